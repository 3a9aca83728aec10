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


"""MultiDOFJointState bytes, against rosbags, which has a CDR of its own, and rclpy."""

from __future__ import annotations

from hypothesis import example, given
from hypothesis import strategies as st
from linkage_ros.messages.multi_dof_joint_state import PlanarWrenchWriter
import pytest
from rosbags.typesys import get_typestore, Stores

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPE = 'sensor_msgs/msg/MultiDOFJointState'
NS = 1_000_000_000

names_ = st.text(st.characters(exclude_categories=['Cs'], exclude_characters='\0'), max_size=12)
numbers = st.floats(width=64)


@st.composite
def states(draw):
    """Draw names, stamp and a wrench for each name."""
    names = draw(st.lists(names_, min_size=1, max_size=6))
    wrench = st.tuples(numbers, numbers, numbers)
    wrenches = draw(st.lists(wrench, min_size=len(names), max_size=len(names)))
    return names, draw(st.integers(0, (2**31 - 1) * NS)), wrenches


WORST = [
    (['a'], NS, [(1.0, 2.0, 3.0)]),
    (['a', 'bcd'], 0, [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]),
    (['abcdefg'], (2**31 - 1) * NS, [(-0.0, 1e-310, 1e308)]),
]


def every_case(test):
    for case in WORST:
        test = example(case)(test)
    return given(states())(test)


@every_case
def test_writes_as_rosbags_does_to_the_last_byte(state):
    names, stamp, wrenches = state
    types = STORE.types
    vector = types['geometry_msgs/msg/Vector3']
    message = types[TYPE](
        types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](*divmod(stamp, NS)), ''),
        names,
        [],
        [],
        [
            types['geometry_msgs/msg/Wrench'](vector(fx, fy, 0.0), vector(0.0, 0.0, moment))
            for fx, fy, moment in wrenches
        ],
    )
    assert PlanarWrenchWriter(names).write(stamp, wrenches) == bytes(
        STORE.serialize_cdr(message, TYPE)
    )


@every_case
def test_rclpy_reads_what_was_written(state):
    names, stamp, wrenches = state
    serialization = pytest.importorskip('rclpy.serialization')
    messages = pytest.importorskip('sensor_msgs.msg')
    written = PlanarWrenchWriter(names).write(stamp, wrenches)
    read = serialization.deserialize_message(written, messages.MultiDOFJointState)
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == divmod(stamp, NS)
    assert read.header.frame_id == ''
    assert read.joint_names == names
    assert len(read.transforms) == len(read.twist) == 0
    assert [
        tuple(repr(getattr(part, axis)) for part in (w.force, w.torque) for axis in 'xyz')
        for w in read.wrench
    ] == [tuple(map(repr, (fx, fy, 0.0, 0.0, 0.0, moment))) for fx, fy, moment in wrenches]
