# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The links of a linkage as flat parts with holes, as DXF for a laser cutter or a mill.

The parts lie side by side in their true size, in [mm]: outlines on the layer CUT, holes and slots
on HOLE, names on NAME; the linkage in a pose is on ASSEMBLY, which is switched off. A link has a
hole at each pin, and a slot where a slider of another link runs in it.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Sequence
from io import StringIO
from itertools import islice
from math import tan, tau
from typing import Any, NamedTuple

from linkage_ros.errors import check_installed
from linkage_ros.kinematics import (
    bounding_corners,
    convex_hull,
    frames_of_links,
    LinkageView,
    links_by_point,
    PlanarClosure,
    prepare_view,
    symbol_size,
    usual_inputs,
)
from linkage_ros.names import dxf_text

_MM = 1e3
_HOLE = 0.4
"""Diameter of a hole, and width of a slot, relative to the width of a bar."""

_ROW = 6
"""Parts in a row."""

_FLATTEST = 1e-12


class _FlatPart(NamedTuple):
    """A link in its own frame, in [mm]: the corners of its outline, its holes and slots."""

    name: str
    corners: Sequence[complex]
    holes: Sequence[complex]
    slots: Sequence[tuple[complex, complex]]


def links_dxf(closure: PlanarClosure) -> bytes:
    """
    Return the links as a DXF file, bars as wide as in a drawing.

    A LinkageError is raised if ezdxf is not installed.
    """
    check_installed('ezdxf', "pip install 'linkage_ros[view]'")
    from ezdxf import filemanagement, units  # local import: an extra, and slow to load

    shown = prepare_view(closure, usual_inputs(closure))
    wide = _MM * 2.0 * symbol_size(shown)
    bore = _HOLE * wide
    document = filemanagement.new(units=units.MM)
    for name, colour in (('CUT', 7), ('HOLE', 1), ('NAME', 3), ('ASSEMBLY', 8)):
        document.layers.add(name, color=colour)
    document.layers.get('ASSEMBLY').off()
    space = document.modelspace()
    parts = list(_list_parts(shown))
    margin = complex(wide, wide) / 2.0
    boxes = [bounding_corners(part.corners) for part in parts]
    sizes = [top - low + 2.0 * margin for low, top in boxes]
    place = 0j
    for index, (part, (low, _), size) in enumerate(zip(parts, boxes, sizes, strict=True)):
        if index % _ROW == 0:
            tallest = max(size.imag for size in islice(sizes, index, index + _ROW))
            place = complex(0.0, place.imag - tallest - 2.0 * wide)
        _draw_part(space, part, place - low + margin, 0.0, wide, bore)
        text = space.add_text(dxf_text(part.name), height=wide / 3.0, dxfattribs={'layer': 'NAME'})
        text.set_placement((place.real, place.imag - wide / 2.0))
        place += size.real + wide
    # Below the parts, as the linkage stands.
    low, top = bounding_corners([place * _MM for place in closure.points(shown.position).values()])
    below = complex(0.0, place.imag - 2.0 * wide) - complex(low.real, top.imag + wide)
    frames = frames_of_links(closure, shown.position)
    for part in parts:
        frame = frames[part.name]
        _draw_part(space, part, below + frame.place * _MM, frame.angle, wide, bore, 'ASSEMBLY')
    written = StringIO()
    document.write(written)
    return written.getvalue().encode()


def _list_parts(shown: LinkageView) -> list[_FlatPart]:
    """Return the links as parts."""
    closure = shown.closure
    linkage = closure.linkage
    shared = {name for name, links in links_by_point(linkage.links).items() if len(links) > 1}
    shared |= {slider.point for slider in linkage.sliders.values()}
    parts = []
    for link, points in linkage.links.items():
        places = {name: complex(x, y) * _MM for name, (x, y) in points.items()}
        slots = []
        for name, slider in linkage.sliders.items():
            if slider.along == link:
                low, high = shown.sweep.travels.get(name, (0.0, 0.0))
                through = places[slider.through]
                slots.append(
                    (through + slider.unit * low * _MM, through + slider.unit * high * _MM)
                )
        ends = [*places.values(), *(end for slot in slots for end in slot)]
        holes = [at for name, at in places.items() if name in shared]
        parts.append(_FlatPart(link, convex_hull(ends), holes, slots))
    return parts


def _draw_part(
    space: Any, part: _FlatPart, place: complex, angle: float, wide: float, bore: float,
    layer: str = '',
) -> None:  # fmt: skip
    """Add a part in a place; on its own layers, or all on one."""

    def place_point(point: complex) -> complex:
        return place + point * rect(1.0, angle)

    attributes = {'layer': layer or 'CUT'}
    outline = _part_outline([place_point(corner) for corner in part.corners], wide / 2.0)
    space.add_lwpolyline(outline, format='xyb', close=True, dxfattribs=attributes)
    attributes = {'layer': layer or 'HOLE'}
    for hole in part.holes:
        centre = place_point(hole)
        space.add_circle((centre.real, centre.imag), bore / 2.0, dxfattribs=attributes)
    for start, end in part.slots:
        outline = _part_outline(convex_hull([place_point(start), place_point(end)]), bore / 2.0)
        space.add_lwpolyline(outline, format='xyb', close=True, dxfattribs=attributes)


def _part_outline(places: Sequence[complex], radius: float) -> list[tuple[float, float, float]]:
    """Return the outline at a distance around a convex polygon: x, y and bulge of each vertex."""
    if len(places) == 1:
        centre = places[0]
        return [(centre.real - radius, centre.imag, 1.0), (centre.real + radius, centre.imag, 1.0)]
    vertices = []
    for index, corner in enumerate(places):
        coming = phase(corner - places[index - 1])
        going = phase(places[(index + 1) % len(places)] - corner)
        turn = (going - coming) % tau
        if turn < _FLATTEST:
            turn = 0.0
        for way, bulge in ((coming, tan(turn / 4.0)), (going, 0.0)):
            at = corner + rect(radius, way - tau / 4.0)
            vertices.append((at.real, at.imag, bulge))
    return vertices
