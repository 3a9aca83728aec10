# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A crank that falls silent, hangs or is doubled: said, and never dressed up as fresh."""

from contextlib import contextmanager
from pathlib import Path
import re
from threading import Event, Thread
import time

import pytest
from sensor_msgs.msg import JointState

from .conftest import LINKAGES
from .graph import crank, NodeProcess, NS, stamp_of, wait_for

OK, WARN, STALE = b'\0', b'\1', b'\3'
TICKING = 'rate: 100\ndrive: {topic: {max_age: 0.3}}'


@pytest.fixture
def joint_states(graph):
    return graph.listen(JointState, '/joint_states')


@pytest.fixture
def publisher(graph):
    return graph.publisher(JointState, '/crank_states')


@contextmanager
def publishing(publisher, make=lambda: crank(0.5)):
    """Publish 100 times a second; give the list of what has been published."""
    published, ending = [], Event()

    def publish():
        while not ending.wait(0.01):
            published.append(make())
            publisher.publish(published[-1])

    thread = Thread(target=publish)
    thread.start()
    try:
        yield published
    finally:
        ending.set()
        thread.join()


def wait_until_taken(graph):
    """Wait until the diagnostics have counted samples."""
    wait_for(lambda: graph.value('crank', 'Samples received') > '0', 'samples')


@pytest.mark.parametrize(
    ('linkage', 'scene', 'inputs'),
    [
        ('five_bar', None, 'left_crank_joint, right_crank_joint'),
        ('four_bar', TICKING, 'crank_joint'),
        ('four_bar', 'rate: 0', 'crank_joint'),
    ],
)
def test_node_without_messages_names_the_awaited_topic(write_scene, start, linkage, scene, inputs):
    """A linkage file alone, of several inputs, waits for messages too."""
    file = LINKAGES / f'{linkage}.yaml'
    if scene is not None:
        file = write_scene(f'waits_{linkage}_{scene[-1]}', scene, linkage)
    node = start(file)
    node.wait_for_log('no message on')
    line = next(line for line in node.log.splitlines() if 'no message on' in line)
    assert re.search(
        rf'no message on /crank_states in \d+ s \(0 publishers\), so nothing is published; send '
        rf'sensor_msgs/JointState with {inputs} there, remap the topic, or name another drive',
        line,
    )


def test_torque_drive_without_commands_reports_the_brake(graph, write_scene, start):
    scene = Path(LINKAGES.parent, 'scenes', 'torque_crank.yaml').read_text()
    _, rate, said = scene.partition('rate:')
    file = write_scene('torque', rate + said.partition('record:')[0], 'four_bar')
    node = start(file, '-p', 'warning_period:=0.5')
    joint_states = graph.listen(JointState, '/joint_states')
    wait_for(lambda: joint_states, 'joint states')
    never = (
        'no command on /crank_commands in 2 s (0 publishers), so the brake of 0.2 N·m holds '
        'crank_joint; send sensor_msgs/JointState with the effort of crank_joint there, or remap '
        'the topic'
    )
    node.wait_for_log(never)
    braked = 'No command yet: the brake of 0.2 N·m holds crank_joint'
    assert graph.wait_for_level('crank', STALE).message == braked
    assert 'no message on' not in node.log
    publisher = graph.publisher(JointState, '/crank_commands')

    def command():
        return JointState(name=['crank_joint'], effort=[0.01])

    with publishing(publisher, command):
        status = graph.wait_for_level('crank', OK)
        count = node.log.count('no command on')
        joint_states.clear()
        wait_for(lambda: len(joint_states) > 2500, 'two seconds with commands')
        assert node.log.count('no command on') == count
    assert status.message == 'Commands arriving'
    # The controller died.
    wait_for(lambda: node.log.count('no command on') > count, 'the line that commands stopped')
    message = graph.wait_for_level('crank', STALE).message
    assert re.fullmatch(
        r'No command for \d+\.\d s: the brake of 0\.2 N·m holds crank_joint', message
    )


def test_dead_publisher_is_not_counted_as_a_second_one(graph, domain, folder, write_scene, start):
    # A controller is killed, and started anew: the graph still shows the one that is dead.
    scene = Path(LINKAGES.parent, 'scenes', 'torque_crank.yaml').read_text()
    _, rate, said = scene.partition('rate:')
    file = write_scene('restarted', rate + said.partition('record:')[0], 'four_bar')
    node = start(file, '-p', 'warning_period:=0.5', '-p', 'diagnostics_period:=0.2')
    ended = graph.publisher(JointState, '/crank_commands', node='dead')  # it sends nothing more
    restarted = graph.publisher(JointState, '/crank_commands')
    wait_for(lambda: graph.value('crank', 'Publishers') == '/dead, /tester', 'both in the graph')

    def command():
        return JointState(name=['crank_joint'], effort=[0.01])

    with publishing(restarted, command):
        graph.wait_for_level('crank', OK)
        for _ in range(10):
            assert graph.next_status('crank').level == OK
        assert 'several publishers' not in node.log
        # It is not dead after all.
        with publishing(ended, command):
            graph.wait_for_level('crank', WARN)
            node.wait_for_log('several publishers send the crank, among /dead and /tester')


def test_silent_crank_publishes_nothing_after_max_age(
    graph, write_scene, start, publisher, joint_states
):
    node = start(write_scene('silence', TICKING))
    assert graph.wait_for_level('crank', STALE).message == 'No crank yet'
    assert joint_states == []
    with publishing(publisher) as published:
        wait_for(lambda: joint_states, 'joint states')
        graph.wait_for_level('crank', OK)
    last = stamp_of(published[-1])
    assert 'No crank for' in graph.wait_for_level('crank', STALE).message
    time.sleep(0.3)
    assert stamp_of(joint_states[-1]) <= last + 0.3 * NS
    count = len(joint_states)
    time.sleep(0.3)
    assert len(joint_states) == count
    with publishing(publisher):
        wait_for(lambda: len(joint_states) > count, 'joint states again')
        graph.wait_for_level('crank', OK)
    assert node.end() == 0


def test_repeated_sample_of_a_hung_publisher_is_silence(
    graph, write_scene, start, publisher, joint_states
):
    # The same message again and again, as a driver sends it that has lost its sensor.
    start(write_scene('hangs', TICKING))
    message = crank(0.5)
    with publishing(publisher, lambda: message):
        wait_until_taken(graph)
        time.sleep(0.5)
        assert graph.next_status('crank').level == STALE
    assert all(stamp_of(state) <= stamp_of(message) + 0.3 * NS for state in joint_states)


def test_samples_older_than_max_age_are_silence(
    graph, write_scene, start, publisher, joint_states
):
    # As from a machine whose clock lags.
    node = start(write_scene('late', TICKING), '-p', 'warning_period:=0.2')
    with publishing(publisher, lambda: crank(0.5, stamp=time.time_ns() - 100 * NS)):
        wait_until_taken(graph)
        status = graph.next_status('crank')
        node.wait_for_log('too old to use')
        time.sleep(1.0)
    assert status.level == STALE
    assert re.fullmatch(r'Samples arrive, but are 100\.\d s old by their stamps', status.message)
    (line,) = [line for line in node.log.splitlines() if 'too old' in line]
    assert 'WARN' in line
    assert re.search(
        r'/crank_states: \d+ samples too old to use, the newest 100\.\d s by its stamp, and '
        r'max_age is 0\.3 s: synchronise the clocks, set use_sim_time .*, or write drive: '
        r'\{topic: \{stamp: arrival\}\}$',
        line,
    )
    assert joint_states == []
    assert int(graph.value('crank', 'Samples stale')) > 0
    assert node.end() == 0
    assert re.search(r'received, 0 used, \d+ superseded, 0 rejected, \d+ stale', node.log)


def test_rate_0_treats_a_repeated_stamp_as_silence(
    graph, write_scene, start, publisher, joint_states
):
    start(write_scene('repeat', 'rate: 0\ndrive: {topic: {max_age: 0.3}}'))
    with publishing(publisher):
        graph.wait_for_level('crank', OK)
    graph.wait_for_level('crank', STALE)
    message = crank(0.5)
    joint_states.clear()
    with publishing(publisher, lambda: message):
        wait_for(lambda: joint_states, 'a joint state')
        time.sleep(0.7)
        assert graph.next_status('crank').level == STALE
    assert {stamp_of(state) for state in joint_states} == {stamp_of(message)}


def test_node_names_two_publishers_of_the_crank(graph, write_scene, start, publisher):
    node = start(write_scene('two', TICKING))
    impostor = graph.publisher(JointState, '/crank_states', node='impostor')
    with publishing(publisher), publishing(impostor):
        status = graph.wait_for_level('crank', WARN)
    assert '/tester' in status.message
    assert '/impostor' in status.message
    (line,) = [line for line in node.log.splitlines() if 'several publishers' in line]
    assert 'WARN' in line
    assert '/tester' in line
    assert '/impostor' in line
    assert 'stop all but one' in line


def test_node_names_two_crank_publishers_on_a_shared_topic(
    graph, domain, folder, write_scene, start
):
    scene = write_scene('shared', TICKING)
    node = start(scene, '-r', 'crank_states:=joint_states', '-p', 'warning_period:=0.5')
    first, arm = (graph.publisher(JointState, '/joint_states', node=name) for name in ('a', 'arm'))
    with publishing(first), publishing(arm, lambda: crank(1.0, name='elbow')):
        wait_for(lambda: graph.value('crank', 'Messages without the crank') > '0', 'the arm')
        graph.wait_for_level('crank', OK)
        graph.next_status('crank')
        assert graph.next_status('crank').level == OK
        assert 'several publishers' not in node.log
        second = graph.publisher(JointState, '/joint_states', node='b')
        with publishing(second, lambda: crank(-1.0)):
            status = graph.wait_for_level('crank', WARN)
            node.wait_for_log('several publishers')
        assert 'several publishers send the crank, among ' in status.message
        assert {'/a', '/b', '/arm'} <= {*re.findall(r'/\w+', status.message)}
        graph.wait_for_level('crank', OK)
        # Another node of the same name, and of the same joints.
        twin = NodeProcess(domain, folder, '-p', f'scene:={scene}')
        try:
            named = 'another node is named /linkage_node: services and diagnostics of both mix'
            node.wait_for_log(named)
            twin.wait_for_log(named)
            assert graph.wait_for_level('tick', WARN).message.startswith(named)
            twin.end()
        finally:
            twin.kill()
        renamed = '-r', '__node:=other', '-r', 'crank_states:=joint_states'
        elsewhere = NodeProcess(domain, folder, '-p', f'scene:={scene}', *renamed)
        try:
            node.wait_for_log('another publisher sends the same joints as /linkage_node; stop one')
        finally:
            elsewhere.kill()
