# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
The steps in space to 80 digits, by forms of their own: law of cosines, planes of two spheres.

Rates and accelerations are differences of these values along the motion of the points, and κ is by
differences in each number that is given.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from mpmath import mp, mpf

DIGITS = 80
_UNIT_ROUNDOFF = mpf(2) ** -53
_STEP = mpf(10) ** -25

Row = list[mpf]


def moved(place: Sequence[Any], velocity: Sequence[Any], change: Sequence[Any], t: Any) -> Row:
    """Return a point at a time."""
    return [p + v * t + a * t * t / 2 for p, v, a in zip(place, velocity, change, strict=True)]


def dot(one: Sequence[Any], other: Sequence[Any]) -> Any:
    """Return the scalar product."""
    return sum(a * b for a, b in zip(one, other, strict=True))


def cross(one: Sequence[Any], other: Sequence[Any]) -> Row:
    """Return the cross product."""
    (a, b, c), (d, e, f) = one, other
    return [b * f - c * e, c * d - a * f, a * e - b * d]


def less(one: Sequence[Any], other: Sequence[Any]) -> Row:
    """Return the difference."""
    return [a - b for a, b in zip(one, other, strict=True)]


def hinge_angle(place: Row, to: Row, rod: mpf, sign: int) -> mpf:
    """Return the angle about z that brings a place to a distance from a point."""
    (a, b, h), (x, y, z) = place, to
    r, d = mp.hypot(a, b), mp.hypot(x, y)
    cosine = (r * r + d * d + (h - z) ** 2 - rod * rod) / (2 * r * d)
    return mp.atan2(y, x) - mp.atan2(b, a) + sign * mp.acos(cosine)


def slide_length(place: Row, to: Row, rod: mpf, sign: int) -> mpf:
    """Return the slide along z that brings a place to a distance from a point."""
    x, y, z = less(to, place)
    return z + sign * mp.sqrt(rod * rod - x * x - y * y)


def three_spheres(ends: Sequence[Row], rods: Sequence[Any], sign: int) -> Row:
    """Return the point of three spheres: on the line of two planes, by a quadratic equation."""
    start, one, other = ends
    d, e = less(one, start), less(other, start)
    normal = cross(d, e)
    # (X − P0)·d = (l0² − l1² + |d|²)/2, likewise e.
    sides = [
        (rods[0] ** 2 - rod**2 + dot(edge, edge)) / 2 for rod, edge in ((rods[1], d), (rods[2], e))
    ]
    square = dot(normal, normal)
    first, second = cross(e, normal), cross(normal, d)
    foot = [(sides[0] * p + sides[1] * q) / square for p, q in zip(first, second, strict=True)]
    height = mp.sqrt((rods[0] ** 2 - dot(foot, foot)) / square)
    return [s + f + sign * height * n for s, f, n in zip(start, foot, normal, strict=True)]


def errors_of(
    function: Callable[[Sequence[Any], Any], Any],
    given: Sequence[float],
    found: Sequence[float],
    floor: Any = None,
    passed: Callable[[Sequence[Any], Any], Row] | None = None,
) -> list[float]:
    """
    Return the errors of a value, its rate and its acceleration at the time 0, in u·κ.

    ``function`` takes the given numbers and the time. With a ``floor`` the value is an angle
    modulo 2π, which counts as the floor at least. ``passed`` takes both and gives the point that
    a step passes to the next one; ``function`` then takes this point instead of the time. Place,
    velocity and acceleration of the point are rounded, so each counts with its own κ.
    """
    with mp.workdps(DIGITS):
        exact = [mpf(number) for number in given]
        sizes = [abs(number) for number in exact]

        def whole(numbers: Sequence[Any], t: Any) -> Any:
            return function(numbers, passed(numbers, t) if passed else t)

        values, kappa = _orders(whole, exact), _sums_of_changes(whole, exact, sizes)
        if passed:
            parts = [partial(_part, passed, axis) for axis in range(3)]
            orders = [_orders(part, exact) for part in parts]
            spreads = [_sums_of_changes(part, exact, sizes) for part in parts]
            # The three places, then the velocities, then the accelerations.
            point, spread = (
                [one[k] for k in range(3) for one in each] for each in (orders, spreads)
            )
            widths = [abs(n) + w for n, w in zip(point, spread, strict=True)]

            def after(numbers: Sequence[Any], t: Any) -> Any:
                return function(exact, moved(numbers[:3], numbers[3:6], numbers[6:], t))

            more = _sums_of_changes(after, point, widths)
            kappa = [one + other for one, other in zip(kappa, more, strict=True)]
        off = [mpf(one) - value for one, value in zip(found, values, strict=True)]
        kappa = [abs(value) + one for value, one in zip(values, kappa, strict=True)]
        if floor is not None:
            kappa[0] += max(floor - abs(values[0]), 0)
            off[0] -= 2 * mp.pi * mp.nint(off[0] / (2 * mp.pi))
        return [
            float(abs(error) / (_UNIT_ROUNDOFF * size)) if error else 0.0
            for error, size in zip(off, kappa, strict=True)
        ]


def _orders(function: Callable[[Sequence[Any], Any], Any], numbers: Sequence[Any]) -> Row:
    """Return a value, its rate and its acceleration at the time 0."""
    before, now, after = (function(numbers, k * _STEP) for k in (-1, 0, 1))
    return [now, (after - before) / (2 * _STEP), (after - 2 * now + before) / _STEP**2]


def _sums_of_changes(
    function: Callable[[Sequence[Any], Any], Any], numbers: Sequence[Any], widths: Sequence[Any]
) -> Row:
    """Return for each order the sum of its changes, as each number changes by its width."""
    values, sums = _orders(function, numbers), [mpf(0)] * 3
    for k, width in enumerate(widths):
        if width:
            beside = list(numbers)
            beside[k] += width * mpf(10) ** -15
            changes = zip(sums, _orders(function, beside), values, strict=True)
            sums = [total + abs(one - value) * mpf(10) ** 15 for total, one, value in changes]
    return sums


def _part(function: Callable[..., Row], axis: int, numbers: Sequence[Any], t: Any) -> Any:
    return function(numbers, t)[axis]


def turn(vector: Sequence[Any], axis: Sequence[Any], angle: Any) -> Row:
    """Return a vector turned about an axis of any length (Rodrigues)."""
    size = mp.sqrt(dot(axis, axis))
    unit = [part / size for part in axis]
    c, s = mp.cos(angle), mp.sin(angle)
    along, across = dot(unit, vector), cross(unit, vector)
    return [
        c * v + s * w + (1 - c) * along * u for v, w, u in zip(vector, across, unit, strict=True)
    ]


def turned_about(point: Sequence[Any], at: Sequence[Any], axis: Sequence[Any], angle: Any) -> Row:
    """Return a point turned about an axis that passes a point."""
    return [a + v for a, v in zip(at, turn(less(point, at), axis, angle), strict=True)]


def angle_to_meet(
    point: Sequence[Any], at: Sequence[Any], axis: Sequence[Any], to: Row, rod: Any, sign: int
) -> mpf:
    """Return the angle about an axis that brings a point to a distance from another one."""
    z = [part / mp.sqrt(dot(axis, axis)) for part in axis]
    arm = less(point, at)
    x = [a - dot(arm, z) * part for a, part in zip(arm, z, strict=True)]
    x = [part / mp.sqrt(dot(x, x)) for part in x]
    frame = (x, cross(z, x), z)
    place, beside = ([dot(way, each) for way in frame] for each in (arm, less(to, at)))
    return hinge_angle(place, beside, rod, sign)


def exact_distance(one: Sequence[float], other: Sequence[float]) -> mpf:
    """Return a distance of two places."""
    with mp.workdps(DIGITS):
        between = less([mpf(part) for part in one], [mpf(part) for part in other])
        return mp.sqrt(dot(between, between))
