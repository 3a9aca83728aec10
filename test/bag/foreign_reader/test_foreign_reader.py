# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Bags as a reader in another language sees them: npm's @mcap/core and its ROS 2 packages.

Of every kind of bag it reads every message, and finds in it what our reader, rclpy and rosbags do.
"""

from itertools import islice
from math import inf, nan
from pathlib import Path
from random import Random
import shutil
from textwrap import dedent
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from linkage_ros.bag import BagWriter, QosProfile, read_bag, Storage, UNFINISHED_DATA
from linkage_ros.cli.main import main
from linkage_ros.description import load_scene
from linkage_ros.messages import text_message
from linkage_ros.node import RunRecording
from linkage_ros.replay import change_text, describe_topic, message_type
from linkage_ros.tick import list_run_topics, Pipeline, TickLoop
from linkage_ros.tools.study import turn_crank
import numpy as np
import pytest
from rclpy.serialization import serialize_message

from .agreement import assert_agreement, of_kind, read
from ..conftest import START, STORE

LINKAGES = Path(__file__).parents[3] / 'config' / 'linkages'
TICKS = 300
JOINT_STATE = 'sensor_msgs/msg/JointState'


class _Log:
    def info(self, line: str) -> None:
        pass

    def error(self, line: str) -> None:
        pytest.fail(line)


def health(number: int) -> bytes:
    """Return a diagnosis, serialized, as long and as odd as they come."""
    array = DiagnosticArray()
    array.header.stamp.sec = number
    for level in (DiagnosticStatus.OK, DiagnosticStatus.STALE):
        values = [KeyValue(key='größte Lücke', value='∞' * number), KeyValue()]
        array.status.append(DiagnosticStatus(level=level, name='tick', values=values))
    return bytes(serialize_message(array))


def run(folder: Path, text: str, linkage: str = 'four_bar') -> Path:
    """Run a scene without a graph, and record it as the node does; return the bag."""
    file = folder / 'scene.yaml'
    file.write_text(f'linkage: {LINKAGES / linkage}.yaml\n{text}\n')
    scene = load_scene(file)
    pipeline = Pipeline(scene)
    samples: list[tuple[bytes, dict[str, Any]]] = []

    def publish_change(change):
        return text_message(change_text(change, scene.faults[change.name].kind))

    def topics():
        return [
            (
                topic.key,
                describe_topic(
                    f'/{topic.name}'.replace('//', '/').replace('~', 'node'),
                    message_type(topic.type, 'scene'),
                    topic.qos,
                ),
            )
            for topic in list_run_topics(pipeline)
        ]

    loop = TickLoop(
        lambda: Pipeline(scene, pipeline.closures, pipeline.injection),
        (lambda: samples.pop() if samples else None) if pipeline.topic else None,
        lambda message: None,
        publish_extras=[lambda message: None] * len(pipeline.extras),
        publish_change=publish_change,
    )

    def pace(loop, stopping):
        for index, (now, message) in enumerate(islice(turn_crank(scene, pipeline), TICKS)):
            if message:
                samples.append((message, {'source_timestamp': now - 137_000}))
            if index % 50 == 25:
                loop.recorder.offer(loop.topics.diagnostics, now, now, health(index))
            loop.tick_at(now)

    recording = RunRecording(_Log())
    recording.start(scene, loop, '', topics)
    loop.start(pace)
    loop.stop()
    assert not loop.failure
    recording.stop(loop)
    (summary,) = recording.ended_bags
    assert not any(counts.dropped for counts in summary.topics)
    return summary.folder


RUNS = {
    # linkage, scene, how it is recorded, and which topics there are
    'joint states': ('four_bar', 'effects: {velocity: {}}', '', {'/crank_states'}),
    'forces and motion': (
        'slider_crank',
        """
        drive: {constant_rate: {rate: 12.566}}
        effects: {acceleration: {}, effort: {}, pin_forces: {}}
        """,
        '',
        {'/node/motion', '/node/pin_forces'},
    ),
    'faults, and times out of order': (
        'four_bar',
        """
        effects: {acceleration: {}}
        faults:
          cable: {silence: {}, at: [0.05], seconds: 0.05}
          clock: {time_jump: {by: 0.2}, at: [0.15], seconds: 0.1}
        """,
        'compression: lz4',
        {'/node/faults', '/node/withheld', '/node/motion', '/crank_states'},
    ),
    'lz4': ('jansen_leg', 'effects: {acceleration: {}}', 'compression: lz4', {'/node/motion'}),
    'zstd': ('jansen_leg', 'effects: {acceleration: {}}', 'compression: zstd', {'/node/motion'}),
    # The least that a scene may ask for: a part of a second would be refused.
    'split': ('four_bar', 'effects: {velocity: {}}', 'split_seconds: 1', {'/crank_states'}),
    'split, zstd': (
        'four_bar',
        'effects: {acceleration: {}}',
        'split_seconds: 1, keep_files: 2, compression: zstd',
        {'/node/motion'},
    ),
}


@pytest.mark.sample(1)
@pytest.mark.parametrize(('linkage', 'text', 'how', 'topics'), RUNS.values(), ids=RUNS.keys())
def test_recorded_runs_agree_with_a_foreign_reader(tmp_path, linkage, text, how, topics):
    rate = 100 if 'split' in how else 1000
    record = f'rate: {rate}\nrecord: {{directory: {tmp_path}, name: bag, {how}}}'
    bag = assert_agreement(run(tmp_path, f'{dedent(text)}\n{record}', linkage))
    assert {topic.name for topic in bag.topics} >= {'/joint_states', '/diagnostics', *topics}
    assert len(bag.files) == (3 if how == 'split_seconds: 1' else 2 if 'split' in how else 1)
    packing = next((name for name in ('lz4', 'zstd') if name in how), '')
    for file in bag.files:
        (chunks,) = of_kind(read(file, 'indexed'), 'chunks')
        assert chunks['packings'] == [packing]
    if 'time_jump' in text:
        times = [message.log_time for message in bag.messages()]
        assert times != sorted(times)


NUMBERS = (0.0, -0.0, 1.5, -1e-300, 5e-324, 2.0**60, 1.7976931348623157e308, inf, -inf, nan)
TEXTS = ('', 'a', 'rocker_joint', 'ü', '関節', '🦿', ' ', '\n\t"\\', 'x' * 300)
KINDS = (
    JOINT_STATE,
    'diagnostic_msgs/msg/DiagnosticArray',
    'std_msgs/msg/String',
    'builtin_interfaces/msg/Time',
    'trajectory_msgs/msg/JointTrajectory',
    'sensor_msgs/msg/MultiDOFJointState',
)
"""All types that the node records."""


def anything(kind: str, random: Random) -> Any:
    """Return a value of a type that rclpy names so, as rosbags has it."""
    if kind.startswith('sequence<'):
        inner = kind.removeprefix('sequence<').removesuffix('>')
        values = [anything(inner, random) for _ in range(random.choice((0, 1, 2, 3, 7)))]
        return np.array(values, float) if inner == 'double' else values
    if '/' in kind:
        name = kind.replace('/', '/msg/')
        inners = message_type(name, 'test').get_fields_and_field_types().values()
        return STORE.types[name](*(anything(inner, random) for inner in inners))
    return {
        'double': lambda: random.choice((*NUMBERS, random.uniform(-4, 4))),
        'string': lambda: random.choice(TEXTS),
        'int32': lambda: random.choice((-(2**31), -1, 0, 2**31 - 1)),
        'uint32': lambda: random.choice((0, 1, 2**32 - 1)),
        # As rosbags has it, with a sign; rclpy and npm's have none.
        'octet': lambda: random.choice((0, 1, 2, 3, 127)),
    }[kind]()


def test_messages_of_all_types_agree_with_a_foreign_reader(tmp_path):
    random = Random(7)
    topics = [
        describe_topic(f'/topic_{index}', message_type(kind, 'test'), QosProfile(depth=index + 1))
        for index, kind in enumerate(KINDS)
    ]
    writer = BagWriter(tmp_path / 'bag', topics, {'ä b.bin': ('', bytes(range(256)))})
    for index in range(1200):
        topic = random.randrange(len(KINDS))
        # Not by rclpy, which leaves bytes behind the end of some messages.
        message = anything(KINDS[topic].replace('/msg/', '/'), random)
        data = bytes(STORE.serialize_cdr(message, KINDS[topic]))
        # The greatest times that rosbag2 has, and none, are among them.
        time = random.choice((0, 1, START + index, 2**63 - 1))
        assert writer.write(topic, time, random.choice((0, time, 2**63 - 1)), data)
    writer.close({'note': 'ü: [1, 2]\n~'})
    bag = assert_agreement(tmp_path / 'bag')
    assert {topic.name for topic in bag.topics} == {m.topic for m in bag.messages()}


@pytest.mark.parametrize('compression', ['none', 'lz4', 'zstd'])
def test_bag_without_messages_agrees_with_a_foreign_reader(tmp_path, topics, compression):
    BagWriter(tmp_path / 'bag', topics, storage=Storage(compression=compression)).close()
    assert list(assert_agreement(tmp_path / 'bag').messages()) == []


@pytest.mark.sample(1)
@pytest.mark.parametrize('compression', ['none', 'lz4', 'zstd'])
def test_killed_and_recovered_bags_agree_with_a_foreign_reader(
    tmp_path, topics, messages, compression, capsys
):
    messages = messages[:4000]
    storage = Storage(split_bytes=100_000, compression=compression)
    writer = BagWriter(tmp_path / 'run', topics, {'a.txt': ('text/plain', b'a')}, storage)
    for index, message in enumerate(messages):
        writer.write(*message)
        if index == len(messages) - 500:
            writer.flush()
    # What a kill leaves is what the system has been given by then.
    shutil.copytree(tmp_path / 'run', tmp_path / 'killed')
    writer.close()
    killed = read_bag(tmp_path / 'killed', allow_truncated=True)
    assert killed.truncated
    ours = [str(message.log_time) for message in killed.messages()]
    assert len(messages) - 500 <= len(ours) < len(messages)
    files = [read(file, 'streamed') for file in killed.files]
    assert [m['logTime'] for records in files for m in of_kind(records, 'message')] == ours
    whole = [end['whole'] for records in files for end in of_kind(records, 'end')]
    assert whole == [True] * (len(files) - 1) + [False]
    assert main(['recover', str(tmp_path / 'killed')]) in {0, 3}
    recovered = assert_agreement(tmp_path / 'killed_recovered')
    assert [str(message.log_time) for message in recovered.messages()] == ours
    assert not set(UNFINISHED_DATA) & set(recovered.custom)
    capsys.readouterr()


def test_foreign_reader_reports_the_damaged_checksum(tmp_path, topics, messages):
    writer = BagWriter(tmp_path / 'run', topics)
    for message in messages[:100]:
        writer.write(*message)
    file = tmp_path / 'run' / writer.close().file
    content = bytearray(file.read_bytes())
    content[content.index(messages[50].data) + 20] ^= 1
    file.write_bytes(content)
    for how in ('indexed', 'streamed'):
        with pytest.raises(AssertionError, match=r'(?i)\bcrc'):
            read(file, how)
