# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Measuring range: readings end at its limits, and nothing else changes."""

from hypothesis import given, strategies as st
from linkage_ros.stages.effects import JointRange, MeasuringRangeEffect

from .sensors import BEGIN, context, published, reading


def limited(**limits):
    joints = {'rocker_joint': JointRange(**limits)}
    return MeasuringRangeEffect(joints).sensor(context())


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
def test_measuring_range_clips_readings(value, rate, effort):
    sensor = limited(low=-1.0, high=2.0, rate=3.0, effort=0.5)
    given_reading = reading(BEGIN, value, value, rates=(rate, rate), efforts=(effort, effort))
    found = sensor(BEGIN, given_reading)
    # The middle of three numbers in order.
    assert found.joints == (value, sorted([-1.0, value, 2.0])[1])
    assert found.rates == (rate, sorted([-3.0, rate, 3.0])[1])
    assert found.efforts == (effort, sorted([-0.5, effort, 0.5])[1])
    assert found.stamp == BEGIN


def test_measuring_range_clips_biased_readings():
    effects = (
        'bias: {joints: {rocker_joint: 5}}, measuring_range: {joints: {rocker_joint: {high: 2}}}'
    )
    assert {read.joints[1] for read in published(effects)} == {2.0}
