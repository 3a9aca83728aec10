# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Serialize MarkerArray messages; after the first, only moving markers are changed in the bytes.

``visualization_msgs/msg/MarkerArray`` is the message that RViz and Foxglove draw. Its fields for
textures, meshes and per-point colours stay empty.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import cos, hypot, sin
from struct import Struct
from typing import Any, NamedTuple

from linkage_ros.messages.layout import (
    NANOSECONDS,
    NumberArray,
    pack_message,
    parse_declaration,
    parse_message,
)

ARROW, CYLINDER, LINE_STRIP, LINE_LIST, SPHERE_LIST = 0, 3, 4, 5, 7
TEXT_VIEW_FACING, TRIANGLE_LIST = 9, 11
"""Types of markers, as Marker.msg numbers them."""

ADD, DELETE = 0, 2
"""Actions on a marker."""

Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, from 0 to 1."""

Place = tuple[float, float, float]
"""x, y and z, in [m]."""

_COUNT = Struct('<I')
_STAMP = Struct('<iI')
_COLOUR = Struct('<4f')
_XY = _TURN = Struct('<2d')
_XYZ, _POSE = Struct('<3d'), Struct('<7d')

MARKER_ARRAY = parse_declaration(
    'Marker[] markers',
    Marker=parse_declaration(
        'Time stamp, string frame_id, string ns, int32 id, int32 type, int32 action, Pose pose, '
        'Vector3 scale, ColorRGBA color, Duration lifetime, bool frame_locked, Point[] points, '
        'ColorRGBA[] colors, string texture_resource, CompressedImage texture, '
        'UVCoordinate[] uv_coordinates, string text, string mesh_resource, MeshFile mesh_file, '
        'bool mesh_use_embedded_materials',
        CompressedImage=parse_declaration(
            'Time stamp, string frame_id, string format, uint8[] data'
        ),
        MeshFile=parse_declaration('string filename, uint8[] data'),
    ),
)


class Marker(NamedTuple):
    """A marker before serialization."""

    # Together they identify the marker.
    ns: str
    number: int
    kind: int  # Its type
    scale: Place  # Widths and lengths, depending on its type, in [m]
    colour: Colour  # Its colour
    points: Sequence[Place] = ()  # Points in its own frame, in [m]
    at: Place = (0.0, 0.0, 0.0)  # Origin of its frame, in [m]
    text: str = ''  # The text, of a text marker
    action: int = ADD  # `ADD` or `DELETE`
    lifetime: int = 0  # Time after which it disappears without an update, in [ns]; 0 for never


def _field_values(frame: str, marker: Marker) -> dict[str, Any]:
    """Return the fields of a marker that are not zero or empty."""
    return {
        'frame_id': frame,
        'ns': marker.ns,
        'id': marker.number,
        'type': marker.kind,
        'action': marker.action,
        'pose': (*marker.at, 0.0, 0.0, 0.0, 1.0),
        'scale': marker.scale,
        'color': marker.colour,
        'lifetime': divmod(marker.lifetime, NANOSECONDS),
        'points': marker.points,
        'text': marker.text,
    }


class MarkerArrayWriter:
    """Writes the same markers repeatedly, in their order; a change holds until the next change."""

    __slots__ = ('_buffer', '_where', '_widths')

    def __init__(self, frame: str, markers: Sequence[Marker]) -> None:
        message = pack_message(
            MARKER_ARRAY, {'markers': [_field_values(frame, marker) for marker in markers]}
        )
        self._buffer = bytearray(message)
        self._widths = [marker.scale[:2] for marker in markers]
        self._where = [
            {name: field.first for name, field in marker.items() if isinstance(field, NumberArray)}
            for marker in parse_message(message, MARKER_ARRAY)['markers']
        ]

    def message_at(self, stamp: int) -> bytes:
        """Return the message for a time, in [ns]."""
        time = divmod(stamp, NANOSECONDS)
        for where in self._where:
            _STAMP.pack_into(self._buffer, where['stamp'], *time)
        return bytes(self._buffer)

    def show_marker(self, number: int, shown: bool) -> None:
        """Show or delete a marker."""
        _COUNT.pack_into(self._buffer, self._where[number]['action'], ADD if shown else DELETE)

    def place_marker(self, number: int, place: complex, angle: float) -> None:
        """Move a marker's frame to a place in [m], turned by an angle in [rad]."""
        at = self._where[number]['pose']
        _XY.pack_into(self._buffer, at, place.real, place.imag)
        _TURN.pack_into(self._buffer, at + 40, sin(0.5 * angle), cos(0.5 * angle))

    def lay_rod(self, number: int, start: Place, end: Place) -> None:
        """Lay a cylinder between two places, in [m]."""
        where = self._where[number]
        x, y, z = (last - first for first, last in zip(start, end, strict=True))
        length = hypot(x, y, z)
        middle = [0.5 * (first + last) for first, last in zip(start, end, strict=True)]
        # Half of the turn about the bisector of the z axis and the rod, which may point down.
        across = hypot(x, y)
        above = length + z if z > 0.0 else across * across / ((length - z) or 1.0)
        turn = (-y, x, 0.0, above) if across or z > 0.0 else (1.0, 0.0, 0.0, 0.0)
        turned = hypot(*turn)
        _POSE.pack_into(
            self._buffer, where['pose'], *middle, *(component / turned for component in turn)
        )
        _XYZ.pack_into(self._buffer, where['scale'], *self._widths[number], length)

    def colour_marker(self, number: int, colour: Colour) -> None:
        """Give a marker another colour."""
        _COLOUR.pack_into(self._buffer, self._where[number]['color'], *colour)

    def move_points(self, number: int, places: Iterable[Place]) -> None:
        """Move the points of a marker, which stay as many, to places in its frame, in [m]."""
        at = self._where[number]['points']
        for place in places:
            _XYZ.pack_into(self._buffer, at, *place)
            at += _XYZ.size
