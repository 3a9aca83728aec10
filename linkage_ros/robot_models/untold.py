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


"""What would have to be published, where the joints that are do not tell where a link stands."""

from __future__ import annotations

from collections.abc import Collection

from linkage_ros.kinematics.linkage import GROUND, Linkage, RevoluteJoint, SlideJoint
from linkage_ros.robot_models.orientation_part import Orientations


def remedy(
    linkage: Linkage, placed: Collection[str]
) -> tuple[str, str, RevoluteJoint | SlideJoint]:
    """Return a link that is joined to placed ones, and the joint that would tell of it."""
    known = {*Orientations(linkage).known_from(GROUND)}
    links = linkage.links
    for link in links:
        if link in placed:
            continue
        pinned = [on for on in placed if {*links[on]} & {*links[link]}]
        for on in pinned:
            if link not in known:
                return link, f'{link}_joint', RevoluteJoint(on, link)
        for name, slider in linkage.sliders.items():
            ends = (slider.along, *(each for each in links if slider.point in links[each]))
            held = [end for end in ends if end in placed]
            if link in ends and held and (link == slider.along or slider.along in placed):
                if link not in known:
                    return link, f'{link}_joint', RevoluteJoint(held[0], link)
                return link, f'{name}_slide', SlideJoint(name)
    raise AssertionError('every link is joined to the ground')


def joint_text(name: str, joint: RevoluteJoint | SlideJoint) -> str:
    """Return a joint as a linkage file says it."""
    if isinstance(joint, SlideJoint):
        return f'{name}: {{slider: {joint.slider}}}'
    return f'{name}: {{parent: {joint.parent}, child: {joint.child}}}'
