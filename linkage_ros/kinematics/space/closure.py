# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
The loop closure of a spatial linkage: from its inputs to its joints, points and frames.

A plan needs joints that lead from the ground to what only closes together. A platform on six rods
has none: it is planned on three slides and three hinges from the ground, its place and its turn.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain, pairwise, permutations
from math import atan2, dist, fsum, sqrt, tau
from typing import TYPE_CHECKING

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.analysis.sweep_analysis import grid_positions
from linkage_ros.kinematics.arithmetic import remainder
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.iterated.straight_line import has_symbols, StraightLine
from linkage_ros.kinematics.plane.linkage import GROUND, Limits, SlideJoint, turn_ratios
from linkage_ros.kinematics.results import Acceleration, Near, Plan, Position, Velocity
from linkage_ros.kinematics.space.carried_points import CarriedPoints, unit_across
from linkage_ros.kinematics.space.idle_turns import hold_idle_turns
from linkage_ros.kinematics.space.linkage import (
    check_space_linkage,
    size_of,
    SpaceLinkage,
    SpatialJoint,
)
from linkage_ros.kinematics.space.merged_pose import merge_pose
from linkage_ros.kinematics.space.plan import SpacePlan
from linkage_ros.kinematics.space.vectors import (
    cross,
    dot,
    GROUND_FRAME,
    length,
    minus,
    scale,
    SpaceFrame,
    Vector,
)
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState
from linkage_ros.names import free_name

if TYPE_CHECKING:
    from linkage_ros.kinematics.space.freedom import Freedom
    from linkage_ros.kinematics.space.point_tracker import RodAxis, SpatialTracker

Quaternion = tuple[float, float, float, float]

_MET = 1e-4
"""Largest gap of a redundant equation, relative to the size: CAD rounds."""

_BESIDE = 0.01
"""How far from a pose a linkage is judged, in [rad] or [m]."""

_STATES = 64
"""Number of states over the inputs in which redundant equations are checked."""


class SpaceClosure(Closure):
    """A spatial linkage, ready to be solved; see `Closure`."""

    linkage: SpaceLinkage
    takes = SpaceLinkage

    def __init__(self, linkage: SpaceLinkage, name: str = '') -> None:
        check_space_linkage(linkage)
        linkage = merge_pose(linkage)
        check_space_linkage(linkage)
        still, planned, hung, one_with = hold_idle_turns(linkage)
        plan = SpacePlan(planned, _add_knot)
        if platforms := free_platforms(plan):
            planned = carry_platforms(planned, platforms, linkage)
            hung = hung and carry_platforms(hung, platforms, linkage)
            plan = SpacePlan(planned, _add_knot)
        if hung is not None:
            plan.hang_rods(hung)
        plan.finish()
        self._plan = plan
        self.held = tuple(plan.linkage.held)
        """Hinges that keep their value, since turns about them move nothing else."""
        from linkage_ros.kinematics.space.freedom import (
            check_freedom,  # local import: it loads numpy
            find_freedom,  # local import: it loads numpy
        )

        freedom = find_freedom(still, CarriedPoints(still, plan.scale))
        at_change_point = freedom.free and plan.finds_all
        for gone, kept in one_with.items():
            if kept in plan.frames:
                plan.frames[gone], plan.pose_frames[gone] = (
                    plan.frames[kept],
                    plan.pose_frames[kept],
                )
        if not at_change_point:
            check_freedom(linkage, plan, freedom)
        self.turns_with = plan.turns_with
        corrections = replace(linkage.corrections, tilted_by=plan.tilt)
        linkage = replace(linkage, corrections=corrections)
        self._set_linkage(linkage, name, plan.scale)
        named = {*linkage.link_names}
        self.groups = [
            group._replace(links=tuple(link for link in group.links if link in named))
            for group in plan.groups
        ]
        self._knots = plan.knots
        self.idle = plan.idle
        """Rods that may turn about themselves."""
        self._error_line = StraightLine(self._list_errors, lambda: None)
        self.steps, self.step_groups = tuple(plan.steps), tuple(plan.step_groups)
        self.ratio_turns = plan.ratio_turns
        self._terms = tuple(
            (plan.coordinates[name], 0, plan.scale if isinstance(joint, SlideJoint) else 1.0, 0.0)
            for name, joint in linkage.joints.items()
        )
        if at_change_point:
            freedom = self._freedom_beside_pose(still) or freedom
            check_freedom(linkage, plan, freedom)
        self.freedom: Freedom = freedom

    def _freedom_beside_pose(self, still: SpaceLinkage) -> Freedom | None:
        """Return the degrees of freedom of a linkage of this plan next to a change point."""
        from linkage_ros.kinematics.space.freedom import (
            find_freedom,  # local import: it loads numpy
        )

        beside = (value + _BESIDE for value in self.linkage.pose.inputs)
        position = self.close_unlimited(*beside)
        if position.status is not Status.CLOSED:
            return None
        moved = self._redraw(still, position)
        return find_freedom(moved, CarriedPoints(moved, self.scale))

    def _redraw(self, linkage: SpaceLinkage, position: Position) -> SpaceLinkage:
        """Return a linkage of these links with the places of a position as its pose."""
        plan, state = self._plan, position.state

        def carry_joint(link: str, joint: SpatialJoint) -> tuple[Vector, Vector, Vector]:
            """Return place and axis of a joint, and a vector across, as a link has them."""
            drawn, frame = plan.pose_frames[link], state.pins[plan.frames[link]]
            at = frame.place(drawn.locate(scale(1.0 / self.scale, joint.at)))
            along = scale(1.0 / length(joint.axis), joint.axis)
            across = frame.turn(drawn.resolve(unit_across(along)))
            return scale(self.scale, at), frame.turn(drawn.resolve(along)), across

        def redraw(name: str, joint: SpatialJoint, *, slides: bool) -> SpatialJoint:
            at, axis, across = carry_joint(joint.parent, joint)
            value = joint.value
            if name in plan.coordinates:
                value = state.coordinates[plan.coordinates[name]] * (self.scale if slides else 1.0)
            elif joint.child in plan.frames:
                moved, _, turned = carry_joint(joint.child, joint)
                value += (
                    dot(axis, minus(moved, at))
                    if slides
                    else atan2(dot(axis, cross(across, turned)), dot(across, turned))
                )
            if not (slides or joint.limits.is_bounded):
                value -= tau * round((value - joint.value) / tau)
            return replace(joint, at=at, axis=axis, value=value)

        return replace(
            linkage,
            points=self._find_places(position.state, linkage.points),
            hinges={
                name: redraw(name, hinge, slides=False) for name, hinge in linkage.hinges.items()
            },
            slides={
                name: redraw(name, slide, slides=True) for name, slide in linkage.slides.items()
            },
        )

    def plan_exchange(self, names: Sequence[str], _near: Near) -> Plan:
        """Return how the linkage is planned with other inputs, joints of this closure."""
        linkage = self.linkage
        own = dict.fromkeys((*linkage.driven, *linkage.published))
        exchanged = replace(
            linkage,
            driven=tuple(names),
            published=tuple(name for name in own if name not in names),
            ratios=turn_ratios(linkage.ratios, names),
        )

        def plan(
            position: Position, _known: Mapping[str, float], limits: Mapping[str, Limits]
        ) -> SpaceClosure:
            drawn = self._redraw(exchanged, position)
            return SpaceClosure(drawn.with_limits(limits), self.name)

        return plan

    def measuring(self, *names: str) -> SpaceClosure:
        """Return the closure with these names among its joints; see `Closure`."""
        if {*names} <= {*self.joint_names}:
            return self
        from linkage_ros.kinematics.space.measured_points import (
            with_measured,  # local import: only few ask for it
        )

        return SpaceClosure(with_measured(self.linkage, names), self.name)

    @property
    def joint_coordinates(self) -> dict[str, int]:
        """Return for each joint whose value is known its index among the coordinates."""
        return self._plan.coordinates

    def points(self, position: Position) -> dict[str, Vector]:
        """
        Return every point in the frame of the ground, as (x, y, z), in [m].

        Raises
        ------
        ValueError
            If the linkage has no pose.

        """
        self._check_pose('points', position)
        return self._find_places(position.state, self.linkage.points)

    def _find_places(self, state: LinkState, names: Iterable[str]) -> dict[str, Vector]:
        """Return the places of points that a link carries, in [m]."""
        places = {}
        for name in names:
            point = self._plan.same[name]
            if point in self._plan.points:
                place = state.pins[self._plan.points[point]]
            else:
                carriers = self._plan.carriers[point]
                known = [link for link in carriers if link in self._plan.frames]
                if not known:
                    continue
                place = self._carried_place(state, known[0], point)
            places[name] = scale(self.scale, place)
        return places

    def named_points(self, position: Position) -> dict[str, Vector]:
        """Return every point by its name, as `points`."""
        return self.points(position)

    def named_motion(
        self, position: Position, velocity: Velocity, acceleration: Acceleration
    ) -> dict[str, tuple[Vector, Vector, Vector]]:
        """Return place, velocity and acceleration of every traced point, in [m]."""
        motions = {}
        for point in self.linkage.traced:
            index = self._plan.points.get(self._plan.same[point])
            if index is not None:
                place, rate, change = (
                    scale(self.scale, motion.state.pins[index])
                    for motion in (position, velocity, acceleration)
                )
                motions[point] = (place, rate, change)
        return motions

    def point_tracker(
        self, points: Sequence[tuple[str, Vector]], links: Sequence[str] = ()
    ) -> SpatialTracker:
        """
        Return a tracker of certain points of links, and of the turns of certain links.

        Each point is the name of its link and its place in the pose, in [m].
        """
        from linkage_ros.kinematics.space.point_tracker import (
            SpatialTracker,  # local import: only forces need it
        )

        return SpatialTracker(self._plan, points, links)

    def carried_vector(self, link: str, vector: Vector) -> Callable[[Position], Vector]:
        """Return a function that gives a vector of the pose as a link with a frame turns it."""
        pin, own = self._plan.frames[link], self._plan.pose_frames[link].resolve(vector)
        return lambda position: position.state.pins[pin].turn(own)

    def spin_of(self, link: str) -> Callable[[Velocity], Vector]:
        """Return a function that gives the spin of a link with a frame, in [rad/s]."""
        pin = self._plan.frames[link]
        return lambda velocity: velocity.state.pins[pin].spin

    def rod_axis(self, link: str) -> RodAxis:
        """Return the axis of a rod that may spin, in the pose, in [m]."""
        from linkage_ros.kinematics.space.point_tracker import (
            rod_axis,  # local import: only forces need it
        )

        axis = rod_axis(self._plan, link)
        start, end = scale(self.scale, axis.start), scale(self.scale, axis.end)
        return axis._replace(start=start, end=end)

    def frames(self, position: Position) -> dict[str, tuple[Vector, Quaternion]]:
        """
        Return the frame of every link: the place of its origin, and how far it has turned.

        In the pose of the file the frames are parallel to that of the ground, and have their
        origins at a hinge or a point of the link. A rod that may turn about itself does not.

        Returns
        -------
        frames : dict
            For each link the place (x, y, z) in [m] and the quaternion (x, y, z, w).

        Raises
        ------
        ValueError
            If the linkage has no pose.

        """
        self._check_pose('frames', position)
        plan, frames = self._plan, {}
        for link in self.linkage.link_names:
            if link in plan.frames:
                frame, drawn = position.state.pins[plan.frames[link]], plan.pose_frames[link]
                # The columns of the rotation from the pose.
                columns = [
                    frame.turn(drawn.resolve(axis)) for axis in plan.pose_frames['ground'][:3]
                ]
                frames[link] = (scale(self.scale, frame.origin), _quaternion_of(columns))
            else:
                points = self.points(position)
                first, second, *_ = self.linkage.links[link]
                drawn_way = minus(self.linkage.points[second], self.linkage.points[first])
                way = minus(points[second], points[first])
                frames[link] = (points[first], _shortest_turn(drawn_way, way))
        return frames

    def closing_errors(self, position: Position) -> list[float]:
        """
        Return by how much each equation of a closed position is off, in [m].

        A point of two links has two places, a rod or strut another length, a joint between known
        links another axis, or a joint is off its ratio (times the size): all equations, redundant
        or not.
        """
        state = position.state
        errors = None if has_symbols(state) else self._error_line(state)
        return [self.scale * error for error in errors or self._list_errors(state)]

    def _list_errors(self, state: LinkState) -> list[float]:
        """Return the error of each equation, in the unit of the steps, with a sign or without."""
        return [*self._errors(state)]

    def _errors(self, state: LinkState) -> Iterator[float]:
        plan, linkage = self._plan, self.linkage
        known = {name: state.pins[index] for name, index in plan.points.items()}
        for point, links in plan.carriers.items():
            carrying = [link for link in links if link in plan.frames]
            places = [self._carried_place(state, link, point) for link in carrying]
            places += [known[point]] if point in known else []
            for place in places:
                yield length(minus(known.setdefault(point, places[0]), place))
        for link in plan.idle:
            for first, second in pairwise(plan.carried[link]):
                size = dist(plan.places[first], plan.places[second])
                yield length(minus(known[first], known[second])) - size
        for joint in linkage.slides.values():
            if joint.parent in plan.frames and joint.child in plan.frames:
                yield from self._slide_errors(state, joint)
        values = {name: state.coordinates[index] for name, index in plan.coordinates.items()}
        for name in values.keys() & linkage.struts.keys():
            start, end = (plan.same[point] for point in linkage.struts[name])
            if start in known and end in known:
                yield length(minus(known[start], known[end])) - values[name]
        for name, ratio in linkage.ratios.items():
            own, *of = (
                values[joint] * (1.0 if joint in linkage.hinges else self.scale)
                for joint in (name, *ratio.terms)
            )
            off = own - ratio.value_at(dict(zip(ratio.terms, of, strict=True)))
            yield remainder(off, tau) if name in linkage.hinges else off / self.scale

    def _slide_errors(self, state: LinkState, joint: SpatialJoint) -> Iterator[float]:
        """Yield by how much a link turns, and leaves the axis, of which it may only slide."""
        plan, ends = self._plan, (joint.parent, joint.child)
        parent, child = (state.pins[plan.frames[link]] for link in ends)
        on, of = (plan.pose_frames[link] for link in ends)
        for axis in range(3):
            yield length(minus(parent.resolve(child[axis]), on.resolve(of[axis])))
        moved = minus(parent.locate(child.origin), on.locate(of.origin))
        way = on.resolve(scale(1.0 / length(joint.axis), joint.axis))
        yield length(cross(way, moved))

    def _carried_place(self, state: LinkState, link: str, point: str) -> Vector:
        frame: SpaceFrame = state.pins[self._plan.frames[link]]
        return frame.place(self._plan.pose_frames[link].locate(self._plan.places[point]))

    def _check_pose(self, what: str, position: Position) -> None:
        if not position.status.has_pose:
            raise ValueError(f'{what}: {position!r} has none; check its status first')

    def _joint_rates(self, values: list[float]) -> tuple[float, ...]:
        # Adding 0.0 makes 0.0 of −0.0: numbers that are 0 are left out of sums, symbols are not.
        return tuple(rate + 0.0 for rate in super()._joint_rates(values))

    @property
    def ball_count(self) -> int:
        """Return the number of points that join two links, which no other joint joins."""
        linkage = self.linkage
        joined = {(joint.parent, joint.child) for joint in linkage.pair_joints.values()}
        count = 0
        for point in linkage.points:
            carriers = [link for link, points in linkage.links.items() if point in points]
            # Links that a hinge joins share the points of its axis.
            pairs = [pair for pair in permutations(carriers, 2) if pair in joined]
            count += len(carriers) - len(pairs) > 1
        return count

    @property
    def slide_bound(self) -> float:
        """Return a length that no slide needs to exceed for a link to be stretched, in [m]."""
        return 4.0 * self.scale

    def other_assemblies(self, starts: int) -> dict[int, list[dict[str, float]]]:
        """
        Return for each group of joints that close only together its other assemblies.

        They are sought at the inputs of the pose, from random starts. Each has the values of these
        joints, in [rad] or [m]: another assembly is another pose of the file.
        """
        assemblies: dict[int, list[dict[str, float]]] = {}
        for number, (knot, unknown) in self._knots.items():
            # A platform that only rods carry has no joints of the file.
            joints = self.linkage.pair_joints
            units = [1.0 if name in self.linkage.hinges else self.scale for name in unknown]
            assemblies[number] = [
                {
                    name: value * unit
                    for name, value, unit in zip(unknown, values, units, strict=True)
                    if name in joints
                }
                for values in knot.other_solutions(starts)
                if not joints.keys().isdisjoint(unknown)
            ]
        return assemblies

    def slide_reach(self, number: int) -> tuple[float, float]:
        """Return between which values an input that slides is worth a trial, in [m]."""
        at, some = self.linkage.pose.inputs[number], 0.125 * self.scale
        several = len(self.linkage.inputs) > 1
        return (at - some, at + some) if several else super().slide_reach(number)

    def links_of_group(self, number: int) -> list[str]:
        """Return the links of a group."""
        return list(self.groups[number].links)


def _add_knot(plan: SpacePlan) -> bool:
    from linkage_ros.kinematics.space.knot_plan import (
        add_knot,  # local import: most linkages have none
    )

    return add_knot(plan)


def closure_in_pose(linkage: SpaceLinkage, name: str = '') -> SpaceClosure:
    """
    Return the closure of a linkage that is closed in its pose, and meets redundant equations.

    Which of these are solved follows from the order of the joints. Those that are chosen may have
    a change point where all together have none: then the reverse order is tried.
    """
    closure = SpaceClosure(linkage, name)
    try:
        _check_closed(closure)
    except _OverconstrainedError:
        hinges = dict(reversed([*linkage.hinges.items()]))
        turned = SpaceClosure(replace(linkage, hinges=hinges), name)
        with suppress(_OverconstrainedError):
            _check_closed(turned)
            return turned
        raise
    return closure


class _OverconstrainedError(DefinitionError):
    """Redundant equations are missed."""


def _check_closed(closure: SpaceClosure) -> None:
    """Refuse a linkage whose pose does not close, or whose redundant equations are not met."""
    pose = closure.linkage.pose.inputs
    position = closure.close_unlimited(*pose)
    if not position.status.has_rates:
        raise DefinitionError(
            'points', f'the linkage is {position.status.value} in the pose', 'draw another pose'
        )
    if not closure.freedom.redundant:
        return
    sides = [*_states_beside(closure)]
    if not all(any(position.status.has_pose for _, position in pair) for pair in sides):
        raise _refusal_of(closure, 'open on both sides of the pose')
    steps = max(2, int(_STATES ** (1.0 / len(pose))))
    gap, inputs = max(
        (closure.residual(position), at)
        for at, position in ((pose, position), *chain(*sides), *grid_positions(closure, steps))
        if position.status.has_pose
    )
    if gap > _MET * size_of(closure.linkage):
        places = ', '.join(f'{value:.4g}' for value in inputs)
        raise _refusal_of(closure, f'missed by {gap:.3g} m where the input is {places}')


def _refusal_of(closure: SpaceClosure, why: str) -> _OverconstrainedError:
    count = closure.freedom.redundant
    return _OverconstrainedError(
        'points',
        f'the linkage is over-constrained: {count} equation{"s" * (count != 1)} more than '
        f'needed, {why}',
        'let a hinge be a ball, or give the axes and lengths that meet them',
    )


def _states_beside(closure: SpaceClosure) -> Iterator[list[tuple[tuple[float, ...], Position]]]:
    """Yield the states next to the pose, for each input those on its two sides."""
    for number, driven in enumerate(closure.linkage.inputs):
        sides = []
        for way in (-_BESIDE, _BESIDE):
            at = [*closure.linkage.pose.inputs]
            at[number] += way * (closure.scale if driven.slider else 1.0)
            sides.append((tuple(at), closure.close_unlimited(*at)))
        yield sides


def _quaternion_of(columns: list[Vector]) -> Quaternion:
    """Return the quaternion (x, y, z, w) of a rotation by its columns, by the largest part."""
    (a, b, c), (d, e, f), (g, h, i) = zip(*columns, strict=True)
    parts = (
        (1.0 + a - e - i, b + d, c + g, h - f),
        (b + d, 1.0 - a + e - i, f + h, c - g),
        (c + g, f + h, 1.0 - a - e + i, d - b),
        (h - f, c - g, d - b, 1.0 + a + e + i),
    )
    number = max(range(4), key=lambda k: parts[k][k])
    factor = 0.5 / sqrt(parts[number][number])
    x, y, z, w = (factor * part for part in parts[number])
    return x, y, z, w


def _shortest_turn(first: Vector, second: Vector) -> Quaternion:
    """Return the quaternion of the shortest rotation from one direction to another."""
    first, second = scale(1.0 / length(first), first), scale(1.0 / length(second), second)
    half = sqrt(max(0.5 * (1.0 + dot(first, second)), 0.0))
    if half < 1e-9:
        return 0.0, 0.0, 0.0, 1.0
    x, y, z = scale(0.5 / half, cross(first, second))
    return x, y, z, half


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
        x, y, z = (fsum(coordinates) / len(places) for coordinates in zip(*places, strict=True))
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
