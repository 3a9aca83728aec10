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
and the cubic c(s) has the places and tangents of both nodes. A cell is accepted only if it is
proven to hold one piece of curve. Let h be the width of the cell, B the Jacobian at c(h/2) of F
and of the distance s, and δB a bound, entry by entry, of the change of B within the box around
the cubic::

    |B⁻¹|·δB contracts: some w > 0 has |B⁻¹|·δB·w ≤ q·w, with q ≤ 0.6
    |B⁻¹·(F(c(h/2)), 0)| is small compared with the box

Then B is regular in the whole box, and for each s the box holds at most one solution (Krawczyk's
test: A. Neumaier, Interval Methods for Systems of Equations, Cambridge 1990, theorem 5.1.8).
Another assembly cannot be in the box, however near it comes. The bound over the unknowns comes
from the sines and cosines themselves. The change of the known links within a cell is estimated
from its ends and its middle, and the residual from the middle, where the residual of a cubic
through both ends is largest.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import inf, nextafter, remainder, sqrt, tau
from typing import NamedTuple

from linkage_ros.kinematics.arithmetic import UndecidedError, UNIT_ROUNDOFF
from linkage_ros.kinematics.built_once import BUILD_LOCK
from linkage_ros.kinematics.iterated.equations import (
    Array,
    bound_jacobian_change,
    Constraint,
    evaluate_constraints,
    is_meshed,
)
from linkage_ros.kinematics.iterated.start_table import StartRow
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState
import numpy as np

_CONTRACTS = 0.6
"""Largest accepted q; the step size aims at two thirds of it."""

_LONGEST = 0.25
_SHORTEST = 2.0**-36
"""Bounds of a step, in [rad] or lengths; the longest grows with the distance of the links."""

_MOST_CELLS = 2**13
"""Cells of one call: about 27 are usual for a turn, 300 for links that go far away on lines."""

_AWAY = 2.0**20
"""In lengths: links that are so far away, on lines that become parallel, do not come back."""

_STRAIGHT = 0.25
"""Largest departure of the slope of x from a straight line in a cell, relative to its change."""

_ACCEPTED = 256.0 * UNIT_ROUNDOFF
"""Largest residual of a constraint at a solution, relative to the size of the coordinates."""

_TOOTH = 1.0 / 16.0
"""Largest residual of a ratio at the start of a step, relative to its period; a step that is twice
as long is off by four times as much, and so is refused before it could reach the next tooth."""

KnownAt = Callable[[float], LinkState | None]
"""State of the links solved before, at an input; None where they do not close."""

RatesAt = Callable[[float], tuple[LinkState, LinkState] | None]
"""State of the links solved before and its derivatives by the input; None if there are none."""

_MOST_TURNS = 64
_MOST_LAPS = 32
"""Laps of a slide: each is twice as long as the one before."""

_SAME = 1e-9
"""Largest difference of known places and angles that count as equal."""

_LAST_FLOATS = 32.0 * UNIT_ROUNDOFF
"""Relative to the input, or to 1: how near its end a toggle and its neighbours look alike."""

_NEXT_TO_END = 2.0**-10
"""In [rad] or lengths: how far links may move while the links before are next to a toggle."""


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
    """Follows the solutions of constraints while one input changes."""

    constraints: Sequence[Constraint]  # As many equations as there are unknowns
    # Functions that give the state of the links solved before.
    known_at: KnownAt
    rates_at: RatesAt
    # Returns the residuals, and their derivatives by the unknowns and the input.
    evaluate: Callable[[list[float], LinkState, LinkState], tuple[Array, Array]]

    def first_node(self, unknowns: Array, x: float) -> BranchNode | None:
        """Return the node at a solution, with its tangent towards larger inputs."""
        system = self._evaluate_system(np.append(unknowns, x))
        if system is None:
            return None
        _, slopes = system
        tangent = np.linalg.svd(slopes)[2][-1]
        return BranchNode(np.append(unknowns, x), tangent if tangent[-1] >= 0.0 else -tangent)

    def is_isolated(self, node: BranchNode, away: Array) -> bool:
        """Return whether a node's solution is the only one at its input within a distance."""
        solved = self.known_at(float(node.place[-1]))
        if solved is None:
            return False
        unknowns = node.place[:-1]
        still = LinkState([0.0] * len(solved[0]), [0j] * len(solved[1]))
        slopes = np.array(evaluate_constraints(self.constraints, unknowns.tolist(), solved)[1])
        if not is_meshed(self.constraints, (np.abs(slopes) @ away).tolist(), 0.25):
            return False
        try:
            inverse = np.linalg.inv(slopes)
        except np.linalg.LinAlgError:
            return False
        change = bound_jacobian_change(self.constraints, unknowns, solved, away, still)
        return _spectral_bound(np.abs(inverse) @ change) < 1.0

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
            far = float(max(np.abs(node.place[1:-1:3]).max(), np.abs(node.place[2:-1:3]).max()))
            if far > _AWAY:
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
        contraction = self._contraction_factor(cell)
        if not contraction <= _CONTRACTS:
            return None, max(0.1, min(0.5, 0.6 * _CONTRACTS / contraction))
        return cell, min(2.0, 0.67 * _CONTRACTS / max(contraction, 1e-3))

    def _turns_at_most_once(self, cell: Cell) -> bool:
        """Return whether x changes in one direction within a cell, or turns back only once."""
        a, b, c, d = cell.control_points()[:, -1].tolist()
        begin, middle, end = b - a, c - b, d - c
        most = max(min(abs(begin), abs(end)), abs(begin - end))
        return bool(abs(middle - 0.5 * (begin + end)) <= _STRAIGHT * most)

    def _contraction_factor(self, cell: Cell) -> float:
        """Return q of a cell; infinite where its middle is a poor approximation."""
        control = cell.control_points()
        middle = 0.125 * (control[0] + control[3]) + 0.375 * (control[1] + control[2])
        moved = np.abs(control - middle).max(axis=0)
        at = float(middle[-1])
        known_rates = self.rates_at(at)
        if known_rates is None:
            return inf
        known, speeds = known_rates
        n = len(middle) - 1
        errors, slopes = self._evaluate_constraints(middle, known, speeds)
        matrix = np.vstack([slopes, cell.begin.tangent])
        try:
            inverse = np.linalg.inv(matrix)
        except np.linalg.LinAlgError:
            return inf
        off = np.abs(inverse[:, :n] @ errors)
        moved += 5.0 * off.max()
        change = np.zeros((n + 1, n + 1))
        ends = [self.known_at(float(node.place[-1])) for node in cell[:2]]
        ways = [_state_distances(known, end) for end in ends if end is not None]
        if len(ways) < 2:
            return inf
        largest_change = LinkState(
            np.max([w[0] for w in ways], axis=0).tolist(),
            np.max([w[1] for w in ways], axis=0).tolist() if ways[0][1] else [],
        )
        change[:n, :n] = bound_jacobian_change(
            self.constraints, middle[:n], known, moved[:n], largest_change
        )
        for node in cell[:2]:
            system = self._evaluate_system(node.place)
            if system is None:
                return inf
            slope = system[1][:, -1]
            change[:n, -1] = np.maximum(change[:n, -1], np.abs(slope - slopes[:, -1]))
        if off.max() > 0.1 * float(np.abs(control[3] - control[0]).max()):
            return inf
        return _spectral_bound(np.abs(inverse) @ change)

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
        system = self._evaluate_system(place)
        if system is None:
            return None
        right = np.zeros(len(place))
        right[-1] = 1.0
        try:
            tangent = np.linalg.solve(np.vstack([system[1], ahead]), right)
        except np.linalg.LinAlgError:
            return None
        return BranchNode(place, tangent / sqrt(float(tangent @ tangent)))

    def _correct_onto(self, start: Array, row: Array, goal: float) -> Array | None:
        """Return the solution at which a linear combination of the coordinates has a value."""
        place, last = start, inf
        size = 1.0 + float(np.abs(start).max())
        for _ in range(12):
            system = self._evaluate_system(place)
            if system is None:
                return None
            errors, slopes = system
            if last == inf and not is_meshed(self.constraints, np.abs(errors).tolist(), _TOOTH):
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

    def _evaluate_system(self, place: Array) -> tuple[Array, Array] | None:
        """Return the residuals, and their derivatives by the unknowns and the input."""
        known_rates = self.rates_at(float(place[-1]))
        return None if known_rates is None else self._evaluate_constraints(place, *known_rates)

    def _evaluate_constraints(
        self, place: Array, solved: LinkState, velocities: LinkState
    ) -> tuple[Array, Array]:
        return self.evaluate(place[:-1].tolist(), solved, velocities)


def _state_distances(one: LinkState, other: LinkState) -> tuple[list[float], list[float]]:
    return (
        [abs(a - b) for a, b in zip(one[0], other[0], strict=True)],
        [abs(a - b) for a, b in zip(one[1], other[1], strict=True)],
    )


def _spectral_bound(matrix: Array) -> float:
    """Return an upper bound of the spectral radius of a non-negative matrix."""
    weights = np.ones(len(matrix))
    bound = inf
    for _ in range(12):
        new = matrix @ weights
        bound = min(bound, float((new / weights).max()))
        weights = new + 1e-6 * float(new.max()) + 1e-300
        weights /= weights.max()
    return bound


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

    __slots__ = ('_continuation', '_far', '_gained', '_known_at', '_repeated_turns', '_sides',
                 '_turning', '_turns', '_x', 'interval')  # fmt: skip

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
        self._known_at = continuation.known_at
        self._turning = turning
        self._far = far
        self._x = x
        node = continuation.first_node(unknowns, x)
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
        """Return the change of the unknowns' angles before the branch starts again, in [rad]."""
        gained: list[float] = self._gained[0::3].tolist()
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
        if not self._sides:
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
        folds = [-float(cell.folds) for cell in reversed(back.cells)]
        folds += [float(cell.folds) for cell in ahead.cells]
        return list(map(StartRow, ends, ends[1:], folds))

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
        if self._turning:
            last = self._x + side.sign * side.laps * tau
        else:
            last = side.sign * max(self._far, side.sign * self._x) * 2.0 ** (side.laps - 1)
        found = list(self._continuation.follow_cells(side.node, side.sign, last))
        cells, node = side.cells + found, found[-1].end if found else side.node
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
        side.inputs = side.inputs + [side.sign * float(one.end.place[-1]) for one in found]
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
        begun, now = self._known_at(self._x), self._known_at(float(side.node.place[-1]))
        if begun is None or now is None:
            return False
        # That a slide differs by a whole number of turns by chance is one in 10⁹.
        (x, pins), (x_now, pins_now) = begun, now
        angles = (remainder(a - b, tau) for a, b in zip(x, x_now, strict=True))
        if max(map(abs, angles)) > _SAME * (1.0 + abs(self._x)):
            return False
        if max((abs(a - b) for a, b in zip(pins, pins_now, strict=True)), default=0.0) > _SAME:
            return False
        moved = side.node.place[:-1] - first.place[:-1]
        gained = np.zeros_like(moved)
        gained[0::3] = tau * np.round(moved[0::3] / tau)
        away = np.abs(moved - gained)
        if not self._continuation.is_isolated(first, away):
            return False
        self._turns, self._gained = side.laps, gained
        return True
