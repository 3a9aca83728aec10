# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Read a robot whose URDF has loops as a spatial linkage: its tree, and what closes it.

A loop leads from an end of what closes it up the tree to the common ancestor, and down to the
other end. The joints on such ways are the linkage, and inputs above them. All others are left out,
and what hangs on them stands still in its own loops: the topmost link of each loop is the ground,
unless an input carries it. Coordinates are in the frame of that link, or of the root if there are
several. Joints keep their names, signs and zeroes.

The pose has the values of joints that are told, or else 0, corrected until the loops close.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, combinations, islice
from math import inf, tau
from typing import Any, NamedTuple

from linkage_ros.description.grammar import ListOf, name_or_names, Named
from linkage_ros.description.linkage_grammar import FARTHEST, MOST_LINKS
from linkage_ros.description.parameters import (
    declare,
    flag,
    Keys,
    Number,
    read_parameters,
    text,
    TextOf,
)
from linkage_ros.description.robot_pose import (
    end_frame,
    frame_of,
    LINE,
    RobotPose,
    RobotTree,
    roll_pitch_yaw,
)
from linkage_ros.description.section import Section
from linkage_ros.description.urdf_file import (
    LOOP_KINDS,
    LoopEnd,
    MOVING,
    pin_frames,
    PLACE,
    read_urdf,
    UrdfFile,
    UrdfJoint,
    UrdfLoop,
)
from linkage_ros.errors import DefinitionError, did_you_mean, FileError, list_names, quote
from linkage_ros.kinematics import (
    CarriedPoints,
    check_limits,
    Closure,
    closure_as_drawn,
    combine_masses,
    direction_of,
    GROUND,
    length,
    Limits,
    PoseCorrections,
    Ratio,
    SpaceClosure,
    SpaceFrame,
    SpaceLinkage,
    SpatialJoint,
    SpatialMass,
    turn_ratios,
    turned_tensor,
    unit_of,
    Vector,
    ZERO,
)

_MET = 1e-3
"""Largest gap of a loop in the pose, relative to the size; of its directions in [rad]."""

_ROUNDED_VALUE = 1e-12
"""Rounding of a joint that loops move, in [rad] or relative to the size."""

_MOST_JOINTS, _MOST_LOOPS = 100, 20
"""Most joints and loops that move together: a pose is sought in seconds."""

_NEAR_ZERO, _MOST_TOLD = 1e-9, 6
"""Least value of a joint that a remedy tells, and the most joints or sets of inputs."""

_PASSIVE = 'passive'
"""What robots of Onshape call joints that no motor moves."""

_MOST_TRIED = 20
"""Most choices of mimics that are tried."""

ROBOT = Keys(
    'A robot whose URDF has loops; all joints in them that are not inputs are published.',
    dict,
    {
        'urdf': text('path of the URDF, relative to the folder of this file'),
        'input': name_or_names('The driven joint; several in a list.', 'a joint of the URDF'),
        'at': declare(
            Named(
                'Values of joints at which all loops close, where they are not 0, by name.',
                Number('a value', 'rad or m', -FARTHEST, FARTHEST),
                MOST_LINKS,
            ),
            {},
        ),
        'near': flag(
            'Whether, where the loops are open at these values, the pose is one near it in which '
            'they close.',
            False,
        ),
        'close': declare(
            ListOf(
                'What else meets: FRAME=FRAME, links whose origins a ball joins, or places '
                'LINK.x,y,z; FRAME=FRAME:hinge, about the z axis of the first, or :fixed.',
                TextOf('two frames'),
            ),
            (),
        ),
    },
)


def read_robot_closure(
    content: Section, name: str, *, publish_inputs: bool, publish_model_joints: bool
) -> Closure:
    """Read the loops of a robot and check that they close, as `read_any_closure` does."""
    urdf = read_urdf(content.named_data, content.mapping['urdf'])
    slides = [joint.name for joint in urdf.joints.values() if joint.kind == 'prismatic']
    keys = read_parameters(content, ROBOT, {'slide': slides})

    def close(robot: _Robot, without: Sequence[str]) -> Closure:
        linkage = robot.linkage(publish_inputs, without)
        closure = closure_as_drawn(linkage, name, publish_model_joints=publish_model_joints)
        check_limits(closure)
        return closure

    robot: _Robot | None = None
    try:
        robot = _Robot(urdf, keys['input'], keys['at'], keys['close'], keys['near'])
        robot.check_driven()
        errors: list[DefinitionError] = []
        idle: list[Closure] = []
        for without in robot.needless_choices(publish_inputs):
            try:
                closure = close(robot, without)
            except DefinitionError as error:
                errors.append(error)
                continue
            if not _holds_a_follower(closure, without):
                return closure
            idle.append(closure)
        if idle:
            return idle[0]
        # The first is without all; the next the likeliest of as many as are needed.
        raise errors[:2][-1]
    except DefinitionError as error:
        section, _, part = error.where.partition('.')
        if section == 'input' and robot and not keys['input'] and (sets := robot.input_sets()):
            written = [' '.join(f'--input {name}' for name in names) for names in sets]
            remedy = f'write {", or ".join(written)}; in a scene input: [{", ".join(sets[0])}]'
            raise content.error('', error.reason, remedy) from None
        if section in ('input', 'at', 'close', 'pose'):
            key = 'at' if section == 'pose' else section
            where = key if key in content else ''
            raise content.error(where, error.reason, error.remedy) from None
        where = f'{"link" if section == "links" else "joint"} {part.partition(".")[0]}'
        remedy = error.remedy.replace('draw another pose', 'give another: at: {JOINT: VALUE}')
        raise FileError(urdf.file, where if part else '', error.reason, remedy) from None


def _holds_a_follower(closure: Closure, without: Sequence[str]) -> bool:
    """Return whether a joint that does not follow would say how far a link turns that is held."""
    if not isinstance(closure, SpaceClosure):
        return False
    hinges = closure.linkage.hinges
    links = {link for name in closure.held for link in (hinges[name].parent, hinges[name].child)}
    followers = [hinges[name] for name in without if name in hinges]
    return any((links - {GROUND}) & {hinge.parent, hinge.child} for hinge in followers)


class _LinkageParts(NamedTuple):
    """What a linkage is made of."""

    points: dict[str, Vector]
    links: dict[str, tuple[str, ...]]
    hinges: dict[str, SpatialJoint]
    slides: dict[str, SpatialJoint]


class _Robot:
    """The loops of a robot; a DefinitionError names one of its keys, a FileError its URDF."""

    def __init__(self, urdf: UrdfFile, driven: Any, told: Any, close: Any, near: bool) -> None:
        self._urdf, self._told, self._near = urdf, {**urdf.start, **told}, near
        self._tree = tree = RobotTree(urdf)
        self._loops: list[UrdfLoop] = []
        taken, said = {*urdf.joints, *urdf.links}, [*urdf.loops, *map(self._read_close, close)]
        there = {self._places_of(loop) for loop in said}
        pins = [loop for loop in self._read_pins() if self._places_of(loop) not in there]
        for number, loop in enumerate((*said, *pins), 1):
            name = f'{loop.name}_{number}' if loop.name in taken else loop.name
            while name in taken:
                name += '_'
            taken.add(name)
            self._loops.append(loop._replace(name=name))
        self._driven = tuple(driven) or urdf.inputs or tuple(self._find_actuated())
        self._ratios = dict(self._find_ratios())
        groups = self._find_groups()
        groups = [group for group in groups if group[1]] or groups
        tied = set().union(*(names for names, _ in groups))
        order = dict.fromkeys((*urdf.start, *urdf.order))
        moving = [name for name in order if urdf.joints[name].kind in MOVING]
        self._carriers = [name for name in self._driven if name in moving and name not in tied]
        """Inputs in no loop, which carry the loops beyond them."""
        if groups:
            groups += [({name}, []) for name in self._carriers]
        # The other leg of a robot, which another linkage may move, is left out.
        chosen = [group for group in groups if not self._driven or group[0] & {*self._driven}]
        self._loops = [loop for _, loops in chosen for loop in loops]
        looped = {name for loop in self._loops for name in self._names_of(loop)}
        self._needless = [
            name for name, ratio in self._ratios.items() if {name, *ratio.terms} <= looped
        ]
        """Joints that follow others in loops, which may move them as well."""
        kept, known = (set().union(*(names for names, _ in of)) for of in (chosen, groups))
        self._moving = [name for name in moving if name in kept]
        self._check(moving, known, chosen, told)
        children = {urdf.joints[name].child for name in self._moving}
        mounts = {tree.body(urdf.joints[name].parent) for name in self._moving} - children
        tree.mount = mounts.pop() if len(mounts) == 1 else urdf.root
        self._pose = RobotPose(tree, self._loops, self._told, self._moving)
        self._apart = [
            RobotPose(tree, loops, self._told, [name for name in self._moving if name in names])
            for names, loops in chosen
            if loops
        ]
        """The same of loops that move together."""

    def _find_groups(self) -> list[tuple[set[str], list[UrdfLoop]]]:
        """Return the joints that loops and ratios tie together, with the loops."""
        groups: list[tuple[set[str], list[UrdfLoop]]] = []
        tied_sets = [(self._names_of(loop), [loop]) for loop in self._loops]
        tied_sets += [({name, *ratio.terms}, []) for name, ratio in self._ratios.items()]
        for names, loops in tied_sets:
            tied = [group for group in groups if group[0] & names]
            groups = [group for group in groups if group not in tied]
            tied_names = names.union(*(group[0] for group in tied))
            groups.append((tied_names, [*(loop for _, of in tied for loop in of), *loops]))
        return groups

    def _find_actuated(self) -> list[str]:
        """Return the joints in loops and couplings that the file says motors move."""
        ends = [tuple(end.link for end in loop.ends) for loop in self._loops]
        ends += [(predecessor, successor) for _, predecessor, successor, _ in self._urdf.couplings]
        tied = {joint.name for pair in ends for joint in chain(*self._tree.ways(*pair))}
        tied |= {joint.mimics for joint in self._urdf.joints.values()}
        if actuated := [name for name in self._urdf.actuated if name in tied]:
            return actuated
        # Robots of Onshape say by a name what no motor moves.
        joints = self._urdf.joints.items()
        moving = [name for name, joint in joints if name in tied and joint.kind in MOVING]
        driven = [name for name in moving if _PASSIVE not in name]
        return driven if len(driven) < len(moving) else []

    def _names_of(self, loop: UrdfLoop) -> set[str]:
        ways = self._tree.ways(*(end.link for end in loop.ends))
        return {joint.name for joint in chain(*ways) if joint.kind != 'fixed'}

    def _check(
        self,
        moving: list[str],
        known: set[str],
        chosen: Sequence[tuple[set[str], list[UrdfLoop]]],
        told: Mapping[str, float],
    ) -> None:
        """Refuse names of no joint, inputs in no loop, and what cannot be in a loop."""
        if not known:
            unread = self._urdf.unread
            reason = f'closes no loop{"; not read: " if unread else ""}{list_names(unread)}'
            raise self._error(
                '', reason, 'write a <loop_joint>, or name frames that meet: close: [FRAME=FRAME] '
                'in a scene, --close FRAME=FRAME',
            )  # fmt: skip
        for key, name in (*(('input', name) for name in self._driven), *(('at', k) for k in told)):
            if name not in moving:
                remedy = did_you_mean(name, moving, f'name one of {list_names(moving)}')
                raise DefinitionError(key, f'there is no moving joint {quote(name)}', remedy)
        for name in self._driven:
            if name not in known:
                remedy = f'name one of {list_names(name for name in moving if name in known)}'
                raise DefinitionError('input', f'{quote(name)} is in no loop', remedy)
            if name in self._ratios and name not in self._needless:
                leaders = list_names(map(quote, self._ratios[name].terms))
                reason = f'{quote(name)} follows {leaders}'
                raise DefinitionError('input', reason, f'drive {leaders}')
        for names, loops in chosen:
            if len(names) > _MOST_JOINTS or len(loops) > _MOST_LOOPS:
                reason = f'has {len(names)} joints in {len(loops)} loops that move together'
                raise self._error('', reason, f'keep {_MOST_JOINTS} and {_MOST_LOOPS} at most')
        for loop in self._loops:
            if loop.kind not in (*LOOP_KINDS.values(), LINE):
                reason = f'{quote(loop.kind)} is not a type of loop'
                remedy = f'write one of {list_names(filter(None, LOOP_KINDS))}'
                raise self._error(f'loop {loop.name}', reason, remedy)
        for joint in (self._urdf.joints[name] for names, _ in chosen for name in names):
            if joint.kind not in MOVING:
                reason, remedy = f'type {joint.kind} cannot be in a loop', list_names(MOVING)
                raise self._error(f'joint {joint.name}', reason, f'write {remedy} or fixed')

    def check_driven(self) -> None:
        """Refuse a robot of which nothing says what drives it."""
        if not self._driven:
            reason = 'the robot does not say which joint drives it'
            remedy = f'name one of {list_names(self._moving)}: input: JOINT in a scene, '
            raise DefinitionError('input', reason, f'{remedy}--input JOINT')

    def input_sets(self) -> list[tuple[str, ...]]:
        """
        Return sets of joints that could drive it, the first few; none where too many are tried.

        They are those of fewest kinds of motors, as the limits of effort and rate tell them.
        """
        from linkage_ros.kinematics import find_input_sets  # local import: it loads numpy

        joints = self._urdf.joints
        limits = {name: joints[name].limits for name in self._moving if name not in self._ratios}
        names = [name for name, of in limits.items() if min(of.effort, of.velocity) < inf]
        names = names or [*limits]
        try:
            linkage = self.linkage(False, self._needless, tuple(names))
        except DefinitionError:
            return []
        input_sets = find_input_sets(linkage, CarriedPoints(linkage, unit_of(linkage)), names)
        kinds = [
            len({(limits[k].effort, limits[k].velocity) for k in names}) for names in input_sets
        ]
        least = [
            names for names, count in zip(input_sets, kinds, strict=True) if count == min(kinds)
        ]
        return least[:_MOST_TOLD]

    def _error(self, where: str, reason: str, remedy: str) -> FileError:
        return FileError(self._urdf.file, where, reason, remedy)

    def needless_choices(self, publish_inputs: bool) -> Iterator[list[str]]:
        """
        Yield choices of joints that need not follow others, as loops move them.

        A robot may say roughly by a mimic what its loops do exactly. None of these follow, or as
        many as are needed; those that turn against the link that the followed joint turns against,
        as gears do, are the first.
        """
        yield self._needless
        if not self._needless:
            return
        from linkage_ros.kinematics import find_freedom  # local import: it loads numpy

        linkage = self.linkage(publish_inputs, self._needless)
        mobility = find_freedom(linkage, CarriedPoints(linkage, unit_of(linkage))).mobility
        needed = min(max(0, mobility - len(self._driven)), len(self._needless))
        names = sorted(self._needless, key=lambda name: not self._is_geared(name))
        for kept in islice(combinations(names, needed), _MOST_TRIED) if needed else ():
            yield [name for name in self._needless if name not in kept]

    def _is_geared(self, name: str) -> bool:
        """Return whether a joint turns against a link that the joint that it follows does."""
        joints = (self._urdf.joints[joint] for joint in (name, *self._ratios[name].terms))
        first_ends, *others = ({self._tree.body(of.parent), of.child} for of in joints)
        return not any(map(first_ends.isdisjoint, others))

    def _read_close(self, asked: str) -> UrdfLoop:
        """Read FRAME=FRAME[:KIND]; the axis of a hinge is the z axis of the first frame."""
        pair, _, kind = asked.rpartition(':')
        if kind not in ('ball', 'hinge', 'fixed'):
            pair, kind = asked, 'ball'
        ends = []
        for name in pair.split('='):
            match = None if name in self._urdf.links else PLACE.fullmatch(name)
            link, *place = match.groups() if match else (name, 0, 0, 0)
            if link not in self._urdf.links:
                remedy = did_you_mean(link, self._urdf.links, 'name a link, or LINK.x,y,z')
                raise DefinitionError('close', f'there is no link {quote(link)}', remedy)
            x, y, z = map(float, place)
            directed = match is None and kind == 'fixed'
            ends.append(LoopEnd(link, (x, y, z), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), directed))
        if len(ends) != 2:
            raise DefinitionError('close', f'{quote(asked)} is not a pair', 'write FRAME=FRAME')
        body, second_body = (self._tree.body(end.link) for end in ends)
        if body == second_body:
            reason = f'{quote(asked)} is within {quote(body)}, in which nothing moves'
            raise DefinitionError('close', reason, 'name frames of two links that move')
        return UrdfLoop(f'{ends[0].link}_pin', kind, (ends[0], ends[1]))

    def _read_pins(self) -> Iterator[UrdfLoop]:
        """Yield the pins that frames called PIN_on_LINK say, and joints that Gazebo closes."""
        pins = pin_frames(self._urdf)
        for pin, (first, *others) in pins.items():
            slider = pin.removesuffix('_line')
            if slider != pin and not others and len(pins.get(slider, ())) == 1:
                ends = LoopEnd(first, ZERO), LoopEnd(pins[slider][0], ZERO)
                yield UrdfLoop(slider, LINE, ends)
            for number, further_pin in enumerate(others):
                ends = LoopEnd(first, ZERO), LoopEnd(further_pin, ZERO)
                yield UrdfLoop(f'{pin}_{number}' if number else pin, 'ball', ends)
        frames = self._tree.place_links({}) if self._urdf.pinned else {}
        for child, parent, place, kind in self._urdf.pinned:
            on_parent = frames[parent].locate(frames[child].place(place))
            rpy = roll_pitch_yaw(*map(frames[parent].resolve, frames[child][:3]))
            ends = LoopEnd(child, place), LoopEnd(parent, on_parent, rpy)
            yield UrdfLoop(f'{child}_on_{parent}', kind, ends)

    def _places_of(self, loop: UrdfLoop) -> frozenset[tuple[str, Vector]]:
        """Return the ends of a loop as places on links that move."""
        places = set()
        for end in loop.ends:
            link, place = end.link, end.xyz
            for joint in self._tree.above[link]:
                if joint.kind != 'fixed':
                    break
                link, place = joint.parent, self._tree.bases[joint.name].place(place)
            x, y, z = (round(coordinate, 9) for coordinate in place)
            places.add((link, (x, y, z)))
        return frozenset(places)

    def _find_ratios(self) -> Iterator[tuple[str, Ratio]]:
        """Yield the joints that follow others: mimics and couplings."""
        for joint in self._urdf.joints.values():
            if joint.mimics:
                yield joint.name, Ratio(joint.mimics, joint.multiplier, joint.offset)
        for name, predecessor, successor, ratio in self._urdf.couplings:
            ways = self._tree.ways(predecessor, successor)
            leaders, followers = (
                [joint.name for joint in way if joint.kind in MOVING] for way in ways
            )
            if not leaders or not followers or not ratio:
                reason = f'couples {len(leaders)} and {len(followers)} joints by {ratio:g}'
                remedy = 'name links that joints move, and a ratio other than 0'
                raise self._error(name, reason, remedy)
            # The sum of the followers is the ratio times the sum of the leaders.
            terms = {**dict.fromkeys(followers, -1.0), **dict.fromkeys(leaders, ratio)}
            moved = next((term for term in terms if term not in self._driven), None)
            if moved is None:
                reason = f'couples the inputs {list_names(terms)}'
                raise self._error(name, reason, 'leave one of them out of the inputs')
            by = -terms.pop(moved)
            (of, first), *others = ((term, factor / by) for term, factor in terms.items())
            yield moved, Ratio(of, first, also=dict(others))

    # The linkage

    def linkage(
        self, publish_inputs: bool, without: Sequence[str], instead: tuple[str, ...] = ()
    ) -> SpaceLinkage:
        """
        Return the linkage in the pose, in which its loops close, without some ratios.

        It has other inputs if these are given ``instead``.
        """
        driven = instead or self._driven
        ratios = {name: of for name, of in self._ratios.items() if name not in without}
        ratios = turn_ratios(ratios, driven)
        free = [name for name in self._moving if name not in (*driven, *ratios)]
        told = {name: self._told.get(name, 0.0) for name in self._urdf.joints}
        pose = self._pose
        values = pose.move(told, {}, self._ratios)
        frames = self._tree.place_links(values)
        open_by, turned_by = (
            max(zip(map(length, errors), (loop.name for loop in loops), strict=True),
                default=(0.0, ''))
            for errors, loops in (
                (pose.gaps(frames), pose.closed), (pose.turns(frames), pose.directed),
            )
        )  # fmt: skip
        for (apart, worst), unit, most in (
            (open_by, 'm', _MET * pose.size), (turned_by, 'rad', _MET),
        ):  # fmt: skip
            if apart > most or (self._near and not pose.is_within_limits(values)):
                near = self._find_near(values, driven, ratios)
                if near is None or not self._near:
                    reason = f'the loop {worst} is open by {apart:.3g} {unit} in the pose'
                    reason += ', and no pose near closes all' if self._near else ''
                    raise DefinitionError('at', reason, self._remedy_of(near, ratios))
                values = near
                break
        as_told = values
        values, _ = pose.meet(values, free, ratios)
        frames, joints = self._tree.place_links(values), self._urdf.joints
        on = {self._urdf.root: GROUND}
        for joint in joints.values():
            own = f'{GROUND}_link' if joint.child == GROUND else joint.child
            above = self._tree.above[joint.child]
            is_carried = any(joint.name in self._carriers for joint in above)
            still = on[joint.parent] if is_carried or joint.kind == 'fixed' else GROUND
            on[joint.child] = own if joint.name in self._moving else still
        for loop in self._loops:
            if loop.kind == 'fixed':
                kept, gone = sorted((on[end.link] for end in loop.ends), key=GROUND.__ne__)
                on = {link: kept if of == gone else of for link, of in on.items()}
        made = _LinkageParts({}, {}, {}, {})
        for name in self._moving:
            joint, frame = joints[name], frames[joints[name].child]
            limits = self._limits_in_pose(joint, values[name], as_told[name])
            axis, ends = frame.turn(direction_of(joint.axis)), (on[joint.parent], on[joint.child])
            if ends[0] != ends[1]:  # It is not held by a fixed loop.
                joined = SpatialJoint(*ends, axis, frame.origin, values[name], limits)
                (made.slides if joint.kind == 'prismatic' else made.hinges)[name] = joined
        movable = [*made.hinges, *made.slides]
        for loop in self._loops:
            self._add_loop(loop, [on[end.link] for end in loop.ends], frames, made)
        traced = tuple(self._add_traced(on, frames, made))
        published = [k for k in self._moving if k in movable and k not in driven]
        left_out = [k for k, joint in joints.items() if joint.kind != 'fixed' and k not in movable]
        left_out += [f'mimic of {name}' for name in without]
        left_out += [
            f'limits of {name}'
            for name in self._moving
            if self._near and not pose.is_within_limits({name: as_told[name]})
        ]
        linkage = SpaceLinkage(
            *made,
            struts={},
            driven=driven,
            published=(*(driven if publish_inputs else ()), *published),
            ratios={name: of for name, of in ratios.items() if name in movable},
            traced=traced,
            left_out=(*left_out, *(f'{tag} (not read)' for tag in self._urdf.unread)),
            corrections=PoseCorrections(
                open_by[0], turned_by[0], beside_by=pose.beside_by(frames)
            ),
        )
        links = linkage.link_names[1:]
        return linkage.with_masses(self._masses(on, frames, links), massless=links)

    def _find_near(
        self, values: dict[str, float], driven: Sequence[str], ratios: Mapping[str, Ratio]
    ) -> dict[str, float] | None:
        """Return a pose near values in which all loops close, sought leg by leg; or None."""
        near: dict[str, float] | None = values
        for pose in self._apart:
            near = near and pose.find_near(near, driven, ratios)
        return near

    def _remedy_of(self, values: Mapping[str, float] | None, ratios: Mapping[str, Ratio]) -> str:
        """Return the remedy for loops that are open, with a pose near it in which they close."""
        if values is None:
            return 'give values of joints at which all loops close'
        pose = [
            f'{name}: {values[name]:.6g}'
            for name in self._moving
            if name not in ratios and abs(values[name]) > _NEAR_ZERO
        ]
        if len(pose) > _MOST_TOLD:
            return 'near it all close: near: true (--near)'
        return f'near it all close: near: true (--near), or at: {{{", ".join(pose)}}}'

    def _masses(
        self, on: Mapping[str, str], frames: Mapping[str, SpaceFrame], links: Sequence[str]
    ) -> dict[str, SpatialMass]:
        """Return the masses of links, with what hangs on them and does not move with a loop."""
        parts: dict[str, list[SpatialMass]] = {}
        for name, body in self._urdf.links.items():
            way = (name, *(joint.parent for joint in self._tree.above[name]))
            carrier = next((on[on_way] for on_way in way if on[on_way] in links), None)
            if body is not None and carrier is not None:
                at = frames[name].compose(frame_of(body.xyz, body.rpy))
                part = SpatialMass(body.mass, at.origin, turned_tensor(at[:3], body.tensor))
                parts.setdefault(carrier, []).append(part)
        return {link: combine_masses(of) for link, of in parts.items()}

    def _add_traced(
        self, on: Mapping[str, str], frames: Mapping[str, SpaceFrame], made: _LinkageParts
    ) -> Iterator[str]:
        """Add the frames called POINT_on_LINK that meet no other as points of links that move."""
        ends = {end.link for loop in self._loops for end in loop.ends}
        for point, (frame, *others) in pin_frames(self._urdf).items():
            is_alone = not others and point not in made.points and frame not in ends
            if is_alone and (link := on[frame]) != GROUND:
                made.points[point] = frames[frame].origin
                made.links[link] = (*made.links.get(link, ()), point)
                yield point

    def _limits_in_pose(self, joint: UrdfJoint, value: float, told: float) -> Limits:
        """Return the limits of a joint, whose value in the pose is corrected."""
        turns, limits = joint.kind != 'prismatic', joint.limits
        # A turn or more does not limit an angle, unless an input may turn one way for ever.
        is_one_way = (limits.low > -inf) != (limits.high < inf) and joint.name in self._driven
        if turns and limits.high - limits.low >= tau and not is_one_way:
            limits = replace(limits, low=-inf, high=inf)
        is_within = limits.low <= told <= limits.high
        if self._near and not is_within:
            # No pose near is within.
            limits = replace(limits, low=-inf, high=inf)
        elif value != told and is_within:
            # CAD rounds: the pose is at a limit, and the corrected one just beyond it.
            room = _ROUNDED_VALUE if turns else _ROUNDED_VALUE * self._pose.size
            low, high = min(limits.low, value - room), max(limits.high, value + room)
            limits = replace(limits, low=low, high=high)
        return limits

    def _add_loop(
        self, loop: UrdfLoop, on: list[str], frames: Mapping[str, SpaceFrame], made: _LinkageParts
    ) -> None:
        """Add what closes a loop to a linkage."""
        places, axes = zip(
            *((end.origin, end.turn(direction_of(its.axis)))
              for its in loop.ends for end in [end_frame(its, frames)]), strict=True,
        )  # fmt: skip
        name = loop.name
        if on[0] == on[1] or loop.kind == 'fixed':
            return
        if loop.kind in ('hinge', 'slide'):
            joints = made.hinges if loop.kind == 'hinge' else made.slides
            joints[name] = SpatialJoint(on[0], on[1], axes[0], places[0])
        elif loop.kind == LINE:
            across = end_frame(loop.ends[0], frames).z
            made.slides[name] = SpatialJoint(on[0], name, axes[0], places[0])
            made.hinges[f'{name} turn'] = SpatialJoint(name, on[1], across, places[1])
        elif loop.kind == 'universal':
            made.hinges[f'{name} 1'] = SpatialJoint(on[0], name, axes[0], places[0])
            made.hinges[f'{name} 2'] = SpatialJoint(name, on[1], axes[1], places[0])
        elif loop.kind == 'rod':
            for number, (link, place) in enumerate(zip(on, places, strict=True)):
                made.points[point := f'{name} {number + 1}'] = place
                for carrier in (link, name):
                    made.links[carrier] = (*made.links.get(carrier, ()), point)
        else:
            made.points[name] = places[0]
            for link in on:
                made.links[link] = (*made.links.get(link, ()), name)
