# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The campaign's reference agrees with others that share nothing with it.

`test/study/test_enclosure.py` compares every family with the balls of the constraints.
"""

from __future__ import annotations

from math import pi
from typing import Any

from campaigns.accuracy.adversarial import ADVERSARIAL, four_bar, inverted_slider_crank
from campaigns.accuracy.random_families import RANDOM
from campaigns.accuracy.reference import (
    condition_numbers,
    exact_condition_numbers,
    Outcome,
    Reference,
    Truth,
)
from campaigns.accuracy.run import make
from mpmath import mp, mpf
import pytest

from ..kinematics import reference as elsewhere
from ..kinematics.samples import (
    FOUR_BARS,
    four_bars,
    inverted_slider_cranks,
    SLIDER_CRANKS,
)


def as_mpf(ball: Any) -> mpf:
    """Return the middle of a ball."""
    with mp.workdps(80):
        return mpf(ball.mid().str(80, radius=False))


def coefficient(truth: Truth, joint: int, power: int) -> mpf:
    """Return a joint's value or a derivative of it, lengths in [m]."""
    is_slide = isinstance(list(truth.motion.mechanism.joints.values())[joint], str)
    with mp.workdps(80):
        scale = mpf(2) ** truth.motion.constants.exponent if is_slide else 1
        return as_mpf(truth.joints[joint][power]) * (2 if power == 2 else 1) * scale


def same_angle(one: mpf, other: mpf, within: float) -> bool:
    with mp.workdps(80):
        return abs(elsewhere.turned(one - other)) < within


@pytest.mark.parametrize('family', FOUR_BARS)
def test_four_bars_are_as_by_mpmath_to_40_digits(family: str) -> None:
    for a, b, c, d, phi, side in four_bars(family, 100):
        expected = elsewhere.four_bar(a, b, c, d, phi, side, digits=90)
        truth = Reference(four_bar((a, b, c, d), side)).solve(phi, 0.0)
        assert (truth.outcome is Outcome.OPEN) == (expected.gap > 0)
        if truth.outcome is not Outcome.CLOSED:
            continue
        links = [expected.coupler, expected.rocker]
        rates = [expected.coupler_rate, expected.rocker_rate]
        for joint in range(2):
            assert same_angle(coefficient(truth, joint, 0), links[joint].value, 1e-40)
            off = abs(coefficient(truth, joint, 1) - rates[joint].value)
            assert off <= 1e-40 * rates[joint].condition


@pytest.mark.parametrize('family', SLIDER_CRANKS)
def test_inverted_slider_cranks_are_as_by_mpmath_to_40_digits(family: str) -> None:
    for a, d, offset, phi, side in inverted_slider_cranks(family, 100):
        expected = elsewhere.inverted_slider_crank(a, d, offset, phi, side, digits=90)
        truth = Reference(inverted_slider_crank((a, d, offset), side)).solve(phi, 0.0)
        assert (truth.outcome is Outcome.OPEN) == (expected.gap > 0)
        if truth.outcome is not Outcome.CLOSED:
            continue
        assert same_angle(coefficient(truth, 0, 0), expected.rod.value, 1e-40)
        slide = expected.slide
        assert abs(coefficient(truth, 1, 0) - slide.value) <= 1e-40 * slide.condition
        for joint, rate in enumerate((expected.rod_rate, expected.slide_rate)):
            assert abs(coefficient(truth, joint, 1) - rate.value) <= 1e-40 * rate.condition


def test_condition_numbers_are_those_of_the_older_reference() -> None:
    for a, b, c, d, phi, side in four_bars('fold and stretch', 100):
        expected = elsewhere.four_bar(a, b, c, d, phi, side)
        reference = Reference(four_bar((a, b, c, d), side))
        truth = reference.solve(phi, 0.0)
        if truth.outcome is not Outcome.CLOSED:
            continue
        kappa = condition_numbers(reference, [truth], [phi], [0.0])[0]
        for joint, (link, rate) in enumerate(
            (
                (expected.coupler, expected.coupler_rate),
                (expected.rocker, expected.rocker_rate),
            )
        ):
            # Here an angle counts as π at least, and the crank's rate is an input.
            position = float(link.condition - abs(link.value)) + pi
            assert kappa[joint, 0] == pytest.approx(position, rel=1e-9)
            velocity = float(rate.condition + abs(rate.value))
            assert kappa[joint, 1] == pytest.approx(velocity, rel=1e-9)


ALL = [*RANDOM, *(name for name in ADVERSARIAL if name != 'lengths × 1e±150')]


@pytest.mark.parametrize('family', ALL)
def test_condition_numbers_in_doubles_are_right_where_differences_can_tell(family: str) -> None:
    for index in range(4):
        mechanism, phi, alpha = make(0, family, index)
        reference = Reference(mechanism)
        for case in range(0, len(phi), max(1, len(phi) // 2)):
            truth = reference.solve(phi[case], alpha[case])
            if truth.outcome is not Outcome.CLOSED:
                continue
            exact = exact_condition_numbers(reference, phi[case], alpha[case], independent=True)
            arguments = [truth], [phi[case]], [alpha[case]]
            assert exact is not None
            assert condition_numbers(reference, *arguments)[0] == pytest.approx(
                exact, rel=1e-3, abs=1e-15
            )
