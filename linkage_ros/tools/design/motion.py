# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Motion generation: a four-bar whose coupler passes three poses.

Any two points of the coupler can be its pins, and any two of the ground its pivots: the poses
determine the other end of each link. A pin A of the coupler has three places in the ground,
P + e^{iθ}·a for the poses (P, θ); the centre of the circle through them is the fixed pivot. In the
frame of the coupler the fixed pivot O has three places, e^{−iθ}·(O − P), and the moving pivot is
the centre of these (L. Burmester, Lehrbuch der Kinematik, 1888).

The circle through three places A₁, A₂, A₃, with the chords u = A₂ − A₁ and v = A₃ − A₁, has its
centre at the same distance from A₁, A₂ and A₃, ::

    c = A₁ + i·(u·v² − v·u²)/(2·(u × v)).

It is computed with 20 bits more than a double: for places near a line, or near each other, u × v
keeps few digits of u and v. Its change with a small move of the places follows from |Aᵢ − c|² =
r². With n = A − c and g = n·dA, of each place, u·dc = g₂ − g₁ and v·dc = g₃ − g₁; so that ::

    dc = i·((v − u)·g₁ − v·g₂ + u·g₃)/(u × v).
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Mapping, Sequence
from itertools import combinations
from math import degrees, isfinite, remainder, tau
from typing import Any, NamedTuple, TypeAlias

from linkage_ros.errors import SynthesisError
from linkage_ros.kinematics import Array, Complex, UNIT_ROUNDOFF
from linkage_ros.tools.design.design import Design, DesignRequest, FARTHEST, FourBar
from linkage_ros.tools.design.double_double import (
    add,
    divide,
    multiply,
    sine_cosine,
    subtract,
    Twofold,
)
from linkage_ros.tools.design.proof import assemble
import numpy as np
from numpy.typing import ArrayLike

SAME = 1e-12
"""Angles nearer than this count as equal, in [rad], and places, relative to the motion."""

Place: TypeAlias = tuple[Twofold, Twofold]
"""Its x and y coordinates."""

TRUSTED = 2.0
"""Bound of a pivot's error, in units of roundoff times sensitivity: one for the rounding of the
inputs, and one for the computation, whose measured error is a third of that."""

_LONGEST = 1e9
"""In chords: the length of a longer link is indistinguishable from infinite."""

_NEAR = 1e-3
"""Places nearer than this, relative to the motion, are at the pole rather than on a line."""


class Pose(NamedTuple):
    """A wanted pose of the coupler: the origin of its frame, in [m], and its angle, in [rad]."""

    place: complex
    angle: float


def check_task(poses: Sequence[Pose], pivots: Mapping[str, complex]) -> None:
    """
    Refuse poses and pivots that no four-bar can have.

    The SynthesisError has the numbers of the poses, counted from 1, or the names of the pivots.
    """
    if len(poses) != 3:
        raise SynthesisError('poses', f'{len(poses)} were given', 'give three')
    for number, (place, angle) in enumerate(poses, 1):
        if not (abs(place) <= FARTHEST and isfinite(angle)):
            raise SynthesisError(
                f'pose {number}',
                f'({place.real}, {place.imag}), {angle} is not a pose',
                'write numbers',
            )
    for name, place in pivots.items():
        if not abs(place) <= FARTHEST:
            raise SynthesisError(
                name, f'({place.real}, {place.imag}) is not a place', 'give numbers'
            )
    spread = max(abs(first.place - second.place) for first, second in combinations(poses, 2))
    for (i, first), (j, second) in combinations(enumerate(poses, 1), 2):
        if (
            abs(remainder(first.angle - second.angle, tau)) < SAME
            and abs(first.place - second.place) <= SAME * spread
        ):
            raise SynthesisError(
                f'poses {i} and {j}',
                f'are the same, {place_text(first.place)} at {degrees(first.angle):.10g}°',
                'give each pose once',
            )
    (name, place), (other_name, other_place) = pivots.items()
    if abs(place - other_place) <= 4.0 * UNIT_ROUNDOFF * (abs(place) + abs(other_place)):
        raise SynthesisError(
            f'{name} and {other_name}',
            f'are the same place, {place_text(place)}: a link between them has no length',
            'give two places',
        )


def split_poses(poses: Sequence[Pose]) -> tuple[Complex, Array]:
    """Return the places of poses, and their angles, (3,) both."""
    return (
        np.array([pose.place for pose in poses], np.complex128),
        np.array([pose.angle for pose in poses], np.float64),
    )


def place_text(place: complex) -> str:
    """Return a place as text for a user."""
    return f'({place.real:.6g}, {place.imag:.6g}) m'


class PoleCircle(NamedTuple):
    """A circle; inf or NaN if the places lie on a line, or two of them are equal."""

    centre: Complex  # Centre, (…)
    spokes: Complex  # From the centre to the places, (…, 3)
    # Between the places, each opposite to its place: A₃ − A₂, A₁ − A₃ and A₂ − A₁, (…, 3).
    chords: Complex
    centre_derivatives: Complex  # dc/dg of each place, as above, (…, 3)


def circle_through(places: Place) -> PoleCircle:
    """Return the circle through three places, (…, 3)."""
    first, second, third = (_place_at(places, index) for index in range(3))
    u, v = _subtract_places(second, first), _subtract_places(third, first)
    with np.errstate(all='ignore'):
        cross = subtract(multiply(u[0], v[1]), multiply(u[1], v[0]))
        twice = (2.0 * cross[0], 2.0 * cross[1])
        u_square, v_square = (add(multiply(w[0], w[0]), multiply(w[1], w[1])) for w in (u, v))
        to_centre = (
            divide(subtract(multiply(v[1], u_square), multiply(u[1], v_square)), twice),
            divide(subtract(multiply(u[0], v_square), multiply(v[0], u_square)), twice),
        )
        centre = add(first[0], to_centre[0]), add(first[1], to_centre[1])
        spokes = [to_complex(_subtract_places(place, centre)) for place in (first, second, third)]
        chords = np.stack((to_complex(_subtract_places(v, u)), -to_complex(v), to_complex(u)), -1)
        pull = 1j * chords / cross[0][..., None]
    return PoleCircle(to_complex(centre), np.stack(spokes, -1), chords, pull)


def centre_sensitivity(circle: PoleCircle, own: Complex, shared: Complex) -> Array:
    """
    Return Σ|x·∂c/∂x| + ``abs(c)`` of the centre c over all inputs x; (…).

    Times 2⁻⁵³ it bounds the error of the centre that rounding the inputs alone causes. ``own`` and
    ``shared`` are x·∂A/∂x of each place: by the inputs that move only this place, (…, 3, k), and
    by the inputs that move all three, (…, 3, m).
    """
    with np.errstate(all='ignore'):
        back = np.conj(circle.spokes)[..., None]
        alone = np.abs(circle.centre_derivatives)[..., None] * np.abs((back * own).real)
        together = np.abs((circle.centre_derivatives[..., None] * (back * shared).real).sum(-2))
        total: Array = alone.sum((-2, -1)) + together.sum(-1) + np.abs(circle.centre)
    return total


def to_complex(place: Place) -> Complex:
    """Return a place as the nearest complex number."""
    complex_place = np.empty(place[0][0].shape, np.complex128)
    complex_place.real, complex_place.imag = place[0][0], place[1][0]
    return complex_place


def _place_at(places: Place, index: int) -> Place:
    (x, x_low), (y, y_low) = places
    return (x[..., index], x_low[..., index]), (y[..., index], y_low[..., index])


def _subtract_places(first: Place, second: Place) -> Place:
    return subtract(first[0], second[0]), subtract(first[1], second[1])


class MotionLinks(NamedTuple):
    """Links from fixed pivots to moving ones; any number of them at once."""

    # The computed pivots, (…), in [m]: fixed ones in the frame of the ground, moving ones in that
    # of the coupler. Infinite or NaN if there is none.
    pivots: Complex
    # From the fixed pivot to the moving one in the frame of the ground, at each pose, (…, 3).
    arms: Complex
    # Σ|x ∂p/∂x| + ``abs(p)`` of each pivot p over poses and given pivot x; (…). Times 2⁻⁵³ it
    # bounds the error of the pivot that rounding these alone causes.
    sensitivity: Array
    chords: Complex  # Between the places of the given pivot, each opposite to its place, (…, 3)

    @property
    def lengths(self) -> Array:
        """Return the lengths of the links, (…)."""
        return np.abs(self.arms[..., 0])

    @property
    def reliable_digits(self) -> Array:
        """Return the number of reliable digits of each pivot, on the scale of its link; (…)."""
        with np.errstate(all='ignore'):
            lost = TRUSTED * UNIT_ROUNDOFF * self.sensitivity / self.lengths
            digits: Array = np.clip(np.nan_to_num(-np.log10(lost), nan=0.0), 0.0, 16.0)
        return digits


def fixed_pivots(places: Complex, angles: Array, moving: ArrayLike) -> MotionLinks:
    """
    Return the links that carry moving pivots through poses, without raising errors.

    The poses are places and angles of the coupler, in [m] and [rad], (…, 3). The pivots are in the
    frame of the coupler, in [m], (…).
    """
    point = np.asarray(moving, np.complex128)[..., None]
    sine, cosine = sine_cosine(_as_twofold(angles))
    x, y = _turn_by(_as_twofold(point.real), _as_twofold(point.imag), cosine, sine)
    circles = circle_through((add(_as_twofold(places.real), x), add(_as_twofold(places.imag), y)))
    turn = cosine[0] + 1j * sine[0]
    own = np.stack(_broadcast_all(places.real, 1j * places.imag, 1j * angles * turn * point), -1)
    shared = np.stack(_broadcast_all(turn * point.real, 1j * turn * point.imag), -1)
    return MotionLinks(
        circles.centre, circles.spokes, centre_sensitivity(circles, own, shared), circles.chords
    )


def moving_pivots(places: Complex, angles: Array, fixed: ArrayLike) -> MotionLinks:
    """
    Return the links that lead from fixed pivots to poses, without raising errors.

    The poses are places and angles of the coupler, in [m] and [rad], (…, 3). The pivots are in the
    frame of the ground, in [m], (…).
    """
    point = np.asarray(fixed, np.complex128)[..., None]
    sine, cosine = sine_cosine(_as_twofold(-angles))
    x = subtract(_as_twofold(point.real), _as_twofold(places.real))
    y = subtract(_as_twofold(point.imag), _as_twofold(places.imag))
    circles = circle_through(_turn_by(x, y, cosine, sine))
    turn = cosine[0] + 1j * sine[0]
    about = -1j * angles * turn * (x[0] + 1j * y[0])
    own = np.stack(_broadcast_all(-turn * places.real, -1j * turn * places.imag, about), -1)
    shared = np.stack(_broadcast_all(turn * point.real, 1j * turn * point.imag), -1)
    arms = -np.conj(turn) * circles.spokes
    return MotionLinks(
        circles.centre, arms, centre_sensitivity(circles, own, shared), circles.chords
    )


def _turn_by(x: Twofold, y: Twofold, cosine: Twofold, sine: Twofold) -> tuple[Twofold, Twofold]:
    return (
        subtract(multiply(cosine, x), multiply(sine, y)),
        add(multiply(sine, x), multiply(cosine, y)),
    )


def _as_twofold(numbers: ArrayLike) -> Twofold:
    high = np.asarray(numbers, np.float64)
    return high, np.zeros_like(high)


def _broadcast_all(*numbers: ArrayLike) -> list[Any]:
    return list(np.broadcast_arrays(*numbers))


def from_moving_pivots(
    poses: Sequence[Pose], a: complex, b: complex
) -> tuple[Design, MotionLinks]:
    """
    Design the four-bar whose coupler has its pins at two given points.

    Parameters
    ----------
    poses
        Three poses.
    a, b
        The pins of crank and rocker, in the frame of the coupler, in [m].

    Raises
    ------
    SynthesisError
        If no link carries one of the pins through its places, or the ground has no length.

    """
    check_task(poses, {'A': a, 'B': b})
    pins = np.array((a, b))
    links = fixed_pivots(*split_poses(poses), pins)
    for index, name in enumerate('AB'):
        _check_link(poses, name, links, index, 'fixed', np.abs(pins[index]))
    _check_distance(links, 'A and B', 'fixed', 'ground')
    return _build_design(poses, links, links.pivots, pins), links


def from_fixed_pivots(
    poses: Sequence[Pose], o2: complex, o4: complex
) -> tuple[Design, MotionLinks]:
    """
    Design the four-bar whose fixed pivots are two given places.

    Parameters
    ----------
    poses
        Three poses.
    o2, o4
        The pivots of crank and rocker, in the frame of the ground, in [m].

    Raises
    ------
    SynthesisError
        If no link leads from one of the pivots to the coupler, or the coupler has no length.

    """
    check_task(poses, {'O2': o2, 'O4': o4})
    pivots = np.array((o2, o4))
    links = moving_pivots(*split_poses(poses), pivots)
    for index, name in enumerate(('O2', 'O4')):
        _check_link(poses, name, links, index, 'moving', np.abs(pivots[index]))
    _check_distance(links, 'O2 and O4', 'moving', 'coupler')
    return _build_design(poses, links, pivots, links.pivots), links


def _build_design(
    poses: Sequence[Pose], links: MotionLinks, fixed: Complex, moving: Complex
) -> Design:
    o2, o4 = (complex(pivot) for pivot in fixed)
    a, b = (complex(pivot) for pivot in moving)
    crank, rocker = (complex(length, 0.0) for length in links.lengths)
    four_bar = FourBar((o2, o4), crank, (a, b), rocker, 'left', traced=0j)
    wanted = tuple(
        DesignRequest(phase(arm), coupler=pose.angle, place=pose.place)
        for arm, pose in zip(links.arms[0].tolist(), poses, strict=True)
    )
    return assemble(Design(four_bar, wanted))


def _check_link(
    poses: Sequence[Pose], name: str, links: MotionLinks, index: int, kind: str, far: float
) -> None:
    """Refuse a pivot from which no link of constant length leads to its other end."""
    chords = np.abs(links.chords[index])
    longest = float(chords.max())
    resting = [
        f'{i + 1} and {j + 1}'
        for i, j in combinations(range(3), 2)
        if chords[3 - i - j]
        <= 16.0 * UNIT_ROUNDOFF * (abs(poses[i].place) + abs(poses[j].place) + far)
    ]
    if len(resting) == 3:
        raise SynthesisError(
            name,
            'the coupler turns about it in all three poses: its link would have no length',
            'choose another place for it',
        )
    if resting:
        raise SynthesisError(
            name,
            f'is the pole of poses {resting[0]}, about which the coupler turns from one to the '
            'other: links of any length would do',
            'choose another place for it',
        )
    digits, length = float(links.reliable_digits[index]), float(links.lengths[index])
    if digits >= 1.0 and length <= _LONGEST * longest:
        return
    if chords.min() > _NEAR * longest:
        slope = degrees(phase(complex(links.chords[index][int(chords.argmax())]))) % 180.0
        seen, slider = ('', '') if kind == 'fixed' else (', seen from the coupler,', ' of it')
        raise SynthesisError(
            name,
            f'its three places{seen} lie on a line at {slope:.4g}°, so that its {kind} pivot is '
            f'infinitely far: a slider along that line{slider} guides it, not a link',
            'choose another place for it, or turn a pose',
        )
    raise SynthesisError(
        name,
        f'is so near a pole that its {kind} pivot has no certain digit',
        'choose another place for it',
    )


def _check_distance(links: MotionLinks, names: str, kind: str, link: str) -> None:
    """Refuse two links that meet in the computed pivot."""
    first, second = (complex(pivot) for pivot in links.pivots)
    size = TRUSTED * float(links.sensitivity.sum()) + 4.0 * float(links.lengths.max())
    if abs(first - second) <= UNIT_ROUNDOFF * size:
        raise SynthesisError(
            names,
            f'have the same {kind} pivot, since the coupler only turns about it: the {link} '
            'would have no length',
            'choose other places for them, or turn a pose',
        )
