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
The steps of a solution, and the state that they pass on.

A linkage is solved by a sequence of steps. Each step starts from the known coordinates and pins
and appends its own; velocities and accelerations are computed by the same sequence again, in lists
of the same layout. Coordinate 0 is the angle of the ground, always 0; the inputs follow, then the
coordinates that the steps append. Lengths are in the unit of the closure's scale.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

from linkage_ros.kinematics.status import Status


class State(NamedTuple):
    """
    The known coordinates and pins; or their rates; or their accelerations.

    Attributes
    ----------
    coordinates
        Angles, in [rad], and slides.
    pins
        Places of pins in the frame of the ground.

    """

    coordinates: list[float]
    pins: list[complex]


class Pose(Protocol):
    """The result of a step, from which its rates are computed."""

    @property
    def status(self) -> Status:
        """Return whether it closes."""

    @property
    def gap(self) -> float:
        """Return the closure error, or 0 if the step closes, in the unit of the lengths."""


class Placed(NamedTuple):
    """The pose of a step that cannot fail."""

    status: Status = Status.CLOSED
    gap: float = 0.0


PLACED = Placed()


class Step(Protocol):
    """A part of a linkage that is solved from the coordinates and pins before it."""

    def close(self, known: State, /) -> Pose:
        """Append to the known state; if that is impossible, return a status that says why."""

    def rates(self, pose: Any, known: State, speeds: State, /) -> Any:
        """Append to the rates; return the intermediate values that `accelerations` needs."""

    def accelerations(
        self, pose: Any, rates: Any, known: State, speeds: State, changes: State, /
    ) -> None:
        """Append to the accelerations."""
