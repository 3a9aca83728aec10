# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""URDFs of others, with the pins that close them, as linkages; and those that are none."""

from cmath import phase, rect
from math import cos, hypot, remainder, sin, tau

from linkage_ros import load
from linkage_ros.cli.main import main
from linkage_ros.description import linkage_text, parse_yaml, read_linkage, read_urdf
from linkage_ros.errors import FileError
from linkage_ros.kinematics import Closure, Limits, RevoluteJoint
from linkage_ros.tools.models import find_pinned, linkage_from_urdf
import numpy as np
import pytest

from .odd import UNTOLD
from .walked import Walked
from ..support.scenes import LINKAGES

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


def gripper(**options):
    options = {'close': [('bar_end', 'finger_end')], 'inputs': ['motor_joint'], **options}
    return linkage_from_urdf(read_urdf(GRIPPER.encode(), 'g.urdf'), **options)


def test_a_gripper_on_an_arm():
    """Its joints close the pin in the URDF itself, walked by yourdfpy, all over the range."""
    made = gripper()
    closure = Closure(made.linkage)
    assert made.left_out == (
        'link base, which belongs to no loop',
        'mimic of finger_joint: the loops move it',
    )
    assert set(made.linkage.joints) == {'bar_joint', 'finger_joint'}
    model = Walked(GRIPPER.replace('<mimic joint="motor_joint" multiplier="0.8"/>', '').encode())
    start = closure.position(0.0).joints
    assert all(abs(remainder(value, tau)) < 1e-12 for value in start)
    for angle in np.linspace(-0.3, 0.5, 41):
        names, values = list(closure.linkage.joints), closure.position(angle).joints
        model.model.update_cfg(
            dict(zip(names, values, strict=True)) | {'motor_joint': angle, 'shoulder': 0.7}
        )
        ends = [model.model.get_transform(end, 'palm')[:3, 3] for end in ('bar_end', 'finger_end')]
        apart = ends[0] - ends[1]
        assert hypot(apart[0], apart[2]) < 1e-12 * 0.1


def test_masses_are_laid_into_the_plane():
    """What is fixed together is one body; the inertia is that about y, by hand."""
    masses = gripper().linkage.masses
    assert set(masses) == {'motor', 'bar', 'finger'}
    assert masses['motor'].mass == 0.1
    assert masses['motor'].inertia == pytest.approx(2e-4)
    # The bar's tensor is turned about x, so that its z is the plane's normal.
    assert masses['bar'].inertia == pytest.approx(3e-4)
    finger = masses['finger']
    assert finger.mass == pytest.approx(0.22)
    # The finger's x points back; the plane's x is z, its y is x, of the wrist, which the palm is
    # turned against.
    one, other = complex(0.02, -0.01) * rect(1.0, 0.3), complex(0.07, 0.03) * rect(1.0, 0.3)
    centre = (0.2 * one + 0.02 * other) / 0.22
    assert complex(*finger.center) == pytest.approx(centre)
    own = 2e-4 + 1e-4 * sin(0.5) ** 2 + 2e-4 * cos(0.5) ** 2
    expected = own + 0.2 * abs(one - centre) ** 2 + 0.02 * abs(other - centre) ** 2
    assert finger.inertia == pytest.approx(expected)


def test_signs_are_those_of_the_urdf():
    """A joint about −y counts the other way: the finger's axis is −y of a frame turned round."""
    joints = gripper().linkage.joints
    assert joints['finger_joint'] == RevoluteJoint('ground', 'finger', LIMITS)
    assert joints['bar_joint'] == RevoluteJoint('bar', 'motor', LIMITS)


def test_a_pose_says_the_side():
    """Of the same URDF with another zero, a pose in which the pins meet has to be told."""
    turned = GRIPPER.replace(
        'xyz="0.05 0 0" rpy="0 0 3.14159265358979"', 'xyz="0.05 0 0" rpy="0 0.5 3.14159265358979"'
    )
    assert turned != GRIPPER
    file = read_urdf(turned.encode(), 'g.urdf')
    options = {'close': [('bar_end', 'finger_end')], 'inputs': ['motor_joint']}
    with pytest.raises(FileError, match='m apart where all joints are 0; give a pose'):
        linkage_from_urdf(file, **options)
    made = linkage_from_urdf(file, at={'finger_joint': 0.5}, **options)
    again, first = Closure(made.linkage), Closure(gripper().linkage)
    assert again.linkage.pose.inputs == (0.0,)
    for angle in (0.1, -0.2):
        place = list(again.linkage.joints).index('finger_joint')
        one, other = again.position(angle).joints[place], first.position(angle).joints[place]
        assert remainder(one - other - 0.5, tau) == pytest.approx(0.0, abs=1e-12)


FOLDED = """<robot name="r">
<link name="base"/><link name="crank"/><link name="rod"/><link name="arm"/>{}</robot>"""


def folded(crank, arm, **options):
    """Return a parallelogram, with its crank and its arm turned by so much where they are at 0."""
    parts = [
        joint('crank_joint', 'base', 'crank', '0 0 0', f'0 0 {crank}', axis='0 0 1'),
        joint('rod_joint', 'crank', 'rod', '0.1 0 0', f'0 0 {-crank}', axis='0 0 1'),
        joint('arm_joint', 'base', 'arm', '0.3 0 0', f'0 0 {arm}', axis='0 0 1'),
        frame('rod', 'rod_end', '0.3 0 0'),
        frame('arm', 'arm_end', '0.1 0 0'),
    ]
    urdf = read_urdf(FOLDED.format(''.join(parts)).encode(), 'r.urdf')
    return linkage_from_urdf(urdf, [('rod_end', 'arm_end')], ['crank_joint'], **options)


def test_a_start_in_which_two_assemblies_meet():
    with pytest.raises(
        FileError, match='several assemblies close the loops where all joints are 0; give'
    ):
        folded(0, 0)
    at = {'crank_joint': 1.0, 'rod_joint': -1.0, 'arm_joint': 1.0}
    linkage = folded(0, 0, at=at).linkage
    assert Closure(linkage).position(2.0).joints == pytest.approx((-2.0, 2.0))
    assert linkage.pose.inputs == (1.0,)


def test_a_start_that_is_closed_says_the_side():
    """Of a parallelogram it is the side at the start, and its links stay parallel from there."""
    for turned in (1.0, -1.0, 2.5):
        linkage = folded(turned, turned).linkage
        again = read_linkage(parse_yaml(linkage_text(linkage, []).encode(), 'again'))
        for value in (-0.4, 0.0, 0.3, 9.0):
            joints = Closure(again).position(value).joints
            assert all(
                abs(remainder(p - q, tau)) < 1e-12
                for p, q in zip(joints, (-value, value), strict=True)
            )


def robot(*parts):
    return f'<robot name="r">{"".join(parts)}</robot>'


LINK = '<link name="{}"/>'.format
CLOSED = [('a', 'b')]

# A four-bar whose loop is closed by the tags of simulators; ground 150, 100, 200, 150 mm.
TREE = ''.join(map(LINK, ('base', 'crank', 'coupler', 'rocker'))) + ''.join(
    joint(f'{child}_joint', parent, child, f'{x} 0 0', axis='0 0 1')
    for parent, child, x in (
        ('base', 'crank', 0), ('crank', 'coupler', 0.1), ('base', 'rocker', 0.15),
    )
)  # fmt: skip
PLACES = ('coupler.0.2,0,0', 'rocker.0.15,0,0')
LOOP_JOINT = (
    '<loop_joint name="pin" type="{}"><link1 link="coupler" xyz="0.2 0 0" rpy="0 0 0"/>'
    '<link2 link="rocker" xyz="0.15 0 0" rpy="0 0 0"/></loop_joint>'
)
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


@pytest.mark.parametrize(
    'tags',
    [
        LOOP_JOINT.format('revolute'),
        LOOP_JOINT.format('spherical'),
        LOOP_CONSTRAINT,
        LOOP_JOINT.format('revolute') + LOOP_CONSTRAINT,
        SDF_JOINT,
        SDF_JOINT.replace('<pose>', '<pose relative_to="coupler">'),
    ],
    ids=[
        'loop_joint', 'spherical', 'loop_constraint', 'one pin by both', 'gazebo',
        'gazebo, frame named',
    ],
)  # fmt: skip
def test_loop_tags_close_as_places_do(tags):
    at = closed_values(0.5)
    asked = linkage_from_urdf(read_urdf(robot(TREE).encode(), 'r'), [PLACES], ['crank_joint'], at)
    found = linkage_from_urdf(read_urdf(robot(TREE, tags).encode(), 'r'), (), ['crank_joint'], at)
    assert found.left_out == ()
    for crank in (0.5, 1.1, 2.0):
        joints = Closure(found.linkage).position(crank)
        expected = Closure(asked.linkage).position(crank).joints
        assert joints.joints == pytest.approx(expected, abs=1e-12)
        assert joints['rocker_joint'] == pytest.approx(closed_values(crank)['rocker_joint'])


@pytest.mark.parametrize('tags', [LOOP_CONSTRAINT, SDF_JOINT])
def test_a_robot_that_import_takes_is_solved_as_it_is(tmp_path, tags):
    """Its pins of Gazebo are where they are with all joints at 0: its frames are turned so."""
    at = closed_values(0.5)
    turned = ''.join(map(LINK, ('base', 'crank', 'coupler', 'rocker')))
    turned += ''.join(
        joint(f'{child}_joint', parent, child, f'{x} 0 0', f'0 0 {at[child + "_joint"]}',
              axis='0 0 1')
        for parent, child, x in (
            ('base', 'crank', 0), ('crank', 'coupler', 0.1), ('base', 'rocker', 0.15),
        )
    )  # fmt: skip
    file = tmp_path / 'robot.urdf'
    file.write_text(robot(turned, tags))
    closure = load(file, {'input': 'crank_joint'})
    for crank in (0.5, 1.1, 2.0):
        found = closure.position(crank - 0.5)
        for name in ('coupler_joint', 'rocker_joint'):
            assert found[name] == pytest.approx(closed_values(crank)[name] - at[name], abs=1e-12)


def test_a_pin_of_gazebo_is_where_it_is_with_all_joints_at_0():
    """Frames are turned so that the loop is closed there, and its plane is tilted."""
    at = closed_values(0.5)
    turned = ''.join(map(LINK, ('base', 'floor', 'crank', 'coupler', 'rocker')))
    turned += joint('tilt', 'base', 'floor', '1 2 3', '0.3 0.2 0.1', kind='fixed')
    turned += ''.join(
        joint(f'{child}_joint', parent, child, f'{x} 0 0', f'0 0 {at[child + "_joint"]}',
              axis='0 0 1')
        for parent, child, x in (
            ('floor', 'crank', 0), ('crank', 'coupler', 0.1), ('floor', 'rocker', 0.15),
        )
    )  # fmt: skip
    ((end, place),) = find_pinned(read_urdf(robot(turned, SDF_JOINT).encode(), 'r'))
    assert end == 'coupler.0.2,0.0,0.0'
    link, _, xyz = place.partition('.')
    assert link == 'rocker'
    assert [*map(float, xyz.split(','))] == pytest.approx([0.15, 0.0, 0.0], abs=1e-12)


UNREAD = {
    SDF_JOINT.replace(
        '<pose>', '<pose relative_to="base">'
    ): 'joint pin of <gazebo>, between rocker and coupler',
    LOOP_JOINT.format('prismatic'): '<loop_joint> pin, which is not a pin',
    ''.join(
        LOOP_JOINT.replace('"pin"', f'"{name}"').format('screw') for name in 'ab'
    ): '<loop_joint> a, b, which are not pins',
    50 * '<closure type="ball"/>': '<closure>',
}


@pytest.mark.parametrize('tags', UNREAD)
def test_tags_that_are_not_read_are_named(tags):
    urdf = read_urdf(robot(TREE, tags).encode(), 'r')
    made = linkage_from_urdf(urdf, [PLACES], ['crank_joint'], closed_values(0.5))
    assert made.left_out == (f'{UNREAD[tags]}: close loops by --close',)
    with pytest.raises(FileError, match=f'closes no loop; not read: {UNREAD[tags]}; name'):
        linkage_from_urdf(urdf, (), ['crank_joint'])


def test_usual_tags_are_no_loops():
    tags = '<material name="m"/><transmission name="t"/><gazebo reference="crank"/><!-- -->'
    made = linkage_from_urdf(
        read_urdf(robot(TREE, tags, LOOP_CONSTRAINT).encode(), 'r'), (), ['crank_joint'],
        closed_values(0.5),
    )  # fmt: skip
    assert made.left_out == ()


A_B = LINK('base') + LINK('a') + LINK('b')
FLAT = joint('j', 'base', 'a', '0 0 0', axis='0 0 1')
BAD = {
    'a loop tag of no link': (
        robot(TREE, LOOP_CONSTRAINT.replace('"coupler"', '"rod"')),
        "x.urdf: loop_constraint pin: its child 'rod' is not a link; name a link",
    ),
    'a loop tag of a link that is misspelt': (
        robot(TREE, LOOP_CONSTRAINT.replace('"coupler"', '"couple"')),
        "x.urdf: loop_constraint pin: its child 'couple' is not a link; did you mean 'coupler'?",
    ),
    'a loop tag without a place': (
        robot(TREE, LOOP_CONSTRAINT.replace('0.2 0 0', '0.2')),
        "x.urdf: loop_constraint pin: xyz='0.2' is not 3 finite numbers; correct it",
    ),
    'a pin of gazebo on no link': (
        robot(TREE, SDF_JOINT.replace('>rocker<', '>rod<')),
        "x.urdf: joint pin of <gazebo>: its parent 'rod' is not a link; name a link",
    ),
    'a pin of gazebo nowhere': (
        robot(TREE, SDF_JOINT.replace('0.2 0 0 0 0 0', '0.2 0 inf 0 0 0')),
        "x.urdf: joint pin of <gazebo>: pose='0.2 0 inf 0 0 0' is not 6 finite numbers; correct",
    ),
    'no XML': ('<robot', 'x.urdf:1: is not XML (unclosed token); name a URDF'),
    'another file': ('<sdf/>', 'x.urdf: is XML, and not a <robot>; name a URDF file'),
    'xacro': (robot('<link name="${prefix}a"/>'),
              'x.urdf: is written in xacro; run first: xacro FILE > FILE.urdf'),
    'nothing': (robot(), 'x.urdf: has no link; name a URDF file'),
    'no name': (robot('<link/>'), "x.urdf: a link has the name ''; give it a name"),
    'a link twice': (robot(LINK('a'), LINK('a')),
                     'x.urdf: link a: is a duplicate name; rename one'),
    'a joint of no kind': (robot(A_B, joint('j', 'base', 'a', '0 0 0', kind='ball')),
                           ("x.urdf: joint j: type='ball' is not a joint type; "
                            'write revolute, continuous, prismatic or fixed')),
    'a planar joint': (
        robot(A_B, joint('j', 'base', 'a', '0 0 0', kind='planar'), joint('k', 'a', 'b', '0 0 0')),
        (
            'x.urdf: joint j: type planar cannot be a pin or slider of a planar linkage; write '
            'revolute, continuous, prismatic or fixed, or leave it out with what hangs on it'
        ),
    ),
    'a floating joint in a loop': (
        robot(A_B, FLAT, joint('free', 'a', 'b', '0 0 0', kind='floating')),
        'x.urdf: joint free: type floating cannot be a pin',
    ),
    'a joint to nothing': (robot(A_B, joint('j', 'base', 'c', '0 0 0')),
                           "x.urdf: joint j: its child 'c' is not a link; name a link"),
    'no number': (robot(A_B, joint('j', 'base', 'a', '0 nan 0')),
                  "x.urdf: joint j: xyz='0 nan 0' is not 3 finite numbers; correct it"),
    'an axis of nothing': (robot(A_B, joint('j', 'base', 'a', '0 0 0', axis='0 0 0')),
                           'x.urdf: joint j: its axis is 0 0 0; write 0 0 1, for example'),
    'two parents': (robot(A_B, FLAT, joint('k', 'b', 'a', '0 0 0')),
                    ('x.urdf: link a: is the child of two joints, j and k; let one end in its own '
                     'frame, and close it by --close')),
    'two roots': (robot(A_B, FLAT), 'x.urdf: has 2 roots (base, b); join all links by joints'),
    'a ring': (robot(A_B, joint('j', 'a', 'b', '0 0 0'), joint('k', 'b', 'a', '0 0 0')),
               'x.urdf: joint j: is in a ring of joints; close it by --close instead'),
    'a mimic of nothing': (
        robot(
            A_B,
            joint('j', 'base', 'a', '0 0 0', more='<mimic joint="q"/>'),
            frame('a', 'c', '0 0 0'),
            joint('k', 'a', 'b', '0 0 0'),
        ),
        "x.urdf: joint j: mimics 'q', which is not a joint; name a joint",
    ),
    'no such frame': (robot(A_B, FLAT, joint('k', 'base', 'b', '1 0 0', axis='0 0 1')),
                      "x.urdf: --close a=bb: there is no link 'bb'; did you mean 'b'?",
                      [('a', 'bb')]),
    'one frame': (robot(A_B, FLAT, joint('k', 'base', 'b', '1 0 0', axis='0 0 1')),
                  'x.urdf: --close a=a: names one link twice; name two', [('a', 'a')]),
    'no loop': (robot(A_B, FLAT, joint('k', 'base', 'b', '1 0 0', axis='0 0 1')),
                'x.urdf: closes no loop; name frames that meet: --close FRAME=FRAME, or call them',
                []),
    'frames of one body': (
        robot(
            A_B,
            FLAT,
            frame('a', 'a2', '1 0 0'),
            joint('k', 'base', 'b', '1 0 0', axis='0 0 1'),
            frame('b', 'b2', '0 1 0'),
        ),
        "x.urdf: --close a=a2: both are fixed to 'a'; name frames of two links",
        [('a', 'b2'), ('a', 'a2')],
    ),
    'another plane': (
        robot(A_B, FLAT, joint('k', 'base', 'b', '1 0 0', axis='0 0.1 1')),
        'x.urdf: joint k: turns about another direction than j; write it fixed, or leave it out',
    ),
    'a slide out of the plane': (
        robot(A_B, FLAT, joint('k', 'base', 'b', '1 0 0', kind='prismatic', axis='0 0 1')),
        'x.urdf: joint k: does not slide in the plane that j turns in; write it fixed',
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', BAD)
def test_what_is_no_linkage(name):
    text, message, *close = BAD[name]
    with pytest.raises(FileError) as caught:
        linkage_from_urdf(read_urdf(text.encode(), 'x.urdf'), *(close or [CLOSED]), ['j'])
    assert '\n' not in str(caught.value)
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize(
    ('inputs', 'line'),
    [
        ([], 'x.urdf: does not say which joint drives it; write --input JOINT, one of j'),
        (['k'], 'x.urdf: --input k: drives no loop, and no joint that mimics it; .* one of j'),
    ],
)  # fmt: skip
def test_what_joints_that_mimic_follow_has_to_be_said(inputs, line):
    gear = joint('k', 'base', 'b', '1 0 0', axis='0 0 1', more='<mimic joint="j"/>')
    urdf = read_urdf(robot(A_B, FLAT, gear).encode(), 'x.urdf')
    with pytest.raises(FileError, match=f'^{line}$'):
        linkage_from_urdf(urdf, (), inputs)
    assert linkage_from_urdf(urdf, (), ['j']).linkage.ratios.keys() == {'k'}


def test_what_drives_it_has_to_be_said():
    with pytest.raises(
        FileError, match='which joint drives it; write --input JOINT, one of motor_joint'
    ):
        gripper(inputs=[])
    with pytest.raises(
        FileError, match="--input motor: is not a moving joint; did you mean 'motor_joint'"
    ):
        gripper(inputs=['motor'])
    with pytest.raises(
        FileError, match=r"links\.bar: is over-constrained by pin 'bar_joint_pin' and"
    ):
        gripper(inputs=['motor_joint', 'finger_joint'])
    with pytest.raises(FileError, match='--at elbow: is not a moving joint'):
        gripper(at={'elbow': 0.1})


class TestCommand:
    """``linkage urdf``, ``linkage mjcf`` and ``linkage import``, as they are typed."""

    def test_there_and_back(self, tmp_path, capsys):
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

    def test_models_of_others_become_linkages(self, tmp_path, capsys):
        file = tmp_path / 'g.urdf'
        file.write_text(GRIPPER)
        typed = ['import', str(file), '--close', 'bar_end=finger_end', '--input', 'motor_joint']
        assert main(typed) == 0
        out, err = capsys.readouterr()
        assert out.startswith('# Imported from g.urdf by linkage import.\nlinks:\n  ground:')
        assert err == (
            'left out: link base, which belongs to no loop\n'
            'left out: mimic of finger_joint: the loops move it\n'
        )

    @pytest.mark.parametrize(
        ('typed', 'message'),
        [
            (['urdf', 'nowhere.yaml'], 'linkage urdf: nowhere.yaml: '),
            (['mjcf', 'nowhere.yaml'], 'linkage mjcf: nowhere.yaml: '),
            (['import', 'nowhere.urdf'], 'linkage import: nowhere.urdf: cannot be read (No such'),
            (['import', '.'], 'linkage import: .: is a folder, not a URDF; name a URDF'),
        ],
    )
    def test_a_file_that_is_not_there(self, typed, message, capsys, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        assert main(typed) == 2
        err = capsys.readouterr().err
        assert err.startswith(message)
        assert err.count('\n') == 1

    def test_a_linkage_that_does_not_tell_all(self, tmp_path, capsys):
        text, remedy = UNTOLD['the coupler']
        file = tmp_path / 'l.yaml'
        file.write_text(text)
        assert main(['urdf', str(file)]) == 2
        err = capsys.readouterr().err
        line = text.count('\n') + 1
        told = f'joints: the published joints do not determine where {remedy}'
        assert err == f'linkage urdf: {file}:{line}: {told}\n'

    def test_where_it_cannot_be_written(self, tmp_path, capsys):
        folder = tmp_path / 'x.urdf'
        folder.mkdir()
        assert main(['urdf', str(LINKAGES / 'four_bar.yaml'), '-o', str(folder)]) == 2
        assert 'exists already; name another' in capsys.readouterr().err

    @pytest.mark.parametrize('typed', [['--close', 'a'], ['--at', 'a=b'], ['--at', 'a']])
    def test_options_that_are_none(self, typed, capsys):
        with pytest.raises(SystemExit) as caught:
            main(['import', 'x.urdf', *typed])
        assert caught.value.code == 2
        assert 'write' in capsys.readouterr().err
