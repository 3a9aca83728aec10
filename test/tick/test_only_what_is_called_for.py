# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A scene imports and builds only what it calls for; nothing else is in the trace of a tick.

One scene for each effect, drive, fault and solver, with that alone, in a process of its own: its
arrays, stages and topics are those that were asked for, and so is what Python has loaded.
"""

import json
import os
import subprocess
import sys
from typing import NamedTuple

from linkage_ros.stages.drives import DRIVES
from linkage_ros.stages.effects import effect_class, EFFECTS
from linkage_ros.stages.faults import FAULTS
import pytest

from ..support.messages import read_joint_state
from ..support.scenes import LINKAGES, ROOT

BARE = 'drive: {constant_rate: {rate: 2.0}}\n'


class Expected(NamedTuple):
    """A scene with one effect, and what it has that the empty scene has not."""

    brings: tuple[str, ...] = ()  # Effects that it starts from
    arrays: tuple[str, ...] = ()  # Arrays of the joint state that are not empty
    # Packages of ours of which more is imported; that of the effects always is.
    packages: tuple[str, ...] = ()
    topics: tuple[str, ...] = ()  # Further topics


RATES = ('velocity', 'acceleration')
FORCES = (*RATES, 'pin_forces')
SCENES = dict.fromkeys(EFFECTS, Expected()) | {
    'velocity': Expected(arrays=('velocity',)),
    'acceleration': Expected(('velocity',), ('velocity',), topics=('~/motion',)),
    'friction': Expected((*RATES, 'effort'), ('effort',), ('dynamics',)),
    'effort': Expected(RATES, ('effort',), ('dynamics',)),
    'pin_forces': Expected(RATES, (), ('dynamics',), ('~/pin_forces',)),
    'compliance': Expected(FORCES, packages=('dynamics',)),
    'clearance': Expected(FORCES, packages=('dynamics',)),
    'jitter': Expected(('velocity',)),
    'delay': Expected(('velocity',)),
    'markers': Expected(topics=('~/markers',)),
}
VECTORS = {'linkage_ros.kinematics.space', 'linkage_ros.kinematics.space.vectors'}
"""What a planar linkage has of space: markers and forces have three components."""
ALTERING = {'tolerance', 'friction'}
"""Effects that change what is built, and have no part in a tick."""
FAULT_SCENES = {
    'time_jump': 'time_jump: {by: 1.0}',
    'not_a_number': 'not_a_number: {}',
    'broken_link': 'broken_link: {link: coupler}',
    'stuck': 'stuck: {joint: rocker_joint}',
    'freeze': 'freeze: {}',
    'silence': 'silence: {}',
}
DRIVE_SCENES = {
    'topic': 'topic: {}',
    'constant_rate': 'constant_rate: {rate: 2.0}',
    'profile': 'profile: {table: [[0, 0.0], [1, 1.0]]}',
    'sine': 'sine: {amplitude: 1.0, frequency: 1.0}',
    'chirp': 'chirp: {amplitude: 1.0, start_frequency: 1.0, end_frequency: 5.0, seconds: 10.0}',
    'torque': 'torque: {}',
}


# Run in a process of its own: build the scene, and print the imported modules, the topics that the
# tick then published, and the files it passed through.
PROGRAM = """
import json, sys
from linkage_ros.tick.pipeline import Pipeline
from linkage_ros.description.scene_file import load_scene
pipeline = Pipeline(load_scene(sys.argv[1]))
modules = sorted(sys.modules)
seen = set()
sys.setprofile(lambda frame, event, _: seen.add(frame.f_code.co_filename))
ticks = [pipeline.tick(1_700_000_000_000_000_000 + number * 1_000_000) for number in range(4)]
sys.setprofile(None)
print(json.dumps({
    'modules': modules, 'after': sorted(sys.modules), 'files': sorted(seen),
    'messages': [tick.message.hex() for tick in ticks if tick.message],
    'stages': [*pipeline.linkages[0].wanted.effects],
    'topics': [extra.topic for extra in pipeline.extras],
}))
"""


def run_python(*arguments):
    """Return what a Python process of its own prints."""
    done = subprocess.run(
        [sys.executable, '-c', *arguments],
        cwd=ROOT,
        env=os.environ | {'PYTHONPATH': str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


class Look:
    """What a scene has: imports, files that a tick passes through, arrays, stages, topics."""

    def __init__(self, folder, scene):
        file = folder / 'scene.yaml'
        file.write_text(f'linkage: {LINKAGES}/four_bar.yaml\n{scene}\n')
        told = json.loads(run_python(PROGRAM, str(file)))
        assert told['after'] == told['modules'], 'a tick has imported something'
        self.modules = set(told['modules'])
        spatial = {name for name in self.modules if '.space' in name or '.spatial' in name}
        assert spatial <= VECTORS, 'the linkage is planar'
        package = f'{ROOT}/'
        self.passed = {
            file.removeprefix(package).removesuffix('.py').replace('/', '.')
            for file in told['files']
            if file.startswith(f'{package}linkage_ros/')
        }
        messages = [read_joint_state(bytes.fromhex(each)) for each in told['messages']]
        self.arrays = {
            name
            for name in ('velocity', 'effort')
            for each in messages
            if len(getattr(each, name))
        }
        self.topics = told['topics']
        self.stages = set(told['stages'])
        assert 'rclpy' not in self.modules


COMMON = {'description', 'kinematics', 'messages'}
FAULTS_MODULE = 'linkage_ros.stages.faults'
OPTIONAL = {'dynamics', 'tools'}
"""Packages of which nothing is in a tick, unless the scene asks for it."""


EFFECT_MODULES, DRIVE_MODULES = (
    {name: path.rpartition('.')[0] for name, path in registry.items()}
    for registry in (EFFECTS, DRIVES)
)


def of_registry(names, modules):
    """Return which effects or drives have their module among some."""
    return {name for name, module in names.items() if module in modules}


def sharing(names, modules=EFFECT_MODULES):
    """Return effects or drives, and those that stand in the same files."""
    return of_registry(modules, {modules[name] for name in names})


def packages(modules):
    """Return which packages of ours modules lie in; messages are there for their topics."""
    parts = (module.split('.') for module in modules if module.startswith('linkage_ros.'))
    # The folders of the stages are told apart; the workbench is one.
    return {
        '.'.join(part[1:3]) if part[1] == 'stages' else part[1] for part in parts if len(part) > 2
    } - COMMON


@pytest.fixture(scope='module')
def bare(tmp_path_factory):
    return Look(tmp_path_factory.mktemp('bare'), BARE)


def test_every_effect_drive_and_fault_has_its_scene():
    assert set(SCENES) == set(EFFECTS)
    assert set(FAULT_SCENES) == set(FAULTS)
    assert {*DRIVE_SCENES, 'bag'} == set(DRIVES)


def test_empty_scene_imports_no_effect_fault_or_numpy(bare):
    for found in (bare.modules, bare.passed):
        assert not of_registry(EFFECT_MODULES, found)
        assert FAULTS_MODULE not in found
        assert of_registry(DRIVE_MODULES, found) == sharing({'constant_rate'}, DRIVE_MODULES)
    assert not packages(bare.passed) & OPTIONAL
    assert not bare.stages
    assert not bare.arrays
    assert not bare.topics
    assert 'numpy' not in bare.modules


@pytest.mark.sample(3)
@pytest.mark.parametrize('effect', SCENES)
def test_scene_with_one_effect_imports_no_other(tmp_path, bare, effect):
    expected = SCENES[effect]
    # Friction acts where forces are.
    beside = ', effort: {}' if effect == 'friction' else ''
    look = Look(tmp_path, f'{BARE}effects: {{{effect}: {effect_class(effect).sample}{beside}}}')
    effects = {effect, *expected.brings}
    assert look.stages == effects
    assert of_registry(EFFECT_MODULES, look.modules) == sharing(effects)
    assert of_registry(EFFECT_MODULES, look.passed) <= sharing(effects)
    assert effect in of_registry(EFFECT_MODULES, look.passed) or effect in ALTERING
    assert look.arrays == set(expected.arrays)
    assert look.topics == list(expected.topics)
    assert packages(look.modules - bare.modules) == {'stages.effects', *expected.packages}
    assert packages(look.passed) & OPTIONAL <= set(expected.packages)
    assert of_registry(DRIVE_MODULES, look.modules) == sharing({'constant_rate'}, DRIVE_MODULES)
    assert FAULTS_MODULE not in look.modules
    assert 'numpy' not in look.modules


@pytest.mark.sample(3)
@pytest.mark.parametrize('drive', DRIVE_SCENES)
def test_scene_with_one_drive_imports_no_other(tmp_path, bare, drive):
    look = Look(tmp_path, f'drive: {{{DRIVE_SCENES[drive]}}}')
    drives = sharing({drive}, DRIVE_MODULES)
    assert of_registry(DRIVE_MODULES, look.modules) == drives
    # The lines of the topic drive stand in the tick that is written for the scene; the crank of
    # the torque drive stands in a file of its own.
    assert of_registry(DRIVE_MODULES, look.passed) == drives - {'topic', 'torque'}
    crank = 'linkage_ros.stages.drives.torque_crank'
    assert (crank in look.passed) == (drive == 'torque')
    assert 'linkage_ros.stages.drives.several_torques' not in look.modules
    assert ('dynamics' in packages(look.modules - bare.modules)) == (drive == 'torque')
    assert 'numpy' not in look.modules


_DYNAMICS = 'linkage_ros.dynamics.'


def test_motor_modules_are_imported_on_request_only(tmp_path):
    wound = 'motor: {torque_constant: 1, resistance: 1, inductance: 1, command: voltage}'
    for motor, parts in (
        ('', set()),
        ('motor: {torque_constant: 1.0}', {'motor'}),
        (wound, {'motor', 'winding'}),
    ):
        look = Look(tmp_path, f'drive: {{torque: {{{motor}}}}}')
        assert {part for part in ('motor', 'winding') if _DYNAMICS + part in look.modules} == parts


def test_wrench_modules_are_imported_on_request_only(tmp_path):
    theirs = {f'linkage_ros.{name}' for name in ('dynamics.wrenches', 'tick.wrench_topics')}
    theirs.add('linkage_ros.messages.wrench')
    other = 'efforts: {rocker_joint: {constant: 1}}'
    for loads, there in ((other, set()), (f'{other}, wrenches: {{coupler: {{}}}}', theirs)):
        look = Look(tmp_path, f'drive: {{torque: {{}}}}\nloads: {{{loads}}}')
        assert theirs & look.modules == there


@pytest.mark.sample(2)
@pytest.mark.parametrize('fault', FAULT_SCENES)
def test_scene_with_a_fault_imports_the_faults(tmp_path, fault):
    drive = 'drive: {topic: {}}\n' if fault == 'not_a_number' else BARE
    look = Look(tmp_path, f'{drive}faults: {{mine: {{{FAULT_SCENES[fault]}}}}}')
    assert FAULTS_MODULE in look.modules


def test_robot_model_modules_are_imported_on_request_only(tmp_path):
    """Neither building a scene nor the node's own modules bring it: configuring the node does."""
    for scene in ('', 'robot_description: true\n'):
        look = Look(tmp_path, BARE + scene)
        assert 'tools' not in packages(look.modules | look.passed)
    pytest.importorskip('rclpy')
    loaded = run_python('import sys, linkage_ros.node.node; print(*sys.modules)').split()
    assert 'linkage_ros.node.node' in loaded
    assert 'tools' not in packages(loaded)


def test_motor_without_play_imports_no_second_mass(tmp_path):
    for drive, is_there in (
        ('torque: {motor: {torque_constant: 0.02, resistance: 1}}', False),
        ('torque: {play: {width: 0.01, inertia: 1.0e-4}}', True),
    ):
        look = Look(tmp_path, f'rate: 100\ndrive: {{{drive}}}')
        assert ('linkage_ros.dynamics.two_masses' in look.modules) == is_there
