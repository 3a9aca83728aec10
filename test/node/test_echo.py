# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""`linkage echo` as its user types it: messages as YAML, their rate, and its words in silence."""

from array import array
import re
import signal
import subprocess
import sys

from linkage_ros.cli import as_yaml, rate_text
from linkage_ros.messages import JOINT_STATE_TYPE
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
import yaml

from .graph import PATIENCE
from ..support import commands

TEXT = 'std_msgs/msg/String'
LATCHED = QoSProfile(depth=2, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def say(graph):
    """Return a function that publishes a message 50 times a second."""

    def say(topic, message):
        publisher = graph.publisher(type(message), topic)
        graph.node.create_timer(0.02, lambda: publisher.publish(message))

    return say


@pytest.fixture
def echo(graph, tmp_path):
    """Return a function that runs ``linkage echo`` on the graph of the test."""

    def echo(*arguments):
        return commands.linkage(
            tmp_path, 'echo', *arguments, timeout=PATIENCE, ROS_DOMAIN_ID=str(graph.domain)
        )

    return echo


def test_echo_prints_joint_states_as_yaml_with_units(say, echo):
    say('/joint_states', JointState(name=['a', 'b'], position=[0.5, -1.25], velocity=[2.0, 0.0]))
    answer = echo('--count', '2')
    assert answer.returncode == 0, answer.stderr
    first, second, rest = answer.stdout.split('---\n')
    assert rest == ''
    for document in (first, second):
        message = yaml.safe_load(document)
        assert message['name'] == ['a', 'b']
        assert message['position'] == [0.5, -1.25]
        assert message['effort'] == []
    assert 'position: [0.5, -1.25]  # rad or m\n' in first
    assert 'velocity: [2.0, 0.0]  # rad/s or m/s\n' in first
    # A machine that is busy may take more than 2 s to discover it, which is a line of its own.
    assert re.fullmatch(
        r'linkage echo: /joint_states: 2 messages, [\d.]+ Hz, period [\d.]+ to [\d.]+ ms',
        answer.stderr.splitlines()[-1],
    )


def test_echo_prints_the_rate_instead_of_messages(say, echo):
    say('/words', String(data='x'))
    answer = echo('words', '--rate', '--seconds', '6')
    assert answer.returncode == 0, answer.stderr
    lines = answer.stdout.splitlines()
    assert lines
    for line in lines:
        assert re.fullmatch(r'/words: [\d.]+ Hz, period [\d.]+ to [\d.]+ ms', line)


def test_echo_names_the_nearest_topic_in_silence(say, echo):
    say('/joint_states', JointState())
    answer = echo('/joint_stats', '--seconds', '3')
    assert (answer.returncode, answer.stdout) == (1, '')
    assert answer.stderr == (
        'linkage echo: /joint_stats: no message for 2 s (0 publishers); '
        "did you mean '/joint_states'?\n"
    )


def test_echo_lists_existing_topics_in_silence(say, echo, graph):
    graph.publisher(String, '/silent')
    say('/words', String(data='x'))
    answer = echo('/silent', '--seconds', '4')
    assert answer.returncode == 1
    assert '/silent: no message for 2 s (1 publishers); topics: ' in answer.stderr
    assert '/words' in answer.stderr


SILENCES = {
    'a count that is not reached': (
        ['/two', '--count', '3', '--timeout', '5'],
        (1, 2, ['/two: ended after 5 s without a message (--timeout)', '/two: 2 messages, ']),
    ),
    'messages that end, without a count': (
        ['/two', '--timeout', '5'],
        (0, 2, ['/two: ended after 5 s without a message (--timeout)', '/two: 2 messages, ']),
    ),
    'a topic that nobody has': (
        ['/nothing', '--timeout', '1'],
        (
            1,
            0,
            [
                '/nothing: no message for 1 s (0 publishers); topics: ',
                '/nothing: ended after 1 s without a message (--timeout)',
            ],
        ),
    ),
    'a count has a timeout without being told': (
        ['/nothing', '--count', '1'],
        (1, 0, ['/nothing: ended after 10 s without a message (--timeout)']),
    ),
}


@pytest.mark.sample(1)
@pytest.mark.parametrize('kind', SILENCES)
def test_silence_ends_echo_after_its_limit(graph, echo, kind):
    latched = graph.node.create_publisher(String, '/two', LATCHED)
    for word in ('one', 'other'):
        latched.publish(String(data=word))
    typed, (code, messages, lines) = SILENCES[kind]
    answer = echo(*typed)
    assert (answer.returncode, answer.stdout.count('---\n')) == (code, messages)
    first = -len(lines)
    for line, beginning in zip(answer.stderr.splitlines()[first:], lines, strict=True):
        assert line.startswith(f'linkage echo: {beginning}')


def test_unreached_count_ends_echo_with_code_1(say, echo):
    say('/words', String(data='x'))
    answer = echo('/words', '--count', '1000000', '--seconds', '5')
    assert answer.returncode == 1
    assert answer.stdout


def test_signal_ends_echo_with_code_0(graph, tmp_path):
    process = subprocess.Popen(
        [sys.executable, '-m', 'linkage_ros.cli.main', 'echo', '/nothing'],
        env=commands.environment(tmp_path) | {'ROS_DOMAIN_ID': str(graph.domain)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        # It has begun when it reports the silence.
        assert '/nothing: no message for 2 s' in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    assert (process.returncode, out, err) == (0, '', '')


def test_echo_cuts_long_fields():
    shown = yaml.safe_load(as_yaml(String(data='x' * 5000), TEXT))
    assert len(shown['data']) <= 1000
    long = JointState(position=array('d', range(1000)))
    shown = yaml.safe_load(as_yaml(long, JOINT_STATE_TYPE))
    assert shown['position'] == [*range(128), '… and 872 more']


def test_echo_rate_equals_the_rate_of_arrivals():
    assert rate_text([0.0, 0.1, 0.3, 0.4]) == '7.5 Hz, period 100.00 to 200.00 ms'
