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
same matrix. Where the method starts depends on the inputs alone: see `BranchGroup` for links that
one input moves, and `GridGroup` for others.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from math import dist, inf, pi, remainder, tau
from operator import add
from random import Random
from typing import NamedTuple

from linkage_ros.kinematics.built_once import BuiltProperty
from linkage_ros.kinematics.iterated.branch import Branch
from linkage_ros.kinematics.iterated.branch_group import BranchGroup, FollowedInput
from linkage_ros.kinematics.iterated.grid import Grid, GridInput
from linkage_ros.kinematics.iterated.grid_group import GridGroup
from linkage_ros.kinematics.iterated.group import find_inputs, require_state
from linkage_ros.kinematics.iterated.newton_system import NewtonSystem
from linkage_ros.kinematics.iterated.steps_before import StepsBefore
from linkage_ros.kinematics.space.knot_equations import KnotEquations
from linkage_ros.kinematics.space.steps import missing_length
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, Step
from linkage_ros.progress import tell_progress
import numpy as np

_APART, _DIGITS = 1e-6, 12
"""Smallest distance of the ends of rods in two solutions, in lengths; and their digits."""

_FAR = 4.0
"""No slide needs to be longer to stretch a link, in lengths."""


class KnotPose(NamedTuple):
    """The links at one state."""

    status: Status
    gap: float
    unknowns: Sequence[float]
    solved: LinkState  # The state that they were appended to


class Knot(Step):
    """
    Links on a tree of joints, closed by as many rods as there are unknown joints.

    ``start`` has the unknowns in the pose, ``unknown`` the names of these joints, and ``sizes``
    the numbers of coordinates and pins before them. Ratios repeat after ``ratio_turns`` turns of
    an input.
    """

    iterates = follows_branch = True

    def __init__(
        self,
        equations: KnotEquations,
        before: StepsBefore,
        start: Sequence[float],
        given_inputs: Sequence[GridInput],
        unknown: tuple[str, ...],
        sizes: tuple[int, int],
        ratio_turns: int,
    ) -> None:
        self._equations, self._start = equations, tuple(start)
        self._before, self._given_inputs = before, given_inputs
        self.unknown = unknown
        self._system = NewtonSystem(equations, sizes)
        self._ratio_turns = ratio_turns

    @property
    def equation_count(self) -> int:
        """Return the number of equations solved at once."""
        return len(self._start)

    @property
    def inputs(self) -> tuple[int, ...]:
        """Return the numbers of the inputs that the links depend on."""
        return self.group.inputs

    @BuiltProperty
    def group(self) -> BranchGroup | GridGroup:
        """Return where solutions start: on the branch of one input, or in cells of several."""
        equations, before, start = self._equations, self._before, self._start
        inputs = find_inputs(equations, before, start)
        if len(before.inputs) > 1 and len(inputs) != 1:
            return GridGroup(equations, before, start, inputs, self._given_inputs, self._system)
        number = inputs[0] if inputs else 0
        is_angle = self._given_inputs[number].is_angle
        followed = FollowedInput(number, is_angle, _FAR, self._ratio_turns)
        return BranchGroup(equations, before, start, followed, self._system)

    @property
    def grid(self) -> Grid | None:
        """Return the cells from which the links are solved, if they depend on several inputs."""
        return self.group.grid if isinstance(self.group, GridGroup) else None

    def branch(self) -> Branch | None:
        """Return the branch of the one input that the links depend on."""
        return self.group.branch if isinstance(self.group, BranchGroup) else None

    def close(self, solved: LinkState) -> KnotPose:
        """Append the unknown joints, and the frames of the links."""
        missing = missing_length([rod.rod for rod in self._equations.rods], solved)
        if missing is not None:
            return KnotPose(Status.OPEN, missing, self._start, solved)
        pose = self.group.close(solved)
        if pose.gained:
            moved = self._equations.place_links(solved, pose.unknowns)
            solved.coordinates.extend(map(add, pose.unknowns, pose.gained))
            solved.pins.extend(islice(moved.pins, self._equations.first, None))
        return KnotPose(pose.status, pose.gap, pose.unknowns, solved)

    def rates(self, pose: KnotPose, solved: LinkState, velocities: LinkState) -> Sequence[float]:
        """Append the rates of the joints, and the motions of the links."""
        rates = self.group.rates(solved, pose.unknowns, velocities)
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
        found = self.group.accelerations(solved, pose.unknowns, velocities, rates, changes)
        changed = self._equations.add_changes(solved, velocities, changes, rates, found)
        changes.coordinates.extend(found)
        changes.pins.extend(islice(changed.pins, self._equations.first, None))

    def other_solutions(self, count: int) -> list[list[float]]:
        """Return other solutions at the inputs of the pose, that random starts lead to."""
        random, turns = Random(count), self._equations.angles
        known, found = require_state(self._before.known_at(self._before.inputs)), [[*self._start]]
        places = [self._equations.rod_ends(known, self._start)]
        for number in range(count):
            tell_progress('starts of other assemblies tried', number, count)
            begin = [
                random.uniform(-pi, pi) if turned else value + random.uniform(-1.0, 1.0)
                for value, turned in zip(self._start, turns, strict=True)
            ]
            solved = self._system.solve(known, np.array(begin), inf)
            if solved is None:
                continue
            solution = solved.tolist()
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
        return self._system.conditioning(pose.solved, pose.unknowns)
