# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The worst of many states of a linkage: its closure errors, and how near singularities are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from operator import itemgetter
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.analysis.ranges import is_iterated, sample_inputs
from linkage_ros.kinematics.analysis.singularity_margin import step_margins
from linkage_ros.kinematics.analysis.sweep_analysis import (
    follow_grid,
    inputs_on_grid,
    InputSweep,
)
from linkage_ros.kinematics.compiling import Compiled, TracedMotion
from linkage_ros.kinematics.results import Position, SingularityMargin

if TYPE_CHECKING:
    from linkage_ros.kinematics.closure import Closure


class WorstStates(NamedTuple):
    """The worst of many positions: where they miss by most, and nearest to a singularity."""

    residual: float  # In [m]
    inputs: tuple[float, ...]  # Where that is, in [rad] or [m]
    positions: int  # How many there are
    margin: SingularityMargin | None  # The least, of several inputs
    nearest: tuple[float, ...]  # Where that is


def find_worst_states(closure: Closure) -> WorstStates | None:
    """Return the worst states over the range, or over a grid of several inputs; None if empty."""
    several = len(closure.linkage.inputs) > 1

    def measure(position: Position) -> Sequence[Sequence[float]]:
        if not position.status.has_pose:
            return [[], []]
        margins = step_margins(closure, position) if several else ()
        errors = closure.closing_errors(position)
        return [[0.0, *errors], [1.0, *(margin.conditioning for margin in margins)]]

    states = []
    for inputs, (errors, margins) in _measured_states(closure, measure):
        if errors:
            states.append((max(map(abs, errors)), round(min(margins), 9), inputs))
    if not states:
        return None
    residual, _, at = max(states, key=itemgetter(0, 2))
    if not several:
        return WorstStates(residual, at, len(states), None, ())
    # Symmetrical linkages have several: the first, whatever the last digits are.
    nearest = min(states, key=itemgetter(1))[2]
    margin = closure.singularity_margin(closure.close_unlimited(*nearest))
    return WorstStates(residual, at, len(states), margin, nearest)


def _measured_states(
    closure: Closure, measure: Callable[[Position], Sequence[Sequence[float]]]
) -> Iterator[tuple[tuple[float, ...], Sequence[Sequence[float]]]]:
    """Yield the inputs of many states with what is measured there."""
    if len(closure.linkage.inputs) == 1:
        for interval in InputSweep(closure).ranges:
            for value in sample_inputs(interval):
                yield (value,), measure(closure.close_unlimited(value))
    elif is_iterated(closure):
        for inputs, position in follow_grid(closure):
            yield inputs, measure(position)
    else:

        def measure_motion(motion: TracedMotion) -> Sequence[Sequence[float]]:
            return measure(motion.position)

        compiled = Compiled(closure, 0, measure_motion, within_limits=False)
        for inputs in inputs_on_grid(closure):
            yield inputs, compiled(*inputs).values
