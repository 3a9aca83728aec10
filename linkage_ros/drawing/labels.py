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


"""Where names go in a drawing, so that they hide little and lie on nothing that is read."""

from __future__ import annotations

from cmath import rect
from collections.abc import Sequence
from math import pi
from typing import NamedTuple

_DIRECTIONS = 16
_DISTANCES = 7


class Label(NamedTuple):
    """
    A name to be placed; all in one unit, such as pixels.

    Attributes
    ----------
    anchors
        Places that it may name; the first is the best.
    width, height
        Of the text.
    clear
        How far from the anchor its box begins.

    """

    anchors: tuple[complex, ...]
    width: float
    height: float
    clear: float


class Placed(NamedTuple):
    """Where a label's centre goes, and the anchor that it names."""

    centre: complex
    anchor: complex


def place_labels(
    labels: Sequence[Label],
    obstacles: Sequence[complex],
    frame: tuple[complex, complex],
) -> list[Placed]:
    """
    Place labels one after the other, each where it hides least.

    Parameters
    ----------
    labels
        What to place; the first has the choice.
    obstacles
        Points of what should not be hidden.
    frame
        The lower left and the upper right corner of the paper.

    """
    boxes: list[tuple[complex, float, float]] = []
    placed = []
    for label in labels:
        best: tuple[float, Placed] | None = None
        half_width, half_height = 0.5 * label.width, 0.5 * label.height
        for rank, anchor in enumerate(label.anchors):
            for ring in range(_DISTANCES):
                for i in range(_DIRECTIONS):
                    way = rect(1.0, pi / 4.0 + i * 2.0 * pi / _DIRECTIONS)
                    # The box touches a circle about the anchor.
                    away = label.clear + 0.45 * ring * label.height
                    centre = anchor + complex(
                        way.real * (away + half_width), way.imag * (away + half_height)
                    )
                    cost = 0.6 * ring + 0.3 * rank + 0.01 * i
                    cost += 2.5 * _inside(centre, half_width, half_height, obstacles)
                    cost += 12.0 * sum(
                        _overlap(centre, half_width, half_height, *box) for box in boxes
                    )
                    cost += 20.0 * _outside(centre, half_width, half_height, frame)
                    if best is None or cost < best[0]:
                        best = cost, Placed(centre, anchor)
        assert best is not None, 'a label has an anchor'
        placed.append(best[1])
        boxes.append((best[1].centre, half_width, half_height))
    return placed


def _inside(centre: complex, width: float, height: float, points: Sequence[complex]) -> int:
    return sum(
        abs(p.real - centre.real) < width and abs(p.imag - centre.imag) < height for p in points
    )


def _overlap(
    centre: complex,
    width: float,
    height: float,
    other: complex,
    its_width: float,
    its_height: float,
) -> bool:
    apart = other - centre
    return abs(apart.real) < width + its_width and abs(apart.imag) < height + its_height


def _outside(centre: complex, width: float, height: float, frame: tuple[complex, complex]) -> bool:
    low, high = frame
    return (
        centre.real - width < low.real
        or centre.real + width > high.real
        or centre.imag - height < low.imag
        or centre.imag + height > high.imag
    )
