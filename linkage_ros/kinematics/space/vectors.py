# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Vectors in space, as tuples of numbers or symbols, and the frames of links.

A product with a constant 0 is not computed: axes along the axes of the ground are the rule.
"""

from __future__ import annotations

from math import cos, hypot, sin
from typing import NamedTuple

from linkage_ros.kinematics.arithmetic import make_vector, sqrt

Vector = tuple[float, float, float]

ZERO: Vector = (0.0, 0.0, 0.0)

_ROUNDING = 2.0**-50
"""A component of a unit vector below this is rounding."""


class SpaceFrame(NamedTuple):
    """The axes and the origin of a link, in the frame of the ground."""

    x: Vector
    y: Vector
    z: Vector
    origin: Vector

    def turn(self, vector: Vector) -> Vector:
        """Return a vector of the link in the frame of the ground."""
        return plus(plus(scale(vector[0], self.x), scale(vector[1], self.y)),
                    scale(vector[2], self.z))  # fmt: skip

    def place(self, point: Vector) -> Vector:
        """Return a point of the link in the frame of the ground."""
        return plus(self.origin, self.turn(point))

    def compose(self, frame: SpaceFrame) -> SpaceFrame:
        """Return a frame of the link in the frame of the ground."""
        return SpaceFrame(
            self.turn(frame.x), self.turn(frame.y), self.turn(frame.z), self.place(frame.origin)
        )

    def resolve(self, vector: Vector) -> Vector:
        """Return a vector in the frame of the link."""
        return dot(self.x, vector), dot(self.y, vector), dot(self.z, vector)

    def locate(self, point: Vector) -> Vector:
        """Return a point in the frame of the link."""
        return self.resolve(minus(point, self.origin))


GROUND_FRAME = SpaceFrame((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), ZERO)


class Twist(NamedTuple):
    """The spin of a link and the velocity of its origin; or their derivatives."""

    spin: Vector
    origin: Vector

    def velocity(self, arm: Vector) -> Vector:
        """Return the velocity of a point, by its arm from the origin."""
        return plus(self.origin, cross(self.spin, arm))

    def acceleration(self, change: Twist, arm: Vector) -> Vector:
        """Return the acceleration of a point, if ``change`` is the derivative of the motion."""
        return plus(change.velocity(arm), cross(self.spin, cross(self.spin, arm)))


STILL = Twist(ZERO, ZERO)


def is_zero(number: float) -> bool:
    """Return whether a number is a 0 that is no symbol."""
    return type(number) is float and number == 0.0


# The next three are called most of all: what `is_zero` says is written out in them.


def multiply(one: float, other: float) -> float:
    """Return a product; 0 without an operation if a factor is 0."""
    if (type(one) is float and one == 0.0) or (type(other) is float and other == 0.0):
        return 0.0
    return one * other


def add(one: float, other: float) -> float:
    """Return a sum; without an operation if a term is 0."""
    if type(one) is float and one == 0.0:
        return other
    return one if type(other) is float and other == 0.0 else one + other


def subtract(one: float, other: float) -> float:
    """Return a difference; without a subtraction if a term is 0."""
    if type(other) is float and other == 0.0:
        return one
    return -other if type(one) is float and one == 0.0 else one - other


def plus(one: Vector, other: Vector) -> Vector:
    """Return the sum of two vectors."""
    return add(one[0], other[0]), add(one[1], other[1]), add(one[2], other[2])


def minus(one: Vector, other: Vector) -> Vector:
    """Return the difference of two vectors."""
    return subtract(one[0], other[0]), subtract(one[1], other[1]), subtract(one[2], other[2])


def scale(factor: float, vector: Vector) -> Vector:
    """Return a vector times a factor."""
    return multiply(factor, vector[0]), multiply(factor, vector[1]), multiply(factor, vector[2])


def dot(one: Vector, other: Vector) -> float:
    """Return the scalar product of two vectors."""
    return add(add(multiply(one[0], other[0]), multiply(one[1], other[1])),
               multiply(one[2], other[2]))  # fmt: skip


def cross(one: Vector, other: Vector) -> Vector:
    """Return the cross product of two vectors."""
    return (
        subtract(multiply(one[1], other[2]), multiply(one[2], other[1])),
        subtract(multiply(one[2], other[0]), multiply(one[0], other[2])),
        subtract(multiply(one[0], other[1]), multiply(one[1], other[0])),
    )


def hypotenuse(one: float, other: float) -> float:
    """Return the length of a vector of two coordinates, which compiled code has a form of."""
    if is_zero(one) or is_zero(other):
        return abs(add(one, other))
    return abs(make_vector(one, other))


def length(vector: Vector) -> float:
    """Return the length of a vector."""
    return sqrt(dot(vector, vector))


def drop_rounding(vector: Vector) -> Vector:
    """Return a vector without the components that are rounding, and with exact axes."""
    x, y, z = (0.0 if abs(one) < _ROUNDING else one for one in vector)
    return x, y, z


def direction_of(vector: Vector) -> Vector:
    """Return the direction of a vector of numbers."""
    return scale(1.0 / hypot(*vector), vector)


def turn_about(axis: Vector, angle: float, vector: Vector) -> Vector:
    """Return a vector of numbers, turned about a unit vector (Rodrigues)."""
    along = scale(dot(axis, vector) * (1.0 - cos(angle)), axis)
    across = plus(scale(cos(angle), vector), scale(sin(angle), cross(axis, vector)))
    return plus(across, along)
