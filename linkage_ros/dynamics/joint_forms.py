# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What the joints of a linkage transmit: the units of their forces and moments, in plane and space.

===========  =====================================  ==========================
joint        forces                                 moments
===========  =====================================  ==========================
pin          two                                    none
slider       across its line                        one
hinge        three                                  two, across its axis
slide        two, across its axis                   three
ball         three                                  none
===========  =====================================  ==========================

A strut transmits the force of its drive alone. A rod that may spin is held by a moment about its
own axis, which is 0: so each link has as many equations as numbers of a motion.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics import (
    balls_of,
    CarriedPoints,
    cross,
    GROUND,
    GROUND_FRAME,
    length,
    minus,
    PlanarClosure,
    Position,
    RevoluteJoint,
    scale,
    unit_across,
    unit_vector,
    Velocity,
    ZERO,
)

if TYPE_CHECKING:
    from linkage_ros.kinematics import SpaceClosure, SpatialJoint, Vector

WHOLE, ACROSS, ALONG, NONE = 'whole', 'across', 'along', ''
"""What of a force or a moment is certain: all, or its part across or along the joint's axis."""

Direction = int | Callable[[Position], Any]
"""A unit vector in the frame of the ground; a number is that of an axis of the ground."""


_ALL: tuple[Direction, ...] = (0, 1, 2)


class Action(NamedTuple):
    """A unit of a force or moment on one link; the opposite acts on the other."""

    link: str
    to: str
    direction: Direction
    joint: int = -1  # The joint at whose place a force acts; −1 of a moment


class LinkTurn(NamedTuple):
    """A link under a torque about an axis."""

    link: str
    rate: Callable[[Velocity, Position], float]  # About the axis, in [rad/s]
    axis: Direction  # A unit vector in the frame of the ground

    def lever(self, velocity: Velocity, position: Position, _moved: Sequence[Any]) -> float:
        """Return the rate of the link about the axis, in [rad/s]."""
        return self.rate(velocity, position)


class JointForm(NamedTuple):
    """What a joint transmits; the force of ``to`` on ``link`` counts."""

    name: str
    link: str
    to: str
    point: tuple[str, Any]  # Its place: a link and the point on it, as `point_tracker` takes it
    forces: tuple[Direction, ...]
    moments: tuple[Direction, ...]
    slides: bool = False
    axis: Direction | None = None  # About or along which it moves; None for a ball

    def actions(self, number: int) -> list[Action]:
        """Return a unit of each force and moment; ``number`` is that of the joint."""
        forces = [Action(self.link, self.to, way, number) for way in self.forces]
        return forces + [Action(self.link, self.to, way) for way in self.moments]

    def motion(self, number: int) -> Action:
        """Return a unit of effort in the direction in which it moves."""
        assert self.axis is not None
        return Action(self.link, self.to, self.axis, number if self.slides else -1)


class JointForms(NamedTuple):
    """The joints of a linkage, and what its drives, ratios and loads on joints act on."""

    links: tuple[str, ...]  # Those that move
    joints: tuple[JointForm, ...]
    efforts: Mapping[str, Action]  # A unit of effort on each driven, published or following joint
    spins: tuple[Action, ...] = ()  # What holds the spin of rods


def planar_forms(closure: PlanarClosure) -> JointForms:
    """Return what the joints of a planar linkage transmit."""
    linkage, structure = closure.linkage, closure.structure
    joints = []
    for joint in structure.joints:
        ends, links = (joint.name, joint.link, joint.to), structure.links
        if joint.kind == 'R':
            point = joint.link, complex(*links[joint.link][joint.name])
            joints.append(JointForm(*ends, point, (0, 1), (), axis=0))
            continue
        slider, along = linkage.sliders[joint.name], closure.angles[joint.to]
        direction = complex(*slider.direction)
        unit = along.unit * direction / abs(direction)
        point = joint.link, complex(*links[joint.link][slider.point])
        ways = _turned_line(along.coordinate, unit, 1j), _turned_line(along.coordinate, unit)
        joints.append(JointForm(*ends, point, ways[:1], (0,), slides=True, axis=ways[1]))
    sliders = {joint.name: n for n, joint in enumerate(joints) if joint.slides}
    efforts = {
        name: Action(joint.child, joint.parent, 0)
        if isinstance(joint, RevoluteJoint)
        else joints[sliders[joint.slider]].motion(sliders[joint.slider])
        for name, joint in (
            *((given.joint, given.as_joint()) for given in linkage.inputs),
            *linkage.joints.items(),
        )
    }
    return JointForms(
        tuple(link for link in structure.links if link != GROUND), tuple(joints), efforts
    )


def planar_bar(
    closure: PlanarClosure, link: str, near: JointForm, far: JointForm
) -> Callable[[Position], complex]:
    """Return the direction on a link from one of its pins to another."""
    points, angle = closure.linkage.links[link], closure.angles[link]
    between = complex(*points[far.name]) - complex(*points[near.name])
    return _turned_line(angle.coordinate, angle.unit * between / abs(between))


def _turned_line(
    coordinate: int, unit: complex, by: complex | None = None
) -> Callable[[Position], complex]:
    """Return the direction of a line that a coordinate turns, or what ``by`` makes of it."""

    def direction(position: Position) -> complex:
        along = unit_vector(position.state.coordinates[coordinate]) * unit
        return along if by is None else by * along

    return direction


def spatial_forms(closure: SpaceClosure, rubbing: Collection[int]) -> JointForms:
    """
    Return what the joints of a linkage in space transmit.

    First come hinges and slides, then struts, then balls. Joints with the numbers ``rubbing``
    transmit first what presses on their guide: the forces across their axes.
    """
    linkage = closure.linkage
    carried = CarriedPoints(linkage, closure.scale)
    joints = [
        _spatial_form(closure, name, joint, number in rubbing)
        for number, (name, joint) in enumerate(linkage.pair_joints.items())
    ]
    for name, (one, other) in linkage.struts.items():
        links = [carried.carriers[carried.same[end]][0] for end in (other, one)]
        ends = [(link, linkage.points[end]) for link, end in zip(links, (other, one), strict=True)]
        along = _strut_direction(closure, ends)
        link, to = links
        joints.append(JointForm(name, link, to, ends[0], (), (), slides=True, axis=along))
    efforts = {joint.name: joint.motion(number) for number, joint in enumerate(joints)}
    for point, first, link in balls_of(linkage, carried):
        holder = next((one for one in (first, link) if one not in closure.idle), first)
        place = holder, scale(closure.scale, carried.places[point])
        name = next(name for name in linkage.points if carried.same[name] == point)
        joints.append(JointForm(name, link, first, place, (0, 1, 2), ()))
    spins = tuple(
        Action(link, GROUND, _strut_direction(closure, _rod_ends(closure, link)))
        for link in closure.idle
    )
    spins += tuple(efforts[name] for name in closure.held)
    return JointForms(linkage.link_names[1:], tuple(joints), efforts, spins)


def spatial_bar(
    closure: SpaceClosure, link: str, near: JointForm, far: JointForm
) -> Callable[[Position], Vector]:
    """Return the direction on a link from one of its joints to another, where nearest."""
    import numpy as np  # local import: few scenes

    hinges = closure.linkage.hinges
    places = [np.array(joint.point[1]) for joint in (near, far)]
    axes = [np.array(hinges[joint.name].axis if joint.axis else ZERO) for joint in (near, far)]
    # The least steps along both axes that lead to the shortest bar.
    steps, *_ = np.linalg.lstsq(
        np.transpose(axes) * (-1.0, 1.0), places[0] - places[1], rcond=None
    )
    start, end = (
        tuple((place + step * axis).tolist())
        for place, step, axis in zip(places, steps, axes, strict=True)
    )
    return _strut_direction(closure, [(link, end), (link, start)])


def _spatial_form(closure: SpaceClosure, name: str, joint: SpatialJoint, rubs: bool) -> JointForm:
    linkage = closure.linkage
    axis = scale(1.0 / length(joint.axis), joint.axis)
    x = unit_across(axis)
    along = closure.carried_vector(joint.parent, axis)
    ends = name, joint.child, joint.parent
    across = tuple(_carried_direction(closure, joint.parent, way) for way in (x, cross(axis, x)))
    if name in linkage.slides:
        points = linkage.links.get(joint.child, ())
        at = linkage.points[points[0]] if points else joint.at
        return JointForm(*ends, (joint.child, at), across, _ALL, slides=True, axis=along)
    forces = (*across, along) if rubs else _ALL
    carrier = GROUND if joint.parent == GROUND else joint.child
    return JointForm(*ends, (carrier, joint.at), forces, across, axis=along)


def _carried_direction(closure: SpaceClosure, link: str, vector: Vector) -> Direction:
    """Return a direction that a link turns; its sign does not matter."""
    if link == GROUND:
        for number, axis in enumerate(GROUND_FRAME[:3]):
            if tuple(map(abs, vector)) == axis:
                return number
    return closure.carried_vector(link, vector)


def _rod_ends(closure: SpaceClosure, link: str) -> list[tuple[str, Vector]]:
    axis = closure.rod_axis(link)
    return [(link, axis.end), (link, axis.start)]


def _strut_direction(
    closure: SpaceClosure, ends: list[tuple[str, Vector]]
) -> Callable[[Position], Vector]:
    """Return the direction from the second of two points to the first one."""
    tracker = closure.point_tracker(ends)

    def direction(position: Position) -> Vector:
        end, start = tracker.places(position)
        along = minus(end, start)
        return scale(1.0 / length(along), along)

    return direction
