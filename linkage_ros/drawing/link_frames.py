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
A linkage's shapes in the frames of the links that carry them, as plain data.

Drawn once in a pose, and from then on moved with the links: what draws them anew, picture by
picture, needs no kinematics. So a rod in a tube keeps the length that it has in that pose.
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from linkage_ros.drawing.figure import all_places, symbol_size, View
from linkage_ros.drawing.painting import corners, outline
from linkage_ros.drawing.shapes import carried_shapes, Circle, Segment, Shape
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import GROUND
from linkage_ros.kinematics.results import Position

_DIGITS = 6
"""Significant ones of what is drawn: a thousandth of a pixel."""


class LinkFrame(NamedTuple):
    """Where the frame of a link is in that of the ground, in [m], and its angle, in [rad]."""

    place: complex
    angle: float


def link_frames(closure: Closure, position: Position) -> dict[str, LinkFrame]:
    """
    Return where the links stand, and the blocks of sliders that are no links.

    Such a block has its frame in the slider's point, turned as what it slides along.
    """
    points, angles = closure.points(position), closure.link_angles(position)
    found = {}
    for link, named in closure.linkage.links.items():
        point, (x, y) = next(iter(named.items()))
        angle = angles[link]
        found[link] = LinkFrame(points[link, point] - complex(x, y) * rect(1.0, angle), angle)
    for block, along, point in blocks(closure):
        found[block] = LinkFrame(points[block, point], angles[along])
    return found


def blocks(closure: Closure) -> list[tuple[str, str, str]]:
    """Return the blocks that are no links: name, what they slide along, the slider's point."""
    links = closure.linkage.links
    return [
        (block, slider.along, slider.point)
        for name, slider in closure.linkage.sliders.items()
        if (block := closure.structure.blocks[name]) not in links
    ]


def drawn_in_frames(shown: View) -> dict[str, Any]:
    """
    Return a linkage as it is drawn, as JSON has it; lengths are in [m].

    ``shapes`` come in the order in which they are painted. Each has the ``link`` in whose frame it
    stands, its ``role`` (see `linkage_ros.drawing.shapes`), and ``points``, x and y in turn: of a
    circle its centre, beside a ``radius``; of a segment its ends; of an area its corners, with
    ``closed``. ``frame`` is the lower left and upper right of all that it reaches, ``size`` half
    the width of a bar, ``paths`` the curves of the traced points over the range of the input.
    """
    size = symbol_size(shown)
    frames = link_frames(shown.closure, shown.position)
    drawn = carried_shapes(shown.closure, shown.position, size, shown.sweep.travels)
    reached = [*all_places(shown), *(p for _, shape in drawn for p in outline(shape))]
    low, high = corners(reached)
    margin = 2.0 * size * (1 + 1j)
    return {
        'size': _short(size),
        'frame': _flat([low - margin, high + margin]),
        'shapes': [_shape(link, shape, frames) for link, shape in drawn],
        'paths': {name: _flat(path) for name, path in shown.sweep.paths.items()}
        if len(shown.closure.linkage.inputs) == 1
        else {},
        'traced': [
            {'point': name, 'link': link, 'at': list(shown.closure.linkage.links[link][name])}
            for name, link in _carriers(shown.closure).items()
        ],
    }


def _shape(link: str, shape: Shape, frames: Mapping[str, LinkFrame]) -> dict[str, Any]:
    # The ground's own frame is that in which all is drawn.
    frame = LinkFrame(0j, 0.0) if link == GROUND else frames[link]
    back = rect(1.0, -frame.angle)

    def within(places: Sequence[complex]) -> list[float]:
        return _flat([(place - frame.place) * back for place in places])

    found: dict[str, Any] = {'link': link, 'role': shape.role, 'name': shape.name}
    if isinstance(shape, Circle):
        return {**found, 'points': within([shape.centre]), 'radius': _short(shape.radius)}
    if isinstance(shape, Segment):
        return {**found, 'points': within([shape.start, shape.end])}
    return {**found, 'points': within(shape.corners), 'closed': True}


def _carriers(closure: Closure) -> dict[str, str]:
    """Return for each traced point a link that has it."""
    links = closure.linkage.links
    return {
        point: next(link for link, named in links.items() if point in named)
        for point in closure.linkage.traced
    }


def _flat(places: Sequence[complex]) -> list[float]:
    return [_short(value) for place in places for value in (place.real, place.imag)]


def _short(value: float) -> float:
    return float(f'{value:.{_DIGITS}g}')
