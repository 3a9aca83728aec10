# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Compliance: links stretch under the axial force that they carry.

A link between two pins P and Q is a bar of axial stiffness k = E·A/L: under the axial force N,
positive in tension, it is longer by N/k (Hooke's law; S. P. Timoshenko, Strength of Materials, ch.
I). With u the unit vector from P to Q, and F the force on the link in each of its pins, inertia
included::

    N = ½·(F_Q − F_P)·u

So each end bears half of the loads between the pins: weight, inertia and springs. The force is
computed for the rigid linkage. The displacement of the published joints is computed to first
order, with fixed inputs: valid for stretches that are small against the links, with an error of
the order of their square. The model is quasi-static: the stretch adds no vibration, and the rates
belong to the rigid linkage.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from linkage_ros.description import each_part, Number
from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics import Joint, unit_vector
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.stage import MechanismState, Stage, with_deflection

_STIFFEST = 1e15


@dataclass(frozen=True, slots=True)
class ComplianceParameters:
    """Links that stretch under their axial force."""

    links: Mapping[str, float] = each_part(
        'axial stiffness of links with two pins; the other links are rigid',
        'link',
        Number('axial stiffness E·A/L', 'N/m', above=0.0, most=_STIFFEST),
        required=True,
    )


PARAMETERS = ComplianceParameters


class _Bar(NamedTuple):
    """A link between two pins, near and far."""

    coordinate: int  # Index of the closure's coordinate that turns it
    axis: complex  # Unit vector from the near pin to the far one where that coordinate is 0
    # Joints by index, with the factor of their axial force in the tension.
    halves: tuple[tuple[int, float], ...]
    # Joints of the far pin by index; 1 where the link is the joint's ``link``, −1 where ``to``.
    far: tuple[tuple[int, float], ...]
    compliance: float  # 1/k, in [m/N]


def stage(parameters: ComplianceParameters, context: Context) -> Stage:
    """Build the stage; raise `DefinitionError` if a link has not exactly two pins."""
    bars = tuple(_make_bar(context, link, k) for link, k in parameters.links.items())
    rigid = (0j,) * len(context.closure.structure.joints)
    shift_of = context.reactions.joint_deflections

    def compliance(motion: MechanismState) -> MechanismState:
        position, reactions = motion.position, motion.reactions
        if not reactions:
            return motion
        x = position.state.coordinates
        offsets = list(rigid)
        for coordinate, axis, halves, far, softness in bars:
            along = unit_vector(x[coordinate]) * axis
            tension = 0.0
            for joint, half in halves:
                fx, fy, _ = reactions[joint]
                tension += half * (fx * along.real + fy * along.imag)
            stretch = tension * softness * along
            # The rigid position of the far pin is short of its real position.
            for joint, sign in far:
                offsets[joint] -= sign * stretch
        moved = shift_of(position, offsets)
        return motion if moved is None else with_deflection(motion, moved)

    return compliance


def _make_bar(context: Context, link: str, stiffness: float) -> _Bar:
    closure = context.closure
    ends: dict[str, list[tuple[int, float]]] = {}
    for index, joint in enumerate(closure.structure.joints):
        if link in (joint.link, joint.to):
            _check_joint(link, joint)
            ends.setdefault(joint.name, []).append((index, 1.0 if joint.link == link else -1.0))
    if len(ends) != 2:
        raise _bar_error(link, f'has the pins {list_names(ends)}')
    near, far = ends
    points = closure.linkage.links[link]
    between = complex(*points[far]) - complex(*points[near])
    angle = closure.angles[link]
    return _Bar(
        angle.coordinate,
        angle.unit * between / abs(between),
        tuple((number, -0.5 * sign) for number, sign in ends[near])
        + tuple((number, 0.5 * sign) for number, sign in ends[far]),
        tuple(ends[far]),
        1.0 / stiffness,
    )


def _check_joint(link: str, joint: Joint) -> None:
    if joint.kind != 'R':
        raise _bar_error(link, f'has the slider {joint.name!r}')


def _bar_error(link: str, reason: str) -> DefinitionError:
    return DefinitionError(
        f'effects.compliance.links.{link}',
        f'{link!r} {reason}, so it is not a bar between two pins',
        'leave it out: only a link with exactly two pins stretches',
    )
