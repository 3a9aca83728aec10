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
Friction: resistance of pins and sliders to their motion.

It is no stage of the tick: all that works with forces includes it, namely efforts, pin forces,
clearance and compliance, and the torque drive. In a pin::

    T = −viscous·ω − coulomb·sign(ω)          ω: rate of one of its links against the other

and in a slider likewise, with the rate of its slide. The Coulomb part does not depend on the force
in the joint (for this and better models: H. Olsson, K. J. Åström, C. Canudas de Wit, M. Gäfvert
and P. Lischinsky, Friction models and friction compensation, European Journal of Control 4, 1998).
At rest it is 0 in an effort; under the torque drive it sticks.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from linkage_ros.dynamics.loads import Friction, JointFriction
from linkage_ros.files.parameters import each, number

_STRONGEST = 1e9


@dataclass(frozen=True, slots=True)
class OneJoint:
    """Friction of one pin or slider."""

    viscous: float = number(
        'for each unit of rate', 0.0, unit='N·m·s/rad or N·s/m', least=0.0, most=_STRONGEST
    )
    coulomb: float = number('at any rate', 0.0, unit='N·m or N', least=0.0, most=_STRONGEST)


@dataclass(frozen=True, slots=True)
class FrictionParameters:
    """Friction in pins and sliders, for all effects and drives that use forces."""

    joints: Mapping[str, OneJoint] = each('of each pin or slider', 'pin', OneJoint, required=True)

    @property
    def friction(self) -> Friction:
        """Return the friction in the form that `Mechanics` takes."""
        return Friction(
            {
                name: JointFriction(joint.viscous, joint.coulomb)
                for name, joint in self.joints.items()
            }
        )


PARAMETERS = FrictionParameters
