/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/*
 * The page of a running node: what the node says, and hands on its crank, faults and recording.
 *
 * All that is shown comes by a WebSocket, and only the newest state is drawn. A switch shows what
 * the node says, not what was asked.
 */

const Live = (() => {
  const TRAIL = 150; // poses that are kept, for the trails of traced points
  const AGAIN = 1000; // ms: between two tries to reach the server
  const HELD = 300; // ms: between two words of a hand that rests; after 1 s it has let go
  const STALE = 0.5; // s: a pose that is older is pale
  const LEVELS = ['OK', 'warning', 'error', 'stale'];
  const DEGREE = Math.PI / 180;
  const [TRY_LATER, GOING_AWAY] = [1013, 1001];
  const at = (id) => document.getElementById(id);
  const seen = { model: null, node: null, state: null, heard: 0, open: false };
  let [socket, canvas, spatial, linkage, hands, drawn] = [null, null, null, null, [], false];

  /** The poses of the last seconds, as a canvas draws them. */
  class Poses {
    constructor(model) {
      this.drawn = model.drawn;
      this.places = new Map(model.links.map((link, i) => [link, 3 * i]));
      this.times = [];
      this.frames = [];
    }

    add(time, frames) {
      if (this.times.length && time < this.times.at(-1)) this.times = this.frames = [];
      this.times = [...this.times.slice(1 - TRAIL), time];
      this.frames = [...this.frames.slice(1 - TRAIL), frames];
    }

    get reach() {
      return this.drawn.frame;
    }

    hasPose(number) {
      return Boolean(this.frames[number]);
    }

    place(link, x, y, number) {
      if (link === 'ground') return [x, y];
      const frames = this.frames[number];
      if (!frames) return null;
      const i = this.places.get(link);
      const [cos, sin] = [Math.cos(frames[i + 2]), Math.sin(frames[i + 2])];
      return [frames[i] + cos * x - sin * y, frames[i + 1] + sin * x + cos * y];
    }
  }

  /** The same of a spatial linkage, whose frames are the places of its drawing. */
  class SpatialPoses extends Space.seen(Poses) {
    constructor(model) {
      super(model);
      this.look(...model.drawn.camera);
    }

    spot(row, number) {
      return this.frames[number]?.slice(3 * row, 3 * row + 3) ?? null;
    }
  }

  function element(tag, properties, ...children) {
    const made = Object.assign(document.createElement(tag), properties);
    made.append(...children);
    return made;
  }

  function send(content) {
    if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(content));
  }

  // What the node says.

  function connect() {
    socket = new WebSocket(new URL('live', location.href.replace(/^http/, 'ws')));
    socket.onopen = () => { seen.open = true; };
    socket.onmessage = ({ data }) => {
      const told = JSON.parse(data);
      if (told.model) showModel(told.model);
      if (told.node) showNode(told.node);
      if (told.state) takeState(told.state);
      if (told.said !== undefined && told.do !== 'crank') at('said').textContent = told.said;
    };
    socket.onclose = ({ code, reason }) => {
      seen.open = false;
      seen.closed = code === TRY_LATER ? reason
        : code === GOING_AWAY ? 'linkage view has ended: start it again, and open its new address'
          : 'linkage view does not answer; trying again';
      showBanner();
      setTimeout(connect, AGAIN);
    };
  }

  function showBanner() {
    const { node, open, closed } = seen;
    let text = '';
    if (!open && closed) text = closed;
    else if (node && !node.there) text = `${node.name} does not answer: it has ended, or cannot be reached`;
    else if (node?.state && node.state !== 'active') text = `${node.name} is ${node.state}, it does not tick`;
    const banner = at('banner');
    if (banner.textContent !== text) banner.textContent = text;
    banner.hidden = !text;
    const off = !open || !node?.there;
    document.querySelectorAll('#live button, #live input').forEach((each) => { each.disabled = off; });
  }

  function showModel(model) {
    seen.model = model;
    seen.state = null;
    showPicture(model);
    at('title').textContent = `${model.name}: ${Page.data.node}`;
    const more = model.live.linkages - 1;
    at('more').textContent = more ? `The scene has ${more} more ${more > 1 ? 'linkages, which are' : 'linkage, which is'} not drawn.` : '';
    at('joints').replaceChildren(...model.live.joints.map(([name]) => element(
      'tr', {}, element('th', { scope: 'row', textContent: name }),
      element('td', { className: 'number' }), element('td', { className: 'number' }),
    )));
    showHands(model);
    at('faults').replaceChildren();
    draw();
  }

  function showPicture(model) {
    const picture = at('live').querySelector('canvas');
    const inSpace = Boolean(model.drawn.camera);
    linkage = inSpace ? new SpatialPoses(model) : new Poses(model);
    if (inSpace) spatial ??= new Space.Canvas(picture, linkage, schedule);
    canvas = inSpace ? spatial : new Picture.Canvas(picture, linkage);
    Object.assign(canvas, { linkage, curves: null, tallest: 620, absent: 'no pose is known' });
    picture.classList.toggle('orbit', inSpace);
    if (inSpace) picture.tabIndex = 0;
    else picture.removeAttribute('tabindex');
    canvas.fit(Picture.ink());
  }

  function showNode(node) {
    seen.node = node;
    const facts = [
      ['ticks', node.ticks && `${Number(node.ticks).toFixed(1)} Hz`],
      ['late by more than a period', node.late],
      ['lost ticks', node.lost],
      ['lateness p50, p99, max', node.lateness.some(Boolean) && `${node.lateness.join(', ')} µs`],
      ['drive', node.drive],
    ];
    at('facts').replaceChildren(...facts.filter(([, value]) => value).map(([name, value]) => element(
      'div', {}, element('dt', { textContent: name }), element('dd', { textContent: value }),
    )));
    at('diagnostics').replaceChildren(...node.diagnostics.map(([level, words]) => element(
      'li', { className: `level-${level}` },
      element('strong', { textContent: LEVELS[level] ?? level }), ` ${words}`,
    )));
    showFaults(node.faults);
    const record = at('record');
    record.textContent = node.recording ? 'Stop recording' : 'Record';
    record.setAttribute('aria-pressed', node.recording);
    at('snapshot').hidden = !node.memory;
    record.hidden = node.memory;
    showBanner();
    schedule();
  }

  function showFaults(faults) {
    const names = Object.keys(faults);
    const box = at('faults');
    at('faults-title').hidden = !names.length;
    if (box.children.length !== names.length) {
      box.replaceChildren(...names.map((name) => {
        const made = element('button', { type: 'button', textContent: name });
        made.setAttribute('role', 'switch');
        made.addEventListener('click', () => {
          send({ do: 'fault', name, on: made.getAttribute('aria-checked') !== 'true' });
        });
        return made;
      }));
    }
    names.forEach((name, i) => box.children[i].setAttribute('aria-checked', faults[name]));
  }

  function takeState(state) {
    seen.state = state;
    seen.heard = performance.now();
    linkage?.add(state.t, state.frames);
    schedule();
  }

  function schedule() {
    if (drawn) return;
    drawn = true;
    requestAnimationFrame(draw);
  }

  /** Return how old the pose is, in [s]. */
  const age = () => (seen.state ? (performance.now() - seen.heard) / 1e3 : Infinity);

  function draw() {
    drawn = false;
    if (!linkage) return;
    const { state } = seen;
    const pale = age() > STALE || !seen.node?.there || !seen.open;
    canvas.canvas.classList.toggle('pale', pale);
    canvas.draw(linkage.times.length - 1, state?.t ?? 0, [0, -1]);
    at('age').textContent = !state ? 'no joint states yet'
      : pale ? `no joint states for ${age().toFixed(1)} s`
        : `joint states ${Looks.duration(Math.max(0, state.age))} old`;
    if (!state) return;
    seen.model.live.joints.forEach(([name, unit], i) => {
      const [value, rate] = state.joints[name] ?? [null, null];
      const [, position, speed] = at('joints').children[i].children;
      position.textContent = value === null ? 'no number' : Angles.readout(value, unit);
      speed.textContent = rate === null ? '' : `${rate.toFixed(4)} ${unit}/s`;
    });
    hands.forEach((hand) => hand.follow());
  }

  // Hands on the node.

  /** A number that a person sets by a slider or types, and that is sent as long as it is held. */
  class Hand {
    constructor(label, { low, high, step, factor, speak, now }) {
      Object.assign(this, { factor, speak, now, spoken: -Infinity, value: null });
      const shared = { min: low, max: high, step, value: 0 };
      this.slider = element('input', { type: 'range', ...shared, ariaLabel: label });
      this.typed = element('input', { type: 'number', step: 'any', value: 0, ariaLabel: label });
      this.hold = element('input', { type: 'checkbox' });
      this.box = element(
        'div', { className: 'controls' }, element('span', { textContent: label }),
        this.slider, this.typed, element('label', {}, this.hold, ' hold'),
      );
      this.slider.addEventListener('input', () => {
        this.typed.value = this.slider.value;
        this.set(Number(this.slider.value) * factor);
      });
      this.typed.addEventListener('change', () => {
        if (!Number.isFinite(this.typed.valueAsNumber)) return;
        this.slider.value = this.typed.value;
        this.set(this.typed.valueAsNumber * factor);
      });
      this.slider.addEventListener('pointerdown', () => { this.down = true; });
      for (const end of ['pointerup', 'pointercancel']) {
        this.slider.addEventListener(end, () => { this.down = false; });
      }
      this.hold.addEventListener('change', () => {
        if (this.hold.checked) this.set(this.value ?? Number(this.slider.value) * factor);
      });
    }

    set(value) {
      this.value = value;
      this.spoken = performance.now();
      this.speak(value);
    }

    /** Say again what is held; without a hand, show where the input is. */
    keep() {
      if ((this.hold.checked || this.down) && this.value !== null) {
        if (performance.now() - this.spoken > HELD) this.set(this.value);
      }
    }

    follow() {
      const free = !this.hold.checked && !this.down && performance.now() - this.spoken > 1200;
      const now = this.now?.();
      if (!free || now === null || now === undefined || document.activeElement === this.typed) return;
      const shown = (now / this.factor).toFixed(1);
      [this.slider.value, this.typed.value] = [shown, shown];
    }
  }

  function showHands(model) {
    const { live } = model;
    hands = [];
    if (live.drive === 'topic' && live.turned) {
      hands = model.inputs.map(({ low, high, unit }, input) => {
        const turns = unit === 'rad';
        const factor = turns ? DEGREE : 1e-3;
        const whole = low === null || high === null;
        return new Hand(`${live.inputs[input]} [${turns ? '°' : 'mm'}]`, {
          low: whole ? (turns ? -180 : -1000) : low / factor,
          high: whole ? (turns ? 180 : 1000) : high / factor,
          step: 0.5,
          factor,
          speak: (angle) => send({ do: 'crank', angle, input }),
          now: () => {
            const now = seen.state?.inputs[input];
            return turns && whole && typeof now === 'number' ? Angles.wrap(now) : now;
          },
        });
      });
    } else if (live.drive === 'torque') {
      const several = model.inputs.length > 1;
      hands = model.inputs.map(({ name, unit }, input) => {
        const most = live.efforts[input];
        return new Hand(`effort ${several ? `of ${name} ` : ''}[${unit === 'rad' ? 'N·m' : 'N'}]`, {
          low: -most, high: most, step: most / 200, factor: 1, speak: (value) => send({ do: 'effort', value, input }),
        });
      });
    }
    const note = element('p', { className: 'note' });
    note.textContent = hands.length
      ? 'Without “hold”, the crank is released one second after the last movement.'
      : `The scene drives the crank itself (${live.drive}).`;
    if (hands.length && live.cranks.some(Boolean)) note.textContent += ' It can be turned in the picture, too.';
    if (live.drive === 'torque') note.textContent = 'Without “hold”, the effort ends after one second.';
    at('hands').replaceChildren(...hands.map((hand) => hand.box), note);
  }

  /** Let a pointer turn a crank in the picture. */
  function turnByPointer() {
    const picture = at('live').querySelector('canvas');
    let grip = null;

    const place = ({ clientX, clientY }) => {
      const box = picture.getBoundingClientRect();
      return canvas.toPlace([clientX - box.left, clientY - box.top]);
    };

    /** Return which crank is at a place; -1 for none. */
    const gripped = (event) => {
      const live = seen.model?.live;
      if (!live?.turned || live.drive !== 'topic' || !seen.state) return -1;
      const [x, y] = place(event);
      return live.cranks.findIndex((crank, i) => crank && typeof seen.state.inputs[i] === 'number'
        && Math.hypot(x - crank[0], y - crank[1]) < 1.5 * crank[2]);
    };

    const direction = ([x, y], [px, py]) => Math.atan2(y - py, x - px);

    picture.addEventListener('touchstart', (event) => {
      if (gripped(event.touches[0]) >= 0) event.preventDefault(); // it does not scroll
    }, { passive: false });
    picture.addEventListener('pointerdown', (event) => {
      const input = gripped(event);
      if (input < 0) return;
      const crank = seen.model.live.cranks[input];
      grip = { input, crank, from: direction(place(event), crank), angle: seen.state.inputs[input] };
      picture.setPointerCapture(event.pointerId);
      hands[input].down = true;
      hands[input].set(grip.angle);
    });
    picture.addEventListener('pointermove', (event) => {
      if (!grip) {
        picture.style.cursor = gripped(event) >= 0 ? 'grab' : '';
        return;
      }
      const to = direction(place(event), grip.crank);
      grip.angle += Angles.wrap(to - grip.from);
      grip.from = to;
      hands[grip.input].set(grip.angle);
    });
    for (const end of ['pointerup', 'pointercancel']) {
      picture.addEventListener(end, () => {
        if (grip) hands[grip.input].down = false;
        grip = null;
      });
    }
  }

  function begin() {
    Page.keepDrawn([at('live').querySelector('figure')], () => {
      if (!linkage) return;
      canvas.fit(Picture.ink());
      draw();
    });
    at('record').addEventListener('click', () => send({ do: 'record', on: !seen.node?.recording }));
    for (const name of ['snapshot', 'reset']) at(name).addEventListener('click', () => send({ do: name }));
    turnByPointer();
    setInterval(() => { hands.forEach((hand) => hand.keep()); draw(); }, 200);
    showBanner();
    connect();
  }

  begin();
  return { state: () => seen };
})();
