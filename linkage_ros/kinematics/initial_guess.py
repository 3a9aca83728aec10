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

"""The start of an iteration: the approximate pose of its links from the linkage file."""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from linkage_ros.errors import DefinitionError, listed
from linkage_ros.kinematics.linkage import Linkage


class InitialGuess(NamedTuple):
    """
    An approximate pose.

    Attributes
    ----------
    inputs
        The inputs of the pose, in [rad] or the unit of the lengths.
    angles
        Angles of the links, in [rad].
    places
        Places of the first point of each link, in the frame of the ground.

    """

    inputs: tuple[float, ...]
    angles: tuple[float, ...]
    places: tuple[complex, ...]


def initial_guess(
    linkage: Linkage,
    links: Sequence[str],
    blocks: Mapping[str, str],
    points: Mapping[str, Mapping[str, complex]],
    scale: float,
    place_known: Callable[[Sequence[float]], tuple[Mapping[str, complex], Mapping[str, float]]],
) -> InitialGuess:
    """
    Fit links to the points of the pose in the file.

    Parameters
    ----------
    linkage
        The linkage.
    links
        Names of the links to place.
    blocks
        For each slider the link that slides.
    points
        Points of every link, in its own frame and in the unit of the lengths.
    scale
        Metres in that unit.
    place_known
        Returns the places and link angles that are known at given inputs.

    Raises
    ------
    DefinitionError
        If there is no pose, or if it has too few points of a link.

    """
    if linkage.pose is None:
        raise DefinitionError(
            'pose',
            f'is missing: no dyad covers {listed(links)}, they are solved by iteration',
            'give inputs, and where points of these links lie then: '
            'pose: {inputs: [...], points: {...}}',
        )
    inputs = tuple(
        value / scale if driven.slider else value
        for value, driven in zip(linkage.pose.inputs, linkage.inputs, strict=True)
    )
    known_places, known_angles = place_known(inputs)
    given = {name: complex(x, y) / scale for name, (x, y) in linkage.pose.points.items()}
    given |= known_places
    angles = dict(known_angles)

    def by_slider(link: str) -> float | None:
        """Return the angle of a link from its slider: by the other link or by the direction."""
        for name, slider in linkage.sliders.items():
            block, rail = blocks[name], slider.along
            ends = slider.through, slider.point
            if link not in (block, rail):
                continue
            turn = slider.angle if link == block else 0.0
            if all(end in given for end in ends) and given[ends[0]] != given[ends[1]]:
                along = given[ends[1]] - given[ends[0]]
                return phase(along / complex(*slider.direction)) + turn
            if link == block:
                return angle_of(rail) + turn
            if block in angles:
                return angles[block] - slider.angle
        return None

    def angle_of(link: str) -> float:
        if link not in angles:
            known = [name for name in points[link] if name in given]
            apart = [n for n in known[1:] if points[link][n] != points[link][known[0]]]
            if apart:
                there = given[apart[0]] - given[known[0]]
                angles[link] = phase(there / (points[link][apart[0]] - points[link][known[0]]))
            else:
                angle = by_slider(link)
                if angle is None:
                    raise DefinitionError(
                        'pose.points',
                        f'does not say where {link!r} lies',
                        f'give two of its points: {listed(points[link])}',
                    )
                angles[link] = angle
        return angles[link]

    places = []
    for link in links:
        turn = rect(1.0, angle_of(link))
        known = next((name for name in points[link] if name in given), None)
        if known is None:
            raise DefinitionError(
                'pose.points', f'does not say where {link!r} lies', 'give one of its points'
            )
        first = next(iter(points[link].values()))
        places.append(given[known] + turn * (first - points[link][known]))
    return InitialGuess(inputs, tuple(angle_of(link) for link in links), tuple(places))
