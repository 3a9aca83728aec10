# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A sample of the endurance campaign, and its judgement of synthetic series."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
import shutil
from subprocess import PIPE, Popen
import sys

from campaigns.reliability.accelerated import Plan, run_all
from campaigns.reliability.endurance import run_over_dds
from campaigns.reliability.judge import shortcomings
from campaigns.reliability.memory import flatness, MOST_GROWTH, Usage, usage
from linkage_ros.bag import BagWriter, Topic, TopicCounts
import pytest

MINUTES = 15.0 / 60.0  # h


@pytest.mark.sample(1)
@pytest.mark.parametrize('scene', ['demo', 'excavator_delay', 'worn_press'])
def test_memory_stays_flat_over_15_minutes(scene: str) -> None:
    # A process of its own: memory freed by other tests would hide growth.
    [done] = run_all([Plan(scene, MINUTES / (3 if scene == 'worn_press' else 1), 100.0)], 1)
    assert done.faults == []
    assert flatness(done.samples).flat
    counts = done.summary.topics[0]
    assert counts.received == done.published > 0
    assert counts.discarded > 0


@pytest.mark.ros
@pytest.mark.skipif(find_spec('rclpy') is None, reason='rclpy is not installed')
def test_a_run_over_dds_counts_its_messages_and_replays() -> None:
    done = run_over_dds(6.0 / 60.0)
    assert done.faults == []
    assert done.replayed['verdict'] == 'identical'
    assert done.counts['recorded']['/joint_states'] > 0
    assert len(done.samples) > 20
    growth = flatness(done.samples)
    assert (growth.files, growth.threads) == (0, 0)


def series(memory, files=lambda _: 8, threads=lambda _: 2) -> list[Usage]:
    """Return 101 samples of a run of 100 s."""
    return [Usage(float(t), round(memory(t)), files(t), threads(t)) for t in range(101)]


SERIES = {
    # usage over time, and whether it is flat
    'the same': (series(lambda t: 30_000), True),
    'more at first': (series(lambda t: 30_000 + 5000 * min(t, 20) / 20), True),
    'a peak': (series(lambda t: 30_000 + 50_000 * (t == 60)), True),
    'up and down': (series(lambda t: 30_000 + 4000 * (t % 2)), True),
    'a little more': (series(lambda t: 30_000 + 0.9 * MOST_GROWTH * t / 75), True),
    'more and more': (series(lambda t: 30_000 + 1.1 * MOST_GROWTH * t / 75), False),
    'ever more, in steps': (series(lambda t: 30_000 + 100 * MOST_GROWTH * (t // 10)), False),
    'a file left open': (series(lambda t: 30_000, files=lambda t: 8 + (t > 50)), False),
    'a file open for moments': (series(lambda t: 30_000, files=lambda t: 8 + t % 2), True),
    'a file open most of the time': (
        series(lambda t: 30_000, files=lambda t: 8 + (t % 3 > 0)),
        True,
    ),
    'a file closed for a moment': (series(lambda t: 30_000, files=lambda t: 8 - (t == 30)), True),
    'one left open, then one closed for a moment': (
        series(lambda t: 30_000, files=lambda t: 8 + (t > 50) - (t == 90)),
        False,
    ),
    'a thread more': (series(lambda t: 30_000, threads=lambda t: 2 + (t > 70)), False),
}


@pytest.mark.parametrize('name', SERIES)
def test_flatness_separates_flat_from_growing_series(name: str) -> None:
    samples, flat = SERIES[name]
    assert flatness(samples).flat is flat


def test_slope_is_robust_against_outliers() -> None:
    line = series(lambda t: 30_000 + 40 * t)
    for at in (40, 55, 90):
        line[at] = line[at]._replace(resident=90_000)
    assert flatness(line).slope == 40.0
    assert flatness(line).growth == 40.0 * 75


HOLDS_MORE = """
import os
print('little', flush=True)
input()
held = b'1' * {held}
pipe = os.pipe()
print('more', flush=True)
input()
"""


def test_usage_counts_memory_files_and_threads() -> None:
    # A process of its own: this one may have free memory left from other tests.
    held = 64_000_000
    with Popen(
        [sys.executable, '-c', HOLDS_MORE.format(held=held)], stdin=PIPE, stdout=PIPE, text=True
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stdout.readline() == 'little\n'
        before = usage(0.0, process.pid)
        print(file=process.stdin, flush=True)
        assert process.stdout.readline() == 'more\n'
        after = usage(1.0, process.pid)
        print(file=process.stdin, flush=True)
    assert 0.9 * held / 1024 <= after.resident - before.resident <= 1.1 * held / 1024
    assert after.files == before.files + 2
    assert after.threads == before.threads == 1


def write_bag(folder: Path, stats: TopicCounts | None) -> Path:
    """Write three messages of one topic, with counts of messages."""
    writer = BagWriter(folder, [Topic('/a', 'std_msgs/msg/Empty', '', '')])
    writer.make_statistics = lambda summary: stats and [stats]
    for time in range(3):
        writer.write(0, time, time, b'\0\1\0\0')
    writer.close()
    return folder


COUNTS = {
    'right': (TopicCounts('/a', 3, 3, 0, 0), []),
    'let go': (TopicCounts('/a', 9, 3, 0, 6), []),
    'none': (None, ['the bag has no counts']),
    'wrong sum': (TopicCounts('/a', 4, 3, 0, 0), ['/a: the counts do not add up']),
    'dropped': (TopicCounts('/a', 5, 3, 2, 0), ['/a: 2 dropped']),
    'more than in the bag': (
        TopicCounts('/a', 4, 4, 0, 0),
        ['/a: 4 counted, 3 in the bag'],
    ),
}


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', COUNTS)
def test_wrong_counts_are_faults(tmp_path: Path, name: str) -> None:
    stats, faults = COUNTS[name]
    assert shortcomings(write_bag(tmp_path / 'bag', stats)) == faults


def test_a_missing_bag_is_a_fault(tmp_path: Path) -> None:
    folder = write_bag(tmp_path / 'bag', None)
    shutil.rmtree(folder)
    (fault,) = shortcomings(folder)
    assert 'does not exist' in fault
