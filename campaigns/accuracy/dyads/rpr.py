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

"""A rod pinned to a placed link that slides through a block pinned to another: a swivel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from campaigns.accuracy.mechanism import Mechanism, Spot
from campaigns.accuracy.motion import conjugate, inverse, Motion, real, root
from campaigns.accuracy.tangent import Tangent, times
from flint import acb
from linkage_ros.kinematics.linkage import Side


@dataclass(frozen=True, slots=True)
class RPR:
    """
    Link ``rail`` from pin A, with a line that a block pinned at D slides on.

    Attributes
    ----------
    rail
        The link with the line.
    a, d
        The outer pins on the links that carry them.
    slider
        Name of the slider.
    side
        +1: D lies ahead of A along the line, -1: behind.
    fold
        Whether the pins meet as the crank passes along the ground, and the rod goes through.

    """

    rail: str
    a: Spot
    d: Spot
    slider: str
    side: int
    fold: bool = False

    @property
    def assembly(self) -> tuple[str, Side]:
        return self.slider, 'ahead' if self.side > 0 else 'behind'

    @property
    def turned(self) -> tuple[str, ...]:
        return (self.rail,)

    @property
    def slid(self) -> tuple[str, ...]:
        return ()

    @property
    def seen(self) -> tuple[Spot | str, Spot | str]:
        return self.a, self.d

    def given(self, _mechanism: Mechanism) -> tuple[Spot, ...]:
        return self.a, self.d

    def close(self, motion: Motion) -> None:
        start, end = motion.at(self.a), motion.at(self.d)
        diagonal = end - start
        base = self._base(motion) * motion.constants.directions[self.slider].conjugate()
        height = base.imag
        reach = root(real(diagonal * conjugate(diagonal)) - height * height)
        if (self.side < 0) != (self.fold and bool((motion.phi / 2).sin() < 0)):
            reach = -reach
        motion.inverse.append(inverse(reach))
        motion.slide[self.slider] = reach - base.real
        unit = diagonal / ((reach + acb(0, height)) * motion.constants.directions[self.slider])
        motion.place(self.rail, unit, self.a.point, start)
        block = motion.mechanism.sliders[self.slider].block
        if block is not None:
            twist = motion.constants.twists[self.slider]
            # It turns as the rail does, and that angle is handed on once.
            motion.place(block, motion.unit[self.rail] * twist, self.d.point, end)

    def _base(self, motion: Motion) -> Any:
        """Return, in the rail's frame, where the block's pin is at slide 0, from the rail's."""
        slide = motion.mechanism.sliders[self.slider]
        base = motion.vector(self.rail, self.a.point, slide.through)
        if slide.block is None or slide.point == self.d.point:
            return base
        arm = motion.vector(slide.block, slide.point, self.d.point)
        return base + arm * motion.constants.twists[self.slider]

    def margin(self, motion: Motion) -> Any:
        """Return what the pins are farther apart than they must, in the constants' unit."""
        diagonal = motion.at(self.d) - motion.at(self.a)
        base = self._base(motion) * motion.constants.directions[self.slider].conjugate()
        return abs(diagonal[0]) - abs(base.imag)

    def vary(self, tangent: Tangent) -> None:
        # E = (g + r·n)·u
        slide = tangent.mechanism.sliders[self.slider]
        base, base_change = tangent.vector(self.rail, self.a.point, slide.through)
        if slide.block is not None and slide.point != self.d.point:
            arm, arm_change = tangent.vector(slide.block, slide.point, self.d.point)
            twist, twist_change = tangent.twist[self.slider], tangent.twist_change[self.slider]
            base = base + arm * twist
            base_change = base_change + twist * (arm_change + 1j * arm * twist_change)
        unit = tangent.unit[self.rail]
        direction = tangent.direction[self.slider]
        direction_change = tangent.direction_change[self.slider]
        value = tangent.slide_value[self.slider]
        start, end = tangent.at(self.a), tangent.at(self.d)
        rest = end - start - unit * base_change - times(value, unit) * direction_change
        along = times((unit * direction).conj(), rest)
        turn = times(tangent.next_inverse(), along.imag)
        tangent.place(self.rail, turn, self.a.point, start)
        tangent.slide[self.slider] = along.real + (base * direction.conjugate()).imag * turn
        if slide.block is not None:
            turn_block = tangent.turn[self.rail].copy()
            turn_block[0] += tangent.twist_change[self.slider]
            tangent.place(slide.block, turn_block, self.d.point, end)
