# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Drive a crank by a sine: θ = θ₀ + A·sin(2π·f·t + φ).

Whole periods of f·t are subtracted in integers, before any rounding. So the argument of the sine
is as exact after a month as at the start.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from math import cos, sin, tau

from linkage_ros.description import each_part, number
from linkage_ros.messages import NANOSECONDS
from linkage_ros.stages.drives.clocked import as_integers, build_clocked, Curve, LARGEST


@dataclass(frozen=True, slots=True)
class Sine:
    """A sine of one input."""

    amplitude: float = number('amplitude', unit='rad or m', least=0.0, most=LARGEST)
    frequency: float = number('frequency', unit='Hz', above=0.0, most=1e6)
    mean: float = number('mean', 0.0, unit='rad or m', least=-LARGEST, most=LARGEST)
    phase: float = number('phase at the first tick', 0.0, unit='rad', least=-6.2832, most=6.2832)


@dataclass(frozen=True, slots=True)
class SineParameters(Sine):
    """A sine of the inputs, from the first tick on."""

    inputs: Mapping[str, Sine] = each_part('inputs with a different sine', 'input', Sine)


PARAMETERS = SineParameters


def value_range(parameters: Sine) -> tuple[float, float]:
    """Return the least and the greatest value of an input, in [rad] or [m]."""
    return parameters.mean - parameters.amplitude, parameters.mean + parameters.amplitude


def motion_curve(parameters: Sine, _where: str = '') -> Curve:
    """Return value, rate and acceleration as a function of time, in [ns]."""
    (frequency,), below = as_integers(parameters.frequency)
    below *= NANOSECONDS
    mean, phase = parameters.mean, parameters.phase
    A = parameters.amplitude
    w = tau * parameters.frequency
    Aw, Aw2 = A * w, A * w * w

    def sine(time: int) -> tuple[float, float, float]:
        angle = tau * (frequency * time % below / below) + phase
        s = sin(angle)
        return mean + A * s, Aw * cos(angle), -Aw2 * s

    return sine


build = partial(build_clocked, 'drive.sine', motion_curve, value_range)
