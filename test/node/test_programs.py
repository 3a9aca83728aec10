# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The programs of the nodes: help, unknown parameters, keys of the scene that are set."""

import re
import subprocess
import sys

from linkage_ros.bag import read_bag
from linkage_ros.description import SCENE_FILE
from linkage_ros.node import CrankSource, LINKAGE_NODE, PDController
import pytest
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters
from rclpy.parameter import parameter_value_to_python
from sensor_msgs.msg import JointState
import yaml

from .graph import NodeProcess, wait_for
from ..support.commands import environment

PROGRAMS = {
    'linkage_node': LINKAGE_NODE,
    'crank_source': CrankSource.PARAMETERS,
    'pd_controller': PDController.PARAMETERS,
}
MAIN = 'import sys; from linkage_ros.node.{} import main; sys.exit(main())'


def program(folder, name, *arguments, before=''):
    return subprocess.run(
        [sys.executable, '-c', before + MAIN.format(name), *arguments],
        env=environment(folder),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', PROGRAMS)
def test_help_lists_every_parameter_without_starting_a_node(tmp_path, name):
    answer = program(tmp_path, name, '--help', '--ros-args', '-p', 'rate:=3.0')
    assert (answer.returncode, answer.stderr) == (0, '')
    assert answer.stdout.startswith(f'usage: ros2 run linkage_ros {name} ')
    text = ' '.join(answer.stdout.split())
    for parameter in PROGRAMS[name]:
        assert f' {parameter.name} {parameter.meaning}' in text
    assert max(map(len, answer.stdout.splitlines())) <= 96


@pytest.mark.parametrize('name', PROGRAMS)
def test_programs_without_ros_name_what_to_install(tmp_path, name):
    answer = program(
        tmp_path, name, '--help', before='import sys; sys.modules["rcl_interfaces"] = None; '
    )
    assert (answer.returncode, answer.stdout) == (2, '')
    assert answer.stderr.startswith(f'{name}: rcl_interfaces: is not installed; source the setup')
    assert answer.stderr.count('\n') == 1


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', ['crank_source', 'pd_controller'])
def test_demo_node_warns_once_of_an_unknown_parameter(tmp_path, name):
    answer = program(tmp_path, name, *('--ros-args', '-p', 'secnds:=9.0', '-p', 'seconds:=0.1'))
    assert answer.returncode == 0
    (line,) = [line for line in answer.stderr.splitlines() if 'WARN' in line]
    assert line.endswith("parameter secnds: unknown, and without effect; did you mean 'seconds'?")


def test_node_warns_once_of_each_unknown_parameter(start, write_scene):
    node = start(
        write_scene('warned', 'rate: 100'),
        *('-p', 'scnee:=x', '-p', 'warn.condtioning:=0.1', '-p', 'use_sim_time:=false'),
        *('-p', 'qos_overrides./joint_states.publisher.depth:=1'),
    )
    assert node.end() == 0
    warned = re.findall(r'parameter (\S+): unknown.*did you mean (\S+)\?', node.log)
    assert sorted(warned) == [
        ('scnee', "'scene'"),
        ('warn.condtioning', "'warn.conditioning'"),
    ]


def test_dumped_parameters_restart_the_node(graph, start, write_scene, folder):
    """As `ros2 param dump` and rqt_reconfigure ask; a file of the answer starts a node."""
    own = [parameter.name for parameter in LINKAGE_NODE]
    scene = write_scene('dumped', 'rate: 100')
    # An empty list in a file is no value to rclpy.
    given = folder / 'given.yaml'
    given.write_text('/**: {ros__parameters: {set: [], cpu_affinity: []}}\n')
    node = start(scene, '--params-file', str(given))
    names = graph.call(ListParameters, '/linkage_node/list_parameters').result.names
    assert {*own} < {*names}
    request = GetParameters.Request(names=names)
    answer = graph.call(GetParameters, '/linkage_node/get_parameters', request)
    dumped = {
        name: parameter_value_to_python(value)
        for name, value in zip(names, answer.values, strict=True)
    }
    assert None not in dumped.values()
    assert (dumped['set'], dumped['cpu_affinity']) == ([''], [-1])
    descriptors = graph.call(
        DescribeParameters,
        '/linkage_node/describe_parameters',
        DescribeParameters.Request(names=own),
    ).descriptors
    assert all(each.description and each.type for each in descriptors)
    assert node.end() == 0
    again = folder / 'parameters.yaml'
    again.write_text(yaml.safe_dump({'/linkage_node': {'ros__parameters': dumped}}))
    node = start(scene, '--params-file', str(again))
    assert node.end() == 0
    assert 'WARN' not in node.log


def test_crank_source_publishes_reliably(graph, domain, folder):
    """A subscriber may ask for it, as joint_state_publisher does for its source_list."""
    heard = graph.listen(JointState, '/crank_states')
    source = NodeProcess(domain, folder, program=('-m', 'linkage_ros.node.crank_source'))
    try:
        wait_for(lambda: heard, 'a crank')
    finally:
        source.kill()


def test_bag_holds_the_scene_with_set_keys(start, write_scene, folder):
    node = start(
        write_scene('set', "rate: 100\nrecord: {name: set, directory: '.'}"),
        *('-p', "set:=['rate=50', 'drive.topic.max_age=0.1']"),
        *('-p', f'runs_directory:={folder}'),
    )
    assert node.end() == 0
    scene = read_bag(folder / 'set').attachments[SCENE_FILE].decode()
    assert 'rate: 50\n' in scene
    assert 'max_age: 0.1\n' in scene
