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
Effort commands as bytes (CDR): that of one joint read out of a ``sensor_msgs/msg/JointState``.

Controllers fill name and effort; positions and velocities may be there or not, and are not looked
at. Nor is the stamp: a command holds from when it comes.

The topic-based hardware of ros2_control (joint_state_topic_hardware_interface 1.1.0) names all
joints of a system, and gives efforts of those alone that have a command: nothing says which. That
a joint which follows from others has none is known.
"""

from __future__ import annotations

from collections.abc import Collection
from struct import Struct
from typing import NamedTuple

from linkage_ros.cdr import STAMP_END
from linkage_ros.joint_state import arrays_of, NANOSECONDS, Rejection


class EffortCommand(NamedTuple):
    """
    A command for one joint.

    Attributes
    ----------
    stamp
        As the message has it, in [ns]; 0 where it has none.
    effort
        In [N·m], of a joint that slides in [N].

    """

    stamp: int
    effort: float


class _Layout(NamedTuple):
    """Where things stand in a message; two messages of one publisher have the same layout."""

    size: int
    fields: Struct
    """Encapsulation, stamp, all up to the positions, and counts of rates and efforts; effort."""
    fixed: tuple[bytes, bytes, int, int]


class JointEffortReader:
    """
    Reads the effort of a joint out of serialized messages.

    Parameters
    ----------
    joint
        Its name. In a message it may stand anywhere among others.
    dependent
        Names of joints that nobody can command. A message may name them without an effort.

    """

    __slots__ = ('_dependent', '_joint', '_layout')

    def __init__(self, joint: str, dependent: Collection[str] = ()) -> None:
        self._joint = joint.encode()
        self._dependent = frozenset(name.encode() for name in dependent)
        self._layout: _Layout | None = None

    def read(self, data: bytes) -> EffortCommand | Rejection:
        """Return the command for the joint, or why there is none."""
        layout = self._layout
        if layout is not None:
            size, fields, fixed = layout
            if len(data) >= size:
                order, seconds, nanoseconds, names, rates, efforts, effort = fields.unpack_from(
                    data
                )
                if (order, names, rates, efforts) == fixed:
                    return EffortCommand(seconds * NANOSECONDS + nanoseconds, effort)
        found = _find(data, self._joint, self._dependent)
        if isinstance(found, Rejection):
            return found
        self._layout = found
        return self.read(data)


def _find(data: bytes, joint: bytes, dependent: Collection[bytes]) -> _Layout | Rejection:
    found = arrays_of(data)
    if isinstance(found, Rejection):
        return found
    order, names, arrays = found
    (position_at, n_positions, _), (rate_at, n_rates, _), (effort_at, n_efforts, efforts) = arrays
    if not n_efforts:
        return Rejection.NO_EFFORT
    able = [name for name in names if name not in dependent]
    if not {n_positions, n_rates, n_efforts} <= {0, len(able), len(names)}:
        return Rejection.UNEQUAL
    if names.count(joint) != 1:
        return Rejection.TWICE if joint in names else Rejection.MISSING
    named = position_at + 4  # with the count of the positions
    commanded = names if n_efforts == len(names) else able
    effort = efforts + 8 * commanded.index(joint)
    return _Layout(
        size=efforts + 8 * n_efforts,
        fields=Struct(
            f'{order}2s2xiI{named - STAMP_END}s{rate_at - named}xI'
            f'{effort_at - rate_at - 4}xI{effort - effort_at - 4}xd'
        ),
        fixed=(data[:2], data[STAMP_END:named], n_rates, n_efforts),
    )
