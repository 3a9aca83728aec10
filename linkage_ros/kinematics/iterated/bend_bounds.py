# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
How much the equations of a planar group bend: bounds of their second derivatives.

A pin places a link next to another one, so that the end of a link is a sum of arms, each of which
turns with one link: Σ c·e^{iθ}, plus places that are known or free. What remains of an equation is
such a sum, or one seen from a link that turns, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations_with_replacement
from typing import Any

from linkage_ros.kinematics.iterated.equations import (
    CoincidentPoints,
    Constraint,
    End,
    Geared,
    OnLine,
)
from linkage_ros.kinematics.step import LinkState

_MOVED = 0.25
"""How far what is seen from a turning link may move between two solutions, in lengths."""

Pair = tuple[int, int]


class ArmSums:
    """The ends of links as sums of arms; ``placed`` gives for a body its end and the other's."""

    def __init__(self, placed: Mapping[int, tuple[End, End]]) -> None:
        self._placed = placed

    def arms_to(self, end: End) -> tuple[dict[int, complex], set[int]]:
        """Return the arms that lead to an end, by the bodies that turn them, and free bodies."""
        if end.body < 0:
            return {}, set()
        if end.body in self._placed:
            own, known_end = self._placed[end.body]
            arms, free = self.arms_to(known_end)
            arm = end.arm - own.arm
        else:
            arms, free, arm = {}, {end.body}, end.arm
        arms[end.body] = arms.get(end.body, 0j) + arm
        return arms, free

    def bound_bends(
        self, constraint: Constraint, unknowns: Sequence[Any], solved: LinkState
    ) -> dict[Pair, Any]:
        """Return bounds of an equation's second derivatives, by pairs of unknowns."""
        if isinstance(constraint, CoincidentPoints):
            arms, _ = self._arms_between(*constraint)
            return {(3 * body, 3 * body): abs(arm) for body, arm in arms.items()}
        if isinstance(constraint, OnLine):
            return self._bound_line(constraint, unknowns, solved)
        bounds: dict[Pair, Any] = {}
        for factor, of in constraint.terms if isinstance(constraint, Geared) else ():
            if isinstance(of, OnLine):
                for pair, bound in self._bound_line(of, unknowns, solved).items():
                    bounds[pair] = bounds.get(pair, 0.0) + abs(factor) * bound
        return bounds

    def _bound_line(
        self, line: OnLine, unknowns: Sequence[Any], solved: LinkState
    ) -> dict[Pair, Any]:
        """Return the bounds of a point seen from a line, which may turn with a body."""
        arms, free = self._arms_between(line.point, line.through)
        body = line.line.body
        bounds: dict[Pair, Any] = {(3 * k, 3 * k): abs(arm) for k, arm in arms.items()}
        if body < 0:
            return bounds
        turn = 3 * body
        reach = abs(line.place(unknowns, solved)) + sum(map(abs, arms.values())) + _MOVED
        bounds[turn, turn] = reach
        for k, arm in arms.items():
            # Seen from its own link, an arm stands still.
            if k != body:
                bounds[_pair(turn, 3 * k)] = 2.0 * abs(arm)
        for k in free:
            for column in (3 * k + 1, 3 * k + 2):
                bounds[_pair(turn, column)] = 2.0
        return bounds

    def _arms_between(self, first: End, second: End) -> tuple[dict[int, complex], set[int]]:
        arms, free = self.arms_to(first)
        others, also_free = self.arms_to(second)
        for body, arm in others.items():
            arms[body] = arms.get(body, 0j) - arm
        return arms, free | also_free


def _pair(first: int, second: int) -> Pair:
    return (first, second) if first < second else (second, first)


def list_bounds(bounds: Mapping[Pair, Any], columns: Sequence[int]) -> list[Any]:
    """Return the bounds of all pairs of some unknowns."""
    return [bounds.get(pair, 0.0) for pair in combinations_with_replacement(columns, 2)]
