# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The loads on a linkage, in addition to its drives, and the parts that they act on.

Points are named by link and point. SI units throughout.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TYPE_CHECKING

from linkage_ros.description import choice, components, each_part, number, number_rows, text
from linkage_ros.errors import DefinitionError, list_names, quote
from linkage_ros.kinematics import GROUND, Linkage

if TYPE_CHECKING:
    from linkage_ros.kinematics import SpaceLinkage

GREATEST_LOAD, STIFFEST = 1e9, 1e12
"""Bounds on loads, in [N], [N·m], [m] and [kg·m²], and on stiffness and damping, in SI units."""

_EFFORT = 'N·m or N'
_PART: Mapping[str, Any] = {'default': (), 'most': GREATEST_LOAD}
"""Default and bound of each table of a load."""


@dataclass(frozen=True, slots=True)
class Spring:
    """
    A spring with a parallel damper, between points of two links.

    It pulls with k·(ℓ − ℓ0) + c·ℓ̇ at the length ℓ. If its ends coincide it has no direction and
    no force.
    """

    # Its ends.
    from_link: str
    from_point: str
    to_link: str
    to_point: str
    stiffness: float  # k, in [N/m]
    free_length: float  # ℓ0, in [m]
    damping: float = 0.0  # c, in [N·s/m]
    name: str = ''  # Its name in messages

    @property
    def ends(self) -> tuple[tuple[str, str], tuple[str, str]]:
        """Its ends, each a link and a point of it."""
        return (self.from_link, self.from_point), (self.to_link, self.to_point)

    def tension(self, length: float, growth: float) -> float:
        """Return the pulling force, in [N], for a length, in [m], and its rate, in [m/s]."""
        return self.stiffness * (length - self.free_length) + self.damping * growth


@dataclass(frozen=True, slots=True)
class JointSpring:
    """A spring at a joint, with a parallel damper."""

    stiffness: float = number('stiffness', unit='N·m/rad or N/m', least=0.0, most=STIFFEST)
    free: float = number(
        'angle or slide at which it has no force', 0.0, unit='rad or m', least=-1e6, most=1e6
    )
    damping: float = number('damping', 0.0, unit='N·m·s/rad or N·s/m', least=0.0, most=STIFFEST)


@dataclass(frozen=True, slots=True)
class SoftStop:
    """A stop at the limits of a joint: a spring with a parallel damper."""

    stiffness: float = number('stiffness', unit='N·m/rad or N/m', above=0.0, most=STIFFEST)
    damping: float = number('damping', 0.0, unit='N·m·s/rad or N·s/m', least=0.0, most=STIFFEST)


@dataclass(frozen=True, slots=True)
class JointLoad:
    """An effort on a joint: the sum of a constant and tables, each linear between its rows."""

    constant: float = number(
        'constant part', 0.0, unit=_EFFORT, least=-GREATEST_LOAD, most=GREATEST_LOAD
    )
    over_time: tuple[tuple[float, float], ...] = number_rows(
        'part over the time since the first pose', ('time [s]', f'effort [{_EFFORT}]'), **_PART
    )
    over_position: tuple[tuple[float, float], ...] = number_rows(
        'part over the position of the joint',
        ('position [rad or m]', f'effort [{_EFFORT}]'),
        **_PART,
    )
    over_rate: tuple[tuple[float, float], ...] = number_rows(
        'part over the rate of the joint', ('rate [rad/s or m/s]', f'effort [{_EFFORT}]'), **_PART
    )


@dataclass(frozen=True, slots=True)
class PointLoad:
    """A force on a point of a link: the sum of a constant and tables."""

    direction: tuple[float, ...] = components(
        'its direction: [x, y], in space [x, y, z]', unit='', most=1e6
    )
    frame: str = choice('frame of the direction', ('ground', 'link'), 'ground')
    constant: float = number(
        'constant part', 0.0, unit='N', least=-GREATEST_LOAD, most=GREATEST_LOAD
    )
    over_time: tuple[tuple[float, float], ...] = number_rows(
        'part over the time since the first pose', ('time [s]', 'force [N]'), **_PART
    )
    over_position: tuple[tuple[float, float], ...] = number_rows(
        'part over the position of the input', ('position [rad or m]', 'force [N]'), **_PART
    )
    over_rate: tuple[tuple[float, float], ...] = number_rows(
        'part over the rate of the input', ('rate [rad/s or m/s]', 'force [N]'), **_PART
    )


@dataclass(frozen=True, slots=True)
class WrenchLoad:
    """A force and a torque on a link, from the messages of a topic."""

    topic: str = text(
        'topic of geometry_msgs/WrenchStamped; absent, wrenches/LINK, of one of several linkages '
        'wrenches/NAME_LINK',
        '',
    )
    point: str = text(
        "point of the link at which the force acts; absent, the origin of the link's frame", ''
    )
    frame: str = choice('frame of the force', ('ground', 'link'), 'ground')
    max_age: float = number(
        'validity of a message, unless another one comes; then the load is 0',
        0.1,
        unit='s',
        least=1e-6,
        most=3600.0,
    )


@dataclass(frozen=True, slots=True)
class AppliedLoads:
    """Loads on joints, points and links."""

    joint_springs: Mapping[str, JointSpring] = each_part(
        'springs at joints', 'any_joint', JointSpring
    )
    stops: Mapping[str, SoftStop] = each_part(
        'stops that yield, at the limits of joints; without, a limit is a hard stop',
        'any_joint',
        SoftStop,
    )
    efforts: Mapping[str, JointLoad] = each_part('efforts on joints', 'any_joint', JointLoad)
    forces: Mapping[str, PointLoad] = each_part('forces on points', 'point', PointLoad)
    wrenches: Mapping[str, WrenchLoad] = each_part(
        'forces and torques on links, as messages give them', 'link', WrenchLoad
    )

    def __bool__(self) -> bool:
        """Return whether there are any."""
        constant = self.joint_springs or self.stops or self.efforts or self.forces
        return bool(constant or self.wrenches)

    @property
    def changes_with_time(self) -> bool:
        """Whether a load changes with the time."""
        efforts, forces = self.efforts.values(), self.forces.values()
        return any(load.over_time for load in efforts) or any(load.over_time for load in forces)


@dataclass(frozen=True, slots=True)
class Loads:
    """Gravity, springs, the inertia of the drive, and the loads on joints and points."""

    # Acceleration of gravity in the frame of the ground, in [m/s²]; in space of three numbers.
    gravity: tuple[float, ...] = (0.0, 0.0)
    springs: tuple[Spring, ...] = ()  # All springs
    # Inertia of each input's motor, seen at the input: in [kg·m²], or in [kg] for a slide.
    drive_inertia: float = 0.0
    # Springs, stops and efforts of joints, forces on points, and wrenches on links.
    applied: AppliedLoads = field(default_factory=AppliedLoads)

    @property
    def without_masses(self) -> bool:
        """Whether there are loads, and none of them is a weight."""
        loaded = self.springs or self.drive_inertia or self.applied
        return bool(loaded) and not any(self.gravity)


@dataclass(frozen=True, slots=True)
class JointFriction:
    """Friction of one pin or slider."""

    viscous: float = number(
        'for each unit of rate', 0.0, unit='N·m·s/rad or N·s/m', least=0.0, most=GREATEST_LOAD
    )
    coulomb: float = number('at any rate', 0.0, unit='N·m or N', least=0.0, most=GREATEST_LOAD)
    breakaway: float = number(
        'at rest, if it is more than coulomb', 0.0, unit='N·m or N', least=0.0, most=GREATEST_LOAD
    )
    stribeck: float = number(
        'rate at which what breakaway adds has fallen to 1/e; 0: it acts at rest only',
        0.0,
        unit='rad/s or m/s',
        least=0.0,
        most=1e6,
    )
    coefficient: float = number(
        'of friction by the force in the joint',
        0.0,
        least=0.0,
        most=10.0,
    )
    radius: float = number(
        'of the pin, if there is a coefficient', 0.0, unit='m', least=0.0, most=100.0
    )

    @property
    def breakaway_excess(self) -> float:
        """Return how much more it is at rest, in [N·m] or [N]."""
        return max(0.0, self.breakaway - self.coulomb)

    @property
    def holding(self) -> float:
        """Return what holds the joint at rest, in [N·m] or [N]."""
        return self.coulomb + self.breakaway_excess

    @property
    def is_dry(self) -> bool:
        """Return whether there is more than viscous friction."""
        return bool(self.coulomb or self.breakaway or self.coefficient)


@dataclass(frozen=True, slots=True)
class Friction:
    """
    Friction by the name of the pin or slider.

    A pin of three links or more has friction in each of its joints: between each of its links and
    the first link in `links` that has it.
    """

    joints: Mapping[str, JointFriction] = field(default_factory=dict)
    holds: bool = False
    """Whether friction carries the load at rest as far as it can, and the effort is the rest."""

    @property
    def load_dependent_joint(self) -> str:
        """Return the first joint whose friction grows with the force in it; '' without one."""
        return next((name for name, joint in self.joints.items() if joint.coefficient), '')


def check_masses(linkage: Linkage | SpaceLinkage, loads: Loads) -> None:
    """
    Refuse a linkage in which a link that moves has no mass; the error has the key ``masses``.

    Loads other than gravity act on a linkage without any masses, too.
    """
    if not linkage.masses and loads.without_masses:
        return
    for link in linkage.link_names:
        if link != GROUND and link not in linkage.masses:
            body = (
                '{mass: 0.1, center: [0, 0], inertia: 1.0e-5}'
                if isinstance(linkage, Linkage)
                else '{mass: 0.1, center: [0, 0, 0], inertia: [1e-5, 0, 0, 1e-5, 0, 1e-5]}'
            )
            raise DefinitionError(
                'masses',
                f'link {quote(link)} has no mass, and forces are asked for',
                f'add masses: {{{link}: {body}}} '
                'in [kg], [m] and [kg·m²]; for a massless link write {mass: 0}',
            )


def check_vector(linkage: Linkage | SpaceLinkage, key: str, vector: Sequence[float]) -> None:
    """Refuse a vector that has not as many coordinates as the linkage has directions."""
    planar = isinstance(linkage, Linkage)
    axes, moves = ('[x, y]', 'planar') if planar else ('[x, y, z]', 'spatial')
    if len(vector) != axes.count(',') + 1:
        numbers = ', '.join(f'{number:g}' for number in vector)
        raise DefinitionError(key, f'[{numbers}], and the linkage is {moves}', f'write {axes}')


def check_loads(
    linkage: Linkage | SpaceLinkage, loads: Loads, friction: Friction | None = None
) -> None:
    """
    Refuse loads and friction on parts that the linkage does not have.

    The error has the key ``loads.gravity``, ``loads.springs.NAME`` (the number of the spring, from
    1, if it has no name) or ``effects.friction.joints.NAME``.
    """
    if any(loads.gravity):
        check_vector(linkage, 'loads.gravity', loads.gravity)
    for count, spring in enumerate(loads.springs, 1):
        key = f'loads.springs.{spring.name or count}'
        for link, end in spring.ends:
            if link not in linkage.links:
                raise DefinitionError(key, f'{quote(link)} is not a link', _one_of(linkage.links))
            if end not in linkage.links[link]:
                raise DefinitionError(
                    key,
                    f'{quote(end)} is not a point of {link!r}',
                    _one_of(linkage.links[link]),
                )
        if spring.from_link == spring.to_link:
            raise DefinitionError(
                key,
                f'both its ends lie on {spring.from_link!r}, so that nothing stretches it',
                'name points of two links',
            )
    if friction is not None and (friction.joints or friction.holds):
        _check_friction(linkage, friction)


def _check_friction(linkage: Linkage | SpaceLinkage, friction: Friction) -> None:
    if not isinstance(linkage, Linkage):
        _check_friction_in_space(linkage, friction)
        return
    carried = [name for names in linkage.links.values() for name in names]
    carried += [slider.point for slider in linkage.sliders.values() if not slider.block]
    pins = {name for name in carried if carried.count(name) > 1}
    for name, joint in friction.joints.items():
        key = f'effects.friction.joints.{name}'
        if name not in pins and name not in linkage.sliders:
            raise DefinitionError(
                key,
                f'{quote(name)} is not a pin or slider',
                _one_of({*pins, *linkage.sliders}),
            )
        if name in pins and name in linkage.sliders:
            raise DefinitionError(
                key, f'{quote(name)} names a pin and a slider', 'give the slider another name'
            )
        if name in linkage.sliders and joint.radius:
            raise DefinitionError(
                f'{key}.radius', f'{quote(name)} is a slider, which has none', 'leave it out'
            )
        if name in pins:
            _check_radius(name, joint)
    _check_holds(friction)


def _check_radius(name: str, joint: JointFriction) -> None:
    if bool(joint.coefficient) != bool(joint.radius):
        present, missing = (
            ('coefficient', 'radius') if joint.coefficient else ('radius', 'coefficient')
        )
        raise DefinitionError(
            f'effects.friction.joints.{name}.{present}',
            f'friction by the force in a pin needs both, and {missing} is missing',
            f'write {missing} too',
        )


def _check_holds(friction: Friction) -> None:
    if friction.holds and friction.load_dependent_joint:
        raise DefinitionError(
            'effects.friction.holds',
            f'at rest the force in {quote(friction.load_dependent_joint)} has no certain value, '
            'and neither '
            'has its friction',
            'leave it out, or write breakaway instead of coefficient',
        )


def _check_friction_in_space(linkage: SpaceLinkage, friction: Friction) -> None:
    """Refuse friction of what is not a joint, or by a force that a joint does not bear."""
    known = (*linkage.driven, *(name for name in linkage.published if name not in linkage.driven))
    for name, joint in friction.joints.items():
        key = f'effects.friction.joints.{name}'
        if name not in known:
            raise DefinitionError(
                key, f'{quote(name)} is neither an input nor a published joint', _one_of(known)
            )
        if name in linkage.hinges:
            _check_radius(name, joint)
        elif joint.radius:
            raise DefinitionError(
                f'{key}.radius', f'{quote(name)} slides, and has none', 'leave it out'
            )
        elif joint.coefficient and name in linkage.struts:
            raise DefinitionError(
                f'{key}.coefficient',
                f'{quote(name)} is a strut, which bears no force across its line',
                'write coulomb or viscous instead',
            )
    _check_holds(friction)


def _one_of(names: Iterable[str]) -> str:
    return f'name one of {list_names(sorted(names))}'
