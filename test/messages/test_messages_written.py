# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages that are written: by rosbags and by rclpy they are the same to the last byte."""

from collections.abc import Callable
from importlib import import_module
from math import cos, sin
from typing import Any, NamedTuple

from hypothesis import given, strategies as st
from linkage_ros.messages import (
    ADD,
    DELETE,
    JOINT_STATE as JOINT_STATE_FIELDS,
    JOINT_TRAJECTORY,
    JointStateWriter,
    JointTrajectoryWriter,
    JointWrenchWriter,
    MalformedError,
    Marker,
    MARKER_ARRAY,
    MarkerArrayWriter,
    MULTI_DOF_JOINT_STATE,
    pack_message,
    parse_message,
)
from linkage_ros.tools.view.report import DIAGNOSTIC_ARRAY
import numpy as np
import pytest
from rosbags.interfaces import Nodetype
from scipy.spatial.transform import Rotation

from ..support.messages import header, JOINT_STATE, STORE

NS = 1_000_000_000
LAST = (2**31 - 1) * NS
TYPES = STORE.types
texts = st.text(st.characters(exclude_categories=['Cs'], exclude_characters='\0'), max_size=12)
times = st.integers(0, LAST)
doubles = st.floats(width=64)
finite = st.floats(allow_nan=False, allow_infinity=False)
places = st.tuples(finite, finite, finite)
# A value that a float32 can hold is read back unchanged.
share = st.sampled_from([0.0, 0.25, 0.5, 1.0])
markers_ = st.builds(
    Marker, ns=texts, number=st.integers(-(2**31), 2**31 - 1), kind=st.integers(0, 12),
    scale=places, colour=st.tuples(share, share, share, share),
    points=st.lists(places, max_size=4),
    at=places, text=texts,
    action=st.sampled_from([ADD, DELETE]), lifetime=times
)  # fmt: skip
FULL = Marker(
    'links', 7, 4, (1.0, 2.0, 3.0), (0.25, 0.5, 0.75, 1.0),
    [(4.0, 5.0, 6.0), (7.0, 8.0, 9.0)], (10.0, 11.0, 12.0), 'offen', ADD, 13 * NS + 14,
)  # fmt: skip


@st.composite
def motions(draw):
    """Draw names, stamp, positions, rates or none, and then accelerations or none."""
    names = draw(st.lists(texts, min_size=1, max_size=6))
    numbers = st.lists(doubles, min_size=len(names), max_size=len(names))
    rates = draw(numbers | st.just([]))
    accelerations = draw(numbers | st.just([])) if rates else []
    return names, draw(times), draw(numbers), rates, accelerations


@st.composite
def wrenches(draw):
    """Draw names, stamp and a wrench for each name."""
    names = draw(st.lists(texts, min_size=1, max_size=6))
    wrench = st.tuples(doubles, doubles, doubles)
    return names, draw(times), draw(st.lists(wrench, min_size=len(names), max_size=len(names)))


def arrays(*numbers):
    return [np.array(values, float) for values in numbers]


def joint_state(names, stamp, positions, rates, _=()):
    return TYPES[JOINT_STATE](header(divmod(stamp, NS)), names, *arrays(positions, rates, []))


def joint_trajectory(names, stamp, positions, rates, accelerations):
    point = TYPES['trajectory_msgs/msg/JointTrajectoryPoint'](
        *arrays(positions, rates, accelerations, []),
        TYPES['builtin_interfaces/msg/Duration'](0, 0),
    )
    kind = TYPES['trajectory_msgs/msg/JointTrajectory']
    return kind(header(divmod(stamp, NS)), names, [point])


def multi_dof_joint_state(names, stamp, forces):
    vector, wrench = TYPES['geometry_msgs/msg/Vector3'], TYPES['geometry_msgs/msg/Wrench']
    efforts = [wrench(vector(x, y, 0.0), vector(0.0, 0.0, moment)) for x, y, moment in forces]
    kind = TYPES['sensor_msgs/msg/MultiDOFJointState']
    return kind(header(divmod(stamp, NS)), names, [], [], efforts)


def marker_message(frame, marker, stamp, angle=0.0):
    """Return a marker with every field of its message, in their order."""
    point = TYPES['geometry_msgs/msg/Point']
    nothing = np.array([], np.uint8)
    return TYPES['visualization_msgs/msg/Marker'](
        header=header(divmod(stamp, NS), frame), ns=marker.ns, id=marker.number, type=marker.kind,
        action=marker.action,
        pose=TYPES['geometry_msgs/msg/Pose'](
            point(*marker.at),
            TYPES['geometry_msgs/msg/Quaternion'](0.0, 0.0, sin(angle / 2), cos(angle / 2))
        ),
        scale=TYPES['geometry_msgs/msg/Vector3'](*marker.scale),
        color=TYPES['std_msgs/msg/ColorRGBA'](*marker.colour),
        lifetime=TYPES['builtin_interfaces/msg/Duration'](*divmod(marker.lifetime, NS)),
        frame_locked=False, points=[point(*place) for place in marker.points], colors=[],
        texture_resource='',
        texture=TYPES['sensor_msgs/msg/CompressedImage'](header(), '', nothing), uv_coordinates=[],
        text=marker.text, mesh_resource='',
        mesh_file=TYPES['visualization_msgs/msg/MeshFile']('', nothing),
        mesh_use_embedded_materials=False
    )  # fmt: skip


def marker_array(frame, markers, stamp):
    kind = TYPES['visualization_msgs/msg/MarkerArray']
    return kind([marker_message(frame, marker, stamp) for marker in markers])


class Message(NamedTuple):
    """A kind of message: what can be in it, how we write it, and as what rosbags has it."""

    cases: st.SearchStrategy[Any]
    ours: Callable[..., bytes]
    theirs: Callable[..., Any]
    worst: list[Any]


MOTIONS = [
    (['a'], NS, [1.0], [], []),
    (['a', 'bcd'], 0, [1.0, 2.0], [3.0, 4.0], []),
    (['abcdefg'], LAST, [1.0], [2.0], [3.0]),
]
MESSAGES = {
    JOINT_STATE: Message(
        motions(),
        lambda names, stamp, positions, rates, _: JointStateWriter(names).write(
            stamp, positions, rates
        ),
        joint_state,
        MOTIONS,
    ),
    'trajectory_msgs/msg/JointTrajectory': Message(
        motions(),
        lambda names, *rest: JointTrajectoryWriter(names).write(*rest),
        joint_trajectory,
        MOTIONS,
    ),
    'sensor_msgs/msg/MultiDOFJointState': Message(
        wrenches(),
        lambda names, *rest: JointWrenchWriter(names, planar=True).write(*rest),
        multi_dof_joint_state,
        [
            (['a'], NS, [(1.0, 2.0, 3.0)]),
            (['a', 'bcd'], 0, [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]),
            (['abcdefg'], LAST, [(-0.0, 1e-310, 1e308)]),
        ],
    ),
    'visualization_msgs/msg/MarkerArray': Message(
        st.tuples(texts, st.lists(markers_, max_size=4), times),
        lambda frame, markers, stamp: MarkerArrayWriter(frame, markers).message_at(stamp),
        marker_array,
        [
            ('ground', [FULL], 15 * NS + 16),
            ('', [], 0),
            # Every length of a text before what stands at multiples of eight.
            *(('g' * n, [FULL._replace(text='t' * m), FULL], LAST)
              for n in range(8) for m in range(4)),
            ('a', [FULL._replace(points=[]), FULL._replace(action=DELETE, text='')], 1),
        ],
    ),
}  # fmt: skip
every_message = pytest.mark.parametrize('kind', MESSAGES)


def serialized(message, kind):
    return bytes(STORE.serialize_cdr(message, kind))


def check_bytes(kind, case):
    message = MESSAGES[kind]
    assert message.ours(*case) == serialized(message.theirs(*case), kind)


@every_message
@given(data=st.data())
def test_writers_give_the_bytes_of_rosbags(kind, data):
    check_bytes(kind, data.draw(MESSAGES[kind].cases))


@every_message
def test_extreme_messages_have_the_bytes_of_rosbags(kind):
    for case in MESSAGES[kind].worst:
        check_bytes(kind, case)


def leaves(message):
    """Return the numbers and texts of a message, of rclpy or rosbags, with their fields."""
    if isinstance(message, str):
        return [message]
    if isinstance(message, bool | int | float | np.number):
        return [repr(float(message))]
    if hasattr(message, 'get_fields_and_field_types'):
        fields = message.get_fields_and_field_types()
    elif hasattr(message, '__msgtype__'):
        fields = [name for name in vars(message) if name.islower() and name != '__msgtype__']
    else:
        return [len(message), *(leaf for each in message for leaf in leaves(each))]
    return [(name, leaf) for name in fields for leaf in leaves(getattr(message, name))]


def check_rclpy(kind, case):
    serialization = pytest.importorskip('rclpy.serialization')
    package, _, name = kind.split('/')
    written = MESSAGES[kind].ours(*case)
    read = serialization.deserialize_message(
        written, getattr(import_module(f'{package}.msg'), name)
    )
    assert leaves(read) == leaves(MESSAGES[kind].theirs(*case))
    # Its padding, and some bytes behind the message, are whatever stood in the memory before:
    # rosbags writes what it reads of them once more, with zeros there.
    again = serialization.serialize_message(read)[: len(written)]
    assert serialized(STORE.deserialize_cdr(again, kind), kind) == written


@every_message
@given(data=st.data())
def test_rclpy_reads_and_rewrites_written_messages(kind, data):
    check_rclpy(kind, data.draw(MESSAGES[kind].cases))


@every_message
def test_rclpy_reads_and_rewrites_extreme_messages(kind):
    for case in MESSAGES[kind].worst:
        check_rclpy(kind, case)


def test_writer_keeps_no_values_of_earlier_messages():
    # What a toggle leaves out is not what the message before it had.
    full, toggle = ([1.0, 2.0], [3.0, 4.0], [5.0, 6.0]), ([1.0, 2.0], [], [])
    writer = JointTrajectoryWriter(['a', 'b'])
    kind = 'trajectory_msgs/msg/JointTrajectory'
    for numbers in (full, toggle, full):
        expected = serialized(joint_trajectory(['a', 'b'], NS, *numbers), kind)
        assert writer.write(NS, *numbers) == expected


@given(
    st.complex_numbers(max_magnitude=1e9, allow_nan=False),
    st.floats(-10.0, 10.0),
    st.lists(places, min_size=2, max_size=2),
    st.booleans(),
)
def test_marker_writer_changes_only_the_moved_fields(at, angle, drawn, shown):
    other = FULL._replace(number=8)
    writer = MarkerArrayWriter('ground', [other, FULL, other])
    writer.place_marker(1, at, angle)
    writer.colour_marker(1, (1.0, 0.0, 0.5, 0.25))
    writer.move_points(1, drawn)
    writer.show_marker(1, shown)
    moved = FULL._replace(
        at=(at.real, at.imag, FULL.at[2]),  # its height stays
        colour=(1.0, 0.0, 0.5, 0.25),
        points=drawn,
        action=ADD if shown else DELETE,
    )
    expected = marker_array('ground', [other, FULL, other], 3 * NS)
    expected.markers[1] = marker_message('ground', moved, 3 * NS, angle)
    assert writer.message_at(3 * NS) == serialized(expected, 'visualization_msgs/msg/MarkerArray')


@given(
    places, st.tuples(*[st.floats(-9.0, 9.0)] * 3).filter(lambda way: max(map(abs, way)) > 1e-3)
)
def test_a_rod_lies_between_two_places(start, way):
    start = tuple(each % 7.0 for each in start)
    end = tuple(a + b for a, b in zip(start, way, strict=True))
    writer = MarkerArrayWriter('ground', [FULL, FULL])
    writer.lay_rod(1, start, end)
    told = STORE.deserialize_cdr(writer.message_at(NS), 'visualization_msgs/msg/MarkerArray')
    still, rod = told.markers
    assert (still.pose.position.x, still.scale.z) == (10.0, 3.0)
    turn, at = rod.pose.orientation, rod.pose.position
    turned = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).apply([0.0, 0.0, rod.scale.z])
    assert turned == pytest.approx(way, abs=1e-9)
    middle = [0.5 * (a + b) for a, b in zip(start, end, strict=True)]
    assert [at.x, at.y, at.z] == pytest.approx(middle, abs=1e-9)
    assert (rod.scale.x, rod.scale.y) == (1.0, 2.0)


# Declarations, against the definitions that rosbags has of Jazzy's.

DECLARATIONS = {
    'diagnostic_msgs/msg/DiagnosticArray': DIAGNOSTIC_ARRAY,
    'sensor_msgs/msg/JointState': JOINT_STATE_FIELDS,
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


def numbers_in(kind):
    """Return how many numbers a type holds, all of one kind; 0 where it holds anything else."""
    fields = list(defined(kind)) if kind in STORE.fielddefs else []
    counts = [numbers_in(inner) if inner in STORE.fielddefs else 1 for _, inner, _ in fields]
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
            assert int(field.kind[:-1]) == numbers_in(inner)


@pytest.mark.parametrize('kind', DECLARATIONS)
def test_declared_fields_equal_those_of_ros(kind):
    check(DECLARATIONS[kind], kind)


@pytest.mark.parametrize('kind', DECLARATIONS)
def test_empty_message_equals_ros_and_truncated_is_malformed(kind):
    message = pack_message(DECLARATIONS[kind], {})
    assert STORE.serialize_cdr(STORE.deserialize_cdr(message, kind), kind) == message
    assert parse_message(message + b'more', DECLARATIONS[kind]) == parse_message(
        message, DECLARATIONS[kind]
    )
    for end in range(len(message)):
        with pytest.raises(MalformedError):
            parse_message(message[:end], DECLARATIONS[kind])
