# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""SIGINT, SIGTERM and SIGHUP at any moment: exit code 0, no traceback, and a closed bag."""

from pathlib import Path
import random
import signal
import time

import pytest
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
import yaml

from .graph import crank, wait_for

REAL_STARTS = True

SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP

# The node, on a middleware that never shuts down: it keeps the interpreter's lock meanwhile, or
# the interpreter is gone.
STUCK = {
    'node': 'node.LinkageNode.destroy_node = lambda _: ctypes.PyDLL(None).sleep(600)',
    'library': 'c = ctypes.CDLL(None); c.__cxa_atexit(c.sleep, ctypes.c_void_p(600), None)',
}
PROGRAM = (
    'import ctypes, sys, time; from linkage_ros.node import linkage_node, node; {}; '
    'sys.exit(linkage_node.main())'
)


@pytest.fixture
def recorded(tmp_path, write_scene):
    """Return a scene that records, and the folder of its bags."""
    runs = tmp_path / 'runs'
    return write_scene('recorded', f'rate: 500\nrecord: {{directory: {runs}}}'), runs


def wait_for_handlers(node):
    """Wait until the process has handlers of its own: before, no program can do anything."""
    status = Path(f'/proc/{node.process.pid}/status')

    def caught():
        (mask,) = [line for line in status.read_text().splitlines() if line.startswith('SigCgt')]
        return all(int(mask.split()[1], 16) >> (number - 1) & 1 for number in SIGNALS)

    wait_for(caught, 'handlers of signals')


def closed_bags(runs):
    """Return the number of messages of each bag, all of which must be closed."""
    totals = []
    for bag in runs.iterdir() if runs.exists() else ():
        with AnyReader([bag]) as reader:
            read = sum(1 for _ in reader.messages())
        metadata = yaml.safe_load((bag / 'metadata.yaml').read_text())
        assert metadata['rosbag2_bagfile_information']['message_count'] == read
        totals.append(read)
    return totals


@pytest.mark.sample(2)
@pytest.mark.parametrize('moment', range(2))
@pytest.mark.parametrize('number', SIGNALS)
def test_signal_at_a_random_moment_closes_the_bag(start, recorded, number, moment):
    scene, runs = recorded
    node = start(scene, ready='')
    wait_for_handlers(node)
    # Once as soon as may be; once while rclpy loads, while the node starts, or after.
    time.sleep(random.Random(f'{number} {moment}').uniform(0.0, 1.0) * moment)
    assert node.end(number) == 0, node.log
    assert 'Traceback' not in node.log
    assert 'Error' not in node.log
    closed_bags(runs)


@pytest.mark.sample(2)
@pytest.mark.parametrize('number', SIGNALS)
def test_signal_during_configuration_ends_with_code_0(start, recorded, number):
    scene, runs = recorded
    stuck = 'node.load_scene = lambda *_: (print("loading", flush=True), time.sleep(600))'
    node = start(scene, ready='loading', program=('-c', PROGRAM.format(stuck)))
    assert node.end(number) == 0, node.log
    assert 'Traceback' not in node.log
    assert closed_bags(runs) == []


@pytest.mark.sample(2)
@pytest.mark.parametrize('number', SIGNALS)
def test_signal_during_a_run_closes_the_bag(graph, start, recorded, number):
    scene, runs = recorded
    node = start(scene)
    publisher = graph.publisher(JointState, '/crank_states')
    heard = graph.listen(JointState, '/joint_states')
    wait_for(lambda: publisher.publish(crank(0.5, 1.0)) or len(heard) > 100, 'joint states')
    assert node.end(number) == 0, node.log
    (messages,) = closed_bags(runs)
    assert messages > 100


def test_repeated_signals_end_the_node_with_code_0(start, recorded):
    scene, runs = recorded
    node = start(scene)
    for number in (*SIGNALS, signal.SIGINT, signal.SIGINT):
        node.process.send_signal(number)
        time.sleep(0.01)
    assert node.process.wait(20) == 0, node.log
    assert len(closed_bags(runs)) == 1


@pytest.mark.sample(1)
@pytest.mark.parametrize('where', STUCK)
def test_hanging_middleware_does_not_keep_the_process(start, recorded, where):
    scene, runs = recorded
    node = start(scene, program=('-c', PROGRAM.format(STUCK[where])))
    assert node.end() == -signal.SIGALRM, node.log
    assert 'Traceback' not in node.log
    assert len(closed_bags(runs)) == 1
