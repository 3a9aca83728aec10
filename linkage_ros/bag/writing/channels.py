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

"""
The schemas and channels of a file: in front of its messages, and once more in a file of their own.

mcap writes them into the first chunk, and at the very end. A recording that is killed has no end:
without the second copy, a damage in its first chunk would take the meaning of all others with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO

from linkage_ros import __version__
from linkage_ros.bag.metadata import qos_text
from linkage_ros.bag.topic import Topic
from mcap.writer import CompressionType, IndexType, Writer


def start(mcap: Writer) -> None:
    """Begin a file, as all of ours begin."""
    mcap.start(profile='ros2', library=f'linkage_ros {__version__}')


def register(mcap: Writer, topics: Sequence[Topic]) -> list[int]:
    """Tell a writer of topics; return their channels' numbers, the same for the same topics."""
    schemas: dict[str, int] = {}
    channels = []
    for topic in topics:
        if topic.type not in schemas:
            definition = topic.definition.encode()
            schemas[topic.type] = mcap.register_schema(topic.type, 'ros2msg', definition)
        description = {
            'offered_qos_profiles': qos_text(topic.qos),
            'topic_type_hash': topic.type_hash,
        }
        channels.append(mcap.register_channel(topic.name, 'cdr', schemas[topic.type], description))
    return channels


def channels_file(topics: Sequence[Topic]) -> bytes:
    """Return an MCAP file that has these topics, and no messages."""
    file = BytesIO()
    mcap = Writer(
        file,
        compression=CompressionType.NONE,
        index_types=IndexType.NONE,
        repeat_channels=False,
        repeat_schemas=False,
        use_chunking=False,
        use_statistics=False,
        use_summary_offsets=False,
    )
    start(mcap)
    register(mcap, topics)
    mcap.finish()  # type: ignore[no-untyped-call]
    return file.getvalue()
