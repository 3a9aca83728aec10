# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The solution curve of links that Newton's method solves, followed without jumping to another one.

The n constraints F(u, x) = 0 on n unknowns u and one input x define a curve of points z = (u, x).
The curve is followed by its length, so a toggle, where it turns back in x, is not a special point.
A cell leads from one solution to the next; s is the distance along the tangent at its first node,
and the cubic c(s) has the places and tangents of both nodes. Let B be the Jacobian of F and of s
at c(s). A cell is accepted only if the theorem of Kantorovich proves at its quarters that c(s)
leads to one solution::

    η·ω ≤ 1/4    η = |B⁻¹·(F, 0)|, the first step of Newton's method    ω a bound of |B⁻¹·B'|

(≤ 1/2 is needed.) Had the cell led to another assembly, its cubic would lie between two solutions,
and neither would be the only one near it. The bound over the unknowns comes from the lengths of
the links; how the known links change B with x is estimated from the ends of the cell.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import inf, nextafter, remainder, sqrt, tau
from typing import NamedTuple, Protocol

from linkage_ros.kinematics.arithmetic import SMALLEST, UndecidedError, UNIT_ROUNDOFF
from linkage_ros.kinematics.batch import Array, Mask
from linkage_ros.kinematics.built_once import BUILD_LOCK
from linkage_ros.kinematics.iterated.start_table import StartRow
from linkage_ros.kinematics.iterated.straight_line import list_numbers
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState
from linkage_ros.progress import tell_progress
import numpy as np

_PROVEN, _AIMED = 0.25, 0.1
"""Largest η·ω that is accepted, and what the step size aims at: it grows with its 4th power."""

_SECOND = 8.0
"""How often the next step at most is in the unit of an unknown."""

_LONGEST = 0.25
_SHORTEST = 2.0**-36
"""Bounds of a step, in [rad] or lengths; the longest grows with the distance of the links."""

_MOST_CELLS = 2**13
"""Cells of one call: about 27 are usual for a turn, 300 for links that go far away on lines."""

_AWAY = 2.0**20
"""In lengths: links that are so far away, on lines that become parallel, do not come back."""

_FAR, _STILL = 2.0**10, 2.0**-46
"""In lengths: so far away they end where the input moves by less than this part of their way."""

_AWAY_FROM_POSE = 32.0
"""As often as far as in the pose, or as a length: there no start is looked for at any price."""

_STRAIGHT = 0.25
"""Largest departure of the slope of x from a straight line in a cell, relative to its change."""

_ACCEPTED = 256.0 * UNIT_ROUNDOFF
"""Largest residual of a constraint at a solution, relative to the size of the coordinates."""

_TOOTH = 1.0 / 16.0
"""Largest residual of a ratio at the start of a step, relative to its period; a step that is twice
as long is off by four times as much, and so is refused before it could reach the next tooth."""

_MOST_TURNS = 64
_MOST_LAPS = 32
"""Laps of a slide: each is twice as long as the one before."""

_SAME = 1e-9
"""Largest difference of known places and angles that count as equal."""

_LAST_FLOATS = 32.0 * UNIT_ROUNDOFF
"""Relative to the input, or to 1: how near its end a toggle and its neighbours look alike."""

_NEXT_TO_END = 2.0**-10
"""In [rad] or lengths: how far links may move while the links before are next to a toggle."""


class BranchCurve(Protocol):
    """As many equations as unknowns, which one input moves; a place has the input after these."""

    @property
    def angles(self) -> Mask:
        """Return for each unknown whether it is an angle; the others are lengths."""

    def known_at(self, x: float) -> LinkState | None:
        """Return the state of the links solved before; None where they do not close."""

    def evaluate(self, place: Array) -> tuple[Array, Array] | None:
        """
        Return the residuals, and their derivatives by unknowns and input.

        None where the links before have no rates.
        """

    def bound_changes(self, place: Array) -> Callable[[Array], Array]:
        """
        Return a function that bounds the change of the derivatives by unknowns, entry by entry.

        It takes the largest change of each unknown from a place, in either direction.
        """

    def is_meshed(self, off: Array, part: float) -> bool:
        """Return whether the residuals of ratios are off by less than a part of their periods."""


class BranchNode(NamedTuple):
    """A point of the curve: the unknowns followed by the input, and the unit tangent there."""

    place: Array
    tangent: Array


class Cell(NamedTuple):
    """A piece of the curve, from one node to the next."""

    # The nodes.
    begin: BranchNode
    end: BranchNode
    width: float  # Distance of the end along the tangent at the begin
    folds: bool = False  # Whether the curve turns back in x at the end

    def control_points(self) -> Array:
        """Return the four control points of the cubic, as rows."""
        (z, t), (z_end, t_end), h = self.begin, self.end, self.width
        ahead = t_end * (h / 3.0 / float(t @ t_end))
        return np.array([z, z + t * (h / 3.0), z_end - ahead, z_end])

    def point_at(self, part: float) -> Array:
        """Return the point of the cubic at a fraction of the width, from 0 to 1."""
        p, r = part, 1.0 - part
        weights = np.array([r * r * r, 3.0 * r * r * p, 3.0 * r * p * p, p * p * p])
        return weights @ self.control_points()

    def part_of(self, x: float) -> float:
        """Return the fraction of the width at which the cubic has an input."""
        a, b, c, d = (float(value) - x for value in self.control_points()[:, -1])
        low, high = 0.0, 1.0
        rising = d > a
        part = a / (a - d) if a != d else 0.0
        for _ in range(60):
            r = 1.0 - part
            value = r * r * (r * a + 3.0 * part * b) + part * part * (3.0 * r * c + part * d)
            if value == 0.0:
                break
            if (value > 0.0) == rising:
                high = part
            else:
                low = part
            slope = 3.0 * (r * r * (b - a) + 2.0 * r * part * (c - b) + part * part * (d - c))
            new = part - value / slope if slope else inf
            if not low < new < high:
                new = 0.5 * (low + high)
            if abs(new - part) <= 1e-15:
                break
            part = new
        return part


@dataclass(frozen=True, slots=True)
class Continuation:
    """Follows the solutions of equations while one input changes."""

    curve: BranchCurve

    def first_node(self, unknowns: Array, x: float) -> BranchNode | None:
        """Return the node at a solution, with its tangent towards larger inputs."""
        system = self.curve.evaluate(np.append(unknowns, x))
        if system is None:
            return None
        _, slopes = system
        tangent = np.linalg.svd(slopes)[2][-1]
        return BranchNode(np.append(unknowns, x), tangent if tangent[-1] >= 0.0 else -tangent)

    def farthest(self, node: BranchNode) -> float:
        """Return the largest length among the unknowns."""
        return float(np.abs(node.place[:-1][~self.curve.angles]).max(initial=0.0))

    def is_isolated(self, node: BranchNode, away: Array) -> bool:
        """Return whether a node's solution is the only one at its input within a distance."""
        system = self.curve.evaluate(node.place)
        change = self.curve.bound_changes(node.place)(away)
        if system is None:
            return False
        slopes = system[1][:, :-1]
        if not self.curve.is_meshed(np.abs(slopes) @ away, 0.25):
            return False
        try:
            inverse = np.linalg.inv(slopes)
        except np.linalg.LinAlgError:
            return False
        return bool((np.abs(inverse) @ change).sum(axis=1).max() < 1.0)

    def follow_cells(self, node: BranchNode, sign: float, last: float) -> Iterator[Cell]:
        """
        Yield cell after cell, up to a toggle or to an input that must not be passed.

        They also end where no cell is proven to hold a single curve, as where two curves cross.
        The sign is +1 towards larger inputs.
        """
        if node.tangent[-1] * sign < 0.0:
            node = BranchNode(node.place, -node.tangent)
        step = 2.0**-5
        count = 0
        while sign * (last - node.place[-1]) > 0.0 and count < _MOST_CELLS:
            far = self.farthest(node)
            if far > _AWAY or (far > _FAR and abs(node.tangent[-1]) < _STILL):
                return
            step = min(step, _LONGEST * max(1.0, far))
            left = sign * (last - node.place[-1])
            slope = sign * float(node.tangent[-1])
            whole = slope > 0.0 and step * slope >= 0.9 * left
            cell, growth = self._next_cell(node, step, last if whole else None)
            if cell is not None and sign * (cell.end.place[-1] - last) > 0.0:
                cell, growth = None, 0.5
            if cell is None:
                step *= growth
                if step < _SHORTEST:
                    return
                continue
            if sign * float(cell.end.tangent[-1]) <= 0.0:
                yield self._fold_cell(cell)
                return
            yield cell
            count += 1
            node = cell.end
            step = cell.width * growth

    def _next_cell(
        self, node: BranchNode, step: float, last: float | None
    ) -> tuple[Cell | None, float]:
        """
        Return the next cell or None, and the factor by which to change the step.

        If ``last`` is given, the cell ends at that input.
        """
        z, tangent = node
        if last is None:
            row, goal = tangent, float(tangent @ z) + step
            start = z + step * tangent
        else:
            row, goal = np.zeros_like(z), last
            row[-1] = 1.0
            start = z + tangent * ((last - z[-1]) / tangent[-1])
            start[-1] = last
        place = self._correct_onto(start, row, goal)
        if place is None:
            return None, 0.25
        end = self._make_node(place, tangent)
        if end is None:
            return None, 0.25
        cell = Cell(node, end, float(tangent @ (place - z)))
        facing = float(tangent @ end.tangent)
        if facing < 0.5 or cell.width <= 0.0 or not self._turns_at_most_once(cell):
            return None, 0.5
        proof = self._proof(cell)
        if not proof <= _PROVEN:
            return None, max(0.1, min(0.7, (_AIMED / proof) ** 0.25))
        return cell, min(2.0, (_AIMED / max(proof, SMALLEST)) ** 0.25)

    def _turns_at_most_once(self, cell: Cell) -> bool:
        """Return whether x changes in one direction within a cell, or turns back only once."""
        a, b, c, d = cell.control_points()[:, -1].tolist()
        begin, middle, end = b - a, c - b, d - c
        most = max(min(abs(begin), abs(end)), abs(begin - end))
        return bool(abs(middle - 0.5 * (begin + end)) <= _STRAIGHT * most)

    def _proof(self, cell: Cell) -> float:
        """Return η·ω, the largest at the quarters of a cell; infinite where there is none."""
        worst, bends = 0.0, None
        for part in (0.5, 0.25, 0.75):  # Where it fails first
            place = cell.point_at(part)
            system = self.curve.evaluate(place)
            if bends is None and system is not None:
                bends = self._bends_by_input(cell, place, system[1])
            if system is None or bends is None:
                return inf
            proof = self._proof_at(place, *system, cell.begin.tangent, bends)
            if not proof <= _PROVEN:
                return proof
            worst = max(worst, proof)
        return worst

    def _bends_by_input(self, cell: Cell, middle: Array, slopes: Array) -> Array | None:
        """Return how fast the derivatives change with the input, from the ends of a cell."""
        bends = np.zeros_like(slopes)
        for end in cell[:2]:
            beside = np.append(middle[:-1], end.place[-1])
            there, way = self.curve.evaluate(beside), float(abs(end.place[-1] - middle[-1]))
            if there is None:
                return None
            if way:
                bends = np.maximum(bends, np.abs(there[1] - slopes) / way)
        return bends

    def _proof_at(
        self, place: Array, errors: Array, slopes: Array, row: Array, bends: Array
    ) -> float:
        """
        Return η·ω of Kantorovich's theorem at a place, along a row; infinite where there is none.

        As in `GridGroup.proof` the better of two units counts.
        """
        n = len(errors)
        try:
            inverse = np.linalg.inv(np.vstack([slopes, row]))
        except np.linalg.LinAlgError:
            return inf
        steps = np.abs(inverse[:, :n] @ errors) + SMALLEST
        inverse, bound_change = np.abs(inverse[:, :n]), self.curve.bound_changes(place)

        def changes_within(units: Array) -> Array:
            """Return how much the step may change by these changes."""
            own, by = units[:n], float(units[n])
            mixed, alone = bends[:, :n] @ own, bends[:, n]
            return inverse @ (bound_change(own) @ own + by * (2.0 * mixed + by * alone))

        even = np.full(n + 1, steps.max())
        fitted = steps + _SECOND * changes_within(steps)
        return min(float((changes_within(units) / units).max()) for units in (even, fitted))

    def _fold_cell(self, cell: Cell) -> Cell:
        """Return the part of a cell before the point where x turns back."""
        z, tangent = cell.begin
        low, high = (0.0, float(tangent[-1])), (cell.width, float(cell.end.tangent[-1]))
        end, width = cell.end, cell.width
        for _ in range(60):
            width = (low[0] * high[1] - high[0] * low[1]) / (high[1] - low[1])
            if not low[0] < width < high[0]:
                width = 0.5 * (low[0] + high[0])
            place = self._correct_onto(
                cell.point_at(width / cell.width), tangent, float(tangent @ z) + width
            )
            node = self._make_node(place, tangent) if place is not None else None
            if node is None:
                break
            end, slope = node, float(node.tangent[-1])
            if abs(slope) < 1e-14 or high[0] - low[0] < 1e-15:
                break
            # Illinois method: the end that stays counts half, so that both ends close in.
            if slope * low[1] > 0.0:
                low, high = (width, slope), (high[0], 0.5 * high[1])
            else:
                low, high = (low[0], 0.5 * low[1]), (width, slope)
        return Cell(cell.begin, end, float(tangent @ (end.place - z)), True)

    def _make_node(self, place: Array, ahead: Array) -> BranchNode | None:
        system = self.curve.evaluate(place)
        if system is None:
            return None
        right = np.zeros(len(place))
        right[-1] = 1.0
        try:
            tangent = np.linalg.solve(np.vstack([system[1], ahead]), right)
        except np.linalg.LinAlgError:
            return None
        return BranchNode(place, np.asarray(tangent / sqrt(float(tangent @ tangent)), np.float64))

    def _correct_onto(self, start: Array, row: Array, goal: float) -> Array | None:
        """Return the solution at which a linear combination of the coordinates has a value."""
        place, last = start, inf
        size = 1.0 + float(np.abs(start).max())
        for _ in range(12):
            system = self.curve.evaluate(place)
            if system is None:
                return None
            errors, slopes = system
            if last == inf and not self.curve.is_meshed(np.abs(errors), _TOOTH):
                return None
            right = np.append(-errors, goal - float(row @ place))
            try:
                step = np.linalg.solve(np.vstack([slopes, row]), right)
            except np.linalg.LinAlgError:
                return None
            length = float(np.abs(step).max())
            if length >= last or length <= 4.0 * UNIT_ROUNDOFF * size:
                good = float(np.abs(errors).max()) <= _ACCEPTED * size
                return place if good else None
            if not length < 0.5:
                return None
            place, last = place + step, length
        return None


def is_repeated(first: LinkState | None, second: LinkState | None) -> bool:
    """Return whether the links before are in one place at two inputs, whole turns apart."""
    if first is None or second is None:
        return False
    # That a slide differs by a whole number of turns by chance is one in 10⁹.
    angles = [remainder(a - b, tau) for a, b in zip(first[0], second[0], strict=True)]
    if max(map(abs, angles)) > _SAME * (1.0 + max(map(abs, first[0]))):
        return False
    places = zip(list_numbers(first[1]), list_numbers(second[1]), strict=True)
    return max((abs(a - b) for a, b in places), default=0.0) <= _SAME


# The branch of one input is a function of the unwrapped input. It ends where the curve of
# solutions turns back, and the range of the input ends there too. If, after some whole turns of
# the input, all links are where they were, the branch starts again and continues for ever. A
# crank direction has finitely many poses and a turn leads from one to another, so a branch
# without an end comes back; the number of turns followed is bounded all the same. A branch that
# is shorter than a turn has one pose for each crank direction: as with dyads, whole turns of the
# input change nothing there, or as many as the ratios in the group need.


class Interval(NamedTuple):
    """The range of a branch, in the coordinate of its input."""

    # Its ends; of a branch that comes back, the pose and the input where it starts again.
    low: float
    high: float
    # For each end whether the linkage ends there; otherwise it was not followed farther.
    limited: tuple[bool, bool]
    turns: int  # Number of whole turns of the input after which it starts again; 0 if it does not
    repeated_turns: int  # Number of whole turns after which the constraints are the same; or 0

    @property
    def period_turns(self) -> int:
        """Return how many whole turns of the input change nothing; 0 if each turn differs."""
        is_short = self.high - self.low < tau * self.repeated_turns
        return self.turns or (self.repeated_turns if is_short else 0)


class Start(NamedTuple):
    """The start of Newton's method."""

    unknowns: Array  # Near the solution; at an end of the branch, the solution
    farthest: float  # Largest distance of the solution from them
    turned_angles: Array  # Change of the unknowns' angles by the turns before, in [rad]
    is_end: bool  # Whether this is the end of the branch, within the last few floats: a toggle


def _last_floats(end: float) -> float:
    """Return how far from the end of a branch its toggle reaches."""
    return _LAST_FLOATS * max(1.0, abs(end))


class _BranchSide:
    """
    Branch continuation in one direction from the pose, extended on demand.

    ``inputs`` are the inputs at the ends of the ``cells``, times the sign; ``end`` is the
    input at which the branch ends, or None until it is known.
    """

    __slots__ = ('cells', 'end', 'inputs', 'laps', 'node', 'sign')

    def __init__(self, node: BranchNode, sign: float) -> None:
        self.sign = sign
        self.node = node
        self.cells: list[Cell] = []
        self.inputs: list[float] = []
        self.laps = 0
        self.end: float | None = None


class Branch:
    """
    All solutions that lead from a pose without a toggle, for one input that turns or slides.

    A slide is followed over the distance ``far`` at least. After ``repeated_turns`` whole turns of
    the input the constraints are the same; 0 if they never are.
    """

    def __init__(
        self,
        continuation: Continuation,
        unknowns: Array,
        x: float,
        *,
        turning: bool,
        far: float,
        repeated_turns: int,
    ) -> None:
        self._repeated_turns = repeated_turns
        self._continuation = continuation
        self._known_at = continuation.curve.known_at
        self._turning = turning
        self._far = far
        self._x = x
        self._node = node = continuation.first_node(unknowns, x)
        self._sides = tuple(_BranchSide(node, sign) for sign in (-1.0, 1.0)) if node else ()
        self._turns = 0
        self._gained = np.zeros_like(unknowns)
        self.interval = self._follow(node, x)

    def find_start(self, x: float) -> Start | None:
        """Return the start of Newton's method at an input; None outside the branch."""
        low, high, _, turns, _ = self.interval
        if not self._sides:
            return None
        turned, x = self.unwrap(x)
        if turns:
            x = min(max(x, low), high)
        side = self._sides[int(x >= self._x)]
        if side.sign * x > self._reach_of(side):
            with BUILD_LOCK:
                while side.end is None and side.sign * x > self._reach_of(side):
                    if not self._follow_lap(side):
                        break
        if side.sign * x > self._reach_of(side):
            return None
        gained = turned * self._gained
        inputs = side.inputs
        number = bisect_left(inputs, side.sign * x)
        if number == len(inputs):
            # Next to a toggle of the links before, the cells become too small to continue.
            return Start(side.node.place[:-1], _NEXT_TO_END, gained, False)
        cell = side.cells[number]
        if cell.folds and abs(x - cell.end.place[-1]) <= _last_floats(cell.end.place[-1]):
            return Start(cell.end.place[:-1], inf, gained, True)
        size = float(np.abs(cell.end.place - cell.begin.place).max())
        return Start(cell.point_at(cell.part_of(x))[:-1], 0.2 * size, gained, False)

    @property
    def gained_angles(self) -> list[float]:
        """Return the turns of the unknowns before the branch starts again, in [rad]."""
        gained: list[float] = self._gained.tolist()
        return gained

    def unwrap(self, x: float) -> tuple[int, float]:
        """Return how often the branch has started again, and the input without these turns."""
        if not (self._turning and self.interval.period_turns):
            return 0, x
        period = tau * self.interval.period_turns
        turned = round((x - 0.5 * (self.interval.low + self.interval.high)) / period)
        return turned, x - turned * period

    def status_at(self, x: float) -> Status:
        """
        Return how the links are at an unwrapped input: closed, open, or at a toggle.

        UndecidedError is raised where the branch was not followed.
        """
        low, high, limited, turns, _ = self.interval
        if turns:
            return Status.CLOSED
        for side, end, is_limited in zip(self._sides, (low, high), limited, strict=True):
            if x < low if side.sign < 0.0 else x > high:
                if not is_limited:
                    raise UndecidedError
                return Status.OPEN
            if side.cells and side.cells[-1].folds and abs(x - end) <= _last_floats(end):
                return Status.TOGGLE
        return Status.CLOSED

    def pieces(self) -> list[StartRow]:
        """Return the pieces of the branch between the nodes, in ascending order."""
        if self._node is None:
            return []
        back, ahead = self._sides
        inputs = [-x for x in reversed(back.inputs)] + [self._x] + ahead.inputs
        # What is not an end of the branch may lie at a rounded input.
        ends = [
            round(x * 2.0**24) / 2.0**24
            if 0 < k < len(inputs) - 1
            and inputs[k + 1] - x > 2.0**-20
            and x - inputs[k - 1] > 2.0**-20
            else x
            for k, x in enumerate(inputs)
        ]
        cells = [*reversed(back.cells), *ahead.cells]
        folds = [-float(cell.folds) for cell in reversed(back.cells)]
        folds += [float(cell.folds) for cell in ahead.cells]
        far = _AWAY_FROM_POSE * max(1.0, self._continuation.farthest(self._node))
        away = [self._continuation.farthest(cell.end) > far for cell in cells]
        return list(map(StartRow, ends, ends[1:], folds, away))

    def nearest_end(self, x: float) -> Array | None:
        """Return the unknowns at the end of the branch that an input lies behind."""
        return self._sides[int(x >= self._x)].node.place[:-1] if self._sides else None

    def _follow(self, node: BranchNode | None, x: float) -> Interval:
        """Follow the branch to its ends, or until it comes back."""
        if node is None:
            return Interval(x, x, (True, True), 0, self._repeated_turns)
        back, ahead = self._sides
        if not self._turning:
            self._follow_lap(back)
            self._follow_lap(ahead)
        else:
            while self._follow_lap(ahead):
                if self._comes_back(node, ahead):
                    ends = x, x + self._turns * tau
                    return Interval(*ends, (False, False), self._turns, self._repeated_turns)
            while self._follow_lap(back):
                pass
        ends = -self._reach_of(back), self._reach_of(ahead)
        limited = back.end is not None, ahead.end is not None
        return Interval(*ends, limited, 0, self._repeated_turns)

    def _reach_of(self, side: _BranchSide) -> float:
        """Return how far a side was followed, times its sign."""
        if side.end is not None:
            return side.sign * side.end
        return side.inputs[-1] if side.inputs else side.sign * self._x

    def _follow_lap(self, side: _BranchSide) -> bool:
        """Follow a side for another turn, or twice as far; return whether it continues."""
        if side.end is not None or side.laps >= (_MOST_TURNS if self._turning else _MOST_LAPS):
            return False
        side.laps += 1
        tell_progress('turns of a branch followed', side.laps)
        if self._turning:
            last = self._x + side.sign * side.laps * tau
        else:
            last = side.sign * max(self._far, side.sign * self._x) * 2.0 ** (side.laps - 1)
        new_cells = list(self._continuation.follow_cells(side.node, side.sign, last))
        cells, node = side.cells + new_cells, new_cells[-1].end if new_cells else side.node
        at = float(node.place[-1])
        end = None
        if cells and cells[-1].folds:
            end = at
        elif side.sign * (last - at) > 0.0:
            end = self._last_known(at, side.sign)
            if end == at and cells:
                # Where branches cross the group is singular too: no way to choose between them.
                cells[-1] = cells[-1]._replace(folds=True)
        # Other threads read a side while it grows: whoever sees an input sees its cell.
        side.node, side.cells = node, cells
        side.inputs = side.inputs + [side.sign * float(cell.end.place[-1]) for cell in new_cells]
        side.end = end
        return end is None

    def _last_known(self, x: float, sign: float) -> float:
        """Return the last float at which the links before close, next to the end of the cells."""
        inside, step = x, 2.0**-50
        while step < 2.0**-20 and self._known_at(inside + sign * step) is not None:
            inside, step = inside + sign * step, 2.0 * step
        outside = inside + sign * step
        if self._known_at(outside) is not None:
            return x
        while abs(outside - inside) > 0.0 and nextafter(inside, outside) != outside:
            middle = 0.5 * (inside + outside)
            if self._known_at(middle) is None:
                outside = middle
            else:
                inside = middle
        return inside

    def _comes_back(self, first: BranchNode, side: _BranchSide) -> bool:
        """Return whether a side has come back; if so, set the turns and the angles gained."""
        now = float(side.node.place[-1])
        if not is_repeated(self._known_at(self._x), self._known_at(now)):
            return False
        moved = side.node.place[:-1] - first.place[:-1]
        gained = np.where(self._continuation.curve.angles, tau * np.round(moved / tau), 0.0)
        away = np.abs(moved - gained)
        if not self._continuation.is_isolated(first, away):
            return False
        self._turns, self._gained = side.laps, gained
        return True
