# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Truncate a bag at every byte and flip every bit of it; judge what the readers give.

They may give all messages or some of them, with the damage reported, or refuse the bag; nothing
false, and no loss without a report.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
import tempfile
from typing import NamedTuple

from bench.report import Table
from campaigns.campaign import Findings, Page, progress_lines, results_of
from campaigns.reliability.judge import FAULT, read
from campaigns.reliability.recording import JOINT_STATE, KILLED, OURS, START, WRITERS
from linkage_ros.bag import (
    BagMessage,
    Message,
    QosProfile,
    read_bag,
    RecordSource,
    Salvage,
    Topic,
    topic_of,
)
from mcap.records import Attachment

_DEFINITION = 'std_msgs/Header header\nstring[] name\nfloat64[] position\n' + '# text\n' * 100
_TOPICS = (
    Topic('/crank', JOINT_STATE, _DEFINITION, 'RIHS01_' + '0a' * 32, QosProfile(depth=5)),
    Topic('/arm/joint_states', JOINT_STATE, _DEFINITION, 'RIHS01_' + '0a' * 32),
)
_ATTACHMENTS = {
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
    """Make a bag by a writer, whose file has about ``size`` bytes."""
    random = Random(f'{seed} {kind}')
    messages = []
    for index in range(max(size // 240, 20)):
        stamp = START + index * 1_000_000
        data = b'\x00\x01\x00\x00' + random.randbytes(random.randrange(60, 300))
        messages.append((index % 2, stamp + random.randrange(-9999, 9999), stamp, data))
    file = WRITERS[kind](folder, _TOPICS, _ATTACHMENTS, messages)
    named = folder if (folder / 'metadata.yaml').exists() else file
    bag = read_bag(named, allow_truncated=kind == KILLED)
    expected = [BagMessage(_TOPICS[topic].name, *rest) for topic, *rest in messages]
    assert list(bag.messages()) == expected, 'the undamaged bag differs from what was written'
    return Subject(folder, file, file.read_bytes(), expected, bag.topics, bag.attachments)


_REPORTED, _SILENT = 'damage reported', 'nothing reported'


def judge_reading(subject: Subject, *, allow_truncated: bool) -> str:
    """Read the damaged file and return a verdict."""
    reading = read(subject.file, allow_truncated=allow_truncated)
    if reading.fault:
        return FAULT + reading.fault.partition(':')[0]
    if reading.bag is None:
        return 'refused'
    reported = bool(reading.error or reading.bag.truncated)
    return _verdict(
        subject, reading.messages, reading.bag.topics, reading.bag.attachments, reported=reported
    )


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
                    channel = channels[id(found.channel)] = found.channel
                    times = found.log_time, found.publish_time
                    given.append(BagMessage(channel.topic, *times, found.data))
                elif isinstance(found, Attachment):
                    attachments[found.name] = found.data
    except Exception as error:  # noqa: BLE001 (a fault)
        return f'{FAULT}{type(error).__name__}'
    known = salvage.data.definitions
    topics = [topic_of(channel, known.schema_of(channel)) for channel in channels.values()]
    return _verdict(subject, given, topics, attachments, reported=bool(salvage.losses))


def _verdict(
    subject: Subject,
    given: Sequence[BagMessage],
    topics: Iterable[Topic],
    attachments: Mapping[str, bytes],
    *,
    reported: bool,
) -> str:
    true = subject.messages
    if any(topic not in subject.topics for topic in topics):
        return f'{FAULT}a false topic'
    if not attachments.items() <= subject.attachments.items():
        return f'{FAULT}a false attachment'
    if given == true:
        complete = len(attachments) == len(subject.attachments)
        amount = 'all' if complete else 'all messages'
    elif _is_part(given, true):
        amount = 'a part' if given else 'none'
    else:
        return f'{FAULT}a false message'
    if amount != 'all' and not reported:
        return f'{FAULT}{amount}, {_SILENT}'
    return f'{amount}, {_REPORTED if reported else _SILENT}'


def _is_part(given: Sequence[BagMessage], true: Sequence[BagMessage]) -> bool:
    """Return whether the given messages are some of the true ones, in their order."""
    if given == true[: len(given)]:
        return True
    rest = iter(true)
    return all(message in rest for message in given)


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
    places: Sequence[int]  # The sizes, or the numbers of the bits


@dataclass
class Tally:
    """Number of verdicts by kind, damage and judge, and the first damages that are faults."""

    verdicts: Counter[tuple[str, str, str, str]] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        self.verdicts += other.verdicts
        self.faults += other.faults[: 20 - len(self.faults)]


def parts(kinds: Iterable[str], seed: int, size: int, sample: int | None) -> list[Part]:
    """Return all damages to bags of some kinds; with ``sample`` so many of each at random."""
    work = []
    for kind in kinds:
        with tempfile.TemporaryDirectory() as folder:
            length = len(make(kind, Path(folder) / 'run', seed, size).content)
        for damage, count in (('cut', length), ('flip', 8 * length)):
            places: Sequence[int] = range(count)
            if sample is not None and sample < count:
                places = sorted(Random(f'{seed} {kind} {damage}').sample(places, sample))
            work += [
                Part(kind, seed, size, damage, places[slice(start, start + _PART)])
                for start in range(0, len(places), _PART)
            ]
    return work


def run_parts(work: Sequence[Part], jobs: int) -> Iterator[tuple[Part, Tally]]:
    """Damage and judge; yield each part when it is done."""
    yield from results_of(_run_part, work, jobs)


def _run_part(part: Part) -> tuple[Part, Tally]:
    """Make the bag; at each place damage its file, judge, and undo the damage."""
    tally = Tally()
    with tempfile.TemporaryDirectory() as folder:
        subject = make(part.kind, Path(folder) / 'run', part.seed, part.size)
        content = subject.content
        with subject.file.open('r+b', buffering=0) as file:
            for place in part.places:
                at, bit = divmod(place, 8) if part.damage == 'flip' else (place, 0)
                if part.damage == 'flip':
                    file.seek(at)
                    file.write(bytes([content[at] ^ 1 << bit]))
                else:
                    file.truncate(place)
                for name, judge in JUDGES.items():
                    verdict = judge(subject)
                    tally.verdicts[part.kind, part.damage, name, verdict] += 1
                    if verdict.startswith(FAULT) and len(tally.faults) < 20:
                        tally.faults.append(
                            f'{name}, {part.kind}, {part.damage} {place}: {verdict}'
                        )
                file.seek(at)
                file.write(content[slice(at, at + 1 if part.damage == 'flip' else None)])
    return part, tally


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


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this campaign."""
    parser.add_argument('--size', type=int, default=100_000, help='of the file, about [bytes]')
    parser.add_argument('--sample', type=int, help='cuts and flips at random, instead of all')
    parser.add_argument(
        '--others', type=int, default=20_000, help='cuts and flips of each bag by other writers'
    )


def run(options: argparse.Namespace) -> Findings:
    """Damage and judge."""
    work = parts([OURS], options.seed, options.size, options.sample)
    if options.others:
        others = [kind for kind in WRITERS if kind != OURS]
        work += parts(others, options.seed, options.size, options.others)
    tally = Tally()
    total = sum(len(part.places) for part in work)
    progress = progress_lines(total, 'damages')
    for part, judged in run_parts(work, options.jobs):
        tally.add(judged)
        progress(len(part.places))
    tables = [_table(tally, kind, damage) for kind in WRITERS for damage in ('cut', 'flip')]
    tables = [table for table in tables if table.rows]
    return Findings(tables, tally.faults, [('damages', f'{total:,}')])


def _table(tally: Tally, kind: str, damage: str) -> Table:
    counts: dict[str, Counter[str]] = {}
    for (of_kind, of_damage, judge, verdict), count in tally.verdicts.items():
        if (of_kind, of_damage) == (kind, damage):
            counts.setdefault(verdict, Counter())[judge] += count
    table = Table(f'{kind}: {damage}', ('verdict', *JUDGES))
    for verdict in sorted(counts, key=lambda v: (not v.startswith(FAULT), v)):
        table.rows.append([verdict, *(f'{counts[verdict][judge]:,}' for judge in JUDGES)])
    return table
