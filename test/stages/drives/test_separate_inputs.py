# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Several inputs, each by messages of its own: two drivers publish one motor each."""

from math import inf, nan

from hypothesis import given, strategies as st
from linkage_ros.bag import BagWriter, Topic
from linkage_ros.messages import JointStateWriter, Rejection
import pytest

from ...support.scenes import FIVE_BAR, pipeline_of

MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000
GOOD = None
SILENT = None
NAMES = {'left': ['left_crank'], 'right': ['right_crank'], 'both': ['right_crank', 'left_crank']}
FIVE_BAR_SCENE = 'rate: 100\ndrive: {topic: {max_age: 0.2}}\neffects: {velocity: {}}'
HELD = FIVE_BAR_SCENE.replace('max_age', 'carry_forward: false, max_age')


def message(names, stamp, *values, rates=None):
    """Return a JointState with a stamp in ms since the begin; rates are 0 unless given."""
    rates = [0.0] * len(values) if rates is None else rates
    return JointStateWriter(NAMES.get(names, [names])).write(BEGIN + stamp * MS, values, rates)


# Name: steps of (time in ms, message or None, its rejection, or (angles, age in ms) or SILENT).
TIMELINES = {
    'there is no crank before each input has a sample': [
        (0, message('left', 0, 0.3), GOOD),
        (0, None, SILENT),
        (10, message('right', 5, 2.0), GOOD),
        (10, None, ((0.3, 2.0), 10)),
    ],
    'each is carried by its own rate since its own stamp': [
        (0, message('left', 0, 0.3, rates=[1.0]), GOOD),
        (50, message('right', 40, 2.0, rates=[-2.0]), GOOD),
        (100, None, ((0.4, 1.88), 100)),
        (110, message('left', 100, 0.5, rates=[1.0]), GOOD),
        (110, None, ((0.51, 1.86), 70)),
    ],
    'one that is silent for max_age silences the linkage until it speaks again': [
        (0, message('both', 0, 2.0, 0.3), GOOD),
        (190, message('left', 190, 0.4), GOOD),
        (200, None, ((0.4, 2.0), 200)),
        (201, None, SILENT),
        (300, message('left', 300, 0.5), GOOD),
        (300, None, SILENT),
        (310, message('right', 310, 2.1), GOOD),
        (310, None, ((0.5, 2.1), 10)),
    ],
    'an older stamp is refused for the input that has a newer one': [
        (0, message('both', 0, 2.0, 0.3), GOOD),
        (20, message('left', 20, 0.4), GOOD),
        (25, message('left', 10, 0.9), Rejection.STAMP_OLD),
        (30, message('both', 15, 2.1, 0.9), GOOD),
        (30, None, ((0.4, 2.1), 15)),
    ],
    'a number that is not finite spoils the whole message': [
        (0, message('both', 0, 2.0, 0.3), GOOD),
        (10, message('both', 10, nan, 0.4), Rejection.NOT_FINITE),
        (10, message('both', 10, 2.1, inf), Rejection.NOT_FINITE),
        (10, None, ((0.3, 2.0), 10)),
    ],
    'an absent rate of one is the difference of its own samples': [
        (0, message('both', 0, 2.0, 0.3, rates=[]), GOOD),
        (0, None, SILENT),
        (100, message('left', 100, 0.4, rates=[]), GOOD),
        (100, message('right', 50, 2.1, rates=[]), GOOD),
        (150, None, ((0.45, 2.3), 100)),
    ],
    'messages of other joints are passed by': [
        (0, message('both', 0, 2.0, 0.3), GOOD),
        (10, message('elbow', 10, 9.0), Rejection.MISSING),
        (10, None, ((0.3, 2.0), 10)),
    ],
}


@pytest.mark.parametrize('name', TIMELINES)
def test_each_input_is_carried_from_its_own_sample(name):
    pipeline = pipeline_of(FIVE_BAR_SCENE, FIVE_BAR)
    for time, offered, expected in TIMELINES[name]:
        now = BEGIN + time * MS
        if offered is not None:
            assert pipeline.offer(offered, now) is expected
            continue
        crank = pipeline.tick(now).states[0].crank
        if expected is SILENT:
            assert crank is None
        else:
            angles, age = expected
            assert crank.angles == pytest.approx(angles, abs=1e-12)
            assert crank.age == age * MS


events = st.tuples(
    st.sampled_from(['left', 'right']), st.integers(0, 30), st.integers(0, 40), st.floats(-3, 3)
)


@given(st.lists(events, max_size=30), st.booleans())
def test_crank_state_uses_the_newest_sample_per_input(offered, carried):
    """The bookkeeping here is a dictionary; the tick is the compiled one and the interpreted."""
    pipeline = pipeline_of(FIVE_BAR_SCENE if carried else HELD, FIVE_BAR)
    (line,) = pipeline.linkages
    newest = {}
    now = BEGIN
    for which, wait, delay, angle in offered:
        now += wait * MS
        stamp = now - delay * MS
        data = JointStateWriter(NAMES[which]).write(stamp, [angle], [0.5])
        if which in newest and stamp < newest[which][0]:
            assert pipeline.offer(data, now) is Rejection.STAMP_OLD
            continue
        assert pipeline.offer(data, now) is GOOD
        newest[which] = stamp, angle
    crank = line.drive.state(now)
    ages = [now - stamp for stamp, _ in newest.values()]
    if len(newest) < 2 or max(ages) > 200 * MS:
        assert crank is None
        return
    left, right = (
        newest[which][1] + carried * (0.5 * ((now - newest[which][0]) * 1e-9))
        for which in ('left', 'right')
    )
    assert (crank.angles, crank.rates, crank.age) == ((left, right), (0.5, 0.5), max(ages))
    state = pipeline.tick(now).states[0]
    assert state.crank == crank
    assert state.reading == line.interpret(now).reading


def test_tick_uses_the_messages_of_both_inputs():
    pipeline = pipeline_of(FIVE_BAR_SCENE, FIVE_BAR)
    for which, stamp in (('left', 0), ('right', 1), ('left', 2)):
        assert pipeline.offer(message(which, stamp, 1.0), BEGIN + 2 * MS) is GOOD
    assert pipeline.count_fresh_and_stale(BEGIN + 5 * MS) == (2, 0)
    assert pipeline.offer(message('left', 300, 1.0), BEGIN + 300 * MS) is GOOD
    assert pipeline.count_fresh_and_stale(BEGIN + 300 * MS) == (1, 0)
    assert pipeline.silent_inputs(BEGIN + 300 * MS) == {'right_crank': BEGIN + MS}


@pytest.mark.parametrize('pace', ['recorded', 'fast'])
def test_bag_of_two_publishers_drives_a_five_bar(tmp_path, pace):
    topic = Topic('/crank_states', 'sensor_msgs/msg/JointState', '', '')
    writer = BagWriter(tmp_path / 'bag', [topic], {})
    for index in range(20):
        which, value = ('left', 0.3 + 0.01 * index) if index % 2 else ('right', 2.0 - 0.01 * index)
        rate = 1.0 if index % 2 else -1.0
        now = BEGIN + 10 * index * MS
        writer.write(0, now, now, message(which, 10 * index, value, rates=[rate]))
    writer.close()
    scene = f'rate: 100\ndrive: {{bag: {{file: {tmp_path}/bag, pace: {pace}}}}}'
    pipeline = pipeline_of(scene, FIVE_BAR)
    for index in range(1, 20):  # The first message names one of both only.
        (state,) = pipeline.tick(BEGIN + 10 * index * MS).states
        held = index - (pace == 'fast')  # The other one is then as it was measured.
        left, right = (index, held) if index % 2 else (held, index)
        expected = 0.3 + 0.01 * left, 2.0 - 0.01 * right
        assert state.crank.angles == pytest.approx(expected, abs=1e-12)
