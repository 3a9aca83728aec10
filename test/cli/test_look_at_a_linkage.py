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

from .conftest import json_keys, on_terminal, Run
from ..docs.blocks import missing
from ..support.commands import environment

LINKAGES = Path(__file__).parents[2] / 'config' / 'linkages'

FILES = sorted(LINKAGES.glob('*.yaml'))

NAMES = [file.stem for file in FILES]

FOUR_BAR = str(LINKAGES / 'four_bar.yaml')

COMMANDS = ('check', 'solve', 'draw')


def shipped(name: str) -> str:
    return str(LINKAGES / f'{name}.yaml')


# What `check` must report for each linkage, in words of its file's head and of its textbook.
SAID = {
    'andrews_squeezer': ['RRR dyad', 'every angle', 'loops               3'],
    'class_3': ["Newton's method, 12 equations", 'crank_arm, platform, lower_arm, upper_arm'],
    'double_rocker': ['double rocker', '36.870°', '101.537°', 'GRCR'],
    'drag_link': ['double crank (drag link)', 'GCCC'],
    'elliptic_trammel': ['RRP dyad', 'slide of driven_slot [m]', '0.12 m', 'ahead of X'],
    'excavator_bucket': ['cylinder_tube + cylinder_rod', '0.682846 m', '1.32285 m'],
    'five_bar': ['degrees of freedom  2', 'it depends on every input'],
    'gripper': ['right_knuckle_joint follows left_knuckle_joint by -1', 'parallelogram'],
    'four_bar': ['crank-rocker', 'GCRR', 'toggles             none', 'pin B left of A→O4'],
    'hoeken': ['crank-rocker', '23.07°'],
    'inverted_slider_crank': ['RPR dyad', 'everywhere', 'pin C ahead of B'],
    'jansen_leg': ['crank-rocker', '8.65°', 'loops               3'],
    'klann_leg': ['connecting_arm, lower_rocker', 'pin hip left of knee→upper_axle'],
    'parallelogram': ['parallelogram (change point)', 'S2X', '180.000°'],
    'peaucellier': ['82.819°', 'rhombus'],
    'scotch_yoke': ['RPP dyad', 'the only one', '90.00°'],
    'slider_crank': ['RRP dyad', '69.08°', '270.00°'],
    'stephenson_3': ['drag_link, output_lever'],
    'watt_1': ['crank-rocker', 'rocker, output_link, upper_link, coupler'],
    'whitworth_quick_return': ['RPR dyad', 'RRP dyad'],
    'windscreen_wiper': ['crank-rocker', 'passenger_wiper'],
}


@pytest.mark.parametrize('name', NAMES)
def test_check_says_what_each_linkage_is(linkage: Run, name: str) -> None:
    answer = linkage('check', shipped(name))
    assert answer.returncode == 0, answer.stderr
    for words in (*SAID[name], 'Solved in this order', 'worst residual', 'input'):
        assert words in answer.stdout


@pytest.mark.parametrize('name', NAMES)
def test_check_gives_json_with_the_documented_keys(linkage: Run, name: str) -> None:
    answer = linkage('check', shipped(name), '--json')
    assert answer.returncode == 0, answer.stderr
    account = json.loads(answer.stdout)
    assert set(account) == json_keys('check')
    assert len(account['groups']) >= 2
    assert account['degrees_of_freedom'] == len(account['inputs'])
    several = len(account['inputs']) > 1
    assert (account['ranges'] is None, account['singular_inputs'] is None) == (several, several)


def test_check_gives_json_in_si_units(linkage: Run) -> None:
    account = json.loads(linkage('check', shipped('double_rocker'), '--json').stdout)
    limit = acos(0.8)
    assert min(abs(one['low']) for one in account['ranges']) == pytest.approx(limit, abs=1e-12)
    assert all(one['limited'] == [True, True] for one in account['ranges'])
    toggles = {one['input'] for one in account['singular_inputs'] if one['status'] == 'toggle'}
    assert min(map(abs, toggles)) == pytest.approx(limit, abs=1e-12)


def edited(tmp_path: Path, old: str, new: str) -> str:
    text = Path(FOUR_BAR).read_text('utf-8')
    assert old in text
    (tmp_path / 'edited.yaml').write_text(text.replace(old, new), 'utf-8')
    return 'edited.yaml'


@pytest.mark.parametrize(
    ('new', 'said'),
    [
        ('  extra: {C: [0, 0], B: [0.1, 0]}\n', "'extra'|links.extra: is free"),
        ('  extra: {O4: [0, 0], B: [0.1, 0]}\n', 'extra'),
        ('  extra: {X: [0, 0], Y: [0.1, 0]}\n', 'links.extra: no chain of pins and sliders'),
    ],
)
@pytest.mark.parametrize('command', COMMANDS)
def test_a_link_too_free_or_held_too_well_is_named_in_a_line(
    linkage: Run, tmp_path: Path, command: str, new: str, said: str
) -> None:
    file = edited(tmp_path, 'input: {', f'{new}input: {{')
    answer = linkage(command, file)
    assert answer.returncode == 2
    assert answer.stdout == ''
    assert answer.stderr.count('\n') == 1
    assert answer.stderr.startswith(f'linkage {command}: edited.yaml:')
    assert any(words in answer.stderr for words in said.split('|'))


def test_check_on_a_terminal_draws_tables(tmp_path: Path) -> None:
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


def test_solve_gives_full_precision_at_the_inputs_asked_for(linkage: Run) -> None:
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


def test_solve_reads_and_tells_radians(linkage: Run) -> None:
    answer = linkage('solve', FOUR_BAR, '--radians', '--at', '1', '--csv')
    (row,) = csv.DictReader(io.StringIO(answer.stdout))
    coupler, rocker = by_hand(0.04, 0.12, 0.08, 0.1, 1.0)
    assert row['crank_joint [rad]'] == '1.0'
    assert float(row['coupler_joint [rad]']) == pytest.approx(coupler, abs=1e-14)
    assert float(row['rocker_joint [rad]']) == pytest.approx(rocker, abs=1e-14)


def test_a_table_says_that_it_is_in_degrees(linkage: Run) -> None:
    head, row = linkage('solve', FOUR_BAR, '--at', '90').stdout.splitlines()
    assert 'crank_joint [°]' in head
    assert row.split()[0] == '90.000000'
    assert 'status' in head
    assert 'closed' in row


def test_a_sweep_goes_over_the_whole_range_from_toggle_to_toggle(linkage: Run) -> None:
    answer = linkage('solve', shipped('elliptic_trammel'), '--steps', '6', '--csv')
    rows = list(csv.DictReader(io.StringIO(answer.stdout)))
    assert len(rows) == 7
    assert [row['status'] for row in rows] == ['toggle', *['closed'] * 5, 'toggle']
    assert float(rows[0]['trammel_slide [m]']) == pytest.approx(-0.12, abs=1e-14)
    for row in rows:
        x, y = float(row['trammel_slide [m]']), float(row['cross_slide [m]'])
        assert x * x + y * y == pytest.approx(0.0144, abs=1e-15)


def test_a_sweep_can_be_bounded_and_told_where_it_is_open(linkage: Run) -> None:
    answer = linkage(
        *('solve', shipped('double_rocker'), '--from', '30', '--to', '60', '--steps', '3'),
        '--json',
    )
    states = json.loads(answer.stdout)['states']
    assert [state['left_rocker_joint'] for state in states] == pytest.approx(
        [radians(angle) for angle in (30, 40, 50, 60)]
    )
    assert [state['status'] for state in states] == ['open', 'closed', 'closed', 'closed']
    assert states[0]['gap'] > 0.0
    assert states[0]['coupler_joint'] is None
    assert states[1]['gap'] == 0.0


def test_rates_and_accelerations_are_what_positions_do(linkage: Run) -> None:
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


def test_several_inputs_come_with_commas(linkage: Run) -> None:
    answer = linkage(*('solve', shipped('five_bar'), '--at', '120,60', '--points', '--json'))
    (state,) = json.loads(answer.stdout)['states']
    assert (state['left_crank_joint'], state['right_crank_joint']) == (radians(120), radians(60))
    assert state['P.x'] == pytest.approx(0.06, abs=1e-15)  # in the middle, by symmetry
    # The elbows are 0.12 + 2·0.09·cos 60° apart.
    height = 0.09 * 3.0**0.5 / 2.0 + (0.11**2 - 0.105**2) ** 0.5
    assert state['P.y'] == pytest.approx(height, abs=1e-14)


def test_an_answer_goes_into_a_file_of_the_kind_of_its_name(linkage: Run, tmp_path: Path) -> None:
    for name, begins in (('a.csv', 'crank_joint [rad],'), ('a.json', '{'), ('a.txt', 'crank')):
        answer = linkage('solve', FOUR_BAR, '--at', '1', '-o', name)
        assert answer.stdout == f'{name}\n'
        assert (tmp_path / name).read_text('utf-8').startswith(begins)


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


@pytest.mark.parametrize('name', NAMES)
def test_every_shipped_linkage_is_drawn(linkage: Run, tmp_path: Path, name: str) -> None:
    answer = linkage('draw', shipped(name), '--names')
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout == f'{name}.png\n'
    assert (tmp_path / f'{name}.png').read_bytes().startswith(PNG)


def test_a_picture_is_the_same_each_time(tmp_path: Path) -> None:
    for kind in ('svg', 'png'):
        drawn = []
        for index in range(2):
            file = tmp_path / f'{index}.{kind}'
            subprocess.run(
                [
                    *(sys.executable, '-m', 'linkage_ros.cli.main'),
                    *('draw', FOUR_BAR, '-o', str(file), '--at', '40'),
                ],
                cwd=tmp_path,
                env=environment(tmp_path) | {'PYTHONHASHSEED': str(index)},
                check=True,
            )
            drawn.append(file.read_bytes())
        assert drawn[0] == drawn[1]


def test_a_pose_and_what_lies_behind_it_can_be_named(linkage: Run, tmp_path: Path) -> None:
    answer = linkage(
        *('draw', FOUR_BAR, '--at', '40', '--at', '80', '--at=-20', '--names', '-o', 'x.svg')
    )
    assert answer.returncode == 0, answer.stderr
    assert '<!-- four_bar, crank_joint 40° -->' in (tmp_path / 'x.svg').read_text('utf-8')


def test_a_pose_that_does_not_close_says_where_it_does(linkage: Run) -> None:
    answer = linkage('draw', shipped('double_rocker'), '--at', '10')
    assert answer.returncode == 2
    assert 'left_rocker_joint 10°: open' in answer.stderr
    assert '36.8699 to 101.537°' in answer.stderr


def test_without_matplotlib_a_line_says_what_to_install(tmp_path: Path) -> None:
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


BAD = [
    (['check'], 'FILE'),
    (['check', 'missing.yaml'], 'missing.yaml: cannot be read'),
    (['solve', FOUR_BAR, '--at', 'soon'], 'soon'),
    (['solve', FOUR_BAR, '--at', 'nan'], 'nan'),
    (['solve', FOUR_BAR, '--at', '1,2'], '2 value(s) for 1 input(s)'),
    (['solve', shipped('five_bar'), '--at', '1'], 'LEFT_CRANK_JOINT,RIGHT_CRANK_JOINT'),
    (['solve', shipped('five_bar')], '--sweep: there are 2 inputs'),
    (['solve', FOUR_BAR, '--steps', '0'], '0 is not between 1 and 1e+06'),
    (['solve', FOUR_BAR, '--steps', 'x'], "'x' is not a whole number"),
    (['solve', FOUR_BAR, '--from', '1,2'], "'1,2' is not a number; a decimal has a point"),
    (['solve', shipped('drag_link'), '--points'], 'the linkage traces none'),
    (['solve', FOUR_BAR, '--at', '1', '-o', 'no/such.csv'], 'no/such.csv: there is no folder no'),
    (['draw', FOUR_BAR, '-o', 'no/such.png'], 'no/such.png: there is no folder no'),
    (['draw', FOUR_BAR, '-o', 'picture.docx'], "picture.docx: ends in '.docx'"),
]


@pytest.mark.parametrize(
    ('typed', 'named'), BAD, ids=[' '.join(Path(word).name for word in row[0]) for row in BAD]
)
def test_wrong_input_is_answered_in_a_line(linkage: Run, typed: list[str], named: str) -> None:
    answer = linkage(*typed)
    assert answer.returncode == 2
    assert named in answer.stderr
    assert 'Traceback' not in answer.stderr
    assert answer.stdout == ''


@pytest.mark.parametrize('command', COMMANDS)
def test_every_command_explains_itself(linkage: Run, command: str) -> None:
    answer = linkage(command, '--help')
    assert answer.returncode == 0
    assert answer.stdout.startswith(f'usage: linkage {command}')
    assert f'\n  {command} ' in linkage('--help').stdout


def test_solving_takes_neither_ros_nor_matplotlib(tmp_path: Path) -> None:
    code = (
        'import sys\nfrom linkage_ros.cli.main import main\n'
        f'main(["solve", {FOUR_BAR!r}, "--at", "40"])\n'
        'sys.exit(any(name in sys.modules for name in ("rclpy", "matplotlib", "numpy")))\n'
    )
    answer = subprocess.run(
        [sys.executable, '-c', code], cwd=tmp_path, capture_output=True, timeout=60, check=False
    )
    assert answer.returncode == 0, answer.stderr


def test_a_full_turn_of_a_parallelogram_is_solved_by_continuity(linkage: Run) -> None:
    answer = linkage('solve', shipped('parallelogram'), '--steps', '8', '--json')
    for state in json.loads(answer.stdout)['states']:
        difference = state['follower_joint'] - state['crank_joint']
        assert abs(remainder(difference, tau)) < 1e-14 * pi


@pytest.mark.parametrize(
    ('name', 'said'),
    [
        ('inv1', 'without a pose      0.000°'),
        ('straight_behind', 'without a pose      0.000°'),
        ('isosceles', 'change points       90.000°, 270.000°'),
        ('inv_ahead', 'change points       0.000°'),
        ('closes_nowhere', 'worst residual      none: the loops close nowhere on a grid'),
    ],
)
def test_check_ends_in_a_sentence_where_no_pose_can_be_told(
    linkage: Run, name: str, said: str
) -> None:
    answer = linkage('check', str(Path(__file__).parents[1] / f'kinematics/defects/{name}.yaml'))
    assert (answer.returncode, answer.stderr) == (0, '')
    assert said in answer.stdout


# `linkage check` and `solve` on iterated links: branch, range, assemblies.


DEFECTS = Path(__file__).parents[1] / 'kinematics' / 'defects'


def test_each_assembly_that_check_lists_is_a_pose_to_paste(linkage: Run, tmp_path: Path) -> None:
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


@pytest.mark.parametrize(
    ('name', 'said'),
    [
        ('class3_over_a_turn', '-2.23619 rad to 5.27374 rad; each turn has different'),
        ('class3_beyond_range', '-6.25934 rad to 0.473075 rad; each turn has different'),
        ('ref_11', '1.8941 rad to 1.89576 rad\n'),
    ],
)
def test_check_names_the_range_of_the_branch(linkage: Run, name: str, said: str) -> None:
    """The ends are those of a walk in small steps over other equations: `test_branches.py`."""
    answer = linkage('check', str(DEFECTS / f'{name}.yaml'), '--radians')
    assert answer.returncode == 0, answer.stderr
    assert said in answer.stdout


def test_solve_goes_from_toggle_to_toggle_of_more_than_a_turn(linkage: Run) -> None:
    file = str(DEFECTS / 'class3_over_a_turn.yaml')
    answer = linkage('solve', file, '--radians', '--steps', '60')
    rows = [line.split() for line in answer.stdout.splitlines()[1:]]
    assert [row[1] for row in rows] == ['toggle', *['closed'] * 59, 'toggle']
    assert float(rows[-1][0]) - float(rows[0][0]) > 7.5


def test_solve_is_open_beyond_the_range_that_check_names(linkage: Run) -> None:
    file = str(DEFECTS / 'class3_beyond_range.yaml')
    answer = linkage(
        'solve', file, '--radians', '--at', '6.75324', '--at', '0.47', '--at', '0.4731'
    )
    rows = [line.split() for line in answer.stdout.splitlines()[1:]]
    assert [row[1] for row in rows] == ['open', 'closed', 'open']


# `linkage check` on sides, turns and lengths that nearly make a change point.


PARALLELOGRAM = 'a: 0.08, b: 0.1, c: 0.08, d: 0.1'
ROCKERS = 'a: 0.1, b: 0.06, c: 0.08, d: 0.12'
LEG = """
links:
  ground: {hip: [0, 0]}
  front_crank: {hip: [0, 0], A: [0.09, 0]}
  rear_crank: {hip: [0, 0], B: [0.09, 0]}
  front_shin: {A: [0, 0], foot: [0.162, 0]}
  rear_shin: {B: [0, 0], foot: [0.162, 0]}
input:
  - {joint: front_joint, parent: ground, child: front_crank}
  - {joint: rear_joint, parent: ground, child: rear_crank}
joints: {front_knee: {parent: front_crank, child: front_shin}}
"""


@pytest.mark.parametrize(
    ('text', 'lines'),
    [
        (
            f'{LEG}pose: {{inputs: [-0.8, -2.3], points: {{foot: [0, -0.2]}}}}',
            [
                'turns … they count: send unwrapped angles, …',
                '3 … pin foot right of B→A as drawn, changing at change points',
            ],
        ),
        (
            f'{LEG}pose: {{inputs: [-0.8, -2.3], points: {{foot: [0, 0.1]}}}}',
            ['3 … pin foot left of B→A as drawn, changing at change points'],
        ),
        (
            f'four_bar: {{{PARALLELOGRAM}, pose: {{inputs: [-1], angles: {{rocker: -1}}}}}}',
            ['2 … pin B right of A→O4 as drawn, changing at change points'],
        ),
        (
            'four_bar: {a: 0.0333, b: 0.1, c: 0.0333333, d: 0.1}',
            ['2 … parallelogram to within 3.3e-05 m; else a …'],
        ),
        (
            f'angles: degrees\nfour_bar: {{{ROCKERS}, input: {{limits: [250, 330]}}}}',
            ['range … 281.537°, toggle, to 330.000°, limit of crank_joint', 'toggles 281.537°, …'],
        ),
    ],
    ids=['leg below', 'leg above', 'parallelogram', 'rounded digit', 'toggle'],
)
def test_check_tells_what_is_true_on_the_drawing(
    text: str, lines: list[str], linkage: Run, tmp_path: Path
) -> None:
    file = tmp_path / 'x.yaml'
    file.write_text(text)
    answer = linkage('check', str(file))
    assert answer.returncode == 0, answer.stderr
    assert not missing(lines, answer.stdout)
