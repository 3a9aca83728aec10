# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Newton's method on links that close only together, in the plane and in space.

There are as many equations as unknowns, with the Jacobian in closed form. Rates and accelerations
solve the same matrix. Where the method starts depends on the inputs alone, so that the assembly is
the one that continuity from the pose leads to: see `BranchGroup` for links that one input moves,
and `GridGroup` for others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, pi, remainder, tau
from operator import sub
from random import Random
from typing import Any, NamedTuple

from linkage_ros.kinematics.arithmetic import UndecidedError
from linkage_ros.kinematics.batch import Array
from linkage_ros.kinematics.built_once import BuiltProperty, keep_results
from linkage_ros.kinematics.iterated.branch import Branch
from linkage_ros.kinematics.iterated.branch_group import BranchGroup, FollowedInput
from linkage_ros.kinematics.iterated.grid import Grid, GridInput
from linkage_ros.kinematics.iterated.grid_group import GridGroup
from linkage_ros.kinematics.iterated.group import (
    Equations,
    find_inputs,
    GroupMotion,
    GroupPose,
    require_state,
)
from linkage_ros.kinematics.iterated.newton_system import NewtonSystem
from linkage_ros.kinematics.iterated.steps_before import StepsBefore
from linkage_ros.kinematics.iterated.straight_line import has_symbols, StraightLine
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, Step
from linkage_ros.progress import tell_progress
import numpy as np

_APART, _DIGITS = 1e-6, 12
"""Smallest distance of places in two solutions, in lengths; and the digits of unknowns."""


class IteratedPose(NamedTuple):
    """The links at one state."""

    # Whether they close; if not, by how much they miss.
    status: Status
    gap: float
    unknowns: Sequence[float]
    solved: LinkState  # The state that they were appended to


class IteratedStep(Step):
    """
    Links that Newton's method closes.

    ``before`` are the steps before, ``sizes`` the numbers of coordinates and pins that they leave,
    ``start`` the unknowns in the pose, roughly, and ``given_inputs`` all inputs. No slide needs to
    be longer than ``far`` to stretch a link. Whole turns of a single input change nothing if they
    are ``repeated_turns``; 0 if none are known.
    """

    iterates = follows_branch = True

    def __init__(
        self,
        equations: Equations,
        before: StepsBefore,
        sizes: tuple[int, int],
        start: Sequence[float],
        given_inputs: Sequence[GridInput],
        far: float,
        repeated_turns: int,
    ) -> None:
        self._equations, self._before, self._start = equations, before, [*start]
        self._given_inputs, self._far = given_inputs, far
        self._repeated_turns = repeated_turns
        self._system = NewtonSystem(equations, sizes)
        examples = keep_results(self._trace_examples)

        def examples_of(*names: str) -> Callable[[], Sequence[Any] | None]:
            return lambda: [values[name] for name in names] if (values := examples()) else None

        at, moving = ('known', 'unknowns'), ('velocities', 'rates')
        self._solution_line = StraightLine(self._list_solution, examples_of('known'))
        self._rates_line = StraightLine(self._list_rates, examples_of(*at, 'velocities'))
        self._accelerations_line = StraightLine(
            self._list_accelerations, examples_of(*at, *moving, 'changes')
        )

    @property
    def equation_count(self) -> int:
        """Return the number of equations solved at once."""
        return len(self._start)

    @property
    def inputs(self) -> tuple[int, ...]:
        """Return the numbers of the inputs that the links depend on."""
        return self.group.inputs if self.group else ()

    @BuiltProperty
    def solution(self) -> Array | None:
        """Return the unknowns at the pose's inputs; None if the pose leads to no solution."""
        return self._system.solution_in_pose(self._before, np.array(self._start))

    @BuiltProperty
    def group(self) -> BranchGroup | GridGroup | None:
        """Return where solutions start; None if the pose leads to none, of several inputs."""
        return self._make_group()

    def _make_group(self) -> BranchGroup | GridGroup | None:
        equations, before, system = self._equations, self._before, self._system
        inputs: tuple[int, ...] = (0,)
        if len(before.inputs) > 1:
            free = [self._start[k] for k in equations.free]
            inputs = find_inputs(equations, before, free)
        if len(inputs) == 1:
            (number,) = inputs
            is_angle = self._given_inputs[number].is_angle
            followed = FollowedInput(number, is_angle, self._far, self._repeated_turns)
            return BranchGroup(equations, before, self._start, followed, system)
        if self.solution is None:
            return None
        start = [float(self.solution[k]) for k in equations.free]
        return GridGroup(equations, before, start, inputs, self._given_inputs, system)

    @property
    def grid(self) -> Grid | None:
        """Return the cells of several inputs, if the links depend on several."""
        return self.group.grid if isinstance(self.group, GridGroup) else None

    def branch(self) -> Branch | None:
        """Return the branch of the one input; None if the pose leads to no solution."""
        return self.group.branch if isinstance(self.group, BranchGroup) else None

    def close(self, solved: LinkState) -> IteratedPose:
        """Append coordinates and pins of the links."""
        missing = self._equations.missing_length(solved)
        if missing is not None:
            return IteratedPose(Status.OPEN, missing, self._start, solved)
        group = self.group
        if has_symbols(solved):
            pose = self._close_straight(solved)
        elif group is None:
            nearest, gap = self._system.nearest(solved, self._start)
            return IteratedPose(Status.OPEN, gap, nearest, solved)
        elif (known := group.remembered_pose(solved)) is not None:
            pose = known
        elif (solution := self._solution_line(solved)) is not None:
            unknowns, links = solution
            _append(solved, links)
            return IteratedPose(Status.CLOSED, 0.0, unknowns, solved)
        else:
            pose = group.close_slowly(solved)
        if pose.gained:
            _append(solved, self._equations.place(solved, pose.unknowns, pose.gained))
        return IteratedPose(pose.status, pose.gap, pose.unknowns, solved)

    def _close_straight(self, solved: LinkState) -> GroupPose:
        if self.group is None:
            raise UndecidedError
        return self.group.close_straight(solved)

    def rates(
        self, pose: IteratedPose, solved: LinkState, velocities: LinkState
    ) -> Sequence[float]:
        """Append the rates of the coordinates and pins that `close` appended."""
        part = self._system.known_part
        states = part(solved), pose.unknowns, part(velocities)
        numbers = None if has_symbols(*states[::2]) else self._rates_line(*states)
        rates, motion = numbers or self._list_rates(*states)
        _append(velocities, motion)
        return rates

    def accelerations(
        self,
        pose: IteratedPose,
        rates: Sequence[float],
        solved: LinkState,
        velocities: LinkState,
        changes: LinkState,
    ) -> None:
        """Append the accelerations of the coordinates and pins that `close` appended."""
        part = self._system.known_part
        states = part(solved), pose.unknowns, part(velocities), rates, part(changes)
        numbers = None if has_symbols(*states[::2]) else self._accelerations_line(*states)
        _append(changes, numbers or self._list_accelerations(*states))

    # The functions of the straight lines

    def _list_solution(self, known: LinkState) -> tuple[Sequence[Any], LinkState]:
        pose = self._close_straight(known)
        if pose.status is not Status.CLOSED:
            raise UndecidedError
        return pose.unknowns, self._equations.place(known, pose.unknowns, pose.gained)

    def _list_rates(
        self, known: LinkState, unknowns: Sequence[Any], velocities: LinkState
    ) -> tuple[list[Any], LinkState]:
        motion = GroupMotion(unknowns, known, [0.0] * len(unknowns), velocities)
        rates = self._equations.solve_motion(motion, self._equations.eliminate(known, unknowns))
        return rates, self._equations.move(motion._replace(rates=rates))

    def _list_accelerations(
        self,
        known: LinkState,
        unknowns: Sequence[Any],
        velocities: LinkState,
        rates: Sequence[Any],
        changes: LinkState,
    ) -> LinkState:
        still = [0.0] * len(unknowns)
        motion = GroupMotion(unknowns, known, rates, velocities, still, changes)
        matrix = self._equations.eliminate(known, unknowns)
        accelerations = self._equations.solve_motion(motion, matrix)
        return self._equations.move(motion._replace(accelerations=accelerations))

    def _trace_examples(self) -> dict[str, Any]:
        """Return the states at the pose as symbols; nothing if it is at a toggle."""
        try:
            known, velocities, changes = require_state(self._before.trace())
            unknowns, _ = self._list_solution(known)
            rates, _ = self._list_rates(known, unknowns, velocities)
        except UndecidedError:
            return {}
        return {
            'known': known,
            'unknowns': unknowns,
            'velocities': velocities,
            'rates': rates,
            'changes': changes,
        }

    def iterate_by(self, steps: int, halvings: int) -> None:
        """Let it take so many steps, from cells halved so often; see `Step`."""
        group = self._make_group()
        if group is not None:
            group.steps, group.halvings = steps, halvings
        self.group = group

    # What checks ask for

    def conditioning(self, pose: IteratedPose) -> float:
        """Return the ratio of the Jacobian's smallest singular value to its largest."""
        return self._system.conditioning(pose.solved, pose.unknowns)

    def solution_at(self, x: float) -> Array | None:
        """Return the unknowns at a value of the single input; None outside the branch."""
        return self.group.solution_at(x) if isinstance(self.group, BranchGroup) else None

    def other_solutions(self, count: int) -> list[list[float]]:
        """Return other solutions at the inputs of the pose, that random starts lead to."""
        if self.solution is None:
            return []
        equations, random, pose = self._equations, Random(count), self.solution.tolist()
        known = require_state(self._before.known_at(self._before.inputs))
        solutions, places = [], [equations.list_places(known, pose)]
        for number in range(count):
            tell_progress('starts of other assemblies tried', number, count)
            values = [
                random.uniform(-pi, pi) if equations.angles[k] else pose[k] + random.uniform(-1, 1)
                for k in equations.free
            ]
            solved = self._system.solve(known, np.array(equations.complete(values, known)), inf)
            if solved is None:
                continue
            solution = solved.tolist()
            own = equations.list_places(known, solution)
            # The angles of a ball are two triples for each place of its link.
            if all(max(map(abs, map(sub, own, others))) > _APART for others in places):
                places.append(own)
                # Without the digits that differ from machine to machine.
                solutions.append(
                    [
                        round(remainder(value, tau) if turned else value, _DIGITS) + 0.0
                        for value, turned in zip(solution, equations.angles, strict=True)
                    ]
                )
        return sorted(solutions)


def _append(state: LinkState, links: LinkState) -> None:
    state.coordinates.extend(links.coordinates)
    state.pins.extend(links.pins)
