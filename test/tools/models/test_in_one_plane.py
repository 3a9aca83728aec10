# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A robot, or a linkage of a spatial file, whose links move in one plane is a planar linkage."""

from io import BytesIO
from math import cos, pi, sin
from pathlib import Path
import re

from linkage_ros import load
from linkage_ros.cli.main import main
from linkage_ros.description import write_linkage
from linkage_ros.dynamics import Loads, Mechanics
from linkage_ros.kinematics import PlanarClosure, SpaceClosure, Status, usual_inputs
from linkage_ros.resources import linkage_names
from linkage_ros.tools.models import model_of, ModelPart, urdf_model
import numpy as np
import pytest

PLANES = {
    'xy': ('0 0 0', ('x', 'y')),
    'xy seen from below': (f'{pi!r} 0 0', ('x', 'y')),
    'xz': (f'{pi / 2!r} 0 0', ('x', 'z')),
    'yz': (f'{pi / 2!r} 0 {pi / 2!r}', ('y', 'z')),
    'xz of CAD': (f'{pi / 2 + 3e-9!r} 1e-8 -2e-9', ('x', 'z')),
}

OBLIQUE = '0.3 0.2 0.1'


def robot_of(folder, name, rpy):
    """Return a gallery linkage as a robot that stands turned on its base."""
    planar = load(name)
    text = urdf_model(name, [ModelPart(planar)]).decode()
    base = (
        '<link name="base"/><joint name="stand" type="fixed"><parent link="base"/>'
        f'<child link="ground"/><origin xyz="0.3 -0.2 0.1" rpy="{rpy}"/></joint></robot>'
    )
    file = folder / 'robot.urdf'
    file.write_text(text.replace('</robot>', base))
    return planar, load(file, {'input': list(planar.input_names)})


def states_of(closure):
    """Return states beyond the pose on both sides, through change points."""
    start = np.array(usual_inputs(closure))
    steps = [1.0 if given.unit == 'rad' else 0.01 for given in closure.linkage.inputs]
    return start + np.linspace(-7.0, 7.0, 71)[:, None] * steps


@pytest.mark.sample(20)
@pytest.mark.parametrize('plane', PLANES)
@pytest.mark.parametrize('name', linkage_names())
def test_planar_robot_has_the_states_of_the_file(tmp_path, name, plane):
    rpy, axes = PLANES[plane]
    planar, robot = robot_of(tmp_path, name, rpy)
    assert isinstance(robot, PlanarClosure)
    assert robot.linkage.axes == axes
    assert (robot.linkage.corrections.tilted_by > 0.0) == plane.endswith('CAD')
    for state in states_of(planar):
        expected, found = planar.position(*state), robot.position(*state)
        assert found.status is expected.status
        if expected.status is Status.CLOSED:
            joints = np.array([found[joint] for joint in planar.joint_names]) - expected.joints
            if len(state) > 1:  # The turns of a dyad of two cranks depend on the order of links.
                joints = np.remainder(joints + pi, 2.0 * pi) - pi
            assert np.abs(joints).max() < (1e-7 if 'CAD' in plane else 1e-12)


def test_a_robot_in_an_oblique_plane_is_spatial(tmp_path):
    planar, robot = robot_of(tmp_path, 'parallelogram', OBLIQUE)
    assert isinstance(robot, SpaceClosure)
    for state in states_of(planar):
        joints = [robot.position(*state)[joint] for joint in planar.joint_names]
        assert joints == pytest.approx(planar.position(*state).joints, abs=1e-12)


SPATIAL = """
points: {{T: [0.35, 0.02, 0.5], U: [0.35, 0.05, 0.5], A: [0.1, 0.3, 0.2]}}
links: {{coupler: [T, U, A]}}
hinges:
  crank_joint: {{parent: ground, child: crank, axis: [0, 1, 0], at: [0, 0, 0.1]{crank}}}
  rod_joint: {{parent: crank, child: coupler, axis: [0, 1, 0], at: [0.1, 0.01, 0.2]}}
  rocker_joint: {{parent: ground, child: rocker, axis: [0, -1, 0], at: [0.4, 0, 0.1]}}
  pin: {{parent: coupler, child: rocker, axis: [0, 1, 0], at: [0.5, 0, 0.35]}}
  {more}
input: [{inputs}]
joints: [{joints}rocker_joint{pin}]
traced: [T{traced}]
"""


def spatial(folder, **kinds):
    file = folder / 'linkage.yaml'
    given = dict.fromkeys(('crank', 'more', 'pin', 'traced'), '')
    given |= {'inputs': 'crank_joint', 'joints': 'rod_joint, '}
    file.write_text(SPATIAL.format(**{**given, **kinds}))
    return load(file)


def test_planar_robot_coordinates_use_the_ground_axes(tmp_path):
    closure = spatial(tmp_path)
    assert isinstance(closure, PlanarClosure)
    assert closure.linkage.traced == ('T',)
    closure = closure.measuring('T.z')
    position = closure.position(0.4)
    # The coupler's turn about y: its angles add up, as all hinges are 0 in the pose.
    turn = 0.4 + position['rod_joint']
    x, z = 0.1 * cos(0.4) + 0.1 * sin(0.4), 0.1 + 0.1 * cos(0.4) - 0.1 * sin(0.4)
    expected = z + 0.3 * cos(turn) - 0.25 * sin(turn)
    assert position['T.z'] == pytest.approx(expected, abs=1e-15)
    assert closure.named_points(position)['T'].real == pytest.approx(
        x + 0.25 * cos(turn) + 0.3 * sin(turn), abs=1e-15
    )


@pytest.mark.parametrize(
    'kinds',
    [
        # The crank and all round the loop are published: their zeroes do not add up.
        {'crank': ', value: 0.5', 'pin': ', pin'},
        # Two traced points are one in the plane.
        {'traced': ', U'},
        # A turntable turns beside it.
        {
            'more': 'turntable: {parent: ground, child: table, axis: [0, 0, 1], at: [0, 0, 0]}',
            'inputs': 'crank_joint, turntable',
        },
    ],
    ids=['zeroes', 'traced', 'turntable'],
)
def test_linkage_with_spatial_features_stays_spatial(tmp_path, kinds):
    flat, closure = spatial(tmp_path), spatial(tmp_path, **kinds)
    assert isinstance(closure, SpaceClosure)
    pose = closure.linkage.pose.inputs
    position = closure.position(*(value + 0.3 * (k == 0) for k, value in enumerate(pose)))
    expected = flat.position(0.3)
    for joint in flat.joint_names:
        assert position[joint] == pytest.approx(expected[joint], abs=1e-14)


def test_traced_point_on_a_hinge_axis_keeps_its_name(tmp_path):
    closure = spatial(tmp_path, traced=', A')
    assert isinstance(closure, PlanarClosure)
    place = closure.named_points(closure.position(0.4))['A']
    assert place == pytest.approx(
        complex(0.1 * (cos(0.4) + sin(0.4)), 0.1 + 0.1 * (cos(0.4) - sin(0.4))), abs=1e-15
    )


def test_urdf_places_links_with_unpublished_joints(tmp_path):
    """By yourdfpy: the traced point of the coupler, whose joint is published for the model."""
    yourdfpy = pytest.importorskip('yourdfpy')
    closure = spatial(tmp_path, joints='')
    assert closure.joint_names == ('rocker_joint',)
    file = tmp_path / 'linkage.yaml'
    robot = yourdfpy.URDF.load(
        BytesIO(model_of(str(file), urdf_model)), load_meshes=False, build_scene_graph=True
    )
    every = spatial(tmp_path)
    position = every.position(0.3)
    robot.update_cfg({'crank_joint': 0.3} | {k: position[k] for k in every.joint_names})
    x, _, z = robot.get_transform('T_on_coupler', 'world')[:3, 3]
    assert complex(x, z) == pytest.approx(every.named_points(position)['T'], abs=1e-12)


@pytest.mark.parametrize('plane', ['xy', 'xy seen from below', 'xz', 'yz'])
def test_planar_robot_masses_equal_the_file(tmp_path, plane):
    """The model of a link has its moment about the plane's normal; others do not matter."""
    planar, robot = robot_of(tmp_path, 'watt_1', PLANES[plane][0])
    expected, found = planar.linkage, robot.linkage
    assert found.masses.keys() == expected.masses.keys() != set()
    for link, mass in found.masses.items():
        own = expected.masses[link]
        assert (mass.mass, mass.inertia) == pytest.approx((own.mass, own.inertia), rel=1e-12)

        def arms(points, center):
            return [np.hypot(*(np.array(place) - center)) for place in points.values()]

        known = arms(expected.links[link], own.center)
        for arm in arms(found.links[link], mass.center):
            assert min(abs(arm - one) for one in known) < 1e-12


@pytest.mark.parametrize('name', ['andrews_squeezer', 'four_bar', 'slider_crank', 'watt_1'])
def test_planar_robot_effort_equals_the_file(tmp_path, name):
    """Under gravity and its own inertia; the robot stands in the plane of x and z."""
    planar, robot = robot_of(tmp_path, name, PLANES['xz'][0])
    efforts = []
    for closure in (planar, robot):
        position = closure.position(usual_inputs(planar)[0] + 0.4)
        velocity = closure.velocity(position, 2.0)
        acceleration = closure.acceleration(position, velocity, 5.0)
        mechanics = Mechanics(closure, Loads((0.3, -9.81)))
        efforts += mechanics.drive_efforts(position, velocity, acceleration)
    assert efforts[1] == pytest.approx(efforts[0], rel=1e-11)


LINKS = Path(__file__).parents[2] / 'kinematics' / 'space' / 'linkages'
ROBOTS = Path(__file__).with_name('robots')
DRAWN = {
    'robot': (ROBOTS / 'palletizer.urdf', ['--input=shoulder', '--input=counterweight']),
    'spatial file': (LINKS / 'four_bar.yaml', []),
}
OUTPUTS = {
    'parts': (['draw'], 'x.dxf'),
    'animation': (['animate', '--seconds=1'], 'x.gif'),
    'engine': (['mjcf'], 'x.xml'),
    'page': (['view'], 'x.html'),
    'assemblies': (['draw', '--assemblies'], 'x.svg'),
}

IN_SPACE = ('animation', 'engine', 'page')
"""What is written of a spatial linkage too."""


@pytest.mark.sample(5)
@pytest.mark.parametrize('output', OUTPUTS)
@pytest.mark.parametrize('source', DRAWN)
def test_planar_commands_accept_planar_robots_only(tmp_path, monkeypatch, source, output, capsys):
    """The output is that of the planar file with the same content and name."""
    monkeypatch.chdir(tmp_path)
    (file, told), (command, name) = DRAWN[source], OUTPUTS[output]
    (planar := tmp_path / 'planar' / f'{file.stem}.yaml').parent.mkdir()
    robot = {'input': [one.partition('=')[2] for one in told]} if told else None
    write_linkage(load(file, robot).linkage, planar, [f'From {file.name}.'])
    found = []
    for given in ([str(file), *told], [str(planar)]):
        assert main([*command, *given, '-o', name, '--force']) == 0
        # A DXF has identifiers of its own and the time.
        found.append(
            re.sub(
                rb'{[-0-9A-F]{36}}|\d{7}\.\d+|\d+-\d+-\d+T[\d:.+]+',
                b'',
                (tmp_path / name).read_bytes(),
            )
        )
    assert found[0] == found[1]
    capsys.readouterr()
    spatial = [str(ROBOTS / 'ankle.urdf'), '--input=pitch', '--input=roll', '-o', f'y{name}']
    if output in IN_SPACE:
        assert main([*command, *spatial]) == 0
        return
    assert main([*command, *spatial]) == 2
    assert 'ankle.urdf: is a spatial linkage' in capsys.readouterr().err


def test_view_writes_a_page_for_a_planar_robot_scene(tmp_path):
    scene = tmp_path / 'scene.yaml'
    scene.write_text(
        f'linkage: {{urdf: {ROBOTS / "palletizer.urdf"}, input: [shoulder, counterweight]}}\n'
        'drive: {topic: {}}\n'
    )
    assert main(['view', str(scene), '-o', str(tmp_path / 'x.html')]) == 0
    assert 'counterweight' in (tmp_path / 'x.html').read_text('utf-8')
