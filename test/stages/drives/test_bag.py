# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The crank from a bag: timelines, what is skipped, which topic is taken, and what is no crank."""

import json
from math import inf, nan
from random import Random

from hypothesis import given, strategies as st
from linkage_ros.bag import BagWriter, Topic
from linkage_ros.description import load_scene
from linkage_ros.errors import BagError, DefinitionError
from linkage_ros.messages import CrankSample, JointStateWriter, Rejection
from linkage_ros.stages.drives import BagDrive, CrankState, SampledCrank, TopicDrive
from linkage_ros.tick import Pipeline
from mcap.writer import IndexType, Writer
import pytest

from .contexts import one_input, readings, two_inputs

MS = 1_000_000
RECORDED = 1_600_000_000_000_000_000
BEGIN = 1_700_000_000_123_456_789
SILENT = None
TYPE = 'sensor_msgs/msg/JointState'
CRANK = JointStateWriter(['other', 'crank_joint'])
NO_CRANK = JointStateWriter(['rocker_joint'])


def sample(time, angle, rate=0.0):
    """Return a sample taken so many ms after the recording began; without a rate, of None."""
    rates = () if rate is None else (9.0, rate)
    return CRANK.write(RECORDED + time * MS, (7.0, angle), rates)


def write(folder, messages, types=None, run=None):
    """Write a bag of (topic, message), a message every ms."""
    names = dict.fromkeys(name for name, _ in messages)
    topics = [Topic(name, (types or {}).get(name, TYPE), '', '') for name in names]
    attached = {} if run is None else {'run.json': ('application/json', run)}
    writer = BagWriter(folder, topics, attached)
    for index, (name, data) in enumerate(messages):
        log_time = RECORDED + index * MS
        writer.write(list(names).index(name), log_time, log_time, data)
    writer.close()
    return str(folder)


def crank(*samples):
    return [('/crank', each) for each in samples]


THREE = crank(sample(0, 0.5, 2.0), sample(100, 1.0, 4.0), sample(150, 3.0, -1.0))
TWO = crank(sample(0, 0.5, 2.0), sample(100, 1.0, 4.0))

TIMELINES = {
    'at their times, carried forward by their rates': (
        {},
        THREE,
        [
            (0, (0.5, 2.0, 0)), (50, (0.6, 2.0, 50)), (99, (0.698, 2.0, 99)), (100, (1.0, 4.0, 0)),
            (125, (1.1, 4.0, 25)), (150, (3.0, -1.0, 0)),
        ],
    ),
    'held as measured': (
        {'carry_forward': False},
        THREE,
        [(0, (0.5, 2.0, 0)), (99, (0.5, 2.0, 99)), (125, (1.0, 4.0, 25)), (160, (3.0, -1.0, 10))],
    ),
    'silent in a gap of the recording, and after its end': (
        {'max_age': 0.04},
        THREE,
        [
            (40, (0.58, 2.0, 40)), (41, SILENT), (99, SILENT), (140, (1.16, 4.0, 40)),
            (141, SILENT), (150, (3.0, -1.0, 0)), (190, (2.96, -1.0, 40)), (191, SILENT),
            (10_000, SILENT),
        ],
    ),
    'ticks that are far apart leave samples out': ({}, THREE, [(150, (3.0, -1.0, 0))]),
    'of two samples of one instant the later counts': (
        {},
        crank(sample(0, 0.5), sample(10, 1.0), sample(10, 2.0), sample(20, 3.0)),
        [(10, (2.0, 0.0, 0)), (20, (3.0, 0.0, 0))],
    ),
    'repeated, a mean interval after the last': (
        {'repeat': True, 'carry_forward': False},
        THREE,  # 150 ms, and 75 more
        [
            (0, (0.5, 2.0, 0)), (224, (3.0, -1.0, 74)), (225, (0.5, 2.0, 0)), (325, (1.0, 4.0, 0)),
            (2_250_000_101, (1.0, 4.0, 1)),
        ],
    ),
    'one for every tick, whatever the time': (
        {'pace': 'fast'},
        THREE,
        [
            (0, (0.5, 2.0, 0)), (1, (1.0, 4.0, 0)), (9999, (3.0, -1.0, 0)), (10_000, SILENT),
            (10_001, SILENT),
        ],
    ),
    'one for every tick, and again': (
        {'pace': 'fast', 'repeat': True},
        TWO,
        [(0, (0.5, 2.0, 0)), (1, (1.0, 4.0, 0)), (2, (0.5, 2.0, 0)), (3, (1.0, 4.0, 0))],
    ),
}  # fmt: skip


@pytest.mark.parametrize('begin', [BEGIN, 0, 1])
@pytest.mark.parametrize('name', TIMELINES)
def test_bag_samples_drive_the_crank_on_time(tmp_path, name, begin):
    parameters, messages, steps = TIMELINES[name]
    drive = BagDrive(write(tmp_path / 'bag', messages), **parameters).build(one_input())
    if steps[0][0]:
        drive.state(begin)
    for time, expected in steps:
        state = drive.state(begin + time * MS)
        if expected is SILENT:
            assert state is None, f'at {time} ms'
        else:
            angle, rate, age = expected
            angles = (pytest.approx(angle, abs=1e-12),)
            assert state == CrankState(angles, (rate,), (0.0,), age * MS), f'at {time} ms'


def test_bag_drive_reports_newest_stamp_and_max_age(tmp_path):
    file = write(tmp_path / 'bag', THREE)
    drive = BagDrive(file, max_age=0.3).build(one_input())
    assert drive.max_age == 300 * MS
    stamps = [drive.stamp]
    for time in (0, 120, 160, 1000):
        drive.state(BEGIN + time * MS)
        stamps.append(drive.stamp)
    assert stamps == [0, BEGIN, BEGIN + 100 * MS, BEGIN + 150 * MS, BEGIN + 150 * MS]
    fast = BagDrive(file, pace='fast').build(one_input())
    fast.state(BEGIN)
    assert (fast.stamp, fast.max_age) == (0, 0)


times = st.lists(st.integers(0, 400), min_size=1, max_size=20).map(sorted)


@given(times, times, st.booleans())
def test_bag_drive_equals_the_topic_drive(tmp_path_factory, taken, ticks, carry_forward):
    values = [(0.1 * index, 3.0 - index) for index in range(len(taken))]
    folder = tmp_path_factory.mktemp('bag') / 'bag'
    samples = [sample(t, *v) for t, v in zip(taken, values, strict=True)]
    bag = write(folder, crank(*samples))
    drive = BagDrive(bag, carry_forward=carry_forward, max_age=0.05).build(one_input())
    topic = SampledCrank(TopicDrive(carry_forward, max_age=0.05), needs_rate=True)
    offers = [(BEGIN + (t - taken[0]) * MS, *v) for t, v in zip(taken, values, strict=True)]
    for tick in [0, *ticks]:
        now = BEGIN + tick * MS
        while offers and offers[0][0] <= now:
            stamp, angle, rate = offers.pop(0)
            assert topic.offer(CrankSample(stamp, (angle,), (rate,)), now) is None
        assert drive.state(now) == topic.state(now)


def test_arrival_stamps_keep_the_recorded_spacing(tmp_path):
    angles = (0.1, 0.2, 0.4)
    samples = [CRANK.write(0, (7.0, angle), (9.0, 0.0)) for angle in angles]
    file = write(tmp_path / 'bag', crank(*samples))
    with pytest.raises(BagError, match='stamp zero'):
        BagDrive(file).build(one_input())
    drive = BagDrive(file, stamp='arrival').build(one_input())
    assert [drive.state(BEGIN + n * MS).angles[0] for n in range(3)] == [*angles]


def test_bag_drive_reads_several_inputs_from_one_message(tmp_path):
    both = JointStateWriter(['right_crank', 'other', 'left_crank'])
    messages = crank(
        both.write(RECORDED, (1.0, 2.0, 3.0), (10.0, 20.0, 30.0)),
        both.write(RECORDED + 10 * MS, (4.0, 5.0, 6.0), (40.0, 50.0, 60.0)),
    )
    file = write(tmp_path / 'bag', messages)
    drive = BagDrive(file).build(two_inputs())
    assert drive.state(BEGIN) == CrankState((3.0, 1.0), (30.0, 10.0), (0.0, 0.0), 0)
    fast = BagDrive(file, pace='fast').build(two_inputs())
    states = [fast.state(0), fast.state(0), fast.state(0)]
    assert states[1:] == [CrankState((6.0, 4.0), (60.0, 40.0), (0.0, 0.0), 0), None]


def test_bag_drive_skips_and_counts_bad_samples(tmp_path):
    bad = [
        (sample(1, nan), Rejection.NOT_FINITE),
        (sample(2, 0.0, inf), Rejection.NOT_FINITE),
        (sample(3, 2e10), Rejection.TOO_LARGE),
        (NO_CRANK.write(RECORDED, (1.0,), ()), Rejection.MISSING),
        (sample(5, 0.5)[:-30], Rejection.MALFORMED),
        (b'', Rejection.MALFORMED),
        (CRANK.write(0, (0.0, 0.5), (0.0, 0.0)), Rejection.STAMP_ZERO),
        (sample(-1, 0.5), Rejection.STAMP_OLD),
    ]
    messages = [bad[3][0], sample(0, 0.1), *(message for message, _ in bad), sample(50, 0.2)]
    drive = BagDrive(write(tmp_path / 'bag', crank(*messages))).build(one_input())
    reasons = [reason for _, reason in bad]
    assert drive.samples.rejected == {
        reason: reasons.count(reason) + (reason is Rejection.MISSING) for reason in reasons
    }
    assert [drive.state(BEGIN + time * MS).angles for time in (0, 49, 50)] == [
        (0.1,),
        (0.1,),
        (0.2,),
    ]


@pytest.mark.parametrize('rate', [None, nan])
@pytest.mark.parametrize(
    ('pace', 'carry_forward', 'needs_rate', 'differenced'),
    [
        ('recorded', True, False, True),
        ('recorded', False, True, True),
        ('recorded', False, False, False),
        ('fast', True, True, True),
        ('fast', True, False, False),
    ],
)
def test_bag_drive_differences_absent_rates(
    tmp_path, pace, carry_forward, needs_rate, differenced, rate
):
    samples = [sample(0, 0.5, rate), sample(10, 0.6, rate), sample(20, 0.65, rate)]
    file = write(tmp_path / 'bag', crank(*samples))
    parameters = BagDrive(file, pace=pace, carry_forward=carry_forward)
    drive = parameters.build(one_input(needs_rate=needs_rate))
    expected = [(0.6, 10.0), (0.65, 5.0)] if differenced else [(0.5, 0.0), (0.6, 0.0), (0.65, 0.0)]
    for index, (angle, speed) in enumerate(expected):
        state = drive.state(BEGIN + 10 * index * MS)
        assert (*state.angles, *state.rates) == pytest.approx((angle, speed), rel=1e-9)


TWO_TOPICS = [
    ('/a/crank', sample(0, 0.1)),
    ('/b/crank', sample(0, 0.2)),
    ('/joint_states', NO_CRANK.write(RECORDED, (1.0,), (0.0,))),
]
RUN = json.dumps({'scene': 's', 'crank_topic': '/b/crank'}).encode()


@pytest.mark.parametrize(
    ('messages', 'run', 'topic', 'angle'),
    [
        (TWO_TOPICS[:1] + TWO_TOPICS[2:], None, '', 0.1),
        (TWO_TOPICS, None, '/a/crank', 0.1),
        (TWO_TOPICS, RUN, '', 0.2),
        (TWO_TOPICS, RUN, '/a/crank', 0.1),
        (TWO_TOPICS[:1], RUN, '', 0.1),
        (TWO_TOPICS[:1], b'{', '', 0.1),
        (TWO_TOPICS[:1], b'[]', '', 0.1),
    ],
    ids=[
        'the only one that holds the input',
        'that which is named',
        'that of the run',
        'that which is named, before that of the run',
        'the run names one that is not there',
        'the account of the run is damaged',
        'the account of the run is none',
    ],
)
def test_bag_drive_selects_the_crank_topic(tmp_path, messages, run, topic, angle):
    file = write(tmp_path / 'bag', messages, run=run)
    drive = BagDrive(file, topic=topic).build(one_input())
    assert drive.state(BEGIN).angles == (angle,)


STRING = {'/text': 'std_msgs/msg/String'}


@pytest.mark.parametrize(('messages', 'parameters', 'said'), [
    (TWO_TOPICS, {}, 'holds crank samples on /a/crank, /b/crank; name one of them as'),
    (TWO_TOPICS[:1], {'topic': '/crank'}, f"holds no topic '/crank' of {TYPE}; it holds /a/crank"),
    ([('/text', b'')], {'topic': '/text'}, f"no topic '/text' of {TYPE}; it holds no other"),
    (TWO_TOPICS[2:], {}, 'holds no crank sample of crank_joint, /joint_states: crank joint'),
    (TWO_TOPICS, {'topic': '/joint_states'}, 'of crank_joint, /joint_states: crank joint mis'),
    ([('/text', b'')], {}, 'holds no crank sample of crank_joint; name another bag'),
    ([], {}, 'holds no crank sample of crank_joint; name another bag'),
])  # fmt: skip
def test_bag_without_the_crank_is_refused(tmp_path, messages, parameters, said):
    file = write(tmp_path / 'bag', messages, STRING)
    with pytest.raises(BagError) as caught:
        BagDrive(file, **parameters).build(one_input())
    assert str(caught.value).startswith(f'{file}: ')
    assert said in str(caught.value)
    assert '\n' not in str(caught.value)


def test_file_that_is_not_a_bag_is_refused(tmp_path):
    file = tmp_path / 'crank.csv'
    file.write_text('time, angle\n')
    for path, said in ((file, 'not an MCAP file'), (tmp_path / 'none', 'does not exist')):
        with pytest.raises(BagError, match=said):
            BagDrive(str(path)).build(one_input())


def test_truncated_bag_is_read_only_with_allow_truncated(tmp_path):
    samples = [sample(time, time * 0.001) for time in range(20_000)]
    folder = tmp_path / 'bag'
    write(folder, crank(*samples))
    file = folder / 'bag_0.mcap'
    file.write_bytes(file.read_bytes()[:1_500_000])
    with pytest.raises(BagError, match='its recording was killed'):
        BagDrive(str(folder)).build(one_input())
    drive = BagDrive(str(folder), allow_truncated=True).build(one_input())
    drive.state(BEGIN)
    assert drive.state(BEGIN + 5000 * MS).angles == (5.0,)
    assert 5000 < len(drive.samples) < 20_000


def test_bag_of_one_instant_cannot_repeat(tmp_path):
    file = write(tmp_path / 'bag', crank(sample(0, 0.5), sample(0, 0.6)))
    with pytest.raises(DefinitionError, match='have the same time; leave repeat out') as caught:
        BagDrive(file, repeat=True).build(one_input())
    assert caught.value.where == 'drive.bag.repeat'
    fast = BagDrive(file, repeat=True, pace='fast').build(one_input())
    assert [fast.state(0).angles for _ in range(3)] == [(0.5,), (0.6,), (0.5,)]


def test_scene_resolves_the_bag_path_relative_to_itself(tmp_path):
    write(tmp_path / 'runs' / 'bag', THREE)
    (tmp_path / 'scene.yaml').write_text(
        'linkage: l.yaml\neffects: {velocity: {}}\ndrive: {bag: {file: runs/bag}}\n'
    )
    (tmp_path / 'l.yaml').write_text('four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}')
    built = Pipeline(load_scene(tmp_path / 'scene.yaml'))
    times = (BEGIN, BEGIN + 50 * MS, BEGIN + 150 * MS)
    assert readings(built, *times) == [(0.5, 2.0), (pytest.approx(0.6), 2.0), (3.0, -1.0)]
    assert built.tick(BEGIN + 351 * MS).message == b''
    assert (built.newest_stamp, built.max_age) == (BEGIN + 150 * MS, 200 * MS)


LAYOUTS = {
    'with an index': {'chunk_size': 256},
    'of one chunk': {},
    'without chunks': {'use_chunking': False},
    'without an index': {'index_types': IndexType.NONE, 'repeat_channels': False,
                         'repeat_schemas': False, 'use_statistics': False,
                         'use_summary_offsets': False},
}  # fmt: skip

TIMES = [*range(0, 8000, 200)]
"""When messages were taken, in [ms]: they span more than any window of seconds."""

ORDERS = {
    'halves exchanged': [*TIMES[20:], *TIMES[:20]],
    'backwards': TIMES[::-1],
    'shuffled': Random(1).sample(TIMES, len(TIMES)),
    'two recorders one after the other': TIMES[::2] + TIMES[1::2],
}


@pytest.mark.parametrize('layout', LAYOUTS)
@pytest.mark.parametrize('order', ORDERS)
def test_bag_samples_are_sorted_by_log_time(tmp_path, order, layout):
    file = tmp_path / 'x.mcap'
    with file.open('wb') as stream:
        writer = Writer(stream, **LAYOUTS[layout])
        writer.start(profile='ros2')
        schema = writer.register_schema(TYPE, 'ros2msg', b'')
        channel = writer.register_channel('/crank', 'cdr', schema)
        for time in ORDERS[order]:
            at = RECORDED + time * MS
            writer.add_message(channel, at, sample(time, time * 1e-3), at)
        writer.finish()
    drive = BagDrive(str(file)).build(one_input())
    states = [drive.state(BEGIN + time * MS) for time in TIMES]
    assert [state and state.angles for state in states] == [(time * 1e-3,) for time in TIMES]
