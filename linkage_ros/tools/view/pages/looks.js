/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* What all pictures and plots share: colours, margins, axes, legends, and numbers as text. */

const Looks = (() => {
  const MARGIN = { l: 66, r: 14, t: 12, b: 50 };
  const NARROW_MARGIN = { l: 54, r: 8, t: 10, b: 44 };
  const LEGEND_ROW = 22;
  const BUTTONS = { width: 140, height: 30 }; // of a plot, in its upper right corner
  const LETTER = 6.6; // pixels: mean width at 12 pixels
  const LONGEST = 36; // letters of a name in a plot; the tables have all of them
  const DASHES = ['solid', 'dash', 'dot', 'dashdot'];
  // Of the same hue, and bright enough for dark paper.
  const ON_DARK = {
    '#0072B2': '#4ba6e3',
    '#D55E00': '#f58b43',
    '#009E73': '#2fc49b',
    '#56B4E9': '#a6dbfa',
  };
  const { data } = Page;
  const places = new Map();

  /** Give each name a colour of its own, in this order. */
  function order(names) {
    for (const name of names) if (!places.has(name)) places.set(name, places.size);
  }

  const isNarrow = (width) => width < Page.NARROW;
  const margin = (width) => (isNarrow(width) ? NARROW_MARGIN : MARGIN);
  const shown = (number) => Number(number.toPrecision(9)).toString();
  const when = (time) => `${time.toFixed(6)} s`;

  /** Return the colour of that number; the ink's for the last. */
  function colour(i, ink) {
    const own = data.colours[i % data.colours.length];
    if (own === '#000000') return ink;
    return Page.isDark() ? ON_DARK[own] ?? own : own;
  }

  /** Return colour and dashes of a joint, the same in all plots; the first has the ink's. */
  function line(name, ink) {
    const { length } = data.colours;
    const i = places.get(name) ?? 0;
    return {
      color: colour((i + length - 1) % length, ink),
      dash: DASHES[Math.floor(i / length) % DASHES.length],
      simplify: false, // else Plotly leaves out points, and a curve has corners
    };
  }

  /** Return a name that a plot has room for. */
  function short(name) {
    const letters = [...name];
    if (letters.length <= LONGEST) return name;
    return `${letters.slice(0, LONGEST / 2).join('')}…${letters.slice(1 - LONGEST / 2).join('')}`;
  }

  const label = (name) => Page.escaped(short(name));

  function timeAxis(ink, view) {
    return Page.axis('time in the run [s]', ink, {
      range: [...view], // Plotly writes into what it is given
      automargin: false,
      exponentformat: 'none',
    });
  }

  /** Return the part of a layout that is about the legend, and how high it is. */
  function legend(names, width) {
    const letters = names.map((name) => 48 + LETTER * short(name).length);
    const widest = Math.max(1, ...letters);
    const across = Math.max(1, Math.floor((width - 70) / widest));
    const end = margin(width).l + Math.min(across, names.length) * widest;
    const below = end > width - BUTTONS.width ? BUTTONS.height : 0;
    const height = LEGEND_ROW * Math.ceil(names.length / across) + 6 + below;
    return [height, {
      showlegend: true,
      legend: {
        orientation: 'h', x: 0, xanchor: 'left', y: 1, yanchor: 'bottom', itemwidth: 30,
        itemsizing: 'constant', font: { size: isNarrow(width) ? 11 : 12 },
      },
    }];
  }

  function duration(seconds) {
    for (const [factor, unit] of [[1, 's'], [1e3, 'ms'], [1e6, 'µs']]) {
      if (seconds * factor >= 0.9995) return `${Number((seconds * factor).toPrecision(3))} ${unit}`;
    }
    return `${Math.round(seconds * 1e9)} ns`;
  }

  return {
    LETTER, colour, duration, isNarrow, label, legend, line, margin, order, short, shown, timeAxis,
    when,
  };
})();
