/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* What is plotted over the time of the run: curves, and what happened. */

const OverTime = (() => {
  const LANE = 36;
  const HEIGHT = 210;
  const PANELS = 340; // height of two, one below the other
  const APART = 2; // pixels: what is closer on a lane is drawn as one
  const EVERY = 12; // pixels: so near to each other a span tells what it is
  const TURN = 2 * Math.PI;
  const { data } = Page;
  const groups = data.curves.map((said) => new Curves.Group(said));
  const wrapsIn = (plot) => data.wrapped && plot.key === 'positions_rad';

  /** Return which curves run on while others swing: on one scale these would be flat. */
  function running(plot) {
    if (plot.key !== 'positions_rad') return [];
    plot.running ??= plot.curves.map((each) => groups[each.of].span(each.column) > 2 * TURN);
    return plot.running.includes(false) ? plot.running : [];
  }

  function texts(part, unit) {
    const { shown, when } = Looks;
    return part.told.map((told, k) => {
      if (!told) return `${when(part.x[k])}<br>${shown(part.y[k] ?? NaN)} ${unit}`;
      const [one, other, begin, end] = told;
      const [low, high] = [Math.min(one, other), Math.max(one, other)];
      return `${when(begin)} to ${when(end)}<br>${shown(low)} to ${shown(high)} ${unit}`;
    });
  }

  /** Return traces and layout of curves. */
  function curves(plot, width, ink, view) {
    const most = Math.max(200, Math.min(1500, width));
    const above = running(plot);
    const panels = above.includes(true);
    const unit = Page.escaped(plot.unit);
    const named = !Looks.DURATIONS.test(plot.key);
    const traces = plot.curves.map((each, i) => {
      const part = groups[each.of].part(each.column, ...view, most, wrapsIn(plot));
      const name = Looks.label(each.name);
      const line = named ? Looks.line(each.name, ink.ink) : { color: ink.faint };
      return {
        type: 'scatter',
        mode: part.x.length < width / 8 ? 'lines+markers' : 'lines',
        name,
        x: part.x,
        y: part.y,
        yaxis: above[i] ? 'y2' : 'y',
        text: texts(part, unit),
        rows: part.rows,
        hovertemplate: `<b>${name}</b><br>%{text}<extra></extra>`,
        line: { ...line, width: 1.5, simplify: false },
        marker: { size: 4, color: line.color },
        connectgaps: false,
      };
    });
    const [room, legend] = Looks.legend(plot.curves.map((each) => each.name), width);
    const edges = Looks.margin(width);
    const top = edges.t + (named ? room : 0);
    const side = (more) => Page.axis(`[${unit}]`, ink, { fixedrange: true, ...more });
    return [traces, {
      height: (panels ? PANELS : HEIGHT) + top + edges.b,
      margin: { ...edges, t: top },
      xaxis: Looks.timeAxis(ink, view),
      yaxis: side(panels ? { domain: [0, 0.47] } : {}),
      ...(panels ? { yaxis2: side({ domain: [0.53, 1] }) } : {}),
      ...(named ? legend : { showlegend: false }),
    }];
  }

  /** Return the spans of a lane within a view, with those as one that are drawn as one. */
  function seen(spans, view, near) {
    const found = [];
    for (const [begin, end, count, text] of spans) {
      if (end < view[0] || begin > view[1]) continue;
      const last = found[found.length - 1];
      if (last && begin - last.end < near) {
        last.end = Math.max(last.end, end);
        last.count += count;
        if (text !== last.text && !last.more) last.more = ', and others';
      } else found.push({ begin, end, count, text, more: '' });
    }
    return found;
  }

  function told(name, { begin, end, count, text, more }) {
    const { when } = Looks;
    const span = end > begin ? `${when(begin)} to ${when(end)}` : when(begin);
    const many = count > 1 ? `, ${count.toLocaleString('en')}` : '';
    return `<b>${name}</b>${many}<br>${span}<br>${Page.escaped(text)}${more}`;
  }

  /** Return traces and layout of what happened, a lane for each kind. */
  function events(_plot, width, ink, view) {
    const names = data.lanes.map((lane) => Page.escaped(lane.title));
    const pixel = (view[1] - view[0]) / width;
    const within = { x: [], y: [], text: [] };
    const put = (trace, x, y, text) => {
      trace.x.push(x);
      trace.y.push(y);
      trace.text.push(text);
    };
    const traces = data.lanes.map((lane, i) => {
      const trace = { x: [], y: [], text: [] };
      for (const span of seen(lane.spans, view, APART * pixel)) {
        const text = told(names[i], span);
        put(trace, span.begin, i, text);
        if (span.end > span.begin) put(trace, span.end, i, text);
        put(trace, null, null, '');
        const to = Math.min(span.end, view[1]);
        let x = Math.max(span.begin, view[0]);
        for (x += EVERY * pixel; x < to; x += EVERY * pixel) put(within, x, i, text);
      }
      const color = Looks.colour(i, ink.ink);
      return {
        ...trace,
        type: 'scatter',
        mode: 'lines+markers',
        name: names[i],
        line: { color, width: 9, simplify: false },
        marker: { symbol: 'line-ns', size: 14, line: { width: 2, color } },
        hovertemplate: '%{text}<extra></extra>',
      };
    });
    // Not only the ends of a span tell what it is.
    traces.push({
      ...within, type: 'scatter', mode: 'markers', marker: { size: 8, opacity: 0 },
      hoverlabel: { bordercolor: ink.ink }, hovertemplate: '%{text}<extra></extra>',
    });
    const edges = Looks.margin(width);
    const count = data.lanes.length;
    // Within the plot, so that its time stands above that of the others.
    const annotations = names.map((text, i) => ({
      text, x: 0, xref: 'paper', xanchor: 'left', y: i - 0.22, yref: 'y', yanchor: 'bottom',
      showarrow: false, font: { size: 12, color: ink.ink }, xshift: 3, borderpad: 0,
    }));
    return [traces, {
      height: edges.t + edges.b + LANE * (count + 0.5),
      margin: edges,
      annotations,
      xaxis: Looks.timeAxis(ink, view),
      yaxis: Page.axis('', ink, {
        range: [count - 0.3, -0.8], tickvals: [], automargin: false, fixedrange: true,
      }),
      showlegend: false,
    }];
  }

  return { curves, events };
})();
