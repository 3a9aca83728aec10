# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Compliance and clearance: the displacement of the published joints under the forces in the linkage.

`compliance`: links stretch under the axial force that they carry.

A link between two pins P and Q, in space two balls or hinges, is a bar of axial stiffness k =
E·A/L: under the axial force N, positive in tension, it is longer by N/k (Hooke's law; S. P.
Timoshenko, Strength of Materials, ch. I). With u the unit vector from P to Q, and F the force on
the link in each of its pins, inertia included::

    N = ½·(F_Q − F_P)·u

So each end bears half of the loads between the pins: weight, inertia and springs. The force is
computed for the rigid linkage. The displacement of the published joints is computed to first
order, with fixed inputs: valid for stretches that are small against the links, with an error of
the order of their square. The model is quasi-static: the stretch adds no vibration, and the rates
belong to the rigid linkage. In space the bar of a hinge begins where its axis is nearest to the
other end.

`clearance`: a pin is smaller than its hole, and the force presses it to one side of the hole.

While pin and hole touch, a massless link between their centres joins them. Its length is the
radial play c, and it lies along the force that it carries (S. W. E. Earles and C. L. S. Wu, Motion
analysis of a rigid-link mechanism with clearance at a bearing, using Lagrangian mechanics and
digital computation, 1973; P. Flores, J. Ambrósio, J. C. P. Claro and H. M. Lankarani, Kinematics
and Dynamics of Multibody Systems with Imperfect Joints, 2008). It is in tension: the centre of the
hole or pin of ``link`` is displaced from the centre at ``to`` by::

    δ = −c·F/|F|              F: the force that ``to`` exerts on ``link``

so a link that hangs in its pin hangs lower by c. In a ball F is the whole force; in a hinge it is
the part across the axis, and the play along the axis and the tilt of the pin in its hole are left
out. In a pin of three links or more, each link is
displaced in this way from the first one that ``links`` names on the pin.

The force is computed for the linkage without play. The displacement of the published joints is
computed to first order, with fixed inputs; its error is of the order of the square of the play.
Contact is never lost: where a force reverses, the pin is on the other side at once. The model is
quasi-static: the rates do not contain the play. A pin whose force is below 1e-12 of the largest in
the linkage is not displaced.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import hypot
from typing import Any, NamedTuple

from linkage_ros.description import each_part, Number
from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics import call, Position
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.effect import MechanismEffect
from linkage_ros.stages.effects.stage import MechanismState, Stage, with_deflection

_STIFFEST = 1e15

_SMALLEST = 1e-12
"""Below this fraction of the largest force, a force is rounding error without a direction."""


@dataclass(frozen=True, slots=True)
class ComplianceEffect(MechanismEffect):
    """Links that stretch under their axial force."""

    links: Mapping[str, float] = each_part(
        'axial stiffness of links with two pins; the other links are rigid',
        'link',
        Number('axial stiffness E·A/L', 'N/m', above=0.0, most=_STIFFEST),
        required=True,
    )

    needs = ('pin_forces',)
    needs_forces = True
    is_compiled = True
    sample = '{links: {coupler: 1.0e+7}}'

    def stage(self, context: Context) -> Stage:
        """Build the stage; raise `DefinitionError` if a link has not exactly two pins."""
        forces = context.reactions
        forces.check_deflections('compliance')
        bars = tuple(_make_bar(context, link, k) for link, k in self.links.items())
        vectors, count = context.mechanics.model.vectors, len(forces.joints)
        shift_of = forces.joint_deflections

        def compliance(motion: MechanismState) -> MechanismState:
            position, reactions = motion.position, motion.reactions
            if not reactions:
                return motion
            offsets = [vectors.zero] * count
            for direction, halves, far, softness in bars:
                along = direction(position)
                tension = 0.0
                for joint, half in halves:
                    tension += half * vectors.dot(forces.force_of(reactions[joint]), along)
                stretch = vectors.scale(tension * softness, along)
                # The rigid position of the far pin is short of its real position.
                for joint, sign in far:
                    offsets[joint] = vectors.minus(offsets[joint], vectors.scale(sign, stretch))
            moved = shift_of(position, offsets)
            return motion if moved is None else with_deflection(motion, moved)

        return compliance


class _Bar(NamedTuple):
    """A link between two pins, near and far."""

    direction: Callable[[Position], Any]  # A unit vector from the near pin to the far one
    # Joints by index, with the factor of their axial force in the tension.
    halves: tuple[tuple[int, float], ...]
    # Joints of the far pin by index; 1 where the link is the joint's ``link``, −1 where ``to``.
    far: tuple[tuple[int, float], ...]
    compliance: float  # 1/k, in [m/N]


@dataclass(frozen=True, slots=True)
class ClearanceEffect(MechanismEffect):
    """Pins displaced by their radial play, along the force that they carry."""

    pins: Mapping[str, float] = each_part(
        'radial play of each pin: half the difference of the diameters of hole and pin',
        'bearing',
        Number('radial play', 'm', least=0.0, most=1e6),
        required=True,
    )

    needs = ('pin_forces',)
    needs_forces = True
    is_compiled = True
    sample = '{pins: {B: 1.0e-4}}'

    def stage(self, context: Context) -> Stage:
        """Build the stage; raise `DefinitionError` if a slider is named."""
        forces = context.reactions
        forces.check_deflections('clearance')
        pins = {joint.name for joint in forces.joints if not joint.slides}
        for name in self.pins:
            if name not in pins:
                raise DefinitionError(
                    f'effects.clearance.pins.{name}',
                    f'{name!r} is a slider, and clearance is a property of pins',
                    f'name pins: {list_names(sorted(pins))}',
                )
        plays = tuple(
            (index, self.pins[joint.name])
            for index, joint in enumerate(forces.joints)
            if not joint.slides and joint.name in self.pins
        )
        vectors, count = context.mechanics.model.vectors, len(forces.joints)
        shift_of = forces.joint_deflections

        def clearance(motion: MechanismState) -> MechanismState:
            reactions = motion.reactions
            if not reactions:
                return motion
            position = motion.position
            pressed = [
                vectors.coordinates(forces.pressing_force(index, reactions[index], position))
                for index in range(count)
            ]
            sizes = [call(hypot, *force) for force in pressed]
            smallest = _SMALLEST * call(max, *sizes)
            offsets = [vectors.zero] * count
            for joint, play in plays:
                size = sizes[joint]
                if size > smallest:
                    offsets[joint] = vectors.from_numbers(
                        [-play * (part / size) for part in pressed[joint]]
                    )
            moved = shift_of(position, offsets)
            return motion if moved is None else with_deflection(motion, moved)

        return clearance


def _make_bar(context: Context, link: str, stiffness: float) -> _Bar:
    forces = context.reactions
    ends: dict[str, list[tuple[int, float]]] = {}
    for index, joint in enumerate(forces.joints):
        if link in (joint.link, joint.to):
            if joint.slides:
                raise _bar_error(link, f'has the slider {joint.name!r}')
            ends.setdefault(joint.name, []).append((index, 1.0 if joint.link == link else -1.0))
    if len(ends) != 2:
        raise _bar_error(link, f'has the pins {list_names(ends)}')
    near, far = ends.values()
    return _Bar(
        forces.bar_direction(link, near[0][0], far[0][0]),
        tuple((number, -0.5 * sign) for number, sign in near)
        + tuple((number, 0.5 * sign) for number, sign in far),
        tuple(far),
        1.0 / stiffness,
    )


def _bar_error(link: str, reason: str) -> DefinitionError:
    return DefinitionError(
        f'effects.compliance.links.{link}',
        f'{link!r} {reason}, so it is not a bar between two pins',
        'leave it out: only a link with exactly two pins stretches',
    )
