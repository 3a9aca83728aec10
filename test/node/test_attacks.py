# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Floods of messages and storms of calls on a node, by `campaigns.reliability.attacks`."""

from campaigns.reliability.attacks import attack_node
from lifecycle_msgs.msg import Transition
from linkage_ros.messages import JointStateWriter, SampleRouter
import pytest
from rcl_interfaces.msg import Log, Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import JointState

from .graph import crank, wait_for
from ..support.sampling import sample_count

REAL_STARTS = True


def test_message_floods_and_call_storms_leave_counts_exact():
    tried, findings = attack_node(sample_count(12, 6), 7)
    assert findings == []
    assert tried['of these received'] > 100
    assert tried['of these rejected'] > 0
    assert tried['change_state'] > 0
    assert tried['set_parameters'] > 0


def test_parameter_of_unknown_type_does_not_end_the_node(graph, write_scene, start):
    # rclpy raises in its service, and would end the executor.
    node = start(write_scene('no_type', 'rate: 100'))
    client = graph.node.create_client(SetParameters, '/linkage_node/set_parameters')
    assert client.wait_for_service(20.0)
    request = SetParameters.Request(parameters=[Parameter(value=ParameterValue(type=77))])
    futures = [client.call_async(request) for _ in range(100)]
    node.wait_for_log('a call failed: ValueError')
    assert graph.trigger('reset')[0]
    assert not any(future.done() for future in futures), 'rclpy has no answer to these'
    heard = graph.listen(JointState, '/joint_states')
    publisher = graph.publisher(JointState, '/crank_states')
    wait_for(lambda: publisher.publish(crank(0.5)) or len(heard) > 5, 'joint states')
    assert sum('a call failed' in line for line in node.log.splitlines()) <= 3, 'once a period'
    assert node.end() == 0
    assert 'Traceback' not in node.log


@pytest.fixture
def peer(graph):
    """Return a function that sets a node's scene, and gives what it logs when configured so."""
    log = graph.listen(Log, '/rosout')

    def set_scene(scene, *settings):
        request = SetParameters.Request(
            parameters=[
                Parameter(
                    name='scene',
                    value=ParameterValue(
                        type=ParameterType.PARAMETER_STRING, string_value=str(scene)
                    ),
                ),
                Parameter(
                    name='set',
                    value=ParameterValue(
                        type=ParameterType.PARAMETER_STRING_ARRAY,
                        string_array_value=settings or [''],
                    ),
                ),
            ]
        )
        answer = graph.call(SetParameters, '/linkage_node/set_parameters', request)
        assert all(result.successful for result in answer.results)
        log.clear()
        if graph.change_state(Transition.TRANSITION_CONFIGURE):
            assert graph.change_state(Transition.TRANSITION_CLEANUP)
            return ''
        return wait_for(lambda: log and log[-1].msg, 'the reason')

    return set_scene


def test_remote_parameters_read_and_import_no_local_files(
    peer, write_scene, start, folder, tmp_path, monkeypatch
):
    secret = 'hunter2'
    (tmp_path / 'token.txt').write_text(secret)
    (folder / 'beside.yaml').write_text(f'password: {secret}')
    (tmp_path / 'evil.py').write_text(f'open({str(tmp_path / "imported")!r}, "w")')
    own = write_scene('own', 'rate: 100')
    monkeypatch.setenv('PYTHONPATH', str(tmp_path))
    node = start(own, '-p', 'autostart:=false', ready='')
    for scene, setting in (
        (tmp_path / 'token.txt', ''),
        (folder / 'beside.yaml', ''),
        ('/proc/self/environ', ''),
        (own, f'linkage={tmp_path}/token.txt'),
        (own, f'linkage={{urdf: {tmp_path}/token.txt, input: m}}'),
        (own, f'drive={{bag: {{file: {tmp_path}/token.txt}}}}'),
        (own, 'effects={"evil.mod": {}}'),
        (own, f'record={{directory: {tmp_path}/runs}}'),
    ):
        reason = peer(scene, *filter(None, [setting]))
        assert 'after the start of the node' in reason or 'neither a scene nor a linkage' in reason
        assert secret not in reason
    assert not (tmp_path / 'imported').exists()
    assert not (tmp_path / 'runs').exists()
    assert peer(own, 'rate=500') == '', 'what it was started with may be set up in another way'
    assert peer('demo', 'rate=500') == ''
    assert peer(own) == ''
    assert node.end() == 0
    assert secret not in node.log


def test_router_caches_no_routes_of_huge_messages():
    routes = SampleRouter({'left': ['crank_joint'], 'right': ['other']})
    for index in range(3):
        names = ['crank_joint', f'of_message_{index}', *(f'joint_{n}' for n in range(20_000))]
        message = JointStateWriter(names).write(1, [0.0] * len(names), [])
        assert routes.find_receivers(message) == ('left',)
    assert routes._found == {}
    small = JointStateWriter(['crank_joint', 'other']).write(1, [0.0, 0.0], [])
    assert routes.find_receivers(small) == routes.find_receivers(small) == ('left', 'right')
    assert len(routes._found) == 1
