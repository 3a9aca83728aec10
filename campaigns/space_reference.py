# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
The steps in space in balls of 256 bits, by forms of their own: law of cosines, planes of spheres.

Every number is a power series in time: rate and acceleration are coefficients, as in
`campaigns.series`. A tape keeps what each was made of, δy(t) = Σ slope(t)·δx(t), with
slopes that are power series as well. So one way back from a result has its derivatives by all that
is given, and with them κ.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import pi

from campaigns.series import CORRECT, ORDER, Row, Series, Tape, UNIT_ROUNDOFF
from flint import arb


def errors_of(
    result: Series,
    found: Sequence[float],
    floor: float | None = None,
    passed: Sequence[Series] = (),
) -> list[float]:
    """
    Return the errors of a value, its rate and its acceleration at the time 0, in u·κ.

    With a ``floor`` the value is an angle modulo 2π, which counts as the floor at least.
    ``passed`` are the coordinates of a point that a step passes to the next one. Its place,
    velocity and acceleration are rounded, so each counts with its own κ.
    """
    given = result.tape.widths
    kappa = result.sizes(given | {part.index: part.sizes(given) for part in passed})
    off = [arb(one) - order for one, order in zip(found, result.orders(), strict=True)]
    if floor is not None:
        kappa[0] += max(floor - abs(float(result.value[0])), 0.0)
        off[0] -= 2 * round(float(off[0]) / (2 * pi)) * arb.pi()
    errors = []
    for error, size in zip(off, kappa, strict=True):
        assert float(error.rad()) <= CORRECT * size, 'fewer than fifty digits are proven'
        errors.append(abs(float(error)) / (UNIT_ROUNDOFF * size) if error != 0 else 0.0)
    return errors


def dot(one: Row, other: Row) -> Series:
    """Return the scalar product."""
    pairs = [*zip(one, other, strict=True)]
    first, *more = (a.value * b.value for a, b in pairs)
    sources = [part for a, b in pairs for part in ((a, b.value), (b, a.value))]
    return Series(one[0].tape, sum(more, first), *sources)


def cross(one: Row, other: Row) -> Row:
    """Return the cross product."""
    (a, b, c), (d, e, f) = one, other
    return [b * f - c * e, c * d - a * f, a * e - b * d]


def less(one: Row, other: Row) -> Row:
    """Return the difference."""
    return [a - b for a, b in zip(one, other, strict=True)]


def unit(vector: Row) -> Row:
    """Return the direction of a vector."""
    size = dot(vector, vector).sqrt()
    return [part / size for part in vector]


def angle_of(x: Series, y: Series) -> Series:
    """Return the angle of a vector in a plane, by integration of its rate."""
    a, b = x.value, y.value
    over = (a * a + b * b).inv()
    turn = (a * b.derivative() - b * a.derivative()) * over
    value = turn.integral() + arb.atan2(b[0], a[0])
    return Series(x.tape, value, (x, -b * over), (y, a * over))


def hinge_angle(place: Row, to: Row, rod: Series, sign: int) -> Series:
    """Return the angle about z that brings a place to a distance from a point."""
    (a, b, h), (x, y, z) = place, to
    rest = h - z
    r, d = dot([a, b], [a, b]), dot([x, y], [x, y])
    even = r + d + (rest * rest - rod * rod)
    turn = angle_of(even, ((r * d) * 4.0 - even * even).sqrt())
    return angle_of(x, y) - angle_of(a, b) + turn * sign


def slide_length(place: Row, to: Row, rod: Series, sign: int) -> Series:
    """Return the slide along z that brings a place to a distance from a point."""
    x, y, z = less(to, place)
    return z + (rod * rod - dot([x, y], [x, y])).sqrt() * sign


def three_spheres(ends: Sequence[Row], rods: Row, sign: int) -> Row:
    """Return the point of three spheres: on the line of two planes, by a quadratic equation."""
    start, one, other = ends
    d, e = less(one, start), less(other, start)
    normal = cross(d, e)
    # (X − P0)·d = (l0² − l1² + |d|²)/2, likewise e.
    first = rods[0] * rods[0]
    sides = [
        (first - rod * rod + dot(edge, edge)) * 0.5 for rod, edge in ((rods[1], d), (rods[2], e))
    ]
    square = dot(normal, normal)
    ways = zip(cross(e, normal), cross(normal, d), strict=True)
    foot = [dot(sides, [*pair]) / square for pair in ways]
    height = ((first - dot(foot, foot)) / square).sqrt() * sign
    return [s + f + height * n for s, f, n in zip(start, foot, normal, strict=True)]


def turned_about(point: Row, at: Row, axis: Row, angle: Series) -> Row:
    """Return a point turned about an axis of any length that passes a place (Rodrigues)."""
    arm, way = less(point, at), unit(axis)
    c, s = angle.cos_sin()
    along = dot(way, arm)
    parts = zip(at, arm, cross(way, arm), way, strict=True)
    weights = [c, s, along - c * along]
    return [a + dot(weights, [*rest]) for a, *rest in parts]


def angle_to_meet(point: Row, at: Row, axis: Row, to: Row, rod: Series, sign: int) -> Series:
    """Return the angle about an axis that brings a point to a distance from another one."""
    z, arm = unit(axis), less(point, at)
    along = dot(arm, z)
    x = unit([a - along * part for a, part in zip(arm, z, strict=True)])
    frame = (x, cross(z, x), z)
    place, beside = ([dot(way, each) for way in frame] for each in (arm, less(to, at)))
    return hinge_angle(place, beside, rod, sign)


def root_near(orders: Sequence[Sequence[float]], gaps: Callable[[Row], Iterable[Series]]) -> Row:
    """Return two unknowns whose two gaps are 0, by Newton's method from found orders."""
    values = [Tape().number(*each).value for each in orders]
    while True:
        tape = Tape()
        unknowns = [Series(tape, value) for value in values]
        left = [*gaps(unknowns)]
        (a, b), (c, d) = ([gap.slopes()[one.index] for one in unknowns] for gap in left)
        over = (b * c - a * d).inv()
        rows = (d * over, -b * over), (-c * over, a * over)
        steps = [p * left[0].value + q * left[1].value for p, q in rows]
        values = [value + step for value, step in zip(values, steps, strict=True)]
        # The next step would be about the square of this one.
        if max(abs(float(step[k])) for step in steps for k in range(ORDER)) < 2.0**-90:
            return [
                Series(tape, value, *zip(left, row, strict=True))
                for value, row in zip(values, rows, strict=True)
            ]
