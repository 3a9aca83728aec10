# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Other assemblies of links that are iterated: further solutions at the inputs of the pose.

Their number is not known beforehand (a platform on three arms has at most six; K. H. Hunt, J.
Mech. Transm. Autom. Des. 105, 1983). The search starts from random angles, see
`IteratedStep.other_solutions`. Its results are assemblies; others may exist.
"""

from __future__ import annotations

from cmath import rect
from math import tau
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.iterated.iterated_step import IteratedStep
from linkage_ros.kinematics.plane.topology import Iterated
import numpy as np

if TYPE_CHECKING:
    from linkage_ros.kinematics.batch import Array
    from linkage_ros.kinematics.plane.closure import PlanarClosure

STARTS = 400
_SAME = 1e-6
"""Largest difference of angles [rad] and places [lengths] within one assembly."""


class Assembly(NamedTuple):
    """An assembly at the inputs of the pose."""

    # Places of the points that the pose names, in the frame of the ground, in [m].
    points: dict[str, complex]
    # Number of whole turns of the input after which the branch of the pose reaches it; 0 if it
    # does not.
    turns: int


def other_assemblies(closure: PlanarClosure, number: int) -> list[Assembly]:
    """
    Return the other assemblies of an iterated group at the inputs of the pose.

    The groups before it keep their places.
    """
    group = closure.structure.groups[number]
    assert isinstance(group, Iterated)
    (step,) = (
        step
        for step, owner in zip(closure.steps, closure.step_groups, strict=True)
        if owner == number and isinstance(step, IteratedStep)
    )
    return [
        Assembly(
            _pose_points(closure, group, unknowns), _turns_to_reach(closure, group, step, unknowns)
        )
        for unknowns in map(np.array, step.other_solutions(STARTS))
    ]


def _are_same(first: Array, second: Array) -> bool:
    away = first - second
    away[0::3] -= tau * np.round(away[0::3] / tau)
    return bool(np.abs(away).max() < _SAME)


def _pose_points(closure: PlanarClosure, group: Iterated, unknowns: Array) -> dict[str, complex]:
    """Return the places of the points of the group that the pose names."""
    pose = closure.linkage.pose
    assert pose is not None
    places = {}
    for name in pose.points:
        for body, link in enumerate(group.links):
            points = closure.structure.links[link]
            if name in points:
                angle, x, y = unknowns.reshape(-1, 3)[body].tolist()
                arm = complex(*points[name]) - complex(*next(iter(points.values())))
                places[name] = complex(x, y) * closure.scale + arm * rect(1.0, angle)
                break
    return places


def _turns_to_reach(
    closure: PlanarClosure, group: Iterated, step: IteratedStep, unknowns: Array
) -> int:
    """Return the number of turns after which the pose's branch reaches a solution; 0 if never."""
    if len(closure.linkage.inputs) > 1 or closure.linkage.inputs[0].slider:
        return 0
    branch = step.branch()
    if branch is None:
        return 0
    low, high, _, turns, _ = branch.interval
    assert closure.linkage.pose is not None
    (x,) = closure.linkage.pose.inputs
    last = turns - 1 if turns else int((high - x) // tau)
    first = 0 if turns else -int((x - low) // tau)
    for k in range(first, last + 1):
        solution = step.solution_at(x + k * tau)
        if k and solution is not None and _are_same(unknowns, solution):
            return k
    return 0
