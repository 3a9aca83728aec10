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
JointState messages as bytes (CDR): some joints read out of them, and a whole message written.

A message taken as bytes and read here costs a tenth of one that is built as an object; and the
same bytes go to the recorder. Encoding: CDR version 1 (encapsulation 00 00 or 00 01), of
``sensor_msgs/msg/JointState``: stamp, frame_id, name[], position[], velocity[], effort[].
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from enum import Enum
from operator import itemgetter
from struct import error as StructError
from struct import Struct
from typing import Any, NamedTuple

from linkage_ros.cdr import aligned, ENCAPSULATION, head_of_joints, STAMP_END
from linkage_ros.written import Lines

NANOSECONDS = 1_000_000_000


class Rejection(Enum):
    """Why a crank message was not used."""

    MALFORMED = 'malformed message'
    EMPTY = 'no joints or no positions'
    UNEQUAL = 'arrays of unequal length'
    MISSING = 'crank joint missing'
    TWICE = 'crank joint named twice'
    NO_RATE = 'no velocities'
    NOT_FINITE = 'position or rate not finite'
    TOO_LARGE = 'position or rate beyond 1e10'
    NO_EFFORT = 'no efforts'
    EFFORT_NOT_FINITE = 'effort not finite'
    EFFORT_TOO_LARGE = 'effort beyond 1e10'
    STAMP_ZERO = 'stamp zero'
    STAMP_INVALID = 'stamp negative or with 1e9 ns or more'
    STAMP_FUTURE = 'stamp in the future'
    STAMP_OLD = 'stamp older than the last'


class CrankSample(NamedTuple):
    """
    The crank as a message tells it: all inputs, in the order of the linkage.

    Attributes
    ----------
    stamp
        Time of the measurement, in [ns].
    angles
        Angle of each input joint, in [rad]; of one that slides its position, in [m].
    rates
        Their rates, in [rad/s] or [m/s]; None where the message has no velocities.

    """

    stamp: int
    angles: tuple[float, ...]
    rates: tuple[float, ...] | None


_Pick = Callable[[tuple[Any, ...]], tuple[Any, ...]]


class _Layout(NamedTuple):
    """Where things stand in a message; two messages of one publisher have the same layout."""

    size: int
    fields: Struct
    """Encapsulation, stamp, all up to the first position, positions, count, rates, count."""
    pick_fixed: _Pick
    fixed: tuple[bytes, bytes, int, int]
    """Encapsulation, all from the frame_id up to the first position, and two counts."""
    pick_positions: _Pick
    pick_rates: _Pick | None


class JointStateReader:
    """
    Reads some joints out of serialized messages.

    Parameters
    ----------
    joints
        Names of the joints, one or more. In a message they may stand in any order, among others.

    """

    __slots__ = ('_joints', '_layout')

    def __init__(self, joints: Sequence[str]) -> None:
        self._joints = tuple(joint.encode() for joint in joints)
        self._layout: _Layout | None = None

    def read(self, data: bytes) -> CrankSample | Rejection:
        """Return the sample of the joints, in the order of their names, or why there is none."""
        layout = self._layout
        if layout is not None:
            size, fields, pick_fixed, fixed, pick_positions, pick_rates = layout
            if len(data) >= size:
                values = fields.unpack_from(data)
                if pick_fixed(values) == fixed:
                    seconds = values[1]
                    nanoseconds = values[2]
                    if seconds < 0 or nanoseconds >= NANOSECONDS:
                        return Rejection.STAMP_INVALID
                    rates = pick_rates(values) if pick_rates else None
                    stamp = seconds * NANOSECONDS + nanoseconds
                    return CrankSample(stamp, pick_positions(values), rates)
        found = _find(data, self._joints)
        if isinstance(found, Rejection):
            return found
        self._layout = found
        return self.read(data)


def arrays_of(data: bytes) -> tuple[str, list[bytes], list[tuple[int, int, int]]] | Rejection:
    """
    Return byte order, names, and where the arrays of numbers stand.

    Of each array: where its count stands, the count, and where its first number stands.
    """
    order = {b'\x00\x00': '>', b'\x00\x01': '<'}.get(data[:2])
    if order is None:
        return Rejection.MALFORMED
    count = Struct(f'{order}I')
    try:
        at = 12 + 4 + count.unpack_from(data, 12)[0]
        at = aligned(at, 4)
        n_names = count.unpack_from(data, at)[0]
        at += 4
        names = []
        # A name takes five bytes or more: no count makes this loop longer than the message.
        for _ in range(min(n_names, len(data))):
            at = aligned(at, 4)
            length = count.unpack_from(data, at)[0]
            name_start, at = at + 4, at + 4 + length
            name_end = at - 1
            names.append(data[name_start:name_end])
        arrays = []
        for _ in range(3):
            at = aligned(at, 4)
            n = count.unpack_from(data, at)[0]
            first = aligned(at + 4, 8) if n else at + 4
            arrays.append((at, n, first))
            at = first + 8 * n
    except StructError:
        return Rejection.MALFORMED
    if at > len(data):
        return Rejection.MALFORMED
    return order, names, arrays


def _find(data: bytes, joints: Sequence[bytes]) -> _Layout | Rejection:
    found = arrays_of(data)
    if isinstance(found, Rejection):
        return found
    order, names, arrays = found
    n_names, (_, n_efforts, after_all) = len(names), arrays[2]
    at = after_all + 8 * n_efforts
    (_, n_positions, positions), (rate_at, n_rates, rates), (effort_at, _, _) = arrays
    if not n_names or not n_positions:
        return Rejection.EMPTY
    if n_positions != n_names or n_rates not in (0, n_names) or n_efforts not in (0, n_names):
        return Rejection.UNEQUAL
    for joint in joints:
        if names.count(joint) != 1:
            return Rejection.TWICE if joint in names else Rejection.MISSING

    # Fields stand in the order of the message, and are picked in that of the joints.
    places = sorted(map(names.index, joints))
    fields = f'{order}2s2xiI{positions - 12}s'
    after = positions
    for first, n, following in ((positions, n_positions, rate_at), (rates, n_rates, effort_at)):
        for place in places if n else ():
            fields += f'{first + 8 * place - after}xd'
            after = first + 8 * place + 8
        fields += f'{following - after}xI'
        after = following + 4
    ranks = [places.index(names.index(joint)) for joint in joints]
    rate_count = 4 + len(joints)
    return _Layout(
        size=at,
        fields=Struct(fields),
        pick_fixed=itemgetter(0, 3, rate_count, -1),
        fixed=(data[:2], data[12:positions], n_rates, n_efforts),
        pick_positions=_pick(4 + rank for rank in ranks),
        pick_rates=_pick(rate_count + 1 + rank for rank in ranks) if n_rates else None,
    )


def _pick(places: Iterable[int]) -> _Pick:
    """Return what takes some values out of a tuple, as a tuple, in one call of C."""
    first, *others = places
    return itemgetter(first, *others) if others else itemgetter(slice(first, first + 1))


class JointStateWriter:
    """
    Writes messages for the same joints again and again.

    Parameters
    ----------
    names
        The joints, in the order in which they are published.

    """

    __slots__ = ('_between', '_end', '_head', '_layouts', '_no_rates')

    def __init__(self, names: Sequence[str]) -> None:
        n = len(names)
        self._head = head = head_of_joints(names, n)
        # After n doubles the offset is a multiple of 8: the next count, then four bytes of
        # padding, unless nothing follows.
        self._between = Struct('<II').pack(n, 0)
        self._no_rates = Struct('<II').pack(0, n)  # the counts of rates and efforts
        self._end = bytes(8)
        numbers = f'<4siI{len(head)}s{n}d'
        self._layouts = (
            Struct(f'{numbers}8s'),
            Struct(f'{numbers}8s{n}d4s'),
            Struct(f'{numbers}8s{n}d'),
            Struct(f'{numbers}8s{n}d8s{n}d'),
        )

    def write(
        self,
        stamp: int,
        positions: Sequence[float],
        rates: Sequence[float],
        efforts: Sequence[float] = (),
    ) -> bytes:
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
        efforts
            One for each joint, in [N·m] or [N], or none.

        """
        seconds, nanoseconds = divmod(stamp, NANOSECONDS)
        alone, with_rates, with_efforts, with_both = self._layouts
        # A field shorter than what is packed into it takes as much as it holds.
        if efforts:
            begin = (ENCAPSULATION, seconds, nanoseconds, self._head, *positions)
            if rates:
                return with_both.pack(*begin, self._between, *rates, self._between, *efforts)
            return with_efforts.pack(*begin, self._no_rates, *efforts)
        if rates:
            return with_rates.pack(
                ENCAPSULATION, seconds, nanoseconds, self._head,
                *positions, self._between, *rates, self._end,
            )  # fmt: skip
        return alone.pack(ENCAPSULATION, seconds, nanoseconds, self._head, *positions, self._end)

    def straight(
        self, stamp: str, positions: Sequence[str], rates: Sequence[str], efforts: Sequence[str]
    ) -> Lines:
        """Return `write` as lines that make ``message`` of expressions; they are short."""
        alone, with_rates, with_efforts, with_both = self._layouts
        numbers = [*positions, *(('between', *rates) if rates else ())]
        if efforts:
            layout = with_both if rates else with_efforts
            numbers += ['between' if rates else repr(self._no_rates), *efforts]
        else:
            layout = with_rates if rates else alone
            numbers.append(repr(self._end))
        packed = f'{ENCAPSULATION!r}, seconds, nanoseconds, head, {", ".join(numbers)}'
        lines = [
            f'seconds, nanoseconds = divmod({stamp}, {NANOSECONDS})',
            f'message = pack({packed})',
        ]
        return Lines(lines, {'pack': layout.pack, 'head': self._head, 'between': self._between})


class OwnJointStates:
    """
    Tells the joint states of a scene from other messages on their topic, by their joints.

    Parameters
    ----------
    linkages
        The published joints of each linkage, in their order. Of several linkages any may be left
        out of a message: those that are open.

    """

    __slots__ = ('_all', '_linkages')

    def __init__(self, linkages: Iterable[Sequence[str]]) -> None:
        linkages = tuple(linkages)
        joints = [joint for linkage in linkages for joint in linkage]
        self._all = head_of_joints(joints, len(joints))
        self._linkages = [(len(linkage), _names(linkage)) for linkage in linkages]

    def __call__(self, message: bytes) -> bool:
        """Return whether a serialized message is one of them."""
        if message.startswith(self._all, STAMP_END):
            return True
        at = _FIRST_NAME
        counted = message[_COUNT_AT:at]
        if not message.startswith(_NO_FRAME, STAMP_END) or len(counted) < _COUNT.size:
            return False
        (count,) = _COUNT.unpack(counted)
        left = count
        for joints, names in self._linkages:
            if joints <= left and message.startswith(names, at):
                at += len(names)
                left -= joints
        return count > left == 0 and message.startswith(counted, at)


_COUNT = Struct('<I')

_NO_FRAME = head_of_joints(())[:8]
"""What stands behind the stamp and before the count of the names: an empty frame_id."""

_COUNT_AT = STAMP_END + len(_NO_FRAME)
_FIRST_NAME = _COUNT_AT + _COUNT.size


def _names(joints: Sequence[str]) -> bytes:
    """Return the names as they stand in a message, up to what follows them."""
    texts = [joint.encode() + b'\0' for joint in joints]
    return b''.join(_COUNT.pack(len(text)) + text + bytes(-len(text) % 4) for text in texts)


def head_of(data: bytes) -> tuple[set[bytes], int] | None:
    """Return the names in a message and where they end; nothing of a malformed one."""
    found = arrays_of(data)
    if isinstance(found, Rejection):
        return None
    _, names, arrays = found
    return set(names), arrays[0][0]


def with_every_number(data: bytes, value: float) -> bytes:
    """Return a message with every position, rate and effort replaced; a malformed one as it is."""
    found = arrays_of(data)
    if isinstance(found, Rejection):
        return data
    order, _, arrays = found
    spoilt = bytearray(data)
    for _, n, first in arrays:
        Struct(f'{order}{n}d').pack_into(spoilt, first, *(value,) * n)
    return bytes(spoilt)
