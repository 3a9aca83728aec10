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


"""PRP over arrays: a pin where two known lines cross."""

from __future__ import annotations

from typing import Any

from linkage_ros.kinematics.batch.arrays import codes_of, joined, States, turned
from linkage_ros.kinematics.diagonal import ROUNDING
from linkage_ros.kinematics.dyads.prp import PRPDyad, PRPPose
from linkage_ros.tuples import new
import numpy as np


class PRPArrays(PRPDyad):
    """A pin on two lines."""

    __slots__ = ()

    def close(self, known: States) -> PRPPose:
        """Append both slides."""
        x, pins = known
        (i, j), (one, other) = self._arms, self._units
        start, end = (pins[k] for k in self._starts)
        units = turned(x[i]) * one, turned(x[j]) * other
        across = turned(x[j] - x[i]) * self._across
        between = end - start
        parallel = np.abs(across.imag) <= ROUNDING
        apart = np.abs(_cross(units[0], between))
        far = parallel & (apart > ROUNDING * (np.abs(start) + np.abs(end)))
        gap = np.where(far, apart, 0.0)
        first, second = _slides(between, units, across.imag, known)
        codes = codes_of(gap, parallel, False)
        return new(PRPPose, (codes, gap, first, second, across, units))

    def rates(self, pose: PRPPose, _known: States, speeds: States) -> tuple[Any, Any]:
        """Append the rates of both slides."""
        v, velocities = speeds
        (i, j), (one, other) = self._arms, pose.units
        start, end = (velocities[k] for k in self._starts)
        carried: Any = end + joined(0.0, v[j] * pose.second) * other
        carried = carried - (start + joined(0.0, v[i] * pose.first) * one)
        return _slides(carried, pose.units, pose.across.imag, speeds)

    def accelerations(
        self, pose: PRPPose, rates: Any, _known: States, speeds: States, changes: States
    ) -> None:
        """Append the accelerations of both slides."""
        v, (a, pulls) = speeds[0], changes
        (i, j), (one, other) = self._arms, pose.units
        start, end = (pulls[k] for k in self._starts)
        carried: Any = end + _carried(pose.second, rates[1], v[j], a[j]) * other
        carried = carried - (start + _carried(pose.first, rates[0], v[i], a[i]) * one)
        _slides(carried, pose.units, pose.across.imag, changes)


def _carried(slide: Any, rate: Any, turn: Any, change: Any) -> Any:
    """Return what a turning line does to a point on it, centrifugal, Euler and Coriolis."""
    return joined(-turn * turn * slide, change * slide + 2.0 * turn * rate)


def _slides(between: Any, units: tuple[Any, Any], sine: Any, states: States) -> tuple[Any, Any]:
    """Resolve a vector along both lines, and append its parts."""
    first, second = _cross(between, units[1]) / sine, _cross(between, units[0]) / sine
    states[0].append(first)
    states[0].append(second)
    return first, second


def _cross(one: Any, other: Any) -> Any:
    return one.real * other.imag - one.imag * other.real
