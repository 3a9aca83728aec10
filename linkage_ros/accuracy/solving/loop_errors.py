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


"""How far a method is from the truth, at the states of a set of poses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from statistics import median
from typing import Any, NamedTuple

from linkage_ros.accuracy.reference.reference import Truth
from linkage_ros.accuracy.solving.methods.method import Method
from linkage_ros.accuracy.solving.poses import Poses
from linkage_ros.kinematics.linkage import Linkage, RevoluteJoint
import numpy as np

FAR = 0.1
"""
In [rad], or of the size: an answer that is farther off counts as none, since it is another pose.
Of the distance, where poses are next to a change point: there the other assembly is as near.
"""


class Errors(NamedTuple):
    """
    What a method was off by.

    Attributes
    ----------
    each
        At every state the worst of the joints, in [rad], of slides of the linkage's size; nothing
        where it failed. Of rates and accelerations it is relative where they are above 1.
    failed
        The part of the states at which it gave no answer, or another pose's.

    """

    each: tuple[float | None, ...]
    failed: float

    @property
    def worst(self) -> float | None:
        """Return the greatest error where it did not fail."""
        return max(self._known, default=None)

    @property
    def middle(self) -> float | None:
        """Return the median error where it did not fail."""
        return median(self._known) if self._known else None

    @property
    def _known(self) -> list[float]:
        return [error for error in self.each if error is not None]


def size_of(linkage: Linkage) -> float:
    """Return the greatest distance between two points of a link, in [m]."""
    return max(
        abs(complex(*one) - complex(*other))
        for points in linkage.links.values()
        for one, other in combinations(points.values(), 2)
    )


def position_errors(method: Method, poses: Poses, truths: Sequence[Truth]) -> Errors:
    """
    Return the errors of a method's positions.

    What starts from its last state goes through the states twice and is judged the second time.
    """
    solve = method.position
    assert solve is not None
    _gone_through(method, poses)
    return _errors(poses, [solve(*inputs) for inputs in poses.inputs], truths, 0)


def motion_errors(
    method: Method, poses: Poses, truths: Sequence[Truth]
) -> tuple[Errors, Errors, Errors]:
    """Return the errors of a method's positions, rates and accelerations."""
    solve = method.motion
    assert solve is not None
    _gone_through(method, poses)
    found = [solve(*inputs) for inputs in poses.inputs]
    one, two, three = (
        _errors(poses, [motion[order] for motion in found], truths, order) for order in range(3)
    )
    return one, two, three


def batch_errors(
    solve: Callable[[Sequence[Any], int], Sequence[Any]], poses: Poses, truths: Sequence[Truth]
) -> tuple[Errors, Errors, Errors]:
    """Return the errors of what solves arrays."""
    found = solve([np.array(row) for row in zip(*poses.inputs, strict=True)], 2)
    one, two, three = (
        _errors(poses, [*zip(*rows, strict=True)], truths, order)
        for order, rows in enumerate(found)
    )
    return one, two, three


def off(linkage: Linkage, found: Sequence[Any], truth: Truth, order: int = 0) -> float:
    """
    Return what joints, rates or accelerations are off by.

    Parameters
    ----------
    linkage
        The linkage.
    found
        Of the published joints.
    truth
        The state.
    order
        Which derivative.

    """
    size, worst, greatest = size_of(linkage), 0.0, 1.0
    for joint, value, true in zip(
        linkage.joints.values(), found, truth.orders[order], strict=True
    ):
        difference = true - (value if hasattr(value, '_mpf_') else float(value))
        if isinstance(joint, RevoluteJoint):
            unit = 1.0
            if not order:
                turn = 2 * true.context.pi
                difference -= turn * true.context.nint(difference / turn)
        else:
            unit = size
        worst = max(worst, float(abs(difference)) / unit)
        greatest = max(greatest, float(abs(true)) / unit)
    return worst / greatest if order else worst


def _gone_through(method: Method, poses: Poses) -> None:
    if method.remembers and method.position is not None:
        for inputs in poses.inputs:
            method.position(*inputs)


def _errors(
    poses: Poses, found: Sequence[Sequence[Any]], truths: Sequence[Truth], order: int
) -> Errors:
    each: list[float | None] = []
    limits = [FAR] * len(truths)
    if poses.key == 'change_point' and not order:
        limits = [FAR * distance for distance in poses.distances]
    for joints, truth, limit in zip(found, truths, limits, strict=True):
        finite = len(joints) > 0 and all(abs(value) < float('inf') for value in joints)
        error = off(poses.linkage, joints, truth, order) if finite else None
        each.append(error if error is not None and error <= limit else None)
    return Errors(tuple(each), each.count(None) / len(each))
