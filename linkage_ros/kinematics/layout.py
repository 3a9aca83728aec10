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


"""Where links and sliders are, in terms of the coordinates of a solution."""

from __future__ import annotations

from cmath import phase, rect
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Angle:
    """
    A link's angle: a coordinate and a constant, in [rad].

    ``unit`` is e^{i·constant}, made from lengths where they are known: an axis stays one, and no
    angle is rounded at the size of a sum.
    """

    coordinate: int
    constant: float
    unit: complex

    def plus(self, angle: float, unit: complex | None = None) -> Angle:
        """Return the angle of what stands at a constant angle to the link."""
        turned = rect(1.0, angle) if unit is None else unit
        return Angle(self.coordinate, self.constant + angle, self.unit * turned)

    def along(self, vector: complex) -> Angle:
        """Return the angle of a vector of the link."""
        return self.plus(phase(vector), vector / abs(vector))


@dataclass(frozen=True, slots=True)
class Slide:
    """A slide: ± a coordinate, and a constant, in the unit of the lengths."""

    coordinate: int
    sign: float
    constant: float = 0.0


@dataclass(frozen=True, slots=True)
class Held:
    """
    Where a link is held: its ``point``, in its own frame, lies where ``at`` of ``link`` does.

    With a ``slide``, it lies that far along a line from there, whose ``direction`` is a unit
    vector in the frame of ``link``. A ``pin`` is the number of a pin that an iteration has placed.
    """

    point: complex
    link: str
    at: complex = 0j
    slide: Slide | None = None
    direction: complex = 1 + 0j
    pin: int = -1


@dataclass(frozen=True, slots=True)
class Line:
    """
    The way of a point of one link along a slider, in the frame of the link that it slides on.

    The point lies at start + sign·(slide of the slider)·direction, a unit vector; ``angle`` is
    that of the moving link less that of the other one.
    """

    start: complex
    direction: complex
    angle: float
    sign: float
