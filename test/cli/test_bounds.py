# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Files that are larger than they look: each is told in a line, within a gigabyte and a half.

Each command runs in a process of its own whose memory the system limits.
"""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
import resource
import struct
import subprocess
import sys
from typing import Any
from zlib import crc32

from linkage_ros.bag import METADATA_FILE, read_bag
from linkage_ros.description import bounded_yaml, DEEPEST, MOST_VALUES
from mcap.opcode import Opcode
from mcap.writer import CompressionType, IndexType, Writer
import pytest
import zstandard

from .recorded import scene_file, SECOND
from .test_replay import recorded
from ..support.commands import environment
from ..support.sampling import sample_count

MEMORY = 3 * 2**29
"""What a process may take, its libraries too [bytes]."""

BOMB = (
    '[&a [x,x,x,x,x,x,x,x,x],'
    + ','.join(f'&{chr(98 + i)} [{",".join([f"*{chr(97 + i)}"] * 9)}]' for i in range(8))
    + ']'
)
QOS = 'offered_qos_profiles'
HEAD = struct.Struct('<BQ')


def told(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run ``linkage`` within `MEMORY`."""
    return subprocess.run(
        [sys.executable, '-m', 'linkage_ros.cli.main', *words],
        cwd=folder,
        env=environment(folder),
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY)),
    )


def facts(folder: Path, name: str) -> dict[str, Any]:
    """Return what ``linkage info`` says of a bag."""
    ended = told(folder, 'info', name, '--json')
    assert ended.returncode == 0, ended.stderr[-2000:]
    return json.loads(ended.stdout)


def channels(file: Path, number: int, qos: str, **options: Any) -> None:
    """Write a file with so many topics, and a message on the first."""
    with file.open('wb') as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, **options)
        writer.start('ros2')
        schema = writer.register_schema('std_msgs/msg/String', 'ros2msg', b'string data')
        for topic in range(number):
            writer.register_channel(f'/t{topic}', 'cdr', schema, {QOS: qos})
        writer.add_message(1, SECOND, b'\0\1\0\0\1\0\0\0\0', SECOND)
        writer.finish()


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    'qos',
    [BOMB, f'- {BOMB}', '- ' + 'x' * 4_000_000, f'- {"[" * 50_000}', '- depth: ' + ':59' * 50_000],
    ids=['aliases', 'a list of aliases', 'four megabytes', 'brackets', 'sixties'],
)
def test_malformed_qos_is_counted_as_not_understood(tmp_path: Path, qos: str) -> None:
    channels(tmp_path / 'a.mcap', 1, qos)
    (topic,) = facts(tmp_path, 'a.mcap')['topics']
    assert (topic['messages'], topic['qos_understood']) == (1, False)


def test_qos_of_many_publishers_equals_that_of_the_first(tmp_path: Path) -> None:
    one = (
        '- history: 1\n  depth: 7\n  reliability: 2\n  durability: 2\n'
        + ''.join(
            f'  {key}:\n    sec: 1\n    nsec: 2\n'
            for key in ('deadline', 'lifespan', 'liveliness_lease_duration')
        )
        + '  liveliness: 1\n  avoid_ros_namespace_conventions: false\n'
    )
    channels(tmp_path / 'a.mcap', 1, one * 900)
    (topic,) = read_bag(tmp_path / 'a.mcap').topics
    assert topic.qos.understood
    assert (topic.qos.depth, topic.qos.reliability) == (7, 'best_effort')


def test_bag_of_65535_channels_is_refused_in_one_line(tmp_path: Path) -> None:
    channels(tmp_path / 'a.mcap', 65_535, '')
    for command in ('info', 'replay', 'plot', 'report')[: sample_count(4, 2)]:
        ended = told(tmp_path, command, 'a.mcap')
        assert ended.returncode == 2
        assert ended.stderr == (
            f'linkage {command}: a.mcap: is damaged: defines more than 10,000 channels or '
            'schemas; linkage recover saves the whole parts\n'
        )


METADATA = {
    'aliases': (f'rosbag2_bagfile_information: {BOMB}', 'aliases are not read'),
    'brackets': ('rosbag2_bagfile_information: ' + '[' * 10_000, 'it is nested too deeply'),
    'a flow list': (
        f'rosbag2_bagfile_information: [{"1," * 500_000}]',
        'it holds more than 200,000 values',
    ),
    'another': ('- 1', 'no mapping rosbag2_bagfile_information'),
}


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', METADATA)
def test_malformed_metadata_yaml_is_refused_in_one_line(tmp_path: Path, name: str) -> None:
    text, reason = METADATA[name]
    (tmp_path / 'a').mkdir()
    channels(tmp_path / 'a' / 'a.mcap', 1, '')
    (tmp_path / 'a' / METADATA_FILE).write_text(text)
    ended = told(tmp_path, 'info', 'a')
    assert ended.stderr == (
        f"linkage info: a/metadata.yaml: is not a bag's metadata ({reason}); "
        'read the MCAP file by itself\n'
    )


def test_oversized_metadata_within_the_mcap_file_are_ignored(tmp_path: Path) -> None:
    with (tmp_path / 'a.mcap').open('wb') as stream:
        writer = Writer(stream)
        writer.start('ros2')
        writer.register_channel('/a', 'cdr', 0)
        for text in (BOMB, f'linkage_ros.: {BOMB}'):
            writer.add_metadata('rosbag2', {'serialized_metadata': text})
        writer.finish()
    account = facts(tmp_path, 'a.mcap')
    assert account['versions']['ros_distro'] is None
    assert len(account['topics']) == 1


def test_info_counts_messages_of_the_file_not_of_metadata(tmp_path: Path) -> None:
    bag = recorded(tmp_path, 'effects: {velocity: {}}\n', 60)
    file = bag / METADATA_FILE
    before = facts(tmp_path, 'bag')['messages']
    file.write_text(file.read_text().replace('message_count: ', 'message_count: 99999999999'))
    assert facts(tmp_path, 'bag')['messages'] == before


def packed(file: Path, chunks: int) -> None:
    """Write chunks of 256 messages of a mebibyte of zeros, all alike."""
    message = HEAD.pack(Opcode.MESSAGE, 22 + 2**20 - 31) + struct.pack('<HIQQ', 1, 0, 1, 1)
    content = (message + bytes(2**20 - 31)) * 255
    data = zstandard.ZstdCompressor().compress(content)
    body = struct.pack('<QQQII', 1, 1, len(content), crc32(content), 4) + b'zstd'
    body += struct.pack('<Q', len(data)) + data
    with file.open('wb') as stream:
        options = {'index_types': IndexType.NONE, 'use_statistics': False}
        writer = Writer(stream, use_chunking=False, **options)
        writer.start('ros2')
        writer.register_channel('/a', 'cdr', 0)
        stream.write((HEAD.pack(Opcode.CHUNK, len(body)) + body) * chunks)
        writer.finish()


def test_info_refuses_to_unpack_a_compression_bomb(tmp_path: Path) -> None:
    packed(tmp_path / 'a.mcap', 200)
    assert (tmp_path / 'a.mcap').stat().st_size < 6_000_000
    account = facts(tmp_path, 'a.mcap')
    assert 'no recording packs as densely' in account['damage']
    assert 0 < account['messages'] < 25_000
    assert sum(each['content_bytes'] for each in account['compressions']) > 50 * 10**9


def test_index_that_repeats_a_chunk_is_damage(tmp_path: Path) -> None:
    channels(tmp_path / 'a.mcap', 1, '')
    content = (tmp_path / 'a.mcap').read_bytes()
    footer = len(content) - 37
    (start,) = struct.unpack_from('<Q', content, footer + 9)
    at = start
    while content[at] != Opcode.CHUNK_INDEX:
        at += 9 + struct.unpack_from('<Q', content, at + 1)[0]
    end = at + 9 + struct.unpack_from('<Q', content, at + 1)[0]
    more = content[at:end] * 1000
    foot = HEAD.pack(Opcode.FOOTER, 20) + struct.pack('<QQI', start, 0, 0)
    (tmp_path / 'b.mcap').write_bytes(content[:end] + more + foot + content[-8:])
    ended = told(tmp_path, 'info', 'b.mcap')
    assert (ended.returncode, ended.stdout) == (2, '')
    assert 'b.mcap: is damaged: its index names the record at byte' in ended.stderr


SCENES = {
    'brackets': ('effects: ' + '[' * 10_000, 'is nested too deeply'),
    'a flow list': (f'effects: [{"1," * 490_000}]\n', 'it holds more than 200,000 values'),
    'aliases': (f'effects: {BOMB}\n', 'aliases are not read'),
    'a long key': (f'{"x" * 900_000}: 1\n', 'has a key without a colon; write key: value'),
}


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', SCENES)
def test_oversized_scene_is_refused_in_one_line(tmp_path: Path, name: str) -> None:
    text, reason = SCENES[name]
    scene = scene_file(tmp_path, text)
    ended = told(tmp_path, 'scene', scene.name)
    assert ended.returncode == 2
    assert reason in ended.stderr
    assert len(ended.stderr) < 1000
    assert ended.stderr.count('\n') == 1


ENDS: dict[str, Callable[[int], str]] = {
    'values': lambda n: f'[{"1," * (n - 1)}]',
    'levels': lambda n: '[' * n + ']' * n,
}


@pytest.mark.sample(1)
@pytest.mark.parametrize(('what', 'most'), [('levels', DEEPEST), ('values', MOST_VALUES)])
def test_yaml_limits_refuse_one_level_or_value_more(what: str, most: int) -> None:
    bounded_yaml(ENDS[what](most))
    with pytest.raises(ValueError, match='it '):
        bounded_yaml(ENDS[what](most + 1))
