# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The bodies of a linkage and the ends of its springs, as its equation of motion sees them.

A body takes part in a motion by two vectors, the velocity c of its centre of mass and its turn s::

    T = ½·m·|c|² + ½·s·K·s

In the plane s is the rate of the link's angle and K its moment of inertia. For links in space see
`linkage_ros.dynamics.spatial_bodies`. Vectors in the plane are complex numbers, and turns are
numbers; in space both are tuples. `PLANE` and `SPACE` have the operations on them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import add, mul, sub
from typing import Any, NamedTuple

from linkage_ros.dynamics.loads import Loads
from linkage_ros.kinematics import (
    Acceleration,
    cross_product,
    make_vector,
    PlanarClosure,
    Position,
    Velocity,
)


class Vectors(NamedTuple):
    """The operations on vectors, turns and moments, of numbers and symbols alike."""

    zero: Any
    from_numbers: Callable[[Sequence[float]], Any]  # The vector of some coordinates
    plus: Callable[[Any, Any], Any]
    minus: Callable[[Any, Any], Any]
    scale: Callable[[float, Any], Any]
    dot: Callable[[Any, Any], float]
    length: Callable[[Any], float]
    momentum: Callable[[Any, Any], Any]  # K·s of K and s
    moment: Callable[[Any, Any, Any], Any]  # Derivative of K·s, of K, s and ṡ
    turn_dot: Callable[[Any, Any], float]  # Product of a turn and a moment, or a momentum
    cross: Callable[[Any, Any], Any]  # The moment of a force, of its lever and the force
    carry: Callable[[Any, Any], Any]  # How a small turn moves the end of a lever
    coordinates: Callable[[Any], tuple[float, ...]]  # Of a vector
    turn_coordinates: Callable[[Any], tuple[float, ...]]  # Of a turn or a moment
    turn_from: Callable[[Sequence[float]], Any]  # The turn or moment of some coordinates
    # For each axis, the moment of a unit of force along it, of its lever; None of 0.
    unit_moments: tuple[Callable[[Any], tuple[float | None, ...]], ...]


def _dot(first: complex, second: complex) -> float:
    return first.real * second.real + first.imag * second.imag


PLANE = Vectors(
    zero=0j,
    from_numbers=lambda numbers: make_vector(*numbers),
    plus=add,
    minus=sub,
    scale=mul,
    dot=_dot,
    length=abs,
    momentum=mul,
    moment=lambda gyration, _, change: gyration * change,
    turn_dot=mul,
    cross=cross_product,
    carry=lambda turn, lever: 1j * turn * lever,
    coordinates=lambda vector: (vector.real, vector.imag),
    turn_coordinates=lambda turn: (turn,),
    turn_from=lambda numbers: numbers[0],
    unit_moments=(lambda lever: (-lever.imag,), lambda lever: (lever.real,)),
)
"""Operations in the plane: vectors are complex numbers, turns are numbers."""


class RigidBody(NamedTuple):
    """The mass of a link, in [kg], its matrix K, and the index of its centre among the points."""

    mass: float
    gyration: Any
    point: int


class BodyModel(NamedTuple):
    """
    The bodies of a linkage and the ends of its springs.

    The points of both are tracked together; the turns are in the order of the bodies.
    """

    vectors: Vectors
    points: Any  # The tracker of the points: a `PointTracker` or a `SpatialTracker`
    bodies: tuple[RigidBody, ...]
    springs: tuple[tuple[int, int], ...]  # Indices of the ends of each spring
    turn_rates: Callable[[Position, Velocity], list[Any]]
    turn_changes: Callable[[Position, Velocity, Acceleration], list[Any]]
    links: tuple[str, ...]  # The link of each body
    # Moments that work on the turns of the bodies, in the frame of the ground
    moments_in_ground: Callable[[Position, list[Any]], list[Any]]


def planar_bodies(closure: PlanarClosure, loads: Loads) -> BodyModel:
    """Return the bodies of a linkage in the plane, and the ends of its springs."""
    linkage = closure.linkage
    heavy = {link: linkage.masses[link] for link in linkage.links if link in linkage.masses}
    heavy = {link: body for link, body in heavy.items() if body.mass or body.inertia}
    points = [(link, complex(*body.center)) for link, body in heavy.items()]
    for spring in loads.springs:
        for link, name in spring.ends:
            points.append((link, complex(*linkage.links[link][name])))
    tracker = closure.point_tracker(points)
    at = iter(tracker.indices)
    bodies = tuple(RigidBody(body.mass, body.inertia, next(at)) for body in heavy.values())
    turns = [closure.angles[link].coordinate for link in heavy]

    def turn_rates(_position: Position, velocity: Velocity) -> list[float]:
        v = velocity.state.coordinates
        return [v[turn] for turn in turns]

    def turn_changes(
        _position: Position, _velocity: Velocity, acceleration: Acceleration
    ) -> list[float]:
        a = acceleration.state.coordinates
        return [a[turn] for turn in turns]

    springs = tuple((next(at), next(at)) for _ in loads.springs)
    return BodyModel(
        PLANE, tracker, bodies, springs, turn_rates, turn_changes,
        tuple(heavy), lambda _, moments: moments,
    )  # fmt: skip


def spring_length(
    vectors: Vectors, places: list[Any], velocities: list[Any], ends: tuple[int, int]
) -> tuple[float, float]:
    """Return the length of a spring and its rate; both 0 if its ends coincide."""
    start, end = ends
    along = vectors.minus(places[end], places[start])
    length = vectors.length(along)
    if not length:
        return 0.0, 0.0
    apart = vectors.minus(velocities[end], velocities[start])
    return length, vectors.dot(along, apart) / length
