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
Read effort commands for one joint from serialized ``sensor_msgs/msg/JointState`` messages.

Controllers fill name and effort; positions and velocities may be present, and are ignored. So is
the stamp: a command holds from its arrival.

The topic-based hardware of ros2_control (joint_state_topic_hardware_interface 1.1.0) names all
joints of a system, but gives efforts only for those that have a command, without saying which. A
joint known to depend on others has none.
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
        Stamp of the message, in [ns]; 0 without one.
    effort
        Effort in [N·m]; of a sliding joint in [N].

    """

    stamp: int
    effort: float


class JointEffortReader:
    """
    Reads the effort of a joint from serialized messages.

    Parameters
    ----------
    joint
        Name of the joint. A message may have it at any place among others.
    dependent
        Names of joints that cannot be commanded. A message may name them without an effort.

    """

    __slots__ = ('_dependent', '_joint', '_known')

    def __init__(self, joint: str, dependent: Collection[str] = ()) -> None:
        self._joint = joint.encode()
        self._dependent = frozenset(name.encode() for name in dependent)
        self._known: tuple[int, Callable[[bytes], tuple[Any, ...]], tuple[Any, ...]] | None = None

    def read(self, data: bytes) -> EffortCommand | Rejection:
        """Return the command for the joint, or the reason for its rejection."""
        if self._known is not None:
            size, unpack_from, fixed = self._known
            if len(data) >= size:
                order, seconds, nanoseconds, names, rates, efforts, effort = unpack_from(data)
                if (order, names, rates, efforts) == fixed:
                    return EffortCommand(seconds * NANOSECONDS + nanoseconds, effort)
        layout = _pattern(data, self._joint, self._dependent)
        if isinstance(layout, Rejection):
            return layout
        self._known = layout.size, layout.unpack_from, layout.fixed
        return self.read(data)


def _pattern(data: bytes, joint: bytes, dependent: Collection[bytes]) -> Pattern | Rejection:
    arrays_or_reason = arrays_of(data)
    if isinstance(arrays_or_reason, Rejection):
        return arrays_or_reason
    _, names, arrays = arrays_or_reason
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
