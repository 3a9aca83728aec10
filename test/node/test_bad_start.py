# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A configuration that is wrong: one line on stderr, exit code 2, and no traceback.

One that only looks wrong: the node warns, and starts.
"""

import os
import subprocess
import sys

import pytest

from ..support.scenes import LONG_COUPLER

REAL_STARTS = True

CONFIGURATION = 2

FILES = {
    'no such scene': (None, 'nowhere.yaml: cannot be read (No such file or directory)'),
    'unknown key': (b'rtae: 5', "scene.yaml:2: rtae: unknown key; did you mean 'rate'?"),
    'absurd rate': (b'rate: 1e9', 'scene.yaml:2: rate: 1000000000.0 is out of bounds'),
    'not UTF-8': (b'# \xff', 'scene.yaml: is not UTF-8'),
    'unknown effect': (
        b'effects: {velocty: {}}',
        "scene.yaml:2: effects.velocty: unknown key; did you mean 'velocity'?",
    ),
}

ARGUMENTS = {
    'no scene': ([], "parameter scene: '' names no file"),
    'period NaN': (['-p', 'diagnostics_period:=.nan'], 'diagnostics_period'),
}


@pytest.fixture
def stderr_of(domain, tmp_path):
    """Return a function that runs a node that must not start, and gives what it says."""

    def stderr_of(*arguments):
        done = subprocess.run(
            [sys.executable, '-m', 'linkage_ros.node.linkage_node', '--ros-args', *arguments],
            env=os.environ | {'ROS_DOMAIN_ID': str(domain), 'ROS_LOG_DIR': str(tmp_path)},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
            timeout=30,
        )
        assert done.returncode == CONFIGURATION, done.stderr
        assert done.stdout == ''
        return done.stderr

    return stderr_of


@pytest.mark.sample(2)
@pytest.mark.parametrize('kind', FILES)
def test_bad_scene_file_is_reported_in_one_line(stderr_of, write_scene, tmp_path, kind):
    content, expected = FILES[kind]
    scene = tmp_path / ('nowhere.yaml' if content is None else 'scene.yaml')
    if content is not None:
        linkage = write_scene('any', '').read_bytes()
        scene.write_bytes(linkage.replace(b'\n\n', b'\n') + content)
    (line,) = stderr_of('-p', f'scene:={scene}').splitlines()
    assert expected in line
    assert str(scene) in line


@pytest.mark.sample(1)
@pytest.mark.parametrize('kind', ARGUMENTS)
def test_bad_node_argument_is_reported_in_one_line(stderr_of, kind):
    arguments, expected = ARGUMENTS[kind]
    (line,) = stderr_of(*arguments).splitlines()
    assert expected in line


def test_node_warns_of_lengths_and_angles_in_other_units(start, write_scene):
    sine = 'rate: 100\ndrive: {sine: {amplitude: 45, frequency: 1}}'
    scene = write_scene('odd_units', sine, LONG_COUPLER.lstrip())
    log = start(scene).log
    linkage = scene.with_name('odd_units_linkage.yaml')
    warned = [line.partition(']: ')[2] for line in log.splitlines() if line.startswith('[WARN]')]
    assert warned[:2] == [
        (
            f"{linkage}:4: links.coupler: is 3000 times as long as 'crank'; "
            'write all lengths in metres, or all in millimetres with units: mm'
        ),
        (
            f'{scene}:3: drive.sine.amplitude: 45 rad is more than a turn; '
            'if it is in degrees, write angles: degrees'
        ),
    ]
