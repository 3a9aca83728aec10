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
        states = self.states_at(inputs)
        return None if states is None else states[0]

    def states_at(self, *coordinates: Sequence[float]) -> list[LinkState] | None:
        """
        Return the state of their links, and its derivatives, or None.

        The inputs are given, and of their rates and accelerations those that are wanted.
        """
        states = [LinkState([0.0, *values], []) for values in coordinates]
        for step in self.steps:
            pose = step.close(states[0])
            if not (pose.status.has_pose if len(states) == 1 else pose.status.has_rates):
                return None
            rates: Any = step.rates(pose, *states[:2]) if len(states) > 1 else ()
            if len(states) > 2:
                step.accelerations(pose, rates, *states)
        return states

    def trace(self) -> list[LinkState] | None:
        """Return state, rates and accelerations at the pose, as symbols; None at a toggle."""
        tape = Tape()

        def add_inputs(name: str) -> list[Any]:
            return [tape.add_input(f'{name}{i}', x) for i, x in enumerate(self.inputs)]

        return self.states_at(*map(add_inputs, 'qwa'))
