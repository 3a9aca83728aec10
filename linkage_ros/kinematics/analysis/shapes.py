# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage in a pose as an engineer draws it: shapes in metres, in the frame of the ground.

The shapes do not depend on how they are painted. Each has a role, which determines its look, and
the name of its part; they come in the order of painting, the topmost last. Links are bars, or
plates if they have three points that are not collinear.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import asin, ceil, pi, tau
from typing import Literal, NamedTuple

from linkage_ros.kinematics.plane.closure import PlanarClosure
from linkage_ros.kinematics.plane.linkage import GROUND, Slider
from linkage_ros.kinematics.results import Position

Role = Literal[
    'link', 'input', 'plate', 'block', 'tube', 'rail', 'slot', 'ground', 'hatch', 'pin', 'ghost',
    'hinge', 'base', 'ball', 'axis',
]  # fmt: skip
"""Kind of a shape; ``input`` is a driven link, ``base`` a joint of a spatial linkage's ground."""

Travels = Mapping[str, tuple[float, float]]
"""Lowest and highest slide of each slider in the drawing, in [m]."""

COLOURS = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#000000')
"""Colours of Okabe and Ito, which colour-blind readers can distinguish."""

INK = '#1f2d3a'
"""Colour of edges."""

FACES = {
    'link': '#c3d3e2',
    'plate': '#d3e0ecc0',
    'input': '#f0a07a',
    'block': '#fff6d6',
    'tube': '#e8edf2',
    'ground': '#ffffff',
    'hinge': '#ffffff',
    'base': '#8795a3',
    'ball': '#46596b',
}
"""Colour of a filled area, by its role."""

_FLAT = 1e-6
"""Largest distance of collinear points from their line, relative to its length."""

_ARC = pi / 8.0
_PITCH_PARTS = 72  # Of a pitch circle, which may be as large as the picture

_PULLEYS = 0.6
"""Sum of the radii of two pulleys, relative to the distance of their pins."""

_MOST_STROKES = 200
"""Strokes of a hatched line: a rail may be a thousand times as long as the links."""


class Polygon(NamedTuple):
    """A filled area."""

    role: Role
    name: str
    corners: tuple[complex, ...]


class Segment(NamedTuple):
    """A straight line."""

    role: Role
    name: str
    start: complex
    end: complex


class Circle(NamedTuple):
    """A circle about a pin."""

    role: Role
    name: str
    centre: complex
    radius: float


Shape = Polygon | Segment | Circle


def bounding_corners(places: Iterable[complex]) -> tuple[complex, complex]:
    """Return the lower left and the upper right corner of the bounding box of places."""
    xs, ys = zip(*((p.real, p.imag) for p in places), strict=True)
    return complex(min(xs), min(ys)), complex(max(xs), max(ys))


def shape_outline(shape: Shape) -> tuple[complex, ...]:
    """Return the corners of a shape's edge."""
    if isinstance(shape, Segment):
        return shape.start, shape.end
    if isinstance(shape, Polygon):
        return (*shape.corners, shape.corners[0])
    return tuple(shape.centre + shape.radius * way for way in (1, 1j, -1, -1j, 1))


def bar_size(picture: float, shortest: float) -> float:
    """Return half the width of a bar, in [m], for a picture and its shortest link."""
    return min(0.013 * picture, max(0.26 * shortest, 0.006 * picture))


class _DrawnPose(NamedTuple):
    """A linkage in a pose, with the values that the shapes need."""

    closure: PlanarClosure
    points: dict[tuple[str, str], complex]
    angles: dict[str, float]
    slides: dict[str, float]
    travels: Travels
    size: float


def draw_shapes(
    closure: PlanarClosure, position: Position, size: float, travels: Travels
) -> list[Shape]:
    """
    Return the shapes of a linkage at a position that closes.

    ``size`` is half the width of a bar, in [m]; all symbols scale with it. ``travels`` are the
    ranges of the slides, for the length of rails.
    """
    return [shape for _, shape in carried_shapes(closure, position, size, travels)]


def carried_shapes(
    closure: PlanarClosure, position: Position, size: float, travels: Travels
) -> list[tuple[str, Shape]]:
    """Draw a linkage as `draw_shapes` does; return each shape with the link that carries it."""
    pose = _DrawnPose(
        closure,
        closure.points(position),
        closure.link_angles(position),
        closure.slide_values(position),
        travels,
        size,
    )
    linkage, structure = closure.linkage, closure.structure
    cylinders = [name for name in linkage.sliders if _is_cylinder(pose, name)]
    ground: list[Shape] = []
    for name, slider in linkage.sliders.items():
        if slider.along == GROUND:
            ground += _ground_rail(pose, name, slider)
    for place in _ground_pins(pose):
        ground += _draw_support(place, size)
    drawn = [(GROUND, shape) for shape in ground]
    driven = driven_links(closure)
    links = [
        (link, _draw_link(pose, link, 'input' if link in driven else 'link', cylinders))
        for link in linkage.links
        if link != GROUND
    ]
    # Plates hide least below the bars, and driven links should be visible.
    for link, parts in sorted(links, key=lambda item: _shape_layer(item[1])):
        drawn += [(link, part) for part in parts]
    for name, slider in linkage.sliders.items():
        if name not in cylinders:
            drawn.append((structure.blocks[name], _draw_block(pose, name, slider)))
    drawn += _pitch_circles(pose)
    pins = {
        point: (link, Circle('pin', point, place, 0.55 * size))
        for (link, point), place in pose.points.items()
        if sum(point in points for points in structure.links.values()) > 1
    }
    return [*drawn, *pins.values()]


def draw_skeleton(closure: PlanarClosure, position: Position) -> list[Segment]:
    """Return the links as lines from point to point, for a pose in the background."""
    points = closure.points(position)
    blocks = closure.structure.blocks
    drawn = []
    for link, named in closure.linkage.links.items():
        if link == GROUND:
            continue
        places = [points[link, point] for point in named]
        for name, slider in closure.linkage.sliders.items():
            if slider.along == link:
                places.append(points[blocks[name], slider.point])
        corners = convex_hull(places)
        ends = [*corners[1:], corners[0]] if len(corners) > 2 else corners[1:]
        drawn += [Segment('ghost', link, *line) for line in zip(corners, ends, strict=False)]
    return drawn


class LinkFrame(NamedTuple):
    """Origin of a link's frame in the ground's frame, in [m], and its angle, in [rad]."""

    place: complex
    angle: float


def frames_of_links(closure: PlanarClosure, position: Position) -> dict[str, LinkFrame]:
    """Return the frames of the links, and of the blocks of sliders that are not links."""
    frames = closure.link_frames
    moving = zip(frames.links, frames.frames_at(position), strict=True)
    return {GROUND: LinkFrame(0j, 0.0)} | {link: LinkFrame(*frame) for link, frame in moving}


def driven_links(closure: PlanarClosure) -> set[str]:
    """Return the links that an input moves relative to their parent."""
    driven = set()
    for given in closure.linkage.inputs:
        if given.slider:
            driven.add(closure.structure.blocks[given.slider])
        elif given.child != GROUND:
            driven.add(given.child)
        else:
            driven.add(given.parent)
    return driven


def convex_hull(points: Iterable[complex]) -> list[complex]:
    """
    Return the corners of the convex hull of points, counter-clockwise.

    For collinear points, the two farthest; for one place, that place. (A. M. Andrew's chain.)
    """
    places = sorted(set(points), key=lambda p: (p.real, p.imag))
    if len(places) < 3:
        return places
    slack = _FLAT * max(abs(p - places[0]) for p in places) ** 2

    def half_hull(ordered: Iterable[complex]) -> list[complex]:
        corners: list[complex] = []
        for place in ordered:
            while len(corners) > 1:
                edge, onward = corners[-1] - corners[-2], place - corners[-2]
                if edge.real * onward.imag - edge.imag * onward.real > slack:
                    break
                corners.pop()
            corners.append(place)
        return corners[:-1]

    return half_hull(places) + half_hull(reversed(places))


def round_corners(corners: Sequence[complex], radius: float) -> tuple[complex, ...]:
    """Return the outline at a distance around a convex polygon, in order."""
    if len(corners) == 1:
        steps = round(tau / _ARC)
        return tuple(corners[0] + rect(radius, i * _ARC) for i in range(steps))
    outline = []
    for i, corner in enumerate(corners):
        coming = phase(corner - corners[i - 1]) - 0.5 * pi
        turn = (phase(corners[(i + 1) % len(corners)] - corner) - 0.5 * pi - coming) % tau
        steps = max(1, ceil(turn / _ARC - 1e-9))
        outline += [corner + rect(radius, coming + turn * j / steps) for j in range(steps + 1)]
    return tuple(outline)


def _pitch_circles(pose: _DrawnPose) -> Iterator[tuple[str, Shape]]:
    """Yield the pitch circles of gears, and belts on pulleys: ratios of pins on a common link."""
    inputs = {driven.joint: driven for driven in pose.closure.linkage.driven_joints}
    for name, ratio in pose.closure.linkage.ratios.items():
        joints = [inputs[name], inputs.get(ratio.of) or pose.closure.linkage.joints[ratio.of]]
        ends = [(getattr(j, 'parent', ''), getattr(j, 'child', '')) for j in joints]
        carrier = next((link for link in ends[0] if link and link in ends[1]), '')
        if not carrier:
            continue
        links = pose.closure.structure.links
        turning = [child if parent == carrier else parent for parent, child in ends]
        pins = [sorted({*links[link]} & {*links[carrier]}) for link in turning]
        if not all(pins) or turning[0] == turning[1]:
            continue
        first, second = (pose.points[carrier, shared[0]] for shared in pins)
        apart, size = second - first, abs(ratio.ratio)
        same = (ends[0][0] == carrier) == (ends[1][0] == carrier)
        meshes = (ratio.ratio < 0.0) == same
        radius = abs(apart) * (1.0 if meshes else _PULLEYS) / (1.0 + size)
        radii = radius, size * radius
        if not radius:
            continue
        for link, centre, r in zip(turning, (first, second), radii, strict=True):
            turns = [pose.angles[link] + k * tau / _PITCH_PARTS for k in range(_PITCH_PARTS + 1)]
            places = [centre + rect(r, turn) for turn in turns]
            for k, place in enumerate(places[1:]):
                yield link, Segment('rail', name, places[k], place)
            yield link, Segment('rail', name, centre, places[0])
        if not meshes:
            lean = asin((radii[0] - radii[1]) / abs(apart))
            for side in (1.0, -1.0):
                across = rect(1.0, phase(apart) + side * (0.5 * pi - lean))
                ends_of_belt = first + radii[0] * across, second + radii[1] * across
                yield carrier, Segment('rail', name, *ends_of_belt)


def _shape_layer(parts: Sequence[Shape]) -> int:
    roles = {shape.role for shape in parts}
    return 2 if 'input' in roles else 0 if 'plate' in roles else 1


def _is_cylinder(pose: _DrawnPose, name: str) -> bool:
    """Return whether a slider is a rod in a tube: both links move, with the same angle."""
    slider = pose.closure.linkage.sliders[name]
    lowest, _ = pose.travels[name]
    return bool(slider.block) and slider.along != GROUND != slider.block and lowest > 0.0


def _ground_pins(pose: _DrawnPose) -> list[complex]:
    """Return the places of the pins on the ground."""
    links = pose.closure.structure.links
    return [
        pose.points[GROUND, point]
        for point in links[GROUND]
        if any(point in points for link, points in links.items() if link != GROUND)
    ]


def _draw_support(pivot: complex, size: float) -> list[Shape]:
    """Draw a pivot on the ground: a triangle on hatched ground."""
    foot, half = pivot - 2.6j * size, 1.7 * size
    return [
        Polygon('ground', GROUND, (pivot, foot - half, foot + half)),
        *_draw_hatch(foot - 1.4 * half, foot + 1.4 * half, size),
    ]


def _draw_hatch(start: complex, end: complex, size: float) -> list[Shape]:
    """Draw the surface of the ground, which lies to the right of start→end."""
    along = (end - start) / abs(end - start)
    count = min(max(3, round(abs(end - start) / (0.9 * size))), _MOST_STROKES)
    stroke = along * complex(-0.7, -0.9) * size
    ticks = [start + (end - start) * (i + 0.8) / count for i in range(count)]
    return [
        Segment('rail', GROUND, start, end),
        *(Segment('hatch', GROUND, tick, tick + stroke) for tick in ticks),
    ]


def _slider_line(pose: _DrawnPose, slider: Slider) -> tuple[complex, complex]:
    """Return the start of a slider's line, and its direction."""
    direction = complex(*slider.direction)
    unit = direction / abs(direction) * rect(1.0, pose.angles[slider.along])
    return pose.points[slider.along, slider.through], unit


def _rail_ends(pose: _DrawnPose, name: str, beyond: float) -> tuple[complex, complex]:
    start, unit = _slider_line(pose, pose.closure.linkage.sliders[name])
    lowest, highest = pose.travels[name]
    return start + unit * (lowest - beyond), start + unit * (highest + beyond)


def _ground_rail(pose: _DrawnPose, name: str, slider: Slider) -> list[Shape]:
    """Draw a slider's line on the ground: a surface, hatched below."""
    size = pose.size
    start, end = _rail_ends(pose, name, 3.0 * size)
    _, unit = _slider_line(pose, slider)
    upright = abs(unit.real) <= _FLAT
    if unit.real < -_FLAT or (upright and unit.imag > 0.0):
        # The ground should lie below the line, or left of a vertical line.
        start, end, unit = end, start, -unit
    below = -1j * unit * 1.5 * size
    return _draw_hatch(start + below, end + below, size)


def _draw_block(pose: _DrawnPose, name: str, slider: Slider) -> Polygon:
    centre = pose.points[pose.closure.structure.blocks[name], slider.point]
    _, unit = _slider_line(pose, slider)
    driven = any(driven.slider == name for driven in pose.closure.linkage.inputs)
    half, across = 2.2 * pose.size * unit, 1.5j * pose.size * unit
    return Polygon(
        'input' if driven else 'block',
        name,
        (
            centre + half + across,
            centre - half + across,
            centre - half - across,
            centre + half - across,
        ),
    )


def _draw_link(pose: _DrawnPose, link: str, role: Role, cylinders: Sequence[str]) -> list[Shape]:
    """Draw a link: its points, and the used part of its rails."""
    linkage, size = pose.closure.linkage, pose.size
    places = [pose.points[link, point] for point in linkage.links[link]]
    drawn: list[Shape] = []
    slots: list[Shape] = []
    for name, slider in linkage.sliders.items():
        if name in cylinders:
            lowest, highest = pose.travels[name]
            start, unit = _slider_line(pose, slider)
            if link == slider.along:
                length = max(lowest - 2.0 * size, 0.5 * lowest)
                across = 1j * unit * 1.7 * size
                near, far = start - across, start + unit * length - across
                tube = (near, far, far + 2.0 * across, near + 2.0 * across)
                drawn.append(Polygon('tube', link, tube))
            elif link == slider.block:
                place = pose.points[link, slider.point]
                inside = max(highest - lowest, 2.0 * size) + 2.0 * size
                inside = min(inside, pose.slides[name] - 0.5 * size)
                places.append(place - unit * inside)
        elif link == slider.along:
            ends = _rail_ends(pose, name, 2.6 * size)
            if len(convex_hull([*places, *ends])) < 3:
                places += ends
            else:
                slots.append(Segment('slot', name, *_rail_ends(pose, name, 0.0)))
                places += ends
    corners = convex_hull(places)
    if len(corners) > 1:
        thick = size if len(corners) == 2 else 0.9 * size
        kind: Role = 'plate' if len(corners) > 2 and role == 'link' else role
        thin = any(link == linkage.sliders[name].block for name in cylinders)
        drawn.append(Polygon(kind, link, round_corners(corners, 0.7 * size if thin else thick)))
    return [*reversed(drawn), *slots]
