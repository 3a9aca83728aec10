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


"""A sample of the damage campaign, of every kind of bag: no verdict is a fault."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from campaigns.damage import run as judge_module
from campaigns.damage.run import (
    FAULT,
    judge_reading,
    judge_salvage,
    JUDGES,
    KILLED,
    KINDS,
    make,
    parts,
    run,
    Tally,
)
from linkage_ros.bag.reader import Bag, BagMessage
import pytest

SEED = 20261121
"""Not the campaign's own: its findings went into the code."""

SAMPLE = 250
SIZE = 40_000


@pytest.fixture(scope='module')
def tally() -> Tally:
    tally = Tally()
    for _, judged in run(parts([*KINDS], SEED, SIZE, SAMPLE), jobs=1):
        tally.add(judged)
    return tally


def test_damage_is_found_or_does_no_harm(tally: Tally) -> None:
    assert tally.faults == []
    assert sum(tally.verdicts.values()) == len(KINDS) * 2 * SAMPLE * len(JUDGES)


def test_the_sample_has_seen_all_there_is_to_see(tally: Tally) -> None:
    own = Counter[tuple[str, str, str]]()
    for (kind, *rest), count in tally.verdicts.items():
        if kind == 'own':
            own[tuple(rest)] += count
    assert own['cut', 'read', 'refused'] == SAMPLE
    assert own['cut', 'read, truncated allowed', 'a part, says so'] > SAMPLE / 2
    assert own['flip', 'read', 'a part, says so'] > SAMPLE / 4
    assert own['flip', 'recover', 'a part, says so'] > SAMPLE / 4
    assert own['flip', 'recover', 'all, says nothing'] > SAMPLE / 50


def test_no_single_bit_takes_all_of_a_killed_bag(tally: Tally) -> None:
    found = {
        verdict: count
        for (kind, damage, judge, verdict), count in tally.verdicts.items()
        if (kind, damage, judge) == (KILLED, 'flip', 'recover')
    }
    assert sum(found.values()) == SAMPLE
    assert 'none, says so' not in found


FALSE = {
    # what a reader gives instead of the true messages, and the verdict on it
    'a false message': lambda true: [*true[:-1], true[-1]._replace(data=b'\0')],
    'a false message ': lambda true: [true[1], true[0], *true[2:]],
    'a false message  ': lambda true: [*true, true[0]],
    'a part, and says nothing': lambda true: true[:-1],
    'none, and says nothing': lambda true: [],
}


@pytest.mark.parametrize('verdict', FALSE)
def test_the_judge_sees_what_is_false(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, verdict: str
) -> None:
    subject = make('own', tmp_path / 'run', SEED, SIZE)

    def messages(bag: Bag) -> list[BagMessage]:
        return FALSE[verdict](subject.messages)

    monkeypatch.setattr(Bag, 'messages', messages)
    assert judge_reading(subject, allow_truncated=False) == FAULT + verdict.strip()


def test_the_judge_sees_what_is_raised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    subject = make('own', tmp_path / 'run', SEED, SIZE)

    def stumble(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(Bag, 'messages', stumble)
    monkeypatch.setattr(judge_module, 'Salvage', stumble)
    assert judge_reading(subject, allow_truncated=False) == f'{FAULT}ZeroDivisionError'
    assert judge_salvage(subject) == f'{FAULT}ZeroDivisionError'
