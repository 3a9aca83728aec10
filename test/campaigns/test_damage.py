# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A sample of the damage campaign, of every kind of bag: no verdict is a fault."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from campaigns.campaign import Tallies, tallies_of
from campaigns.reliability import damage as judge_module
from campaigns.reliability.damage import (
    DAMAGES,
    judge_part,
    judge_reading,
    judge_salvage,
    JUDGES,
    make,
    parts,
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
def tallies() -> Tallies:
    samples = dict.fromkeys(WRITERS, SAMPLE)
    judge = partial(judge_part, SIZE, samples)
    return tallies_of(judge, parts(SEED, SIZE, samples), jobs=1)


def test_damage_is_reported_or_harmless(tallies: Tallies) -> None:
    for damage in DAMAGES:
        for tally in tallies[damage].values():
            assert tally.findings() == []
            verdicts = [tally.counts[name] for name in tally.counts if ': ' in name]
            assert sum(verdicts) == SAMPLE * len(JUDGES)


@pytest.mark.sample(0)
def test_damage_sample_contains_every_usual_verdict(tallies: Tallies) -> None:
    cut, flip = (tallies[damage][OURS].counts for damage in DAMAGES)
    assert cut['read: refused'] == SAMPLE
    assert cut['read, truncated allowed: a part, damage reported'] > SAMPLE / 2
    assert flip['read: a part, damage reported'] > SAMPLE / 4
    assert flip['recover: a part, damage reported'] > SAMPLE / 4
    assert flip['recover: all, nothing reported'] > SAMPLE / 50


def test_single_bit_never_loses_all_of_a_killed_bag(tallies: Tallies) -> None:
    counts = tallies['flip'][KILLED].counts
    assert sum(counts[name] for name in counts if name.startswith('recover: ')) == SAMPLE
    assert 'recover: none, damage reported' not in counts


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
