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
JointTrajectory messages of a single point as bytes (CDR): the state of the joints at one instant.

``trajectory_msgs/msg/JointTrajectory`` is the message of common_interfaces that has a field for
accelerations. Its fields: stamp, frame_id, joint_names[], points[]; of a point: positions[],
velocities[], accelerations[], effort[], time_from_start.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct

from linkage_ros.cdr import ENCAPSULATION, head_of_joints
from linkage_ros.joint_state import NANOSECONDS


class JointTrajectoryWriter:
    """
    Writes messages for the same joints again and again.

    Parameters
    ----------
    names
        The joints, in the order in which they are published.

    """

    __slots__ = ('_between', '_end', '_head', '_layouts')

    def __init__(self, names: Sequence[str]) -> None:
        n = len(names)
        self._head = head_of_joints(names, 1, n)
        # After n doubles the offset is a multiple of 8, so that the next count is followed by
        # four bytes of padding. Behind the last array that holds numbers stand the counts of those
        # that hold none, and a time_from_start of zero.
        self._between = Struct('<II').pack(n, 0)
        self._end = bytes(4 * 5)
        numbers = f'<4siI{len(self._head)}s{n}d'
        self._layouts = (
            Struct(f'{numbers}20s'),
            Struct(f'{numbers}8s{n}d16s'),
            Struct(f'{numbers}8s{n}d8s{n}d12s'),
        )

    def write(
        self,
        stamp: int,
        positions: Sequence[float],
        rates: Sequence[float],
        accelerations: Sequence[float],
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
        accelerations
            One for each joint, in [rad/s²] or [m/s²], or none; none where there are no rates.

        """
        seconds, nanoseconds = divmod(stamp, NANOSECONDS)
        begin = (ENCAPSULATION, seconds, nanoseconds, self._head, *positions)
        alone, with_rates, with_all = self._layouts
        if not rates:
            return alone.pack(*begin, self._end)
        # A field shorter than what is packed into it takes as much as it holds.
        if not accelerations:
            return with_rates.pack(*begin, self._between, *rates, self._end)
        return with_all.pack(
            *begin, self._between, *rates, self._between, *accelerations, self._end
        )
