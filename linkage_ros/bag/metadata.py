# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Write what a bag says of itself: ``metadata.yaml``, and the statistics of its recording.

rosbag2 reads ``metadata.yaml`` before it opens a bag's files. The keys and their order are its
own, metadata version 9 (Jazzy; ``rosbag2_storage/yaml.hpp``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
import errno
from functools import lru_cache
import json
import os
from pathlib import Path
import re
from typing import Any

from linkage_ros.bag.topic import QosProfile, Topic
import yaml

METADATA_FILE = 'metadata.yaml'
ROOT_KEY = 'rosbag2_bagfile_information'
NO_START = 2**63 - 1
"""Starting time [ns] that rosbag2 writes for a bag without messages."""

_NAME = '/_'
_PLAIN = re.compile(r'/[A-Za-z0-9_/]*')
"""Names that YAML writes unquoted; asking yaml would take a millisecond for each."""

_PREFIX = 'linkage_ros.'

STATS_RECORD = f'{_PREFIX}account'
"""Name of the metadata record with the `TopicCounts` at the end of a bag's last file."""

DISCARDED = f'{_PREFIX}discarded'
"""Key in the ``custom_data`` of a bag whose first files were removed: counts by topic, as JSON."""

FAILURE = f'{_PREFIX}failure'
"""Key in the ``custom_data`` of a bag whose recording ended early: the reason."""

UNFINISHED = f'{_PREFIX}unfinished'
"""Key in the ``custom_data`` of a bag in recording, or of a killed recording."""

UNFINISHED_DATA: Mapping[str, str] = {
    UNFINISHED: 'being recorded, or killed; the counts are from the last flush'
}


@dataclass(frozen=True, slots=True)
class BagSummary:
    """Summary of a bag, or of one of its files."""

    folder: Path  # The bag's folder
    file: str  # Name of its MCAP file; of several the last
    topics: tuple[Topic, ...]  # The topics, in the order of their numbers
    counts: tuple[int, ...]  # Messages in the file, for each topic
    start: int  # Least log time [ns]; `NO_START` without messages
    duration: int  # Greatest minus least log time [ns]
    size: int  # Size of the MCAP file, or files [bytes]
    parts: tuple[BagSummary, ...] = ()  # Summaries of the files, if there are several
    # Messages in files that were removed to keep newer ones, for each topic; () for none.
    discarded: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class TopicCounts:
    """
    Counts of one topic's messages in a recording, or in the memory of the last seconds.

    At every instant ``received == recorded + dropped + discarded + waiting``.
    """

    name: str
    received: int  # Messages offered
    recorded: int  # Messages in the bag, or in memory
    # Messages for which disk or memory was too slow or too full, or whose times fit into no bag.
    dropped: int
    # Messages in files that were removed for newer ones; of a memory: too old, or no room for them
    discarded: int = 0
    waiting: int = 0  # Messages in the queue, or with the recorder's thread


def count_topics(summary: BagSummary, received: Sequence[int]) -> list[TopicCounts]:
    """Return the counts of a bag that was offered these numbers of messages; the rest dropped."""
    names = [topic.name for topic in summary.topics]
    counts = zip(names, received, summary.counts, summary.discarded, strict=True)
    return [TopicCounts(name, n, kept, n - kept - gone, gone) for name, n, kept, gone in counts]


@lru_cache
def qos_text(qos: QosProfile) -> str:
    """Return an MCAP channel's ``offered_qos_profiles``: YAML, a list of one profile."""
    return _dump_yaml([qos.to_mapping()]).strip()


def metadata_text(summary: BagSummary, custom: Mapping[str, str], *, root: bool = True) -> str:
    """
    Return the text of ``metadata.yaml``, with ``custom`` as its ``custom_data``.

    rosbag2 writes the root key in the file, and omits it in the MCAP file's own
    ``serialized_metadata``.
    """
    files = summary.parts or (summary,)
    topics = [
        f'{_topic_text(topic)}  message_count: {count}\n'
        for topic, count in zip(summary.topics, summary.counts, strict=True)
    ]
    text = ''.join(
        [
            _dump_yaml({'version': 9, 'storage_identifier': 'mcap'}),
            _extent_text(summary.duration, summary.start, sum(summary.counts)),
            'topics_with_message_count:\n' if topics else 'topics_with_message_count: []\n',
            *topics,
            _dump_yaml({'compression_format': '', 'compression_mode': ''}),
            _dump_yaml({'relative_file_paths': [part.file for part in files]}),
            'files:\n',
            *(
                _file_text(part.file, part.duration, part.start, sum(part.counts))
                for part in files
            ),
            _dump_yaml(
                {
                    'custom_data': dict(custom) or None,
                    # rosbag2 takes it from the environment; the message definitions are Jazzy's
                    # anyway.
                    'ros_distro': os.environ.get('ROS_DISTRO') or 'jazzy',
                }
            ),
        ]
    )
    return f'{ROOT_KEY}:\n{_indent(text)}' if root else text


def merge_summaries(parts: Sequence[BagSummary], discarded: Sequence[int]) -> BagSummary:
    """Return the summary of a bag of these files; of a single file, its own summary."""
    last = parts[-1]
    start = min(part.start for part in parts)
    ends = [part.start + part.duration for part in parts if any(part.counts)]
    return BagSummary(
        folder=last.folder,
        file=last.file,
        topics=last.topics,
        counts=tuple(map(sum, zip(*(part.counts for part in parts), strict=True))),
        start=start,
        duration=max(ends) - start if ends else 0,
        size=sum(part.size for part in parts),
        parts=tuple(parts) if len(parts) > 1 else (),
        discarded=tuple(discarded),
    )


def write_metadata(summary: BagSummary, custom: Mapping[str, str]) -> None:
    """Write ``metadata.yaml`` atomically; an `OSError` leaves an old file unchanged."""
    target = summary.folder / METADATA_FILE
    temporary = target.with_suffix('.yaml.tmp')
    try:
        # Unbuffered: Python's buffers would retry forever on a disk that accepts nothing.
        with temporary.open('wb', buffering=0) as file:
            rest = memoryview(metadata_text(summary, custom).encode())
            while rest:
                count = file.write(rest)
                if not count:
                    raise OSError(errno.EIO, 'the disk accepts no data')
                rest = rest[count:]
            os.fsync(file.fileno())
        temporary.replace(target)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise
    sync_folder(summary.folder)


def sync_folder(folder: Path) -> None:
    """Sync a folder's names to the disk: without it a power cut can lose a whole file."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _topic_text(topic: Topic) -> str:
    if _PLAIN.fullmatch(topic.name):
        return _describe_topic(replace(topic, name=_NAME)).replace(_NAME, topic.name, 1)
    return _describe_topic(topic)


# Types and names are constant: a bag of a thousand files repeats them for each.
@lru_cache(maxsize=256)
def _describe_topic(topic: Topic) -> str:
    metadata = {
        'name': topic.name,
        'type': topic.type,
        'serialization_format': 'cdr',
        'offered_qos_profiles': [topic.qos.to_mapping()],
        'type_description_hash': topic.type_hash,
    }
    return _dump_yaml([{'topic_metadata': metadata}])


def _file_text(file: str, duration: int, start: int, messages: int) -> str:
    # rosbag2 writes the keys of a file in another order than the keys of the bag.
    return _path_text(file) + _indent(
        f'starting_time:\n  nanoseconds_since_epoch: {start}\n'
        f'duration:\n  nanoseconds: {duration}\n'
        f'message_count: {messages}\n'
    )


# Cached by name only: the counts of the newest file change each second.
@lru_cache(maxsize=8192)
def _path_text(file: str) -> str:
    return _dump_yaml([{'path': file}])


def _extent_text(duration: int, start: int, messages: int) -> str:
    return (
        f'duration:\n  nanoseconds: {duration}\n'
        f'starting_time:\n  nanoseconds_since_epoch: {start}\n'
        f'message_count: {messages}\n'
    )


def _indent(text: str) -> str:
    return ''.join(f'  {line}\n' for line in text[:-1].split('\n'))


def _dump_yaml(content: Any) -> str:
    text: str = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=1000)
    return text


def custom_data(
    custom: Mapping[str, str], summary: BagSummary, account: Sequence[TopicCounts] | None
) -> dict[str, str]:
    """Return a bag's ``custom_data``: ``custom``, and the statistics once they are known."""
    entries = dict(custom)
    if any(summary.discarded):
        names = (topic.name for topic in summary.topics)
        entries[DISCARDED] = json.dumps(dict(zip(names, summary.discarded, strict=True)))
    if account:
        entries[f'{_PREFIX}received'] = json.dumps({t.name: t.received for t in account})
        entries[f'{_PREFIX}dropped'] = json.dumps({t.name: t.dropped for t in account})
    return entries


def last_records(
    custom: Mapping[str, str], summary: BagSummary, account: Sequence[TopicCounts] | None
) -> dict[str, dict[str, str]]:
    """Return the metadata records at the end of a file, by name; arguments as `custom_data`."""
    text = metadata_text(summary, custom_data(custom, summary, account), root=False)
    records = {'rosbag2': {'serialized_metadata': text}}
    if account:
        counts = {
            'received': {topic.name: topic.received for topic in account},
            'recorded': {topic.name: topic.recorded for topic in account},
            'dropped': {topic.name: topic.dropped for topic in account},
            'discarded': {topic.name: topic.discarded for topic in account},
        }
        records[STATS_RECORD] = {word: json.dumps(by_topic) for word, by_topic in counts.items()}
    return records


def counts_in(custom: Mapping[str, str], word: str) -> dict[str, int]:
    """
    Return the counts by topic in a bag's ``custom_data``; empty if missing or damaged.

    They are of the kind 'received', 'dropped' or 'discarded'.
    """
    try:
        counts = json.loads(custom[f'{_PREFIX}{word}'])
    except (KeyError, ValueError, RecursionError):
        return {}
    entries = counts.items() if isinstance(counts, dict) else ()
    return {topic: count for topic, count in entries if type(count) is int and count >= 0}
