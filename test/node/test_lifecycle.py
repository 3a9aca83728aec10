# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The life of a node: transitions, bags of a cycle, services and parameters."""

import time

from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import GetState
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState

from .graph import crank, wait_for

NODE = '/linkage_node'
BY_HAND = '-p', 'autostart:=false'


@pytest.fixture
def state(graph):
    return lambda: graph.call(GetState, f'{NODE}/get_state').current_state.id


@pytest.fixture
def turn(graph):
    """Return a function that publishes the crank for a time, or until it is heard of."""
    publisher = graph.publisher(JointState, '/crank_states')
    heard = graph.listen(JointState, '/joint_states')

    def turn(seconds=None, angle=0.5):
        heard.clear()
        begin = time.monotonic()

        def go_on():
            publisher.publish(crank(angle))
            time.sleep(0.01)
            return len(heard) > 20 if seconds is None else time.monotonic() > begin + seconds

        wait_for(go_on, 'joint states')
        return heard

    return turn


def counts(bag):
    """Return how many messages of a topic rosbags finds in a bag."""
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
        return {topic: info.msgcount for topic, info in reader.topics.items()}


def test_managed_node_records_one_bag_per_activation(
    graph, write_scene, start, folder, state, turn
):
    runs = folder / 'two_bags'
    scene = write_scene('managed', f'rate: 100\nrecord: {{directory: {runs}}}')
    node = start(scene, *BY_HAND, ready='')
    assert state() == State.PRIMARY_STATE_UNCONFIGURED
    assert not turn(0.2)
    assert graph.change_state(Transition.TRANSITION_CONFIGURE)
    assert state() == State.PRIMARY_STATE_INACTIVE
    assert not turn(0.2)
    assert not runs.exists()
    for _ in range(2):
        assert graph.change_state(Transition.TRANSITION_ACTIVATE)
        assert state() == State.PRIMARY_STATE_ACTIVE
        assert turn()
        assert graph.change_state(Transition.TRANSITION_DEACTIVATE)
        time.sleep(0.1)
        assert not turn(0.2)
    assert graph.change_state(Transition.TRANSITION_CLEANUP)
    assert graph.change_state(Transition.TRANSITION_CONFIGURE), 'it may be set up again'
    assert node.end() == 0
    bags = sorted(runs.iterdir())
    assert len(bags) == 2
    for bag in bags:
        found = counts(bag)
        assert found.pop('/linkage_node/resets') == 0
        assert set(found) == {'/crank_states', '/joint_states', '/diagnostics'}
        assert min(found.values()) > 0


def test_bad_scene_fails_the_configure_transition(graph, write_scene, start, state):
    node = start(write_scene('bad', 'rtae: 100'), *BY_HAND, ready='')
    assert not graph.change_state(Transition.TRANSITION_CONFIGURE)
    assert state() == State.PRIMARY_STATE_UNCONFIGURED
    (line,) = [line for line in node.log.splitlines() if 'bad.yaml' in line]
    assert "bad.yaml:2: rtae: unknown key; did you mean 'rate'?" in line
    assert node.end() == 0
    assert 'Traceback' not in node.log


def test_unconfigured_node_takes_another_scene(graph, write_scene, start, turn):
    """Whichever scene it is set up with is the one that it runs."""
    node = start(write_scene('absent', 'rtae: 100'), *BY_HAND, ready='')
    assert not graph.change_state(Transition.TRANSITION_CONFIGURE)

    def give(scene):
        changed = parameter('scene', string_value=str(scene))
        request = SetParameters.Request(parameters=[changed])
        (result,) = graph.call(SetParameters, f'{NODE}/set_parameters', request).results
        return result.reason

    names = {}
    for linkage in ('four_bar', 'inverted_slider_crank'):
        assert give(write_scene(f'now_{linkage}', 'rate: 100', linkage)) == ''
        assert graph.change_state(Transition.TRANSITION_CONFIGURE)
        assert 'cannot change while the node is configured' in give('other.yaml')
        assert graph.change_state(Transition.TRANSITION_ACTIVATE)
        assert 'cannot change while the node is configured' in give('other.yaml')
        names[linkage] = [*turn()[-1].name]
        assert graph.change_state(Transition.TRANSITION_DEACTIVATE)
        assert graph.change_state(Transition.TRANSITION_CLEANUP)
    assert names == {
        'four_bar': ['coupler_joint', 'rocker_joint'],
        'inverted_slider_crank': ['rod_joint', 'rod_slide'],
    }
    assert node.end() == 0


def test_impossible_transitions_and_services_are_refused(graph, write_scene, start, state):
    node = start(write_scene('refused', 'rate: 100'), *BY_HAND, ready='')
    for transition in ('ACTIVATE', 'DEACTIVATE', 'CLEANUP', 'ACTIVE_SHUTDOWN'):
        assert not graph.change_state(getattr(Transition, f'TRANSITION_{transition}'))
        assert state() == State.PRIMARY_STATE_UNCONFIGURED
    assert graph.change_state(Transition.TRANSITION_CONFIGURE)
    assert not graph.change_state(Transition.TRANSITION_CONFIGURE)
    for service in ('reset', 'start_recording', 'stop_recording'):
        success, message = graph.trigger(service)
        assert not success
        assert 'not ' in message
    assert node.end() == 0
    assert 'Traceback' not in node.log


def test_shutdown_service_closes_the_bag(graph, write_scene, start, folder, state, turn):
    runs = folder / 'shut'
    node = start(write_scene('shut', f'rate: 100\nrecord: {{directory: {runs}}}'))
    turn()
    assert graph.change_state(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    assert state() == State.PRIMARY_STATE_FINALIZED
    (bag,) = runs.iterdir()
    assert counts(bag)['/joint_states'] > 0
    assert node.end() == 0


def test_reset_service_forgets_turns_and_stamps(graph, write_scene, start, turn):
    start(write_scene('reset', 'rate: 100\ndrive: {topic: {max_age: 60, carry_forward: false}}'))
    # Three turns, a third at a time: the coupler unwinds against the crank.
    heard = turn(angle=0.0)
    first = heard[-1].position[0]
    for third in range(1, 10):
        heard = turn(angle=third * 2.0943951)
    assert heard[-1].position[0] - first == pytest.approx(-18.85, abs=0.01)
    success, message = graph.trigger('reset')
    assert success, message
    time.sleep(0.2)
    heard.clear()
    time.sleep(0.2)
    assert heard == [], 'the crank is forgotten'
    assert turn(angle=0.0)[-1].position[0] == pytest.approx(first, abs=1e-6)
    graph.diagnostics.clear()
    wait_for(lambda: graph.value('tick', 'Resets') == '1', 'the count of resets')


def test_services_start_and_stop_a_recording(graph, write_scene, start, folder, turn):
    runs = folder / 'asked'
    # Who asks runs elsewhere: what is relative to the node's own folder is answered as absolute.
    node = start(write_scene('asked', 'rate: 100'), '-p', 'runs_directory:=asked')
    success, message = graph.trigger('stop_recording')
    assert not success
    assert 'not recording' in message
    bags = []
    for _ in range(2):
        success, message = graph.trigger('start_recording')
        assert success, message
        assert str(runs) in message
        success, message = graph.trigger('start_recording')
        assert not success
        assert f'already recording to {runs}/asked_' in message
        turn()
        success, message = graph.trigger('stop_recording')
        assert success, message
        bags = sorted(runs.iterdir())
        assert str(bags[-1]) in message
    assert len(bags) == 2
    assert all(counts(bag)['/joint_states'] > 0 for bag in bags)
    assert node.end() == 0


def test_snapshot_service_returns_an_absolute_folder(graph, write_scene, start, folder, turn):
    scene = write_scene('kept', 'rate: 100\nrecord: {snapshot_seconds: 5, directory: kept}')
    start(scene)
    turn()
    success, message = graph.trigger('snapshot')
    assert success, message
    assert f'recorded to {folder / "kept"}/kept_' in message


def parameter(name, **value):
    kind = {
        'double_value': ParameterType.PARAMETER_DOUBLE,
        'string_value': ParameterType.PARAMETER_STRING,
        'bool_value': ParameterType.PARAMETER_BOOL,
    }[next(iter(value))]
    return Parameter(name=name, value=ParameterValue(type=kind, **value))


def test_refused_parameter_names_the_reason(graph, write_scene, start):
    node = start(write_scene('parameters', 'rate: 100'))

    def change(changed):
        request = SetParameters.Request(parameters=[changed])
        (result,) = graph.call(SetParameters, f'{NODE}/set_parameters', request).results
        return result.successful, result.reason

    assert change(parameter('warning_period', double_value=2.0)) == (True, '')
    assert change(parameter('warn.transmission_angle', double_value=0.5)) == (True, '')
    for refused in (
        parameter('scene', string_value='other.yaml'),
        parameter('autostart', bool_value=False),
        parameter('diagnostics_period', double_value=0.0),
        parameter('diagnostics_period', double_value=float('nan')),
        parameter('diagnostics_period', double_value=float('inf')),
        parameter('warning_period', double_value=-1.0),
        parameter('warning_period', string_value='often'),
        parameter('warn.transmission_angle', double_value=1.6),
        parameter('warn.conditioning', double_value=-1e-6),
        parameter('warn.toggle_distance', double_value=float('nan')),
        parameter('rtae', double_value=1.0),
    ):
        successful, reason = change(refused)
        assert not successful, refused
        assert len(reason.splitlines()) == 1
    names = ['scene', 'autostart', 'diagnostics_period', 'warning_period', 'runs_directory']
    names += [f'warn.{what}' for what in ('transmission_angle', 'conditioning', 'toggle_distance')]
    request = DescribeParameters.Request(names=names)
    answer = graph.call(DescribeParameters, f'{NODE}/describe_parameters', request)
    assert all(descriptor.description for descriptor in answer.descriptors)
    assert node.end() == 0
    assert 'Traceback' not in node.log


def test_second_activation_counts_its_own_open_ticks(graph, write_scene, start, turn):
    linkage = 'four_bar: {a: 1.0, b: 1.0, c: 1.0, d: 2.0}'
    scene = write_scene('again', 'rate: 200', linkage)
    node = start(scene, *BY_HAND, '-p', 'warning_period:=60.0', ready='')
    assert graph.change_state(Transition.TRANSITION_CONFIGURE)
    for number, seconds in ((1, 2.0), (2, 0.8)):
        assert graph.change_state(Transition.TRANSITION_ACTIVATE)
        turn(seconds, angle=3.0)
        assert graph.change_state(Transition.TRANSITION_DEACTIVATE)
        warnings = [line for line in node.log.splitlines() if ' ticks open by ' in line]
        assert len(warnings) == number
        assert int(warnings[-1].split(' ticks open')[0].split()[-1]) > 0
    assert node.end() == 0
