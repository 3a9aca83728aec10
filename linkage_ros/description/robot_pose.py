# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
The pose of a robot: frames of its links at values of its joints, and what its loops miss there.

If loops miss a pose by rounding, joints that are not driven are moved until they close: no length
changes. So is a pose sought in which they close (the method of Levenberg and Marquardt).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import chain, product
from math import atan2, hypot, remainder, tau
from random import Random

from linkage_ros.description.urdf_file import LoopEnd, MOVING, UrdfFile, UrdfJoint, UrdfLoop
from linkage_ros.kinematics import (
    cross,
    direction_of,
    dot,
    extent_of,
    GROUND_FRAME,
    length,
    minus,
    ONE_PLACE,
    PARALLEL,
    plus,
    Ratio,
    scale,
    SpaceFrame,
    turn_about,
    Vector,
    ZERO,
)

_ROUNDED, _CLOSED = 1e-14, 1e-9
"""Gaps that are rounding, and those of a pose that is found, relative to the size."""

_LEAST_DAMPING, _SEARCH_DAMPING, _MORE_DAMPING = 1e-10, 1e-3, 10.0
"""Damping of a step, relative to the size: near a pose, far from it, and its change."""

_MOST_STEPS, _MOST_SEARCH_STEPS = 12, 60
"""Most steps to a pose: from one that rounding misses, and from any other."""

_BESIDE = 1e-6
"""Least distance of the ends of a pin that is not rounding of CAD, relative to the size."""

_NUDGES = (0.0, 0.3, 1.0, 2.0)
"""How much joints are moved at random before a pose is sought, in [rad] and [m]."""

_SEED = 20

_UPRIGHT = 1e-12
"""Cosine of the pitch below which roll and yaw are one angle."""

LINE = 'line'
"""What closes a loop by frames SLIDER_on_LINK on the x axis of SLIDER_line_on_LINK."""

_SLIDING = ('slide', LINE)
"""What closes a loop but for a slide along the x axis."""


class RobotTree:
    """The joints of a robot; ``mount`` is the link in whose frame all others are placed."""

    def __init__(self, urdf: UrdfFile) -> None:
        self._root = self.mount = urdf.root
        self.joints = urdf.joints
        self.above: dict[str, tuple[UrdfJoint, ...]] = {urdf.root: ()}
        """For each link the joints from it to the root."""
        for joint in urdf.joints.values():
            self.above[joint.child] = (joint, *self.above[joint.parent])
        self.bases = {joint.name: frame_of(joint.xyz, joint.rpy) for joint in urdf.joints.values()}
        """For each joint the frame of its child at 0, in that of its parent."""

    def ways(self, first: str, second: str) -> list[list[UrdfJoint]]:
        """Return the joints from two links up to their common ancestor."""
        shared = {*self.above[first]} & {*self.above[second]}
        return [
            [joint for joint in self.above[link] if joint not in shared]
            for link in (first, second)
        ]

    def body(self, link: str) -> str:
        """Return the link that moves a link, or the root."""
        moving = (joint.child for joint in self.above[link] if joint.kind != 'fixed')
        return next(moving, self._root)

    def place_links(
        self, values: Mapping[str, float], joints: Sequence[UrdfJoint] = ()
    ) -> dict[str, SpaceFrame]:
        """
        Return the frame of each link on the mount at values of the joints, in its frame.

        Links that some ``joints`` suffice to reach are enough, if these are given.
        """
        frames = {self.mount: GROUND_FRAME}
        for joint in joints or self.joints.values():
            if joint.parent not in frames:
                continue
            base = frames[joint.parent].compose(self.bases[joint.name])
            if value := values.get(joint.name, 0.0):
                axis = base.turn(direction_of(joint.axis))
                if joint.kind == 'prismatic':
                    base = base._replace(origin=plus(base.origin, scale(value, axis)))
                else:
                    x, y, z = (turn_about(axis, value, way) for way in base[:3])
                    base = SpaceFrame(x, y, z, base.origin)
            frames[joint.child] = base
        return frames


class RobotPose:
    """What closes loops of a robot, at values of its joints; what is told of these is kept."""

    def __init__(
        self,
        tree: RobotTree,
        loops: Sequence[UrdfLoop],
        told: Mapping[str, float],
        moving: Sequence[str],
    ) -> None:
        self._tree, self._told, self._moving = tree, told, moving
        self.closed = [loop for loop in loops if loop.kind != 'rod']
        self.directed = [loop for loop in loops if _is_directed(loop)]
        above = {
            joint.name for loop in loops for end in loop.ends for joint in tree.above[end.link]
        }
        above |= {joint.name for name in moving for joint in tree.above[tree.joints[name].child]}
        self._joints = [joint for joint in tree.joints.values() if joint.name in above]
        frames = tree.place_links({}, self._joints)
        places = [frames[tree.joints[name].child].origin for name in moving]
        places += [end_frame(end, frames).origin for loop in loops for end in loop.ends]
        size = extent_of(places)
        self.size = size if size > ONE_PLACE else 1.0

    def move(
        self, values: dict[str, float], moves: Mapping[str, float], ratios: Mapping[str, Ratio]
    ) -> dict[str, float]:
        """Return values after some moves; joints follow others."""
        values = values | {name: values[name] + move for name, move in moves.items()}
        return values | {
            name: ratio.value_at(values)
            for name, ratio in ratios.items()
            if name not in self._told
        }

    def gaps(self, frames: Mapping[str, SpaceFrame]) -> list[Vector]:
        """Return by how much each loop is open, in [m]; a rod has its length in the pose."""
        return [self._gap(loop, frames)[0] for loop in self.closed]

    def beside_by(self, frames: Mapping[str, SpaceFrame]) -> float:
        """Return the largest distance along the axis of the ends of a planar pin, in [m]."""
        apart = max((self._gap(loop, frames)[1] for loop in self.closed), default=0.0)
        return apart if apart > _BESIDE * self.size else 0.0

    def _gap(self, loop: UrdfLoop, frames: Mapping[str, SpaceFrame]) -> tuple[Vector, float]:
        """Return by how much a loop is open, and its ends lie next to each other."""
        first, second = (end_frame(end, frames) for end in loop.ends)
        gap, axis = minus(second.origin, first.origin), first.turn(direction_of(loop.ends[0].axis))
        along = dot(gap, axis) if loop.kind in _SLIDING else 0.0
        gap, offset = minus(gap, scale(along, axis)), 0.0
        if normal := self._normal_of(loop, frames):
            offset = dot(gap, normal)
            gap = minus(gap, scale(offset, normal))
        return gap, abs(offset)

    def _normal_of(self, loop: UrdfLoop, frames: Mapping[str, SpaceFrame]) -> Vector | None:
        """Return the normal of a loop that moves in a plane: pins may end next to each other."""
        ways = chain(*self._tree.ways(*(end.link for end in loop.ends)))
        moving = [joint for joint in ways if joint.kind in MOVING]
        axes = [frames[joint.child].turn(direction_of(joint.axis)) for joint in moving]
        slides = [joint.kind == 'prismatic' for joint in moving]
        if all(slides):
            return None
        normal = axes[slides.index(False)]
        tilts = (
            abs(dot(axis, normal)) if slide else length(cross(axis, normal))
            for axis, slide in zip(axes, slides, strict=True)
        )
        return normal if max(tilts) < PARALLEL else None

    def turns(self, frames: Mapping[str, SpaceFrame]) -> list[Vector]:
        """Return by how much the second frame of each directed loop is turned, in [rad]."""
        turns = []
        for loop in self.directed:
            first, second = (end_frame(end, frames) for end in loop.ends)
            if loop.kind == 'hinge':
                axes = [
                    frame.turn(direction_of(end.axis))
                    for frame, end in zip((first, second), loop.ends, strict=True)
                ]
                turns.append(_turn_of_axis(*axes))
            else:
                turns.append(_turn_of_frame(first, second))
        return turns

    def _remaining_errors(self, frames: Mapping[str, SpaceFrame]) -> list[float]:
        """Return what is left of all equations; directions are lengths at the size."""
        turns = (scale(self.size, turn) for turn in self.turns(frames))
        return [*chain(*self.gaps(frames), *turns)]

    def _slopes(
        self, frames: Mapping[str, SpaceFrame], free: Sequence[str], ratios: Mapping[str, Ratio]
    ) -> list[list[float]]:
        """Return for each free joint the rates of what is left at a rate of 1."""
        loops = [*self.closed, *self.directed]
        rates = {name: [ZERO] * len(loops) for name in free}
        for number, loop in enumerate(loops):
            ways = self._tree.ways(*(end.link for end in loop.ends))
            turns = number >= len(self.closed)
            slides = loop.kind in _SLIDING and not turns
            for end, way, sign in zip(loop.ends, ways, (-1.0, 1.0), strict=True):
                # A line is carried along to the place that slides on it.
                place = end_frame(loop.ends[1] if slides else end, frames).origin
                for joint in way:
                    ratio = ratios.get(joint.name, Ratio(joint.name, 1.0))
                    moved = [term for term in ratio.terms if term in rates]
                    if moved and joint.kind in MOVING:
                        frame = frames[joint.child]
                        rate = frame.turn(direction_of(joint.axis))
                        if turns:
                            rate = scale(0.0 if joint.kind == 'prismatic' else self.size, rate)
                        elif joint.kind != 'prismatic':
                            rate = cross(rate, minus(place, frame.origin))
                        for of in moved:
                            part = scale(sign * ratio.terms[of], rate)
                            rates[of][number] = plus(rates[of][number], part)
            if slides or (turns and loop.kind == 'hinge'):
                first, _ = loop.ends
                axis = end_frame(first, frames).turn(direction_of(first.axis))
                for row in rates.values():  # What moves along or about the axis is free.
                    row[number] = minus(row[number], scale(dot(row[number], axis), axis))
        return [[*chain(*row)] for row in rates.values()]

    def meet(
        self,
        values: dict[str, float],
        free: Sequence[str],
        ratios: Mapping[str, Ratio],
        *,
        is_far: bool = False,
        within_limits: bool = False,
    ) -> tuple[dict[str, float], float]:
        """Return values at which the loops close, as far as free joints do it, and the gap."""
        frames = self._tree.place_links(values, self._joints)
        left = self._remaining_errors(frames)
        damping = _SEARCH_DAMPING if is_far else _LEAST_DAMPING
        for _ in range(_MOST_SEARCH_STEPS if is_far else _MOST_STEPS):
            if hypot(*left) <= _ROUNDED * self.size or not free:
                break
            import numpy as np  # local import: many poses are met

            slopes = np.array(self._slopes(frames, free, ratios))
            # The shortest step: J·Jᵀ is smaller than Jᵀ·J.
            matrix = slopes.T @ slopes + damping * self.size**2 * np.eye(len(left))
            steps = slopes @ np.linalg.solve(matrix, -np.array(left))
            moves = dict(zip(free, steps.tolist(), strict=True))
            if within_limits:
                moves = {
                    name: self._bring_within(name, values[name] + move) - values[name]
                    for name, move in moves.items()
                }
            moved = self.move(values, moves, ratios)
            frames_there = self._tree.place_links(moved, self._joints)
            left_there = self._remaining_errors(frames_there)
            if hypot(*left_there) < hypot(*left):
                values, frames, left = moved, frames_there, left_there
                damping = max(damping / _MORE_DAMPING, _LEAST_DAMPING)
            else:
                damping *= _MORE_DAMPING
        return values, hypot(*left)

    def _bring_within(self, name: str, value: float) -> float:
        limits = self._tree.joints[name].limits
        return min(max(value, limits.low), limits.high)

    def is_within_limits(self, values: Mapping[str, float]) -> bool:
        """Return whether these joints that move are within their limits."""
        moving = (name for name in self._moving if name in values)
        limits = ((values[name], self._tree.joints[name].limits) for name in moving)
        return all(within.low <= value <= within.high for value, within in limits)

    def _draw(self, name: str, value: float, nudge: float, drawn: Random) -> float:
        """Return by how much a joint is moved: into its limits, and there at random."""
        limits, within = self._tree.joints[name].limits, self._bring_within(name, value)
        low, high = max(within - nudge, limits.low), min(within + nudge, limits.high)
        return drawn.uniform(low, high) - value

    def find_near(
        self, values: dict[str, float], driven: Sequence[str], ratios: Mapping[str, Ratio]
    ) -> dict[str, float] | None:
        """
        Return a pose near values of joints in which all loops close; None if none is found.

        It is sought within the limits of the joints, and beyond them if there is none. Inputs are
        moved if others do not suffice, and what is told at last.
        """
        free = [name for name in self._moving if name not in ratios]
        untold = [name for name in free if name not in self._told]
        others = [name for name in untold if name not in driven]
        drawn = Random(_SEED)
        starts = [*product((True,), (others, untold, free), _NUDGES)]
        starts += product((False,), (others, free), (0.0,))
        for within_limits, moved, nudge in starts:
            nudges = {name: self._draw(name, values[name], nudge, drawn) for name in moved}
            start = self.move(values, nudges, ratios)
            met, gap = self.meet(start, moved, ratios, is_far=True, within_limits=within_limits)
            for name in moved:
                if self._tree.joints[name].kind != 'prismatic':
                    angle = remainder(met[name], tau)
                    if not within_limits or self._bring_within(name, angle) == angle:
                        met[name] = angle
            if gap < _CLOSED * self.size and (self.is_within_limits(met) or not within_limits):
                return met
        return None


def _is_directed(loop: UrdfLoop) -> bool:
    """Return whether what closes a loop says how the second frame lies in the first."""
    first, second = loop.ends
    if loop.kind == 'hinge':
        return second.is_directed
    return loop.kind in ('fixed', 'slide') and first.is_directed and second.is_directed


def _turn_of_axis(first: Vector, second: Vector) -> Vector:
    """Return the turn from one axis to another, in [rad]; of a hinge both ways are one."""
    sine, cosine = cross(first, second), dot(first, second)
    sine = sine if cosine >= 0.0 else scale(-1.0, sine)
    size = length(sine)
    return scale(atan2(size, abs(cosine)) / size, sine) if size else ZERO


def _turn_of_frame(first: SpaceFrame, second: SpaceFrame) -> Vector:
    """Return the turn from one frame to another, in [rad]."""
    pairs = [*zip(first[:3], second[:3], strict=True)]
    sine = scale(0.5, plus(plus(*(cross(*pair) for pair in pairs[:2])), cross(*pairs[2])))
    angle = atan2(size := length(sine), 0.5 * (sum(dot(*pair) for pair in pairs) - 1.0))
    if size > _ROUNDED:
        return scale(angle / size, sine)
    # A half turn: its axis is what both frames share.
    shared = max((plus(*pair) for pair in pairs), key=length)
    return scale(angle, direction_of(shared))


def end_frame(end: LoopEnd, frames: Mapping[str, SpaceFrame]) -> SpaceFrame:
    """Return the frame of an end of what closes a loop."""
    return frames[end.link].compose(frame_of(end.xyz, end.rpy))


def roll_pitch_yaw(x: Vector, y: Vector, z: Vector) -> Vector:
    """Return the angles about fixed axes that turn the ground's axes to these."""
    cosine = hypot(x[0], x[1])
    pitch = atan2(-x[2], cosine)
    if cosine < _UPRIGHT:  # Roll and yaw turn about one axis.
        return atan2(-z[1], y[1]), pitch, 0.0
    return atan2(y[2], z[2]), pitch, atan2(x[1], x[0])


@lru_cache(1024)
def frame_of(xyz: Vector, rpy: Vector) -> SpaceFrame:
    """Return the frame of an origin of a URDF: roll, pitch and yaw about fixed axes."""
    x, y, z = GROUND_FRAME[:3]
    for axis, angle in zip((x, y, z), rpy, strict=True):
        x, y, z = (turn_about(axis, angle, way) for way in (x, y, z))
    return SpaceFrame(x, y, z, xyz)
