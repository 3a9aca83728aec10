# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Ratios in robot models: mimic of a URDF, there and back, and joint equalities of MuJoCo."""

from math import hypot, remainder, tau
from random import Random

from linkage_ros.errors import FileError
from linkage_ros.kinematics import Closure, InputSweep, Ratio, sample_inputs
from linkage_ros.tools.models import (
    ModelPart,
    mujoco_model,
    urdf_model,
)
import numpy as np
import pytest

from .test_import import joint, weighed
from .walked import Walked
from ...kinematics.test_ratios import geared_five_bar, rack_and_pinion
from ...support.robots import robot_of
from ...support.scenes import closure_of, LINKAGES

MOTOR = '<mimic joint="left_joint" multiplier="{}" offset="{}"/>'


def hand(random: Random, multiplier: float, offset: float, axis: str) -> tuple[str, list[str]]:
    """Return a URDF of two four-bar fingers, closed with the joints at 0, and where they close."""
    parts = ['<link name="base"/>']
    places = []
    for side, sign in (('left', -1.0), ('right', 1.0)):
        knuckle, inner = sign * random.uniform(0.03, 0.05), sign * random.uniform(0.01, 0.02)
        a = sign * random.uniform(0.01, 0.03), -random.uniform(0.04, 0.06)
        b = sign * random.uniform(0.0, 0.02), -random.uniform(0.05, 0.07)
        parts += [f'<link name="{side}"/><link name="{side}_in"/><link name="{side}_tip"/>']
        mimic = MOTOR.format(multiplier, offset) if side == 'right' else ''
        turned = axis if side == 'right' else '0 0 1'
        # The right knuckle stands at its offset where the motor is at 0.
        rpy = f'0 0 {-offset if axis == "0 0 1" else offset}' if side == 'right' else '0 0 0'
        parts += [
            joint(f'{side}_joint', 'base', side, f'{knuckle} 0 0', rpy, axis=turned, more=mimic),
            joint(f'{side}_in_joint', 'base', f'{side}_in', f'{inner} 0 0', axis='0 0 1'),
            joint(f'{side}_tip_joint', side, f'{side}_tip', f'{a[0]} {a[1]} 0', axis='0 0 1'),
        ]
        along = knuckle + a[0], a[1]
        there = inner + b[0] - along[0], b[1] - along[1]
        places.append(f'{side}_tip.{there[0]},{there[1]},0')
        places.append(f'{side}_in.{b[0]},{b[1]},0')
    return f'<robot name="hand">{"".join(parts)}</robot>', places


def hand_of(text: str, places: list[str], **told: object) -> Closure:
    """Return the linkage of a hand whose places meet."""
    close = [f'{one}={other}' for one, other in zip(places[::2], places[1::2], strict=True)]
    closure: Closure = robot_of(text, close=close, input='left_joint', **told)
    return closure


@pytest.mark.sample(1)
@pytest.mark.parametrize('axis', ['0 0 1', '0 0 -1'])
@pytest.mark.parametrize(('multiplier', 'offset'), [(-1.0, 0.0), (1.0, 0.2), (0.5, -0.3)])
def test_urdf_mimic_becomes_a_ratio(multiplier: float, offset: float, axis: str) -> None:
    """Places on links close the loops, as yourdfpy walks them; the joint goes as mimic says."""
    random = Random(f'{multiplier} {offset} {axis}')
    for _ in range(3):
        text, places = hand(random, multiplier, offset, axis)
        closure = hand_of(text, places, at={'right_joint': offset})
        assert closure.linkage.left_out == ()
        assert closure.linkage.ratios == {'right_joint': Ratio('left_joint', multiplier, offset)}
        walked = Walked(text.replace(MOTOR.format(multiplier, offset), '').encode())
        for motor in (-0.05, 0.0, 0.04):
            joints = closure.position(motor).joints
            values = dict(zip(closure.joint_names, joints, strict=True)) | {'left_joint': motor}
            wanted = multiplier * motor + offset
            assert abs(remainder(values['right_joint'] - wanted, tau)) < 1e-12
            walked.model.update_cfg(values)
            for one, other in zip(places[::2], places[1::2], strict=True):
                ends = []
                for place in (one, other):
                    link, numbers = place.split('.', 1)
                    at = np.array([*map(float, numbers.split(',')), 1.0])
                    ends.append((walked.model.get_transform(link, 'base') @ at)[:3])
                assert hypot(*(ends[0] - ends[1])) < 1e-12


def test_redundant_mimics_are_listed_as_left_out() -> None:
    """Of two mimics one is needed; that of gears on the base comes first."""
    text, places = hand(Random(1), -1.0, 0.0, '0 0 1')
    text = text.replace(
        '</joint><joint name="right_tip_joint"',
        f'{MOTOR.format(0.9, 0.0)}</joint><joint name="right_tip_joint"',
    )
    linkage = hand_of(text, places).linkage
    assert set(linkage.ratios) == {'right_joint'}
    assert linkage.left_out == ('mimic of right_in_joint',)


def test_mimic_robot_needs_no_loop() -> None:
    """A rack on a pinion."""
    mimic = '<mimic joint="pinion_joint" multiplier="0.012" offset="0.001"/>'
    text = (
        '<robot name="r"><link name="base"/><link name="pinion"/>'
        + weighed('rack', 0.1)
        + joint('pinion_joint', 'base', 'pinion', '0 0 0', axis='0 0 1')
        + joint('rack_joint', 'base', 'rack', '0 0.012 0', '', 'prismatic', '1 0 0', mimic)
        + '</robot>'
    ).replace('rpy=""', '')
    assert robot_of(text, input='pinion_joint').position(2.0)['rack_joint'] == pytest.approx(
        0.025, rel=1e-15
    )


def test_closing_place_on_an_unknown_link_is_refused() -> None:
    """One line says which links there are."""
    text, places = hand(Random(1), -1.0, 0.0, '0 0 1')
    with pytest.raises(FileError, match='there is no link'):
        hand_of(text, [places[0].replace('left_tip', 'left_top'), *places[1:]])


SHAPES = {
    'geared five-bar': lambda: geared_five_bar(
        (6.0, 1.0, 7.0, 9.0, 4.0), Ratio('theta2', 2.0, 0.5)
    ),
    'rack': lambda: rack_and_pinion(0.012),
    'gripper': lambda: closure_of((LINKAGES / 'gripper.yaml').read_bytes()).linkage,
}


@pytest.mark.parametrize('name', SHAPES)
def test_ratios_survive_the_urdf_round_trip(name: str) -> None:
    """The ratio is a mimic, and the joints come back the same."""
    closure = Closure(SHAPES[name]())
    data = urdf_model('r', [ModelPart(closure)])
    again = robot_of(data)
    # Frames of the model that turn with links follow as well.
    assert again.linkage.ratios.items() >= closure.linkage.ratios.items()
    for interval in InputSweep(closure).ranges:
        for value in sample_inputs(interval, 24)[1:-1]:
            here, there = closure.position(value), again.position(value)
            for joint_name, turns in zip(closure.joint_names, closure.turning, strict=True):
                off = there[joint_name] - here[joint_name]
                assert abs(remainder(off, tau) if turns else off) < 1e-11


@pytest.mark.parametrize('name', SHAPES)
def test_mujoco_model_keeps_the_ratio(name: str) -> None:
    """The engine starts closed, and still has the ratio when its servo has moved the input."""
    mujoco = pytest.importorskip('mujoco')
    closure = Closure(SHAPES[name]())
    model = mujoco.MjModel.from_xml_string(mujoco_model('r', [ModelPart(closure)]).decode())
    state = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, state, model.key('start').id)

    def value(joint_name: str) -> float:
        return float(state.qpos[model.joint(joint_name).qposadr[0]])

    ((follower, given),) = closure.linkage.ratios.items()
    state.ctrl[0] += 0.1
    begun = value(given.of)
    for steps in (0, 2000):
        for _ in range(steps):
            mujoco.mj_step(model, state)
        off = value(follower) - given.ratio * value(given.of) - given.offset
        assert abs(remainder(off, tau)) < 2e-3
    assert value(given.of) - begun == pytest.approx(0.1, abs=0.02)
