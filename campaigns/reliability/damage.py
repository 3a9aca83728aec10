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
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from random import Random
import tempfile

from bench.report import Table
from campaigns.campaign import Findings, Page, Part, parts_of, tallies_of
from campaigns.reliability.judge import FAULT, read
from campaigns.reliability.recording import (
    JOINT_STATE,
    KILLED,
    NumberedMessage,
    OURS,
    START,
    WRITERS,
)
from campaigns.tally import Judgement, Tally
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
    messages: list[NumberedMessage] = []
    for index in range(max(size // 240, 20)):
        stamp = START + index * 1_000_000
        data = b'\x00\x01\x00\x00' + random.randbytes(random.randrange(60, 300))
        messages.append((index % 2, stamp + random.randrange(-9999, 9999), stamp, data))
    file = WRITERS[kind](folder, _TOPICS, _ATTACHMENTS, messages)
    named = folder if (folder / 'metadata.yaml').exists() else file
    bag = read_bag(named, allow_truncated=kind == KILLED)
    expected = [BagMessage(_TOPICS[each[0]].name, *each[1:]) for each in messages]
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


DAMAGES = ('cut', 'flip')
"""The file is truncated to so many bytes, or one bit is inverted."""

Samples = Mapping[str, int | None]
"""How many damages of a kind are tried for each writer, at random; None for all."""


def find_places(
    seed: int, kind: str, damage: str, length: int, sample: int | None
) -> Sequence[int]:
    """Return sizes to truncate to, or numbers of bits to invert, in a file of some length."""
    count = length if damage == 'cut' else 8 * length
    if sample is None or sample >= count:
        return range(count)
    return sorted(Random(f'{seed} {kind} {damage}').sample(range(count), sample))


def parts(seed: int, size: int, samples: Samples) -> list[Part]:
    """Return the damages to bags of some kinds, each made with ``size``."""
    work = []
    for kind, sample in samples.items():
        with tempfile.TemporaryDirectory() as folder:
            length = len(make(kind, Path(folder) / 'run', seed, size).content)
        for damage in DAMAGES:
            count = len(find_places(seed, kind, damage, length, sample))
            work += parts_of(seed, {kind: count}, _PART, damage)
    return work


def judge_part(size: int, samples: Samples, part: Part) -> Iterator[tuple[int, Judgement]]:
    """Make the bag; at each place damage its file, judge, and undo the damage."""
    judged, kind = Judgement(), part.family
    with tempfile.TemporaryDirectory() as folder:
        subject = make(kind, Path(folder) / 'run', part.seed, size)
        content = subject.content
        places = find_places(part.seed, kind, part.test, len(content), samples[kind])
        with subject.file.open('r+b', buffering=0) as file:
            for place in (places[number] for number in part.numbers):
                at, bit = divmod(place, 8) if part.test == 'flip' else (place, 0)
                if part.test == 'flip':
                    file.seek(at)
                    file.write(bytes([content[at] ^ 1 << bit]))
                else:
                    file.truncate(place)
                for name, judge in JUDGES.items():
                    verdict = judge(subject)
                    if verdict.startswith(FAULT):
                        judged.find(f'{name}: {verdict}', f'{kind}, {part.test} {place}', place)
                    else:
                        judged.counts[f'{name}: {verdict}'] += 1
                file.seek(at)
                file.write(content[slice(at, at + 1 if part.test == 'flip' else None)])
    yield part.first, judged


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
    samples: dict[str, int | None] = {OURS: options.sample}
    if options.others:
        samples |= {kind: options.others for kind in WRITERS if kind != OURS}
    work = parts(options.seed, options.size, samples)
    judge = partial(judge_part, options.size, samples)
    tallies = tallies_of(judge, work, options.jobs, 'damages')
    bags = [(kind, damage, tallies[damage][kind]) for kind in samples for damage in DAMAGES]
    faults = [f'{name}: {note.text}' for *_, tally in bags for name, note in tally.findings()]
    tables = [_table(f'{kind}: {damage}', tally) for kind, damage, tally in bags]
    return Findings(tables, faults, [('damages', f'{sum(part.size for part in work):,}')])


def _table(title: str, tally: Tally) -> Table:
    counts: dict[str, list[int]] = {}
    for column, judge in enumerate(JUDGES):
        for name, count in tally.counts.items():
            if name.startswith(f'{judge}: '):
                verdict = name.removeprefix(f'{judge}: ')
                counts.setdefault(verdict, [0] * len(JUDGES))[column] = count
    table = Table(title, ('verdict', *JUDGES))
    for verdict in sorted(counts, key=lambda v: (not v.startswith(FAULT), v)):
        table.rows.append([verdict, *(f'{count:,}' for count in counts[verdict])])
    return table
