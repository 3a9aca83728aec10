# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Studies: which runs there are, what is kept of each, and the same numbers however they run."""

import csv
from pathlib import Path

from linkage_ros.cli.main import main
from linkage_ros.description import load_scene
from linkage_ros.errors import LinkageError
from linkage_ros.messages import JointStateReader
from linkage_ros.replay import (
    BEGIN,
    instants_of,
    ParameterSweep,
    run_one,
    runs_of,
    Study,
    sweep_of,
)
from linkage_ros.tick import Pipeline
import numpy as np
import pytest
from scipy.stats import kstest

LINKAGES = Path(__file__).parents[2] / 'config' / 'linkages'
NOISY = f"""
linkage: {LINKAGES}/four_bar.yaml
rate: 100
seed: 7
drive: {{constant_rate: {{rate: 2}}}}
effects: {{velocity: {{}}, noise: {{joints: {{rocker_joint: {{white: 0.001}}}}}}}}
"""


@pytest.fixture
def noisy(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path('noisy.yaml').write_text(NOISY)
    return load_scene('noisy.yaml')


def study_of(scene, seconds, instants=11):
    return Study(scene.name, scene.files, scene.folder, seconds, instants)


def test_study_runs_all_combinations_with_every_seed():
    sweeps = [
        ParameterSweep('rate', (100.0, 200.0)),
        ParameterSweep('loads.drive_inertia', (1e-4, 1e-3, 1e-2)),
    ]
    runs = runs_of(sweeps, 4, 9)
    assert len(set(runs)) == 24
    assert runs[0] == (('rate', 100.0), ('loads.drive_inertia', 1e-4), ('seed', 9))
    assert {dict(run)['seed'] for run in runs} == {9, 10, 11, 12}
    assert runs_of([], 1, 9) == [()]


def test_sweep_reads_a_range_or_a_list():
    assert sweep_of('rate=1:2:5') == ParameterSweep('rate', (1.0, 1.25, 1.5, 1.75, 2.0))
    assert sweep_of('a.b=-1,2e3') == ParameterSweep('a.b', (-1.0, 2000.0))


@pytest.mark.parametrize(
    'text',
    ['rate', '=1,2', 'rate=', 'rate=a,b', 'rate=1:2', 'rate=1:2:1', 'rate=1:2:3:4', 'rate=1:2:x',
     'rate=nan,1', 'rate=1:inf:3', 'drive.torque.method=rk4,gauss_legendre'],
)  # fmt: skip
def test_malformed_sweep_is_refused(text):
    with pytest.raises(LinkageError, match='is neither KEY=LOW:HIGH:N nor KEY=a,b,c'):
        sweep_of(text)


def test_study_limits_its_number_of_runs():
    with pytest.raises(LinkageError, match='has 1,000,000,000 runs, more than 100,000'):
        sweep_of('rate=1:2:1000000000')
    with pytest.raises(LinkageError, match='has 1,000,000 runs, more than 100,000'):
        runs_of([ParameterSweep('rate', tuple(range(1000)))], 1000, 0)
    with pytest.raises(LinkageError, match='names a value twice'):
        sweep_of('rate=1,2,1.0')
    with pytest.raises(LinkageError, match='sweep each key once'):
        runs_of([ParameterSweep('rate', (1.0,)), ParameterSweep('rate', (2.0,))], 1, 0)
    for runs, joints, ticks in ((1, 1, 5), (10, 3, 10**6), (10**5, 12, 10**6)):
        instants = instants_of(runs, joints, ticks)
        assert 1 <= instants <= ticks
        assert runs * joints * instants <= 24_000_000


def test_run_statistics_equal_those_of_its_messages(noisy):
    outcome = run_one(study_of(noisy, 1.0), (('seed', 3), ('drive.constant_rate.rate', 5.0)))
    scene = load_scene('noisy.yaml', ['seed=3', 'drive.constant_rate.rate=5.0'])
    pipeline, reader = Pipeline(scene), JointStateReader(scene.joint_names)
    samples = [reader.read(pipeline.tick(BEGIN + n * 10_000_000).message) for n in range(101)]
    assert (outcome.failure, outcome.ticks, outcome.messages) == ('', 101, 101)
    for index, joint in enumerate(scene.joint_names):
        for head, column in (
            (joint, np.array([sample.angles[index] for sample in samples])),
            (f'{joint} rate', np.array([sample.rates[index] for sample in samples])),
        ):
            expected = column.min(), column.max(), column.mean(), np.sqrt(np.mean(column**2))
            assert outcome.statistics[head] == pytest.approx(expected, rel=1e-12)
        at = [samples[10 * n].angles[index] for n in range(11)]
        assert list(outcome.positions[index]) == at


def test_spread_over_seeds_equals_the_noise(noisy):
    ideal = load_scene('noisy.yaml', ['effects={}'])
    (line,) = Pipeline(ideal).linkages
    line.interpret(BEGIN)
    exact = line.interpret(BEGIN + 500_000_000).reading.joints[-1]
    study = study_of(noisy, 0.5, 2)
    found = [run_one(study, (('seed', seed),)).positions[-1, -1] for seed in range(150)]
    assert len(set(found)) == 150
    assert kstest((np.array(found) - exact) / 0.001, 'norm').pvalue > 1e-3


def test_two_processes_give_the_table_of_one(noisy):
    for workers in ('1', '2'):
        assert main(['simulate', 'noisy.yaml', '--seconds', '0.3', '--seeds', '5', '--workers',
                     workers, '-o', f'{workers}.csv']) == 0  # fmt: skip
    assert Path('1.csv').read_bytes() == Path('2.csv').read_bytes()
    with Path('1.csv').open(newline='') as lines:
        rows = list(csv.DictReader(lines))
    assert [int(row['seed']) for row in rows] == [7, 8, 9, 10, 11]
    assert len({row['rocker_joint mean [rad]'] for row in rows}) == 5


def test_failed_run_is_named_and_the_others_finish(noisy, capsys):
    assert main(['simulate', 'noisy.yaml', '--seconds', '0.1', '--sweep', 'rate=100,-5,200',
                 '--workers', '1', '-o', 'x.csv']) == 0  # fmt: skip
    named, counted = capsys.readouterr().err.splitlines()
    assert named.startswith('linkage simulate: rate=-5: ')
    assert counted == 'linkage simulate: 1 of 3 runs failed'
    with Path('x.csv').open(newline='') as lines:
        rows = list(csv.DictReader(lines))
    assert [row['ticks'] for row in rows] == ['11', '0', '21']
    assert main(['simulate', 'noisy.yaml', '--sweep', 'no=1,2', '--workers', '1', '-o',
                 'y.csv']) == 1  # fmt: skip
    assert not Path('y.csv').exists()


def test_runs_failing_for_one_reason_name_it_once(noisy, capsys):
    # The numbers in the reason are those of the runs.
    values = ','.join(f'-{value}' for value in range(1, 6))
    assert main(['simulate', 'noisy.yaml', '--seconds', '0.1', '--sweep', f'rate={values}',
                 '--workers', '1', '-o', 'x.csv']) == 1  # fmt: skip
    named, counted = capsys.readouterr().err.splitlines()
    assert named.startswith('linkage simulate: rate=-1: ')
    assert named.endswith('; likewise 4 other runs')
    assert counted == 'linkage simulate: 5 of 5 runs failed'


def test_study_draws_the_spread_of_joints(noisy):
    assert main(['simulate', 'noisy.yaml', '--seconds', '0.1', '--seeds', '3', '--workers', '1',
                 '-o', 'x.svg']) == 0  # fmt: skip
    drawn = Path('x.svg').read_text()
    for text in ('noisy: 3 runs of 0.1 s', 'rocker_joint [rad]', 'less the median [rad]'):
        assert f'<!-- {text} -->' in drawn


def test_study_options_without_a_study_are_refused(noisy, capsys):
    for option in (['--workers', '2'], ['--dask', 'tcp://x:1']):
        assert main(['simulate', 'noisy.yaml', '-o', 'x.csv', *option]) == 2
        assert f'{option[0]}: is for a study; add --seeds or --sweep' in capsys.readouterr().err
