# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Lengths of dyads without the rounding by which they miss a change point.

Coordinates of an oblique plane are rounded, and so are the lengths between them: a parallelogram
of such lengths would fold at its change points. Lengths that are equal in pairs to nine digits are
made equal. Where links lie in line but for less than 1e-14 of their lengths, one is made to fit.
Linkages that are drawn in their plane keep their lengths, however nearly these are equal.
"""

from __future__ import annotations

from linkage_ros.kinematics.arithmetic import exact_sum

PAIRED = 1e-9
"""Largest relative difference of lengths that are equal but for rounded coordinates."""

_IN_LINE = 1e-14
"""Largest part of the lengths by which links miss a line through rounding."""


def _is_rounding(off: float, size: float) -> bool:
    return 0.0 < abs(off) <= _IN_LINE * size


def _are_equal(first: float, second: float) -> bool:
    return abs(first - second) <= PAIRED * max(first, second)


def four_bar_lengths(a: float, b: float, c: float, d: float) -> tuple[float, float, float, float]:
    """Return crank, coupler, rocker and ground of a four-bar."""
    if _are_equal(a, c) and _are_equal(b, d):
        return a, d, a, d
    if _are_equal(a, b) and _are_equal(c, d):
        return a, a, d, d
    size = a + b + c + d
    if max(abs(a - d), abs(b - c)) <= _IN_LINE * min(a, b):
        return a, b, b, a  # Where the two pins meet, they may pass each other closely.
    if _is_rounding(off := exact_sum(b, c, -a, -d), size):
        return a, b - off, c, d
    if _is_rounding(off := exact_sum(max(a, d), -min(a, d), -max(b, c), min(b, c)), size):
        return (a, b + off, c, d) if b > c else (a, b, c + off, d)
    return a, b, c, d


def swivel_lengths(a: float, d: float, offset: float) -> tuple[float, float, float]:
    """Return crank, ground and offset of an inverted slider-crank; pins may pass closely."""
    if max(abs(a - d), abs(offset)) <= _IN_LINE * a:
        return a, a, 0.0
    if _is_rounding(off := exact_sum(max(a, d), -min(a, d), -abs(offset)), a + d):
        return a, d, offset + off if offset > 0.0 else offset - off
    return a, d, offset


def rail_lengths(a: float, b: float, height: float) -> tuple[float, float]:
    """Return the link to a line, and the height of the crank's pivot over it."""
    if _are_equal(a, b) and abs(height) <= PAIRED * a:
        return a, 0.0
    for side in (-height, height):
        if _is_rounding(off := exact_sum(b, side, -a), a + b):
            return b - off, height
    return b, height
