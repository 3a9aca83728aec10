# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Make a linkage of a URDF and the pins that close its loops."""

from __future__ import annotations

from cmath import rect
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations, islice, product
from math import hypot, inf, pi, remainder, tau
from typing import NamedTuple

from linkage_ros.description import MOVING, UrdfFile
from linkage_ros.errors import DefinitionError, did_you_mean, FileError, list_names
from linkage_ros.kinematics import (
    AssemblyPose,
    assur_groups,
    Closure,
    count_mobility,
    Dyad,
    GROUND,
    Input,
    Iterated,
    Limits,
    Linkage,
    NO_LIMITS,
    Point,
    Ratio,
    RevoluteJoint,
    Side,
    usual_inputs,
)
from linkage_ros.tools.models.planar import (
    add_places,
    find_closings,
    find_loops,
    find_pinned,
    lay_flat,
    Planar,
)
from linkage_ros.tools.models.urdf_topology import urdf_topology, UrdfTopology

# The assembly of each dyad, from a pose of its links.
#
# A URDF does not contain it. The linkage is closed at the pose's inputs with each combination of
# sides, and the one that gives the pose is chosen. So no sign convention of the dyads is repeated
# here.

Poses = Mapping[str, tuple[complex, float]]
"""For each link the origin of its frame, in [m], and its angle, in [rad]."""

_SIDED = ('RRR', 'RRP', 'RPR')
"""Dyads with two assemblies."""

_MANY = 10
"""Maximum number of dyads whose sides are tried together; each further one doubles the time."""

_FOUND = 0.05
"""Maximum angle between a link in a pose and in the closed linkage, in [rad]."""

_MOST_TRIED = 200
"""Most choices of mimics that are tried as ratios."""

_SAME = 1e-6
"""Two assemblies are the same if poses and inputs differ by less than this, in [rad]."""

_REMEDY = 'give a pose in which it is closed, off its toggles: --at JOINT=VALUE, for each joint'

_MET = 1e-3
"""Maximum distance between pins that meet in a pose, as a fraction of the linkage's size."""


def assemble(linkage: Linkage, inputs: tuple[float, ...], poses: Poses, where: str) -> Linkage:
    """
    Return a linkage with the sides that give a pose, from a linkage without sides.

    ``poses`` are the poses of its links at the inputs, in [rad] or [m]; ``where`` names the pose
    in messages. A DefinitionError is raised if the linkage is not valid, or if no sides or several
    combinations give the pose.
    """
    groups = assur_groups(linkage).groups
    # Where a side changes at change points, it is that at the pose.
    linkage = replace(linkage, pose=AssemblyPose(inputs, {}))
    if any(isinstance(group, Iterated) for group in groups):
        linkage = replace(linkage, pose=AssemblyPose(inputs, _point_positions(linkage, poses)))
    keys = [_side_key(each) for each in groups if isinstance(each, Dyad) and each.kind in _SIDED]
    if len(keys) > _MANY:
        reason = f'{len(keys)} dyads are too many to try all their sides'
        raise DefinitionError('assembly', reason, 'import it in parts')
    candidates = []
    choices = [
        ('ahead', 'behind') if key in linkage.sliders else ('left', 'right') for key in keys
    ]
    for sides in product(*choices):
        assembly: dict[str, Side] = dict(zip(keys, sides, strict=True))  # type: ignore[arg-type]
        closure = Closure(replace(linkage, assembly=assembly))
        candidates.append((_largest_error(closure, inputs, poses), closure))
    candidates.sort(key=lambda each: each[0])
    least, closure = candidates[0]
    if least > _FOUND:
        raise DefinitionError('assembly', f'no assembly closes the loops {where}', _REMEDY)
    if len(candidates) > 1 and candidates[1][0] < least + _SAME:
        raise DefinitionError('assembly', f'several assemblies close the loops {where}', _REMEDY)
    if closure.linkage.pose == AssemblyPose(inputs, {}):
        bare = Closure(replace(closure.linkage, pose=None))
        if _are_near(usual_inputs(bare), inputs) and _largest_error(bare, inputs, poses) <= _FOUND:
            return bare.linkage
    return closure.linkage


def _side_key(dyad: Dyad) -> str:
    """Return the key of a dyad's side: its slider, or the pin between its links."""
    joints = (dyad.inner, *dyad.outer)
    return next((joint.name for joint in joints if joint.kind == 'P'), dyad.inner.name)


def _point_positions(linkage: Linkage, poses: Poses) -> dict[str, Point]:
    """Return the positions of all points in the pose, in the frame of the ground."""
    found: dict[str, Point] = {}
    for link, points in linkage.links.items():
        place, angle = poses[link]
        for name, at in points.items():
            there = place + rect(1.0, angle) * complex(*at)
            found.setdefault(name, (there.real, there.imag))
    return found


def _largest_error(closure: Closure, inputs: tuple[float, ...], poses: Poses) -> float:
    """Return the largest angle between a link and its pose, in [rad]."""
    position = closure.position(*inputs)
    if not position.joints:
        return pi
    angles = closure.link_angles(position)
    return max(abs(remainder(angles[link] - poses[link][1], tau)) for link in poses)


def _are_near(one: Sequence[float], other: Sequence[float]) -> bool:
    return all(abs(p - q) < _SAME for p, q in zip(one, other, strict=True))


class ImportedLinkage(NamedTuple):
    """
    A linkage, and the parts of the URDF that it leaves out, in words.

    It starts at the URDF's start if its own would differ.
    """

    linkage: Linkage
    left_out: tuple[str, ...]


def linkage_from_urdf(
    urdf: UrdfFile,
    close: Sequence[tuple[str, str]] = (),
    inputs: Sequence[str] = (),
    at: Mapping[str, float] | None = None,
    *,
    limits: bool = True,
) -> ImportedLinkage:
    """
    Make a linkage of a URDF.

    ``close`` has pairs of links whose origins coincide, beside the pairs that frame names and loop
    tags define. ``inputs`` names driven joints; by default the ones that the file names. ``at``
    has values of joints, in [rad] or [m], in a pose in which the loops close; by default the
    file's values, or 0. With ``limits`` the joints keep their limits.

    A FileError with a remedy is raised if the URDF does not give a linkage.
    """
    made = _Import(urdf, close, inputs, at or {}).make_linkage()
    if not limits:
        return made
    return made._replace(linkage=_add_limits(made.linkage, urdf))


class _Import:
    def __init__(
        self,
        urdf: UrdfFile,
        close: Sequence[tuple[str, str]],
        inputs: Sequence[str],
        at: Mapping[str, float],
    ) -> None:
        close = (*urdf.closings, *find_pinned(urdf), *close)
        self._urdf = urdf = add_places(urdf, close)
        self._closings, alone = find_closings(urdf, close)
        for joint in urdf.joints.values():
            if joint.kind in ('floating', 'planar'):
                raise self._file_error(
                    f'joint {joint.name}',
                    f'type {joint.kind} cannot be a pin or slider of a planar linkage',
                    f'write {list_names(MOVING)} or fixed, or leave it out with what hangs on it',
                )
        moving = [joint.name for joint in urdf.joints.values() if joint.kind in MOVING]
        for option, names in (('--input', inputs), ('--at', at)):
            for name in names:
                if name not in moving:
                    raise self._file_error(
                        f'{option} {name}',
                        'is not a moving joint',
                        did_you_mean(name, moving, f'name one of {list_names(moving)}'),
                    )
        self._inputs = tuple(inputs) or urdf.inputs
        self._loops = find_loops(urdf, self._closings, self._inputs)
        followed = dict.fromkeys(joint.mimics for joint in urdf.joints.values() if joint.mimics)
        if followed and not self._closings and followed.keys().isdisjoint(self._inputs):
            raise self._file_error(
                f'--input {self._inputs[0]}' if self._inputs else '',
                'drives no loop, and no joint that mimics it'
                if self._inputs
                else 'does not say which joint drives it',
                f'write --input JOINT, one of {list_names(followed)}',
            )
        if not self._loops.joints or not (self._closings or followed):
            raise self._file_error(
                '',
                'closes no loop'
                + (f'; not read: {list_names(urdf.unread)}' if urdf.unread else ''),
                'name frames that meet: --close FRAME=FRAME, or call them PIN_on_LINK; or places: '
                '--close LINK.x,y,z=LINK.x,y,z',
            )
        self._planar: Planar = lay_flat(urdf, self._loops)
        self._pose = dict.fromkeys(moving, 0.0) | dict(urdf.start) | dict(at)
        self._told = {*urdf.start, *at}
        self._skeleton: UrdfTopology = urdf_topology(urdf, self._planar, self._closings, alone)

    def _file_error(self, where: str, reason: str, remedy: str) -> FileError:
        return FileError(self._urdf.file, where, reason, remedy)

    def make_linkage(self) -> ImportedLinkage:
        made = self._skeleton
        links = {
            link: {name: (at.real, at.imag) for name, at in points.items()}
            for link, points in made.links.items()
        }
        masses = {
            link: self._planar.masses[body]
            for link, body in made.bodies.items()
            if link != GROUND and body in self._planar.masses
        }
        linkage = Linkage(
            links,
            tuple(self._make_input(name) for name in self._inputs),
            {},
            {name: of for name, of in made.joints.items() if name not in self._inputs},
            made.sliders,
            made.traced,
            masses=masses,
        )
        if not linkage.inputs:
            raise self._file_error(
                '',
                'does not say which joint drives it',
                f'write --input JOINT, one of {list_names(made.joints)}',
            )
        frames = self._body_frames()
        self._check_met(frames)
        linkage, ignored = self._with_ratios(linkage)
        given = tuple(self._pose[each.joint] for each in linkage.inputs)
        poses = {link: frames[body] for link, body in made.bodies.items()}
        try:
            linkage = assemble(linkage, given, poses, self._pose_text())
        except DefinitionError as error:
            raise self._file_error(error.where, error.reason, error.remedy) from None
        left_out = [f'{part}, which belongs to no loop' for part in self._loops.left_out]
        unread = [f'{tag}: close loops by --close' for tag in self._urdf.unread]
        return ImportedLinkage(linkage, (*left_out, *ignored, *unread))

    def _with_ratios(self, linkage: Linkage) -> tuple[Linkage, list[str]]:
        """
        Return the linkage with as many mimics as ratios as it needs, and the others in words.

        Loops move some joints as their mimics say, at least roughly: these are not needed. Those
        that turn against the link that the followed joint turns against, as gears do, come first.
        """
        joints = self._skeleton.joints

        def joint_ends(name: str) -> set[str]:
            joint = joints.get(name)
            return {joint.parent, joint.child} if isinstance(joint, RevoluteJoint) else set()

        ratios = {
            joint.name: Ratio(joint.mimics, joint.multiplier, joint.offset)
            for joint in self._planar.joints
            if joint.mimics in joints and joint.name in linkage.joints
        }
        names = sorted(ratios, key=lambda name: not joint_ends(name) & joint_ends(ratios[name].of))
        wanted = count_mobility(linkage) - len(linkage.inputs)
        for chosen in islice(combinations(names, max(0, min(wanted, len(names)))), _MOST_TRIED):
            with_ratios = replace(linkage, ratios={name: ratios[name] for name in chosen})
            try:
                assur_groups(with_ratios)
            except DefinitionError:
                continue
            others = [name for name in names if name not in chosen]
            return with_ratios, [f'mimic of {name}: the loops move it' for name in others]
        return linkage, []

    def _make_input(self, name: str) -> Input:
        joint = self._skeleton.joints.get(name)
        if joint is None:
            raise self._file_error(f'--input {name}', 'is not part of a loop', self._one_of())
        if not isinstance(joint, RevoluteJoint):
            return Input(name, slider=joint.slider)
        links = self._skeleton.links
        if not {*links[joint.parent]} & {*links[joint.child]}:
            raise self._file_error(
                f'--input {name}', 'turns links that no pin joins', self._one_of(but=name)
            )
        return Input(name, joint.parent, joint.child)

    def _one_of(self, but: str = '') -> str:
        return f'name one of {list_names(each for each in self._skeleton.joints if each != but)}'

    def _body_frames(self) -> dict[str, tuple[complex, float]]:
        """Return position and angle of every body in the pose, in the frame of the root."""
        frames = {self._planar.root: (0j, 0.0)}
        for joint in self._planar.joints:
            value = self._pose[joint.name]
            if joint.mimics and joint.name not in self._told:
                value = joint.multiplier * self._pose[joint.mimics] + joint.offset
            place, angle = frames[joint.parent]
            place += rect(1.0, angle) * joint.place
            if joint.kind == 'P':
                place += rect(1.0, angle) * joint.axis * value
            else:
                angle += joint.axis.real * value
            frames[joint.child] = (place, angle)
        return frames

    def _check_met(self, frames: Mapping[str, tuple[complex, float]]) -> None:
        def frame_place(name: str) -> complex:
            frame = self._planar.frames[name]
            there, angle = frames[frame.body]
            return there + rect(1.0, angle) * frame.place

        size = max(
            (hypot(x.real, x.imag) for of in self._skeleton.links.values() for x in of.values()),
            default=0.0,
        )
        for closing in self._closings:
            first, *others = closing.frames
            for other in others:
                apart = frame_place(other) - frame_place(first)
                if closing.line:
                    frame = self._planar.frames[first]
                    _, angle = frames[frame.body]
                    apart = complex(0.0, (apart / frame.facing / rect(1.0, angle)).imag)
                if abs(apart) > _MET * size:
                    raise self._file_error(
                        f'--close {first}={other}',
                        f'these are {abs(apart):.3g} m apart {self._pose_text()}',
                        'give a pose in which they meet: --at JOINT=VALUE, once for each joint',
                    )

    def _pose_text(self) -> str:
        return 'in the pose' if self._told else 'where all joints are 0'


def _add_limits(linkage: Linkage, urdf: UrdfFile) -> Linkage:
    """Return a linkage with the joint limits of the robot."""

    def limits_of(name: str, turns: bool) -> Limits:
        limits = urdf.joints[name].limits if name in urdf.joints else NO_LIMITS
        if turns and limits.high - limits.low >= tau:
            # A range of a full turn or more does not limit an angle.
            return replace(limits, low=-inf, high=inf)
        return limits

    return replace(
        linkage,
        inputs=tuple(replace(one, limits=limits_of(one.joint, False)) for one in linkage.inputs),
        joints={
            name: replace(joint, limits=limits_of(name, isinstance(joint, RevoluteJoint)))
            for name, joint in linkage.joints.items()
        },
    )
