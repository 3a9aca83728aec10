/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* Joints, rates and accelerations over the first input, with a mark where the linkage is. */

const OverInput = (() => {
  const COUNT = 361;
  const SECONDS = { joints: '', rates: '/s', accelerations: '/s²' };
  const ASIDE = 0.05; // of the values at each end do not count for how high a curve is drawn
  const SECOND_AXIS = 58; // pixels
  const WILD = 6; // times the span of the others: values as far as these are beside a toggle
  const [POOR, FAIR] = [Math.PI / 6, Math.PI / 4];
  const QUALITY = { poor: '#d55e00', fair: '#e6b422', good: '#009e73' };

  /** Return the states over the range of the first input, the others held. */
  function states(linkage) {
    const [low, high] = linkage.range();
    const found = [];
    for (let i = 0; i < COUNT; i++) {
      const value = low + ((high - low) * i) / (COUNT - 1);
      found.push([value, linkage.motion([value, ...linkage.inputs.slice(1)])]);
    }
    return found;
  }

  const hasTwoUnits = ({ model }) => new Set(model.joints.map((joint) => joint.unit)).size > 1;

  /** Return the edges of a plot; where joints turn and slide, there is an axis on both sides. */
  function margin(linkage, width) {
    const edges = Looks.margin(width);
    return hasTwoUnits(linkage) ? { ...edges, r: edges.r + SECOND_AXIS } : edges;
  }

  /**
   * Return the range of an axis for the curves on it; undefined leaves it to Plotly.
   *
   * Beside a toggle rates and accelerations have no bound: there the axis ends before they do.
   */
  function within(traces) {
    const sorted = traces.flatMap(({ y }) => y).filter((each) => each !== null).sort((a, b) => a - b);
    const share = (part) => sorted[Math.round(part * (sorted.length - 1))];
    const [low, high] = [share(ASIDE), share(1 - ASIDE)];
    const span = high - low;
    if (!(share(1) - share(0) > WILD * span) || !span) return undefined;
    return [Math.max(share(0), low - span), Math.min(share(1), high + span)];
  }

  class Plot {
    constructor(figure) {
      this.figure = figure;
      this.place = figure.querySelector('.plot');
      this.key = figure.dataset.key;
      this.cursor = document.createElement('div');
      this.cursor.className = 'cursor';
    }

    draw(linkage, found) {
      const width = Math.floor(this.place.clientWidth);
      if (!width) return;
      const ink = Page.colours();
      const { inputs: [input], joints } = linkage.model;
      const across = Angles.shown(input.unit);
      const both = hasTwoUnits(linkage);
      const traces = joints.map((joint, i) => {
        const own = Angles.shown(joint.unit);
        const unit = `${own.unit}${SECONDS[this.key]}`;
        const label = Looks.label(joint.name);
        return {
          type: 'scatter',
          mode: 'lines',
          name: both ? `${label} [${unit}]` : label,
          x: found.map(([value]) => value * across.factor),
          y: found.map(([, state]) => (state[this.key].length ? state[this.key][i] * own.factor : null)),
          yaxis: both && joint.unit === 'm' ? 'y2' : 'y',
          hovertemplate: `<b>${label}</b> %{y:.6~g} ${unit}<br>at %{x:.6~g} ${across.unit}<extra></extra>`,
          line: Looks.line(joint.name, ink.ink),
        };
      });
      const edges = margin(linkage, width);
      const [room, legend] = Looks.legend(joints.map((joint) => joint.name), width);
      const range = [found[0][0], found[found.length - 1][0]].map((value) => value * across.factor);
      const first = Angles.shown(joints.every((joint) => joint.unit === 'm') ? 'm' : 'rad');
      const toggles = (linkage.model.toggles ?? []).map((value) => ({
        type: 'line', x0: value * across.factor, x1: value * across.factor, y0: 0, y1: 1,
        yref: 'paper', line: { color: QUALITY.poor, width: 1, dash: 'dot' },
      }));
      const layout = Page.layout(width, ink, {
        height: 210 + room,
        margin: { ...edges, t: edges.t + room },
        xaxis: Page.axis(`${Looks.label(input.name)} [${across.unit}]`, ink, { range, automargin: false }),
        yaxis: Page.axis(`[${first.unit}${SECONDS[this.key]}]`, ink, {
          automargin: false, range: within(traces.filter(({ yaxis }) => yaxis === 'y')),
        }),
        shapes: toggles,
        ...(both && {
          yaxis2: Page.axis(`[m${SECONDS[this.key]}]`, ink, {
            overlaying: 'y', side: 'right', automargin: false, showgrid: false, tickmode: 'auto',
            range: within(traces.filter(({ yaxis }) => yaxis === 'y2')),
          }),
        }),
        ...legend,
      });
      Plotly.react(this.place, traces, layout, Page.config);
      [this.width, this.edges, this.height, this.range] = [width, layout.margin, layout.height, range];
      this.place.append(this.cursor);
      this.mark(linkage);
    }

    /** Put the line where the linkage is. */
    mark(linkage) {
      if (!this.range) return;
      const { factor } = Angles.shown(linkage.model.inputs[0].unit);
      const [from, to] = this.range;
      let at = linkage.inputs[0] * factor;
      if (linkage.model.inputs[0].unit === 'rad') {
        const turn = Angles.TURN * factor;
        at -= turn * Math.floor((at - from) / turn);
      }
      const share = (at - from) / (to - from || 1);
      const { l, r, t, b } = this.edges;
      this.cursor.hidden = !(share >= 0 && share <= 1);
      this.cursor.style.height = `${this.height - t - b}px`;
      this.cursor.style.top = `${t}px`;
      this.cursor.style.transform = `translateX(${l + share * (this.width - l - r)}px)`;
    }
  }

  /** Paint transmission angle as a band of colours, and the singularity margin as a line. */
  function paintBand(canvas, linkage) {
    const { quality } = linkage.model;
    const [width, tall] = [Math.floor(canvas.parentElement.clientWidth), 46];
    const ratio = window.devicePixelRatio || 1;
    [canvas.width, canvas.height] = [Math.round(width * ratio), tall * ratio];
    canvas.style.height = `${tall}px`;
    const pen = canvas.getContext('2d');
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, tall);
    const { l, r } = margin(linkage, width);
    const known = quality?.input ?? [];
    if (!known.length) return;
    const [from, to] = linkage.range();
    const across = (value) => l + ((value - from) / (to - from || 1)) * (width - l - r);
    const ink = Page.colours();
    pen.lineWidth = 1.5;
    known.forEach((value, i) => {
      const angle = quality.transmission_angle[i];
      if (angle === null || value < from - 1e-9 || value > to + 1e-9) return;
      const step = Math.max(1, (across(to) - across(from)) / known.length + 0.6);
      pen.fillStyle = QUALITY[angle < POOR ? 'poor' : angle < FAIR ? 'fair' : 'good'];
      pen.fillRect(across(value) - step / 2, 6, step, 12);
    });
    pen.beginPath();
    known.forEach((value, i) => {
      const margin = quality.margin[i];
      if (margin !== null && value >= from - 1e-9 && value <= to + 1e-9) {
        pen.lineTo(across(value), 42 - 20 * Math.min(1, margin));
      }
    });
    pen.strokeStyle = ink.ink;
    pen.stroke();
  }

  return { Plot, states, paintBand };
})();
