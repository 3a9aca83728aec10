# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A proof of how many knots a table needs to meet a tolerance at every input.

The error of a polynomial between knots follows from a bound of the second or fourth derivative
over the range (see `table`). The range is cut into cells, small enough to enclose the solution of
the loops over each cell (see `validated_enclosure`), and to bound its derivatives closely by their
values at its middle. The closed form is enclosed likewise at the ends of the cells and at the
knots, within the cells on both sides: so the solutions of neighbouring cells are the same, the
closed form is on this solution and on no other assembly, and the errors of its values and slopes
are bounded. The proof rests on IEEE 754 arithmetic, and on numpy's sines being accurate to 4 units
in the last place; it does not rest on samples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees, pi, remainder, sqrt, tau
from typing import Any, NamedTuple, NoReturn

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import Closure, signed_distance
from linkage_ros.kinematics.compiling import SolverOutline, TracedMotion
from linkage_ros.solvers.loops import Loops, Turns
from linkage_ros.solvers.validated_enclosure import (
    Array,
    Cells,
    Disc,
    enclose_coordinates,
    Enclosure,
    Jet,
    Mask,
    scale_disc,
    sum_discs,
)
import numpy as np
from numpy.typing import NDArray

_NEAR = 0.01
"""In [rad]: a failure nearer to a toggle than this is caused by the toggle."""

_NARROWER = 'write solver: closed_form, or a span: [low, high] that keeps away from it'

MOST_KNOTS = 2**20
_FEWEST_KNOTS = 4
_FIRST_CELLS = 16
_SMALLEST_CELL = 2.0**-18
"""Fraction of the range: if this is too large to prove anything, a toggle is there or near."""

_MOST_CELLS = 2**14
_PLENTY = 2**10
"""For each this many cells the knots may double, which costs less than still smaller cells."""

_BLOCK = 4096
_TIGHT = 1.1
"""A bound within this factor of the value at the middle needs no smaller cells."""

_ERRORS = {'linear': (2, 2.0 / 8.0), 'hermite': (4, 24.0 / 384.0)}
"""For each order the Taylor coefficient that determines the error, and its factor."""

_ROUNDING = 2.0**-49


class TableRequest(NamedTuple):
    """The table to be proven."""

    closed: Closure  # A linkage of one input, in closed form
    groups: Sequence[Loops]  # Its loops
    # Its published joints, each as factor·(Σ ±x_j) + constant.
    joints: Sequence[tuple[Turns, float, float]]
    tolerance: float  # Bound of the error, in [rad] or [m]
    order: str  # Interpolation between the knots: 'linear' or 'hermite'


def refuse_trouble(request: TableRequest, ranges: Sequence[tuple[float, float]]) -> None:
    """Refuse a range with a toggle or a change point, where no bound exists."""
    for low, high in ranges:
        for singular in request.closed.singular_inputs:
            middle = 0.5 * (low + high)
            if low <= middle - signed_distance(request.closed, middle, singular.value) <= high:
                raise unproven_error(
                    request, f'cannot be proven near {input_text(request, singular.value)}'
                )


def input_text(request: TableRequest, value: float) -> str:
    """Return a value of the input as text for a user."""
    if request.closed.linkage.inputs[0].slider:
        return f'{value:.6g} m'
    where = f'{degrees(remainder(value, tau)):.4g}°'
    near = any(
        abs(signed_distance(request.closed, value, singular.value)) < _NEAR
        for singular in request.closed.singular_inputs
    )
    return f'the toggle or change point at {where}' if near else where


def unproven_error(request: TableRequest, reason: str, remedy: str = _NARROWER) -> DefinitionError:
    """Return the error for a tolerance that is not proven."""
    # A unit in brackets is not converted to the file's: tolerances are in SI in all files.
    unit = 'rad' if any(request.closed.turning) else 'm'
    return DefinitionError(
        'solver.table', f'tolerance {request.tolerance:g} [{unit}] {reason}', remedy
    )


class _ErrorBounds(NamedTuple):
    """The bounds over each cell of a range."""

    # The cell, in the coordinate of the input.
    low: Array
    high: Array
    proven: Mask  # Whether the bounds are proven
    # Of the joints' Taylor coefficient: a bound over the cell, and its value at the middle.
    bound: Array
    middle: Array
    slope: Array  # A bound of the joints' first derivative
    # For all groups, (cells, unknowns): the closed form at the middle, and the distance within
    # which there is no other solution.
    unknowns: Array
    boxes: Array

    def choose_cells(self, cells: Any) -> _ErrorBounds:
        """Return the bounds of some cells, in their order."""
        return _ErrorBounds(*(field[cells] for field in self))


def _join_bounds(parts: Sequence[_ErrorBounds]) -> _ErrorBounds:
    fields: Any = zip(*parts, strict=True)
    return _ErrorBounds(*(np.concatenate(each) for each in fields))


class RangeProof:
    """A range of the input, cut into cells that are as small as necessary."""

    def __init__(self, request: TableRequest, low: float, high: float) -> None:
        self._request = request
        self._closed_form = _ClosedForm(request)
        self._ends = low, high
        self._unit = request.closed.scale if request.closed.linkage.inputs[0].slider else 1.0
        self._span = (high - low) / self._unit
        self._power, self._factor = _ERRORS[request.order]
        self._bounds = self._refine_cells()

    def required_knots(self) -> int:
        """Return the number of knots that the derivatives require."""
        # The mean slope of a cell determines the whole turns of the table.
        least = self._span * float(self._bounds.slope.max()) / (0.5 * pi)
        count = self._needed_knots(float(self._bounds.bound.max()))
        while count < least:
            count *= 2
        return count

    def error_bounds(self, knots: int) -> tuple[float, float]:
        """
        Return the errors of positions and of their derivatives, for a number of knots.

        They are the error of interpolation, the errors of values and slopes at the knots
        multiplied by the effect of the polynomials on them, and the rounding of the evaluation.
        """
        x = np.linspace(*self._ends, knots + 1)
        solved = self._request.closed.solve(x, rates=1.0, derivatives=1)
        assert solved.velocities is not None
        value = slope = 0.0
        for begin in range(0, knots + 1, _BLOCK):
            block = slice(begin, begin + _BLOCK)
            at = x[block]
            enclosed = self._enclose_points(self._bounds, at)
            for k, (turns, factor, constant) in enumerate(self._request.joints):
                joint = _joint_coefficient(turns, factor, enclosed.jets, 0)
                off = solved.positions[k, block] - joint.center - constant
                if self._request.closed.turning[k]:
                    off = np.remainder(off + pi, 2.0 * pi) - pi
                value = max(value, float((np.abs(off) + joint.radius).max()))
                joint = scale_disc(
                    _joint_coefficient(turns, factor, enclosed.jets, 1), 1.0 / self._unit
                )
                off = solved.velocities[k, block] - joint.center
                slope = max(slope, float((np.abs(off) + joint.radius).max()))
        bounds = self._bounds
        h = self._span / knots
        bound = float(bounds.bound.max())
        position, rate = self._factor * h**self._power * bound + value, 2.0 * value / h
        if self._request.order == 'hermite':
            position += 0.25 * h * self._unit * slope
            rate += sqrt(3.0) / 9.0 * h**3 * bound + value / h + self._unit * slope
        else:
            rate += h * bound
        farthest = max(map(abs, self._ends)) / self._unit
        sizes = pi + farthest * float(bounds.slope.max()) + float(np.abs(solved.positions).max())
        rounding = _ROUNDING * sizes
        return position + rounding, (rate + rounding / h) / self._unit

    def _refine_cells(self) -> _ErrorBounds:
        """Return bounds over cells that are small enough."""
        low, high = self._ends
        edges = np.linspace(low / self._unit, high / self._unit, _FIRST_CELLS + 1)
        done = self._bounds_over(edges[:-1], edges[1:])
        while True:
            split = ~done.proven
            if split.any():
                where = int(np.flatnonzero(split)[np.argmin((done.high - done.low)[split])])
                width = done.high[where] - done.low[where]
                if width < _SMALLEST_CELL * self._span or len(split) > _MOST_CELLS:
                    self._refuse(0.5 * (done.low[where] + done.high[where]))
            else:
                # The middles require these knots in any case: no cell need be tighter.
                knots = self._needed_knots(float(done.middle.max()))
                allowed = self._allowed_coefficient(knots << min(len(split) // _PLENTY, 8))
                split = (done.bound > allowed) & (done.bound > _TIGHT * done.middle)
            if len(split) > _MOST_CELLS or not split.any():
                done = done.choose_cells(np.argsort(done.low))
                for begin in range(0, len(done.low), _BLOCK):
                    block = slice(begin, begin + _BLOCK)
                    self._enclose_points(done, done.low[block] * self._unit)
                self._enclose_points(done, done.high[-1:] * self._unit)
                return done
            halves = done.low[split], 0.5 * (done.low[split] + done.high[split]), done.high[split]
            new = self._bounds_over(np.concatenate(halves[:2]), np.concatenate(halves[1:]))
            done = _join_bounds([done.choose_cells(~split), new])

    def _needed_knots(self, bound: float) -> int:
        """Return the fewest knots at which interpolation keeps the tolerance; a power of two."""
        knots = _FEWEST_KNOTS
        while self._allowed_coefficient(knots) < bound and knots <= MOST_KNOTS:
            knots *= 2
        return knots

    def _allowed_coefficient(self, knots: int) -> float:
        """Return the largest Taylor coefficient that is allowed for a number of knots."""
        share = 0.95 * self._request.tolerance
        return float(share / (self._factor * (self._span / knots) ** self._power))

    def _bounds_over(self, low: Array, high: Array) -> _ErrorBounds:
        """Return the bounds over cells, given in the coordinate of the input."""
        bounds = []
        for begin in range(0, len(low), _BLOCK):
            block = slice(begin, begin + _BLOCK)
            ends = low[block] * self._unit, high[block] * self._unit
            enclosed = self._enclose_cells(*ends, self._power)
            highest, slopes = (
                [
                    _joint_coefficient(turns, factor, enclosed.jets, k)
                    for turns, factor, _ in self._request.joints
                ]
                for k in (self._power, 1)
            )
            count = len(low[block])
            bounds.append(
                _ErrorBounds(
                    low[block],
                    high[block],
                    enclosed.proven,
                    _largest_values([disc.magnitude for disc in highest], count),
                    _largest_values([np.abs(disc.center) for disc in highest], count),
                    _largest_values([disc.magnitude for disc in slopes], count),
                    np.concatenate([group.middle for group in enclosed.groups], axis=1),
                    np.concatenate([group.box for group in enclosed.groups], axis=1),
                )
            )
        return _join_bounds(bounds)

    def _enclose_cells(self, low: Array, high: Array, order: int) -> Enclosure:
        """Enclose cells, given in [rad] or [m]."""
        middle = 0.5 * (low + high)
        coordinates, pins = self._closed_form.coordinates_at(middle)
        # Wide enough to hold its ends in spite of rounding.
        half = 0.5 * (high - low) / self._unit + _ROUNDING * np.abs(middle / self._unit)
        cells = Cells(middle / self._unit, half, coordinates, pins)
        with np.errstate(all='ignore'):
            enclosed = enclose_coordinates(self._request.groups, cells, order)
        finite = np.isfinite(
            _largest_values([jet[-1].magnitude for jet in enclosed.jets.values()], len(middle))
        )
        return enclosed._replace(proven=enclosed.proven & finite)

    def _enclose_points(self, bounds: _ErrorBounds, x: Array) -> Enclosure:
        """Enclose points; refuse if one is not the solution of the cells around it."""
        enclosure = self._enclose_cells(x, x, 1)
        middle, radius, turning = (
            np.concatenate([getattr(group, name) for group in enclosure.groups], axis=-1)
            for name in ('middle', 'radius', 'turning')
        )
        at = x / self._unit
        last = np.searchsorted(bounds.low, at, 'right') - 1
        linked = enclosure.proven.copy()
        for cell in (last, np.where(bounds.low[last] == at, np.maximum(last - 1, 0), last)):
            off = middle - bounds.unknowns[cell]
            off = np.where(turning, np.remainder(off + pi, 2.0 * pi) - pi, off)
            held = np.abs(off) + radius + _ROUNDING < bounds.boxes[cell]
            linked &= held.all(axis=1)
        if not linked.all():
            self._refuse(float(at[~linked][0]))
        return enclosure

    def _refuse(self, at: float) -> NoReturn:
        raise unproven_error(
            self._request, f'cannot be proven near {input_text(self._request, at * self._unit)}'
        )


def _joint_coefficient(turns: Turns, factor: float, jets: Mapping[int, Jet], order: int) -> Disc:
    """Return a Taylor coefficient of a published joint, without its constant."""
    coefficient = scale_disc(
        sum_discs([scale_disc(jets[k][order], sign) for k, sign in turns]), factor
    )
    return Disc(np.real(coefficient.center), coefficient.radius)


def _largest_values(values: Sequence[Any], count: int) -> Array:
    """Return the largest value of each cell."""
    largest: Array = np.max([np.broadcast_to(value, (count,)) for value in values], axis=0)
    return largest


class _ClosedForm:
    """Coordinates and pins of the closed form at many values of the input."""

    def __init__(self, request: TableRequest) -> None:
        self._numbers = [k for group in request.groups for k in group.coordinates]
        self._pins = [k for group in request.groups for k in group.pins]
        width = len(self._numbers) + 2 * len(self._pins)
        self._solver = SolverOutline(request.closed, width, self._wanted_numbers)

    def coordinates_at(self, x: Array) -> tuple[Array, NDArray[np.complex128]]:
        """Return coordinates and pins, a row for each, at values in [rad] or [m]."""
        rows = self._solver.solve([x], derivatives=0).positions
        numbers, parts = np.split(rows, [len(self._numbers)])
        coordinates = np.zeros((max(self._numbers) + 1, len(x)))
        coordinates[self._numbers] = numbers
        pins = np.zeros((max(self._pins, default=-1) + 1, len(x)), np.complex128)
        pins[self._pins] = parts[0::2] + 1j * parts[1::2]
        return coordinates, pins

    def _wanted_numbers(self, motion: TracedMotion) -> list[list[float]]:
        if not motion.position.joints:
            return [[]]
        x, pins = motion.position.state
        places = [part for k in self._pins for part in (pins[k].real, pins[k].imag)]
        return [[*(x[k] for k in self._numbers), *places]]


class Proven(NamedTuple):
    """The result of the proof."""

    knots: int  # Number of cells in each range
    position: float  # Bound of the error of positions, in [rad] or [m]
    rate: float  # Bound of the error of their derivatives by the input


def knots_for(request: TableRequest, ranges: Sequence[tuple[float, float]]) -> Proven:
    """
    Return the number of cells that each range of the input needs, and the proven errors.

    A range, in [rad] or [m], that holds a toggle or a change point, and a proof that takes more
    than `MOST_KNOTS`, raise DefinitionError.
    """
    refuse_trouble(request, ranges)
    proofs = [RangeProof(request, low, high) for low, high in ranges]
    knots = max(one.required_knots() for one in proofs)
    while True:
        if knots > MOST_KNOTS:
            raise unproven_error(
                request, f'takes more than {MOST_KNOTS} knots', 'write a larger tolerance'
            )
        position, rate = map(max, zip(*(one.error_bounds(knots) for one in proofs), strict=True))
        if position <= request.tolerance:
            return Proven(knots, position, rate)
        if position > 2.0 * request.tolerance:
            least = f'{position:.1g}'
            raise unproven_error(
                request, f'is finer than rounding allows here, {least}', 'write a larger tolerance'
            )
        knots *= 2
