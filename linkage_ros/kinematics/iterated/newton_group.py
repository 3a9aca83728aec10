# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Newton's method on the constraints of links that no dyad covers (class III and higher).

The unknowns are the angle of each link and the place of one point of it. A pin makes two points
coincide, a slider keeps an angle and a point on a line, a driven joint fixes an angle or a slide:
as many equations as unknowns, with the Jacobian in closed form. Velocities and accelerations
solve the same matrix for the derivatives of the constraints.

The assembly is the one that continuity from the given pose leads to: see `BranchGroup` for a
single input, and `GridGroup` for several.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import add
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics.arithmetic import make_vector, UndecidedError
from linkage_ros.kinematics.batch import Array
from linkage_ros.kinematics.built_once import BuiltProperty, keep_results
from linkage_ros.kinematics.iterated.branch import Branch
from linkage_ros.kinematics.iterated.branch_group import BranchGroup, FollowedInput
from linkage_ros.kinematics.iterated.equations import (
    Constraint,
    Constraints,
    GroupMotion,
    OnLine,
)
from linkage_ros.kinematics.iterated.grid import Grid, grid_inputs, GridInput
from linkage_ros.kinematics.iterated.grid_group import GridGroup
from linkage_ros.kinematics.iterated.group import find_inputs, GroupPose
from linkage_ros.kinematics.iterated.group_equations import GroupEquations
from linkage_ros.kinematics.iterated.newton_system import NewtonSystem
from linkage_ros.kinematics.iterated.steps_before import StepsBefore
from linkage_ros.kinematics.iterated.straight_line import has_symbols, StraightLine
from linkage_ros.kinematics.plane.linkage import Linkage
from linkage_ros.kinematics.plane.rough_pose import close_in_pose, guess_unknowns
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, Step
import numpy as np

if TYPE_CHECKING:
    from linkage_ros.kinematics.plane.solved_links import SolvedLinks

_AROUND = 64.0
"""In [rad] or lengths: largest distance from the start in a search for a solution."""


class IteratedPose(NamedTuple):
    """The links at one state."""

    # Whether they close; if not, the smallest residual that was reached.
    status: Status
    gap: float
    unknowns: list[float]  # For each body its angle and the place of its point
    solved: LinkState  # The state that they were appended to


class Iteration(Step):
    """
    A group of links that Newton's method solves.

    There are as many constraints as unknowns. The values of ``slides`` are appended to the
    coordinates. ``given_inputs`` are the inputs, as coordinates. ``start`` has the approximate
    angle and place of each body at the pose, one after the other. ``before`` are the steps before
    this one, and ``known`` is their state at the pose. No slide needs to be longer than ``far`` to
    stretch a link. Whole turns of a single input change nothing if they are ``repeated_turns``; 0
    if none are known.
    """

    iterates = follows_branch = True

    def __init__(
        self,
        constraints: tuple[Constraint, ...],
        slides: tuple[OnLine, ...],
        start: Sequence[float],
        before: tuple[Step, ...],
        given_inputs: Sequence[GridInput],
        far: float,
        known: LinkState,
        repeated_turns: int,
    ) -> None:
        self._slides = slides
        self.inputs = tuple(given.home for given in given_inputs)
        self._before = StepsBefore(before, self.inputs)
        self._given_inputs = given_inputs
        self._start = np.array(start)
        self._equations = GroupEquations(constraints, len(start) // 3)
        self._system = NewtonSystem(self._equations, (len(known.coordinates), len(known.pins)))
        self._followed = FollowedInput(0, given_inputs[0].is_angle, far, repeated_turns)
        examples = keep_results(self._trace_examples)

        def examples_of(*names: str) -> Callable[[], Sequence[LinkState] | None]:
            return lambda: [found[name] for name in names] if (found := examples()) else None

        self._solution_line = StraightLine(self._straight_solution, examples_of('known'))
        self._rates_line = StraightLine(
            self._straight_rates, examples_of('pose', 'known', 'velocities')
        )
        self._accelerations_line = StraightLine(
            self._straight_accelerations,
            examples_of('pose', 'rates', 'known', 'velocities', 'accelerations'),
        )

    @property
    def equation_count(self) -> int:
        """Return the number of equations solved at once."""
        return len(self._start)

    @BuiltProperty
    def group(self) -> BranchGroup | GridGroup | None:
        """Return where solutions start; None if the pose leads to none, of several inputs."""
        if len(self.inputs) == 1:
            start = self._start.tolist()
            return BranchGroup(self._equations, self._before, start, self._followed, self._system)
        solution = self.solution
        if solution is None:
            return None
        start = [float(solution[k]) for k in self._equations.free]
        inputs = find_inputs(self._equations, self._before, start)
        return GridGroup(
            self._equations, self._before, start, inputs, self._given_inputs, self._system
        )

    def branch(self) -> Branch | None:
        """Return the branch of a single input; None if the pose leads to no solution."""
        return self.group.branch if isinstance(self.group, BranchGroup) else None

    @property
    def grid(self) -> Grid | None:
        """Return the cells of several inputs, if there are several."""
        return self.group.grid if isinstance(self.group, GridGroup) else None

    @BuiltProperty
    def solution(self) -> Array | None:
        """Return the unknowns at the pose's inputs; None if the pose leads to no solution."""
        return self._system.solution_in_pose(self._before, self._start)

    def close(self, solved: LinkState) -> IteratedPose:
        """Append the angles of the bodies, the slides, and the places of the bodies."""
        group = self.group
        if has_symbols(solved):
            pose = self._close_straight(solved)
        elif group is not None and (known := group.remembered_pose(solved)) is not None:
            pose = known
        elif (values := self._solution_line(solved)) is not None:
            self._append_solution(solved, values)
            return IteratedPose(Status.CLOSED, 0.0, values[: self.equation_count], solved)
        else:
            pose = self._close_slowly(solved)
        if pose.gained:
            self._append_solution(solved, self._list_solution(pose, solved))
        return IteratedPose(pose.status, pose.gap, [*pose.unknowns], solved)

    def _close_straight(self, solved: LinkState) -> GroupPose:
        """
        Return the unknowns as straight lines; none where the links do not close.

        All decisions are by symbols. Where they leave it open how the links lie,
        `UndecidedError` is raised.
        """
        if self.group is None:
            raise UndecidedError
        return self.group.close_straight(solved)

    def _close_slowly(self, solved: LinkState) -> GroupPose:
        """Close the links where straight lines do not, as near a toggle."""
        if self.group is None:
            nearest, gap = self._system.nearest(solved, self._start.tolist())
            return GroupPose(Status.OPEN, nearest, (), gap)
        return self.group.close_slowly(solved)

    def _list_solution(self, pose: GroupPose, solved: LinkState) -> list[Any]:
        """Return the unknowns, the angles with their turns, and the slides."""
        angles = map(add, pose.unknowns[0::3], pose.gained[0::3])
        slides = [slide.place(pose.unknowns, solved).real for slide in self._slides]
        return [*pose.unknowns, *angles, *slides]

    def _straight_solution(self, solved: LinkState) -> list[Any]:
        """Return the same as straight lines, where the links close."""
        pose = self._close_straight(solved)
        if pose.status is not Status.CLOSED:
            raise UndecidedError
        return self._list_solution(pose, solved)

    def _trace_examples(self) -> dict[str, LinkState]:
        """Return the states at the pose as symbols; nothing if it is at a toggle."""
        n = self.equation_count
        try:
            traced = self._before.trace()
            if traced is None:
                return {}
            known, velocities, accelerations = traced
            pose = LinkState(self._straight_solution(known)[:n], [])
            rates = LinkState(self._straight_rates(pose, known, velocities)[:n], [])
        except UndecidedError:
            return {}
        return {
            'known': known,
            'velocities': velocities,
            'accelerations': accelerations,
            'pose': pose,
            'rates': rates,
        }

    def rates(self, pose: IteratedPose, solved: LinkState, velocities: LinkState) -> list[float]:
        """Append the rates of the coordinates and pins that `close` appended."""
        states = LinkState(pose.unknowns, []), solved, velocities
        if has_symbols(*states):
            found = self._straight_rates(*states)
        else:
            found = self._rates_line(states[0], *map(self._system.known_part, states[1:])) or []
        self._append_rates(velocities, found)
        return found[: self.equation_count]

    def _straight_rates(
        self, pose: LinkState, solved: LinkState, velocities: LinkState
    ) -> list[Any]:
        """Return the rates of the unknowns and of the slides."""
        unknowns = pose.coordinates
        motion = GroupMotion(unknowns, solved, [0.0] * len(unknowns), velocities)
        motion = motion._replace(rates=self._equations.solve_motion(motion))
        return [*motion.rates, *(slide.measured_change(motion) for slide in self._slides)]

    def accelerations(
        self,
        pose: IteratedPose,
        rates: list[float],
        solved: LinkState,
        velocities: LinkState,
        accelerations: LinkState,
    ) -> None:
        """Append the accelerations of the coordinates and pins that `close` appended."""
        states = (
            LinkState(pose.unknowns, []), LinkState(rates, []), solved, velocities, accelerations
        )  # fmt: skip
        if has_symbols(*states):
            found = self._straight_accelerations(*states)
        else:
            found = (
                self._accelerations_line(*states[:2], *map(self._system.known_part, states[2:]))
                or []
            )
        self._append_rates(accelerations, found)

    def _straight_accelerations(
        self,
        pose: LinkState,
        pose_rates: LinkState,
        solved: LinkState,
        velocities: LinkState,
        accelerations: LinkState,
    ) -> list[Any]:
        """Return the accelerations of the unknowns and of the slides."""
        unknowns, rates = pose.coordinates, pose_rates.coordinates
        still = [0.0] * len(unknowns)
        motion = GroupMotion(unknowns, solved, rates, velocities, still, accelerations)
        found = self._equations.solve_motion(motion)
        motion = motion._replace(accelerations=found)
        return [*found, *(slide.measured_change(motion) for slide in self._slides)]

    def conditioning(self, pose: IteratedPose) -> float:
        """Return the ratio of the Jacobian's smallest singular value to its largest."""
        return self._system.conditioning(pose.solved, pose.unknowns)

    def solution_from(self, angles: Array) -> Array | None:
        """
        Return the solution at the pose's inputs that these angles lead to.

        The constraints are linear in the places, which start at the least-squares solution.
        """
        solved = self._before.known_at(self.inputs)
        if solved is None:
            return None
        start = np.zeros_like(self._start)
        start[0::3] = angles
        errors, jacobian = self._system.evaluate(solved, start)
        places = np.arange(len(start)) % 3 > 0
        start[places] = np.linalg.lstsq(jacobian[:, places], -errors, rcond=None)[0]
        return self._system.solve(solved, start, _AROUND)

    def solution_at(self, x: float) -> Array | None:
        """Return the unknowns at a value of the single input; None outside the branch."""
        return self.group.solution_at(x) if isinstance(self.group, BranchGroup) else None

    def _append_solution(self, solved: LinkState, values: Sequence[float]) -> None:
        """Append a solution: unknowns, angles with the turns made before, and slides."""
        n = self.equation_count
        solved.coordinates.extend(values[n:])
        solved.pins.extend(_body_places(values[:n]))

    def _append_rates(self, state: LinkState, values: Sequence[float]) -> None:
        """Append the rates of the unknowns and of the slides, or their accelerations."""
        n = self.equation_count
        state.coordinates.extend(values[0:n:3])
        state.coordinates.extend(values[n:])
        state.pins.extend(_body_places(values[:n]))


def _body_places(values: Sequence[float]) -> list[complex]:
    return list(map(make_vector, values[1::3], values[2::3]))


def make_iteration(
    linkage: Linkage,
    links: Sequence[str],
    constraints: Constraints,
    planner: SolvedLinks,
    before: tuple[Step, ...],
) -> Iteration:
    """
    Return the step that solves a group of links, after the steps before it.

    A DefinitionError says that there is no pose, or that it has too few points of a link.
    """
    pose, scale = linkage.pose, planner.scale
    if pose is None:
        raise DefinitionError(
            'pose',
            f'is missing: no dyad covers {list_names(links)}, they are solved by iteration',
            'give inputs, and where points of these links lie then: '
            'pose: {inputs: [...], points: {...}}',
        )
    solved = close_in_pose(linkage, scale, before)
    beyond = 1 + len(linkage.inputs)
    inputs = tuple(solved.coordinates[1:beyond])
    pins = {name: solved.pins[i] for name, i in constraints.known_pins.items()}
    start = guess_unknowns(linkage, links, planner, pins, solved)
    far = sum(
        max(abs(one - other) for one in points.values() for other in points.values())
        for points in planner.points.values()
    )
    slides = tuple(constraints.slides.values())
    given = grid_inputs(linkage.inputs, inputs, scale)
    return Iteration(
        tuple(constraints.constraints), slides, start, before, given, far, solved,
        constraints.turns,
    )  # fmt: skip
