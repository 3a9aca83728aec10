# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A constant rate: the double nearest to θ₀ + ω·t, t from the first tick on, of each input."""

from math import ulp

from hypothesis import example, given, strategies as st
from linkage_ros.errors import DefinitionError
from linkage_ros.stages.drives import ConstantRate, ConstantRateDrive, CrankState
from mpmath import mp
import pytest

from .contexts import one_input, pipeline, readings, two_inputs

SECOND = 1_000_000_000
DAY = 86_400 * SECOND
BEGIN = 1_700_000_000_123_456_789


def exact(start, rate, time):
    """Return start + rate·t to 60 digits."""
    with mp.workdps(60):
        return mp.mpf(start) + mp.mpf(rate) * time / SECOND


@given(st.floats(-1e3, 1e3), st.floats(-1e4, 1e4), st.integers(0, 1000 * DAY))
@example(0.1, 0.3, 3 * SECOND)  # with the product rounded too: 0.9999999999999999
def test_constant_rate_angle_is_rounded_once(start, rate, time):
    angle, same_rate, acceleration = ConstantRate(rate, start).motion_curve()(time)
    assert abs(angle - exact(start, rate, time)) <= 0.500001 * mp.mpf(ulp(angle))
    assert (same_rate, acceleration) == (rate, 0.0)


def test_constant_rate_starts_at_the_first_tick():
    drive = ConstantRateDrive(rate=4.0, start=1.0).build(one_input())
    assert (drive.stamp, drive.max_age) == (0, 0)
    assert drive.state(BEGIN) == CrankState((1.0,), (4.0,), (0.0,), 0)
    assert drive.state(BEGIN + SECOND // 4) == CrankState((2.0,), (4.0,), (0.0,), 0)
    assert drive.state(BEGIN + SECOND // 4) == CrankState((2.0,), (4.0,), (0.0,), 0), 'once more'


def test_constant_rate_accepts_a_first_tick_at_zero():
    drive = ConstantRateDrive(rate=4.0).build(one_input())
    assert [drive.state(time).angles for time in (0, SECOND)] == [(0.0,), (4.0,)]


def test_constant_rate_drives_inputs_alike_or_individually():
    alike = ConstantRateDrive(rate=4.0, start=1.0).build(two_inputs())
    alike.state(BEGIN)
    assert alike.state(BEGIN + SECOND) == CrankState((5.0, 5.0), (4.0, 4.0), (0.0, 0.0), 0)
    own = ConstantRateDrive(rate=4.0, start=1.0, inputs={'right_crank': ConstantRate(-2.0)})
    drive = own.build(two_inputs())
    drive.state(BEGIN)
    assert drive.state(BEGIN + SECOND) == CrankState((5.0, -2.0), (4.0, -2.0), (0.0, 0.0), 0)


@pytest.mark.parametrize(
    ('context', 'inputs'),
    [(one_input(), ('crank_joint',)), (two_inputs(), ('left_crank', 'right_crank'))],
    ids=['one input', 'two inputs'],
)
def test_unused_common_rate_is_refused(context, inputs):
    own = {name: ConstantRate(1.0) for name in inputs}
    with pytest.raises(DefinitionError, match=r'names every input') as caught:
        ConstantRateDrive(rate=4.0, inputs=own).build(context)
    assert caught.value.where == 'drive.constant_rate.inputs'
    assert '\n' not in str(caught.value)


def test_scene_publishes_the_constant_rate_input():
    built = pipeline('constant_rate: {rate: 2.5, start: 0.5}')
    times = (BEGIN, BEGIN + SECOND // 2, BEGIN + SECOND // 2 + 40_000_000)
    assert readings(built, *times) == [(0.5, 2.5), (1.75, 2.5), (1.85, 2.5)]
