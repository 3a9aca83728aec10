/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* The page of a run: one time, shown in the picture and in the plots, and the keys that move it. */

const Report = (() => {
  const { data } = Page;
  const LEAST = 1e-6; // s: the closest zoom
  const KEYS_OF_ITS_OWN = 'select, .scroll';
  const SPACE_OF_ITS_OWN = 'button, summary, [type=checkbox]';
  const CLOSER = 1.5; // times a key zooms in
  const named = (id) => document.getElementById(id);
  const frames = data.frames && {
    step: data.frames.step,
    times: Curves.unpacked(data.frames.times, Float64Array),
    values: Object.fromEntries(
      Object.entries(data.frames.values).map(([n, v]) => [n, Curves.unpacked(v, Float64Array)]),
    ),
  };
  const kind = (linkage) => (linkage.drawn?.camera ? Space : Picture);
  const linkages = frames
    ? data.linkages.map((said) => new (kind(said).Linkage)(said, frames)) : [];
  const posed = frames ? frames.times.findIndex(
    (time, number) => linkages.every((linkage) => linkage.hasPose(number, time)),
  ) : -1;
  const whole = Object.freeze([
    data.since, data.until > data.since ? data.until : data.since + 1,
  ]);
  const state = {
    frames,
    linkages,
    whole,
    view: whole,
    // The first pose: a crank may have come after the run began.
    time: posed < 0 ? data.since : Math.max(data.since, frames.times[posed]),
    speed: 1,
    playing: false,
    seek,
    zoom,
    play,
    pause,
    get canvases() {
      return canvases;
    },
    get number() {
      return frames ? Curves.above(frames.times, state.time) - 1 : -1;
    },
  };
  let plots = [];
  let canvases = [];
  let last = 0;
  let next = 0; // picture of a run that plays
  let waiting = false;

  function seek(time) {
    state.time = Math.min(Math.max(time, whole[0]), whole[1]);
    show();
  }

  /** Show a part of the run in all plots; without one, all of it. */
  function zoom(range) {
    let view = whole;
    if (range) {
      const from = Math.max(whole[0], Math.min(...range.map(Number)));
      const to = Math.min(whole[1], Math.max(...range.map(Number)));
      if (to - from >= LEAST) view = [from, to];
    }
    state.view = view;
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      plots.forEach((plot) => plot.draw(state.view));
      show();
    });
  }

  function play() {
    if (state.time >= whole[1]) state.time = whole[0];
    state.playing = true;
    last = performance.now();
    label();
    cancelAnimationFrame(next);
    next = requestAnimationFrame(run);
  }

  function pause() {
    state.playing = false;
    cancelAnimationFrame(next);
    label();
  }

  function run(now) {
    // A picture has the time at which it was begun, which may be before the time of the click.
    const passed = Math.max(0, now - last) / 1000;
    state.time = Math.min(state.time + passed * state.speed, whole[1]);
    last = Math.max(now, last);
    show();
    if (state.time >= whole[1]) pause();
    else next = requestAnimationFrame(run);
  }

  function label() {
    named('play').textContent = state.playing ? '❚❚' : '▶';
    const what = state.playing ? 'Pause' : 'Play';
    named('play').setAttribute('aria-label', what);
    named('play').title = `${what} (Space)`;
  }

  function step(by) {
    pause();
    const to = Math.min(Math.max(state.number + by, 0), frames.times.length - 1);
    seek(frames.times[to]);
  }

  function show() {
    plots.forEach((plot) => plot.move(state.time));
    if (!named('scrub')) return;
    const { number } = state;
    const posed = canvases.map((canvas) => canvas.draw(number, state.time, state.view));
    const share = (state.time - whole[0]) / (whole[1] - whole[0]);
    named('scrub').value = Math.round(share * 1e6);
    named('scrub').setAttribute('aria-valuetext', `${state.time.toFixed(3)} s`);
    tell(number, posed);
  }

  /** Return what is going on at a time, of what has a lane. */
  function going(time) {
    return data.lanes.flatMap((lane) => lane.spans
      .filter(([begin, end]) => begin <= time && time <= end)
      .map(([, , , text]) => (text ? `${lane.title}: ${text}` : lane.title)));
  }

  function tell(number, posed) {
    const facts = [['time', `${state.time.toFixed(6)} s`]];
    if (number >= 0) facts.push(['joint state of', `${frames.times[number].toFixed(6)} s`]);
    linkages.forEach((linkage, i) => {
      const there = linkage.drawn ? posed[canvases.findIndex((c) => c.linkage === linkage)]
        : linkage.hasPose(number, state.time);
      if (!there) {
        facts.push([linkage.name || 'pose', 'none recorded here']);
        return;
      }
      const units = new Map(linkage.joints.map((name, k) => [name, linkage.units[k]]));
      linkage.inputs.forEach((name, k) => units.set(name, linkage.input_units[k]));
      const names = [...new Set([...linkage.inputs, ...linkage.joints])];
      for (const name of names) {
        const value = frames.values[name][number];
        if (Number.isFinite(value)) facts.push([name, Angles.readout(value, units.get(name))]);
      }
      const apart = linkage.apart[number] * 1e3;
      if (!Number.isFinite(apart)) return;
      const unlike = apart < 1e-6 ? '< 1 nm' : `${apart.toPrecision(3)} mm`;
      facts.push([`links come apart by${linkages.length > 1 ? ` (${linkage.name})` : ''}`, unlike]);
    });
    const now = going(state.time);
    if (now.length) facts.push(['going on', now.join('; ')]);
    named('readout').replaceChildren(...facts.map(([name, text]) => {
      const row = document.createElement('div');
      const term = document.createElement('dt');
      const told = document.createElement('dd');
      [term.textContent, told.textContent] = [name, text];
      row.className = text.length > 34 ? 'wide' : '';
      row.append(term, told);
      return row;
    }));
  }

  function begin() {
    Object.assign(Angles.chosen, data.units);
    canvases = [...document.querySelectorAll('figure[data-linkage]')].flatMap((figure) => {
      const linkage = linkages[Number(figure.dataset.linkage)];
      const canvas = figure.querySelector('canvas');
      canvas.hidden = !linkage.drawn;
      return linkage.drawn ? [new (kind(linkage).Canvas)(canvas, linkage, show)] : [];
    });
    plots = [...document.querySelectorAll('figure[data-plot]')].map((f) => new Plots.Plot(f));
    // All of them have to have their size before the first is shown.
    canvases.forEach((canvas) => canvas.fit(Picture.ink()));
    Page.keepDrawn(canvases.map((each) => each.canvas.parentElement), (figure) => {
      canvases.find((each) => each.canvas.parentElement === figure).fit(Picture.ink());
      show();
    });
    Page.keepDrawn(plots.map((plot) => plot.figure), (figure) => {
      plots.find((plot) => plot.figure === figure).draw(state.view);
    });
    // Paper has a width and colours of its own.
    Page.paper.addEventListener('change', () => {
      canvases.forEach((canvas) => canvas.fit(Picture.ink()));
      plots.forEach((plot) => plot.draw(state.view));
      show();
    });
    if (named('play')) controls();
    if (named('unit')) angleControls();
    document.addEventListener('keydown', press);
    show();
  }

  function controls() {
    for (const [id, key] of [['back', '←'], ['onward', '→']]) {
      named(id).title = `${named(id).getAttribute('aria-label')} (${key})`;
    }
    label();
    named('play').addEventListener('click', () => (state.playing ? pause() : play()));
    named('back').addEventListener('click', () => step(-1));
    named('onward').addEventListener('click', () => step(1));
    named('scrub').addEventListener('input', (event) => {
      pause();
      seek(whole[0] + (event.target.value / 1e6) * (whole[1] - whole[0]));
    });
    named('speed').addEventListener('change', (event) => {
      state.speed = Number(event.target.value);
    });
    named('traces').addEventListener('change', (event) => {
      canvases.forEach((canvas) => { canvas.traces = event.target.checked; });
      show();
    });
  }

  function angleControls() {
    named('unit').addEventListener('change', (event) => {
      Angles.chosen.degrees = event.target.value === 'degrees';
      drawAngles();
    });
    named('range').addEventListener('change', (event) => {
      Angles.chosen.wrapped = event.target.value === 'wrapped';
      drawAngles();
    });
    named('range').value = data.units.wrapped ? 'wrapped' : 'continuous';
    named('unit').value = data.units.degrees ? 'degrees' : 'rad';
  }

  function drawAngles() {
    plots.forEach((plot) => plot.draw(state.view));
    show();
  }

  /** Choose the other of the two options of a list. */
  function switchTo(list) {
    list.selectedIndex = 1 - list.selectedIndex;
    list.dispatchEvent(new Event('change'));
  }

  /** Zoom by a factor about the time, or about the middle if the time is not in view. */
  function scale(factor) {
    const [from, to] = state.view;
    const about = from <= state.time && state.time <= to ? state.time : (from + to) / 2;
    zoom([about - (about - from) * factor, about + (to - about) * factor]);
  }

  const keys = {
    '+': () => scale(1 / CLOSER),
    '-': () => scale(CLOSER),
    0: () => zoom(null),
  };

  const angleKeys = {
    d: () => switchTo(named('unit')),
    w: () => switchTo(named('range')),
  };

  const playerKeys = {
    ' ': () => (state.playing ? pause() : play()),
    ArrowLeft: () => step(-1),
    ArrowRight: () => step(1),
    Home: () => seek(whole[0]),
    End: () => seek(whole[1]),
  };

  function press(event) {
    const { key, target } = event;
    if (event.altKey || event.ctrlKey || event.metaKey || target.closest(KEYS_OF_ITS_OWN)) return;
    if (key === ' ' && target.closest(SPACE_OF_ITS_OWN)) return;
    const name = key.length === 1 ? key.toLowerCase() : key;
    const act = keys[name] ?? (named('unit') && angleKeys[name])
      ?? (named('play') && playerKeys[name]);
    if (!act) return;
    act();
    event.preventDefault();
  }

  // The others look for it while they draw.
  queueMicrotask(begin);
  return state;
})();
