/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* Draws the diagrams of the page, and draws them anew where its width or its colours change. */
'use strict';

(() => {
  const PALE = 0.3;
  const PARTS = 6; // of a line between whose ends no name should stand
  const PALE_HEX = '4d'; // the same opacity behind a colour #rrggbb
  const NOTHING = {
    text: 'nothing was measured',
    xref: 'paper',
    yref: 'paper',
    x: 0.5,
    y: 0.5,
    showarrow: false,
  };
  const diagrams = Page.data.diagrams;

  function arms(lengths, colour) {
    if (!lengths.length) return { visible: false };
    const [below, above] = lengths;
    return {
      type: 'data',
      symmetric: false,
      array: above,
      arrayminus: below,
      color: colour,
      thickness: 1.2,
      width: 3,
    };
  }

  function inked(colour, own) {
    return own === '#000000' ? colour.ink : own;
  }

  function traces(diagram, colour) {
    const [x, y] = diagram.front;
    const front = { x, y, type: 'scatter', mode: 'lines', hoverinfo: 'skip', cliponaxis: false };
    front.line = { color: colour.faint, width: 1.5, shape: 'hv' };
    return [front].concat(diagram.traces.map((trace) => {
      const own = inked(colour, trace.colour);
      const pale = trace.pale.some(Boolean);
      const arm = pale ? own + PALE_HEX : own;
      return {
        type: 'scatter',
        mode: trace.joined ? 'lines+markers' : 'markers',
        x: trace.x,
        y: trace.y,
        error_x: arms(trace.x_arms, arm),
        error_y: arms(trace.y_arms, arm),
        text: trace.text,
        hovertemplate: '%{text}<extra></extra>',
        line: { color: arm, width: 1.8, dash: trace.dash },
        marker: {
          color: own,
          opacity: trace.pale.map((each) => (each ? PALE : 1)),
          symbol: trace.symbol,
          size: trace.on_edge ? 11 : 8,
          maxdisplayed: 40,
          line: { width: trace.on_edge ? 2 : 0, color: own },
        },
        cliponaxis: false,
      };
    }));
  }

  function axis(shown, colour) {
    const type = shown.logarithmic ? 'log' : 'linear';
    return Page.axis(shown.title, colour, { type, range: shown.range });
  }

  function layout(diagram, width, colour) {
    const narrow = width < Page.NARROW;
    return Page.layout(width, colour, {
      height: narrow ? 420 : 520,
      margin: { l: 56, r: narrow ? 12 : 16, t: 32, b: 56, autoexpand: true },
      showlegend: false,
      xaxis: axis(diagram.x, colour),
      yaxis: axis(diagram.y, colour),
      annotations: diagram.empty ? [NOTHING] : [],
    });
  }

  /** Return the names as annotations, each where it covers least: the best ones are placed first. */
  function names(diagram, place, colour) {
    const { xaxis, yaxis, width } = place._fullLayout;
    const size = width < Page.NARROW ? 9 : 12;
    const measure = document.createElement('canvas').getContext('2d');
    measure.font = `bold ${size}px ${getComputedStyle(document.body).fontFamily}`;
    const at = (x, y) => [xaxis.d2p(x), yaxis.d2p(y)];
    const points = diagram.traces.flatMap((trace) =>
      trace.x.flatMap((x, k) => (x === null ? [] : [at(x, trace.y[k])])));
    const line = ([x0, y0], [x1, y1]) => {
      for (let part = 1; part < PARTS; part += 1) {
        points.push([x0 + (part / PARTS) * (x1 - x0), y0 + (part / PARTS) * (y1 - y0)]);
      }
    };
    for (const trace of diagram.traces.filter((each) => each.joined)) {
      const shown = trace.x.flatMap((x, k) => (x === null ? [] : [at(x, trace.y[k])]));
      shown.slice(1).forEach((point, k) => line(shown[k], point));
    }
    const steps = diagram.front[0].map((x, k) => at(x, diagram.front[1][k]));
    steps.slice(1).forEach(([x, y], k) => {
      line(steps[k], [x, steps[k][1]]);
      line([x, steps[k][1]], [x, y]);
    });
    const boxes = [];
    const cost = ([x, y, w, h]) => {
      const over = (low, high, end) => Math.max(0, -low) + Math.max(0, high - end);
      const outside = over(x - w, x + w, xaxis._length) + over(y - h, y + h, yaxis._length);
      const hidden = points.filter(([px, py]) => Math.abs(px - x) < w && Math.abs(py - y) < h);
      const shared = boxes.map(([bx, by, bw, bh]) =>
        Math.max(0, w + bw - Math.abs(bx - x)) * Math.max(0, h + bh - Math.abs(by - y)));
      return outside * 50 + hidden.length * 40 + shared.reduce((sum, area) => sum + area, 0);
    };
    const ordered = [...diagram.names].sort((one, other) => one.pale - other.pale);
    return ordered.map((name) => {
      const [px, py] = at(name.x, name.y);
      const widths = name.lines.map((line) => measure.measureText(unescaped(line)).width);
      const w = Math.max(...widths) / 2 + 2;
      const h = name.lines.length * size * 0.65 + 1;
      let best = null;
      for (let ring = 0; ring < 8; ring += 1) {
        for (let turn = 0; turn < 16; turn += 1) {
          const way = [Math.cos((turn * Math.PI) / 8), -Math.sin((turn * Math.PI) / 8)];
          const away = 8 + 9 * ring;
          const box = [px + way[0] * (away + w), py + way[1] * (away + h), w, h];
          const value = cost(box) + 12 * ring + 0.1 * turn;
          if (best === null || value < best.value) best = { value, box, ring };
        }
      }
      boxes.push(best.box);
      const own = readable(inked(colour, name.colour));
      return {
        text: name.pale ? name.lines.join('<br>') : `<b>${name.lines.join('<br>')}</b>`,
        x: xaxis.type === 'log' ? Math.log10(name.x) : name.x,
        y: yaxis.type === 'log' ? Math.log10(name.y) : name.y,
        ax: best.box[0] - px,
        ay: best.box[1] - py,
        showarrow: true,
        arrowhead: 0,
        arrowwidth: 0.7,
        arrowcolor: best.ring > 1 ? own : 'rgba(0,0,0,0)',
        standoff: 5,
        font: { size, color: own },
        opacity: name.pale ? 0.75 : 1,
        captureevents: false,
      };
    });
  }

  /** Return a colour for letters: lighter in the dark. */
  function readable(own) {
    if (!matchMedia('(prefers-color-scheme: dark)').matches || own.length !== 7) return own;
    const parts = [1, 3, 5].map((at) => parseInt(own.slice(at, at + 2), 16));
    return `rgb(${parts.map((part) => Math.round(part + 0.45 * (255 - part))).join(',')})`;
  }

  function unescaped(text) {
    return text.replace(/&#(\d+);/g, (_, code) => String.fromCodePoint(Number(code)));
  }

  function draw(figure) {
    const diagram = diagrams[figure.dataset.diagram];
    figure.classList.add('drawn');
    const place = figure.querySelector('.plot');
    const width = Math.floor(place.clientWidth);
    if (!width) return;
    const colour = Page.colours();
    const shown = layout(diagram, width, colour);
    Plotly.react(place, traces(diagram, colour), shown, Page.config);
    if (diagram.names.length) Plotly.relayout(place, { annotations: names(diagram, place, colour) });
  }

  Page.keepDrawn([...document.querySelectorAll('figure[data-diagram]')], draw);
})();
