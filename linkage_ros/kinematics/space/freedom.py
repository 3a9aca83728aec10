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

from typing import NamedTuple

from linkage_ros.errors import DefinitionError, list_names, quote
from linkage_ros.kinematics.batch import Array
from linkage_ros.kinematics.space.linkage import SpaceLinkage
from linkage_ros.kinematics.space.plan import SpacePlan
from linkage_ros.kinematics.space.vectors import Vector
import numpy as np

_RANK = 1e-9
"""Singular values below this, relative to the largest, are rounding."""

_ROUNDED = 1e-4
"""Singular values below this, relative to the largest, may be the rounding of CAD."""

_MOVES = 1e-7
"""Motions of links above this are none of rounding."""


class Freedom(NamedTuple):
    """How free a linkage is in its pose."""

    mobility: int  # Degrees of freedom, without the turns of rods about themselves
    redundant: int  # Equations beyond those that are needed
    free: tuple[str, ...]  # Links that the inputs leave free
    dependent: int  # Inputs beyond the degrees of freedom


def find_freedom(linkage: SpaceLinkage, plan: SpacePlan) -> Freedom:
    """Return the degrees of freedom in the pose."""
    links = {name: number for number, name in enumerate(linkage.link_names)}
    places, count = plan.places, 6 * len(links)
    rows: list[Array] = []

    def spin(link: str) -> Array:
        first, found = 6 * links[link], np.zeros((3, count))
        found[:, first:][:, :3] = np.eye(3)
        return found

    def velocity(link: str, place: Vector) -> Array:
        x, y, z = place
        first = 6 * links[link]
        found = np.zeros((3, count))
        # v + ω × place
        found[:, first:][:, :3] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
        found[:, first:][:, 3:6] = np.eye(3)
        return found

    def rate(name: str) -> Array:
        """Return the row of a joint's rate, in the unit of the file."""
        if name in linkage.struts:
            one, other = linkage.struts[name]
            between = np.subtract(places[other], places[one])
            at_other, at_one = (
                velocity(plan.carriers[plan.same[point]][0], places[point])
                for point in (other, one)
            )
            along: Array = plan.scale * between / np.linalg.norm(between)
            return np.asarray(along @ (at_other - at_one))
        joint = linkage.pair_joints[name]
        axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
        if name in linkage.hinges:
            return np.asarray(axis @ (spin(joint.child) - spin(joint.parent)))
        at = (0.0, 0.0, 0.0)
        moving = velocity(joint.child, at) - velocity(joint.parent, at)
        return np.asarray(plan.scale * axis @ moving)

    for name, joint in linkage.pair_joints.items():
        axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
        across = np.eye(3) - np.outer(axis, axis)
        turning = spin(joint.child) - spin(joint.parent)
        x, y, z = joint.at
        at = (x / plan.scale, y / plan.scale, z / plan.scale)
        moving = velocity(joint.child, at) - velocity(joint.parent, at)
        hinge = name in linkage.hinges
        rows += [across @ turning, moving] if hinge else [turning, across @ moving]
    needed = 5 * len(linkage.pair_joints)
    for point, links_at in plan.carriers.items():
        if point not in linkage.points:
            continue
        for link in links_at[1:]:
            if _is_on_hinge(linkage, plan, point, {links_at[0], link}):
                continue
            rows.append(velocity(link, places[point]) - velocity(links_at[0], places[point]))
            needed += 3
    for name, ratio in linkage.ratios.items():
        rows.append((rate(name) - ratio.ratio * rate(ratio.of))[None])
        needed += 1
    ground = np.zeros((6, count))
    ground[:, :6] = np.eye(6)  # The first of the links
    constraints = np.vstack([*rows, ground])
    everything = np.vstack([constraints, np.vstack([rate(name) for name in linkage.driven])])
    rods = plan.rods

    def judge(tolerance: float) -> Freedom:
        rank, _ = _rank_and_motions(constraints, tolerance)
        locked, motions = _rank_and_motions(everything, tolerance)

        def moves(row: Array) -> bool:
            return bool(np.abs(row @ motions).max(initial=0.0) > _MOVES)

        free = [
            link
            for link in links
            if any(moves(velocity(link, places[point])) for point in plan.carried[link])
            or (link not in rods and moves(spin(link)))
        ]
        dependent = len(linkage.driven) - (locked - rank)
        return Freedom(count - rank - len(rods), needed + 6 - rank, tuple(free), dependent)

    # Rounded dimensions miss redundant equations: then the range decides whether they are met.
    exact, rounded = judge(_RANK), judge(_ROUNDED)
    return rounded if exact.dependent and not (rounded.free or rounded.dependent) else exact


def check_freedom(linkage: SpaceLinkage, plan: SpacePlan, freedom: Freedom) -> None:
    """Refuse a linkage that its inputs do not move, or that its steps do not find."""
    count = len(linkage.driven)
    degrees = f'degree{"s" * (freedom.mobility != 1)} of freedom'
    given = f'{count} input{"s" * (count != 1)} for {freedom.mobility} {degrees}'
    if freedom.free:
        # At a toggle equations are redundant that are needed elsewhere.
        away = 'draw a pose that is no toggle, ' if freedom.redundant else ''
        stay = 'stay' if len(freedom.free) > 1 else 'stays'
        raise DefinitionError(
            'input', f'{given}: {list_names(freedom.free)} {stay} free',
            f'{away}drive another joint, or hold what is free',
        )  # fmt: skip
    for name in linkage.driven:
        if name in linkage.pair_joints and _is_in_no_loop(linkage, name):
            raise DefinitionError('input', f'{quote(name)} is in no loop', 'leave its link out')
    if freedom.dependent and not freedom.mobility:
        raise DefinitionError(
            'input', f'{given}: the linkage is over-constrained, and cannot move',
            'let a hinge be a ball, or correct the axes and the places',
        )  # fmt: skip
    if freedom.dependent:
        raise DefinitionError(
            'input', f'{given}: they depend on each other', 'leave one of them out'
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


def _is_in_no_loop(linkage: SpaceLinkage, name: str) -> bool:
    """Return whether nothing but a joint leads from its child to its parent."""
    joint, reached = linkage.pair_joints[name], {linkage.pair_joints[name].child}
    ways = [{one.parent, one.child} for one in linkage.pair_joints.values() if one is not joint]
    for point in (*linkage.points, *linkage.struts):
        ends = linkage.struts.get(point, (point,))
        ways.append({link for link, of in linkage.links.items() if not set(ends).isdisjoint(of)})
    for _ in linkage.link_names:
        reached.update(*(way for way in ways if not way.isdisjoint(reached)))
    return joint.parent not in reached


def _is_on_hinge(linkage: SpaceLinkage, plan: SpacePlan, point: str, links: set[str]) -> bool:
    """Return whether a point lies on the axis of a hinge between two links."""
    place = np.array(plan.places[point])
    for hinge in linkage.hinges.values():
        arm = place - np.array(hinge.at) / plan.scale
        axis = np.array(hinge.axis) / np.linalg.norm(hinge.axis)
        if {hinge.parent, hinge.child} == links and np.abs(np.cross(axis, arm)).max() < _RANK:
            return True
    return False


def _rank_and_motions(matrix: Array, tolerance: float) -> tuple[int, Array]:
    """Return the rank of a matrix, and the vectors that it makes 0, as columns."""
    _, values, rows = np.linalg.svd(matrix)
    rank = int(np.count_nonzero(values > tolerance * values[0]))
    return rank, rows[rank:].T
