# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Links in space that close only together: Newton's method on the joints of a tree.

Each rod is one equation, ½(|C − B|² − L²) = 0, between places on two links. Three rods of length 1
hold a ball: they lead to one place from three others on the link that it is part of. The residual
and its derivatives are written once, for numbers and symbols; rates and accelerations solve the
same matrix. Where the method starts is on a `Grid`: so a state depends on its inputs alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain, islice
from math import dist, inf, pi, remainder, tau
from random import Random
from typing import Any, NamedTuple

from linkage_ros.kinematics.iterated.grid import Grid, GridInput
from linkage_ros.kinematics.iterated.grid_group import GridGroup
from linkage_ros.kinematics.iterated.steps_before import StepsBefore
from linkage_ros.kinematics.iterated.straight_line import StraightLine
from linkage_ros.kinematics.space.knot_equations import KnotEquations
from linkage_ros.kinematics.space.steps import missing_length
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, Step

_APART, _DIGITS = 1e-6, 12
"""Smallest distance of the ends of rods in two solutions, in lengths; and their digits."""

_SHORTEST = 2.0**-6
"""In lengths: the gap of a shorter rod is measured as that of one of this length."""

_MOVED = 2.0**-20
"""A gap that shrinks to less, relative to itself, is closed by another assembly."""


class KnotPose(NamedTuple):
    """The links at one state."""

    status: Status
    gap: float
    unknowns: Sequence[float]
    solved: LinkState  # The state that they were appended to
    before: int  # Number of its coordinates then


class Knot(Step):
    """
    Links on a tree of joints, closed by as many rods as there are unknown joints.

    ``start`` has the unknowns in the pose, ``unknown`` the names of these joints.
    """

    iterates = True

    def __init__(
        self,
        equations: KnotEquations,
        before: StepsBefore,
        start: Sequence[float],
        given_inputs: Sequence[GridInput],
        unknown: tuple[str, ...],
    ) -> None:
        self._equations, self._start = equations, tuple(start)
        self.unknown = unknown
        self._group = GridGroup(equations, before, start, given_inputs)
        self._matrix_line = StraightLine(self._list_matrix, lambda: None)

    @property
    def equation_count(self) -> int:
        """Return the number of equations solved at once."""
        return len(self._start)

    @property
    def inputs(self) -> tuple[int, ...]:
        """Return the numbers of the inputs that the links depend on."""
        return self._group.inputs

    @property
    def grid(self) -> Grid:
        """Return the cells from which the links are solved."""
        return self._group.grid

    def close(self, solved: LinkState) -> KnotPose:
        """Append the unknown joints, and the frames of the links."""
        before = len(solved.coordinates)
        missing = missing_length([rod.rod for rod in self._equations.rods], solved)
        if missing is not None:
            return KnotPose(Status.OPEN, missing, self._start, solved, before)
        values = self._group.solution(solved)
        if values is None:
            return self._close_slowly(solved)
        return self._append(Status.CLOSED, solved, values)

    def rates(self, pose: KnotPose, solved: LinkState, velocities: LinkState) -> Sequence[float]:
        """Append the rates of the joints, and the motions of the links."""
        rates = self._group.rates(solved, pose.unknowns, velocities)
        moving = self._equations.add_motions(solved, velocities, rates)
        velocities.coordinates.extend(rates)
        velocities.pins.extend(islice(moving.pins, self._equations.first, None))
        return rates

    def accelerations(
        self,
        pose: KnotPose,
        rates: Sequence[float],
        solved: LinkState,
        velocities: LinkState,
        changes: LinkState,
    ) -> None:
        """Append the accelerations of the joints, and the derivatives of the motions."""
        found = self._group.accelerations(solved, pose.unknowns, velocities, rates, changes)
        changed = self._equations.add_changes(solved, velocities, changes, rates, found)
        changes.coordinates.extend(found)
        changes.pins.extend(islice(changed.pins, self._equations.first, None))

    def other_solutions(self, count: int) -> list[list[float]]:
        """Return other solutions at the inputs of the pose, that random starts lead to."""
        random, turns = Random(count), self._equations.turns
        known, found = self._group.known_in_pose(), [[*self._start]]
        places = [self._equations.rod_ends(known, self._start)]
        for _ in range(count):
            begin = [
                random.uniform(-pi, pi) if turned else value + random.uniform(-1.0, 1.0)
                for value, turned in zip(self._start, turns, strict=True)
            ]
            solution = self._group.solve_from(self.grid.home, begin)
            if solution is None:
                continue
            ends = self._equations.rod_ends(known, solution)
            # A ball has two triples of angles for each place of its link.
            if all(max(map(dist, ends, others)) > _APART for others in places):
                places.append(ends)
                values = zip(solution, turns, strict=True)
                # Without the digits that differ from machine to machine.
                found.append(
                    [
                        round(remainder(value, tau) if turned else value, _DIGITS) + 0.0
                        for value, turned in values
                    ]
                )
        return sorted(found[1:])

    def conditioning(self, pose: KnotPose) -> float:
        """Return the ratio of the Jacobian's smallest singular value to its largest."""
        # Later steps have appended to the state.
        before = pose.before
        known = LinkState(
            pose.solved.coordinates[:before], pose.solved.pins[: self._equations.first]
        )
        return self._conditioning_at(known, pose.unknowns)

    def _append(self, status: Status, solved: LinkState, unknowns: Sequence[float]) -> KnotPose:
        before = len(solved.coordinates)
        moved = self._equations.place_links(solved, unknowns)
        solved.coordinates.extend(unknowns)
        solved.pins.extend(islice(moved.pins, self._equations.first, None))
        return KnotPose(status, 0.0, unknowns, solved, before)

    def _close_slowly(self, solved: LinkState) -> KnotPose:
        """Close the links where no cell is proven: next to a singularity, or beyond it."""
        from linkage_ros.kinematics.iterated.descent import descend  # local import: it loads numpy
        import numpy as np  # local import: few states need it

        status, found = self._group.close_slowly(
            solved, lambda unknowns: self._conditioning_at(solved, unknowns)
        )
        if status is Status.CLOSED:
            return self._append(status, solved, found)
        lengths = [rod.rod.length(solved) for rod in self._equations.rods]
        sizes = np.maximum(lengths, _SHORTEST)

        def system(unknowns: Any) -> Any:
            found = self._matrix_line(solved, LinkState(unknowns.tolist(), []))
            if found is None:
                return np.full(len(sizes), inf), np.full((len(sizes), len(sizes)), inf)
            errors, *columns = np.array(found).reshape(-1, len(sizes)) / sizes
            return errors, np.transpose(columns)

        begin = np.array(found)
        first = float(np.abs(system(begin)[0]).max())
        unknowns, gap = descend(system, begin)
        if status is Status.TOGGLE:
            return self._append(status, solved, unknowns.tolist())
        gap = gap if gap > _MOVED * first else first
        return KnotPose(status, gap, found, solved, len(solved.coordinates))

    def _list_matrix(self, known: LinkState, pose: LinkState) -> list[float]:
        """Return the errors, and the matrix of their derivatives by columns."""
        errors, rows = self._equations.evaluate(known, pose.coordinates)
        return [*errors, *chain(*zip(*rows, strict=True))]

    def _conditioning_at(self, known: LinkState, unknowns: Sequence[float]) -> float:
        from linkage_ros.kinematics.iterated.descent import (
            reciprocal_condition,  # local import: it loads numpy
        )
        import numpy as np  # local import: few states need it

        found = self._matrix_line(known, LinkState([*unknowns], []))
        columns = np.array(found).reshape(-1, len(unknowns))[1:]
        return reciprocal_condition(columns.T)
