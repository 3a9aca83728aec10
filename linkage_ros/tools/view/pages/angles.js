/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* How a page shows values: angles in radians or degrees, continuous or within half a turn of zero;
 * lengths in the unit of the file. */

const Angles = (() => {
  const TURN = 2 * Math.PI;
  const DEGREE = Math.PI / 180;
  const IN_DEGREES = { rad: '°', 'rad/s': '°/s' };
  const NOTHING = 1e-12; // rad or m: what is less is rounding
  const chosen = { degrees: false, wrapped: false, length: { length: 'm', factor: 1 } };

  /** Return an angle within half a turn of zero, in [rad]. */
  const wrap = (angle) => angle - TURN * Math.round(angle / TURN);

  /** Return the unit in which numbers of an SI unit are shown, and the factor to it. */
  function shown(unit) {
    const degrees = chosen.degrees && IN_DEGREES[unit];
    if (/^m(\/s)?$/.test(unit)) {
      return { unit: unit.replace('m', chosen.length.length), factor: 1 / chosen.length.factor };
    }
    return degrees ? { unit: degrees, factor: 1 / DEGREE } : { unit, factor: 1 };
  }

  /** Return an angle in [rad] as whole turns and the degrees beyond them. */
  function turnsAndDegrees(angle) {
    const turns = Math.trunc(angle / TURN);
    const rest = (angle - turns * TURN) / DEGREE;
    if (!turns) return `${rest.toFixed(2)}°`;
    const sign = angle < 0 ? '-' : '+';
    const word = Math.abs(turns) === 1 ? 'turn' : 'turns';
    return `${turns.toLocaleString('en')} ${word} ${sign} ${Math.abs(rest).toFixed(2)}°`;
  }

  /** Return a joint's value with its unit; an angle also as turns and degrees. */
  function readout(value, unit) {
    const { unit: own, factor } = shown(unit);
    const angle = chosen.wrapped && unit === 'rad' ? wrap(value) : value;
    const number = (Math.abs(angle) < NOTHING ? 0 : angle * factor).toPrecision(6);
    if (unit !== 'rad') return `${number} ${own}`;
    if (!chosen.degrees) return `${number} rad (${turnsAndDegrees(angle)})`;
    return Math.abs(angle) < TURN ? `${number}${own}` : `${number}${own} (${turnsAndDegrees(angle)})`;
  }

  return { TURN, chosen, wrap, shown, readout };
})();
