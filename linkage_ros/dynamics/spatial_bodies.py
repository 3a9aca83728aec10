# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The bodies of a linkage in space, as its equation of motion sees them, and what loads act on.

The turn s of a link is its spin in its own axes, and K its tensor of inertia there. The moment
that turns it is K·ṡ + s × K·s (Euler).

A rod that may spin about itself turns by s = v2 − v1, the velocities of its ends. With the moment
of inertia I across it and its length L, K is the number I/L²: |s|/L is its rate of turning. This
is exact for a centre of mass on its axis and a tensor that is round about it; its spin then stays
as it is, and works on nothing.

Loads act on points of links along directions, and on links about axes. A rod that may spin has no
axes of its own, and a torque along it would spin it: a load that turns with it, and a torque on
it, are refused.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from linkage_ros.dynamics.bodies import BodyModel, RigidBody, Vectors
from linkage_ros.dynamics.joint_forms import LinkTurn
from linkage_ros.dynamics.loads import AppliedLoads, Loads
from linkage_ros.errors import DefinitionError, quote
from linkage_ros.kinematics import (
    check_inertia,
    cross,
    dot,
    GROUND_FRAME,
    length,
    minus,
    plus,
    Position,
    scale,
    SpaceClosure,
    SpatialMass,
    tensor_rows,
    turned_tensor,
    Vector,
    ZERO,
)

Rows = tuple[Vector, Vector, Vector]

_BESIDE = 1e-3
"""How far the centre of a rod may be beside its axis, relative to its length: CAD rounds."""

_ROUND = 0.01
"""By how much rounded moments of a rod may miss what is round, relative to the one across it."""


def _momentum(gyration: Rows | float, turn: Vector) -> Vector:
    """Return K·s; K of a rod that may spin is a number."""
    if isinstance(gyration, float):
        return scale(gyration, turn)
    first, second, third = gyration
    return dot(first, turn), dot(second, turn), dot(third, turn)


def _moment(gyration: Rows | float, turn: Vector, change: Vector) -> Vector:
    changed = _momentum(gyration, change)
    if isinstance(gyration, float):
        return changed
    return plus(changed, cross(turn, _momentum(gyration, turn)))


SPACE = Vectors(
    ZERO, tuple, plus, minus, scale, dot, length,
    momentum=_momentum, moment=_moment, turn_dot=dot,
    cross=cross, carry=cross, coordinates=tuple, turn_coordinates=tuple, turn_from=tuple,
    unit_moments=(
        lambda lever: (None, lever[2], -lever[1]),
        lambda lever: (-lever[2], None, lever[0]),
        lambda lever: (lever[1], -lever[0], None),
    ),
)  # fmt: skip
"""Operations in space: vectors and turns are tuples."""


def spatial_bodies(closure: SpaceClosure, loads: Loads) -> BodyModel:
    """
    Return the bodies of a linkage in space, and the ends of its springs.

    Moments of inertia that no body has, and a rod that may spin but is not round about its axis,
    raise DefinitionError.
    """
    linkage = closure.linkage
    heavy = {link: linkage.masses[link] for link in linkage.link_names if link in linkage.masses}
    heavy = {link: body for link, body in heavy.items() if body.mass or any(body.inertia)}
    for link, body in heavy.items():
        if any(body.inertia):
            check_inertia(f'masses.{link}.inertia', body.inertia)
    points = [(link, body.center) for link, body in heavy.items()]
    for spring in loads.springs:
        points += [(link, linkage.points[name]) for link, name in spring.ends]
    tracker = closure.point_tracker(points, list(heavy))
    at = iter(tracker.indices)
    bodies = tuple(
        RigidBody(
            body.mass,
            _rod_gyration(closure, link, body)
            if link in closure.idle
            else tensor_rows(turned_tensor([*zip(*axes, strict=True)], body.inertia)),
            next(at),
        )
        for (link, body), axes in zip(heavy.items(), tracker.axes, strict=True)
    )
    springs = tuple((next(at), next(at)) for _ in loads.springs)
    return BodyModel(
        SPACE, tracker, bodies, springs, tracker.turn_rates, tracker.turn_changes,
        tuple(heavy), tracker.moments_in_ground,
    )  # fmt: skip


def _rod_gyration(closure: SpaceClosure, link: str, body: SpatialMass) -> float:
    """Return I/L² of a rod that may spin, in [kg]."""
    axis = closure.rod_axis(link)
    size = length(minus(axis.end, axis.start))
    remedy = 'let it hang on a universal joint: a hinge and a link between it and one of its ends'
    if (beside := axis.distance(body.center)) > _BESIDE * size:
        raise DefinitionError(
            f'masses.{link}.center',
            f'it is {beside:.3g} m off the line through {quote(axis.ends[0])} and '
            f'{quote(axis.ends[1])}, about which the rod may spin: nothing says where it is',
            f'write one on the line, or {remedy}',
        )
    along = scale(1.0 / size, minus(axis.end, axis.start))
    rows = tensor_rows(body.inertia)
    turned = _momentum(rows, along)
    own = dot(along, turned)
    across = 0.5 * (rows[0][0] + rows[1][1] + rows[2][2] - own)
    # What a round tensor has: I·(1 − e·eᵀ) + I_own·e·eᵀ.
    off = max(
        abs(rows[i][j] - across * (i == j) - (own - across) * along[i] * along[j])
        for i in range(3)
        for j in range(3)
    )
    if off > _ROUND * max(across, own):
        raise DefinitionError(
            f'masses.{link}.inertia',
            f'it is not round about the line through {quote(axis.ends[0])} and '
            f'{quote(axis.ends[1])}, about which the rod may spin: nothing says how it lies',
            f'leave it out, as {{mass: {body.mass:g}}} of a thin rod, or {remedy}',
        )
    return across / (size * size)


class SpatialParts:
    """What loads act on in space."""

    vectors = SPACE
    wrench_numbers: tuple[int, ...] = (0, 1, 2, 3, 4, 5)

    def __init__(self, closure: SpaceClosure, applied: AppliedLoads) -> None:
        self._closure = closure
        for name, force in applied.forces.items():
            if name.rpartition('.')[0] in closure.idle and force.frame == 'link':
                raise DefinitionError(
                    f'loads.forces.{name}.frame',
                    'the rod may spin about itself, and has no axes that turn with it',
                    'write frame: ground',
                )
        for link in applied.wrenches:
            if link in closure.idle:
                raise DefinitionError(
                    f'loads.wrenches.{link}',
                    'the rod may spin about itself, and nothing bears a torque along it',
                    'name the link that holds it',
                )

    def place(self, link: str, point: str) -> Vector:
        if point:
            return self._closure.linkage.points[point]
        pose = self._closure.close_unlimited(*self._closure.linkage.pose.inputs)
        return self._closure.frames(pose)[link][0]

    def direction(self, link: str, vector: Vector, frame: str) -> Callable[[Position], Vector]:
        if frame == 'ground':
            return lambda _: vector
        return self._closure.carried_vector(link, vector)

    def axes(self, link: str, frame: str) -> list[Callable[[Position], Vector]]:
        return [self.direction(link, axis, frame) for axis in GROUND_FRAME[:3]]

    def turns(self, link: str, frame: str) -> Sequence[LinkTurn]:
        spin = self._closure.spin_of(link)

        def turn(axis: Callable[[Position], Vector]) -> LinkTurn:
            return LinkTurn(link, lambda v, position: dot(spin(v), axis(position)), axis)

        return [turn(axis) for axis in self.axes(link, frame)]
