# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages as rosbags writes and reads them: its CDR shares no code with ours."""

from typing import Any

import numpy as np
from rosbags.typesys import get_typestore, Stores

STORE = get_typestore(Stores.ROS2_JAZZY)
JOINT_STATE = 'sensor_msgs/msg/JointState'
WRENCH_STAMPED = 'geometry_msgs/msg/WrenchStamped'


def header(stamp=(0, 0), frame=''):
    time = STORE.types['builtin_interfaces/msg/Time']
    return STORE.types['std_msgs/msg/Header'](time(*stamp), frame)


def joint_state(
    names, positions=(), velocities=(), efforts=(), stamp=(1, 2), frame='', little=True
) -> bytes:
    """Return the bytes of a JointState; its stamp is (sec, nanosec)."""
    values = (np.array(each, float) for each in (positions, velocities, efforts))
    message = STORE.types[JOINT_STATE](header(stamp, frame), list(names), *values)
    return bytes(STORE.serialize_cdr(message, JOINT_STATE, little_endian=little))


def read_joint_state(data: bytes) -> Any:
    """Return a JointState of its bytes."""
    return STORE.deserialize_cdr(data, JOINT_STATE)


def wrench_stamped(fx, fy, moment, others=(7.0, 8.0, 9.0), frame='', little=True) -> bytes:
    """Return the bytes of a WrenchStamped; the others are force.z, torque.x and torque.y."""
    vector = STORE.types['geometry_msgs/msg/Vector3']
    fz, *torques = others
    wrench = STORE.types['geometry_msgs/msg/Wrench'](vector(fx, fy, fz), vector(*torques, moment))
    message = STORE.types[WRENCH_STAMPED](header((1, 2), frame), wrench)
    return bytes(STORE.serialize_cdr(message, WRENCH_STAMPED, little_endian=little))
