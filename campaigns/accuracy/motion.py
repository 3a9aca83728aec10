# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage at one input angle as power series in time, in balls of any precision.

The crank's direction is the series of e^iφ(t) with φ(t) = φ + t + α·t²/2, and every dyad is a
closed form in such series (`campaigns.series`). What a dyad passes to later dyads is rounded: it
is changed by a 0 of its own on the tape.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import frexp, pi, remainder
from typing import Any

from campaigns.accuracy.mechanism import CRANK, Key, Mechanism, Spot
from campaigns.series import FACTORIALS, Series, Tape
from flint import arb
from linkage_ros.kinematics import GROUND, SlideJoint


class OpenError(Exception):
    """A dyad does not reach."""


class UndecidedError(Exception):
    """The working precision cannot decide whether a dyad is open, or its links are in line."""


class Motion:
    """
    The pose and motion of all links; each dyad adds the links that it places.

    Attributes
    ----------
    unit
        For each link the series of e^iθ, θ its angle against the ground.
    origin
        For each link the series of its frame's origin.
    slide
        For each slider the series of its point's distance from the start of the line.
    unchanged
        As ``unit``, before it is rounded.
    numbers
        For each number of the linkage its index on the tape, and 1j for the imaginary part of a
        place; lengths are relative to a power of 2 near the largest, with this ``exponent``.
    placed
        Number of dyads that are closed.

    Parameters
    ----------
    mechanism, numbers
        The mechanism, and its numbers.
    precision
        In bits.
    phi, alpha
        Angle and acceleration of the input, whose rate is 1.

    """

    def __init__(
        self,
        mechanism: Mechanism,
        numbers: Mapping[Key, Any],
        precision: int,
        phi: Any,
        alpha: Any = 0.0,
    ) -> None:
        self.mechanism = mechanism
        self.tape = tape = Tape(precision)
        self.phi = arb(phi)
        self.exponent = max(
            frexp(max(map(abs, spot)))[1]
            for points in mechanism.links.values()
            for spot in points.values()
        )
        self.numbers: dict[Key, tuple[int, complex]] = {}
        self.points = {
            Spot(link, point): self._given(link, point, numbers, arb(2) ** -self.exponent)
            for link, points in mechanism.links.items()
            for point in points
        }
        self.directions, self.twists = {}, {}
        for name, slide in mechanism.sliders.items():
            direction = self._given(name, 'direction', numbers)
            self.directions[name] = direction / direction.norm().sqrt()
            if slide.angle:
                angle = tape.number(numbers[name, 'direction', 'angle'])
                self.numbers[name, 'direction', 'angle'] = angle.index, 1
                self.twists[name] = angle.direction()
            else:
                self.twists[name] = tape.constant(1)
        self.crank = tape.number(phi, 1.0, alpha)
        # The angle counts within half a turn; the first dyad may use its sum with another one.
        opening = mechanism.opening()
        turned = abs(remainder(float(self.phi), 2 * pi))
        sum_with = abs(remainder(float(self.phi) + opening, 2 * pi)) if opening else 0.0
        # By which rounding the numbers and the input angle changes the distance to a toggle.
        self.widths = dict(tape.widths) | {self.crank.index: [turned]}
        tape.widths[self.crank.index] = [turned + sum_with, 1.0, abs(float(alpha))]
        ground = tape.constant(1)
        self.unit = {GROUND: ground, CRANK: self.crank.direction()}
        self.unchanged = dict(self.unit)
        pivot = next(iter(mechanism.links[CRANK]))
        arm = self.unit[CRANK] * self.points[Spot(CRANK, pivot)]
        self.origin = {
            GROUND: tape.constant(0),
            CRANK: self.points[Spot(GROUND, pivot)] - arm,
        }
        self.slide: dict[str, Series] = {}
        self._passed = mechanism.passed_pins()
        self._roundings: dict[str | Spot, Series] = {}
        self.placed = 0

    def _given(self, owner: str, name: str, numbers: Mapping[Key, Any], unit: Any = 1) -> Series:
        x, y = (owner, name, 'x'), (owner, name, 'y')
        point = self.tape.point(arb(numbers[x]) * unit, arb(numbers[y]) * unit)
        self.numbers |= {x: (point.index, 1), y: (point.index, 1j)}
        return point

    def solve(self) -> None:
        """Close one dyad after the other."""
        for dyad in self.mechanism.dyads:
            dyad.close(self)
            self.placed += 1

    def at(self, spot: Spot) -> Series:
        """Return the position of a point of a placed link."""
        z = self.points[spot]
        if spot.link == GROUND:
            return z
        place = self.origin[spot.link] + self.unit[spot.link] * z
        return self._rounded_place(spot, place) if self.placed else place

    def vector(self, link: str, start: str, end: str) -> Series:
        """Return the vector from one point of a link to another, in its frame."""
        return self.points[Spot(link, end)] - self.points[Spot(link, start)]

    def place(self, link: str, unit: Series, point: str, where: Series) -> None:
        """Set the pose of a link by its direction and one of its points."""
        self.unchanged[link] = unit
        if self._passed and link in self.mechanism.dyads[self.placed].turned:
            turn = unit.turning()
            sizes = self._sizes(turn)
            # An angle counts as at least π.
            sizes[0] += pi - abs(float(turn.orders()[0]))
            change = self.tape.change(sizes)
            unit += unit * change * 1j
        self.unit[link] = unit
        arm = unit * self.points[Spot(link, point)]
        self.origin[link] = self._rounded_place(link, where) - arm

    def ride(self, slider: str, unit: Series, point: str, where: Series) -> None:
        """Set the pose of a block that a slide places."""
        slide = self.mechanism.sliders[slider]
        if self._passed and slider in self.mechanism.dyads[self.placed].slid:
            line = self.unit[slide.along] * self.directions[slider]
            change = self.tape.change(self._sizes(self.slide[slider]))
            where += line * change
        self.place(slide.block, unit, point, where)

    def _sizes(self, passed: Series) -> list[float]:
        """Return the size and the condition number of a passed result, in each order."""
        return passed.sizes(self.tape.widths)

    def _rounded_place(self, owner: str | Spot, place: Series) -> Series:
        """Return a place that is passed to later dyads; each coordinate counts with its size."""
        if owner not in self._passed:
            return place
        if owner not in self._roundings:
            orders = [complex(place.value[k]) * factor for k, factor in enumerate(FACTORIALS)]
            widths = [complex(abs(order.real), abs(order.imag)) for order in orders]
            self._roundings[owner] = self.tape.change(widths)
        return place + self._roundings[owner]

    def joints(self) -> list[tuple[Series, list[float]]]:
        """Return the published joints, each with the absolute values of its terms, in order."""
        found = []
        for joint in self.mechanism.joints.values():
            if isinstance(joint, SlideJoint):
                slide = self.slide[joint.slider]
                found.append((slide, [abs(float(order)) for order in slide.orders()]))
                continue
            unit, terms = self.unchanged[joint.child], [pi, 0.0, 0.0]
            for link in {joint.child, joint.parent} - {GROUND}:
                turn = self.unchanged[link].turning()
                for order in (1, 2):
                    terms[order] += abs(float(turn.orders()[order]))
            if joint.parent != GROUND:
                unit = unit * self.unchanged[joint.parent].conjugate()
            found.append((unit.turning(), terms))
        return found

    def line(self, name: str, point: str) -> tuple[Series, Series, Series | None]:
        """
        Return the line of a slider on a placed link as a start, a direction and the block's unit.

        The start is that of the parallel line on which the given point of the block moves.
        """
        slide = self.mechanism.sliders[name]
        start = self.at(Spot(slide.along, slide.through))
        unit = self.unit[slide.along]
        direction = unit * self.directions[name]
        if not slide.block:
            return start, direction, None
        turned = unit * self.twists[name]
        if point != slide.point:
            start += turned * self.vector(slide.block, slide.point, point)
        return start, direction, turned


def root(square: Series) -> Series:
    """Return the positive root of the square of a dyad's reach."""
    if square.value[0].real < 0:
        raise OpenError
    if not square.value[0].real > 0:
        raise UndecidedError
    return square.sqrt()


def decided(determinant: Series) -> Series:
    """Return a determinant, which must not be 0."""
    if determinant.value[0].contains(0):
        raise UndecidedError
    return determinant
