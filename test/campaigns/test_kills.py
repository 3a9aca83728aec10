# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A sample of the kills campaign: the bag is good in every phase; no durations are judged."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import shutil

from campaigns.campaign import results_of
from campaigns.reliability import judge as judge_module
from campaigns.reliability.judge import FAULT
from campaigns.reliability.kills import (
    judge,
    kill,
    Marks,
    NO_FILE,
    NO_FOLDER,
    Outcome,
    PERIOD_NS,
    Plan,
    plans,
)
from campaigns.reliability.recording import message, Phase, TOPICS
from linkage_ros.bag import Bag, BagMessage, BagWriter, METADATA_FILE, Storage
import pytest

from ..support.sampling import sample_count

SEED = 20261121
"""Another seed than the campaign's."""

KILLS = AIMED = sample_count(12, 6)
MS = 1_000_000


@pytest.fixture(scope='module')
def outcomes() -> list[Outcome]:
    return list(results_of(kill, plans(SEED, KILLS, AIMED, (0.2, 1.2)), 3))


def test_a_killed_bag_begins_with_the_offered_messages(outcomes: list[Outcome]) -> None:
    assert [outcome.faults for outcome in outcomes] == [[]] * (KILLS + AIMED)


def test_kill_sample_covers_all_phases(
    outcomes: list[Outcome],
) -> None:
    recorded = [o for o in outcomes if Phase.MAKING < o.phase < Phase.CLOSED]
    assert len(recorded) > KILLS / 2
    assert sum(outcome.found for outcome in recorded) > 100
    assert any(outcome.loss for outcome in recorded)
    # The aims are reached: a phase that is never announced is killed after the close.
    reached = {outcome.phase for outcome in outcomes if outcome.plan.aim is Phase.SPLITTING}
    assert reached - {Phase.CLOSED}
    assert {outcome.plan.aim for outcome in outcomes} >= {
        Phase.MAKING,
        Phase.FLUSHING,
        Phase.SPLITTING,
        Phase.CLOSING,
    }


PLAN = Plan(0, Storage(flush_period=0.1), 100, Phase.MAKING, 1, 0.0)


@pytest.fixture
def marks() -> Marks:
    """Return marks of 100 ticks, 1 ms apart, the first at 1 s."""
    marks = Marks.make(PLAN.ticks)
    marks.enter(Phase.RECORDING)
    for tick in range(PLAN.ticks):
        marks.begin_tick()
        marks.times[tick] = 1000 * MS + tick * PERIOD_NS
    marks.offered = len(TOPICS) * PLAN.ticks
    return marks


def record(folder: Path, marks: Marks, count: int, storage: Storage | None = None) -> BagWriter:
    """Write and flush a number of messages, as a recording before its kill."""
    writer = BagWriter(folder, TOPICS, {}, storage)
    for index in range(count):
        writer.write(*message(index, marks.times[index // 2]))
    writer.flush()
    return writer


def test_loss_equals_age_of_the_oldest_missing_message(tmp_path: Path, marks: Marks) -> None:
    record(tmp_path / 'bag', marks, 120)
    marks.safe = 90
    outcome = judge(PLAN, tmp_path / 'bag', marks, 1105 * MS)
    assert outcome.faults == []
    assert (outcome.found, outcome.discarded) == (120, 0)
    # Message 120 was offered at 1060 ms, message 90 at 1045 ms.
    assert (outcome.loss, outcome.power_loss) == (45 * MS, 60 * MS)
    # The last tick began at 1099 ms, and then none for 6 ms.
    assert (outcome.tick, outcome.paused) == (6 * MS, 0)
    assert outcome.strict_excess == (45 - 100 - 1) * MS
    assert outcome.excess == (45 - 100 - 6) * MS


def test_messages_removed_by_the_ring_are_not_lost(tmp_path: Path, marks: Marks) -> None:
    record(tmp_path / 'bag', marks, 200, Storage(split_seconds=0.02, keep_files=2))
    outcome = judge(PLAN, tmp_path / 'bag', marks, 1100 * MS)
    # Files of 20 ticks; of the five the last two are kept.
    assert (outcome.discarded, outcome.found) == (120, 80)
    assert (outcome.faults, outcome.loss) == ([], 0)


def test_bag_not_yet_made_may_be_missing(tmp_path: Path) -> None:
    marks = Marks.make(1)
    marks.enter(Phase.MAKING)
    assert judge(PLAN, tmp_path / 'bag', marks, 0).verdicts == {'bag': NO_FOLDER}
    (tmp_path / 'bag').mkdir()
    (tmp_path / 'bag' / 'bag_0.mcap').touch()
    outcome = judge(PLAN, tmp_path / 'bag', marks, 0)
    assert (outcome.verdicts['bag'], outcome.faults) == (NO_FILE, [])
    marks.enter(Phase.RECORDING)
    outcome = judge(PLAN, tmp_path / 'bag', marks, 0)
    assert outcome.verdicts['bag'] == f'{FAULT}no complete file, although recording had begun'


def _counts_more(folder: Path) -> None:
    file = folder / METADATA_FILE
    file.write_text(file.read_text().replace('message_count: 0', 'message_count: 121'))


def _names_another(folder: Path) -> None:
    file = folder / METADATA_FILE
    file.write_text(file.read_text().replace('bag_0.mcap', 'bag_1.mcap'))


def _empty(folder: Path) -> None:
    shutil.rmtree(folder)
    folder.mkdir()


BROKEN: dict[str, tuple[Callable[[Path], None], str]] = {
    'metadata truncated': (lambda f: (f / METADATA_FILE).write_text('a: ['), 'metadata'),
    'no metadata': (lambda f: (f / METADATA_FILE).unlink(), 'metadata'),
    'metadata counts too many messages': (_counts_more, 'metadata'),
    'metadata names a missing file': (_names_another, 'metadata'),
    'an empty folder': (_empty, 'bag'),
    'no folder': (shutil.rmtree, 'bag'),
}


@pytest.mark.parametrize('name', BROKEN)
def test_the_judge_detects_broken_bags(tmp_path: Path, marks: Marks, name: str) -> None:
    record(tmp_path / 'bag', marks, 120)
    break_bag, part = BROKEN[name]
    break_bag(tmp_path / 'bag')
    outcome = judge(PLAN, tmp_path / 'bag', marks, 1100 * MS)
    assert outcome.verdicts[part].startswith(FAULT)


FALSE: dict[str, Callable[[list[BagMessage]], list[BagMessage]]] = {
    'another byte': lambda true: [*true[:-1], true[-1]._replace(data=b'\0')],
    'another order': lambda true: [true[1], true[0], *true[2:]],
    'one twice': lambda true: [*true, true[-1]],
    'a gap': lambda true: [*true[:5], *true[6:]],
    'the first is missing': lambda true: true[1:],
    'another time': lambda true: [true[0]._replace(log_time=1), *true[1:]],
    'less than was flushed': lambda true: true[:99],
}


@pytest.mark.parametrize('name', FALSE)
def test_the_judge_detects_false_messages(
    tmp_path: Path, marks: Marks, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    record(tmp_path / 'bag', marks, 120)
    marks.safe = 100
    whole = Bag.messages
    monkeypatch.setattr(Bag, 'messages', lambda bag: FALSE[name](list(whole(bag))))
    outcome = judge(PLAN, tmp_path / 'bag', marks, 1100 * MS)
    assert outcome.verdicts['bag'].startswith(FAULT)


def test_the_judge_detects_a_wrong_recovery(
    tmp_path: Path, marks: Marks, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(tmp_path / 'bag', marks, 120)

    def recover(_: Path, target: Path) -> None:
        record(target, marks, 119).close()

    monkeypatch.setattr(judge_module, 'recover_bag', recover)
    outcome = judge(PLAN, tmp_path / 'bag', marks, 1100 * MS)
    assert outcome.faults == [f'recovered: {FAULT}other messages']


def test_an_incomplete_closed_bag_is_a_fault(tmp_path: Path, marks: Marks) -> None:
    record(tmp_path / 'bag', marks, 199).close()
    marks.enter(Phase.CLOSED)
    outcome = judge(PLAN, tmp_path / 'bag', marks, 1100 * MS)
    assert outcome.verdicts['bag'] == f'{FAULT}finished, but incomplete'


def test_pauses_count_within_the_interval() -> None:
    marks = Marks.make(1)
    for _ in range(300):
        marks.enter(Phase.FLUSHING)
        marks.enter(Phase.RECORDING)
    begin = marks.enter(Phase.SPLITTING)
    # The last pause has not ended; it lasts until the kill.
    assert marks.paused(begin, begin + 7 * MS) == 7 * MS
    assert marks.paused(begin + 5 * MS, begin + 7 * MS) == 2 * MS
    assert 0 < marks.paused(0, begin) < begin
