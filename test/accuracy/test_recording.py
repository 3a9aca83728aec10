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


"""Cost of recording: the counts of real runs agree, and figures equal those computed by hand."""

from collections import Counter

from linkage_ros.accuracy import recording
from linkage_ros.accuracy.recorded_run import Flush, record_run, Recorded
from linkage_ros.accuracy.recording import Cost, cost_of, measure_costs, measure_recording, part_of
from linkage_ros.bag.storage import Storage
from linkage_ros.kinematics.closure import Closure
from linkage_ros.measuring import Spread
from linkage_ros.resources import shipped
from linkage_ros.scene.load import load_scene
from mcap.reader import make_reader
import pytest

MS = 1_000_000
FLUSHED_OFTEN = Storage(flush_period=0.05)
PACKED = Storage(flush_period=0.05, compression='zstd')


@pytest.fixture
def scene_at(tmp_path):
    """Return a function that loads a scene: a crank in, joint states and ~/motion out."""

    def load(rate):
        file = tmp_path / 'scene.yaml'
        linkage = shipped('linkages/four_bar.yaml')
        file.write_text(f'linkage: {linkage}\nrate: {rate}\neffects: {{acceleration: {{}}}}\n')
        return load_scene(file)

    return load


@pytest.fixture
def run(scene_at, tmp_path):
    """Return a function that records a run of a scene into tmp_path/bag."""

    def run(rate, storage, seconds):
        scene = scene_at(rate)
        closures = [Closure(member.linkage) for member in scene.members]
        return record_run(scene, closures, storage and tmp_path / 'bag', storage, seconds)

    return run


@pytest.mark.parametrize('storage', [FLUSHED_OFTEN, PACKED], ids=['not packed', 'zstd'])
def test_the_account_of_a_run_is_that_of_its_bag(run, tmp_path, storage):
    found = run(500, storage, 0.3)
    assert found.dropped == 0
    assert found.received == found.recorded == 3 * len(found.ticks)
    (file,) = (tmp_path / 'bag').glob('*.mcap')
    with file.open('rb') as stream:
        messages = [
            (channel.topic, len(message.data))
            for _, channel, message in make_reader(stream).iter_messages()
        ]
    ticks = len(found.ticks)
    topics = Counter(topic for topic, _ in messages)
    assert topics == {'crank_states': ticks, '/joint_states': ticks, '/node/motion': ticks}
    assert found.size < file.stat().st_size
    if storage is FLUSHED_OFTEN:
        # In a chunk a message has 31 bytes of its own, in the index behind it 16.
        assert found.size > sum(size + 31 + 16 for _, size in messages)


def test_a_run_is_as_long_as_asked_for_and_flushed_in_each_period(run):
    found = run(1000, FLUSHED_OFTEN, 0.3)
    assert found.seconds >= 0.3
    assert 1 <= len(found.flushes) <= found.seconds / 0.045 + 1
    for flush in found.flushes:
        assert flush.end > flush.begin
        # By a clock that is read once more, a few microseconds later.
        assert flush.stake >= 44 * MS
        assert 0 < flush.cpu < found.cpu
    for before, after in zip(found.flushes[:-1], found.flushes[1:], strict=True):
        assert after.stake == after.end - before.begin


@pytest.mark.parametrize(('rate', 'ticked_at'), [(100, 100), (1000, 1000), (5000, 1000)])
def test_ticks_come_at_the_rate_of_the_scene_up_to_a_thousand(run, rate, ticked_at):
    found = run(rate, FLUSHED_OFTEN, 0.2)
    # None before it is due; one after the end.
    assert 1 < len(found.ticks) <= found.seconds * ticked_at + 1
    assert min(found.ticks) >= 0


def test_a_run_without_a_flush_goes_on_until_there_is_one(run):
    found = run(500, Storage(flush_period=0.25), 0.2)
    assert found.flushes
    # The flush begins 0.225 s after its writer, which begins before the first tick.
    assert found.seconds > 0.21


def test_without_a_bag_there_are_ticks_only(run, tmp_path):
    found = run(500, None, 0.1)
    assert found.ticks
    assert (found.received, found.cpu, found.size, found.flushes) == (0, 0, 0, ())
    assert not (tmp_path / 'bag').exists()


def test_costs_by_hand():
    # 1000 messages in 2 s. Writing them took 8 ms, two flushes 1 ms each and 3 ms with the wait:
    # a flush comes every 0.36 s, which is 180 messages.
    flush = Flush(0, 3 * MS, 1 * MS, 410 * MS)
    run = Recorded(
        seconds=2.0,
        ticks=tuple(range(0, 1_001_000, 1000)),
        received=1000,
        recorded=990,
        dropped=10,
        cpu=10 * MS,
        flushes=(flush, flush._replace(end=5 * MS, stake=430 * MS)),
        written=(90_000, 1.8),
        size=99_000,
    )
    cost = cost_of(Storage(flush_period=0.4), [run, run])
    assert cost.cpu.middle == pytest.approx(8.0 + 1000 / 180)
    assert cost.waited.middle == pytest.approx((2.0 + 4.0) / 2 / 0.36)
    assert cost.waits == pytest.approx((3.0, 4.0))
    assert cost.stake == pytest.approx((430.0, 430.0, 430.0))
    assert cost.stake_messages == pytest.approx(0.43 * 500)
    assert cost.written == pytest.approx((50.0, 50.0, 50.0))
    assert cost.size.middle == 100.0
    assert (cost.late.middle, cost.late_p99.middle) == (500.0, 990.0)
    assert cost.dropped == 20


def test_a_scene_that_says_nothing_costs_nothing():
    silent = Recorded(1.0, (0,), 0, 0, 0, 10, (Flush(0, 1 * MS, 0, 1 * MS),), None, 500)
    assert cost_of(FLUSHED_OFTEN, [silent]).cpu.middle == 0.0


def cost(period, compression='none', cpu=10.0, size=100.0):
    """Return a cost: at stake is the period, and 1000 messages a second."""

    def one(value):
        return Spread(value, value, value)

    return Cost(
        Storage(flush_period=period, compression=compression), one(cpu), one(5.0), (1.0, 2.0),
        one(1e3 * period), 1e3 * period, None, one(size), one(80.0), one(200.0), 0,
    )  # fmt: skip


def test_advice_is_the_cheapest_that_is_safe_enough(scene_at):
    costs = [
        cost(0.05, cpu=30.0),
        cost(0.1, cpu=20.0),
        cost(0.5, cpu=10.5),
        cost(2.0, cpu=10.0),
        cost(0.5, 'zstd', cpu=12.0, size=25.0),
    ]
    tenth, second, five, near, packed = part_of(scene_at(1000), costs).advice
    assert tenth.startswith(
        'To lose at most 0.1 s to a power cut: flush_period: 0.1; at worst 100 ms'
    )
    assert second.startswith('To lose at most 1 s to a power cut: flush_period: 0.5; ')
    assert five.startswith('To lose at most 5 s to a power cut: flush_period: 2; ')
    assert near.startswith('flush_period: 0.5 is the shortest period')
    assert packed.startswith('compression: zstd makes the bag 4.0 times smaller; ')
    assert '12.0 µs of processor time, not packed 10.5 µs' in packed


def test_the_headline_is_that_of_the_setting_of_the_scene(scene_at):
    scene = scene_at(1000)
    costs = [cost(0.5, cpu=20.0), cost(1.0, 'zstd', cpu=15.0), cost(1.0), cost(2.0, cpu=9.0)]
    part = part_of(scene, costs)
    assert part.headline == 'Recording costs 10 µs a message and may lose 1 s in a crash.'
    assert part.clause == 'recording costs 10 µs a message and may lose 1 s in a crash'
    assert 'zstd' in part.sentences[1]


def test_what_no_period_keeps_safe_is_said(scene_at):
    first, *_ = part_of(scene_at(1000), [cost(0.5), cost(2.0)]).advice
    assert first == 'No flush period here keeps what a power cut may take below 0.1 s.'


def test_the_share_of_a_core_is_the_time_of_all_messages_of_a_second(scene_at):
    (table,) = part_of(scene_at(1000), [cost(0.5, cpu=20.0)]).tables
    row = dict(zip(table.columns, table.rows[0], strict=True))
    assert row['of a core [%]'] == pytest.approx(2.0)


def test_settings_take_turns_and_nothing_is_left_behind(scene_at, tmp_path, monkeypatch):
    made = []

    def recorded(scene, closures, folder, storage, seconds):
        made.append((folder and folder.parent.parent, storage.flush_period, seconds))
        return Recorded(0.3, (0,), 1, 1, 0, 1, (Flush(0, 1, 1, 1),), None, 1)

    monkeypatch.setattr(recording, 'record_run', recorded)
    compared = [None, FLUSHED_OFTEN, Storage(flush_period=2.0)]
    here = sorted(tmp_path.iterdir())
    measure_costs(scene_at(500), tmp_path, compared, 0.3, 2)
    one_way = [(None, 1.0, 0.3), (tmp_path, 0.05, 0.3), (tmp_path, 2.0, 2.2)]
    assert made == [*one_way, *reversed(one_way)]
    assert sorted(tmp_path.iterdir()) == sorted({*here, tmp_path / 'scene.yaml'})


def test_a_part_of_the_page(scene_at, tmp_path, monkeypatch):
    monkeypatch.setattr(recording, 'QUICK_PERIODS', (0.05, 0.2))
    monkeypatch.setattr(recording, 'QUICK_PACKED_AT', 0.2)
    told = []
    part = measure_recording(scene_at(500), tmp_path, True, told.append)
    (table,) = part.tables
    assert [row[0] for row in table.rows] == [
        'no bag',
        'flush_period: 0.05',
        'flush_period: 0.2',
        'flush_period: 0.2, compression: lz4',
        'flush_period: 0.2, compression: zstd',
        'flush_period: 1',
    ]
    assert all(len(row) == len(table.columns) for row in table.rows)
    rows = [dict(zip(table.columns, row, strict=True)) for row in table.rows[1:]]
    assert [row['dropped [messages]'] for row in rows] == [0] * 5
    *plain, lz4, zstd, default = (row['in the bag [bytes/message]'].high for row in rows)
    assert min(*plain, default) > max(lz4, zstd), 'half of a message is names and zeros'
    stakes = [row['a power cut may take [ms]'].low for row in rows]
    assert all(at >= 900 * p for at, p in zip(stakes, (0.05, 0.2, 0.2, 0.2, 1.0), strict=True))
    for diagram in part.diagrams:
        assert [(c.name, len(c.points)) for c in diagram.curves] == [
            ('not packed', 3),
            ('lz4', 1),
            ('zstd', 1),
        ]
    assert part.key == 'recording'
    assert told[0] == 0.0
    assert told[-1] == 1.0
    assert told == sorted(told)
    assert [path.name for path in tmp_path.iterdir()] == ['scene.yaml']
