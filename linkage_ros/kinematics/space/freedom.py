# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Degrees of freedom of a spatial linkage in its pose: which links its inputs move, and how.

To first order every link has a spin and a velocity. Joints and balls are linear equations in them;
the rank says how many of these are needed. Equations beyond are redundant: the linkage moves only
if its dimensions meet them everywhere.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import combinations
from math import comb
from typing import NamedTuple

from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics.batch import Array
from linkage_ros.kinematics.space.carried_points import CarriedPoints, SAME
from linkage_ros.kinematics.space.linkage import SpaceLinkage, SpatialJoint
from linkage_ros.kinematics.space.plan import SpacePlan
from linkage_ros.kinematics.space.vectors import scale, Vector, ZERO
import numpy as np

_RANK = 1e-9
"""Singular values below this, relative to the largest, are rounding."""

_ROUNDED = 1e-4
"""Singular values below this, relative to the largest, may be the rounding of CAD."""

_MOVES = 1e-7
"""Motions of links above this are none of rounding."""

_MOST_SETS = 5000
"""Most sets of inputs that are tried."""


class Freedom(NamedTuple):
    """How free a linkage is in its pose."""

    mobility: int  # Degrees of freedom, without the turns of rods about themselves
    redundant: int  # Equations beyond those that are needed
    free: tuple[str, ...]  # Links that the inputs leave free
    dependent: int  # Inputs beyond the degrees of freedom


class _MotionEquations:
    """The linear equations of the spins and velocities of all links; a motion has six numbers."""

    def __init__(self, linkage: SpaceLinkage, carried: CarriedPoints) -> None:
        self._linkage, self._carried = linkage, carried
        self._links = {name: number for number, name in enumerate(linkage.link_names)}
        self.size = 6 * len(self._links)
        rows = [np.eye(6, self.size)]  # The ground is the first of the links
        for name, joint in linkage.pair_joints.items():
            rows += self._joint_rows(joint, name in linkage.hinges)
        self.needed = 6 + 5 * len(linkage.pair_joints)
        ratios = [
            _without_unit(
                self.rate(name) - sum(factor * self.rate(of) for of, factor in ratio.terms.items())
            )[None]
            for name, ratio in linkage.ratios.items()
        ]
        self.needed += len(ratios)
        self.constraints: Array = np.vstack([*rows, *self._ball_rows(), *ratios])

    def spin(self, link: str) -> Array:
        """Return the rows of the spin of a link."""
        return np.eye(3, self.size, 6 * self._links[link])

    def velocity(self, link: str, place: Vector) -> Array:
        """Return the rows of the velocity of a place on a link: v + ω × place."""
        return self._of_link(link, _velocity_rows(place))

    def _of_link(self, link: str, rows: Array) -> Array:
        """Return rows in the six numbers of a link as rows in those of all."""
        rows_of_all = np.zeros((len(rows), len(self._links), 6))
        rows_of_all[:, self._links[link]] = rows
        return rows_of_all.reshape(len(rows), self.size)

    def rate(self, name: str) -> Array:
        """Return the row of a joint's rate, in the unit of the file."""
        linkage, carried = self._linkage, self._carried
        if name in linkage.struts:
            first, second = linkage.struts[name]
            between = np.subtract(carried.places[second], carried.places[first])
            at_other, at_one = (
                self.velocity(carried.carriers[carried.same[point]][0], carried.places[point])
                for point in (second, first)
            )
            along: Array = carried.size * between / np.linalg.norm(between)
            return np.asarray(along @ (at_other - at_one))
        joint = linkage.pair_joints[name]
        axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
        if name in linkage.hinges:
            return np.asarray(axis @ self._relative_spin(joint))
        return np.asarray(carried.size * axis @ self._relative_velocity(joint, ZERO))

    def _joint_rows(self, joint: SpatialJoint, turns: bool) -> list[Array]:
        axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
        across = np.eye(3) - np.outer(axis, axis)
        spin = self._relative_spin(joint)
        velocity = self._relative_velocity(joint, scale(1.0 / self._carried.size, joint.at))
        return [across @ spin, velocity] if turns else [spin, across @ velocity]

    def _ball_rows(self) -> Iterator[Array]:
        """Yield the rows of the balls between two links; count all equations as needed ones."""
        carried, balls = self._carried, defaultdict[tuple[str, str], list[Array]](list)
        for point, first, link in balls_of(self._linkage, carried):
            balls[first, link].append(_velocity_rows(carried.places[point]))
        for (first, link), rows in balls.items():
            self.needed += 3 * len(rows)
            # However many balls two links share: as many rows as a motion has numbers.
            least = _least_rows(np.vstack(rows))
            yield self._of_link(link, least) - self._of_link(first, least)

    def _relative_spin(self, joint: SpatialJoint) -> Array:
        return self.spin(joint.child) - self.spin(joint.parent)

    def _relative_velocity(self, joint: SpatialJoint, place: Vector) -> Array:
        return self.velocity(joint.child, place) - self.velocity(joint.parent, place)


def find_freedom(linkage: SpaceLinkage, carried: CarriedPoints) -> Freedom:
    """Return the degrees of freedom in the pose."""
    equations = _MotionEquations(linkage, carried)
    inputs = np.vstack([_without_unit(equations.rate(name)) for name in linkage.driven])
    constraints = _least_rows(equations.constraints)
    of_constraints, of_all = (
        np.linalg.svd(rows)[1:] for rows in (constraints, np.vstack([constraints, inputs]))
    )
    rods = carried.rods

    def judge(tolerance: float) -> Freedom:
        rank, _ = _rank_and_motions(*of_constraints, tolerance)
        locked, motions = _rank_and_motions(*of_all, tolerance)

        def moves(rows: Array) -> bool:
            return bool(np.abs(rows @ motions).max(initial=0.0) > _MOVES)

        free = [
            link
            for link in linkage.link_names
            if any(
                moves(equations.velocity(link, carried.places[at])) for at in carried.carried[link]
            )
            or (link not in rods and moves(equations.spin(link)))
        ]
        return Freedom(
            mobility=equations.size - rank - len(rods),
            redundant=equations.needed - rank,
            free=tuple(free),
            dependent=len(linkage.driven) - (locked - rank),
        )

    # Rounded dimensions miss redundant equations: then the range decides whether they are met.
    exact, rounded = judge(_RANK), judge(_ROUNDED)
    return rounded if exact.dependent and not (rounded.free or rounded.dependent) else exact


def find_input_sets(
    linkage: SpaceLinkage, carried: CarriedPoints, names: Sequence[str]
) -> list[tuple[str, ...]]:
    """
    Return the sets of joints, of these names, that would move all of a linkage as its inputs.

    The inputs that it has do not matter. Of more than `_MOST_SETS` sets none is returned.
    """
    equations = _MotionEquations(linkage, carried)
    values, rows = np.linalg.svd(_least_rows(equations.constraints))[1:]
    rank, motions = _rank_and_motions(values, rows, _ROUNDED)
    mobility = equations.size - rank - len(carried.rods)
    if not 0 < mobility <= len(names) or comb(len(names), mobility) > _MOST_SETS:
        return []
    rates = np.vstack([_without_unit(equations.rate(name)) for name in names]) @ motions
    return [
        tuple(names[number] for number in chosen)
        for chosen in combinations(range(len(names)), mobility)
        if np.linalg.svd(rates[[*chosen]], compute_uv=False)[-1] > _ROUNDED
    ]


def check_freedom(linkage: SpaceLinkage, plan: SpacePlan, freedom: Freedom) -> None:
    """Refuse a linkage that its inputs do not move, or that its steps do not find."""
    count = len(linkage.driven)
    degrees = f'degree{"s" * (freedom.mobility != 1)} of freedom'
    counts = f'{count} input{"s" * (count != 1)} for {freedom.mobility} {degrees}'
    free = [link for link in freedom.free if link in linkage.link_names]
    if free:
        # At a toggle equations are redundant that are needed elsewhere.
        away = 'draw a pose that is not at a toggle, ' if freedom.redundant else ''
        stay = 'stay' if len(free) > 1 else 'stays'
        raise DefinitionError(
            'input', f'{counts}: {list_names(free)} {stay} free',
            f'{away}drive another joint, or hold what is free',
        )  # fmt: skip
    if freedom.dependent and not freedom.mobility:
        raise DefinitionError(
            'input', f'{counts}: the linkage is over-constrained, and cannot move',
            'let a hinge be a ball, or correct the axes and the places',
        )  # fmt: skip
    if freedom.dependent:
        raise DefinitionError(
            'input', f'{counts}: they depend on each other', 'leave one of them out'
        )
    unknown = [
        link for link in linkage.link_names if link not in plan.frames and link not in plan.idle
    ]
    if unknown or plan.lost:
        raise DefinitionError(
            'input',
            f'no step finds {list_names(unknown or plan.lost)}',
            'let each hang on hinges and slides that lead to the ground, or drive other joints',
        )


def balls_of(linkage: SpaceLinkage, carried: CarriedPoints) -> Iterator[tuple[str, str, str]]:
    """
    Yield each ball: its point, the first link that carries it, and another one.

    Links that hinges through the point join, as in a universal joint, share no ball.
    """
    for point in dict.fromkeys(carried.same[point] for point in linkage.points):
        left = [*carried.carriers[point]]
        first = left[0] if left else ''
        while left:
            joined = [left.pop(0)]
            if joined[0] != first:
                yield point, first, joined[0]
            for link in joined:
                on_hinge = [
                    end for end in left if _is_on_hinge(linkage, carried, point, {link, end})
                ]
                joined += on_hinge
                left = [end for end in left if end not in on_hinge]


def _is_on_hinge(
    linkage: SpaceLinkage, carried: CarriedPoints, point: str, links: set[str]
) -> bool:
    """Return whether a point lies on the axis of a hinge between two links."""
    place = np.array(carried.places[point])
    for hinge in linkage.hinges.values():
        arm = place - np.array(hinge.at) / carried.size
        axis = np.array(hinge.axis) / np.linalg.norm(hinge.axis)
        if {hinge.parent, hinge.child} == links and np.linalg.norm(np.cross(axis, arm)) < SAME:
            return True
    return False


def _without_unit(row: Array) -> Array:
    """Return a row in metres or radians as a row among others, which have no unit."""
    return row / (np.abs(row).max() or 1.0)


def _velocity_rows(place: Vector) -> Array:
    """Return the rows of the velocity of a place in the six numbers of its link."""
    x, y, z = place
    return np.array([[0, z, -y, 1, 0, 0], [-z, 0, x, 0, 1, 0], [y, -x, 0, 0, 0, 1]], dtype=float)


def _least_rows(matrix: Array) -> Array:
    """Return a matrix of the same singular values and motions without more rows than columns."""
    if matrix.shape[0] <= matrix.shape[1]:
        return matrix
    return np.asarray(np.linalg.qr(matrix, mode='r'))


def _rank_and_motions(values: Array, rows: Array, tolerance: float) -> tuple[int, Array]:
    """Return the rank by singular values, and the vectors that the matrix makes 0, as columns."""
    rank = int(np.count_nonzero(values > tolerance * values[0]))
    return rank, rows[rank:].T
