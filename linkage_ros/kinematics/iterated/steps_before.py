# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""The steps that come before an iterated one: their state at inputs, and as symbols."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from linkage_ros.kinematics.compiling import Tape
from linkage_ros.kinematics.step import LinkState, Step


class StepsBefore:
    """The steps before an iterated one; ``inputs`` are those of the pose, as coordinates."""

    __slots__ = ('inputs', 'steps')

    def __init__(self, steps: tuple[Step, ...], inputs: tuple[float, ...]) -> None:
        self.steps = steps
        self.inputs = inputs

    def known_at(self, inputs: Sequence[float]) -> LinkState | None:
        """Return the state of their links, or None."""
        solved = LinkState([0.0, *inputs], [])
        for step in self.steps:
            if not step.close(solved).status.has_pose:
                return None
        return solved

    def moving_at(
        self, inputs: Sequence[float], rates: Sequence[float]
    ) -> tuple[LinkState, LinkState] | None:
        """Return the state of their links and its rates, or None."""
        known, speeds = LinkState([0.0, *inputs], []), LinkState([0.0, *rates], [])
        for step in self.steps:
            pose = step.close(known)
            if not pose.status.has_rates:
                return None
            step.rates(pose, known, speeds)
        return known, speeds

    def changing_at(
        self, inputs: Sequence[float], rates: Sequence[float], accelerations: Sequence[float]
    ) -> tuple[LinkState, LinkState, LinkState] | None:
        """Return the state of their links, its rates and its accelerations, or None."""
        states = tuple(LinkState([0.0, *each], []) for each in (inputs, rates, accelerations))
        known, speeds, changes = states
        for step in self.steps:
            pose = step.close(known)
            if not pose.status.has_rates:
                return None
            found: Any = step.rates(pose, known, speeds)
            step.accelerations(pose, found, known, speeds, changes)
        return known, speeds, changes

    def trace(self) -> tuple[LinkState, LinkState, LinkState] | None:
        """Return the same at the pose, as symbols; None if they are at a toggle there."""
        tape = Tape()

        def add_inputs(name: str) -> list[Any]:
            return [tape.add_input(f'{name}{i}', x) for i, x in enumerate(self.inputs)]

        return self.changing_at(*map(add_inputs, 'qwa'))
