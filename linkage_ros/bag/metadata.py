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
``metadata.yaml``: what rosbag2 reads of a bag before it opens the file.

The keys and their order are rosbag2's, metadata version 9 (Jazzy; ``rosbag2_storage/yaml.hpp``).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import os
from pathlib import Path
from typing import Any

from linkage_ros.bag.topic import QosProfile, Topic
import yaml

METADATA_FILE = 'metadata.yaml'
ROOT_KEY = 'rosbag2_bagfile_information'
NO_START = 2**63 - 1
"""The starting time [ns] that rosbag2 gives a bag without messages."""


@dataclass(frozen=True, slots=True)
class BagSummary:
    """
    What a bag holds.

    Parameters
    ----------
    folder
        The bag's folder.
    file
        Name of the MCAP file in it.
    topics
        The topics, in the order of their numbers.
    counts
        Messages in the file, for each topic.
    refused
        Messages that were not written because a time of theirs does not fit, for each topic.
    start
        Least log time [ns]; `NO_START` without messages.
    duration
        Greatest less least log time [ns].
    size
        Size of the MCAP file [bytes].

    """

    folder: Path
    file: str
    topics: tuple[Topic, ...]
    counts: tuple[int, ...]
    refused: tuple[int, ...]
    start: int
    duration: int
    size: int


def qos_text(qos: QosProfile) -> str:
    """Return an MCAP channel's ``offered_qos_profiles``: YAML, a list of the one profile."""
    return _dump([qos.to_mapping()]).strip()


def metadata_text(summary: BagSummary, custom: Mapping[str, str], *, root: bool = True) -> str:
    """
    Return the text of ``metadata.yaml``.

    Parameters
    ----------
    summary
        What the bag holds.
    custom
        Goes to ``custom_data``.
    root
        Whether the root key is there: rosbag2 has it in the file, and leaves it out in the MCAP
        file's own ``serialized_metadata``.

    """
    information = {
        'version': 9,
        'storage_identifier': 'mcap',
        **_extent(summary),
        'topics_with_message_count': [
            {
                'topic_metadata': {
                    'name': topic.name,
                    'type': topic.type,
                    'serialization_format': 'cdr',
                    'offered_qos_profiles': [topic.qos.to_mapping()],
                    'type_description_hash': topic.type_hash,
                },
                'message_count': count,
            }
            for topic, count in zip(summary.topics, summary.counts, strict=True)
        ],
        'compression_format': '',
        'compression_mode': '',
        'relative_file_paths': [summary.file],
        'files': [{'path': summary.file, **_extent(summary)}],
        'custom_data': dict(custom) or None,
        # As rosbag2 has it, from the environment; the definitions here are Jazzy's anyway.
        'ros_distro': os.environ.get('ROS_DISTRO') or 'jazzy',
    }
    return _dump({ROOT_KEY: information} if root else information)


def write_metadata(summary: BagSummary, custom: Mapping[str, str]) -> None:
    """
    Write ``metadata.yaml`` so that at every instant a whole one is there, the old or the new.

    Raises
    ------
    OSError
        As the system gives it; the old file, if there was one, is untouched.

    """
    target = summary.folder / METADATA_FILE
    temporary = target.with_suffix('.yaml.tmp')
    try:
        with temporary.open('w', encoding='utf-8') as file:
            file.write(metadata_text(summary, custom))
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(target)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise
    sync_folder(summary.folder)


def sync_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk: without it a power cut can lose a whole file."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _extent(summary: BagSummary) -> dict[str, Any]:
    # New mappings at each call: YAML would write a shared one as an anchor and an alias.
    return {
        'duration': {'nanoseconds': summary.duration},
        'starting_time': {'nanoseconds_since_epoch': summary.start},
        'message_count': sum(summary.counts),
    }


def _dump(content: Any) -> str:
    text: str = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=1000)
    return text
