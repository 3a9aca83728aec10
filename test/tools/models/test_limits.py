# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Limits through URDF and back, and in MJCF; what is computed is told from what is given."""

from dataclasses import replace
from xml.etree import ElementTree as ET

from hypothesis import given, settings, strategies as st
from linkage_ros.description import read_urdf
from linkage_ros.errors import FileError
from linkage_ros.kinematics import Closure, Limits
from linkage_ros.tools.models import (
    ModelPart,
    mujoco_model,
    urdf_model,
)
import mujoco
import pytest

from ...support.robots import robot_of
from ...support.scenes import closure_of

FOUR_BAR = 'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1, SAID}'


def closed(said):
    text = FOUR_BAR.replace(', SAID', said)
    return closure_of(text)


def limits_in(data):
    """Return of each joint of a URDF its kind and what <limit> says."""
    return {
        joint.get('name'): (joint.get('type'), dict(joint.find('limit').attrib))
        for joint in ET.fromstring(data).findall('joint')
        if joint.find('limit') is not None
    }


GIVEN = {
    'none': '',
    'of the input': ', input: {limits: [0.5, 1.5], velocity: 2, effort: 3}',
    'of the input, one side': ', input: {limits: [0.5, .inf]}',
    'rate alone': ', input: {velocity: 100}',
    'effort alone, as large as what is made up': ', input: {effort: 1000}',
    'of a published joint': ', joints: {rocker_joint: {limits: [1, 2], velocity: 7}}',
    'in another turn': ', joints: {rocker_joint: {limits: [-5.25, -4.25]}}',
}


@pytest.mark.parametrize('name', GIVEN)
def test_limits_survive_the_urdf_round_trip(name):
    linkage = closed(GIVEN[name]).linkage
    made = robot_of(urdf_model('it', [ModelPart(Closure(linkage))])).linkage
    assert made.limits == linkage.limits


WIDTH = st.floats(0.5, 3.0)


@settings(max_examples=30, deadline=None)
@given(low=st.floats(-3.0, 3.0), width=WIDTH, rate=st.none() | st.floats(1e-6, 1e6))
def test_random_input_limits_survive_the_urdf_round_trip(low, width, rate):
    said = f'limits: [{low!r}, {low + width!r}]' + (f', velocity: {rate!r}' if rate else '')
    linkage = closed(f', input: {{{said}}}').linkage
    made = robot_of(urdf_model('it', [ModelPart(Closure(linkage))])).linkage
    assert made.limits == linkage.limits


def test_urdf_writes_given_and_computed_limits():
    said = ', input: {limits: [0.5, 1.5], velocity: 2, effort: 3}'
    written = limits_in(urdf_model('it', [ModelPart(closed(said))]))
    assert written['crank_joint'] == (
        'revolute', {'lower': '0.5', 'upper': '1.5', 'effort': '3', 'velocity': '2'},
    )  # fmt: skip
    # The others are computed, over what the limits leave of the range.
    kind, limit = written['rocker_joint']
    low, high = (closed(said).position(value).joints[1] for value in (0.5, 1.5))
    assert kind == 'revolute'
    assert float(limit['lower']) == pytest.approx(min(low, high), abs=2e-3)
    assert float(limit['upper']) == pytest.approx(max(low, high), abs=2e-3)
    assert (limit['effort'], limit['velocity']) == ('1000', '100')


def test_edited_urdf_limits_are_kept():
    data = urdf_model('it', [ModelPart(closed(''))]).decode()
    _, limit = limits_in(data.encode())['rocker_joint']
    robot = ET.fromstring(data)
    for joint in robot.findall('joint'):
        if joint.get('name') == 'rocker_joint':
            joint.find('limit').set('upper', '2.0')
    made = robot_of(ET.tostring(robot)).linkage
    assert made.limits == {'rocker_joint': Limits(float(limit['lower']), 2.0)}
    for joint in robot.findall('joint'):
        if joint.get('name') == 'rocker_joint':
            joint.find('limit').set('lower', '1.0')
            joint.find('limit').set('velocity', '3')
    made = robot_of(ET.tostring(robot)).linkage
    assert made.limits == {'rocker_joint': Limits(1.0, 2.0, velocity=3.0)}
    assert limit['upper'] != '2.0'


def without_book(data):
    """Return a URDF as `linkage urdf` wrote it before it told what it had computed."""
    robot = ET.fromstring(data)
    for joint in robot.find('linkage_start'):
        for book in joint.findall('computed'):
            joint.remove(book)
    return ET.tostring(robot)


def test_urdf_without_computed_limit_record_has_no_limits():
    data = without_book(urdf_model('it', [ModelPart(closed(''))]))
    assert robot_of(data).linkage.limits == {}


def test_foreign_urdf_limits_are_read():
    robot = ET.fromstring(urdf_model('it', [ModelPart(closed(''))]))
    robot.remove(robot.find('linkage_start'))
    for joint in robot.findall('joint'):
        if joint.get('name') == 'crank_joint':
            joint.set('type', 'revolute')
            joint.find('limit').attrib.update(lower='-0.5', upper='1.5', effort='4', velocity='0')
    data = ET.tostring(robot)
    at = dict(zip(('coupler_joint', 'rocker_joint'), closed('').position(0.0).joints, strict=True))
    made = robot_of(data, input='crank_joint', at=at)
    assert made.linkage.limits['crank_joint'] == Limits(-0.5, 1.5, effort=4.0)
    assert made.linkage.limits['rocker_joint'].velocity == 100.0


@pytest.mark.parametrize(('lower', 'upper'), [('2', '1'), ('1', '1')])
def test_crossed_urdf_limits_are_refused(lower, upper):
    robot = ET.fromstring(urdf_model('it', [ModelPart(closed(''))]))
    for joint in robot.findall('joint'):
        if joint.get('name') == 'rocker_joint':
            joint.find('limit').attrib.update(lower=lower, upper=upper)
    with pytest.raises(FileError) as error:
        read_urdf(ET.tostring(robot), 'it.urdf')
    assert str(error.value) == (
        f'it.urdf: joint rocker_joint: its limits, {lower} to {upper}, leave nothing between '
        'them; correct <limit>, or leave lower and upper out'
    )


def test_mujoco_model_keeps_the_limits():
    said = (
        ', input: {limits: [0.5, 1.5], velocity: 2, effort: 3}, '
        'joints: {rocker_joint: {limits: [-5.4, -4.2]}}'
    )
    model = mujoco.MjModel.from_xml_string(mujoco_model('it', [ModelPart(closed(said))]).decode())
    crank, rocker = model.joint('crank_joint'), model.joint('rocker_joint')
    assert (crank.limited.item(), rocker.limited.item()) == (1, 1)
    assert crank.range.tolist() == [0.5, 1.5]
    assert model.jnt_actfrcrange[crank.id].tolist() == [-3.0, 3.0]
    assert rocker.range.tolist() == [-5.4, -4.2]
    start = model.key('start').qpos[rocker.qposadr.item()]
    assert -5.4 < start < -4.2
    assert model.actuator('crank_joint').ctrlrange.tolist() == [0.5, 1.5]
    assert not model.joint('coupler_joint').limited.item()


def test_urdf_limits_use_the_linkage_prefixes():
    said = ', input: {limits: [0.5, 1.5]}'
    parts = [ModelPart(closed(said), prefix='left_'), ModelPart(closed(''), prefix='right_')]
    written = limits_in(urdf_model('it', parts))
    assert written['left_crank_joint'][1]['upper'] == '1.5'
    assert written['right_crank_joint'][0] == 'continuous'
    assert replace(Limits(), low=0.0).is_bounded
