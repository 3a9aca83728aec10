# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage whose loops are closed by another solver than the closed form.

The solver gives the results of a tick, `position`, `velocity` and `acceleration`; the closed form
gives ranges, singularity margins, points and drawings at the same inputs.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import (
    Acceleration,
    BuiltProperty,
    Closure,
    InputRange,
    PointMotion,
    Position,
    SingularInput,
    SingularityMargin,
    Status,
    to_doubles,
    Velocity,
)

if TYPE_CHECKING:
    from linkage_ros.kinematics import Batch, Linkage
    from numpy.typing import ArrayLike


class SolverChoice(NamedTuple):
    """The solver chosen for the accuracy of a scene, its parameters, and the reason."""

    solver: str
    parameters: Mapping[str, float]
    why: str


class Solver(Closure):
    """
    A closure that subclasses solve differently; itself, it uses the closed form.

    It has the methods of `Closure`. ``choice`` is the reason for this solver, if the scene
    named none.
    """

    def __init__(self, closed: Closure) -> None:
        # Not built again: for an iterated linkage that would follow a whole turn.
        vars(self).update(vars(closed))
        self._keep_limits()
        self.closed = closed
        self.choice: SolverChoice | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._build_arguments(), {'name': self.name, 'choice': self.choice}

    def _build_arguments(self) -> tuple[Any, ...]:
        """Return the arguments that build the same closure."""
        return (self.closed,)

    def solve(
        self,
        *inputs: ArrayLike,
        rates: Any = None,
        accelerations: Any = None,
        derivatives: int = 2,
        out: Batch | None = None,
    ) -> Batch:
        """Solve many states as `Closure.solve`; other solvers solve them one by one."""
        batch = self.closed.solve(
            *inputs, rates=rates, accelerations=accelerations, derivatives=derivatives, out=out
        )
        if self.by_steps:
            return batch
        from linkage_ros.kinematics import CODES  # local import: it loads numpy
        import numpy as np  # local import: the batch alone needs it

        count, driven = len(batch.status), len(inputs)
        given, speeds, changes = (
            _joint_values(values, driven, count)
            for values in (
                inputs,
                [1.0] * driven if rates is None else rates,
                [0.0] * driven if accelerations is None else accelerations,
            )
        )
        solved = np.isin(batch.status, (CODES[Status.CLOSED], CODES[Status.LIMITED]))
        for k in np.flatnonzero(solved).tolist():
            position = self.position(*(values[k] for values in given))
            batch.positions[:, k] = position.joints
            if batch.velocities is not None:
                velocity = self.velocity(position, *(values[k] for values in speeds))
                batch.velocities[:, k] = velocity.joints
                if batch.accelerations is not None:
                    batch.accelerations[:, k] = self.acceleration(
                        position, velocity, *(values[k] for values in changes)
                    ).joints
        return batch

    def exact_position(self, position: Position) -> Position:
        """Return the position of the closed form at the same inputs."""
        return self.closed.position(*position.inputs)

    def place_links(self, position: Position) -> Position:
        """Return a position with the angles, slides and pins of all links."""
        return self.exact_position(position)

    def points(self, position: Position) -> dict[tuple[str, str], complex]:
        return super().points(self.place_links(position))

    def link_angles(self, position: Position) -> dict[str, float]:
        return super().link_angles(self.place_links(position))

    def slide_values(self, position: Position) -> dict[str, float]:
        return super().slide_values(self.place_links(position))

    def point_motion(
        self, position: Position, velocity: Velocity, acceleration: Acceleration
    ) -> dict[tuple[str, str], PointMotion]:
        exact = self.exact_position(position)
        rates = self.closed.velocity(exact, *self.inputs_of(velocity.state))
        changes = self.inputs_of(acceleration.state)
        accelerations = self.closed.acceleration(exact, rates, *changes)
        return self.closed.point_motion(exact, rates, accelerations)

    @BuiltProperty
    def input_ranges(self) -> tuple[InputRange, ...]:
        return self.closed.input_ranges

    @BuiltProperty
    def singular_inputs(self) -> tuple[SingularInput, ...]:
        return self.closed.singular_inputs

    @BuiltProperty
    def closing_ranges(self) -> tuple[InputRange, ...]:
        return self.closed.closing_ranges

    def singularity_margin(self, position: Position) -> SingularityMargin:
        return self.closed.singularity_margin(self.exact_position(position))


def refuse_ratios(linkage: Linkage, solver: str) -> None:
    """Refuse a linkage with ratios, which other solvers than the closed form do not close."""
    if linkage.ratios:
        raise DefinitionError(
            f'solver.{solver}',
            f'does not support ratios, such as the ratio of {next(iter(linkage.ratios))!r}',
            'write solver: closed_form',
        )


def _joint_values(values: Any, driven: int, count: int) -> list[list[float]]:
    """Return the values of each driven joint, one for each state; a single joint needs no list."""
    import numpy as np  # local import: the batch alone needs it

    if driven == 1 and not isinstance(values, list | tuple) and np.ndim(values) < 2:
        values = [values]
    return [np.broadcast_to(to_doubles('inputs', value), count).tolist() for value in values]
