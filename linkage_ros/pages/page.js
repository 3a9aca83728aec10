/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* What the scripts of all pages share: the data, and plots that have the page's own looks. */
'use strict';

const Page = (() => {
  const NARROW = 640;
  const dark = matchMedia('(prefers-color-scheme: dark)');
  const touch = matchMedia('(pointer: coarse)');
  const config = {
    displaylogo: false,
    displayModeBar: 'hover',
    // Named one by one: none of these leads out of the page.
    modeBarButtons: [['zoom2d', 'pan2d', 'zoomIn2d', 'zoomOut2d', 'resetScale2d']],
    plotlyServerURL: '',
    responsive: false,
  };

  function colours(...more) {
    const style = getComputedStyle(document.documentElement);
    const named = (name) => style.getPropertyValue(`--${name}`).trim();
    const names = ['ink', 'paper', 'panel', 'grid', 'rule', 'faint', ...more];
    return Object.fromEntries(names.map((name) => [name, named(name)]));
  }

  /** Return an axis; `title` is one that was escaped. */
  function axis(title, colour, more) {
    return {
      title: { text: title, standoff: 8 },
      automargin: true,
      color: colour.ink,
      gridcolor: colour.grid,
      linecolor: colour.rule,
      zeroline: false,
      showline: true,
      ticks: 'outside',
      tickcolor: colour.rule,
      exponentformat: 'power',
      nticks: 8,
      fixedrange: touch.matches, // a finger that scrolls the page must not zoom
      ...more,
    };
  }

  function layout(width, colour, more) {
    const narrow = width < NARROW;
    return {
      width,
      paper_bgcolor: colour.paper,
      plot_bgcolor: colour.paper,
      font: {
        family: getComputedStyle(document.body).fontFamily,
        size: narrow ? 11 : 13,
        color: colour.ink,
      },
      hoverlabel: {
        align: 'left',
        bgcolor: colour.panel,
        bordercolor: colour.ink,
        font: { color: colour.ink },
      },
      hovermode: 'closest',
      dragmode: touch.matches ? false : 'zoom',
      ...more,
    };
  }

  /** Return a text in which Plotly finds neither markup nor a formula. */
  function escaped(text) {
    return text.replace(/[&<>$]/g, (letter) => `&#${letter.codePointAt(0)};`);
  }

  /** Draw elements now, and anew where their width or the colours change. */
  function keepDrawn(elements, draw) {
    for (const element of elements) {
      draw(element);
      let width = element.clientWidth;
      new ResizeObserver(() => {
        // Print has a width of its own.
        if (element.clientWidth === width || matchMedia('print').matches) return;
        width = element.clientWidth;
        requestAnimationFrame(() => draw(element));
      }).observe(element);
    }
    dark.addEventListener('change', () => elements.forEach(draw));
  }

  const data = JSON.parse(document.getElementById('data').textContent);
  return { NARROW, touch, config, data, colours, axis, layout, escaped, keepDrawn };
})();
