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
The diagonal of a dyad: from its first outer pin A to its second outer pin D.

Two pins that lie on links which are themselves pinned together, at O, are as crank pin and ground
pivot of a four-bar: `CrankDiagonal`. Its half-angle form loses nothing where OA lies along OD (a
change point), where the coordinates of A and D cancel. For all others there are the coordinates:
`FreeDiagonal`.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple, Protocol

from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import State


class Diagonal(NamedTuple):
    """
    The vector from A to D at one state of the linkage.

    Attributes
    ----------
    square
        s² = |AD|²; 0 where no direction can be told.
    direction
        Of AD, in [rad].
    fold, stretch
        √(s² − lower²) and √(upper² − s²): how far the dyad is from its limits. Signed at a change
        point; the latter is 1 where the dyad has no upper limit.
    gap
        What A and D are too near or too far by; 0 where the dyad closes.
    near, far
        2·√(ad)·sin(φ/2) and 2·√(ad)·cos(φ/2) of a `CrankDiagonal`, else 0.
    excess
        What s² has beyond the diagonal's ``least``, its constant part.
    status
        Of the dyad, as far as the diagonal decides it.

    """

    square: float
    direction: float
    fold: float
    stretch: float
    gap: float
    near: float
    far: float
    excess: float
    status: Status


class Growth(NamedTuple):
    """
    The rates of a diagonal: ṡ/s = swing·growth, and its direction's rate is base + swing·turn.

    Growth and turn may be huge where A is next to D. What they are multiplied by in a dyad is as
    small then: that product comes first. ``lean`` is the growth by fold and stretch: at a change
    point all three are 0, and it is not.
    """

    growth: float
    turn: float
    swing: float
    base: float
    lean: float


class GrowthChange(NamedTuple):
    """
    The derivative of a `Growth`, ṡ²/s² added to that of ṡ/s.

    That is s̈/s = change·growth + swing²·pull, which is no difference of large numbers where A is
    next to D; and the direction's is base + change·turn + swing²·swirl.

    The bend is what the pull leaves of a dyad's own second derivative (each dyad says what), by
    fold and stretch: near a change point a difference of large numbers, so a `CrankDiagonal` tells
    it in the place of the pull, where all others leave it to the dyad.
    """

    pull: float
    swirl: float
    change: float
    base: float
    bend: float | None


class AnyDiagonal(Protocol):
    """
    What a dyad asks of a diagonal.

    Attributes
    ----------
    least
        A constant that s² is never below.

    """

    least: Fraction

    def at(self, known: State, /) -> Diagonal:
        """Return the diagonal."""

    def rates(self, diagonal: Diagonal, known: State, speeds: State, /) -> Growth:
        """Return how the diagonal grows and turns."""

    def accelerations(
        self, diagonal: Diagonal, growth: Growth, known: State, speeds: State, changes: State, /
    ) -> GrowthChange:
        """Return the derivative of `rates`."""
