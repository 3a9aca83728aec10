# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The benchmark runs and prints finite ratios; nothing that is timed is asserted."""

from math import isfinite
from pathlib import Path
import re
from shutil import which
import subprocess
import sys

from bench.kinematics_speed import AVAILABLE
from bench.report import ratios, spread, Table
from linkage_ros.cli import table_text
from linkage_ros.tools.study import percentile
import pytest

ROOT = Path(__file__).resolve().parents[2]
LINKAGES = sorted((ROOT / 'config' / 'linkages').glob('*.yaml'))


def test_percentiles_interpolate_between_neighbours():
    assert percentile([4.0, 1.0, 3.0, 2.0], 50.0) == 2.5
    assert percentile([1.0, 2.0], 100.0) == 2.0
    assert not isfinite(percentile([], 50.0))
    assert spread([1.0]) == '1.0'
    assert spread([1.0, 2.0, 3.0], 0) == '2 (2–2)'


def test_benchmark_ratios_are_taken_turn_by_turn():
    assert ratios([2.0, 30.0], [1.0, 10.0]) == [2.0, 3.0]


def test_benchmark_table_is_aligned_text_and_markdown():
    table = Table('t', ('', 'µs'), [('a', '1.0')])
    assert table_text(table.aligned()) == 't\n    µs\na  1.0'
    assert table.markdown() == '## t\n\n|  | µs |\n| --- | ---: |\n| a | 1.0 |\n'


@pytest.mark.sample(0)
@pytest.mark.ros
@pytest.mark.alone
@pytest.mark.timeout(90)
def test_latency_is_measured_against_the_relay(tmp_path):
    kept = _bench(tmp_path, '--only', 'c')
    cells = _row(kept, 'linkage_node')
    assert _measured(cells[1:4])
    assert _measured(cells[5:6])
    assert '≤ 1.25' in cells[6]


@pytest.mark.ros
@pytest.mark.alone
@pytest.mark.timeout(90)
def test_ticks_are_measured_against_the_bare_loop(tmp_path):
    kept = _bench(tmp_path, '--only', 'b')
    cells = _row(kept, 'linkage_node')
    assert _measured(cells[1:4])
    assert 'lateness' in kept
    assert 'bare loop' in kept


@pytest.mark.sample(0)
@pytest.mark.ros
@pytest.mark.alone
@pytest.mark.timeout(90)
def test_ticks_are_measured_against_the_idiomatic_node(tmp_path):
    kept = _bench(tmp_path, '--only', 'a')
    cells = _row(kept, 'idiomatic node')
    assert _measured(cells[1:3])


@pytest.mark.ros
@pytest.mark.alone
@pytest.mark.timeout(90)
def test_benchmark_measures_100_linkages_in_one_node(tmp_path):
    cells = _row(_bench(tmp_path, '--only', 'many'), '100 four-bars in one node, 1 kHz')
    assert _measured(cells[1:4])


@pytest.mark.sample(0)
@pytest.mark.ros
@pytest.mark.alone
@pytest.mark.timeout(90)
def test_real_time_benchmark_measures_priority_and_cpu_affinity(tmp_path):
    kept = _bench(tmp_path, '--only', 'real_time')
    for more in ('', ' + thread_priority', ' + thread_priority + cpu_affinity'):
        cells = _row(kept, f'linkage_node{more}, 1 kHz')
        assert _measured(cells[1:4])


@pytest.mark.sample(0)
@pytest.mark.ros
@pytest.mark.alone
@pytest.mark.timeout(90)
def test_subscriber_benchmark_measures_each_transport(tmp_path):
    kept = _bench(tmp_path, '--only', 'comers')
    for way in (
        'shared memory',
        'UDP only',
        'shared memory, timeout 30 ms',
        'shared memory, asynchronous',
    ):
        cells = _row(kept, f'{way}, 1 kHz')
        stood, lost, ticks, *_, deaf, missed = cells[1:]
        assert 0 <= int(lost) < int(ticks)
        assert int(stood) >= 0
        assert deaf == '0'
        assert int(missed.partition(' of ')[2]) > 0


@pytest.mark.timeout(90)
def test_empty_scene_is_measured_against_handwritten_code(tmp_path):
    kept = _bench(tmp_path, '--only', 'empty')
    for name, target in (
        ('empty scene / straight line and packing', '≤ 1.5'),
        ('with velocity / empty scene', '≤ 1.25'),
    ):
        cells = _row(kept, f'µs a tick: {name}')
        assert _measured(cells[1:4])
        assert cells[4] == target


@pytest.mark.sample(0)
@pytest.mark.timeout(90)
def test_compiled_linkages_are_measured_against_plain_steps(tmp_path):
    kept = _bench(tmp_path, '--only', 'compiled')
    for linkage in LINKAGES:
        cells = _row(kept, linkage.stem)
        assert _measured(cells[1:4])
        assert re.match('≤ 0', cells[4])
        if which('cc') and linkage.stem != 'class_3':
            cells = _row(kept, linkage.stem, 1)
            assert _measured(cells[1:4])
            assert re.match('≥ 0', cells[4])
    for dyads in (1, 2, 4, 8, 16, 32):
        assert _measured(_row(kept, str(dyads))[1:3])


@pytest.mark.sample(0)
@pytest.mark.timeout(90)
def test_solving_is_measured_against_straight_line_code(tmp_path):
    kept = _bench(tmp_path, '--only', 'kinematics')
    names = ['µs a state: four-bar / straight line', 'µs a state: Jansen leg / four-bar']
    if AVAILABLE:
        names += ['µs a state: pylinkage / four-bar', 'Mstates/s: numpy / pylinkage']
    for name in names:
        cells = _row(kept, name)
        assert _measured(cells[1:4])
        assert re.match('[≤≥] ', cells[4])
    assert 'CPU of a tick' not in kept


def _bench(runs: Path, *arguments: str) -> str:
    """Run it and return the tables that it keeps."""
    done = subprocess.run(
        [sys.executable, '-m', 'bench', '--quick', '--runs', str(runs), *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=80,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert 'Machine' in done.stdout
    (file,) = runs.iterdir()
    return file.read_text(encoding='utf-8')


def _row(text: str, name: str, table: int = 0) -> list[str]:
    """Return the cells of a row, of that table among those that have one of this name."""
    line = [line for line in text.splitlines() if line.startswith(f'| {name} |')][table]
    return [cell.strip() for cell in line.strip('|').split('|')]


def _measured(cells: list[str]) -> bool:
    """Tell whether each cell begins with a number; what the clock said is for people to judge."""
    return all(re.match(r'\d+(\.\d+)?(?![\w.])', cell) for cell in cells)
