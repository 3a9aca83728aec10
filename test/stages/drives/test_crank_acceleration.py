# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The crank's acceleration, estimated from samples: in closed form, and in what it moves."""

from math import cos, exp, pi, sin

from hypothesis import given, strategies as st
from linkage_ros.errors import FileError
from linkage_ros.messages import CrankSample, Rejection
from linkage_ros.stages.drives import SampledCrank, TopicDrive
import pytest

from ...support.messages import joint_state as serialized, read_joint_state
from ...support.scenes import PENDULUM, pipeline_of

MS = 1_000_000
NOW = 10_000 * MS
DIFFERENCED = TopicDrive(acceleration='differenced')


def fed(parameters, samples):
    """Return a drive that has taken samples: pairs of a time in [ms] and a rate."""
    drive = SampledCrank(parameters, needs_rate=False)
    for time, rate in samples:
        stamp = round(time * MS)
        assert drive.offer(CrankSample(stamp, (0.0,), (rate,)), stamp) is None
    return drive


def acceleration(drive, time):
    return drive.state(round(time * MS)).accelerations[0]


@given(st.lists(st.integers(1, 150), min_size=2, max_size=8), st.integers(0, 190))
def test_differenced_acceleration_extrapolates_a_uniformly_accelerated_crank(gaps, after):
    # q = 0.3 + 2·t − 3·t²/2, at irregular samples, and between two of them.
    drive = SampledCrank(DIFFERENCED, needs_rate=False)
    time = 0
    for gap in gaps:
        time += gap
        t = time * 1e-3
        sample = CrankSample(time * MS, (0.3 + 2.0 * t - 1.5 * t * t,), (2.0 - 3.0 * t,))
        assert drive.offer(sample, time * MS) is None
    state = drive.state((time + after) * MS)
    t = (time + after) * 1e-3
    assert state.angles[0] == pytest.approx(0.3 + 2.0 * t - 1.5 * t * t, abs=1e-12)
    assert state.rates[0] == pytest.approx(2.0 - 3.0 * t, abs=1e-12)
    assert state.accelerations[0] == pytest.approx(-3.0, abs=1e-9)


def test_differenced_acceleration_lags_by_half_an_interval():
    # Of ω = sin(20·t), sampled each 5 ms: the mean of the acceleration over the last interval.
    drive = fed(DIFFERENCED, [(5 * n, sin(0.1 * n)) for n in range(1, 40)])
    middle = 20.0 * cos(0.1 * 38.5)
    mean = (sin(0.1 * 39) - sin(0.1 * 38)) / 0.005
    assert acceleration(drive, 5 * 39) == pytest.approx(mean, rel=1e-12)
    assert acceleration(drive, 5 * 39) == pytest.approx(middle, rel=0.1**2 / 20.0)


def test_acceleration_low_pass_answers_a_step_exponentially():
    # From 1 s on the crank accelerates by 4 rad/s²; samples come at irregular times.
    filtered = TopicDrive(acceleration='differenced', cutoff=7.0)
    times = [800, 900, 1000, 1007, 1019, 1020, 1051, 1113]
    for count in range(3, len(times) + 1):
        samples = [(time, max(0.0, 4e-3 * (time - 1000))) for time in times[:count]]
        since = 1e-3 * (times[count - 1] - 1000)
        expected = 4.0 * (1.0 - exp(-2.0 * pi * 7.0 * since))
        assert acceleration(fed(filtered, samples), times[count - 1]) == pytest.approx(
            expected, abs=1e-11
        )


# Samples as (time in ms, rate), and the acceleration at the last of them.
HISTORIES = {
    'one sample has none': ([(1000, 5.0)], 0.0),
    'two have': ([(1000, 5.0), (1010, 5.2)], 20.0),
    'a repeated stamp keeps it': ([(1000, 5.0), (1010, 5.2), (1010, 9.0)], 20.0),
    'after a gap it begins again': ([(1000, 5.0), (1010, 5.2), (1300, 8.0)], 0.0),
    'and goes on then': ([(1000, 5.0), (1300, 8.0), (1310, 8.1)], 10.0),
    'a difference that no machine has counts as none': ([(1000, 0.0), (1000.000001, 1e9)], 0.0),
}


@pytest.mark.parametrize('name', HISTORIES)
def test_sample_histories_give_the_expected_acceleration(name):
    samples, expected = HISTORIES[name]
    assert acceleration(fed(DIFFERENCED, samples), samples[-1][0]) == pytest.approx(expected)


def test_older_stamp_leaves_the_acceleration_unchanged():
    drive = fed(DIFFERENCED, [(1000, 5.0), (1010, 5.2)])
    older = CrankSample(1005 * MS, (0.0,), (50.0,))
    assert drive.offer(older, 1010 * MS) is Rejection.STAMP_OLD
    assert acceleration(drive, 1010) == pytest.approx(20.0)


SCENE = """
rate: 100
drive: {topic: {DRIVE}}
effects: {velocity: {}, effort: {}}
publish_input: true
loads: {gravity: [0, -9.81]}
"""


@pytest.mark.parametrize(('drive', 'counts'), [('acceleration: differenced', 1.0), ('', 0.0)])
def test_topic_drive_effort_includes_the_differenced_acceleration(drive, counts):
    # A pendulum of 0.23 kg·m² about its pivot, 2 kg at 0.3 m; the crank at q = 1.5·t².
    pipeline = pipeline_of(SCENE.replace('DRIVE', drive), PENDULUM)
    for n in range(1, 8):
        t = 0.01 * n
        stamp = divmod(NOW + n * 10 * MS, 1000 * MS)
        message = serialized(['drive_joint'], [1.5 * t * t], [3.0 * t], stamp=stamp)
        assert pipeline.offer(message, NOW + n * 10 * MS) is None
        tick = pipeline.tick(NOW + n * 10 * MS + 4 * MS)
    state = read_joint_state(tick.message)
    t = 0.074 if drive else 0.07
    q = 1.5 * t * t if drive else 1.5 * t * t + 3.0 * t * 0.004
    expected = 0.23 * 3.0 * counts + 2.0 * 9.81 * 0.3 * cos(q)
    assert state.position[0] == pytest.approx(q, abs=1e-12)
    assert state.effort[0] == pytest.approx(expected, rel=1e-9)


def test_cutoff_without_differenced_acceleration_is_refused():
    with pytest.raises(
        FileError, match='cutoff: has nothing to filter; add acceleration: differenced'
    ):
        pipeline_of('drive: {topic: {cutoff: 5}}\n', PENDULUM)
