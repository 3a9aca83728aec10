# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Read some joints, or an effort, from serialized JointState messages, and write whole messages.

Reading a message from its bytes takes a tenth of the time of building the object, and the recorder
gets the same bytes. Encoding: CDR version 1 (encapsulation 00 00 or 00 01) of
``sensor_msgs/msg/JointState``: stamp, frame_id, name[], position[], velocity[], effort[].
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from enum import Enum
from struct import Struct
from typing import Any, NamedTuple

from linkage_ros.generated_code import Lines
from linkage_ros.messages.layout import (
    ArrayWriter,
    byte_order,
    compile_pattern,
    MalformedError,
    NANOSECONDS,
    NumberArray,
    pack_message,
    parse_declaration,
    parse_message,
    Pattern,
    STAMP_END,
)

JOINT_STATE = parse_declaration(
    'Time stamp, string frame_id, string[] name, '
    'float64[] position, float64[] velocity, float64[] effort'
)
"""``sensor_msgs/msg/JointState``."""

_COUNT = Struct('<I')

_NO_FRAME = pack_message(parse_declaration('Time stamp, string frame_id'), {})[STAMP_END:].ljust(
    8, b'\0'
)
"""Bytes between the stamp and the count of the names: an empty frame_id."""

_COUNT_AT = STAMP_END + len(_NO_FRAME)
_FIRST_NAME = _COUNT_AT + _COUNT.size


class Rejection(Enum):
    """Reason for the rejection of a message."""

    MALFORMED = 'malformed message'
    EMPTY = 'no joints or no positions'
    UNEQUAL = 'arrays of unequal length'
    MISSING = 'crank joint missing'
    TWICE = 'crank joint named twice'
    NOT_FINITE = 'position or rate not finite'
    TOO_LARGE = 'position or rate beyond 1e10'
    NO_EFFORT = 'no efforts'
    EFFORT_NOT_FINITE = 'effort not finite'
    EFFORT_TOO_LARGE = 'effort beyond 1e10'
    STAMP_ZERO = 'stamp zero'
    STAMP_INVALID = 'stamp negative or with 1e9 ns or more'
    STAMP_FUTURE = 'stamp in the future'
    STAMP_OLD = 'stamp older than the last'
    NO_CRANK = 'no crank reaches the joint'
    WRENCH_NOT_FINITE = 'force or torque not finite'
    WRENCH_TOO_LARGE = 'force or torque beyond 1e9'


class CrankSample(NamedTuple):
    """State of the inputs in a message, in the order of the linkage."""

    stamp: int  # Time of the measurement, in [ns]
    angles: tuple[float, ...]  # Value of each input, in [rad]; of a sliding input in [m]
    # Rates, in [rad/s] or [m/s]; None if the message has no velocities, NaN where one is absent.
    rates: tuple[float, ...] | None
    named: int = -1  # Bit i: the message names input i; the values of the others are NaN
    # Efforts, in [N·m] or [N], where they are wanted; None if the message has none.
    efforts: tuple[float, ...] | None = None

    def merged_over(self, earlier: CrankSample | None) -> CrankSample:
        """Return the sample, with an earlier one's values of inputs that it leaves out."""
        if earlier is None or self.named == -1:
            return self
        angles, rates = (
            tuple(
                new if self.named >> index & 1 else old
                for index, (new, old) in enumerate(zip(ours, theirs, strict=True))
            )
            for ours, theirs in (
                (self.angles, earlier.angles),
                (self.rates or (), earlier.rates or ()),
            )
        )
        return CrankSample(self.stamp, angles, rates)


class JointStateReader:
    """
    Reads some joints from serialized messages.

    Parameters
    ----------
    joints
        Names of one or more joints. A message may have them in any order, among others.
    with_efforts
        Whether a sample has the efforts of the joints too.

    """

    __slots__ = ('_joints', '_known', '_with_efforts')

    def __init__(self, joints: Sequence[str], with_efforts: bool = False) -> None:
        self._joints = tuple(joint.encode() for joint in joints)
        self._known: tuple[Any, ...] | None = None
        self._with_efforts = with_efforts

    def read(self, data: bytes) -> CrankSample | Rejection:
        """Return the sample of the joints, in the given order, or the reason for its rejection."""
        known = self._known
        if known is not None:
            size, unpack_from, pick_fixed, fixed, pick_positions, pick_rates, *more = known
            if len(data) >= size:
                values = unpack_from(data)
                if pick_fixed(values) == fixed:
                    seconds = values[1]
                    nanoseconds = values[2]
                    if seconds < 0 or nanoseconds >= NANOSECONDS:
                        return Rejection.STAMP_INVALID
                    stamp = seconds * NANOSECONDS + nanoseconds
                    positions, rates = pick_positions(values), pick_rates(values) or None
                    if not more:
                        return CrankSample(stamp, positions, rates)
                    return CrankSample(stamp, positions, rates, -1, more[0](values) or None)
        layout = _sample_pattern(data, self._joints, self._with_efforts)
        if isinstance(layout, Rejection):
            return layout
        self._known = *layout[:4], *layout.picks
        return self.read(data)


def arrays_of(data: bytes) -> tuple[str, list[bytes], list[NumberArray]] | Rejection:
    """Return byte order, names, and the places of positions, rates and efforts."""
    try:
        fields = parse_message(data, JOINT_STATE)
    except MalformedError:
        return Rejection.MALFORMED
    arrays = [fields[name] for name in ('position', 'velocity', 'effort')]
    return byte_order(data), fields['name'], arrays


def _sample_pattern(
    data: bytes, joints: Sequence[bytes], with_efforts: bool
) -> Pattern | Rejection:
    arrays_or_reason = arrays_of(data)
    if isinstance(arrays_or_reason, Rejection):
        return arrays_or_reason
    _, names, arrays = arrays_or_reason
    positions, rates, efforts = arrays
    # First, whether it is for this reader at all: others may share the topic.
    if names and not {*joints} <= {*names}:
        return Rejection.MISSING
    if not names or not positions.length:
        return Rejection.EMPTY
    if positions.length != len(names) or not {rates.length, efforts.length} <= {0, len(names)}:
        return Rejection.UNEQUAL
    if any(names.count(joint) > 1 for joint in joints):
        return Rejection.TWICE
    places = [8 * names.index(joint) for joint in joints]
    groups = [
        [array.first + place for place in places] if array.length else []
        for array in (positions, rates, efforts)[: 2 + with_efforts]
    ]
    return compile_pattern(data, arrays, groups)


class JointStateWriter(ArrayWriter):
    """
    Writes messages for a fixed list of joints, in this order.

    Positions are in [rad] or [m], rates in [rad/s] or [m/s], efforts in [N·m] or [N].
    """

    __slots__ = ()

    def __init__(self, names: Sequence[str]) -> None:
        arrays = {'positions': 'position', 'rates': 'velocity', 'efforts': 'effort'}
        super().__init__(JOINT_STATE, {'name': names}, arrays)

    def compile_write(
        self,
        stamp: str,
        positions: Sequence[str],
        rates: Sequence[str],
        efforts: Sequence[str] = (),
    ) -> Lines:
        """Return `write` as generated lines that make ``message`` from expressions."""
        arrays = {'positions': positions, 'rates': rates, 'efforts': efforts}
        call = self.message_expression(
            {name: ', '.join(values) for name, values in arrays.items() if values}
        )
        lines = [f'seconds, nanoseconds = divmod({stamp}, {NANOSECONDS})']
        return Lines([*lines, f'message = {call.lines[0]}'], call.bound)


class OwnJointStates:
    """
    Recognises the joint states of a scene among other messages on their topic, by their joints.

    ``linkages`` are the published joints of each linkage, in order. If there are several linkages,
    a message may omit any that are open.
    """

    __slots__ = ('_all', '_linkages')

    def __init__(self, linkages: Iterable[Sequence[str]]) -> None:
        linkages = tuple(linkages)
        joints = [joint for linkage in linkages for joint in linkage]
        self._all = (
            _NO_FRAME + _COUNT.pack(len(joints)) + _encode_names(joints) + _COUNT.pack(len(joints))
        )
        self._linkages = [(len(linkage), _encode_names(linkage)) for linkage in linkages]

    def __call__(self, message: bytes) -> bool:
        """Return whether a serialized message is a joint state of the scene."""
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


def _encode_names(joints: Sequence[str]) -> bytes:
    """Return the names as encoded in a message, up to the next field."""
    data = pack_message(parse_declaration('string[] name'), {'name': joints})[8:]
    return data + bytes(-len(data) % 4)


def head_of(data: bytes) -> tuple[set[bytes], int] | None:
    """Return the names in a message and the end of the names; None if malformed."""
    arrays_or_reason = arrays_of(data)
    if isinstance(arrays_or_reason, Rejection):
        return None
    _, names, arrays = arrays_or_reason
    return set(names), arrays[0].count_at


def with_every_number(data: bytes, value: float) -> bytes:
    """Replace every position, rate and effort of a message; return a malformed one unchanged."""
    arrays_or_reason = arrays_of(data)
    if isinstance(arrays_or_reason, Rejection):
        return data
    order, _, arrays = arrays_or_reason
    spoilt = bytearray(data)
    for _, n, first in arrays:
        Struct(f'{order}{n}d').pack_into(spoilt, first, *(value,) * n)
    return bytes(spoilt)


class EffortCommand(NamedTuple):
    """Commands for the joints of a reader."""

    stamp: int  # Stamp of the message, in [ns]; 0 without one
    # Effort of each joint in [N·m], of a sliding one in [N]; None for a joint without a command.
    efforts: tuple[float | None, ...]


class JointEffortReader:
    """
    Reads the efforts of some joints, at any places in a message, from serialized messages.

    A message names one of the joints or more: the others have no command in it. Controllers fill
    name and effort; positions and velocities may be present, and are ignored. So is the stamp: a
    command holds from its arrival. The topic-based hardware of ros2_control
    (joint_state_topic_hardware_interface 1.1.0) names all joints of a system, but gives efforts
    only for those that have a command, without saying which; a joint that depends on others has
    none. So a message may name the ``dependent`` joints, which cannot be commanded, without an
    effort.
    """

    __slots__ = ('_dependent', '_joints', '_known')

    def __init__(self, joints: Sequence[str], dependent: Collection[str] = ()) -> None:
        self._joints = [joint.encode() for joint in joints]
        self._dependent = frozenset(name.encode() for name in dependent)
        self._known: tuple[Pattern, list[bool]] | None = None

    def read(self, data: bytes) -> EffortCommand | Rejection:
        """Return the commands for the joints, or the reason for the rejection of the message."""
        if self._known is not None:
            (size, unpack_from, pick_fixed, fixed, (pick,)), named = self._known
            if len(data) >= size:
                values = unpack_from(data)
                if pick_fixed(values) == fixed:
                    efforts = pick(values)
                    if len(efforts) < len(named):
                        left = iter(efforts)
                        efforts = tuple([next(left) if has_value else None for has_value in named])
                    return EffortCommand(values[1] * NANOSECONDS + values[2], efforts)
        layout = _effort_pattern(data, self._joints, self._dependent)
        if isinstance(layout, Rejection):
            return layout
        self._known = layout
        return self.read(data)


def _effort_pattern(
    data: bytes, joints: Sequence[bytes], dependent: Collection[bytes]
) -> tuple[Pattern, list[bool]] | Rejection:
    """Return the layout of a message, and which of the joints it names."""
    arrays_or_reason = arrays_of(data)
    if isinstance(arrays_or_reason, Rejection):
        return arrays_or_reason
    _, names, arrays = arrays_or_reason
    efforts = arrays[-1]
    named = [joint in names for joint in joints]
    # First, whether it is for this reader at all: others may share the topic.
    if names and not any(named):
        return Rejection.MISSING
    if not efforts.length:
        return Rejection.NO_EFFORT
    able = [name for name in names if name not in dependent]
    if not {array.length for array in arrays} <= {0, len(able), len(names)}:
        return Rejection.UNEQUAL
    if not names:
        return Rejection.MISSING
    if any(names.count(joint) > 1 for joint in joints):
        return Rejection.TWICE
    commanded = names if efforts.length == len(names) else able
    places = [efforts.first + 8 * commanded.index(joint) for joint in joints if joint in names]
    return compile_pattern(data, arrays, [places]), named
