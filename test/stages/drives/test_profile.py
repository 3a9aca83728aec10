# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A profile: timelines by hand, its curves against closed forms and against scipy's splines."""

from math import tau

from hypothesis import given, strategies as st
from linkage_ros.errors import DefinitionError
from linkage_ros.stages.drives import CrankState, Profile, ProfileDrive
from mpmath import mp
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from .contexts import pipeline, readings, two_inputs

MS = 1_000_000
SECOND = 1000 * MS
THERE_AND_BACK = ((0.0, 0.0), (1.0, 2.0), (1.5, 2.0), (2.0, 0.0))
ONCE_AROUND = ((0.0, 0.0), (1.0, 1.0), (2.0, tau))
LATE = ((0.5, 1.0), (1.0, 3.0))

TIMELINES = {
    'straight from row to row, then at rest': (
        Profile(THERE_AND_BACK, 'linear'),
        [
            (0, (0.0, 2.0, 0.0)), (250, (0.5, 2.0, 0.0)), (1000, (2.0, 0.0, 0.0)),
            (1250, (2.0, 0.0, 0.0)), (1500, (2.0, -4.0, 0.0)), (1875, (0.5, -4.0, 0.0)),
            (2000, (0.0, 0.0, 0.0)), (999_999, (0.0, 0.0, 0.0)),
        ],
    ),
    'at rest in every row, and halfway as fast as 15/8 of the mean': (
        Profile(THERE_AND_BACK, 'minimum_jerk'),
        [
            (0, (0.0, 0.0, 0.0)), (500, (1.0, 3.75, 0.0)), (1000, (2.0, 0.0, 0.0)),
            (1100, (2.0, 0.0, 0.0)), (1500, (2.0, 0.0, 0.0)), (1750, (1.0, -7.5, 0.0)),
            (2000, (0.0, 0.0, 0.0)),
        ],
    ),
    'of two rows a cubic is 3x² − 2x³': (
        Profile(((0.0, 1.0), (2.0, 5.0)), 'cubic'),
        [
            (0, (1.0, 0.0, 6.0)), (500, (1.625, 2.25, 3.0)), (1000, (3.0, 3.0, 0.0)),
            (2000, (5.0, 0.0, 0.0)),
        ],
    ),
    'before the first row it rests there': (Profile(LATE, 'linear'), [
        (0, (1.0, 0.0, 0.0)), (499, (1.0, 0.0, 0.0)), (500, (1.0, 4.0, 0.0)),
        (750, (2.0, 4.0, 0.0)), (1000, (3.0, 0.0, 0.0)),
    ]),
    'what comes back repeats': (
        Profile(THERE_AND_BACK, 'linear', repeat=True),
        [
            (2000, (0.0, 2.0, 0.0)), (2250, (0.5, 2.0, 0.0)), (3250, (2.0, 0.0, 0.0)),
            (2_000_000_250, (0.5, 2.0, 0.0)),
        ],
    ),
    'what gains goes on from there, and what is late is late once': (
        Profile(LATE, 'linear', repeat=True),
        [
            (499, (1.0, 0.0, 0.0)), (750, (2.0, 4.0, 0.0)), (1000, (3.0, 4.0, 0.0)),
            (1250, (4.0, 4.0, 0.0)), (1750, (6.0, 4.0, 0.0)),
        ],
    ),
    'an index drive steps on and on': (
        Profile(((0.0, 0.0), (1.0, 0.5), (2.0, 0.5)), 'minimum_jerk', repeat=True),
        [
            (500, (0.25, 0.9375, 0.0)), (1500, (0.5, 0.0, 0.0)), (2500, (0.75, 0.9375, 0.0)),
            (2_000_500, (500.25, 0.9375, 0.0)),
        ],
    ),
    'evenly spaced rows that repeat are a constant rate': (
        Profile(((0.0, 0.0), (0.5, 1.0), (1.0, 2.0)), 'cubic', repeat=True),
        [(250, (0.5, 2.0, 0.0)), (750, (1.5, 2.0, 0.0)), (7750, (15.5, 2.0, 0.0))],
    ),
    'so are two': (Profile(((0.0, 0.0), (1.0, 2.0)), 'cubic', repeat=True), [
        (0, (0.0, 2.0, 0.0)), (250, (0.5, 2.0, 0.0)), (7750, (15.5, 2.0, 0.0)),
    ]),
}  # fmt: skip


@pytest.mark.parametrize('name', TIMELINES)
def test_profile_follows_its_timeline(name):
    parameters, steps = TIMELINES[name]
    profile = parameters.motion_curve()
    for time, expected in steps:
        assert profile(time * MS) == pytest.approx(expected, abs=1e-12), f'at {time} ms'


@st.composite
def tables(draw):
    n = draw(st.integers(2, 12))
    gaps = draw(st.lists(st.integers(1, 20_000), min_size=n, max_size=n))
    values = draw(st.lists(st.floats(-50.0, 50.0), min_size=n, max_size=n))
    times = np.cumsum(gaps) * 1e-3
    return tuple(zip(times.tolist(), values, strict=True))


@given(tables(), st.sampled_from(['linear', 'cubic', 'minimum_jerk']), st.booleans())
def test_profile_passes_through_every_row(table, interpolation, repeat):
    profile = Profile(table, interpolation, repeat=repeat).motion_curve()
    for time, value in table:
        assert profile(round(time * SECOND))[0] == pytest.approx(value, abs=1e-13)


@given(tables(), st.floats(0.0, 1.0))
def test_cubic_profile_equals_the_clamped_spline(table, part):
    times, values = np.array(table).T
    spline = CubicSpline(times, values, bc_type='clamped')
    time = round((times[0] + part * (times[-1] - times[0])) * SECOND) - 1
    check_spline(Profile(table, 'cubic').motion_curve(), spline, time, 0.0)


@given(tables(), st.floats(0.0, 1.0), st.integers(0, 5))
def test_repeating_cubic_profile_equals_the_periodic_spline(table, part, rounds):
    times, values = np.array(table).T
    length = times[-1] - times[0]
    trend = (values[-1] - values[0]) / length
    level = values - trend * (times - times[0])
    level[-1] = level[0]
    spline = CubicSpline(times, level, bc_type='periodic')
    within = round((times[0] + part * length) * SECOND) - 1
    time = within + rounds * round(length * SECOND)
    check_spline(Profile(table, 'cubic', repeat=True).motion_curve(), spline, time, trend)


def check_spline(profile, spline, time, trend):
    """Check against a spline to which a trend is added; it may swing far beyond its rows."""
    begin = round(spline.x[0] * SECOND)
    time = max(time, begin)
    t = spline.x[0] + (time - begin) / SECOND
    gained = trend * (t - spline.x[0])
    h = np.diff(spline.x)
    swing = max(abs(spline(np.linspace(spline.x[0], spline.x[-1], 500))))
    size = 100.0 + abs(gained) + swing
    limits = (1e-11 * size, 1e-11 * size / min(h), 1e-11 * size / min(h) ** 2)
    found = profile(time)
    wanted = (spline(t) + gained, spline(t, 1) + trend, spline(t, 2))
    for value, expected, limit in zip(found, wanted, limits, strict=True):
        assert abs(value - expected) <= limit


@pytest.mark.parametrize('x', ['0.0', '0.001', '0.2', '0.5', '0.7', '0.999', '0.999999999'])
def test_minimum_jerk_profile_equals_flash_and_hogan(x):
    profile = Profile(((1.0, 0.3), (3.5, -1.4)), 'minimum_jerk').motion_curve()
    with mp.workdps(40):
        h, step = mp.mpf('2.5'), mp.mpf(-1.4) - mp.mpf(0.3)

        def position(t):
            s = (t - 1) / h
            return mp.mpf(0.3) + step * (10 * s**3 - 15 * s**4 + 6 * s**5)

        time = SECOND + round(float(x) * 2.5 * SECOND)
        expected = [mp.diff(position, mp.mpf(time) / SECOND, n) for n in range(3)]
    assert profile(time) == pytest.approx([float(v) for v in expected], rel=0, abs=3e-14)


@pytest.mark.parametrize('interpolation', ['cubic', 'minimum_jerk'])
def test_profile_is_continuous_across_its_rows(interpolation):
    profile = Profile(ONCE_AROUND, interpolation, repeat=True).motion_curve()
    for row in range(1, 9):
        before, after = profile(row * SECOND - 1), profile(row * SECOND)
        # In a nanosecond nothing changes by more than the next derivative, here below 320.
        assert after == pytest.approx(before, abs=3.2e-7)


def test_repeating_profile_stays_exact_after_a_million_rounds():
    profile = Profile(ONCE_AROUND, 'minimum_jerk', repeat=True).motion_curve()
    angle, rate, acceleration = profile(2_000_000 * SECOND + SECOND // 2)
    with mp.workdps(40):
        expected = 1_000_000 * mp.mpf(tau) + mp.mpf('0.5')
    assert abs(angle - expected) <= 2e-9, 'two units in the last place of 6e6'
    assert (rate, acceleration) == (1.875, 0.0)


def test_profile_drives_each_input_by_its_own_table():
    own = {'left_crank': Profile(LATE, 'linear')}
    drive = ProfileDrive(THERE_AND_BACK, 'linear', inputs=own).build(two_inputs())
    assert (drive.stamp, drive.max_age) == (0, 0)
    begin = 1_700_000_000_000_000_000
    assert drive.state(begin) == CrankState((1.0, 0.0), (0.0, 2.0), (0.0, 0.0), 0)
    assert drive.state(begin + 750 * MS) == CrankState((2.0, 1.5), (4.0, 2.0), (0.0, 0.0), 0)


@pytest.mark.parametrize(
    ('table', 'reason'),
    [
        (((0.0, 1.0),), 'has one row; write two or more'),
        (((-0.5, 1.0), (1.0, 1.0)), 'row 1 is at -0.5 s, before the first tick'),
        (((0.0, 1.0), (1.0, 1.0), (1.0, 2.0)), 'row 3 is at 1.0 s, not after row 2 at 1.0 s'),
        (((0.0, 1.0), (2.0, 1.0), (1.5, 2.0)), 'row 3 is at 1.5 s, not after row 2 at 2.0 s'),
        (((0.0, 1.0), (1e-10, 1.0)), 'row 2 is at 1e-10 s, not after row 1 at 0.0 s'),
    ],
)
def test_invalid_profile_table_is_refused(table, reason):
    with pytest.raises(DefinitionError) as caught:
        ProfileDrive(table).build(two_inputs())
    assert str(caught.value).startswith(f'drive.profile.table: {reason}')
    own = {'right_crank': Profile(table)}
    with pytest.raises(DefinitionError) as caught:
        ProfileDrive(LATE, inputs=own).build(two_inputs())
    assert str(caught.value).startswith(f'drive.profile.inputs.right_crank.table: {reason}')
    assert '\n' not in str(caught.value)


def test_a_scene_publishes_the_profile():
    built = pipeline('profile: {table: [[0, 0.5], [1, 1], [2, 0.5]], interpolation: linear}')
    times = (SECOND, SECOND + 500 * MS, 2 * SECOND + 500 * MS, 4 * SECOND)
    assert readings(built, *times) == [(0.5, 0.5), (0.75, 0.5), (0.75, -0.5), (0.5, 0.0)]
