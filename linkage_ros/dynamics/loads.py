# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
The loads on a linkage, in addition to its drives, and the parts that they act on.

Points are named by link and point. SI units throughout.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from linkage_ros.errors import DefinitionError, listed, quoted
from linkage_ros.kinematics.linkage import GROUND, Linkage


@dataclass(frozen=True, slots=True)
class Spring:
    """
    A spring with a parallel damper, between points of two links.

    It pulls with k·(ℓ − ℓ0) + c·ℓ̇ at the length ℓ. If its ends coincide it has no direction and
    no force.

    Attributes
    ----------
    from_link, from_point, to_link, to_point
        Its ends.
    stiffness
        k, in [N/m].
    free_length
        ℓ0, in [m].
    damping
        c, in [N·s/m].
    name
        Its name in messages.

    """

    from_link: str
    from_point: str
    to_link: str
    to_point: str
    stiffness: float
    free_length: float
    damping: float = 0.0
    name: str = ''

    @property
    def ends(self) -> tuple[tuple[str, str], tuple[str, str]]:
        """Its ends, each a link and a point of it."""
        return (self.from_link, self.from_point), (self.to_link, self.to_point)

    def tension(self, length: float, growth: float) -> float:
        """Return the pulling force, in [N], for a length, in [m], and its rate, in [m/s]."""
        return self.stiffness * (length - self.free_length) + self.damping * growth


@dataclass(frozen=True, slots=True)
class Loads:
    """
    Gravity, springs and the inertia of the drive.

    Attributes
    ----------
    gravity
        Acceleration of gravity in the frame of the ground, in [m/s²].
    springs
        All springs.
    drive_inertia
        Inertia of each input's motor, seen at the input: in [kg·m²], or in [kg] for a slide.

    """

    gravity: tuple[float, float] = (0.0, 0.0)
    springs: tuple[Spring, ...] = ()
    drive_inertia: float = 0.0


@dataclass(frozen=True, slots=True)
class JointFriction:
    """
    The friction of a pin or slider.

    Attributes
    ----------
    viscous
        Of a pin in [N·m·s/rad], of a slider in [N·s/m].
    coulomb
        Of a pin in [N·m], of a slider in [N]; independent of the force in the joint.

    """

    viscous: float = 0.0
    coulomb: float = 0.0


@dataclass(frozen=True, slots=True)
class Friction:
    """
    Friction by the name of the pin or slider.

    A pin of three links or more has friction in each of its joints: between each of its links and
    the first link in `links` that has it.
    """

    joints: Mapping[str, JointFriction] = field(default_factory=dict)


def check_masses(linkage: Linkage) -> None:
    """
    Refuse a linkage in which a link that moves has no mass.

    Raises
    ------
    DefinitionError
        With the key ``masses`` of the linkage file.

    """
    for link in linkage.links:
        if link != GROUND and link not in linkage.masses:
            raise DefinitionError(
                'masses',
                f'link {quoted(link)} has no mass, and forces are asked for',
                f'add masses: {{{link}: {{mass: 0.1, center: [0, 0], inertia: 1.0e-5}}}} '
                'in [kg], [m] and [kg·m²]',
            )


def check_loads(linkage: Linkage, loads: Loads, friction: Friction | None = None) -> None:
    """
    Refuse loads and friction on parts that the linkage does not have.

    Raises
    ------
    DefinitionError
        With the key ``loads.springs.NAME`` (the number of the spring, from 1, if it has no name)
        or ``effects.friction.joints.NAME``.

    """
    for number, spring in enumerate(loads.springs, 1):
        key = f'loads.springs.{spring.name or number}'
        for link, point in spring.ends:
            if link not in linkage.links:
                raise DefinitionError(key, f'{quoted(link)} is not a link', _one_of(linkage.links))
            if point not in linkage.links[link]:
                raise DefinitionError(
                    key,
                    f'{quoted(point)} is not a point of {link!r}',
                    _one_of(linkage.links[link]),
                )
        if spring.from_link == spring.to_link:
            raise DefinitionError(
                key,
                f'both its ends lie on {spring.from_link!r}, so that nothing stretches it',
                'name points of two links',
            )
    carried = [point for points in linkage.links.values() for point in points]
    carried += [slider.point for slider in linkage.sliders.values() if not slider.block]
    pins = {point for point in carried if carried.count(point) > 1}
    for name in friction.joints if friction else ():
        if name not in pins and name not in linkage.sliders:
            raise DefinitionError(
                f'effects.friction.joints.{name}',
                f'{quoted(name)} is no pin or slider',
                _one_of({*pins, *linkage.sliders}),
            )
        if name in pins and name in linkage.sliders:
            raise DefinitionError(
                f'effects.friction.joints.{name}',
                f'{quoted(name)} names a pin and a slider',
                'give the slider another name',
            )


def _one_of(names: Iterable[str]) -> str:
    return f'name one of {listed(sorted(names))}'
