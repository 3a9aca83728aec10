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
    """Return whether a number is a 0 that is not a symbol."""
    return type(number) is float and number == 0.0


# The next three are called most of all: what `is_zero` says is written out in them.


def multiply(first: float, second: float) -> float:
    """Return a product; 0 without an operation if a factor is 0."""
    if (type(first) is float and first == 0.0) or (type(second) is float and second == 0.0):
        return 0.0
    return first * second


def add(first: float, second: float) -> float:
    """Return a sum; without an operation if a term is 0."""
    if type(first) is float and first == 0.0:
        return second
    return first if type(second) is float and second == 0.0 else first + second


def subtract(first: float, second: float) -> float:
    """Return a difference; without a subtraction if a term is 0."""
    if type(second) is float and second == 0.0:
        return first
    return -second if type(first) is float and first == 0.0 else first - second


def plus(first: Vector, second: Vector) -> Vector:
    """Return the sum of two vectors."""
    return add(first[0], second[0]), add(first[1], second[1]), add(first[2], second[2])


def minus(first: Vector, second: Vector) -> Vector:
    """Return the difference of two vectors."""
    return (
        subtract(first[0], second[0]),
        subtract(first[1], second[1]),
        subtract(first[2], second[2]),
    )


def scale(factor: float, vector: Vector) -> Vector:
    """Return a vector times a factor."""
    return multiply(factor, vector[0]), multiply(factor, vector[1]), multiply(factor, vector[2])


def dot(first: Vector, second: Vector) -> float:
    """Return the scalar product of two vectors."""
    return add(add(multiply(first[0], second[0]), multiply(first[1], second[1])),
               multiply(first[2], second[2]))  # fmt: skip


def cross(first: Vector, second: Vector) -> Vector:
    """Return the cross product of two vectors."""
    return (
        subtract(multiply(first[1], second[2]), multiply(first[2], second[1])),
        subtract(multiply(first[2], second[0]), multiply(first[0], second[2])),
        subtract(multiply(first[0], second[1]), multiply(first[1], second[0])),
    )


def hypotenuse(first: float, second: float) -> float:
    """Return the length of a vector of two coordinates, which compiled code has a form of."""
    if is_zero(first) or is_zero(second):
        return abs(add(first, second))
    return abs(make_vector(first, second))


def length(vector: Vector) -> float:
    """Return the length of a vector."""
    return sqrt(dot(vector, vector))


def drop_rounding(vector: Vector) -> Vector:
    """Return a vector without the components that are rounding, and with exact axes."""
    x, y, z = (0.0 if abs(component) < _ROUNDING else component for component in vector)
    return x, y, z


def direction_of(vector: Vector) -> Vector:
    """Return the direction of a vector of numbers."""
    return scale(1.0 / hypot(*vector), vector)


def turn_about(axis: Vector, angle: float, vector: Vector) -> Vector:
    """Return a vector of numbers, turned about a unit vector (Rodrigues)."""
    along = scale(dot(axis, vector) * (1.0 - cos(angle)), axis)
    across = plus(scale(cos(angle), vector), scale(sin(angle), cross(axis, vector)))
    return plus(across, along)
