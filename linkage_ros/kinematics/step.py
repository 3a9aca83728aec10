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
One step of a solution, and what is handed from step to step.

A linkage is solved by a sequence of steps. Each starts from the coordinates and pins that are
known so far and appends its own; velocities and accelerations are found by walking the same
sequence again, with lists of the same layout. Coordinate 0 is the angle of the ground, always 0;
the inputs follow, then what the steps append. Lengths are in the unit of the closure's scale.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

from linkage_ros.kinematics.status import Status


class State(NamedTuple):
    """
    What is known so far; or the rates of it; or the accelerations.

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
    """What a step found, and what its own rates start from."""

    @property
    def status(self) -> Status:
        """Return whether it closes."""

    @property
    def gap(self) -> float:
        """Return what it misses by where it does not close, else 0, in the unit of the lengths."""


class Placed(NamedTuple):
    """The pose of a step that cannot fail."""

    status: Status = Status.CLOSED
    gap: float = 0.0


PLACED = Placed()


class Step(Protocol):
    """A part of a linkage that follows from what is known before it."""

    def close(self, known: State, /) -> Pose:
        """Append to what is known, or return a status that says why there is nothing."""

    def rates(self, pose: Any, known: State, speeds: State, /) -> Any:
        """Append to the speeds; return what `accelerations` starts from."""

    def accelerations(
        self, pose: Any, rates: Any, known: State, speeds: State, changes: State, /
    ) -> None:
        """Append to the accelerations."""
