/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* Curves as a page holds them, reduced to as many points as a plot has room for. */

const Curves = (() => {
  const USUAL = 5; // times as far apart as rows are: there is nothing between them

  /** Return numbers from base64 of their bytes. */
  function unpacked(text, Kind) {
    const letters = atob(text);
    const bytes = new Uint8Array(letters.length);
    for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
    return new Kind(bytes.buffer);
  }

  /** Return the first place in sorted numbers whose number is greater than a value. */
  function above(sorted, value) {
    let low = 0;
    let high = sorted.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (sorted[middle] > value) high = middle;
      else low = middle + 1;
    }
    return low;
  }

  /** Two columns of extremes, of which every two rows become one; the first stays the first. */
  function halved(first, second) {
    const n = Math.ceil(first.length / 2);
    const one = new Float64Array(n);
    const other = new Float64Array(n);
    for (let i = 0; i < n; i++) {
      let low = NaN;
      let high = NaN;
      let lowAt = 0;
      let highAt = 0;
      for (let k = 0; k < 4; k++) {
        const from = 2 * i + (k >> 1);
        if (from >= first.length) break;
        const value = k & 1 ? second[from] : first[from];
        if (!(value >= low)) {
          if (!Number.isNaN(value)) [low, lowAt] = [value, k];
        }
        if (!(value <= high)) {
          if (!Number.isNaN(value)) [high, highAt] = [value, k];
        }
      }
      [one[i], other[i]] = lowAt <= highAt ? [low, high] : [high, low];
    }
    return [one, other];
  }

  /** Return a column of angles without the steps of a turn. */
  function unwrapped([first, second]) {
    const parts = first === second ? [first.slice()] : [first.slice(), second.slice()];
    let last = NaN;
    for (let i = 0; i < first.length; i++) {
      for (const values of parts) {
        if (!Number.isFinite(values[i])) continue;
        if (!Number.isNaN(last)) values[i] += Angles.wrap(values[i] - last) - (values[i] - last);
        last = values[i];
      }
    }
    return [parts[0], parts[parts.length - 1]];
  }

  class Level {
    constructor(begins, ends, columns) {
      this.begins = begins;
      this.ends = ends;
      this.columns = columns; // of each [first, second]
    }

    get coarser() {
      if (!this.next) {
        const n = Math.ceil(this.begins.length / 2);
        const last = this.begins.length - 1;
        const begins = new Float64Array(n);
        const ends = new Float64Array(n);
        for (let i = 0; i < n; i++) {
          begins[i] = this.begins[2 * i];
          ends[i] = this.ends[Math.min(2 * i + 1, last)];
        }
        this.next = new Level(begins, ends, this.columns.map((column) => halved(...column)));
        this.next.finer = this;
      }
      return this.next;
    }
  }

  class Group {
    constructor(said) {
      const begins = unpacked(said.begins, Float64Array);
      const ends = said.ends ? unpacked(said.ends, Float64Array) : begins;
      const columns = said.first.map((text, i) => {
        const first = unpacked(text, Float64Array);
        return [first, said.second ? unpacked(said.second[i], Float64Array) : first];
      });
      this.rows = said.rows;
      this.unwrapped = new Map();
      this.level = new Level(begins, ends, columns);
      const span = begins.length ? ends[ends.length - 1] - begins[0] : 0;
      this.usual = span / Math.max(1, said.of - 1);
      this.apart = Math.max(USUAL * this.usual, 2e-3);
    }

    /** Return the finest level of a column, and its number there; angles without steps of a turn. */
    continuous(column) {
      if (!this.unwrapped.has(column)) {
        const { begins, ends, columns } = this.level;
        this.unwrapped.set(column, new Level(begins, ends, [unwrapped(columns[column])]));
      }
      return [this.unwrapped.get(column), 0];
    }

    /** Return how far the values of a column are from each other. */
    span(column, unwrap) {
      const [level, number] = unwrap ? this.continuous(column) : [this.level, column];
      let [low, high] = [Infinity, -Infinity];
      for (const values of level.columns[number]) {
        for (const value of values) {
          if (value < low) low = value;
          if (value > high) high = value;
        }
      }
      return high - low;
    }

    /**
     * Return a part of a column.
     *
     * `from`, `to`: its times; `most`: in about so many intervals. `angle`: for angles whether they
     * jump by a turn in the record (`recorded`), and whether they shall here (`wrapped`). Returns
     * x, y and, for a point of an interval of several rows, the interval's extremes and times.
     */
    part(column, from, to, most, angle = {}) {
      const { recorded = false, wrapped = false } = angle;
      const fold = wrapped && !recorded;
      let [level, at] = recorded && !wrapped ? this.continuous(column) : [this.level, column];
      let rows = this.rows;
      let first;
      let last;
      for (;;) {
        // One more on either side, so that lines lead out of the plot.
        first = Math.max(0, above(level.ends, from) - 1);
        last = Math.min(level.begins.length, above(level.begins, to) + 1);
        if (last - first <= most) break;
        level = level.coarser;
        rows *= 2;
      }
      const found = { x: [], y: [], told: [], rows };
      let end = null; // of what was put last
      const put = (x, y, told) => {
        found.x.push(x);
        found.y.push(Number.isFinite(y) ? y : null);
        found.told.push(told);
      };
      const tear = (x) => put(x, NaN, null);
      const take = (held, i, of) => {
        let [one, other] = [held.columns[at][0][i], held.columns[at][1][i]];
        const [begin, until] = [held.begins[i], held.ends[i]];
        const torn = until - begin > this.apart + (of - 1) * this.usual;
        // Where a silence lies within, what is before it and behind it is told apart.
        if (torn && held.finer && found.x.length < 8 * most) {
          take(held.finer, 2 * i, of / 2);
          if (2 * i + 1 < held.finer.begins.length) take(held.finer, 2 * i + 1, of / 2);
          return;
        }
        const edge = other > one ? Math.PI : -Math.PI;
        const through = fold && Math.abs(Angles.wrap(other) - Angles.wrap(one) - (other - one)) > 1;
        if (fold) [one, other] = [Angles.wrap(one), Angles.wrap(other)];
        const before = found.y[found.y.length - 1];
        const turned = wrapped && (of === 1 || fold) && Math.abs(one - before) > Math.PI;
        if (end !== null && (begin - end > this.apart || turned)) tear(begin);
        end = until;
        if (of === 1) {
          put(begin, one, null);
          return;
        }
        const told = [through ? -edge : one, through ? edge : other, begin, until];
        put(begin, one, told);
        if (through) {
          put(begin, edge, told);
          tear(begin);
          put(until, -edge, told);
        } else if (torn) tear(begin);
        put(until, other, told);
      };
      for (let i = first; i < last; i++) take(level, i, rows);
      return found;
    }
  }

  return { unpacked, above, Group };
})();
