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


"""A sample of the kills campaign: whatever a recording was at, its bag is good; no time judged."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import shutil

from campaigns.kills import run as judge_module
from campaigns.kills.plan import Marks, message, PERIOD_NS, Phase, Plan, plans, TOPICS
from campaigns.kills.run import FAULT, judge, NO_FILE, NO_FOLDER, Outcome, run
from linkage_ros.bag.metadata import METADATA_FILE
from linkage_ros.bag.reader import Bag, BagMessage
from linkage_ros.bag.storage import Storage
from linkage_ros.bag.writer import BagWriter
import pytest

SEED = 20261121
"""Not the campaign's own."""

KILLS, AIMED = 12, 12
MS = 1_000_000


@pytest.fixture(scope='module')
def outcomes() -> list[Outcome]:
    return list(run(plans(SEED, KILLS, AIMED, (0.2, 1.2)), jobs=3))


def test_what_a_kill_leaves_is_the_beginning_of_what_was_offered(outcomes: list[Outcome]) -> None:
    assert [outcome.faults for outcome in outcomes] == [[]] * (KILLS + AIMED)


def test_the_sample_has_seen_recordings_that_were_killed_and_some_of_each_verdict(
    outcomes: list[Outcome],
) -> None:
    recorded = [o for o in outcomes if Phase.MAKING < o.phase < Phase.CLOSED]
    assert len(recorded) > KILLS / 2
    assert sum(outcome.found for outcome in recorded) > 100
    assert any(outcome.loss for outcome in recorded)
    assert {outcome.plan.aim for outcome in outcomes} >= {
        Phase.MAKING,
        Phase.FLUSHING,
        Phase.SPLITTING,
        Phase.CLOSING,
    }


PLAN = Plan(0, Storage(flush_period=0.1), 100, Phase.MAKING, 1, 0.0)


@pytest.fixture
def marks(tmp_path: Path) -> Marks:
    """Return marks of 100 ticks that were begun, 1 ms apart from 1 s on."""
    marks = Marks.make(tmp_path / 'marks', PLAN.ticks)
    marks.enter(Phase.RECORDING)
    for tick in range(PLAN.ticks):
        marks.begin_tick()
        marks.times[tick] = 1000 * MS + tick * PERIOD_NS
    marks.offered = len(TOPICS) * PLAN.ticks
    return marks


def record(folder: Path, marks: Marks, count: int, storage: Storage | None = None) -> BagWriter:
    """Write so many messages and flush them, as a recording that is killed then."""
    writer = BagWriter(folder, TOPICS, {}, storage)
    for number in range(count):
        writer.write(*message(number, marks.times[number // 2]))
    writer.flush()
    return writer


def test_the_age_of_what_is_missing_is_the_loss(tmp_path: Path, marks: Marks) -> None:
    record(tmp_path / 'bag', marks, 120)
    marks.safe = 90
    outcome = judge(PLAN, tmp_path / 'bag', marks, 1105 * MS)
    assert outcome.faults == []
    assert (outcome.found, outcome.let_go) == (120, 0)
    # Message 120 was offered at 1060 ms, message 90 at 1045 ms.
    assert (outcome.loss, outcome.power_loss) == (45 * MS, 60 * MS)
    # The last tick began at 1099 ms, and then none for 6 ms.
    assert (outcome.tick, outcome.paused) == (6 * MS, 0)
    assert outcome.strict_excess == (45 - 100 - 1) * MS
    assert outcome.excess == (45 - 100 - 6) * MS


def test_what_made_way_in_a_ring_is_not_missing(tmp_path: Path, marks: Marks) -> None:
    record(tmp_path / 'bag', marks, 200, Storage(split_seconds=0.02, keep_files=2))
    outcome = judge(PLAN, tmp_path / 'bag', marks, 1100 * MS)
    # Files of 20 ticks; of the five the last two are kept.
    assert (outcome.let_go, outcome.found) == (120, 80)
    assert (outcome.faults, outcome.loss) == ([], 0)


def test_nothing_is_expected_of_a_bag_that_is_not_yet_made(tmp_path: Path) -> None:
    marks = Marks.make(tmp_path / 'marks', 1)
    marks.enter(Phase.MAKING)
    assert judge(PLAN, tmp_path / 'bag', marks, 0).verdicts == {'bag': NO_FOLDER}
    (tmp_path / 'bag').mkdir()
    (tmp_path / 'bag' / 'bag_0.mcap').touch()
    outcome = judge(PLAN, tmp_path / 'bag', marks, 0)
    assert (outcome.verdicts['bag'], outcome.faults) == (NO_FILE, [])
    marks.enter(Phase.RECORDING)
    outcome = judge(PLAN, tmp_path / 'bag', marks, 0)
    assert outcome.verdicts['bag'] == f'{FAULT}nothing whole, although it had begun'


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
    'metadata cut': (lambda f: (f / METADATA_FILE).write_text('a: ['), 'metadata'),
    'no metadata': (lambda f: (f / METADATA_FILE).unlink(), 'metadata'),
    'metadata counts more than is there': (_counts_more, 'metadata'),
    'metadata names a file that is not there': (_names_another, 'metadata'),
    'an empty folder': (_empty, 'bag'),
    'no folder': (shutil.rmtree, 'bag'),
}


@pytest.mark.parametrize('name', BROKEN)
def test_the_judge_sees_what_is_broken(tmp_path: Path, marks: Marks, name: str) -> None:
    record(tmp_path / 'bag', marks, 120)
    do, what = BROKEN[name]
    do(tmp_path / 'bag')
    outcome = judge(PLAN, tmp_path / 'bag', marks, 1100 * MS)
    assert outcome.verdicts[what].startswith(FAULT)


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
def test_the_judge_sees_what_is_false(
    tmp_path: Path, marks: Marks, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    record(tmp_path / 'bag', marks, 120)
    marks.safe = 100
    whole = Bag.messages
    monkeypatch.setattr(Bag, 'messages', lambda bag: FALSE[name](list(whole(bag))))
    outcome = judge(PLAN, tmp_path / 'bag', marks, 1100 * MS)
    assert outcome.verdicts['bag'].startswith(FAULT)


def test_the_judge_sees_what_is_recovered_otherwise(
    tmp_path: Path, marks: Marks, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(tmp_path / 'bag', marks, 120)

    def recover(_: Path, target: Path) -> None:
        record(target, marks, 119).close()

    monkeypatch.setattr(judge_module, 'recover', recover)
    outcome = judge(PLAN, tmp_path / 'bag', marks, 1100 * MS)
    assert outcome.faults == [f'recovered: {FAULT}other messages']


def test_a_closed_bag_that_lacks_something_is_a_fault(tmp_path: Path, marks: Marks) -> None:
    record(tmp_path / 'bag', marks, 199).close()
    marks.enter(Phase.CLOSED)
    outcome = judge(PLAN, tmp_path / 'bag', marks, 1100 * MS)
    assert outcome.verdicts['bag'] == f'{FAULT}finished, but not all'


def test_pauses_count_as_far_as_they_fall_into_a_time(tmp_path: Path) -> None:
    marks = Marks.make(tmp_path / 'marks', 1)
    for _ in range(300):
        with marks.pause(Phase.FLUSHING):
            pass
    begin = marks.enter(Phase.SPLITTING)
    # The last one has not ended: it lasts until the kill.
    assert marks.paused(begin, begin + 7 * MS) == 7 * MS
    assert marks.paused(begin + 5 * MS, begin + 7 * MS) == 2 * MS
    assert 0 < marks.paused(0, begin) < begin
