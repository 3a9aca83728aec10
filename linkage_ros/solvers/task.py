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


"""What is to be proven of a table, and what is said where it cannot be."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, remainder, tau
from typing import NamedTuple

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.nearness import away
from linkage_ros.solvers.loops import Loops, Turns

_NEAR = 0.01
"""In [rad]: what fails nearer to a toggle than this fails because of it."""

_NARROWER = 'write solver: closed_form, or a span: [low, high] that keeps away from it'


class Task(NamedTuple):
    """
    What is to be proven.

    Attributes
    ----------
    closed
        A linkage of one input, in closed form.
    groups
        Its loops.
    joints
        Its published joints, each as factor·(Σ ±x_j) + constant.
    tolerance
        In [rad] or [m].
    order
        Between the knots: 'linear' or 'hermite'.

    """

    closed: Closure
    groups: Sequence[Loops]
    joints: Sequence[tuple[Turns, float, float]]
    tolerance: float
    order: str


def refuse_trouble(task: Task, ranges: Sequence[tuple[float, float]]) -> None:
    """Refuse where a toggle or a change point lies in a range: there is no bound."""
    for low, high in ranges:
        for singular in task.closed.singular_inputs:
            middle = 0.5 * (low + high)
            if low <= middle - away(task.closed, middle, singular.value) <= high:
                raise refusal(task, f'cannot be proven near {place(task, singular.value)}')


def place(task: Task, value: float) -> str:
    """Return a value of the input as a user reads it."""
    if task.closed.linkage.inputs[0].slider:
        return f'{value:.6g} m'
    where = f'{degrees(remainder(value, tau)):.4g}°'
    near = any(
        abs(away(task.closed, value, singular.value)) < _NEAR
        for singular in task.closed.singular_inputs
    )
    return f'the toggle or change point at {where}' if near else where


def refusal(task: Task, reason: str, remedy: str = _NARROWER) -> DefinitionError:
    """Return the error for a tolerance that is not proven."""
    unit = 'rad' if any(task.closed.turning) else 'm'
    return DefinitionError('solver.table', f'tolerance {task.tolerance:g} {unit} {reason}', remedy)
