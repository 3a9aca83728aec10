# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A sample of the damage campaign, of every kind of bag: no verdict is a fault."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from campaigns.reliability import damage as judge_module
from campaigns.reliability.damage import (
    judge_reading,
    judge_salvage,
    JUDGES,
    make,
    parts,
    run_parts,
    Tally,
)
from campaigns.reliability.judge import FAULT
from campaigns.reliability.recording import KILLED, OURS, WRITERS
from linkage_ros.bag import Bag, BagMessage
import pytest

from ..support.sampling import sample_count

SEED = 20261121
"""Another seed than the campaign's, whose findings are fixed."""

SAMPLE = sample_count(250, 40)
SIZE = 40_000


@pytest.fixture(scope='module')
def tally() -> Tally:
    tally = Tally()
    for _, judged in run_parts(parts([*WRITERS], SEED, SIZE, SAMPLE), jobs=1):
        tally.add(judged)
    return tally


def test_damage_is_reported_or_harmless(tally: Tally) -> None:
    assert tally.faults == []
    assert sum(tally.verdicts.values()) == len(WRITERS) * 2 * SAMPLE * len(JUDGES)


@pytest.mark.sample(0)
def test_damage_sample_contains_every_usual_verdict(tally: Tally) -> None:
    ours = Counter[tuple[str, str, str]]()
    for (kind, *rest), count in tally.verdicts.items():
        if kind == OURS:
            ours[tuple(rest)] += count
    assert ours['cut', 'read', 'refused'] == SAMPLE
    assert ours['cut', 'read, truncated allowed', 'a part, damage reported'] > SAMPLE / 2
    assert ours['flip', 'read', 'a part, damage reported'] > SAMPLE / 4
    assert ours['flip', 'recover', 'a part, damage reported'] > SAMPLE / 4
    assert ours['flip', 'recover', 'all, nothing reported'] > SAMPLE / 50


def test_single_bit_never_loses_all_of_a_killed_bag(tally: Tally) -> None:
    verdicts = {
        verdict: count
        for (kind, damage, judge, verdict), count in tally.verdicts.items()
        if (kind, damage, judge) == (KILLED, 'flip', 'recover')
    }
    assert sum(verdicts.values()) == SAMPLE
    assert 'none, damage reported' not in verdicts


FALSE = {
    # The verdict on a wrong reader, and the messages that it returns instead of the true ones.
    'a false message': lambda true: [*true[:-1], true[-1]._replace(data=b'\0')],
    'a false message ': lambda true: [true[1], true[0], *true[2:]],
    'a false message  ': lambda true: [*true, true[0]],
    'a part, nothing reported': lambda true: true[:-1],
    'none, nothing reported': lambda true: [],
}


@pytest.mark.parametrize('verdict', FALSE)
def test_the_judge_detects_false_messages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, verdict: str
) -> None:
    subject = make(OURS, tmp_path / 'run', SEED, SIZE)

    def messages(bag: Bag) -> list[BagMessage]:
        return FALSE[verdict](subject.messages)

    monkeypatch.setattr(Bag, 'messages', messages)
    assert judge_reading(subject, allow_truncated=False) == FAULT + verdict.strip()


def test_the_judge_detects_exceptions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    subject = make(OURS, tmp_path / 'run', SEED, SIZE)

    def stumble(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(Bag, 'messages', stumble)
    monkeypatch.setattr(judge_module, 'Salvage', stumble)
    assert judge_reading(subject, allow_truncated=False) == f'{FAULT}ZeroDivisionError'
    assert judge_salvage(subject) == f'{FAULT}ZeroDivisionError'
