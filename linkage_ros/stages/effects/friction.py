# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Friction: resistance of pins and sliders to their motion.

It is not a stage of the tick: all that works with forces includes it, namely efforts, pin forces,
clearance and compliance, and the torque drive. In a pin::

    T = −viscous·ω − (coulomb + (breakaway − coulomb)·exp(−(ω/stribeck)²) + D)·sign(ω)
    D = coefficient·radius·|F|

with ω the rate of one of its links against the other and F the force in the pin, and in a slider
likewise, with the rate of its slide and without a radius. Sources: H. Olsson, K. J. Åström, C.
Canudas de Wit, M. Gäfvert and P. Lischinsky, Friction models and friction compensation, European
Journal of Control 4, 1998, with Stribeck's curve in the form of eq. 5 with the exponent 2; for D,
the friction circle, R. L. Norton, Design of Machinery, ch. 11.

Under the torque drive a linkage at rest sticks up to the sum of breakaway·|ψ'| over its joints. In
an effort under another drive, friction at rest is 0; with `holds` it carries the load as far as it
can, and the drive the rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from linkage_ros.description import each_part, flag
from linkage_ros.dynamics import Friction, JointFriction
from linkage_ros.stages.effects.effect import ForceEffect


@dataclass(frozen=True, slots=True)
class FrictionEffect(ForceEffect):
    """Friction in pins and sliders, in space in joints, for what uses forces."""

    joints: Mapping[str, JointFriction] = each_part(
        'of each pin or slider, in space of each joint', 'pin', JointFriction, required=True
    )
    holds: bool = flag('at rest friction carries what it can, and effort the rest', False)

    sample = '{joints: {O2: {coulomb: 0.01}}}'

    @property
    def friction(self) -> Friction:
        """Return the friction in the form that `Mechanics` takes."""
        return Friction(self.joints, self.holds)
