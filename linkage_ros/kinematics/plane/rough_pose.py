# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The angles and places of iterated links, guessed from the pose of a file."""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics.plane.linkage import Linkage
from linkage_ros.kinematics.step import LinkState, Step

if TYPE_CHECKING:
    from linkage_ros.kinematics.plane.solved_links import SolvedLinks


def close_in_pose(linkage: Linkage, scale: float, steps: Sequence[Step]) -> LinkState:
    """Return the state after steps at the inputs of the pose; a DefinitionError if it is open."""
    assert linkage.pose is not None
    inputs = (
        value / scale if driven.slider else value
        for value, driven in zip(linkage.pose.inputs, linkage.inputs, strict=True)
    )
    solved = LinkState([0.0, *inputs], [])
    for step in steps:
        if not step.close(solved).status.has_pose:
            raise DefinitionError(
                'pose.inputs',
                'what comes before the links of the pose does not close there',
                'give inputs that the linkage can have',
            )
    return solved


def guess_unknowns(
    linkage: Linkage,
    links: Sequence[str],
    planner: SolvedLinks,
    pins: Mapping[str, complex],
    solved: LinkState,
) -> list[float]:
    """
    Return angle and place of each link, fitted to the points and angles that the pose names.

    ``solved`` are the links before, as `close_in_pose` returns them, ``pins`` places of their
    pins, in lengths.
    """
    pose, points, x = linkage.pose, planner.points, solved.coordinates
    assert pose is not None
    targets = {name: complex(*place) / planner.scale for name, place in pose.points.items()}
    targets |= pins
    angles = {link: x[a.coordinate] + a.constant for link, a in planner.angles.items()}
    angles |= {link: angle for link, angle in pose.angles.items() if link in links}

    def by_slider(link: str) -> float | None:
        """Return the angle of a link from its slider: by the other link or by the direction."""
        for name, slider in linkage.sliders.items():
            block, rail = planner.blocks[name], slider.along
            ends = slider.through, slider.point
            if link not in (block, rail):
                continue
            turn = slider.angle if link == block else 0.0
            if all(end in targets for end in ends) and targets[ends[0]] != targets[ends[1]]:
                along = targets[ends[1]] - targets[ends[0]]
                return phase(along / complex(*slider.direction)) + turn
            if link == block:
                return angle_of(rail) + turn
            if block in angles:
                return angles[block] - slider.angle
        return None

    def angle_of(link: str) -> float:
        if link not in angles:
            known = [name for name in points[link] if name in targets]
            apart = [n for n in known[1:] if points[link][n] != points[link][known[0]]]
            if apart:
                there = targets[apart[0]] - targets[known[0]]
                angles[link] = phase(there / (points[link][apart[0]] - points[link][known[0]]))
            else:
                angle = by_slider(link)
                if angle is None:
                    raise DefinitionError(
                        'pose.points',
                        f'does not say where {link!r} lies',
                        f'give two of its points: {list_names(points[link])}',
                    )
                angles[link] = angle
        return angles[link]

    start: list[float] = []
    for link in links:
        angle = angle_of(link)
        known = next((name for name in points[link] if name in targets), None)
        if known is None:
            raise DefinitionError(
                'pose.points', f'does not say where {link!r} lies', 'give one of its points'
            )
        first = next(iter(points[link].values()))
        place = targets[known] + rect(1.0, angle) * (first - points[link][known])
        start += (angle, place.real, place.imag)
    return start
