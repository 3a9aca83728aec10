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

"""A sample of the attacks: each is answered, or refused in a line."""

from __future__ import annotations

from pathlib import Path
import random
from random import Random

from campaigns.attacks import files, signals
from campaigns.attacks.bags import attack, changed, judged
from campaigns.attacks.bags import COMMANDS as BAG_COMMANDS
from campaigns.attacks.files import mutated
from campaigns.in_process import Ended
from linkage_ros.cli.main import COMMANDS
import pytest

# A sample of the attacks: no traceback, no hang, no long output; and the judge detects them.


SEED = 20261122


"""Not the campaign's own."""


def test_changed_files_are_answered() -> None:
    tried, findings = files.attack(60, SEED)
    assert findings == []
    assert sum(tried.values()) == 60
    assert any(how.endswith(': 0') for how in tried)
    assert any(how.endswith(': 2') for how in tried)


def test_every_command_that_takes_a_linkage_gets_changed_ones() -> None:
    without = {
        'demo',
        'play',
        'plot',
        'info',
        'report',
        'export',
        'recover',
        'import',
        'synthesize',
    }
    assert set(files.COMMANDS) == set(COMMANDS) - without


def test_signals_end_commands() -> None:
    tried, findings = signals.attack(6, SEED)
    assert findings == []
    assert sum(tried.values()) == 6


def test_files_are_changed_in_many_ways() -> None:
    original = b'links: {ground: {A: [0, 0], B: [0.1, 0]}}\ninput: {joint: j}\n'
    found = {mutated(original, random.Random(number))[1] for number in range(300)}
    assert len(found) > 200
    assert sum(b'5e-324' in one for one in found) > 1


@pytest.mark.parametrize(
    ('command', 'code', 'said', 'found'),
    [
        ('check', 0, '', False),
        ('check', 2, 'linkage check: x: is wrong; correct it\n', False),
        ('scene', 2, 'linkage scene: one\nlinkage scene: other\n', False),
        ('synthesize', 1, '', False),
        (
            'replay',
            0,
            'linkage replay: nothing to compare with: bag: carries no run.json\n',
            False,
        ),
        ('accuracy', 0, 'accuracy of x: 4 of 30\n', False),
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
def test_the_judge_knows_an_end_that_must_not_be(command, code, said, found) -> None:
    assert bool(files.judged(command, code, said)) is found


# A sample of the attacks with bags: each command shows what it can read, or one line with why not.


BAG_SEED = 20261123


"""Not the campaign's own: its findings went into the code."""


SAMPLE = 20


def test_changed_bags_are_told_in_time_and_within_memory() -> None:
    tried, findings = attack(SAMPLE, BAG_SEED)
    assert findings == []
    assert sum(tried.values()) == SAMPLE * len(BAG_COMMANDS)


def test_the_same_seed_changes_a_bag_alike(tmp_path: Path) -> None:
    made = []
    for name in ('one', 'other'):
        (tmp_path / name).mkdir()
        done = changed(tmp_path / name, Random('6'))
        # The bytes are others: a bag says when it was made.
        made.append((done, sorted(file.stat().st_size for file in (tmp_path / name).iterdir())))
    assert made[0] == made[1]


@pytest.mark.parametrize(
    ('end', 'wrong'),
    [
        ((0, 'a table', ''), ''),
        ((2, '', 'linkage info: x: is damaged\n'), ''),
        ((2, '', 'linkage export: x: unfinished: killed\nlinkage export: x: is damaged\n'), ''),
        ((2, '', ''), '0 lines'),
        ((2, '', 'one\ntwo\n'), '2 lines'),
        ((0, '', ''), 'nothing is told'),
        ((0, 'a\x1b[0m', ''), 'not printable'),
        ((2, '', 'x' * 331_000), 'a line of 331000 letters'),
        (('traceback', '', 'MemoryError'), 'MemoryError'),
        (('no end', '', 'more than 60 s'), 'more than 60 s'),
    ],
)
def test_what_must_not_be_is_a_finding(end: tuple[object, str, str], wrong: str) -> None:
    code, shown, said = end
    found = judged(Ended(code, said, shown))
    assert wrong in found
    assert bool(found) == bool(wrong)


def test_every_command_that_only_looks_is_tried() -> None:
    assert set(BAG_COMMANDS) == {'info', 'report', 'export', 'plot'}
