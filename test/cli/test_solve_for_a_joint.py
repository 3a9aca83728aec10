# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage solve --joint`` and ``check --branches``: which crank gives a joint a value."""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Callable, Sequence
import csv
import io
import json
from math import acos, atan2, cos, pi, radians, remainder, sin, sqrt, tau
from pathlib import Path
from random import Random
import re

from linkage_ros import load
from linkage_ros.cli.main import main
import numpy as np
import pytest

from .conftest import Run


def solved(linkage: Run, *arguments: str) -> list[dict[str, str]]:
    answer = linkage('solve', *arguments, '--csv')
    assert answer.returncode == 0, answer.stderr
    return list(csv.DictReader(io.StringIO(answer.stdout)))


def test_solve_joint_finds_the_crank_on_every_branch(linkage: Run) -> None:
    rows = solved(linkage, 'four_bar', '--joint', 'rocker_joint=68.7549')
    closure = load('four_bar')
    assert [row['branch'] for row in rows] == ['1', '2']
    for row in rows:
        position = closure.position(float(row['crank_joint [rad]']))
        assert position['rocker_joint'] == pytest.approx(radians(68.7549), abs=1e-15)
        off = position['coupler_joint'] - float(row['coupler_joint [rad]'])
        assert remainder(off, tau) == pytest.approx(0.0, abs=1e-14)


def test_solve_joint_takes_rates_of_the_joint(linkage: Run) -> None:
    asked = ('--joint', 'foot.y=-0.08', '--rate', '0.01', '--acceleration', '0.02', '--points')
    rows = solved(linkage, 'jansen_leg', *asked)
    assert [row['branch'] for row in rows] == ['2', '3']
    closure = load('jansen_leg')
    for row in rows:
        position = closure.position(float(row['crank_joint [rad]']))
        velocity = closure.velocity(position, float(row['crank_joint rate [rad/s]']))
        crank = float(row['crank_joint acceleration [rad/s²]'])
        acceleration = closure.acceleration(position, velocity, crank)
        motions = closure.point_motion(position, velocity, acceleration)
        (foot,) = {motion for (_, point), motion in motions.items() if point == 'foot'}
        found = [foot.place.imag, foot.velocity.imag, foot.acceleration.imag]
        assert found == pytest.approx([-0.08, 0.01, 0.02], rel=1e-11)


def test_solve_takes_as_many_joints_as_inputs(linkage: Run) -> None:
    asked = ('--joint', 'right_elbow=1.4', '--joint', 'left_elbow=-1.2', '--radians')
    rows = solved(linkage, 'five_bar', *asked)
    assert rows
    for row in rows:
        position = load('five_bar').position(
            float(row['left_crank_joint [rad]']), float(row['right_crank_joint [rad]'])
        )
        assert position['right_elbow'] == pytest.approx(1.4, abs=1e-14)
        assert position['left_elbow'] == pytest.approx(-1.2, abs=1e-14)


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('name', 'joints'),
    [
        ('four_bar', ['rocker_joint']),
        ('rssr', ['rocker_joint']),
        ('five_bar', ['left_elbow', 'right_elbow']),
        ('wishbone', ['upper_joint', 'rack']),
        ('spherical_four_bar', ['rocker']),
    ],
)
def test_solve_refuses_unreachable_values_of_joints(
    name: str, joints: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    random, seen = Random(48), set()
    for _ in range(12):
        typed = [f'{joint}={random.uniform(-3.0, 3.0):.3f}' for joint in joints]
        asked = [word for value in typed for word in ('--joint', value)]
        code = main(['solve', name, *asked, '--radians', '--csv'])
        said = capsys.readouterr()
        seen.add(code)
        rows = list(csv.DictReader(io.StringIO(said.out)))
        if code == 0:
            assert {row['status'] for row in rows} <= {'closed', 'toggle', 'change point'}
        else:
            assert (code, rows) == (2, [])
            (line,) = [one for one in said.err.splitlines() if 'note: ' not in one]
            assert line.startswith(f'linkage solve: --joint {joints[0]}=')
            assert ': is not reached' in line
    assert 2 in seen


def five_bar_foot(left: float, right: float) -> dict[str, float]:
    """Return where the tip of the gallery's five-bar is, by two circles, and an elbow."""
    a, b = rect(0.09, left), 0.12 + rect(0.09, right)
    half = (a - b) / 2
    foot = b + half - 1j * half * sqrt(0.11**2 / abs(half) ** 2 - 1)
    return {'P.x': foot.real, 'P.y': foot.imag, 'left_elbow': phase((foot - a) / a)}


def delta_platform(*angles: float) -> dict[str, float]:
    """Return where the gallery's delta has its platform, below its knees: by three spheres."""
    knees = []
    for k, angle in enumerate(angles):
        out = np.array([cos(tau * k / 3), sin(tau * k / 3), 0.0])
        arm = 0.1 * cos(angle) - 0.15 * sin(angle), -0.1 * sin(angle) - 0.15 * cos(angle)
        knees.append(out * (0.06 + arm[0]) + np.array([0.0, 0.0, arm[1]]))
    sides = np.array(knees[1:]) - knees[0]
    normal = np.cross(*sides)
    middle, *_ = np.linalg.lstsq(
        np.array([*sides, normal]), np.array([*(0.5 * (sides**2).sum(1)), 0.0]), rcond=None
    )
    up = normal / np.linalg.norm(normal)
    place = knees[0] + middle - up * sqrt(0.16**2 + 0.35**2 - middle @ middle)
    return dict(zip('xyz', map(float, place), strict=True))


@pytest.mark.parametrize(
    ('name', 'over', 'held', 'reference'),
    [
        ('five_bar', 'left_crank_joint', (0.3, 1.2), five_bar_foot),
        ('five_bar', 'right_crank_joint', (1.4, 0.2), five_bar_foot),
        ('delta', 'a2', (0.1, 0.0, -0.2), delta_platform),
    ],
)
def test_branches_over_one_of_several_inputs(
    name: str,
    over: str,
    held: Sequence[float],
    reference: Callable[..., dict[str, float]],
    linkage: Run,
) -> None:
    """On each branch the joint of a closed form moves one way, and turns back where it says."""
    typed = ['--over', over, '--radians', '--at', *map(str, held)]
    answer = json.loads(linkage('check', name, '--branches', *typed, '--json').stdout)
    number = [given['joint'] for given in answer['inputs']].index(over)
    names = {branch['joint'] for branch in answer['branches']}
    assert {'five_bar': {'right_elbow', *five_bar_foot(1.0, 2.0)}, 'delta': {*'xyz'}}[
        name
    ] == names
    for branch in answer['branches']:
        if branch['joint'] == 'right_elbow':
            continue
        assert branch['held'] == {
            given['joint']: value
            for given, value in zip(answer['inputs'], held, strict=True)
            if given['joint'] != over
        }

        def value_at(crank: float, joint: str = branch['joint']) -> float:
            inputs = [crank if k == number else value for k, value in enumerate(held)]
            return reference(*inputs)[joint]

        low, high = branch['input_low'], branch['input_high']
        width = high - low
        inner = [low + width * (k + 0.5) / 200 for k in range(200)]
        values = np.array([value_at(crank) for crank in inner])
        steps = np.diff(np.unwrap(values) if branch['unit'] == 'rad' else values)
        assert (steps > 0.0).all() if branch['rises'] else (steps < 0.0).all()
        ends = [low, high] if branch['rises'] else [high, low]
        for end, key, back in zip(ends, ('low', 'high'), branch['turns_back'], strict=True):
            if back:
                assert value_at(end) == pytest.approx(branch[key], abs=1e-12)
                beside = [value_at(end + way * 1e-3 * width) for way in (-1, 1)]
                assert (beside[0] - value_at(end)) * (beside[1] - value_at(end)) > 0.0


@pytest.mark.parametrize(
    ('typed', 'said'),
    [
        (
            ['delta', '--branches'],
            '--branches: there are 3 inputs; name one, as --over a1, or leave it out',
        ),
        (['delta', '--branches', '--over', 'b'], '--over b: is not an input; name a1, a2, a3'),
        (['delta', '--over', 'a1'], '--over: says where branches are; write --branches too'),
        (['delta', '--at', '0', '0', '0'], '--at: says where branches are; write --branches too'),
        (
            ['five_bar', '--branches', '--over', 'left_crank_joint', '--at', '0', '0', '0'],
            '--at 0 0 0: 3 value(s) for 2 input(s); write --at LEFT_CRANK_JOINT RIGHT_CRANK_JOINT',
        ),
        (
            ['wishbone', '--branches', '--over', 'travel', '--at', '0', '900'],
            'travel: closes nowhere while the other inputs are held; hold them elsewhere, by --at',
        ),
    ],
)
def test_branches_refuse_what_names_no_way(
    typed: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['check', *typed]) == 2
    assert capsys.readouterr().err == f'linkage check: {said}\n'


TANGENT = """
links:
  ground: {O: [0, 0], G: [0, 1]}
  crank: {O: [0, 0], X: [1, 0]}
  shoe: {P: [0, 0], Q: [0.2, 0]}
sliders:
  rail: {point: P, block: shoe, along: ground, through: G, direction: [1, 0]}
  slot: {point: P, along: crank, through: O, direction: [1, 0]}
input: {joint: crank_joint, parent: ground, child: crank, limits: [-0.1, 0.1]}
joints: {shoe_slide: {slider: rail}}
"""
"""A shoe slides on a rail at height 1, by a pin in the slot of the crank: its slide is 1/tan."""


def test_solve_names_every_crank_beyond_limits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'tangent.yaml').write_text(TANGENT)
    random = Random(48)
    for _ in range(8):
        slide = round(random.uniform(-3.0, 3.0), 3)
        typed = ['--joint', f'shoe_slide={slide}', '--radians']
        assert main(['solve', str(tmp_path / 'tangent.yaml'), *typed]) == 2
        said = capsys.readouterr().err
        cranks = [float(found) % tau for found in re.findall(r'crank_joint at (\S+) rad', said)]
        right = atan2(1.0, slide)
        assert sorted(cranks) == pytest.approx([right, right + pi], abs=1e-5)


def three_arms() -> str:
    """Return a planar parallel robot of three arms, each of 70 and 80 mm; its pose by circles."""
    corners = [rect(0.12, tau * k / 3) for k in range(3)]
    hinges = [rect(0.035, tau * k / 3 + 0.2) for k in range(3)]
    lines = ['links:', f'  ground: {{{", ".join(place(f"O{k}", corners[k]) for k in range(3))}}}']
    lines += [f'  platform: {{{", ".join(place(f"B{k}", hinges[k]) for k in range(3))}}}']
    points, cranks = [place(f'B{k}', hinges[k]) for k in range(3)], []
    for k, (corner, hinge) in enumerate(zip(corners, hinges, strict=True)):
        across = hinge - corner
        opening = acos((0.07**2 + abs(across) ** 2 - 0.08**2) / (2 * 0.07 * abs(across)))
        cranks.append(phase(across) + opening)
        points.append(place(f'A{k}', corner + rect(0.07, cranks[k])))
        lines += [
            f'  crank{k}: {{O{k}: [0, 0], A{k}: [0.07, 0]}}',
            f'  rod{k}: {{A{k}: [0, 0], B{k}: [0.08, 0]}}',
        ]
    lines += ['input:']
    lines += [f'  - {{joint: motor{k}, parent: ground, child: crank{k}}}' for k in range(3)]
    lines += [f'pose: {{inputs: {cranks}, points: {{{", ".join(points)}}}}}', 'joints:']
    lines += [f'  elbow{k}: {{parent: crank{k}, child: rod{k}}}' for k in range(3)]
    return '\n'.join([*lines, ''])


def place(name: str, at: complex) -> str:
    return f'{name}: [{at.real!r}, {at.imag!r}]'


def test_solve_finds_states_of_iterated_links_by_search(linkage: Run, tmp_path: Path) -> None:
    (tmp_path / 'arms.yaml').write_text(three_arms(), 'utf-8')
    closure = load(tmp_path / 'arms.yaml')
    pose = closure.linkage.pose
    assert pose is not None
    wanted = closure.position(*pose.inputs)
    joints = (f'elbow0={wanted["elbow0"]!r}', f'elbow1={wanted["elbow1"]!r}')
    asked = [
        word for name in (*joints, f'motor2={pose.inputs[2]!r}') for word in ('--joint', name)
    ]
    answer = linkage('solve', 'arms.yaml', '--radians', '--csv', *asked)
    rows = list(csv.DictReader(io.StringIO(answer.stdout)))
    note = f'linkage solve: note: {len(rows)} found by a search from 65 states; '
    assert note in answer.stderr
    offs = [
        max(abs(remainder(float(row[f'motor{k} [rad]']) - pose.inputs[k], tau)) for k in range(2))
        for row in rows
    ]
    assert min(offs) < 1e-9
