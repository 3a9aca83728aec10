# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Fast DDS goes without shared memory unless the user says otherwise; where it has it, that is told.

A publisher that opens a subscriber's shared-memory port may stand still for 0.33 s (Fast-DDS issue
6535); `python -m bench --only comers` shows it.
"""

import json
import os
from pathlib import Path
import shutil
import subprocess
import sys

from linkage_ros.node import leave_out_shared_memory, stay_on_this_machine
from linkage_ros.resources import shipped_path
import pytest
from sensor_msgs.msg import JointState

from .graph import PATIENCE, wait_for

SAID = (
    'FASTDDS_BUILTIN_TRANSPORTS',
    'FASTRTPS_DEFAULT_PROFILES_FILE',
    'FASTDDS_DEFAULT_PROFILES_FILE',
    'RMW_FASTRTPS_PUBLICATION_MODE',
)
RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
TURNING = 'drive: {constant_rate: {rate: 1.0}}\nrate: 1000'
OWN_NETWORK = [shutil.which('unshare') or 'unshare', '--map-root-user', '--net']

REAL_STARTS = True  # Transports are chosen when a process starts

# A process that hosts the node among others: rclpy is initialised before the node is created.
COMPONENT = """
import rclpy
rclpy.init()
from linkage_ros.node.node import LinkageNode
from linkage_ros.signals import stop_on_signals
from rclpy.executors import SingleThreadedExecutor
stop = stop_on_signals()
node = LinkageNode()
executor = SingleThreadedExecutor()
executor.add_node(node)
node.trigger_configure()
node.trigger_activate()
while not stop.is_set():
    executor.spin_once(timeout_sec=0.1)
node.end_run()
"""


def own_network_is_allowed():
    try:
        return subprocess.run([*OWN_NETWORK, 'true'], check=False).returncode == 0
    except OSError:
        return False


@pytest.fixture
def unsaid(monkeypatch, tmp_path):
    """Let the environment say nothing of how messages are carried."""
    monkeypatch.chdir(tmp_path)
    for name in SAID:
        # First set, so that what is set meanwhile is taken back too.
        monkeypatch.setenv(name, '')
        monkeypatch.delenv(name)


def test_shared_memory_is_disabled_by_default(unsaid):
    leave_out_shared_memory()
    assert os.environ['FASTDDS_BUILTIN_TRANSPORTS'] == 'UDPv4'


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('FASTDDS_BUILTIN_TRANSPORTS', 'DEFAULT'),
        ('FASTRTPS_DEFAULT_PROFILES_FILE', 'mine.xml'),
        ('FASTDDS_DEFAULT_PROFILES_FILE', 'mine.xml'),
        ('RMW_FASTRTPS_PUBLICATION_MODE', 'ASYNCHRONOUS'),
    ],
)
def test_transport_settings_of_the_user_are_kept(unsaid, monkeypatch, name, value):
    monkeypatch.setenv(name, value)
    leave_out_shared_memory()
    assert {said: os.environ[said] for said in SAID if said in os.environ} == {name: value}


def test_default_profile_in_the_folder_is_kept(unsaid):
    Path('DEFAULT_FASTRTPS_PROFILES.xml').touch()
    leave_out_shared_memory()
    assert 'FASTDDS_BUILTIN_TRANSPORTS' not in os.environ


@pytest.fixture
def meet(domain, write_scene, folder):
    """Return a function by which a node and a client on defaults meet, on a network alone."""
    if not own_network_is_allowed():
        pytest.skip('no network of its own without user namespaces')
    scene = write_scene('turning', TURNING)

    def meet(*program, **own):
        environment = {k: v for k, v in os.environ.items() if k not in SAID} | {
            'ROS_DOMAIN_ID': str(domain),
            'ROS_LOG_DIR': str(folder),
            **{f'NODE_{name}': value for name, value in own.items()},
        }
        environment.pop('_ROS_WHEELS_BOOTSTRAP_COMPLETE', None)
        script = Path(__file__).with_name('on_own_network.py')
        command = [*OWN_NETWORK, sys.executable, str(script), str(scene)]
        done = subprocess.run(
            command + list(program or ('-m', 'linkage_ros.node.linkage_node')),
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=4 * PATIENCE,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return {**json.loads(done.stdout), 'log': done.stderr}

    return meet


def heard_all(numbers):
    return len(numbers) > 1 and numbers == list(range(numbers[0], numbers[-1] + 1))


def test_shared_memory_client_receives_every_message(meet):
    found = meet()
    assert found['client']
    assert not found['node']
    assert heard_all(found['numbers'])
    assert 'Middleware' not in found['tick']
    assert 'may pause' not in found['log']


def test_enabled_shared_memory_is_reported_with_its_cost(meet):
    found = meet(FASTDDS_BUILTIN_TRANSPORTS='DEFAULT')
    assert found['node']
    assert heard_all(found['numbers'])
    assert 'stand still' in found['tick']['Middleware']
    assert found['log'].count('ticks may pause once') == 1


def test_component_reports_shared_memory_of_its_process(meet):
    found = meet('-c', COMPONENT)
    assert found['node']
    assert 'FASTDDS_BUILTIN_TRANSPORTS=UDPv4' in found['tick']['Middleware']
    assert found['log'].count('ticks may pause once') == 1


def test_node_reports_shared_memory_under_local_discovery(graph, start, write_scene):
    node = start(write_scene('local', TURNING))
    (line,) = [line for line in node.log.splitlines() if 'may pause' in line]
    assert 'INFO' in line
    assert 'DDS' not in line
    assert 'shared memory' not in line
    graph.next_status('tick')
    assert 'config/fastdds/local.xml' in graph.value('tick', 'Middleware')


def test_shipped_profile_has_local_discovery_without_shared_memory(
    graph, start, write_scene, monkeypatch
):
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SYSTEM_DEFAULT')
    monkeypatch.setenv('FASTRTPS_DEFAULT_PROFILES_FILE', str(shipped_path('fastdds/local.xml')))
    heard = graph.listen(JointState, 'joint_states')
    node = start(write_scene('profile', TURNING))
    wait_for(lambda: len(heard) > 100, 'joint states')
    assert 'may pause' not in node.log
    assert '/fastrtps_port' not in Path(f'/proc/{node.process.pid}/maps').read_text()


def test_demo_has_local_discovery_without_shared_memory(folder, unsaid):
    environment = {k: v for k, v in os.environ.items() if k not in (*SAID, RANGE)}
    environment.pop('_ROS_WHEELS_BOOTSTRAP_COMPLETE', None)
    command = [sys.executable, '-m', 'linkage_ros', 'demo', 'bare', '--seconds', '1', '--plain']
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False,
        timeout=4 * PATIENCE,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    said = done.stdout + done.stderr
    assert RANGE + '=LOCALHOST' in said, 'a second terminal has it simple'
    assert 'may pause' not in said
    assert ' 0 used' not in said, 'the crank beside it was found'


@pytest.mark.parametrize('name', SAID)
def test_demo_keeps_transport_settings_of_the_user(unsaid, monkeypatch, name):
    monkeypatch.setenv(name, 'mine')
    monkeypatch.setenv(RANGE, 'SUBNET')
    stay_on_this_machine()
    assert os.environ[RANGE] == 'LOCALHOST'
    assert {said: os.environ[said] for said in SAID if said in os.environ} == {name: 'mine'}
