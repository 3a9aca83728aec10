# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""Robots in SDF and MJCF, and a YAML file of closings beside a URDF: the states of the URDF."""

from pathlib import Path

from linkage_ros.description import load, load_scene, read_as_urdf
from linkage_ros.errors import LinkageError
from linkage_ros.tick import Pipeline
import numpy as np
import pytest

ROBOTS = Path(__file__).parent / 'robots'
ANKLE = {'input': ['pitch', 'roll']}
STATES = [(0.0, 0.0), (0.1, 0.2), (-0.3, 0.15), (0.25, -0.3)]


def joints_at(closure, inputs):
    return dict(zip(closure.linkage.joints, closure.position(*inputs).joints, strict=True))


def assert_same_states(closure, names, states=STATES, told=ANKLE):
    """Compare joints, by their names here and there, with those of ankle.urdf."""
    urdf = load(ROBOTS / 'ankle.urdf', told)
    for inputs in states:
        wanted, found = joints_at(urdf, inputs), joints_at(closure, inputs)
        assert {name: found[here] for name, here in names.items()} == pytest.approx(
            {name: wanted[name] for name in names}, abs=1e-13
        )


def test_sdf_robot_has_the_states_of_the_urdf():
    closure = load(ROBOTS / 'ankle.sdf', ANKLE)
    names = {'m1': 'm1', 'm2': 'm2', 'rod1_y': 'rod1_ends_1', 'rod1_x': 'rod1_ends_2'}
    assert_same_states(closure, names)
    limits = closure.linkage.limits
    assert (limits['roll'].low, limits['roll'].high) == (-0.4, 0.4)
    assert 'm2' not in limits  # 1e16 is none


def test_sdf_axis_that_is_left_out_is_z(tmp_path):
    """As in joint.sdf of SDFormat 1.7: neither <axis> nor <axis2> is required, xyz is 0 0 1."""
    text = (ROBOTS / 'ankle.sdf').read_text('utf-8')
    robots = []
    for second in ('<axis2><xyz>0 0 1</xyz></axis2>', ''):
        robot = tmp_path / 'robot.sdf'
        robot.write_text(text.replace('<axis2><xyz>1 0 0</xyz></axis2>', second))
        robots.append(read_as_urdf(robot))
    assert robots[0] == robots[1]
    assert robots[0] != read_as_urdf(ROBOTS / 'ankle.sdf')


def test_sdf_frame_chain_of_1500_is_resolved(tmp_path):
    frames = ''.join(
        f'<frame name="f{k}"><pose relative_to="f{k + 1}">1e-4 0 0 0 0 0</pose></frame>'
        for k in range(1500)
    )
    text = (ROBOTS / 'ankle.sdf').read_text('utf-8')
    text = text.replace('<frame name="hip_height"><pose>', f'{frames}<frame name="f1500"/>'
                        '<frame name="hip_height"><pose relative_to="f0">')  # fmt: skip
    (tmp_path / 'far.sdf').write_text(text)
    closure = load(tmp_path / 'far.sdf', ANKLE)
    # The hip stands at 0.3 in the model; the ground is the model's.
    at = closure.linkage.hinges['pitch'].at
    assert at == pytest.approx((0.45, 0.1, -0.4), abs=1e-12)


def test_sdf_masses_are_read_in_the_model_pose():
    mass = load(ROBOTS / 'ankle.sdf', ANKLE).linkage.masses['rod2']
    # 0.1 below rod2 on the shin, and turned by 0.4 about x; the shin is turned in the model.
    x, y, z = np.eye(3)
    shin = rotation(z, -1) @ rotation(y, 0.2) @ rotation(x, 0.3)
    turn = shin @ rotation(x, 0.4)
    assert mass.mass == 0.1
    assert mass.center == pytest.approx(
        shin @ (0.040, -0.0165, 0.111) + (0.3, 0.1, -0.4), abs=1e-15
    )
    xx, xy, xz, yy, yz, zz = mass.inertia
    assert np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) == pytest.approx(
        turn @ np.diag([3e-4, 3e-4, 1e-5]) @ turn.T, abs=1e-17
    )


CLOSINGS = """\
closed_loop: [[rod1_tip, foot_eye], ['rod2_tip_joint', foot_eye2]]
type: ['3D', 6d]
name_mot: [toe, pitch, roll]
joint_name: [rod1_start, rod2_start, rod2_socket, gone, bolted]
joint_type: [UJOINT_YX, UJOINT_YX, SPHERICAL, SPHERICAL, FIXED]
"""


def ankle_with_closings(folder):
    """Write the ankle with rods of one joint each, and the file that says what they are."""
    text = (ROBOTS / 'ankle.urdf').read_text('utf-8')
    begin, end = text.index('<joint name="rod1_y"'), text.index('<joint name="m2"')
    after = text.index('<joint name="rod2_y"')
    parts = [
        text[:begin],
        joint(
            'rod1_start', 'revolute', 'bar1', 'rod1', '0 -0.004 -0.0165', '-1.5707963267948966 0 0'
        ),
        joint('rod1_tip_joint', 'fixed', 'rod1', 'rod1_tip', '-0.013 -0.0015 -0.156'),
        joint('bolted', 'revolute', 'shin', 'cover', '0 0 0'),
        text[end:after],
        joint('rod2_start', 'revolute', 'bar2', 'rod2', '0 -0.0165 -0.004'),
        joint('rod2_socket', 'revolute', 'rod2', 'rod2_tip', '-0.018 0.0015 -0.221'),
        joint('rod2_tip_joint', 'fixed', 'rod2_tip', 'rod2_eye', '0 0 0'),
        joint('foot_eye_joint', 'fixed', 'foot', 'foot_eye', '0.022 0.015 0.008'),
        joint('foot_eye2_joint', 'fixed', 'foot', 'foot_eye2', '0.022 -0.015 0.008'),
        '</robot>',
    ]
    (folder / 'robot.urdf').write_text('\n'.join(parts))
    (folder / 'robot.yaml').write_text(CLOSINGS)
    return folder / 'robot.yaml'


def joint(name, kind, parent, child, xyz, rpy='0 0 0'):
    return (
        f'<link name="{child}"/><joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="0 0 1"/></joint>'
    )


def test_closings_file_gives_the_states_of_the_urdf(tmp_path):
    closure = load(ankle_with_closings(tmp_path))
    assert [driven.joint for driven in closure.linkage.inputs] == ['pitch', 'roll']
    names = {'m1': 'm1', 'm2': 'm2', 'rod1_y': 'rod1_start_Y', 'rod1_x': 'rod1_start_X',
             'rod2_y': 'rod2_start_Y', 'rod2_x': 'rod2_start_X'}  # fmt: skip
    assert_same_states(closure, names)
    assert 'SPHERICAL of gone, which is not a joint (not read)' in closure.linkage.left_out


def test_scene_stores_robot_and_closings_as_one_urdf(tmp_path):
    file = ankle_with_closings(tmp_path)
    (tmp_path / 'scene.yaml').write_text('linkage: robot.yaml\nrate: 100\n')
    scene = load_scene(tmp_path / 'scene.yaml')
    assert scene.files['linkage.urdf'] == read_as_urdf(file)
    assert Pipeline(scene).linkages


def mujoco_gap(model, data, closure, inputs):
    """Return by how much MuJoCo's own kinematics miss the closings at the closure's joints."""
    import mujoco

    values = joints_at(closure, inputs)
    values |= dict(zip((each.joint for each in closure.linkage.inputs), inputs, strict=True))
    mujoco.mj_resetData(model, data)
    mujoco.mj_kinematics(model, data)
    for number in range(model.njnt):
        name, address = model.joint(number).name, model.jnt_qposadr[number]
        if model.jnt_type[number] == mujoco.mjtJoint.mjJNT_BALL:
            # Turns about the axes of the world in the pose, as a turn about the body's own.
            body = data.body(name).xmat.reshape(3, 3)
            turn = np.eye(3)
            for letter, axis in zip('123', np.eye(3), strict=True):
                turn = turn @ rotation(axis, values[f'{name}_{letter}'])
            quaternion = np.zeros(4)
            mujoco.mju_mat2Quat(quaternion, (body.T @ turn @ body).reshape(-1))
            data.qpos[slice(address, address + 4)] = quaternion
        else:
            data.qpos[address] = values[name]
    mujoco.mj_forward(model, data)
    return np.abs(data.efc_pos[: data.ne]).max()


def rotation(axis, angle):
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def test_mjcf_loops_close_in_mujoco():
    mujoco = pytest.importorskip('mujoco')
    closure = load(ROBOTS / 'cassie_leg.xml', {'near': True})
    assert [driven.joint for driven in closure.linkage.inputs] == ['knee', 'foot']
    text = (ROBOTS / 'cassie_leg.xml').read_text('utf-8')
    for part in ('<asset><mesh name="shin" file="shin.obj"/></asset>',
                 '<geom type="mesh" mesh="shin"/>'):  # fmt: skip
        text = text.replace(part, '')
    text = text.replace('<compiler ', '<compiler boundmass="1" boundinertia="1" ')
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    draw = np.random.default_rng(7)
    for knee, foot in draw.uniform(np.radians([-110, -120]), np.radians([-45, -50]), (50, 2)):
        assert mujoco_gap(model, data, closure, (knee, foot)) < 1e-12


def test_plugins_of_an_mjcf_are_left_out(tmp_path):
    """A plugin that MuJoCo does not know would be refused: here it never sees one."""
    pytest.importorskip('mujoco')
    text = (ROBOTS / 'cassie_leg.xml').read_text('utf-8')
    plugin = '<extension><plugin plugin="a.soil"><instance name="s"/></plugin></extension>'
    geometry = '<geom type="sphere" size="0.01"><plugin instance="s"/></geom>'
    assert text.count('</body>') > 1
    file = tmp_path / 'leg.xml'
    text = text.replace('</body>', f'{geometry}</body>', 1)
    file.write_text(text.replace('</mujoco>', f'{plugin}</mujoco>'), 'utf-8')
    plain, found = (load(of, {'near': True}) for of in (ROBOTS / 'cassie_leg.xml', file))
    assert joints_at(found, found.linkage.pose.inputs) == joints_at(
        plain, plain.linkage.pose.inputs
    )


def test_mjcf_joint_and_tendon_equalities_become_ratios(tmp_path):
    pytest.importorskip('mujoco')
    (tmp_path / 'tied.xml').write_text("""\
<mujoco><worldbody>
  <body name="arm"><joint name="a" axis="0 0 1"/>
    <body name="hand" pos="1 0 0"><joint name="b" axis="0 0 1"/>
      <body name="tip" pos="1 0 0"><joint name="c" axis="0 0 1"/></body></body></body>
</worldbody>
<tendon>
  <fixed name="cord"><joint joint="b" coef="2"/><joint joint="c" coef="-0.5"/></fixed>
</tendon>
<equality><joint joint1="b" joint2="a" polycoef="0.1 -3 0 0 0"/><tendon tendon1="cord"/></equality>
<actuator><position joint="a"/></actuator></mujoco>
""")
    closure = load(tmp_path / 'tied.xml')
    # The tendon keeps its length at 0: 2 b = 0.5 c.
    b = 0.1 - 3.0 * 0.2
    assert joints_at(closure, (0.2,)) == pytest.approx({'b': b, 'c': 4.0 * b}, abs=1e-15)


@pytest.mark.parametrize('turns', [(90, -90, 90), (-90, 90, 90), (37, 143, -10)])
def test_mjcf_joint_reference_values_are_respected(tmp_path, turns):
    mujoco = pytest.importorskip('mujoco')
    ref = [f'ref="{turn}"' for turn in turns]
    text = f"""\
<mujoco><compiler boundmass="1" boundinertia="1"/><worldbody>
  <body name="crank"><joint name="a" axis="0 1 0" {ref[0]}/>
    <body name="coupler" pos="0 0 0.04" euler="0 70 0">
      <joint name="b" axis="0 1 0" {ref[1]}/></body>
  </body>
  <body name="rocker" pos="0.1 0 0"><joint name="c" axis="0 -1 0" {ref[2]}/></body>
</worldbody>
<equality><connect body1="coupler" body2="rocker" anchor="0 0 0.12"/></equality></mujoco>
"""
    (tmp_path / 'bars.xml').write_text(text)
    closure = load(tmp_path / 'bars.xml', {'input': ['a']})
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    start = np.radians(turns[0])
    for angle in np.linspace(start - 0.3, start + 0.3, 7):
        assert mujoco_gap(model, data, closure, (angle,)) < 1e-14


SDF = '<sdf version="1.7"><model name="m">{}</model></sdf>'
LINK = '<link name="a"/><link name="b"/>'
HINGE = (
    '<joint name="j" type="revolute"><parent>a</parent><child>b</child>'
    '<axis><xyz>0 0 1</xyz></axis></joint>'
)
BODY = '<mujoco><worldbody><body name="b"><joint name="j"/></body></worldbody>{}</mujoco>'
REFUSED = {
    'two models': ('r.sdf', SDF.replace('</model>', '</model><model name="n"/>'),
                   'r.sdf: has 2 models: m, n; keep one'),
    'a nested model': ('r.sdf', SDF.format('<include/>'),
                       ('r.sdf: model m: has a nested <include>; write one model without others: '
                       'gz sdf -p FILE')),
    'a pose in a circle': ('r.sdf', SDF.format('<link name="a"><pose relative_to="b"/></link>'
                           '<link name="b"><pose relative_to="a"/></link>' + HINGE),
                           'r.sdf: b: its pose is relative to itself; name another frame'),
    'a frame that is not there': ('r.sdf', SDF.format(
        '<link name="a"><pose relative_to="bb"/></link><link name="b"/>' + HINGE),
        "r.sdf: there is no frame 'bb'; did you mean 'b'?"),
    'a pose of five numbers': ('r.sdf', SDF.format(
        '<link name="a"><pose>1 2 3 4 5</pose></link><link name="b"/>' + HINGE),
        "r.sdf: link a: '1 2 3 4 5' is not 6 finite numbers; correct it"),
    'a screw': ('r.sdf', SDF.format(LINK + HINGE.replace('revolute', 'screw')),
                ("r.sdf: joint j: type='screw' is not read; write revolute, continuous, "
                 'prismatic, ball, fixed, universal, revolute2')),
    'a link on its own': ('r.sdf', SDF.format(LINK + '<link name="c"/>' + HINGE),
                          'r.sdf: no joint leads from world to c; write a joint of type fixed'),
    'no axis': ('r.sdf', SDF.format(LINK + HINGE.replace('0 0 1', '0 0 0')),
                'r.sdf: joint j: its axis is 0 0 0; write 0 0 1, for example'),
    'universal axes in line': ('r.sdf', SDF.format(LINK + HINGE.replace('revolute', 'universal')),
                               ('r.sdf: joint j: its two axes are parallel; write an <axis2> '
                                'across the first; it is 0 0 1 where none is written')),
    'another file': ('r.xml', BODY.format('<include file="/etc/passwd"/>'),
                     ('r.xml: has an element <include>; write a plain file: mj_saveLastXML')),
    'bodies by number': ('r.xml', BODY.format('<worldbody><replicate count="3"/></worldbody>'),
                         'r.xml: has an element <replicate>; write a plain file: mj_saveLastXML'),
    'no model of MuJoCo': ('r.xml', BODY.replace('name="j"', 'nam="j"').format(''),
                           ('r.xml: is refused by MuJoCo (XML Error: Schema violation: '
                           "unrecognized attribute: 'nam'); correct the file")),
    'a weld that is open': ('r.xml', BODY.format(
        '<equality><weld body1="b" relpose="0 0 1 1 0 0 0"/></equality>'),
        ('r.xml: weld closing_1: holds its bodies 1 from their pose in the file; leave relpose '
         'out, or write the pose in which it holds')),
    'too many joints': ('r.sdf', SDF.format(LINK + ''.join(
        HINGE.replace('"j"', f'"j{number}"') for number in range(2001))),
        'r.sdf: has 2002 joints; keep the part with the loops: 2000'),
    'deep nesting': ('r.xml', BODY.format('<a>' * 5000 + '</a>' * 5000),
                     'r.xml: is nested too deeply; use fewer levels'),
    'closings without a URDF': ('r.yaml', 'closed_loop: [[a, b]]',
                                ('r.yaml: closed_loop: closes loops of no URDF; write the URDF '
                                 'next to it as r.urdf')),
}  # fmt: skip


@pytest.mark.parametrize('case', REFUSED)
def test_unreadable_robot_is_refused_in_one_line(tmp_path, monkeypatch, case):
    name, text, line = REFUSED[case]
    if name.endswith('.xml'):
        pytest.importorskip('mujoco')
    monkeypatch.chdir(tmp_path)
    Path(name).write_text(text)
    with pytest.raises(LinkageError) as caught:
        load(Path(name), {'input': ['j']})
    assert str(caught.value) == line


WRONG_CLOSINGS = {
    'a frame that is not there': (
        'foot_eye2]]', 'foot_ey2]]',
        "1: closed_loop: there is no 'foot_ey2'; did you mean 'foot_eye2'?"),
    'no pair': ("['rod2_tip_joint', foot_eye2]", 'rod2_tip',
                "1: closed_loop: 'rod2_tip' is not a pair; write [FRAME, FRAME]"),
    'an unknown type': ("'3D', 6d", "'3D', 5d", "2: type: there is no '5d'; name one of 3d, 6d"),
    'a type too few': ("'3D', 6d", "'3D'", '2: type: has 1 entries; write 2 of them'),
    'a motor that is no joint': ('toe, pitch', 'toe, pich',
                                 "3: name_mot: there is no 'pich'; did you mean 'pitch'?"),
    'a key that is not known': (
        'name_mot', 'name_mott', "3: name_mott: unknown key; did you mean 'name_mot'?"),
}  # fmt: skip


@pytest.mark.parametrize('case', WRONG_CLOSINGS)
def test_wrong_closings_are_refused_in_one_line(tmp_path, case):
    old, new, line = WRONG_CLOSINGS[case]
    file = ankle_with_closings(tmp_path)
    assert CLOSINGS.count(old) == 1
    file.write_text(CLOSINGS.replace(old, new))
    with pytest.raises(LinkageError) as caught:
        load(file)
    assert str(caught.value) == f'{file}:{line}'


FINGERS = """\
<mujoco><worldbody>
  <body name="right"><joint name="right" axis="0 0 1"/>
    <body name="tip" pos="0.1 0 0"><joint name="tip" axis="0 0 1"/></body></body>
  <body name="bar" pos="0 0.05 0"><joint name="bar" axis="0 0 1"/></body>
  <body name="left" pos="-0.1 0 0"><joint name="left" axis="0 0 1"/>
    <body name="left_tip" pos="-0.1 0 0"><joint name="left_tip" axis="0 0 1"/></body></body>
  <body name="left_bar" pos="-0.1 0.05 0"><joint name="left_bar" axis="0 0 1"/></body>
</worldbody>
<tendon>
  <fixed name="split"><joint joint="right" coef="0.5"/><joint joint="left" coef="0.5"/></fixed>
</tendon>
<equality>
  <connect body1="bar" body2="tip" anchor="0.1 0 0"/>
  <connect body1="left_bar" body2="left_tip" anchor="-0.1 0 0"/>
  <joint joint1="right" joint2="left" polycoef="0 -1 0 0 0"/>
</equality>
<actuator><general tendon="split"/></actuator></mujoco>
"""


@pytest.mark.parametrize('chosen', [{}, {'input': 'right'}, {'input': 'left'}])
def test_motor_on_a_tendon_drives_both_fingers(tmp_path, chosen):
    """Parallelograms: all links of a finger turn alike, and one finger against the other."""
    pytest.importorskip('mujoco')
    (tmp_path / 'fingers.xml').write_text(FINGERS)
    closure = load(tmp_path / 'fingers.xml', chosen)
    (driven,) = closure.input_names
    assert driven == chosen.get('input', 'left')
    values = closure.position(0.3)
    for name in ('left', 'left_bar', 'bar', 'right'):
        if name != driven:
            sign = 1.0 if ('left' in name) == (driven == 'left') else -1.0
            assert values[name] == pytest.approx(sign * 0.3, abs=1e-12)


def test_closings_file_with_a_misspelt_joint_is_refused(tmp_path):
    file = ankle_with_closings(tmp_path)
    file.write_text(CLOSINGS.replace('rod1_start', 'rod1_strat'))
    with pytest.raises(LinkageError, match="no joint 'rod1_strat'; did you mean 'rod1_start'"):
        load(file)
