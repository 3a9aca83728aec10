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
The numbers of messages about joints, each under what it tells: CDR of three types, of any joints.

A message is parsed where its layout differs from the last one's only; else it is unpacked at known
places in one call. ``sensor_msgs/msg/JointState`` is read as it is. A message of
``trajectory_msgs/msg/JointTrajectory`` is read where it has one point, as ``~/motion`` has: the
state at an instant. One of ``sensor_msgs/msg/MultiDOFJointState`` is where it has wrenches alone,
as ``~/pin_forces``; of these what acts in the plane: forces in x and y, moment about z.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import partial
from operator import itemgetter
from struct import error as StructError
from struct import Struct
from typing import Any, NamedTuple

from linkage_ros.cdr import aligned, STAMP_END
from linkage_ros.joint_state import arrays_of, NANOSECONDS, Rejection

JOINT_STATE = 'sensor_msgs/msg/JointState'
TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
WRENCHES = 'sensor_msgs/msg/MultiDOFJointState'

POSITION, RATE, ACCELERATION, EFFORT = 'position', 'rate', 'acceleration', 'effort'
FORCE_X, FORCE_Y, TORQUE = 'force x', 'force y', 'torque'
QUANTITIES = (POSITION, RATE, ACCELERATION, EFFORT, FORCE_X, FORCE_Y, TORQUE)

UNITS = {
    POSITION: ('rad', 'm'),
    RATE: ('rad/s', 'm/s'),
    ACCELERATION: ('rad/s²', 'm/s²'),
    EFFORT: ('N·m', 'N'),
    FORCE_X: ('N', 'N'),
    FORCE_Y: ('N', 'N'),
    TORQUE: ('N·m', 'N·m'),
}
"""Of each quantity the unit where the joint turns, and where it slides."""

MALFORMED = Rejection.MALFORMED.value
UNEQUAL = Rejection.UNEQUAL.value
TWICE = 'a joint named twice'
POINTS = 'not one point'
POSES = 'transforms or twists'
NO_JOINTS = 'not about joints'

Key = tuple[str, str]
"""A joint's name, and the quantity."""


class Values(NamedTuple):
    """
    What a message tells.

    Attributes
    ----------
    stamp
        In [ns].
    keys
        What the numbers are; the same object as long as the layout is the same.
    names
        The joints, in the order of the message; the same object as `keys` is.
    numbers
        In [rad], [m], [N·m] or [N], and per second.

    """

    stamp: int
    keys: tuple[Key, ...]
    names: tuple[str, ...]
    numbers: tuple[float, ...]


class _Array(NamedTuple):
    """
    An array of numbers in a message.

    Attributes
    ----------
    count_at
        Where its count stands.
    first
        Where its first number stands.
    keys
        What each number is; nothing for one that is passed over.

    """

    count_at: int
    first: int
    keys: Sequence[Key | None]


class _Layout(NamedTuple):
    """Where things stand in a message; two messages of one publisher have the same layout."""

    size: int
    fields: Struct
    """Encapsulation, stamp, and in turn what is the same in each message, and numbers."""
    pick_fixed: Callable[[tuple[Any, ...]], tuple[Any, ...]]
    fixed: tuple[Any, ...]
    pick_numbers: Callable[[tuple[Any, ...]], tuple[float, ...]]
    keys: tuple[Key, ...]
    names: tuple[str, ...]


class MessageValues:
    """
    Reads the numbers of messages of one topic.

    Parameters
    ----------
    message_type
        One of `JOINT_STATE`, `TRAJECTORY` and `WRENCHES`; messages of others tell nothing.
    dependent
        Names of joints that nobody can command. A JointState may name them without a number, as
        `JointEffortReader` takes it.

    """

    __slots__ = ('_layout', '_parse')

    def __init__(self, message_type: str, dependent: Collection[str] = ()) -> None:
        self._parse = _PARSERS.get(message_type, _others)
        if message_type == JOINT_STATE:
            self._parse = partial(_joint_state, dependent=dependent)
        self._layout: _Layout | None = None

    def read(self, data: bytes) -> Values | str:
        """Return what a message tells, or why it is left out."""
        layout = self._layout
        if layout is None or len(data) != layout.size:
            return self._read_anew(data)
        values = layout.fields.unpack(data)
        if layout.pick_fixed(values) != layout.fixed:
            return self._read_anew(data)
        return _values(layout, values)

    def _read_anew(self, data: bytes) -> Values | str:
        try:
            found = self._parse(data)
            layout = found if isinstance(found, str) else _layout(data, *found)
        except StructError:
            return MALFORMED
        if isinstance(layout, str):
            return layout
        self._layout = layout
        return _values(layout, layout.fields.unpack(data))


def _values(layout: _Layout, values: tuple[Any, ...]) -> Values:
    stamp = values[1] * NANOSECONDS + values[2]
    return Values(stamp, layout.keys, layout.names, layout.pick_numbers(values))


_Parsed = tuple[str, list[str], list[_Array]]
"""Byte order, names and arrays."""


def _layout(data: bytes, order: str, names: list[str], arrays: Sequence[_Array]) -> _Layout | str:
    if len(set(names)) != len(names):
        return TWICE
    fields, at, place = f'{order}2s2xiI', STAMP_END, 3
    fixed, places, keys = [0], [], []
    for count_at, first, told in arrays:
        # Between a count and the first number there may be padding, in which anything may stand.
        counted = count_at + 4
        fields += f'{counted - at}s{first - counted}x'
        fixed.append(place)
        place += 1
        for key in told:
            fields += 'd'
            if key is not None:
                keys.append(key)
                places.append(place)
            place += 1
        at = first + 8 * len(told)
    fields += f'{len(data) - at}x'
    struct = Struct(fields)
    pick_fixed = _pick(fixed)
    return _Layout(
        size=len(data),
        fields=struct,
        pick_fixed=pick_fixed,
        fixed=pick_fixed(struct.unpack(data)),
        pick_numbers=_pick(places),
        keys=tuple(keys),
        names=tuple(names),
    )


def _pick(places: Sequence[int]) -> Callable[[tuple[Any, ...]], tuple[Any, ...]]:
    """Return what takes some values out of a tuple, as a tuple."""
    if len(places) < 2:
        end = places[0] + 1 if places else 0
        return itemgetter(slice(places[0] if places else 0, end))
    return itemgetter(*places)


def _joint_state(data: bytes, dependent: Collection[str] = ()) -> _Parsed | str:
    found = arrays_of(data)
    if isinstance(found, Rejection):
        return found.value
    order, encoded, places = found
    names = [_text(name) for name in encoded]
    able = [name for name in names if name not in dependent]
    arrays = []
    for quantity, (count_at, n, first) in zip((POSITION, RATE, EFFORT), places, strict=True):
        told = next((some for some in ((), names, able) if len(some) == n), None)
        if told is None:
            return UNEQUAL
        arrays.append(_Array(count_at, first, [(name, quantity) for name in told]))
    return order, names, arrays


def _trajectory(data: bytes) -> _Parsed | str:
    cursor = _Cursor(data)
    names = cursor.names()
    if cursor.count() != 1:
        return POINTS
    arrays = []
    for quantity in (POSITION, RATE, ACCELERATION, EFFORT):
        count_at, n, first = cursor.numbers(1)
        if n not in (0, len(names)):
            return UNEQUAL
        arrays.append(_Array(count_at, first, [(name, quantity) for name in names] if n else []))
    return cursor.order, names, arrays


def _wrenches(data: bytes) -> _Parsed | str:
    cursor = _Cursor(data)
    names = cursor.names()
    if cursor.count() or cursor.count():
        return POSES
    count_at, n, first = cursor.numbers(6)
    if n not in (0, len(names)):
        return UNEQUAL
    keys: list[Key | None] = []
    for name in names if n else ():
        keys += [(name, FORCE_X), (name, FORCE_Y), None, None, None, (name, TORQUE)]
    return cursor.order, names, [_Array(count_at, first, keys)]


def _others(_: bytes) -> str:
    return NO_JOINTS


_PARSERS: dict[str, Callable[[bytes], _Parsed | str]] = {
    JOINT_STATE: _joint_state,
    TRAJECTORY: _trajectory,
    WRENCHES: _wrenches,
}

TYPES = tuple(_PARSERS)
"""Types of messages that can be read."""


class _Cursor:
    """Goes through a message from its header on; raises struct.error where that ends too early."""

    __slots__ = ('_at', '_count', '_data', 'order')

    def __init__(self, data: bytes) -> None:
        order = {b'\x00\x00': '>', b'\x00\x01': '<'}.get(data[:2])
        if order is None:
            raise StructError
        self.order = order
        self._count = Struct(f'{order}I')
        self._data, self._at = data, STAMP_END
        frame_id = self.count()
        self._at += frame_id

    def count(self) -> int:
        at = aligned(self._at, 4)
        self._at = at + 4
        (count,) = self._count.unpack_from(self._data, at)
        return int(count)

    def names(self) -> list[str]:
        names = []
        # A name takes five bytes or more: no count makes this loop longer than the message.
        for _ in range(min(self.count(), len(self._data))):
            length = self.count()
            start = self._at
            self._at = start + length
            end = self._at - 1
            names.append(_text(self._data[start:end]))
        return names

    def numbers(self, each: int) -> tuple[int, int, int]:
        """Pass over an array of some numbers each; return as `arrays_of` does."""
        n = self.count()
        count_at = self._at - 4
        first = aligned(self._at, 8) if n else self._at
        self._at = first + 8 * each * n
        if self._at > len(self._data):
            raise StructError
        return count_at, n, first


def _text(name: bytes) -> str:
    return name.decode('utf-8', 'backslashreplace')
