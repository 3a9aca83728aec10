# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
The order of solution of a spatial linkage: which step finds what, from the inputs outwards.

There are no kinds of mechanisms and no patterns. Two points of one link keep their distance: so
each pair of points on a link is a rod, whatever else joins the link. In the order of the file,
again and again:

- a planar loop whose inputs are known is solved in its plane, as a planar linkage;
- a joint whose value is known places its link;
- a hinge or slide whose link carries a known point is aimed at it;
- a hinge or slide whose link carries a point at a known distance from a known one is closed; of
  all such pairs the one is taken whose rod meets the motion of its point least squarely off;
- a link with three known points has a frame;
- a point at known distances from three known points is placed; a link that hangs on three slides
  only moves without turning, and is one point;
- if there is none of these, the smallest set of joints that close together is a knot.

The pose gives the sign of each closed step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import combinations
from math import atan2, dist, fsum, hypot, lcm, tau
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics.plane.linkage import GROUND
from linkage_ros.kinematics.plane.plan import SolutionPlan
from linkage_ros.kinematics.plane.solved_links import count_turns, PlanStart
from linkage_ros.kinematics.plane.topology import (
    assur_groups,
    Dyad,
    GearedLinks,
    Iterated,
    Structure,
)
from linkage_ros.kinematics.space.carried_points import CarriedPoints, unit_across
from linkage_ros.kinematics.space.folding_joints import Course, folding_joint, FoldingJoint
from linkage_ros.kinematics.space.joints import HingePair, LowerPair, SlidePair
from linkage_ros.kinematics.space.linkage import SpaceLinkage, SpatialJoint, unit_of
from linkage_ros.kinematics.space.planar_loops import find_planar_loops, PlanarLoop
from linkage_ros.kinematics.space.steps import (
    AimedHinge,
    CarriedPoint,
    ClosedHinge,
    ClosedJoint,
    ClosedSlide,
    frame_of,
    FramedLink,
    GivenJoint,
    GroundStep,
    MeasuredHinge,
    MeasuredStrut,
    ResolvedSlides,
    Rod,
)
from linkage_ros.kinematics.space.three_distances import order_ends, ThreeDistances
from linkage_ros.kinematics.space.vectors import (
    cross,
    dot,
    drop_rounding,
    GROUND_FRAME,
    length,
    minus,
    plus,
    scale,
    SpaceFrame,
    Vector,
    ZERO,
)
from linkage_ros.kinematics.step import FollowerJoint, GearedAngle, GroupDescription, LinkState
from linkage_ros.progress import tell_progress

if TYPE_CHECKING:
    from linkage_ros.kinematics.iterated.iterated_step import IteratedStep

_SQUARE = 1e-6
"""Least sine of the angle at which a rod may meet the motion of its point in the pose."""

_BETTER = 1e-6
"""By how much the next pair must be better: among equal ones the first is taken."""


class _Pair(NamedTuple):
    """A point of a link, and a known point at a known distance."""

    point: str
    known: str
    rod: Rod
    by: str  # The link or strut that keeps the distance


class SpacePlan:
    """
    Makes the steps of a spatial linkage; lengths are in the unit of ``scale`` metres.

    ``add_knot`` adds links that only close together as the next step, and says whether it could.
    `finish` adds what is published.
    """

    def __init__(self, linkage: SpaceLinkage, add_knot: Callable[[SpacePlan], bool]) -> None:
        self._add_knot = add_knot
        self.scale = unit_of(linkage)
        self.steps: list[Any] = []
        self.step_groups: list[int] = []
        self.groups: list[GroupDescription] = []
        self.knots: dict[int, tuple[IteratedStep, tuple[str, ...]]] = {}
        """Links that only close together, by the number of their group."""
        self.coordinates: dict[str, int] = {
            name: 1 + number for number, name in enumerate(linkage.driven)
        }
        self.frames: dict[str, int] = {}
        """Indices, among the pins, of the frames of links that are known."""
        self.pose_frames: dict[str, SpaceFrame] = {GROUND: GROUND_FRAME}
        self.points: dict[str, int] = {}
        """Indices, among the pins, of the points that are placed."""
        self._take_linkage(linkage)
        count = len(linkage.driven)
        self.turns_with = {
            k: tuple(float(i + 1 == k) for i in range(count)) for k in range(1 + count)
        }
        """For each coordinate that is a sum of inputs, how often each input is in it."""
        self.tilt = 0.0
        """By how much joints of planar loops leave their plane, in [rad]."""
        self._tried = 0
        self._spatial: set[frozenset[str]] = set()
        self.state = LinkState([0.0, *map(self.pose_value, linkage.driven)], [])
        """The pose as the steps so far find it."""
        self.frames[GROUND] = 0
        self.add_step(GroundStep())
        while self._find_next():
            pass

    def hang_rods(self, linkage: SpaceLinkage) -> None:
        """Add the steps of the same linkage with the hinges on which its rods hang."""
        self._take_linkage(linkage)
        while self._find_next():
            pass

    def finish(self) -> None:
        """Tell which rods may spin, and measure what is published."""
        unknown = self._unknown_links()
        self.idle = tuple(
            link
            for link in self.carried_points.rods
            if link in unknown and all(map(self.is_known, self.carried[link]))
        )
        """Rods whose ends are known: nothing holds their turn about themselves."""
        self._measure_published()

    def _take_linkage(self, linkage: SpaceLinkage) -> None:
        """Plan this linkage from here on."""
        self.linkage = linkage
        self.carried_points = known = CarriedPoints(linkage, self.scale)
        self.places, self.axes, self.same = known.places, known.axes, known.same
        self.carriers, self.carried = known.carriers, known.carried

    def add_step(self, step: Any) -> None:
        if not step.close(self.state).status.has_pose:
            raise DefinitionError(
                'points', 'the linkage is at a toggle in the pose', 'draw another pose'
            )
        self.steps.append(step)
        self.step_groups.append(len(self.groups))
        tell_progress('steps planned', len(self.steps))

    @property
    def next_pin(self) -> int:
        """Return the index of the pin that the next step appends."""
        return len(self.state.pins)

    @property
    def finds_all(self) -> bool:
        """Return whether its steps find all links and published joints."""
        return not self.lost and {*self._unknown_links()} <= {*self.idle}

    def _unknown_links(self) -> list[str]:
        return [link for link in self.linkage.link_names if link not in self.frames]

    def is_known(self, point: str) -> bool:
        """Return whether a point is placed, or on a link that is."""
        return point in self.points or any(link in self.frames for link in self.carriers[point])

    def point_index(self, point: str) -> int:
        """Return the index of a known point; it is placed when first asked for."""
        if point not in self.points:
            link = next(link for link in self.carriers[point] if link in self.frames)
            place = drop_rounding(self.pose_frames[link].locate(self.places[point]))
            self.points[point] = self.next_pin
            self.add_step(CarriedPoint(self.frames[link], place, self.next_pin))
        return self.points[point]

    def _find_next(self) -> bool:
        """Add the next step; False if there is none."""
        return (
            any(map(self._follow, self.linkage.ratios))
            or self._solve_loop()
            or any(map(self._give, self.linkage.pair_joints))
            or any(map(self._aim, self.linkage.pair_joints))
            or any(map(self._close, self.linkage.pair_joints))
            or any(map(self._frame, self._unknown_links()))
            or any(map(self._place_point, self.carriers))
            or any(map(self._translate, self._unknown_links()))
            or (self.has_unknown_joints and self._add_knot(self))
        )

    @property
    def has_unknown_joints(self) -> bool:
        """Return whether a joint leads to a link that is not solved yet."""
        joints = self.linkage.pair_joints.values()
        held = {end for joint in joints for end in (joint.parent, joint.child)}
        return not held.isdisjoint(self._unknown_links())

    # Planar loops

    def _solve_loop(self) -> bool:
        """Solve a planar loop whose inputs are known."""
        if self._tried == len(self.coordinates):
            return False
        self._tried = len(self.coordinates)
        for loop in find_planar_loops(self.linkage, self.carried_points, self.coordinates):
            if frozenset(loop.offsets) not in self._spatial:
                self._spatial.add(frozenset(loop.offsets))
                # A pose at a toggle is left to the steps in space.
                with suppress(DefinitionError):
                    structure = assur_groups(loop.linkage)
                    # Links that are iterated, or turned by ratios, are a knot.
                    knots = GearedLinks, Iterated
                    if not any(isinstance(group, knots) for group in structure.groups):
                        self._add_loop(loop, structure)
                        return True
        return False

    def _add_loop(self, loop: PlanarLoop, structure: Structure) -> None:
        """Add the steps of a planar loop, and the values of its joints."""
        start = PlanStart.alone(loop.linkage, structure)
        known = [self.coordinates[name] in self.turns_with for name in loop.inputs]
        turns = {0: start.turns_with[0]}
        turns |= {k: start.turns_with[k] for k, turned in enumerate(known, 1) if turned}
        drawn = SolutionPlan(loop.linkage, structure, replace(start, turns_with=turns))
        inputs = tuple(self._inner_input(loop, name) for name in loop.inputs)
        coordinates, pins = self.state
        within = PlanStart(self.scale, inputs, len(coordinates), len(pins), self.turns_with)
        planar = SolutionPlan(loop.linkage, structure, within, drawn)
        for step in planar.steps:
            self.add_step(step)
        for name, joint in loop.linkage.joints.items():
            first, second, factor, constant = planar.joint_term(joint)
            rest = loop.offsets[name]
            if not self._slides(name):
                x = self.state.coordinates
                off = x[first] - x[second] + constant + rest - self.pose_value(name)
                rest -= tau * round(off / tau)
            self.coordinates[name] = self._joint_coordinate(
                FollowerJoint(name, first, second, factor * constant, factor, rest)
            )
        self.tilt = max(self.tilt, loop.tilt)
        by = list_names(loop.inputs)
        kinds = ', '.join(group.kind for group in structure.groups if isinstance(group, Dyad))
        self.end_group('planar loop', loop.links[1:], f'{kinds}, on {loop.links[0]}, by {by}')

    def _inner_input(self, loop: PlanarLoop, name: str) -> int:
        """Return the coordinate of an input of a planar loop."""
        index, offset = self.coordinates[name], loop.offsets[name]
        return self._joint_coordinate(FollowerJoint(name, index, 0, -offset, 1.0, 0.0))

    def _joint_coordinate(self, step: FollowerJoint) -> int:
        """Return the coordinate that is a joint's value; a step makes one if it has to."""
        if (step.other, step.constant, step.ratio, step.offset) == (0, 0.0, 1.0, 0.0):
            return step.one
        self.add_step(step)
        return len(self.state.coordinates) - 1

    # Joints

    def _ends(self, name: str) -> tuple[str, str] | None:
        """Return the known and the unknown link of a joint; None if there are not one of each."""
        joint = self.linkage.pair_joints[name]
        ends = sorted((joint.parent, joint.child), key=lambda link: link not in self.frames)
        known, unknown = ends
        if known in self.frames and unknown not in self.frames:
            return known, unknown
        return None

    def _axis_to(self, name: str, child: str) -> Vector:
        """Return the axis of a joint, reversed if the child is its parent in the file."""
        joint = self.linkage.pair_joints[name]
        return self.axes[name] if joint.child == child else scale(-1.0, self.axes[name])

    def pose_value(self, name: str) -> float:
        """Return the value of a joint in the pose, in the unit of the steps."""
        value = self.linkage.pose_value(name)
        return value / self.scale if self._slides(name) else value

    def _slides(self, name: str) -> bool:
        return name not in self.linkage.hinges

    def make_joint(
        self, name: str, parent: str, child: str, toward: Vector | None = None
    ) -> tuple[LowerPair, SpaceFrame]:
        """Return a joint on a known link, and the frame of its child in the pose."""
        z = self._axis_to(name, child)
        if name in self.linkage.hinges:
            at = scale(1.0 / self.scale, self.linkage.hinges[name].at)
        else:
            at = self.places[self.carried[child][0]] if self.carried[child] else ZERO
        x = unit_across(z)
        if toward is not None:
            # The x axis leads roughly there: the direction does not jump from π to −π nearby.
            y, arm = cross(z, x), minus(toward, at)
            ways = (x, y, scale(-1.0, x), scale(-1.0, y))
            x = max(ways, key=lambda way: dot(way, arm))
        # The seat does not turn with the joint: the child turns or moves from it by the value.
        kind = SlidePair if self._slides(name) else HingePair
        origin = minus(at, scale(self.pose_value(name), z)) if self._slides(name) else at
        base = SpaceFrame(x, cross(z, x), z, origin)
        on = self.pose_frames[parent]
        x, y, z = (drop_rounding(on.resolve(axis)) for axis in base[:3])
        seat = SpaceFrame(x, y, z, on.locate(base.origin))
        joint = kind(self.frames[parent], seat)
        return joint, joint.child_frame(base, self.pose_value(name))

    def _set_frame(self, link: str, frame: SpaceFrame) -> int:
        """Keep the frame of a link that the next step appends; return its index."""
        self.frames[link], self.pose_frames[link] = self.next_pin, frame
        return self.next_pin

    def _give(self, name: str) -> bool:
        """Place the link of a joint whose value is known."""
        ends = self._ends(name)
        if ends is None or name not in self.coordinates:
            return False
        joint, frame = self.make_joint(name, *ends)
        index = self._set_frame(ends[1], frame)
        self.add_step(GivenJoint(joint, self.coordinates[name], index))
        kind = 'input' if name in self.linkage.driven else 'joint'
        self.end_group(kind, (ends[1],), f'{name}, on {ends[0]}')
        return True

    def end_group(
        self, kind: str, links: tuple[str, ...], method: str, assembly: str = ''
    ) -> None:
        self.groups.append(GroupDescription(kind, links, method, assembly))

    def _follow(self, name: str) -> bool:
        """Give a joint that follows a known one its value."""
        ratio = self.linkage.ratios[name]
        if name in self.coordinates or not ratio.terms.keys() <= self.coordinates.keys():
            return False
        own = self.scale if self._slides(name) else 1.0
        offset = ratio.offset / own
        factors = {
            self.coordinates[of]: factor * (self.scale if self._slides(of) else 1.0) / own
            for of, factor in ratio.terms.items()
        }
        self.coordinates[name] = len(self.state.coordinates)
        if factors.keys() <= self.turns_with.keys():
            turns = [
                [factor * turn for turn in self.turns_with[of]] for of, factor in factors.items()
            ]
            self.turns_with[self.coordinates[name]] = tuple(map(fsum, zip(*turns, strict=True)))
        if ratio.also:
            self.add_step(GearedAngle(tuple(factors.items()), offset))
        else:
            ((of, factor),) = factors.items()
            self.add_step(FollowerJoint(name, of, 0, 0.0, factor, offset))
        self.end_group('ratio', (), f'{name} follows {ratio.text}')
        return True

    def _aim(self, name: str) -> bool:
        """Aim a hinge at a known point that its link carries."""
        ends = self._ends(name)
        if ends is None or name in self.coordinates:
            return False
        slides, axis = self._slides(name), self._axis_to(name, ends[1])
        at = self.linkage.pair_joints[name].at
        for point in filter(self.is_known, self.carried[ends[1]]):
            arm = minus(self.places[point], scale(1.0 / self.scale, at))
            if not slides and length(cross(axis, arm)) < _SQUARE:
                continue
            to = self.point_index(point)
            joint, frame = self.make_joint(name, *ends, self.places[point])
            place = frame.locate(self.places[point])
            index = self._set_frame(ends[1], frame)
            self.coordinates[name] = len(self.state.coordinates)
            if isinstance(joint, HingePair):
                x, y, _ = joint.base(self.state).locate(self.places[point])
                direction = self._direction(place, atan2(y, x), name)
                self.add_step(AimedHinge(joint, direction, to, index))
            else:
                self._add_resolved((name,), ends[0], to, self.places[point])
                self.add_step(GivenJoint(joint, self.coordinates[name], index))
            self.end_group('aimed', (ends[1],), f'{name}, on {ends[0]}, at point {point}')
            return True
        return False

    def _direction(self, place: Vector, near: float, name: str) -> float:
        """Return the direction of a place, with the turns of the pose; it gives `near` with 0."""
        direction = atan2(place[1], place[0])
        return direction + tau * round((near - direction - self.pose_value(name)) / tau)

    def _distances(self, point: str) -> Iterator[_Pair]:
        """Yield the known points at known distances from a point."""
        for link in self.carriers[point]:
            for known in self.carried[link]:
                size = dist(self.places[point], self.places[known])
                if known != point and size and self.is_known(known):
                    yield _Pair(point, known, Rod(size), link)
        for name, points in self.linkage.struts.items():
            ends = [self.same[end] for end in points]
            if name in self.coordinates and point in ends:
                far_end = ends[1 - ends.index(point)]
                if self.is_known(far_end):
                    yield _Pair(point, far_end, Rod(0.0, self.coordinates[name]), name)
        for name, joint in self.linkage.slides.items():
            for link, beyond in ((joint.parent, joint.child), (joint.child, joint.parent)):
                if name in self.coordinates and link in self.carriers[point]:
                    for known in self.carried[beyond]:
                        if known != point and self.is_known(known):
                            way = (point, known) if link == joint.parent else (known, point)
                            yield _Pair(point, known, self.slide_rod(name, *way), name)

    def slide_rod(self, slide: str, start: str, end: str) -> Rod:
        """Return the distance of a point of a slide's parent to one of its child."""
        axis, way = self.axes[slide], minus(self.places[end], self.places[start])
        along = dot(way, axis)
        beside = length(drop_rounding(minus(way, scale(along, axis))))
        # On the axis it is a cylinder from pin to pin, whose length is not negative.
        is_cylinder = beside < _SQUARE and along > 0.0
        across = None if is_cylinder else beside
        return Rod(along - self.pose_value(slide), self.coordinates[slide], across)

    def _close(self, name: str) -> bool:
        """Close a hinge or slide by a rod."""
        ends = self._ends(name)
        if ends is None or name in self.coordinates:
            return False
        best, choice = _SQUARE, None
        axis, at = self._axis_to(name, ends[1]), self.linkage.pair_joints[name].at
        for point in self.carried[ends[1]]:
            arm = minus(self.places[point], scale(1.0 / self.scale, at))
            slope = axis if self._slides(name) else cross(axis, arm)
            for pair in self._distances(point) if length(slope) > _SQUARE else ():
                rod = minus(self.places[point], self.places[pair.known])
                square = dot(rod, slope) / (length(rod) * length(slope))
                if abs(square) > best + _BETTER:
                    best, choice = abs(square), (pair, 1.0 if square > 0.0 else -1.0)
        if choice is None:
            return False
        (point, known, bar, by), sign = choice
        to = self.point_index(known)
        joint, frame = self.make_joint(name, *ends, self.places[known])
        place = drop_rounding(frame.locate(self.places[point]))
        index = self._set_frame(ends[1], frame)
        self.coordinates[name] = len(self.state.coordinates)
        if isinstance(joint, HingePair):
            radius = hypot(place[0], place[1])
            step: Any = ClosedHinge(joint, place, to, bar, sign, index, radius, 0.0)
        else:
            step = ClosedSlide(joint, place, to, bar, sign, index)
        side = f'{"+" if sign > 0.0 else "-"}, as in the pose'
        if (folding := self._fold(step, ends[0], known)) is not None:
            step, side = folding, f'{side}, and passes its change points'
        trial = LinkState([*self.state.coordinates], [*self.state.pins])
        if isinstance(joint, HingePair) and step.close(trial).status.has_pose:
            # Where 0 lies among the whole turns follows from the value in the pose.
            value = trial.coordinates[-1]
            step = replace(step, direction=self._direction(place, value, name))
        self.add_step(step)
        method = f'{name}, on {ends[0]}, by {by} from {known} to {point}'
        self.end_group('closed', (ends[1],), method, side)
        return True

    def _fold(self, step: ClosedJoint, on: str, known: str) -> FoldingJoint | None:
        """Return a closed joint that passes its change points, if one joint moves its rod."""
        base = self.pose_frames[on].compose(step.joint.seat)
        end = base.locate(self.places[known])
        for name, joint in self.linkage.pair_joints.items() if not step.rod.moved_by else ():
            ends = {joint.parent, joint.child} - {on}
            moves_end = len(ends) == 1 and not ends.isdisjoint(self.carriers[known])
            if name not in self.coordinates or not moves_end:
                continue
            index, value = self.coordinates[name], self.pose_value(name)
            axis = base.resolve(self._axis_to(name, *ends))
            if self._slides(name):
                course = Course.along(index, value, axis, end)
            else:
                at = base.locate(scale(1.0 / self.scale, joint.at))
                course = Course.about(index, value, axis, at, end)
            keeps_turns = index in self.turns_with
            return folding_joint(step, course, value, keeps_turns=keeps_turns)
        return None

    # Links and points

    def _frame(self, link: str) -> bool:
        """Find the frame of a link with three known points."""
        known = list(filter(self.is_known, self.carried[link]))
        for names in combinations(known, 3):
            start, *ends = (self.places[name] for name in names)
            first, second = (minus(end, start) for end in ends)
            if length(cross(first, second)) > 1e-3 * length(first) * length(second):
                indices = tuple(map(self.point_index, names))
                index = self._set_frame(link, frame_of(start, first, second))
                self.add_step(FramedLink((indices[0], indices[1], indices[2]), index))
                self.end_group('framed', (link,), f'by points {list_names(names)}')
                return True
        return False

    def _place_point(self, point: str) -> bool:
        """Place a point at three known distances."""
        if self.is_known(point):
            return False
        return self._meet(point, list(self._distances(point)), {})

    def _meet(
        self, point: str, pairs: list[_Pair], shifts: dict[_Pair, tuple[str, Vector]]
    ) -> bool:
        """Place a point by the first three pairs that tell it; some are shifted beside a point."""
        at = self.places[point]
        ends = {
            pair: plus(self.places[pair.known], shifts[pair][1] if shifts else ZERO)
            for pair in pairs
        }
        for named in combinations(pairs, 3):
            if len({pair.known for pair in named}) < 3 and not shifts:
                continue
            three = [named[k] for k in order_ends(at, [ends[pair] for pair in named])]
            places = [ends[pair] for pair in three]
            rods = [minus(at, place) for place in places]
            size = length(rods[0]) * length(rods[1]) * length(rods[2])
            across = cross(minus(places[1], places[0]), minus(places[2], places[0]))
            if abs(volume := dot(across, rods[0])) <= _SQUARE * size:
                continue
            to = []
            for pair in three:
                to.append(self.point_index(pair.known))
                if shifts and length(shifts[pair][1]):
                    root, offset = shifts[pair]
                    offset = drop_rounding(self.pose_frames[root].resolve(offset))
                    self.add_step(CarriedPoint(self.frames[root], offset, self.next_pin, to[-1]))
                    to[-1] = self.next_pin - 1
            sign = 1.0 if volume > 0.0 else -1.0
            self.points[point] = self.next_pin
            lengths = tuple(pair.rod for pair in three)
            self.add_step(ThreeDistances(tuple(to), lengths, sign, self.next_pin))
            by = list_names(f'{pair.by} from {pair.known}' for pair in three)
            side = '+' if sign > 0.0 else '-'
            method = f'point {point}, by {by}'
            self.end_group('three distances', (), method, f'{side}, as in the pose')
            return True
        return False

    def _slide_chain(self, link: str) -> tuple[str, list[str]] | None:
        """Return the known link and the slides that lead from it to a link, outwards."""
        chain: list[str] = []
        while link not in self.frames:
            ways = [
                (name, joint)
                for name, joint in self.linkage.slides.items()
                if link in (joint.parent, joint.child) and name not in chain
            ]
            # A chain, not a tree: the first slide that leads on.
            if not ways or len(chain) > 2:
                return None
            name, joint = ways[0]
            chain.insert(0, name)
            link = joint.parent if joint.child == link else joint.child
        return link, chain

    def _translate(self, link: str) -> bool:
        """Place a link that hangs on three slides: it does not turn, and so is one point."""
        chain_found = self._slide_chain(link)
        if chain_found is None or len(chain_found[1]) != 3 or not self.carried[link]:
            return False
        root, chain = chain_found
        point = self.carried[link][0]
        pairs, shifts = [], {}
        for carried in self.carried[link]:
            for pair in self._distances(carried):
                pairs.append(pair)
                shifts[pair] = (root, minus(self.places[point], self.places[carried]))
        if not self._meet(point, pairs, shifts):
            return False
        self._add_resolved(tuple(chain), root, self.points[point], self.places[point])
        return True

    def _add_resolved(self, names: tuple[str, ...], root: str, point: int, place: Vector) -> None:
        """Measure the slides that lead from a link to a point."""
        on, chain = self.pose_frames[root], self.linkage.pair_joints
        link, axes = root, []
        for name in names:
            joint = chain[name]
            link = joint.child if joint.parent == link else joint.parent
            axes.append(self._axis_to(name, link))
        start = place
        for name, axis in zip(names, axes, strict=True):
            start = minus(start, scale(self.pose_value(name), axis))
        first = len(self.state.coordinates)
        self.coordinates |= {name: first + number for number, name in enumerate(names)}
        duals = _dual_basis(axes)
        directions = tuple(drop_rounding(on.resolve(dual)) for dual in duals)
        self.add_step(ResolvedSlides(self.frames[root], on.locate(start), directions, point))

    # What is published

    def _measure_published(self) -> None:
        """Measure published joints that no step found."""
        linkage = self.linkage
        followed = (of for ratio in linkage.ratios.values() for of in ratio.terms)
        wanted = [*linkage.published, *followed]
        self.lost: list[str] = []
        """Published joints that no step can find."""
        for name in dict.fromkeys(wanted):
            if name in self.coordinates:
                continue
            if name in linkage.held:
                self.coordinates[name] = len(self.state.coordinates)
                self.add_step(FollowerJoint(name, 0, 0, 0.0, 0.0, linkage.held[name]))
            elif name in linkage.struts:
                ends = [self.same[point] for point in linkage.struts[name]]
                if not all(map(self.is_known, ends)):
                    self.lost.append(name)
                    continue
                first, second = map(self.point_index, ends)
                self.coordinates[name] = len(self.state.coordinates)
                step = MeasuredStrut((first, second), self.coordinates[name])
                self.add_step(step)
            else:
                joint = linkage.pair_joints[name]
                if joint.parent not in self.frames or joint.child not in self.frames:
                    self.lost.append(name)
                    continue
                if self._slides(name):
                    self._measure_slide(name, joint)
                else:
                    pair, frame = self.make_joint(name, joint.parent, joint.child)
                    assert isinstance(pair, HingePair)
                    # The x axis of the seat, turned with the child.
                    mark = drop_rounding(self.pose_frames[joint.child].resolve(frame.x))
                    self.coordinates[name] = len(self.state.coordinates)
                    self.add_step(MeasuredHinge(pair, mark, self.frames[joint.child]))
            self.end_group('measured', (), name)
        for point in linkage.traced:
            if self.is_known(self.same[point]):
                self.point_index(self.same[point])
        self.step_groups = [min(number, len(self.groups) - 1) for number in self.step_groups]

    def _measure_slide(self, name: str, joint: SpatialJoint) -> None:
        child = joint.child
        place = self.places[self.carried[child][0]] if self.carried[child] else ZERO
        point = self.next_pin
        local = self.pose_frames[child].locate(place)
        self.add_step(CarriedPoint(self.frames[child], local, point))
        self._add_resolved((name,), joint.parent, point, place)

    @property
    def ratio_turns(self) -> int:
        """Return the turns of a single input after which the joints that follow it repeat."""
        turns = 1
        for name in self.linkage.ratios:
            totals = self._factors_of_inputs(name)
            if len(totals) == 1 and not self._slides(name):
                turns = lcm(turns, *map(count_turns, totals.values()))
        return turns

    def _factors_of_inputs(self, name: str) -> dict[str, float]:
        """Return by how much a joint turns with each turn of an input that turns, by ratios."""
        if name not in self.linkage.ratios:
            return {name: 1.0} if name in self.linkage.driven and not self._slides(name) else {}
        totals: dict[str, float] = {}
        for of, ratio in self.linkage.ratios[name].terms.items():
            for name_of_input, factor in self._factors_of_inputs(of).items():
                totals[name_of_input] = totals.get(name_of_input, 0.0) + ratio * factor
        return totals


def _dual_basis(axes: list[Vector]) -> list[Vector]:
    """Return the vectors whose scalar product with one axis is 1, and with the others 0."""
    if len(axes) == 1:
        return axes
    first, second, third = axes
    volume = dot(first, cross(second, third))
    return [
        drop_rounding(scale(1.0 / volume, cross(*two)))
        for two in ((second, third), (third, first), (first, second))
    ]
