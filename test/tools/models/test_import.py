# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Robots of others, with the pins that close them, as linkages; and those that are refused."""

from cmath import phase, rect
from dataclasses import replace
from math import cos, hypot, inf, pi, remainder, sin, tau

from linkage_ros import load
from linkage_ros.cli.main import main
from linkage_ros.dynamics import Loads, Mechanics
from linkage_ros.errors import DefinitionError, FileError, LinkageError
from linkage_ros.kinematics import (
    Limits,
    PlanarClosure,
    PoseCorrections,
    RevoluteJoint,
    SpaceClosure,
)
from linkage_ros.resources import linkage_names, spatial_linkage_names
from linkage_ros.tools.models import model_of, urdf_model
import numpy as np
import pytest

from .odd import UNTOLD
from .test_robot_loops import CHOICES, ROBOTS
from .walked import Walked
from ...support.robots import robot_of
from ...support.scenes import LINKAGES

LIMITS = Limits(-3.0, 3.0, velocity=1.0, effort=1.0)
"""What `joint` says below."""


def frame(parent, name, xyz, rpy='0 0 0'):
    return (
        f'<link name="{name}"/><joint name="{name}_fixed" type="fixed"><parent link="{parent}"/>'
        f'<child link="{name}"/><origin xyz="{xyz}" rpy="{rpy}"/></joint>'
    )


def joint(name, parent, child, xyz, rpy='0 0 0', kind='revolute', axis='0 1 0', more=''):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
        f'<limit lower="-3" upper="3" effort="1" velocity="1"/>{more}</joint>'
    )


def weighed(name, mass, xyz='0 0 0', rpy='0 0 0', inertia=(1e-4, 2e-4, 3e-4)):
    ixx, iyy, izz = inertia
    return (
        f'<link name="{name}"><inertial><origin xyz="{xyz}" rpy="{rpy}"/><mass value="{mass}"/>'
        f'<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/></inertial></link>'
    )


# An arm whose wrist turns about z, and on it a finger moved by a four-bar: joints about y, all
# closed with the joints at 0. The finger's joint mimics the motor, as in URDFs without loops.
# Shape of the loop, in the wrist's frame (x, z): motor (0, 0) to (0.03, 0.04); finger (0.05, 0) to
# (0.08, 0.05); the bar between their ends.
BAR_END = 0.05 * cos(0.7) + 0.01 * sin(0.7)
BAR_SIDE = -0.05 * sin(0.7) + 0.01 * cos(0.7)
GRIPPER = f"""<robot name="gripper">
<link name="base"/><link name="wrist"/>
{joint('shoulder', 'base', 'wrist', '0.1 0.2 0.3', '0.4 0.1 0', axis='0 0 1')}
{weighed('palm', 0.3)}{frame('palm', 'tool', '0 0 0.1')}
<joint name="palm_fixed" type="fixed"><parent link="wrist"/><child link="palm"/>
  <origin xyz="0 0.01 0.02" rpy="0 0.3 0"/></joint>
{weighed('motor', 0.1, '0.015 0 0.02')}
{joint('motor_joint', 'palm', 'motor', '0 0 0')}
{weighed('bar', 0.05, '0.01 0 0', '1.5707963267948966 0 0')}
{joint('bar_joint', 'motor', 'bar', '0.03 0.002 0.04', '0 -0.7 0', axis='0 -1 0')}
{weighed('finger', 0.2, '0.01 0 0.02')}
{
    joint(
        'finger_joint',
        'palm',
        'finger',
        '0.05 0 0',
        '0 0 3.14159265358979',
        axis='0 -1 0',
        more='<mimic joint="motor_joint" multiplier="0.8"/>',
    )
}
{weighed('pad', 0.02, '0 0 0.01')}
<joint name="pad_fixed" type="fixed"><parent link="finger"/><child link="pad"/>
  <origin xyz="-0.03 0 0.06" rpy="0 0 0.5"/></joint>
<link name="bar_end"/>
<joint name="bar_end_fixed" type="fixed"><parent link="bar"/><child link="bar_end"/>
  <origin xyz="{BAR_END} 0 {BAR_SIDE}"/></joint>
<link name="finger_end"/>
<joint name="finger_end_fixed" type="fixed"><parent link="finger"/><child link="finger_end"/>
  <origin xyz="-0.03 -0.004 0.05"/></joint>
</robot>"""


def gripper(text=GRIPPER, **told):
    return robot_of(text, **{'close': ['bar_end=finger_end'], 'input': 'motor_joint', **told})


def test_imported_gripper_closes_its_urdf_pins():
    """Its joints close the pin in the URDF itself, walked by yourdfpy, all over the range."""
    closure = gripper()
    assert closure.linkage.left_out == ('shoulder', 'mimic of finger_joint')
    assert closure.linkage.axes == ('x', 'z')
    assert set(closure.linkage.joints) == {'bar_joint', 'finger_joint'}
    model = Walked(GRIPPER.replace('<mimic joint="motor_joint" multiplier="0.8"/>', '').encode())
    assert closure.position(0.0).joints == pytest.approx((0.0, 0.0), abs=1e-12)
    for angle in np.linspace(-0.3, 0.5, 41):
        names, values = closure.joint_names, closure.position(angle).joints
        model.model.update_cfg(
            dict(zip(names, values, strict=True)) | {'motor_joint': angle, 'shoulder': 0.7}
        )
        ends = [model.model.get_transform(end, 'palm')[:3, 3] for end in ('bar_end', 'finger_end')]
        apart = ends[0] - ends[1]
        assert hypot(apart[0], apart[2]) < 1e-12 * 0.1


def test_imported_masses_are_projected_into_the_plane():
    """What is fixed together is one body; the inertia is that about y, by hand."""
    masses = gripper().linkage.masses
    assert set(masses) == {'motor', 'bar', 'finger'}
    assert masses['motor'].mass == 0.1
    assert masses['motor'].inertia == pytest.approx(2e-4)
    # The bar's tensor is turned about x, so that its z is the plane's normal.
    assert masses['bar'].inertia == pytest.approx(3e-4)
    finger = masses['finger']
    assert finger.mass == pytest.approx(0.22)
    # The finger's x points back; x and z are those of the wrist, which the palm is turned against.
    one, other = complex(-0.01, 0.02) * rect(1.0, -0.3), complex(0.03, 0.07) * rect(1.0, -0.3)
    centre = (0.2 * one + 0.02 * other) / 0.22
    assert complex(*finger.center) == pytest.approx(centre)
    own = 2e-4 + 1e-4 * sin(0.5) ** 2 + 2e-4 * cos(0.5) ** 2
    expected = own + 0.2 * abs(one - centre) ** 2 + 0.02 * abs(other - centre) ** 2
    assert finger.inertia == pytest.approx(expected)


def test_imported_joints_keep_the_urdf_signs():
    """From x to z is about −y, as the axis of the bar; the finger's frame is turned round."""
    joints = gripper().linkage.joints
    assert joints['bar_joint'] == RevoluteJoint('motor', 'bar', LIMITS)
    assert joints['finger_joint'] == RevoluteJoint('finger', 'ground', LIMITS)


def test_import_pose_selects_the_assembly():
    """Of the same URDF with another zero, a pose in which the pins meet has to be told."""
    turned = GRIPPER.replace(
        'xyz="0.05 0 0" rpy="0 0 3.14159265358979"', 'xyz="0.05 0 0" rpy="0 0.5 3.14159265358979"'
    )
    assert turned != GRIPPER
    with pytest.raises(FileError, match=r'the loop bar_end_pin is open by .* m in the pose; near'):
        gripper(turned)
    again, first = gripper(turned, at={'finger_joint': 0.5}), gripper()
    assert again.linkage.pose.inputs == (0.0,)
    for angle in (0.1, -0.2):
        one, other = (of.position(angle)['finger_joint'] for of in (again, first))
        assert remainder(one - other - 0.5, tau) == pytest.approx(0.0, abs=1e-12)


FOLDED = """<robot name="r">
<link name="base"/><link name="crank"/><link name="rod"/><link name="arm"/>{}</robot>"""


@pytest.mark.parametrize('turned', [0.0, 1.0, -1.0, 2.5, pi])
def test_imported_parallelogram_links_stay_parallel(turned):
    """Also drawn flat, where two assemblies meet: by the sums of angles."""
    parts = [
        joint('crank_joint', 'base', 'crank', '0 0 0', f'0 0 {turned}', axis='0 0 1'),
        joint('rod_joint', 'crank', 'rod', '0.1 0 0', f'0 0 {-turned}', axis='0 0 1'),
        joint('arm_joint', 'base', 'arm', '0.3 0 0', f'0 0 {turned}', axis='0 0 1'),
        frame('rod', 'rod_end', '0.3 0 0'),
        frame('arm', 'arm_end', '0.1 0 0'),
    ]
    text = FOLDED.format(''.join(parts)).replace('upper="3"', 'upper="30"')
    closure = robot_of(text, close=['rod_end=arm_end'], input='crank_joint')
    for value in (-0.4, 0.0, 0.3, 2.0, 9.0):
        joints = closure.position(value).joints
        assert np.remainder(np.subtract(joints, (-value, value)) + pi, tau) - pi == pytest.approx(
            0.0, abs=1e-12
        )


def robot(*parts):
    return f'<robot name="r">{"".join(parts)}</robot>'


LINK = '<link name="{}"/>'.format

# A four-bar whose loop is closed by the tags of simulators; ground 150, 100, 200, 150 mm.
TREE = ''.join(map(LINK, ('base', 'crank', 'coupler', 'rocker'))) + ''.join(
    joint(f'{child}_joint', parent, child, f'{x} 0 0', axis='0 0 1')
    for parent, child, x in (
        ('base', 'crank', 0), ('crank', 'coupler', 0.1), ('base', 'rocker', 0.15),
    )
)  # fmt: skip
PLACES = ('coupler.0.2,0,0', 'rocker.0.15,0,0')
LOOP_CONSTRAINT = (
    '<loop_constraint name="pin"><parent link="rocker"/><parent_origin xyz="0.15 0 0"/>'
    '<child link="coupler"/><child_origin xyz="0.2 0 0"/></loop_constraint>'
)
SDF_JOINT = (
    '<gazebo><joint name="pin" type="revolute"><parent>rocker</parent><child>coupler</child>'
    '<pose>0.2 0 0 0 0 0</pose></joint></gazebo>'
)


def closed_values(crank):
    """Return the joints' values where the pins of coupler and rocker meet, by circles."""
    start = rect(0.1, crank)
    across = 0.15 - start
    along = (abs(across) ** 2 + 0.2**2 - 0.15**2) / (2 * abs(across))
    pin = start + across / abs(across) * complex(along, (0.2**2 - along**2) ** 0.5)
    coupler, rocker = phase(pin - start), phase(pin - 0.15)
    return {'crank_joint': crank, 'coupler_joint': coupler - crank, 'rocker_joint': rocker}


PINS = {
    'loop_constraint': LOOP_CONSTRAINT,
    'gazebo': SDF_JOINT,
    'gazebo, frame named': SDF_JOINT.replace('<pose>', '<pose relative_to="coupler">'),
    'one pin by both': LOOP_CONSTRAINT + SDF_JOINT,
}


@pytest.mark.parametrize('floor', ['0 0 0', '0.3 0.2 0.1'])
@pytest.mark.parametrize('tags', PINS)
def test_simulator_pin_tags_close_a_loop(tags, floor):
    """Gazebo's are where they are with all joints at 0: frames are turned so, on any floor."""
    at = closed_values(0.5)
    turned = ''.join(map(LINK, ('base', 'floor', 'crank', 'coupler', 'rocker')))
    turned += joint('tilt', 'base', 'floor', '1 2 3', floor, kind='fixed')
    turned += ''.join(
        joint(f'{child}_joint', parent, child, f'{x} 0 0', f'0 0 {at[child + "_joint"]}',
              axis='0 0 1')
        for parent, child, x in (
            ('floor', 'crank', 0), ('crank', 'coupler', 0.1), ('floor', 'rocker', 0.15),
        )
    )  # fmt: skip
    closure = robot_of(robot(turned, PINS[tags]), input='crank_joint')
    assert isinstance(closure, PlanarClosure if floor == '0 0 0' else SpaceClosure)
    for crank in (0.5, 1.1, 2.0):
        found = closure.position(crank - 0.5)
        for name in ('coupler_joint', 'rocker_joint'):
            assert found[name] == pytest.approx(closed_values(crank)[name] - at[name], abs=1e-12)


def test_fixed_joint_of_gazebo_welds_as_at_zero():
    """Half of the coupler hangs on the rocker; with all joints at 0 both halves are parallel."""
    half = SDF_JOINT.replace('revolute', 'fixed').replace('<parent>rocker', '<parent>half')
    weld = LINK('half') + joint('half_joint', 'rocker', 'half', '0.15 0 0', axis='0 0 1')
    weld += half.replace('0.2 0 0 0', '0.1 0 0 0')

    def values(crank):
        at = closed_values(crank)
        return at | {'half_joint': crank + at['coupler_joint'] - at['rocker_joint']}

    closure = robot_of(robot(TREE, weld), input='crank_joint', at=values(0.5))
    for crank in (0.3, 0.5, 1.1):
        found = closure.position(crank)
        for name in ('coupler_joint', 'rocker_joint', 'half_joint'):
            assert found[name] == pytest.approx(values(crank)[name], abs=1e-12)


def test_pose_near_leaves_out_limits_that_exclude_it():
    """The rocker's limits exclude every closed pose; an exporter copied them."""
    start, end = TREE.rsplit('lower="-3" upper="3"', 1)
    limited, told = f'{start}lower="3" upper="3.3"{end}', closed_values(0.5)
    closure = robot_of(robot(limited, LOOP_CONSTRAINT), input='crank_joint', at=told, near=True)
    assert closure.linkage.left_out == ('limits of rocker_joint',)
    assert closure.linkage.joints['rocker_joint'].limits.low == -inf
    with pytest.raises(LinkageError, match=r"bring 'rocker_joint' to .* beyond its limits"):
        robot_of(robot(limited, LOOP_CONSTRAINT), input='crank_joint', at=told)


def test_pose_near_has_no_whole_turns(monkeypatch):
    """The search begins many turns away, as it does when it has not found a nearer pose."""
    monkeypatch.setattr('linkage_ros.description.robot_pose._NUDGES', (40.0,))
    free = TREE.replace('lower="-3" upper="3"', 'lower="-100" upper="100"')
    told = {'input': 'crank_joint', 'at': {'crank_joint': 0.5}, 'near': True}
    closure = robot_of(robot(free, LOOP_CONSTRAINT), **told)
    assert max(map(abs, closure.position(*closure.linkage.pose.inputs).joints)) <= pi


UNREAD = {
    SDF_JOINT.replace(
        '<pose>', '<pose relative_to="base">'
    ): 'joint pin of <gazebo>, between rocker and coupler',
    50 * '<closure type="ball"/>': '<closure>',
}


@pytest.mark.parametrize('tags', UNREAD)
def test_unread_urdf_tags_are_listed(tags):
    told = {'input': 'crank_joint', 'at': closed_values(0.5)}
    linkage = robot_of(robot(TREE, tags), close=['='.join(PLACES)], **told).linkage
    assert linkage.left_out == (f'{UNREAD[tags]} (not read)',)
    with pytest.raises(FileError, match=f'closes no loop; not read: {UNREAD[tags]}; write'):
        robot_of(robot(TREE, tags), **told)


def test_common_urdf_tags_are_ignored():
    tags = '<material name="m"/><transmission name="t"/><gazebo reference="crank"/><!-- -->'
    told = {'input': 'crank_joint', 'at': closed_values(0.5)}
    assert robot_of(robot(TREE, tags, LOOP_CONSTRAINT), **told).linkage.left_out == ()


A_B = LINK('base') + LINK('a') + LINK('b')
FLAT = joint('j', 'base', 'a', '0 0 0', axis='0 0 1')
BAD = {
    'a loop tag of no link': (
        robot(TREE, LOOP_CONSTRAINT.replace('"coupler"', '"rod"')),
        "r.urdf: loop_constraint pin: its child 'rod' is not a link; name a link",
    ),
    'a loop tag of a link that is misspelt': (
        robot(TREE, LOOP_CONSTRAINT.replace('"coupler"', '"couple"')),
        "r.urdf: loop_constraint pin: its child 'couple' is not a link; did you mean 'coupler'?",
    ),
    'a loop tag without a place': (
        robot(TREE, LOOP_CONSTRAINT.replace('0.2 0 0', '0.2')),
        "r.urdf: loop_constraint pin: xyz='0.2' is not 3 finite numbers; correct it",
    ),
    'a pin of gazebo on no link': (
        robot(TREE, SDF_JOINT.replace('>rocker<', '>rod<')),
        "r.urdf: joint pin of <gazebo>: its parent 'rod' is not a link; name a link",
    ),
    'a pin of gazebo nowhere': (
        robot(TREE, SDF_JOINT.replace('0.2 0 0 0 0 0', '0.2 0 inf 0 0 0')),
        "r.urdf: joint pin of <gazebo>: pose='0.2 0 inf 0 0 0' is not 6 finite numbers; correct",
    ),
    'no XML': ('<robot', 'r.urdf:1: is not XML (unclosed token); name a URDF'),
    'another file': ('<sdf/>', 'r.urdf: is XML, and not a <robot>; name a URDF file'),
    'xacro': (robot('<link name="${prefix}a"/>'),
              'r.urdf: is written in xacro; run first: xacro FILE > FILE.urdf'),
    'nothing': (robot(), 'r.urdf: has no link; name a URDF file'),
    'no name': (robot('<link/>'), "r.urdf: a link has the name ''; give it a name"),
    'a link twice': (robot(LINK('a'), LINK('a')),
                     'r.urdf: link a: is a duplicate name; rename one'),
    'a joint of no kind': (robot(A_B, joint('j', 'base', 'a', '0 0 0', kind='ball')),
                           ("r.urdf: joint j: type='ball' is not a joint type; "
                            'write revolute, continuous, prismatic or fixed')),
    'a joint to nothing': (robot(A_B, joint('j', 'base', 'c', '0 0 0')),
                           "r.urdf: joint j: its child 'c' is not a link; name a link"),
    'no number': (robot(A_B, joint('j', 'base', 'a', '0 nan 0')),
                  "r.urdf: joint j: xyz='0 nan 0' is not 3 finite numbers; correct it"),
    'an axis of nothing': (robot(A_B, joint('j', 'base', 'a', '0 0 0', axis='0 0 0')),
                           'r.urdf: joint j: its axis is 0 0 0; write 0 0 1, for example'),
    'two parents': (robot(A_B, FLAT, joint('k', 'b', 'a', '0 0 0')),
                    ('r.urdf: link a: is the child of two joints, j and k; let one end in its own '
                     'frame, and close it by --close')),
    'two roots': (robot(A_B, FLAT), 'r.urdf: has 2 roots (base, b); join all links by joints'),
    'a ring': (robot(A_B, joint('j', 'a', 'b', '0 0 0'), joint('k', 'b', 'a', '0 0 0')),
               'r.urdf: joint j: is in a ring of joints; close it by --close instead'),
    'a mimic of nothing': (
        robot(
            A_B,
            joint('j', 'base', 'a', '0 0 0', more='<mimic joint="q"/>'),
            frame('a', 'c', '0 0 0'),
            joint('k', 'a', 'b', '0 0 0'),
        ),
        "r.urdf: joint j: mimics 'q', which is not a joint; name a joint",
    ),
    'no such frame': (robot(A_B, FLAT, joint('k', 'base', 'b', '1 0 0', axis='0 0 1')),
                      "r.urdf: close: there is no link 'bb'; did you mean 'b'?",
                      ['a=bb']),
    'one frame': (robot(A_B, FLAT, joint('k', 'base', 'b', '1 0 0', axis='0 0 1')),
                  "r.urdf: close: 'a=a' is within 'a', in which nothing moves; name", ['a=a']),
    'frames of one body': (
        robot(
            A_B,
            FLAT,
            frame('a', 'a2', '1 0 0'),
            joint('k', 'base', 'b', '1 0 0', axis='0 0 1'),
            frame('b', 'b2', '0 1 0'),
        ),
        "r.urdf: close: 'a=a2' is within 'a', in which nothing moves; name frames of two links",
        ['a=b2', 'a=a2'],
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', BAD)
def test_urdf_that_gives_no_linkage_is_refused(name):
    text, message, *close = BAD[name]
    with pytest.raises(FileError) as caught:
        robot_of(text, close=close[0] if close else ['a=b'], input='j')
    assert '\n' not in str(caught.value)
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize(
    ('told', 'line'),
    [
        ({}, 'r.urdf: the robot does not say which joint drives it; write --input j; .*'),
        ({'input': 'k'}, "r.urdf: input: 'k' follows 'j'; drive 'j'"),
    ],
)
def test_mimic_robot_needs_a_named_input(told, line):
    gear = joint('k', 'base', 'b', '1 0 0', axis='0 0 1', more='<mimic joint="j"/>')
    with pytest.raises(FileError, match=f'^{line}$'):
        robot_of(robot(A_B, FLAT, gear), **told)
    assert robot_of(robot(A_B, FLAT, gear), input='j').linkage.ratios.keys() == {'k'}


def test_import_without_a_valid_input_is_refused():
    with pytest.raises(FileError, match='drives it; write --input motor_joint, or --input bar_j'):
        gripper(input=[])
    with pytest.raises(FileError, match="no moving joint 'motor'; did you mean 'motor_joint'"):
        gripper(input='motor')
    with pytest.raises(FileError, match='2 inputs for 1 degree of freedom: they depend on each'):
        gripper(input=['motor_joint', 'finger_joint'])
    with pytest.raises(FileError, match="at: there is no moving joint 'elbow'"):
        gripper(at={'elbow': 0.1})


class TestCommand:
    """``linkage urdf``, ``linkage mjcf`` and ``linkage import``, as they are typed."""

    def test_urdf_and_import_commands_round_trip(self, tmp_path, capsys):
        model, file = tmp_path / 'leg.urdf', tmp_path / 'leg.yaml'
        assert main(['urdf', str(LINKAGES / 'jansen_leg.yaml'), '-o', str(model)]) == 0
        assert main(['import', str(model), '-o', str(file)]) == 0
        assert capsys.readouterr().out == f'{model}\n{file}\n'
        assert main(['check', str(file)]) == 0
        assert main(['urdf', str(file)]) == 0
        assert '<robot name="leg">' in capsys.readouterr().out
        assert main(['mjcf', str(file)]) == 0
        assert '<mujoco model="leg">' in capsys.readouterr().out
        assert [path.name for path in tmp_path.iterdir() if path.name.startswith('.')] == []

    def test_import_command_converts_a_foreign_urdf(self, tmp_path, capsys):
        file = tmp_path / 'g.urdf'
        file.write_text(GRIPPER)
        typed = ['import', str(file), '--close', 'bar_end=finger_end', '--input', 'motor_joint']
        assert main(typed) == 0
        out, err = capsys.readouterr()
        assert out.startswith('# Imported from g.urdf by linkage import.\naxes: xz\nlinks:\n')
        assert err == 'left out: shoulder\nleft out: mimic of finger_joint\n'

    @pytest.mark.parametrize(
        ('typed', 'message'),
        [
            (['urdf', 'nowhere.yaml'], 'linkage urdf: nowhere.yaml: '),
            (['mjcf', 'nowhere.yaml'], 'linkage mjcf: nowhere.yaml: '),
            (['import', 'nowhere.urdf'], 'linkage import: nowhere.urdf: cannot be read (No such'),
            (['import', '.'], 'linkage import: .: is a folder, not a URDF; name a URDF'),
        ],
    )
    def test_missing_model_file_is_refused_in_one_line(
        self, typed, message, capsys, tmp_path, monkeypatch
    ):
        monkeypatch.chdir(tmp_path)
        assert main(typed) == 2
        err = capsys.readouterr().err
        assert err.startswith(message)
        assert err.count('\n') == 1

    def test_urdf_command_refuses_undetermined_links(self, tmp_path, capsys):
        text, remedy = UNTOLD['the coupler']
        file = tmp_path / 'l.yaml'
        file.write_text(text)
        assert main(['urdf', str(file)]) == 2
        err = capsys.readouterr().err
        line = text.count('\n') + 1
        told = f'joints: the published joints do not determine where {remedy}'
        assert err == f'linkage urdf: {file}:{line}: {told}\n'

    def test_urdf_command_refuses_an_existing_folder(self, tmp_path, capsys):
        folder = tmp_path / 'x.urdf'
        folder.mkdir()
        assert main(['urdf', str(LINKAGES / 'four_bar.yaml'), '-o', str(folder)]) == 2
        assert 'exists already; name another' in capsys.readouterr().err

    @pytest.mark.parametrize('typed', [['--start', 'a=b'], ['--start', 'a']])
    def test_import_command_refuses_invalid_options(self, typed, capsys):
        with pytest.raises(SystemExit) as caught:
            main(['import', 'x.urdf', *typed])
        assert caught.value.code == 2
        assert 'write' in capsys.readouterr().err


def imported(folder, robot, **told):
    """Return a robot, and the linkage of the file that is imported from it."""
    file = folder / 'linkage.yaml'
    given = [f'--input={name}' for name in told.get('input', ())]
    given += [f'--close={pair}' for pair in told.get('close', ())]
    given += [f'--start={name}={value}' for name, value in told.get('at', {}).items()]
    assert main(['import', str(robot), *given, '-o', str(file)]) == 0
    return load(robot, told), load(file)


def robot_file(folder, name):
    """Return the URDF of a linkage, or of one of the robots, and what is told of it."""
    if name in CHOICES:
        told = CHOICES[name][0]
        driven = told['input']
        return ROBOTS / f'{name}.urdf', {**told, 'input': np.atleast_1d(driven).tolist()}
    file = folder / 'robot.urdf'
    file.write_bytes(model_of(name, urdf_model))
    return file, {}


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', [*linkage_names(), *spatial_linkage_names(), *CHOICES])
def test_imported_linkage_file_equals_the_robot_exactly(tmp_path, name):
    file, told = robot_file(tmp_path, name)
    robot, again = imported(tmp_path, file, **told)
    assert type(robot) is type(again)
    bare = {'corrections': PoseCorrections(), 'left_out': ()}
    one, other = (replace(closure.linkage, **bare) for closure in (robot, again))
    if isinstance(robot, SpaceClosure):
        # A slide is along a direction, wherever.
        slides = {name: replace(slide, at=(0.0, 0.0, 0.0)) for name, slide in one.slides.items()}
        one = replace(one, slides=slides)
    assert repr(one) == repr(other)
    pose = np.array(robot.linkage.pose.inputs)
    for away in np.random.default_rng(49).uniform(-0.2, 0.2, (9, len(pose))):
        expected, found = robot.position(*(pose + away)), again.position(*(pose + away))
        assert found.status is expected.status
        assert found.joints == expected.joints


def test_imported_file_keeps_the_plane_axes(tmp_path):
    _, closure = imported(
        tmp_path, ROBOTS / 'palletizer.urdf', input=['shoulder', 'counterweight']
    )
    assert closure.linkage.axes == ('x', 'z')


@pytest.mark.parametrize('command', ['check', 'view', 'mjcf', 'scene'])
def test_robot_keys_in_a_linkage_file_are_refused(tmp_path, capsys, command):
    file = tmp_path / 'robot.yaml'
    file.write_text(f'urdf: {ROBOTS / "ankle.urdf"}\ninput: [pitch, roll]\n')
    assert main([command, str(file)]) == 2
    err = capsys.readouterr().err
    line = 'urdf: is not a key of a linkage; name the URDF itself, or write linkage: {urdf: FILE}'
    assert line in err or 'is neither a scene nor a linkage; write linkage: FILE for a' in err


def test_import_accepts_inertia_that_only_forces_refuse(tmp_path):
    """Exporters write some for a link without a shape: what reads the robot reads its file."""
    text, mesh = (ROBOTS / 'ankle.urdf').read_text(), '<link name="foot">'
    assert mesh in text
    (tmp_path / 'robot.urdf').write_text(
        text.replace(
            mesh,
            f'{mesh}<inertial><mass value="1"/><inertia ixx="1" iyy="0.1" izz="0.1"/></inertial>',
        )
    )
    robot, again = imported(tmp_path, tmp_path / 'robot.urdf', input=['pitch', 'roll'])
    assert again.linkage.masses == robot.linkage.masses
    with pytest.raises(DefinitionError, match='its principal moments are'):
        Mechanics(again, Loads((0.0, 0.0, -9.81)))
