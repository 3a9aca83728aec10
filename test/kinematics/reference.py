# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The truth that the kinematics are measured against, to as many digits as a test asks for.

It is the campaign's: a dyad in power series of balls (`campaigns.accuracy.reference`), which
`test/tools/study/test_enclosure.py` compares with the constraints in all families.

An error is stated in units of u·κ, with u = 2⁻⁵³ and κ = Σ|xᵢ ∂y/∂xᵢ| + |y| over the lengths and
the crank's direction within (-π, π]: what rounding inputs and result once may cause by itself.
"""

from dataclasses import dataclass
from math import inf, pi
from typing import Any, NamedTuple

from campaigns.accuracy import adversarial
from campaigns.accuracy.mechanism import Mechanism
from campaigns.accuracy.reference import condition_numbers, Outcome, Reference
from linkage_ros.kinematics import SlideJoint, Status
from mpmath import mp, mpf

UNIT_ROUNDOFF = 2.0**-53
DIGITS = 50


class Quantity(NamedTuple):
    """A correct value and its condition number κ; infinite where the value has no derivative."""

    value: Any
    condition: float

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
    A four-bar at one crank direction; angles from the ground O→D, the crank turns at 1 rad/s.

    ``gap`` is what coupler and rocker miss each other by (0: they meet). The rest is None where
    they miss; at a toggle κ is infinite, and there are no rates.
    """

    gap: mpf
    coupler: Quantity | None = None
    rocker: Quantity | None = None
    coupler_rate: Quantity | None = None
    rocker_rate: Quantity | None = None
    coupler_acceleration: Quantity | None = None
    rocker_acceleration: Quantity | None = None


@dataclass(frozen=True, slots=True)
class SliderCrank:
    """An inverted slider-crank, as `FourBar`."""

    gap: mpf
    rod: Quantity | None = None
    slide: Quantity | None = None
    rod_rate: Quantity | None = None
    slide_rate: Quantity | None = None
    rod_acceleration: Quantity | None = None
    slide_acceleration: Quantity | None = None


def four_bar(
    a: float, b: float, c: float, d: float, phi: float, side: int, digits: int = DIGITS
) -> FourBar:
    """Solve crank a, coupler b, rocker c on ground d; B lies left of A→D if the side is +1."""
    return FourBar(*_solve(adversarial.four_bar((a, b, c, d), side), phi, digits))


def inverted_slider_crank(
    a: float, d: float, offset: float, phi: float, side: int, digits: int = DIGITS
) -> SliderCrank:
    """
    Solve crank a, swivel D at d, and a rod whose line passes the crank pin A at an offset.

    The offset is positive where the line passes left of A. If the side is +1, D lies ahead of A
    along the rod, if -1, behind.
    """
    mechanism = adversarial.inverted_slider_crank((a, d, offset), side)
    return SliderCrank(*_solve(mechanism, phi, digits))


def _solve(mechanism: Mechanism, phi: float, digits: int) -> list[Any]:
    """Return the gap and, where the dyad closes, both joints, their rates and accelerations."""
    reference = Reference(mechanism)
    truth = reference.solve(phi, 0.0, 4 * digits)
    with mp.workdps(digits):
        unit = mpf(2) ** truth.motion.exponent

        def number(ball: Any) -> mpf:
            return mpf(ball.mid().str(digits, radius=False))

        if truth.outcome is Outcome.OPEN:
            (dyad,) = mechanism.dyads
            return [-number(dyad.margin(truth.motion).orders()[0]) * unit]
        if truth.outcome is Outcome.SINGULAR:
            return [mpf(0), Quantity(mpf(0), inf), Quantity(mpf(0), inf)]
        slides = [isinstance(joint, SlideJoint) for joint in mechanism.joints.values()]
        values = [
            number(series[order]) * (1, 1, 2)[order] * (unit if sliding else 1)
            for order in range(3)
            for series, sliding in zip(truth.joints, slides, strict=True)
        ]
        values[:2] = [v if slides[k] else turned(v) for k, v in enumerate(values[:2])]
        kappa = condition_numbers(truth).T.flatten().tolist()
        # There an angle counts as π, and the crank's rate ω is an input: y' ~ ω, y'' ~ ω².
        beside = [*(0.0 if slides[k] else pi - abs(values[k]) for k in range(2))]
        beside += [abs(value) for value in values[2:4]] + [2 * abs(value) for value in values[4:]]
        return [mpf(0)] + [
            Quantity(value, k * (unit if sliding else 1) - more)
            for value, k, more, sliding in zip(values, kappa, beside, 3 * slides, strict=True)
        ]


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
