# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Events of a run are found in its bag when they happened; bags of others show joint states."""

from math import acos, cos, sqrt

from linkage_ros.bag import BagWriter, read_bag, Topic
from linkage_ros.messages import JointStateWriter
from linkage_ros.tools.view.report import Progress, read_run, ReportHeader, run_html, Window
import numpy as np
import pytest

from .runs import BEGIN, but, curve, from_then_on, MS, on_lanes, read, recorded, Said, sample
from .test_messages import GOOD, TWICE
from ....node.ticked import Moment

QUIET = 'faults: {quiet: {silence: {}}, worn: {stuck: {joint: rocker_joint}}}\n'
SHORT_MEMORY = 'drive: {topic: {max_age: 0.2}}\n'
SWINGING = 'four_bar: {a: 0.1, b: 0.05, c: 0.06, d: 0.12}\n'
LIMIT = acos((0.1**2 + 0.12**2 - 0.11**2) / (2 * 0.1 * 0.12))  # coupler and rocker in line
GAP = sqrt(0.1**2 + 0.12**2 - 2 * 0.1 * 0.12 * cos(LIMIT + 0.0005)) - 0.11
FLAT = 'four_bar: {a: 0.25, b: 0.375, c: 0.375, d: 1.0}\n'  # stretched out at 0, and only there


def asking(**asked):
    """Return what asks for faults at ticks: `tick_200=('quiet', True)`."""
    at = {int(key.removeprefix('tick_')): (change,) for key, change in asked.items()}
    return lambda tick, moment: moment._replace(asked=at.get(tick, ()))


def resetting(tick, moment):
    return moment._replace(reset=tick == 300)


def without_samples(first, last):
    return lambda tick, m: m._replace(messages=()) if first <= tick <= last else m


def without_ticks(first, last):
    return lambda tick, m: None if first <= tick <= last else m


def jumping_back(tick, moment):
    if tick < 400:
        return moment
    return moment._replace(
        time=moment.time - 500 * MS, messages=(sample(tick - 500, 0.007 * tick),)
    )


def swinging(tick, moment):
    # At tick 600 the crank is within its limit, and then it goes on.
    return moment._replace(messages=(sample(tick, LIMIT - 0.6005 + 0.001 * tick, 1.0),))


def flat(tick, moment):
    return moment._replace(messages=(sample(tick, -1.0 + 0.125 * tick, 1.0),))


# Scene, change of `turning`, its linkage, and the spans on the lanes, in [ms].
HAPPENS = {
    'nothing': ('', None, '', {}),
    'a fault, on and off': (
        QUIET,
        asking(tick_200=('quiet', True), tick_500=('quiet', False)),
        '',
        {
            'fault': [(200, 500, 1, 'quiet (silence)')],
            'silent': [(199, 500, 1, '')],
            'withheld': [(200, 499, 300, '')],
        },
    ),
    'faults that overlap, one to the end': (
        QUIET,
        asking(tick_200=('worn', True), tick_300=('quiet', True), tick_310=('quiet', False)),
        '',
        {
            'fault': [(200, 999, 1, 'worn (stuck)'), (300, 310, 1, 'quiet (silence)')],
            'silent': [(299, 310, 1, '')],
            'withheld': [(300, 309, 10, '')],
        },
    ),
    'a fault by the timeline of the scene': (
        'faults: {quiet: {silence: {}, at: [0.25, 0.75], seconds: 0.1}}\n',
        None,
        '',
        {
            'fault': [(250, 350, 1, 'quiet (silence)'), (750, 850, 1, 'quiet (silence)')],
            'silent': [(249, 350, 1, ''), (749, 850, 1, '')],
            'withheld': [(250, 349, 100, ''), (750, 849, 100, '')],
        },
    ),
    'a reset': ('', resetting, '', {'reset': [(300, 300, 1, '')]}),
    # At 499 ms the sample of 299 ms is 200 ms old.
    'no samples': (
        SHORT_MEMORY,
        without_samples(300, 699),
        '',
        {'stale': [(299, 700, 1, '')], 'silent': [(499, 700, 1, '')]},
    ),
    'no samples from some time on': (
        SHORT_MEMORY,
        without_samples(300, 999),
        '',
        {},  # nothing is recorded after the last joint state: nobody knows how long it went on
    ),
    'no ticks': ('', without_ticks(300, 349), '', {'silent': [(299, 350, 1, '')]}),
    'a clock that jumps back': (
        '',
        jumping_back,
        '',
        {'jump': [(399, 399, 1, 'by 0.499 s')], 'reset': [(399, 399, 1, '')]},
    ),
    'a loop that opens': (
        '',
        swinging,
        SWINGING,
        {
            'open': [(601, 999, 399, f'open, the links miss by {GAP:.3g} m')],
            'silent': [(600, 999, 1, '')],
        },
    ),
    'a toggle, and nothing else': (
        'effects: {velocity: {}}\n',
        flat,
        FLAT,
        {
            'open': [(0, 15, 15, 'open, the links miss by 0.14 m')],
            'toggle': [(8, 8, 1, '')],
            'silent': [(0, 8, 1, ''), (8, 15, 1, '')],
        },
    ),
    'readings that come late': (
        'effects: {delay: {seconds: 0.002}}\n',
        None,
        '',
        {'withheld': [(0, 1, 2, '')]},
    ),
}


@pytest.mark.sample(3)
@pytest.mark.parametrize('block', [8192, 64])
@pytest.mark.parametrize('name', HAPPENS)
def test_event_appears_on_its_track_at_its_time(tmp_path, monkeypatch, name, block):
    monkeypatch.setattr('linkage_ros.tools.view.report.blocks._MOST_MESSAGES', block)
    scene, changed, linkage, expected = HAPPENS[name]
    ticks = 16 if linkage == FLAT else 1000
    moments = but(ticks, changed or (lambda _tick, moment: moment))
    more = {'linkage': linkage} if linkage else {}
    assert on_lanes(read(recorded(tmp_path, scene, moments, **more))) == expected


def test_report_is_independent_of_the_block_size(tmp_path, monkeypatch):
    late = np.random.default_rng(7).integers(0, 90_000, 1000)
    moments = but(
        1000,
        lambda tick, m: Moment(
            m.time + int(late[tick]),
            m.messages if tick % 7 and not 300 <= tick < 600 else (),
            tick == 800,
            (('quiet', tick == 100),) if tick in (100, 130) else (),
        ),
    )
    said = [Said(ms + 0.5, 'tick', {'Lost ticks': ms}, ms // 200, 'm') for ms in range(0, 900, 97)]
    bag = recorded(
        tmp_path, f'{SHORT_MEMORY}{QUIET}effects: {{velocity: {{}}}}\n', moments, said=said
    )

    def all_of():
        found = read(bag)
        arrays = [array for each in found.curves for array in each.intervals[1:]]
        counts = (found.lateness.counts, found.age.counts)
        frames = [found.frames.times, *found.frames.values.values()]
        return on_lanes(found), found.end, found.last_values, [*arrays, *counts, *frames]

    *whole, arrays = all_of()
    assert {'fault', 'stale', 'silent', 'reset', 'lost', 'health', 'withheld'} == {*whole[0]}
    for size in (1, 50, 333):
        monkeypatch.setattr('linkage_ros.tools.view.report.blocks._MOST_MESSAGES', size)
        *other, pieces = all_of()
        assert other == whole
        for one, two in zip(arrays, pieces, strict=True):
            assert np.array_equal(one, two, equal_nan=True)


TWO = """
linkages:
- {name: left, linkage: l.yaml}
- {name: right, linkage: l.yaml}
"""


def both(tick, moment):
    joints = ['left_crank_joint', 'right_crank_joint']
    time = moment.time
    if 300 <= tick < 700:
        message = JointStateWriter(joints[:1]).write(time, [0.007 * tick], [7.0])
    else:
        message = JointStateWriter(joints).write(time, [0.007 * tick] * 2, [7.0] * 2)
    return moment._replace(messages=(message,))


INJECTED = Said(350.5, 'faults', {'quiet (silence)': 'injected', 'worn (stuck)': 'off'})
OFF = Said(350.5, 'faults', {'quiet (silence)': 'off', 'worn (stuck)': 'off'})

# For a bag that begins at 300 ms: switches and diagnostics of the run, and its faults.
BEGUN_LATER = {
    'on before, and turned off': (
        asking(tick_200=('quiet', True), tick_500=('quiet', False)),
        (),
        [(0, 200, 1, 'quiet (silence)')],
    ),
    'on before, as the diagnostics say': (
        asking(tick_200=('quiet', True)),
        (INJECTED,),
        [(0, 699, 1, 'quiet (silence)')],
    ),
    'on before, as both say': (
        asking(tick_200=('quiet', True), tick_500=('quiet', False)),
        (INJECTED,),
        [(0, 200, 1, 'quiet (silence)')],
    ),
    'on before, off, and on again': (
        asking(tick_200=('quiet', True), tick_400=('quiet', False), tick_600=('quiet', True)),
        (INJECTED,),
        [(0, 100, 1, 'quiet (silence)'), (300, 699, 1, 'quiet (silence)')],
    ),
    'off before': (asking(tick_200=('quiet', True), tick_250=('quiet', False)), (OFF,), []),
    'on before, and nothing says so': (asking(tick_200=('quiet', True)), (), []),
    'on before the diagnostics say so, and not before the bag': (
        asking(tick_340=('quiet', True)),
        (INJECTED,),
        [(40, 699, 1, 'quiet (silence)')],
    ),
}


@pytest.mark.sample(2)
@pytest.mark.parametrize('block', [8192, 1])
@pytest.mark.parametrize('name', BEGUN_LATER)
def test_fault_begun_before_the_bag_starts_with_it(tmp_path, monkeypatch, name, block):
    monkeypatch.setattr('linkage_ros.tools.view.report.blocks._MOST_MESSAGES', block)
    changed, said, expected = BEGUN_LATER[name]
    bag = recorded(tmp_path, QUIET, but(1000, changed), said=said)
    found = on_lanes(read(from_then_on(bag, tmp_path / 'later', 300.0)))
    assert found.get('fault', []) == expected


def test_whole_run_shows_no_earlier_fault(tmp_path):
    moments = but(1000, asking(tick_500=('quiet', False)))
    assert 'fault' not in on_lanes(read(recorded(tmp_path, QUIET, moments)))


def test_each_of_two_linkages_has_its_own_silence(tmp_path):
    found = read(recorded(tmp_path, TWO, but(1000, both)))
    # The other's sample is held for 0.2 s.
    assert on_lanes(found) == {'silent': [(499, 700, 1, 'right')]}
    left, right = found.linkages
    assert (left.silent.count, right.silent.count) == (0, 1)


def test_report_part_holds_its_events_and_counts_of_all(tmp_path):
    bag = recorded(
        tmp_path, QUIET, but(1000, asking(tick_200=('quiet', True), tick_500=('quiet', False)))
    )
    whole, part = read(bag), read(bag, Window(400 * MS, 600 * MS))
    assert on_lanes(part) == {
        'fault': [(400, 500, 1, 'quiet (silence)')],
        'silent': [(400, 500, 1, '')],
        'withheld': [(400, 499, 100, '')],
    }
    assert curve(part, 'rocker_joint', 'position')[0] == [*range(500, 601)]
    assert part.contents == whole.contents
    assert part.end == whole.end


# Bags that others have written: their joint states as they are, without a linkage.


STATE = 'sensor_msgs/msg/JointState'


def state(joints, rates=()):
    return JointStateWriter([*joints]).write(BEGIN, [*joints.values()], rates)


def foreign(folder, rows, kind=STATE):
    """Return what is read of messages: topic, log time in [ms], and bytes."""
    names = [*dict.fromkeys(name for name, _, _ in rows)]
    writer = BagWriter(folder / 'bag', [Topic(name, kind, '', '') for name in names])
    for name, time, data in rows:
        writer.write(names.index(name), BEGIN + round(time * MS), 0, data)
    writer.close()
    found, scene, missing = read_run(read_bag(writer.folder), Window(), Progress())
    assert scene is None
    assert 'carries no run.json, scene.yaml' in missing
    return found


def test_joints_of_two_topics_have_separate_curves(tmp_path):
    rows = []
    for ms in range(100):
        rows += [('/arm', ms, state({'a': ms, 'b': -ms}, [1.0, 2.0]))]
        rows += [('/hand', ms + 0.5, state({'a': 2 * ms}))]
    found = foreign(tmp_path, rows)
    assert [(curves.title, curves.rows) for curves in found.curves] == [
        ('/arm', 100), ('/hand', 100)
    ]  # fmt: skip
    arm, hand = found.curves
    assert [(c.name, c.quantity, c.unit) for c in arm.columns] == [
        ('a', 'position', 'rad or m'), ('b', 'position', 'rad or m'),
        ('a', 'rate', 'rad/s or m/s'), ('b', 'rate', 'rad/s or m/s'),
    ]  # fmt: skip
    assert [(c.name, c.quantity) for c in hand.columns] == [('a', 'position')]
    assert (hand.intervals.begins / MS).tolist() == [ms + 0.5 for ms in range(100)]
    assert hand.intervals.first[:, 0].tolist() == [2 * ms for ms in range(100)]
    assert found.linkages == ()
    # Nobody knows which of them ought not to be silent.
    assert 'silent' not in found.event_tracks
    pytest.importorskip('plotly')
    page = run_html(found, ReportHeader('t', [], [], []))
    assert '"name":"a on /arm"' in page
    assert '"name":"a on /hand"' in page


def test_joints_appearing_later_are_left_out_and_counted(tmp_path):
    rows = [('/j', ms, state({'a': 1.0} if ms < 9000 else {'a': 1.0, 'b': 2.0}))
            for ms in range(10_000)]  # fmt: skip
    found = foreign(tmp_path, rows)
    assert [column.name for column in found.curves[0].columns] == ['a']
    assert found.curves[0].rows == 10_000
    assert found.left_out == {('/j', 'messages with joints that turn up later'): 1000}


# Log times of messages on one topic in their order, their times in the run where these differ,
# and what is on the lanes.
TIMES = {
    'late by less than a second': (
        [0, 10, 20, 900, 30, 910, 2000, 2010],
        [0, 10, 20, 900, 900, 910, 2000, 2010],
        {'silent': [(20, 900, 1, ''), (910, 2000, 1, '')]},
    ),
    'late by more': (
        [0, 10, 5000, 3000, 3010],
        [0, 10, 5000, 5000, 5010],
        {'jump': [(5000, 5000, 1, 'by 2 s')], 'silent': [(10, 5000, 1, '')]},
    ),
    'a silence': ([*range(0, 1000, 10), *range(3000, 4000, 10)], None,
                  {'silent': [(990, 3000, 1, '')]}),
}  # fmt: skip


@pytest.mark.parametrize('name', TIMES)
def test_run_time_of_one_topic_continues_after_jumps(tmp_path, name):
    logged, times, lanes = TIMES[name]
    found = foreign(tmp_path, [('/j', ms, state({'a': float(ms)})) for ms in logged])
    assert curve(found, 'a', 'position') == (times or logged, logged)
    assert on_lanes(found) == lanes


def test_unreadable_messages_are_counted_by_topic(tmp_path):
    rows = [('/j', 0, GOOD), ('/j', 1, TWICE), ('/j', 2, b'no'), ('/k', 3, b'')]
    found = foreign(tmp_path, rows)
    assert found.curves[0].rows == 1
    assert found.left_out == {
        ('/j', 'a joint named twice'): 1,
        ('/j', 'malformed message'): 1,
        ('/k', 'malformed message'): 1,
    }


def test_topics_beyond_the_first_6_are_counted(tmp_path):
    rows = [(f'/j{n}', n, state({'a': 0.0})) for n in range(9)]
    found = foreign(tmp_path, rows)
    assert [curves.title for curves in found.curves] == [f'/j{n}' for n in range(6)]
    why = 'topics of joint states beyond the first 6'
    assert found.left_out == {(f'/j{n}', why): 1 for n in (6, 7, 8)}


def test_topics_of_other_types_are_counted_without_curves(tmp_path):
    found = foreign(tmp_path, [('/t', ms, b'abc') for ms in range(5)], 'std_msgs/msg/Empty')
    assert not found.curves
    (topic,) = found.contents.topics
    assert (topic.messages, topic.size) == (5, 15)
