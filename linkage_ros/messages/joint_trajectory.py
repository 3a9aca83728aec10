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
Write JointTrajectory messages with a single point: the state of the joints at one instant.

``trajectory_msgs/msg/JointTrajectory`` is the message of common_interfaces with a field for
accelerations. Its fields: stamp, frame_id, joint_names[], points[]; of a point: positions[],
velocities[], accelerations[], effort[], time_from_start.
"""

from __future__ import annotations

from collections.abc import Sequence

from linkage_ros.messages.layout import ArrayWriter, declared

JOINT_TRAJECTORY = declared(
    'Time stamp, string frame_id, string[] joint_names, JointTrajectoryPoint[] points',
    JointTrajectoryPoint=declared(
        'float64[] positions, float64[] velocities, float64[] accelerations, float64[] effort, '
        'Duration time_from_start'
    ),
)


class JointTrajectoryWriter(ArrayWriter):
    """
    Writes messages for a fixed list of joints.

    Positions are in [rad] or [m], rates and accelerations per [s] and [s²].

    Parameters
    ----------
    names
        The joints, in the order of the message.

    """

    __slots__ = ()

    def __init__(self, names: Sequence[str]) -> None:
        arrays = {
            'positions': 'positions',
            'rates': 'velocities',
            'accelerations': 'accelerations',
        }
        super().__init__(JOINT_TRAJECTORY, {'joint_names': names}, arrays, 'points')
