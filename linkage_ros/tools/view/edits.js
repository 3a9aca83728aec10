/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* What the reader has changed: texts with their inputs, back and forth, and what is not saved. */

const Edits = (() => {
  const MOST = 500;

  class History {
    constructor(text, inputs) {
      this.states = [{ text, inputs }];
      this.at = 0;
      this.saved = text;
    }

    get now() {
      return this.states[this.at];
    }

    get isSaved() {
      return this.now.text === this.saved;
    }

    /** Remember a text; the same text again has only new inputs. */
    add(text, inputs) {
      if (text === this.now.text) {
        this.now.inputs = inputs;
        return;
      }
      this.states.splice(this.at + 1);
      this.states.push({ text, inputs });
      if (this.states.length > MOST) this.states.shift();
      this.at = this.states.length - 1;
    }

    /** Go back or on by a number of steps; return the state there, or null. */
    go(by) {
      const at = this.at + by;
      if (at < 0 || at >= this.states.length) return null;
      this.at = at;
      return this.now;
    }

    can(by) {
      return this.at + by >= 0 && this.at + by < this.states.length;
    }
  }

  return { History };
})();
