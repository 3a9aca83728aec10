# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What the markers of planar and spatial linkages share: how they are collected, arrows, trails.

Forces are arrows, efforts arcs about their joints, or arrows along them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import cos, hypot, log1p, pi, sin
from typing import Any, NamedTuple

from linkage_ros.kinematics import COLOURS, INK, Input, plus, scale
from linkage_ros.messages import ARROW, Colour, LINE_STRIP, Marker, Place, TEXT_VIEW_FACING

ARROW_POINTS = 16
"""Number of points of an effort's arrow, with its head."""

_GRAVITY = 9.81
_SHORTEST = 0.25
"""Least length of an arrow, in half bars."""

_WIDEST = 1.7 * pi
"""Greatest angle of an arc, in [rad]; a longer one would meet itself."""

_HEAD = 0.5
"""Angle between an arrow and the edges of its head, in [rad]."""


def rgba(code: str) -> Colour:
    """Return the colour for #rrggbb or #rrggbbaa."""
    red, green, blue, *alpha = (value / 255.0 for value in bytes.fromhex(code[1:]))
    return red, green, blue, alpha[0] if alpha else 1.0


ALARM = rgba('#e0241b')
"""Colour near a toggle."""

HATCHED = rgba('#7f93a6')
"""Colour of the ground's lines: visible on white and on black."""

EDGE, _FORCE, _EFFORT = map(rgba, (INK, '#CC79A7', '#009E73'))
NOWHERE: list[Place] = [(0.0, 0.0, 0.0)]


class MarkersWanted(NamedTuple):
    """What a scene wants of the markers of a linkage."""

    thickness: float  # Width of a bar, as a share of the workspace; 0 for a suitable one
    trail: int  # Number of points in a traced point's trail; 0 for its whole curve instead
    joints: Sequence[Any]  # Joints whose forces are shown, of `linkage_ros.dynamics`
    inputs: Sequence[Input]  # Inputs whose efforts are shown
    lifetimes: tuple[int, int]  # Of moving and of still markers, in [ns]


class DriveArm(NamedTuple):
    """Where an effort is shown: about a place from an angle, or from it along a direction."""

    at: Place
    ways: tuple[Place, Place]  # Directions of the angles 0 and π/2; or along, and of its head
    start: float | None = None  # The angle, in [rad]; None where it acts along


class PlacedMarkers(NamedTuple):
    """Where traced points, joints with forces, and drives with efforts are at a position."""

    traced: list[Place]
    joints: list[Place]
    drives: list[DriveArm]


class MarkerPile:
    """
    The markers of a linkage, as they are collected.

    Attributes
    ----------
    size, extent
        Half the width of a bar, and the diagonal of the workspace, in [m].
    markers, still
        Those that change from message to message; the ground, and the curves of traced points.
    trails, forces, efforts
        Indices of the moving markers that are trails of traced points, and arrows.
    status
        Index of the text.
    layer, z
        Height of a layer, and of the next one, in [m].

    """

    def __init__(self, size: float, extent: float, wanted: MarkersWanted) -> None:
        self.size, self.extent = size, extent
        self.layer = self.z = 0.5 * size
        self.markers: list[Marker] = []
        self.still: list[Marker] = []
        self.trails: list[int] = []
        self.forces: list[int] = []
        self.efforts: list[int] = []
        self.status = 0
        self._wanted = wanted

    @property
    def above(self) -> Place:
        """Return the origin of the next layer."""
        return 0.0, 0.0, self.z

    def add(self, marker: Marker) -> int:
        """Add a marker that moves; return its index."""
        self.markers.append(marker._replace(lifetime=self._wanted.lifetimes[0]))
        return len(self.markers) - 1

    def add_still(self, markers: Sequence[Marker]) -> None:
        """Add markers that do not move."""
        self.still += [marker._replace(lifetime=self._wanted.lifetimes[1]) for marker in markers]

    def add_traces(self, curves: Mapping[str, Sequence[Place]]) -> None:
        """Add a trail of each traced point; or else its whole curve, where that is known."""
        for index, curve in enumerate(curves.values()):
            line = (0.35 * self.size, 0.0, 0.0)
            colour, points = rgba(COLOURS[index % len(COLOURS)]), NOWHERE * self._wanted.trail
            marker = Marker('traces', index, LINE_STRIP, line, colour, points or curve)
            if points:
                self.trails.append(self.add(marker._replace(at=self.above)))
            elif curve:
                self.add_still([marker])

    def add_arrows(self) -> None:
        """Add the arrows of forces and efforts, above all that is there."""
        self.z += 2.0 * self.layer
        thick, line = (0.6 * self.size, 1.5 * self.size, 2.2 * self.size), (0.5 * self.size, 0, 0)
        self.forces = [
            self.add(Marker('forces', n, ARROW, thick, _FORCE, NOWHERE * 2, self.above))
            for n in range(len(self._wanted.joints))
        ]
        places = NOWHERE * ARROW_POINTS
        self.efforts = [
            self.add(Marker('efforts', n, LINE_STRIP, line, _EFFORT, places, self.above))
            for n in range(len(self._wanted.inputs))
        ]

    def add_status(self, at: tuple[float, float]) -> None:
        """Add the text, at x and y, above all that is there."""
        letters = (0.0, 0.0, 4.0 * self.size)
        self.status = self.add(
            Marker('status', 0, TEXT_VIEW_FACING, letters, ALARM, at=(*at, self.z))
        )


class Arrows:
    """
    Arrows for forces and efforts, each as its points; none where it is too short to be seen.

    The lengths follow ``scale``, in [m/N]; if it is 0, they are::

        L = D/8 · ln(1 + F/W)

    with D the diagonal of the workspace, and W = 9.81 m/s² · Σm the weight of the moving links: so
    no force is too small or too large to be seen, and an arrow does not depend on earlier ones.
    The effort of a rotating drive is an arc about its pin, at a radius of eight half bars, as long
    as the arrow of its force at that radius.
    """

    def __init__(self, scale: float, mass: float, pile: MarkerPile) -> None:
        self._scale = scale
        self._eighth = 0.125 * pile.extent
        self._weight = _GRAVITY * mass or 1.0  # of a massless linkage: one newton
        self._shortest = _SHORTEST * pile.size
        self._radius = 8.0 * pile.size
        self._head = 2.0 * pile.size

    def _arrow_length(self, force: float) -> float:
        if self._scale:
            return self._scale * force
        return self._eighth * log1p(force / self._weight)

    def force_arrow(self, start: Place, force: Place) -> list[Place]:
        """Return the arrow of a force, in [N], at a place."""
        size = hypot(*force)
        length = self._arrow_length(size)
        if length < self._shortest:
            return []
        return [start, plus(start, scale(length / size, force))]

    def effort_arrow(self, arm: DriveArm, effort: float) -> list[Place]:
        """Return the arrow of an effort: an arc about the joint, or along it."""
        sign = 1.0 if effort > 0.0 else -1.0
        along_arm, across_arm = arm.ways
        if arm.start is None:
            length = self._arrow_length(abs(effort))
            end = plus(arm.at, scale(sign * length, along_arm))
            return self._add_head([arm.at, end], (scale(sign, along_arm), across_arm), length)
        length = self._arrow_length(abs(effort) / self._radius)
        turn = sign * min(length / self._radius, _WIDEST)
        steps = ARROW_POINTS - 4
        angles = [arm.start + turn * i / steps for i in range(steps)] + [arm.start + turn]
        ways = [
            plus(scale(cos(angle), along_arm), scale(sin(angle), across_arm)) for angle in angles
        ]
        line = [plus(arm.at, scale(self._radius, way)) for way in ways]
        c, s = sign * cos(angles[-1]), sign * sin(angles[-1])
        along = plus(scale(-s, along_arm), scale(c, across_arm))
        return self._add_head(line, (along, ways[-1]), length)

    def _add_head(
        self, line: list[Place], ways: tuple[Place, Place], length: float
    ) -> list[Place]:
        """Return a line with a head; all arrows have the same number of points."""
        if length < self._shortest:
            return []
        end, size = line[-1], min(self._head, length)
        along, across = scale(-size * cos(_HEAD), ways[0]), scale(size * sin(_HEAD), ways[1])
        back = plus(end, along)
        drawn = [*line, plus(back, across), end, plus(back, scale(-1.0, across))]
        return [*drawn, *[drawn[-1]] * (ARROW_POINTS - len(drawn))]
