# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The crank as a function of a joint: one on each branch of the joint over the crank.

A branch is a piece of the crank's range on which the joint moves one way. It ends where the joint
turns back, or where the range ends. Let s go from 0 to 1 while the joint y goes from its lowest
value a to its highest b, so that y − a grows as s² if the joint turns back at a, and as s if it
does not; likewise at b::

    both     s = 2/π·atan2(√(y − a), √(b − y))         a only   s = √((y − a)/(b − a))
    b only   s = 1 − √((b − y)/(b − a))                neither  s = (y − a)/(b − a)

The crank is a smooth function of s, also at the ends. A slide may pass through infinity, where the
lines that it lies between are parallel: its branches end before such a pole. On branches that go
far, angles u = atan(y/c) take the place of y, a and b above, with the size c of the linkage: they
are smooth up to the pole. A table of the crank starts Newton's method on the
compiled closed form; two steps are usual. So a crank depends on y and the branch, on nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from math import atan2, ceil, floor, inf, isnan, nan, pi, remainder, sin, sqrt, tan, tau
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics.analysis.monotonic_pieces import FARTHEST, monotonic_pieces
from linkage_ros.kinematics.analysis.sweep_analysis import InputSweep
from linkage_ros.kinematics.arithmetic import UNIT_ROUNDOFF
from linkage_ros.kinematics.compiling import Compiled, OutputSelection, TracedMotion

if TYPE_CHECKING:
    from linkage_ros.kinematics.closure import Closure

_CELLS = 32
"""Cells of a table, for each turn of the crank."""

_STEPS, _LAST = 6, 1e-9
"""Most Newton steps, and the greatest last one, of a branch's width: the next is its square."""

_BISECTIONS = 120
_SAME = 1e-9
"""A joint that moves less than this does not move, in [rad] or of the linkage's size."""

_FOUND = 1e-6
"""Farthest that an output is from its wanted value at a crank that is found, likewise."""

_FLAT_SLOPE = 1e-9
"""The slope of an output that stands, of its mean slope on the branch."""

_LONG = 16.0
"""A slide that is longer, in sizes of the linkage, goes far: its table is one of angles."""

_BESIDE_TOGGLE = 1e-12
"""Distance from a toggle, of a branch's width, within which the crank is extrapolated."""

_NEAR, _NEARER = 1e-6, 1e-8
"""Fractions of the width near an end of a branch where slopes show the kind of the end."""


class Output(NamedTuple):
    """The output of a branch: a published joint."""

    name: str
    turning: bool
    number: int  # Among all published joints
    wanted: OutputSelection  # Its value, rate and acceleration, each in a group


def joint_output(closure: Closure, name: str) -> Output:
    """Return a published joint as an output."""
    number = closure.joint_names.index(name)

    def joint_values(motion: TracedMotion) -> Sequence[Sequence[float]]:
        end = number + 1
        return [part.joints[number:end] for part in motion if part is not None]

    return Output(name, closure.turning[number], number, joint_values)


class CrankBranch:
    """A piece of the crank's range on which an output moves one way; its number counts from 1."""

    def __init__(
        self,
        evaluate: OutputFunction,
        piece: Sequence[tuple[float, float]],
        number: int,
        by: tuple[str, str] = ('', ''),
        period: float = 0.0,
    ) -> None:
        self.number = number
        self.turning, self.crank_turns = evaluate.turning, evaluate.crank_turns
        self._evaluate = evaluate
        self.rises = piece[-1][1] > piece[0][1]
        # For low and high the joint whose limits end the branch there; '' if none does.
        self.by = by if self.rises else by[::-1]
        if not self.rises:
            piece = piece[::-1]
        # The extreme values of the output and their cranks; then the ends of the crank.
        (self.first, self.low), (self.last, self.high) = piece[0], piece[-1]
        self.least, self.most = sorted((self.first, self.last))
        width = self.most - self.least
        self._greatest_last = _LAST * width
        longest = max(map(abs, (self.low, self.high)))
        goes_far = not self.turning and longest > _LONG * evaluate.size
        # The size c in u = atan(y/c), of a branch that goes far; else 0.
        self._far = evaluate.size if goes_far else 0.0
        self._height = self._rise_between(self.low, self.high)
        self.endless = tuple(
            goes_far and abs(end) > 0.5 * FARTHEST * evaluate.size for end in (self.low, self.high)
        )
        """For low and high whether the branch ends there next to a pole."""
        if goes_far:
            longest = min(map(abs, (self.low, self.high)))
        rounding = UNIT_ROUNDOFF * (longest + evaluate.size)
        self.slack = 8.0 * rounding
        """A value beyond an end by no more is at the end."""
        # The turns of crank and output after which the poses repeat, in [rad]; else 0.
        self.period, self.rise = (period, self.high - self.low) if period else (0.0, 0.0)
        near = [
            [
                abs(self._slope_of_rise(*evaluate(end + share * (far_end - end))))
                for share in (_NEAR, _NEARER)
            ]
            for end, far_end in ((self.first, self.last), (self.last, self.first))
        ]
        # For both whether the output turns back there; else the range of the crank ends there.
        self.turns_back = tuple(10.0 * nearer < far for far, nearer in near)
        self.steep = tuple(nearer > 3.0 * far for far, nearer in near)
        """For both ends whether the output ends with an infinite slope: at a toggle."""
        low_back, high_back = self.turns_back
        self._lowest = self.low + rounding * low_back
        self._highest = self.high - rounding * high_back
        self.flat = _FLAT_SLOPE * self._height * (self._far or 1.0) / width
        """With a smaller slope the output stands, and the crank has no rate."""
        self._make_table(piece, near)

    def _make_table(
        self, piece: Sequence[tuple[float, float]], near: Sequence[Sequence[float]]
    ) -> None:
        """Make the table of cranks and their slopes at equal steps of s."""
        turns = ceil((self.most - self.least) / tau) if self._evaluate.crank_turns else 1
        self._cells = cells = _CELLS * max(1, turns)
        # For the cells beside a toggle: its crank and output, a crank beside it, and how far the
        # output moves up to there.
        self._steep_cells: dict[int, tuple[tuple[float, float], float, float]] = {}
        middle = 0.5 * (self.first + self.last)
        for i, is_steep, at in zip((0, cells - 1), self.steep, (piece[0], piece[-1]), strict=True):
            if is_steep:
                beside = at[0] + 2.0 * _BESIDE_TOGGLE * (middle - at[0])
                moved = self._evaluate(beside)[0] - at[1]
                moved = remainder(moved, tau) if self.turning else moved
                self._steep_cells[i] = (at, beside, abs(moved))
        self.cranks, slopes = [self.first], [0.0]
        way, height = (1.0 if self.last > self.first else -1.0), self._height
        k = 0
        for i in range(1, cells):
            y, rise = self._output_at(i / cells)
            while k < len(piece) - 2 and piece[k + 1][1] < y:
                k += 1
            (below, less), (above, more) = piece[k], piece[k + 1]
            start = below + (above - below) * ((y - less) / (more - less))
            crank, slope = self._refine_crank(y, below, above, start)
            self.cranks.append(crank)
            slopes.append(rise / abs(self._slope_of_rise(y, slope)) if slope else inf)
        self.cranks.append(self.last)
        slopes.append(0.0)
        both = all(self.turns_back)
        for index, i in enumerate((0, cells)):
            far, nearer = near[index]
            if self.turns_back[index]:
                # y = end ± k·s², and it bends by f″ = slope/distance: dθ/ds = √(2k/f″).
                bend = far / (_NEAR * (self.most - self.least))
                slopes[i] = sqrt((0.5 * pi * pi if both else 2.0) * height / bend)
            elif not self.steep[index]:
                slopes[i] = self._output_at(i / cells)[1] / nearer if nearer else inf
        tangents = []
        for i, slope in enumerate(slopes):
            # Within three times the slopes beside it, the table rises or falls everywhere.
            before, after = max(i - 1, 0), i + 2
            chords = [abs(q - p) for p, q in pairwise(self.cranks[before:after])]
            tangents.append(way * min(slope / cells, 3.0 * min(chords)))
        # A cubic on each cell, from its start.
        self._cubics = [
            (p, s, 3.0 * (q - p) - 2.0 * s - e, 2.0 * (p - q) + s + e)
            for (p, q), (s, e) in zip(pairwise(self.cranks), pairwise(tangents), strict=True)
        ]
        square = self._far * self._far
        last = self._greatest_last
        self._known = self._evaluate.fast, self.turning, square, last, self.least, self.most
        self._least_steps = self._count_steps()

    def _count_steps(self) -> int:
        """Return how many steps of Newton's method suffice in all cells."""
        most = 1
        for i in range(self._cells):
            for t in (0.25, 0.75):
                y, _ = self._output_at((i + t) / self._cells)
                crank = self._start_at(self._cubics[i], t)
                for count in range(1, _STEPS):
                    value, slope = self._evaluate(crank)
                    step = self._step_from(value, slope, y, i + t) if slope else nan
                    if isnan(step):
                        break
                    crank -= step
                    most = max(most, count)
                    if not abs(step) >= self._greatest_last:
                        break
        return most

    def _step_from(self, value: float, slope: float, y: float, place: float) -> float:
        """
        Return a step of Newton's method from an output.

        Next to a toggle at y₀ it is that for the squares of y − y₀, which the crank goes as; NaN
        too near to it.
        """
        step = self._without_turns(value - y) / slope
        if self._far:  # That for tan(u − u₀), with u of the value and u₀ of y
            square = self._far * self._far
            step = step * ((square + value * y) / (square + y * y))
        for i, ((_, end), _, moved) in self._steep_cells.items():
            inside = place > float(i) if i else place < 1.0
            way, rise = self._without_turns(y - end), self._without_turns(value - end)
            if not abs(rise) > 0.25 * moved:
                return nan
            if inside:
                step = step * (way + rise) / (2.0 * rise)
        return step

    @staticmethod
    def _start_at(cubic: Sequence[float], t: float) -> float:
        p, s, bend, twist = cubic
        return p + t * (s + t * (bend + t * twist))

    def _without_turns(self, difference: float) -> float:
        """Return a difference of outputs, without whole turns."""
        return remainder(difference, tau) if self.turning else difference

    def _rise_between(self, low: float, high: float) -> float:
        """Return the rise from one output to another: that of their angles u on a long branch."""
        far = self._far
        return atan2(far * (high - low), far * far + low * high) if far else high - low

    def _slope_of_rise(self, value: float, slope: float) -> float:
        """Return the slope of such a rise at an output with a slope."""
        far = self._far
        return slope * (far / (far * far + value * value)) if far else slope

    def _output_at(self, s: float) -> tuple[float, float]:
        """Return the output at s, and the derivative of the rise up to it by s."""
        height, end = self._height, self.low
        if all(self.turns_back):
            rise, slope = height * sin(0.5 * pi * s) ** 2, 0.5 * pi * height * sin(pi * s)
        elif self.turns_back[0]:
            rise, slope = height * s * s, 2.0 * height * s
        elif self.turns_back[1]:
            end = self.high
            rise, slope = -height * (1.0 - s) ** 2, 2.0 * height * (1.0 - s)
        else:
            rise, slope = height * s, height
        if not self._far:
            return end + rise, slope
        y = self._far * tan(atan2(end, self._far) + rise)
        return min(max(y, self.low), self.high), slope

    def _table_parameter(self, y: float) -> float:
        """Return s of a value between the ends."""
        if self.turns_back[0]:
            low = self._rise_between(self.low, y)
            if self.turns_back[1]:
                return atan2(sqrt(low), sqrt(self._rise_between(y, self.high))) * (2.0 / pi)
            return sqrt(low / self._height)
        if self.turns_back[1]:
            return 1.0 - sqrt(self._rise_between(y, self.high) / self._height)
        part: float = self._rise_between(self.low, y) / self._height
        return part

    def distance_beyond(self, y: float) -> float:
        """Return how much a value is beyond the branch, in its unit; 0 if it is reached."""
        y -= self._turns_before(y)
        away = max(self.low - y, y - self.high)
        return away if away > self.slack else 0.0

    def _turns_before(self, y: float) -> float:
        """Return the whole turns, in [rad], that are left out of a value."""
        if self.low <= y <= self.high:
            return 0.0
        if self.rise:
            return self.rise * floor((y - self.low) / self.rise)
        if self.turning:
            return tau * round((y - 0.5 * (self.low + self.high)) / tau)
        return 0.0

    def find_crank(self, y: float) -> tuple[float, float]:
        """
        Return the crank at a value that is reached, and nearly the slope of the output there.

        In [rad] or [m]; where the output turns back, the slope is 0, at a toggle infinite. Both
        are NaN where the output jumps over the value.
        """
        turns = 0.0
        if not self.low <= y <= self.high:
            before = self._turns_before(y)
            y -= before
            turns = before / self.rise * self.period if self.rise else 0.0
            turns = turns if self.rises else -turns
        if y <= self._lowest:
            return self.first + turns, 0.0 if self.turns_back[0] else inf
        if y >= self._highest:
            return self.last + turns, 0.0 if self.turns_back[1] else inf
        cells = self._cells
        place = self._table_parameter(y) * cells
        # An end belongs to the cell before it.
        i = min(max(ceil(place) - 1, 0), cells - 1)
        t = place - i
        crank = self._start_at(self._cubics[i], t)
        if place == 1.0 or i not in self._steep_cells:
            fast, turning, square, last, least, most = self._known
            for count in range(1, 1 + _STEPS):
                values = fast(crank, 1.0)
                if values is None:
                    break
                ((value,), (slope,)) = values
                off = value - y
                if turning:
                    off = remainder(off, tau)
                if not slope:
                    break
                step = off / slope
                if square:  # As in `_step_from`
                    step *= (square + value * y) / (square + y * y)
                crank -= step
                if count >= self._least_steps and -last < step < last:
                    if least <= crank <= most:
                        return crank + turns, slope
                    break
        else:
            (end, value), beside, moved = self._steep_cells[i]
            if (way := abs(y - value)) < moved:
                # So near the toggle the closed form has too few digits: the crank goes as y².
                return end + (beside - end) * (way / moved) ** 2 + turns, inf
        crank, slope = self._refine_crank(y, self.cranks[i], self.cranks[i + 1], crank)
        off = self._without_turns(self._rise_between(self._evaluate(crank)[0], y))
        if not abs(off) <= _FOUND * (1.0 if self._far else self._evaluate.size):
            return nan, nan
        return crank + turns, slope

    def state_at(self, s: float) -> tuple[float, float]:
        """Return an output and its crank at s of the table, from 0 at ``low`` to 1."""
        value, _ = self._output_at(s)
        return value, self.find_crank(value)[0]

    def near_line(self) -> tuple[float, float]:
        """
        Return constant and factor of a line c₀ + c₁·y that the crank is within half a turn of.

        It is level, unless the crank goes on with the output for a turn or more.
        """
        values = [self._output_at(k / self._cells)[0] for k in range(self._cells + 1)]
        factor = 0.0
        if self.most - self.least >= 0.999 * tau:
            factor = (self.last - self.first) / (self.high - self.low)
        apart = [crank - factor * y for crank, y in zip(self.cranks, values, strict=True)]
        return 0.5 * (min(apart) + max(apart)), factor

    def evaluate(self, crank: float) -> tuple[float, float]:
        """Return the output at a crank of the branch, and its slope there."""
        return self._evaluate(crank)

    def _refine_crank(
        self, y: float, below: float, above: float, start: float = nan
    ) -> tuple[float, float]:
        """Return the crank at a value between two others, to the last bit, and the slope."""
        crank = start
        if not min(below, above) < crank < max(below, above):
            crank = 0.5 * (below + above)
        slope, before = nan, inf
        for _ in range(_BISECTIONS):
            value, slope = self._evaluate(crank)
            off = value - y
            if self.turning:
                off = remainder(off, tau)
            if off == 0.0:
                break
            below, above = (crank, above) if off < 0.0 else (below, crank)
            step = off / slope if slope else inf
            if abs(step) <= 2.0 * UNIT_ROUNDOFF * abs(crank):
                break
            better = crank - step
            # Newton's method as long as it gains, else bisection.
            if not min(below, above) < better < max(below, above) or abs(step) > 0.5 * before:
                better = 0.5 * (below + above)
            if better in (crank, below, above):
                break
            before, crank = abs(better - crank), better
        return crank, slope


class OutputFunction:
    """
    An output over the crank, with its slope, both NaN where the linkage does not close.

    The crank is the input of ``sweep``. ``compiled`` has all published joints; without it the
    output is compiled alone.
    """

    def __init__(
        self,
        closure: Closure,
        output: Output,
        sweep: InputSweep,
        compiled: Compiled | None = None,
    ) -> None:
        self._number = output.number if compiled else 0
        self._compiled = compiled or Compiled(closure, 1, output.wanted, within_limits=False)
        self.fast: Callable[..., Any] = self._compiled.fast
        self._interpret: Callable[..., Any] = self._compiled.run_interpreted
        if len(closure.input_names) > 1:
            self.fast, self._interpret = sweep.along(self.fast), sweep.along(self._interpret)
        self.turning = output.turning
        self.crank_turns = sweep.turning
        self.size = tau if output.turning else closure.scale
        """The size of numbers that it is a difference of, in its unit."""

    def __call__(self, crank: float) -> tuple[float, float]:
        """Return the output and its slope at a crank."""
        values = self.fast(crank, 1.0)
        if values is None:
            values = self._interpret(crank, 1.0).values
        value, slope = (group[self._number] if group else nan for group in values)
        return value, slope


def crank_branches(
    closure: Closure,
    output: Output,
    *,
    limited: bool = True,
    compiled: Compiled | None = None,
    sweep: InputSweep | None = None,
) -> list[CrankBranch]:
    """
    Return the branches of an output over one input, by the crank at which they begin.

    If ``limited``, limits of joints cut them. An output that does not move raises DefinitionError.
    ``compiled`` is as in `OutputFunction`: then the branches do not look for cranks. ``sweep``
    says which of several inputs moves.
    """
    sweep = sweep or InputSweep(closure)
    evaluate = OutputFunction(closure, output, sweep, compiled)
    ranges = sweep.ranges if limited else closure.closing_ranges
    branches: list[CrankBranch] = []
    for interval in ranges:
        period = interval.highest - interval.lowest if interval.is_whole else 0.0
        for piece, turns_on in monotonic_pieces(evaluate, interval):
            if abs(piece[-1][1] - piece[0][1]) > _SAME * evaluate.size:
                by = dict(zip(interval[:2], interval.by, strict=True))
                ends = by.get(piece[0][0], ''), by.get(piece[-1][0], '')
                number, turns = len(branches) + 1, period * turns_on
                branches.append(CrankBranch(evaluate, piece, number, ends, turns))
    if ranges and not branches:
        raise DefinitionError(output.name, 'does not move with the input', 'name another joint')
    return branches


def branches_over(sweep: InputSweep, name: str) -> list[CrankBranch]:
    """Return the branches of a joint, or of what is measured, over an input; others are held."""
    closure = sweep.closure.measuring(name)
    return crank_branches(closure, joint_output(closure, name), sweep=sweep)


class Inverse(NamedTuple):
    """An output of a linkage with its branches over the crank."""

    output: Output
    branches: Sequence[CrankBranch]

    def find_cranks(self, value: float) -> list[tuple[int, float]]:
        """Return the cranks at which the output has a value, each after its branch."""
        cranks_found = []
        for branch in self.branches:
            values = [value]
            if branch.rise:  # Poses may repeat after several turns of the output.
                values = [value + tau * k for k in range(round(branch.rise / tau))]
            elif self.output.turning:
                # A branch may span several turns.
                lowest, highest = branch.low - branch.slack, branch.high + branch.slack
                turns = range(ceil((lowest - value) / tau), floor((highest - value) / tau) + 1)
                values = [value + tau * k for k in turns]
            cranks = [branch.find_crank(y)[0] for y in values if not branch.distance_beyond(y)]
            cranks_found += [(branch.number, crank) for crank in cranks if not isnan(crank)]
        return cranks_found

    def find_branch(self, number: int | None = None, near: float | None = None) -> CrankBranch:
        """Return the branch of a number, or the one nearest a crank, or the only one."""
        name, branches = self.output.name, self.branches
        if number is None and near is not None:
            return min(branches, key=lambda branch: _crank_distance(branch, near))
        for branch in branches:
            if branch.number == number or (number is None and len(branches) == 1):
                return branch
        unit = 'rad' if branches[0].crank_turns else 'm'
        choices = list_names(
            f'{b.number} ({b.least:.6g} to {b.most:.6g} {unit})' for b in branches
        )
        if number is not None:
            raise DefinitionError(
                f'branch {number}', f'{name} has no branch of this number', f'use {choices}'
            )
        raise DefinitionError(
            name,
            f'several cranks reach a value: {len(branches)} branches',
            f'name a branch, or a crank near it; branches and their cranks: {choices}',
        )


def _crank_distance(branch: CrankBranch, crank: float) -> float:
    """Return how far a crank is from a branch; one that turns is compared modulo a turn."""
    if branch.crank_turns:
        crank -= tau * round((crank - 0.5 * (branch.least + branch.most)) / tau)
    return max(branch.least - crank, crank - branch.most, 0.0)


def inverse_of(closure: Closure, name: str, limited: bool = True) -> Inverse:
    """
    Return an output with its branches; limits of joints cut them.

    Several inputs, and an output that is an input or does not move, raise DefinitionError.
    """
    if len(closure.input_names) > 1:
        raise DefinitionError(
            name, f'there are {len(closure.input_names)} inputs', 'name as many joints'
        )
    if name in closure.input_names:
        raise DefinitionError(name, 'is an input', 'name a joint that depends on it')
    output = joint_output(closure, name)
    branches = crank_branches(closure, output, limited=limited)
    if not branches:
        raise DefinitionError(name, 'nothing is within the limits', 'widen the limits')
    return Inverse(output, branches)
