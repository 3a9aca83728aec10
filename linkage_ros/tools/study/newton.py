# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Newton's method on the constraint equations of a linkage, in the places and turns of its links.

It shares no formula with the closed form.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TYPE_CHECKING

from linkage_ros.kinematics import Closure
import numpy as np

if TYPE_CHECKING:
    from linkage_ros.tools.study.exact_constraints import ExactConstraints

_MOST = 50
"""Most iterations; more mean no convergence."""

_BEHIND = 0.01
"""How far behind a state its iteration starts, in [rad] or parts of the size."""


class _RoundedConstraints:
    """The constraints at some inputs as sums c·x_i·x_j of doubles."""

    def __init__(self, exact: ExactConstraints) -> None:
        self._exact, self._count = exact, exact.count
        terms = [
            (row, float(factor.mid()), i, j)
            for row, products in enumerate(exact.constraints)
            for (factor, *_), i, j in products
        ]
        rows, factors, one, other = zip(*terms, strict=True)
        self._rows, self._factors = np.array(rows), np.array(factors)
        self._one, self._other = np.array(one), np.array(other)
        # The places of both derivatives of each product in the flat Jacobian.
        width = exact.count + 1
        self._places = np.concatenate(
            [self._rows * width + self._one, self._rows * width + self._other]
        )

    def newton_step(self, unknowns: Any) -> Any:
        """Return a step of Newton's method; the first unknown is 1 and stays."""
        one, other = unknowns[self._one], unknowns[self._other]
        errors = np.bincount(self._rows, self._factors * one * other, self._count)
        slopes = np.concatenate([self._factors * other, self._factors * one])
        width = self._count + 1
        jacobian = np.bincount(self._places, slopes, self._count * width)
        return np.linalg.solve(jacobian.reshape(-1, width)[:, 1:], errors)

    def joint_values(self, unknowns: Any) -> tuple[Any, ...]:
        """Return the published joints."""
        return self._exact.joint_values([*map(self._exact.number, unknowns.tolist())])


def solve_by_newton(closure: Closure, tolerance: float) -> Callable[..., Sequence[Any]]:
    """
    Return Newton's method from a state a little behind, as from the last tick.

    It ends at a last correction of at most the tolerance, in [rad] and parts of the size. The
    starts are kept, so a second call with the same inputs only iterates.
    """
    from linkage_ros.tools.study.enclosure import (
        constraints_of,  # local import: an optional dependency
    )

    linkage = closure.linkage
    starts: dict[tuple[float, ...], tuple[_RoundedConstraints, Any]] = {}

    def start_behind(inputs: Sequence[float], exact: ExactConstraints) -> Any:
        """Return the unknowns of the closure at inputs that differ, on the side that closes."""
        units = [closure.scale if each.slider else 1.0 for each in linkage.inputs]
        for side in (-_BEHIND, _BEHIND, 0.0):
            near = [x + side * unit for x, unit in zip(inputs, units, strict=True)]
            if closure.position(*near).joints:
                return np.array([*map(float, exact.initial_unknowns(closure, near))])
        raise ValueError(f'{tuple(inputs)}: the linkage does not close')

    def position(*inputs: float) -> Sequence[Any]:
        if inputs not in starts:
            exact = constraints_of(closure, inputs)
            starts[inputs] = _RoundedConstraints(exact), start_behind(inputs, exact)
        constraints, start = starts[inputs]
        unknowns = start.copy()
        for _ in range(_MOST):
            try:
                step = constraints.newton_step(unknowns)
            except np.linalg.LinAlgError:
                return ()
            unknowns[1:] -= step
            if float(np.abs(step).max()) <= tolerance:
                return constraints.joint_values(unknowns)
        return ()

    return position
