# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The dyads in closed form, in power series of balls.

A link is placed when its pose is known.

- RRR: two links pinned together, each pinned to a placed link. A circle intersects a circle.
- RRP: a link pinned to a placed link, with its other pin on a placed line. A circle intersects a
  line.
- RPR: a rod pinned to a placed link slides through a block that is pinned to another placed link.
- PRP and RPP: two sliders. A line intersects a line, once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from campaigns.accuracy.mechanism import CRANK, Dyad, Mechanism, Spot
from campaigns.accuracy.motion import decided, Motion, root
from campaigns.series import Series


@dataclass(frozen=True, slots=True)
class RPR(Dyad):
    """Link ``rail`` from pin A, with a line that a block pinned at D slides on."""

    rail: str  # The link with the line
    # The outer pins on the links that carry them.
    a: Spot
    d: Spot
    slider: str  # Name of the slider
    side: int  # +1: D lies ahead of A along the line, -1: behind
    # Whether the pins coincide when the crank lies along the ground; the side changes there.
    fold: bool = False

    CLOSING = ('slider', 'ahead', 'behind')
    TURNED = ('rail',)

    def close(self, motion: Motion) -> None:
        start, end = motion.at(self.a), motion.at(self.d)
        diagonal = end - start
        base = (
            _pin_at_zero(motion, self.slider, self.a.point, self.d.point)
            * motion.directions[self.slider].conjugate()
        )
        height = base.imag()
        reach = root(diagonal.norm() - height * height)
        if (self.side < 0) != (self.fold and bool((motion.phi / 2).sin() < 0)):
            reach = -reach
        motion.slide[self.slider] = reach - base.part()
        unit = diagonal / ((reach + height * 1j) * motion.directions[self.slider])
        motion.place(self.rail, unit, self.a.point, start)
        block = motion.mechanism.sliders[self.slider].block
        if block:
            twist = motion.twists[self.slider]
            # The block turns with the rail, whose angle is passed on once.
            motion.place(block, motion.unit[self.rail] * twist, self.d.point, end)

    def margin(self, motion: Motion) -> Series:
        diagonal = motion.at(self.d) - motion.at(self.a)
        base = (
            _pin_at_zero(motion, self.slider, self.a.point, self.d.point)
            * motion.directions[self.slider].conjugate()
        )
        height = base.imag()
        return diagonal.norm().sqrt() - _positive(height)


@dataclass(frozen=True, slots=True)
class RRP(Dyad):
    """Link ``one`` from pin A to pin B, which a slider keeps on a line of a placed link."""

    one: str  # The link
    a: Spot  # Its outer pin on the link that carries it
    pin: str  # B; also a point of the slider's block if it has one
    slider: str  # Name of the slider
    side: int  # +1: B lies ahead of A along the line, -1: behind

    CLOSING = ('slider', 'ahead', 'behind')
    TURNED = ('one',)
    SLID = ('slider',)
    ENDS = ('a', 'slider')

    def close(self, motion: Motion) -> None:
        start = motion.at(self.a)
        b = motion.vector(self.one, self.a.point, self.pin)
        base, line, block = motion.line(self.slider, self.pin)
        across = (base - start) * line.conjugate()
        height = across.imag()
        reach = root(b.norm() - height * height)
        if self.side < 0:
            reach = -reach
        motion.slide[self.slider] = reach - across.part()
        arm = line * (reach + height * 1j)
        motion.place(self.one, arm / b, self.a.point, start)
        if block is not None:
            motion.ride(self.slider, block, self.pin, start + arm)

    def margin(self, motion: Motion) -> Series:
        base, line, _ = motion.line(self.slider, self.pin)
        across = ((base - motion.at(self.a)) * line.conjugate()).imag()
        reach = motion.vector(self.one, self.a.point, self.pin).norm().sqrt()
        return reach - _positive(across)


@dataclass(frozen=True, slots=True)
class RRR(Dyad):
    """Links ``one`` (from pin A) and ``two`` (from pin D), pinned together at B."""

    # The links that the dyad places.
    one: str
    two: str
    # The outer pins on the links that carry them.
    a: Spot
    d: Spot
    pin: str  # B, on both links
    side: int  # +1: B lies left of A→D, -1: right
    # Whether the linkage folds or stretches when the crank lies along the ground, and passes this
    # change point: ``side`` is then the side for 0 < φ < π, and changes there.
    fold: bool = False
    stretch: bool = False

    CLOSING = ('pin', 'left', 'right')
    TURNED = ('one', 'two')

    def close(self, motion: Motion) -> None:
        start = motion.at(self.a)
        diagonal = motion.at(self.d) - start
        b, c, square, foot, area = self._triangle(motion, diagonal)
        height = root(area)
        if self.side_at(motion.phi) < 0:
            height = -height
        one = diagonal * (foot + height * 1j) / square
        two = one - diagonal
        motion.place(self.one, one / b, self.a.point, start)
        motion.place(self.two, two / c, self.d.point, motion.at(self.d))

    def _triangle(self, motion: Motion, diagonal: Series) -> tuple[Series, ...]:
        b = motion.vector(self.one, self.a.point, self.pin)
        c = motion.vector(self.two, self.d.point, self.pin)
        square, b_square, c_square = diagonal.norm(), b.norm(), c.norm()
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

    def margin(self, motion: Motion) -> Series:
        diagonal = motion.at(self.d) - motion.at(self.a)
        s = diagonal.norm().sqrt()
        b = motion.vector(self.one, self.a.point, self.pin).norm().sqrt()
        c = motion.vector(self.two, self.d.point, self.pin).norm().sqrt()
        folded = s - _positive(b - c)
        stretched = b + c - s
        return folded if folded.value[0].real < stretched.value[0].real else stretched


@dataclass(frozen=True, slots=True)
class PRP(Dyad):
    """Two blocks pinned together, each on a line of a placed link; the second may be virtual."""

    # Names of the sliders.
    one: str
    two: str
    pin: str  # The pin of both blocks; the point of slider ``two`` if its block is virtual

    SLID = ('one', 'two')
    ENDS = ('one', 'two')

    def close(self, motion: Motion) -> None:
        base_one, line_one, block_one = motion.line(self.one, self.pin)
        base_two, line_two, block_two = motion.line(self.two, self.pin)
        over = _meet(base_two - base_one, line_one, line_two)
        motion.slide[self.one], motion.slide[self.two] = over[0], -over[1]
        where = base_one + line_one * over[0]
        for name, block in ((self.one, block_one), (self.two, block_two)):
            if block is not None:
                motion.ride(name, block, self.pin, where)

    def margin(self, motion: Motion) -> Series:
        lines = [motion.line(name, self.pin)[1] for name in (self.one, self.two)]
        return _positive((lines[0] * lines[1].conjugate()).imag())


@dataclass(frozen=True, slots=True)
class RPP(Dyad):
    """
    A yoke that slides on the line of a placed link; in its slot slides a block, pinned to a link.

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

    SLID = ('outer',)
    ENDS = ('a', 'outer')

    def close(self, motion: Motion) -> None:
        inner, outer = (motion.mechanism.sliders[name] for name in (self.inner, self.outer))
        base, line, unit = motion.line(self.outer, outer.point)
        assert unit is not None
        slot = unit * motion.directions[self.inner]
        start = motion.at(self.a)
        rest = start - base - unit * _pin_at_zero(motion, self.inner, outer.point, self.a.point)
        over = _meet(rest, slot, line)
        motion.slide[self.inner], motion.slide[self.outer] = over
        motion.ride(self.outer, unit, outer.point, base + line * over[1])
        if inner.block:
            turned = unit * motion.twists[self.inner]
            motion.place(inner.block, turned, self.a.point, start)

    def margin(self, motion: Motion) -> Series:
        outer = motion.mechanism.sliders[self.outer]
        _, line, unit = motion.line(self.outer, outer.point)
        assert unit is not None
        return _positive((unit * motion.directions[self.inner] * line.conjugate()).imag())


def _pin_at_zero(motion: Motion, slider: str, origin: str, pin: str) -> Series:
    """Return a pin of a slider's block at a slide of 0, from the origin of the slider's link."""
    slide = motion.mechanism.sliders[slider]
    place = motion.vector(slide.along, origin, slide.through)
    if not slide.block or slide.point == pin:
        return place
    return place + motion.vector(slide.block, slide.point, pin) * motion.twists[slider]


def _positive(number: Series) -> Series:
    """Return the absolute value of a real number."""
    return -number if number.value[0].real < 0 else number


def _meet(rest: Series, one: Series, two: Series) -> tuple[Series, Series]:
    """Solve x·one + y·two = rest for real x and y."""
    by = decided((one * two.conjugate()).imag())
    return (rest * two.conjugate()).imag() / by, -(rest * one.conjugate()).imag() / by


def is_nearly_paired(mechanism: Mechanism) -> bool:
    """
    Return whether the lengths of a four-bar are equal in pairs to 1/500, and no toggle is meant.

    Folded kites have one change point: they pass it only if the crank drives them.
    """
    return any(
        _are_nearly_equal((a, c), (b, d))
        or _are_nearly_equal((a, b), (c, d))
        or (crank == CRANK and _are_nearly_equal((a, d), (b, c)))
        for dyad in mechanism.dyads
        if isinstance(dyad, RRR) and not (dyad.fold or dyad.stretch)
        for crank, (a, b, c, d) in _four_bars(mechanism, dyad)
    )


def _are_nearly_equal(*pairs: tuple[float, float]) -> bool:
    return all(abs(one - other) <= max(one, other) / 500 for one, other in pairs)


def _four_bars(mechanism: Mechanism, dyad: RRR) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Yield the link at A and the lengths of each loop of the dyad and two links with a pin."""
    links = mechanism.links
    b = _distance(links[dyad.one], dyad.a.point, dyad.pin)
    c = _distance(links[dyad.two], dyad.d.point, dyad.pin)
    for crank, arm in links.items():
        for ground, base in links.items():
            if dyad.a.point in arm and dyad.d.point in base and crank != ground:
                for pivot in (arm.keys() & base.keys()) - {dyad.pin}:
                    a = _distance(arm, pivot, dyad.a.point)
                    yield crank, (a, b, c, _distance(base, pivot, dyad.d.point))


def _distance(points: Mapping[str, tuple[float, float]], one: str, other: str) -> float:
    return abs(complex(*points[one]) - complex(*points[other]))
