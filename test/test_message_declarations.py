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

"""Declarations of messages, against the definitions that rosbags has of Jazzy's."""

from linkage_ros.messages.joint_state import JOINT_STATE
from linkage_ros.messages.joint_values import JOINT_TRAJECTORY, MULTI_DOF_JOINT_STATE
from linkage_ros.messages.layout import MalformedError, packed, parsed
from linkage_ros.messages.marker_array import MARKER_ARRAY
from linkage_ros.report.diagnostics_summary import DIAGNOSTIC_ARRAY
import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_typestore, Stores

STORE = get_typestore(Stores.ROS2_JAZZY)
DECLARATIONS = {
    'diagnostic_msgs/msg/DiagnosticArray': DIAGNOSTIC_ARRAY,
    'sensor_msgs/msg/JointState': JOINT_STATE,
    'sensor_msgs/msg/MultiDOFJointState': MULTI_DOF_JOINT_STATE,
    'trajectory_msgs/msg/JointTrajectory': JOINT_TRAJECTORY,
    'visualization_msgs/msg/MarkerArray': MARKER_ARRAY,
}


def defined(kind):
    """Yield name, type and whether it is a sequence, of each field; a header is its fields."""
    for name, (node, content) in STORE.fielddefs[kind][1]:
        many = node is Nodetype.SEQUENCE
        inner = content[0] if many else (node, content)
        if inner[1] == 'std_msgs/msg/Header':
            yield from defined('std_msgs/msg/Header')
        else:
            yield name, inner[1], many


def leaves(kind):
    """Return how many numbers a type holds, all of one kind; 0 where it holds anything else."""
    fields = list(defined(kind)) if kind in STORE.fielddefs else []
    counts = [leaves(inner) if inner in STORE.fielddefs else 1 for _, inner, _ in fields]
    return sum(counts) if all(counts) else 0


def check(declaration, kind):
    fields = list(defined(kind))
    assert [(field.name, field.many) for field in declaration] == [
        (name, many) for name, _, many in fields
    ]
    for field, (_, inner, _) in zip(declaration, fields, strict=True):
        if not isinstance(field.kind, str):
            check(field.kind, inner)
        elif field.kind[0].isdigit():
            assert int(field.kind[:-1]) == leaves(inner)


@pytest.mark.parametrize('kind', DECLARATIONS)
def test_fields_stand_as_ros_defines_them(kind):
    check(DECLARATIONS[kind], kind)


@pytest.mark.parametrize('kind', DECLARATIONS)
def test_an_empty_message_is_that_of_ros_and_malformed_if_cut(kind):
    message = packed(DECLARATIONS[kind], {})
    assert STORE.serialize_cdr(STORE.deserialize_cdr(message, kind), kind) == message
    assert parsed(message + b'more', DECLARATIONS[kind]) == parsed(message, DECLARATIONS[kind])
    for end in range(len(message)):
        with pytest.raises(MalformedError):
            parsed(message[:end], DECLARATIONS[kind])
