# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""Bags to damage: a node's own, and such as other writers leave; with what is true of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import os
from pathlib import Path
from random import Random

from linkage_ros.bag.reader import BagMessage, read_bag
from linkage_ros.bag.topic import QosProfile, Topic
from linkage_ros.bag.writer import BagWriter
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

START = 1_700_000_000_000_000_000
KILLED = 'own, killed'
TYPE = 'sensor_msgs/msg/JointState'
DEFINITION = 'std_msgs/Header header\nstring[] name\nfloat64[] position\n' + '# text\n' * 100
ATTACHMENTS = {
    'scene.yaml': ('text/yaml', b'linkage: four_bar.yaml\nrate: 1000\n' * 10),
    'linkage.yaml': ('text/yaml', b'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n' * 10),
    'empty': ('text/plain', b''),
}


@dataclass(frozen=True, slots=True)
class Subject:
    """A bag's folder, its one file as it is undamaged, and what it holds."""

    folder: Path
    file: Path
    content: bytes
    messages: list[BagMessage]
    topics: tuple[Topic, ...]
    attachments: Mapping[str, bytes]


def make(kind: str, folder: Path, seed: int, size: int) -> Subject:
    """Make a bag of this kind with a file of about so many bytes."""
    random = Random(f'{seed} {kind}')
    count = max(size // 240, 20)
    messages = []
    for number in range(count):
        stamp = START + number * 1_000_000
        data = b'\x00\x01\x00\x00' + random.randbytes(random.randrange(60, 300))
        messages.append((number % 2, stamp + random.randrange(-9999, 9999), stamp, data))
    topics = (
        Topic('/crank', TYPE, DEFINITION, 'RIHS01_' + '0a' * 32, QosProfile(depth=5)),
        Topic('/arm/joint_states', TYPE, DEFINITION, 'RIHS01_' + '0a' * 32),
    )
    file = KINDS[kind](folder, topics, messages)
    named = folder if (folder / 'metadata.yaml').exists() else file
    bag = read_bag(named, allow_truncated=kind == KILLED)
    expected = [BagMessage(topics[topic].name, *rest) for topic, *rest in messages]
    assert list(bag.messages()) == expected, 'undamaged, it is not what was written'
    return Subject(folder, file, file.read_bytes(), expected, bag.topics, bag.attachments)


def _own(folder: Path, topics: tuple[Topic, ...], messages: list[tuple[int, int, int, bytes]]):
    writer = BagWriter(folder, topics, ATTACHMENTS)
    for number, message in enumerate(messages):
        writer.write(*message)
        if number % 50 == 49:
            writer.flush()
    writer.close({'seed': '7'})
    return folder / f'{folder.name}_0.mcap'


def _killed(folder: Path, topics: tuple[Topic, ...], messages: list[tuple[int, int, int, bytes]]):
    """Write one that ends behind its last chunk, where a kill after a flush leaves it."""
    file = _own(folder, topics, messages)
    with file.open('rb') as stream:
        last = make_reader(stream).get_summary().chunk_indexes[-1]
    os.truncate(file, last.chunk_start_offset + last.chunk_length + last.message_index_length)
    return file


def _by_mcap(**options: object) -> Callable[..., Path]:
    """Return what writes a file by mcap's writer with these options, and no metadata.yaml."""

    def write(folder: Path, topics: tuple[Topic, ...], messages) -> Path:
        folder.mkdir(parents=True)
        file = folder / f'{folder.name}_0.mcap'
        with file.open('wb') as stream:
            writer = Writer(stream, chunk_size=12_000, **options)
            writer.start(profile='ros2')
            for name, (media_type, data) in ATTACHMENTS.items():
                writer.add_attachment(0, START, name, media_type, data)
            schema = writer.register_schema(TYPE, 'ros2msg', DEFINITION.encode())
            channels = [writer.register_channel(t.name, 'cdr', schema) for t in topics]
            for topic, log_time, publish_time, data in messages:
                writer.add_message(channels[topic], log_time, data, publish_time)
            writer.finish()
        return file

    return write


KINDS: dict[str, Callable[..., Path]] = {
    'own': _own,
    KILLED: _killed,
    'lz4': _by_mcap(compression=CompressionType.LZ4),
    'zstd': _by_mcap(compression=CompressionType.ZSTD),
    'no index': _by_mcap(
        compression=CompressionType.NONE,
        use_statistics=False,
        use_summary_offsets=False,
        repeat_channels=False,
        repeat_schemas=False,
    ),
    'no chunks, all data under one checksum': _by_mcap(
        use_chunking=False, enable_data_crcs=True, compression=CompressionType.NONE
    ),
}
