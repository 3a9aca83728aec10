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

"""Two links pinned together, each pinned to a link that is placed: a circle meets a circle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from campaigns.accuracy.mechanism import Mechanism, Spot
from campaigns.accuracy.motion import conjugate, inverse, Motion, real, root
from campaigns.accuracy.tangent import Tangent, times
from linkage_ros.kinematics.linkage import Side


@dataclass(frozen=True, slots=True)
class RRR:
    """
    Links ``one`` (from pin A) and ``two`` (from pin D), pinned together at B.

    Attributes
    ----------
    one, two
        Links that are placed by it.
    a, d
        The outer pins on the links that carry them.
    pin
        B, on both links.
    side
        +1: B lies left of A→D, -1: right.
    fold, stretch
        Whether the linkage folds or stretches with its crank along the ground only, and goes
        through: the side is then that for 0 < φ < π and changes there.

    """

    one: str
    two: str
    a: Spot
    d: Spot
    pin: str
    side: int
    fold: bool = False
    stretch: bool = False

    @property
    def assembly(self) -> tuple[str, Side]:
        return self.pin, 'left' if self.side > 0 else 'right'

    @property
    def turned(self) -> tuple[str, ...]:
        return self.one, self.two

    @property
    def slid(self) -> tuple[str, ...]:
        return ()

    @property
    def seen(self) -> tuple[Spot | str, Spot | str]:
        return self.a, self.d

    def given(self, _mechanism: Mechanism) -> tuple[Spot, ...]:
        return self.a, self.d

    def close(self, motion: Motion) -> None:
        start = motion.at(self.a)
        diagonal = motion.at(self.d) - start
        b, c, square, foot, area = self._triangle(motion, diagonal)
        height = root(area)
        if self.side_at(motion.phi) < 0:
            height = -height
        one = diagonal * (foot + height * 1j) / square
        two = one - diagonal
        # two × one, which both rates are divided by.
        motion.inverse.append(inverse(height))
        motion.place(self.one, one / b, self.a.point, start)
        motion.place(self.two, two / c, self.d.point, motion.at(self.d))

    def _triangle(self, motion: Motion, diagonal: Any) -> tuple[Any, ...]:
        b = motion.vector(self.one, self.a.point, self.pin)
        c = motion.vector(self.two, self.d.point, self.pin)
        square = real(diagonal * conjugate(diagonal))
        b_square, c_square = (b * b.conjugate()).real, (c * c.conjugate()).real
        foot = (square + (b_square - c_square)) * 0.5
        return b, c, square, foot, square * b_square - foot * foot

    def side_at(self, phi: Any) -> int:
        """Return the side at a crank angle."""
        side = self.side
        if self.fold and (phi / 2).sin() < 0:
            side = -side
        if self.stretch and (phi / 2).cos() < 0:
            side = -side
        return side

    def margin(self, motion: Motion) -> Any:
        """Return what the links reach farther than they must, in the unit of the constants."""
        diagonal = motion.at(self.d) - motion.at(self.a)
        s = abs(diagonal[0])
        b = abs(motion.vector(self.one, self.a.point, self.pin))
        c = abs(motion.vector(self.two, self.d.point, self.pin))
        return (s - abs(b - c)).min(b + c - s)

    def vary(self, tangent: Tangent) -> None:
        # A + b·u1 − c·u2 − D = 0
        b, b_change = tangent.vector(self.one, self.a.point, self.pin)
        c, c_change = tangent.vector(self.two, self.d.point, self.pin)
        unit_one, unit_two = tangent.unit[self.one], tangent.unit[self.two]
        start = tangent.at(self.a)
        rest = tangent.at(self.d) - start - unit_one * b_change + unit_two * c_change
        by = tangent.next_inverse()
        turn_one = times(by, times((unit_two * c).conj(), rest).real)
        turn_two = times(by, times((unit_one * b).conj(), rest).real)
        tangent.place(self.one, turn_one, self.a.point, start)
        tangent.place(self.two, turn_two, self.d.point, tangent.at(self.d))
