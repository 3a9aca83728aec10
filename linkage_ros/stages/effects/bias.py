# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Bias: the systematic errors of a sensor: its zero, its scale, and a disc that runs eccentrically.

The reading of a joint is off by (instrumental bias: JCGM 200:2012, International vocabulary of
metrology, 4.20)::

    y = x + b + s·x + e·sin(x − φ)        ẏ = ẋ·(1 + s + e·cos(x − φ)) + bᵥ        τ̂ = τ + bₑ

b is the error of the zero: ``joints`` gives it, and ``deviations`` the standard deviation of a
further one, which is drawn once from the seed. s is the scale error. A disc whose centre lies ε
from the axis of the joint is read at the radius R with the error e = ε/R, once a turn; φ is the
angle at which it passes through 0 upwards (R. M. Kennel, Encoders for simultaneous sensing of
position and speed in electrical drives with digital control, IEEE Transactions on Industry
Applications 43, 2007).

bᵥ and bₑ, ``rates`` and ``efforts``, belong to sensors that measure rates, and torques or
forces. Accelerations have no bias.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, sin
from operator import add

from linkage_ros.description import each_part, Number, number
from linkage_ros.errors import DefinitionError
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.effect import SensorEffect
from linkage_ros.stages.effects.stage import Sensor, SensorReading

_Systematic = tuple[int, float, float, float]
"""Index of a joint, its scale error, and amplitude and phase of its eccentric disc."""


@dataclass(frozen=True, slots=True)
class EccentricDisc:
    """The error of a disc whose centre is off the axis."""

    amplitude: float = number('largest error', unit='rad', least=0.0, most=1.0)
    phase: float = number('angle of no error, from where it grows', 0.0, unit='rad')


@dataclass(frozen=True, slots=True)
class BiasEffect(SensorEffect):
    """Systematic errors of measured joints: of the zero, of the scale, and once a turn."""

    joints: Mapping[str, float] = each_part(
        'constant error of a joint',
        'joint',
        Number('error, added to the position', 'rad or m', -1e6, 1e6),
    )
    deviations: Mapping[str, float] = each_part(
        'a further constant error, drawn from the seed',
        'joint',
        Number('its standard deviation', 'rad or m', 0.0, 1e6),
    )
    rates: Mapping[str, float] = each_part(
        'constant error of a measured rate',
        'joint',
        Number('error, added to the rate', 'rad/s or m/s', -1e6, 1e6),
    )
    efforts: Mapping[str, float] = each_part(
        'constant error of a measured effort',
        'joint',
        Number('error, added to the effort', 'N·m or N', -1e9, 1e9),
    )
    scales: Mapping[str, float] = each_part(
        'scale error of a joint',
        'joint',
        Number('part of the position that is added to it', '', -0.5, 0.5),
    )
    eccentricities: Mapping[str, EccentricDisc] = each_part(
        'eccentric disc of a joint', 'joint', EccentricDisc
    )

    sample = '{joints: {rocker_joint: 0.01}}'

    def sensor(self, context: Context) -> Sensor:
        """Build the sensor; raise `DefinitionError` for no error, or the disc of a slide."""
        if self == BiasEffect():
            raise DefinitionError(
                'effects.bias', 'names no joint', 'write joints: {JOINT: 0.01}, or leave it out'
            )
        disc, joints = EccentricDisc(0.0), context.joints
        for joint, turns in zip(joints, context.closure.turning, strict=True):
            if joint in self.eccentricities and not turns:
                raise DefinitionError(
                    f'effects.bias.eccentricities.{joint}',
                    'is a slide and has no disc',
                    'leave it out',
                )
        zeros = tuple(
            self.joints.get(joint, 0.0)
            + (
                context.random(f'bias/{joint}').gauss(0.0, self.deviations[joint])
                if joint in self.deviations
                else 0.0
            )
            for joint in joints
        )
        systematic: tuple[_Systematic, ...] = tuple(
            (i, self.scales.get(joint, 0.0), eccentricity.amplitude, eccentricity.phase)
            for i, joint in enumerate(joints)
            if joint in self.scales or joint in self.eccentricities
            for eccentricity in [self.eccentricities.get(joint, disc)]
        )
        of_rates = tuple(self.rates.get(joint, 0.0) for joint in joints)
        of_efforts = tuple(self.efforts.get(joint, 0.0) for joint in joints)

        def bias(_now: int, reading: SensorReading) -> SensorReading:
            return reading._replace(joints=tuple(map(add, reading.joints, zeros)))

        def every_bias(_now: int, reading: SensorReading) -> SensorReading:
            values, rates, efforts = list(reading.joints), list(reading.rates), reading.efforts
            for i, scale, amplitude, phase in systematic:
                value = values[i]
                values[i] += scale * value + amplitude * sin(value - phase)
                if rates:
                    rates[i] *= 1.0 + scale + amplitude * cos(value - phase)
            return reading._replace(
                joints=tuple(map(add, values, zeros)),
                rates=tuple(map(add, rates, of_rates)) if rates else (),
                efforts=tuple(map(add, efforts, of_efforts)) if efforts else (),
            )

        return every_bias if systematic or any(of_rates) or any(of_efforts) else bias
