/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* The field "the accuracy that I need": input and answers, from the answers in the page. */
'use strict';

(() => {
  const ROWS = [
    ['write', 'write into the scene'],
    ['tick', 'a tick then costs'],
    ['rate', 'tick rates that make use of it'],
  ];

  function made(tag, text, attributes) {
    const element = Object.assign(document.createElement(tag), attributes);
    element.textContent = text;
    return element;
  }

  function answer(replies, text) {
    const wanted = Number(text.trim().replace(',', '.'));
    if (!(wanted > 0) || wanted === Infinity) return null;
    const degrees = ((wanted * 180) / Math.PI).toPrecision(2);
    // The first answer holds from 0.
    const reply = replies.filter((each) => each.accuracy <= wanted).pop();
    return [['that is', `${Number(degrees)}°`], ...ROWS.map(([key, name]) => [name, reply[key]])];
  }

  function fill(place) {
    const scenes = JSON.parse(place.dataset.replies);
    const names = Object.keys(scenes);
    const label = made('label', 'The accuracy that I need: ');
    const input = made('input', '', { value: '0.001', size: 8, inputMode: 'decimal' });
    const chosen = made('select', '', { ariaLabel: 'scene' });
    chosen.append(...names.map((name) => made('option', name, { value: name })));
    const output = made('dl', '');
    output.setAttribute('aria-live', 'polite');
    function show() {
      const lines = answer(scenes[chosen.value], input.value);
      const shown = lines || [['not a number above 0', 'write 0.001, or 1e-6']];
      output.replaceChildren(
        ...shown.flatMap(([name, text]) => [made('dt', name), made('dd', text)]),
      );
    }
    input.addEventListener('input', show);
    chosen.addEventListener('change', show);
    label.append(input, ' rad');
    place.replaceChildren(label, ...(names.length > 1 ? [' of ', chosen] : []), output);
    show();
  }

  document.querySelectorAll('.wanted[data-replies]').forEach(fill);
})();
