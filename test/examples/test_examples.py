# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Every example runs as it stands, anywhere, and does what its line in the README says."""

from __future__ import annotations

import csv
from importlib.util import find_spec
from pathlib import Path
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET

import linkage_ros as lr
import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / 'examples'
BAG = ROOT / 'test' / 'bag' / 'recorded' / 'torque_crank.mcap'
SCRIPTS = sorted(file.name for file in FOLDER.glob('*.py'))

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason='an installation has no examples')


def printed(script: str, folder: Path, *arguments: str) -> list[str]:
    """Return the lines that an example prints in a folder of its own."""
    done = subprocess.run(
        [sys.executable, '-W', 'error', str(FOLDER / script), *arguments],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, '')
    return done.stdout.splitlines()


def test_readme_lists_each_example_script_once() -> None:
    text = (FOLDER / 'README.md').read_text('utf-8')
    assert sorted(re.findall(r'^\| \[(.*?)\]', text, re.MULTILINE)) == SCRIPTS
    assert len(SCRIPTS) == 9


def test_example_scripts_have_at_most_40_lines() -> None:
    for file in FOLDER.rglob('*.py'):
        own = [line for line in file.read_text('utf-8').splitlines() if line[:1] != '#']
        assert len(own) <= 40, file


def test_turn_example_prints_the_joints_every_30_degrees(tmp_path: Path) -> None:
    head, *rows = printed('turn.py', tmp_path)
    assert head.split() == ['crank', *lr.load('jansen_leg').joint_names]
    assert [int(row.split()[0]) for row in rows] == list(range(0, 360, 30))


def test_csv_example_writes_angles_and_rates_of_closure(tmp_path: Path) -> None:
    assert printed('table_to_csv.py', tmp_path)[0] == '361 states, 0 of them open'
    rows = list(csv.DictReader((tmp_path / 'four_bar.csv').open()))
    closure = lr.load('four_bar')
    for row in rows[::60]:
        position = closure.position(float(row['crank_joint [rad]']))
        velocity = closure.velocity(position, 3.0)
        for unit, found in (('rad', position), ('rad/s', velocity)):
            told = {name: float(row[f'{name} [{unit}]']) for name in closure.joint_names}
            assert told == pytest.approx(dict(found), abs=1e-12)


def test_svg_example_draws_every_shipped_linkage(tmp_path: Path) -> None:
    printed('draw_svg.py', tmp_path)
    pictures = sorted(tmp_path.glob('*.svg'))
    assert [picture.stem for picture in pictures] == lr.linkage_names()
    for picture in pictures:
        assert ET.parse(picture).getroot().tag.endswith('svg')


def test_scene_example_prints_read_and_true_slides(tmp_path: Path) -> None:
    lines = printed('scene_without_ros.py', tmp_path)
    pairs = re.findall(r'piston_slide: read (\S+), true (\S+)', ' '.join(lines))
    assert len(pairs) == 5
    assert all(0.0 < abs(float(read) - float(true)) < 1e-3 for read, true in pairs)


def test_effect_example_reads_within_its_dead_zone(tmp_path: Path) -> None:
    lines = printed('own_effect.py', tmp_path)
    off = [
        float(true) - float(read)
        for true, read in re.findall(r'(\d\.\d+), read (\S+)', '\n'.join(lines))
    ]
    assert len(off) == 10
    assert all(abs(error) <= 0.0501 for error in off)
    assert any(off)


def test_function_generator_example_meets_three_precision_points(tmp_path: Path) -> None:
    _, *rows = printed('function_generator.py', tmp_path)
    values = [re.findall(r'-?\d+\.\d{5}', row) for row in rows]
    assert len(values) == 11
    errors = [float(y) - float(true) for y, true in values]
    # Three precision points: the middle one, and one near each end, where the error turns.
    assert errors[5] == pytest.approx(0.0, abs=1e-5)
    assert [error > 0.0 for error in errors if abs(error) > 1e-5] == [
        False,
        *[True] * 4,
        *[False] * 4,
        True,
    ]
    assert max(map(abs, errors)) < 1e-3


@pytest.mark.skipif(shutil.which('cc') is None, reason='there is no C compiler')
def test_compile_example_gives_equal_joints_in_c_and_python(tmp_path: Path) -> None:
    status, in_c, in_python = printed('compile_to_c.py', tmp_path)
    assert status == 'status: 0'
    assert in_c.split()[2:] == in_python.split()[2:] != []


@pytest.mark.skipif(find_spec('jax') is None, reason='needs jax')
def test_gradient_example_finds_rods_with_zero_residual(tmp_path: Path) -> None:
    lines = printed('rods_by_gradients.py', tmp_path)
    before, gradient, rods, after = ([float(x) for x in line.split()[-2:]] for line in lines)
    assert max(map(abs, after)) < 1e-14
    ankle = lr.load(FOLDER / 'ankle_rods.yaml')
    motors = (0.10, -0.04)
    assert ankle.position(0.0, 0.0, *rods).joints == pytest.approx(motors, abs=1e-13)
    # What holds the motors where they are turns the foot by the rods.
    start = ankle.linkage.pose.inputs[2:]
    position = ankle.position(*before, *start)
    assert position.joints == pytest.approx(motors, abs=1e-12)
    by_foot, by_rods = np.split(ankle.jacobian(position), 2, axis=1)
    turned = np.linalg.solve(by_foot, -by_rods)
    assert gradient == pytest.approx(2.0 * np.array(before) @ turned, rel=1e-9)


def test_read_bag_example_prints_the_recorded_joints(tmp_path: Path) -> None:
    lines = printed('read_bag.py', tmp_path, str(BAG))
    assert lines[0] == '/joint_states sensor_msgs/msg/JointState'
    states = [line.split() for line in lines if line[0].isdigit()]
    closure = lr.load('four_bar')
    assert len(states) > 100
    for _, crank, *joints in states[::50]:
        read = [float(value) for value in joints]
        assert read == pytest.approx(closure.position(float(crank)).joints, abs=1e-5)
