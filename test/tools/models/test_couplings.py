# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Joints that follow sums of others: a belt over a knee, a differential, in files and robots."""

from pathlib import Path

from linkage_ros import load
from linkage_ros.description import linkage_text
from linkage_ros.errors import DefinitionError, FileError
import numpy as np
import pytest

BELT = (Path(__file__).parent / 'robots' / 'belt.urdf').read_text('utf-8')
RNG = np.random.default_rng(12)


def robot(folder, text, **told):
    file = folder / 'robot.urdf'
    file.write_text(text)
    return load(file, told)


def values_of(closure, *inputs):
    """Return all joints at some inputs, and their rates at random ones, with these."""
    rates = RNG.uniform(-1.0, 1.0, len(inputs))
    position = closure.position(*inputs)
    velocity = closure.velocity(position, *rates)
    names = (*closure.input_names, *closure.joint_names)
    return (
        dict(zip(names, (*inputs, *position.joints), strict=True)),
        dict(zip(names, (*rates, *velocity.joints), strict=True)),
    )


@pytest.mark.parametrize(
    'inputs',
    [[], ['knee', 'ankle'], ['rotor_joint', 'knee'], ['ankle', 'rotor_joint']],
    ids=['as the file says', 'joints', 'rotor and knee', 'ankle and rotor'],
)
def test_belt_coupling_turns_the_rotor_by_the_sum(tmp_path, inputs):
    closure = robot(tmp_path, BELT, **({'input': inputs} if inputs else {}))
    file = tmp_path / 'written.yaml'
    file.write_text(linkage_text(closure.linkage))
    exchanged = closure.driven_by('rotor_joint', 'knee')
    for one in (closure, load(file), exchanged):
        for given in RNG.uniform(-20.0, 20.0, (10, 2)):
            for known in values_of(one, *given):
                belt = 12.0 * (known['knee'] + known['ankle'])
                assert known['rotor_joint'] == pytest.approx(belt, abs=1e-12)


DIFFERENTIAL = """
points: {}
hinges:
  left: {parent: ground, child: left_gear, at: [0, 0.1, 0], axis: [0, 1, 0]}
  right: {parent: ground, child: right_gear, at: [0, -0.1, 0], axis: [0, 1, 0]}
  pitch: {parent: ground, child: cross, at: [0, 0, 0], axis: [0, 1, 0]}
  roll: {parent: cross, child: hand, at: [0, 0, 0], axis: [1, 0, 0]}
input: [left, right]
ratios:
  pitch: {of: left, ratio: 0.5, also: {right: 0.5}}
  roll: {of: left, ratio: -0.7, also: {right: 0.7}, offset: 0}
"""


def test_differential_pitch_and_roll_follow_sum_and_difference(tmp_path):
    file = tmp_path / 'differential.yaml'
    file.write_text(DIFFERENTIAL)
    closure = load(file)
    for given in RNG.uniform(-20.0, 20.0, (10, 2)):
        for known in values_of(closure, *given):
            left, right = known['left'], known['right']
            assert known['pitch'] == pytest.approx(0.5 * (left + right), abs=1e-12)
            assert known['roll'] == pytest.approx(0.7 * (right - left), abs=1e-12)


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        (BELT.replace('value="12.0"', 'value="0"'), 'couples 2 and 1 joints by 0'),
        (BELT.replace('"false"', '"true"'), 'couples the inputs rotor_joint, ankle, knee'),
        (BELT.replace('successor link="rotor"', 'successor link="thigh"'), 'couples 2 and 0'),
    ],
)
def test_impossible_couplings_are_refused(tmp_path, text, said):
    with pytest.raises(FileError, match=said):
        robot(tmp_path, text)


@pytest.mark.parametrize(
    ('old', 'new', 'said'),
    [
        ('{right: 0.5}', '{rigth: 0.5}', "ratios.pitch.also: there is no joint 'rigth'"),
        ('{right: 0.5}', '{pitch: 0.5}', 'ratios.pitch.of: pitch follows pitch'),
        ('{right: 0.5}', '{right: 0}', 'write a ratio other than 0'),
        ('{right: 0.5}', 'right', 'ratios.pitch.also'),
    ],
)
def test_impossible_ratio_sums_are_refused(tmp_path, old, new, said):
    file = tmp_path / 'differential.yaml'
    file.write_text(DIFFERENTIAL.replace(old, new))
    with pytest.raises((DefinitionError, FileError), match=said):
        load(file)
