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
Arrows for forces and efforts among the markers.

They begin where the force acts. Where no scale is given, their lengths are::

    L = D/8 · ln(1 + F/W)

with D the diagonal of all that the linkage reaches, and W = 9.81 m/s² · Σm the weight of what
moves: no force is too small or too large to be seen, and none depends on what came before. The
effort of a drive that turns is an arc about its pin, at a radius of eight half bars, as long as
the arrow of the force that it makes there.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Mapping, Sequence
from math import log1p, pi

from linkage_ros.effects.marker_shapes import ARROW_POINTS, Key, MarkerShapes
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Input

_GRAVITY = 9.81
_SHORTEST = 0.25
"""Of the half bar: no arrow is shorter."""

_WIDEST = 1.7 * pi
"""An arc that goes farther round would meet itself."""

Points = Mapping[tuple[str, str], complex]


class Arrows:
    """
    Forces and efforts as arrows, each as its places; none where it is too short to be seen.

    Parameters
    ----------
    scale
        Length for a force, in [m/N]; 0 for the logarithm.
    closure, shapes
        The linkage, and how large it is drawn.
    joints
        Where the forces act.

    """

    def __init__(
        self, scale: float, closure: Closure, shapes: MarkerShapes, joints: Sequence[Key]
    ) -> None:
        self._closure = closure
        self._scale = scale
        self._eighth = 0.125 * shapes.extent
        self._weight = _GRAVITY * sum(each.mass for each in closure.linkage.masses.values())
        self._shortest = _SHORTEST * shapes.size
        self._radius = 8.0 * shapes.size
        self._head = 2.0 * shapes.size
        self._joints = joints

    def _length(self, force: float) -> float:
        if self._scale:
            return self._scale * force
        return self._eighth * log1p(force / self._weight)

    def forces(
        self, points: Points, reactions: Sequence[tuple[float, float, float]]
    ) -> list[list[complex]]:
        """Return for each joint its arrow."""
        if not reactions:
            return [[] for _ in self._joints]
        drawn = []
        for at, (fx, fy, _) in zip(self._joints, reactions, strict=True):
            force = complex(fx, fy)
            length = self._length(abs(force))
            start = points[at]
            end = start + rect(length, phase(force))
            drawn.append([start, end] if length >= self._shortest else [])
        return drawn

    def efforts(
        self,
        inputs: Sequence[Input],
        points: Points,
        angles: Mapping[str, float],
        efforts: Sequence[float],
    ) -> list[list[complex]]:
        """Return for each input the arrow of its effort: an arc about the pin, or straight."""
        if not efforts:
            return [[] for _ in inputs]
        return [
            self._straight(given, points, angles, effort)
            if given.slider
            else self._arc(given, points, angles, effort)
            for given, effort in zip(inputs, efforts, strict=True)
        ]

    def _straight(
        self, given: Input, points: Points, angles: Mapping[str, float], effort: float
    ) -> list[complex]:
        slider = self._closure.linkage.sliders[given.slider]
        block = self._closure.structure.blocks[given.slider]
        way = rect(1.0 if effort > 0.0 else -1.0, angles[slider.along])
        way *= complex(*slider.direction) / abs(complex(*slider.direction))
        start = points[block, slider.point]
        length = self._length(abs(effort))
        return self._headed([start, start + length * way], way, length)

    def _arc(
        self, given: Input, points: Points, angles: Mapping[str, float], effort: float
    ) -> list[complex]:
        links = self._closure.linkage.links
        pin = next(point for point in links[given.parent] if point in links[given.child])
        centre, start = points[given.child, pin], angles[given.child]
        length = self._length(abs(effort) / self._radius)
        turn = min(length / self._radius, _WIDEST) * (1.0 if effort > 0.0 else -1.0)
        steps = ARROW_POINTS - 4
        arc = [centre + rect(self._radius, start + turn * i / steps) for i in range(steps)]
        arc.append(centre + rect(self._radius, start + turn))
        way = rect(1.0, start + turn) * (1j if effort > 0.0 else -1j)
        return self._headed(arc, way, length)

    def _headed(self, line: list[complex], way: complex, length: float) -> list[complex]:
        """Return a line with a head, of as many places as every arrow."""
        if length < self._shortest:
            return []
        end, back = line[-1], min(self._head, length) * way
        drawn = [*line, end - back * rect(1.0, 0.5), end, end - back * rect(1.0, -0.5)]
        return [*drawn, *[drawn[-1]] * (ARROW_POINTS - len(drawn))]
