# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Starts of a path fit: random four-bars, each placed on the points as well as possible.

The shape of a coupler curve depends on few numbers. If the crank angles θ at the points are known,
with a crank of length 1, ::

    place ≈ p + q·e^{iθ} + r·e^{iβ}

is linear in p (the crank's pivot), q (the crank's length and the ground's direction) and r (the
traced point): only b, c, d, the assembly and the crank's zero are drawn. Without timing the points
are first assigned to the curve of a drawn traced point by their distance along it, and the angles
there are taken as known.

Every drawn four-bar closes on its way: d is drawn first, which gives the shortest and the longest
diagonal, then b + c above the longest and b − c between the shortest's.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import tau

from linkage_ros.kinematics import Array, Complex
from linkage_ros.tools.design.path.curves import (
    Aim,
    coupler_directions,
    curve_distances,
    extreme_diagonals,
    Fitted,
    path_distances,
    resample,
    theta_at,
)
import numpy as np

_GROUND = (-2.3, 2.3)
"""Bounds of ln(d/a): grounds from a tenth of the crank to ten cranks."""

_SPARE = (-4.0, 1.5)
"""Bounds of the logarithm of b + c minus the longest diagonal, relative to that diagonal."""

_ARM = 1.0
"""Spread of the traced point around the middle of the coupler, in coupler lengths."""

_ARC = (0.35, 6.1)
"""Bounds of the rotation of the crank along an open path, in [rad]."""

_GRID = 48
_AROUND = 32
"""Steps of the crank, and places along the curve, at which a closed path is compared."""


@dataclass(frozen=True, slots=True)
class Starts(ABC):
    """A search (see `Problem`) whose candidates are placed on the points."""

    aim: Aim

    @abstractmethod
    def sample(self, generator: np.random.Generator, count: int) -> Array:
        """Draw candidates, (count, n)."""

    @abstractmethod
    def _crank_angles(self, candidates: Array) -> Array:
        """Return the crank angles at the points for each candidate, in [rad]."""

    def score(self, candidates: Array) -> Array:
        """Return the error of each candidate, placed on the points."""
        return _fit_candidates(candidates, self._crank_angles(candidates), self.aim)[0]

    def place_candidates(self, candidates: Array) -> Fitted:
        """Return the candidates as four-bars placed on the points."""
        return _start_fits(candidates, self._crank_angles(candidates), self.aim)


@dataclass(frozen=True, slots=True)
class Timed(Starts):
    """Candidates b/a, c/a, d/a, side and the crank angle at the zero of the timing."""

    def sample(self, generator: np.random.Generator, count: int) -> Array:
        zero = generator.uniform(0.0, tau, count)
        timing = _known_timing(self.aim.timing)
        low, high = zero + timing.min(), zero + timing.max()
        return np.column_stack((_draw_bars(generator, low, high, self.aim.full_turn), zero))

    def _crank_angles(self, candidates: Array) -> Array:
        return candidates[:, 4:5] + _known_timing(self.aim.timing)


@dataclass(frozen=True, slots=True)
class Open(Starts):
    """Candidates b/a, c/a, d/a, side, the traced point, the first crank angle and the travel."""

    def sample(self, generator: np.random.Generator, count: int) -> Array:
        start = generator.uniform(0.0, tau, count)
        travel = generator.uniform(*_ARC, count) * generator.choice((-1.0, 1.0), count)
        low, high = np.minimum(start, start + travel), np.maximum(start, start + travel)
        bars = _draw_bars(generator, low, high, self.aim.full_turn)
        return np.column_stack((bars, _draw_points(generator, bars), start, travel))

    def _crank_angles(self, candidates: Array) -> Array:
        start, travel = candidates[:, 6:7], candidates[:, 7:8]
        angles = start + travel * np.linspace(0.0, 1.0, _GRID // 2)
        way = curve_distances(_coupler_curve(candidates, angles))
        return start + travel * theta_at(way, path_distances(self.aim.points))


@dataclass(frozen=True, slots=True)
class Closed(Starts):
    """Candidates b/a, c/a, d/a, side and the traced point; the start is computed."""

    def sample(self, generator: np.random.Generator, count: int) -> Array:
        bars = _draw_bars(generator, np.zeros(count), np.full(count, tau), True)
        return np.column_stack((bars, _draw_points(generator, bars)))

    def _crank_angles(self, candidates: Array) -> Array:
        """Return the angles for the rotation of the whole curve that fits the points best."""
        curve = _coupler_curve(candidates, np.linspace(0.0, tau, _GRID + 1)[None, :])
        way = curve_distances(curve)
        even = np.arange(_AROUND) / _AROUND
        spectrum = np.fft.fft(resample(curve, way, even), axis=1)
        wanted = path_distances(np.append(self.aim.points, self.aim.points[0]))
        target = resample(
            np.append(self.aim.points, self.aim.points[0])[None, :], wanted[None, :], even
        )[0]
        best = np.full(len(candidates), -1.0)
        begin = np.zeros(len(candidates))
        way_round = np.ones(len(candidates))
        # Backwards: the places at steps of −0, −1, −2 …
        for sign, places in ((1.0, target), (-1.0, np.roll(target[::-1], 1))):
            fit = np.abs(np.fft.ifft(np.conj(spectrum) * _middled_spectrum(places), axis=1))
            shift = np.argmax(fit, axis=1)
            highest = np.take_along_axis(fit, shift[:, None], axis=1)[:, 0]
            better = highest > best
            best[better] = highest[better]
            begin[better] = -shift[better] / _AROUND
            way_round[better] = sign
        goes = begin[:, None] + way_round[:, None] * wanted[:-1]
        whole = np.floor(goes)
        return tau * (whole + theta_at(way, goes - whole))


def problem_of(aim: Aim, closed: bool) -> Starts:
    """Return the search for a kind of path."""
    if aim.timing is not None:
        return Timed(aim)
    return Closed(aim) if closed else Open(aim)


def _draw_bars(generator: np.random.Generator, low: Array, high: Array, full_turn: bool) -> Array:
    """Draw b, c, d for a crank of 1, and the side, that close between these angles; (n, 4)."""
    count = len(low)
    if full_turn:
        low, high = np.zeros(count), np.full(count, tau)
    d = np.exp(generator.uniform(*_GROUND, count))
    shortest, longest = extreme_diagonals(np.ones(count), d, low, high)
    both = longest * (1.0 + np.exp(generator.uniform(*_SPARE, count)))
    more = shortest * generator.uniform(-1.0, 1.0, count)
    side = generator.choice((-1.0, 1.0), count)
    return np.column_stack((0.5 * (both + more), 0.5 * (both - more), d, side))


def _draw_points(generator: np.random.Generator, bars: Array) -> Array:
    spread: Array = generator.normal(0.0, _ARM, (len(bars), 2))
    spread[:, 0] += 0.5
    return bars[:, :1] * spread


def _coupler_curve(candidates: Array, angles: Array) -> Complex:
    crank = np.exp(1j * angles)
    coupler = _coupler_vectors(candidates, crank)
    curve: Complex = crank + (candidates[:, 4:5] + 1j * candidates[:, 5:6]) * coupler
    return curve


def _coupler_vectors(candidates: Array, crank: Complex) -> Complex:
    b, c, d, side = candidates[:, :4].T[:, :, None]
    return coupler_directions(crank, b, c, d, side)[0]


def _fit_candidates(candidates: Array, angles: Array, aim: Aim) -> tuple[Array, Complex, Complex]:
    """
    Return the remaining squares, q and r: least squares, solved in closed form.

    A four-bar with a length outside of the bounds has inf.
    """
    crank = np.exp(1j * angles)
    coupler = _coupler_vectors(candidates, crank)
    crank = crank - crank.mean(1, keepdims=True)
    coupler = coupler - coupler.mean(1, keepdims=True)
    target = aim.points - aim.points.mean()
    cranks, couplers = _square(crank).sum(1), _square(coupler).sum(1)
    shared = np.einsum('ij,ij->i', np.conj(crank), coupler)
    on_crank, on_coupler = np.conj(crank) @ target, np.conj(coupler) @ target
    with np.errstate(all='ignore'):
        if aim.timing is not None and not aim.zero_free:
            # The crank's direction is given: q lies along one direction, only its size is free.
            onward = np.exp(-1j * candidates[:, 4])
            own = cranks - _square(shared) / couplers
            part = on_crank - shared * on_coupler / couplers
            q = onward * (np.conj(onward) * part).real / own
            r = (on_coupler - np.conj(shared) * q) / couplers
            out = (np.conj(onward) * part).real <= 0.0
        else:
            whole = cranks * couplers - _square(shared)
            q = (couplers * on_crank - shared * on_coupler) / whole
            r = (cranks * on_coupler - np.conj(shared) * on_crank) / whole
            out = np.zeros(len(q), dtype=bool)
        left = _square(target).sum() - (np.conj(q) * on_crank + np.conj(r) * on_coupler).real
        a = np.abs(q)
        lengths = np.column_stack((np.ones(len(a)), candidates[:, :3]))
        out |= lengths.min(1) * a < aim.shortest
        out |= lengths.max(1) * a > aim.longest
        out |= np.abs(r) > aim.longest
    return np.where(out | ~np.isfinite(left), np.inf, np.maximum(left, 0.0)), q, r


def _start_fits(candidates: Array, angles: Array, aim: Aim) -> Fitted:
    _, q, r = _fit_candidates(candidates, angles, aim)
    crank = np.exp(1j * angles)
    coupler = _coupler_vectors(candidates, crank)
    pivot = (aim.points - q[:, None] * crank - r[:, None] * coupler).mean(1)
    lengths = np.abs(q)[:, None] * np.column_stack((np.ones(len(q)), candidates[:, :3]))
    point = r * np.exp(-1j * np.angle(q))
    rows = np.column_stack(
        (pivot.real, pivot.imag, np.angle(q), np.log(lengths), point.real, point.imag)
    )
    return Fitted(rows, angles, candidates[:, 3])


def _square(values: Complex) -> Array:
    squares: Array = values.real**2 + values.imag**2
    return squares


def _middled_spectrum(places: Complex) -> Complex:
    spectrum = np.fft.fft(places)
    spectrum[0] = 0.0
    return spectrum


def _known_timing(timing: Array | None) -> Array:
    if timing is None:
        raise TypeError('a timed search of a path without timing')
    return timing
