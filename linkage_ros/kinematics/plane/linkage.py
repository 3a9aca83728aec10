# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage: links with named points, pins, sliders, inputs and the joints to publish.

Lengths are in metres, angles in radians, masses in kilograms. A point named on two or more links
is a pin of these links.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any, ClassVar, Literal, TYPE_CHECKING

from linkage_ros.errors import DefinitionError, list_names

Point = tuple[float, float]

GROUND = 'ground'
"""The name of the link that does not move; its frame is the frame of the linkage."""

Side = Literal['left', 'right', 'ahead', 'behind']


@dataclass(frozen=True, slots=True)
class Slider:
    """
    A point of one link that stays on a line of another.

    Attributes
    ----------
    point
        Name of the point; not a point of ``along``.
    along
        Name of the link that carries the line.
    through
        Name of a point of ``along`` on the line; the slide is measured from it, in [m].
    direction
        Direction of the line in the frame of ``along``, any length but zero.
    block
        Name of the link that slides without turning against the line; '' if the link that carries
        the point may turn about it (a pin in a slot, a rod in a swivel).
    angle
        Angle of the block minus the angle of ``along``, in [rad].

    """

    point: str
    along: str
    through: str
    direction: Point
    block: str = ''
    angle: float = 0.0

    @property
    def unit(self) -> complex:
        """Return the direction as a unit vector."""
        direction = complex(*self.direction)
        return direction / abs(direction)


@dataclass(frozen=True, slots=True)
class Limits:
    """
    The limits of a joint of the machine, as in ``<limit>`` of a URDF; infinite means no limit.

    Attributes
    ----------
    low, high
        Range of the joint, in [rad] or [m].
    velocity
        Largest rate in either direction, in [rad/s] or [m/s].
    effort
        Largest torque or force in either direction, in [N·m] or [N].

    """

    low: float = -inf
    high: float = inf
    velocity: float = inf
    effort: float = inf

    @property
    def is_bounded(self) -> bool:
        """Whether the range of the joint is limited on any side."""
        return self.low > -inf or self.high < inf

    def __str__(self) -> str:
        return f'[{self.low:.6g}, {self.high:.6g}]'


NO_LIMITS = Limits()
"""The limits of a joint without limits in the file."""


@dataclass(frozen=True, slots=True)
class Input:
    """
    A driven joint, named ``joint``, with the limits of the machine's joint.

    Its value is the angle of ``child`` minus the angle of ``parent``, which share a pin, in [rad];
    or, if ``slider`` is named, the slide of that slider, in [m].
    """

    joint: str
    parent: str = ''
    child: str = ''
    slider: str = ''
    limits: Limits = NO_LIMITS

    @property
    def unit(self) -> str:
        """Return the unit of its value."""
        return 'm' if self.slider else 'rad'

    @classmethod
    def from_joint(cls, name: str, joint: RevoluteJoint | SlideJoint) -> Input:
        """Return a published joint as an input."""
        if isinstance(joint, SlideJoint):
            return cls(name, slider=joint.slider, limits=joint.limits)
        return cls(name, joint.parent, joint.child, limits=joint.limits)

    def as_joint(self) -> RevoluteJoint | SlideJoint:
        """Return it as a published joint."""
        if self.slider:
            return SlideJoint(self.slider, self.limits)
        return RevoluteJoint(self.parent, self.child, self.limits)


@dataclass(frozen=True, slots=True)
class RevoluteJoint:
    """
    A published angle, ``child`` minus ``parent``, in [rad], as in a URDF.

    Its whole turns are as they come, with ``turns`` added; or, if ``near`` is given, such that it
    is within half a turn of near[0] + near[1]·(first input) + near[2]·(second input) and so on.
    """

    unit: ClassVar = 'rad'

    parent: str
    child: str
    limits: Limits = NO_LIMITS
    near: tuple[float, ...] = ()
    turns: int = 0


@dataclass(frozen=True, slots=True)
class SlideJoint:
    """A published slide: the position of a slider's point along its line, in [m]."""

    unit: ClassVar = 'm'

    slider: str
    limits: Limits = NO_LIMITS


@dataclass(frozen=True, slots=True)
class Ratio:
    """
    How a joint follows another, as by gears, a belt or a rack: ratio·``of`` + offset.

    Attributes
    ----------
    of
        Name of the other joint: an input, or a published joint.
    ratio
        In [rad] or [m] of the joint for a [rad] or [m] of the other.
    offset
        Value of the joint where the others are at 0, in [rad] or [m].
    also
        In space, further joints that add to it, each with its ratio, as of a belt over a joint or
        of a differential. In the plane a joint between the outer links is the sum.

    """

    of: str
    ratio: float
    offset: float = 0.0
    also: Mapping[str, float] = field(default_factory=dict)

    @property
    def terms(self) -> dict[str, float]:
        """Return the ratio of each joint that is followed."""
        return {self.of: self.ratio, **self.also}

    def value_at(self, values: Mapping[str, float]) -> float:
        """Return the value of the joint at those of the joints that it follows."""
        total = self.ratio * values[self.of]
        for name, ratio in self.also.items():
            total += ratio * values[name]
        return total + self.offset

    @property
    def text(self) -> str:
        """Return what is followed, in words."""
        return ' and '.join(f'{name} by {ratio:g}' for name, ratio in self.terms.items())


def turn_ratios(ratios: Mapping[str, Ratio], names: Sequence[str]) -> dict[str, Ratio]:
    """
    Return the ratios with these joints as inputs: what they followed follows them.

    Raises
    ------
    DefinitionError
        If a joint follows other inputs only.

    """
    turned = dict(ratios)
    for name in names:
        follower = name
        chain = []
        while follower in turned:
            ratio = turned.pop(follower)
            of = next((term for term in ratio.terms if term not in names), '')
            if not of:
                others = list_names(ratio.terms)
                reason = f'and {others} are one freedom: the first follows the other'
                raise DefinitionError(name, reason, 'name a joint of another freedom')
            factor = ratio.terms[of]
            also = {term: -by / factor for term, by in ratio.terms.items() if term != of}
            chain.append((of, Ratio(follower, 1.0 / factor, -ratio.offset / factor, also)))
            follower = of
        turned |= chain
    return turned


@dataclass(frozen=True, slots=True)
class AssemblyPose:
    """The linkage as drawn, at some inputs; what it names determines the assembly."""

    inputs: tuple[float, ...]  # Of each input, in [rad] or [m]; the linkage starts there
    # Approximate places of points, in the frame of the ground, in [m]; points of links that no
    # dyad covers are the initial guess of their iteration.
    points: Mapping[str, Point]
    # Approximate angles of links to the ground, in [rad].
    angles: Mapping[str, float] = field(default_factory=dict)

    @property
    def is_drawn(self) -> bool:
        """Whether it says where links lie."""
        return bool(self.points or self.angles)


@dataclass(frozen=True, slots=True)
class Mass:
    """
    The mass of a link.

    Attributes
    ----------
    mass
        In [kg]; 0 for a massless link.
    center
        Centre of mass in the link's frame, in [m].
    inertia
        Moment of inertia about the centre of mass, in [kg·m²]; 0 for a point.

    """

    mass: float
    center: Point
    inertia: float


@dataclass(frozen=True, slots=True)
class PoseCorrections:
    """
    What is corrected in the pose in which a linkage in space is drawn.

    Attributes
    ----------
    open_by
        By how much the loops of the robot that it is read from do not close in the pose, in [m];
        None without a robot. What they miss, the pose is corrected by.
    turned_by
        By how much the directions of frames that these loops join differ there, in [rad].
    merged_by
        The largest distance between places that a closure takes for one, in [m].
    tilted_by
        The largest angle between axes that a closure takes for parallel, in [rad].
    beside_by
        The largest distance between the two ends of a pin of the robot along its axis, in [m].

    """

    open_by: float | None = None
    turned_by: float = 0.0
    merged_by: float = 0.0
    tilted_by: float = 0.0
    beside_by: float = 0.0


class JointedLinkage:
    """What linkages in plane and space have in common: inputs and published joints."""

    __slots__ = ()

    if TYPE_CHECKING:

        @property
        def inputs(self) -> tuple[Input, ...]: ...

        @property
        def joints(self) -> Mapping[str, RevoluteJoint | SlideJoint]: ...

    @property
    def named_joints(self) -> dict[str, RevoluteJoint | SlideJoint]:
        """Return all joints with a name in messages: the inputs, then the published ones."""
        return {driven.joint: driven.as_joint() for driven in self.inputs} | {**self.joints}

    @property
    def limits(self) -> dict[str, Limits]:
        """Return the limits of the joints that have any, by name, inputs first."""
        # An input that is also published has its limits as an input.
        of_inputs = {driven.joint: driven.limits for driven in self.inputs}
        named = {name: joint.limits for name, joint in self.named_joints.items()} | of_inputs
        return {name: limits for name, limits in named.items() if limits != NO_LIMITS}


@dataclass(frozen=True, slots=True)
class Linkage(JointedLinkage):
    """
    A planar linkage, as a linkage file says it.

    Attributes
    ----------
    links
        The points of each link, by name, in the link's own frame, in [m].
    inputs
        The driven joints.
    assembly
        For the pin or slider that closes a dyad, the side on which it lies.
    joints
        The published joints, in this order.
    sliders
        The sliders, by name.
    traced
        Names of points whose curves are recorded or drawn.
    pose
        The linkage as drawn at its start; it determines the assembly, if `assembly` does not.
    masses
        Masses by link name; given only for forces, and then for every link that moves.
    ratios
        By the name of a published joint, how it follows another joint.
    nominal
        The linkage without deviations, if this one has some; it determines the assembly and the
        change points that are passed.
    axes
        The names of the axes of its plane; those of a robot may be x and z.
    corrections
        What was corrected in the pose, if it was drawn in space.
    left_out
        What belongs to no loop of the robot that it is read from.

    """

    links: Mapping[str, Mapping[str, Point]]
    inputs: tuple[Input, ...]
    assembly: Mapping[str, Side]
    joints: Mapping[str, RevoluteJoint | SlideJoint]
    sliders: Mapping[str, Slider]
    traced: tuple[str, ...] = ()
    pose: AssemblyPose | None = None
    masses: Mapping[str, Mass] = field(default_factory=dict)
    ratios: Mapping[str, Ratio] = field(default_factory=dict)
    nominal: Linkage | None = field(default=None, compare=False, repr=False)
    axes: tuple[str, str] = ('x', 'y')
    corrections: PoseCorrections | None = field(default=None, compare=False, repr=False)
    left_out: tuple[str, ...] = field(default=(), compare=False, repr=False)

    @property
    def link_names(self) -> tuple[str, ...]:
        """Return all links."""
        return tuple(self.links)

    def without_limits(self, joints: Collection[str]) -> Linkage:
        """Return the linkage without the limits of some joints' ranges."""
        inputs = remove_limits({driven.joint: driven for driven in self.inputs}, joints)
        return replace(
            self, inputs=tuple(inputs.values()), joints=remove_limits(self.joints, joints)
        )

    @property
    def driven_joints(self) -> tuple[Input, ...]:
        """Return the inputs, then the joints that follow others, as if they were inputs."""
        followers = (Input.from_joint(name, self.joints[name]) for name in self.ratios)
        return (*self.inputs, *followers)


def remove_limits(parts: Mapping[str, Any], names: Collection[str]) -> dict[str, Any]:
    """Return joints by name; the ranges of those among ``names`` have no limits."""
    return {
        name: replace(part, limits=replace(part.limits, low=-inf, high=inf))
        if name in names
        else part
        for name, part in parts.items()
    }


def links_by_point(links: Mapping[str, Iterable[str]]) -> dict[str, list[str]]:
    """Return the links that carry each point, in the order of the file."""
    carriers: dict[str, list[str]] = {}
    for link, points in links.items():
        for point in points:
            carriers.setdefault(point, []).append(link)
    return carriers
