/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* Plots over other things than time: joints over the crank, and histograms of durations. */

const OverOthers = (() => {
  const MOST = 3000; // places of a curve over the crank
  const { TURN } = Angles;
  const ALL_BUT_A_TURN = 0.95 * TURN;

  function reach(values, first, last) {
    let [low, high] = [Infinity, -Infinity];
    for (let i = first; i < last; i++) {
      if (values[i] < low) low = values[i];
      if (values[i] > high) high = values[i];
    }
    return high - low;
  }

  /** Return traces and layout of a linkage's joints over its first input. */
  function crossed(plot, width, ink, view) {
    const { shown, when } = Looks;
    const linkage = Report.linkages[Number(plot.key.split('_')[1])];
    const [input, unit] = [linkage.inputs[0], linkage.input_units[0]];
    const { times, values } = Report.frames;
    const crank = values[input];
    const first = Curves.above(times, view[0] - 1e-9);
    const last = Curves.above(times, view[1]);
    const step = Math.max(1, Math.ceil((last - first) / MOST));
    const turns = unit === 'rad' && reach(crank, first, last) > ALL_BUT_A_TURN;
    const joints = linkage.joints.map((name, i) => [name, linkage.units[i]])
      .filter(([name]) => name !== input);
    const crankUnit = Angles.shown(unit);
    const both = new Set(joints.map(([, each]) => each)).size > 1;
    const name = Looks.label(input);
    const traces = joints.map(([joint, own]) => {
      const runs = own === 'rad' && reach(values[joint], first, last) > TURN;
      const ownUnit = Angles.shown(own);
      const [x, y, text] = [[], [], []];
      for (let i = first; i < last; i += step) {
        const value = values[joint][i];
        if (!Number.isFinite(crank[i]) || !Number.isFinite(value)) continue;
        const at = turns ? crank[i] - TURN * Math.floor(crank[i] / TURN) : crank[i];
        x.push(at * crankUnit.factor);
        y.push((runs ? Angles.wrap(value) : value) * ownUnit.factor);
        text.push(`${when(times[i])}<br>${name} ${shown(crank[i] * crankUnit.factor)} `
          + `${crankUnit.unit}<br>${shown(value * ownUnit.factor)} ${ownUnit.unit}`);
      }
      const label = Looks.label(joint);
      return {
        type: 'scatter',
        mode: 'markers',
        name: both ? `${label} [${ownUnit.unit}]` : label,
        x, y, text,
        yaxis: both && own === 'm' ? 'y2' : 'y',
        hovertemplate: `<b>${label}</b><br>%{text}<extra></extra>`,
        marker: { color: Looks.line(joint, ink.ink).color, size: 3.5 },
      };
    });
    const names = joints.map(([joint]) => (both ? `${joint} [rad]` : joint));
    const [room, legend] = Looks.legend(names, width);
    const edges = Looks.margin(width);
    const turn = TURN * crankUnit.factor;
    const whole = turns ? { range: [0, turn], tickmode: 'array',
      tickvals: [0, 0.25, 0.5, 0.75, 1].map((k) => k * turn),
      ticktext: Angles.chosen.degrees ? ['0', '90', '180', '270', '360']
        : ['0', 'π/2', 'π', '3π/2', '2π'] } : {};
    const side = (own, more) => Page.axis(`[${Angles.shown(own).unit}]`, ink, { automargin: false, ...more });
    const other = { overlaying: 'y', side: 'right', showgrid: false, tickmode: 'auto' };
    const title = `${name} [${crankUnit.unit}]${turns ? ', within a turn' : ''}`;
    return [traces, {
      height: 260 + edges.t + edges.b + room,
      margin: { ...edges, t: edges.t + room, r: both ? edges.l : edges.r + 8 },
      xaxis: Page.axis(title, ink, { automargin: false, ...whole }),
      yaxis: side(both || joints.some(([, own]) => own === 'rad') ? 'rad' : 'm'),
      ...(both ? { yaxis2: side('m', other) } : {}),
      ...legend,
    }];
  }

  /** Return places and texts of the marks of a logarithmic axis of durations. */
  function marks(low, high) {
    const few = high - low < 1.8;
    const found = [];
    for (let power = Math.floor(low); power <= high; power++) {
      for (const k of few ? [1, 2, 5] : [1]) {
        const at = power + Math.log10(k);
        if (at >= low && at <= high) found.push([at, Looks.duration(k * 10 ** power)]);
      }
    }
    return { tickvals: found.map(([at]) => at), ticktext: found.map(([, text]) => text) };
  }

  /** Return traces and layout of how durations are spread. */
  function spread(plot, width, ink) {
    const { duration } = Looks;
    const { counts, edges: bins } = Page.data.histograms[plot.key.split('_')[1]];
    const least = bins.find((edge) => edge > 0) / 10 ** 0.1;
    const place = (edge) => Math.log10(Math.max(edge, least));
    const [low, high] = [place(bins[0]) - 0.05, place(bins[bins.length - 1]) + 0.05];
    const edges = Looks.margin(width);
    return [[{
      type: 'bar',
      x: counts.map((_, i) => (place(bins[i]) + place(bins[i + 1])) / 2),
      y: counts,
      width: counts.map((_, i) => Math.max(place(bins[i + 1]) - place(bins[i]), 0.01)),
      marker: { color: ink.faint, line: { width: 0.5, color: ink.paper } },
      text: counts.map((count, i) => `${duration(bins[i])} to ${duration(bins[i + 1])}`
        + `<br>${count.toLocaleString('en')} tick${count === 1 ? '' : 's'}`),
      textposition: 'none',
      hovertemplate: '%{text}<extra></extra>',
    }], {
      height: 200 + edges.b,
      margin: { ...edges, b: 32 },
      xaxis: Page.axis('', ink, {
        tickmode: 'array', ...marks(low, high), automargin: false, range: [low, high],
      }),
      // Few ticks are late, and these matter.
      yaxis: Page.axis('ticks', ink, { type: 'log', dtick: 1, automargin: false,
        range: [Math.log10(0.7), Math.log10(2 * Math.max(...counts))] }),
      bargap: 0,
    }];
  }

  return { crossed, spread };
})();
