# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Platforms that only rods carry: planned on three slides and three hinges from the ground.

A plan needs joints that lead from the ground to what only closes together. A platform on six rods
has none; its place and its turn about the axes of the ground are six.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import fsum

from linkage_ros.kinematics.plane.linkage import GROUND
from linkage_ros.kinematics.space.linkage import SpaceLinkage, SpatialJoint
from linkage_ros.kinematics.space.plan import SpacePlan
from linkage_ros.kinematics.space.vectors import GROUND_FRAME
from linkage_ros.names import free_name


def free_platforms(plan: SpacePlan) -> list[str]:
    """Return the links that a plan does not find, that do not spin, and that only balls hold."""
    joints = plan.linkage.pair_joints.values()
    held = {end for joint in joints for end in (joint.parent, joint.child)}
    rods = plan.carried_points.rods
    return [
        link
        for link in plan.linkage.links
        if link not in plan.frames and link not in held and link not in rods
    ]


def carry_platforms(
    linkage: SpaceLinkage, platforms: Sequence[str], whole: SpaceLinkage
) -> SpaceLinkage:
    """
    Return the linkage with joints that lead to these links from the ground.

    No link or joint of the ``whole`` linkage, of which this may be a part, has their names.
    """
    taken = {*whole.link_names, *whole.struts, *whole.pair_joints}
    hinges, slides = dict(linkage.hinges), dict(linkage.slides)
    for link in platforms:
        places = [linkage.points[point] for point in linkage.links[link]]
        x, y, z = (fsum(one) / len(places) for one in zip(*places, strict=True))
        at, on = (x, y, z), GROUND
        for prefix, joints in (('', slides), ('r', hinges)):
            for letter, axis in zip('xyz', GROUND_FRAME[:3], strict=True):
                name = free_name(f'{link}_{prefix}{letter}', taken)
                is_last = prefix and letter == 'z'
                child = link if is_last else free_name(f'{name}_carrier', taken)
                taken |= {name, child}
                joints[name] = SpatialJoint(on, child, axis, at)
                on = child
    return replace(linkage, hinges=hinges, slides=slides)
