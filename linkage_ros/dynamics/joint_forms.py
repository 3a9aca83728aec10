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

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from linkage_ros.kinematics import (
    GROUND,
    PlanarClosure,
    Position,
    RevoluteJoint,
    unit_vector,
    Velocity,
)

WHOLE, ACROSS, ALONG, NONE = 'whole', 'across', 'along', ''
"""What of a force or a moment is certain: all, or its part across or along the joint's axis."""

Direction = int | Callable[[Position], Any]
"""A unit vector in the frame of the ground; a number is that of an axis of the ground."""


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
            *((driven.joint, driven.as_joint()) for driven in linkage.inputs),
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
