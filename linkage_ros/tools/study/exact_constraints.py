# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The constraints of a linkage as sums of c·x_i·x_j, with x_0 = 1, and their derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from flint import arb, arb_mat

Term = tuple[tuple[Any, Any, Any], int, int]
"""A factor with its first and second time derivative, and the numbers of two unknowns."""


class SingularError(Exception):
    """At a toggle or a change point there is nothing to prove."""


class Proof(NamedTuple):
    """Balls that hold the published joints, their rates and accelerations; angles modulo 2π."""

    joints: tuple[Any, ...]
    rates: tuple[Any, ...]
    accelerations: tuple[Any, ...]


class ExactConstraints:
    """The constraints of a linkage as sums of products of two unknowns, the first is 1."""

    count: int
    constraints: list[list[Term]]

    number = staticmethod(arb)
    """Makes a number of a double."""

    def initial_unknowns(self, closure: Any, inputs: Sequence[float]) -> list[Any]:
        """Return the unknowns from the closure's solution; ValueError where it has none."""
        raise NotImplementedError

    def joint_values(self, *motion: Sequence[Any]) -> tuple[Any, ...]:
        """Return the published joints; with derivatives of the unknowns, the last of them."""
        raise NotImplementedError

    def compute_residuals(self, motion: Sequence[Sequence[Any]]) -> list[Any]:
        """Return the residuals, differentiated as often as the motion has derivatives."""
        return [evaluate_terms(terms, motion) for terms in self.constraints]

    def compute_jacobian(self, x: Sequence[Any]) -> Any:
        """Return the derivatives of the constraints with respect to the unknowns."""
        rows = [[arb(0)] * (self.count + 1) for _ in self.constraints]
        for row, terms in zip(rows, self.constraints, strict=True):
            for (factor, *_), i, j in terms:
                row[i] += factor * x[j]
                row[j] += factor * x[i]
        return arb_mat([row[1:] for row in rows])

    def prove_joints(self, x: Sequence[Any]) -> Proof:
        """Return the published joints and their derivatives."""
        slopes, motion = self.compute_jacobian(x), [list(x)]
        for _ in range(2):
            motion.append([arb(0)] * len(x))
            rest = self.compute_residuals(motion)
            try:
                solved = slopes.solve(arb_mat([[-value] for value in rest]))
            except ZeroDivisionError:
                raise SingularError('the balls hold a singular matrix') from None
            motion[-1] = [arb(0), *solved.entries()]
        ends = (1, 2, 3)
        return Proof(*(self.joint_values(*motion[:end]) for end in ends))


def evaluate_terms(terms: Sequence[Term], motion: Sequence[Sequence[Any]]) -> Any:
    """Return a sum of products; for a motion its highest derivative, by the product rule."""
    x = motion[0]
    total = arb(0)
    for (c, c1, c2), i, j in terms:
        if len(motion) == 1:
            total += c * x[i] * x[j]
            continue
        v = motion[1]
        swept = v[i] * x[j] + x[i] * v[j]
        if len(motion) == 2:
            total += c1 * x[i] * x[j] + c * swept
            continue
        a = motion[2]
        pulled = a[i] * x[j] + 2 * v[i] * v[j] + x[i] * a[j]
        total += c2 * x[i] * x[j] + 2 * c1 * swept + c * pulled
    return total


def constant_term(factor: Any, i: int, j: int) -> Term:
    """Return the product of two unknowns and a factor that stays."""
    return (arb(factor), arb(0), arb(0)), i, j
