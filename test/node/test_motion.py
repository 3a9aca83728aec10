# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""~/motion carries positions, rates and accelerations, only where a scene asks for it."""

from array import array
from cmath import exp
import os
from pathlib import Path
import subprocess
import sys
import time

from lifecycle_msgs.msg import Transition
import pytest
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from .graph import crank, NS, stamp_of, wait_for
from .loops import (
    accelerations,
    five_bar_gap,
    four_bar,
    inverted_slider_crank,
    modulo_turns,
    rates,
)
from ..support.scenes import FIVE_BAR

MOTION = '/linkage_node/motion'
OMEGA = 20.0
ERROR = b'\2'
ROOT = Path(__file__).parents[2]
ONE_ANGLE = 'four_bar: {a: 1.0, b: 1.0, c: 1.0, d: 3.0}'


@pytest.fixture
def publisher(graph):
    return graph.publisher(JointState, '/crank_states')


@pytest.fixture
def motions(graph):
    return graph.listen(JointTrajectory, MOTION)


def turn(publisher, seconds, begin):
    """Publish a crank that turns at OMEGA from the time `begin` on."""
    wait_for(publisher.get_subscription_count, 'the node')
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        stamp = time.time_ns()
        publisher.publish(crank(OMEGA * ((stamp - begin) / NS), OMEGA, stamp))
        time.sleep(0.005)


@pytest.mark.parametrize(
    ('linkage', 'loop'),
    [('four_bar', four_bar), ('inverted_slider_crank', inverted_slider_crank)],
)
def test_motion_topic_holds_accelerations_of_a_constant_crank(
    graph, write_scene, start, publisher, motions, linkage, loop
):
    text = 'rate: 200\neffects: {acceleration: {}}'
    node = start(write_scene(f'motion_{linkage}', text, linkage))
    states = graph.listen(JointState, '/joint_states')
    begin = time.time_ns()
    turn(publisher, 1.0, begin)
    wait_for(lambda: len(motions) > 50, 'motions')
    same_tick = {stamp_of(state): state for state in states}
    compared = 0
    for message in motions.copy():
        theta = OMEGA * ((stamp_of(message) - begin) / NS)
        (point,) = message.points
        assert list(point.effort) == []
        assert (point.time_from_start.sec, point.time_from_start.nanosec) == (0, 0)
        for value, expected in zip(point.positions, loop(theta), strict=True):
            assert exp(1j * value) == modulo_turns(expected)
        assert list(point.velocities) == pytest.approx(rates(loop, theta, OMEGA), abs=1e-5)
        expected = accelerations(loop, theta, OMEGA)
        assert list(point.accelerations) == pytest.approx(expected, abs=1e-5)
        if (state := same_tick.get(stamp_of(message))) is not None:
            compared += 1
            assert message.joint_names == state.name
            assert message.header == state.header
            assert point.positions == state.position
            assert point.velocities == state.velocity
    assert compared > 50
    assert node.end() == 0
    assert f'to /joint_states and {MOTION}' in node.log


def test_motion_topic_solves_a_linkage_of_two_inputs(
    graph, write_scene, start, publisher, motions
):
    text = 'rate: 200\neffects: {acceleration: {}}\ndrive: {topic: {max_age: 60}}'
    node = start(write_scene('two_inputs', text, FIVE_BAR))
    begin = time.time_ns()
    names, speeds, starts = ['right_crank', 'x', 'left_crank'], [0.5, 7.0, -0.3], [2.0, 0.0, 0.5]

    def publish():
        seconds = (time.time_ns() - begin) / NS
        message = crank(0.0, stamp=begin + round(seconds * NS))
        message.name = names
        message.position = array(
            'd', [s + v * seconds for s, v in zip(starts, speeds, strict=True)]
        )
        message.velocity = array('d', speeds)
        publisher.publish(message)
        return len(motions) > 50

    wait_for(publish, 'motions')
    assert node.end() == 0
    for message in motions:
        seconds = (stamp_of(message) - begin) / NS
        left, right = 0.5 - 0.3 * seconds, 2.0 + 0.5 * seconds
        (point,) = message.points
        assert message.joint_names == ['upper_joint', 'lower_joint']
        assert abs(five_bar_gap(*point.positions, left, right)) < 1e-9
        # The gap stays closed where rates and accelerations are right: p + v·t + a·t²/2.
        for t in (-1e-3, 1e-3):
            upper, lower = (
                p + v * t + a * t * t / 2
                for p, v, a in zip(
                    point.positions, point.velocities, point.accelerations, strict=True
                )
            )
            # What is left is of the third order, and the joints' third derivatives are below 10.
            assert abs(five_bar_gap(upper, lower, left - 0.3 * t, right + 0.5 * t)) < 1e-9
    assert 'crank left_crank, right_crank from /crank_states' in node.log


def test_two_publishers_drive_two_inputs_and_silence_is_named(
    graph, write_scene, start, publisher, motions
):
    other = graph.publisher(JointState, '/crank_states')
    scene = 'rate: 200\neffects: {acceleration: {}}'
    node = start(write_scene('two_drivers', scene, FIVE_BAR))
    wait_for(publisher.get_subscription_count, 'the node')
    wait_for(other.get_subscription_count, 'the node')

    def send_left(until):
        return lambda: publisher.publish(crank(1.0, name='left_crank')) or until()

    wait_for(send_left(lambda: 'no sample of right_crank yet' in node.log), 'the warning')
    assert motions == []
    wait_for(
        send_left(lambda: other.publish(crank(2.0, name='right_crank')) or len(motions) > 400),
        'motions',
    )
    (point,) = motions[-1].points
    assert abs(five_bar_gap(*point.positions, 1.0, 2.0)) < 1e-9
    wait_for(send_left(lambda: 'no sample of right_crank for' in node.log), 'the warning')
    assert 'several publishers' not in node.log
    assert node.end() == 0


def test_motion_topic_holds_positions_only_at_a_toggle(
    graph, write_scene, start, publisher, motions
):
    text = 'rate: 100\ndrive: {topic: {carry_forward: false}}\neffects: {acceleration: {}}'
    node = start(write_scene('motion_toggle', text, ONE_ANGLE))
    wait_for(lambda: publisher.publish(crank(0.0, 1.0)) or len(motions) > 5, 'motions')
    for message in motions.copy():
        (point,) = message.points
        assert len(point.positions) == 2
        assert list(point.velocities) == list(point.accelerations) == []

    def open_for(diagnoses):
        graph.diagnostics.clear()
        wait_for(
            lambda: publisher.publish(crank(1.0, 1.0)) or len(graph.diagnostics) > diagnoses,
            'diagnostics',
        )
        assert graph.status('loop closure').level == ERROR

    open_for(3)
    motions.clear()
    open_for(3)
    assert motions == []
    assert node.end() == 0


def test_motion_topic_appears_and_disappears_with_the_scene(
    graph, folder, write_scene, start, publisher, motions
):
    def publishers():
        return graph.node.get_publishers_info_by_topic(MOTION)

    scene = write_scene('comes', 'rate: 100\neffects: {acceleration: {}}')
    node = start(scene, '-p', 'autostart:=false', ready='')
    for _ in range(2):
        assert not publishers()
        assert graph.change_state(Transition.TRANSITION_CONFIGURE)
        wait_for(publishers, 'the topic')
        assert graph.change_state(Transition.TRANSITION_ACTIVATE)
        motions.clear()
        wait_for(lambda: publisher.publish(crank(0.5, 1.0)) or motions, 'a motion')
        assert graph.change_state(Transition.TRANSITION_DEACTIVATE)
        assert graph.change_state(Transition.TRANSITION_CLEANUP)
        wait_for(lambda: not publishers(), 'no topic')
    scene.write_text(scene.read_text().replace('acceleration', 'velocity'))
    assert graph.change_state(Transition.TRANSITION_CONFIGURE)
    assert graph.change_state(Transition.TRANSITION_ACTIVATE)
    assert not publishers()
    assert node.end() == 0


PROGRAM = """
import sys
import rclpy
from rclpy.parameter import Parameter
from linkage_ros.node.node import LinkageNode

rclpy.init()
node = LinkageNode(parameter_overrides=[Parameter('scene', value=sys.argv[1])])
node.trigger_configure()
node.trigger_activate()
node.end_run()
print(sys.argv[2] in sys.modules)
node.destroy_node()
rclpy.shutdown()
"""


@pytest.fixture
def run_program(domain):
    """Return a function that runs a program, with what it reads from its command line."""

    def run(program, *arguments):
        return subprocess.run(
            [sys.executable, '-c', program, *map(str, arguments)],
            cwd=ROOT,
            env=os.environ | {'ROS_DOMAIN_ID': str(domain), 'PYTHONPATH': str(ROOT)},
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
        )

    return run


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('name', 'text', 'package', 'imported'),
    [
        ('velocity', 'effects: {velocity: {}}', 'trajectory_msgs', False),
        ('acceleration', 'effects: {acceleration: {}}', 'trajectory_msgs', True),
        ('unrecorded', '', 'mcap', False),
        ('recorded', 'record: {directory: FOLDER}', 'mcap', True),
    ],
)
def test_node_imports_packages_only_where_called_for(
    run_program, write_scene, folder, name, text, package, imported
):
    scene = write_scene(f'imports_{name}', text.replace('FOLDER', str(folder / 'runs')))
    done = run_program(PROGRAM, scene, package)
    assert done.stdout.split() == [str(imported)], done.stderr


WITHOUT = """
import sys
from threading import Event
sys.modules[sys.argv[2]] = None
from linkage_ros.node.run import run_linkage_node
sys.exit(run_linkage_node(Event(), [], {'scene': sys.argv[1]}, seconds=0.2))
"""


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('name', 'text', 'package', 'code', 'told'),
    [
        ('acceleration', 'effects: {acceleration: {}}', 'trajectory_msgs', 2,
         ['install the ROS package trajectory_msgs']),
        ('nothing', '', 'mcap', 0, []),
        ('recording', 'record: {directory: runs}', 'mcap', 1,
         ['mcap: is not installed; python3 -m pip']),
    ],
)  # fmt: skip
def test_missing_packages_are_reported_where_needed(
    run_program, write_scene, name, text, package, code, told
):
    drive = 'drive: {constant_rate: {rate: 1}}'
    done = run_program(WITHOUT, write_scene(f'without_{name}', f'{drive}\n{text}'), package)
    assert done.returncode == code, done.stderr
    errors = [line for line in done.stderr.splitlines() if 'ERROR' in line]
    assert len(errors) == len(told)
    assert all(words in line for words, line in zip(told, errors, strict=True))
