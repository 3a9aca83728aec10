# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Every scene that comes with the package, on a graph: what it publishes, and what that shows."""

from cmath import exp
from contextlib import nullcontext
from math import cos, hypot, remainder, sin, sqrt, tau
from pathlib import Path

import pytest
from sensor_msgs.msg import JointState, MultiDOFJointState
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

from .graph import NS, stamp_of, wait_for
from .loops import four_bar, inverted_slider_crank, modulo_turns
from .test_spatial import RODS
from .turning import angle_at, turning

SCENES = Path(__file__).parents[2] / 'config' / 'scenes'
SECONDS = 1.0
"""How long each is heard; the press makes two strokes."""

FOUR_BAR = ['coupler_joint', 'rocker_joint']
DRIVEN_FOUR_BAR = ['crank_joint', *FOUR_BAR]
JANSEN = ['upper_rod_joint', 'upper_triangle_joint', 'lower_rod_joint', 'lower_rocker_joint',
          'parallel_rod_joint', 'leg_joint']  # fmt: skip
BUCKET = ['bucket_cylinder', 'tube_joint', 'rocker_joint', 'bucket_link_joint', 'bucket_joint']
FINGERS = [f'{side}_{joint}' for side in ('left', 'right') for joint in DRIVEN_FOUR_BAR]

# Name: (joints, arrays beside the positions, topics beside the joint states, crank from a topic).
PUBLISHED = {
    'bare': (FOUR_BAR, '', {}, True),
    'demo': (FOUR_BAR, 'velocity', {}, True),
    'encoder_rocker': (DRIVEN_FOUR_BAR, 'velocity', {}, False),
    'excavator_delay': (BUCKET, 'velocity', {}, False),
    'fault_drill': (FOUR_BAR, 'velocity', {'faults': 'std_msgs/msg/String'}, True),
    'inverted_slider_crank': (['rod_joint', 'rod_slide'], 'velocity', {}, True),
    'jansen_leg': (JANSEN, 'velocity', {'motion': 'trajectory_msgs/msg/JointTrajectory'}, True),
    'motion': (FOUR_BAR, 'velocity', {'motion': 'trajectory_msgs/msg/JointTrajectory'}, True),
    'torque_ankle': (['m1', 'm2', 'pitch', 'roll'], 'velocity effort', {}, False),
    'torque_crank': (DRIVEN_FOUR_BAR, 'velocity effort', {}, False),
    'two_fingers': (FINGERS, 'velocity', {}, False),
    'visible_bucket': (
        BUCKET,
        'velocity effort',
        {
            'pin_forces': 'sensor_msgs/msg/MultiDOFJointState',
            'markers': 'visualization_msgs/msg/MarkerArray',
        },
        False,
    ),
    'worn_press': (
        ['crank_joint', 'rod_joint', 'piston_slide'],
        'velocity effort',
        {'pin_forces': 'sensor_msgs/msg/MultiDOFJointState'},
        False,
    ),
}  # fmt: skip


def span(states):
    """Return from when to when states are, in [s]."""
    return (stamp_of(states[-1]) - stamp_of(states[0])) / NS if states else 0.0


def closes(loop, first=None):
    """Return what asks for joints that close a loop over the crank of the tests."""

    def check(states, _):
        for state in states[:first]:
            expected = loop(angle_at(stamp_of(state)))
            for value, joint in zip(state.position, expected, strict=True):
                assert exp(1j * value) == modulo_turns(joint)

    return check


def is_a_four_bar(theta, *joints, within=1e-9):
    for value, joint in zip(joints, four_bar(theta), strict=True):
        assert abs(remainder(value - joint, tau)) < within


def counts_and_ideal_neighbours(states, _):
    for state in states:
        crank, coupler, rocker = state.position
        counts = rocker * 4096 / tau
        assert counts == pytest.approx(round(counts), abs=1e-6)
        # Of one instant, between two ticks: within what interpolating leaves.
        assert abs(remainder(coupler - four_bar(crank)[0], tau)) < 1e-6
        assert abs(remainder(rocker - four_bar(crank)[1], tau)) < tau / 4096 + 1.5e-3
    assert len({state.position[2] for state in states}) < len(states)
    # Rates that no mechanism has: a count more or less.
    assert any(abs(state.velocity[2]) > 1.0 for state in states)


def fifty_samples_a_second(states, _):
    moving = {tuple(state.position) for state in states}
    assert 10 < len(moving) <= 50 * span(states) + 3
    for state in states:
        assert (state.position[0] - 0.8) * (1.2 - state.position[0]) >= 0.0


def at_rest_under_its_brake(states, _):
    for state in states:
        is_a_four_bar(*state.position)
        assert state.position[0] == 0.5
        assert list(state.velocity) == [0.0, 0.0, 0.0]
        assert state.effort[0] != 0.0  # what holds the weight
        assert list(state.effort[1:]) == [0.0, 0.0]


def sinks_without_commands(states, _):
    for state in states:
        values = dict(zip(state.name, state.position, strict=True))
        assert all(abs(gap(values)) < 1e-9 for gap in RODS['ankle_motors'])
        assert list(state.effort) == [0.0] * 4
    # The foot's centre of mass is before the ankle: the toes sink.
    pitch = [state.position[2] for state in states]
    assert pitch == sorted(pitch)
    assert pitch[-1] > 0.1


def two_loops_of_their_own(states, _):
    for state in states:
        is_a_four_bar(*state.position[:3])
        is_a_four_bar(*state.position[3:])
    # They do not close at one time.
    assert any(abs(state.position[0] - state.position[3]) > 0.05 for state in states)


def worn_and_loaded(states, extras):
    a, rod, offset = 0.040, 0.140, 0.010
    for state in states:
        theta = state.position[0]
        drawn = a * cos(theta) + sqrt(rod**2 - (a * sin(theta) - offset) ** 2)
        # Holes and pins within 30 µm of the drawing, and 130 µm of play in all.
        assert 0.0 < abs(state.position[2] - drawn) < 5e-4
        assert list(state.effort[1:]) == [0.0, 0.0]
    assert min(state.effort[0] for state in states) < -1.0
    assert max(state.effort[0] for state in states) > 1.0
    by_stamp = {stamp_of(force): force for force in extras['pin_forces']}
    compared = [by_stamp[stamp_of(state)] for state in states if stamp_of(state) in by_stamp]
    assert len(compared) > 200
    for force in compared:
        assert force.joint_names == ['O2', 'A', 'B', 'cylinder']
        assert len(force.wrench) == 4
        assert force.transforms == force.twist == []
        # The cylinder does not push along its line, except by its friction.
        assert abs(force.wrench[3].force.x) < 30.0


def drawn_where_it_is(states, extras):
    by_stamp = {stamp_of(state): state for state in states}
    compared = 0
    for array in extras['markers']:
        if (state := by_stamp.get(stamp_of(array.markers[0]))) is not None:
            compared += 1
            (rim,) = [m for m in array.markers if (m.ns, m.id) == ('pins', 0)]
            # The cylinder is as long as its pins are apart: K on the ground, C on the rod.
            apart = [hypot(pin.x - 1.18, pin.y - 0.3) for pin in rim.points]
            assert min(abs(length - state.position[0]) for length in apart) < 1e-9
    assert 10 < compared <= 30 * span(states) + 2


def accelerations_of_the_same_instant(states, extras):
    by_stamp = {stamp_of(state): state for state in states}
    compared = 0
    for motion in extras['motion']:
        if (state := by_stamp.get(stamp_of(motion))) is not None:
            compared += 1
            (point,) = motion.points
            assert motion.joint_names == state.name
            assert (point.positions, point.velocities) == (state.position, state.velocity)
            assert len(point.accelerations) == len(state.name)
    assert compared > 200


SHOWN = {
    'bare': closes(four_bar),
    'demo': closes(four_bar),
    'encoder_rocker': counts_and_ideal_neighbours,
    'excavator_delay': fifty_samples_a_second,
    'fault_drill': closes(four_bar, first=200),  # all is well for 2 s
    'inverted_slider_crank': closes(inverted_slider_crank),
    'jansen_leg': accelerations_of_the_same_instant,
    'motion': accelerations_of_the_same_instant,
    'torque_ankle': sinks_without_commands,
    'torque_crank': at_rest_under_its_brake,
    'two_fingers': two_loops_of_their_own,
    'visible_bucket': drawn_where_it_is,
    'worn_press': worn_and_loaded,
}
OF_EVERY_NODE = {
    '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
    '/linkage_node/scene': 'std_msgs/msg/String',
    '/linkage_node/transition_event': 'lifecycle_msgs/msg/TransitionEvent',
    '/parameter_events': 'rcl_interfaces/msg/ParameterEvent',
    '/rosout': 'rcl_interfaces/msg/Log',
}
TYPES = {
    'trajectory_msgs/msg/JointTrajectory': JointTrajectory,
    'sensor_msgs/msg/MultiDOFJointState': MultiDOFJointState,
    'visualization_msgs/msg/MarkerArray': MarkerArray,
}


def published(graph):
    """Return the topics of the node, each with its type; nothing before all are discovered."""
    if ('linkage_node', '/') not in graph.node.get_node_names_and_namespaces():
        return None
    topics = dict(graph.node.get_publisher_names_and_types_by_node('linkage_node', '/'))
    # The node has made these before those that a scene calls for.
    found = {topic: kind for topic, (kind,) in topics.items()}
    return found if OF_EVERY_NODE.keys() <= found.keys() else None


def test_scene_tests_cover_every_shipped_scene():
    shipped = {file.stem for file in SCENES.glob('*.yaml')}
    assert set(PUBLISHED) == set(SHOWN) == shipped


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', PUBLISHED)
def test_shipped_scene_publishes_exactly_its_topics(graph, start, name):
    joints, arrays, extra_topics, from_topic = PUBLISHED[name]
    states = graph.listen(JointState, '/joint_states')
    extras = {
        topic: graph.listen(TYPES[kind], f'/linkage_node/{topic}')
        for topic, kind in extra_topics.items()
        if kind in TYPES
    }
    publisher = graph.publisher(JointState, '/crank_states')
    node = start(SCENES / f'{name}.yaml')
    with turning(publisher) if from_topic else nullcontext():
        wait_for(lambda: span(states) > SECONDS, 'joint states')
        topics = wait_for(lambda: published(graph), 'the names of its topics')
        assert node.end() == 0
    assert 'Traceback' not in node.log
    assert topics == {
        '/joint_states': 'sensor_msgs/msg/JointState',
        **{f'/linkage_node/{topic}': kind for topic, kind in extra_topics.items()},
        **OF_EVERY_NODE,
    }
    stamps = [stamp_of(state) for state in states]
    assert stamps == sorted(set(stamps))
    for state in states:
        assert state.name == joints
        for array in ('position', 'velocity', 'effort'):
            there = array == 'position' or array in arrays.split()
            assert len(getattr(state, array)) == (len(joints) if there else 0), array
    SHOWN[name](states.copy(), extras)
