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
A linkage at one input angle as power series in time, in balls of any precision (FLINT's Arb).

Nothing is differentiated by hand: the crank's direction is the series of e^iφ(t) with
φ(t) = φ + t + α·t²/2, every dyad is a closed form in such series, and velocity and acceleration
are read from their second and third coefficients. A ball encloses its exact value, so that the
number of correct digits is proved with each result.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import frexp
from typing import Any, NamedTuple

from campaigns.accuracy.mechanism import CRANK, GROUND, Key, Mechanism, Spot
from flint import acb, acb_series, arb, arb_series, ctx

ORDER = 3
ctx.cap = ORDER


class OpenError(Exception):
    """A dyad does not reach."""


class UndecidedError(Exception):
    """At the working precision a dyad is open as well as closed, or its links are in line."""


class Handed(NamedTuple):
    """
    A number that one dyad hands on to the next ones: a coefficient of a power series in time.

    Attributes
    ----------
    owner
        A link, a slider, or a point of a link.
    what
        ``turn``, the link's angle; ``x`` or ``y``, of the pin by which it is held, or of the point
        itself; ``slide``.
    power
        Of time: 0, 1 or 2, for the position, the rate and half the acceleration.

    """

    owner: str | Spot
    what: str
    power: int


class Constants:
    """The numbers of a mechanism as balls; lengths by a power of 2 nearest to the greatest one."""

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
    Where the links are and how they move; each dyad adds its own.

    Attributes
    ----------
    unit
        For each link the series of e^iθ, θ its angle against the ground.
    origin
        For each link the series of its frame's origin.
    slide
        For each slider the series of its point's distance from the start of the line.
    inverse
        For each dyad the inverse of the determinant that its linear equations have.
    shown
        As ``unit``, before what is handed on is changed.
    held
        For each link the series of where the pin is by which it is held.

    Parameters
    ----------
    mechanism, constants
        What moves.
    pivot
        Name of the crank's pin on the ground.
    changed
        What is handed on with a change, by how much; for condition numbers.

    """

    def __init__(
        self,
        mechanism: Mechanism,
        constants: Constants,
        pivot: str,
        changed: tuple[Handed, Any] | None = None,
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
        self.shown = dict(self.unit)
        self.held: dict[str, Any] = {}
        self.slide: dict[str, Any] = {}
        self.inverse: list[Any] = []
        self.phi = phi
        self._behind = False
        for dyad in self.mechanism.dyads:
            dyad.close(self)
            self._behind = True

    def at(self, spot: Spot) -> Any:
        """Return where a point of a placed link is."""
        z = self.constants.points[spot]
        if spot.link == GROUND:
            return acb_series([z])
        place = self.origin[spot.link] + self.unit[spot.link] * z
        if self._behind and self._changed is not None and self._changed[0].owner == spot:
            place += self._change()
        return place

    def vector(self, link: str, start: str, end: str) -> Any:
        """Return what leads from one point of a link to another, in its frame."""
        return self.constants.points[Spot(link, end)] - self.constants.points[Spot(link, start)]

    def place(self, link: str, unit: Any, point: str, where: Any) -> None:
        """Note where a link is, by its direction and one of its points."""
        self.shown[link] = unit
        self.held[link] = where
        if self._changed is not None and self._changed[0].owner == link:
            if self._changed[0].what == 'turn':
                # To first order, as the differences are that this is for.
                unit = unit * (1 + self._change() * acb(0, 1))
            else:
                where = where + self._change()
        self.unit[link] = unit
        self.origin[link] = where - unit * self.constants.points[Spot(link, point)]

    def ride(self, slider: str, unit: Any, point: str, where: Any) -> None:
        """Note where a block is that a slide places."""
        slide = self.mechanism.sliders[slider]
        if self._changed is not None and self._changed[0].owner == slider:
            line = self.unit[slide.along] * self.constants.directions[slider]
            where = where + line * self._change()
        self.place(str(slide.block), unit, point, where)

    def _change(self) -> Any:
        assert self._changed is not None
        (_, what, power), amount = self._changed
        return acb_series([0] * power + [acb(0, amount) if what == 'y' else acb(amount)])

    def line(self, name: str, point: str) -> tuple[Any, Any, Any]:
        """
        Return the line of a slider on a placed link as a start, a direction and the block's unit.

        The start is that of the line's parallel through a point of the block.
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
    """Return the positive root of what a dyad's reach is squared."""
    if square[0] < 0:
        raise OpenError
    if not square[0] > 0:
        raise UndecidedError
    return square.sqrt()


def inverse(series: Any) -> Any:
    """Return 1 by a determinant."""
    if series[0].contains(0):
        raise UndecidedError
    return series.inv()


def turning(series: Any) -> Any:
    """Return the angle of a unit vector in time."""
    # The cut of the logarithm is turned to where the direction is not.
    if series[0].real < 0:
        logarithm = (-series).log()
        return imag(logarithm) + arb.pi()
    return imag(series.log())
