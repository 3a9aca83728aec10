# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
JointState messages that are read, as crank samples and as effort commands, against rosbags.

The readers answer every sequence of bytes with what they read or a rejection, and never raise.
"""

from array import array
from collections.abc import Callable
from math import isnan
import struct
from typing import Any, NamedTuple

from hypothesis import assume, example, given, settings, strategies as st
from linkage_ros.messages import (
    CrankSample,
    EffortCommand,
    JointEffortReader,
    JointStateReader,
    JointStateWriter,
    OwnJointStates,
    Rejection,
)
import pytest

from ..support.messages import joint_state as serialized

NS = 1_000_000_000
CRANK = 'crank_joint'
names_ = st.text(st.characters(exclude_categories=['Cs'], exclude_characters='\0'), max_size=12)
doubles = st.floats(width=64)


def same(one, other):
    return one == other or (one is not None and isnan(one) and isnan(other))


@st.composite
def joint_states(draw, inputs=(CRANK,), required='positions'):
    """Draw the parts of a message with the inputs among its joints, in any order."""
    others = draw(st.lists(names_.filter(lambda name: name not in inputs), max_size=6))
    names = draw(st.permutations([*others, *inputs]))
    numbers = st.lists(doubles, min_size=len(names), max_size=len(names))
    stamp = st.integers(0, 2**31 - 1), st.integers(0, NS - 1)
    return {
        'names': names,
        **{
            key: draw(numbers if key == required else numbers | st.just([]))
            for key in ('positions', 'velocities', 'efforts')
        },
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
def test_reader_reads_joint_states_written_by_rosbags(messages):
    # One reader for all: what it remembers of the layout of one must not colour the next.
    reader = JointStateReader([CRANK])
    for message in (*messages, *messages):
        data = serialized(**message)
        assert agrees(reader.read(data), message)
        assert agrees(reader.read(data + b'\0\0\0'), message), 'DDS may pad'


@given(st.lists(joint_states(required='efforts'), min_size=1, max_size=4))
def test_reader_reads_the_effort_of_its_joint(messages):
    reader = JointEffortReader([CRANK])  # one for all: layouts change from message to message
    for message in messages:
        stamp, (effort,) = reader.read(serialized(**message))
        assert stamp == message['stamp'][0] * NS + message['stamp'][1]
        assert same(effort, message['efforts'][message['names'].index(CRANK)])


@given(st.data(), st.lists(names_, min_size=2, max_size=5, unique=True))
def test_reader_orders_several_joints_by_its_inputs(data, inputs):
    reader = JointStateReader(inputs)
    for _ in range(3):
        message = data.draw(joint_states(inputs))
        for _ in range(2):
            assert agrees(reader.read(serialized(**message)), message, inputs)


@given(st.data(), st.lists(names_, min_size=2, max_size=5, unique=True))
def test_reader_needs_each_joint_exactly_once(data, inputs):
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
def test_reader_reads_joint_states_written_by_rclpy(message):
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


class Reader(NamedTuple):
    """A reader, a message that it reads, and what it reads of it."""

    build: Callable[[], Any]
    good: bytes
    read: CrankSample | EffortCommand


READERS = {
    'crank sample': Reader(
        lambda: JointStateReader([CRANK]),
        serialized(['a', CRANK], [0.1, 0.5], [0.2, 1.0], frame='base'),
        CrankSample(NS + 2, (0.5,), (1.0,)),
    ),
    'effort command': Reader(
        lambda: JointEffortReader([CRANK]),
        serialized(['a', CRANK], [0.1, 0.2], efforts=[1.0, 4.0], frame='base'),
        EffortCommand(NS + 2, (4.0,)),
    ),
}
every_reader = pytest.mark.parametrize('name', READERS)


@every_reader
@pytest.mark.parametrize('warm', [False, True])
def test_truncated_message_is_malformed(name, warm):
    build, good, read = READERS[name]
    for length in range(len(good)):
        reader = build()
        if warm:
            assert reader.read(good) == read
        assert reader.read(good[:length]) is Rejection.MALFORMED
        assert reader.read(good) == read


@given(joint_states(), st.lists(st.tuples(st.integers(0), st.integers(0, 255)), max_size=8))
def test_damaged_message_gives_a_sample_or_a_rejection(message, changes):
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


@every_reader
@given(st.lists(st.tuples(st.integers(0, 2**16), st.integers(0, 255)), max_size=8), st.booleans())
def test_reader_survives_any_damaged_message(name, damage, after_a_good_one):
    build, good, read = READERS[name]
    reader = build()
    if after_a_good_one:
        assert reader.read(good) == read
    data = bytearray(good)
    for place, value in damage:
        data[place % len(data)] = value
    assert isinstance(reader.read(bytes(data)), type(read) | Rejection)
    assert reader.read(good) == read


@every_reader
@given(st.binary(max_size=200))
@example(b'\0\1\0\0' + b'\xff' * 100)
@example(b'\0\1\0\0' + bytes(12) + b'\xff\xff\xff\x7f' * 20)
def test_reader_survives_random_bytes(name, data):
    build, _, read = READERS[name]
    assert isinstance(build().read(data), type(read) | Rejection)


REFUSED = {
    'crank sample': [
        ({'names': [], 'positions': []}, Rejection.EMPTY),
        ({'names': [CRANK], 'positions': []}, Rejection.EMPTY),
        ({'names': [CRANK, 'x'], 'positions': [1]}, Rejection.UNEQUAL),
        ({'names': [CRANK], 'positions': [1, 2]}, Rejection.UNEQUAL),
        ({'names': [CRANK], 'positions': [1], 'velocities': [1, 2]}, Rejection.UNEQUAL),
        ({'names': [CRANK, 'x'], 'positions': [1, 2], 'efforts': [1]}, Rejection.UNEQUAL),
        ({'names': ['x'], 'positions': [1]}, Rejection.MISSING),
        ({'names': ['x'], 'positions': [], 'efforts': [1]}, Rejection.MISSING),
        ({'names': ['x', 'y'], 'positions': [1]}, Rejection.MISSING),
        ({'names': ['x', 'x'], 'positions': [1, 1, 1]}, Rejection.MISSING),
        ({'names': [f'{CRANK}_2'], 'positions': [1]}, Rejection.MISSING),
        ({'names': [CRANK, CRANK], 'positions': [1, 1]}, Rejection.TWICE),
        ({'names': [CRANK], 'positions': [1], 'stamp': (-1, 0)}, Rejection.STAMP_INVALID),
        ({'names': [CRANK], 'positions': [1], 'stamp': (1, NS)}, Rejection.STAMP_INVALID),
    ],
    'effort command': [
        ({'names': [CRANK], 'efforts': []}, Rejection.NO_EFFORT),
        ({'names': [], 'efforts': []}, Rejection.NO_EFFORT),
        ({'names': [CRANK], 'efforts': [], 'positions': [1]}, Rejection.NO_EFFORT),
        ({'names': ['rocker_joint'], 'efforts': [1]}, Rejection.MISSING),
        ({'names': ['x'], 'positions': [1]}, Rejection.MISSING),
        ({'names': ['x', 'y'], 'efforts': [1]}, Rejection.MISSING),
        ({'names': [CRANK, CRANK], 'efforts': [1, 2]}, Rejection.TWICE),
        ({'names': [], 'efforts': [1]}, Rejection.UNEQUAL),
        ({'names': [CRANK, 'b'], 'efforts': [1]}, Rejection.UNEQUAL),
        ({'names': [CRANK], 'efforts': [1, 2]}, Rejection.UNEQUAL),
        ({'names': [CRANK, 'b'], 'efforts': [1, 2], 'positions': [1]}, Rejection.UNEQUAL),
        ({'names': [CRANK, 'b'], 'efforts': [1, 2], 'velocities': [1]}, Rejection.UNEQUAL),
    ],
}


@pytest.mark.parametrize(
    ('name', 'message', 'reason'),
    [(name, *refused) for name, rows in REFUSED.items() for refused in rows],
)
@pytest.mark.parametrize('little', [False, True])
def test_reader_names_the_reason_of_a_rejection(name, message, reason, little):
    build, good, read = READERS[name]
    reader = build()
    assert reader.read(serialized(**message, little=little)) is reason
    assert reader.read(good) == read
    assert reader.read(serialized(**message, little=little)) is reason, 'with a layout known'


DEPENDENT = ('coupler_joint', 'rocker_joint')


@pytest.mark.parametrize(
    ('names', 'efforts', 'expected'),
    [
        # As joint_state_topic_hardware_interface 1.1.0 sends them: efforts in the order of the
        # joints that have a command.
        ([CRANK, 'coupler_joint', 'rocker_joint'], [4.0], 4.0),
        (['coupler_joint', CRANK, 'rocker_joint'], [4.0], 4.0),
        (['rocker_joint', 'coupler_joint', CRANK], [4.0], 4.0),
        (['arm', 'rocker_joint', CRANK], [1.0, 4.0], 4.0),
        ([CRANK, 'rocker_joint', 'arm'], [4.0, 1.0], 4.0),
        (['rocker_joint', CRANK], [1.0, 4.0], 4.0),
        # Whose the effort is, nothing says.
        (['arm', CRANK], [4.0], Rejection.UNEQUAL),
        (['arm', 'rocker_joint', CRANK], [4.0], Rejection.UNEQUAL),
        (['arm', 'rocker_joint'], [4.0], Rejection.MISSING),
        ([CRANK, 'rocker_joint', CRANK], [4.0, 4.0], Rejection.TWICE),
    ],
)
@pytest.mark.parametrize('little', [True, False])
def test_dependent_joints_need_no_effort(names, efforts, expected, little):
    reader = JointEffortReader([CRANK], DEPENDENT)
    for _ in range(2):  # also with a layout known
        read = reader.read(serialized(names, efforts=efforts, little=little))
        assert read == (EffortCommand(NS + 2, (4.0,)) if expected == 4.0 else expected)


def test_command_with_stamp_zero_is_accepted():
    data = serialized([CRANK], efforts=[4.0], stamp=(0, 0))
    assert JointEffortReader([CRANK]).read(data) == EffortCommand(0, (4.0,))


@every_reader
@pytest.mark.parametrize('encapsulation', [b'\0\2', b'\0\3', b'\0\6', b'\0\7', b'\0\12', b'\1\1'])
def test_other_encodings_are_refused(name, encapsulation):
    build, good, _ = READERS[name]
    reader = build()
    for _ in range(2):  # also when it has seen that very message in an encoding that it reads
        assert reader.read(encapsulation + good[2:]) is Rejection.MALFORMED
        reader.read(good)


@pytest.mark.parametrize(
    'wrong', [{'velocities': [1.0]}, {'efforts': [1.0]}, {'positions': [1.0]}]
)
def test_known_layout_is_checked_in_each_message(wrong):
    right = {'names': [CRANK, 'x'], 'positions': [1.0, 2.0]}
    reader = JointStateReader([CRANK])
    assert reader.read(serialized(**right))[:3] == (NS + 2, (1.0,), None)
    assert reader.read(serialized(**right | wrong)) is Rejection.UNEQUAL
    assert reader.read(serialized(**right))[:3] == (NS + 2, (1.0,), None)


@given(st.lists(st.lists(names_, min_size=1, max_size=3), min_size=1, max_size=4), st.data())
def test_own_joint_states_are_recognised(linkages, data):
    joints = [joint for linkage in linkages for joint in linkage]
    assume(len(set(joints)) == len(joints) and CRANK not in joints)
    own = OwnJointStates(linkages)
    there = [linkage for linkage in linkages if data.draw(st.booleans())] or linkages[:1]
    names = [joint for linkage in there for joint in linkage]
    rates = data.draw(st.sampled_from([[], [0.5] * len(names)]))
    assert own(JointStateWriter(names).write(NS, [0.0] * len(names), rates))


@given(st.lists(st.lists(names_, min_size=2, max_size=3), min_size=2, max_size=3), st.data())
def test_messages_of_other_joints_are_not_own(linkages, data):
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
