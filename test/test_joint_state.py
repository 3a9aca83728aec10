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
JointState bytes, read and written, against rosbags, which has a CDR of its own, and rclpy.

The reader answers every sequence of bytes with a sample or a rejection, and never raises.
"""

from __future__ import annotations

from array import array
from math import isnan
import struct

from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from linkage_ros.messages.joint_state import (
    CrankSample,
    JointStateReader,
    JointStateWriter,
    OwnJointStates,
    Rejection,
)
import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPE = 'sensor_msgs/msg/JointState'
NS = 1_000_000_000
CRANK = 'crank_joint'

names_ = st.text(st.characters(exclude_categories=['Cs'], exclude_characters='\0'), max_size=12)
doubles = st.floats(width=64)


def serialized(names, positions, velocities=(), efforts=(), stamp=(1, 2), frame='', little=True):
    message = STORE.types[TYPE](
        STORE.types['std_msgs/msg/Header'](
            STORE.types['builtin_interfaces/msg/Time'](*stamp), frame
        ),
        list(names),
        *(np.array(values, float) for values in (positions, velocities, efforts)),
    )
    return bytes(STORE.serialize_cdr(message, TYPE, little_endian=little))


def same(one, other):
    return one == other or (one is not None and isnan(one) and isnan(other))


@st.composite
def joint_states(draw, inputs=(CRANK,)):
    """Draw the parts of a message with the inputs among its joints, in any order."""
    others = draw(st.lists(names_.filter(lambda name: name not in inputs), max_size=6))
    names = draw(st.permutations([*others, *inputs]))
    numbers = st.lists(doubles, min_size=len(names), max_size=len(names))
    stamp = st.integers(0, 2**31 - 1), st.integers(0, NS - 1)
    return {
        'names': names,
        'positions': draw(numbers),
        'velocities': draw(numbers | st.just([])),
        'efforts': draw(numbers | st.just([])),
        'stamp': draw(st.tuples(*stamp)),
        'frame': draw(names_),
        'little': draw(st.booleans()),
    }


def expected(message, inputs=(CRANK,)):
    indices = [message['names'].index(name) for name in inputs]
    seconds, nanoseconds = message['stamp']
    positions, rates = (
        tuple(message[key][i] for i in indices) if message[key] else None
        for key in ('positions', 'velocities')
    )
    return seconds * NS + nanoseconds, positions, rates


def agrees(found, message, inputs=(CRANK,)):
    assert isinstance(found, CrankSample)
    stamp, positions, rates = expected(message, inputs)
    assert found.stamp == stamp
    assert (found.rates is None) == (rates is None)
    pairs = zip(found.angles + (found.rates or ()), positions + (rates or ()), strict=True)
    return all(same(*pair) for pair in pairs)


@given(st.lists(joint_states(), min_size=1, max_size=4))
def test_reads_what_rosbags_has_written(messages):
    # One reader for all: what it remembers of the layout of one must not colour the next.
    reader = JointStateReader([CRANK])
    for message in (*messages, *messages):
        data = serialized(**message)
        assert agrees(reader.read(data), message)
        assert agrees(reader.read(data + b'\0\0\0'), message), 'DDS may pad'


@given(st.data(), st.lists(names_, min_size=2, max_size=5, unique=True))
def test_reads_several_joints_in_their_own_order_whatever_the_messages(data, inputs):
    reader = JointStateReader(inputs)
    for _ in range(3):
        message = data.draw(joint_states(inputs))
        for _ in range(2):
            assert agrees(reader.read(serialized(**message)), message, inputs)


@given(st.data(), st.lists(names_, min_size=2, max_size=5, unique=True))
def test_of_several_joints_each_has_to_be_there_once(data, inputs):
    message = data.draw(joint_states(inputs))
    changed = data.draw(st.sampled_from(inputs))
    place = message['names'].index(changed)
    reader = JointStateReader(inputs)
    assert agrees(reader.read(serialized(**message)), message, inputs)
    for name, reason in (('', Rejection.MISSING), (changed, Rejection.TWICE)):
        without = [each for i, each in enumerate(message['names']) if i != place]
        names = [*without, name, name] if reason is Rejection.TWICE else without
        assume(reason is Rejection.TWICE or changed not in names)
        assert reader.read(serialized(names, [0.0] * len(names))) is reason
        assert agrees(reader.read(serialized(**message)), message, inputs)


@given(joint_states())
def test_reads_what_rclpy_has_written(message):
    rclpy_serialization = pytest.importorskip('rclpy.serialization')
    joint_state = pytest.importorskip('sensor_msgs.msg').JointState()
    joint_state.header.stamp.sec, joint_state.header.stamp.nanosec = message['stamp']
    joint_state.header.frame_id = message['frame']
    joint_state.name = message['names']
    joint_state.position = array('d', message['positions'])
    joint_state.velocity = array('d', message['velocities'])
    joint_state.effort = array('d', message['efforts'])
    data = rclpy_serialization.serialize_message(joint_state)
    assert agrees(JointStateReader([CRANK]).read(data), message)


@given(joint_states(), st.lists(st.tuples(st.integers(0), st.integers(0, 255)), max_size=8))
def test_whatever_the_bytes_there_is_an_answer(message, changes):
    data = serialized(**message)
    damaged = bytearray(data)
    for place, value in changes:
        damaged[place % len(damaged)] = value
    for warm in (False, True):
        reader = JointStateReader([CRANK])
        if warm:
            reader.read(data)
        for end in range(len(damaged) + 1):
            answer = reader.read(bytes(damaged[:end]))
            assert isinstance(answer, CrankSample | Rejection)
            if not changes and end < len(data):
                assert answer is Rejection.MALFORMED, 'a message cut short is none'


@given(st.binary(max_size=200))
@example(b'\0\1\0\0' + b'\xff' * 100)
@example(b'\0\1\0\0' + bytes(12) + b'\xff\xff\xff\x7f' * 20)
def test_bytes_that_never_were_a_message(data):
    assert isinstance(JointStateReader([CRANK]).read(data), CrankSample | Rejection)


@pytest.mark.parametrize(
    ('message', 'reason'),
    [
        ({'names': [], 'positions': []}, Rejection.EMPTY),
        ({'names': [CRANK], 'positions': []}, Rejection.EMPTY),
        ({'names': [CRANK, 'x'], 'positions': [1]}, Rejection.UNEQUAL),
        ({'names': [CRANK], 'positions': [1, 2]}, Rejection.UNEQUAL),
        ({'names': [CRANK], 'positions': [1], 'velocities': [1, 2]}, Rejection.UNEQUAL),
        ({'names': [CRANK, 'x'], 'positions': [1, 2], 'efforts': [1]}, Rejection.UNEQUAL),
        ({'names': ['x'], 'positions': [1]}, Rejection.MISSING),
        ({'names': [f'{CRANK}_2'], 'positions': [1]}, Rejection.MISSING),
        ({'names': [CRANK, CRANK], 'positions': [1, 1]}, Rejection.TWICE),
        ({'names': [CRANK], 'positions': [1], 'stamp': (-1, 0)}, Rejection.STAMP_INVALID),
        ({'names': [CRANK], 'positions': [1], 'stamp': (1, NS)}, Rejection.STAMP_INVALID),
    ],
)
@pytest.mark.parametrize('warm', [False, True])
@pytest.mark.parametrize('little', [False, True])
def test_says_why_there_is_no_sample(message, reason, warm, little):
    reader = JointStateReader([CRANK])
    good = serialized([CRANK], [0.5], [1.0])
    if warm:
        reader.read(good)
    assert reader.read(serialized(**message, little=little)) is reason
    assert reader.read(good) == (NS + 2, (0.5,), (1.0,))


@pytest.mark.parametrize('encapsulation', [b'\0\2', b'\0\3', b'\0\6', b'\0\7', b'\0\12', b'\1\1'])
def test_other_encodings_are_refused(encapsulation):
    good = serialized([CRANK], [0.5], [1.0])
    reader = JointStateReader([CRANK])
    for _ in range(2):  # also when it has seen that very message in an encoding that it reads
        assert reader.read(encapsulation + good[2:]) is Rejection.MALFORMED
        reader.read(good)


@pytest.mark.parametrize(
    'wrong', [{'velocities': [1.0]}, {'efforts': [1.0]}, {'positions': [1.0]}]
)
def test_a_layout_seen_before_is_not_taken_for_granted(wrong):
    right = {'names': [CRANK, 'x'], 'positions': [1.0, 2.0]}
    reader = JointStateReader([CRANK])
    assert reader.read(serialized(**right)) == (NS + 2, (1.0,), None)
    assert reader.read(serialized(**right | wrong)) is Rejection.UNEQUAL
    assert reader.read(serialized(**right)) == (NS + 2, (1.0,), None)


@given(
    st.lists(names_, min_size=1, max_size=6),
    st.integers(0, (2**31 - 1) * NS),
    st.data(),
)
def test_writes_as_rosbags_does_to_the_last_byte(names, stamp, data):
    numbers = st.lists(doubles, min_size=len(names), max_size=len(names))
    positions, rates = data.draw(numbers), data.draw(numbers | st.just([]))
    written = JointStateWriter(names).write(stamp, positions, rates)
    assert written == serialized(names, positions, rates, stamp=divmod(stamp, NS))

    read = STORE.deserialize_cdr(written, TYPE)
    assert read.header.stamp.sec * NS + read.header.stamp.nanosec == stamp
    assert read.header.frame_id == ''
    assert read.name == names
    assert read.position.tobytes() == np.array(positions, float).tobytes()
    assert read.velocity.tobytes() == np.array(rates, float).tobytes()
    assert len(read.effort) == 0


@given(st.lists(st.lists(names_, min_size=1, max_size=3), min_size=1, max_size=4), st.data())
def test_own_messages_are_told_whatever_linkages_are_in_them(linkages, data):
    joints = [joint for linkage in linkages for joint in linkage]
    assume(len(set(joints)) == len(joints) and CRANK not in joints)
    own = OwnJointStates(linkages)
    there = [linkage for linkage in linkages if data.draw(st.booleans())] or linkages[:1]
    names = [joint for linkage in there for joint in linkage]
    rates = data.draw(st.sampled_from([[], [0.5] * len(names)]))
    assert own(JointStateWriter(names).write(NS, [0.0] * len(names), rates))


@given(st.lists(st.lists(names_, min_size=2, max_size=3), min_size=2, max_size=3), st.data())
def test_a_message_of_other_joints_is_none_of_ones_own(linkages, data):
    joints = [joint for linkage in linkages for joint in linkage]
    assume(len(set(joints)) == len(joints) and CRANK not in joints)
    own = OwnJointStates(linkages)
    others = [
        [CRANK], [CRANK, *joints], [*joints, CRANK], [*linkages[1], *linkages[0]],
        linkages[0][:1], [*linkages[0], linkages[1][0]], [*joints, *linkages[0]],
    ]  # fmt: skip
    names = data.draw(st.sampled_from(others))
    assert not own(serialized(names, [0.0] * len(names)))
    assert not own(serialized(linkages[0], []))
    assert not own(serialized([], []))
    assert not own(JointStateWriter(joints).write(NS, [0.0] * len(joints), [])[:20])


@settings(max_examples=20)
@given(joint_states())
def test_reader_and_writer_agree(message):
    written = JointStateWriter(message['names']).write(
        NS, message['positions'], message['velocities']
    )
    _, (angle,), rates = expected(message)
    found = JointStateReader([CRANK]).read(written)
    assert found.stamp == NS
    assert struct.pack('<d', found.angles[0]) == struct.pack('<d', angle)
    assert (found.rates is None) == (rates is None)
    assert rates is None or same(found.rates[0], rates[0])
