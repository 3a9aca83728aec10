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


"""JointTrajectory bytes, against rosbags, which has a CDR of its own, and rclpy."""

from __future__ import annotations

from array import array

from hypothesis import example, given
from hypothesis import strategies as st
from linkage_ros.messages.joint_trajectory import JointTrajectoryWriter
import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPE = 'trajectory_msgs/msg/JointTrajectory'
NS = 1_000_000_000

names_ = st.text(st.characters(exclude_categories=['Cs'], exclude_characters='\0'), max_size=12)


@st.composite
def motions(draw):
    """Draw names, stamp, positions, rates or none, and then accelerations or none."""
    names = draw(st.lists(names_, min_size=1, max_size=6))
    numbers = st.lists(st.floats(width=64), min_size=len(names), max_size=len(names))
    rates = draw(numbers | st.just([]))
    accelerations = draw(numbers | st.just([])) if rates else []
    return names, draw(st.integers(0, (2**31 - 1) * NS)), draw(numbers), rates, accelerations


WORST = [
    (['a'], NS, [1.0], [], []),
    (['a', 'bcd'], 0, [1.0, 2.0], [3.0, 4.0], []),
    (['abcdefg'], (2**31 - 1) * NS, [1.0], [2.0], [3.0]),
]


def every_case(test):
    for case in WORST:
        test = example(case)(test)
    return given(motions())(test)


@every_case
def test_writes_as_rosbags_does_to_the_last_byte(motion):
    names, stamp, positions, rates, accelerations = motion
    types = STORE.types
    message = types[TYPE](
        types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](*divmod(stamp, NS)), ''),
        names,
        [
            types['trajectory_msgs/msg/JointTrajectoryPoint'](
                *(np.array(values, float) for values in (positions, rates, accelerations, [])),
                types['builtin_interfaces/msg/Duration'](0, 0),
            )
        ],
    )
    written = JointTrajectoryWriter(names).write(stamp, positions, rates, accelerations)
    assert written == bytes(STORE.serialize_cdr(message, TYPE))


@every_case
def test_writes_what_rclpy_writes_and_reads(motion):
    names, stamp, positions, rates, accelerations = motion
    serialization = pytest.importorskip('rclpy.serialization')
    messages = pytest.importorskip('trajectory_msgs.msg')
    message = messages.JointTrajectory(
        joint_names=names,
        points=[
            messages.JointTrajectoryPoint(
                positions=array('d', positions),
                velocities=array('d', rates),
                accelerations=array('d', accelerations),
            )
        ],
    )
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, NS)
    written = JointTrajectoryWriter(names).write(stamp, positions, rates, accelerations)
    # Its padding, and some bytes behind the message, are whatever stood in the memory before:
    # rosbags writes what it reads of them once more, with zeros there.
    theirs = serialization.serialize_message(message)[: len(written)]
    assert written == bytes(STORE.serialize_cdr(STORE.deserialize_cdr(theirs, TYPE), TYPE))

    read = serialization.deserialize_message(written, messages.JointTrajectory)
    assert read.header == message.header
    assert read.joint_names == names
    (point,) = read.points
    assert point.positions.tobytes() == array('d', positions).tobytes()
    assert point.velocities.tobytes() == array('d', rates).tobytes()
    assert point.accelerations.tobytes() == array('d', accelerations).tobytes()
    assert len(point.effort) == 0
    assert (point.time_from_start.sec, point.time_from_start.nanosec) == (0, 0)


def test_one_writer_writes_each_message_for_itself():
    # What a toggle leaves out is not what the message before it had.
    writer = JointTrajectoryWriter(['a', 'b'])
    full = writer.write(NS, [1.0, 2.0], [3.0, 4.0], [5.0, 6.0])
    toggle = writer.write(NS, [1.0, 2.0], [], [])
    assert writer.write(NS, [1.0, 2.0], [3.0, 4.0], [5.0, 6.0]) == full
    (point,) = STORE.deserialize_cdr(toggle, TYPE).points
    assert list(point.positions) == [1.0, 2.0]
    assert len(point.velocities) == len(point.accelerations) == len(point.effort) == 0
