# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Robots as CAD writes them: noise where a 0 was meant, and joints in any order.

Each linkage of the gallery is written as a URDF. Every origin and every rpy gets noise, and the
joints are shuffled. What comes back is the linkage, but for what the noise does to its lengths.
"""

from contextlib import suppress
from math import dist, radians, remainder, tau
from random import Random
from xml.etree import ElementTree as ET

from linkage_ros import load
from linkage_ros.cli.main import main
from linkage_ros.errors import FileError
from linkage_ros.kinematics import RevoluteJoint, usual_inputs
from linkage_ros.resources import linkage_names, spatial_linkage_names
from linkage_ros.tools.models import model_of, urdf_model
import pytest

FINE, COARSE, ROUGH = (-19.0, -14.0), (-14.0, -9.0), (-6.7, -6.0)
"""Powers of ten between which noise is drawn, in [m] and [rad]; the last is that of six digits."""


def with_noise(text, random, size):
    """Return a URDF with noise on all of its joints and closings, in a random order."""
    robot = ET.fromstring(text)
    for place in (*robot.findall('joint/*[@xyz]'), *robot.findall('loop_joint/*[@xyz]')):
        for key in sorted({'xyz', 'rpy'} & {*place.attrib}):
            values = [float(one) + random.uniform(-size, size) for one in place.get(key).split()]
            place.set(key, ' '.join(map(repr, values)))
    parts = [part for part in robot if part.tag in ('joint', 'loop_joint')]
    for part in parts:
        robot.remove(part)
    robot.extend(random.sample(parts, len(parts)))
    return ET.tostring(robot, 'unicode')


@pytest.fixture(scope='module')
def models():
    """Return models that have been written, by linkage."""
    return {}


def check_poses(name, robot, random, size):
    """Check the poses of a robot that is a linkage of the gallery but for noise of a size."""
    linkage = load(name)
    inputs = linkage.linkage.inputs
    is_flat = name in linkage_names()
    pose = usual_inputs(linkage) if is_flat else linkage.linkage.pose.inputs
    closed = 0
    for _ in range(5):
        at = [
            value + random.uniform(-0.1, 0.1) * (0.1 if given.slider else 1.0)
            for value, given in zip(pose, inputs, strict=True)
        ]
        expected, found = linkage.position(*at), robot.position(*at)
        assert found.status == expected.status, size
        if not expected.status.has_pose:
            continue
        joints = dict(zip(robot.joint_names, found.joints, strict=True))
        for joint, value in zip(linkage.joint_names, expected.joints, strict=True):
            away = joints.get(joint, value) - value
            turns = isinstance(linkage.linkage.joints[joint], RevoluteJoint)
            away = remainder(away, tau) if turns else away
            assert abs(away) < 1e3 * size + 1e-13, (joint, size)
        closed += 1
    assert closed > 2


@pytest.mark.sample(7)
@pytest.mark.parametrize('powers', [FINE, COARSE], ids=['fine', 'coarse'])
@pytest.mark.parametrize('name', [*linkage_names(), *spatial_linkage_names()])
def test_cad_noise_and_joint_order_change_no_pose(tmp_path, models, name, powers):
    if name not in models:
        models[name] = model_of(name, urdf_model).decode()
    random = Random(f'{name} {powers}')
    size = 10.0 ** random.uniform(*powers)
    file = tmp_path / 'robot.urdf'
    file.write_text(with_noise(models[name], random, size))
    check_poses(name, load(file), random, size)


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', ['bennett', 'wishbone'])
def test_rounded_robot_is_right_or_refused(tmp_path, name):
    """A point of two links may be next to the axis of their hinge, or miss it."""
    file, random, count = tmp_path / 'robot.urdf', Random(name), 0
    text = model_of(name, urdf_model).decode()
    for _ in range(3):
        size = 10.0 ** random.uniform(*ROUGH)
        file.write_text(with_noise(text, random, size))
        with suppress(FileError):
            check_poses(name, load(file), random, size)
            count += 1
    assert count


ANKLE = """
r2x u2 rod2 <origin xyz="6.93889e-18 0 0" rpy="-4.8e-17 3.7e-17 -3.1e-17"/><axis xyz="1 0 0"/>
r2y bar2 u2 <origin xyz="0 -0.0165 -0.004" rpy="-0.1 0.2 0.3"/><axis xyz="0 1 0"/>
r1x u1 rod1 <origin xyz="6.93889e-18 0 0" rpy="-4.8e-17 3.7e-17 -3.1e-17"/><axis xyz="1 0 0"/>
r1y bar1 u1 <origin xyz="0 0.0165 -0.004" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0"/>
m2 shin bar2 <origin xyz="0.040 0 0.215"/><axis xyz="1 0 0"/>
m1 shin bar1 <origin xyz="0.035 0 0.150"/><axis xyz="1 0 0"/>
roll cross foot <origin xyz="0 0 -0.018"/><axis xyz="1 0 0"/>
pitch shin cross <axis xyz="0 1 0"/>
"""
RODS = """
rod1 0.018386157660996695 -0.013121961234768567 -0.1549096941440987 0.022 0.015 0.008
rod2 0.027487085777631218 0.028674296889734285 -0.21815016574216142 0.022 -0.015 0.008
"""
AT_5_3 = {'pitch': -2.901734, 'roll': 1.129640, 'r1y': 1.411035, 'r1x': -5.011640,
          'r2y': -0.994411, 'r2x': 2.838769}  # fmt: skip
"""Joints at 5 and -3 degrees of m1 and m2, by Newton's method on the frames of the URDF."""


def ankle_urdf():
    """Return an ankle with rods on two hinges that miss each other by 7e-18 m, child first."""
    links = {'shin', *(line.split()[2] for line in ANKLE.strip().splitlines())}
    yield '<robot name="ankle">'
    yield from (f'<link name="{link}"/>' for link in sorted(links))
    for line in ANKLE.strip().splitlines():
        name, parent, child, rest = line.split(maxsplit=3)
        yield f'<joint name="{name}" type="continuous"><parent link="{parent}"/>'
        yield f'<child link="{child}"/>{rest}</joint>'
    for line in RODS.strip().splitlines():
        rod, *xyz = line.split()
        yield f'<loop_joint name="ball of {rod}" type="spherical"><link1 link="{rod}" xyz="'
        yield f'{" ".join(xyz[:3])}"/><link2 link="foot" xyz="{" ".join(xyz[3:])}"/></loop_joint>'
    yield '</robot>'


def test_ankle_with_nearly_coincident_hinges_moves_as_drawn(tmp_path):
    file = tmp_path / 'ankle.urdf'
    file.write_text(''.join(ankle_urdf()))
    ankle = load(file, {'input': ['m1', 'm2']})
    for at, joints in (((0, 0), dict.fromkeys(AT_5_3, 0.0)), ((5, -3), AT_5_3)):
        found = ankle.position(*map(radians, at))
        for name, value in zip(ankle.joint_names, found.joints, strict=True):
            assert abs(value - radians(joints[name])) < 1e-8
    assert 6.9e-18 < ankle.linkage.corrections.merged_by < 8e-18


def test_check_prints_the_largest_merged_distance(tmp_path, capsys):
    text = model_of('hooke_joint', urdf_model).decode()
    text = text.replace('<origin xyz="0 0 0"', '<origin xyz="0 3e-10 4e-10"', 1)
    (tmp_path / 'robot.urdf').write_text(text)
    assert main(['check', str(tmp_path / 'robot.urdf')]) == 0
    assert 'places of the pose that are up to 5e-10 m apart' in capsys.readouterr().out


def test_clearly_separate_hinges_are_not_merged(tmp_path):
    text = ''.join(ankle_urdf()).replace('6.93889e-18', '2e-6')
    (tmp_path / 'ankle.urdf').write_text(text)
    ankle = load(tmp_path / 'ankle.urdf', {'input': ['m1', 'm2']})
    assert ankle.linkage.corrections.merged_by == 0.0
    assert dist(ankle.linkage.hinges['r1x'].at, ankle.linkage.hinges['r1y'].at) > 1e-6
