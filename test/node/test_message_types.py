# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A type's name, which strangers choose, gives the class of a message, or an error of one line."""

from contextlib import suppress
import os
from pathlib import Path
import re
import subprocess
import sys

from hypothesis import given, strategies as st
import linkage_ros
from linkage_ros.errors import LinkageError
from linkage_ros.replay import message_type, topic_description
import pytest
from sensor_msgs.msg import JointState

STRANGE = [
    '',
    '/',
    '//',
    'a',
    'a/b',
    'this/msg/X',
    'os/msg/path',
    'os/path/join',
    'antigravity/msg/Thing',
    'linkage_ros/msg/Node',
    'sensor_msgs/JointState',
    'sensor_msgs/srv/JointState',
    'sensor_msgs/srv/SetCameraInfo',
    'std_srvs/srv/Empty',
    'example_interfaces/action/Fibonacci_FeedbackMessage',
    'sensor_msgs/msg/NoSuchThing',
    'sensor_msgs/msg/__name__',
    'sensor_msgs/msg/_joint_state',
    'sensor_msgs/msg/JointState/x',
    'sensor_msgs/msg/../JointState',
    'sensor_msgs/msg/JointState\n',
    'sensor_msgs/msg/JointState\0',
    ' sensor_msgs/msg/JointState',
    '.sensor_msgs/msg/JointState',
    '../sensor_msgs/msg/JointState',
    '../../etc/msg/Thing',
    'sensor_msgs.msg/msg/JointState',
    'sénsor_msgs/msg/JointState',
    'sensor_msgs/msg/JointStаte',  # with a Cyrillic letter
    'no_such_msgs/msg/Thing',
    f'{"a" * 5000}/msg/X',
    f'sensor_msgs/msg/{"X" * 300}',
    '\x1b[2J/msg/X',
]


@pytest.mark.parametrize('name', STRANGE, ids=range(len(STRANGE)))
def test_unknown_message_type_is_refused_without_an_import(name, monkeypatch):
    def refuse(module):
        raise AssertionError(f'{module} is imported')

    if not name.startswith('sensor_msgs/msg/'):
        monkeypatch.setattr(topic_description, 'import_module', refuse)
    with pytest.raises(LinkageError) as caught:
        message_type(name, '/joint_states')
    line = str(caught.value)
    assert re.fullmatch(r"/joint_states: .*(is not a ROS 2 message|' is not installed); .+", line)
    assert line.isprintable()
    assert len(line) < 300


PIECES = st.sampled_from(
    ['/', 'msg', 'srv', '.', '..', 'this', 'sensor_msgs', 'os', 'JointState', '', 'é', '\0']
)


@given(name=st.one_of(st.text(max_size=40), st.lists(PIECES, max_size=7).map(''.join)))
def test_random_type_name_imports_only_message_packages(name):
    before = set(sys.modules)
    with suppress(LinkageError):
        assert message_type(name, '/x') is JointState
        assert name == 'sensor_msgs/msg/JointState'
    assert 'this' not in sys.modules
    assert {module.partition('.')[0] for module in set(sys.modules) - before} <= {'sensor_msgs'}


ECHO = """\
import sys
import rclpy.node
names = [('/joint_states', [sys.argv[1]])]
rclpy.node.Node.get_topic_names_and_types = lambda self, *given, **named: names
from linkage_ros.cli.main import main
sys.exit(main(['echo', '--count', '1', '--timeout', '1']))
"""
"""The graph announces a type, as any participant can."""


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', ['this/msg/X', '', 'a/b/c/d', '../msg/X', 'std_srvs/srv/Empty'])
def test_echo_imports_no_module_named_on_the_graph(name, domain):
    done = subprocess.run(
        [sys.executable, '-c', ECHO, name],
        env=os.environ | {'ROS_DOMAIN_ID': str(domain)},
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert (done.returncode, done.stdout) == (2, '')
    reason = "(its type '.*' is not a ROS 2 message|'this/msg/X' is not installed)"
    assert re.fullmatch(rf'linkage echo: /joint_states: {reason}; .+\n', done.stderr)


def test_one_module_of_the_package_imports_message_types():
    package = Path(linkage_ros.__file__).parent
    named = [
        str(file.relative_to(package))
        for file in package.rglob('*.py')
        if re.search(
            r'rosidl_runtime_py|get_message\(|import_module\(f.*msg', file.read_text('utf-8')
        )
    ]
    assert named == ['replay/topic_description.py']
