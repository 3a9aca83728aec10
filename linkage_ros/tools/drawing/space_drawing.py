# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The axonometric picture of a spatial linkage.

The camera is far away: lengths across its view are true. Azimuth and elevation are the direction
in which it stands, and the z axis of the ground points up in the picture.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, pairwise
from math import radians
from typing import Any, NamedTuple

from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import (
    Circle,
    convex_hull,
    drawn_once,
    LinkageView,
    Part,
    Polygon,
    round_corners,
    Segment,
    Shape,
    SpaceDrawing,
)
from linkage_ros.tools.drawing.painting import DrawnLinkage, DrawnName
import numpy as np
from numpy.typing import NDArray

Places = NDArray[np.float64]

_SAME = 1e-6
"""Shortest line that has a direction, relative to the extent."""

_AZIMUTHS, _ELEVATIONS = [a for a in range(-170, 190, 10) if a % 90], (20, 30, 40)
"""Directions of which one is chosen, in [°]."""

_BESIDE = 0.87
"""Cosine of the angle between an axis and the direction in which it is seen, at most."""

_SHORTEST = 0.01
"""Length that is added to lines in the picture, relative to the extent: some are points."""

_FAINTEST, _FADING = 0.4, 0.6
"""Least strength of a shape, and what is lost of it over the extent of the linkage."""


class Camera(NamedTuple):
    """Where the camera stands, in [rad]: about the z axis from x to y, and above the x-y plane."""

    azimuth: float
    elevation: float

    @property
    def axes(self) -> Places:
        """Return, as rows, the directions to the right, up, and to the camera."""
        ca, sa = np.cos(self.azimuth), np.sin(self.azimuth)
        ce, se = np.cos(self.elevation), np.sin(self.elevation)
        return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])

    def project(self, places: Places) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
        """Return places in the picture, and how near they are to the camera, in [m]."""
        right, up, near = self.axes @ places.T
        return right + 1j * up, near


def choose_camera(
    drawing: SpaceDrawing,
    places: Places,
    azimuth: float | None = None,
    elevation: float | None = None,
) -> Camera:
    """
    Return the camera before which links hide each other least; its angles may be given.

    Of every 10° of azimuth and three elevations, where none is within 30° of an axis if that
    can be, it is the one that shortens lines between joints and points least, by the mean of
    the logarithms.
    """
    joined = places[drawing.joined_rows]
    lines = np.array([a - b for a, b in combinations(joined, 2)]).reshape(-1, 3)
    lines = lines[np.linalg.norm(lines, axis=1) > _SAME * drawing.extent]
    rows = [part.corners for part in drawing.parts if part.role == 'axis']
    axes = np.array([places[a] - places[b] for a, b in rows]).reshape(-1, 3)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    azimuths = [*map(radians, _AZIMUTHS)] if azimuth is None else [azimuth]
    elevations = [*map(radians, _ELEVATIONS)] if elevation is None else [elevation]
    cameras = [Camera(a, e) for e in elevations for a in azimuths]
    oblique = [
        camera for camera in cameras if np.abs(axes @ camera.axes[2]).max(initial=0.0) < _BESIDE
    ]

    def length_seen(camera: Camera) -> float:
        seen = np.abs(camera.project(lines)[0]) + _SHORTEST * drawing.extent
        return float(np.log(seen).mean()) if len(lines) else 0.0

    return max(oblique or cameras, key=length_seen)


def space_page_data(drawing: SpaceDrawing, seen: Places) -> dict[str, Any]:
    """Return the drawing as JSON data; ``seen`` are its places at many positions."""
    middle = 0.5 * (seen.min(axis=(0, 1)) + seen.max(axis=(0, 1)))
    away = seen - middle
    reach = [np.linalg.norm(places, axis=2).max() for places in (away[:, :, :2], away)]
    return {
        'camera': choose_camera(drawing, seen[0]),
        'middle': middle.tolist(),
        # To the side and upward, from wherever it is seen.
        'reach': [float(length) + 2.0 * drawing.size for length in reach],
        'size': drawing.size,
        'extent': drawing.extent,
        'has_lengths': drawing.has_lengths,
        'count': drawing.count,
        'tubes': drawing.tubes,
        'shapes': [
            {**part._asdict(), 'number': number, 'below': drawing.below(number)}
            for number, part in enumerate(drawing.parts)
        ],
        'traced': [
            {'point': name, 'link': drawing.points[name], 'at': []} for name in drawing.traced
        ],
        'paths': {},
    }


def projected_shapes(
    drawing: SpaceDrawing, places: Places, camera: Camera
) -> list[tuple[Shape, float]]:
    """Return shapes in the picture, the farthest first, each with its strength from 0 to 1."""
    seen, near = camera.project(places)
    depths = [float(np.mean(near[list(part.corners)])) for part in drawing.parts]
    nearest, painted = max(depths), []
    for i, part in enumerate(drawing.parts):
        # A rail is behind all.
        order = max([depths[i], *(depths[number] for number in drawing.below(i))])
        shape = _shape_of(part, [complex(seen[row]) for row in part.corners], drawing.size)
        strength = max(_FAINTEST, 1.0 - _FADING * (nearest - depths[i]) / drawing.extent)
        painted.append((part.role != 'rail', order, i, shape, strength))
    return [
        (shape, strength) for *_, shape, strength in sorted(painted, key=lambda entry: entry[:3])
    ]


def _shape_of(part: Part, corners: list[complex], size: float) -> Shape:
    radius = part.width * size
    if part.role in ('axis', 'rail'):
        return Segment(part.role, part.name, corners[0], corners[-1])
    if len(corners) == 1:
        return Circle(part.role, part.name, corners[0], radius)
    if len(corners) == 2 or part.is_hull:
        return Polygon(part.role, part.name, round_corners(convex_hull(corners), radius))
    ways = np.gradient(np.array(corners))
    across = 1j * radius * ways / np.maximum(np.abs(ways), _SAME * radius)
    edges = (*(corners + across), *(corners - across)[::-1])
    return Polygon(part.role, part.name, tuple(map(complex, edges)))


def skeleton_of(drawing: SpaceDrawing, places: Places, camera: Camera) -> Iterator[Segment]:
    """Yield the links as lines in the picture, for a pose in the background."""
    seen, _ = camera.project(places)
    for part in drawing.bodies:
        corners: Sequence[complex] = [complex(seen[row]) for row in part.corners]
        if part.is_hull:
            corners = convex_hull(corners)
            corners = [*corners, corners[0]] if len(corners) > 2 else corners
        for start, end in pairwise(corners):
            yield Segment('ghost', part.name, start, end)


def draw_spatial(shown: LinkageView, angles: Sequence[float | None]) -> DrawnLinkage:
    """Draw a spatial linkage from a camera, whose angles `choose_camera` takes."""
    drawing, closure = SpaceDrawing(shown.closure), shown.closure
    if not drawing.parts:
        raise LinkageError(closure.name, 'has only slides, which have no place', 'add a point')
    several = len(shown.inputs) > 1 and not shown.are_ghosts_given
    behind = [] if several else [drawing.places(ghost) for ghost in shown.ghosts]
    places = drawing.places(shown.position)
    camera = choose_camera(drawing, places, *angles)
    drawn = projected_shapes(drawing, places, camera)
    seen, _ = camera.project(places)
    paths = {
        name: drawn_once(camera.project(path)[0].tolist())
        for name, path in drawing.paths(shown.sweep, shown.inputs).items()
    }
    return DrawnLinkage(
        drawing.size,
        [shape for shape, _ in drawn],
        list(skeleton_of(drawing, places, camera)),
        [list(skeleton_of(drawing, places, camera)) for places in behind],
        paths,
        {name: complex(seen[drawing.points[name]]) for name in paths},
        list(_spatial_names(drawing, seen)),
        [strength for _, strength in drawn],
        camera,
        drawing.has_lengths,
    )


def _spatial_names(drawing: SpaceDrawing, seen: Any) -> Iterator[DrawnName]:
    for name, row in drawing.joints.items():
        yield DrawnName(name, (complex(seen[row]),), clear=1.8)
    for name, row in drawing.points.items():
        yield DrawnName(name, (complex(seen[row]),))
    for part in drawing.bodies:
        corners = [complex(seen[row]) for row in part.corners]
        anchors = [corners[len(corners) // 2], *corners[2:-2]]
        if len(corners) == 2:
            (start, end), parts = corners, (0.5, 0.35, 0.65, 0.25, 0.75)
            anchors = [start + (end - start) * part for part in parts]
        elif part.is_hull:
            anchors = [sum(corners) / len(corners)]
        yield DrawnName(part.name, anchors, is_link=True, clear=1.1)
