# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A gap is part of what a sensor sees: where the linkage has no pose, nothing is read or made up.

The reference is the loop of the linkage, written apart: with the crank's angle at a message's
stamp, the published joints have to close it.
"""

from cmath import rect
from math import pi, sin

from linkage_ros.messages import JointStateWriter
from linkage_ros.stages.effects import Delay, DelayEffect
import pytest

from .sensors import BEGIN, MS, reading
from ...support.scenes import pipeline_of

A, B, C, D = 0.2, 0.15, 0.18, 0.25
DOUBLE_ROCKER = b"""
links:
  ground:  {O2: [0, 0], O4: [0.25, 0]}
  crank:   {O2: [0, 0], A: [0.2, 0]}
  coupler: {A: [0, 0], B: [0.15, 0]}
  rocker:  {O4: [0, 0], B: [0.18, 0]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {B: left}
joints:
  coupler_joint: {parent: ground, child: coupler}
  rocker_joint: {parent: ground, child: rocker}
"""
SINE = 'drive: {sine: {mean: 0.9, amplitude: 1.6, frequency: 0.5}}\npublish_input: false\n'


def crank_at(time):
    """Return the crank's angle at a time, in [ns], as the sine of `SINE` has it."""
    return 0.9 + 1.6 * sin(2.0 * pi * 0.5 * (time - BEGIN) * 1e-9)


def open_by(crank, joints):
    """Return what the loop of vectors is open by, in [m]."""
    coupler, rocker = joints
    return abs(rect(A, crank) + rect(B, coupler) - D - rect(C, rocker))


def closes(crank):
    """Return whether coupler and rocker reach each other at a crank angle."""
    diagonal = abs(D - rect(A, crank))
    return abs(B - C) <= diagonal <= B + C


def pipeline(effects, drive=SINE, faults=''):
    return pipeline_of(f'rate: 1000\n{drive}effects: {{{effects}}}\n{faults}', DOUBLE_ROCKER)


def run(effects, ticks=4000):
    """Return for each tick, 1 ms apart, what is read."""
    work = pipeline(effects)
    return [work.tick(BEGIN + i * MS).states[0].reading for i in range(ticks)]


@pytest.mark.parametrize('velocity', ['', 'velocity: {}, '], ids=['', 'with rates'])
@pytest.mark.parametrize('between', ['interpolated', 'sampled'])
@pytest.mark.parametrize(('seconds', 'late'), [(0.1, 100), (0.0996, 100), (0.0, 0)])
def test_delay_publishes_only_readings_with_a_pose(seconds, late, between, velocity):
    delay = f'delay: {{seconds: {seconds}, between: {between}, stamp: measured}}'
    found = run(f'{velocity}{delay}')
    posed = [closes(crank_at(BEGIN + i * MS)) for i in range(len(found))]
    assert 0.2 < sum(posed) / len(posed) < 0.9, 'a linkage that opens and closes'
    # Each tick with a pose is answered as much later, and no tick without one.
    assert [one is not None for one in found] == [*[False] * late, *posed][: len(found)]
    for one in found:
        if one is not None:
            assert closes(crank_at(one.stamp))
            # Between two ticks as far as a mixture may be off, which next to a toggle is far.
            exact = between == 'sampled' or (one.stamp - BEGIN) % MS == 0
            assert open_by(crank_at(one.stamp), one.joints) < (1e-14 if exact else 5e-3)


@pytest.mark.sample(1)
@pytest.mark.parametrize('distribution', ['uniform', 'half_normal'])
def test_jitter_publishes_no_reading_from_a_gap(distribution):
    found = run(f'jitter: {{seconds: 0.004, distribution: {distribution}}}')
    posed = [closes(crank_at(BEGIN + i * MS)) for i in range(len(found))]
    # One that looks up to 4 ms back may miss the first four after a gap, and none else.
    for i, one in enumerate(found):
        assert posed[i] or one is None
        if one is None and i >= 4:
            assert not all(posed[k] for k in range(i - 4, i + 1))
        if one is not None:
            instants = [one.stamp - k * MS // 100 for k in range(401)]
            assert min(open_by(crank_at(time), one.joints) for time in instants) < 3e-4


def test_topic_pause_gives_a_delayed_gap():
    drive = 'drive: {topic: {max_age: 0.05}}\n'
    work = pipeline('delay: {seconds: 0.02, stamp: measured}', drive)
    write = JointStateWriter(['crank_joint']).write
    stamps = []
    for i in range(600):
        now = BEGIN + i * MS
        if i < 200 or i >= 400:
            assert work.offer(write(now, [0.8 + 1e-4 * i], [0.1], []), now) is None
        found = work.tick(now).states[0].reading
        stamps += [] if found is None else [(found.stamp - BEGIN) // MS]
    # The last sample, of 199 ms, is carried forward for 50 ms; the next comes at 400 ms.
    assert stamps == [*range(250), *range(400, 580)]


def test_first_sensor_silence_arrives_delayed():
    line = Delay(DelayEffect(0.0025), mixes=True)
    found = []
    for ms in range(12):
        now = BEGIN + ms * MS
        one = line(now, reading(now, float(ms)) if ms != 5 else None)
        found.append(None if one is None else one.joints[0])
    # Mixed until the last reading before the silence arrives; from then on as it is.
    assert found == [None, None, None, 0.5, 1.5, 2.5, 3.5, 4.0, None, 6.0, 7.0, 8.0]


def test_gap_behind_a_silent_sensor_counts_once():
    # With a lossy sensor before the delay, the line carries messages: a gap takes as long as they.
    line = Delay(DelayEffect(0.002), mixes=True)
    found = []
    for ms in range(12):
        now = BEGIN + ms * MS
        if ms in (4, 5, 6):
            one = line.gap(now)
        else:
            one = line(now, None if ms == 1 else reading(now, float(ms)))
        found.append(None if one is None else one.joints[0])
    assert found == [None, None, 0.0, None, 2.0, 3.0, None, None, None, 7.0, 8.0, 9.0]


def test_freeze_fault_over_an_open_loop_repeats_the_reading():
    work = pipeline('velocity: {}', faults='faults: {hang: {freeze: {}}}\n')
    found = []
    for i in range(3000):
        if i == 100:
            work.injection.switch_fault('hang', on=True)
        found.append(work.tick(BEGIN + i * MS).states[0].reading)
    posed = [closes(crank_at(BEGIN + i * MS)) for i in range(len(found))]
    assert all(posed[:100])
    assert not all(posed)
    for i, one in enumerate(found[100:], 100):
        assert one.joints == found[99].joints
        assert one.stamp == BEGIN + i * MS


@pytest.mark.parametrize(
    'effects',
    [
        'delay: {seconds: 0.0123}',
        'jitter: {seconds: 0.0031}',
        'jitter: {seconds: 0.0031}, delay: {seconds: 0.0123, between: interpolated}',
        'noise: {joints: {rocker_joint: {white: 1.0e-3}}}, delay: {seconds: 0.0123}',
        'encoder: {joints: {rocker_joint: {counts: 4096}}}, delay: {seconds: 0.0123}',
    ],
)
def test_velocity_effect_does_not_change_positions(effects):
    with_rates, without = run(f'velocity: {{}}, {effects}'), run(effects)
    for one, other in zip(with_rates, without, strict=True):
        assert (one is None) == (other is None)
        if one is not None:
            assert (one.stamp, one.joints) == (other.stamp, other.joints)
            assert other.rates == ()


def test_delay_keeps_whole_encoder_counts():
    encoder = 'encoder: {joints: {rocker_joint: {counts: 4096}}}'
    found = run(f'{encoder}, delay: {{seconds: 0.0123}}')
    counts = [one.joints[1] * 4096 / (2.0 * pi) for one in found if one is not None]
    assert counts
    assert all(abs(count - round(count)) < 1e-9 for count in counts)


@pytest.mark.parametrize(
    'effects',
    [
        'delay: {seconds: 0.1}',
        'delay: {seconds: 0.0123, between: sampled, stamp: measured}',
        'jitter: {seconds: 0.0031}',
        (
            'jitter: {seconds: 0.0031}, noise: {joints: {rocker_joint: {white: 1.0e-3}}}, '
            'dropout: {probability: 0.3}, delay: {seconds: 0.05}'
        ),
        'rate_limit: {rate: 90, hold: silent}, delay: {seconds: 0.05}',
    ],
)
def test_replay_of_recorded_ticks_gives_the_same_messages(effects):
    # As a bag has it: the ticks with a message, and those without of which a replay has to know.
    # A topic that pauses remembers nothing by itself, other than a drive that goes on.
    drive = 'drive: {topic: {max_age: 0.02}}\n'
    write = JointStateWriter(['crank_joint']).write
    live, again = pipeline(effects, drive), pipeline(effects, drive)
    kept = 0
    for i in range(3000):
        now = BEGIN + i * MS
        if i % 700 < 500:
            sample = write(now, [crank_at(now)], [0.0], [])
            assert live.offer(sample, now) is again.offer(sample, now) is None
        tick = live.tick(now)
        if tick.message or live.changes_state(tick):
            kept += 1
            assert again.tick(now).message == tick.message, i
    assert 500 < kept < 2800


def test_delayed_accelerations_arrive_with_their_reading():
    work = pipeline('acceleration: {}, delay: {seconds: 0.1}')
    ticks = [work.tick(BEGIN + i * MS) for i in range(2000)]
    arrived = [tick for tick in ticks if tick.message]
    assert any(not tick.states[0].position.joints for tick in arrived)
    assert all(tick.extras and tick.extras[0] for tick in arrived)
