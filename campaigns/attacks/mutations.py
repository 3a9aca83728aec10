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

"""What is done to a file: its numbers, keys, values, lines and bytes changed at random."""

from __future__ import annotations

from collections.abc import Callable
import random
import re

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
    """Return what was done, in words, and a file that it was done to, once or a few times."""
    done = []
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        change = rng.choice(_CHANGES)
        done.append(change.__name__.strip('_'))
        data = change(data, rng)
    return ', '.join(done), data


def _number(data: bytes, rng: random.Random) -> bytes:
    return _replaced(_NUMBER, data, rng, rng.choice(_NUMBERS))


def _near_number(data: bytes, rng: random.Random) -> bytes:
    """Replace a number by another of the file, or by one that is next to itself."""
    numbers = _NUMBER.findall(data) or [b'0']
    value = float(rng.choice(numbers))
    near = rng.choice((value, -value, value * (1.0 + 2e-16), value + 1e-9, value * 1e-6, 0.0))
    return _replaced(_NUMBER, data, rng, repr(near).encode())


def _value(data: bytes, rng: random.Random) -> bytes:
    return _replaced(_VALUE, data, rng, rng.choice(_OTHERS))


def _list(data: bytes, rng: random.Random) -> bytes:
    return _replaced(_LIST, data, rng, rng.choice((*_OTHERS, *_NUMBERS)))


def _name(data: bytes, rng: random.Random) -> bytes:
    """Replace a name by another of the file, or by something else."""
    names = _NAME.findall(data) or [b'x']
    return _replaced(_NAME, data, rng, rng.choice((*rng.sample(names, 1), *_OTHERS)))


def _line(data: bytes, rng: random.Random) -> bytes:
    """Leave a line out, write it twice, move it, or push it in."""
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
    """Flip a bit, or put something in."""
    place = rng.randrange(len(data) + 1)
    if rng.random() < 0.5 and place < len(data):
        return data[:place] + bytes([data[place] ^ 1 << rng.randrange(8)]) + data[place + 1 :]
    return data[:place] + rng.choice((*_BYTES, *_OTHERS)) + data[place:]


def _whole(data: bytes, rng: random.Random) -> bytes:
    """Do something to all of it: cut it, repeat it, encode it otherwise."""
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
    places = [found.span() for found in pattern.finditer(data)]
    if not places:
        return data
    start, end = rng.choice(places)
    return data[:start] + by + data[end:]
