# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage by plain geometry: intersections of circles and lines, one dyad after the other.

It gives the states that close, the closure error of the others, and the pose in the assembly of
the file; `constraints` corrects the pose to the solution. The dyads and their order come from the
generator of the linkage, not from the package. Many states are computed at once, in numpy's
longest floats.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from campaigns.accuracy.dyads import PRP, RPP, RPR, RRP, RRR
from campaigns.accuracy.mechanism import Spot
from campaigns.topologies.constraints import Array, Complex, Real, TURN
from linkage_ros.kinematics import GROUND, Linkage
import numpy as np


@dataclass(frozen=True, slots=True)
class DrivenLink:
    """A link that an input places relative to a placed link."""

    link: str
    on: str
    index: int


@dataclass(frozen=True, slots=True)
class DrivenRRR:
    """Two arms pinned together; an arm may consist of two links with an input between them."""

    arms: tuple[tuple[str, ...], tuple[str, ...]]  # The links of each arm, from the outer pin on
    ends: tuple[Spot, Spot]  # The outer pins, on the links that carry them
    pin: str  # The pin that the last links share


Group = DrivenLink | DrivenRRR | RRR | RRP | RPR | PRP | RPP


class Margin(NamedTuple):
    """Margin of a dyad in [m], negative if it is open, and the size of its terms."""

    spare: Array
    grain: Array


@dataclass(frozen=True, slots=True)
class Passing:
    """A side of assembly that changes where the linkage passes a change point."""

    side: int  # +1 or −1, for a crank direction between 0 and π from the line
    # Link whose x axis lies along the crank; link and direction of the line.
    crank: str
    line: tuple[str, complex]
    at: tuple[bool, bool]  # Whether it changes at a crank direction of 0, and at π
    # Sign s and constant c of the crank's direction s·input + c, which counts turns; None if the
    # crank is not the input and only its direction is known.
    turns: tuple[int, float] | None

    def sign(self, places: Places, inputs: Array) -> Array:
        """Return the side at many states."""
        link, direction = self.line
        phi = np.angle(places.units[self.crank] * (places.units[link] * direction).conj())
        if self.turns is not None:
            whole = self.turns[0] * inputs[0] + self.turns[1]
            phi = phi + TURN * np.round((whole - phi) / TURN)
        side = np.full(phi.shape, self.side)
        for part, passed in zip((np.sin(phi / 2), np.cos(phi / 2)), self.at, strict=True):
            if passed:
                side = np.where(part < 0, -side, side)
        return side


@dataclass
class Places:
    """Poses of links."""

    # For each link the direction of its x axis and the position of its origin.
    units: dict[str, Array] = field(default_factory=dict)
    origins: dict[str, Array] = field(default_factory=dict)
    margins: list[Margin] = field(default_factory=list)  # Margin of each dyad that has limits
    # For each dyad of two lines the sine of the angle between them; they are parallel at 0.
    crossings: list[Array] = field(default_factory=list)


class Geometry:
    """
    A linkage of dyads.

    Parameters
    ----------
    linkage
        The linkage.
    groups
        Its inputs and dyads in the order of solution.
    sides
        +1 or −1 for the pin or slider that closes a dyad with two assemblies. +1: left of the line
        between the outer pins, in the order of ``ends`` or a→d, or ahead.

    """

    def __init__(
        self, linkage: Linkage, groups: tuple[Group, ...], sides: Mapping[str, int | Passing]
    ) -> None:
        self.linkage = linkage
        self._groups = groups
        self._sides = sides

    def place(self, inputs: Array) -> Places:
        """Return the poses at inputs (inputs, N); without meaning where a dyad is open."""
        count = inputs.shape[1]
        places = Places()
        places.units[GROUND] = np.ones(count, Complex)
        places.origins[GROUND] = np.zeros(count, Complex)
        self.inputs = inputs
        for group in self._groups:
            with np.errstate(all='ignore'):
                getattr(self, f'_{type(group).__name__.lower()}')(group, places)
        return places

    def point(self, link: str, point: str) -> Any:
        """Return a point in the frame of its link."""
        x, y = self.linkage.links[link][point]
        return Complex(x) + Complex(1j) * Complex(y)

    def at(self, places: Places, spot: Spot) -> Array:
        """Return the position of a point."""
        return np.asarray(places.origins[spot.link] + places.units[spot.link] * self.point(*spot))

    def _side(self, closing: str, places: Places) -> Any:
        side = self._sides[closing]
        return side if isinstance(side, int) else side.sign(places, self.inputs)

    def _put(self, places: Places, link: str, unit: Array, point: str, where: Array) -> None:
        unit = unit / np.abs(unit)
        places.units[link] = unit
        places.origins[link] = where - unit * self.point(link, point)

    def _drivenlink(self, group: DrivenLink, places: Places) -> None:
        unit, origin = self._carried(group.on, group.link, group.index)
        places.units[group.link] = places.units[group.on] * unit
        places.origins[group.link] = places.origins[group.on] + places.units[group.on] * origin

    def _carried(self, on: str, link: str, index: int) -> tuple[Array, Array]:
        """Return direction and origin of a driven link in the frame of the other link."""
        given, value = self.linkage.inputs[index], self.inputs[index]
        if given.slider:
            slider = self.linkage.sliders[given.slider]
            turn = _polar(np.full(1, slider.angle, Real))
            start, line = self._line(given.slider)
            along = start + value * line
            if slider.block == link:
                return turn, along - turn * self.point(link, slider.point)
            # The line is on the new link, the block is the known one.
            back = turn.conj()
            return back, self.point(on, slider.point) - back * along
        (pin,) = set(self.linkage.links[on]) & set(self.linkage.links[link])
        unit = _polar(value if given.child == link else -value)
        return unit, self.point(on, pin) - unit * self.point(link, pin)

    def _line(self, name: str, pin: str = '') -> tuple[Any, Any]:
        """Return the line on which a pin of a slider's block moves, in the frame of ``along``."""
        slider = self.linkage.sliders[name]
        x, y = (Real(part) for part in slider.direction)
        line = (x + Complex(1j) * y) / np.sqrt(x * x + y * y)
        start = self.point(slider.along, slider.through)
        if pin and pin != slider.point:
            beside = self.point(slider.block, pin) - self.point(slider.block, slider.point)
            start = start + _polar(np.full(1, slider.angle, Real)) * beside
        return start, line

    def _block(self, places: Places, name: str, pin: str, where: Array) -> None:
        slider = self.linkage.sliders[name]
        if slider.block:
            turn = _polar(np.full(1, slider.angle, Real))
            self._put(places, slider.block, places.units[slider.along] * turn, pin, where)

    def _rrr(self, dyad: RRR, places: Places) -> None:
        arms = (
            self.point(dyad.one, dyad.pin) - self.point(dyad.one, dyad.a.point),
            self.point(dyad.two, dyad.pin) - self.point(dyad.two, dyad.d.point),
        )
        ends = self.at(places, dyad.a), self.at(places, dyad.d)
        one, other = self._triangle(places, ends, arms, self._side(dyad.pin, places))
        self._put(places, dyad.one, one / arms[0], dyad.a.point, ends[0])
        self._put(places, dyad.two, other / arms[1], dyad.d.point, ends[1])

    def _drivenrrr(self, dyad: DrivenRRR, places: Places) -> None:
        arms, rests = [], []
        for links, end in zip(dyad.arms, dyad.ends, strict=True):
            tip, rest = self.point(links[-1], dyad.pin), []
            if len(links) > 1:
                unit, origin = self._carried(links[0], links[1], self._between(*links))
                tip = origin + unit * tip
                rest = [(links[1], unit, origin)]
            arms.append(tip - self.point(links[0], end.point))
            rests.append(rest)
        ends = self.at(places, dyad.ends[0]), self.at(places, dyad.ends[1])
        vectors = self._triangle(places, ends, (arms[0], arms[1]), self._side(dyad.pin, places))
        for k in (0, 1):
            first = dyad.arms[k][0]
            self._put(places, first, vectors[k] / arms[k], dyad.ends[k].point, ends[k])
            for link, unit, origin in rests[k]:
                places.units[link] = places.units[first] * unit
                places.origins[link] = places.origins[first] + places.units[first] * origin

    def _between(self, one: str, other: str) -> int:
        for i, given in enumerate(self.linkage.inputs):
            ends = {given.parent, given.child}
            if given.slider:
                slider = self.linkage.sliders[given.slider]
                ends = {slider.block, slider.along}
            if ends == {one, other}:
                return i
        raise LookupError(f'no input between {one} and {other}')

    def _triangle(
        self, places: Places, ends: tuple[Array, Array], arms: tuple[Any, Any], side: Any
    ) -> tuple[Array, Array]:
        """Return the vectors from two ends to the point where two arms meet, on a side."""
        diagonal = ends[1] - ends[0]
        s, b, c = np.abs(diagonal), np.abs(arms[0]), np.abs(arms[1])
        spare = np.minimum(b + c - s, s - np.abs(b - c))
        grain = np.abs(ends[0]) + np.abs(ends[1]) + b + c
        places.margins.append(Margin(spare, grain))
        # Heron's area, each factor a difference of lengths.
        product = (b + c - s) * (b + c + s) * (s - b + c) * (s + b - c)
        height = side * np.sqrt(np.maximum(product, 0)) / (2 * s)
        foot = (s * s + (b - c) * (b + c)) / (2 * s)
        one = diagonal / s * (foot + Complex(1j) * height)
        return one, one - diagonal

    def _rrp(self, dyad: RRP, places: Places) -> None:
        start, line = self._line(dyad.slider, dyad.pin)
        along = self.linkage.sliders[dyad.slider].along
        unit = places.units[along] * line
        foot = places.origins[along] + places.units[along] * start
        end = self.at(places, dyad.a)
        seen = (end - foot) * unit.conj()
        arm = self.point(dyad.one, dyad.pin) - self.point(dyad.one, dyad.a.point)
        b, y = np.abs(arm), seen.imag
        places.margins.append(
            Margin(b - np.abs(y), np.abs(end) + np.abs(foot) + np.abs(start) + b)
        )
        ahead = self._side(dyad.slider, places) * np.sqrt(np.maximum((b - y) * (b + y), 0))
        where = foot + unit * (seen.real + ahead)
        self._put(places, dyad.one, (where - end) / arm, dyad.a.point, end)
        self._block(places, dyad.slider, dyad.pin, where)

    def _rpr(self, dyad: RPR, places: Places) -> None:
        start, line = self._line(dyad.slider, dyad.d.point)
        ends = self.at(places, dyad.a), self.at(places, dyad.d)
        diagonal = ends[1] - ends[0]
        seen = (start - self.point(dyad.rail, dyad.a.point)) * line.conj()
        s, h = np.abs(diagonal), seen.imag
        if np.abs(h) < 8 * UNIT * (np.abs(start) + np.abs(self.point(dyad.rail, dyad.a.point))):
            h = 0 * h
        grain = np.abs(ends[0]) + np.abs(ends[1]) + np.abs(start)
        places.margins.append(Margin(s - np.abs(h), grain))
        ahead = self._side(dyad.slider, places) * np.sqrt(np.maximum((s - h) * (s + h), 0))
        unit = diagonal / (ahead + Complex(1j) * h) / line
        self._put(places, dyad.rail, unit, dyad.a.point, ends[0])
        self._block(places, dyad.slider, dyad.d.point, ends[1])

    def _prp(self, dyad: PRP, places: Places) -> None:
        feet, units = [], []
        for name in (dyad.one, dyad.two):
            along = self.linkage.sliders[name].along
            start, line = self._line(name, dyad.pin)
            feet.append(places.origins[along] + places.units[along] * start)
            units.append(places.units[along] * line)
        places.crossings.append((units[0].conj() * units[1]).imag)
        where = feet[0] + units[0] * _crossing(feet[1] - feet[0], units[0], units[1])
        for name in (dyad.one, dyad.two):
            self._block(places, name, dyad.pin, where)

    def _rpp(self, dyad: RPP, places: Places) -> None:
        inner, outer = self.linkage.sliders[dyad.inner], self.linkage.sliders[dyad.outer]
        yoke = places.units[outer.along] * _polar(np.full(1, outer.angle, Real))
        start, line = self._line(dyad.outer)
        foot = places.origins[outer.along] + places.units[outer.along] * start
        unit = places.units[outer.along] * line
        slot, direction = self._line(dyad.inner, dyad.a.point)
        pin = self.at(places, dyad.a)
        # Pin = guide point + vector to the start of the slot + slide along the slot.
        beside = yoke * (slot - self.point(inner.along, outer.point))
        between = pin - beside - foot
        where = foot + unit * _crossing(between, unit, yoke * direction)
        self._put(places, inner.along, yoke, outer.point, where)
        self._block(places, dyad.inner, dyad.a.point, pin)


UNIT = 2.0**-53


def _crossing(between: Array, one: Array, other: Array) -> Array:
    """Return the distance along the first line to its intersection with the second."""
    return np.asarray((between.conj() * other).imag / (one.conj() * other).imag)


def _polar(angle: Array) -> Array:
    return np.cos(angle) + Complex(1j) * np.sin(angle)
