# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The truth that the kinematics are measured against, to as many digits as a test asks for.

Nothing here is taken from the package. A loop is solved in coordinates, by intersecting circles
(or a circle with a line), and differentiated implicitly: with the unit complex numbers of its
links, the derivative of its closing equation is linear in what is sought, for every input and for
the crank's rate alike. Coordinates cancel near a change point; digits are cheap, so they may.

An error is stated in units of u·κ, with u = 2⁻⁵³ and κ = Σ|xᵢ ∂y/∂xᵢ| + |y| over the lengths and
the crank's direction within (-π, π]: what rounding inputs and result once may cause by itself.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

from linkage_ros.kinematics import Status
from mpmath import mp, mpc, mpf

# The reference of the kinematics tests, with any number of digits.
#
# Nothing here is taken from the package. A loop is solved in coordinates, by intersecting
# circles (or a circle with a line), and differentiated implicitly: with the unit complex numbers
# of its links, the derivative of its closing equation is linear in the unknowns, for every
# input and for the crank's rate alike. Coordinates cancel near a change point; this is harmless,
# since the number of digits is free.
#
# An error is given in units of u·κ, with u = 2⁻⁵³ and κ = Σ|xᵢ ∂y/∂xᵢ| + |y| over the lengths
# and the crank's direction within (-π, π]: the error that rounding inputs and result once may
# cause by itself.


UNIT_ROUNDOFF = 2.0**-53
DIGITS = 50


class Quantity(NamedTuple):
    """A correct value and its condition number κ; infinite where the value has no derivative."""

    value: mpf
    condition: mpf

    def error_of(self, computed: float) -> float:
        """Return the error of a length or rate in units of u·κ."""
        return self._in_units(abs(mpf(computed) - self.value))

    def angle_error_of(self, computed: float) -> float:
        """Return the error of an angle, modulo 2π, in units of u·κ."""
        return self._in_units(abs(turned(mpf(computed) - self.value)))

    def half_turn_error_of(self, computed: float) -> float:
        """Return the error of an angle in units of u·κ; the angle counts as π at least."""
        floor = max(mp.pi - abs(self.value), 0)
        return Quantity(self.value, self.condition + floor).angle_error_of(computed)

    def _in_units(self, error: mpf) -> float:
        # An exact result is exact whatever κ is, also where κ is 0 because all is.
        return float(error / (UNIT_ROUNDOFF * self.condition)) if error else 0.0


def turned(angle: mpf) -> mpf:
    """Return an angle less the nearest multiple of 2π."""
    return angle - 2 * mp.pi * mp.nint(angle / (2 * mp.pi))


@dataclass(frozen=True, slots=True)
class FourBar:
    """
    A four-bar at one crank direction; angles from the ground O→D.

    ``gap`` is what coupler and rocker miss each other by (0: they meet), ``cross`` AB × DB; the
    rest is None where they miss, and rates are None where cross is 0.
    """

    gap: mpf
    cross: mpf
    coupler: Quantity | None = None
    rocker: Quantity | None = None
    coupler_rate: Quantity | None = None
    rocker_rate: Quantity | None = None


def four_bar(a: Any, b: Any, c: Any, d: Any, phi: Any, side: int, digits: int = DIGITS) -> FourBar:
    """
    Solve crank a, coupler b, rocker c on ground d by intersecting the circles about A and D.

    The crank is at φ in [rad]; B lies left of A→D if the side is +1. It works with so many digits.
    """
    with mp.workdps(digits):
        a, b, c, d, phi = map(mpf, (a, b, c, d, phi))
        crank_unit = mp.expj(phi)
        diagonal = d - a * crank_unit
        s = abs(diagonal)
        gap = max(abs(b - c) - s, s - (b + c))
        if gap > 0:
            return FourBar(gap, mpf(0))
        foot = (s * s + b * b - c * c) / (2 * s)
        height = mp.sqrt((b + c - s) * (b + c + s) * (s - abs(b - c)) * (s + abs(b - c))) / (2 * s)
        coupler = diagonal / s * mpc(foot, side * height)
        rocker = coupler - diagonal
        cross = _cross(coupler, rocker)
        if cross == 0:
            poses = [Quantity(mp.arg(link), mp.inf) for link in (coupler, rocker)]
            return FourBar(mpf(0), cross, *poses)
        # a·e^iφ + b·e^iθ3 − c·e^iθ4 − d = 0, of which one partial derivative after the other:
        coupler_unit, rocker_unit = coupler / b, rocker / c
        inputs = (turned(phi), a, b, c, d)
        partials = (1j * a * crank_unit, crank_unit, coupler_unit, -rocker_unit, mpc(-1))
        slopes = [_two_links(coupler, rocker, 1j * partial) for partial in partials]
        rates = slopes[0]
        # b·e^iθ3·θ3' − c·e^iθ4·θ4' = −a·e^iφ, and that by each input again:
        crank_slopes = (1j * a * crank_unit, crank_unit, 0, 0, 0)
        rate_slopes = []
        for i, (slope3, slope4) in enumerate(slopes):
            coupler_slope = 1j * coupler * slope3 + (coupler_unit if i == 2 else 0)
            rocker_slope = 1j * rocker * slope4 + (rocker_unit if i == 3 else 0)
            rest = -crank_slopes[i] - coupler_slope * rates[0] + rocker_slope * rates[1]
            rate_slopes.append(_two_links(coupler, rocker, rest))
        return FourBar(
            mpf(0),
            cross,
            _quantity(mp.arg(coupler), inputs, [slope[0] for slope in slopes]),
            _quantity(mp.arg(rocker), inputs, [slope[1] for slope in slopes]),
            _quantity(rates[0], inputs, [slope[0] for slope in rate_slopes]),
            _quantity(rates[1], inputs, [slope[1] for slope in rate_slopes]),
        )


@dataclass(frozen=True, slots=True)
class SliderCrank:
    """An inverted slider-crank at one crank direction; None where there is a gap."""

    gap: mpf
    rod: Quantity | None = None
    slide: Quantity | None = None
    rod_rate: Quantity | None = None
    slide_rate: Quantity | None = None


def inverted_slider_crank(
    a: Any, d: Any, offset: Any, phi: Any, side: int, digits: int = DIGITS
) -> SliderCrank:
    """
    Solve crank a, swivel D at d, and a rod whose line passes the crank pin A at an offset.

    Parameters
    ----------
    a, d, offset
        Lengths; offset is positive where the line passes left of A.
    phi
        Direction of the crank, in [rad].
    side
        +1: D lies ahead of A along the rod, -1: behind.
    digits
        To work with.

    """
    with mp.workdps(digits):
        a, d, h, phi = map(mpf, (a, d, offset, phi))
        crank_unit = mp.expj(phi)
        diagonal = d - a * crank_unit
        square = (diagonal * diagonal.conjugate()).real - h * h
        if square < 0:
            return SliderCrank(abs(h) - abs(diagonal))
        r = side * mp.sqrt(square)
        if r == 0:
            # A straight rod on its swivel has no direction; a bent one stands across it.
            rod = Quantity(mp.arg(diagonal / mpc(0, h)), mp.inf) if h else None
            return SliderCrank(mpf(0), rod, Quantity(r, mp.inf))
        # a·e^iφ + (r + ih)·e^iψ − d = 0
        unit = diagonal / mpc(r, h)
        inputs = (turned(phi), a, d, h)
        partials = (1j * a * crank_unit, crank_unit, mpc(-1), 1j * unit)
        slopes = [_rod(unit, r, h, -partial) for partial in partials]
        rates = slopes[0]
        # i(r + ih)·e^iψ·ψ' + e^iψ·r' = −i·a·e^iφ, and that by each input again:
        crank_slopes = (-a * crank_unit, 1j * crank_unit, 0, 0)
        rate_slopes = []
        for i, (rod_slope, slide_slope) in enumerate(slopes):
            unit_slope = 1j * unit * rod_slope
            arm_slope = mpc(slide_slope, i == 3) * unit + mpc(r, h) * unit_slope
            rest = -crank_slopes[i] - 1j * arm_slope * rates[0] - unit_slope * rates[1]
            rate_slopes.append(_rod(unit, r, h, rest))
        return SliderCrank(
            mpf(0),
            _quantity(mp.arg(unit), inputs, [slope[0] for slope in slopes]),
            _quantity(r, inputs, [slope[1] for slope in slopes]),
            _quantity(rates[0], inputs, [slope[0] for slope in rate_slopes]),
            _quantity(rates[1], inputs, [slope[1] for slope in rate_slopes]),
        )


def _cross(one: mpc, other: mpc) -> mpf:
    return one.real * other.imag - one.imag * other.real


def _two_links(coupler: mpc, rocker: mpc, right: mpc) -> tuple[mpf, mpf]:
    """Solve coupler·x − rocker·y = right for real x and y."""
    area = _cross(coupler, rocker)
    return _cross(right, rocker) / area, _cross(right, coupler) / area


def _rod(unit: mpc, r: mpf, h: mpf, right: mpc) -> tuple[mpf, mpf]:
    """Solve i(r + ih)·unit·x + unit·y = right for real x and y."""
    along = right * unit.conjugate()
    return along.imag / r, along.real + h * along.imag / r


def _quantity(value: mpf, inputs: tuple[mpf, ...], slopes: list[mpf]) -> Quantity:
    return Quantity(
        value, abs(value) + sum(abs(x * s) for x, s in zip(inputs, slopes, strict=True))
    )


# Limits of the error of a result, in units of u·κ (`reference`), and a record of the worst.
#
# Beside each limit stands the value measured over 220,000 random loops of other seeds.


ANGLE = 4.0
"""Limit for angles; 2.6 was measured. κ counts an angle as at least π."""

LENGTH = 4.0
"""Limit for slides and for gaps, the latter in u times all lengths; 2.4 and 3.5 were measured."""

RATE = 4.0
"""Limit for rates; `docs/accuracy/campaign.md` has what millions of cases reach."""

TOGGLE = 32.0
"""
Limit for angles at a toggle.

What is within 16 u of a limit position is reported as lying there. With δ the distance, the angle
is off by √δ and κ is 1/(2·√δ), which makes 32 of it; 25 was measured.
"""


class Worst:
    """The worst errors of a sweep, each with the case that it was met in."""

    def __init__(self) -> None:
        self._met: dict[str, tuple[float, float, object]] = {}

    def note(self, quantity: str, error: float, limit: float, case: object) -> None:
        """Remember an error, where it is nearer to its limit than what was seen before."""
        ratio, _, _ = self._met.get(quantity, (-1.0, 0.0, None))
        # Written so that what is not a number counts as worst.
        if not error / limit <= ratio:
            self._met[quantity] = (error / limit, error, case)

    def note_status(
        self, status: Status, gap: float, true_gap: float, size: float, case: object
    ) -> None:
        """Check status and gap; a toggle is right where the true gap is rounding."""
        assert (status is not Status.OPEN) or true_gap > 0.0, f'no missed closure: {case}'
        assert (status is not Status.CLOSED) or true_gap <= 0.0, f'no false closure: {case}'
        error = abs(gap - max(true_gap, 0.0)) / (UNIT_ROUNDOFF * size)
        self.note('gap', error, LENGTH, case)

    def check(self) -> None:
        """Fail where an error was above its limit."""
        beyond = {k: v for k, v in self._met.items() if not v[0] <= 1.0}
        assert not beyond, '\n'.join(
            f'{quantity}: {error:.3g} u·κ at {case}'
            for quantity, (_, error, case) in beyond.items()
        )
