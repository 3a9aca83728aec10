/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* What the scripts of all pages share: the data, and plots that have the page's own looks. */
'use strict';

const Page = (() => {
  const NARROW = 640;
  // Where a letter is typed, it is not a command.
  const TYPED = 'select, textarea, input:not([type=checkbox], [type=range])';
  const dark = matchMedia('(prefers-color-scheme: dark)');
  const paper = matchMedia('print');
  // The rules for dark colours; the switch changes the condition under which they hold.
  const darkRules = [...document.styleSheets].flatMap((sheet) => [...sheet.cssRules])
    .filter((rule) => rule.conditionText === dark.media);
  const redraws = [];
  let chosen = ''; // light or dark; empty: as the system is set
  const touch = matchMedia('(pointer: coarse)');
  const config = {
    displaylogo: false,
    displayModeBar: 'hover',
    // Named one by one: none of these leads out of the page.
    modeBarButtons: [['zoom2d', 'pan2d', 'zoomIn2d', 'zoomOut2d', 'resetScale2d']],
    plotlyServerURL: '',
    responsive: false,
  };

  const prefersDark = () => (chosen ? chosen === 'dark' : dark.matches);
  const isDark = () => prefersDark() && !paper.matches;

  /** Show the page in the colours 'light' or 'dark', whatever the system is set to. */
  function setScheme(scheme) {
    chosen = scheme;
    document.documentElement.style.colorScheme = scheme;
    for (const rule of darkRules) rule.media.mediaText = scheme === 'dark' ? 'screen' : 'not all';
    redraw();
  }

  function redraw() {
    const other = prefersDark() ? 'Light' : 'Dark';
    switched.textContent = prefersDark() ? '☀' : '☾';
    switched.title = `${other} colours (L)`;
    switched.setAttribute('aria-label', `${other} colours`);
    redraws.forEach((draw) => draw());
  }

  const switchScheme = () => setScheme(prefersDark() ? 'light' : 'dark');

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

  /** Return a text in which Plotly finds no markup, no formula and no place for a number. */
  function escaped(text) {
    return text.replace(/[%&<>$]/g, (letter) => `&#${letter.codePointAt(0)};`);
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
    redraws.push(() => elements.forEach(draw));
  }

  const data = JSON.parse(document.getElementById('data').textContent);
  const switched = document.getElementById('scheme');
  switched.hidden = false;
  switched.addEventListener('click', switchScheme);
  document.addEventListener('keydown', ({ key, target, altKey, ctrlKey, metaKey }) => {
    if (altKey || ctrlKey || metaKey || target.closest(TYPED)) return;
    if (key.toLowerCase() === 'l') switchScheme();
  });
  dark.addEventListener('change', redraw);
  redraw();
  return {
    NARROW, touch, paper, config, data, isDark, colours, axis, layout, escaped, keepDrawn,
  };
})();
