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
JointState messages as bytes (CDR): one joint read out of them, and a whole message written.

A message taken as bytes and read here costs a tenth of one that is built as an object; and the
same bytes go to the recorder. Encoding: CDR version 1 (encapsulation 00 00 or 00 01), of
``sensor_msgs/msg/JointState``: stamp, frame_id, name[], position[], velocity[], effort[].
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from struct import error as StructError
from struct import Struct
from typing import NamedTuple

from linkage_ros.tuples import new

NANOSECONDS = 1_000_000_000


class Rejection(Enum):
    """Why a crank message was not used."""

    MALFORMED = 'malformed message'
    EMPTY = 'no joints or no positions'
    UNEQUAL = 'arrays of unequal length'
    MISSING = 'crank joint missing'
    TWICE = 'crank joint named twice'
    NO_RATE = 'no velocities'
    NOT_FINITE = 'angle or rate not finite'
    TOO_LARGE = 'angle or rate beyond 1e10 rad, rad/s'
    STAMP_ZERO = 'stamp zero'
    STAMP_INVALID = 'stamp negative or with 1e9 ns or more'
    STAMP_FUTURE = 'stamp in the future'
    STAMP_OLD = 'stamp older than the last'


class CrankSample(NamedTuple):
    """
    The crank as a message tells it.

    Attributes
    ----------
    stamp
        Time of the measurement, in [ns].
    angle
        Angle of the input joint, in [rad].
    rate
        Its rate, in [rad/s]; None where the message has no velocities.

    """

    stamp: int
    angle: float
    rate: float | None


class _Layout(NamedTuple):
    """Where things stand in a message; two messages of one publisher have the same layout."""

    fields: Struct
    fixed: tuple[bytes, bytes, int, int]
    """Encapsulation, all from the frame_id up to the first position, and two counts."""
    size: int


class JointStateReader:
    """
    Reads one joint out of serialized messages.

    Parameters
    ----------
    joint
        Name of the joint.

    """

    __slots__ = ('_joint', '_layout')

    def __init__(self, joint: str) -> None:
        self._joint = joint.encode()
        self._layout: _Layout | None = None

    def read(self, data: bytes) -> CrankSample | Rejection:
        """Return the joint's sample, or why there is none."""
        layout = self._layout
        if layout is not None and len(data) >= layout.size:
            kind, seconds, nanoseconds, head, angle, rates, *rate, efforts = (
                layout.fields.unpack_from(data)
            )
            if (kind, head, rates, efforts) == layout.fixed:
                if seconds < 0 or nanoseconds >= NANOSECONDS:
                    return Rejection.STAMP_INVALID
                stamp = seconds * NANOSECONDS + nanoseconds
                return new(CrankSample, (stamp, angle, rate[0] if rate else None))
        found = _find(data, self._joint)
        if isinstance(found, Rejection):
            return found
        self._layout = found
        return self.read(data)


def _find(data: bytes, joint: bytes) -> _Layout | Rejection:
    order = {b'\x00\x00': '>', b'\x00\x01': '<'}.get(data[:2])
    if order is None:
        return Rejection.MALFORMED
    count = Struct(f'{order}I')
    try:
        at = 12 + 4 + count.unpack_from(data, 12)[0]
        at = _aligned(at, 4)
        n_names = count.unpack_from(data, at)[0]
        at += 4
        names = []
        # A name takes five bytes or more: no count makes this loop longer than the message.
        for _ in range(min(n_names, len(data))):
            at = _aligned(at, 4)
            length = count.unpack_from(data, at)[0]
            name_start, at = at + 4, at + 4 + length
            name_end = at - 1
            names.append(data[name_start:name_end])
        arrays = []
        for _ in range(3):
            at = _aligned(at, 4)
            n = count.unpack_from(data, at)[0]
            first = _aligned(at + 4, 8) if n else at + 4
            arrays.append((at, n, first))
            at = first + 8 * n
    except StructError:
        return Rejection.MALFORMED
    if at > len(data):
        return Rejection.MALFORMED
    (_, n_positions, positions), (rate_at, n_rates, rates), (effort_at, n_efforts, _) = arrays
    if not n_names or not n_positions:
        return Rejection.EMPTY
    if n_positions != n_names or n_rates not in (0, n_names) or n_efforts not in (0, n_names):
        return Rejection.UNEQUAL
    if names.count(joint) != 1:
        return Rejection.TWICE if joint in names else Rejection.MISSING
    skip = 8 * names.index(joint)
    angle = positions + skip
    layout = f'{order}2s2xiI{positions - 12}s{skip}xd{rate_at - angle - 8}xI'
    after = rate_at + 4
    if n_rates:
        layout += f'{rates + skip - after}xd'
        after = rates + skip + 8
    return _Layout(
        Struct(f'{layout}{effort_at - after}xI'),
        (data[:2], data[12:positions], n_rates, n_efforts),
        at,
    )


class JointStateWriter:
    """
    Writes messages for the same joints again and again.

    Parameters
    ----------
    names
        The joints, in the order in which they are published.

    """

    __slots__ = ('_join', '_middle', '_positions_only', '_tail', '_with_rates', 'names')

    names: bytes
    """What its messages have from byte 12 up to the first position: names and counts."""

    def __init__(self, names: Sequence[str]) -> None:
        n = len(names)
        head = bytearray(Struct('<II').pack(1, 0)[:5])  # an empty frame_id
        head += bytes(_aligned(12 + len(head), 4) - 12 - len(head)) + Struct('<I').pack(n)
        for name in names:
            text = name.encode() + b'\0'
            head += bytes(_aligned(len(head), 4) - len(head))
            head += Struct('<I').pack(len(text)) + text
        head += bytes(_aligned(len(head), 4) - len(head)) + Struct('<I').pack(n)
        head += bytes(_aligned(12 + len(head), 8) - 12 - len(head))
        # After n doubles the offset is a multiple of 8: the next count, then four bytes of
        # padding.
        self.names = bytes(head)
        self._join = Struct('<II').pack(n, 0)
        self._tail = Struct('<I').pack(0)
        self._middle = Struct('<II').pack(0, 0)
        self._positions_only = Struct(f'<4siI{len(head)}s{n}d8s')
        self._with_rates = Struct(f'<4siI{len(head)}s{n}d8s{n}d4s')

    def write(self, stamp: int, positions: Sequence[float], rates: Sequence[float]) -> bytes:
        """
        Return a message.

        Parameters
        ----------
        stamp
            Time of the state, in [ns].
        positions
            One for each joint, in [rad] or [m].
        rates
            One for each joint, in [rad/s] or [m/s], or none: then the array is left empty.

        """
        seconds, nanoseconds = divmod(stamp, NANOSECONDS)
        if rates:
            return self._with_rates.pack(
                b'\x00\x01\x00\x00', seconds, nanoseconds, self.names,
                *positions, self._join, *rates, self._tail,
            )  # fmt: skip
        return self._positions_only.pack(
            b'\x00\x01\x00\x00', seconds, nanoseconds, self.names, *positions, self._middle
        )


def _aligned(offset: int, size: int) -> int:
    """Return the next place for a value of ``size`` bytes; alignment counts from byte 4."""
    return offset + (4 - offset) % size
