# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""
All inputs at which joints have values: several inputs, by a search.

Newton's method for the inputs q of the joints y(q) starts at every state of a grid over the
inputs, for all states at once. A step that leads to no pose is halved. What it finds is closed to
the last digit state by state. A single input has branches instead, which are complete.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, remainder, tau
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.analysis.exchanged_inputs import check_moved, DEPENDENT
from linkage_ros.kinematics.analysis.sweep_analysis import inputs_on_grid
from linkage_ros.kinematics.status import Status

if TYPE_CHECKING:
    from linkage_ros.kinematics.batch import Array
    from linkage_ros.kinematics.closure import Closure

_LINES, _STARTS, _STARTS_ITERATED = 16, 1000, 100
"""Lines of the grid along each input, and most states; the same of links that are iterated."""

_STEPS, _HALVED, _POLISH = 30, 5, 6
"""Steps of Newton's method, how often one is halved, and steps for what is found."""

_LONGEST = 0.5
"""Longest step, in [rad] or of the linkage's size."""

_NEAR, _MET = 1e-6, 1e-10
"""Farthest that joints are off where a solution is near, and where it is found, likewise."""

_APART = 1e-6
"""Inputs that are nearer to each other are one solution, likewise."""


class Searched(NamedTuple):
    """The inputs at which joints have values, as far as a search finds them."""

    inputs: list[
        tuple[float, ...]
    ]  # Angles without limits are in (−π, π] rad, but of iterated links
    starts: int  # From how many states they are sought
    reach: dict[str, tuple[float, float]]  # The least and the greatest value of each joint there


def search_inputs(closure: Closure, wanted: Mapping[str, float]) -> Searched:
    """
    Return the inputs at which as many joints as inputs have values.

    States beyond limits are among them, after the others. The joints are as in
    `Closure.driven_by`, and so are the errors.
    """
    import numpy as np  # local import: one input does without it

    most, count = _STARTS_ITERATED if closure.grids else _STARTS, len(closure.linkage.inputs)
    starts = [*inputs_on_grid(closure, min(_LINES, int(most ** (1.0 / count))))]
    if closure.linkage.pose is not None:
        starts.append(closure.linkage.pose.inputs)
    measured = closure.measuring(*wanted)
    search = _Search(measured, wanted)
    inputs = np.array(starts)
    errors, slopes = search.errors_at(inputs)
    closed = np.isfinite(errors).all(axis=1)
    if closed.any() and not (np.linalg.svd(slopes[closed])[1][:, -1] > DEPENDENT).any():
        check_moved(measured, [*wanted], measured.position(*inputs[closed][0]))
    reach = search.reach_of(errors)
    for _ in range(_STEPS):
        closed = np.isfinite(errors).all(axis=1)
        inputs, errors, slopes = inputs[closed], errors[closed], slopes[closed]
        if (np.abs(errors) < _NEAR).all():
            break  # Also where no state is left
        steps = search.steps_from(errors, slopes)
        for _ in range(_HALVED):
            better = inputs - steps
            errors, slopes = search.errors_at(better)
            opened = ~np.isfinite(errors).all(axis=1)
            if not opened.any():
                break
            steps[opened] *= 0.5
        inputs = better
    solutions: list[tuple[float, ...]] = []
    for row in inputs[(np.abs(errors) < _NEAR).all(axis=1)].tolist():
        if not any(search.is_same(row, known) for known in solutions):
            solution = search.polish(row)
            if solution and not any(search.is_same(solution, known) for known in solutions):
                solutions.append(solution)
    beyond = {inputs: closure.position(*inputs).status is Status.LIMITED for inputs in solutions}
    solutions.sort(key=lambda inputs: (beyond[inputs], inputs))
    return Searched(solutions, len(starts), reach)


class _Search:
    """Errors of joints over the inputs, in [rad] and in sizes of the linkage."""

    def __init__(self, closure: Closure, wanted: Mapping[str, float]) -> None:
        import numpy as np  # local import: as above

        self._closure, self._names = closure, [*wanted]
        self._rows = [closure.joint_names.index(name) for name in wanted]
        self._values = np.array([*wanted.values()])
        self._turning = np.array([closure.turning[row] for row in self._rows])
        self._units = np.where(self._turning, 1.0, closure.scale)
        inputs = closure.linkage.inputs
        self._input_units = np.array(
            [closure.scale if driven.slider else 1.0 for driven in inputs]
        )
        # Links that close only together are followed from the pose, and not a turn away.
        self._wraps = [
            not (driven.slider or driven.limits.is_bounded or closure.grids) for driven in inputs
        ]

    def errors_at(self, inputs: Array) -> tuple[Array, Array]:
        """Return errors (N, joints), NaN where no pose is, and slopes (N, joints, inputs)."""
        import numpy as np  # local import: as above

        slopes = []
        for unit in np.eye(len(self._input_units)).tolist():
            batch = self._closure.solve(inputs, rates=unit, derivatives=1)
            assert batch.velocities is not None
            slopes.append(batch.velocities[self._rows].T)
        off = batch.positions[self._rows].T - self._values
        off = np.where(self._turning, off - tau * np.rint(off / tau), off) / self._units
        rows = np.stack(slopes, axis=2) * (self._input_units / self._units[:, None])
        off[~np.isfinite(rows).all(axis=(1, 2))] = np.nan
        return off, rows

    def reach_of(self, errors: Array) -> dict[str, tuple[float, float]]:
        """Return the least and the greatest value of each joint, in [rad] or [m]."""
        import numpy as np  # local import: as above

        closed = errors[np.isfinite(errors).all(axis=1)]
        values = closed * self._units + self._values
        if not len(values):
            return {}
        ends = zip(values.min(axis=0).tolist(), values.max(axis=0).tolist(), strict=True)
        return dict(zip(self._names, ends, strict=True))

    def steps_from(self, errors: Array, slopes: Array) -> Array:
        """Return steps (N, inputs), in [rad] and [m]; long ones are shortened."""
        import numpy as np  # local import: as above

        steps = np.einsum('nij,nj->ni', np.linalg.pinv(slopes), errors)
        longest = np.abs(steps).max(axis=1, initial=0.0, keepdims=True)
        shorter: Array = steps * (_LONGEST / np.maximum(longest, _LONGEST)) * self._input_units
        return shorter

    def polish(self, inputs: Sequence[float]) -> tuple[float, ...] | None:
        """Return inputs nearby that meet the values to the last digits; None if none do."""
        import numpy as np  # local import: as above

        at = [
            remainder(x, tau) if turns else x for x, turns in zip(inputs, self._wraps, strict=True)
        ]
        best, least = at, inf
        for _ in range(_POLISH):
            errors, slopes = self.errors_at(np.array([at]))
            off = float(np.abs(errors).max())
            if not off < least:
                break
            best, least = at, off
            at = (np.array(at) - self.steps_from(errors, slopes)[0]).tolist()
        return tuple(best) if least < _MET else None

    def is_same(self, first: Sequence[float], second: Sequence[float]) -> bool:
        """Return whether inputs are one solution, apart from turns without limits."""
        ways = (
            (remainder(a - b, tau) if turns else a - b) / unit
            for a, b, turns, unit in zip(
                first, second, self._wraps, self._input_units, strict=True
            )
        )
        return all(abs(way) < _APART for way in ways)
