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
How a motion changes with each number of its linkage: what condition numbers are made of.

The closing equation of a dyad, differentiated by a number, is linear in the changes of its two
unknowns, at every time: a power series again, with the same determinant for all numbers. The
directions of all links, the slides and the inverse of the determinant come from the reference and
are right to the last digit of a double; nothing that cancels near a singularity is computed here.
What is, are sums that are as great as what they are compared with, so that double precision is
enough for a condition number; a test compares it with differences of fifty digits.

Arrays are [power of time, case, number].
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any

from campaigns.accuracy.mechanism import CRANK, GROUND, Key, Mechanism, Spot
from campaigns.accuracy.motion import Constants, Handed, ORDER
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


def times(series: Array, change: Array) -> Array:
    """Return the product of two power series."""
    product: Array = series[0] * change
    product[1:] += series[1] * change[:-1]
    product[2] += series[2] * change[0]
    return product


def handed_on(mechanism: Mechanism) -> tuple[Handed, ...]:
    """Return what dyads hand on to the ones behind them: pins, then angles and slides in order."""
    if len(mechanism.dyads) < 2:
        return ()
    links = [link for link in mechanism.links if link not in {GROUND, CRANK}]
    spots = {spot for dyad in mechanism.dyads[1:] for spot in dyad.given(mechanism)}
    pins: list[str | Spot] = [*links, *sorted(spot for spot in spots if spot.link != GROUND)]
    names: list[tuple[str | Spot, str]] = [(pin, part) for pin in pins for part in 'xy']
    for dyad in mechanism.dyads:
        names += [(link, 'turn') for link in dyad.turned]
        names += [(slider, 'slide') for slider in dyad.slid if mechanism.sliders[slider].block]
    return tuple(Handed(*name, power) for name in names for power in range(ORDER))


def turn_values(unit: Array) -> Array:
    """Return an angle's rate and half its acceleration, behind a 0, of the series of e^iθ."""
    back = unit[0].conj()
    return np.array([np.zeros(len(back)), (unit[1] * back).imag, (unit[2] * back).imag])


def turn_sizes(unit: Array) -> Array:
    """Return their sizes, and π in place of the 0: an angle counts as half a turn at least."""
    sizes = np.abs(turn_values(unit))
    sizes[0] = pi
    return sizes


class Tangent:
    """
    Changes per unit of relative change of every number that is not zero, and of φ, ω and α.

    Parameters
    ----------
    mechanism
        What is varied.
    constants
        Its numbers as balls.
    numbers
        The same as doubles.
    values
        Series of links, slides and inverse determinants, [power of time, case].
    held
        Series of the pins that links are held by, and of the points that dyads are given.
    phi, alpha
        Input angles and accelerations of the cases.
    opening
        Of each case the angle that the first dyad sees, as far as it is a sum.

    """

    def __init__(
        self,
        mechanism: Mechanism,
        constants: Constants,
        numbers: Mapping[Key, float],
        values: Mapping[str | int, Array],
        held: Mapping[str | Spot, Array],
        phi: Array,
        alpha: Array,
        opening: Array,
    ) -> None:
        self.mechanism = mechanism
        self._constants = constants
        self._values = values
        self._cases = len(phi)
        self._behind = False
        columns = [key for key, value in numbers.items() if value]
        self._column = {key: i for i, key in enumerate(columns)}
        self._inputs = len(columns)
        self.handed = handed_on(mechanism)
        self._handed = {key: self._inputs + 4 + i for i, key in enumerate(self.handed)}
        self._count = len(columns) + 4 + len(self.handed)
        self._held = held
        self.unit = {name: values[name][..., None] for name in ('ground', *self._links())}
        self.slide_value = {name: values[name][..., None] for name in mechanism.sliders}
        self._inverse = iter(range(len(mechanism.dyads)))
        self.direction, self.direction_change = {}, {}
        self.twist, self.twist_change = {}, {}
        for name in mechanism.sliders:
            x, y = (numbers[name, 'direction', component] for component in 'xy')
            self.direction[name] = complex(constants.directions[name])
            self.direction_change[name] = self.direction[name] * (
                1j * (self._change((name, 'direction'), x, y) / complex(x, y)).imag
            )
            self.twist[name] = complex(constants.twists[name])
            angle = (name, 'direction', 'angle')
            self.twist_change[name] = np.zeros(self._count)
            if angle in self._column:
                self.twist_change[name][self._column[angle]] = numbers[angle]
        self._vectors: dict[tuple[str, str], Array] = {}
        unit = 2.0**-constants.exponent
        for link, points in mechanism.links.items():
            for point, (x, y) in points.items():
                change = self._change((link, point), x * unit, y * unit)
                self._vectors[link, point] = change
        self.turn = {GROUND: self._zeros(float), CRANK: self._zeros(float)}
        self.turn[CRANK][0, :, self._inputs] = phi
        self.turn[CRANK][1, :, self._inputs + 1] = 1.0
        self.turn[CRANK][2, :, self._inputs + 2] = 0.5 * alpha
        self.turn[CRANK][0, :, self._inputs + 3] = opening
        self.shown = dict(self.turn)
        self._origin = {GROUND: self._zeros(complex)}
        self.slide: dict[str, Array] = {}
        pivot = next(iter(mechanism.links[CRANK]))
        self.place(CRANK, self.turn[CRANK], pivot, self.at(Spot(GROUND, pivot)))
        for dyad in mechanism.dyads:
            dyad.vary(self)
            self._behind = True

    def _links(self) -> list[str]:
        return [name for name in self.mechanism.links if name != GROUND]

    def _zeros(self, kind: type) -> Array:
        return np.zeros((ORDER, self._cases, self._count), kind)

    def _change(self, owner: tuple[str, str], x: float, y: float) -> Array:
        """Return how a vector in a link's frame changes with its own components."""
        change = np.zeros(self._count, complex)
        for component, value in (('x', x), ('y', 1j * y)):
            key = (owner[0], owner[1], component)
            if key in self._column:
                change[self._column[key]] = value
        return change

    def next_inverse(self) -> Array:
        """Return the inverse determinant of the dyad that is being varied."""
        return self._values[next(self._inverse)][..., None]

    def vector(self, link: str, start: str, end: str) -> tuple[complex, Array]:
        """Return what leads from one point of a link to another, and its change."""
        points = self._constants.points
        value = complex(points[Spot(link, end)] - points[Spot(link, start)])
        return value, self._vectors[link, end] - self._vectors[link, start]

    def at(self, spot: Spot) -> Array:
        """Return the change of where a point is."""
        change = self._origin[spot.link] + self._arm(spot)
        if self._behind:
            self._round_pin(spot, change)
        return change

    def _round_pin(self, owner: str | Spot, change: Array) -> None:
        if (owner, 'x', 0) in self._handed:
            for power, place in enumerate(self._held[owner]):
                change[power, :, self._handed[Handed(owner, 'x', power)]] += place.real
                change[power, :, self._handed[Handed(owner, 'y', power)]] += 1j * place.imag

    def _arm(self, spot: Spot) -> Array:
        unit = self.unit[spot.link]
        arm = unit * self._vectors[spot.link, spot.point]
        z = complex(self._constants.points[spot])
        if z and spot.link != GROUND:
            arm += 1j * times(unit * z, self.turn[spot.link])
        return arm

    def place(self, link: str, turn: Array, point: str, where: Array) -> None:
        """Note the change of a link's angle, and of where one of its points is."""
        self.shown[link] = turn
        if (link, 'turn', 0) in self._handed:
            turn = turn.copy()
            sizes = turn_sizes(self.unit[link][..., 0]) + np.abs(turn).sum(axis=2)
            for power, size in enumerate(sizes):
                turn[power, :, self._handed[Handed(link, 'turn', power)]] += size
        where = where.copy()
        self._round_pin(link, where)
        self.turn[link] = turn
        self._origin[link] = where - self._arm(Spot(link, point))

    def ride(self, slider: str, pin: str, turn: Array, where: Array) -> None:
        """Note the change of a block that a slide places."""
        slide = self.mechanism.sliders[slider]
        if (slider, 'slide', 0) in self._handed:
            moved = self._zeros(float)
            sizes = np.abs(self.slide[slider]).sum(axis=2)
            sizes += np.abs(self.slide_value[slider][..., 0])
            for power, size in enumerate(sizes):
                moved[power, :, self._handed[Handed(slider, 'slide', power)]] = size
            where = where + times(self.unit[slide.along] * self.direction[slider], moved)
        self.place(str(slide.block), turn, pin, where)

    def line(self, name: str, point: str) -> tuple[Array, Array, Array, Array | None]:
        """Return a line's direction, its change, that of its start, and the block's turn."""
        slide = self.mechanism.sliders[name]
        unit = self.unit[slide.along]
        line = unit * self.direction[name]
        turn = self.turn[slide.along]
        line_change = unit * self.direction_change[name] + 1j * times(line, turn)
        start = self.at(Spot(slide.along, slide.through))
        if slide.block is None:
            return line, line_change, start, None
        turn = turn.copy()
        turn[0] += self.twist_change[name]
        if point != slide.point:
            arm, arm_change = self.vector(slide.block, slide.point, point)
            turned = unit * self.twist[name]
            start = start + turned * arm_change + 1j * times(turned * arm, turn)
        return line, line_change, start, turn
