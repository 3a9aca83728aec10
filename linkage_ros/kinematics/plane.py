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


"""Vectors and lines of the plane."""

from __future__ import annotations

from math import pi, remainder


def cross(one: complex, other: complex) -> float:
    """Return the z component of the cross product of two vectors."""
    return one.real * other.imag - one.imag * other.real


def resolved(vector: complex, unit: complex) -> tuple[float, float]:
    """Return a vector's parts along a unit vector and to the left of it."""
    turned = vector * unit.conjugate()
    return turned.real, turned.imag


def folded(angle: float) -> float:
    """Return the acute angle between two lines, of an angle between them, in [rad]."""
    return abs(remainder(angle, pi))
