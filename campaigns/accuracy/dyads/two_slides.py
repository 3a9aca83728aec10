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

"""The dyads with two sliders, PRP and RPP: a line meets a line, once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from campaigns.accuracy.mechanism import Mechanism, Spot
from campaigns.accuracy.motion import conjugate, imag, inverse, Motion
from campaigns.accuracy.tangent import Tangent, times


@dataclass(frozen=True, slots=True)
class PRP:
    """
    Two blocks pinned together, each on a line of a placed link; the second may be virtual.

    Attributes
    ----------
    one, two
        Names of the sliders.
    pin
        What the blocks share; the point of slider ``two`` where its block is virtual.

    """

    one: str
    two: str
    pin: str

    @property
    def assembly(self) -> None:
        return None

    @property
    def turned(self) -> tuple[str, ...]:
        return ()

    @property
    def slid(self) -> tuple[str, ...]:
        return self.one, self.two

    @property
    def seen(self) -> tuple[Spot | str, Spot | str]:
        return self.one, self.two

    def given(self, mechanism: Mechanism) -> tuple[Spot, ...]:
        return mechanism.start(self.one), mechanism.start(self.two)

    def close(self, motion: Motion) -> None:
        base_one, line_one, block_one = motion.line(self.one, self.pin)
        base_two, line_two, block_two = motion.line(self.two, self.pin)
        over = _meet(motion, base_two - base_one, line_one, line_two)
        motion.slide[self.one], motion.slide[self.two] = over[0], -over[1]
        where = base_one + line_one * over[0]
        for name, block in ((self.one, block_one), (self.two, block_two)):
            if block is not None:
                motion.ride(name, block, self.pin, where)

    def margin(self, motion: Motion) -> Any:
        """Return how far the lines are from parallel, as a sine."""
        lines = [motion.line(name, self.pin)[1] for name in (self.one, self.two)]
        return abs((lines[0] * conjugate(lines[1]))[0].imag)

    def vary(self, tangent: Tangent) -> None:
        line_one, change_one, base_one, turn_one = tangent.line(self.one, self.pin)
        line_two, change_two, base_two, turn_two = tangent.line(self.two, self.pin)
        value_one = tangent.slide_value[self.one]
        rest = base_two - base_one - times(value_one, change_one)
        rest = rest + times(tangent.slide_value[self.two], change_two)
        slide_one, minus_two = _vary_meeting(tangent, rest, line_one, line_two)
        tangent.slide[self.one], tangent.slide[self.two] = slide_one, -minus_two
        where = base_one + times(value_one, change_one) + times(line_one, slide_one)
        for name, turn in ((self.one, turn_one), (self.two, turn_two)):
            if turn is not None:
                tangent.ride(name, self.pin, turn, where)


@dataclass(frozen=True, slots=True)
class RPP:
    """
    A yoke that slides on a placed link's line, and in its own line a block pinned to a link.

    Attributes
    ----------
    a
        The block's outer pin on the link that carries it.
    inner
        Slider between the block, which may be virtual, and the yoke, which carries its line.
    outer
        Slider of the yoke on the placed link.

    """

    a: Spot
    inner: str
    outer: str

    @property
    def assembly(self) -> None:
        return None

    @property
    def turned(self) -> tuple[str, ...]:
        return ()

    @property
    def slid(self) -> tuple[str, ...]:
        return (self.outer,)

    @property
    def seen(self) -> tuple[Spot | str, Spot | str]:
        return self.a, self.outer

    def given(self, mechanism: Mechanism) -> tuple[Spot, ...]:
        return self.a, mechanism.start(self.outer)

    def close(self, motion: Motion) -> None:
        inner, outer = (motion.mechanism.sliders[name] for name in (self.inner, self.outer))
        base, line, unit = motion.line(self.outer, outer.point)
        slot = unit * motion.constants.directions[self.inner]
        start = motion.at(self.a)
        rest = start - base - unit * self._offset(motion)
        over = _meet(motion, rest, slot, line)
        motion.slide[self.inner], motion.slide[self.outer] = over
        motion.ride(self.outer, unit, outer.point, base + line * over[1])
        if inner.block is not None:
            turned = unit * motion.constants.twists[self.inner]
            motion.place(inner.block, turned, self.a.point, start)

    def _offset(self, motion: Motion) -> Any:
        """Return, in the yoke's frame, the block's pin at slide 0 from the yoke's point."""
        inner, outer = (motion.mechanism.sliders[name] for name in (self.inner, self.outer))
        offset = motion.vector(inner.along, outer.point, inner.through)
        if inner.block is None or inner.point == self.a.point:
            return offset
        arm = motion.vector(inner.block, inner.point, self.a.point)
        return offset + arm * motion.constants.twists[self.inner]

    def margin(self, motion: Motion) -> Any:
        """Return how far the lines are from parallel, as a sine."""
        outer = motion.mechanism.sliders[self.outer]
        _, line, unit = motion.line(self.outer, outer.point)
        return abs((unit * motion.constants.directions[self.inner] * conjugate(line))[0].imag)

    def vary(self, tangent: Tangent) -> None:
        inner, outer = (tangent.mechanism.sliders[name] for name in (self.inner, self.outer))
        line, line_change, base, turn = tangent.line(self.outer, outer.point)
        assert turn is not None, 'a yoke is a block: it keeps its angle'
        offset, offset_change = tangent.vector(inner.along, outer.point, inner.through)
        if inner.block is not None and inner.point != self.a.point:
            arm, arm_change = tangent.vector(inner.block, inner.point, self.a.point)
            twist, twist_change = tangent.twist[self.inner], tangent.twist_change[self.inner]
            offset = offset + arm * twist
            offset_change = offset_change + twist * (arm_change + 1j * arm * twist_change)
        unit = tangent.unit[inner.along]
        slot = unit * tangent.direction[self.inner]
        slot_change = unit * tangent.direction_change[self.inner] + 1j * times(slot, turn)
        start = tangent.at(self.a)
        rest = start - base - unit * offset_change - 1j * times(unit * offset, turn)
        rest = rest - times(tangent.slide_value[self.inner], slot_change)
        value = tangent.slide_value[self.outer]
        rest = rest - times(value, line_change)
        slides = _vary_meeting(tangent, rest, slot, line)
        tangent.slide[self.inner], tangent.slide[self.outer] = slides
        where = base + times(value, line_change) + times(line, slides[1])
        tangent.ride(self.outer, outer.point, turn, where)
        if inner.block is not None:
            turn_block = turn.copy()
            turn_block[0] += tangent.twist_change[self.inner]
            tangent.place(inner.block, turn_block, self.a.point, start)


def _meet(motion: Motion, rest: Any, one: Any, two: Any) -> tuple[Any, Any]:
    """Solve x·one + y·two = rest for real x and y."""
    by = inverse(imag(one * conjugate(two)))
    motion.inverse.append(by)
    return imag(rest * conjugate(two)) * by, -imag(rest * conjugate(one)) * by


def _vary_meeting(tangent: Tangent, rest: Any, one: Any, two: Any) -> tuple[Any, Any]:
    by = tangent.next_inverse()
    x = times(by, times(two.conj(), rest).imag)
    return x, -times(by, times(one.conj(), rest).imag)
