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
Write MultiDOFJointState messages with wrenches only.

``sensor_msgs/msg/MultiDOFJointState`` is the message of common_interfaces for the wrenches of
several joints at one instant. Its fields: stamp, frame_id, joint_names[], transforms[], twist[],
wrench[]; of a wrench: force (x, y, z), torque (x, y, z). Arrays without values stay empty.
"""

from __future__ import annotations

from collections.abc import Sequence

from linkage_ros.messages.layout import declared, NANOSECONDS, packed, packing, parsed

MULTI_DOF_JOINT_STATE = declared(
    'Time stamp, string frame_id, string[] joint_names, '
    'Transform[] transforms, Twist[] twist, Wrench[] wrench'
)


class PlanarWrenchWriter:
    """
    Writes messages for a fixed list of joints.

    Parameters
    ----------
    names
        The joints, in the order of the message.

    """

    __slots__ = ('_constants', '_pack')

    def __init__(self, names: Sequence[str]) -> None:
        values = {'joint_names': names, 'wrench': [(0.0,) * 6] * len(names)}
        message = packed(MULTI_DOF_JOINT_STATE, values)
        wrenches = parsed(message, MULTI_DOF_JOINT_STATE)['wrench']
        # Force z and torque x, y of a wrench are zeros between the changing numbers.
        self._pack, self._constants = packing(message, [(wrenches.first, 'dd24xd' * len(names))])

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
        encapsulation, head = self._constants
        return self._pack(encapsulation, seconds, nanoseconds, head, *numbers)
