# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A drawing as data for pages: shapes in the frames of the links that carry them."""

from __future__ import annotations

from cmath import rect
from collections.abc import Mapping, Sequence
from typing import Any

from linkage_ros.kinematics import (
    all_places,
    bounding_corners,
    carried_shapes,
    Circle,
    frames_of_links,
    LinkageView,
    LinkFrame,
    PlanarClosure,
    Position,
    Segment,
    Shape,
    shape_outline,
    symbol_size,
    traced_carriers,
)

_DIGITS = 6
"""Significant digits of places: a thousandth of a pixel."""


def drawn_in_frames(shown: LinkageView) -> dict[str, Any]:
    """
    Return the drawing of a linkage as JSON data; lengths are in [m].

    ``shapes`` come in the order in which they are painted. Each has the ``link`` of its frame, its
    ``role`` (see `linkage_ros.kinematics.analysis.shapes`), and ``points``, x and y in turn: of a
    circle its centre, with a ``radius``; of a segment its ends; of an area its corners, with
    ``closed``. ``frame`` is the lower left and upper right corner of the drawing, ``size`` half
    the width of a bar, ``paths`` the curves of the traced points over the range of the input.
    """
    size = symbol_size(shown)
    drawn = carried_shapes(shown.closure, shown.position, size, shown.sweep.travels)
    reached = [*all_places(shown), *(p for _, shape in drawn for p in shape_outline(shape))]
    low, high = bounding_corners(reached)
    margin = 2.0 * size * (1 + 1j)
    return {
        'frame': _flatten_places([low - margin, high + margin]),
        'paths': {name: _flatten_places(path) for name, path in shown.sweep.paths.items()}
        if len(shown.closure.linkage.inputs) == 1
        else {},
        **_carried_shapes(shown.closure, shown.position, size, drawn),
    }


def pose_in_frames(closure: PlanarClosure, position: Position, size: float) -> dict[str, Any]:
    """
    Return the drawing of a linkage of pins without its motion: it takes a tenth of the time.

    The linkage has no slider, and the position closes. ``size`` is half the width of a bar, in
    [m].
    """
    drawn = carried_shapes(closure, position, size, {})
    return _carried_shapes(closure, position, size, drawn)


def _carried_shapes(
    closure: PlanarClosure, position: Position, size: float, drawn: Sequence[tuple[str, Shape]]
) -> dict[str, Any]:
    frames = frames_of_links(closure, position)
    return {
        'size': _round_digits(size),
        'shapes': [_shape_data(link, shape, frames) for link, shape in drawn],
        'traced': [
            {'point': name, 'link': link, 'at': list(closure.linkage.links[link][name])}
            for name, link in traced_carriers(closure.linkage).items()
        ],
    }


def _shape_data(link: str, shape: Shape, frames: Mapping[str, LinkFrame]) -> dict[str, Any]:
    frame = frames[link]
    back = rect(1.0, -frame.angle)

    def flat_places(places: Sequence[complex]) -> list[float]:
        return _flatten_places([(place - frame.place) * back for place in places])

    data: dict[str, Any] = {'link': link, 'role': shape.role, 'name': shape.name}
    if isinstance(shape, Circle):
        return {
            **data,
            'points': flat_places([shape.centre]),
            'radius': _round_digits(shape.radius),
        }
    if isinstance(shape, Segment):
        return {**data, 'points': flat_places([shape.start, shape.end])}
    return {**data, 'points': flat_places(shape.corners), 'closed': True}


def _flatten_places(places: Sequence[complex]) -> list[float]:
    return [_round_digits(value) for place in places for value in (place.real, place.imag)]


def _round_digits(value: float) -> float:
    return float(f'{value:.{_DIGITS}g}')
