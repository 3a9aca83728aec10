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
MarkerArray messages as bytes (CDR): packed once, and of each message only what moves written anew.

``visualization_msgs/msg/MarkerArray`` is what RViz and Foxglove draw. Of its fields those stay
empty that hold textures, meshes and colours of single points.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import cos, sin
from struct import Struct
from typing import NamedTuple

from linkage_ros.cdr import aligned, ENCAPSULATION
from linkage_ros.joint_state import NANOSECONDS

ARROW, LINE_STRIP, LINE_LIST, SPHERE_LIST = 0, 4, 5, 7
TEXT_VIEW_FACING, TRIANGLE_LIST = 9, 11
"""Types of markers, as Marker.msg numbers them."""

ADD, DELETE = 0, 2
"""What is to be done with a marker."""

Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, from 0 to 1."""

Place = tuple[float, float, float]
"""x, y and z, in [m]."""


class Marker(NamedTuple):
    """
    A marker as it is packed.

    Attributes
    ----------
    ns, number
        What tells it from the others.
    kind
        Its type.
    scale
        Widths and lengths of its kind, in [m].
    colour
        Its colour.
    points
        In its own frame.
    at, z
        Where its frame's origin is, in [m].
    text
        What a text says.
    action
        `ADD` or `DELETE`.
    lifetime
        After which it goes if it does not come again, in [ns]; 0 for never.

    """

    ns: str
    number: int
    kind: int
    scale: Place
    colour: Colour
    points: Sequence[Place] = ()
    at: complex = 0j
    z: float = 0.0
    text: str = ''
    action: int = ADD
    lifetime: int = 0


_COUNT = Struct('<I')
_STAMP = Struct('<iI')
_KIND = Struct('<iii')
_PLACE = Struct('<3d')
_POSE = Struct('<7d')
_COLOUR = Struct('<4f')
_XY = Struct('<2d')
_TURN = Struct('<2d')


class _Where(NamedTuple):
    """Where the fields of a marker stand that change."""

    stamp: int
    action: int
    pose: int
    colour: int
    points: int


class MarkerArrayWriter:
    """
    Writes the same markers again and again.

    What is changed stays so until it is changed again.

    Parameters
    ----------
    frame
        In which all of them stand.
    markers
        The markers, in their order.

    """

    __slots__ = ('_buffer', '_where')

    def __init__(self, frame: str, markers: Sequence[Marker]) -> None:
        packed = _Packed()
        packed.count(len(markers))
        self._where = tuple(packed.marker(frame, marker) for marker in markers)
        self._buffer = packed.data

    def message(self, stamp: int) -> bytes:
        """Return the message of a state at a time in [ns]."""
        time = divmod(stamp, NANOSECONDS)
        for where in self._where:
            _STAMP.pack_into(self._buffer, where[0], *time)
        return bytes(self._buffer)

    def show(self, number: int, shown: bool) -> None:
        """Add a marker, or delete it."""
        _COUNT.pack_into(self._buffer, self._where[number][1], ADD if shown else DELETE)

    def place(self, number: int, place: complex, angle: float) -> None:
        """Move a marker's frame to a place in [m], turned by an angle in [rad]."""
        at = self._where[number][2]
        _XY.pack_into(self._buffer, at, place.real, place.imag)
        _TURN.pack_into(self._buffer, at + 40, sin(0.5 * angle), cos(0.5 * angle))

    def paint(self, number: int, colour: Colour) -> None:
        """Give a marker another colour."""
        _COLOUR.pack_into(self._buffer, self._where[number][3], *colour)

    def draw(self, number: int, places: Iterable[complex]) -> None:
        """Move the points of a marker, which stay as many, to places in its frame, in [m]."""
        at = self._where[number][4]
        for place in places:
            _XY.pack_into(self._buffer, at, place.real, place.imag)
            at += 24


class _Packed:
    """Bytes to which fields are added, each at a multiple of its size."""

    def __init__(self) -> None:
        self.data = bytearray(ENCAPSULATION)

    def _add(self, fields: Struct, size: int, *values: float) -> int:
        """Return where the values stand."""
        self.data.extend(bytes(aligned(len(self.data), size) - len(self.data)))
        at = len(self.data)
        self.data.extend(fields.pack(*values))
        return at

    def count(self, number: int) -> int:
        return self._add(_COUNT, 4, number)

    def _text(self, text: str) -> None:
        data = text.encode() + b'\0'
        self.count(len(data))
        self.data.extend(data)

    def marker(self, frame: str, marker: Marker) -> _Where:
        stamp = self._add(_STAMP, 4, 0, 0)
        self._text(frame)
        self._text(marker.ns)
        kind = self._add(_KIND, 4, marker.number, marker.kind, marker.action)
        x, y = marker.at.real, marker.at.imag
        pose = self._add(_POSE, 8, x, y, marker.z, 0.0, 0.0, 0.0, 1.0)
        self._add(_PLACE, 8, *marker.scale)
        colour = self._add(_COLOUR, 4, *marker.colour)
        self._add(_STAMP, 4, *divmod(marker.lifetime, NANOSECONDS))
        self.data.append(0)  # frame_locked
        points = self.count(len(marker.points)) + 4
        points = aligned(points, 8) if marker.points else points
        for point in marker.points:
            self._add(_PLACE, 8, *point)
        self.count(0)  # colors
        self._text('')  # texture_resource
        self._add(_STAMP, 4, 0, 0)
        for _ in range(2):  # frame_id and format of the texture
            self._text('')
        self.count(0)  # its data
        self.count(0)  # uv_coordinates
        self._text(marker.text)
        for _ in range(2):  # mesh_resource and the mesh's file name
            self._text('')
        self.count(0)  # its data
        self.data.append(0)  # mesh_use_embedded_materials
        return _Where(stamp, kind + 8, pose, colour, points)
