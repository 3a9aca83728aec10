# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""`linkage play` as its user types it: what others on the graph hear, and what it says."""

from dataclasses import replace
from functools import cache
from itertools import chain, pairwise
import os
import re
import signal
import subprocess
import sys
import time

from linkage_ros.bag import BagWriter, QosProfile, read_bag
from linkage_ros.node import bag_topic, offered_qos
from mcap.writer import Writer
import pytest
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from .graph import crank, NS, PATIENCE, stamp_of, wait_for

BEGIN = 1_700_000_000 * NS
MS = 1_000_000
DEEP = QoSProfile(depth=1000)
KINDS = {'/joints': JointState, '/words': String}


def topic_of(name, kind=None, **qos):
    topic = bag_topic(name, kind or KINDS[name], QoSProfile(depth=1))
    return replace(topic, qos=QosProfile(**{'depth': 1000, **qos}))


@cache  # rclpy leaves in the padding of a message what stood in memory before
def joints_and_words(count):
    """Return (topic, log time, bytes); both speak at each tenth time, in multiples of 4 bytes."""
    return list(_joints_and_words(count))


def _joints_and_words(count):
    for index in range(count):
        at = BEGIN + index * 10 * MS
        message = crank(0.1 * index, 1.0, at)
        yield 0, at, serialize_message(message)
        if index % 10 == 0:
            yield 1, at, serialize_message(String(data=f'say {index:03d}'))


def write(folder, messages, topics=('/joints', '/words')):
    """Write a bag by the recorder's own writer; return its folder."""
    topics = [topic_of(topic) if isinstance(topic, str) else topic for topic in topics]
    writer = BagWriter(folder, topics)
    for number, at, data in messages:
        writer.write(number, at, at, data)
    writer.close()
    return folder


@pytest.fixture
def bag(tmp_path):
    """Return a bag that lasts 0.99 s."""
    return write(tmp_path / 'bag', joints_and_words(100))


class Player:
    """``linkage play``, as a process."""

    def __init__(self, domain, folder, *arguments):
        self.process = subprocess.Popen(
            [sys.executable, '-m', 'linkage_ros.cli.main', 'play', *map(str, arguments)],
            cwd=folder,
            env=os.environ
            | {
                'ROS_DOMAIN_ID': str(domain),
                'ROS_LOG_DIR': str(folder),
                'RCUTILS_COLORIZED_OUTPUT': '0',
            },
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def ended(self, code=0):
        """Wait for the end; return what it said on both outputs."""
        said, complaints = self.process.communicate(timeout=PATIENCE)
        assert self.process.returncode == code, complaints
        assert 'Traceback' not in complaints
        return said, complaints


@pytest.fixture
def play(graph, tmp_path):
    players = []

    def play(*arguments):
        players.append(Player(graph.domain, tmp_path, *arguments))
        return players[-1]

    yield play
    for player in players:
        player.process.kill()
        player.process.communicate()


def listen(graph, *topics, qos=DEEP, heard=None):
    """Return a list to which (topic, bytes) of every message will be appended."""
    heard = [] if heard is None else heard

    def listener(topic):
        return lambda data: heard.append((topic, bytes(data)))

    for topic in topics:
        kind = KINDS.get(topic, JointState)
        graph.node.create_subscription(kind, topic, listener(topic), qos, raw=True)
    return heard


def test_every_message_is_heard_as_it_was_recorded(graph, bag, play):
    heard = listen(graph, '/joints', '/words')
    said, complaints = play(bag, '--wait', 20).ended()
    recorded = [(message.topic, message.data) for message in read_bag(bag).messages()]
    wait_for(lambda: len(heard) >= len(recorded), 'all messages')
    # Two topics are two streams: each is in order.
    for topic in KINDS:
        assert [each for each in heard if each[0] == topic] == [
            each for each in recorded if each[0] == topic
        ]
    assert re.search(r'^played +0\.990 s of the bag in ', said)
    assert '/joints: 100\n' in said
    assert '/words: 10\n' in said
    assert re.search(r'^late +\d+ of 110 messages by more than 10 ms; at most', said, re.MULTILINE)
    assert complaints == ''


def test_the_order_is_that_of_the_log_times(graph, tmp_path, play):
    # Written in the order of arrival at the recorder, a little out of time.
    times = [0, 3, 1, 2, 2, 7, 5, 6]
    bag = write(
        tmp_path / 'bag',
        [
            (0, BEGIN + at * MS, serialize_message(crank(float(index))))
            for index, at in enumerate(times)
        ],
        ['/joints'],
    )
    heard = graph.listen(JointState, '/joints')
    play(bag, '--wait', 20).ended()
    wait_for(lambda: len(heard) >= len(times), 'all messages')
    assert [message.position[0] for message in heard] == [0, 2, 3, 4, 1, 6, 7, 5]


def test_half_as_long_at_twice_the_rate(bag, play):
    def took(rate):
        said, _ = play(bag, '--rate', rate).ended()
        return float(re.search(r'of the bag in ([\d.]+) s, at a rate of', said)[1])

    # From 1.98 s down to 0.25 s. Only what is due has been sent, however slow the machine.
    slow, fast = took(0.5), took(4)
    assert slow >= 1.98
    assert 0.2475 <= fast < 0.5 * slow


@pytest.mark.parametrize(
    ('qos', 'reliability', 'durability'),
    [
        ({}, ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE),
        (
            {'reliability': 'best_effort'},
            ReliabilityPolicy.BEST_EFFORT,
            DurabilityPolicy.VOLATILE,
        ),
        (
            {'durability': 'transient_local', 'deadline': 5, 'lifespan': 5},
            ReliabilityPolicy.RELIABLE,
            DurabilityPolicy.TRANSIENT_LOCAL,
        ),
    ],
    ids=['reliable', 'best effort', 'transient local'],
)
def test_the_recorded_quality_of_service_is_offered(
    graph, tmp_path, play, qos, reliability, durability
):
    messages = [(0, BEGIN + index * 100 * MS, b'\0\1\0\0') for index in range(300)]
    bag = write(tmp_path / 'bag', messages, [topic_of('/joints', **qos)])
    player = play(bag)
    (found,) = wait_for(lambda: graph.node.get_publishers_info_by_topic('/joints'), 'a publisher')
    assert found.topic_type == 'sensor_msgs/msg/JointState'
    assert found.qos_profile.reliability == reliability
    assert found.qos_profile.durability == durability
    # Promises about time would be broken by another rate.
    assert found.qos_profile.deadline.nanoseconds > 10 * NS
    assert found.qos_profile.lifespan.nanoseconds > 10 * NS
    player.process.send_signal(signal.SIGINT)
    player.ended()


@pytest.mark.parametrize(
    ('recorded', 'history', 'depth'),
    [
        (QosProfile(depth=7), HistoryPolicy.KEEP_LAST, 7),
        (QosProfile(history='keep_all', depth=0), HistoryPolicy.KEEP_ALL, 1),
        (QosProfile(history='system_default', depth=0), HistoryPolicy.KEEP_LAST, 1),
        (QosProfile(depth=-5), HistoryPolicy.KEEP_LAST, 1),
        (QosProfile(depth=2**63), HistoryPolicy.KEEP_LAST, 2**31 - 1),
        (QosProfile(reliability='best_available'), HistoryPolicy.KEEP_LAST, 10),
        (QosProfile(durability='no such word'), HistoryPolicy.KEEP_LAST, 10),
    ],
)
def test_whatever_depth_a_bag_claims(recorded, history, depth):
    qos = offered_qos(recorded)
    assert (qos.history, qos.depth) == (history, depth)
    assert qos.reliability == ReliabilityPolicy.RELIABLE
    assert qos.durability == DurabilityPolicy.VOLATILE


def test_who_comes_late_hears_the_last_of_a_transient_local_topic(graph, tmp_path, play):
    qos = {'durability': 'transient_local', 'depth': 1}
    words = topic_of('/words', **qos)
    bag = write(
        tmp_path / 'bag',
        chain(
            [(1, BEGIN, serialize_message(String(data='the map')))],
            ((0, BEGIN + n * 100 * MS, b'\0\1\0\0') for n in range(300)),
        ),
        ['/joints', words],
    )
    player = play(bag)
    joints = listen(graph, '/joints')
    wait_for(lambda: joints, 'messages that come after the first')
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    heard = listen(graph, '/words', qos=latched)
    wait_for(lambda: heard, 'the map')
    assert heard == [('/words', serialize_message(String(data='the map')))]
    player.process.send_signal(signal.SIGINT)
    player.ended()


def test_topics_start_seconds_and_remapping(graph, bag, play):
    heard = listen(graph, '/joints', '/elsewhere')
    arguments = ['--topics', '/joints', '--start', 0.2, '--seconds', 0.3, '--rate', 5]
    said, _ = play(
        bag, *arguments, '--wait', 20, '--ros-args', '-r', '/joints:=/elsewhere'
    ).ended()
    # 0.20, 0.21 … 0.50
    expected = [('/elsewhere', data) for _, _, data in joints_and_words(100) if len(data) > 60]
    wait_for(lambda: len(heard) >= 31, 'the part')
    assert heard == expected[20:51]
    assert '/joints: 31\n' in said
    assert '/words' not in said


def test_it_waits_until_somebody_listens(graph, bag, play):
    player = play(bag, '--wait', 60)
    wait_for(lambda: graph.node.get_publishers_info_by_topic('/joints'), 'a publisher')
    time.sleep(1.5)  # longer than the bag
    assert player.process.poll() is None
    heard = listen(graph, '/joints')
    player.ended()
    wait_for(lambda: len(heard) == 100, 'all messages')


def test_it_waits_so_long_and_no_longer(bag, play):
    said, _ = play(bag, '--rate', 100, '--wait', 0.2).ended()
    assert '/joints: 100\n' in said


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_loop_goes_on_until_a_signal(graph, bag, play, number):
    heard = listen(graph, '/words')
    player = play(bag, '--loop', '--rate', 5, '--wait', 20)
    wait_for(lambda: len(heard) >= 35, 'three passes and a half')
    player.process.send_signal(number)
    said, complaints = player.ended()
    once = [('/words', data) for _, _, data in joints_and_words(100) if len(data) < 60]
    assert heard[:35] == (once * 4)[:35]
    assert re.search(r'^played +[\d.]+ s of the bag', said)
    assert complaints == ''


@pytest.mark.parametrize('arguments', [['--wait', 60], ['--rate', 0.01]])
def test_a_signal_ends_it_where_it_waits(graph, bag, play, arguments):
    player = play(bag, *arguments)
    wait_for(lambda: graph.node.get_publishers_info_by_topic('/joints'), 'a publisher')
    player.process.send_signal(signal.SIGINT)
    player.ended()


def test_the_clock_is_the_bags(graph, bag, play):
    clocks = graph.listen(Clock, '/clock')
    heard = graph.listen(JointState, '/joints')
    play(bag, '--clock', 100, '--rate', 0.5, '--wait', 20).ended()
    wait_for(lambda: len(heard) == 100 and len(clocks) > 100, 'messages and ticks')
    time.sleep(0.2)
    times = [clock.clock.sec * NS + clock.clock.nanosec - BEGIN for clock in clocks]
    # A hundred a second, at half the pace: one each 5 ms of the bag; and one at its end.
    expected = [index * 5 * MS for index in range(199)]
    assert set(times) <= set(expected)
    assert times == sorted(times)
    assert times[-1] == 990 * MS


def test_a_clock_in_the_bag_gives_way(graph, tmp_path, play):
    clock = topic_of('/clock', Clock)
    messages = [(0, BEGIN + n * MS, serialize_message(Clock())) for n in range(50)]
    bag = write(tmp_path / 'bag', [*messages, (1, BEGIN, b'\0\1\0\0')], [clock, '/joints'])
    said, complaints = play(bag, '--clock', '--rate', 10).ended()
    assert complaints == 'linkage play: /clock: is left out; --clock publishes its own\n'
    assert '/clock' not in said
    said, complaints = play(bag, '--rate', 10).ended()
    assert '/clock: 50\n' in said
    assert complaints == ''


def test_a_node_on_simulated_time_repeats_what_was_recorded(
    graph, write_scene, start, tmp_path, play
):
    # A tick for every sample, so that both nodes have the same ticks.
    recording = start(
        write_scene('recorded', f'rate: 0\nrecord: {{directory: {tmp_path / "runs"}}}')
    )
    publisher = graph.publisher(JointState, '/crank_states')
    heard = graph.listen(JointState, '/joint_states')
    wait_for(lambda: publisher.publish(crank(0.4, 1.0)) or heard, 'a joint state')
    for index in range(300):
        publisher.publish(crank(0.4 + 0.003 * index, 1.0))
        time.sleep(0.003)
    assert recording.end() == 0, recording.log
    (bag,) = (tmp_path / 'runs').iterdir()
    recorded = [m.data for m in read_bag(bag).messages() if m.topic == '/joint_states']
    assert len(recorded) > 250
    start(write_scene('again', 'rate: 0'), '-p', 'use_sim_time:=true')
    again = listen(graph, '/joint_states')
    # Again and again: messages may get lost before all have found each other, or later on a topic
    # of best effort.
    player = play(bag, '--clock', '--topics', '/crank_states', '--loop')
    wait_for(lambda: len(set(again)) > 0.9 * len(recorded), 'joint states')
    player.process.send_signal(signal.SIGINT)
    player.ended()
    assert {data for _, data in again} <= set(recorded)


def test_the_clock_moves_a_node_that_ticks_by_it(graph, write_scene, start, tmp_path, play):
    # The crank of the bag turns at 1 rad/s of the bag's time, a year ago.
    messages = [
        (0, at, serialize_message(crank((at - BEGIN) / NS, 1.0, at)))
        for at in range(BEGIN, BEGIN + 2 * NS, 5 * MS)
    ]
    bag = write(tmp_path / 'bag', messages, [topic_of('/crank_states', JointState)])
    start(
        write_scene('ticking', 'rate: 100\ndrive: {topic: {}}\npublish_input: true'),
        *('-p', 'use_sim_time:=true'),
    )
    heard = graph.listen(JointState, '/joint_states')
    # Again and again: the tests' own end may be slow to find the node's.
    player = play(bag, '--clock', 50, '--rate', 2, '--loop')
    wait_for(lambda: len(heard) > 100, 'two passes')
    player.process.send_signal(signal.SIGINT)
    player.ended()
    assert any(after < before for before, after in pairwise(map(stamp_of, heard)))
    for message in heard:
        angle = message.position[list(message.name).index('crank_joint')]
        assert angle == pytest.approx((stamp_of(message) - BEGIN) / NS, abs=1e-6)


def foreign(file, channels):
    """Write an MCAP file by somebody else: (topic, type) pairs, a message each."""
    with file.open('wb') as stream:
        writer = Writer(stream)
        writer.start(profile='ros2', library='somebody else')
        for index, (name, kind) in enumerate(channels):
            schema = writer.register_schema(kind, 'ros2msg', b'') if kind else 0
            channel = writer.register_channel(name, 'cdr', schema)
            writer.add_message(channel, BEGIN + index, b'\0\1\0\0\0\0\0\0', BEGIN + index)
        writer.finish()
    return file


LEFT_OUT = [
    # topic and type, and why it is left out
    ('/x', 'no_such_msgs/msg/Thing', "'no_such_msgs/msg/Thing' is not installed; install the ROS"),
    ('/x', 'sensor_msgs/msg/NoSuchThing', "'sensor_msgs/msg/NoSuchThing' is not installed"),
    ('/x', 'sensor_msgs/JointState', "its type 'sensor_msgs/JointState' is not a ROS 2"),
    ('/x', '', "its type '' is not a ROS 2 message"),
    ('/x', 'antigravity/msg/Thing', "'antigravity/msg/Thing' is not installed"),
    ('/x', '../../etc/msg/Thing', 'is not a ROS 2 message'),
    ('two words', 'std_msgs/msg/Empty', 'two words: is not a ROS 2 topic name'),
    ('/a//b', 'std_msgs/msg/Empty', '/a//b: is not a ROS 2 topic name'),
    ('', 'std_msgs/msg/Empty', "'': is not a ROS 2 topic name"),
    ('/a\0b', 'std_msgs/msg/Empty', r'/a\x00b: is not a ROS 2 topic name'),
    ('/{word}', 'std_msgs/msg/Empty', '/{word}: is not a ROS 2 topic name'),
    (f'/{"x" * 3000}', 'std_msgs/msg/Empty', f'/{"x" * 37}…{"x" * 38}: is not a ROS 2'),
    ('/\x1b[2J', 'std_msgs/msg/Empty', r'/\x1b[2J: is not a ROS 2 topic name'),
]


def test_a_foreign_bag_plays_what_can_be_published(graph, tmp_path, play):
    strange = [
        (f'{name}{index}' if name == '/x' else name, kind)
        for index, (name, kind, _) in enumerate(LEFT_OUT)
    ]
    file = foreign(tmp_path / 'foreign.mcap', [*strange, ('/joints', 'std_msgs/msg/Empty')])
    said, complaints = play(file).ended()
    assert '/joints: 1\n' in said
    lines = complaints.splitlines()
    assert len(lines) == len(LEFT_OUT)
    for line, (_, _, why) in zip(lines, LEFT_OUT, strict=True):
        assert line.startswith('linkage play: left out: ')
        assert why in line


def test_another_definition_of_a_type_is_left_out(tmp_path, play):
    other = replace(topic_of('/words'), type_hash=f'RIHS01_{"0" * 64}')
    bag = write(tmp_path / 'bag', joints_and_words(3), ['/joints', other])
    said, complaints = play(bag).ended()
    assert '/joints: 3\n' in said
    assert '/words' not in said
    assert (
        'left out: /words: std_msgs/msg/String had another definition when it was recorded'
        in complaints
    )


def test_a_killed_recording_is_played_as_far_as_it_goes(tmp_path, bag, play):
    (file,) = bag.glob('*.mcap')
    whole = file.read_bytes()
    # Behind the last chunk comes the index; the writer is killed in the middle of that.
    file.write_bytes(whole[:-300])
    said, complaints = play(bag, '--rate', 10).ended()
    assert '/joints: 100\n' in said
    assert (
        complaints == f'linkage play: {bag}: unfinished: its recording was killed; '
        'its content is played\n'
    )


def test_a_damaged_bag_is_played_up_to_the_damage(tmp_path, play):
    words = [
        (0, BEGIN + index * MS, serialize_message(String(data=f'<{index}>' * 100)))
        for index in range(500)
    ]
    bag = write(tmp_path / 'bag', words, ['/words'])
    (file,) = bag.glob('*.mcap')
    content = bytearray(file.read_bytes())
    content[content.index(b'<300>')] ^= 1
    file.write_bytes(content)
    said, complaints = play(bag, '--rate', 10).ended(1)
    count = int(re.search(r'/words: (\d+)', said)[1])
    assert 100 < count <= 300
    (line,) = complaints.splitlines()
    assert line.startswith(f'linkage play: ended early: {file}: is damaged: the chunk at byte ')


def wrong(folder):
    """Make what cannot be played."""
    (folder / 'text.mcap').write_text('no bag at all')
    (folder / 'empty.mcap').write_bytes(b'')
    (folder / 'folder').mkdir()
    write(folder / 'bag', joints_and_words(10))
    write(folder / 'silent', [])
    write(folder / 'instant', [(0, BEGIN, b'\0\1\0\0')])
    write(folder / 'far', [(0, 2**62, b'\0\1\0\0')])
    foreign(folder / 'foreign.mcap', [('/x', 'no_such_msgs/msg/Thing')])


WRONG = [
    # what is typed, and what the answer names
    ('missing', 'missing: does not exist'),
    ('text.mcap', 'text.mcap: is a text file, not an MCAP file'),
    ('empty.mcap', 'empty.mcap: is empty'),
    ('folder', 'folder: holds no .mcap file'),
    ('silent', 'silent: holds no messages; there is nothing to play'),
    ('foreign.mcap', 'foreign.mcap: has no topic that can be published; nothing to play'),
    ('bag --topics /joint', "/joint: bag has no such topic; did you mean '/joints'?"),
    ('bag --topics /zzz', '/zzz: bag has no such topic; there are: /joints, /words'),
    ('bag --start 1', '--start 1: is behind the end of bag; it lasts 0.09 s'),
    ('bag --topics /words --start 0.05', 'bag: holds no message of these topics at these times'),
    ('instant --loop', 'all messages have the same time; play it without --loop'),
    ('far --clock', f'--clock: {2**62} ns is beyond the times of messages'),
    ('bag --rate 0', '--rate: 0 is not between 0.01 and 1000'),
    ('bag --rate 1001', '--rate: 1001 is not between 0.01 and 1000'),
    ('bag --rate nan', '--rate: nan is not between 0.01 and 1000'),
    ('bag --rate fast', "argument --rate: 'fast' is not a number"),
    ('bag --clock 0', '--clock: 0 is not between 0.1 and 10000'),
    ('bag --start -1', '--start: -1 is not between 0 and 1e+09'),
    ('bag --ros-args -r', '--ros-args: '),
]


@pytest.fixture(scope='module')
def wrongs(tmp_path_factory):
    folder = tmp_path_factory.mktemp('wrong')
    wrong(folder)
    return folder


@pytest.mark.parametrize(('typed', 'named'), WRONG, ids=[typed for typed, _ in WRONG])
def test_what_cannot_be_played_is_said_in_a_line(domain, wrongs, typed, named):
    said, complaints = Player(domain, wrongs, *typed.split()).ended(
        1 if typed == 'instant --loop' else 2
    )
    assert named in complaints.splitlines()[-1]
    assert (said == '') == (typed != 'instant --loop')


def test_a_bag_that_is_being_written_is_not_played(tmp_path, play):
    writer = BagWriter(tmp_path / 'bag', [topic_of('/joints')])
    for _, at, data in joints_and_words(10):
        writer.write(0, at, at, data)
    writer.flush()
    _, complaints = play(tmp_path / 'bag').ended(2)
    file = tmp_path / 'bag' / 'bag_0.mcap'
    assert complaints == f'linkage play: {file}: is being written; end its recording first\n'
    writer.close()
    play(tmp_path / 'bag', '--rate', 10).ended()
