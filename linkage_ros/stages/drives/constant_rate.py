# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Drive a crank at a constant rate: θ = θ₀ + ω·t.

The sum is computed in integers and rounded once, so the angle is the double nearest to the exact
value after any time. An input may leave the range that the linkage can reach: it goes on, and the
loop is reported open from there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from math import inf

from linkage_ros.description import each_part, number
from linkage_ros.messages import NANOSECONDS
from linkage_ros.stages.drives.clocked import as_integers, build_clocked, Curve, LARGEST


@dataclass(frozen=True, slots=True)
class ConstantRate:
    """A constant rate of one input."""

    rate: float = number('rate', unit='rad/s or m/s', least=-LARGEST, most=LARGEST)
    start: float = number(
        'value at the first tick', 0.0, unit='rad or m', least=-LARGEST, most=LARGEST
    )


@dataclass(frozen=True, slots=True)
class ConstantRateParameters(ConstantRate):
    """A constant rate of the inputs, from the first tick on."""

    inputs: Mapping[str, ConstantRate] = each_part(
        'inputs with a different rate and start', 'input', ConstantRate
    )


PARAMETERS = ConstantRateParameters


def value_range(parameters: ConstantRate) -> tuple[float, float]:
    """Return the least and the greatest value of an input, in [rad] or [m]."""
    start, rate = parameters.start, parameters.rate
    return (-inf if rate < 0.0 else start), (inf if rate > 0.0 else start)


def motion_curve(parameters: ConstantRate, _where: str = '') -> Curve:
    """Return value, rate and acceleration as a function of time, in [ns]."""
    (start, per_second), below = as_integers(parameters.start, parameters.rate)
    start *= NANOSECONDS
    below *= NANOSECONDS
    rate = parameters.rate

    def constant_rate(time: int) -> tuple[float, float, float]:
        return (start + per_second * time) / below, rate, 0.0

    return constant_rate


build = partial(build_clocked, 'drive.constant_rate', motion_curve, value_range)
