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


"""
What a scene does not call for is not imported, not built, and not in the trace of a tick.

One scene for each effect, drive and fault, with that alone: what it brings along is written beside
it, and everything else has to be absent.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
import subprocess
import sys

from linkage_ros.drives.drive import DRIVES
from linkage_ros.effects.stage import EFFECTS
from linkage_ros.faults.fault import FAULTS
import pytest

ROOT = Path(__file__).parents[1]

BARE = 'drive: {constant_rate: {rate: 2.0}}\n'
KINEMATICS = {'effects.velocity', 'effects.acceleration'}
FORCES = {*KINEMATICS, 'dynamics.mechanics', 'dynamics.reactions', 'effects.pin_forces'}
PINS = {'messages.multi_dof_joint_state'}
DRAWN = {
    'effects.marker_arrows',
    'effects.marker_shapes',
    'messages.marker_array',
    'drawing.curves',
    'drawing.figure',
    'drawing.labels',
    'drawing.painting',
    'drawing.shapes',
}

# Name: (scene, modules that are there beside those of the empty scene).
SCENES = {
    'tolerance': ('effects: {tolerance: {standard_deviation: 1.0e-5}}', set()),
    'backlash': ('effects: {backlash: {play: 0.01}}', set()),
    'velocity': ('effects: {velocity: {}}', set()),
    'acceleration': (
        'effects: {acceleration: {}}',
        {'effects.velocity', 'messages.joint_trajectory'},
    ),
    'friction': (
        'effects: {effort: {}, friction: {joints: {A: {viscous: 0.1}}}}',
        {*KINEMATICS, 'effects.effort', 'dynamics.mechanics'},
    ),
    'effort': ('effects: {effort: {}}', {*KINEMATICS, 'dynamics.mechanics'}),
    'pin_forces': ('effects: {pin_forces: {}}', FORCES | PINS),
    'compliance': ('effects: {compliance: {links: {coupler: 1.0e6}}}', FORCES),
    'clearance': ('effects: {clearance: {pins: {A: 1.0e-5}}}', FORCES),
    'jitter': ('effects: {jitter: {seconds: 0.001}}', {'effects.history', 'effects.velocity'}),
    'bias': ('effects: {bias: {joints: {rocker_joint: 0.1}}}', set()),
    'noise': ('effects: {noise: {joints: {rocker_joint: {white: 0.001}}}}', set()),
    'encoder': ('effects: {encoder: {joints: {rocker_joint: {counts: 4096}}}}', set()),
    'rate_limit': ('effects: {rate_limit: {rate: 100}}', set()),
    'dropout': ('effects: {dropout: {probability: 0.1}}', set()),
    'delay': ('effects: {delay: {seconds: 0.002}}', {'effects.history', 'effects.velocity'}),
    'markers': ('effects: {markers: {}}', DRAWN),
}
SILENT = {'not_a_number': 'drive: {topic: {}}\n'}
FAULT_SCENES = {
    'time_jump': 'time_jump: {by: 1.0}',
    'not_a_number': 'not_a_number: {}',
    'broken_link': 'broken_link: {link: coupler}',
    'stuck': 'stuck: {joint: rocker_joint}',
    'freeze': 'freeze: {}',
    'silence': 'silence: {}',
}
DRIVE_SCENES = {
    'topic': ('topic: {}', set()),
    'constant_rate': ('constant_rate: {rate: 2.0}', set()),
    'profile': ('profile: {table: [[0, 0.0], [1, 1.0]]}', set()),
    'sine': ('sine: {amplitude: 1.0, frequency: 1.0}', set()),
    'chirp': (
        'chirp: {amplitude: 1.0, start_frequency: 1.0, end_frequency: 5.0, seconds: 10.0}',
        set(),
    ),
    'torque': ('torque: {}', set()),
}

SOLVER_SCENES = {
    'solver: closed_form': set(),
    'solver: {newton: {tolerance: 1.0e-9}}': {
        'solvers.newton',
        'solvers.loops',
        'solvers.solver',
    },
    'solver: {table: {tolerance: 1.0e-3}}': {
        'solvers.table',
        'solvers.proof',
        'solvers.validated_enclosure',
        'solvers.loops',
        'solvers.solver',
    },
}

# Run in a process of its own: builds the scene, says what was imported, and which files the tick
# then passed through.
PROGRAM = """
import json, sys
from linkage_ros.pipeline import Pipeline
from linkage_ros.scene.load import load_scene
pipeline = Pipeline(load_scene(sys.argv[1]))
modules = sorted(sys.modules)
seen = set()
sys.setprofile(lambda frame, event, _: seen.add(frame.f_code.co_filename))
for number in range(4):
    pipeline.tick(1_700_000_000_000_000_000 + number * 1_000_000)
sys.setprofile(None)
stages = [line.stages for line in pipeline.lines][0]
print(json.dumps([modules, sorted(seen), stages, sorted(sys.modules)]))
"""


def look(folder, scene):
    """Return what is imported, what a tick passes through, and the stages that are held."""
    (folder / 'scene.yaml').write_text(f'linkage: {ROOT}/config/linkages/four_bar.yaml\n{scene}\n')
    done = subprocess.run(
        [sys.executable, '-c', PROGRAM, str(folder / 'scene.yaml')],
        cwd=ROOT,
        env=os.environ | {'PYTHONPATH': str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    modules, files, stages, modules_after = json.loads(done.stdout)
    assert modules_after == modules, 'a tick has imported something'
    prefix = 'linkage_ros.'
    ours = {name.removeprefix(prefix) for name in modules if name.startswith(prefix)}
    package = str(ROOT / 'linkage_ros')
    passed = {
        file.removeprefix(f'{package}/').removesuffix('.py').replace('/', '.')
        for file in files
        if file.startswith(package)
    }
    return ours, passed, set(stages), set(modules)


OPTIONAL = {
    name.removeprefix('linkage_ros.')
    for registry in (EFFECTS, DRIVES, FAULTS)
    for name in registry.values()
} | {
    *FORCES,
    *PINS,
    *DRAWN,
    'effects.history',
    'messages.joint_trajectory',
    'faults.injection',
    'messages.joint_effort',
}
"""Modules that a scene may or may not have; the rest is always there."""


def test_every_effect_and_fault_has_its_scene():
    assert set(SCENES) == set(EFFECTS)
    assert set(FAULT_SCENES) == set(FAULTS)
    assert {*DRIVE_SCENES, 'bag'} == set(DRIVES)


def test_an_empty_scene_has_nothing(tmp_path):
    modules, passed, stages, everything = look(tmp_path, BARE)
    assert modules & OPTIONAL == {'drives.constant_rate'}
    assert passed & OPTIONAL == {'drives.constant_rate'}
    assert solvers_of(modules) == {'solvers.registry'}
    assert not solvers_of(passed)
    assert stages == set()
    assert not everything & {'numpy', 'rclpy'}


@pytest.mark.parametrize('effect', SCENES)
def test_a_scene_with_one_effect_has_no_other(tmp_path, effect):
    scene, beside = SCENES[effect]
    modules, passed, stages, everything = look(tmp_path, BARE + scene)
    allowed = {f'effects.{effect}', 'drives.constant_rate', *beside}
    assert modules & OPTIONAL == allowed
    assert passed & OPTIONAL <= allowed
    assert f'effects.{effect}' in passed or effect in ('tolerance', 'friction')
    assert stages == {name.split('.')[1] for name in allowed if name in EFFECT_MODULES}
    assert ('numpy' in everything) == ('dynamics.reactions' in beside)


def solvers_of(modules):
    """Return those modules that are of the solvers' room."""
    return {name for name in modules if name.startswith('solvers.')}


@pytest.mark.parametrize('scene', SOLVER_SCENES)
def test_a_scene_with_one_solver_has_no_other(tmp_path, scene):
    modules, passed, _, everything = look(tmp_path, BARE + scene)
    allowed = SOLVER_SCENES[scene]
    assert solvers_of(modules) == {'solvers.registry', *allowed}
    # What proves a table, or knows the closed form, has no part in a tick.
    assert solvers_of(passed) <= {'solvers.newton', 'solvers.table'} & allowed
    assert ('numpy' in everything) == ('solvers.table' in allowed)


EFFECT_MODULES = {name.removeprefix('linkage_ros.') for name in EFFECTS.values()}


@pytest.mark.parametrize('drive', DRIVE_SCENES)
def test_a_scene_with_one_drive_has_no_other(tmp_path, drive):
    scene, _ = DRIVE_SCENES[drive]
    modules, passed, _, everything = look(tmp_path, f'drive: {{{scene}}}')
    drives = {name for name in OPTIONAL if name.startswith('drives.')}
    assert modules & drives == {f'drives.{drive}'}
    # The lines of the topic drive stand in the tick that is written for the scene.
    assert passed & drives == ({f'drives.{drive}'} - {'drives.topic'})
    assert (
        ('dynamics.mechanics' in modules)
        == ('messages.joint_effort' in modules)
        == (drive == 'torque')
    )
    assert 'numpy' not in everything


@pytest.mark.parametrize('fault', FAULT_SCENES)
def test_a_scene_with_one_fault_has_no_other(tmp_path, fault):
    drive = SILENT.get(fault, BARE)
    modules, passed, _, _ = look(tmp_path, f'{drive}faults: {{mine: {{{FAULT_SCENES[fault]}}}}}')
    faults = {name for name in OPTIONAL if name.startswith('faults.')}
    assert modules & faults == {f'faults.{fault}', 'faults.injection'}
    assert passed & faults <= {f'faults.{fault}', 'faults.injection'}


def test_a_robot_model_is_made_where_it_is_asked_for_alone(tmp_path):
    """Neither building a scene nor the node's own modules bring it: configuring the node does."""
    for scene in ('', 'robot_description: true\n'):
        modules, passed, _, _ = look(tmp_path, BARE + scene)
        assert not {name for name in modules | passed if name.startswith('models')}
    pytest.importorskip('rclpy')
    done = subprocess.run(
        [sys.executable, '-c', 'import sys, linkage_ros.ros.node; print(*sys.modules)'],
        cwd=ROOT,
        env=os.environ | {'PYTHONPATH': str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    loaded = done.stdout.split()
    assert 'linkage_ros.ros.scene_topics' in loaded
    assert not [name for name in loaded if name.startswith('linkage_ros.models')]
