# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Drive a crank at a constant rate, θ = θ₀ + ω·t, or by a sine, θ = θ₀ + A·sin(2π·f·t + φ).

Products with the time are computed in integers and rounded once. So an angle at a constant rate is
the double nearest to the exact value after any time, and the argument of a sine, from which whole
periods are subtracted in integers, is as exact after a month as at the start. An input may leave
the range that the linkage can reach: it goes on, and the loop is reported open from there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, inf, sin, tau

from linkage_ros.description import each_part, number
from linkage_ros.messages import NANOSECONDS
from linkage_ros.stages.drives.clocked import as_integers, ClockedDrive, Curve, InputMotion
from linkage_ros.stages.drives.drive import LARGEST


@dataclass(frozen=True, slots=True)
class ConstantRate(InputMotion):
    """A constant rate of one input."""

    rate: float = number('rate', unit='rad/s or m/s', least=-LARGEST, most=LARGEST)
    start: float = number(
        'value at the first tick', 0.0, unit='rad or m', least=-LARGEST, most=LARGEST
    )

    def value_range(self) -> tuple[float, float]:
        """Return the least and the greatest value of an input, in [rad] or [m]."""
        start, rate = self.start, self.rate
        return (-inf if rate < 0.0 else start), (inf if rate > 0.0 else start)

    def motion_curve(self, _where: str = '') -> Curve:
        """Return value, rate and acceleration as a function of time, in [ns]."""
        (start, per_second), below = as_integers(self.start, self.rate)
        start *= NANOSECONDS
        below *= NANOSECONDS
        rate = self.rate

        def constant_rate(time: int) -> tuple[float, float, float]:
            return (start + per_second * time) / below, rate, 0.0

        return constant_rate


@dataclass(frozen=True, slots=True)
class ConstantRateDrive(ConstantRate, ClockedDrive):
    """A constant rate of the inputs, from the first tick on."""

    KEY = 'drive.constant_rate'
    inputs: Mapping[str, ConstantRate] = each_part(
        'inputs with a different rate and start', 'input', ConstantRate
    )


@dataclass(frozen=True, slots=True)
class Sine(InputMotion):
    """A sine of one input."""

    amplitude: float = number('amplitude', unit='rad or m', least=0.0, most=LARGEST)
    frequency: float = number('frequency', unit='Hz', above=0.0, most=1e6)
    mean: float = number('mean', 0.0, unit='rad or m', least=-LARGEST, most=LARGEST)
    phase: float = number('phase at the first tick', 0.0, unit='rad', least=-6.2832, most=6.2832)

    def value_range(self) -> tuple[float, float]:
        """Return the least and the greatest value of an input, in [rad] or [m]."""
        return self.mean - self.amplitude, self.mean + self.amplitude

    def motion_curve(self, _where: str = '') -> Curve:
        """Return value, rate and acceleration as a function of time, in [ns]."""
        (frequency,), below = as_integers(self.frequency)
        below *= NANOSECONDS
        mean, phase = self.mean, self.phase
        A = self.amplitude
        w = tau * self.frequency
        Aw, Aw2 = A * w, A * w * w

        def sine(time: int) -> tuple[float, float, float]:
            angle = tau * (frequency * time % below / below) + phase
            s = sin(angle)
            return mean + A * s, Aw * cos(angle), -Aw2 * s

        return sine


@dataclass(frozen=True, slots=True)
class SineDrive(Sine, ClockedDrive):
    """A sine of the inputs, from the first tick on."""

    KEY = 'drive.sine'
    inputs: Mapping[str, Sine] = each_part('inputs with a different sine', 'input', Sine)
