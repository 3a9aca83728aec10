# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Read three types of messages about joints, by joint and quantity, and write two of them.

A message is parsed only if its layout differs from the previous one's; otherwise one call unpacks
it. A ``sensor_msgs/msg/JointState`` is read completely. A ``trajectory_msgs/msg/JointTrajectory``
must have one point, as in ``~/motion``: the state at an instant. A
``sensor_msgs/msg/MultiDOFJointState`` must have wrenches only, as in ``~/pin_forces``. These are
the messages of common_interfaces that have fields for accelerations, and for the wrenches of
several joints.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

from linkage_ros.messages import joint_state as declaration
from linkage_ros.messages.joint_state import Rejection
from linkage_ros.messages.layout import (
    ArrayWriter,
    compile_packing,
    compile_pattern,
    MalformedError,
    NANOSECONDS,
    NumberArray,
    pack_message,
    parse_declaration,
    parse_message,
    Pattern,
)

JOINT_STATE_TYPE = 'sensor_msgs/msg/JointState'
TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
WRENCHES = 'sensor_msgs/msg/MultiDOFJointState'

POSITION, RATE, ACCELERATION, EFFORT = 'position', 'rate', 'acceleration', 'effort'
FORCE_X, FORCE_Y, TORQUE = 'force x', 'force y', 'torque'
FORCE_Z, TORQUE_X, TORQUE_Y = 'force z', 'torque x', 'torque y'
_WRENCH = (FORCE_X, FORCE_Y, FORCE_Z, TORQUE_X, TORQUE_Y, TORQUE)
QUANTITIES = (POSITION, RATE, ACCELERATION, EFFORT, *_WRENCH)

IN_SPACE = frozenset({FORCE_Z, TORQUE_X, TORQUE_Y})
"""Quantities that are 0 in the joints of a planar linkage."""

UNITS = {
    POSITION: ('rad', 'm'),
    RATE: ('rad/s', 'm/s'),
    ACCELERATION: ('rad/s²', 'm/s²'),
    EFFORT: ('N·m', 'N'),
    **dict.fromkeys(_WRENCH[:3], ('N', 'N')),
    **dict.fromkeys(_WRENCH[3:], ('N·m', 'N·m')),
}
"""Unit of each quantity for a revolute joint, and for a sliding one."""


def unit_in_si(key: Key, turning: Mapping[str, bool]) -> str:
    """
    Return the unit of a quantity of a joint: 'rad or m' where it is not known whether it turns.

    ``turning`` says it of the known joints.
    """
    name, quantity = key
    angular, linear = UNITS[quantity]
    if name in turning:
        return angular if turning[name] else linear
    return angular if angular == linear else f'{angular} or {linear}'


MALFORMED = Rejection.MALFORMED.value
UNEQUAL = Rejection.UNEQUAL.value
TWICE = 'a joint named twice'
POINTS = 'not one point'
POSES = 'transforms or twists'
NO_JOINTS = 'not about joints'

Key = tuple[str, str]
"""A joint's name, and the quantity."""

JOINT_TRAJECTORY = parse_declaration(
    'Time stamp, string frame_id, string[] joint_names, JointTrajectoryPoint[] points',
    JointTrajectoryPoint=parse_declaration(
        'float64[] positions, float64[] velocities, float64[] accelerations, float64[] effort, '
        'Duration time_from_start'
    ),
)

MULTI_DOF_JOINT_STATE = parse_declaration(
    'Time stamp, string frame_id, string[] joint_names, '
    'Transform[] transforms, Twist[] twist, Wrench[] wrench'
)


class MessageContent(NamedTuple):
    """The values in a message."""

    stamp: int  # In [ns]
    # Meaning of each number; the same object as long as the layout is the same.
    keys: tuple[Key, ...]
    names: tuple[str, ...]  # The joints, in the order of the message; likewise the same object
    numbers: tuple[float, ...]  # In [rad], [m], [N·m] or [N], and per second


class MessageValues:
    """
    Reads the numbers in the messages of one topic, whose type is one of `TYPES`.

    Messages of other types have no numbers. A JointState may name the ``dependent`` joints, which
    cannot be commanded, without a number, as in `JointEffortReader`.
    """

    __slots__ = ('_known', '_parse')

    def __init__(self, message_type: str, dependent: Collection[str] = ()) -> None:
        self._parse = _PARSERS.get(message_type, _parse_other)
        if message_type == JOINT_STATE_TYPE:
            self._parse = partial(_parse_joint_state, dependent=dependent)
        self._known: tuple[Pattern, tuple[Key, ...], tuple[str, ...]] | None = None

    def read(self, data: bytes) -> MessageContent | str:
        """Return the values of a message, or the reason why it is skipped."""
        if self._known is not None:
            (size, unpack_from, pick_fixed, fixed, (pick,)), keys, joints = self._known
            if len(data) >= size:
                values = unpack_from(data)
                if pick_fixed(values) == fixed:
                    stamp = values[1] * NANOSECONDS + values[2]
                    return MessageContent(stamp, keys, joints, pick(values))
        try:
            parsed_or_reason = self._parse(data)
        except MalformedError:
            return MALFORMED
        if isinstance(parsed_or_reason, str):
            return parsed_or_reason
        names, columns, width = parsed_or_reason
        if len(set(names)) != len(names):
            return TWICE
        places = {
            (name, quantity): array.first + 8 * (width * index + place)
            for array, listed, quantities in columns
            for index, name in enumerate(listed if array.length else ())
            for place, quantity in quantities
        }
        arrays = [array for array, _, _ in columns]
        known = compile_pattern(data, arrays, [list(places.values())], width)
        self._known = known, tuple(places), tuple(names)
        return self.read(data)


_Column = tuple[NumberArray, Sequence[str], Sequence[tuple[int, str]]]
"""An array, the joints of its elements, and the quantity of each number of an element."""

_Parsed = tuple[Sequence[str], Sequence[_Column], int]
"""All joints, the arrays, and the number of numbers per element."""


def _parse_joint_state(data: bytes, dependent: Collection[str] = ()) -> _Parsed | str:
    fields = parse_message(data, declaration.JOINT_STATE)
    names = _decode_names(fields['name'])
    able = [name for name in names if name not in dependent]
    columns: list[_Column] = []
    for name, quantity in (('position', POSITION), ('velocity', RATE), ('effort', EFFORT)):
        array = fields[name]
        listed = next((some for some in ([], names, able) if len(some) == array.length), None)
        if listed is None:
            return UNEQUAL
        columns.append((array, listed, [(0, quantity)]))
    return names, columns, 1


def _parse_trajectory(data: bytes) -> _Parsed | str:
    fields = parse_message(data, JOINT_TRAJECTORY)
    names = _decode_names(fields['joint_names'])
    if len(fields['points']) != 1:
        return POINTS
    (point,) = fields['points']
    arrays = [point[name] for name in ('positions', 'velocities', 'accelerations', 'effort')]
    if not {array.length for array in arrays} <= {0, len(names)}:
        return UNEQUAL
    quantities = (POSITION, RATE, ACCELERATION, EFFORT)
    columns = zip(arrays, quantities, strict=True)
    return names, [(array, names, [(0, quantity)]) for array, quantity in columns], 1


def _parse_wrenches(data: bytes) -> _Parsed | str:
    fields = parse_message(data, MULTI_DOF_JOINT_STATE)
    names, wrenches = _decode_names(fields['joint_names']), fields['wrench']
    if fields['transforms'].length or fields['twist'].length:
        return POSES
    if wrenches.length not in (0, len(names)):
        return UNEQUAL
    return names, [(wrenches, names, [*enumerate(_WRENCH)])], 6


def _parse_other(_: bytes) -> str:
    return NO_JOINTS


_PARSERS: dict[str, Callable[[bytes], _Parsed | str]] = {
    JOINT_STATE_TYPE: _parse_joint_state,
    TRAJECTORY: _parse_trajectory,
    WRENCHES: _parse_wrenches,
}

TYPES = tuple(_PARSERS)
"""Message types that can be read."""


def _decode_names(names: Sequence[bytes]) -> list[str]:
    return [name.decode('utf-8', 'backslashreplace') for name in names]


class JointTrajectoryWriter(ArrayWriter):
    """
    Writes a JointTrajectory of a single point, the state of the joints at one instant.

    Positions are in [rad] or [m], rates and accelerations per [s] and [s²].
    """

    __slots__ = ()

    def __init__(self, names: Sequence[str]) -> None:
        arrays = {
            'positions': 'positions',
            'rates': 'velocities',
            'accelerations': 'accelerations',
        }
        super().__init__(JOINT_TRAJECTORY, {'joint_names': names}, arrays, 'points')


class JointWrenchWriter:
    """
    Writes a MultiDOFJointState with wrenches only, for a fixed list of joints.

    In the plane a wrench has the force in x and y and the torque about z, in space six numbers.
    """

    __slots__ = ('_constants', '_pack')

    def __init__(self, names: Sequence[str], *, planar: bool) -> None:
        values = {'joint_names': names, 'wrench': [(0.0,) * 6] * len(names)}
        message = pack_message(MULTI_DOF_JOINT_STATE, values)
        wrenches = parse_message(message, MULTI_DOF_JOINT_STATE)['wrench']
        # Force z and torque x, y of a planar wrench are zeros between the changing numbers.
        numbers = 'dd24xd' if planar else '6d'
        self._pack, self._constants = compile_packing(
            message, [(wrenches.first, numbers * len(names))]
        )

    def write(self, stamp: int, wrenches: Iterable[tuple[float, ...]]) -> bytes:
        """
        Return a message with a wrench for each joint, in [N] and [N·m].

        ``stamp`` is the time of the state, in [ns].
        """
        seconds, nanoseconds = divmod(stamp, NANOSECONDS)
        numbers: tuple[float, ...] = ()
        for wrench in wrenches:
            numbers += wrench
        encapsulation, head = self._constants
        return self._pack(encapsulation, seconds, nanoseconds, head, *numbers)
