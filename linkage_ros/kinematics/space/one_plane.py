# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
A linkage in space whose links all move in one plane, as the planar linkage that it is.

The plane is across an axis of the ground, and keeps the names of the other two axes. A linkage in
an oblique plane stays spatial. So does one with hinges round a loop whose values in the pose do
not add up: frames of links cannot give each of them its zero. And so does one with two traced
points of a link above each other, which are one point in the plane.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from math import tau

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.plane.closure import PlanarClosure
from linkage_ros.kinematics.plane.linkage import Linkage, RevoluteJoint
from linkage_ros.kinematics.space.carried_points import CarriedPoints
from linkage_ros.kinematics.space.closure import closure_in_pose, SpaceClosure
from linkage_ros.kinematics.space.linkage import check_space_linkage, SpaceLinkage, unit_of
from linkage_ros.kinematics.space.merged_pose import merge_pose
from linkage_ros.kinematics.space.planar_loops import model_in_plane, PlanarLoop
from linkage_ros.kinematics.space.rod_joints import with_rod_joints
from linkage_ros.kinematics.space.vectors import GROUND_FRAME, scale

_SAME_ZERO = 1e-12
"""Difference of a joint's values in plane and space that is rounding, in [rad]."""

_PLANES = ('y', 'z'), ('x', 'z'), ('x', 'y')
"""The axes of the planes across x, y and z."""


def closure_as_drawn(
    linkage: SpaceLinkage, name: str = '', *, publish_model_joints: bool = False
) -> Closure:
    """
    Return the closure of a linkage that closes in its pose: planar if its links move so.

    With ``publish_model_joints`` its published joints place every link. Rods and struts hang on
    axes across the plane then, and the closure of a linkage that has some is spatial.
    """
    check_space_linkage(linkage)
    drawn = with_rod_joints(linkage) if publish_model_joints else linkage
    planar = linkage_in_plane(drawn)
    if planar is not None:
        # A pose at a toggle is left to the closure in space.
        with suppress(DefinitionError):
            closure = PlanarClosure(planar, name)
            turns = _turns_in_pose(closure, drawn)
            if any(turns.values()):
                joints = {
                    joint: replace(of, turns=turns[joint]) if isinstance(of, RevoluteJoint) else of
                    for joint, of in planar.joints.items()
                }
                closure = PlanarClosure(replace(planar, joints=joints), name)
            return closure
    spatial = closure_in_pose(linkage, name)
    if publish_model_joints:
        return SpaceClosure(with_rod_joints(spatial.linkage), name)
    return spatial


def _turns_in_pose(closure: PlanarClosure, linkage: SpaceLinkage) -> dict[str, int]:
    """Return for each joint the whole turns that its value lacks in the pose."""
    position = closure.close_unlimited(*linkage.pose.inputs)
    if not position.status.has_rates:
        raise DefinitionError('pose', 'the linkage is at a toggle', 'draw another pose')
    return {
        name: round((linkage.pose_value(name) - value) / tau)
        for name, value in zip(closure.joint_names, position.joints, strict=True)
    }


def linkage_in_plane(linkage: SpaceLinkage) -> Linkage | None:
    """Return a linkage as a planar one, or None if its links do not all move in one plane."""
    linkage = merge_pose(linkage)
    carried = CarriedPoints(linkage, unit_of(linkage))
    x, y, z = GROUND_FRAME[:3]
    for normal, axes in zip((x, scale(-1.0, y), z), _PLANES, strict=True):
        model = model_in_plane(linkage, carried, normal)
        sums = any(ratio.also for ratio in linkage.ratios.values())
        if model is not None and not sums and linkage.ratios.keys() <= {*linkage.published}:
            return _in_plane(linkage, model.with_joints(linkage.published, linkage.links), axes)
    return None


def _in_plane(linkage: SpaceLinkage, loop: PlanarLoop, axes: tuple[str, str]) -> Linkage | None:
    """Return the planar linkage, or None if it cannot say a joint's zero or a traced point."""
    named = {point for points in loop.linkage.links.values() for point in points}
    has_own_zeroes = any(abs(offset) > _SAME_ZERO for offset in loop.offsets.values())
    if has_own_zeroes or not named.issuperset(linkage.traced):
        return None
    planar = loop.linkage
    return replace(planar, traced=linkage.traced, axes=axes, left_out=linkage.left_out)
