/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* A linkage in motion: what its program says at inputs, for the canvas and for the curves. */

const Motion = (() => {
  const CLOSED = 2; // the greatest status with values
  const CHANGE_POINT = 1;
  const BETWEEN = 1e-9; // inputs nearer than this to a known pose have its values

  /** Poses that a server or a page has computed, for linkages whose loops are iterated. */
  class Known {
    constructor(poses = []) {
      this.poses = [];
      this.take(poses);
    }

    take(poses) {
      this.poses.push(...poses);
      this.poses.sort((one, other) => one.inputs[0] - other.inputs[0]);
    }

    /**
     * Return the pose at inputs, between the two nearest; null where there is none.
     *
     * Undefined where none is known at all with these inputs and any first one.
     */
    at([input, ...others]) {
      const poses = this.poses.filter(({ inputs }) => (
        others.every((value, i) => Math.abs(inputs[i + 1] - value) < BETWEEN)));
      if (!poses.length) return undefined;
      const after = poses.findIndex((pose) => pose.inputs[0] >= input - BETWEEN);
      if (after < 0) return null;
      const next = poses[after];
      if (after === 0 || next.inputs[0] - input < BETWEEN) return next;
      const before = poses[after - 1];
      if (!before.joints.length || !next.joints.length) return before;
      const share = (input - before.inputs[0]) / (next.inputs[0] - before.inputs[0]);
      const mix = (one, other) => one.map((value, i) => value + share * (other[i] - value));
      const found = { status: before.status };
      for (const key of ['joints', 'rates', 'accelerations', 'frames', 'frameRates']) {
        found[key] = mix(before[key], next[key]);
      }
      return found;
    }
  }

  const NEARBY = 24; // inputs to either side that are tried, to follow a hand
  const FINE = 1e-6; // of the range

  const nothing = { status: 6, joints: [], rates: [], accelerations: [], frames: [], frameRates: [] };

  class Linkage {
    constructor(model) {
      this.model = model;
      this.inputs = model.inputs.map((input) => input.value);
      this.known = new Known(model.poses ?? []);
      // The program is what the server has compiled; nothing of a file is in it but numbers.
      this.run = model.program
        ? new Function(`${model.program}\nreturn motion;`)()
        : (inputs) => this.known.at(inputs);
      this.places = new Map(model.links.map((link, i) => [link, i]));
      this.begin();
    }

    get drawn() {
      return this.model.drawn;
    }

    /** Return the corners of the picture; they stay while a pin is dragged. */
    get reach() {
      return this.frameOfPicture ?? this.reached ?? this.drawn.frame;
    }

    get times() {
      return []; // no motion is recorded
    }

    begin() {
      this.seek(this.inputs);
    }

    /** Return the motion at inputs; a first input that turns at a rate of 1, the others at rest. */
    motion(inputs) {
      return this.tell(inputs) ?? nothing;
    }

    tell(inputs) {
      const rates = inputs.map((_, i) => (i ? 0 : 1));
      return this.run(inputs, rates, inputs.map(() => 0));
    }

    seek(inputs) {
      this.inputs = [...inputs];
      const told = this.tell(this.inputs);
      // What a server is yet to tell stands where it was.
      this.now = (told === undefined ? this.now : told) ?? nothing;
      return this.now;
    }

    get closed() {
      return this.now.status <= CLOSED && this.now.frames.length > 0;
    }

    get isChangePoint() {
      return this.now.status === CHANGE_POINT;
    }

    hasPose() {
      return this.closed;
    }

    /** Return x, y and angle of the frame of a link. */
    frame(link) {
      if (link === 'ground') return [0, 0, 0];
      const at = 3 * this.places.get(link);
      return this.now.frames.slice(at, at + 3);
    }

    place(link, x, y) {
      const [left, up, angle] = this.frame(link);
      const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
      return [left + cos * x - sin * y, up + sin * x + cos * y];
    }

    /** Return the coordinates of a place in the frame of the ground. */
    coordinates(link, ...at) {
      return this.place(link, ...at);
    }

    /** Return a place in the frame of a link. */
    within(link, [x, y]) {
      const [left, up, angle] = this.frame(link);
      const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
      return [cos * (x - left) + sin * (y - up), cos * (y - up) - sin * (x - left)];
    }

    /** Return each pin with its place. */
    pins() {
      return this.model.pins.map((pin) => ({ ...pin, place: this.place(pin.link, ...pin.at) }));
    }

    /**
     * Return the first input that brings a place of a link nearest to where a hand is.
     *
     * It is sought about the input, so that the linkage does not leap to another part of its way.
     */
    following(link, at, hand) {
      const [low, high] = this.range();
      const { now, inputs: [input, ...others] } = this;
      const isWhole = this.model.inputs[0].unit === 'rad' && high - low > 2 * Math.PI - 1e-6;
      const within = (value) => (isWhole ? value : Math.min(Math.max(value, low), high));
      const far = (value) => {
        this.now = this.motion([value, ...others]);
        const place = this.closed ? this.place(link, ...at) : null;
        return place ? Math.hypot(place[0] - hand[0], place[1] - hand[1]) : Infinity;
      };
      let [found, step] = [input, (high - low) / 8];
      let least = far(found);
      for (let i = -NEARBY; i <= NEARBY; i++) {
        const value = within(input + (i * step) / NEARBY);
        const away = far(value);
        if (away < least) [found, least] = [value, away];
      }
      for (step /= NEARBY; step > FINE * (high - low); step /= 2) {
        for (const value of [within(found - step / 2), within(found + step / 2)]) {
          const away = far(value);
          if (away < least) [found, least] = [value, away];
        }
      }
      this.now = now;
      return found;
    }

    /** Return the instant centre of a link relative to the ground; null if it only slides. */
    centre(link) {
      const at = 3 * this.places.get(link);
      const [vx, vy, turn] = this.now.frameRates.slice(at, at + 3);
      if (!(Math.abs(turn) > 1e-9)) return null;
      const [x, y] = this.frame(link);
      return [x - vy / turn, y + vx / turn];
    }

    /** Return the range about the first input, in which it can be moved; a whole turn for a crank. */
    range() {
      const { ranges, inputs: [input] } = this.model;
      const value = this.inputs[0];
      const turn = input.unit === 'rad' ? 2 * Math.PI : 0;
      const found = (ranges ?? []).find(([low, high]) => {
        const shift = turn ? turn * Math.floor((value - low) / turn) : 0;
        return low <= value - shift && value - shift <= high;
      }) ?? ranges?.[0];
      if (found) return found;
      if (input.low !== null && input.high !== null) return [input.low, input.high];
      const half = turn ? Math.PI : Math.abs(value) || 1;
      return [value - half, value + half];
    }
  }

  /** A spatial linkage: what its program calls frames are the places of its drawing. */
  class Spatial extends Space.seen(Linkage) {
    spot(row) {
      const tube = this.tubes.get(row);
      if (!tube) return this.now.frames.slice(3 * row, 3 * row + 3);
      const [, start, end, length] = tube;
      const [from, to] = [this.spot(start), this.spot(end)];
      const part = Math.min(length / Math.hypot(...to.map((value, i) => value - from[i])), 0.9);
      return from.map((value, i) => value + part * (to[i] - value));
    }

    get tubes() {
      this.struts ??= new Map(this.drawn.tubes.map((tube) => [tube[0], tube]));
      return this.struts;
    }

    coordinates(row) {
      return this.spot(row);
    }

    centre() {
      return null; // a link in space turns about an axis
    }
  }

  const made = (model) => new (model.drawn.camera ? Spatial : Linkage)(model);

  return { Linkage, Known, made };
})();
