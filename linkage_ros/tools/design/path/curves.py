# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The points that a coupler curve shall pass, and the coupler curves of many four-bars at once.

A four-bar is a row of nine numbers (`COLUMNS`): the crank's pivot p, the direction φ of the
ground, the logarithms of the lengths a, b, c, d, and the traced point w in the coupler's frame. At
the crank angle θ, counted from the ground line, ::

    z = p + e^{iφ}·(a·e^{iθ} + w·e^{iβ}),   a·e^{iθ} + b·e^{iβ} = d + c·e^{iψ}.

The coupler's direction needs no angle: with D = d − a·e^{iθ} from the crank's pin to the rocker's
pivot, x = (b² + |D|² − c²)/2b and y = √(|D|² − x²) along and across b, ::

    e^{iβ} = D·(x ± i·y)/|D|²,   + where the rocker's pin is on the left of D.

Its derivatives follow from |a·e^{iθ} + b·e^{iβ} − d| = c.
Lengths along a curve are sums of chords.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import degrees, inf, isfinite, tau
from typing import NamedTuple

from linkage_ros.errors import SynthesisError
from linkage_ros.kinematics import Array, Complex, Mask
from linkage_ros.tools.design.design import FARTHEST, SHORTEST
import numpy as np
from numpy.typing import NDArray

COLUMNS = ('x', 'y', 'phi', 'ln_a', 'ln_b', 'ln_c', 'ln_d', 'w_x', 'w_y')
"""The dimensions in a row."""

LENGTHS = slice(3, 7)
POINT = slice(7, 9)
"""The slices of a row with the logarithms of the lengths, and with the traced point."""

_SPARE = 1e-9
"""Least distance of a loop from folding, relative to its longest diagonal, for its derivative."""


@dataclass(frozen=True, slots=True)
class PathTask:
    """
    Points to pass, in this order.

    Attributes
    ----------
    points
        Places in the frame of the ground, in [m]; three at least.
    closed
        Whether the path returns to its first point; then the crank turns fully.
    timing
        Crank angles at the points, in [rad], all increasing or all decreasing, within a turn; None
        if they are free.
    zero_free
        Whether only the differences of these angles count. Otherwise they are angles of the
        crank's pin itself, from the x axis.
    full_turn
        Whether the crank shall turn fully even if the path is open.
    links
        Smallest and largest length of links, and largest distance of the traced point from the
        crank's pin along x and y of the coupler, as multiples of the path's size.

    Raises
    ------
    SynthesisError
        If the definition is invalid.

    """

    points: tuple[complex, ...]
    closed: bool = False
    timing: tuple[float, ...] | None = None
    zero_free: bool = True
    full_turn: bool = False
    links: tuple[float, float] = (0.2, 4.0)

    def __post_init__(self) -> None:
        _check_points(self.points, self.closed)
        if self.timing is not None:
            _check_timing(self.timing, len(self.points), self.closed)
        shortest, longest = self.links
        if not 0.0 < shortest < longest < inf:
            raise SynthesisError(
                'links', f'from {shortest:g} to {longest:g} of the path', 'write e.g. 0.2 to 4'
            )

    @property
    def size(self) -> float:
        """Return the diagonal of the bounding box of the points, in [m]."""
        return _path_size(self.points)


def _check_points(points: tuple[complex, ...], closed: bool) -> None:
    if len(points) < 3:
        raise SynthesisError('path', f'{len(points)} points', 'give three at least')
    for number, point in enumerate(points, 1):
        if not (isfinite(point.real) and isfinite(point.imag)):
            raise SynthesisError(
                f'point {number}', f'({point.real:g}, {point.imag:g}) is not a place', 'correct it'
            )
    for number, (point, after) in enumerate(pairwise(points), 1):
        if point == after:
            raise SynthesisError(
                f'points {number} and {number + 1}',
                f'both at ({point.real:g}, {point.imag:g})',
                'leave one out',
            )
    if closed and points[0] == points[-1]:
        raise SynthesisError(
            f'point {len(points)}',
            'is the first one again',
            'leave it out: a closed path returns by itself',
        )
    if not SHORTEST <= _path_size(points) <= FARTHEST:
        reason = f'its size is {_path_size(points):g} m'
        raise SynthesisError('path', reason, f'make it {SHORTEST:g} to {FARTHEST:g} m')


def _check_timing(timing: tuple[float, ...], points: int, closed: bool) -> None:
    if len(timing) != points:
        raise SynthesisError(
            'timing', f'{len(timing)} crank angles for {points} points', 'give one for each'
        )
    steps = [after - before for before, after in pairwise(timing)]
    if not (all(step > 0.0 for step in steps) or all(step < 0.0 for step in steps)):
        raise SynthesisError(
            'timing',
            'the crank angles neither increase nor decrease throughout',
            'write on beyond 360° or below 0° where they wrap',
        )
    travel = abs(timing[-1] - timing[0])
    # A few rounding errors of degrees do not exceed a turn.
    if not travel < tau * (1.0 + 1e-12) or (closed and travel > tau * (1.0 - 1e-12)):
        raise SynthesisError(
            'timing',
            f'the crank travels {degrees(travel):g}°',
            'the points must be within one turn'
            + (', the last before the first again' if closed else ''),
        )


def _path_size(points: tuple[complex, ...]) -> float:
    x, y = [point.real for point in points], [point.imag for point in points]
    return abs(complex(max(x) - min(x), max(y) - min(y)))


class Fitted(NamedTuple):
    """Four-bars, and their crank angles at the points."""

    rows: Array  # Dimensions by `COLUMNS`, (n, 9)
    angles: Array  # Crank angles from the ground line at the points, (n, N)
    side: Array  # 1 for left and −1 for right, (n,)

    def select_rows(self, chosen: NDArray[np.intp]) -> Fitted:
        """Return the four-bars with these indices."""
        return Fitted(self.rows[chosen], self.angles[chosen], self.side[chosen])


@dataclass(frozen=True, slots=True)
class Aim:
    """The target of a fit."""

    points: Complex  # (N,), of a path around the origin whose size is 1
    timing: Array | None  # Crank angles at the points, (N,); None if they are free
    zero_free: bool  # Whether the zero of the timing is free, so that only differences count
    full_turn: bool  # Whether the loop must close at every crank angle
    # Bounds of the links; the traced point may be at most ``longest`` from the crank's pin, along
    # x and along y.
    shortest: float
    longest: float


class Slopes(NamedTuple):
    """
    Places of the traced point, (n, N), and their derivatives.

    By dimension, in the order of `COLUMNS`, they are (n, N, 9); by the crank angle θ (n, N).
    """

    places: Complex
    by_dimension: Complex
    by_angle: Complex


def coupler_directions(
    crank: Complex, b: Array, c: Array, d: Array, side: Array
) -> tuple[Complex, Array]:
    """
    Return e^{iβ}, and y², which is below 0 if the loop is open.

    ``crank`` is the vector a·e^{iθ}, (n, N); the lengths are (n, 1), and ``side`` is 1 for left
    and −1 for right, (n, 1).
    """
    diagonal = d - crank
    square = diagonal.real**2 + diagonal.imag**2
    along = (square + (b * b - c * c)) / (2.0 * b)
    across_square = square - along * along
    across = np.sqrt(np.maximum(across_square, 0.0))
    across *= side
    turned = np.empty_like(diagonal)
    turned.real = diagonal.real * along - diagonal.imag * across
    turned.imag = diagonal.real * across + diagonal.imag * along
    turned /= square
    return turned, across_square


def point_slopes(rows: Array, angles: Array, side: Array) -> Slopes:
    """Return places and derivatives of four-bars (n, 9) at crank angles (n, N)."""
    a, b, c, d = np.exp(rows[:, LENGTHS]).T[:, :, None]
    frame = np.exp(1j * rows[:, 2:3])
    point = rows[:, 7:8] + 1j * rows[:, 8:9]
    unit = np.exp(1j * angles)
    crank = a * unit
    coupler, _ = coupler_directions(crank, b, c, d, side[:, None])
    rocker = crank + b * coupler - d
    back = np.conj(rocker)
    # d(|R|²)/dβ, which vanishes where the loop folds.
    fold = -b * (back * coupler).imag
    by = np.empty((*angles.shape, len(COLUMNS)), dtype=np.complex128)
    arm = frame * point * coupler
    turn = 1j * arm / fold
    swing = frame * crank
    by[..., 0] = 1.0
    by[..., 1] = 1j
    by[..., 2] = 1j * (swing + arm)
    by[..., 3] = swing - turn * (back * crank).real
    by[..., 4] = -turn * (b * (back * coupler).real)
    by[..., 5] = turn * (c * c)
    by[..., 6] = turn * (d * rocker.real)
    by[..., 7] = frame * coupler
    by[..., 8] = 1j * by[..., 7]
    by_angle = 1j * swing + turn * (back * crank).imag
    pivot = rows[:, 0:1] + 1j * rows[:, 1:2]
    return Slopes(pivot + swing + arm, by, by_angle)


def transmission_cotangents(rows: Array, angles: Array) -> tuple[Array, Array, Array]:
    """
    Return the cotangent of the transmission angle, and its derivatives.

    It is 0 if coupler and rocker are square, and unbounded if they are in line. With cos μ = (b² +
    c² − |D|²)/2bc, d(cot μ) = d(cos μ)/sin³ μ.

    For dimensions (n, 9) and crank angles (n, N) the results are the cotangents, (n, N), their
    derivatives by dimension, (n, N, 9), and by crank angle, (n, N).
    """
    a, b, c, d = np.exp(rows[:, LENGTHS]).T[:, :, None]
    cosine, swing = np.cos(angles), 2.0 * a * d * np.sin(angles)
    square = (a - d) ** 2 + 2.0 * a * d * (1.0 - cosine)
    twice = 2.0 * b * c
    inward = (b * b + c * c - square) / twice
    sine = np.sqrt(np.maximum(1.0 - inward * inward, 1e-30))
    steep = 1.0 / (twice * sine**3)
    by = np.zeros((*square.shape, len(COLUMNS)))
    by[..., 3] = -steep * (2.0 * a * (a - d * cosine))
    by[..., 4] = steep * (b * b - c * c + square)
    by[..., 5] = steep * (c * c - b * b + square)
    by[..., 6] = -steep * (2.0 * d * (d - a * cosine))
    return inward / sine, by, -steep * swing


def extreme_diagonals(a: Array, d: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """
    Return the shortest and the longest diagonal from the crank's pin to the rocker's pivot.

    Crank angles are from the ground line, in [rad].
    """
    first, last = np.cos(low), np.cos(high)
    nearest = np.where(_contains_angle(low, high, 0.0), 1.0, np.maximum(first, last))
    farthest = np.where(_contains_angle(low, high, np.pi), -1.0, np.minimum(first, last))
    constant, factor = (a - d) ** 2, 2.0 * a * d
    return (
        np.sqrt(constant + factor * (1.0 - nearest)),
        np.sqrt(constant + factor * (1.0 - farthest)),
    )


def stay_closed(rows: Array, low: Array, high: Array) -> Mask:
    """Return which four-bars (n, 9) stay closed, and away from toggles, between two angles."""
    a, b, c, d = np.exp(rows[:, LENGTHS]).T
    shortest, longest = extreme_diagonals(a, d, low, high)
    spare = _SPARE * longest
    closed: Mask = (b + c > longest + spare) & (np.abs(b - c) < shortest - spare)
    return closed


def _contains_angle(low: Array, high: Array, angle: float) -> Mask:
    """Return whether an angle lies between two others, modulo a turn."""
    held: Mask = np.ceil((low - angle) / tau) * tau + angle <= high
    return held


def curve_distances(curves: Complex) -> Array:
    """Return the relative distance of every point along its curve, from 0 to 1, (n, M)."""
    steps = np.abs(np.diff(curves, axis=1))
    way = np.zeros(curves.shape)
    np.cumsum(steps, axis=1, out=way[:, 1:])
    way /= np.maximum(way[:, -1:], 1e-300)
    return way


def path_distances(points: Complex) -> Array:
    """Return the relative distance of points along their path, from 0 to 1, (N,)."""
    return curve_distances(points[None, :]).ravel()


def theta_at(way: Array, wanted: Array) -> Array:
    """
    Return the places at relative distances along curves, as a fraction of their steps.

    The ways are from `curve_distances`, (n, M), the distances from 0 to 1, (N,) or (n, N).
    """
    before, part = _find_segment(way, wanted)
    part += before
    part /= way.shape[1] - 1
    return part


def resample(curves: Complex, way: Array, wanted: Array) -> Complex:
    """Return the places of curves (n, M) at relative distances, on their chords, (n, N)."""
    before, part = _find_segment(way, wanted)
    start = np.take_along_axis(curves, before, axis=1)
    end = np.take_along_axis(curves, before + 1, axis=1)
    places: Complex = start + part * (end - start)
    return places


def _find_segment(
    way: Array, wanted: Array
) -> tuple[np.ndarray[tuple[int, int], np.dtype[np.int64]], Array]:
    """Return the step that holds each distance, and the fraction of that step, (n, N) both."""
    rows, last = len(way), way.shape[1] - 1
    wanted = np.broadcast_to(wanted, (rows, wanted.shape[-1]))
    # One search for all rows: each has its own range.
    offset = 2.0 * np.arange(rows)[:, None]
    index = np.searchsorted((way + offset).ravel(), (wanted + offset).ravel(), side='right')
    before = index.reshape(wanted.shape) - np.arange(rows)[:, None] * (last + 1) - 1
    before = np.clip(before, 0, last - 1)
    low = np.take_along_axis(way, before, axis=1)
    high = np.take_along_axis(way, before + 1, axis=1)
    return before, np.clip((wanted - low) / np.maximum(high - low, 1e-300), 0.0, 1.0)
