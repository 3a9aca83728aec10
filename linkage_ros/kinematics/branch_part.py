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
The branch of a single input that a pose names: all solutions that lead from it without a toggle.

It is a function of the unwrapped input. Where the curve of solutions turns back, the branch ends,
and with it the range of the input. Where, after some whole turns of the input, all links are where
they were, it begins again, and goes on for ever. There are finitely many poses to a crank
direction, and a turn leads from one to another, so that a branch without an end comes back; how
many turns are followed is bounded all the same. A branch that is shorter than a turn has one pose
to a crank direction: whole turns of the input change nothing there, as they do not with dyads.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from math import floor, inf, nextafter, remainder, tau
from typing import NamedTuple

from linkage_ros.kinematics.branch import Cell, Continuation, Node
from linkage_ros.kinematics.equations import Array
from linkage_ros.kinematics.rounding import UNIT_ROUNDOFF
from linkage_ros.kinematics.step import State
import numpy as np

_MOST_TURNS = 64
_MOST_LAPS = 32
"""Of a slide: each is twice as long as the one before."""

_SAME = 1e-9
"""What known places and angles may differ by and be the same."""

_LAST_FLOATS = 32.0 * UNIT_ROUNDOFF
"""Of the input, or of 1: how near its end a toggle cannot be told from its neighbours."""

_NEXT_TO_END = 2.0**-10
"""In [rad] or lengths: how far links may go where those before them are next to a toggle."""


class Interval(NamedTuple):
    """
    Where a branch goes, in the coordinate of its input.

    Attributes
    ----------
    low, high
        Its ends; of one that comes back, from the pose to where it begins again.
    limited
        Of each end whether the linkage ends there; else it was not followed farther.
    turns
        After how many whole turns of the input it begins again; 0 where it does not.

    """

    low: float
    high: float
    limited: tuple[bool, bool]
    turns: int

    @property
    def period(self) -> int:
        """How many whole turns of the input change nothing; 0 where each turn is another."""
        return self.turns or int(self.high - self.low < tau)


class Start(NamedTuple):
    """
    Where an iteration starts.

    Attributes
    ----------
    unknowns
        Next to the solution; at an end of the branch, the solution.
    farthest
        How far from them the solution may be.
    turned
        What the unknowns' angles gained by the turns before, in [rad].
    ends
        Whether it is at the end of the branch, within the last few floats: a toggle.

    """

    unknowns: Array
    farthest: float
    turned: Array
    ends: bool


class _Side:
    """
    One side of the pose, followed as far as it was asked for.

    ``inputs`` are those where the ``cells`` end, times the sign, and ``end`` is that where the
    branch ends, once that is found.
    """

    __slots__ = ('cells', 'end', 'inputs', 'laps', 'node', 'sign')

    def __init__(self, node: Node, sign: float) -> None:
        self.sign = sign
        self.node = node
        self.cells: list[Cell] = []
        self.inputs: list[float] = []
        self.laps = 0
        self.end: float | None = None


class Branch:
    """
    A branch.

    Parameters
    ----------
    continuation
        Follows it.
    unknowns, x
        The solution at the pose, and the input there.
    known_at
        Returns what is known before at an input, nothing where that does not close.
    turning
        Whether the input turns.
    far
        How far a slide is followed at least.

    """

    __slots__ = ('_continuation', '_far', '_gained', '_known_at', '_sides', '_turning', '_turns',
                 '_x', 'interval')  # fmt: skip

    def __init__(
        self,
        continuation: Continuation,
        unknowns: Array,
        x: float,
        known_at: Callable[[float], State | None],
        *,
        turning: bool,
        far: float,
    ) -> None:
        self._continuation = continuation
        self._known_at = known_at
        self._turning = turning
        self._far = far
        self._x = x
        node = continuation.first(unknowns, x)
        self._sides = tuple(_Side(node, sign) for sign in (-1.0, 1.0)) if node else ()
        self._turns = 0
        self._gained = np.zeros_like(unknowns)
        self.interval = self._followed(node, x)

    def start(self, x: float) -> Start | None:
        """Return where the iteration starts at an input; nothing where the branch is not."""
        turned = 0.0
        low, high, _, turns = self.interval
        if not self._sides:
            return None
        if turns:
            period = turns * tau
            turned = floor((x - low) / period)
            x = min(max(x - turned * period, low), high)
        elif self._turning and not low <= x <= high and self.interval.period:
            x -= tau * round((x - 0.5 * (low + high)) / tau)
        side = self._sides[int(x >= self._x)]
        while side.end is None and side.sign * x > self._reached(side) and self._lap(side):
            pass
        if side.sign * x > self._reached(side):
            return None
        gained = turned * self._gained
        number = bisect_left(side.inputs, side.sign * x)
        if number == len(side.cells):
            # Next to a toggle of the links before, where cells get too small to go on.
            return Start(side.node.place[:-1], _NEXT_TO_END, gained, False)
        cell = side.cells[number]
        if cell.folds and abs(x - cell.end.place[-1]) <= _LAST_FLOATS * max(1.0, abs(x)):
            return Start(cell.end.place[:-1], inf, gained, True)
        size = float(np.abs(cell.end.place - cell.begin.place).max())
        return Start(cell.at(cell.part_of(x))[:-1], 0.2 * size, gained, False)

    def nearest_end(self, x: float) -> Array | None:
        """Return the unknowns at the end of the branch behind which an input lies."""
        return self._sides[int(x >= self._x)].node.place[:-1] if self._sides else None

    def _followed(self, node: Node | None, x: float) -> Interval:
        """Follow the branch to its ends, or to where it comes back."""
        if node is None:
            return Interval(x, x, (True, True), 0)
        back, ahead = self._sides
        if not self._turning:
            self._lap(back)
            self._lap(ahead)
        else:
            while self._lap(ahead):
                if self._comes_back(node, ahead):
                    return Interval(x, x + self._turns * tau, (False, False), self._turns)
            while self._lap(back):
                pass
        ends = -self._reached(back), self._reached(ahead)
        return Interval(*ends, (back.end is not None, ahead.end is not None), 0)

    def _reached(self, side: _Side) -> float:
        """Return how far a side was followed, times its sign."""
        if side.end is not None:
            return side.sign * side.end
        return side.inputs[-1] if side.inputs else side.sign * self._x

    def _lap(self, side: _Side) -> bool:
        """Follow a side a turn farther, or to twice as far; return whether it goes on there."""
        if side.end is not None or side.laps >= (_MOST_TURNS if self._turning else _MOST_LAPS):
            return False
        side.laps += 1
        if self._turning:
            last = self._x + side.sign * side.laps * tau
        else:
            last = side.sign * max(self._far, side.sign * self._x) * 2.0 ** (side.laps - 1)
        for cell in self._continuation.cells(side.node, side.sign, last):
            side.cells.append(cell)
            side.inputs.append(side.sign * float(cell.end.place[-1]))
            side.node = cell.end
        at = float(side.node.place[-1])
        if side.cells and side.cells[-1].folds:
            side.end = at
        elif side.sign * (last - at) > 0.0:
            side.end = self._last_known(at, side.sign)
            if side.end == at and side.cells:
                # Where branches cross the group is singular, too: which one goes on is not told.
                side.cells[-1] = side.cells[-1]._replace(folds=True)
        return side.end is None

    def _last_known(self, x: float, sign: float) -> float:
        """Return the last float at which the links before close, next to where cells end."""
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

    def _comes_back(self, first: Node, side: _Side) -> bool:
        """Return whether all is where it began, and note after how many turns, and what gained."""
        begun, now = self._known_at(self._x), self._known_at(float(side.node.place[-1]))
        if begun is None or now is None:
            return False
        # A slide that differs by a whole number of turns would be one in 10⁹.
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
        if not self._continuation.alone(first, away):
            return False
        self._turns, self._gained = side.laps, gained
        return True
