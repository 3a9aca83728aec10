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
CDR version 1, as far as messages about joints need it.

Numbers stand at multiples of their size, counted from behind the four bytes of the encapsulation;
an array or a text is a count and what it holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct

ENCAPSULATION = b'\x00\x01\x00\x00'
"""What begins a message that is written here: little-endian, no options."""

_COUNT = Struct('<I')

STAMP_END = 12
"""Where a stamp ends that begins a message: two numbers of four bytes."""


def aligned(offset: int, size: int) -> int:
    """Return the next place for a value of ``size`` bytes; alignment counts from byte 4."""
    return offset + (4 - offset) % size


def head_of_joints(names: Sequence[str], *counts: int) -> bytes:
    """
    Return what a message about joints has from the end of its stamp up to its first number.

    Parameters
    ----------
    names
        The joints; they stand behind an empty frame_id.
    counts
        The counts behind them, of which the last is that of the numbers, of eight bytes each.

    """
    head = bytearray(STAMP_END)

    def add(number: int, text: bytes = b'') -> None:
        head.extend(bytes(aligned(len(head), 4) - len(head)) + _COUNT.pack(number) + text)

    add(1, b'\0')  # an empty frame_id
    add(len(names))
    for name in names:
        text = name.encode() + b'\0'
        add(len(text), text)
    for count in counts:
        add(count)
    return bytes(head[STAMP_END:]) + bytes(aligned(len(head), 8) - len(head))


_TIME = Struct('<4siI')


TIME_END = 2**31 * 1_000_000_000
"""No stamp of a message is as late as this, in [ns]."""


def time_message(time: int) -> bytes:
    """Return a ``builtin_interfaces/msg/Time``, of a time in [ns]."""
    return _TIME.pack(ENCAPSULATION, *divmod(time, 1_000_000_000))


def text_message(text: str) -> bytes:
    """Return a ``std_msgs/msg/String``."""
    data = text.encode() + b'\0'
    return ENCAPSULATION + _COUNT.pack(len(data)) + data


def text_of(message: bytes) -> str:
    """
    Return the text of a ``std_msgs/msg/String`` as `text_message` writes it.

    Raises
    ------
    ValueError
        Where it is not one.

    """
    if message[:4] != ENCAPSULATION or len(message) < 9:
        raise ValueError('not a text')
    end = 7 + int.from_bytes(message[4:8], 'little')
    return message[8:end].decode()
