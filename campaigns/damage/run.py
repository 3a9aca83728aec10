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
Bags are damaged, read and recovered; a verdict compares the outcome with the original.

The bags are a node's own, and others in the style of other writers. The damages are shared among
processes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
import os
from pathlib import Path
from random import Random
import tempfile
from typing import NamedTuple

from campaigns.campaign import results_of
from linkage_ros.bag.mcap_records import Message, Source
from linkage_ros.bag.reader import BagMessage, read_bag, topic_of
from linkage_ros.bag.salvage import Salvage
from linkage_ros.bag.topic import QosProfile, Topic
from linkage_ros.bag.writer import BagWriter
from linkage_ros.errors import BagError
from mcap.reader import make_reader
from mcap.records import Attachment
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


FAULT = 'FAULT: '
"""Prefix of a verdict that is a violation."""


def judge_reading(subject: Subject, *, allow_truncated: bool) -> str:
    """Read the bag's file as it lies there now; return a verdict."""
    given: list[BagMessage] = []
    try:
        bag = read_bag(subject.file, allow_truncated=allow_truncated)
    except BagError:
        return 'refused'
    except Exception as error:  # noqa: BLE001
        return f'{FAULT}{type(error).__name__}'
    end = 'says nothing'
    try:
        given.extend(bag.messages())
    except BagError:
        end = 'says so'
    except Exception as error:  # noqa: BLE001
        return f'{FAULT}{type(error).__name__}'
    if bag.truncated:
        end = 'says so'
    if not _is_subset(bag.topics, subject.topics):
        return f'{FAULT}a false topic'
    if not bag.attachments.items() <= subject.attachments.items():
        return f'{FAULT}a false attachment'
    complete = len(bag.attachments) == len(subject.attachments)
    return _verdict(given, subject.messages, end, complete=complete)


def judge_salvage(subject: Subject) -> str:
    """Look for what is whole in the bag's file as it lies there now; return a verdict."""
    given: list[BagMessage] = []
    attachments: dict[str, bytes] = {}
    channels = {}
    try:
        with subject.file.open('rb') as stream:
            salvage = Salvage(Source(stream))
            for found in salvage.found():
                if isinstance(found, Message):
                    channels[id(found.channel)] = found.channel
                    given.append(
                        BagMessage(
                            found.channel.topic, found.log_time, found.publish_time, found.data
                        )
                    )
                elif isinstance(found, Attachment):
                    attachments[found.name] = found.data
    except Exception as error:  # noqa: BLE001
        return f'{FAULT}{type(error).__name__}'
    known = salvage.data.definitions
    topics = [topic_of(channel, known.schema_of(channel)) for channel in channels.values()]
    if not _is_subset(topics, subject.topics):
        return f'{FAULT}a false topic'
    if not attachments.items() <= subject.attachments.items():
        return f'{FAULT}a false attachment'
    end = 'says so' if salvage.losses else 'says nothing'
    complete = len(attachments) == len(subject.attachments)
    return _verdict(given, subject.messages, end, complete=complete)


def _verdict(
    given: Sequence[BagMessage], true: Sequence[BagMessage], end: str, *, complete: bool
) -> str:
    if given == true:
        amount = 'all' if complete else 'all messages'
    elif _is_part(given, true):
        amount = 'a part' if given else 'none'
    else:
        return f'{FAULT}a false message'
    if amount != 'all' and end == 'says nothing':
        return f'{FAULT}{amount}, and says nothing'
    return f'{amount}, {end}'


def _is_part(given: Sequence[BagMessage], true: Sequence[BagMessage]) -> bool:
    """Say whether these are some of those, in their order."""
    if given == true[: len(given)]:
        return True
    rest = iter(true)
    return all(message in rest for message in given)


def _is_subset(some: Iterable[object], those: Sequence[object]) -> bool:
    return all(each in those for each in some)


_PART = 4000
"""Damages that a process takes at a time."""

JUDGES: dict[str, Callable[[Subject], str]] = {
    'read': lambda subject: judge_reading(subject, allow_truncated=False),
    'read, truncated allowed': lambda subject: judge_reading(subject, allow_truncated=True),
    'recover': judge_salvage,
}


class Part(NamedTuple):
    """
    Some of the damages to one bag.

    Attributes
    ----------
    kind, seed, size
        Which bag, as `make` takes it.
    damage
        'cut' to so many bytes, or 'flip' of the bit of this number.
    places
        The bytes or bits.

    """

    kind: str
    seed: int
    size: int
    damage: str
    places: range | list[int]


@dataclass
class Tally:
    """How often each judge came to each verdict, and the first damages that led to a fault."""

    verdicts: Counter[tuple[str, str, str, str]] = field(default_factory=Counter)
    faults: list[tuple[str, str, int, str, str]] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        self.verdicts += other.verdicts
        self.faults += other.faults[: 20 - len(self.faults)]


def parts(kinds: list[str], seed: int, size: int, sample: int | None) -> list[Part]:
    """Return all damages to the bags of these kinds, or of each damage so many at random."""
    work = []
    for kind in kinds:
        with tempfile.TemporaryDirectory() as folder:
            length = len(make(kind, Path(folder) / 'run', seed, size).content)
        for damage, count in (('cut', length), ('flip', 8 * length)):
            if sample is None or sample >= count:
                work += [
                    Part(kind, seed, size, damage, range(start, min(start + _PART, count)))
                    for start in range(0, count, _PART)
                ]
            else:
                places = sorted(Random(f'{seed} {kind} {damage}').sample(range(count), sample))
                work += [
                    Part(kind, seed, size, damage, places[start : start + _PART])
                    for start in range(0, sample, _PART)
                ]
    return work


def run(work: list[Part], jobs: int) -> Iterator[tuple[Part, Tally]]:
    """Damage and judge; yield each part as it is done."""
    yield from results_of(_with_part, work, jobs)


def _with_part(part: Part) -> tuple[Part, Tally]:
    return part, run_part(part)


def run_part(part: Part) -> Tally:
    """Make the bag, damage its file at each place, judge, and make it whole again."""
    tally = Tally()
    with tempfile.TemporaryDirectory() as folder:
        subject = make(part.kind, Path(folder) / 'run', part.seed, part.size)
        content = subject.content
        with subject.file.open('r+b', buffering=0) as file:
            for place in part.places:
                if part.damage == 'flip':
                    at, bit = divmod(place, 8)
                    file.seek(at)
                    file.write(bytes([content[at] ^ 1 << bit]))
                else:
                    file.truncate(place)
                for name, judge in JUDGES.items():
                    verdict = judge(subject)
                    tally.verdicts[part.kind, part.damage, name, verdict] += 1
                    if verdict.startswith(FAULT) and len(tally.faults) < 20:
                        tally.faults.append((part.kind, part.damage, place, name, verdict))
                if part.damage == 'flip':
                    file.seek(at)
                    file.write(content[at : at + 1])
                else:
                    file.seek(place)
                    file.write(content[place:])
    return tally
