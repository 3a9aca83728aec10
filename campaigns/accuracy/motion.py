# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage at one input angle as power series in time, in balls of any precision (FLINT's Arb).

Nothing is differentiated by hand. The crank's direction is the series of e^iφ(t) with
φ(t) = φ + t + α·t²/2, every dyad is a closed form in such series, and velocity and acceleration
are read from their second and third coefficients. A ball encloses its exact value, so the number
of correct digits is proven for each result.

**Condition numbers** follow from the derivative of a motion with respect to each number of its
linkage. The closing equation of a dyad, differentiated by a number, is linear in the derivatives
of its two unknowns at every time. It is again a power series, with the same determinant for all
numbers. The directions of all links, the slides and the inverse of the determinant come from the
reference, and are correct to the last digit of a double. Terms that cancel near a singularity are
not computed here. The remaining sums are as large as their terms, so double precision is enough
for a condition number; a test compares it with differences of fifty digits.

Arrays are [power of time, case, number].
"""

from __future__ import annotations

from collections.abc import Mapping
from math import frexp, pi
from typing import Any, NamedTuple

from campaigns.accuracy.mechanism import CRANK, GROUND, Key, Mechanism, Spot
from flint import acb, acb_series, arb, arb_series, ctx
import numpy as np
import numpy.typing as npt

ORDER = 3
ctx.cap = ORDER


class OpenError(Exception):
    """A dyad does not reach."""


class UndecidedError(Exception):
    """The working precision cannot decide whether a dyad is open, or its links are in line."""


class PassedResult(NamedTuple):
    """A number that a dyad passes to later dyads: a coefficient of a power series in time."""

    owner: str | Spot  # A link, a slider, or a point of a link
    # ``turn``, the link's angle; ``x`` or ``y`` of the pin that holds the link, or of the point
    # itself; ``slide``.
    quantity: str
    power: int  # Power of time: 0, 1 or 2, for the position, the rate and half the acceleration


class Constants:
    """The numbers of a mechanism as balls; lengths relative to a power of 2 near the largest."""

    def __init__(self, mechanism: Mechanism, numbers: Mapping[Key, Any]) -> None:
        self.exponent = max(
            frexp(max(map(abs, spot)))[1]
            for points in mechanism.links.values()
            for spot in points.values()
        )
        unit = arb(2) ** -self.exponent
        number = {key: arb(value) for key, value in numbers.items()}
        self.points = {
            Spot(link, point): acb(number[link, point, 'x'], number[link, point, 'y']) * unit
            for link, points in mechanism.links.items()
            for point in points
        }
        self.directions = {}
        self.twists = {}
        for name, slide in mechanism.sliders.items():
            direction = acb(number[name, 'direction', 'x'], number[name, 'direction', 'y'])
            self.directions[name] = direction / abs(direction)
            angle = number[name, 'direction', 'angle']
            self.twists[name] = acb(angle.cos(), angle.sin()) if slide.angle else acb(1)


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
    inverse
        For each dyad the inverse determinant of its linear equations.
    unchanged
        As ``unit``, without the change of a passed result.
    held
        For each link the series of the position of the pin that holds it.

    Parameters
    ----------
    mechanism, constants
        The mechanism and its numbers.
    pivot
        Name of the crank's pin on the ground.
    changed
        For condition numbers: a passed result to change, and by how much.

    """

    def __init__(
        self,
        mechanism: Mechanism,
        constants: Constants,
        pivot: str,
        changed: tuple[PassedResult, Any] | None = None,
    ) -> None:
        self._changed = changed
        self.mechanism = mechanism
        self.constants = constants
        self._pivot = constants.points[Spot(GROUND, pivot)]
        self._crank_pivot = constants.points[Spot(CRANK, pivot)]

    def solve(self, phi: Any, alpha: Any) -> None:
        """Close one dyad after the other."""
        sine, cosine = phi.sin_cos()
        direction = acb(cosine, sine)
        crank = acb_series(
            [direction, acb(-sine, cosine), direction * acb(arb(-0.5), alpha * arb(0.5))]
        )
        self.unit: dict[str, Any] = {GROUND: acb_series([1]), CRANK: crank}
        self.origin: dict[str, Any] = {
            GROUND: acb_series([0]),
            CRANK: self._pivot - self._crank_pivot * crank,
        }
        self.unchanged = dict(self.unit)
        self.held: dict[str, Any] = {}
        self.slide: dict[str, Any] = {}
        self.inverse: list[Any] = []
        self.phi = phi
        self._first_done = False
        for dyad in self.mechanism.dyads:
            dyad.close(self)
            self._first_done = True

    def at(self, spot: Spot) -> Any:
        """Return the position of a point of a placed link."""
        z = self.constants.points[spot]
        if spot.link == GROUND:
            return acb_series([z])
        place = self.origin[spot.link] + self.unit[spot.link] * z
        if self._first_done and self._changed is not None and self._changed[0].owner == spot:
            place += self._change()
        return place

    def vector(self, link: str, start: str, end: str) -> Any:
        """Return the vector from one point of a link to another, in its frame."""
        return self.constants.points[Spot(link, end)] - self.constants.points[Spot(link, start)]

    def place(self, link: str, unit: Any, point: str, where: Any) -> None:
        """Set the pose of a link by its direction and one of its points."""
        self.unchanged[link] = unit
        self.held[link] = where
        if self._changed is not None and self._changed[0].owner == link:
            if self._changed[0].quantity == 'turn':
                # To first order, like the differences that use it.
                unit = unit * (1 + self._change() * acb(0, 1))
            else:
                where = where + self._change()
        self.unit[link] = unit
        self.origin[link] = where - unit * self.constants.points[Spot(link, point)]

    def ride(self, slider: str, unit: Any, point: str, where: Any) -> None:
        """Set the pose of a block that a slide places."""
        slide = self.mechanism.sliders[slider]
        if self._changed is not None and self._changed[0].owner == slider:
            line = self.unit[slide.along] * self.constants.directions[slider]
            where = where + line * self._change()
        self.place(str(slide.block), unit, point, where)

    def _change(self) -> Any:
        assert self._changed is not None
        (_, quantity, power), amount = self._changed
        return acb_series([0] * power + [acb(0, amount) if quantity == 'y' else acb(amount)])

    def line(self, name: str, point: str) -> tuple[Any, Any, Any]:
        """
        Return the line of a slider on a placed link as a start, a direction and the block's unit.

        The start is that of the parallel line on which the given point of the block moves.
        """
        slide = self.mechanism.sliders[name]
        start = self.at(Spot(slide.along, slide.through))
        unit = self.unit[slide.along]
        direction = unit * self.constants.directions[name]
        if slide.block is None:
            return start, direction, None
        turned = unit * self.constants.twists[name]
        if point != slide.point:
            start += turned * self.vector(slide.block, slide.point, point)
        return start, direction, turned


def conjugate(series: Any) -> Any:
    """Return the complex conjugate at every time."""
    return acb_series([c.conjugate() for c in series.coeffs()])


def real(series: Any) -> Any:
    """Return the real part at every time."""
    return arb_series([c.real for c in series.coeffs()])


def imag(series: Any) -> Any:
    """Return the imaginary part at every time."""
    return arb_series([c.imag for c in series.coeffs()])


def root(square: Any) -> Any:
    """Return the positive root of the square of a dyad's reach."""
    if square[0] < 0:
        raise OpenError
    if not square[0] > 0:
        raise UndecidedError
    return square.sqrt()


def inverse(series: Any) -> Any:
    """Return the inverse of a determinant."""
    if series[0].contains(0):
        raise UndecidedError
    return series.inv()


def turning(series: Any) -> Any:
    """Return the angle of a unit vector in time."""
    # The branch cut of the logarithm is turned away from the direction.
    if series[0].real < 0:
        logarithm = (-series).log()
        return imag(logarithm) + arb.pi()
    return imag(series.log())


Array = npt.NDArray[Any]


def times(series: Array, change: Array) -> Array:
    """Return the product of two power series."""
    product: Array = series[0] * change
    product[1:] += series[1] * change[:-1]
    product[2] += series[2] * change[0]
    return product


def passed_results(mechanism: Mechanism) -> tuple[PassedResult, ...]:
    """Return the results that dyads pass to later ones: pins, then angles and slides."""
    if len(mechanism.dyads) < 2:
        return ()
    links = [link for link in mechanism.links if link not in {GROUND, CRANK}]
    spots = {spot for dyad in mechanism.dyads[1:] for spot in dyad.given(mechanism)}
    pins: list[str | Spot] = [*links, *sorted(spot for spot in spots if spot.link != GROUND)]
    names: list[tuple[str | Spot, str]] = [(pin, part) for pin in pins for part in 'xy']
    for dyad in mechanism.dyads:
        names += [(link, 'turn') for link in dyad.turned]
        names += [(slider, 'slide') for slider in dyad.slid if mechanism.sliders[slider].block]
    return tuple(PassedResult(*name, power) for name in names for power in range(ORDER))


def turn_values(unit: Array) -> Array:
    """Return 0, the rate and half the acceleration of an angle θ, from the series of e^iθ."""
    back = unit[0].conj()
    return np.array([np.zeros(len(back)), (unit[1] * back).imag, (unit[2] * back).imag])


def turn_sizes(unit: Array) -> Array:
    """Return the absolute values of `turn_values`, and π first: an angle counts as at least π."""
    sizes = np.abs(turn_values(unit))
    sizes[0] = pi
    return sizes


class Tangent:
    """
    The derivatives of a motion by the relative change of each nonzero number, and of φ, ω and α.

    Parameters
    ----------
    mechanism
        The mechanism whose numbers vary.
    constants
        Its numbers as balls.
    numbers
        Its numbers as doubles.
    values
        Series of links, slides and inverse determinants, [power of time, case].
    held
        Series of the pins that hold links, and of the points passed to dyads.
    phi, alpha
        Input angles and accelerations of the cases.
    opening
        For each case the angle that the first dyad uses, if it is a rounded sum.

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
        self._first_done = False
        columns = [key for key, value in numbers.items() if value]
        self._column = {key: i for i, key in enumerate(columns)}
        self._inputs = len(columns)
        self.handed = passed_results(mechanism)
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
        self.unchanged = dict(self.turn)
        self._origin = {GROUND: self._zeros(complex)}
        self.slide: dict[str, Array] = {}
        pivot = next(iter(mechanism.links[CRANK]))
        self.place(CRANK, self.turn[CRANK], pivot, self.at(Spot(GROUND, pivot)))
        for dyad in mechanism.dyads:
            dyad.vary(self)
            self._first_done = True

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
        """Return the vector from one point of a link to another, and its change."""
        points = self._constants.points
        value = complex(points[Spot(link, end)] - points[Spot(link, start)])
        return value, self._vectors[link, end] - self._vectors[link, start]

    def at(self, spot: Spot) -> Array:
        """Return the change of the position of a point."""
        change = self._origin[spot.link] + self._arm(spot)
        if self._first_done:
            self._round_pin(spot, change)
        return change

    def _round_pin(self, owner: str | Spot, change: Array) -> None:
        if (owner, 'x', 0) in self._handed:
            for power, place in enumerate(self._held[owner]):
                change[power, :, self._handed[PassedResult(owner, 'x', power)]] += place.real
                change[power, :, self._handed[PassedResult(owner, 'y', power)]] += 1j * place.imag

    def _arm(self, spot: Spot) -> Array:
        unit = self.unit[spot.link]
        arm = unit * self._vectors[spot.link, spot.point]
        z = complex(self._constants.points[spot])
        if z and spot.link != GROUND:
            arm += 1j * times(unit * z, self.turn[spot.link])
        return arm

    def place(self, link: str, turn: Array, point: str, where: Array) -> None:
        """Set the change of a link's angle, and of the position of one of its points."""
        self.unchanged[link] = turn
        if (link, 'turn', 0) in self._handed:
            turn = turn.copy()
            sizes = turn_sizes(self.unit[link][..., 0]) + np.abs(turn).sum(axis=2)
            for power, size in enumerate(sizes):
                turn[power, :, self._handed[PassedResult(link, 'turn', power)]] += size
        where = where.copy()
        self._round_pin(link, where)
        self.turn[link] = turn
        self._origin[link] = where - self._arm(Spot(link, point))

    def ride(self, slider: str, pin: str, turn: Array, where: Array) -> None:
        """Set the change of a block that a slide places."""
        slide = self.mechanism.sliders[slider]
        if (slider, 'slide', 0) in self._handed:
            moved = self._zeros(float)
            sizes = np.abs(self.slide[slider]).sum(axis=2)
            sizes += np.abs(self.slide_value[slider][..., 0])
            for power, size in enumerate(sizes):
                moved[power, :, self._handed[PassedResult(slider, 'slide', power)]] = size
            where = where + times(self.unit[slide.along] * self.direction[slider], moved)
        self.place(str(slide.block), turn, pin, where)

    def line(self, name: str, point: str) -> tuple[Array, Array, Array, Array | None]:
        """Return a line's direction, the changes of direction and start, and the block's turn."""
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
