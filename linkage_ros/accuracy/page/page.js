/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* Draws the diagrams of the page, and draws them anew where its width or its colours change. */
'use strict';

(() => {
  const LEGEND_LINE = { narrow: 19.5, wide: 22 };
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

  function traces(diagram, colour) {
    return diagram.traces.map((trace) => {
      const own = trace.colour === '#000000' ? colour.ink : trace.colour;
      return {
        type: 'scatter',
        mode: trace.joined ? 'lines+markers' : 'markers',
        name: trace.name,
        legendgroup: trace.name,
        showlegend: trace.in_legend,
        x: trace.x,
        y: trace.y,
        error_x: arms(trace.x_arms, own),
        error_y: arms(trace.y_arms, own),
        text: trace.text,
        hovertemplate: '%{text}<extra></extra>',
        line: { color: own, width: 1.8, dash: trace.dash },
        marker: {
          color: own,
          symbol: trace.symbol,
          size: trace.on_edge ? 11 : 8,
          maxdisplayed: 40,
          line: { width: trace.on_edge ? 2 : 0, color: own },
        },
        cliponaxis: false,
      };
    });
  }

  function axis(shown, colour) {
    const type = shown.logarithmic ? 'log' : 'linear';
    return Page.axis(shown.title, colour, { type, range: shown.range });
  }

  function legendLines(diagram) {
    const named = diagram.traces.filter((trace) => trace.in_legend);
    return named.reduce((sum, trace) => sum + trace.name.split('<br>').length, 0);
  }

  function layout(diagram, width, colour) {
    const narrow = width < Page.NARROW;
    const lines = legendLines(diagram) * (narrow ? LEGEND_LINE.narrow : LEGEND_LINE.wide);
    const bottom = narrow ? 72 + lines : 56;
    const height = narrow ? 320 + bottom : Math.max(440, lines + 32 + bottom);
    const legend = narrow
      ? { x: 0, xanchor: 'left', y: 0, yref: 'container', yanchor: 'bottom' }
      : { x: 1.02, xanchor: 'left', y: 1, yanchor: 'top' };
    return Page.layout(width, colour, {
      height,
      margin: { l: 56, r: narrow ? 12 : 16, t: 32, b: bottom, autoexpand: true },
      showlegend: true,
      legend: { ...legend, font: { size: narrow ? 11 : 12 }, itemwidth: 30, tracegroupgap: 0 },
      xaxis: axis(diagram.x, colour),
      yaxis: axis(diagram.y, colour),
      annotations: diagram.empty ? [NOTHING] : [],
    });
  }

  function draw(figure) {
    const diagram = diagrams[figure.dataset.diagram];
    figure.classList.add('drawn');
    const place = figure.querySelector('.plot');
    const width = Math.floor(place.clientWidth);
    if (!width) return;
    const colour = Page.colours();
    Plotly.react(place, traces(diagram, colour), layout(diagram, width, colour), Page.config);
  }

  Page.keepDrawn([...document.querySelectorAll('figure[data-diagram]')], draw);
})();
