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

from collections.abc import Callable, Collection
from typing import Any, NamedTuple

from linkage_ros.messages.joint_state import arrays_of, Rejection
from linkage_ros.messages.layout import NANOSECONDS, Pattern, pattern


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

    __slots__ = ('_dependent', '_joint', '_known')

    def __init__(self, joint: str, dependent: Collection[str] = ()) -> None:
        self._joint = joint.encode()
        self._dependent = frozenset(name.encode() for name in dependent)
        self._known: tuple[int, Callable[[bytes], tuple[Any, ...]], tuple[Any, ...]] | None = None

    def read(self, data: bytes) -> EffortCommand | Rejection:
        """Return the command for the joint, or why there is none."""
        if self._known is not None:
            size, unpack_from, fixed = self._known
            if len(data) >= size:
                order, seconds, nanoseconds, names, rates, efforts, effort = unpack_from(data)
                if (order, names, rates, efforts) == fixed:
                    return EffortCommand(seconds * NANOSECONDS + nanoseconds, effort)
        found = _pattern(data, self._joint, self._dependent)
        if isinstance(found, Rejection):
            return found
        self._known = found.size, found.unpack_from, found.fixed
        return self.read(data)


def _pattern(data: bytes, joint: bytes, dependent: Collection[bytes]) -> Pattern | Rejection:
    found = arrays_of(data)
    if isinstance(found, Rejection):
        return found
    _, names, arrays = found
    efforts = arrays[-1]
    if not efforts.length:
        return Rejection.NO_EFFORT
    able = [name for name in names if name not in dependent]
    if not {array.length for array in arrays} <= {0, len(able), len(names)}:
        return Rejection.UNEQUAL
    if names.count(joint) != 1:
        return Rejection.TWICE if joint in names else Rejection.MISSING
    commanded = names if efforts.length == len(names) else able
    return pattern(data, arrays, [[efforts.first + 8 * commanded.index(joint)]])
