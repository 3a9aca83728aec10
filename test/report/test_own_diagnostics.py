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

"""What the diagnostics of a run add: ticks lost, messages dropped, warnings, and when it ended."""

from __future__ import annotations

from pathlib import Path

from linkage_ros.report.diagnostics_summary import _COUNTED
import pytest

from .runs import but, MS, on_lanes, read, recorded, Said

SHORT_MEMORY = 'drive: {topic: {max_age: 0.2}}\n'


def without_samples(first, last):
    return lambda tick, m: m._replace(messages=()) if first <= tick <= last else m


def test_diagnostics_tell_of_the_time_since_those_before(tmp_path):
    said = [
        Said(100.3, 'tick', {'Lost ticks': 2}),
        Said(200.3, 'tick', {'Lost ticks': 2}),
        Said(300.3, 'tick', {'Lost ticks': 7}, level=1, message='5 ticks lost'),
        Said(
            300.4, 'loop closure', {'Ticks open': 4, 'Ticks at a toggle': 1}, level=2, message='m'
        ),
        Said(
            400.3,
            'loop closure',
            {'Ticks open': 4, 'Ticks indeterminate': 6, 'Ticks beyond limits': 3},
        ),
        Said(500.3, 'recording', {'Dropped: /joint_states': 3, 'Dropped: /crank': 0}),
        Said(600.3, 'motor', {'Lost ticks': 99}, level=2, message='of somebody else'),
        Said(900.3, 'tick', {'Lost ticks': 1}),  # the node was started anew
    ]
    found = read(recorded(tmp_path, said=said))
    assert on_lanes(found) == {
        'lost': [(0, 100.3, 2, ''), (200.3, 300.3, 5, ''), (500.3, 900.3, 1, '')],
        'told_open': [(300.3, 300.4, 4, 'open'), (300.4, 400.3, 6, 'indeterminate')],
        'told_toggle': [(300.3, 300.4, 1, '')],
        'told_limited': [(300.4, 400.3, 3, '')],
        'dropped': [(400.3, 500.3, 3, 'messages of /joint_states')],
        'health': [
            (200.3, 300.3, 1, 'warning, tick: 5 ticks lost'),
            (300.3, 300.4, 1, 'error, loop closure: m'),
        ],
    }
    assert found.said['tick', 'Lost ticks'] == '1'
    assert ('motor', 'Lost ticks') not in found.said


def test_diagnostics_tell_how_long_a_run_went_on_without_a_joint_state(tmp_path):
    moments = but(1000, without_samples(300, 999))
    said = [Said(ms, 'crank', {}, 3, 'No crank') for ms in (1000.0, 2000.0, 3000.0)]
    found = read(recorded(tmp_path, SHORT_MEMORY, moments, said=said))
    assert found.end == 3000 * MS
    assert on_lanes(found) == {
        'stale': [(299, 3000, 1, '')],
        'silent': [(499, 3000, 1, '')],
        'health': [(0, 3000, 3, 'stale, crank: No crank')],
    }


def test_a_bag_begun_in_mid_run_does_not_tell_what_was_lost_before(tmp_path):
    bag = recorded(tmp_path, said=[Said(100, 'tick', {'Lost ticks': 50}),
                                   Said(200, 'tick', {'Lost ticks': 53})])  # fmt: skip
    begun = bag.attachments['run.json'].replace(b'{', b'{"begun": "mid-run", ', 1)
    bag.attachments['run.json'] = begun
    assert on_lanes(read(bag)) == {'lost': [(100, 200, 3, '')]}


def test_ever_new_diagnostics_take_no_ever_growing_room(tmp_path):
    said = [
        Said(ms, 'tick', {f'{ms} {n}': 'x' * 1000 for n in range(100)}, 1, f'{ms}' * 200)
        for ms in range(100)
    ]
    found = read(recorded(tmp_path, said=said))
    assert len(found.said) == 500
    assert all(len(value) <= 80 for value in found.said.values())
    assert sum(span[2] for span in on_lanes(found)['health']) == 100


def test_the_counts_that_are_followed_are_those_that_the_node_tells():
    pytest.importorskip('diagnostic_msgs')
    from linkage_ros.ros import diagnostics  # local import: needs rclpy

    source = Path(diagnostics.__file__).read_text()
    for key in _COUNTED:
        assert f"'{key}':" in source
    assert "f'Dropped: {topic.name}'" in source


def test_what_could_not_be_known_is_not_said_to_be_none(tmp_path):
    assert {*read(recorded(tmp_path)).lanes} == {
        'silent',
        'jump',
        'rejected',
        'open',
        'stale',
        'reset',
    }
