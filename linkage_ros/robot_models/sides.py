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


"""
On which sides the dyads of a linkage close, from a pose of its links.

A URDF does not say it. Each combination of sides is closed at the pose's inputs, and the one that
leads to the pose is taken: so no convention of the dyads stands here a second time.
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from math import pi, remainder, tau

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Linkage, Point, Pose, Side
from linkage_ros.kinematics.structure import Dyad, Iterated
from linkage_ros.kinematics.sweep_analysis import usual_inputs
from linkage_ros.kinematics.topology import find_groups

Poses = Mapping[str, tuple[complex, float]]
"""Of each link the origin of its frame, in [m], and its angle, in [rad]."""

_SIDED = ('RRR', 'RRP', 'RPR')
"""Dyads that close in two ways."""

_MANY = 10
"""Dyads whose sides are tried all together; each more doubles the time."""

_FOUND = 0.05
"""What the links of a pose may be turned by from where the linkage closes, in [rad]."""

_SAME = 1e-6
"""What the poses of two assemblies may differ by and be one, in [rad]; inputs likewise."""

_REMEDY = 'give a pose in which it is closed, off its toggles: --at JOINT=VALUE, for each joint'


def assembled(linkage: Linkage, inputs: tuple[float, ...], poses: Poses, where: str) -> Linkage:
    """
    Return a linkage with the sides that lead to a pose.

    Parameters
    ----------
    linkage
        The linkage, without sides.
    inputs
        Of the pose, in [rad] or [m].
    poses
        Where its links are then.
    where
        The pose in words, for messages.

    Raises
    ------
    DefinitionError
        Where it is no linkage; where no sides lead to the pose, or several do.

    """
    groups = find_groups(linkage).groups
    if any(isinstance(group, Iterated) for group in groups):
        linkage = replace(linkage, pose=Pose(inputs, _points(linkage, poses)))
    keys = [_key(each) for each in groups if isinstance(each, Dyad) and each.kind in _SIDED]
    if len(keys) > _MANY:
        reason = f'{len(keys)} dyads are too many to try all their sides'
        raise DefinitionError('assembly', reason, 'import it in parts')
    found = []
    choices = [
        ('ahead', 'behind') if key in linkage.sliders else ('left', 'right') for key in keys
    ]
    for sides in product(*choices):
        assembly: dict[str, Side] = dict(zip(keys, sides, strict=True))  # type: ignore[arg-type]
        closure = Closure(replace(linkage, assembly=assembly))
        found.append((_off(closure, inputs, poses), closure))
    found.sort(key=lambda each: each[0])
    least, closure = found[0]
    if least > _FOUND:
        raise DefinitionError('assembly', f'no way to close it leads to the pose {where}', _REMEDY)
    if len(found) > 1 and found[1][0] < least + _SAME:
        raise DefinitionError('assembly', f'two ways to close it meet {where}', _REMEDY)
    if closure.linkage.pose is None and not _near(usual_inputs(closure), inputs):
        return replace(closure.linkage, pose=Pose(inputs, {}))
    return closure.linkage


def _key(dyad: Dyad) -> str:
    """Return what names the side of a dyad: its slider, or the pin between its links."""
    joints = (dyad.inner, *dyad.outer)
    return next((joint.name for joint in joints if joint.kind == 'P'), dyad.inner.name)


def _points(linkage: Linkage, poses: Poses) -> dict[str, Point]:
    """Return where all points are in the pose, in the frame of the ground."""
    found: dict[str, Point] = {}
    for link, points in linkage.links.items():
        place, angle = poses[link]
        for name, at in points.items():
            there = place + rect(1.0, angle) * complex(*at)
            found.setdefault(name, (there.real, there.imag))
    return found


def _off(closure: Closure, inputs: tuple[float, ...], poses: Poses) -> float:
    """Return how far links are turned from the pose, at most, in [rad]."""
    position = closure.position(*inputs)
    if not position.joints:
        return pi
    angles = closure.link_angles(position)
    return max(abs(remainder(angles[link] - poses[link][1], tau)) for link in poses)


def _near(one: Sequence[float], other: Sequence[float]) -> bool:
    return all(abs(p - q) < _SAME for p, q in zip(one, other, strict=True))
