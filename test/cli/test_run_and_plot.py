# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage run`` and ``linkage plot``, on scenes of the user's own."""

from __future__ import annotations

from pathlib import Path
import re
import subprocess
import sys

from linkage_ros.bag import BagWriter, read_bag, Topic
from linkage_ros.replay import recorded_scene
import pytest

from .conftest import Run
from ..support.commands import environment

pytestmark = pytest.mark.ros


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    (tmp_path / 'rod.yaml').write_text('inverted_slider_crank: {a: 0.15, swivel: [0.25, 0.1]}\n')
    scene = tmp_path / 'rod scene.yaml'
    scene.write_text(
        'linkage: rod.yaml\nrate: 0\neffects: {acceleration: {}}\nrecord: {name: "b 1"}\n'
    )
    return scene


@pytest.fixture
def crank(tmp_path: Path):
    process = subprocess.Popen(
        [
            *(sys.executable, '-m', 'linkage_ros.node.crank_source', '--ros-args'),
            *('-p', 'rate:=200.0', '-p', 'seconds:=30.0', '-p', 'joint:=crank_joint'),
            *('-r', 'crank_states:=motor'),
        ],
        env=environment(tmp_path),
    )
    yield process
    process.terminate()
    assert process.wait(20) == 0


def test_run_is_remapped_recorded_and_plotted(
    linkage: Run, tmp_path: Path, scene: Path, crank: object
) -> None:
    answer = linkage(
        'run', str(scene), '--seconds', '4', '--ros-args', '-r', 'crank_states:=motor'
    )
    assert answer.returncode == 0, answer.stderr
    assert '/motor' in answer.stdout
    proof = re.search(r'(\d+) of (\d+) joint states and (\d+) of (\d+) motion ', answer.stdout)
    assert len(set(proof.groups())) == 1
    assert int(proof.group(1)) > 100
    bag = read_bag(tmp_path / 'runs' / 'b 1')
    assert recorded_scene(bag).name == 'rod scene'
    assert sum(message.topic == '/joint_states' for message in bag.messages()) > 100
    drawn = linkage('plot', 'runs/b 1', '-o', 'rod.svg')
    assert drawn.returncode == 0, drawn.stderr
    svg = (tmp_path / 'rod.svg').read_text()
    assert svg.startswith('<?xml')


def test_run_takes_a_linkage_file_without_a_scene(linkage: Run, tmp_path: Path) -> None:
    (tmp_path / 'designed.yaml').write_text('four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n')
    answer = linkage('run', 'designed.yaml', '--seconds', '1', '--plain')
    assert answer.returncode == 0, answer.stderr
    assert 'designed: ticking at 1000 Hz; crank crank_joint driven by constant_rate' in (
        answer.stdout + answer.stderr
    )
    assert not (tmp_path / 'runs').exists()


@pytest.mark.parametrize(('options', 'unit'), [((), '°'), (('--radians',), ' rad')])
def test_run_prints_joints_with_their_units(
    linkage: Run, options: tuple[str, ...], unit: str
) -> None:
    file = Path(__file__).parents[2] / 'config' / 'linkages' / 'slider_crank.yaml'
    answer = linkage('run', str(file), '--seconds', '1.5', '--plain', *options)
    assert answer.returncode == 0, answer.stderr
    number = r'-?[\d.]+'
    assert re.search(rf'crank_joint {number}{unit}  .*piston_slide {number} m', answer.stdout)


def test_run_numbers_its_bag_where_the_folder_exists(
    linkage: Run, tmp_path: Path, scene: Path
) -> None:
    taken = tmp_path / 'runs' / 'b 1'
    taken.mkdir(parents=True)
    answer = linkage('run', str(scene), '--seconds', '1')
    assert answer.returncode == 0
    assert 'runs/b 1_2: b 1 exists already' in answer.stderr
    assert list(taken.iterdir()) == []
    assert not read_bag(tmp_path / 'runs' / 'b 1_2').truncated


def test_plot_refuses_a_bag_without_joint_states(
    linkage: Run, tmp_path: Path, scene: Path
) -> None:
    files = {
        'scene.yaml': ('', b'linkage: x\n'),
        'linkage.yaml': ('', b'four_bar: {a: 1, b: 3, c: 3, d: 4}\n'),
        'run.json': ('', b'{"scene": "s", "crank_topic": "/c", "joint_states_topic": "/j"}'),
    }
    BagWriter(
        tmp_path / 'empty', [Topic('/c', 'sensor_msgs/msg/JointState', '', '')], files
    ).close()
    answer = linkage('plot', 'empty')
    assert answer.returncode == 2
    assert answer.stderr == (
        'linkage plot: empty: holds no joint states; record a run with a crank\n'
    )


def test_plot_names_a_picture_that_it_cannot_write(
    linkage: Run, tmp_path: Path, scene: Path, crank: object
) -> None:
    linkage('run', str(scene), '--seconds', '3', '--ros-args', '-r', 'crank_states:=motor')
    for picture in ('no/such/folder.png', 'picture.docx'):
        answer = linkage('plot', 'runs/b 1', '-o', picture)
        assert answer.returncode == 2
        assert picture in answer.stderr
        assert 'Traceback' not in answer.stderr
