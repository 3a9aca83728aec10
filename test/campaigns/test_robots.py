# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The judge of published robots, on robots of our own."""

from pathlib import Path

from campaigns.robots import Judge, Robot
from linkage_ros import load
from linkage_ros.description import read_as_urdf
from linkage_ros.kinematics import PlanarClosure
import pytest

ROBOTS = Path(__file__).parents[1] / 'tools' / 'models' / 'robots'
TYPED = {
    'ankle.urdf': ('pitch', 'roll'),
    'rods_on_three_hinges.urdf': ('m1', 'm2'),
    'palletizer.urdf': ('shoulder', 'counterweight'),
    'ankle.sdf': ('pitch', 'roll'),
}


def judged(name):
    """Return a judge, the inputs, and values of all joints in a state."""
    file, typed = ROBOTS / name, TYPED[name]
    closure = load(file, Robot(ROBOTS, '', name, typed).options)
    is_planar = isinstance(closure, PlanarClosure)
    position = closure.position(*(value + 0.05 for value in closure.linkage.pose.inputs))
    names = closure.input_names, closure.joint_names
    values = {
        joint: value
        for of, found in zip(names, (position.inputs, position.joints), strict=True)
        for joint, value in zip(of, found, strict=True)
    }
    judge = Judge(read_as_urdf(file), closure.linkage.left_out, is_planar=is_planar)
    return judge, closure.input_names, values


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', TYPED)
def test_judge_agrees_with_the_closure(name):
    judge, held, values = judged(name)
    assert judge.loops
    assert judge.difference(values, held) < 1e-13


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', TYPED)
def test_judge_finds_a_joint_that_is_off(name):
    judge, held, values = judged(name)
    joint = next(each for each in values if each not in held)
    off = {**values, joint: values[joint] + 1e-6}
    assert judge.difference(off, held) > 2e-7


def test_judge_returns_the_gap_of_loops_that_stay_open():
    judge, _, values = judged('ankle.urdf')
    values['pitch'] += 0.1
    assert judge.difference(values, [name for name in values if name != 'roll']) > 1e-3
