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


"""Many states of a closure that has no way to solve them at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from linkage_ros.kinematics.batch import Batch, CODES
from linkage_ros.kinematics.status import Status
from linkage_ros.solvers.solver import Solver
import numpy as np
from numpy.typing import ArrayLike

_SOLVED = CODES[Status.CLOSED], CODES[Status.LIMITED]


def solve_one_by_one(
    solver: Solver,
    inputs: Sequence[ArrayLike],
    rates: Any,
    accelerations: Any,
    derivatives: int,
    out: Batch | None,
) -> Batch:
    """Solve them one after the other; arguments, results and errors as of `Closure.solve`."""
    batch = solver.closed.solve(
        *inputs, rates=rates, accelerations=accelerations, derivatives=derivatives, out=out
    )
    count, driven = len(batch.status), len(inputs)
    given = [np.broadcast_to(np.asarray(value, np.float64), count).tolist() for value in inputs]
    moving = [_rows(rates, 1.0, driven, count), _rows(accelerations, 0.0, driven, count)]
    for k in np.flatnonzero(np.isin(batch.status, _SOLVED)).tolist():
        position = solver.position(*(values[k] for values in given))
        batch.positions[:, k] = position.joints
        if batch.velocities is not None:
            velocity = solver.velocity(position, *(values[k] for values in moving[0]))
            batch.velocities[:, k] = velocity.joints
            if batch.accelerations is not None:
                changes = (values[k] for values in moving[1])
                batch.accelerations[:, k] = solver.acceleration(
                    position, velocity, *changes
                ).joints
    return batch


def _rows(values: Any, absent: float, driven: int, count: int) -> list[list[float]]:
    """Return for each driven joint its values, one a state."""
    if values is None:
        values = [absent] * driven
    alone = np.ndim(values) < 2 if driven == 1 and not isinstance(values, list | tuple) else False
    each = [values] if alone else list(values)
    return [np.broadcast_to(np.asarray(value, np.float64), count).tolist() for value in each]
