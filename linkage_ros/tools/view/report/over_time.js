/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* Plots over the time of the run: curves, and events in a row for each kind. */

const OverTime = (() => {
  const ROW = 32; // pixels: height of a kind of events, with its name in two lines
  const NAMED_ROW = 40; // of a bar with its name above it
  const MOST_ROWS = 6; // of one kind; names of bars for which there is no row are left out
  const GUTTER = 16; // letters of a line in the gutter, at most if its words are short
  const HEIGHT = 210;
  const PANELS = 340; // height of two, one below the other
  const APART = 2; // pixels: what is closer on a lane is drawn as one
  const EVERY = 12; // pixels: so near to each other a span tells what it is
  const DURATIONS = /^(lateness|age)$/;
  const { data } = Page;
  const groups = data.curves.map((said) => new Curves.Group(said));

  // Joints have the same colours in all plots.
  for (const plot of data.plots) {
    if (!DURATIONS.test(plot.key)) Looks.order(plot.curves.map((each) => each.name));
  }

  /** Return a name in two lines, for the gutter. */
  function folded(name) {
    if (name.length <= GUTTER) return [name];
    const middle = Math.ceil(name.length / 2);
    const before = name.lastIndexOf(' ', middle);
    const after = name.indexOf(' ', middle);
    const at = after < 0 || middle - before <= after - middle ? before : after;
    return at < 0 ? [name] : [name.slice(0, at), name.slice(at + 1)];
  }

  const letters = Math.max(0, ...data.lanes.flatMap(({ title }) => folded(title)
    .map((line) => line.length)));

  const gutterFont = (width) => (Looks.isNarrow(width) ? 10 : 11.5);

  /** Return the margins; names of rows have a gutter of their own, on the left. */
  function margin(width, isEvents = false) {
    const edges = Looks.margin(width);
    const gutter = 14 + (letters * Looks.LETTER * gutterFont(width)) / 12;
    // One time lies above the other, if there is the width for it.
    if (Looks.isNarrow(width) && !isEvents) return edges;
    return { ...edges, l: Math.max(edges.l, Math.ceil(gutter)) };
  }

  /** Return how angles are recorded and shown; nothing for a plot of other numbers. */
  function angleOf(plot) {
    if (plot.key !== 'positions_rad') return undefined;
    return { recorded: data.units.wrapped, wrapped: Angles.chosen.wrapped };
  }

  /** Return which curves run on while others swing: on one scale these would be flat. */
  function running(plot) {
    const angle = angleOf(plot);
    if (!angle || angle.wrapped) return [];
    const turning = plot.curves.map(
      (each) => groups[each.of].span(each.column, angle.recorded) > 2 * Angles.TURN,
    );
    return turning.includes(false) ? turning : [];
  }

  function texts(part, unit, factor) {
    const { shown, when } = Looks;
    return part.told.map((told, k) => {
      if (!told) return `${when(part.x[k])}<br>${shown((part.y[k] ?? NaN) * factor)} ${unit}`;
      const [one, other, begin, end] = told;
      const [low, high] = [Math.min(one, other) * factor, Math.max(one, other) * factor];
      return `${when(begin)} to ${when(end)}<br>${shown(low)} to ${shown(high)} ${unit}`;
    });
  }

  /** Return traces and layout of curves. */
  function curves(plot, width, ink, view) {
    const most = Math.max(200, Math.min(1500, width));
    const above = running(plot);
    const panels = above.includes(true);
    const { unit: shownUnit, factor } = Angles.shown(plot.unit);
    const unit = Page.escaped(shownUnit);
    const named = !DURATIONS.test(plot.key);
    const traces = plot.curves.map((each, i) => {
      const part = groups[each.of].part(each.column, ...view, most, angleOf(plot));
      const name = Looks.label(each.name);
      const line = named ? Looks.line(each.name, ink.ink) : { color: ink.faint, simplify: false };
      return {
        type: 'scatter',
        mode: part.x.length < width / 8 ? 'lines+markers' : 'lines',
        name,
        x: part.x,
        y: part.y.map((value) => (value === null ? null : value * factor)),
        yaxis: above[i] ? 'y2' : 'y',
        text: texts(part, unit, factor),
        rows: part.rows,
        hovertemplate: `<b>${name}</b><br>%{text}<extra></extra>`,
        line: { ...line, width: 1.5 },
        marker: { size: 4, color: line.color },
        connectgaps: false,
      };
    });
    const [room, legend] = Looks.legend(plot.curves.map((each) => each.name), width);
    const edges = margin(width);
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

  /** Return the spans of a lane within a view; those that look like one as one, unless `named`. */
  function seen(spans, view, near, named) {
    const found = [];
    for (const [begin, end, count, text] of spans) {
      if (end < view[0] || begin > view[1]) continue;
      const last = found[found.length - 1];
      if (last && begin - last.end < near && (!named || text === last.text)) {
        last.end = Math.max(last.end, end);
        last.count += count;
        if (text !== last.text && !last.more) last.more = ', and others';
      } else found.push({ begin, end, count, text, more: '' });
    }
    return found;
  }

  function told(name, { begin, end, count, text, more }) {
    const { duration, when } = Looks;
    const span = end > begin
      ? `${when(begin)} to ${when(end)} (${duration(end - begin)})` : when(begin);
    const many = count > 1 ? `, ${count.toLocaleString('en')}` : '';
    return `<b>${name}</b>${many}<br>${span}<br>${Page.escaped(text)}${more}`;
  }

  /** Return a fault's name without its kind. */
  const faultName = (text) => text.replace(/ \([^()]*\)$/, '');

  /**
   * Give each span a row in which neither its bar nor its name meets another's.
   *
   * Adds `row` and, if there is room for it, `name` and the side of the bar where it begins. Returns
   * the number of rows.
   */
  function arrange(spans, view, pixel) {
    const ends = []; // of each row, as a time
    for (const span of spans) {
      const name = Looks.short(faultName(span.text));
      const width = (6 + Looks.LETTER * name.length) * pixel;
      const [left, right] = [Math.max(span.begin, view[0]), Math.min(span.end, view[1])];
      const isRight = left + width > view[1];
      const from = isRight ? Math.min(left, right - width) : left;
      let row = ends.findIndex((end) => end <= from);
      if (row < 0 && ends.length < MOST_ROWS) row = ends.push(0) - 1;
      if (row < 0) span.row = MOST_ROWS - 1;
      else Object.assign(span, { row, name, isRight });
      ends[span.row] = Math.max(ends[span.row], right, isRight ? right : left + width);
    }
    return Math.max(1, ends.length);
  }

  /** Return traces and layout of events, a row for each kind, and more for faults that overlap. */
  function events(_plot, width, ink, view) {
    const names = data.lanes.map((lane) => Page.escaped(lane.title));
    const edges = margin(width, true);
    const pixel = (view[1] - view[0]) / (width - edges.l - edges.r);
    const within = { x: [], y: [], text: [] };
    const put = (trace, x, y, text) => {
      trace.x.push(x);
      trace.y.push(y);
      trace.text.push(text);
    };
    const annotations = [];
    const tickvals = [];
    let top = 0; // in pixels below the upper edge
    const traces = data.lanes.map((lane, i) => {
      const trace = { x: [], y: [], text: [] };
      const isNamed = lane.key === 'fault';
      const spans = seen(lane.spans, view, APART * pixel, isNamed);
      const rows = isNamed ? arrange(spans, view, pixel) : 1;
      const high = isNamed ? NAMED_ROW : ROW;
      for (const span of spans) {
        const text = told(names[i], span);
        const y = top + high * (span.row ?? 0) + (isNamed ? 0.68 : 0.5) * high;
        const [left, right] = [Math.max(span.begin, view[0]), Math.min(span.end, view[1])];
        put(trace, span.begin, y, text);
        if (span.end > span.begin) put(trace, span.end, y, text);
        put(trace, null, null, '');
        for (let x = left + EVERY * pixel; x < right; x += EVERY * pixel) put(within, x, y, text);
        if (span.name) {
          annotations.push({
            text: Page.escaped(span.name) + (span.more && ' …'), x: span.isRight ? right : left,
            xanchor: span.isRight ? 'right' : 'left', y, yanchor: 'bottom', yshift: 8,
            showarrow: false, borderpad: 0, font: { size: 12, color: ink.ink },
          });
        }
      }
      tickvals.push(top + (isNamed ? 0.68 : 0.5) * high);
      top += rows * high;
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
    // Not only the ends of a span say what it is.
    traces.push({
      ...within, type: 'scatter', mode: 'markers', marker: { size: 8, opacity: 0 },
      hoverlabel: { bordercolor: ink.ink }, hovertemplate: '%{text}<extra></extra>',
    });
    return [traces, {
      height: edges.t + edges.b + top,
      margin: edges,
      annotations,
      xaxis: Looks.timeAxis(ink, view),
      yaxis: Page.axis('', ink, {
        range: [top, 0], tickmode: 'array', tickvals, ticks: '', automargin: false,
        ticktext: data.lanes.map(({ title }) => folded(title).map(Page.escaped).join('<br>')),
        tickfont: { size: gutterFont(width) }, fixedrange: true,
      }),
      showlegend: false,
    }];
  }

  return { curves, events };
})();
