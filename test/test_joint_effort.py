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
Effort commands read from bytes, against rosbags, which has a CDR of its own.

The reader answers every sequence of bytes with a command or a rejection, and never raises.
"""

from __future__ import annotations

from math import isnan

from hypothesis import example, given
from hypothesis import strategies as st
from linkage_ros.messages.joint_effort import EffortCommand, JointEffortReader
from linkage_ros.messages.joint_state import Rejection
import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPE = 'sensor_msgs/msg/JointState'
NS = 1_000_000_000
CRANK = 'crank_joint'

names_ = st.text(st.characters(exclude_categories=['Cs'], exclude_characters='\0'), max_size=12)
doubles = st.floats(width=64)


def serialized(names, efforts, positions=(), velocities=(), stamp=(1, 2), frame='', little=True):
    message = STORE.types[TYPE](
        STORE.types['std_msgs/msg/Header'](
            STORE.types['builtin_interfaces/msg/Time'](*stamp), frame
        ),
        list(names),
        *(np.array(values, float) for values in (positions, velocities, efforts)),
    )
    return bytes(STORE.serialize_cdr(message, TYPE, little_endian=little))


@st.composite
def commands(draw):
    others = draw(st.lists(names_.filter(lambda name: name != CRANK), max_size=6))
    names = draw(st.permutations([*others, CRANK]))
    numbers = st.lists(doubles, min_size=len(names), max_size=len(names))
    return {
        'names': names,
        'efforts': draw(numbers),
        'positions': draw(numbers | st.just([])),
        'velocities': draw(numbers | st.just([])),
        'stamp': draw(st.tuples(st.integers(0, 2**31 - 1), st.integers(0, NS - 1))),
        'frame': draw(names_),
        'little': draw(st.booleans()),
    }


@given(st.lists(commands(), min_size=1, max_size=4))
def test_the_effort_of_the_joint_is_read(parts):
    reader = JointEffortReader(CRANK)  # one for all: layouts change from message to message
    for part in parts:
        stamp, effort = reader.read(serialized(**part))
        expected = part['efforts'][part['names'].index(CRANK)]
        assert stamp == part['stamp'][0] * NS + part['stamp'][1]
        assert effort == expected or (isnan(effort) and isnan(expected))


@pytest.mark.parametrize(
    ('parts', 'rejection'),
    [
        ({'names': [CRANK], 'efforts': []}, Rejection.NO_EFFORT),
        ({'names': [], 'efforts': []}, Rejection.NO_EFFORT),
        ({'names': [CRANK], 'efforts': [], 'positions': [1.0]}, Rejection.NO_EFFORT),
        ({'names': ['rocker_joint'], 'efforts': [1.0]}, Rejection.MISSING),
        ({'names': [CRANK, CRANK], 'efforts': [1.0, 2.0]}, Rejection.TWICE),
        ({'names': [], 'efforts': [1.0]}, Rejection.UNEQUAL),
        ({'names': [CRANK, 'b'], 'efforts': [1.0]}, Rejection.UNEQUAL),
        ({'names': [CRANK], 'efforts': [1.0, 2.0]}, Rejection.UNEQUAL),
        (
            {'names': [CRANK, 'b'], 'efforts': [1.0, 2.0], 'positions': [1.0]},
            Rejection.UNEQUAL,
        ),
        (
            {'names': [CRANK, 'b'], 'efforts': [1.0, 2.0], 'velocities': [1.0]},
            Rejection.UNEQUAL,
        ),
    ],
)
def test_what_is_no_command_is_refused(parts, rejection):
    reader = JointEffortReader(CRANK)
    assert reader.read(serialized(**parts)) is rejection
    assert reader.read(serialized([CRANK], [4.0])) == EffortCommand(NS + 2, 4.0)
    assert reader.read(serialized(**parts)) is rejection, 'also with a layout known'


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
def test_joints_that_follow_from_others_need_no_effort(names, efforts, expected, little):
    reader = JointEffortReader(CRANK, DEPENDENT)
    for _ in range(2):  # also with a layout known
        read = reader.read(serialized(names, efforts, little=little))
        assert read == (EffortCommand(NS + 2, 4.0) if expected == 4.0 else expected)


def test_a_stamp_of_zero_is_as_good_as_any():
    command = JointEffortReader(CRANK).read(serialized([CRANK], [4.0], stamp=(0, 0)))
    assert command == EffortCommand(0, 4.0)


@pytest.mark.parametrize('length', range(len(serialized([CRANK], [4.0], frame='base'))))
def test_a_message_cut_short_is_malformed(length):
    whole = serialized([CRANK], [4.0], frame='base')
    reader = JointEffortReader(CRANK)
    for _ in range(2):
        assert reader.read(whole[:length]) is Rejection.MALFORMED
        assert reader.read(whole) == EffortCommand(NS + 2, 4.0)


@given(st.binary(max_size=200))
@example(b'\x00\x01\x00\x00' + b'\xff' * 100)
def test_any_bytes_are_answered(data):
    assert isinstance(JointEffortReader(CRANK).read(data), EffortCommand | Rejection)


@given(
    st.lists(st.tuples(st.integers(0, 2**16), st.integers(0, 255)), max_size=8),
    st.booleans(),
)
def test_any_damage_is_answered(damage, after_a_good_one):
    good = serialized(['a', CRANK], [1.0, 4.0], [0.1, 0.2], frame='base')
    reader = JointEffortReader(CRANK)
    if after_a_good_one:
        assert reader.read(good).effort == 4.0
    data = bytearray(good)
    for place, value in damage:
        data[place % len(data)] = value
    assert isinstance(reader.read(bytes(data)), EffortCommand | Rejection)
    assert reader.read(good).effort == 4.0
