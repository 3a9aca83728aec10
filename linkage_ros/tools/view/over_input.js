/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* Joints, rates and accelerations over the first input, with a mark where the linkage is. */

const OverInput = (() => {
  const COUNT = 361;
  const SECONDS = { joints: '', rates: '/s', accelerations: '/s²' };
  const ASIDE = 0.05; // of the values at each end do not count for how high a curve is drawn
  const EDGE = 0.08; // of the span
  const SECOND_AXIS = 58; // pixels
  const WILD = 6; // times the span of the others: values as far as these are next to a toggle
  const [POOR, FAIR] = [Math.PI / 6, Math.PI / 4];
  const ORDER = { joints: 0, rates: 1, accelerations: 2 };
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

  /** Return where the first input is between two values, from 0 to 1; an angle less its turns. */
  function share(linkage, from, to) {
    let [at] = linkage.inputs;
    if (linkage.model.inputs[0].unit === 'rad') {
      at -= Angles.TURN * Math.floor((at - from) / Angles.TURN);
    }
    return (at - from) / (to - from || 1);
  }

  const hasTwoUnits = ({ model }) => new Set(model.joints.map((joint) => joint.unit)).size > 1;

  /** Return the edges of a plot; where joints turn and slide, there is an axis on both sides. */
  function edgesOf(linkage, width) {
    const edges = Looks.margin(width);
    return hasTwoUnits(linkage) ? { ...edges, r: edges.r + SECOND_AXIS } : edges;
  }

  /**
   * Return the range of an axis for the curves on it; undefined leaves it to Plotly.
   *
   * Next to a toggle rates and accelerations have no bound: there the axis ends before they do.
   */
  function within(traces) {
    const sorted = traces.flatMap(({ y }) => y).filter((each) => each !== null).sort((a, b) => a - b);
    const part = (number) => sorted[Math.round(number * (sorted.length - 1))];
    const [low, high] = [part(ASIDE), part(1 - ASIDE)];
    const span = high - low;
    if (!(part(1) - part(0) > WILD * span) || !span) return undefined;
    const edge = EDGE * span;
    return [Math.max(part(0) - edge, low - span), Math.min(part(1) + edge, high + span)];
  }

  /**
   * Return angles without leaps of whole turns, which are not motion; null where there is none.
   *
   * The one numbered `at` is within half a turn of `now`, where the linkage is.
   */
  function unwrapped(angles, at, now) {
    let before = null;
    const found = angles.map((angle) => {
      if (angle !== null) before = near(angle, before ?? angle);
      return angle === null ? null : before;
    });
    const moved = found[at] === null ? 0 : near(found[at], now) - found[at];
    return found.map((angle) => (angle === null ? null : angle + moved));
  }

  /** Return an angle with as many whole turns more or less as bring it nearest to another. */
  const near = (angle, other) => angle - Angles.TURN * Math.round((angle - other) / Angles.TURN);

  /** Return what the traced points go through in the states, x and y in turn. */
  function paths(linkage, found) {
    const there = linkage.now;
    const made = Object.fromEntries(linkage.drawn.traced.map(({ point, link, at }) => {
      const closed = found.filter(([, state]) => state.frames.length);
      return [point, closed.flatMap(([, state]) => {
        linkage.now = state;
        return linkage.place(link, ...at).slice(0, 2);
      })];
    }));
    linkage.now = there;
    return made;
  }

  class Plot {
    /** `rate` returns the rate of the first input, in [rad/s] or [m/s]. */
    constructor(figure, rate) {
      this.rate = rate;
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
          y: this.values(linkage, found, i).map((value) => (value === null ? null : value * own.factor)),
          yaxis: both && joint.unit === 'm' ? 'y2' : 'y',
          hovertemplate: `<b>${label}</b> %{y:.6~g} ${unit}<br>at %{x:.6~g} ${across.unit}<extra></extra>`,
          line: Looks.line(joint.name, ink.ink),
        };
      });
      const edges = edgesOf(linkage, width);
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
          yaxis2: Page.axis(`[${Angles.shown('m').unit}${SECONDS[this.key]}]`, ink, {
            overlaying: 'y', side: 'right', automargin: false, showgrid: false, tickmode: 'auto',
            range: within(traces.filter(({ yaxis }) => yaxis === 'y2')),
          }),
        }),
        ...legend,
      });
      Plotly.react(this.place, traces, layout, Page.config);
      [this.width, this.edges, this.height] = [width, layout.margin, layout.height];
      this.ends = [found[0][0], found[found.length - 1][0]];
      this.place.append(this.cursor);
      this.mark(linkage);
    }

    /** Return the values of a joint in its unit, null where the loops do not close. */
    values(linkage, found, i) {
      const times = this.rate() ** ORDER[this.key];
      const values = found.map(([, state]) => (i in state[this.key] ? times * state[this.key][i] : null));
      const turns = this.key === 'joints' && linkage.model.joints[i].unit === 'rad';
      if (!turns || !linkage.closed) return values;
      const at = Math.round(share(linkage, found[0][0], found[COUNT - 1][0]) * (COUNT - 1));
      return unwrapped(values, Math.min(Math.max(at, 0), COUNT - 1), linkage.now.joints[i]);
    }

    /** Put the line where the linkage is. */
    mark(linkage) {
      if (!this.ends) return;
      const across = share(linkage, ...this.ends);
      const { l, r, t, b } = this.edges;
      this.cursor.hidden = !(across >= 0 && across <= 1);
      this.cursor.style.height = `${this.height - t - b}px`;
      this.cursor.style.top = `${t}px`;
      this.cursor.style.transform = `translateX(${l + across * (this.width - l - r)}px)`;
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
    const { l, r } = edgesOf(linkage, width);
    const [from, to] = linkage.range();
    const known = (quality?.input ?? []).map((value, i) => (
      { value, angle: quality.transmission_angle[i], margin: quality.margin[i] }))
      .filter(({ value }) => value > from - 1e-9 && value < to + 1e-9);
    const across = (value) => l + ((value - from) / (to - from || 1)) * (width - l - r);
    const ink = Page.colours();
    pen.lineWidth = 1.5;
    known.forEach(({ value, angle }, i) => {
      if (angle === null) return;
      // Halfway to the one before, and to the one after; a pixel's share leaves no gap.
      const left = across((value + (known[i - 1]?.value ?? value)) / 2);
      const right = across((value + (known[i + 1]?.value ?? value)) / 2) + 0.5;
      pen.fillStyle = QUALITY[angle < POOR ? 'poor' : angle < FAIR ? 'fair' : 'good'];
      pen.fillRect(left, 6, right - left, 12);
    });
    pen.beginPath();
    for (const { value, margin } of known) {
      if (margin !== null) pen.lineTo(across(value), 42 - 20 * Math.min(1, margin));
    }
    pen.strokeStyle = ink.ink;
    pen.stroke();
  }

  return { Plot, paths, states, paintBand };
})();
