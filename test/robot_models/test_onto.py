# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Linkages back onto the robots that they came from: frames meet in space, and all else stays."""

from dataclasses import replace
import io

from linkage_ros.cli.main import main
from linkage_ros.description import read_urdf
from linkage_ros.errors import FileError
from linkage_ros.kinematics import Closure, RevoluteJoint
from linkage_ros.tools.models import linkage_from_urdf, ModelPart, urdf_onto
import numpy as np
import pytest
import yourdfpy

from .test_import import closed_values, frame, GRIPPER, joint, LINK, PLACES, robot, TREE
from ..support.scenes import LINKAGES

# A slider-crank whose rod ends on the line of a slot, in a plane that is turned in space.
SLOT = robot(
    ''.join(map(LINK, ('base', 'crank', 'rod', 'slot'))),
    joint('crank_joint', 'base', 'crank', '0.01 0.2 0.05', '1.1 0.4 -0.3', axis='0 0 1'),
    joint('rod_joint', 'crank', 'rod', '0.05 0 0.012', axis='0 0 1'),
    joint('slot_slide', 'base', 'slot', '0.01 0.2 0.05', '1.1 0.4 -0.3', 'prismatic', '1 0 0'),
    frame('rod', 'end', '0.15 0 0'),
)
ROBOTS = {
    'a four-bar': (robot(TREE), [PLACES], ['crank_joint'], closed_values(0.5)),
    'a gripper on an arm': (GRIPPER, [('bar_end', 'finger_end')], ['motor_joint'], {}),
    'a slider in a tilted plane': (SLOT, [('end', 'slot')], ['crank_joint'], {'slot_slide': 0.2}),
}


def added_to(name):
    """Return a robot, the linkage imported from it, and the robot with what closes its loops."""
    text, *options = ROBOTS[name]
    urdf = read_urdf(text.encode(), 'r.urdf')
    linkage = linkage_from_urdf(urdf, *options).linkage
    return text, linkage, urdf_onto(urdf, text.encode(), [ModelPart(Closure(linkage))]).decode()


@pytest.mark.parametrize('name', ROBOTS)
def test_the_robot_stays_and_the_frames_say_the_loops(name):
    """Imported again without any option, the linkage is the same."""
    before, linkage, after = added_to(name)
    assert after.startswith(before.removesuffix('</robot>'))
    again = linkage_from_urdf(read_urdf(after.encode(), 'r.urdf')).linkage
    one, other = Closure(linkage), Closure(again)
    assert one.linkage.joints.keys() == other.linkage.joints.keys()
    for value in np.linspace(0.4, 0.6, 5):
        expected = one.position(value).joints
        assert expected
        assert other.position(value).joints == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize('name', ROBOTS)
def test_frames_of_a_pin_meet_in_space(name):
    """The robot is walked by yourdfpy, with the joints that the linkage publishes."""
    before, linkage, after = added_to(name)
    model = yourdfpy.URDF.load(
        io.BytesIO(after.replace('<mimic joint="motor_joint" multiplier="0.8"/>', '').encode()),
        build_scene_graph=True,
        load_meshes=False,
    )
    frames = sorted(
        {*read_urdf(after.encode(), 'r').links} - {*read_urdf(before.encode(), 'r').links}
    )
    assert len(frames) == 2
    closure = Closure(linkage)
    driven = linkage.inputs[0].joint
    for value in np.linspace(0.3, 0.6, 7):
        position = closure.position(value)
        names = [*linkage.joints, driven]
        shown = dict(zip(names, [*position.joints, value], strict=True))
        model.update_cfg(
            {name: shown[name] for name in shown if name in model.actuated_joint_names}
        )
        one, other = (model.get_transform(name) for name in frames)
        assert np.abs(one[:3, 3] - other[:3, 3]).max() < 1e-12
        assert one[:3, 2] == pytest.approx(other[:3, 2], abs=1e-12)


def test_a_published_joint_that_the_robot_lacks_is_added():
    """Its frame turns with the child, as seen from the parent, both walked by yourdfpy."""
    text, *options = ROBOTS['a gripper on an arm']
    urdf = read_urdf(text.encode(), 'r.urdf')
    linkage = linkage_from_urdf(urdf, *options).linkage
    joints = {**linkage.joints, 'lean': RevoluteJoint('ground', 'bar')}
    closure = Closure(replace(linkage, joints=joints))
    data = urdf_onto(urdf, text.encode(), [ModelPart(closure)])
    model = yourdfpy.URDF.load(
        io.BytesIO(data.replace(b'<mimic joint="motor_joint" multiplier="0.8"/>', b'')),
        build_scene_graph=True,
        load_meshes=False,
    )
    seen = []
    for value in (0.2, 0.5):
        position = closure.position(value)
        model.update_cfg(
            dict(zip(joints, position.joints, strict=True))
            | {'motor_joint': value, 'shoulder': 0.4}
        )
        frame, bar = (model.get_transform(name)[:3, :3] for name in ('lean_frame', 'bar'))
        seen.append(frame.T @ bar)
    assert np.abs(seen[0] - seen[1]).max() < 1e-12


def test_what_linkage_urdf_wrote_lacks_nothing(tmp_path, capsys):
    model, again = tmp_path / 'leg.urdf', tmp_path / 'again.urdf'
    linkage = str(LINKAGES / 'jansen_leg.yaml')
    assert main(['urdf', linkage, '-o', str(model)]) == 0
    assert main(['urdf', linkage, '--onto', str(model), '-o', str(again)]) == 0
    assert again.read_bytes() == model.read_bytes()
    assert main(['urdf', linkage, '--onto', str(tmp_path / 'no.urdf')]) == 2
    assert 'no.urdf: cannot be read' in capsys.readouterr().err


ROCKER = joint('rocker_joint', 'base', 'rocker', '0.15 0 0', kind='{}', axis='{}')
BAD = {
    'another robot': (
        robot(TREE.replace('xyz="0.1 0 0"', 'xyz="0.11 0 0"')),
        'r.urdf: joint coupler_joint: is at (0.11, 0) m of the plane, where the linkage has no',
    ),
    'a slide instead of a pin': (
        robot(
            TREE.replace(ROCKER.format('revolute', '0 0 1'), ROCKER.format('prismatic', '1 0 0'))
        ),
        'r.urdf: joint rocker_joint: slides, and not in the linkage; name the robot',
    ),
    'another link': (
        robot(TREE.replace('"rocker"', '"follower"')),
        "r.urdf: has no link 'rocker' that its joints move; name the robot",
    ),
    'other names': (
        robot(TREE.replace('_joint"', '_pin"')),
        'r.urdf: has none of the joints coupler_joint, crank_joint, rocker_joint; name the robot',
    ),
}


@pytest.mark.parametrize('name', BAD)
def test_a_robot_that_it_did_not_come_from(name):
    text, message = BAD[name]
    _, linkage, _ = added_to('a four-bar')
    with pytest.raises(FileError) as caught:
        urdf_onto(read_urdf(text.encode(), 'r.urdf'), text.encode(), [ModelPart(Closure(linkage))])
    assert str(caught.value).startswith(message)
