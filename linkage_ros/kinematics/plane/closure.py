# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The loop closure of a planar linkage: from its inputs to its joints, points and frames."""

from __future__ import annotations

from collections.abc import Sequence
from math import tau
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.analysis.ranges import closing_ranges, link_lengths
from linkage_ros.kinematics.arithmetic import unit_vector
from linkage_ros.kinematics.built_once import BuiltProperty
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.limits import without_mirrored, zero_length
from linkage_ros.kinematics.plane.checks import check_linkage
from linkage_ros.kinematics.plane.linkage import GROUND, Linkage, RevoluteJoint, SlideJoint
from linkage_ros.kinematics.plane.plan import SolutionPlan
from linkage_ros.kinematics.plane.topology import assur_groups, Driven, Dyad, links_of, Structure
from linkage_ros.kinematics.results import (
    Acceleration,
    InputRange,
    Near,
    Plan,
    PointMotion,
    Position,
    Velocity,
)
from linkage_ros.kinematics.step import LinkState

if TYPE_CHECKING:
    from linkage_ros import LinkagePage
    from linkage_ros.kinematics.analysis.point_tracker import PointTracker


class PlanarClosure(Closure):
    """A planar linkage, ready to be solved; see `Closure`."""

    linkage: Linkage
    takes = Linkage

    def __init__(self, linkage: Linkage, name: str = '') -> None:
        check_linkage(linkage)
        self.structure: Structure = assur_groups(linkage)
        planner = SolutionPlan(linkage, self.structure)
        self._set_linkage(linkage, name, planner.scale)
        steps = tuple(planner.steps)
        self._known = planner
        self.step_groups = tuple(planner.step_groups)
        self.angles, self.slides = planner.angles, planner.slides
        self.turns_with = planner.turns_with
        self.ratio_turns = planner.ratio_turns
        self._terms = tuple(self._joint_term(joint) for joint in linkage.joints.values())
        self._point_index = {
            (link, name): planner.place_point(link, point)
            for link, points in planner.points.items()
            for name, point in points.items()
        }
        self.steps = steps
        needed = len(steps)
        self._more_steps = tuple(planner.steps[needed:])

    def view(self) -> LinkagePage:
        """
        Return the page of `linkage view`, which a notebook shows in a cell.

        Raises
        ------
        LinkageError
            If plotly is not installed.

        """
        from linkage_ros import LinkagePage  # local import: only a notebook asks for pages

        return LinkagePage(self)

    def plan_exchange(self, names: Sequence[str], near: Near) -> Plan:
        """Return how the linkage is planned with other inputs, joints of this closure."""
        from linkage_ros.kinematics.analysis.exchanged_inputs import (
            PlaneExchange,  # local import: only few ask for it
        )

        return PlaneExchange(self, names, near, lambda linkage: PlanarClosure(linkage, self.name))

    def measuring(self, *names: str) -> PlanarClosure:
        """Return the closure with these names among its joints; see `Closure`."""
        if {*names} <= {*self.joint_names}:
            return self
        from linkage_ros.kinematics.analysis.measured_points import (
            with_measured,  # local import: only few ask for it
        )

        return PlanarClosure(with_measured(self.linkage, names), self.name)

    def points(self, position: Position) -> dict[tuple[str, str], complex]:
        """
        Return every point of every link, by link and name, in the ground's frame.

        Returns
        -------
        points : dict
            For each pair of names the place x + iy, in [m].

        Raises
        ------
        ValueError
            If the linkage has no pose.

        """
        if not position.status.has_pose:
            raise ValueError(f'points: {position!r} has none; check its status first')
        places = self._with_all_points(position).pins
        return {key: places[i] * self.scale for key, i in self._point_index.items()}

    def named_points(self, position: Position) -> dict[str, complex]:
        """Return every point by its name, as `Position.points`."""
        return {point: place for (_, point), place in self.points(position).items()}

    def named_motion(
        self, position: Position, velocity: Velocity, acceleration: Acceleration
    ) -> dict[str, PointMotion]:
        """Return `point_motion` by the names of the points."""
        motions = self.point_motion(position, velocity, acceleration)
        return {point: motion for (_, point), motion in motions.items()}

    def point_motion(
        self, position: Position, velocity: Velocity, acceleration: Acceleration
    ) -> dict[tuple[str, str], PointMotion]:
        """Return place, velocity and acceleration of every point of every link."""
        state = self._with_all_points(position)
        velocities = LinkState(velocity.state.coordinates, list(velocity.state.pins))
        accelerations = LinkState(acceleration.state.coordinates, list(acceleration.state.pins))
        for step in self._more_steps:
            rates = step.rates((), state, velocities)
            step.accelerations((), rates, state, velocities, accelerations)
        return {
            key: PointMotion(
                *(values.pins[i] * self.scale for values in (state, velocities, accelerations))
            )
            for key, i in self._point_index.items()
        }

    def point_tracker(self, points: Sequence[tuple[str, complex]]) -> PointTracker:
        """
        Return a tracker of certain points of links, which computes no others.

        Each point is the name of its link and its place in that link's frame, in [m].
        """
        from linkage_ros.kinematics.analysis.point_tracker import (
            PointTracker,  # local import: only forces need it
        )

        return PointTracker(self._known, points)

    @BuiltProperty
    def link_frames(self) -> LinkFrames:
        """Return the frames of the links and blocks that move."""
        return LinkFrames(self)

    def link_angles(self, position: Position) -> dict[str, float]:
        """Return the angle of every link to the ground, in [rad], not wrapped."""
        x = position.state.coordinates
        return {link: x[angle.coordinate] + angle.constant for link, angle in self.angles.items()}

    def slide_values(self, position: Position) -> dict[str, float]:
        """Return the slide of every slider, in [m]."""
        x = position.state.coordinates
        return {
            name: self.scale * (slide.sign * x[slide.coordinate] + slide.constant)
            for name, slide in self.slides.items()
        }

    def closing_errors(self, position: Position) -> list[float]:
        """
        Return the distances between the two places of each pin, or slider's point, in [m].

        Each link is placed by its own pin or slider and its angle. Ratios between joints join no
        places, and are not counted.
        """
        points, angles = self.points(position), self.link_angles(position)
        errors = []
        for joint in self.structure.joints:
            if joint.kind == 'R':
                error = points[joint.link, joint.name] - points[joint.to, joint.name]
            else:
                slider = self.linkage.sliders[joint.name]
                between = points[joint.link, slider.point] - points[joint.to, slider.through]
                line = complex(*slider.direction) * unit_vector(angles[joint.to])
                along = self.slide_values(position)[joint.name]
                error = between - along * line / abs(line)
            errors.append(abs(error))
        return errors

    @BuiltProperty
    def closing_ranges(self) -> tuple[InputRange, ...]:
        """
        Ranges in which a single input closes every loop, without limits; empty for several.

        A cylinder has only the ranges of positive length, unless it starts in the others or is
        limited to them.
        """
        return self.keep_usual(closing_ranges(self))

    @BuiltProperty
    def zero_length(self) -> float | None:
        """Slide at which the two pins of a cylinder meet, in [m]; None if there is none."""
        return zero_length(self.linkage, self.structure)

    @property
    def slide_bound(self) -> float:
        """Return a length that no slide needs to exceed for a link to be stretched, in [m]."""
        return sum(link_lengths(self.structure.links))

    def keep_usual(self, ranges: tuple[InputRange, ...]) -> tuple[InputRange, ...]:
        """Return the ranges of the first input that a user expects: cylinders of one sign."""
        return without_mirrored(self.linkage, self.structure, ranges) if ranges else ()

    def needed_groups(self, number: int) -> set[int]:
        """Return the numbers of a group and of the groups that it starts from."""
        groups = self.structure.groups
        owner = {link: i for i, group in enumerate(groups) for link in links_of(group)}
        needed: set[int] = set()
        asked = [number]
        while asked:
            i = asked.pop()
            if i not in needed:
                needed.add(i)
                group = groups[i]
                if isinstance(group, Driven):
                    starts = [group.joint.to, *self._followed_links(group.index)]
                elif isinstance(group, Dyad):
                    starts = [joint.to for joint in group.outer]
                else:
                    return set(range(number + 1))
                asked += [owner[link] for link in starts if link != GROUND]
        return needed

    def _followed_links(self, number: int) -> list[str]:
        """Return the links between which the joint is that a driven joint follows; or none."""
        linkage = self.linkage
        ratio = linkage.ratios.get(linkage.driven_joints[number].joint)
        if ratio is None:
            return []
        joint = linkage.named_joints[ratio.of]
        if isinstance(joint, SlideJoint):
            return [linkage.sliders[joint.slider].along, self.structure.blocks[joint.slider]]
        return [joint.parent, joint.child]

    def links_of_group(self, number: int) -> list[str]:
        """Return the links of a group; a block has the name of its slider."""
        sliders = {block: f'slider {name}' for name, block in self.structure.blocks.items()}
        links = links_of(self.structure.groups[number])
        return [sliders.get(link, link) for link in links]

    def _with_all_points(self, position: Position) -> LinkState:
        """Return a position with all points placed, also those that no loop needs."""
        state = LinkState(position.state.coordinates, list(position.state.pins))
        for step in self._more_steps:
            step.close(state)
        return state

    def _joint_term(self, joint: RevoluteJoint | SlideJoint) -> tuple[int, int, float, float]:
        """Return a published joint as factor·(x[i] − x[j]) + constant, in [rad] or [m]."""
        i, j, factor, constant = self._known.joint_term(joint)
        if isinstance(joint, SlideJoint):
            return i, j, factor * self.scale, constant * self.scale
        return i, j, factor, constant + tau * joint.turns


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

    def __init__(self, closure: PlanarClosure) -> None:
        linkage = closure.linkage
        carriers = {link: (link, 0j, link) for link in linkage.links if link != GROUND} | {
            block.name: (
                block.link,
                complex(*linkage.links[block.link][block.point]),
                block.along,
            )
            for block in separate_blocks(linkage, closure.structure)
        }
        self.links = tuple(carriers)  # Names of the links and blocks, in the order of the frames
        self._tracker = closure.point_tracker([(link, at) for link, at, _ in carriers.values()])
        self._angles = [closure.angles[turning] for _, _, turning in carriers.values()]

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
