# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Coordinates, distances and angles of a planar linkage as published joints.

``P.x`` and ``P.y`` are the coordinates of a point: the slide of a block along an axis of the
ground that carries a slot across, with the point in it. ``A-B`` is the distance of two points: the
slide of a pin at B along a tube that is pinned to A. ``rod.angle`` is the angle of a link to the
ground. The links that are added have no mass and hold nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from linkage_ros.errors import DefinitionError, did_you_mean, list_names, quote
from linkage_ros.kinematics.plane.linkage import (
    GROUND,
    Linkage,
    links_by_point,
    RevoluteJoint,
    SlideJoint,
    Slider,
)

_AXES = ((1.0, 0.0), (0.0, 1.0)), ((0.0, 1.0), (1.0, 0.0))
"""For each axis of the plane its direction, and that of the slot across."""


def with_measured(linkage: Linkage, names: Sequence[str]) -> Linkage:
    """
    Return a linkage with what names describe as published joints, after its own; also inputs.

    A name that is neither a joint nor describes what moves raises DefinitionError.
    """
    inputs = {driven.joint: driven for driven in linkage.inputs}
    for name in names:
        if name in linkage.joints:
            continue
        if name in inputs:
            joints = {**linkage.joints, name: inputs[name].as_joint()}
            linkage = replace(linkage, joints=joints)
        else:
            linkage = _add_measured(linkage, name)
    return linkage


def _add_measured(linkage: Linkage, name: str) -> Linkage:
    carriers = links_by_point(linkage.links)
    ends = point_pair(name, carriers)
    of, _, what = name.rpartition('.')
    if of in carriers and what in linkage.axes:
        if GROUND in carriers[of]:
            raise DefinitionError(name, f'{of} is a point of the ground', 'name one that moves')
        added = _with_coordinate(linkage, name, of, what)
    elif of in linkage.links and what == 'angle':
        if of == GROUND:
            raise DefinitionError(name, 'the ground does not turn', 'name a link that moves')
        joints = {**linkage.joints, name: RevoluteJoint(GROUND, of)}
        added = replace(linkage, joints=joints)
    elif ends is not None:
        check_apart(name, carriers[ends[0]], carriers[ends[1]])
        added = _with_distance(linkage, name, *ends)
    else:
        coordinates = (f'{point}.{axis}' for point in linkage.traced for axis in linkage.axes)
        known = [*(driven.joint for driven in linkage.inputs), *linkage.joints, *coordinates]
        raise DefinitionError(
            name or quote(name), 'is not a joint, and describes no point, distance or angle',
            did_you_mean(
                name, known, f'name one of {list_names(known)}, or P.x, A-B, LINK.angle'
            ),
        )  # fmt: skip
    if linkage.nominal is not None:
        added = replace(added, nominal=_add_measured(linkage.nominal, name))
    return added


def point_pair(name: str, points: Collection[str]) -> tuple[str, str] | None:
    """Return the two points of a distance such as ``A-B``; their names may have hyphens."""
    parts = name.split('-')
    pairs = (('-'.join(parts[:k]), '-'.join(parts[k:])) for k in range(1, len(parts)))
    return next((pair for pair in pairs if pair[0] in points and pair[1] in points), None)


def check_apart(name: str, first: Sequence[str], second: Sequence[str]) -> None:
    """Refuse the distance of two points that one link carries; these are their carriers."""
    both = [link for link in first if link in second]
    if both:
        raise DefinitionError(
            name, f'both points are on {both[0]}: their distance does not change',
            'name points of two links',
        )  # fmt: skip


def _with_coordinate(linkage: Linkage, name: str, point: str, axis: str) -> Linkage:
    along, across = _AXES[linkage.axes.index(axis)]
    block, origin = f'carrier of {name}', f'origin of {name}'
    ground = {**linkage.links[GROUND], origin: (0.0, 0.0)}
    sliders = {
        name: Slider(block, GROUND, origin, along, block),
        f'slot of {name}': Slider(point, block, block, across),
    }
    return replace(
        linkage,
        links={**linkage.links, GROUND: ground, block: {block: (0.0, 0.0)}},
        sliders={**linkage.sliders, **sliders},
        joints={**linkage.joints, name: SlideJoint(name)},
    )


def _with_distance(linkage: Linkage, name: str, start: str, end: str) -> Linkage:
    tube = f'tube of {name}'
    return replace(
        linkage,
        links={**linkage.links, tube: {start: (0.0, 0.0)}},
        sliders={**linkage.sliders, name: Slider(end, tube, start, (1.0, 0.0))},
        assembly={**linkage.assembly, name: 'ahead'},
        joints={**linkage.joints, name: SlideJoint(name)},
    )
