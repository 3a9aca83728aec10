# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The relay: commands of a dependent joint in, commands of its crank out."""

from math import nan

from linkage_ros import DefinitionError, load
from linkage_ros.description import load_scene
from linkage_ros.node import CommandRelay, PARAMETERS, RefusedError
import numpy as np
import pytest
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from .graph import NodeProcess, wait_for
from .test_programs import program

KEYS = ('drive={topic: {joint: rocker_joint, branch: 1}}',)


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ('name', 'joints', 'start'),
    [
        ('five_bar', ('P.x', 'P.y'), (1.1, 1.2)),
        ('ankle_motors', ('pitch', 'roll'), (0.2, -0.1)),
        ('delta', ('x', 'y', 'z'), (0.1, 0.2, 0.3)),
        ('rssr', ('B.x',), (-0.2,)),
        ('gripper', ('left_pad-right_pad',), (0.4,)),
    ],
)
def test_relay_turns_commands_of_joints_into_all_inputs(name, joints, start):
    settings = (f'drive={{topic: {{joint: [{", ".join(joints)}]}}}}',)
    relay = CommandRelay(load_scene(name, settings=settings))
    closure = load(name).measuring(*joints)
    position = closure.position(*start)
    velocity = closure.velocity(position, *([0.3] * len(start)))
    acceleration = closure.acceleration(position, velocity, *([-0.2] * len(start)))
    rows = [[found[joint] for joint in joints] for found in (position, velocity, acceleration)]
    one = JointTrajectoryPoint(positions=rows[0], velocities=rows[1], accelerations=rows[2])
    found = relay.turn_trajectory(JointTrajectory(joint_names=joints, points=[one]))
    assert tuple(found.joint_names) == closure.input_names
    (turned,) = found.points
    assert [*turned.positions] == pytest.approx(start, abs=1e-11)
    assert [*turned.velocities] == pytest.approx([0.3] * len(start), abs=1e-9)
    assert [*turned.accelerations] == pytest.approx([-0.2] * len(start), abs=1e-8)
    # Efforts do the same work on either side, at the motion and at each input's own.
    efforts = [1.0 - 0.6 * k for k in range(len(joints))]
    state = JointState(name=joints, position=rows[0], velocity=rows[1], effort=efforts)
    turned = relay.turn_state(state)
    power = np.dot(efforts, rows[1])
    assert np.dot(turned.effort, turned.velocity) == pytest.approx(power, rel=1e-9, abs=1e-12)
    one.effort = efforts
    (found,) = relay.turn_trajectory(JointTrajectory(joint_names=joints, points=[one])).points
    assert found.effort == turned.effort
    for k in range(len(start)):
        moved = closure.velocity(position, *(float(i == k) for i in range(len(start))))
        work = np.dot(efforts, [moved[joint] for joint in joints])
        assert turned.effort[k] == pytest.approx(work, rel=1e-8, abs=1e-12)
    with pytest.raises(RefusedError, match='is not reached: '):
        relay.turn_state(JointState(name=joints, position=[9.0] * len(joints)))
    if len(joints) > 1:
        with pytest.raises(
            RefusedError, match=f'names {joints[0]} without .*{joints[-1]}; send all'
        ):
            relay.turn_state(JointState(name=joints[:1], position=rows[0][:1]))


@pytest.fixture(scope='module')
def relay():
    return CommandRelay(load_scene('four_bar', settings=KEYS))


def point(*numbers, seconds=1):
    rows = dict(zip(('positions', 'velocities', 'accelerations'), numbers, strict=False))
    made = JointTrajectoryPoint(**{name: [value] for name, value in rows.items()})
    made.time_from_start.sec = seconds
    return made


def trajectory(*points, joint='rocker_joint'):
    made = JointTrajectory(joint_names=[joint], points=list(points))
    made.header.frame_id = 'kept'
    return made


@pytest.mark.parametrize('given', [(1.2,), (1.2, 0.5), (1.2, 0.5, -2.0)])
def test_relay_turns_every_value_of_trajectory_points(relay, given):
    found = relay.turn_trajectory(trajectory(point(*given), point(*given, seconds=2)))
    assert (found.joint_names, found.header.frame_id) == (['crank_joint'], 'kept')
    assert [one.time_from_start.sec for one in found.points] == [1, 2]
    closure = load('four_bar')
    for one in found.points:
        rows = [list(row) for row in (one.positions, one.velocities, one.accelerations)]
        assert [len(row) for row in rows] == [int(i < len(given)) for i in range(3)]
        position = closure.position(rows[0][0])
        assert position['rocker_joint'] == pytest.approx(given[0], abs=1e-15)
        if len(given) > 1:
            velocity = closure.velocity(position, rows[1][0])
            assert velocity['rocker_joint'] == pytest.approx(given[1], rel=1e-13)
        if len(given) > 2:
            acceleration = closure.acceleration(position, velocity, rows[2][0])
            assert acceleration['rocker_joint'] == pytest.approx(given[2], rel=1e-12)


END = load('four_bar').branches('rocker_joint')[0].high


@pytest.mark.parametrize(
    ('message', 'reason'),
    [
        (trajectory(point(1.2), point(3.0)), 'point 2 of 2: rocker_joint at 3 rad is not reached'),
        (trajectory(point(nan)), 'point 1 of 1: rocker_joint at nan rad is not reached'),
        (trajectory(point(END, 0.5)), 'turns back there: the crank has no rate'),
        (trajectory(point(1.0), joint='elbow'), 'names elbow; send rocker_joint only'),
        (trajectory(JointTrajectoryPoint()), '0 positions for 1 joints'),
        (
            trajectory(JointTrajectoryPoint(positions=[1.2], velocities=[1.0, 2.0])),
            'arrays of unequal length',
        ),
    ],
)
def test_relay_refuses_points_without_a_crank_angle(relay, message, reason):
    with pytest.raises(RefusedError) as error:
        relay.turn_trajectory(message)
    assert reason in str(error.value)
    assert '\n' not in str(error.value)


def test_relay_accepts_rest_where_the_joint_turns_back(relay):
    (found,) = relay.turn_trajectory(trajectory(point(END, 0.0, 0.0))).points
    assert list(found.velocities) == [0.0]


def test_turning_back_joint_puts_no_effort_on_the_crank(relay):
    found = relay.turn_state(JointState(name=['rocker_joint'], position=[END], effort=[2.0]))
    assert list(found.effort) == pytest.approx([0.0], abs=1e-6)
    message = JointState(name=['rocker_joint'], position=[1.2], effort=[nan])
    assert np.isnan(relay.turn_state(message).effort).all()


def test_efforts_at_a_crank_toggle_are_not_sent():
    closure = load('double_rocker')
    joint = closure.joint_names[-1]
    end = closure.input_ranges[0].highest
    at = closure.position(end)[joint]
    (number,) = [one.number for one in closure.branches(joint) if abs(one.most - end) < 1e-9]
    drive = f'drive={{topic: {{joint: {joint}, branch: {number}}}}}'
    relay = CommandRelay(load_scene('double_rocker', settings=(drive,)))
    message = JointState(name=[joint], position=[at])
    assert relay.turn_state(message).position == pytest.approx([end], abs=1e-7)
    message.effort = [1.0]
    with pytest.raises(RefusedError, match=f'an effort of {joint} comes to none of the inputs'):
        relay.turn_state(message)


def test_relay_passes_an_empty_trajectory(relay):
    assert relay.turn_trajectory(trajectory()).joint_names == ['crank_joint']


def test_relay_ignores_states_of_other_joints(relay):
    message = JointState(name=['elbow', 'rocker_joint'], position=[0.1, 1.2], velocity=[nan, nan])
    found = relay.turn_state(message)
    assert (found.name, len(found.position), len(found.velocity)) == (['crank_joint'], 1, 1)
    assert relay.turn_state(JointState(name=['elbow'], position=[0.1])) is None


def test_relay_turns_commands_of_two_linkages(tmp_path):
    drive = 'drive: {topic: {joint: rocker_joint, branch: %d}}'
    (tmp_path / 'two.yaml').write_text(
        'linkages:\n'
        f'- {{name: left, linkage: four_bar, {drive % 1}}}\n'
        f'- {{name: right, linkage: four_bar, {drive % 2}}}\n'
    )
    relay = CommandRelay(load_scene(tmp_path / 'two.yaml'))
    names = ['right_rocker_joint', 'left_rocker_joint']
    found = relay.turn_state(JointState(name=names, position=[1.2, 1.3]))
    closure = load('four_bar')
    assert found.name == ['right_crank_joint', 'left_crank_joint']
    cranks = [
        dict(closure.cranks('rocker_joint', value))[branch]
        for value, branch in ((1.2, 2), (1.3, 1))
    ]
    assert list(found.position) == pytest.approx(cranks, abs=4e-15)


def test_relay_refuses_a_scene_without_a_dependent_joint():
    with pytest.raises(DefinitionError, match='names no dependent joint'):
        CommandRelay(load_scene('four_bar'))


def test_relay_without_a_scene_names_the_parameter(tmp_path):
    answer = program(tmp_path, 'linkage_relay', '--help')
    assert all(parameter.name in answer.stdout for parameter in PARAMETERS)
    answer = program(tmp_path, 'linkage_relay')
    assert (answer.returncode, answer.stdout) == (2, '')
    assert answer.stderr.startswith('linkage_relay: parameter scene: names no file; start with')


def test_relay_node_publishes_crank_commands_and_trajectories(graph, domain, folder):
    cranks = graph.listen(JointState, '/crank_commands')
    trajectories = graph.listen(JointTrajectory, '/crank_trajectory')
    states = graph.publisher(JointState, '/joint_commands')
    plans = graph.publisher(JointTrajectory, '/joint_trajectory')
    scene = folder / 'relayed.yaml'
    scene.write_text('linkage: four_bar\ndrive: {topic: {joint: rocker_joint, branch: 1}}\n')
    node = NodeProcess(
        domain,
        folder,
        program=('-m', 'linkage_ros', 'relay', str(scene)),
    )
    try:

        def sent(heard, publisher, message):
            def is_heard():
                publisher.publish(message)
                return heard

            return wait_for(is_heard, 'a command')[0]

        crank = sent(cranks, states, JointState(name=['rocker_joint'], position=[1.2]))
        expected = dict(load('four_bar').cranks('rocker_joint', 1.2))[1]
        assert list(crank.position) == [expected]
        found = sent(trajectories, plans, trajectory(point(1.2, 0.1)))
        assert list(found.points[0].positions) == [expected]
        plans.publish(trajectory(point(3.0)))
        told = wait_for(
            lambda: [
                status
                for array in graph.diagnostics
                for status in array.status
                if status.name == 'linkage_relay: commands' and 'not sent' in status.message
            ],
            'a warning',
        )
        assert 'point 1 of 1: rocker_joint at 3 rad is not reached' in told[0].message
    finally:
        node.kill()
