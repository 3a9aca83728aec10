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
"""A dyad on a crank and the ground, alone: its coordinates are those of the loop's own frame."""

from __future__ import annotations

from typing import Any

from linkage_ros.kinematics.dyads.rpr import RPRDyad, RPRPose, swivel_diagonal
from linkage_ros.kinematics.dyads.rrr import crank_diagonal, RRRDyad, RRRPose
from linkage_ros.kinematics.step import State


class _OnCrank:
    """Directions are measured from the ground O→D, the crank's direction is φ."""

    def __init__(self, dyad: Any) -> None:
        self._dyad = dyad
        self.diagonal = dyad.diagonal

    def rates(self, pose: Any, crank_rate: float) -> tuple[float, float]:
        """Return the rates of both coordinates."""
        speeds = State([0.0, crank_rate], [])
        self._dyad.rates(pose, State([], []), speeds)
        first, second = speeds.coordinates[2:]
        return first, second

    def accelerations(
        self, pose: Any, crank_rate: float, crank_acceleration: float
    ) -> tuple[float, float]:
        """Return the accelerations of both coordinates."""
        known, speeds = State([], []), State([0.0, crank_rate], [])
        rates = self._dyad.rates(pose, known, speeds)
        changes = State([0.0, crank_acceleration], [])
        self._dyad.accelerations(pose, rates, known, speeds, changes)
        first, second = changes.coordinates[2:]
        return first, second


class FourBar(_OnCrank):
    """Crank a, coupler b, rocker c, ground d; B on the side of A→D that the sign says."""

    def __init__(self, a: float, b: float, c: float, d: float, sign: int) -> None:
        super().__init__(RRRDyad(crank_diagonal(a, b, c, d), b, c, sign))

    def close(self, phi: float) -> RRRPose:
        """Return the pose at a crank direction."""
        return self._dyad.close(State([0.0, phi], []))  # type: ignore[no-any-return]


class InvertedSliderCrank(_OnCrank):
    """Crank a, ground d, a rod whose line passes the crank pin at an offset."""

    def __init__(self, a: float, d: float, offset: float, sign: int) -> None:
        super().__init__(RPRDyad(swivel_diagonal(a, d, offset), offset, sign))

    def close(self, phi: float) -> RPRPose:
        """Return the pose at a crank direction."""
        return self._dyad.close(State([0.0, phi], []))  # type: ignore[no-any-return]
