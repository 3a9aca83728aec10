# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Clearance: a pin is smaller than its hole, and the force presses it to one side of the hole.

While pin and hole touch, a massless link between their centres joins them. Its length is the
radial play c, and it lies along the force that it carries (S. W. E. Earles and C. L. S. Wu, Motion
analysis of a rigid-link mechanism with clearance at a bearing, using Lagrangian mechanics and
digital computation, 1973; P. Flores, J. Ambrósio, J. C. P. Claro and H. M. Lankarani, Kinematics
and Dynamics of Multibody Systems with Imperfect Joints, 2008). It is in tension: the centre of the
hole or pin of ``link`` is displaced from the centre at ``to`` by::

    δ = −c·F/|F|              F: the force that ``to`` exerts on ``link``

so a link that hangs in its pin hangs lower by c. In a pin of three links or more, each link is
displaced in this way from the first one that ``links`` names on the pin.

The force is computed for the linkage without play. The displacement of the published joints is
computed to first order, with fixed inputs; its error is of the order of the square of the play.
Contact is never lost: where a force reverses, the pin is on the other side at once. The model is
quasi-static: the rates do not contain the play. A pin whose force is below 1e-12 of the largest in
the linkage is not displaced.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import hypot

from linkage_ros.description import each_part, Number
from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics import call, make_vector
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.stage import MechanismState, Stage, with_deflection

_SMALLEST = 1e-12
"""Below this fraction of the largest force, a force is rounding error without a direction."""


@dataclass(frozen=True, slots=True)
class ClearanceParameters:
    """Pins displaced by their radial play, along the force that they carry."""

    pins: Mapping[str, float] = each_part(
        'radial play of each pin: half the difference of the diameters of hole and pin',
        'pin',
        Number('radial play', 'm', least=0.0, most=1e6),
        required=True,
    )


PARAMETERS = ClearanceParameters


def stage(parameters: ClearanceParameters, context: Context) -> Stage:
    """Build the stage; raise `DefinitionError` if a slider is named."""
    joints = context.closure.structure.joints
    pins = {joint.name for joint in joints if joint.kind == 'R'}
    for name in parameters.pins:
        if name not in pins:
            raise DefinitionError(
                f'effects.clearance.pins.{name}',
                f'{name!r} is a slider, and clearance is a property of pins',
                f'name pins: {list_names(sorted(pins))}',
            )
    plays = tuple(
        (index, parameters.pins[joint.name])
        for index, joint in enumerate(joints)
        if joint.kind == 'R' and joint.name in parameters.pins
    )
    centred = (0j,) * len(joints)
    shift_of = context.reactions.joint_deflections

    def clearance(motion: MechanismState) -> MechanismState:
        reactions = motion.reactions
        if not reactions:
            return motion
        sizes = [call(hypot, fx, fy) for fx, fy, _ in reactions]
        smallest = _SMALLEST * call(max, *sizes)
        offsets = list(centred)
        for joint, play in plays:
            size = sizes[joint]
            if size > smallest:
                fx, fy, _ = reactions[joint]
                offsets[joint] = make_vector(-play * (fx / size), -play * (fy / size))
        moved = shift_of(motion.position, offsets)
        return motion if moved is None else with_deflection(motion, moved)

    return clearance
