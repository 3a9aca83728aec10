# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Read the numbers of serialized ``geometry_msgs/msg/WrenchStamped`` messages."""

from __future__ import annotations

from struct import Struct

from linkage_ros.messages.joint_state import Rejection
from linkage_ros.messages.layout import (
    byte_order,
    MalformedError,
    parse_declaration,
    parse_message,
)

WRENCH_STAMPED = 'geometry_msgs/msg/WrenchStamped'

_FIELDS = parse_declaration('Time stamp, string frame_id, Wrench wrench')
_NUMBERS = {order: Struct(f'{order}6d') for order in '<>'}


def read_wrench(data: bytes) -> tuple[float, ...] | Rejection:
    """
    Return force.x, y, z and torque.x, y, z of a message, or the reason for its rejection.

    The stamp and the frame are ignored: a wrench holds from its arrival, in the frame that the
    scene names. The numbers may be any.
    """
    try:
        first = parse_message(data, _FIELDS)['wrench'].first
    except MalformedError:
        return Rejection.MALFORMED
    return _NUMBERS[byte_order(data)].unpack_from(data, first)
