# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
``python -m campaigns.damage``: bags truncated at every byte, and with every bit flipped.

A damaged bag is read and recovered, and the result is compared with the original: messages are the
recorded ones in their order, topics and attachments are unchanged, and every loss is reported.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
import os
from pathlib import Path
from random import Random
import sys
import tempfile
from typing import NamedTuple

from bench.report import say, Table
from campaigns.campaign import (
    exit_code,
    machine_of,
    Page,
    parser_of,
    progress_lines,
    publish,
    results_of,
)
from linkage_ros.bag import (
    BagMessage,
    BagWriter,
    Message,
    QosProfile,
    read_bag,
    RecordSource,
    Salvage,
    Topic,
    topic_of,
)
from linkage_ros.errors import BagError
from mcap.reader import make_reader
from mcap.records import Attachment
from mcap.writer import CompressionType, Writer

START = 1_700_000_000_000_000_000
OURS = 'linkage_ros'
KILLED = 'linkage_ros, killed'
TYPE = 'sensor_msgs/msg/JointState'
DEFINITION = 'std_msgs/Header header\nstring[] name\nfloat64[] position\n' + '# text\n' * 100
ATTACHMENTS = {
    'scene.yaml': ('text/yaml', b'linkage: four_bar.yaml\nrate: 1000\n' * 10),
    'linkage.yaml': ('text/yaml', b'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n' * 10),
    'empty': ('text/plain', b''),
}


@dataclass(frozen=True, slots=True)
class Subject:
    """An undamaged bag: its folder, its single file, and the content of both."""

    folder: Path
    file: Path
    content: bytes
    messages: list[BagMessage]
    topics: tuple[Topic, ...]
    attachments: Mapping[str, bytes]


def make(kind: str, folder: Path, seed: int, size: int) -> Subject:
    """Make a bag of a kind, whose file has about ``size`` bytes."""
    random = Random(f'{seed} {kind}')
    count = max(size // 240, 20)
    messages = []
    for index in range(count):
        stamp = START + index * 1_000_000
        data = b'\x00\x01\x00\x00' + random.randbytes(random.randrange(60, 300))
        messages.append((index % 2, stamp + random.randrange(-9999, 9999), stamp, data))
    topics = (
        Topic('/crank', TYPE, DEFINITION, 'RIHS01_' + '0a' * 32, QosProfile(depth=5)),
        Topic('/arm/joint_states', TYPE, DEFINITION, 'RIHS01_' + '0a' * 32),
    )
    file = KINDS[kind](folder, topics, messages)
    named = folder if (folder / 'metadata.yaml').exists() else file
    bag = read_bag(named, allow_truncated=kind == KILLED)
    expected = [BagMessage(topics[topic].name, *rest) for topic, *rest in messages]
    assert list(bag.messages()) == expected, 'the undamaged bag differs from what was written'
    return Subject(folder, file, file.read_bytes(), expected, bag.topics, bag.attachments)


def _by_linkage_ros(
    folder: Path, topics: tuple[Topic, ...], messages: list[tuple[int, int, int, bytes]]
):
    writer = BagWriter(folder, topics, ATTACHMENTS)
    for index, message in enumerate(messages):
        writer.write(*message)
        if index % 50 == 49:
            writer.flush()
    writer.close({'seed': '7'})
    return folder / f'{folder.name}_0.mcap'


def _killed(folder: Path, topics: tuple[Topic, ...], messages: list[tuple[int, int, int, bytes]]):
    """Write a bag that ends after its last chunk, as a kill after a flush leaves it."""
    file = _by_linkage_ros(folder, topics, messages)
    with file.open('rb') as stream:
        last = make_reader(stream).get_summary().chunk_indexes[-1]
    os.truncate(file, last.chunk_start_offset + last.chunk_length + last.message_index_length)
    return file


def _by_mcap(**options: object) -> Callable[..., Path]:
    """Return a function that writes a bag by mcap's writer, without metadata.yaml."""

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
    OURS: _by_linkage_ros,
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

_REPORTED, _SILENT = 'damage reported', 'nothing reported'


def judge_reading(subject: Subject, *, allow_truncated: bool) -> str:
    """Read the damaged file and return a verdict."""
    given: list[BagMessage] = []
    try:
        bag = read_bag(subject.file, allow_truncated=allow_truncated)
    except BagError:
        return 'refused'
    except Exception as error:  # noqa: BLE001
        return f'{FAULT}{type(error).__name__}'
    end = _SILENT
    try:
        given.extend(bag.messages())
    except BagError:
        end = _REPORTED
    except Exception as error:  # noqa: BLE001
        return f'{FAULT}{type(error).__name__}'
    if bag.truncated:
        end = _REPORTED
    if not _is_subset(bag.topics, subject.topics):
        return f'{FAULT}a false topic'
    if not bag.attachments.items() <= subject.attachments.items():
        return f'{FAULT}a false attachment'
    complete = len(bag.attachments) == len(subject.attachments)
    return _verdict(given, subject.messages, end, complete=complete)


def judge_salvage(subject: Subject) -> str:
    """Recover undamaged records from the damaged file and return a verdict."""
    given: list[BagMessage] = []
    attachments: dict[str, bytes] = {}
    channels = {}
    try:
        with subject.file.open('rb') as stream:
            salvage = Salvage(RecordSource(stream))
            for found in salvage.find_records():
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
    end = _REPORTED if salvage.losses else _SILENT
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
    if amount != 'all' and end == _SILENT:
        return f'{FAULT}{amount}, {_SILENT}'
    return f'{amount}, {end}'


def _is_part(given: Sequence[BagMessage], true: Sequence[BagMessage]) -> bool:
    """Return whether the given messages are some of the true ones, in their order."""
    if given == true[: len(given)]:
        return True
    rest = iter(true)
    return all(message in rest for message in given)


def _is_subset(some: Iterable[object], those: Sequence[object]) -> bool:
    return all(each in those for each in some)


_PART = 4000
"""Number of damages that a process tries at a time."""

JUDGES: dict[str, Callable[[Subject], str]] = {
    'read': lambda subject: judge_reading(subject, allow_truncated=False),
    'read, truncated allowed': lambda subject: judge_reading(subject, allow_truncated=True),
    'recover': judge_salvage,
}


class Part(NamedTuple):
    """Some of the damages to one bag."""

    # The bag, as arguments of `make`.
    kind: str
    seed: int
    size: int
    damage: str  # 'cut': the file is truncated to so many bytes; 'flip': one bit is inverted
    places: range | list[int]  # The sizes, or the numbers of the bits


@dataclass
class Tally:
    """Number of verdicts by kind, damage and judge, and the first damages that are faults."""

    verdicts: Counter[tuple[str, str, str, str]] = field(default_factory=Counter)
    faults: list[tuple[str, str, int, str, str]] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        self.verdicts += other.verdicts
        self.faults += other.faults[: 20 - len(self.faults)]


def parts(kinds: list[str], seed: int, size: int, sample: int | None) -> list[Part]:
    """Return all damages to bags of some kinds; with ``sample`` so many of each at random."""
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
                    Part(kind, seed, size, damage, places[slice(start, start + _PART)])
                    for start in range(0, sample, _PART)
                ]
    return work


def run(work: list[Part], jobs: int) -> Iterator[tuple[Part, Tally]]:
    """Damage and judge; yield each part when it is done."""
    yield from results_of(_with_part, work, jobs)


def _with_part(part: Part) -> tuple[Part, Tally]:
    return part, run_part(part)


def run_part(part: Part) -> Tally:
    """Make the bag; at each place damage its file, judge, and undo the damage."""
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
                    file.write(bytes([content[at]]))
                else:
                    file.seek(place)
                    file.write(content[place:])
    return tally


PAGE = Page(
    Path('docs/recordings/damage.md'),
    'Damaged bags',
    """
Made by `make damage`. A bag of about 100 kB that linkage_ros recorded is truncated at every byte,
and every bit of it is flipped, each time starting from the undamaged bag. A bag that was killed,
and bags by other writers with and without compression, are damaged at random places. Each damaged
bag is read as a complete bag, read as a bag that may be truncated, and recovered. The result has
to be the recorded messages in their order, with unchanged topics and attachments; every loss has
to be reported.

A row is a verdict: how much was read, and whether damage was reported. The numbers count damages.
*all messages*: all messages, but not all attachments. A verdict that is a violation begins with
FAULT: a false message, topic or attachment, an unreported loss, or a Python exception.
""",
)


def main() -> int:
    """Damage and judge; return 1 if a verdict is a fault."""
    parser = parser_of('damage', __doc__, page=PAGE)
    parser.add_argument('--size', type=int, default=100_000, help='of the file, about [bytes]')
    parser.add_argument('--sample', type=int, help='cuts and flips at random, instead of all')
    parser.add_argument(
        '--others', type=int, default=20_000, help='cuts and flips of each bag by other writers'
    )
    arguments = parser.parse_args()
    begin = datetime.now().astimezone()
    work = parts([OURS], arguments.seed, arguments.size, arguments.sample)
    if arguments.others:
        others = [kind for kind in KINDS if kind != OURS]
        work += parts(others, arguments.seed, arguments.size, arguments.others)
    tally = Tally()
    total = sum(len(part.places) for part in work)
    progress = progress_lines(total, 'damages')
    for part, judged in run(work, arguments.jobs):
        tally.add(judged)
        progress(len(part.places))
    tables = [_table(tally, kind, damage) for kind in KINDS for damage in ('cut', 'flip')]
    tables = [table for table in tables if table.rows]
    for kind, damage, place, name, verdict in tally.faults:
        say(f'{name}, {kind}, {damage} {place}: {verdict}')
    tables.append(machine_of(begin, arguments, 'damages', total))
    publish(tables, PAGE if arguments.write else None)
    return int(bool(tally.faults))


def _table(tally: Tally, kind: str, damage: str) -> Table:
    counts: dict[str, Counter[str]] = {}
    for (of_kind, of_damage, judge, verdict), count in tally.verdicts.items():
        if (of_kind, of_damage) == (kind, damage):
            counts.setdefault(verdict, Counter())[judge] += count
    table = Table(f'{kind}: {damage}', ('verdict', *JUDGES))
    for verdict in sorted(counts, key=lambda v: (not v.startswith(FAULT), v)):
        table.rows.append([verdict, *(f'{counts[verdict][judge]:,}' for judge in JUDGES)])
    return table


if __name__ == '__main__':
    sys.exit(exit_code(main))
