# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""
A bound of the derivatives over a range of the input, and what a table makes of it.

The range is cut into cells, each as small as it takes to enclose the loops' solution, and to bound
its derivatives by about what they are in its middle (see `cells`). At the ends of the cells, and
at the knots of a table, the closed form's values are enclosed likewise, within the cells about.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import pi, sqrt
from typing import Any, NamedTuple, NoReturn

from linkage_ros.kinematics.compiled.solve import Solver
from linkage_ros.kinematics.compiled.trace import Motion
from linkage_ros.solvers.cells import Array, Cells, enclose, Enclosure, Mask
from linkage_ros.solvers.discs import Disc, Jet, times, total
from linkage_ros.solvers.loops import Turns
from linkage_ros.solvers.task import place, refusal, Task
import numpy as np
from numpy.typing import NDArray

MOST_KNOTS = 2**20
_FEWEST_KNOTS = 4
_FIRST_CELLS = 16
_SMALLEST_CELL = 2.0**-18
"""Of the range: where that is too large to prove anything, there is a toggle, or next to one."""

_MOST_CELLS = 2**14
_PLENTY = 2**10
"""Of cells: for each so many twice as many knots cost less than cells that spare them."""

_BLOCK = 4096
_TIGHT = 1.1
"""A bound that exceeds the middle's by no more than this is not worth smaller cells."""

_ERRORS = {'linear': (2, 2.0 / 8.0), 'hermite': (4, 24.0 / 384.0)}
"""For each order the Taylor coefficient that the error goes with, and the factor."""

_ROUNDING = 2.0**-49


class _Bounds(NamedTuple):
    """
    What holds over each cell of a range.

    Attributes
    ----------
    low, high
        The cell, in the coordinate of the input.
    proven
        Whether anything does.
    bound, middle
        Of the joints' Taylor coefficient: a bound over the cell, and what it is in the middle.
    slope
        A bound of the joints' first derivative.
    unknowns, boxes
        Of all groups, (cells, unknowns): what the closed form has in the middle, and how far from
        it there is no other solution.

    """

    low: Array
    high: Array
    proven: Mask
    bound: Array
    middle: Array
    slope: Array
    unknowns: Array
    boxes: Array

    def chosen(self, cells: Any) -> _Bounds:
        """Return those of some cells, in their order."""
        return _Bounds(*(field[cells] for field in self))


def _joined(parts: Sequence[_Bounds]) -> _Bounds:
    fields: Any = zip(*parts, strict=True)
    return _Bounds(*(np.concatenate(each) for each in fields))


class RangeProof:
    """A range of the input, cut into cells that are as small as it takes."""

    def __init__(self, task: Task, low: float, high: float) -> None:
        self._task = task
        self._closed_form = _ClosedForm(task)
        self._ends = low, high
        self._unit = task.closed.scale if task.closed.linkage.inputs[0].slider else 1.0
        self._span = (high - low) / self._unit
        self._power, self._factor = _ERRORS[task.order]
        self._bounds = self._refined()

    def knots(self) -> int:
        """Return how many the derivatives ask for."""
        # The table tells whole turns apart by the mean slope of a cell.
        least = self._span * float(self._bounds.slope.max()) / (0.5 * pi)
        count = self._needed(float(self._bounds.bound.max()))
        while count < least:
            count *= 2
        return count

    def errors(self, knots: int) -> tuple[float, float]:
        """
        Return what positions and their derivatives are off by, with so many knots.

        That is interpolation; what values and slopes at the knots are off by, times what the
        polynomials make of that; and what their evaluation is rounded by.
        """
        x = np.linspace(*self._ends, knots + 1)
        found = self._task.closed.solve(x, rates=1.0, derivatives=1)
        assert found.velocities is not None
        value = slope = 0.0
        for begin in range(0, knots + 1, _BLOCK):
            block = slice(begin, begin + _BLOCK)
            at = x[block]
            enclosed = self._linked(self._bounds, at)
            for k, (turns, factor, constant) in enumerate(self._task.joints):
                joint = _joint(turns, factor, enclosed.jets, 0)
                off = found.positions[k, block] - joint.center - constant
                if self._task.closed.turning[k]:
                    off = np.remainder(off + pi, 2.0 * pi) - pi
                value = max(value, float((np.abs(off) + joint.radius).max()))
                joint = times(_joint(turns, factor, enclosed.jets, 1), 1.0 / self._unit)
                off = found.velocities[k, block] - joint.center
                slope = max(slope, float((np.abs(off) + joint.radius).max()))
        bounds = self._bounds
        h = self._span / knots
        bound = float(bounds.bound.max())
        position, rate = self._factor * h**self._power * bound + value, 2.0 * value / h
        if self._task.order == 'hermite':
            position += 0.25 * h * self._unit * slope
            rate += sqrt(3.0) / 9.0 * h**3 * bound + value / h + self._unit * slope
        else:
            rate += h * bound
        farthest = max(map(abs, self._ends)) / self._unit
        sizes = pi + farthest * float(bounds.slope.max()) + float(np.abs(found.positions).max())
        rounding = _ROUNDING * sizes
        return position + rounding, (rate + rounding / h) / self._unit

    def _refined(self) -> _Bounds:
        """Return bounds over cells no larger than they may be."""
        low, high = self._ends
        edges = np.linspace(low / self._unit, high / self._unit, _FIRST_CELLS + 1)
        done = self._over(edges[:-1], edges[1:])
        while True:
            split = ~done.proven
            if split.any():
                where = int(np.flatnonzero(split)[np.argmin((done.high - done.low)[split])])
                width = done.high[where] - done.low[where]
                if width < _SMALLEST_CELL * self._span or len(split) > _MOST_CELLS:
                    self._refuse(0.5 * (done.low[where] + done.high[where]))
            else:
                # What the middles ask for is asked for in any case: no cell need be tighter.
                knots = self._needed(float(done.middle.max()))
                allowed = self._allowed(knots << min(len(split) // _PLENTY, 8))
                split = (done.bound > allowed) & (done.bound > _TIGHT * done.middle)
            if len(split) > _MOST_CELLS or not split.any():
                done = done.chosen(np.argsort(done.low))
                for begin in range(0, len(done.low), _BLOCK):
                    block = slice(begin, begin + _BLOCK)
                    self._linked(done, done.low[block] * self._unit)
                self._linked(done, done.high[-1:] * self._unit)
                return done
            halves = done.low[split], 0.5 * (done.low[split] + done.high[split]), done.high[split]
            new = self._over(np.concatenate(halves[:2]), np.concatenate(halves[1:]))
            done = _joined([done.chosen(~split), new])

    def _needed(self, bound: float) -> int:
        """Return the fewest knots at which interpolation keeps the tolerance; a power of two."""
        knots = _FEWEST_KNOTS
        while self._allowed(knots) < bound and knots <= MOST_KNOTS:
            knots *= 2
        return knots

    def _allowed(self, knots: int) -> float:
        """Return what the Taylor coefficient may be."""
        share = 0.95 * self._task.tolerance
        return float(share / (self._factor * (self._span / knots) ** self._power))

    def _over(self, low: Array, high: Array) -> _Bounds:
        """Return the bounds over some cells, given in the coordinate of the input."""
        found = []
        for begin in range(0, len(low), _BLOCK):
            block = slice(begin, begin + _BLOCK)
            ends = low[block] * self._unit, high[block] * self._unit
            enclosed = self._enclosed(*ends, self._power)
            highest, slopes = (
                [_joint(turns, factor, enclosed.jets, k) for turns, factor, _ in self._task.joints]
                for k in (self._power, 1)
            )
            count = len(low[block])
            found.append(
                _Bounds(
                    low[block],
                    high[block],
                    enclosed.proven,
                    _largest([disc.size for disc in highest], count),
                    _largest([np.abs(disc.center) for disc in highest], count),
                    _largest([disc.size for disc in slopes], count),
                    np.concatenate([group.middle for group in enclosed.groups], axis=1),
                    np.concatenate([group.box for group in enclosed.groups], axis=1),
                )
            )
        return _joined(found)

    def _enclosed(self, low: Array, high: Array, order: int) -> Enclosure:
        """Enclose cells, given in [rad] or [m]."""
        middle = 0.5 * (low + high)
        coordinates, pins = self._closed_form.at(middle)
        # Wide enough to hold its ends, whatever was rounded.
        half = 0.5 * (high - low) / self._unit + _ROUNDING * np.abs(middle / self._unit)
        cells = Cells(middle / self._unit, half, coordinates, pins)
        with np.errstate(all='ignore'):
            enclosed = enclose(self._task.groups, cells, order)
        finite = np.isfinite(
            _largest([jet[-1].size for jet in enclosed.jets.values()], len(middle))
        )
        return enclosed._replace(proven=enclosed.proven & finite)

    def _linked(self, bounds: _Bounds, x: Array) -> Enclosure:
        """Enclose points; refuse if there is one that is not the solution of the cells about."""
        found = self._enclosed(x, x, 1)
        middle, radius, turning = (
            np.concatenate([getattr(group, name) for group in found.groups], axis=-1)
            for name in ('middle', 'radius', 'turning')
        )
        at = x / self._unit
        last = np.searchsorted(bounds.low, at, 'right') - 1
        linked = found.proven.copy()
        for cell in (last, np.where(bounds.low[last] == at, np.maximum(last - 1, 0), last)):
            off = middle - bounds.unknowns[cell]
            off = np.where(turning, np.remainder(off + pi, 2.0 * pi) - pi, off)
            held = np.abs(off) + radius + _ROUNDING < bounds.boxes[cell]
            linked &= held.all(axis=1)
        if not linked.all():
            self._refuse(float(at[~linked][0]))
        return found

    def _refuse(self, at: float) -> NoReturn:
        raise refusal(self._task, f'cannot be proven near {place(self._task, at * self._unit)}')


def _joint(turns: Turns, factor: float, jets: Mapping[int, Jet], order: int) -> Disc:
    """Return a Taylor coefficient of a published joint, without its constant."""
    found = times(total([times(jets[k][order], sign) for k, sign in turns]), factor)
    return Disc(np.real(found.center), found.radius)


def _largest(values: Sequence[Any], count: int) -> Array:
    """Return the largest of each cell."""
    found: Array = np.max([np.broadcast_to(value, (count,)) for value in values], axis=0)
    return found


class _ClosedForm:
    """Coordinates and pins of the closed form, at many values of the input."""

    def __init__(self, task: Task) -> None:
        self._numbers = [k for group in task.groups for k in group.coordinates]
        self._pins = [k for group in task.groups for k in group.pins]
        width = len(self._numbers) + 2 * len(self._pins)
        self._solver = Solver(task.closed, width, self._wanted)

    def at(self, x: Array) -> tuple[Array, NDArray[np.complex128]]:
        """Return them, each in its row, at values in [rad] or [m]."""
        found = self._solver.solve([x], derivatives=0).positions
        numbers, parts = np.split(found, [len(self._numbers)])
        coordinates = np.zeros((max(self._numbers) + 1, len(x)))
        coordinates[self._numbers] = numbers
        pins = np.zeros((max(self._pins, default=-1) + 1, len(x)), np.complex128)
        pins[self._pins] = parts[0::2] + 1j * parts[1::2]
        return coordinates, pins

    def _wanted(self, motion: Motion) -> list[list[float]]:
        if not motion.position.joints:
            return [[]]
        x, pins = motion.position.state
        places = [part for k in self._pins for part in (pins[k].real, pins[k].imag)]
        return [[*(x[k] for k in self._numbers), *places]]
