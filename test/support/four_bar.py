# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The four-bar in closed form, by two circles that meet; nothing here is the package's own."""

from __future__ import annotations

from cmath import phase, rect
from typing import Any

GALLERY = 0.04, 0.12, 0.08, 0.1
"""Lengths of config/linkages/four_bar.yaml, in [m]: crank, coupler, rocker and ground."""


def meeting_point(first: Any, second: Any, radius: Any, other_radius: Any, side: int = 1) -> Any:
    """
    Return where circles about two points meet, or None.

    It lies left of the way from the first to the second point, right of it if the side is −1. The
    numbers are Python's or mpmath's.
    """
    apart = second - first
    s = abs(apart)
    along = (s * s + radius * radius - other_radius * other_radius) / (2 * s)
    square = radius * radius - along * along
    return None if square < 0 else first + apart / s * (along + side * square**0.5 * 1j)


def four_bar_angles(
    crank: float, lengths: tuple[float, float, float, float] = GALLERY
) -> tuple[float, float]:
    """Return the angles of coupler and rocker against the ground; B is left of A→O4."""
    a, b, c, d = lengths
    pin = rect(a, crank)
    end = meeting_point(pin, d, b, c)
    return phase(end - pin), phase(end - d)
