# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Recordings of numbered messages, and the writers of bags.

The bytes of every message contain its number and its time, so that a bag can be compared byte by
byte with what was offered.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import IntEnum
import os
from pathlib import Path
from time import sleep
from typing import Any, Protocol

from linkage_ros.bag import (
    BagMessage,
    BagSummary,
    BagWriter,
    QosProfile,
    Recorder,
    Storage,
    Topic,
)
from linkage_ros.errors import RecordingError
from linkage_ros.messages import JointStateWriter
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

JOINT_STATE = 'sensor_msgs/msg/JointState'
START = 1_700_000_000_000_000_000
_HASH = 'RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e'
_LINE = 80 * '=' + '\n'
_DEFINITION = f"""\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{_LINE}MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_LINE}MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
TOPICS = (
    Topic('/crank_states', JOINT_STATE, _DEFINITION, _HASH, QosProfile(depth=5)),
    Topic('/joint_states', JOINT_STATE, _DEFINITION, _HASH),
)
ATTACHMENTS = {
    'scene.yaml': ('application/yaml', b'linkage: four_bar.yaml\nrate: 1000\n' * 10),
    'linkage.yaml': ('application/yaml', b'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n' * 10),
}
_WRITE = (
    JointStateWriter(['crank_joint']).write,
    JointStateWriter(['coupler_joint', 'rocker_joint']).write,
)

NumberedMessage = tuple[int, int, int, bytes]
"""Number of its topic, log time and publish time in [ns], data."""


def message(number: int, time: int) -> NumberedMessage:
    """
    Return a numbered message for the recorder, two for each tick: of the crank, of joint states.

    Its bytes contain its number, from 0, and the time at which it is offered, in [ns].
    """
    topic = number % len(TOPICS)
    joints = (float(number), 0.1 * number)[: topic + 1]
    return topic, time, time - 137_000, _WRITE[topic](time, joints, (1.0, -1.0)[: topic + 1], ())


def expected(number: int, time: int) -> BagMessage:
    """Return a numbered message as it has to be in the bag."""
    topic, log_time, publish_time, data = message(number, time)
    return BagMessage(TOPICS[topic].name, log_time, publish_time, data)


_PERIOD = 500_000  # between two messages [ns]


def time_of(number: int) -> int:
    """Return the time at which a message is offered, in recordings that do not wait [ns]."""
    return START + number * _PERIOD


def expected_messages(count: int) -> list[BagMessage]:
    """Return the first messages of such a recording, as they have to be in the bag."""
    return [expected(index, time_of(index)) for index in range(count)]


class Phase(IntEnum):
    """Phases of a recording, in order."""

    STARTING = 0
    MAKING = 1
    RECORDING = 2
    FLUSHING = 3
    SPLITTING = 4
    CLOSING = 5
    CLOSED = 6


class Watch(Protocol):
    """Is told the progress of a `WatchedWriter`."""

    def enter(self, phase: Phase, written: int, /) -> object:
        """Take the begin of a phase, and the number of messages written so far."""


class WatchedWriter(BagWriter):
    """
    A writer whose phases are watched.

    With ``flush_every`` it flushes and renews its metadata after that number of messages, so that
    all runs are equal.
    """

    def __init__(
        self, watch: Watch, folder: Path, storage: Storage, flush_every: int | None = None
    ) -> None:
        self._watch, self._flush_every = watch, flush_every
        self._written = 0
        watch.enter(Phase.MAKING, 0)
        super().__init__(folder, TOPICS, ATTACHMENTS, storage)
        watch.enter(Phase.RECORDING, 0)

    def write(self, topic: int, log_time: int, publish_time: int, data: bytes) -> bool:
        if self._flush_every and self._written and self._written % self._flush_every == 0:
            self._due = 0.0
            self.flush()
        accepted = super().write(topic, log_time, publish_time, data)
        self._written += 1
        return accepted

    def flush(self) -> None:
        with self._phase(Phase.FLUSHING):
            super().flush()

    def close(self, custom: Mapping[str, str] | None = None) -> BagSummary:
        with self._phase(Phase.CLOSING, Phase.CLOSED):
            return super().close(custom)

    def _begin_next_file(self) -> None:
        with self._phase(Phase.SPLITTING):
            super()._begin_next_file()

    @contextmanager
    def _phase(self, phase: Phase, after: Phase = Phase.RECORDING) -> Iterator[None]:
        self._watch.enter(phase, self._written)
        yield
        self._watch.enter(after, self._written)


@dataclass(slots=True)
class Recorded:
    """The outcome of a recording, as its caller sees it."""

    refused: str = ''  # The error that kept it from beginning; '' for none
    escaped: str = ''  # An exception other than RecordingError; '' for none
    offered: int = 0  # Number of messages offered
    # Received, recorded, dropped, discarded and waiting, of each topic.
    counts: list[tuple[int, int, int, int, int]] = field(default_factory=list)
    failure: str | None = None  # The error that ended it early; None for none

    @property
    def recorded(self) -> int:
        """Return the number of messages that are counted as recorded."""
        return sum(counts[1] for counts in self.counts)

    @property
    def discarded(self) -> int:
        """Return the number of messages that are counted as removed by the ring."""
        return sum(counts[3] for counts in self.counts)


def record(
    make: Callable[[], BagWriter], messages: Callable[[Recorder], Iterable[NumberedMessage]]
) -> Recorded:
    """Make a writer and record messages; whatever goes wrong is a part of the outcome."""
    done = Recorded()
    recorder: Recorder | None = None
    try:
        writer = make()
        recorder = Recorder(writer, flush_period=writer.storage.flush_period)
        for offered in messages(recorder):
            recorder.offer(*offered)
            done.offered += 1
        summary = recorder.stop(timeout=60.0)
        done.counts = [
            (c.received, c.recorded, c.dropped, c.discarded, c.waiting) for c in summary.topics
        ]
        done.failure = summary.failure
    except Exception as error:  # noqa: BLE001 (a fault)
        if recorder is None and isinstance(error, RecordingError):
            done.refused = str(error)
        else:
            done.escaped = f'{type(error).__name__}: {error}'
    return done


def wait_for(recorder: Recorder, most: int) -> None:
    """Wait until the recorder's queue has at most so many messages, or it has failed."""
    while recorder.failure is None and sum(c.waiting for c in recorder.read_counts()) > most:
        sleep(0.001)


Topics = Sequence[Topic]
Attachments = Mapping[str, tuple[str, bytes]]


def by_linkage_ros(
    folder: Path, topics: Topics, attachments: Attachments, messages: Iterable[NumberedMessage]
) -> Path:
    """Write a bag with a flush after every 50 messages; return its file."""
    writer = BagWriter(folder, topics, attachments)
    for index, each in enumerate(messages):
        writer.write(*each)
        if index % 50 == 49:
            writer.flush()
    writer.close({'seed': '7'})
    return folder / f'{folder.name}_0.mcap'


def _killed(folder: Path, *content: Any) -> Path:
    """Write a bag that ends after its last chunk, as a kill after a flush leaves it."""
    file = by_linkage_ros(folder, *content)
    with file.open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    last = summary.chunk_indexes[-1]
    os.truncate(file, last.chunk_start_offset + last.chunk_length + last.message_index_length)
    return file


def _by_mcap(**options: Any) -> Callable[..., Path]:
    """Return a function that writes a bag by mcap's writer, without metadata.yaml."""

    def write(
        folder: Path,
        topics: Topics,
        attachments: Attachments,
        messages: Iterable[NumberedMessage],
    ) -> Path:
        folder.mkdir(parents=True)
        file = folder / f'{folder.name}_0.mcap'
        with file.open('wb') as stream:
            writer = Writer(stream, chunk_size=12_000, **options)
            writer.start(profile='ros2')
            for name, (media_type, data) in attachments.items():
                writer.add_attachment(0, START, name, media_type, data)
            definition = topics[0].definition.encode()
            schema = writer.register_schema(topics[0].type, 'ros2msg', definition)
            channels = [writer.register_channel(t.name, 'cdr', schema) for t in topics]
            for topic, log_time, publish_time, data in messages:
                writer.add_message(channels[topic], log_time, data, publish_time)
            writer.finish()  # type: ignore[no-untyped-call]
        return file

    return write


OURS = 'linkage_ros'
KILLED = 'linkage_ros, killed'
WRITERS: dict[str, Callable[..., Path]] = {
    OURS: by_linkage_ros,
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
"""The writers of bags: each takes a folder, topics, attachments and messages, and makes a file."""
