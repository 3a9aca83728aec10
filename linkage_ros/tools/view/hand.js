/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* Mouse, finger and keys on the drawing: a pin is dragged, the crank is turned, a link is chosen. */

const Hand = (() => {
  const COARSE_STEP = 10; // times a fine step of a key

  /**
   * Listen on the canvas of a drawing.
   *
   * `act` has `mayEdit()`, `tool()`, `turnTo(angle or place)`, `movePin(pin, place)`, `pointed(link,
   * place)`, `choose(pin)`, `ended()` and `nudge(dx, dy)`; of a linkage in space, where
   * `isSpatial()`, `follow(point, place)` if it `follows()`, and `turned()`.
   */
  function attach(board, act) {
    const { canvas } = board;
    let held = null;

    const pixelOf = (event) => {
      const { left, top } = canvas.getBoundingClientRect();
      return [event.clientX - left, event.clientY - top];
    };

    /** Return what a press takes: a pin to be moved, or the crank; in space a point, or nothing. */
    function taken(pixel, coarse) {
      const pin = board.pinAt(pixel, coarse);
      if (act.isSpatial()) return pin && act.follows() ? { point: pin } : null;
      if (pin && act.mayEdit() && act.tool() === 'shape') return { pin };
      const link = pin ? pin.links.find(act.isDriven) : board.linkAt(pixel);
      if (link && act.isDriven(link)) return { crank: link };
      // With several links at a pin, any of them leads to the crank.
      return act.tool() === 'turn' || !act.mayEdit() ? { crank: null } : null;
    }

    canvas.addEventListener('pointerdown', (down) => {
      if (down.button || held) return;
      const pixel = pixelOf(down);
      const tool = act.tool();
      if (act.mayEdit() && (tool === 'trace' || tool === 'input')) {
        const link = board.linkAt(pixel);
        if (link) act.pointed(link, board.toPlace(pixel));
        return;
      }
      const what = taken(pixel, down.pointerType === 'touch');
      if (!what) return;
      held = { ...what, id: down.pointerId };
      canvas.setPointerCapture(down.pointerId);
      canvas.focus({ preventScroll: true }); // its keys go on from here
      if (held.pin ?? held.point) act.choose((held.pin ?? held.point).name);
      else act.turnTo(board.toPlace(pixel), true);
      down.preventDefault();
    });

    canvas.addEventListener('pointermove', (move) => {
      const pixel = pixelOf(move);
      if (!held) {
        const pin = board.pinAt(pixel, false);
        canvas.style.cursor = pin || board.linkAt(pixel) ? 'grab' : 'default';
        return;
      }
      if (move.pointerId !== held.id) return;
      if (held.pin) act.movePin(held.pin.name, board.toPlace(pixel));
      else if (held.point) act.follow(held.point, board.toPlace(pixel));
      else act.turnTo(board.toPlace(pixel), false);
    });

    for (const end of ['pointerup', 'pointercancel']) {
      canvas.addEventListener(end, (event) => {
        if (!held || event.pointerId !== held.id) return;
        const pinned = Boolean(held.pin);
        held = null;
        act.ended(pinned);
      });
    }

    if (act.isSpatial()) {
      board.listen(act.turned, (down) => !down.button
        && !taken(pixelOf(down), down.pointerType === 'touch'));
    }

    // Of the keys, those with which the chosen pin is moved; without one, they turn the crank.
    canvas.addEventListener('keydown', (event) => {
      const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
      const step = steps[event.key];
      if (step) {
        const far = event.shiftKey ? COARSE_STEP : 1;
        act.nudge(step[0] * far, step[1] * far);
      } else if (event.key === 'n' || event.key === 'p') {
        const names = board.linkage.model.pins.map((pin) => pin.name);
        const at = names.indexOf(board.chosen) + (event.key === 'n' ? 1 : -1);
        act.choose(names[(at + names.length) % names.length]);
      } else if (event.key === 'Escape') act.choose(null);
      else return;
      event.preventDefault();
      event.stopPropagation();
    });
  }

  return { attach };
})();
