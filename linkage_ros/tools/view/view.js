/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* The page of a linkage: what is shown, what a hand and keys change, and what the server answers. */

const View = (() => {
  const { data } = Page;
  const TURN_IN = 4; // s: a turn of the crank that plays
  const SLOWER = 140; // ms between two drawings of all curves
  const WHOLE_AFTER = 250; // ms without an edit, until what takes longer is asked for
  const KEY = 1 / 400; // of the picture: a step of a key
  const SLIDER_STEPS = 1000;
  const RANGE = 60; // poses that the server tells over a range
  const named = (id) => document.getElementById(id);
  const listeners = [];
  const editing = data.mode === 'edit';
  const isSpatial = Boolean(data.model.drawn.camera); // then it moves, and is not edited
  let linkage = Motion.made(data.model);
  let board = null;
  let plots = [];
  let history = new Edits.History(data.model.text, linkage.inputs);
  let states = []; // over the range of the first input
  let playing = false;
  let forth = 1;
  let last = 0;
  let there = !data.server;
  let drawnAt = -SLOWER;
  let curvesDue = null;
  let wholeDue = null;
  let rangeDue = null;
  let settling = 0; // requests for a whole model
  let dragged = null; // { pin, inputs }: the drag that is under way
  let grip = 0; // angle between the hand and the crank it turns
  let rate = 1; // of the first input, in [rad/s] or [m/s]

  const driven = () => linkage.model.driven;
  const mayEdit = () => editing && there && !isSpatial;

  /** Ask the server about the linkage that is shown; the name tells a file from what is new. */
  const ask = (what, content) => Talk.ask(what, { name: linkage.model.name, ...content });

  // What is shown.

  /** Show another model of the linkage; of one during a drag, ranges and checks are the old ones. */
  function show(model, inputs = null) {
    const before = linkage;
    Looks.order(model.joints.map((joint) => joint.name));
    Angles.chosen.length = model.unit;
    const kept = model.ranges ? {} : {
      ranges: before.model.ranges, toggles: before.model.toggles, quality: before.model.quality,
      warnings: before.model.warnings,
    };
    // A quick answer draws the links; where they go follows from the program.
    const { frame, paths } = before.drawn;
    linkage = Motion.made({ ...kept, ...model, drawn: { frame, paths, ...model.drawn } });
    const same = model.inputs.length === before.inputs.length;
    linkage.seek(inputs ?? (same ? before.inputs : linkage.inputs));
    if (!linkage.closed && !inputs) linkage.seek(model.inputs.map((input) => input.value));
    linkage.frameOfPicture = dragged ? before.reach : null;
    showRate();
    board.take(linkage);
    if (!dragged) board.fit(Picture.ink());
    if (model.ranges || !dragged) form();
    else numbers();
    curves();
    moved();
  }

  /** Draw the linkage where it is, and mark its place on the curves. */
  function moved() {
    board.paint();
    plots.forEach((plot) => plot.mark(linkage));
    sliders();
    readout();
    listeners.forEach((listener) => listener(linkage));
  }

  /** Draw the curves, at once or soon: more often than this nobody can read them. */
  function curves() {
    clearTimeout(curvesDue);
    const wait = drawnAt + SLOWER - performance.now();
    if (wait > 0) {
      curvesDue = setTimeout(curves, wait);
      return;
    }
    states = OverInput.states(linkage);
    paths();
    plots.forEach((plot) => plot.draw(linkage, states));
    OverInput.paintBand(named('band'), linkage);
    drawnAt = performance.now();
  }

  function paths() {
    if (linkage.inputs.length === 1) linkage.drawn.paths = OverInput.paths(linkage, states);
  }

  /** Ask the server for the pose of a linkage that is solved by iteration, between known ones. */
  const askForPose = Talk.newest(async (asked) => {
    if (asked.model.program || !editing || !there) return;
    const inputs = [...asked.inputs];
    try {
      const { poses: [pose] } = await ask('poses', { text: history.now.text, inputs: [inputs] });
      if (linkage !== asked || asked.inputs.some((value, i) => value !== inputs[i])) return;
      asked.now = pose;
      moved();
    } catch (error) {
      said(error);
    }
  });

  /** Ask the server for the poses over the first input, where another one has changed. */
  const askForRange = Talk.newest(async (asked) => {
    const [low, high] = asked.range();
    const others = asked.inputs.slice(1);
    const inputs = [...Array(RANGE + 1).keys()].map((i) => [low + ((high - low) * i) / RANGE, ...others]);
    try {
      const { poses } = await ask('poses', { text: history.now.text, inputs });
      asked.known.poses = [];
      asked.known.take(poses.map((pose, i) => ({ ...pose, inputs: inputs[i] })));
      if (linkage !== asked) return;
      asked.seek(asked.inputs);
      curves();
      moved();
    } catch (error) {
      said(error);
    }
  });

  function readout() {
    const { joints, inputs } = linkage.model;
    const facts = inputs.map((input, i) => [input.name, Angles.readout(linkage.inputs[i], input.unit)]);
    if (!linkage.closed) facts.push(['pose', 'the loops do not close at this input']);
    else if (linkage.isChangePoint) facts.push(['pose', 'a change point']);
    joints.forEach((joint, i) => {
      if (!linkage.closed) return;
      const read = board.values?.[joint.name];
      const sensed = read === undefined || read === null ? ''
        : `, read ${Angles.readout(read, joint.unit)}`;
      facts.push([joint.name, `${Angles.readout(linkage.now.joints[i], joint.unit)}${sensed}`]);
    });
    if (linkage.closed) {
      const { unit, factor } = Angles.shown('m');
      for (const { point, link, at } of linkage.drawn.traced) {
        const place = linkage.coordinates(link, ...at).map((value) => (value * factor).toFixed(decimals()));
        facts.push([point, `${place.join(', ')} ${unit}`]);
      }
    }
    named('readout').replaceChildren(...facts.map(([name, text]) => {
      const row = document.createElement('div');
      const term = document.createElement('dt');
      const told = document.createElement('dd');
      [term.textContent, told.textContent] = [name, text];
      row.append(term, told);
      return row;
    }));
  }

  /** Return how many decimals tell a place to a ten thousandth of the picture. */
  function decimals() {
    const [left, , right] = linkage.reach;
    const fine = ((right - left) * Angles.shown('m').factor) / 1e4;
    return Math.min(12, Math.max(0, Math.ceil(-Math.log10(fine || 1))));
  }

  /** Return the unit of the first input, in which its rate is typed; ω is in radians. */
  function unitOfRate() {
    const { unit } = linkage.model.inputs[0];
    return unit === 'rad' ? { unit, factor: 1 } : Angles.shown(unit);
  }

  function showRate() {
    const { unit, factor } = unitOfRate();
    named('rate-unit').textContent = `${unit}/s`;
    named('rate').value = Number((rate * factor).toPrecision(6));
  }

  // Sliders.

  function sliders() {
    document.querySelectorAll('#inputs input').forEach((slider, i) => {
      if (document.activeElement === slider && slider.matches(':active')) return;
      const [low, high] = bounds(i);
      slider.value = Math.round(((within(i, linkage.inputs[i]) - low) / (high - low || 1)) * SLIDER_STEPS);
      slider.setAttribute('aria-valuetext', Angles.readout(linkage.inputs[i], linkage.model.inputs[i].unit));
    });
  }

  function bounds(i) {
    if (i === 0) return linkage.range();
    const input = linkage.model.inputs[i];
    const half = input.unit === 'rad' ? Math.PI : Math.abs(input.value) || 1;
    return [input.low ?? input.value - half, input.high ?? input.value + half];
  }

  /** Return an input within its slider: an angle less its whole turns. */
  function within(i, value) {
    const [low] = bounds(i);
    if (linkage.model.inputs[i].unit !== 'rad') return value;
    return value - Angles.TURN * Math.floor((value - low) / Angles.TURN + 1e-12);
  }

  function setInput(i, value) {
    const inputs = [...linkage.inputs];
    inputs[i] = value;
    seek(inputs);
  }

  /** Go to inputs. */
  function seek(inputs) {
    const others = inputs.some((value, i) => i && value !== linkage.inputs[i]);
    linkage.seek(inputs);
    if (others) { // over the first input, the others held
      if (linkage.model.program) curves();
      else if (editing && there) {
        clearTimeout(rangeDue);
        rangeDue = setTimeout(() => askForRange(linkage), WHOLE_AFTER);
      }
    }
    moved();
    read();
    askForPose(linkage);
  }

  // Playing.

  function play() {
    playing = true;
    last = performance.now();
    label();
    requestAnimationFrame(run);
  }

  function pause() {
    playing = false;
    label();
  }

  function label() {
    const button = named('play');
    button.textContent = playing ? '❚❚' : '▶';
    button.setAttribute('aria-label', playing ? 'Pause' : 'Play');
    button.title = `${playing ? 'Pause' : 'Play'} (Space)`;
  }

  function run(now) {
    if (!playing) return;
    const passed = Math.min(0.1, Math.max(0, now - last) / 1000);
    last = now;
    const [low, high] = linkage.range();
    const whole = linkage.model.inputs[0].unit === 'rad' && high - low > Angles.TURN - 1e-6;
    let value = linkage.inputs[0] + (forth * passed * (high - low)) / TURN_IN;
    if (!whole && (value > high || value < low)) {
      forth = value > high ? -1 : 1;
      value = Math.min(Math.max(value, low), high);
    }
    setInput(0, value);
    requestAnimationFrame(run);
  }

  // Edits.

  const send = Talk.newest(async ({ edit, inputs, whole }) => {
    const { text } = history.now;
    try {
      const base = dragged?.text ?? text;
      const model = await ask('edit', { text: base, edit, whole, size: linkage.drawn.size });
      board.wrong = null;
      warn('');
      const now = model.inputs.map((input) => input.value);
      const at = edit.pin || edit.input ? now : inputs;
      if (dragged) dragged.last = { text: model.text, inputs: at };
      else history.add(model.text, at);
      show(model, at);
      buttons();
      if (!whole) askForWhole();
    } catch (error) {
      said(error, edit.pin ?? edit.length?.to ?? null);
    }
  });

  function askForWhole() {
    clearTimeout(wholeDue);
    wholeDue = setTimeout(async () => {
      // Of two requests that wait, the server drops the older one: no edit may be that.
      if (dragged || send.isBusy()) {
        askForWhole();
        return;
      }
      wholeDue = null;
      const { text } = history.now;
      settling += 1;
      try {
        const model = await ask('model', { text, whole: true });
        if (text === history.now.text && !dragged) show(model, linkage.inputs);
      } catch (error) {
        said(error);
      }
      settling -= 1;
    }, WHOLE_AFTER);
  }

  /** Say an error in the line above the drawing, and at the pin that it concerns. */
  function said(error, pin = null) {
    if (!error || error.dropped) return;
    if (error.lost) return; // the banner says so
    if (!error.text) throw error;
    board.wrong = { pin: error.pin ?? pin, text: reason(error.text) };
    warn(error.text);
    sides();
    board.paint();
  }

  /** Return an error without the place in the file, which the pin shows. */
  const reason = (text) => text.replace(/^.*?: (links[^:]*|assembly[^:]*): /, '');

  function warn(text) {
    named('wrong').textContent = text;
    named('wrong').hidden = !text;
  }

  function edit(change) {
    if (!mayEdit()) return;
    send({ edit: { ...change, inputs: linkage.inputs }, inputs: linkage.inputs, whole: false });
  }

  function movePin(pin, [x, y]) {
    if (!dragged) dragged = { text: history.now.text, inputs: [...linkage.inputs], last: null };
    const snap = Number(named('snap').value) * linkage.model.unit.factor;
    send({
      edit: { pin, to: [seen(x), seen(y)], inputs: dragged.inputs, snap },
      inputs: dragged.inputs,
      whole: false,
    });
  }

  /** End a drag: its last text is one step of the history. */
  function ended(pinned) {
    if (!pinned || !dragged) return;
    const settle = () => {
      // The answer to the last request may still be on its way.
      if (send.isBusy()) {
        setTimeout(settle, 20);
        return;
      }
      const done = dragged;
      dragged = null;
      if (done?.last) history.add(done.last.text, done.last.inputs);
      linkage.frameOfPicture = null;
      board.fit(Picture.ink());
      form();
      curves();
      moved();
      buttons();
      askForWhole();
    };
    settle();
  }

  async function go(by) {
    const state = history.go(by);
    if (!state) return;
    try {
      const model = await ask('model', { text: state.text, whole: true });
      board.wrong = null;
      warn('');
      show(model, state.inputs);
    } catch (error) {
      said(error);
    }
    buttons();
  }

  async function openShipped(name) {
    if (!name) return;
    try {
      const model = await Talk.ask('open', { name });
      history = new Edits.History(model.text, model.inputs.map((input) => input.value));
      history.saved = null;
      named('title').textContent = model.name;
      board.wrong = null;
      warn('');
      show(model, history.now.inputs);
      buttons();
    } catch (error) {
      said(error);
    }
  }

  async function save() {
    try {
      const { file } = await ask('save', { text: history.now.text });
      history.saved = history.now.text;
      tell(`saved: ${file}`);
    } catch (error) {
      said(error);
    }
    buttons();
  }

  async function download(kind) {
    if (!kind) return;
    if (kind === 'png') {
      board.canvas.toBlob((blob) => hand(blob, `${linkage.model.name}.png`));
      return;
    }
    try {
      tell(`making ${kind} …`);
      const { name, type, data: text } = await ask('export', {
        kind, text: history.now.text, inputs: linkage.inputs,
      });
      const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
      hand(new Blob([bytes], { type }), name);
      tell(`${name}: ${bytes.length.toLocaleString('en')} bytes`);
    } catch (error) {
      said(error);
    }
  }

  function hand(blob, name) {
    const link = document.createElement('a');
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  function tell(text) {
    named('status').textContent = text;
  }

  function buttons() {
    if (!editing) return;
    if (named('undo')) named('undo').disabled = !there || !history.can(-1);
    if (named('redo')) named('redo').disabled = !there || !history.can(1);
    if (named('save')) named('save').disabled = !there || history.isSaved;
    for (const control of document.querySelectorAll('.edit')) control.disabled = !there;
  }

  // What the sensors of a scene read.

  const begun = performance.now();
  const read = Talk.newest(async () => {
    if (!data.scene || !there) return;
    try {
      const t = (performance.now() - begun) / 1000;
      const found = await ask('read', {
        t, text: history.now.text, inputs: linkage.inputs, rates: linkage.inputs.map(() => 0),
      });
      board.values = found.read;
      if (found.frames?.length) {
        const sensed = new Motion.Linkage({ ...linkage.model, program: null });
        sensed.now = { ...linkage.now, frames: found.frames };
        board.read = sensed;
      } else board.read = null;
      board.paint();
      readout();
    } catch (error) {
      said(error);
    }
  });

  // The crank in the hand.

  const angleAbout = (place, [x, y]) => Math.atan2(place[1] - y, place[0] - x);

  /** Turn the first crank to the hand; the first touch takes it where it is. */
  function turnTo(place, first) {
    const [link] = driven();
    if (!link || !linkage.closed) return;
    const pivot = linkage.pins().find((pin) => pin.ground && pin.links.includes(link));
    const { unit } = linkage.model.inputs[0];
    if (unit !== 'rad' || !pivot) return;
    const angle = angleAbout(place, pivot.place);
    if (first) {
      grip = linkage.inputs[0] - angle;
      pause();
      return;
    }
    const value = linkage.inputs[0] + Angles.wrap(angle + grip - linkage.inputs[0]);
    const [low, high] = linkage.range();
    const whole = high - low > Angles.TURN - 1e-6;
    setInput(0, whole ? value : Math.min(Math.max(value, low), high));
  }

  /** Return a length as finely as an eye can point. */
  function seen(value) {
    const [left, , right] = linkage.reach;
    const fine = 10 ** Math.floor(Math.log10((right - left) / 2000));
    return Number((fine * Math.round(value / fine)).toPrecision(9));
  }

  const act = {
    mayEdit,
    isSpatial: () => isSpatial,
    follows: () => linkage.inputs.length === 1,
    follow(point, place) {
      pause();
      setInput(0, linkage.following(point.link, point.at, place));
    },
    turned() {
      paths();
      moved();
    },
    tool: () => document.querySelector('input[name=tool]:checked')?.value ?? 'turn',
    isDriven: (link) => driven().includes(link),
    turnTo,
    movePin,
    ended,
    pointed(link, place) {
      if (act.tool() === 'input') edit({ input: { link } });
      else edit({ trace: { link, at: linkage.within(link, place).map(seen) } });
    },
    choose(name) {
      board.chosen = name;
      tell(name ? `pin ${name}` : '');
      board.paint();
    },
    nudge(dx, dy) {
      const pin = board.chosen && linkage.pins().find((each) => each.name === board.chosen);
      if (!pin || !mayEdit()) {
        const [low, high] = linkage.range();
        setInput(0, linkage.inputs[0] + ((dx + dy) * (high - low)) / 360);
        return;
      }
      const [left, bottom, right, top] = linkage.reach;
      const step = Number(named('snap').value) * linkage.model.unit.factor
        || Math.max(right - left, top - bottom) * KEY;
      edit({ pin: pin.name, to: [pin.place[0] + dx * step, pin.place[1] + dy * step] });
    },
  };

  // Numbers and choices.

  const shownLength = (value) => Number((value / linkage.model.unit.factor).toPrecision(9));

  function cell(tag, ...content) {
    const made = document.createElement(tag);
    made.append(...content);
    return made;
  }

  function typed(label, value, change) {
    if (!editing) return cell('span', String(value));
    const field = document.createElement('input');
    Object.assign(field, { type: 'number', step: 'any', value, className: 'edit', disabled: !mayEdit() });
    field.setAttribute('aria-label', label);
    field.addEventListener('input', () => { field.isTyped = true; });
    field.addEventListener('change', () => {
      field.isTyped = false;
      if (field.value !== '' && Number.isFinite(field.valueAsNumber)) change(field.valueAsNumber);
    });
    return field;
  }

  /** Write lengths and sides, without the field in which somebody types. */
  function numbers() {
    const { lengths, unit } = linkage.model;
    document.querySelectorAll('#lengths input').forEach((field, i) => {
      if (!field.isTyped && lengths[i]) field.value = shownLength(lengths[i].value);
    });
    named('unit-of-length').textContent = unit.length;
    sides();
  }

  function sides() {
    const now = Object.values(linkage.model.choices);
    document.querySelectorAll('#choices select').forEach((choice, i) => {
      choice.value = now[i].now;
    });
  }

  /**
   * Fill an element with a part for each of its contents, if they are others than before.
   *
   * A part that stays keeps the focus, and the press of a button that is not yet let go.
   */
  function fill(id, contents, make) {
    const place = named(id);
    const key = JSON.stringify([contents, linkage.model.unit, mayEdit()]);
    if (place.filledWith === key) return;
    place.filledWith = key;
    place.replaceChildren(...contents.map(make));
  }

  function form() {
    const { model } = linkage;
    const { factor } = model.unit;
    // Without a server the numbers are text, and stay.
    const lengths = editing ? model.lengths.map(({ value, ...own }) => own) : model.lengths;
    fill('lengths', lengths, (each, i) => {
      const field = typed(`length ${each.key}`, shownLength(model.lengths[i].value), (value) => edit({
        length: { link: each.link, from: each.from, to: each.to, value: value * factor },
      }));
      return cell('tr', cell('th', each.key), cell('td', field));
    });
    const choices = Object.entries(model.choices).map(([name, each]) => [name, each.sides]);
    fill('choices', choices, ([name, possible]) => {
      const { now } = model.choices[name];
      if (!editing) return cell('tr', cell('th', name), cell('td', now ?? ''));
      const choice = document.createElement('select');
      choice.className = 'edit';
      choice.disabled = !mayEdit();
      choice.setAttribute('aria-label', `side of ${name}`);
      choice.append(...possible.map((side) => new Option(side, side, side === now, side === now)));
      choice.addEventListener('change', () => edit({ side: { [name]: choice.value } }));
      return cell('tr', cell('th', name), cell('td', choice));
    });
    fill('traced', model.drawn.traced.map(({ point }) => point), (point) => {
      if (!editing) return cell('span', point);
      const remove = cell('button', `✕ ${point}`);
      Object.assign(remove, { type: 'button', className: 'edit', disabled: !mayEdit() });
      remove.setAttribute('aria-label', `trace ${point} no more`);
      remove.addEventListener('click', () => edit({ untrace: point }));
      return remove;
    });
    named('warnings').replaceChildren(...(model.warnings ?? []).map((text) => cell('li', text)));
    named('warnings').hidden = !(model.warnings ?? []).length;
    // Without a program and a server, what other inputs move is not known.
    const moving = model.inputs.slice(0, model.program || editing ? undefined : 1);
    fill('inputs', moving.map(({ name }) => name), (name, i) => {
      const slider = document.createElement('input');
      Object.assign(slider, { type: 'range', min: 0, max: SLIDER_STEPS, step: 1 });
      slider.addEventListener('input', () => {
        pause();
        const [low, high] = bounds(i);
        setInput(i, low + ((high - low) * slider.valueAsNumber) / SLIDER_STEPS);
      });
      return cell('label', cell('span', name), slider);
    });
    numbers();
    sliders();
  }

  // The beginning.

  function begin() {
    Angles.chosen.degrees = true;
    Looks.order(data.model.joints.map((joint) => joint.name));
    Angles.chosen.length = data.model.unit;
    board = new (isSpatial ? Board.Spatial : Board.Drawing)(named('drawing'), linkage);
    board.take(linkage);
    Hand.attach(board, act);
    plots = [...document.querySelectorAll('figure[data-key]')].map((f) => new OverInput.Plot(f, () => rate));
    form();
    board.fit(Picture.ink());
    Page.keepDrawn([board.canvas.parentElement], () => {
      board.fit(Picture.ink());
      moved();
    });
    Page.keepDrawn([named('plots')], curves);
    controls();
    label();
    buttons();
    moved();
    if (!data.server) return;
    Talk.onChange((now, words) => {
      there = now;
      named('lost').hidden = now;
      named('lost-why').textContent = words;
      buttons();
      form();
      if (now) curves();
    });
    if (editing) {
      Talk.open();
      Talk.onChange((now) => now && shipped());
    }
  }

  async function shipped() {
    const list = named('open');
    if (!list || list.options.length > 1) return;
    try {
      const { linkages } = await Talk.ask('names');
      list.append(...linkages.map((name) => new Option(name, name)));
    } catch (error) {
      said(error);
    }
  }

  function controls() {
    named('play').addEventListener('click', () => (playing ? pause() : play()));
    for (const what of ['ghosts', 'centres', 'names']) {
      named(what)?.addEventListener('change', (event) => {
        board.shown[what] = event.target.checked;
        if (what === 'ghosts') board.fit(Picture.ink());
        board.paint();
      });
    }
    named('angles').addEventListener('change', (event) => {
      Angles.chosen.degrees = event.target.value === 'degrees';
      curves();
      moved();
    });
    showRate();
    named('rate').addEventListener('change', ({ target }) => {
      const typed = target.valueAsNumber / unitOfRate().factor;
      if (Number.isFinite(typed)) rate = typed;
      showRate();
      curves();
    });
    document.addEventListener('keydown', press);
    if (!editing) return;
    named('undo')?.addEventListener('click', () => go(-1));
    named('redo')?.addEventListener('click', () => go(1));
    named('save')?.addEventListener('click', save);
    named('open')?.addEventListener('change', (event) => {
      openShipped(event.target.value);
      event.target.value = '';
    });
    named('download').addEventListener('change', (event) => {
      download(event.target.value);
      event.target.value = '';
    });
  }

  function press(event) {
    const { key, target } = event;
    const typing = target.closest('input[type=number], select, textarea');
    if ((event.ctrlKey || event.metaKey) && !event.altKey && editing && !typing) {
      const wanted = key.toLowerCase();
      const by = wanted === 'z' ? (event.shiftKey ? 1 : -1) : wanted === 'y' ? 1 : 0;
      if (by) go(by);
      if (wanted === 's' && named('save')) save();
      if (by || wanted === 's') event.preventDefault();
      return;
    }
    if (typing || event.altKey || target.closest('button, [type=checkbox], [type=radio], summary')) return;
    if (key !== ' ') return;
    if (playing) pause();
    else play();
    event.preventDefault();
  }

  queueMicrotask(begin);
  return {
    show,
    seek,
    edit,
    onMove: (listener) => listeners.push(listener),
    /** Return what tests and other scripts of this page look at. */
    state: () => ({
      inputs: linkage.inputs, ...linkage.now, text: linkage.model.text, model: linkage.model,
      closed: linkage.closed, there, wrong: board.wrong,
      busy: Boolean(dragged || wholeDue || settling),
    }),
    get board() { return board; },
    get linkage() { return linkage; },
  };
})();
