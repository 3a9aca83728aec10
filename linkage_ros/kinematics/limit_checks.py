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


"""Limits that no state of a linkage meets, refused."""

from __future__ import annotations

from collections.abc import Iterable

from linkage_ros.errors import DefinitionError, listed, quoted
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.limits import Bound
from linkage_ros.kinematics.machine_ranges import within_own, within_published
from linkage_ros.kinematics.ranges import describe, InputRange
from linkage_ros.kinematics.sweep_analysis import grid, samples


def check_limits(closure: Closure) -> None:
    """
    Refuse limits between which a linkage cannot be.

    Raises
    ------
    DefinitionError
        Where the pose is beyond limits, the range of an input never meets its limits, or none of
        the states in it brings a published joint within its own.

    """
    bounds, linkage = closure.bounds, closure.linkage
    if not bounds:
        return
    if linkage.pose:
        joints = closure.position(*linkage.pose.inputs).joints
        bound = bounds.exceeded(linkage.pose.inputs, joints) if joints else None
        if bound is not None:
            raise DefinitionError(
                'pose.inputs',
                f'bring {quoted(bound.name)} to {bound.turned(joints[bound.number]):.6g}, '
                f'beyond its limits {_ends(closure, bound)}',
                'start within the limits, or widen them',
            )
    if len(linkage.inputs) == 1:
        _check_single(closure)
    elif not (linkage.pose and joints) and not _met_on_grid(closure):
        names = listed(map(quoted, linkage.limits))
        raise DefinitionError(
            'input.limits',
            f'no state was found within the limits of {names}',
            'widen them, or name a pose within them',
        )


def _check_single(closure: Closure) -> None:
    ranges, bounds = closure.closing_ranges, closure.bounds
    if bounds.inputs:
        (bound,) = bounds.inputs
        ranges = within_own(closure, ranges)
        if not ranges:
            raise DefinitionError(
                'input.limits',
                f'{_ends(closure, bound)} of {quoted(bound.name)} never meet its range, '
                f'{describe(closure.closing_ranges)}',
                'widen them',
            )
    for bound in bounds.joints:
        if not within_published(closure, ranges, [bound]):
            low, high = _extent(closure, ranges, bound)
            raise DefinitionError(
                f'joints.{bound.name}.limits',
                f'{_ends(closure, bound)} of {quoted(bound.name)} are never met: it goes from '
                f'{low:.6g} to {high:.6g}',
                'widen them',
            )
    if bounds.joints and not within_published(closure, ranges, bounds.joints):
        names = listed(quoted(bound.name) for bound in bounds.joints)
        raise DefinitionError(
            'joints',
            f'the limits of {names} are met, but never together',
            'widen them',
        )


def _extent(closure: Closure, ranges: Iterable[InputRange], bound: Bound) -> tuple[float, float]:
    """Return between which values a published joint goes, as near to its limits as turns let."""
    values = [value for one in ranges for value in samples(one)]
    found = [closure.position(value).joints for value in values]
    turned = [bound.turned(joints[bound.number]) for joints in found if joints]
    return min(turned), max(turned)


def _met_on_grid(closure: Closure) -> bool:
    return any(
        position.joints and closure.bounds.exceeded(inputs, position.joints) is None
        for inputs, position in grid(closure)
    )


def _ends(closure: Closure, bound: Bound) -> str:
    limits = closure.linkage.limits[bound.name]
    return str(limits)
