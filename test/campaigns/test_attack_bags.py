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


"""A sample of the attacks with bags: each command tells what it can, or why not in a line."""

from __future__ import annotations

from pathlib import Path
from random import Random

from campaigns.attacks.bags import attack, changed, COMMANDS, judged
from campaigns.in_process import Ended
import pytest

SEED = 20261123
"""Not the campaign's own: its findings went into the code."""

SAMPLE = 20


def test_changed_bags_are_told_in_time_and_within_memory() -> None:
    tried, findings = attack(SAMPLE, SEED)
    assert findings == []
    assert sum(tried.values()) == SAMPLE * len(COMMANDS)


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
    assert set(COMMANDS) == {'info', 'report', 'export', 'plot'}
