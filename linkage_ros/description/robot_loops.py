# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
The loops of a robot as a spatial linkage: its tree, and what closes it.

A loop leads from an end of what closes it up the tree to the common ancestor, and down to the
other end. The joints on such ways are the linkage. All others are left out, and what hangs on them
stands still in its own loops: the topmost link of each loop is the ground. Joints keep their
names, signs and zeroes.

The pose has the values of joints that are told, or else 0. If the loops miss it by rounding, the
joints that are not driven are moved until they close (Newton's method, damped).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from math import cos, hypot, inf, remainder, sin, tau
import re

from linkage_ros.description.urdf_file import (
    LOOP_KINDS,
    LoopEnd,
    MOVING,
    UrdfFile,
    UrdfJoint,
    UrdfLoop,
)
from linkage_ros.errors import DefinitionError, did_you_mean, FileError, list_names, quote
from linkage_ros.kinematics import (
    cross,
    direction_of,
    dot,
    Elimination,
    GROUND,
    GROUND_FRAME,
    length,
    Limits,
    minus,
    plus,
    Ratio,
    scale,
    SpaceFrame,
    SpaceLinkage,
    SpatialJoint,
    turn_about,
    Vector,
)

CLOSE_KINDS = ('ball', 'hinge', 'fixed')
"""What may close frames that a user names."""

_MET = 1e-3
"""Largest gap of a loop in the pose, relative to the size."""

_ROUNDED = 1e-14
"""Gaps below this, relative to the size, are rounding."""

_CLOSED = 1e-9
"""Largest gap, relative to the size, of a pose that is found."""

_MOST_STEPS, _MOST_HALVED = 40, 8
"""Most steps of Newton's method, and how often one is halved."""

_SLOPE_STEP, _DAMPING = 1e-6, 1e-10
_NUDGES = (0.0, 0.5, -0.5)
"""How much joints are moved before a pose is sought, in [rad] or [m]."""

_NUMBER = r'[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?'
_PLACE = re.compile(rf'(.+?)\.({_NUMBER}),({_NUMBER}),({_NUMBER})')

_X, _Z, _STRAIGHT = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


class RobotLoops:
    """
    The loops of a robot, in a pose.

    ``driven`` are the names of the driven joints, ``told`` values of joints in the pose, in [rad]
    or [m], ``close`` texts FRAME=FRAME[:KIND] of what else meets. A DefinitionError names one of
    the keys input, at and close, a FileError a part of the URDF.
    """

    def __init__(
        self,
        urdf: UrdfFile,
        driven: Sequence[str],
        told: Mapping[str, float],
        close: Sequence[str],
        publish_inputs: bool,
    ) -> None:
        self._urdf, self._publish_inputs = urdf, publish_inputs
        self._loops = [*urdf.loops, *map(self._read_close, close)]
        for loop in self._loops:
            if loop.kind not in LOOP_KINDS.values():
                reason = f'{quote(loop.kind)} is no type of what closes a loop'
                remedy = f'write one of {list_names(filter(None, LOOP_KINDS))}'
                raise self._error(f'loop {loop.name}', reason, remedy)
        moving = [name for name in urdf.order if urdf.joints[name].kind in MOVING]
        for key, names in (('input', driven), ('at', told)):
            for name in names:
                if name not in moving:
                    remedy = did_you_mean(name, moving, f'name one of {list_names(moving)}')
                    raise DefinitionError(key, f'there is no moving joint {quote(name)}', remedy)
        self._above: dict[str, tuple[UrdfJoint, ...]] = {urdf.root: ()}
        for joint in urdf.joints.values():
            self._above[joint.child] = (joint, *self._above[joint.parent])
        looped = {
            joint.name
            for loop in self._loops
            for way in self._ways(*(end.link for end in loop.ends))
            for joint in way
        }
        self._driven = tuple(driven) or tuple(name for name in urdf.inputs if name in looped)
        self._ratios = dict(self._find_ratios())
        pairs = [{name, ratio.of} for name, ratio in self._ratios.items()]
        self._kept = looped.union(*(pair for pair in pairs if pair & looped))
        self.needless = [name for name, of in self._ratios.items() if {name, of.of} <= looped]
        """Joints that follow others in loops, which may move them as well."""
        self._check_kept(looped)
        self._told = {**urdf.start, **told}
        self._frames = {joint.name: _frame(joint.xyz, joint.rpy) for joint in urdf.joints.values()}
        places = [frame.origin for frame in self._place_links({}).values()]
        self._size = max(max(one) - min(one) for one in zip(*places, strict=True)) or 1.0

    def _error(self, where: str, reason: str, remedy: str) -> FileError:
        return FileError(self._urdf.file, where, reason, remedy)

    # What is in the loops

    def _read_close(self, text: str) -> UrdfLoop:
        """Read FRAME=FRAME[:KIND]; the axis of a hinge is the z axis of the first frame."""
        pair, _, kind = text.rpartition(':')
        if kind not in CLOSE_KINDS:
            pair, kind = text, 'ball'
        ends = []
        for name in pair.split('='):
            found = None if name in self._urdf.links else _PLACE.fullmatch(name)
            link, *place = found.groups() if found else (name, '0', '0', '0')
            if link not in self._urdf.links:
                remedy = did_you_mean(link, self._urdf.links, 'name a link, or LINK.x,y,z')
                raise DefinitionError('close', f'there is no link {quote(link)}', remedy)
            x, y, z = map(float, place)
            ends.append(LoopEnd(link, (x, y, z), _STRAIGHT, _Z))
        if len(ends) != 2:
            raise DefinitionError('close', f'{quote(text)} is no pair', 'write FRAME=FRAME')
        return UrdfLoop(pair, kind, (ends[0], ends[1]))

    def _ways(self, one: str, other: str) -> tuple[list[UrdfJoint], list[UrdfJoint]]:
        """Return the joints from two links up to their common ancestor."""
        ways = self._above[one], self._above[other]
        first, second = ({joint.name for joint in way} for way in ways)
        return (
            [joint for joint in ways[0] if joint.name not in second],
            [joint for joint in ways[1] if joint.name not in first],
        )

    def _find_ratios(self) -> Iterator[tuple[str, Ratio]]:
        """Yield the joints that follow others: mimics and couplings."""
        for joint in self._urdf.joints.values():
            if joint.mimics:
                yield joint.name, Ratio(joint.mimics, joint.multiplier, joint.offset)
        for name, predecessor, successor, given in self._urdf.couplings:
            ways = [
                [joint.name for joint in way if joint.kind in MOVING]
                for way in self._ways(predecessor, successor)
            ]
            if [*map(len, ways)] != [1, 1] or not given:
                raise self._error(
                    f'coupling {name}', f'couples {len(ways[0])} and {len(ways[1])} joints by '
                    f'{given:g}', 'couple one joint with one, by a ratio other than 0',
                )  # fmt: skip
            ((leader,), (follower,)), ratio = ways, given
            if follower in self._driven:
                leader, follower, ratio = follower, leader, 1.0 / given
            yield follower, Ratio(leader, ratio)

    def _check_kept(self, looped: Collection[str]) -> None:
        """Refuse a robot without loops, inputs in none, and joints that are no hinge or slide."""
        joints = [self._urdf.joints[name] for name in self._urdf.order if name in self._kept]
        for joint in joints:
            if joint.kind not in (*MOVING, 'fixed'):
                remedy = f'write {list_names(MOVING)} or fixed'
                reason = f'type {joint.kind} cannot be in a loop'
                raise self._error(f'joint {joint.name}', reason, remedy)
        moving = [joint.name for joint in joints if joint.kind in MOVING]
        if not set(moving) & set(looped):
            unread = self._urdf.unread
            raise self._error(
                '', 'closes no loop' + (f'; not read: {list_names(unread)}' if unread else ''),
                'write a <loop_joint>, or name frames that meet: close: [FRAME=FRAME] in a scene, '
                '--close FRAME=FRAME',
            )  # fmt: skip
        if not self._driven:
            raise DefinitionError(
                'input', f'{self._urdf.file} does not say which joint drives it',
                f'name one of {list_names(moving)}',
            )  # fmt: skip
        for name in self._driven:
            if name not in moving:
                remedy = f'name one of {list_names(moving)}'
                raise DefinitionError('input', f'{quote(name)} is in no loop', remedy)

    # The pose

    def _place_links(self, values: Mapping[str, float]) -> dict[str, SpaceFrame]:
        """Return the frame of each link at values of the joints, in that of the root."""
        frames = {self._urdf.root: GROUND_FRAME}
        for joint in self._urdf.joints.values():
            base = _within(frames[joint.parent], self._frames[joint.name])
            value = values.get(joint.name, 0.0)
            if joint.kind in MOVING and value:
                axis = base.turn(direction_of(joint.axis))
                if joint.kind == 'prismatic':
                    base = base._replace(origin=plus(base.origin, scale(value, axis)))
                else:
                    x, y, z = (turn_about(axis, value, way) for way in base[:3])
                    base = SpaceFrame(x, y, z, base.origin)
            frames[joint.child] = base
        return frames

    def _misses(self, loop: UrdfLoop, frames: Mapping[str, SpaceFrame]) -> tuple[Vector, Vector]:
        """Return by how much a loop is open: in place in [m], and in direction, as a sine."""
        ends = loop.ends
        one, other = (_end_frame(end, frames) for end in ends)
        axis = one.turn(direction_of(ends[0].axis or _X))
        gap, turned = minus(other.origin, one.origin), _STRAIGHT
        is_turned = None not in (ends[0].rpy, ends[1].rpy)
        if loop.kind == 'slide':
            gap = minus(gap, scale(dot(gap, axis), axis))
        if loop.kind == 'hinge' and (is_turned or ends[1].axis):
            turned = cross(axis, other.turn(direction_of(ends[1].axis or ends[0].axis or _X)))
        elif loop.kind in ('slide', 'fixed') and is_turned:
            for way, its in zip(one[:3], other[:3], strict=True):
                turned = plus(turned, scale(0.5, cross(way, its)))
        return gap, turned

    def _follow(self, values: dict[str, float], ratios: Mapping[str, Ratio]) -> dict[str, float]:
        """Return values in which joints follow others."""
        following = {
            name: of.ratio * values[of.of] + of.offset
            for name, of in ratios.items()
            if name not in self._told
        }
        return {**values, **following}

    def _residuals(self, values: Mapping[str, float]) -> list[float]:
        frames = self._place_links(values)
        found = []
        for loop in self._loops:
            if loop.kind != 'rod':  # its length is that of the pose
                gap, turned = self._misses(loop, frames)
                found += [*gap, *scale(self._size, turned)]
        return found

    def _meet(
        self, values: dict[str, float], free: Sequence[str], ratios: Mapping[str, Ratio]
    ) -> dict[str, float]:
        """Return values at which the loops close, as far as moving the free joints can do it."""
        steps = [
            _SLOPE_STEP * (self._size if self._urdf.joints[name].kind == 'prismatic' else 1.0)
            for name in free
        ]
        found = self._residuals(values)
        for _ in range(_MOST_STEPS):
            if hypot(*found) <= _ROUNDED * self._size or not free:
                break
            rows = []
            for name, step in zip(free, steps, strict=True):
                low, high = (
                    self._residuals(self._follow({**values, name: values[name] + way}, ratios))
                    for way in (-step, step)
                )
                rows.append([(b - a) / (2.0 * step) for a, b in zip(low, high, strict=True)])
            products = [[_sum(one, other) for other in rows] for one in rows]
            damping = _DAMPING * max(max(map(abs, row)) for row in products) or 1.0
            for number, row in enumerate(products):
                row[number] += damping
            try:
                moves = Elimination(products, ()).solve([_sum(row, found) for row in rows])
            except ArithmeticError:
                break
            for halved in range(_MOST_HALVED):
                moved = {
                    name: values[name] - move * 0.5**halved
                    for name, move in zip(free, moves, strict=True)
                }
                tried = self._follow({**values, **moved}, ratios)
                left = self._residuals(tried)
                if hypot(*left) < hypot(*found):
                    break
            else:
                break
            values, found = tried, left
        return values

    def close(self, without: Sequence[str] = ()) -> SpaceLinkage:
        """Return the linkage in the pose, in which its loops close, without some ratios."""
        ratios = {name: of for name, of in self._ratios.items() if name not in without}
        joints, size = self._urdf.joints, self._size
        moving = [
            name for name in self._urdf.order if name in self._kept and joints[name].kind in MOVING
        ]
        given = {name: self._told.get(name, 0.0) for name in joints}
        values = self._follow(given, self._ratios)
        free = [name for name in moving if name not in (*self._driven, *ratios)]
        frames = self._place_links(values)
        gaps = [
            (max(length(gap) / size, length(turned)), length(gap), loop.name)
            for loop in self._loops
            if loop.kind != 'rod'
            for gap, turned in [self._misses(loop, frames)]
        ]
        worst, apart, name = max(gaps, default=(0.0, 0.0, ''))
        if worst > _MET:
            by = f'{apart:.3g} m' if apart > _MET * size else f'{worst:.3g} rad'
            reason = f'the loop {name} of {self._urdf.file} is open by {by} in the pose'
            raise DefinitionError('at', reason, self._found_pose(values, free, ratios))
        return self._build(self._meet(values, free, ratios), moving, ratios, apart)

    def _found_pose(
        self, values: dict[str, float], free: Sequence[str], ratios: Mapping[str, Ratio]
    ) -> str:
        """Return a pose near values of joints in which all loops close, as a remedy."""
        untold = [name for name in free if name not in self._told]
        slides = [name for name, of in self._urdf.joints.items() if of.kind == 'prismatic']
        turns = dict.fromkeys(self._kept, tau) | dict.fromkeys(slides, inf)
        # Newton's method does not leave a stretched pose. What is told is moved last.
        for moved, nudge in (*((untold, nudge) for nudge in _NUDGES), (free, 0.0)):
            start = self._follow({**values, **{k: values[k] + nudge for k in moved}}, ratios)
            met = self._meet(start, moved, ratios)
            if hypot(*self._residuals(met)) < _CLOSED * self._size:
                pose = [
                    f'{name}: {remainder(met[name], turns[name]):.6g}'
                    for name in self._urdf.order
                    if name in self._kept and abs(met[name]) > _CLOSED and name not in ratios
                ]
                return f'near it all close: at: {{{", ".join(pose)}}}'
        return 'give values of joints at which all loops close'

    # The linkage

    def _build(
        self,
        values: Mapping[str, float],
        moving: Sequence[str],
        ratios: Mapping[str, Ratio],
        open_by: float,
    ) -> SpaceLinkage:
        frames, joints = self._place_links(values), self._urdf.joints
        on = {self._urdf.root: GROUND}
        for joint in joints.values():
            if joint.name in moving:
                on[joint.child] = joint.child if joint.child != GROUND else f'{GROUND}_link'
            else:
                on[joint.child] = on[joint.parent] if joint.kind == 'fixed' else GROUND
        for loop in self._loops:
            if loop.kind == 'fixed':
                kept, gone = sorted((on[end.link] for end in loop.ends), key=GROUND.__ne__)
                on = {link: kept if of == gone else of for link, of in on.items()}
        points: dict[str, Vector] = {}
        links: dict[str, tuple[str, ...]] = {}
        found: dict[str, dict[str, SpatialJoint]] = {'hinges': {}, 'slides': {}}
        for name in moving:
            joint = joints[name]
            parent, child, frame = on[joint.parent], on[joint.child], frames[joint.child]
            if parent == child:
                continue
            turns = joint.kind != 'prismatic'
            found['hinges' if turns else 'slides'][name] = SpatialJoint(
                parent, child, frame.turn(direction_of(joint.axis)), frame.origin, values[name],
                _usual_limits(joint.limits) if turns else joint.limits,
            )  # fmt: skip
        taken = {*joints, *self._urdf.links}
        for loop in self._loops:
            ends = [on[end.link] for end in loop.ends]
            if ends[0] != ends[1] and loop.kind != 'fixed':
                self._add_loop(loop, ends, frames, taken, points, links, found)
        named = {**found['hinges'], **found['slides']}
        published = [name for name in moving if name in named and name not in self._driven]
        return SpaceLinkage(
            points, links, **found, struts={}, driven=self._driven,
            published=(*(self._driven if self._publish_inputs else ()), *published),
            ratios={name: of for name, of in ratios.items() if name in named},
            left_out=(
                *(name for name, of in joints.items() if of.kind != 'fixed' and name not in named),
                *(f'mimic of {k}' for k in self._ratios if k in moving and k not in ratios),
            ),
            open_by=open_by,
        )  # fmt: skip

    def _add_loop(
        self,
        loop: UrdfLoop,
        on: Sequence[str],
        frames: Mapping[str, SpaceFrame],
        taken: set[str],
        points: dict[str, Vector],
        links: dict[str, tuple[str, ...]],
        joints: Mapping[str, dict[str, SpatialJoint]],
    ) -> None:
        """Add what closes a loop between two links."""
        one, other = (_end_frame(end, frames) for end in loop.ends)
        axis = one.turn(direction_of(loop.ends[0].axis or _X))
        name = _free_name(loop.name, taken)

        def carry(point: str, place: Vector, *carriers: str) -> None:
            points[point] = place
            for link in carriers:
                links[link] = (*links.get(link, ()), point)

        if loop.kind == 'ball':
            carry(name, one.origin, *on)
        elif loop.kind == 'rod':
            for number, (link, place) in enumerate(
                zip(on, (one.origin, other.origin), strict=True)
            ):
                carry(_free_name(f'{name}_{number + 1}', taken), place, link, name)
        elif loop.kind == 'universal':
            ways = (axis, other.turn(direction_of(loop.ends[1].axis or _X)))
            for number, way in enumerate(ways):
                ends = ((on[0], name), (name, on[1]))[number]
                hinge = _free_name(f'{name}_{number + 1}', taken)
                joints['hinges'][hinge] = SpatialJoint(*ends, way, one.origin)
        else:
            joints[f'{loop.kind}s'][name] = SpatialJoint(on[0], on[1], axis, one.origin)


def _usual_limits(limits: Limits) -> Limits:
    """Return the limits of a hinge: a range of a full turn or more does not limit an angle."""
    full = limits.high - limits.low >= tau
    return replace(limits, low=-inf, high=inf) if full else limits


def _free_name(name: str, taken: set[str]) -> str:
    """Return a name that nothing has, and take it."""
    while name in taken:
        name += '_'
    taken.add(name)
    return name


def _sum(one: Sequence[float], other: Sequence[float]) -> float:
    return sum(a * b for a, b in zip(one, other, strict=True))


def _end_frame(end: LoopEnd, frames: Mapping[str, SpaceFrame]) -> SpaceFrame:
    return _within(frames[end.link], _frame(end.xyz, end.rpy or _STRAIGHT))


def _within(outer: SpaceFrame, inner: SpaceFrame) -> SpaceFrame:
    """Return a frame that is given in another one."""
    x, y, z = map(outer.turn, inner[:3])
    return SpaceFrame(x, y, z, outer.place(inner.origin))


def _frame(xyz: Vector, rpy: Vector) -> SpaceFrame:
    """Return the frame of an origin of a URDF: roll, pitch and yaw about fixed axes."""
    (cr, cp, cy), (sr, sp, sy) = map(cos, rpy), map(sin, rpy)
    return SpaceFrame(
        (cy * cp, sy * cp, -sp),
        (cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr),
        (cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr),
        xyz,
    )
