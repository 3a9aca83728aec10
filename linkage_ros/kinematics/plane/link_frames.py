# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Position and rate of the frame of each link, of numbers and of symbols alike."""

from __future__ import annotations

from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.analysis.point_tracker import PointTracker
from linkage_ros.kinematics.plane.linkage import GROUND, Linkage

if TYPE_CHECKING:
    from linkage_ros.kinematics.plane.solved_links import SolvedLinks
    from linkage_ros.kinematics.plane.topology import Structure
    from linkage_ros.kinematics.results import Position, Velocity


class Block(NamedTuple):
    """The block of a slider: the link along which it slides, and a point of the link with it."""

    name: str
    along: str
    point: str
    link: str


class LinkFrames:
    """
    The frames of the links that move, and of the blocks of sliders that are not links.

    Such a block has its frame at the slider's point, with the angle of the link it slides along.
    """

    def __init__(self, linkage: Linkage, structure: Structure, known: SolvedLinks) -> None:
        carriers = {link: (link, 0j, link) for link in linkage.links if link != GROUND} | {
            block.name: (
                block.link,
                complex(*linkage.links[block.link][block.point]),
                block.along,
            )
            for block in separate_blocks(linkage, structure)
        }
        self.links = tuple(carriers)  # Names of the links and blocks, in the order of the frames
        self._tracker = PointTracker(known, [(link, at) for link, at, _ in carriers.values()])
        self._angles = [known.angles[turning] for _, _, turning in carriers.values()]

    def frames_at(self, position: Position) -> list[tuple[Any, Any]]:
        """Return the origin of each frame, as x + iy in [m], and its angle, in [rad]."""
        places = self._tracker.places(position)
        x = position.state.coordinates
        return [
            (places[index], x[angle.coordinate] + angle.constant)
            for index, angle in zip(self._tracker.indices, self._angles, strict=True)
        ]

    def frame_rates(self, position: Position, velocity: Velocity) -> list[tuple[Any, Any]]:
        """Return the velocity of each origin, in [m/s], and the rate of the angle, in [rad/s]."""
        places = self._tracker.places(position)
        velocities = self._tracker.velocities(position, velocity, places)
        v = velocity.state.coordinates
        return [
            (velocities[index], v[angle.coordinate])
            for index, angle in zip(self._tracker.indices, self._angles, strict=True)
        ]


def separate_blocks(linkage: Linkage, structure: Structure) -> list[Block]:
    """Return the blocks that are not links."""
    links = linkage.links
    carriers = {point: link for link in reversed(list(links)) for point in links[link]}
    return [
        Block(block, slider.along, slider.point, carriers[slider.point])
        for name, slider in linkage.sliders.items()
        if (block := structure.blocks[name]) not in links
    ]
