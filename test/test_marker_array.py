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


"""MarkerArray bytes, against rosbags, which has a CDR of its own, and rclpy."""

from __future__ import annotations

from math import cos, sin

from hypothesis import example, given
from hypothesis import strategies as st
from linkage_ros.messages.marker_array import ADD, DELETE, Marker, MarkerArrayWriter
import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPE = 'visualization_msgs/msg/MarkerArray'
NS = 1_000_000_000

texts = st.text(st.characters(exclude_categories=['Cs'], exclude_characters='\0'), max_size=9)
numbers = st.floats(allow_nan=False, allow_infinity=False)
places = st.tuples(numbers, numbers, numbers)
# What a float32 holds comes back as it was.
share = st.sampled_from([0.0, 0.25, 0.5, 1.0])
times = st.integers(0, (2**31 - 1) * NS)
markers_ = st.builds(
    Marker,
    ns=texts,
    number=st.integers(-(2**31), 2**31 - 1),
    kind=st.integers(0, 12),
    scale=places,
    colour=st.tuples(share, share, share, share),
    points=st.lists(places, max_size=4),
    at=st.complex_numbers(allow_nan=False, allow_infinity=False),
    z=numbers,
    text=texts,
    action=st.sampled_from([ADD, DELETE]),
    lifetime=times,
)
arrays = st.tuples(texts, st.lists(markers_, max_size=4), times)

FULL = Marker(
    'links', 7, 4, (1.0, 2.0, 3.0), (0.25, 0.5, 0.75, 1.0),
    [(4.0, 5.0, 6.0), (7.0, 8.0, 9.0)], 10 + 11j, 12.0, 'offen', ADD, 13 * NS + 14,
)  # fmt: skip
WORST = [
    ('ground', [FULL], 15 * NS + 16),
    ('', [], 0),
    # Every length of a text before what stands at multiples of eight.
    *(('g' * n, [FULL._replace(text='t' * m), FULL], (2**31 - 1) * NS)
      for n in range(8) for m in range(4)),
    ('a', [FULL._replace(points=[]), FULL._replace(action=DELETE, text='')], 1),
]  # fmt: skip


def every_case(test):
    for case in WORST:
        test = example(case)(test)
    return given(arrays)(test)


def as_rosbags_has_it(frame, marker, stamp, angle=0.0):
    """Return a marker with every field of its message, in their order."""
    types = STORE.types
    header, point = types['std_msgs/msg/Header'], types['geometry_msgs/msg/Point']
    time = types['builtin_interfaces/msg/Time']
    colour = types['std_msgs/msg/ColorRGBA']
    quaternion = types['geometry_msgs/msg/Quaternion']
    nothing = np.array([], np.uint8)
    return types['visualization_msgs/msg/Marker'](
        header=header(time(*divmod(stamp, NS)), frame),
        ns=marker.ns,
        id=marker.number,
        type=marker.kind,
        action=marker.action,
        pose=types['geometry_msgs/msg/Pose'](
            point(marker.at.real, marker.at.imag, marker.z),
            quaternion(0.0, 0.0, sin(angle / 2), cos(angle / 2)),
        ),
        scale=types['geometry_msgs/msg/Vector3'](*marker.scale),
        color=colour(*marker.colour),
        lifetime=types['builtin_interfaces/msg/Duration'](*divmod(marker.lifetime, NS)),
        frame_locked=False,
        points=[point(*place) for place in marker.points],
        colors=[],
        texture_resource='',
        texture=types['sensor_msgs/msg/CompressedImage'](header(time(0, 0), ''), '', nothing),
        uv_coordinates=[],
        text=marker.text,
        mesh_resource='',
        mesh_file=types['visualization_msgs/msg/MeshFile']('', nothing),
        mesh_use_embedded_materials=False,
    )


def serialized(markers):
    return bytes(STORE.serialize_cdr(STORE.types[TYPE](markers), TYPE))


@every_case
def test_writes_as_rosbags_does_to_the_last_byte(case):
    frame, markers, stamp = case
    expected = serialized([as_rosbags_has_it(frame, marker, stamp) for marker in markers])
    assert MarkerArrayWriter(frame, markers).message(stamp) == expected


@every_case
def test_rclpy_has_the_same_bytes_but_for_what_it_leaves_in_padding(case):
    serialization = pytest.importorskip('rclpy.serialization')
    messages = pytest.importorskip('visualization_msgs.msg')
    frame, markers, stamp = case
    written = MarkerArrayWriter(frame, markers).message(stamp)
    again = serialization.serialize_message(
        serialization.deserialize_message(written, messages.MarkerArray)
    )
    # rclpy does not clear its padding: read by another hand, its bytes say what ours say.
    assert len(again) == len(written)
    read = STORE.deserialize_cdr(again, TYPE)
    assert bytes(STORE.serialize_cdr(read, TYPE)) == written


def test_rclpy_reads_every_field():
    serialization = pytest.importorskip('rclpy.serialization')
    messages = pytest.importorskip('visualization_msgs.msg')
    message = MarkerArrayWriter('ground', [FULL]).message(15 * NS + 16)
    (read,) = serialization.deserialize_message(message, messages.MarkerArray).markers
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == (15, 16)
    assert (read.header.frame_id, read.ns, read.id) == ('ground', 'links', 7)
    assert (read.type, read.action) == (read.LINE_STRIP, read.ADD)
    place, turn = read.pose.position, read.pose.orientation
    assert (place.x, place.y, place.z) == (10.0, 11.0, 12.0)
    assert (turn.x, turn.y, turn.z, turn.w) == (0.0, 0.0, 0.0, 1.0)
    assert (read.scale.x, read.scale.y, read.scale.z) == (1.0, 2.0, 3.0)
    assert (read.color.r, read.color.g, read.color.b, read.color.a) == (0.25, 0.5, 0.75, 1.0)
    assert (read.lifetime.sec, read.lifetime.nanosec) == (13, 14)
    assert [(p.x, p.y, p.z) for p in read.points] == [(4.0, 5.0, 6.0), (7.0, 8.0, 9.0)]
    assert (read.text, read.frame_locked, list(read.colors)) == ('offen', False, [])
    assert (read.texture_resource, read.texture.format, read.mesh_resource) == ('', '', '')
    assert (len(read.texture.data), len(read.uv_coordinates)) == (0, 0)
    assert (read.mesh_file.filename, len(read.mesh_file.data)) == ('', 0)
    assert read.mesh_use_embedded_materials is False


@given(
    st.complex_numbers(max_magnitude=1e9, allow_nan=False),
    st.floats(-10.0, 10.0),
    st.lists(st.complex_numbers(max_magnitude=1e9, allow_nan=False), min_size=2, max_size=2),
    st.booleans(),
)
def test_what_moves_is_written_into_its_places_and_nothing_else(at, angle, drawn, shown):
    other = FULL._replace(number=8)
    writer = MarkerArrayWriter('ground', [other, FULL, other])
    writer.place(1, at, angle)
    writer.paint(1, (1.0, 0.0, 0.5, 0.25))
    writer.draw(1, drawn)
    writer.show(1, shown)
    moved = FULL._replace(
        at=at,
        colour=(1.0, 0.0, 0.5, 0.25),
        # Heights stay.
        points=[(p.real, p.imag, z) for p, z in zip(drawn, (6.0, 9.0), strict=True)],
        action=ADD if shown else DELETE,
    )
    expected = [
        as_rosbags_has_it('ground', other, 3 * NS),
        as_rosbags_has_it('ground', moved, 3 * NS, angle),
        as_rosbags_has_it('ground', other, 3 * NS),
    ]
    assert writer.message(3 * NS) == serialized(expected)
