# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Run the commands that read bags on randomly changed bags.

Bits are flipped, files truncated, records removed, doubled and moved, lengths and numbers
replaced. Most checksums are removed, since they would reveal the change at once. The attachments
of a bag are changed too, with correct checksums. A command has to end within the limits of time
and memory, with the remaining content or with one line. Any other outcome is a finding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
import json
from pathlib import Path
from random import Random
from shutil import rmtree
from struct import Struct

from campaigns.reliability.damage import make
from campaigns.reliability.judge import fault_of, Manners, Try
from campaigns.reliability.processes import confined, in_process
from campaigns.reliability.recording import JOINT_STATE, START, WRITERS
from linkage_ros.bag import BagWriter, METADATA_FILE, RUN_FILE, Storage, Topic
from linkage_ros.description import LINKAGE_FILE, parse_scene, SCENE_FILE
from linkage_ros.tick import Pipeline
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

COMMANDS = {
    'info': [],
    'report': ['-o', 'x.html'],
    'export': ['-o', 'x.csv'],
    'plot': ['-o', 'x.png'],
}
"""Commands to run on each bag, with the arguments after its name."""

_SECONDS = 60
"""Time limit of a command, in [s]; on a shared processor the slowest takes one second."""

MANNERS = Manners((0, 1, 2), notes=4, longest=7000, beside=': unfinished: ', silent=False)
"""A missing end is reported in addition to other damage."""

_SIZE = 12_000
_PERIOD = 1_000_000
_SCENE = b"""linkage: l.yaml
drive: {sine: {amplitude: 1.0, frequency: 2.0}}
effects: {velocity: {}, delay: {seconds: 0.002}, bias: {joints: {rocker_joint: 0.01}}}
"""
_LINKAGE = b'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n'
_HEAD = Struct('<BQ')
_FOOTER = 37  # bytes, with the magic behind it
_EXTREMES = (0, 1, 2**7, 2**8 - 1, 2**15, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1)
_WORDS = (
    *(b'', b'~', b'[[[[', b'{a: {b: {}}}', b'*a', b'&a [*a]', b'1e999', b'.nan', b'-1', b'\0'),
    *(b'9' * 5000, b'x' * 50_000, b'\xff\xfe', b'\x1b[31m', '\u202e'.encode(), b'os.path: {}'),
)
_AT_CHECKSUM: dict[int, int] = {Opcode.CHUNK: 33, Opcode.DATA_END: 9, Opcode.FOOTER: 25}
"""Offset of the checksum in each record; an attachment has it at its end."""


def tries(seed: int, numbers: range) -> Iterator[Try]:
    """Run the commands on changed bags."""
    with confined():
        for number in numbers:
            Path('bag').mkdir()
            changes = change_bag(Path('bag'), Random(f'{seed} {number}'))
            for command, arguments in COMMANDS.items():
                ended = in_process([command, 'bag', *arguments], _SECONDS)
                fault = fault_of(ended, MANNERS)
                finding = fault and f'bag {seed} {number}: {changes}: {command}: {fault}'
                yield f'{command}: {ended.code}', finding
            rmtree('bag')


def change_bag(folder: Path, random: Random) -> str:
    """Make a bag in an empty folder and change it; return the description of the changes."""
    kind = random.choice((*['of a scene'] * 6, *WRITERS))
    texts = {RUN_FILE: b'', SCENE_FILE: _SCENE, LINKAGE_FILE: _LINKAGE}
    if kind != 'of a scene':
        make(kind, folder / 'made', random.randrange(10**9), _SIZE)
        done = []
    elif random.random() < 0.4:
        name = random.choice([*texts])
        done = [f'the text of {name}']
        _record(folder, lambda each, text: _edited(text, random) if each == name else text, random)
    else:
        done = []
        _record(folder, lambda _, text: text, random)
    for made in [*(folder / 'made').iterdir()]:
        made.rename(folder / made.name)
    (folder / 'made').rmdir()
    metadata = folder / METADATA_FILE
    if metadata.exists() and random.random() < 0.2:
        metadata.write_bytes(_edited(metadata.read_bytes(), random))
        done.append('the metadata')
    (file,) = folder.glob('*.mcap')
    content = file.read_bytes()
    for _ in range(random.choice((1, 1, 2, 5)) if not done else 0):
        change = random.choice(_CHANGES)
        done.append(change.__name__.strip('_'))
        content = change(content, random)
    if random.random() < 0.7:
        content = _without_checksums(content)
        done.append('no checksums')
        if random.random() < 0.4:
            content = _without_index(content)
            done.append('no index')
    file.write_bytes(content)
    return f'{kind}: {", ".join(done)}'


def _record(folder: Path, edit: Callable[[str, bytes], bytes], random: Random) -> None:
    """Record a short run, with edited attachments."""
    files = {SCENE_FILE: _SCENE, LINKAGE_FILE: _LINKAGE}
    pipeline = Pipeline(parse_scene('attacked', 'here', files))
    run = {
        'scene': 'attacked',
        'seed': 1,
        'joint_states_topic': '/joint_states',
        'withheld_topic': '/withheld',
        'extra_topics': [],
    }
    texts = files | {RUN_FILE: json.dumps(run).encode()}
    topics = [Topic('/joint_states', JOINT_STATE, 'text', 'RIHS01_' + '0a' * 32)]
    topics.append(Topic('/withheld', 'builtin_interfaces/msg/Time', 'text', ''))
    writer = BagWriter(
        folder / 'made',
        topics,
        {name: ('', edit(name, text)) for name, text in texts.items()},
        Storage(compression=random.choice(('none', 'lz4', 'zstd'))),
    )
    for index in range(40):
        stamp = START + index * _PERIOD
        if message := pipeline.tick(stamp).message:
            writer.write(0, stamp, stamp, message)
        if index % 15 == 0:
            writer.flush()
    writer.close({})


def _records(content: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield kind, begin and end of each record, up to the first broken one."""
    at = len(MCAP0_MAGIC)
    while at + _HEAD.size <= len(content) - len(MCAP0_MAGIC):
        kind, length = _HEAD.unpack_from(content, at)
        end = at + _HEAD.size + length
        if end > len(content):
            return
        yield kind, at, end
        at = end


def _without_checksums(content: bytes) -> bytes:
    """Return a file without checksums, which would reveal a change."""
    changed = bytearray(content)
    for kind, at, end in _records(content):
        place = end - 4 if kind == Opcode.ATTACHMENT else at + _AT_CHECKSUM.get(kind, 0)
        after = place + 4
        if place > at and after <= end:
            changed[place:after] = bytes(4)
    # Behind a broken record the footer has not been reached.
    if len(changed) > _FOOTER:
        changed[-12:-8] = bytes(4)
    return bytes(changed)


def _without_index(content: bytes) -> bytes:
    """Return a file whose footer names no index, so that the whole file is read."""
    return content[:-28] + bytes(20) + content[-8:] if len(content) > _FOOTER else content


def _some(content: bytes, random: Random) -> tuple[int, int]:
    """Return begin and end of a random record, or of a few bytes if there is none."""
    records = [(at, end) for _, at, end in _records(content)]
    return random.choice(records) if records else (0, min(8, len(content)))


def _flipped(content: bytes, random: Random) -> bytes:
    changed = bytearray(content)
    for _ in range(random.choice((1, 3, 30)) if changed else 0):
        changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    return bytes(changed)


def _cut(content: bytes, random: Random) -> bytes:
    return content[: random.randrange(len(content) + 1)]


def _spliced(content: bytes, random: Random) -> bytes:
    """Insert copies of a record before another one."""
    begin, end = _some(content, random)
    place, _ = _some(content, random)
    return content[:place] + content[begin:end] * random.choice((1, 1, 100)) + content[place:]


def _removed(content: bytes, random: Random) -> bytes:
    begin, end = _some(content, random)
    return content[:begin] + content[end:]


def _swapped_lengths(content: bytes, random: Random) -> bytes:
    (one, _), (other, _) = _some(content, random), _some(content, random)
    changed = bytearray(content)
    first, second = slice(one + 1, one + 9), slice(other + 1, other + 9)
    changed[second], changed[first] = content[first], content[second]
    return bytes(changed)


def _another_kind(content: bytes, random: Random) -> bytes:
    begin, _ = _some(content, random)
    changed = bytearray(content)
    changed[begin] = random.randrange(256)
    return bytes(changed)


def _extreme(content: bytes, random: Random) -> bytes:
    """Replace a number in a record, or its length, by an extreme one."""
    begin, end = _some(content, random)
    size = random.choice((2, 4, 8))
    place = random.randrange(begin, max(begin + 1, min(end, begin + 120)))
    number = int(random.choice(_EXTREMES) % 2 ** (8 * size))
    after = place + size
    return content[:place] + number.to_bytes(size, 'little') + content[after:]


def _zeros(content: bytes, random: Random) -> bytes:
    place, size = random.randrange(len(content) + 1), random.choice((8, 512, 4096))
    after = place + size
    return content[:place] + bytes(size) + content[after:]


_CHANGES: tuple[Callable[[bytes, Random], bytes], ...] = (
    *(_flipped, _cut, _spliced, _removed, _swapped_lengths, _another_kind, _extreme, _extreme),
    _zeros,
)


def _edited(text: bytes, random: Random) -> bytes:
    """Return a text with a part of it replaced, repeated or removed."""
    begin, end = sorted(random.randrange(len(text) + 1) for _ in range(2))
    end = min(end, begin + random.choice((1, 8, 40)))
    word = random.choice((*_WORDS, text[begin:end] * 3))
    return text[:begin] + word + text[end:]
