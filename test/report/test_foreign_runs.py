# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Bags that others have written: their joint states as they are, without a linkage."""

from __future__ import annotations

from linkage_ros.bag.reader import read_bag
from linkage_ros.bag.topic import Topic
from linkage_ros.bag.writer import BagWriter
from linkage_ros.messages.joint_state import JointStateWriter
from linkage_ros.report.blocks import Progress
from linkage_ros.report.html import ReportHeader, run_html
from linkage_ros.report.reading import read_run
from linkage_ros.report.run import Window
import pytest

from .runs import BEGIN, curve, MS, on_lanes
from .test_messages import encoded, GOOD, TWICE

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


def test_joints_of_several_topics_are_told_apart(tmp_path):
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
    assert 'silent' not in found.lanes
    pytest.importorskip('plotly')
    page = run_html(found, ReportHeader('t', [], [], []))
    assert '"name":"a on /arm"' in page
    assert '"name":"a on /hand"' in page


def test_joints_that_turn_up_later_are_counted(tmp_path):
    rows = [('/j', ms, state({'a': 1.0} if ms < 9000 else {'a': 1.0, 'b': 2.0}))
            for ms in range(10_000)]  # fmt: skip
    found = foreign(tmp_path, rows)
    assert [column.name for column in found.curves[0].columns] == ['a']
    assert found.curves[0].rows == 10_000
    assert found.left_out == {('/j', 'messages with joints that turn up later'): 1000}


def test_what_stands_late_by_less_than_a_second_is_no_jump(tmp_path):
    times = [0, 10, 20, 900, 30, 910, 2000, 2010]
    found = foreign(tmp_path, [('/j', ms, state({'a': float(ms)})) for ms in times])
    assert (found.curves[0].intervals.begins / MS).tolist() == [
        0, 10, 20, 900, 900, 910, 2000, 2010
    ]  # fmt: skip
    assert found.curves[0].intervals.first[:, 0].tolist() == times
    assert 'jump' not in on_lanes(found)


def test_what_stands_late_by_more_is_one(tmp_path):
    times = [0, 10, 5000, 3000, 3010]
    found = foreign(tmp_path, [('/j', ms, state({'a': float(ms)})) for ms in times])
    assert (found.curves[0].intervals.begins / MS).tolist() == [0, 10, 5000, 5000, 5010]
    assert on_lanes(found)['jump'] == [(5000, 5000, 1, 'by 2 s')]


def test_one_topic_that_is_silent(tmp_path):
    times = [*range(0, 1000, 10), *range(3000, 4000, 10)]
    found = foreign(tmp_path, [('/j', ms, state({'a': 0.0})) for ms in times])
    assert on_lanes(found) == {'silent': [(990, 3000, 1, '')]}


def test_what_cannot_be_read_is_counted_by_topic(tmp_path):
    rows = [('/j', 0, GOOD), ('/j', 1, encoded(TWICE)), ('/j', 2, b'no'), ('/k', 3, b'')]
    found = foreign(tmp_path, rows)
    assert found.curves[0].rows == 1
    assert found.left_out == {
        ('/j', 'a joint named twice'): 1,
        ('/j', 'malformed message'): 1,
        ('/k', 'malformed message'): 1,
    }


def test_of_many_topics_the_first_are_told_and_the_others_counted(tmp_path):
    rows = [(f'/j{n}', n, state({'a': 0.0})) for n in range(9)]
    found = foreign(tmp_path, rows)
    assert [curves.title for curves in found.curves] == [f'/j{n}' for n in range(6)]
    why = 'topics of joint states beyond the first 6'
    assert found.left_out == {(f'/j{n}', why): 1 for n in (6, 7, 8)}


def test_other_topics_are_counted_and_not_drawn(tmp_path):
    found = foreign(tmp_path, [('/t', ms, b'abc') for ms in range(5)], 'std_msgs/msg/Empty')
    assert not found.curves
    (topic,) = found.contents.topics
    assert (topic.messages, topic.size) == (5, 15)


def test_curve_is_the_helper_that_it_says(tmp_path):
    found = foreign(tmp_path, [('/j', ms, state({'a': ms / 2})) for ms in range(5)])
    assert curve(found, 'a', 'position') == ([0, 1, 2, 3, 4], [0, 0.5, 1, 1.5, 2])
