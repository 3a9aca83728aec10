/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* The field for a need: it shows the cheapest answer that reaches it. */
'use strict';

(() => {
  const input = document.getElementById('need');
  if (!input) return;
  const output = document.getElementById('answer');

  function show() {
    const need = Number(input.value.trim().replace(',', '.'));
    // From the greatest error to the least: the first that is small enough is the cheapest.
    const found = Page.data.answers.find(({ error }) => error <= need);
    output.textContent = need > 0 && found ? found.text : 'write a number above 0, such as 1e-3';
  }

  input.addEventListener('input', show);
  input.closest('.field').hidden = false;
  show();
})();
