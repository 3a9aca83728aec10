# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Coordinates of points and distances of points of a spatial linkage as published joints.

``P.x``, ``P.y`` and ``P.z`` are the coordinates of a point in the frame of the ground: slides
along the axes, one on the other, of which the last carries the point. ``A-B`` is a strut.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from linkage_ros.errors import DefinitionError, did_you_mean, list_names, quote
from linkage_ros.kinematics.analysis.measured_points import check_apart, point_pair
from linkage_ros.kinematics.plane.linkage import GROUND
from linkage_ros.kinematics.space.linkage import SpaceLinkage, SpatialJoint
from linkage_ros.kinematics.space.vectors import Vector

_AXES: dict[str, Vector] = {'x': (1.0, 0.0, 0.0), 'y': (0.0, 1.0, 0.0), 'z': (0.0, 0.0, 1.0)}


def with_measured(linkage: SpaceLinkage, names: Sequence[str]) -> SpaceLinkage:
    """
    Return a linkage with what names describe as published joints, after its own.

    A name that is neither a joint nor describes what moves raises DefinitionError.
    """
    for name in names:
        known = [*linkage.pair_joints, *linkage.struts]
        of, _, axis = name.rpartition('.')
        pair = point_pair(name, linkage.points)
        if name in known:
            if name not in linkage.published:
                linkage = replace(linkage, published=(*linkage.published, name))
        elif of in linkage.points and axis in _AXES:
            linkage = _with_coordinate(linkage, name, of, axis)
        elif pair is not None:
            linkage = _with_distance(linkage, name, pair)
        elif axis == 'angle' and of in linkage.link_names:
            own = [
                hinge
                for hinge, joint in linkage.hinges.items()
                if of in (joint.parent, joint.child)
            ]
            raise DefinitionError(
                name, 'a link in space turns about more than one axis, and has no one angle',
                f'name a hinge, as {list_names(own or linkage.hinges)}',
            )  # fmt: skip
        else:
            remedy = f'name one of {list_names(known)}, or P.x, A-B'
            raise DefinitionError(
                name or quote(name), 'is not a joint, and describes no point or distance',
                did_you_mean(name, known, remedy),
            )  # fmt: skip
    return linkage


def _with_coordinate(linkage: SpaceLinkage, name: str, point: str, axis: str) -> SpaceLinkage:
    if point in linkage.links.get(GROUND, ()):
        raise DefinitionError(name, f'{point} is a point of the ground', 'name one that moves')
    place = dict(zip(_AXES, linkage.points[point], strict=True))
    slides, before, carriers = dict(linkage.slides), GROUND, []
    for letter in (axis, *(letter for letter in _AXES if letter != axis)):
        link, slide = f'carrier along {letter} of {name}', f'{letter} of {name}'
        slide = name if letter == axis else slide
        slides[slide] = SpatialJoint(before, link, _AXES[letter], value=place[letter])
        before = link
        carriers.append(link)
    return replace(
        linkage,
        slides=slides,
        links={**linkage.links, before: (point,)},
        published=(*linkage.published, name),
        masses=linkage.masses_with(*carriers),
    )


def _with_distance(linkage: SpaceLinkage, name: str, pair: tuple[str, str]) -> SpaceLinkage:
    carriers = [[link for link, on in linkage.links.items() if end in on] for end in pair]
    check_apart(name, *carriers)
    return replace(
        linkage,
        struts={**linkage.struts, name: pair},
        published=(*linkage.published, name),
    )
