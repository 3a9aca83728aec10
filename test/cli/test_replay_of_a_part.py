# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage replay`` and ``info`` say what is missing of a run that is not all in its bag."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from linkage_ros.bag import BagMessage, read_bag, recover_bag, Storage
from linkage_ros.cli import info, replay
import pytest

from .recorded import answer, BEGIN, MS, rewritten
from .test_replay import from_tick, NOISE, recorded, told

RING = Storage(split_seconds=0.1, keep_files=2)  # of 300 ticks at 1 kHz the last 100 to 200 stay


# Effects, exit code, verdict, and the part that cannot be reproduced.
RINGS = {
    'nothing remembered': ('velocity: {}', 0, 'identical', ''),
    'a delay that fills': ('velocity: {}, delay: {seconds: 0.02}', 0, 'identical', ''),
    'play, which is passed': ('backlash: {play: 0.01}', 0, 'identical', ''),
    'random numbers': (NOISE, 1, 'cannot be told', 'noise'),
    'random latencies': (
        'velocity: {}, delay: {seconds: 0.002, spread: 0.004}', 1, 'cannot be told', 'delay',
    ),
    'delays that fill': (
        'delay: {seconds: 0.02, joints: {rocker_joint: {seconds: 0.03}}}', 0, 'identical', '',
    ),
    "a joint's random latencies": (
        'delay: {seconds: 0, joints: {rocker_joint: {seconds: 0, spread: 0.004}}}',
        1, 'cannot be told', 'delay',
    ),
    'a low-pass': (
        'velocity: {}, encoder: {joints: {rocker_joint: {counts: 4096}}, cutoff: 5}',
        1, 'cannot be told', 'encoder',
    ),
    'counts from the beginning': (
        'encoder: {joints: {rocker_joint: {counts: 4096, incremental: true, index: false}}}',
        1, 'cannot be told', 'encoder',
    ),
}  # fmt: skip


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', RINGS)
def test_replay_of_a_ring_names_the_removed_beginning(tmp_path, capsys, name) -> None:
    effects, code, verdict, lost = RINGS[name]
    bag = recorded(tmp_path, f'effects: {{{effects}}}\n')
    ring = rewritten(bag, 'ring', storage=RING)
    gone = len(list(read_bag(bag).messages())) - len(list(read_bag(ring).messages()))
    assert gone > 100
    found, account = told(capsys, ring)
    assert (found, account['verdict']) == (code, verdict)
    why = account['beginning_missing']
    assert why.startswith(f'its first {gone} messages were removed for newer ones: ')
    assert why.endswith(f'{lost} cannot be reproduced') == bool(lost)
    assert answer(replay, ring) == code
    assert f'\n{why}\n' in capsys.readouterr().out


def test_replay_finds_a_difference_in_a_ring(tmp_path, capsys) -> None:
    bag = recorded(tmp_path, 'effects: {velocity: {}}\n')

    def edit(_: int, message: BagMessage) -> BagMessage:
        if message.topic == '/joint_states' and message.publish_time == BEGIN + 290 * MS:
            return message._replace(data=message.data[:-1] + bytes([message.data[-1] ^ 1]))
        return message

    code, account = told(capsys, rewritten(bag, 'ring', edit, storage=RING))
    assert (code, account['verdict'], account['different_ticks']) == (3, 'different', 1)


def test_replay_of_a_later_split_file_names_missing_beginning(tmp_path, capsys) -> None:
    bag = recorded(tmp_path, f'effects: {{{NOISE}}}\n')
    split = rewritten(bag, 'split', storage=Storage(split_seconds=0.1))
    code, account = told(capsys, split)
    assert (code, account['beginning_missing']) == (0, None)
    code, account = told(capsys, split / 'split_1.mcap')
    assert (code, account['verdict']) == (1, 'cannot be told')
    assert account['beginning_missing'].startswith('begins with split_1.mcap, which is not the ')


@pytest.mark.parametrize('said', ['mid-run', 'with the run'])
def test_ring_begun_in_mid_run_is_identical(tmp_path, capsys, said) -> None:
    bag = recorded(tmp_path, 'effects: {velocity: {}}\n')
    part = rewritten(bag, 'part', from_tick(31), storage=RING, begun=said)
    code, account = told(capsys, part)
    assert (code, account['verdict']) == (0, 'identical')
    assert account['beginning_missing'].startswith('its first ')


def test_replay_names_dropped_messages_beside_a_difference(tmp_path, capsys) -> None:
    bag = recorded(tmp_path, f'effects: {{{NOISE}}}\n')

    def without_one(_: int, message: BagMessage) -> BagMessage | None:
        tick = message.publish_time == BEGIN + 100 * MS
        return None if tick and message.topic == '/joint_states' else message

    counts = {'/joint_states': 1, '/diagnostics': 7, '/crank_states': 0}
    custom = {'linkage_ros.dropped': json.dumps(counts)}
    said = {'diagnostics_topic': '/diagnostics'}
    part = rewritten(bag, 'part', without_one, custom=custom, **said)
    code, account = told(capsys, part)
    assert (code, account['verdict']) == (3, 'different')
    line = '1 messages were dropped during the recording: what depends on a missing one '
    assert account['gaps'] == [f'{line}may differ']
    assert answer(replay, part) == 3
    assert line in capsys.readouterr().out
    # A tick that nothing remembers is missed by nobody: there is nothing to explain.
    (tmp_path / 'other').mkdir()
    bag = recorded(tmp_path / 'other', '')
    assert answer(replay, rewritten(bag, 'part', without_one, custom=custom, **said)) == 0
    assert 'were dropped during the' not in capsys.readouterr().out


def test_replay_names_bytes_lost_by_recovery_beside_a_difference(tmp_path, capsys) -> None:
    bag = recorded(tmp_path, f'effects: {{{NOISE}}}\n', 6000)
    file = bag / 'bag_0.mcap'
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    recovery = recover_bag(bag)
    assert recovery is not None
    code, account = told(capsys, recovery.folder)
    assert code == 3
    assert account['gaps'][0].startswith('recovered from bag: ')
    assert answer(replay, recovery.folder) == 3
    assert ' bytes lost in 1 places: what depends on a' in capsys.readouterr().out


def facts(capsys: pytest.CaptureFixture[str], bag: Path) -> tuple[str, dict[str, Any]]:
    """Return what ``linkage info`` prints, and its account."""
    capsys.readouterr()
    answer(info, bag)
    text = capsys.readouterr().out
    answer(info, bag, '--json')
    return text, json.loads(capsys.readouterr().out)


def test_info_counts_discarded_messages_of_a_ring(tmp_path, capsys) -> None:
    bag = recorded(tmp_path, '')
    ring = rewritten(bag, 'ring', storage=RING)
    text, account = facts(capsys, ring)
    gone = len(list(read_bag(bag).messages())) - account['messages']
    assert sum(topic['discarded'] for topic in account['topics']) == gone > 100
    assert any(line.split()[:2] == ['beginning', 'its'] for line in text.splitlines())
    assert f'{gone}, in files that newer ones replaced' in text
    assert '  discarded  ' in text


def test_info_counts_received_messages(tmp_path, capsys) -> None:
    bag = recorded(tmp_path, '')
    text, account = facts(capsys, bag)
    assert {topic['received'] for topic in account['topics']} == {None}
    assert '  received  ' not in text
    names = ['/joint_states', '/linkage/withheld', '/crank_states']
    custom = {
        'linkage_ros.received': json.dumps(dict(zip(names, (305, 0, 300), strict=True))),
        'linkage_ros.dropped': json.dumps(dict(zip(names, (5, 0, 0), strict=True))),
    }
    whole = rewritten(bag, 'whole', custom=custom)
    text, account = facts(capsys, whole)
    counts = {each['name']: (each['received'], each['dropped']) for each in account['topics']}
    assert counts == {names[0]: (305, 5), names[1]: (0, 0), names[2]: (300, 0)}
    assert [line.split() for line in text.splitlines() if line.startswith('received')] == [
        ['received', '605']
    ]
    assert 'discarded' not in text


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    'counts',
    ['3', '[]', '{"/joint_states": "many"}', '{"/joint_states": -1}', '{"/joint_states": true}',
     '[' * 100_000, '{"/joint_states": 1e400}', 'nonsense'],
)  # fmt: skip
def test_malformed_message_counts_are_shown_as_unknown(tmp_path, capsys, counts) -> None:
    custom = {f'linkage_ros.{word}': counts for word in ('received', 'dropped', 'discarded')}
    bag = rewritten(recorded(tmp_path, ''), 'odd', custom=custom)
    _, account = facts(capsys, bag)
    states = account['topics'][0]
    assert (states['received'], states['dropped'], states['discarded']) == (None, None, None)
    assert told(capsys, bag)[1]['beginning_missing'] is None
    assert account['unfinished'] is None


def test_info_marks_an_unfinished_bag(tmp_path, capsys) -> None:
    bag = recorded(tmp_path, '')
    text, account = facts(capsys, bag)
    assert account['unfinished'] is None
    assert [line.split() for line in text.splitlines() if line.startswith('unfinished')] == [
        ['unfinished', 'no']
    ]
    custom = {'linkage_ros.unfinished': 'being recorded, or killed'}
    text, account = facts(capsys, rewritten(bag, 'killed', custom=custom))
    assert account['truncated']
    assert account['unfinished'] == 'its recording was killed, or still runs'
    assert 'unfinished   its recording was killed, or still runs\n' in text
