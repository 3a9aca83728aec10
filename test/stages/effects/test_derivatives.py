# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Velocity and acceleration: slopes of positions and rates, and neither at a toggle."""

from dataclasses import replace
from math import inf, isfinite, nan, remainder, tau

from hypothesis import given, strategies as st
from linkage_ros.stages.drives import Context, CrankState
from linkage_ros.stages.effects import (
    AccelerationEffect,
    MechanismState,
    SensorReading,
    VelocityEffect,
)
import pytest

from .sensors import ANGLES, SLIDE
from ...support.messages import STORE
from ...support.scenes import closure_of

EVERY_OTHER = closure_of('four_bar: {a: 1, b: 1, c: 1, d: 2}')
angles, rates = st.floats(-10.0, 10.0), st.floats(-10.0, 10.0)
loops = pytest.mark.parametrize('loop', [ANGLES, SLIDE], ids=['four-bar', 'slider-crank'])


def moved(loop, angle, rate, alpha=0.0):
    """Return the motion that leaves velocity and acceleration."""
    crank = CrankState((angle,), (rate,), (alpha,), 0)
    context = Context(loop, 1000.0, True, 'seed', None, None)
    motion = MechanismState(crank, loop.position(angle), None, None, (), (), ())
    for effect in (VelocityEffect(), AccelerationEffect()):
        motion = effect.stage(context)(motion)
    return motion


@given(angles, rates, rates)
@loops
def test_velocity_and_acceleration_equal_numerical_derivatives(loop, angle, rate, alpha):
    # The crank's own motion: θ(t) = angle + rate·t + alpha·t²/2.
    step = 1e-5
    before, after = (
        moved(loop, angle + rate * t + alpha * t * t / 2.0, rate + alpha * t)
        for t in (-step, step)
    )
    found = moved(loop, angle, rate, alpha)
    ends = zip(*(loop.position(angle + t).joints for t in (step, -step)), strict=True)
    slopes = [remainder(a - b, tau) / (2.0 * step) * rate for a, b in ends]
    assert list(found.velocity.joints) == pytest.approx(slopes, abs=1e-6 * abs(rate))
    ends = zip(after.velocity.joints, before.velocity.joints, strict=True)
    slopes = [(a - b) / (2.0 * step) for a, b in ends]
    size = rate * rate + abs(alpha) + 1.0
    assert list(found.acceleration.joints) == pytest.approx(slopes, abs=1e-6 * size)


@given(angles)
def test_resting_crank_has_resting_joints(angle):
    found = moved(ANGLES, angle, 0.0)
    assert not any((*found.velocity.joints, *found.acceleration.joints))


@given(angles, rates)
def test_constant_crank_rate_still_gives_joint_accelerations(angle, rate):
    # What the topic drive gives: the unknown acceleration of the crank is 0, not the joints'.
    one, two = (moved(SLIDE, angle, r).acceleration.joints for r in (rate, 2.0 * rate))
    assert list(two) == pytest.approx([4.0 * value for value in one], rel=1e-12, abs=1e-300)


@given(st.floats(-17.0, -1.0))
def test_derivatives_near_a_toggle_are_finite_or_missing(exponent):
    angle = EVERY_OTHER.input_ranges[0].highest - 10.0**exponent
    if EVERY_OTHER.position(angle).joints:
        found = moved(EVERY_OTHER, angle, 1e10, 1e10)
        for each in (found.velocity, found.acceleration):
            assert each is None or all(map(isfinite, each.joints))


@pytest.mark.parametrize('value', [inf, -inf, nan])
def test_overflowing_acceleration_is_omitted(value):
    class Overflowing:
        def acceleration(self, *_):
            found = ANGLES.acceleration(POSITION, VELOCITY, 0.0)
            return replace(found, joints=(1.0, value))

    context = Context(Overflowing(), 1000.0, True, 'seed', None, None)
    stage = AccelerationEffect().stage(context)
    motion = MechanismState(CRANK, POSITION, VELOCITY, None, (), (), ())
    assert stage(motion) == motion


def test_acceleration_message_holds_one_trajectory_point():
    motion = moved(ANGLES, 1.0, 2.0)
    rates, accelerations = motion.velocity.joints, motion.acceleration.joints
    # Turns added, and whatever else sensors do: what is written is what is read.
    reading = SensorReading(3_000_000_004, (7.0, 8.0), rates, accelerations, ())
    context = Context(ANGLES, 1000.0, True, 'seed', None, None, prefix='left_')
    data = AccelerationEffect().writer(context)(9, motion, reading)
    message = STORE.deserialize_cdr(data, 'trajectory_msgs/msg/JointTrajectory')
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (3, 4)
    assert message.joint_names == ['left_coupler_joint', 'left_rocker_joint']
    (point,) = message.points
    assert list(point.positions) == [7.0, 8.0]
    assert tuple(point.velocities) == rates
    assert tuple(point.accelerations) == accelerations
    assert len(point.effort) == 0
    assert (point.time_from_start.sec, point.time_from_start.nanosec) == (0, 0)


CRANK = CrankState((1.0,), (2.0,), (0.0,), 0)
POSITION = ANGLES.position(1.0)
VELOCITY = ANGLES.velocity(POSITION, 2.0)
