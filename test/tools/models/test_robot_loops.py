# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Robots whose URDF has loops: read in each dialect, solved, run, written, and refused."""

from dataclasses import replace
from io import BytesIO
from pathlib import Path
import re
from xml.etree import ElementTree as ET

from linkage_ros import load, load_scene
from linkage_ros.cli.main import main
from linkage_ros.description import linkage_content, parse_yaml
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import SpaceClosure
from linkage_ros.resources import named_file, spatial_linkage_names
from linkage_ros.tools.models import model_of, ModelPart, urdf_model
import numpy as np
import pytest
import yaml

from ...support.scenes import LINKAGES

ROBOTS = Path(__file__).with_name('robots')
OWN = Path(__file__).parents[2] / 'kinematics' / 'space' / 'linkages'


@pytest.fixture
def turns():
    """Return random numbers that depend on no other test."""
    return np.random.default_rng(48)


# An independent route: homogeneous matrices of the URDF, and Newton's method in small steps.


def numbers(element, key, default='0 0 0'):
    text = default if element is None else element.get(key, default)
    return np.array(text.split(), float)


def moved(xyz, turn=None):
    matrix = np.eye(4)
    matrix[:3, 3] = xyz
    matrix[:3, :3] = np.eye(3) if turn is None else turn
    return matrix


def turn(axis, angle):
    x, y, z = axis / np.linalg.norm(axis)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew


def origin(element):
    roll, pitch, yaw = numbers(element, 'rpy')
    x, y, z = np.eye(3)
    return moved(numbers(element, 'xyz'), turn(z, yaw) @ turn(y, pitch) @ turn(x, roll))


class Walk:
    """A robot whose loops, pairs of places on links, are closed from one state to the next."""

    def __init__(self, text, loops):
        self.joints, self.loops = ET.fromstring(text).findall('joint'), loops

    def places(self, values):
        frames, waiting = {}, list(self.joints)
        children = {joint.find('child').get('link') for joint in waiting}
        frames |= {joint.find('parent').get('link'): np.eye(4) for joint in waiting
                   if joint.find('parent').get('link') not in children}  # fmt: skip
        while waiting:
            joint = waiting.pop(0)
            parent, child = (joint.find(end).get('link') for end in ('parent', 'child'))
            if parent not in frames:
                waiting.append(joint)
                continue
            value, axis = values.get(joint.get('name'), 0.0), numbers(joint.find('axis'), 'xyz')
            move = moved(value * axis) if joint.get('type') == 'prismatic' else np.eye(4)
            if joint.get('type') in ('revolute', 'continuous'):
                move = moved((0, 0, 0), turn(axis, value))
            frames[child] = frames[parent] @ origin(joint.find('origin')) @ move
        return [(frames[link] @ [*xyz, 1.0])[:3] for pair in self.loops for link, xyz in pair]

    def gaps(self, values):
        places = np.array(self.places(values))
        return (places[1::2] - places[::2]).ravel()

    def go(self, state, inputs, steps=6):
        """Return the state at some inputs, by small steps from another state."""
        state, start = dict(state), {name: state[name] for name in inputs}
        free = [name for name in state if name not in inputs]
        for step in range(1, steps + 1):
            part = step / steps
            state |= {k: start[k] + part * (v - start[k]) for k, v in inputs.items()}
            for _ in range(3 if step < steps else 7):
                slopes = [
                    (self.gaps(state | {k: state[k] + 1e-6})
                     - self.gaps(state | {k: state[k] - 1e-6})) / 2e-6
                    for k in free
                ]  # fmt: skip
                change = np.linalg.lstsq(np.transpose(slopes), self.gaps(state), rcond=1e-9)[0]
                state |= {k: state[k] - d for k, d in zip(free, change, strict=True)}
        return state


ROD1, ROD2 = ('rod1', (-0.013, -0.0015, -0.156)), ('rod2', (-0.018, 0.0015, -0.221))
FOOT1, FOOT2 = ('foot', (0.022, 0.015, 0.008)), ('foot', (0.022, -0.015, 0.008))
KNEE = {'crank_joint': 1.2, 'coupler_joint': -0.88242, 'rocker_joint': -1.20663}
TIPS = ['left_rod_tip=left_arm_eye', 'right_rod.0.1,-0.03,-0.05=right_arm.0,0,0.15']
CHOICES = {
    'ankle': ({'input': ['pitch', 'roll']}, [(ROD1, FOOT1), (ROD2, FOOT2)], 0.3),
    'rover': (
        {'input': 'left_rocker', 'close': TIPS},
        [(('left_rod', (0.1, 0.03, -0.05)), ('left_arm', (0, 0, 0.15))),
         (('right_rod', (0.1, -0.03, -0.05)), ('right_arm', (0, 0, 0.15)))],
        0.25,
    ),
    'four_bar': (
        {'input': 'crank_joint', 'at': KNEE},
        [(('coupler', (0.12, 0, -0.01)), ('rocker', (0.08, 0, 0)))], 1.5,
    ),
    'palletizer': (
        {'input': ['shoulder', 'counterweight']},
        [(('link', (0, 0, 1.2)), ('forearm', (-0.3, 0.1, 0.05)))], 0.5,
    ),
    'turntable': (
        {'input': ['yaw', 'upper', 'lever']},
        [(('rod1', (0, 0, 1.1)), ('triangle', (-0.25, 0, 0.1))),
         (('rod2', (1.2, 0, 0)), ('hand', (0.1, 0, 0.3))),
         (('rod3', (0, 0, 1.1)), ('forearm', (-0.35, 0, 0)))],
        0.9,
    ),
}  # fmt: skip
"""For each robot what is told, the places of its loops, and how far its inputs go."""


def read(folder, text, **told):
    file = folder / 'robot.urdf'
    file.write_text(text)
    return load(file, told)


def near_pose(closure, reach, count):
    """Return inputs near the pose; they depend on no other test."""
    pose = np.array(closure.linkage.pose.inputs)
    return pose + np.random.default_rng(37).uniform(-reach, reach, (count, len(pose)))


def pose_of(closure):
    inputs = closure.linkage.pose.inputs
    names, joints = closure.joint_names, closure.position(*inputs).joints
    return dict(zip((*closure.input_names, *names), (*inputs, *joints), strict=True))


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', CHOICES)
def test_robot_states_equal_newtons_method_on_the_urdf(name):
    told, loops, reach = CHOICES[name]
    closure = load(ROBOTS / f'{name}.urdf', told)
    walk = Walk((ROBOTS / f'{name}.urdf').read_text(), loops)
    pose = pose_of(closure)
    for inputs in near_pose(closure, reach, 2):
        given = dict(zip(closure.input_names, inputs.tolist(), strict=True))
        expected = walk.go(pose, given)
        position = closure.position(*given.values())
        found = {**given, **dict(zip(closure.joint_names, position.joints, strict=True))}
        assert found == pytest.approx(expected, abs=1e-12)


def ends(spelling, *pairs):
    """Return a loop tag for each pair of places."""
    return ''.join(
        spelling.format(n=number, a=one[0], p=' '.join(map(str, one[1])),
                        b=other[0], q=' '.join(map(str, other[1])))
        for number, (one, other) in enumerate(pairs)
    )  # fmt: skip


PLACES = (
    '<parent link="{a}"/><child link="{b}"/><parent_origin xyz="{p}"/><child_origin xyz="{q}"/>'
)
PLUS = ('<predecessor link="{a}"><origin xyz="{p}"/></predecessor>'
        '<successor link="{b}"><origin xyz="{q}"/></successor>')  # fmt: skip
TAGS = {
    'Isaac Sim': '<loop_joint name="l{n}" type="{t}">'
    '<link1 link="{a}" xyz="{p}" rpy="0 0 0"/><link2 link="{b}" xyz="{q}" rpy="0 0 0"/>{x}'
    '</loop_joint>',
    'Isaac Sim, link1 twice': '<loop_joint name="l{n}" type="{t}">'
    '<link1 link="{a}" xyz="{p}" rpy="0 0 0"/><link1 link="{b}" xyz="{q}" rpy="0 0 0"/>{x}'
    '</loop_joint>',
    'Fusion': f'<loop_joint name="l{{n}}" type="{{t}}">{PLACES}{{x}}</loop_joint>',
    'urdfdom': f'<constraint name="l{{n}}" type="{{t}}_joint">{PLACES}{{x}}</constraint>',
    'URDF+': f'<loop name="l{{n}}" type="{{t}}">{PLUS}{{x}}</loop>',
    'loop_constraint': f'<loop_constraint name="l{{n}}">{PLACES}</loop_constraint>',
}
AXES = {'urdfdom': '<parent_axis xyz="0 0 1"/><child_axis xyz="0 0 2"/>'}
OPEN = re.compile(r'<(loop_joint|loop|constraint)\b.*</\1>', re.DOTALL)


@pytest.mark.sample(5)
@pytest.mark.parametrize('kind', ['spherical', 'revolute'])
@pytest.mark.parametrize('dialect', [*TAGS, 'close'])
def test_loop_tag_dialects_give_the_same_states(tmp_path, dialect, kind):
    name = 'ankle' if kind == 'spherical' else 'four_bar'
    told, pairs, reach = CHOICES[name]
    text = OPEN.sub('', (ROBOTS / f'{name}.urdf').read_text())
    expected = load(ROBOTS / f'{name}.urdf', told)
    if dialect == 'close':
        places = [[f'{link}.{",".join(map(str, xyz))}' for link, xyz in pair] for pair in pairs]
        end = ':hinge' if kind == 'revolute' else ''
        closure = read(tmp_path, text, **told, close=[f'{"=".join(one)}{end}' for one in places])
    else:
        axis = AXES.get(dialect, '<axis xyz="0 0 1"/>') if kind == 'revolute' else ''
        tag = TAGS[dialect].replace('{t}', kind).replace('{x}', axis)
        closure = read(tmp_path, text.replace('</robot>', ends(tag, *pairs) + '</robot>'), **told)
    for inputs in near_pose(expected, reach, 20):
        joints = expected.position(*inputs).joints
        assert closure.position(*inputs).joints == pytest.approx(joints, abs=1e-14)


def closing_frames(pairs):
    """Return frames as onshape-to-robot writes them: two links where each loop meets."""
    return ''.join(
        f'<link name="closing_{number}_{end}"/><joint name="closing_{number}_{end}_frame" '
        f'type="fixed"><parent link="{link}"/><child link="closing_{number}_{end}"/>'
        f'<origin xyz="{" ".join(map(str, xyz))}"/></joint>'
        for number, pair in enumerate(pairs)
        for end, (link, xyz) in enumerate(pair, 1)
    )


def test_closing_frames_of_onshape_close_loops_without_options(tmp_path):
    """What is called passive is driven by no motor."""
    told, pairs, reach = CHOICES['ankle']
    text = OPEN.sub('', (ROBOTS / 'ankle.urdf').read_text())
    joints = re.findall(r'<joint name="(\w+)" type="(?:revolute|continuous)"', text)
    for name in joints:
        if name not in told['input']:
            text = re.sub(rf'(joint(?: name)?=)"{name}"', rf'\1"passive_{name}"', text)
    text = re.sub(r'<(ros2_control|transmission)\b.*?</\1>', '', text, flags=re.DOTALL)
    closure = read(tmp_path, text.replace('</robot>', closing_frames(pairs) + '</robot>'))
    expected = load(ROBOTS / 'ankle.urdf', told)
    assert closure.input_names == expected.input_names
    for inputs in near_pose(expected, reach, 20):
        found = closure.position(*inputs)
        values = [found[f'passive_{name}'] for name in expected.joint_names]
        assert values == pytest.approx(expected.position(*inputs).joints, abs=1e-14)


def test_ankle_driven_by_motors_inverts_its_joints():
    given = {'input': ['m1', 'm2']}
    closure, motors = (
        load(ROBOTS / 'ankle.urdf', CHOICES['ankle'][0]),
        load(ROBOTS / 'ankle.urdf', given),
    )
    for inputs in near_pose(closure, 0.25, 10):
        found = dict(zip(closure.joint_names, closure.position(*inputs).joints, strict=True))
        joints = motors.position(found['m1'], found['m2']).joints
        assert joints[:2] == pytest.approx(inputs, abs=1e-14)


def test_link_constraints_act_as_rods(tmp_path):
    """A <constraint type="link"> is a rod between two balls (urdfdom#264)."""
    text = OPEN.sub('', (ROBOTS / 'ankle.urdf').read_text())
    bars = (('bar1', (0, -0.004, -0.0165)), FOOT1), (('bar2', (0, -0.0165, -0.004)), FOOT2)
    rods = ends(f'<constraint name="l{{n}}" type="link">{PLACES}</constraint>', *bars)
    closure = read(tmp_path, text.replace('</robot>', f'{rods}</robot>'), input=['pitch', 'roll'])
    expected = load(ROBOTS / 'ankle.urdf', {'input': ['pitch', 'roll']})
    assert closure.joint_names == ('m1', 'm2')
    assert {'rod1_y', 'toe', 'hip'} < set(closure.linkage.left_out)
    for inputs in near_pose(expected, 0.3, 30):
        found = dict(zip(expected.joint_names, expected.position(*inputs).joints, strict=True))
        joints = closure.position(*inputs).joints
        assert joints == pytest.approx((found['m1'], found['m2']), abs=1e-14)


MOTOR = '<link name="rotor"/><joint name="motor" type="continuous"><parent link="arm"/>'
MOTOR += '<child link="rotor"/><axis xyz="0 1 0"/></joint>'
COUPLED = '<coupling name="gear"><predecessor link="{}"/><successor link="{}"/>{}</coupling>'
GEARS = {
    'mimic': ('<mimic joint="motor" multiplier="0.5"/>', ''),
    'coupling': ('', COUPLED.format('rotor', 'crank', '<ratio value="0.5"/>')),
    'coupling, turned round': ('', COUPLED.format('crank', 'rotor', '<ratio value="2"/>')),
}


@pytest.mark.parametrize('gear', GEARS)
def test_geared_motor_drives_a_loop(tmp_path, gear):
    within, beside = GEARS[gear]
    text = (ROBOTS / 'four_bar.urdf').read_text()
    text = text.replace('<child link="crank"/>', f'<child link="crank"/>{within}')
    text = text.replace('</robot>', f'{MOTOR}{beside}</robot>')
    geared = read(tmp_path, text, input='motor', at={**KNEE, 'motor': 2.4})
    expected = load(ROBOTS / 'four_bar.urdf', CHOICES['four_bar'][0])
    for (crank,) in near_pose(expected, 1.5, 20):
        found = dict(zip(geared.joint_names, geared.position(2.0 * crank).joints, strict=True))
        assert found.pop('crank_joint') == pytest.approx(crank, abs=1e-15)
        assert [*found.values()] == pytest.approx(expected.position(crank).joints, abs=1e-14)


def test_redundant_mimic_of_a_loop_is_left_out(tmp_path):
    """Exporters write roughly by a mimic what a loop does exactly."""
    text = (ROBOTS / 'four_bar.urdf').read_text()
    rough = '<child link="rocker"/><mimic joint="crank_joint" multiplier="-0.4" offset="-0.7"/>'
    closure = read(
        tmp_path, text.replace('<child link="rocker"/>', rough), **CHOICES['four_bar'][0]
    )
    assert closure.linkage.left_out == ('mimic of rocker_joint',)


def test_loops_without_an_input_are_left_out(tmp_path):
    """A scene may move one leg of a robot, and another linkage of it the other."""
    text = (ROBOTS / 'ankle.urdf').read_text()
    inner = re.search(r'<robot name="ankle">(.*)</robot>', text, re.DOTALL)[1]
    other = re.sub(r'(name|link|joint)="(?!pelvis)(\w+)"', r'\1="right_\2"', inner)
    other = other.replace('<link name="pelvis"/>', '')
    both = text.replace('</robot>', f'{other}</robot>')
    one = load(ROBOTS / 'ankle.urdf', {'input': ['pitch', 'roll']})
    for side in ('', 'right_'):
        leg = read(tmp_path, both, input=[f'{side}pitch', f'{side}roll'])
        assert leg.joint_names == tuple(f'{side}{name}' for name in one.joint_names)
        assert {'m1', 'right_m1'} & {*leg.linkage.left_out} == {{'': 'right_m1'}.get(side, 'm1')}
        for inputs in near_pose(one, 0.3, 5):
            joints = one.position(*inputs).joints
            assert leg.position(*inputs).joints == pytest.approx(joints, abs=1e-14)


def test_rounded_loops_are_closed_without_changing_links(tmp_path):
    """CAD writes five digits: no link changes, and each angle is that at which the loops close."""
    text = (ROBOTS / 'ankle.urdf').read_text().replace('0.040 0 0.215', '0.04001 0 0.21502')
    closure = read(tmp_path, text, input=['pitch', 'roll'])
    assert 1e-5 < closure.linkage.corrections.open_by < 3e-5
    pose = pose_of(closure)
    walk = Walk(text, CHOICES['ankle'][1])
    assert np.abs(walk.gaps(pose)).max() < 1e-14
    assert 1e-5 < max(map(abs, pose.values())) < 1e-2


@pytest.mark.sample(2)
@pytest.mark.parametrize('rounding', [1e-16, 1e-13, 1e-9, 1e-6])
def test_pose_at_a_limit_tolerates_loop_rounding(tmp_path, rounding, turns):
    """Each joint that the loops move has a limit of 0, above or below, where it is in the pose."""
    text = (ROBOTS / 'ankle.urdf').read_text()
    off = [0.022, 0.015, 0.008] + rounding * turns.uniform(-1.0, 1.0, 3)
    text = text.replace('xyz="0.022 0.015 0.008"', f'xyz="{" ".join(map(repr, off.tolist()))}"')
    for joint in ('m1', 'rod1_y', 'rod1_x'):
        for low, high in ((0.0, 0.5), (-0.5, 0.0)):
            robot = ET.fromstring(text)
            element = robot.find(f'joint[@name="{joint}"]')
            element.set('type', 'revolute')
            limit = (
                ET.SubElement(element, 'limit') if (of := element.find('limit')) is None else of
            )
            limit.attrib |= {'lower': str(low), 'upper': str(high)}
            limited = ET.tostring(robot, 'unicode')
            ankle = read(tmp_path, limited, input=['pitch', 'roll'])
            assert ankle.position(0.0, 0.0).status.value == 'closed'
            states = [ankle.position(*at) for at in turns.uniform(-0.2, 0.2, (20, 2))]
            assert {'closed', 'limited'} == {state.status.value for state in states}


STRUTS = {
    'from its length': OWN / 'excavator.yaml',
    'to its length, with hinges within': OWN / 'steered_rod.yaml',
    'its start moves, its name is taken, a joint follows it': 'cylinder.yaml',
}
CYLINDER = """
points: {P: [0.3, 0.03, 0.1], Q: [0.1, 0.02, -0.1], T: [1.5, 0, 0.4]}
links: {ground: [Q], boom: [P]}
hinges:
  boom_joint: {parent: ground, child: boom, at: [0, 0, 0], axis: [0, -1, 0.1]}
  cylinder_x: {parent: boom, child: cylinder_rod, at: [1.5, 0, 0.4], axis: [0, -1, 0]}
struts: {cylinder: [P, Q]}
ratios: {cylinder_x: {of: cylinder, ratio: 2, offset: -0.5660388679233962}}
input: cylinder
"""


def model_and_robot(file, folder):
    urdf = folder / 'robot.urdf'
    urdf.write_bytes(model_of(file, urdf_model))
    return urdf.read_text(), load(urdf)


@pytest.fixture(scope='module')
def hexapod(tmp_path_factory):
    return model_and_robot('hexapod', tmp_path_factory.mktemp('hexapod'))


@pytest.mark.sample(4)
@pytest.mark.parametrize('name', [*spatial_linkage_names(), *STRUTS])
def test_spatial_linkage_survives_the_urdf_round_trip(tmp_path, name, request):
    file = STRUTS.get(name, name)
    if file == 'cylinder.yaml':
        file = tmp_path / file
        file.write_text(CYLINDER)
    own = request.getfixturevalue('hexapod') if name == 'hexapod' else None
    linkage, (_, robot) = load(file), own or model_and_robot(file, tmp_path)
    assert robot.input_names == linkage.input_names
    assert {k: robot.linkage.limits[k] for k in linkage.linkage.limits} == linkage.linkage.limits
    count = 0
    for inputs in near_pose(linkage, 0.1, 15):
        one, other = linkage.position(*inputs), robot.position(*inputs)
        assert one.status == other.status
        if one.status.has_pose:
            found = dict(zip(robot.joint_names, other.joints, strict=True))
            joints = [found[joint] for joint in linkage.joint_names]
            assert joints == pytest.approx(one.joints, abs=1e-12)
            count += 1
    assert count > 5


@pytest.mark.parametrize('name', ['bennett', 'spherical_four_bar'])
def test_loop_closing_joint_keeps_its_pose_value(tmp_path, name, turns):
    """Its frame is welded as it lies where the joints have values that are not 0."""
    linkage = load(name).linkage
    values = {joint: turns.uniform(-3.0, 3.0) for joint in linkage.hinges}
    hinges = {k: replace(hinge, value=values[k]) for k, hinge in linkage.hinges.items()}
    written = SpaceClosure(replace(linkage, hinges=hinges))
    (tmp_path / 'robot.urdf').write_bytes(urdf_model(name, [ModelPart(written)]))
    robot = load(tmp_path / 'robot.urdf')
    assert robot.linkage.corrections.turned_by < 1e-12
    for inputs in written.linkage.pose.inputs + turns.uniform(-0.3, 0.3, (5, 1)):
        joints = dict(zip(robot.joint_names, robot.position(*inputs).joints, strict=True))
        found = [joints[joint] for joint in written.joint_names]
        assert found == pytest.approx(written.position(*inputs).joints, abs=1e-12)


def test_urdf_masses_equal_the_spatial_file(turns):
    """By yourdfpy, with the frames of links at the joints of the pose, beside the file's text."""
    yourdfpy = pytest.importorskip('yourdfpy')
    linkage = load('ankle_motors').linkage
    hinges = {
        name: replace(hinge, value=turns.uniform(-0.5, 0.5))
        for name, hinge in linkage.hinges.items()
    }
    closure = SpaceClosure(replace(linkage, hinges=hinges))
    text = urdf_model('ankle', [ModelPart(closure)]).decode()
    model = yourdfpy.URDF.load(BytesIO(text.encode()), load_meshes=False, build_scene_graph=True)
    model.update_cfg({
        joint.get('name'): float(joint.get('value'))
        for joint in ET.fromstring(text).find('linkage_start')
    })  # fmt: skip
    told = yaml.safe_load((LINKAGES / 'space' / 'ankle_motors.yaml').read_text())['masses']
    found = {name: link.inertial for name, link in model.link_map.items() if link.inertial}
    assert found.keys() == {link for link, body in told.items() if body['mass']}
    for name, body in found.items():
        frame = model.get_transform(name, 'ground') @ body.origin
        assert body.mass == told[name]['mass']
        if 'center' in told[name]:  # otherwise it is a rod
            xx, xy, xz, yy, yz, zz = told[name]['inertia']
            assert frame[:3, 3] == pytest.approx(told[name]['center'], abs=1e-14)
            turned = frame[:3, :3] @ body.inertia @ frame[:3, :3].T
            assert turned == pytest.approx(
                np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), abs=1e-17
            )


def test_hexapod_urdf_rods_end_at_the_platform_points(hexapod):
    """By yourdfpy, at the joints of the model as they come back, beside the file's own points."""
    yourdfpy = pytest.importorskip('yourdfpy')
    text, robot = hexapod
    model = yourdfpy.URDF.load(BytesIO(text.encode()), load_meshes=False, build_scene_graph=True)
    linkage, loops = load('hexapod'), ET.fromstring(text).findall('loop_joint')
    assert [loop.get('name') for loop in loops] == [f'q{n}' for n in range(1, 7)]
    for inputs in near_pose(linkage, 0.05, 5):
        points = linkage.points(linkage.position(*inputs))
        joints = robot.position(*inputs).joints
        model.update_cfg(dict(zip(robot.joint_names, joints, strict=True))
                         | dict(zip(robot.input_names, inputs, strict=True)))  # fmt: skip
        for loop in loops:
            for end in loop:
                at = model.get_transform(end.get('link'), 'ground') @ [*numbers(end, 'xyz'), 1.0]
                assert at[:3] == pytest.approx(points[loop.get('name')], abs=1e-12)


def test_pinocchio_reads_a_hexapod_urdf(hexapod):
    pinocchio = pytest.importorskip('pinocchio')
    model = pinocchio.buildModelFromXML(hexapod[0])
    assert {'leg1_x', 'leg1_y', 'leg1', 'x', 'r_z'} < {*model.names}
    assert model.nv == 6 + 6 * 3


SCENE = 'linkage: {urdf: robots/ankle.urdf, input: [pitch, roll]}\nrate: 200\n'
SCENE += 'drive: {sine: {amplitude: 0.1, frequency: 0.5}}\neffects: {velocity: {}}\n'


def test_robot_bag_replays_without_its_urdf(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'robots').mkdir()
    urdf = tmp_path / 'robots' / 'ankle.urdf'
    urdf.write_bytes((ROBOTS / 'ankle.urdf').read_bytes())
    (tmp_path / 'legs.yaml').write_text(SCENE)
    assert load_scene('legs.yaml').files['linkage.urdf'] == urdf.read_bytes()
    assert main(['simulate', 'legs.yaml', '--seconds', '1', '-o', 'bag']) == 0
    urdf.unlink()
    assert main(['replay', 'bag']) == 0
    assert 'identical: all 201 ticks' in capsys.readouterr().out
    assert main(['report', 'bag', '-o', 'bag.html']) == 0


BAD = yaml.safe_load((ROBOTS / 'refused.yaml').read_text('utf-8'))
MANY = [
    f'<loop_joint name="a" type="spherical"><link1 link="bar1" xyz="{n} 0 0"/>'
    f'<link2 link="foot" xyz="{n} 1 0"/></loop_joint>'
    for n in range(3000)
]
LARGE = {
    'LOOPS': ''.join(MANY),
    'FEWER': ''.join(MANY[:198]),
    'PADDING': ' ' * 10_000_000,
    'JOINTS': ''.join(
        f'<joint name="j{n}" type="fixed"><parent link="foot"/><child link="k{n}"/></joint>'
        f'<link name="k{n}"/>'
        for n in range(2000)
    ),
    'CHAIN': ''.join(
        f'<joint name="j{n}" type="continuous"><parent link="{f"k{n}" if n else "chassis"}"/>'
        f'<child link="k{n + 1}"/><axis xyz="0 1 0"/></joint><link name="k{n + 1}"/>'
        for n in range(101)
    ),
}


@pytest.mark.parametrize('case', BAD)
def test_bad_robots_are_refused_in_one_line(tmp_path, case):
    told = BAD[case].get('told', {'input': ['pitch', 'roll']})
    text = (ROBOTS / f'{BAD[case].get("robot", "ankle")}.urdf').read_text()
    for old, new in {**BAD[case].get('changes', {}), **LARGE}.items():
        assert old in text or old in LARGE
        text = text.replace(old, new)
    with pytest.raises(LinkageError) as caught:
        read(tmp_path, text, **told)
    said = str(caught.value).replace(str(tmp_path / 'robot.urdf'), 'FILE')
    assert said.removeprefix('FILE: ') == BAD[case]['line']


def test_robot_options_on_a_linkage_file_are_refused(tmp_path):
    with pytest.raises(LinkageError, match='is not a robot; leave out input'):
        linkage_content(named_file('four_bar', 'linkages'), {'input': 'x'})
    scene = parse_yaml(SCENE.encode(), 'legs.yaml')
    assert scene.section('linkage').text('urdf') == 'robots/ankle.urdf'


WELDED = """
<robot name="welded"><link name="base"/><link name="crank"/><link name="rod"/><link name="rocker"/>
<link name="end"/><joint name="q1" type="continuous"><parent link="base"/><child link="crank"/>
<axis xyz="0 0 1"/></joint><joint name="q2" type="continuous"><parent link="crank"/>
<child link="rod"/><origin xyz="0.1 0 0" rpy="0 0 0.6"/><axis xyz="0 0 1"/></joint>
<joint name="q3" type="continuous"><parent link="base"/><child link="rocker"/>
<origin xyz="0.35 0 0"/><axis xyz="0 0 1"/></joint><joint name="q4" type="continuous">
<parent link="rocker"/><child link="end"/><origin xyz="-0.0023993155270964905 0.1693927420185106 0"
rpy="0 0 0.6"/><axis xyz="0 0 1"/></joint>%s</robot>
"""
CLOSED_BY = '<loop_joint name="loop" type="{}"><link1 link="rod" xyz="0.3 0 0" rpy="0 0 0"/>'
CLOSED_BY += '<link2 link="end" xyz="0 0 0" rpy="{} {} {}"/><axis xyz="0 0 1"/></loop_joint>'


def angle_between(kind, rpy):
    """Return how far frames that were parallel are apart, or their z axes, by matrices."""
    turned = origin(ET.fromstring(f'<origin rpy="{" ".join(map(str, rpy))}"/>'))[:3, :3]
    if kind == 'revolute':
        return np.arccos(np.clip(abs(turned[2, 2]), 0, 1))
    return np.arccos(np.clip((np.trace(turned) - 1) / 2, -1, 1))


@pytest.mark.sample(1)
@pytest.mark.parametrize('kind', ['fixed', 'revolute', 'prismatic'])
def test_misaligned_closing_frames_are_refused(tmp_path, kind, turns):
    for _ in range(4):
        rpy = turns.uniform(0.4, 3.0, 3) * turns.choice([-1, 1], 3)
        with pytest.raises(LinkageError, match='the loop loop is open by') as caught:
            read(tmp_path, WELDED % CLOSED_BY.format(kind, *rpy), input='q1')
        told = float(re.search(r'open by (\S+) rad', str(caught.value))[1])
        assert told == pytest.approx(angle_between(kind, rpy), abs=6e-3)


@pytest.mark.parametrize('kind', ['fixed', 'revolute'])
def test_check_prints_rounding_of_closing_frames(tmp_path, kind, capsys):
    rpy = (3e-4, -2e-4, 0.0)
    text = WELDED % CLOSED_BY.format(kind, *rpy)
    if kind == 'revolute':
        text = text.replace('"q4" type="continuous"', '"q4" type="fixed"')
    closure = read(tmp_path, text, input='q1')
    assert closure.linkage.corrections.turned_by == pytest.approx(
        angle_between(kind, rpy), rel=1e-6
    )
    assert main(['check', str(tmp_path / 'robot.urdf'), '--input', 'q1', '--radians']) == 0
    assert ' m and 0.00036 rad in the pose' in capsys.readouterr().out


TIP = '<link name="tip"/><joint name="tip" type="fixed"><parent link="rod"/><child link="tip"/>'
TIP += '<origin xyz="0.3 0 0" rpy="0 0 -0.5"/></joint>'


@pytest.mark.parametrize('welded', [CLOSED_BY.format('fixed', 0, 0, 0.5), 'tip=end:fixed'])
def test_open_weld_error_proposes_the_closing_pose(tmp_path, welded, turns):
    text, close = WELDED % (welded if '<' in welded else TIP), [] if '<' in welded else [welded]
    with pytest.raises(LinkageError, match=r'is open by 0\.5 rad in the pose; near it') as caught:
        read(tmp_path, text, input='q1', close=close)
    at = yaml.safe_load(str(caught.value).partition('at: ')[2])
    assert at == {'q4': -0.5}
    closure = read(tmp_path, text, input='q1', close=close, at=at)
    assert closure.linkage.corrections.turned_by < 1e-15
    # Rod and end are one link: by the angles from base to it, over crank and over rocker.
    for crank in turns.uniform(-3.0, 3.0, 5):
        joints = closure.position(crank)
        over_crank = crank + 0.6 + joints['q2']
        away = over_crank - (joints['q3'] + 0.6 + joints['q4'] + 0.5)
        assert np.remainder(away + np.pi, 2.0 * np.pi) - np.pi == pytest.approx(0.0, abs=1e-12)


def test_welded_places_need_no_correction(tmp_path):
    close = ['rod.0.3,0,0=end.0,0,0:fixed']
    closure = read(tmp_path, WELDED.replace('rpy="0 0 0.6"/><axis xyz="0 0 1"/></joint>%s', '/>'
                   '<axis xyz="0 0 1"/></joint>%s') % '', input='q1', close=close)  # fmt: skip
    assert closure.linkage.corrections.turned_by == 0.0


COMMANDED = (
    '<ros2_control name="c" type="system">'
    '<joint name="m1"><command_interface name="position"/></joint>'
    '<joint name="m2"><command_interface name="effort"/></joint>'
    '<joint name="pitch"><state_interface name="position"/></joint></ros2_control>'
)
TRANSMITTED = (
    '<transmission name="t1"><joint name="pitch"/><actuator name="a"/></transmission>'
    '<transmission name="t2"><joint name="roll"/></transmission>'
)


@pytest.mark.parametrize(
    ('added', 'inputs'),
    [
        (COMMANDED, ('m1', 'm2')),
        (TRANSMITTED, ('pitch', 'roll')),
        (TRANSMITTED + COMMANDED, ('m1', 'm2')),
        (COMMANDED.replace('"m2"', '"m2" independent="true"'), ('m1', 'm2')),
    ],
    ids=['ros2_control', 'transmissions', 'both', 'an attribute more'],
)
def test_urdf_tags_select_the_motor_joints(tmp_path, added, inputs):
    ankle = (ROBOTS / 'ankle.urdf').read_text()
    closure = read(tmp_path, ankle.replace('</robot>', f'{added}</robot>'))
    assert closure.input_names == inputs
    told = read(tmp_path, ankle.replace('</robot>', f'{added}</robot>'), input=['pitch', 'roll'])
    assert told.input_names == ('pitch', 'roll'), 'who names inputs is heard'


@pytest.mark.parametrize('name', ['ankle', 'rover', 'palletizer', 'turntable'])
def test_suggested_inputs_of_a_robot_drive_it(tmp_path, name):
    told = {key: value for key, value in CHOICES[name][0].items() if key != 'input'}
    text = re.sub(' independent="true"', '', (ROBOTS / f'{name}.urdf').read_text())
    with pytest.raises(LinkageError, match='does not say which joint drives it; write') as caught:
        read(tmp_path, text, **told)
    (inputs,) = re.findall(r'in a scene input: \[(.*)\]$', str(caught.value))
    closure = read(tmp_path, text, **told, input=inputs.split(', '))
    assert closure.position(*closure.linkage.pose.inputs).status.has_rates


@pytest.mark.parametrize(('apart', 'told'), [(0.0, 0.0), (1e-9, 0.0), (0.012, 0.012)])
def test_planar_pin_offset_along_its_axis_is_recorded(tmp_path, apart, told):
    """Links of a plane lie beside each other; a wrong place along the axis looks the same."""
    text, end = (ROBOTS / 'four_bar.urdf').read_text(), '<origin xyz="0.08 0 0"/>'
    assert end in text
    one, other = (
        read(tmp_path, text.replace(end, f'<origin xyz="0.08 0 {z}"/>'), **CHOICES['four_bar'][0])
        for z in (0.0, apart)
    )
    assert other.linkage.corrections.beside_by == pytest.approx(told, abs=1e-12)
    inputs = one.linkage.pose.inputs
    assert other.position(*inputs).joints == pytest.approx(one.position(*inputs).joints, abs=1e-7)


def open_leg(number, rod, turns):
    """Return a four-bar in a plane of its own, open at 0: crank 0.1, rocker 0.2, ground 0.25."""
    a, b, c = turns
    joints = ''.join(
        f'<joint name="{name}{number}" type="continuous"><parent link="{parent}"/>'
        f'<child link="{child}{number}"/><origin xyz="{x} 0 {z}" rpy="0 0 {turn}"/>'
        f'<axis xyz="0 0 1"/></joint><link name="{child}{number}"/>'
        for name, parent, child, x, z, turn in (
            ('a', 'base', 'crank', 0.0, number, a),
            ('b', f'crank{number}', 'rod', 0.1, 0.0, b),
            ('c', 'base', 'rocker', 0.25, number, c),
        )
    )
    return (
        f'{joints}<loop_joint name="loop{number}" type="spherical">'
        f'<link1 link="rod{number}" xyz="{rod} 0 0"/><link2 link="rocker{number}" xyz="0.2 0 0"/>'
        '</loop_joint>'
    )


def test_loop_bound_counts_loops_that_move_together(tmp_path):
    # Every other leg is stretched out at 0, and found from joints that are nudged.
    legs = {n: (0.22 + 0.004 * n, ((0.3, 0.2, 1.1), (0.0, 0.0, 0.0))[n % 2]) for n in range(21)}
    text = ''.join(open_leg(number, *leg) for number, leg in legs.items())
    robot = f'<robot name="legs"><link name="base"/>{text}</robot>'
    closure = read(tmp_path, robot, input=[f'a{number}' for number in legs], near=True)
    inputs = closure.linkage.pose.inputs
    pose = closure.position(*inputs)
    values = dict(zip(closure.joint_names, pose.joints, strict=True))
    values |= dict(zip(closure.input_names, inputs, strict=True))
    for number, (rod, rest) in legs.items():
        a, b, c = (values[f'{name}{number}'] + at for name, at in zip('abc', rest, strict=True))
        end = 0.1 * np.exp(1j * a) + rod * np.exp(1j * (a + b))
        assert end == pytest.approx(0.25 + 0.2 * np.exp(1j * c), abs=1e-12)
