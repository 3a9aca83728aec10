# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Shapes of links in a robot model: bars between their points, discs at them, rails for sliders.

Robot models have only boxes and cylinders. All shapes are given in the frame of their link. Each
link has a layer of its own, so that links pass each other as in a machine. Frames stay in the
plane z = 0: the layer in which a link is drawn does not move its pins.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Mapping
from statistics import median
from typing import NamedTuple

from linkage_ros.kinematics import (
    convex_hull,
    GROUND,
    link_lengths,
    PlanarClosure,
    SlideJoint,
)
from linkage_ros.tools.models.orientation import AngleSpan

_COLOURS = (
    (0.30, 0.47, 0.66, 1.0),
    (0.95, 0.56, 0.17, 1.0),
    (0.35, 0.63, 0.31, 1.0),
    (0.88, 0.34, 0.35, 1.0),
    (0.46, 0.72, 0.70, 1.0),
    (0.69, 0.48, 0.63, 1.0),
    (0.93, 0.79, 0.28, 1.0),
    (0.61, 0.46, 0.37, 1.0),
)
_GREY = (0.55, 0.55, 0.55, 1.0)


class Solid(NamedTuple):
    """A box, or a cylinder whose axis is z."""

    kind: str  # ``bar``, ``disc``, ``block`` or ``rail``
    name: str  # Name of the point of a disc or block, or of the slider of a rail; else ''
    # In the frame of the link, in [m].
    centre: complex
    z: float
    angle: float  # Angle of a box about z, in [rad]
    # Of a box; both are the diameter of a cylinder. In [m].
    length: float
    width: float
    height: float  # Size along z, in [m]


class LinkBody(NamedTuple):
    """The shapes of a link."""

    colour: tuple[float, float, float, float]
    solids: tuple[Solid, ...]


def link_bodies(
    closure: PlanarClosure, ranges: Mapping[str, AngleSpan], first_layer: int = 0
) -> dict[str, LinkBody]:
    """Return the shapes of each link, above the layers that other linkages occupy."""
    linkage = closure.linkage
    width = bar_width(closure)
    height = 0.5 * width
    moving = [link for link in linkage.links if link != GROUND]
    drawn = {}
    for link in linkage.links:
        layer = moving.index(link) + 1 if link != GROUND else 0
        z = 1.2 * height * (first_layer + layer)
        colour = _COLOURS[(layer - 1) % len(_COLOURS)] if layer else _GREY
        solids = [
            *_bar_solids(closure, link, z, width),
            *_rail_solids(closure, link, ranges, z, width),
        ]
        drawn[link] = LinkBody(colour, tuple(solids))
    return drawn


def bar_width(closure: PlanarClosure) -> float:
    """Return the width of bars, in [m]: a fraction of the typical length of links."""
    lengths = [length for length in link_lengths(closure.linkage.links) if length > 0.0]
    longest = max(lengths, default=0.0) or closure.slide_bound or 1.0
    common = median(lengths or [longest])
    return min(0.12 * common, 0.05 * longest)


def _bar_solids(closure: PlanarClosure, link: str, z: float, width: float) -> list[Solid]:
    points = {name: complex(*at) for name, at in closure.linkage.links[link].items()}
    height = 0.5 * width
    if len(points) == 1 and link != GROUND:
        ((name, at),) = points.items()
        return [
            Solid(
                'block', name, at, z, _block_angle(closure, link), 3.0 * width, 2.0 * width, height
            )
        ]
    discs = [
        Solid('disc', name, at, z, 0.0, 1.4 * width, 1.4 * width, height)
        for name, at in points.items()
    ]
    if link == GROUND:
        return discs
    corners = convex_hull(points.values())
    ends = [*corners[1:], corners[0]] if len(corners) > 2 else corners[1:]
    inner = [at for at in points.values() if at not in corners and len(corners) > 2]
    lines = [*zip(corners, ends, strict=False), *((corners[0], at) for at in inner)]
    bars = [
        Solid('bar', '', 0.5 * (p + q), z, phase(q - p), abs(q - p), width, 0.8 * height)
        for p, q in lines
    ]
    return bars + discs


def _block_angle(closure: PlanarClosure, link: str) -> float:
    """Return the angle of a block along its slider, in the block's own frame."""
    for slider in closure.linkage.sliders.values():
        if slider.block == link:
            return phase(complex(*slider.direction)) - slider.angle
    return next(
        (
            phase(complex(*slider.direction))
            for slider in closure.linkage.sliders.values()
            if slider.along == link
        ),
        0.0,
    )


def _rail_solids(
    closure: PlanarClosure, link: str, ranges: Mapping[str, AngleSpan], z: float, width: float
) -> list[Solid]:
    rails = []
    for name, slider in closure.linkage.sliders.items():
        if slider.along != link:
            continue
        low, high = slider_travel(closure, name, ranges)
        if link != GROUND:
            low, high = min(low, 0.0), max(high, 0.0)  # the rail must reach the link's bars
        unit = slider.unit
        start = complex(*closure.linkage.links[link][slider.through])
        centre = start + 0.5 * (low + high) * unit
        length = high - low + 3.0 * width
        rails.append(
            Solid('rail', name, centre, z, phase(unit), length, 0.35 * width, 0.4 * width)
        )
    return rails


def slider_travel(
    closure: PlanarClosure, slider: str, ranges: Mapping[str, AngleSpan]
) -> tuple[float, float]:
    """Return the range of a slider's point along its line, in [m], as far as it is known."""
    for name, joint in closure.linkage.named_joints.items():
        if isinstance(joint, SlideJoint) and joint.slider == slider:
            return ranges[name].lowest, ranges[name].highest
    far = 0.5 * closure.slide_bound
    return -far, far
