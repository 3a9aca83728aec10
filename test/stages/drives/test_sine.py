# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A sine against 60 digits: value, and its derivatives as mpmath differentiates them."""

from math import pi

from hypothesis import given, strategies as st
from linkage_ros.stages.drives import CrankState, Sine, SineDrive
from mpmath import mp
import pytest

from .contexts import pipeline, readings, two_inputs

SECOND = 1_000_000_000
DAY = 86_400 * SECOND
ROUNDING = 8e-15
"""Of the sine and cosine of an angle of up to two turns, a few roundings of 2e-16 each."""


def check(parameters, time):
    """Check a sine at a time, in [ns]."""
    with mp.workdps(60):
        A, f, mean, phase = map(
            mp.mpf,
            (parameters.amplitude, parameters.frequency, parameters.mean, parameters.phase),
        )

        def position(t):
            return mean + A * mp.sin(2 * mp.pi * f * t + phase)

        expected = [mp.diff(position, mp.mpf(time) / SECOND, n) for n in range(3)]
        w = 2 * mp.pi * f
        found = parameters.motion_curve()(time)
        limits = (ROUNDING * A + abs(mean) * 2e-16, ROUNDING * A * w, ROUNDING * A * w * w)
        for value, wanted, limit in zip(found, expected, limits, strict=True):
            assert abs(value - wanted) <= limit


@given(
    st.just(0.0) | st.floats(1e-9, 100.0),
    st.floats(1e-7, 1e4),
    st.floats(-2.0, 2.0),
    st.floats(-6.0, 6.0),
    st.sampled_from((0, 1, SECOND)) | st.integers(0, 3000 * DAY),
)
def test_sine_position_rate_and_acceleration_equal_the_definition(
    amplitude, frequency, mean, phase, time
):
    check(Sine(amplitude, frequency, mean, phase), time)


@pytest.mark.parametrize('periods', [1, 10**6, 10**12 + 1])
def test_sine_repeats_whole_periods_bit_for_bit(periods):
    # A period is 8 ms.
    sine = Sine(amplitude=0.5, frequency=125.0, mean=0.1, phase=0.3).motion_curve()
    for time in range(0, 8_000_000, 999_983):
        assert sine(time + periods * 8_000_000) == sine(time)


def test_sine_drives_each_input_by_its_own_parameters():
    own = {'left_crank': Sine(amplitude=0.5, frequency=0.25, mean=2.0)}
    drive = SineDrive(amplitude=1.0, frequency=0.25, inputs=own).build(two_inputs())
    assert (drive.stamp, drive.max_age) == (0, 0)
    rate = pi / 2
    state = drive.state(5 * SECOND)
    assert state == CrankState((2.0, 0.0), (0.5 * rate, rate), (0.0, 0.0), 0)
    angles, rates, accelerations, age = drive.state(6 * SECOND)
    assert angles == (2.5, 1.0)
    assert rates == pytest.approx((0.0, 0.0), abs=1e-15)
    assert accelerations == pytest.approx((-0.5 * rate**2, -(rate**2)))
    assert age == 0


def test_a_scene_publishes_the_sine():
    built = pipeline('sine: {amplitude: 0.5, frequency: 0.25, mean: 1}')
    assert readings(built, SECOND, 2 * SECOND) == [(1.0, 0.25 * pi), (1.5, pytest.approx(0.0))]
