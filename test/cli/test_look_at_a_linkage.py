# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage check``, ``solve`` and ``draw`` on real files."""

from __future__ import annotations

from cmath import phase, rect
import csv
import io
import json
from math import acos, degrees, pi, radians, remainder, tau
from pathlib import Path
import re
import subprocess
import sys

import pytest
import yaml

from .conftest import on_terminal, Run
from ..support.commands import environment

LINKAGES = Path(__file__).parents[2] / 'config' / 'linkages'

FILES = sorted(LINKAGES.glob('*.yaml'))

NAMES = [file.stem for file in FILES]

FOUR_BAR = str(LINKAGES / 'four_bar.yaml')


def shipped(name: str) -> str:
    return str(LINKAGES / f'{name}.yaml')


def test_check_prints_json_in_si_units(linkage: Run) -> None:
    account = json.loads(linkage('check', shipped('double_rocker'), '--json').stdout)
    limit = acos(0.8)
    assert min(abs(one['low']) for one in account['ranges']) == pytest.approx(limit, abs=1e-12)
    assert all(one['limited'] == [True, True] for one in account['ranges'])
    toggles = {one['input'] for one in account['singular_inputs'] if one['status'] == 'toggle'}
    assert min(map(abs, toggles)) == pytest.approx(limit, abs=1e-12)


def test_check_draws_tables_on_a_terminal(tmp_path: Path) -> None:
    pytest.importorskip('rich')
    shown = on_terminal(tmp_path, 'check', FOUR_BAR, columns=160)
    assert '╭' in shown
    # Units in brackets are no markup.
    assert 'lengths [m]' in shown


def by_hand(a: float, b: float, c: float, d: float, phi: float) -> tuple[float, float]:
    """Return coupler and rocker joint of a four-bar on the left, by two circles."""
    crank_pin = rect(a, phi)
    across = d - crank_pin
    s = abs(across)
    along = (b * b - c * c + s * s) / (2.0 * s)
    b_pin = crank_pin + across / s * complex(along, (b * b - along * along) ** 0.5)
    return phase(b_pin - crank_pin) - phi, phase(b_pin - d)


def test_solve_prints_full_precision_at_the_given_inputs(linkage: Run) -> None:
    answer = linkage('solve', FOUR_BAR, '--at', '40', '--at=-100.5', '--json')
    assert answer.returncode == 0, answer.stderr
    told = json.loads(answer.stdout)
    assert told['units'] == {
        'crank_joint': 'rad', 'gap': 'm', 'coupler_joint': 'rad', 'rocker_joint': 'rad',
    }  # fmt: skip
    assert [state['status'] for state in told['states']] == ['closed', 'closed']
    for state, phi in zip(told['states'], (40.0, -100.5), strict=True):
        assert state['crank_joint'] == radians(phi)
        coupler, rocker = by_hand(0.04, 0.12, 0.08, 0.1, radians(phi))
        for name, expected in (('coupler_joint', coupler), ('rocker_joint', rocker)):
            assert abs(remainder(state[name] - expected, tau)) < 1e-14
            assert -pi < state[name] <= pi


def test_solve_sweeps_the_whole_range_between_toggles(linkage: Run) -> None:
    answer = linkage('solve', shipped('elliptic_trammel'), '--steps', '6', '--csv')
    rows = list(csv.DictReader(io.StringIO(answer.stdout)))
    assert len(rows) == 7
    assert [row['status'] for row in rows] == ['toggle', *['closed'] * 5, 'toggle']
    assert float(rows[0]['trammel_slide [m]']) == pytest.approx(-0.12, abs=1e-14)
    for row in rows:
        x, y = float(row['trammel_slide [m]']), float(row['cross_slide [m]'])
        assert x * x + y * y == pytest.approx(0.0144, abs=1e-15)


def test_solved_rates_and_accelerations_equal_differences_of_positions(linkage: Run) -> None:
    """Against central differences of positions, of joints and of a traced point."""
    step = 1e-3  # s; at 20 °/s and 5 °/s²
    at = [f'{50.0 + 20.0 * t + 0.5 * 5.0 * t * t!r}' for t in (-step, 0.0, step)]
    answer = linkage(
        *('solve', shipped('jansen_leg'), '--at', at[0], '--at', at[1], '--at', at[2]),
        *('--rate', '20', '--acceleration', '5', '--points', '--json'),
    )
    assert answer.returncode == 0, answer.stderr
    before, now, after = json.loads(answer.stdout)['states']
    names = [name.removesuffix(' rate') for name in now if name.endswith(' rate')]
    assert {'leg_joint', 'foot.x', 'foot.y'} <= set(names)
    for name in names:
        rate = (after[name] - before[name]) / (2.0 * step)
        change = (after[name] - 2.0 * now[name] + before[name]) / step**2
        assert now[f'{name} rate'] == pytest.approx(rate, rel=1e-6, abs=1e-6)
        assert now[f'{name} acceleration'] == pytest.approx(change, rel=1e-4, abs=1e-4)


def test_solve_takes_several_inputs_as_separate_words(linkage: Run) -> None:
    answer = linkage(*('solve', shipped('five_bar'), '--at', '120', '60', '--points', '--json'))
    (state,) = json.loads(answer.stdout)['states']
    assert (state['left_crank_joint'], state['right_crank_joint']) == (radians(120), radians(60))
    assert state['P.x'] == pytest.approx(0.06, abs=1e-15)  # in the middle, by symmetry
    # The elbows are 0.12 + 2·0.09·cos 60° apart.
    height = 0.09 * 3.0**0.5 / 2.0 + (0.11**2 - 0.105**2) ** 0.5
    assert state['P.y'] == pytest.approx(height, abs=1e-14)


def test_rates_at_a_toggle_are_left_out(linkage: Run) -> None:
    limit = degrees(acos(0.8))
    answer = linkage(
        *('solve', shipped('double_rocker'), '--at', repr(limit), '--rate', '1'),
        '--json',
    )
    (state,) = json.loads(answer.stdout)['states']
    if state['status'] == 'toggle':  # within the last floats of it
        assert state['coupler_joint'] is not None
        assert state['coupler_joint rate'] is None


PNG = b'\x89PNG\r\n\x1a\n'


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', NAMES)
def test_draw_draws_every_shipped_linkage(linkage: Run, tmp_path: Path, name: str) -> None:
    answer = linkage('draw', shipped(name), '--names')
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout == f'{name}.png\n'
    assert (tmp_path / f'{name}.png').read_bytes().startswith(PNG)


def test_repeated_drawing_gives_the_same_bytes(tmp_path: Path) -> None:
    code = (
        'import sys\nfrom linkage_ros.cli.main import main\n'
        'for kind in ("svg", "png"):\n'
        f'    main(["draw", {FOUR_BAR!r}, "-o", f"{{sys.argv[1]}}.{{kind}}", "--at", "40"])\n'
    )
    for seed in '01':
        subprocess.run(
            [sys.executable, '-c', code, seed],
            cwd=tmp_path,
            env=environment(tmp_path) | {'PYTHONHASHSEED': seed},
            check=True,
        )
    for kind in ('svg', 'png'):
        first, second = ((tmp_path / f'{seed}.{kind}').read_bytes() for seed in '01')
        assert first == second


def test_draw_takes_several_poses(linkage: Run, tmp_path: Path) -> None:
    answer = linkage(
        *('draw', FOUR_BAR, '--at', '40', '--at', '80', '--at=-20', '--names', '-o', 'x.svg')
    )
    assert answer.returncode == 0, answer.stderr
    assert '<!-- four_bar, crank_joint 40° -->' in (tmp_path / 'x.svg').read_text('utf-8')


def test_draw_without_matplotlib_names_what_to_install(tmp_path: Path) -> None:
    code = (
        'import sys; sys.modules["matplotlib"] = None\n'
        'import importlib.util as u; find = u.find_spec\n'
        'u.find_spec = lambda name, *a: None if name == "matplotlib" else find(name, *a)\n'
        'from linkage_ros.cli.main import main\n'
        f'sys.exit(main(["draw", {FOUR_BAR!r}]))\n'
    )
    answer = subprocess.run(
        [sys.executable, '-c', code],
        cwd=tmp_path,
        env=environment(tmp_path),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert answer.returncode == 2
    assert "pip install 'linkage_ros[report]'" in answer.stderr
    assert 'Traceback' not in answer.stderr


def test_solve_imports_neither_rclpy_nor_matplotlib(tmp_path: Path) -> None:
    code = (
        'import sys\nfrom linkage_ros.cli.main import main\n'
        f'main(["solve", {FOUR_BAR!r}, "--at", "40"])\n'
        'sys.exit(any(name in sys.modules for name in ("rclpy", "matplotlib", "numpy")))\n'
    )
    answer = subprocess.run(
        [sys.executable, '-c', code], cwd=tmp_path, capture_output=True, timeout=60, check=False
    )
    assert answer.returncode == 0, answer.stderr


def test_solve_follows_a_parallelogram_over_a_full_turn(linkage: Run) -> None:
    answer = linkage('solve', shipped('parallelogram'), '--steps', '8', '--json')
    for state in json.loads(answer.stdout)['states']:
        difference = state['follower_joint'] - state['crank_joint']
        assert abs(remainder(difference, tau)) < 1e-14 * pi


# `linkage check` and `solve` on iterated links: branch, range, assemblies.


DEFECTS = Path(__file__).parents[1] / 'kinematics' / 'defects'


def test_assemblies_that_check_lists_are_poses_to_paste(linkage: Run, tmp_path: Path) -> None:
    text = (DEFECTS / 'class3_beyond_range.yaml').read_text('utf-8')
    answer = linkage('check', str(DEFECTS / 'class3_beyond_range.yaml'))
    assert (
        'Other assemblies of group 2 at the inputs of the pose: 3 found from 400' in answer.stdout
    )
    listed = re.findall(r'^\{inputs: .*\}\}', answer.stdout, re.MULTILINE)
    assert len(listed) == 3
    joints = []
    for index, pose in enumerate(['', *listed]):
        file = tmp_path / f'{index}.yaml'
        # The line `pose: …` of the file in the place of that which it has.
        changed = re.sub('^pose: .*$', f'pose: {pose}', text, flags=re.MULTILINE)
        file.write_text(changed if pose else text, 'utf-8')
        (at,) = yaml.safe_load(file.read_text('utf-8'))['pose']['inputs']
        solved = linkage('solve', str(file), '--radians', f'--at={at!r}')
        cells = solved.stdout.splitlines()[1].split()
        assert cells[1] == 'closed', solved.stdout
        joints.append(tuple(cells[3:]))
    assert len(set(joints)) == 4


def test_solve_sweeps_more_than_a_turn_between_toggles(linkage: Run) -> None:
    file = str(DEFECTS / 'class3_over_a_turn.yaml')
    answer = linkage('solve', file, '--radians', '--steps', '60')
    rows = [line.split() for line in answer.stdout.splitlines()[1:]]
    assert [row[1] for row in rows] == ['toggle', *['closed'] * 59, 'toggle']
    assert float(rows[-1][0]) - float(rows[0][0]) > 7.5


def test_solve_prints_open_beyond_the_range_of_check(linkage: Run) -> None:
    file = str(DEFECTS / 'class3_beyond_range.yaml')
    answer = linkage(
        'solve', file, '--radians', '--at', '6.75324', '--at', '0.47', '--at', '0.4731'
    )
    rows = [line.split() for line in answer.stdout.splitlines()[1:]]
    assert [row[1] for row in rows] == ['open', 'closed', 'open']


# `linkage check` on sides, turns and lengths that nearly make a change point.
