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
MultiDOFJointState messages with wrenches alone, as bytes (CDR).

``sensor_msgs/msg/MultiDOFJointState`` is the message of common_interfaces that says what several
joints carry at one instant. Its fields: stamp, frame_id, joint_names[], transforms[], twist[],
wrench[]; of a wrench: force (x, y, z), torque (x, y, z). An array that does not apply stays empty.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct

from linkage_ros.cdr import ENCAPSULATION, head_of_joints
from linkage_ros.joint_state import NANOSECONDS


class PlanarWrenchWriter:
    """
    Writes messages for the same joints again and again.

    Parameters
    ----------
    names
        The joints, in the order in which they are published.

    """

    __slots__ = ('_head', '_layout')

    def __init__(self, names: Sequence[str]) -> None:
        self._head = head_of_joints(names, 0, 0, len(names))
        # Of each wrench force z and torque x, y are zeros, which stand between the moving numbers.
        self._layout = Struct(f'<4siI{len(self._head)}s{"dd24xd" * len(names)}')

    def write(self, stamp: int, wrenches: Sequence[tuple[float, float, float]]) -> bytes:
        """
        Return a message.

        Parameters
        ----------
        stamp
            Time of the state, in [ns].
        wrenches
            One for each joint: force in x and y, in [N], and torque about z, in [N·m].

        """
        seconds, nanoseconds = divmod(stamp, NANOSECONDS)
        numbers: tuple[float, ...] = ()
        for wrench in wrenches:
            numbers += wrench
        return self._layout.pack(ENCAPSULATION, seconds, nanoseconds, self._head, *numbers)
