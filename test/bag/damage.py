# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A bag to be damaged, and the ways to do it."""

from io import BytesIO
from pathlib import Path

from linkage_ros.bag import BagWriter, read_bag
from mcap.reader import make_reader

ATTACHMENTS = {
    'scene.yaml': ('text/yaml', b'linkage: four_bar\n' * 9),
    'linkage.yaml': ('text/yaml', b'four_bar: {}\n' * 9),
}
COUNT = 600
EACH = 100  # messages in a chunk


def write_run(folder: Path, topics, messages) -> Path:
    """Write a finished bag of six chunks of a hundred messages; return its folder."""
    writer = BagWriter(folder, topics, ATTACHMENTS)
    for index, message in enumerate(messages[:COUNT]):
        writer.write(*message)
        if index % EACH == EACH - 1:
            writer.flush()
    writer.close({'seed': '7'})
    return folder


def chunks_of(content: bytes) -> list[tuple[int, int]]:
    """Return where chunks begin and end, by mcap's reader."""
    with_index = make_reader(BytesIO(content)).get_summary()
    return [
        (each.chunk_start_offset, each.chunk_start_offset + each.chunk_length)
        for each in with_index.chunk_indexes
    ]


def data_of(folder: Path) -> list[bytes]:
    return [message.data for message in read_bag(folder).messages()]


def damaged(run: Path, change) -> Path:
    """Change the bag's file as told."""
    file = run / 'run_0.mcap'
    content = bytearray(file.read_bytes())
    file.write_bytes(change(content) or content)
    return run


def without(messages, lost: range) -> list[bytes]:
    return [m.data for index, m in enumerate(messages[:COUNT]) if index not in lost]


def flip(at: int, bit: int = 0):
    def change(content):
        content[at] ^= 1 << bit

    return change


def in_chunk(number: int, offset: int):
    def change(content):
        content[chunks_of(content)[number][0] + offset] ^= 0x80

    return change
