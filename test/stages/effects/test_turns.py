# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Angles that run on beyond a turn, and angles wrapped to (−π, π]."""

from fractions import Fraction
from math import nextafter, pi, tau

from hypothesis import given, strategies as st
from linkage_ros.kinematics import wrap_angle
from linkage_ros.stages.effects import Continuous, SensorReading, wrap_all
import pytest

EXACT_TAU = Fraction('6.28318530717958647692528676655900576839433879875021')
steps = st.floats(-3.0, 3.0)


def reading(*joints):
    return SensorReading(7, joints, (), (), ())


@given(st.lists(steps, min_size=1, max_size=60), st.floats(-pi, pi))
def test_continuous_angle_follows_the_turns(moves, start):
    # What the loop knows of an angle is the angle up to turns.
    stage = Continuous([True])
    angle = wrap_angle(start)
    assert stage(0, reading(angle)).joints == (angle,)
    for move in moves:
        angle += move
        assert stage(0, reading(wrap_angle(angle))).joints[0] == pytest.approx(angle, abs=1e-12)


@given(st.floats(-1e6, 1e6))
def test_continuous_angle_starts_wrapped(angle):
    (first,) = Continuous([True])(0, reading(angle)).joints
    assert -pi < first <= pi
    assert first == wrap_angle(angle)


@given(st.lists(st.floats(-100.0, 100.0), min_size=1, max_size=20))
def test_continuous_angle_steps_at_most_half_a_turn(angles):
    stage = Continuous([True])
    last = None
    for angle in angles:
        (now,) = stage(0, reading(angle)).joints
        assert abs((now - angle) / tau - round((now - angle) / tau)) < 1e-12
        assert last is None or abs(now - last) <= pi + 1e-12
        last = now


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=20))
def test_turn_handling_leaves_slides_unchanged(lengths):
    for stage in (Continuous([False, True]), wrap_all([False, True])):
        for length in lengths:
            assert stage(0, reading(length, length)).joints[0] == length


@given(st.floats(-1e9, 1e9))
def test_wrapped_angle_is_exact(angle):
    rest = wrap_angle(angle)
    assert -pi < rest <= pi
    turns = round((Fraction(angle) - Fraction(rest)) / Fraction(tau))
    assert Fraction(angle) - turns * Fraction(tau) == Fraction(rest) or rest == pi


@pytest.mark.parametrize(
    ('angle', 'rest'),
    [
        (0.0, 0.0),
        (pi, pi),
        (-pi, pi),
        (nextafter(pi, 4), nextafter(-pi, 0)),
        (nextafter(-pi, -4), nextafter(pi, 0)),
        (tau, 0.0),
        (3 * pi, pi),
        (-3 * pi, pi),
        (4.0, 4.0 - tau),
    ],
)
def test_wrapped_angle_is_right_at_pi(angle, rest):
    assert wrap_angle(angle) == pytest.approx(rest, abs=1e-15)
    assert -pi < wrap_angle(angle) <= pi
    (now,) = wrap_all([True])(0, reading(angle)).joints
    assert now == wrap_angle(angle)


def test_continuous_angle_does_not_drift_over_many_turns():
    stage = Continuous([True])
    for step in range(100_001):
        (now,) = stage(0, reading(wrap_angle(step * 1.0))).joints
    # The last is exact up to the rounding of tau, 2.4e-16, for each of 15915 turns.
    assert abs(now - 100_000.0) < 1e-11


def test_turn_handling_passes_other_fields_unchanged():
    rest = (1.0, 2.0), (3.0, 4.0), (5.0, 0.0)
    for stage in (Continuous([True, False]), wrap_all([True, False])):
        assert stage(9, SensorReading(7, (0.5, 0.5), *rest)) == (7, (0.5, 0.5), *rest)
