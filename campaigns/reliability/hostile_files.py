# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Run every command that takes a file on randomly changed files.

A command has to end within the limits of time and memory: with its result, or with exit code 2 and
a line that is no longer than a screen. Any other outcome is a finding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
import random
import re
from shutil import rmtree
import warnings

from campaigns.reliability.judge import fault_of, Manners, Try
from campaigns.reliability.processes import confined, Ended, in_own_process, in_process
from campaigns.reliability.recording import by_linkage_ros, JOINT_STATE, START
from linkage_ros.bag import Topic
from linkage_ros.description import parse_yaml, read_linkage
from linkage_ros.messages import JointStateWriter
from linkage_ros.resources import shipped_path

_NUMBER = re.compile(rb'(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.])')
_NAME = re.compile(rb'[A-Za-z_]\w*')
_VALUE = re.compile(rb'(?<=: )[^,{}\[\]\n#]+')
_LIST = re.compile(rb'[\[{][^\[\]{}\n]*[\]}]')

_NUMBERS = (
    *(b'0', b'-0.0', b'5e-324', b'-5e-324', b'2.3e-308', b'1e-30', b'1e-9', b'-1e-9', b'1e-3'),
    *(b'1', b'-1', b'2', b'3.141592653589793', b'1e3', b'1e6', b'1e9', b'-1e9', b'1e12', b'1e150'),
    *(b'1e308', b'-1e308', b'1.8e308', b'1e999', b'.inf', b'-.inf', b'.nan', b'nan', b'inf'),
    *(b'9' * 40, b'9' * 400, b'1' + b'0' * 5000, b'0x10', b'0o7', b'1_000', b'+.5', b'1e'),
)
_OTHERS = (
    *(b'', b'~', b'true', b'off', b'[]', b'{}', b'""', b'[[]]', b'[1, 2, 3]', b'{a: 1}', b'left'),
    *(b'"\\0"', b'"\\n"', b"'", b'"', b'&a', b'*a', b'!!python/none', b'!!binary x', b'!!set {a}'),
    *(b'|', b'- 1', b'? x', b'ground', b'../../x', b'/dev/zero', b'x' * 3000, b'2001-01-01', b'%'),
    *('é'.encode(), '\u202e'.encode(), b'\x1b[31m', b'\xff\xfe', b'<<: {a: 1}', b'os.system'),
)
_BYTES = (
    *(b'\0', b'\xff', b'\xc3', b'\t', b'\r', b'\x7f', b'\x85', b'\x1b', b'\n'),
    '\u2028'.encode(),
)


def mutated(data: bytes, rng: random.Random) -> tuple[str, bytes]:
    """Return a description of the changes, and a file with one or a few of them."""
    changes = []
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        change = rng.choice(_CHANGES)
        changes.append(change.__name__.strip('_'))
        data = change(data, rng)
    return ', '.join(changes), data


def _number(data: bytes, rng: random.Random) -> bytes:
    return _replaced(_NUMBER, data, rng, rng.choice(_NUMBERS))


def _near_number(data: bytes, rng: random.Random) -> bytes:
    """Replace a number by another number of the file, or by one near it."""
    numbers = _NUMBER.findall(data) or [b'0']
    value = float(rng.choice(numbers))
    near = rng.choice((value, -value, value * (1.0 + 2e-16), value + 1e-9, value * 1e-6, 0.0))
    return _replaced(_NUMBER, data, rng, repr(near).encode())


def _value(data: bytes, rng: random.Random) -> bytes:
    return _replaced(_VALUE, data, rng, rng.choice(_OTHERS))


def _list(data: bytes, rng: random.Random) -> bytes:
    return _replaced(_LIST, data, rng, rng.choice((*_OTHERS, *_NUMBERS)))


def _name(data: bytes, rng: random.Random) -> bytes:
    """Replace a name by another name of the file, or by something else."""
    names = _NAME.findall(data) or [b'x']
    return _replaced(_NAME, data, rng, rng.choice((*rng.sample(names, 1), *_OTHERS)))


def _line(data: bytes, rng: random.Random) -> bytes:
    """Remove, double, move or indent a line."""
    lines = data.splitlines(keepends=True) or [b'']
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(4):
        case 0:
            del lines[i]
        case 1:
            lines.insert(i, lines[i])
        case 2:
            lines.insert(j, lines.pop(i))
        case _:
            lines[i] = b' ' * rng.choice((1, 2, 7)) + lines[i]
    return b''.join(lines)


def _bytes(data: bytes, rng: random.Random) -> bytes:
    """Flip a bit, or insert something."""
    place = rng.randrange(len(data) + 1)
    if rng.random() < 0.5 and place < len(data):
        flipped = bytearray(data)
        flipped[place] ^= 1 << rng.randrange(8)
        return bytes(flipped)
    return data[:place] + rng.choice((*_BYTES, *_OTHERS)) + data[place:]


def _whole(data: bytes, rng: random.Random) -> bytes:
    """Change the whole file: truncate, repeat or encode it."""
    match rng.randrange(7):
        case 0:
            return data[: rng.randrange(len(data) + 1)]
        case 1:
            return b'\xef\xbb\xbf' + data
        case 2:
            return data.replace(b'\n', b'\r\n')
        case 3:
            return data.decode(errors='replace').encode('utf-16')
        case 4:
            return data + data
        case 5:
            return rng.randbytes(200)
        case _:
            return data.replace(b' ', b'\t')


_CHANGES: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    *(_number, _number, _number, _near_number, _near_number, _value, _list, _name, _name),
    *(_line, _bytes, _whole),
)


def _replaced(pattern: re.Pattern[bytes], data: bytes, rng: random.Random, by: bytes) -> bytes:
    places = [match.span() for match in pattern.finditer(data)]
    if not places:
        return data
    start, end = rng.choice(places)
    return data[:start] + by + data[end:]


_SECONDS = 60.0
"""Time limit of a command, in [s]; on a shared processor the slowest takes seconds."""

_NODE = {
    'ROS_AUTOMATIC_DISCOVERY_RANGE': 'OFF',
    'RCUTILS_CONSOLE_OUTPUT_FORMAT': '{severity} {message}',
    'RCUTILS_COLORIZED_OUTPUT': '0',
}

_FILE = 'scenes/x.yaml'
COMMANDS = {
    'check': [_FILE],
    'solve': [_FILE, '--steps', '8', '--rate', '1', '--points'],
    'view': [_FILE, '-o', 'x.html'],
    'draw': [_FILE, '-o', 'x.svg'],
    'animate': [_FILE, '-o', 'x.gif', '--seconds', '0.2'],
    'compile': [_FILE, '-o', 'x.c'],
    'urdf': [_FILE],
    'mjcf': [_FILE],
    'fmu': [_FILE, '-o', 'x.fmu'],
    'scene': [_FILE],
    'simulate': [_FILE, '--seconds', '0.05', '-o', 'x.csv'],
    'accuracy': [_FILE, '--quick', '--only', 'effects', '-o', 'x.html'],
    'replay': ['bag', '--scene', _FILE],
    'run': [_FILE, '--plain', '--seconds', '0.1', '--runs', 'runs'],
    'relay': [_FILE, '--joint', 'rocker_joint', '--seconds', '0.1'],
}
"""Arguments of each command."""

_SCENE = (
    'view', 'fmu', 'scene', 'simulate', 'urdf', 'mjcf', 'accuracy', 'replay', 'run',
    'relay',
)  # fmt: skip
_TABLES = {
    'pairs': b'crank,rocker\n0,0\n30,17\n60,38\n',
    'path': b'0.1;0.2\n0.15;0.25\n0.2;0.2\n0.15;0.1\n0.12;0.1\n',
}


def tries(seed: int, numbers: range) -> Iterator[Try]:
    """Run commands on changed files."""
    with warnings.catch_warnings(), confined() as folder:
        warnings.simplefilter('default')
        originals = _originals(folder)
        for number in numbers:
            outcome, fault = _try(originals, f'{seed} {number}')
            yield outcome, fault and f'file {seed} {number}: {fault}'


def _originals(folder: Path) -> dict[str, dict[str, bytes]]:
    """Return unchanged files by kind and name, and link the linkages beside the scenes."""
    linkages = shipped_path('linkages/four_bar.yaml').parent
    (folder / 'linkages').symlink_to(linkages)
    (folder / 'scenes').mkdir()
    originals: dict[str, dict[str, bytes]] = {
        'linkage': {file.name: file.read_bytes() for file in sorted(linkages.glob('*.yaml'))},
        'scene': {
            file.name: file.read_bytes()
            for file in sorted(shipped_path('scenes/demo.yaml').parent.glob('*.yaml'))
        },
        'urdf': {},
        'table': _TABLES,
    }
    for name in ('four_bar', 'slider_crank', 'watt_1'):
        in_process(['urdf', f'linkages/{name}.yaml', '-o', f'{name}.urdf'], _SECONDS)
        originals['urdf'][name] = Path(f'{name}.urdf').read_bytes()
    _record(originals['linkage'])
    return originals


def _record(linkages: Mapping[str, bytes]) -> None:
    """Record samples of the inputs of all linkages, for `linkage replay` with a changed scene."""
    inputs = {
        driven.joint: None
        for name, content in linkages.items()
        for driven in read_linkage(parse_yaml(content, name)).inputs
    }
    write = JointStateWriter([*inputs]).write
    topic = Topic('/crank_states', JOINT_STATE, 'text', 'RIHS01_' + '0a' * 32)
    stamps = [START + 1_000_000 * index for index in range(20)]
    rates = [10.0] * len(inputs)
    samples = [write(stamp, [0.01 * i] * len(inputs), rates) for i, stamp in enumerate(stamps)]
    messages = [(0, stamp, stamp, data) for stamp, data in zip(stamps, samples, strict=True)]
    by_linkage_ros(Path('bag'), [topic], {}, messages)


def _try(originals: dict[str, dict[str, bytes]], seed: str) -> tuple[str, str]:
    """Try a file; return the command with its end, and the violation."""
    rng = random.Random(seed)
    kind = rng.choice(('linkage', 'linkage', 'linkage', 'scene', 'scene', 'urdf', 'table'))
    name = rng.choice(sorted(originals[kind]))
    changes, data = mutated(originals[kind][name], rng)
    Path(_FILE).write_bytes(data)
    match kind:
        case 'linkage' | 'scene':
            command = rng.choice(sorted(COMMANDS) if kind == 'linkage' else _SCENE)
            arguments = [command, *COMMANDS[command]]
        case 'urdf':
            command, arguments = 'import', ['import', _FILE]
        case _:
            command, arguments = 'synthesize', ['synthesize', f'--{name}', _FILE]
            arguments += ['--candidates', '200']
    if command in ('run', 'relay'):
        ended = in_own_process(arguments, _SECONDS, **_NODE)
        # Leave out the log lines of the node.
        lines = [line for line in ended.stderr.splitlines() if line[:4] not in ('INFO', 'WARN')]
        ended = Ended(ended.code, '\n'.join(lines))
    else:
        ended = in_process(arguments, _SECONDS)
    for folder in ('page', 'runs'):
        rmtree(folder, ignore_errors=True)
    fault = fault_of(ended, manners(command))
    outcome = f'{command}: {ended.code}'
    return outcome, fault and f'{name}: {changes}: {" ".join(arguments)}: {fault}'


_BESIDE = '^(left out: |accuracy of |pictures: )'
"""Lines beside a result: omissions of an import, progress of a measurement or of an animation."""

_OTHERWISE = {
    # There may be no linkage that meets the task.
    'synthesize': Manners((0, 1, 2), beside=_BESIDE),
    # What cannot be compared is told beside the result.
    'replay': Manners(beside=_BESIDE, with_result='^linkage replay: '),
}


def manners(command: str) -> Manners:
    """Return how a command has to end."""
    return _OTHERWISE.get(command, Manners(beside=_BESIDE))
