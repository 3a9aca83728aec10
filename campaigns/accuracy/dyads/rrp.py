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

"""A link pinned to a placed one, its other pin on a placed line: a circle meets a line."""

from __future__ import annotations

from dataclasses import dataclass

from campaigns.accuracy.mechanism import Mechanism, Spot
from campaigns.accuracy.motion import conjugate, imag, inverse, Motion, real, root
from campaigns.accuracy.tangent import Tangent, times
from linkage_ros.kinematics.linkage import Side


@dataclass(frozen=True, slots=True)
class RRP:
    """
    Link ``one`` from pin A to pin B, which a slider keeps on a line of a placed link.

    Attributes
    ----------
    one
        The link.
    a
        Its outer pin on the link that carries it.
    pin
        B; on the slider's block too where it has one.
    slider
        Name of the slider.
    side
        +1: B lies ahead of A along the line, -1: behind.

    """

    one: str
    a: Spot
    pin: str
    slider: str
    side: int

    @property
    def assembly(self) -> tuple[str, Side]:
        return self.slider, 'ahead' if self.side > 0 else 'behind'

    @property
    def turned(self) -> tuple[str, ...]:
        return (self.one,)

    @property
    def slid(self) -> tuple[str, ...]:
        return (self.slider,)

    @property
    def seen(self) -> tuple[Spot | str, Spot | str]:
        return self.a, self.slider

    def given(self, mechanism: Mechanism) -> tuple[Spot, ...]:
        return self.a, mechanism.start(self.slider)

    def close(self, motion: Motion) -> None:
        start = motion.at(self.a)
        b = motion.vector(self.one, self.a.point, self.pin)
        base, line, block = motion.line(self.slider, self.pin)
        across = (base - start) * conjugate(line)
        height = imag(across)
        reach = root((b * b.conjugate()).real - height * height)
        if self.side < 0:
            reach = -reach
        motion.inverse.append(inverse(reach))
        slide = reach - real(across)
        motion.slide[self.slider] = slide
        arm = line * (reach + height * 1j)
        motion.place(self.one, arm / b, self.a.point, start)
        if block is not None:
            motion.ride(self.slider, block, self.pin, start + arm)

    def margin(self, motion: Motion) -> object:
        """Return what the link reaches farther than it must, in the unit of the constants."""
        base, line, _ = motion.line(self.slider, self.pin)
        across = ((base - motion.at(self.a)) * conjugate(line))[0].imag
        return abs(motion.vector(self.one, self.a.point, self.pin)) - abs(across)

    def vary(self, tangent: Tangent) -> None:
        # A + b·u − Q − r·N = 0
        b, b_change = tangent.vector(self.one, self.a.point, self.pin)
        unit = tangent.unit[self.one]
        start = tangent.at(self.a)
        line, line_change, base_change, block_turn = tangent.line(self.slider, self.pin)
        slide = tangent.slide_value[self.slider]
        rest = base_change + times(slide, line_change) - start - unit * b_change
        along = times(line.conj(), rest)
        turn = times(tangent.next_inverse(), along.imag)
        where = start + unit * b_change + 1j * times(unit * b, turn)
        tangent.place(self.one, turn, self.a.point, start)
        tangent.slide[self.slider] = -times(times(unit * b, line.conj()).imag, turn) - along.real
        if block_turn is not None:
            tangent.ride(self.slider, self.pin, block_turn, where)
