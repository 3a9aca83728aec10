# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Convert a planar URDF and its loop joints to links, pins, sliders and joints."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from re import fullmatch
from typing import NamedTuple

from linkage_ros.description import UrdfFile
from linkage_ros.errors import FileError
from linkage_ros.kinematics import GROUND, RevoluteJoint, SlideJoint, Slider
from linkage_ros.names import free_name
from linkage_ros.tools.models.planar import Closing, Frame, Planar, PlanarJoint

# The connections of two bodies of a URDF: joints between them, through frames without a body.
#
# URDF gives every joint a child link. Consecutive joints at one place, with no shape or mass
# between them, are one pin, or a pin in a slot::
#
#     R+  a pin      P  a block on its line      P R+  a pin in a slot      R+ P  a rod in a swivel

Symbol = tuple[tuple[tuple[str, float], ...], float]
"""An angle as a sum of joints with factors, and a constant, in [rad]."""

_PATTERNS = 'R+|P|PR+|R+P'

NEAR = 1e-9
"""Positions closer than this fraction of the linkage's size are one."""

_TREE, _CUT, _MARK, _ALONE = 8, 0, 1, 2
"""Sources of a point's name; the lowest wins."""


class Chain(NamedTuple):
    """Joints from one body to another, with no body between them."""

    parent: str
    child: str
    joints: tuple[PlanarJoint, ...]

    @property
    def sliding_joint(self) -> PlanarJoint | None:
        """Return the slide of the chain, or None."""
        return next((joint for joint in self.joints if joint.kind == 'P'), None)


def find_chains(planar: Planar, marked: Collection[str], near: float) -> list[Chain]:
    """
    Return the connections of the bodies.

    ``marked`` are bodies that carry a loop joint: they are kept even without shape or mass.
    Positions closer than ``near``, in [m], are one.
    """
    hung: dict[str, list[PlanarJoint]] = {}
    for joint in planar.joints:
        hung.setdefault(joint.parent, []).append(joint)

    def grow_chain(start: PlanarJoint) -> Iterator[tuple[PlanarJoint, ...]]:
        """Yield longer and longer chains that start with a joint."""
        chain = [start]
        yield tuple(chain)
        while True:
            body = chain[-1].child
            onward = hung.get(body, [])
            if body in planar.bodied or body in marked or len(onward) != 1:
                return
            if abs(onward[0].place) > near:
                return
            chain.append(onward[0])
            yield tuple(chain)

    made, ahead = [], [planar.root]
    for body in ahead:
        for joint in hung.get(body, []):
            whole = [
                found
                for found in grow_chain(joint)
                if fullmatch(_PATTERNS, ''.join(each.kind for each in found))
            ]
            made.append(Chain(body, whole[-1][-1].child, whole[-1]))
            ahead.append(made[-1].child)
    return made


def body_angles(planar: Planar) -> dict[str, Symbol]:
    """Return the angle of every body as a sum of joints."""
    angles: dict[str, Symbol] = {planar.root: ((), 0.0)}
    for joint in planar.joints:
        angles[joint.child] = angles[joint.parent]
        if joint.kind == 'R':
            angles[joint.child] = add_joint_angle(angles[joint.parent], joint)
    return angles


def add_joint_angle(symbol: Symbol, joint: PlanarJoint) -> Symbol:
    """Return the angle after a revolute joint."""
    terms = dict(symbol[0])
    sign = joint.axis.real
    name = joint.mimics or joint.name
    terms[name] = terms.get(name, 0.0) + sign * (joint.multiplier if joint.mimics else 1.0)
    constant = symbol[1] + (sign * joint.offset if joint.mimics else 0.0)
    return tuple(sorted((each, of) for each, of in terms.items() if of)), constant


# Points of bodies by position: a pin is one point that several bodies share.


class Points:
    """
    Points, in the order in which they are added.

    Positions on a body that are closer than ``near``, in [m], are one point.
    """

    def __init__(self, near: float) -> None:
        self._near = near
        self._same: list[int] = []
        self._found: list[tuple[str, complex]] = []
        self._hints: list[tuple[int, int, str]] = []

    def point_at(self, body: str, place: complex, hint: str = '', rank: int = 9) -> int:
        """Return the number of the point at a position of a body; a hint may become its name."""
        number = self.find_point(body, place)
        if number is None:
            number = len(self._found)
            self._found.append((body, place))
            self._same.append(number)
        if hint:
            self._hints.append((rank, number, hint))
        return number

    def find_point(self, body: str, place: complex) -> int | None:
        """Return the number of the point at a position, or None."""
        for index, (other, there) in enumerate(self._found):
            if other == body and abs(there - place) <= self._near:
                return index
        return None

    def suggest_name(self, number: int, name: str, rank: int) -> None:
        """Suggest a name for a point; the lowest rank wins."""
        self._hints.append((rank, number, name))

    def merge_points(self, one: int, other: int) -> int:
        """Merge two points into one pin."""
        kept, gone = self._same[one], self._same[other]
        self._same = [kept if of == gone else of for of in self._same]
        return one

    def name_points(
        self, bodies: Collection[str]
    ) -> tuple[dict[str, dict[str, complex]], list[str]]:
        """Return the points of each body by name, and the name of each number."""
        taken: dict[int, str] = {}
        for _, number, hint in sorted(self._hints, key=lambda hint: hint[:2]):
            point = self._same[number]
            if point not in taken:
                taken[point] = free_name(hint, taken.values())
        names = [taken.setdefault(number, f'point_{number + 1}') for number in self._same]
        links: dict[str, dict[str, complex]] = {body: {} for body in bodies}
        for name, (body, place) in zip(names, self._found, strict=True):
            if body in links:
                links[body][name] = place
        return links, names


class _SliderRail(NamedTuple):
    """A slider between bodies, with the numbers of its points."""

    point: int
    along: str
    through: int
    direction: complex
    block: str
    angle: float


@dataclass(slots=True)
class UrdfTopology:
    """The linkage elements of a URDF by name: points in [m], bodies, sliders, joints."""

    links: dict[str, dict[str, complex]] = field(default_factory=dict)
    bodies: dict[str, str] = field(default_factory=dict)
    sliders: dict[str, Slider] = field(default_factory=dict)
    joints: dict[str, RevoluteJoint | SlideJoint] = field(default_factory=dict)
    traced: tuple[str, ...] = ()


def urdf_topology(
    urdf: UrdfFile,
    planar: Planar,
    closings: Sequence[Closing],
    alone: dict[str, str],
) -> UrdfTopology:
    """
    Find the linkage elements of a URDF's loops; single frames are points, with their names.

    A FileError says that a linkage cannot have such a joint or closing.
    """
    return _Building(urdf, planar, closings, alone).build()


class _Building:
    def __init__(
        self,
        urdf: UrdfFile,
        planar: Planar,
        closings: Sequence[Closing],
        alone: dict[str, str],
    ) -> None:
        self._urdf, self._planar, self._closings, self._alone = urdf, planar, closings, alone
        places = [abs(joint.place) for joint in planar.joints]
        places += [abs(frame.place) for frame in planar.frames.values()]
        self.near = NEAR * (max(places, default=0.0) or 1.0)
        self._symbols = body_angles(planar)
        closing = {frame for each in closings for frame in each.frames}
        # A slide that ends in a frame gives the position of a slider's point, not a link.
        leaves = {j.child for j in planar.joints} - {j.parent for j in planar.joints}
        self._tips = {j.child: j for j in planar.joints if j.kind == 'P' and j.child in leaves}
        self._tips = {b: j for b, j in self._tips.items() if b not in planar.bodied}
        marked = {planar.frames[frame].body for frame in closing} - set(self._tips)
        self._chains = find_chains(planar, marked, self.near)
        self._points = Points(self.near)
        self._rails: dict[str, _SliderRail] = {}
        self._joints: dict[str, tuple[str, str] | str] = {}

    def build(self) -> UrdfTopology:
        kept = [self._planar.root]
        kept += [each.child for each in self._chains if each.child not in self._tips]
        for chain in self._chains:
            if chain.child not in self._tips:
                self._connect_body(chain, kept)
        for closing in self._closings:
            self._close_loop(closing)
        made = UrdfTopology(bodies=dict(self._link_names(kept)))
        names = {body: link for link, body in made.bodies.items()}
        for mark, body, place in self._planar.marks:
            number = self._points.find_point(body, place)
            if number is not None:
                self._points.suggest_name(number, mark, _MARK)
        traced = [
            self._points.point_at(frame.body, frame.place, self._alone[name], _ALONE)
            for name, frame in self._planar.frames.items()
            if name in self._alone
        ]
        points, called = self._points.name_points(kept)
        made.links = {names[body]: points[body] for body in kept}
        made.traced = tuple(dict.fromkeys(called[number] for number in traced))
        for name, rail in self._rails.items():
            made.sliders[name] = Slider(
                called[rail.point],
                names[rail.along],
                called[rail.through],
                (rail.direction.real, rail.direction.imag),
                names[rail.block] if rail.block else '',
                rail.angle if rail.block else 0.0,
            )
        order = [*self._urdf.start, *(n for n in self._urdf.order if n not in self._urdf.start)]
        for name in order:
            joint = self._joints.get(name)
            if isinstance(joint, str):
                made.joints[name] = SlideJoint(joint)
            elif isinstance(joint, tuple):
                made.joints[name] = RevoluteJoint(names[joint[0]], names[joint[1]])
        return made

    def _link_names(self, kept: Sequence[str]) -> Iterator[tuple[str, str]]:
        yield GROUND, kept[0]
        taken = {GROUND, *kept[1:]}
        for body in kept[1:]:
            name = body
            while name == GROUND or (name != body and name in taken):
                name = f'{name}_link'
            yield name, body

    def _connect_body(self, chain: Chain, kept: Sequence[str]) -> None:
        """Add the pin or slider that connects a body."""
        first, last = chain.joints[0], chain.joints[-1]
        at_parent = self._points.point_at(chain.parent, first.place, f'{last.name}_pin', _TREE)
        at_child = self._points.point_at(chain.child, 0j)
        self._find_turned_links(chain, kept)
        slide = chain.sliding_joint
        if slide is None:
            self._points.merge_points(at_parent, at_child)
            return
        if first is slide:
            block = chain.child if self._is_rigid(chain.parent, chain.child) else ''
            angle = self._symbols[chain.child][1] - self._symbols[chain.parent][1]
            rail = _SliderRail(at_child, chain.parent, at_parent, slide.axis, block, angle)
        else:
            # The rod slides: its position counts opposite to its direction of motion.
            block = chain.parent if self._is_rigid(chain.parent, chain.child) else ''
            angle = self._symbols[chain.parent][1] - self._symbols[chain.child][1]
            rail = _SliderRail(at_parent, chain.child, at_child, -slide.axis, block, angle)
        self._rails[slide.name] = rail
        self._joints[slide.name] = slide.name

    def _find_turned_links(self, chain: Chain, kept: Sequence[str]) -> None:
        """Find the two links of the angle that each joint of a chain measures."""
        symbol = self._symbols[chain.parent]
        for joint in chain.joints:
            if joint.kind != 'R':
                continue
            before, symbol = symbol, add_joint_angle(symbol, joint)
            if joint.mimics and len(chain.joints) > 1:
                continue  # it turns an auxiliary frame until it is parallel to a link
            ends = []
            for where, likely in ((before, chain.parent), (symbol, chain.child)):
                found = [likely, *kept]
                ends.append(
                    next((b for b in found if _is_same_angle(self._symbols[b], where)), '')
                )
            if not all(ends):
                raise FileError(
                    self._urdf.file,
                    f'joint {joint.name}',
                    'turns between frames that are parallel to no link',
                    'give these frames a body, or leave out what they hold',
                )
            parent, child = ends if joint.axis.real > 0.0 else reversed(ends)
            self._joints[joint.name] = (parent, child)

    def _is_rigid(self, one: str, other: str) -> bool:
        return self._symbols[one][0] == self._symbols[other][0]

    def _close_loop(self, closing: Closing) -> None:
        frames = [self._planar.frames[name] for name in closing.frames]
        tips = [frame for frame in frames if frame.body in self._tips]
        if closing.line:
            self._add_slider(closing, frames[0], frames[1], frames[0].facing, '')
            return
        if len(tips) > 1 or (tips and len(frames) > 2):
            raise FileError(
                self._urdf.file,
                f'--close {"=".join(closing.frames)}',
                'closes a slide that ends in a frame by more than one link',
                'close it by one',
            )
        if tips:
            joint = self._tips[tips[0].body]
            other = next(frame for frame in frames if frame is not tips[0])
            line = Frame(joint.parent, joint.place + tips[0].place, joint.axis)
            # Another body at the tip may turn about it: the tip becomes a point.
            self._add_slider(closing, line, other, joint.axis, joint.name)
            return
        first, *others = frames
        one = self._points.point_at(first.body, first.place, closing.name, _CUT)
        for other in others:
            if other.body == first.body:
                raise FileError(
                    self._urdf.file,
                    f'--close {"=".join(closing.frames)}',
                    f'both are fixed to {first.body!r}',
                    'name frames of two links between which something moves',
                )
            self._points.merge_points(one, self._points.point_at(other.body, other.place))

    def _add_slider(
        self, closing: Closing, line: Frame, point: Frame, direction: complex, joint: str
    ) -> None:
        """Add a slider that connects no body of the tree."""
        name = joint or closing.name
        at = self._points.point_at(point.body, point.place, f'{closing.name}_point', _TREE)
        through = self._points.point_at(line.body, line.place, f'{closing.name}_line', _TREE)
        block = point.body if self._is_rigid(line.body, point.body) else ''
        angle = self._symbols[point.body][1] - self._symbols[line.body][1]
        self._rails[name] = _SliderRail(at, line.body, through, direction, block, angle)
        if joint:
            self._joints[joint] = joint


def _is_same_angle(one: Symbol, other: Symbol) -> bool:
    return one[0] == other[0] and abs(one[1] - other[1]) < NEAR
