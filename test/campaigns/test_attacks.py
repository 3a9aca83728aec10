# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A sample of the attacks: each is answered, or refused in a line."""

from __future__ import annotations

from pathlib import Path
import random
from random import Random

from campaigns.reliability import hostile_files, signals
from campaigns.reliability.attacks import attack
from campaigns.reliability.hostile_bags import (
    change_bag,
    COMMANDS as BAG_COMMANDS,
    MANNERS,
    tries,
)
from campaigns.reliability.hostile_files import manners, mutated
from campaigns.reliability.judge import fault_of
from campaigns.reliability.processes import Ended
from linkage_ros.cli import COMMANDS
import pytest

from ..support.sampling import sample_count

# A sample of the attacks: no traceback, no hang, no long output; and the judge detects them.


SEED = 20261122
"""Another seed than the campaign's."""

COUNT = sample_count(40, 12)


def test_changed_files_cause_no_findings() -> None:
    tried, findings = attack(hostile_files.tries, COUNT, SEED, part=50)
    assert findings == []
    assert tried.total() == COUNT
    assert any(end.endswith(': 0') for end in tried)
    assert any(end.endswith(': 2') for end in tried)


def test_every_linkage_command_is_attacked_with_changed_files() -> None:
    without = {
        'demo',
        'echo',
        'plot',
        'info',
        'report',
        'export',
        'recover',
        'import',
        'synthesize',
        'gallery',
        'compare',
        'completion',
    }
    assert set(hostile_files.COMMANDS) == set(COMMANDS) - without


def test_signals_end_commands() -> None:
    count = sample_count(6, 3)
    tried, findings = attack(signals.tries, count, SEED)
    assert findings == []
    assert tried.total() == count


def test_mutated_files_differ_in_many_ways() -> None:
    original = b'links: {ground: {A: [0, 0], B: [0.1, 0]}}\ninput: {joint: j}\n'
    files_ = {mutated(original, random.Random(index))[1] for index in range(300)}
    assert len(files_) > 200
    assert sum(b'5e-324' in file for file in files_) > 1


@pytest.mark.parametrize(
    ('command', 'code', 'errors', 'is_fault'),
    [
        ('check', 0, '', False),
        ('check', 2, 'linkage check: x: is wrong; correct it\n', False),
        ('check', 2, 'linkage check: x.yaml:1: is wrong\nlinkage check: x.yaml:2: too\n', False),
        ('synthesize', 1, '', False),
        (
            'replay',
            0,
            'linkage replay: nothing to compare with: bag: carries no run.json\n',
            False,
        ),
        ('accuracy', 0, 'accuracy of x: 4 of 30\n', False),
        ('animate', 0, 'pictures: 1 of 4\n', False),
        ('accuracy', 2, 'accuracy of x: 4 of 30\nlinkage accuracy: x: is wrong\n', False),
        ('replay', 2, 'linkage replay: one\nlinkage replay: other\n', True),
        ('replay', 0, 'RuntimeWarning: overflow', True),
        ('run', 2, '', True),
        ('check', 2, 'one\nother\n', True),
        ('check', 2, '', True),
        ('check', 2, 'x' * 2000, True),
        ('check', 0, 'RuntimeWarning: overflow', True),
        ('check', 1, '', True),
        ('check', 'traceback', 'IndexError', True),
        ('check', 'no end', 'more than 60 s', True),
    ],
)
def test_the_judge_detects_faults(command, code, errors, is_fault) -> None:
    assert bool(fault_of(Ended(code, errors), manners(command))) is is_fault


# A sample of the attacks with bags: each command shows the content, or one line with the reason.


BAG_SEED = 20261123

"""Another seed than the campaign's, whose findings are fixed."""

SAMPLE = sample_count(20, 8)


def test_changed_bags_cause_no_findings() -> None:
    tried, findings = attack(tries, SAMPLE, BAG_SEED, part=SAMPLE)
    assert findings == []
    assert tried.total() == SAMPLE * len(BAG_COMMANDS)


def test_equal_seeds_change_a_bag_equally(tmp_path: Path) -> None:
    made = []
    for name in ('one', 'other'):
        (tmp_path / name).mkdir()
        changes = change_bag(tmp_path / name, Random('6'))
        # The bytes differ: a bag holds the time at which it was made.
        made.append((changes, sorted(file.stat().st_size for file in (tmp_path / name).iterdir())))
    assert made[0] == made[1]


@pytest.mark.parametrize(
    ('end', 'fault'),
    [
        ((0, 'a table', ''), ''),
        ((2, '', 'linkage info: x: is damaged\n'), ''),
        ((2, '', 'linkage export: x: unfinished: killed\nlinkage export: x: is damaged\n'), ''),
        ((2, '', ''), '0 lines'),
        ((2, '', 'one\ntwo\n'), '2 lines'),
        ((0, '', ''), 'no output'),
        ((0, 'a\x1b[0m', ''), 'not printable'),
        ((2, '', 'x' * 331_000), 'a line of 331000 characters'),
        (('traceback', '', 'MemoryError'), 'MemoryError'),
        (('no end', '', 'more than 60 s'), 'more than 60 s'),
    ],
)
def test_judge_reports_bad_ends_of_commands(end: tuple[object, str, str], fault: str) -> None:
    code, stdout, stderr = end
    finding = fault_of(Ended(code, stderr, stdout), MANNERS)
    assert fault in finding
    assert bool(finding) == bool(fault)


def test_every_bag_command_is_attacked() -> None:
    assert set(BAG_COMMANDS) == {'info', 'report', 'export', 'plot'}
