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

The assembly is the one that continuity from the given pose leads to. With a single input it is a
`Branch`, which is followed once, so that a state depends only on its input and not on where the
linkage was before: the method starts from the curve of the branch, and a solution farther from
there than the curve allows is rejected. Two steps from a table of that curve end within the
rounding; they are a straight line without a library, which a tape records. Only next to a toggle
numpy iterates, until no step is shorter. With several inputs, cells take the place of the table:
see `Grid`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import inf, isnan, nan
from operator import add, sub
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics.arithmetic import (
    make_vector,
    UndecidedError,
    UNIT_ROUNDOFF,
)
from linkage_ros.kinematics.built_once import keep_results
from linkage_ros.kinematics.iterated.branch import Branch, Continuation, Start
from linkage_ros.kinematics.iterated.descent import descend, reciprocal_condition
from linkage_ros.kinematics.iterated.equations import (
    Array,
    Constraint,
    Constraints,
    differentiate_constraints,
    evaluate_constraints,
    GroupMotion,
    OnLine,
)
from linkage_ros.kinematics.iterated.grid import Grid, grid_inputs, GridInput
from linkage_ros.kinematics.iterated.grid_group import GridGroup
from linkage_ros.kinematics.iterated.group_equations import GroupEquations
from linkage_ros.kinematics.iterated.start_table import make_start_table, StartTable
from linkage_ros.kinematics.iterated.steps_before import StepsBefore
from linkage_ros.kinematics.iterated.straight_line import has_symbols, StraightLine
from linkage_ros.kinematics.plane.linkage import Linkage
from linkage_ros.kinematics.plane.rough_pose import guess_unknowns
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, Step
import numpy as np

if TYPE_CHECKING:
    from linkage_ros.kinematics.plane.solved_links import SolvedLinks

_ACCEPTED = 256.0 * UNIT_ROUNDOFF
"""Largest residual of a constraint at a solution, relative to the size of the coordinates."""

_AROUND = 64.0
"""In [rad] or lengths: largest distance from the start in a search for a solution."""

_MOVED = 1e-6
"""In lengths: a smaller closure error is not reported."""

_LAST_STEP = 2.0**-28
"""
Sum of the last changes by Newton's method, in [rad] and lengths: the next is below the rounding.

Near a toggle the method converges more slowly by the same factor by which the rounding is greater.
"""


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
    coordinates. ``inputs`` are the inputs of the pose, as coordinates, and ``sliding`` says for
    each whether it is a slide. ``start`` has the approximate angle and place of each body at the
    pose, one after the other. ``before`` are the steps before this one, and ``known`` is their
    state at the pose. No slide needs to be longer than ``far`` to stretch a link. Whole turns of a
    single input change nothing if they are ``repeated_turns``; 0 if none are known.
    """

    iterates = follows_branch = True

    __slots__ = (
        '_accelerations_line', '_before', '_constraints', '_equations', '_far', '_given_inputs',
        '_known_sizes', '_moving_line', '_rates_line', '_repeated_turns', '_slides', '_sliding',
        '_solution_line', '_start', '_system_line', '_table', 'branch', 'group', 'inputs',
        'solution',
    )  # fmt: skip

    def __init__(
        self,
        constraints: tuple[Constraint, ...],
        slides: tuple[OnLine, ...],
        inputs: tuple[float, ...],
        start: Sequence[float],
        before: tuple[Step, ...],
        sliding: tuple[bool, ...],
        given_inputs: Sequence[GridInput],
        far: float,
        known: LinkState,
        repeated_turns: int,
    ) -> None:
        self._constraints = constraints
        self._slides = slides
        self._before = StepsBefore(before, inputs)
        self.inputs = inputs
        self._sliding = sliding
        self._far, self._repeated_turns = far, repeated_turns
        self._given_inputs = given_inputs
        self._start = np.array(start)
        self._equations = GroupEquations(constraints, len(start) // 3)
        self._system_line = StraightLine(self._list_system, lambda: None)
        self._moving_line = StraightLine(self._list_moving, lambda: None)
        self._known_sizes = len(known.coordinates), len(known.pins)
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
        self._table = keep_results(self._make_table)
        # Returns the branch of a single input; None if the pose leads to no solution.
        self.branch = keep_results(self._follow_branch)
        self.group = keep_results(self._make_group)
        # Returns the unknowns at the pose's inputs; None if the pose leads to no solution.
        self.solution = keep_results(self._solution_of_pose)

    @property
    def equation_count(self) -> int:
        """Return the number of equations solved at once."""
        return len(self._start)

    def close(self, solved: LinkState) -> IteratedPose:
        """Append the angles of the bodies, the slides, and the places of the bodies."""
        status, values = (
            self._close_straight(solved)
            if has_symbols(solved)
            else (Status.CLOSED, self._solution_line(solved))
        )
        if values is None:
            return self._close_slowly(solved)
        self._append_solution(solved, values)
        return IteratedPose(status, 0.0, values[: self.equation_count], solved)

    def _close_straight(self, solved: LinkState) -> tuple[Status, list[Any]]:
        """
        Return the status, and unknowns, angles with their turns and slides, as straight lines.

        All decisions are by symbols. Where they leave it open how the links lie,
        `UndecidedError` is raised.
        """
        equations, inputs = self._equations, self._inputs_of(solved)
        turns, gained = 0, [0.0] * (self.equation_count // 3)
        if len(inputs) > 1:
            group = self.group()
            values = None if group is None else group.solution(solved)
            if values is None:
                raise UndecidedError
        else:
            branch, table = self.branch(), self._table()
            if branch is None or table is None:
                raise UndecidedError
            turns, x = branch.unwrap(inputs[0])
            gained = branch.gained_angles
            status = branch.status_at(x)
            if status is not Status.CLOSED:
                return status, []
            values, farthest = table.find_start(x)
            for most in (farthest, _LAST_STEP):
                errors, solve = equations.linearize(solved, values)
                step = solve(errors)
                if not sum(map(abs, step[1:]), abs(step[0])) <= most:
                    raise UndecidedError
                values = [value - change for value, change in zip(values, step, strict=True)]
        unknowns = equations.place_bodies(values, solved)
        angles = [
            angle + turns * more if more else angle
            for angle, more in zip(unknowns[0::3], gained, strict=True)
        ]
        slides = [slide.place(unknowns, solved).real for slide in self._slides]
        return Status.CLOSED, [*unknowns, *angles, *slides]

    def _make_group(self) -> GridGroup | None:
        """Return the cells of several inputs; None if the pose leads to no solution."""
        solution = self.solution()
        if solution is None:
            return None
        start = [float(solution[k]) for k in self._equations.free]
        return GridGroup(self._equations, self._before, start, self._given_inputs)

    @property
    def grid(self) -> Grid | None:
        """Return the cells of several inputs, if there are several."""
        group = self.group() if len(self.inputs) > 1 else None
        return None if group is None else group.grid

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

    def _make_table(self) -> StartTable | None:
        """Return the table of starts of a single input; None if there is no branch."""
        branch = self.branch()
        if branch is None:
            return None
        free = list(self._equations.free)

        def solution_at(x: float) -> Array | None:
            start = branch.find_start(x)
            found = start.unknowns if start is not None and start.is_end else self.solution_at(x)
            return None if found is None else found[free]

        def converges(x: float, values: Array) -> bool:
            known = self._before.known_at((x,))
            if known is None:
                return False
            unknowns = np.array(self._equations.place_bodies(values.tolist(), known))
            length = inf
            for _ in range(2):
                errors, jacobian = self._evaluate_system(known, unknowns)
                try:
                    step = np.linalg.solve(jacobian, errors)
                except np.linalg.LinAlgError:
                    return False
                unknowns, length = unknowns - step, float(np.abs(step[free]).sum())
            return length <= _LAST_STEP / 16.0

        return make_start_table(branch.pieces(), solution_at, converges)

    def _close_slowly(self, solved: LinkState) -> IteratedPose:
        """Close the links where straight lines do not, as near a toggle."""
        inputs = self._inputs_of(solved)
        if len(inputs) > 1:
            return self._close_beyond_cells(solved)
        start = self._start_at(inputs)
        if start is None or start.is_end:
            return self._not_closed(solved)
        corrected = self._solve_newton(solved, start.unknowns, start.farthest)
        if corrected is None:
            return self._not_closed(solved)
        return self._pose_at(Status.CLOSED, solved, corrected[0], start.turned_angles)

    def _close_beyond_cells(self, solved: LinkState) -> IteratedPose:
        """Close the links by several inputs where no cell is, as near a toggle."""
        group = self.group()
        if group is None:
            return self._nearest_open_pose(solved, self._start)

        def conditioning(values: Sequence[float]) -> float:
            unknowns = self._equations.place_bodies(values, solved)
            return reciprocal_condition(self._evaluate_lists(solved, unknowns)[1])

        status, values = group.close_slowly(solved, conditioning)
        unknowns = np.array(self._equations.place_bodies(values, solved))
        if status is Status.OPEN:
            return self._nearest_open_pose(solved, unknowns)
        if status is Status.TOGGLE:
            unknowns, _ = descend(partial(self._evaluate_system, solved), unknowns)
        return self._pose_at(status, solved, unknowns, np.zeros_like(unknowns))

    def _pose_at(
        self, status: Status, solved: LinkState, unknowns: Array, turned: Array
    ) -> IteratedPose:
        """Append a solution, and return its pose."""
        values = unknowns.tolist()
        slides = [slide.place(values, solved).real for slide in self._slides]
        self._append_solution(solved, [*values, *(unknowns + turned)[0::3].tolist(), *slides])
        return IteratedPose(status, 0.0, values, solved)

    def _not_closed(self, solved: LinkState) -> IteratedPose:
        """Return the pose at a toggle, or the nearest one where the links are open."""
        inputs, branch = self._inputs_of(solved), self.branch()
        start = self._start_at(inputs)
        if start is not None and start.is_end:
            # The Jacobian is singular here, so Newton's method would come no nearer.
            return self._pose_at(Status.TOGGLE, solved, start.unknowns, start.turned_angles)
        if start is not None:
            corrected = self._solve_newton(solved, start.unknowns, start.farthest)
            if corrected is not None:
                return self._pose_at(Status.TOGGLE, solved, corrected[0], start.turned_angles)
        end = None if branch is None else branch.nearest_end(inputs[0])
        return self._nearest_open_pose(solved, self._start if end is None else end)

    def _inputs_of(self, solved: LinkState) -> list[float]:
        end = 1 + len(self.inputs)
        return solved.coordinates[1:end]

    def _follow_branch(self) -> Branch | None:
        solution = self.solution()
        if solution is None:
            return None
        return Branch(
            Continuation(
                self._constraints,
                lambda x: self._before.known_at((x,)),
                lambda x: self._before.moving_at((x,), (1.0,)),
                self._evaluate_moving,
            ),
            solution,
            self.inputs[0],
            turning=not self._sliding[0],
            far=self._far,
            repeated_turns=self._repeated_turns,
        )

    def _solution_of_pose(self) -> Array | None:
        solved = self._before.known_at(self.inputs)
        corrected = self._solve_newton(solved, self._start, inf) if solved is not None else None
        return corrected[0] if corrected is not None else None

    def rates(self, pose: IteratedPose, solved: LinkState, velocities: LinkState) -> list[float]:
        """Append the rates of the coordinates and pins that `close` appended."""
        states = LinkState(pose.unknowns, []), solved, velocities
        if has_symbols(*states):
            found = self._straight_rates(*states)
        else:
            found = self._rates_line(states[0], *map(self._known_part, states[1:])) or []
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
            found = self._accelerations_line(*states[:2], *map(self._known_part, states[2:])) or []
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

    def _straight_solution(self, solved: LinkState) -> list[Any]:
        """Return the unknowns, the angles with their turns, and the slides."""
        status, values = self._close_straight(solved)
        if status is not Status.CLOSED:
            raise UndecidedError
        return values

    def conditioning(self, pose: IteratedPose) -> float:
        """Return the ratio of the Jacobian's smallest singular value to its largest."""
        return reciprocal_condition(self._evaluate_lists(pose.solved, pose.unknowns)[1])

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
        errors, jacobian = self._evaluate_system(solved, start)
        places = np.arange(len(start)) % 3 > 0
        start[places] = np.linalg.lstsq(jacobian[:, places], -errors, rcond=None)[0]
        corrected = self._solve_newton(solved, start, _AROUND)
        return None if corrected is None else corrected[0]

    def solution_at(self, x: float) -> Array | None:
        """Return the unknowns at a value of the single input; None outside the branch."""
        start, known = self._start_at((x,)), self._before.known_at((x,))
        if start is None or known is None:
            return None
        corrected = self._solve_newton(known, start.unknowns, start.farthest)
        return None if corrected is None else corrected[0]

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

    def _evaluate_system(self, solved: LinkState, unknowns: Array) -> tuple[Array, Array]:
        """Return the residuals, and their derivatives by the unknowns."""
        errors, jacobian = self._evaluate_lists(solved, unknowns.tolist())
        return np.array(errors), jacobian

    def _evaluate_lists(
        self, solved: LinkState, unknowns: Sequence[float]
    ) -> tuple[list[float], Array]:
        known, n = self._known_part(solved), len(unknowns)
        numbers = self._system_line(known, LinkState([*unknowns], [])) or []
        return numbers[:n], np.array(numbers[n:]).reshape(n, n)

    def _list_system(self, solved: LinkState, pose: LinkState) -> list[float]:
        errors, rows = evaluate_constraints(self._constraints, pose.coordinates, solved)
        return [*errors, *(slope for row in rows for slope in row)]

    def _evaluate_moving(
        self, unknowns: list[float], solved: LinkState, velocities: LinkState
    ) -> tuple[Array, Array]:
        """Return the residuals, and their derivatives by the unknowns and by time."""
        numbers = self._moving_line(LinkState(unknowns, []), solved, velocities) or []
        n = len(unknowns)
        return np.array(numbers[:n]), np.array(numbers[n:]).reshape(n, n + 1)

    def _list_moving(
        self, pose: LinkState, solved: LinkState, velocities: LinkState
    ) -> list[float]:
        unknowns = pose.coordinates
        errors, rows = evaluate_constraints(self._constraints, unknowns, solved)
        motion = GroupMotion(unknowns, solved, [0.0] * len(unknowns), velocities)
        drift = differentiate_constraints(self._constraints, motion)
        return [*errors, *(x for row, d in zip(rows, drift, strict=True) for x in (*row, d))]

    def _known_part(self, state: LinkState) -> LinkState:
        """Return what a state has of the links before this step."""
        coordinates, pins = self._known_sizes
        return LinkState(state.coordinates[:coordinates], state.pins[:pins])

    def _start_at(self, inputs: Sequence[float]) -> Start | None:
        """Return where Newton's method starts; None if the assembly does not lead there."""
        branch = self.branch()
        return None if branch is None else branch.find_start(inputs[0])

    def _solve_newton(
        self, solved: LinkState, start: Array, farthest: float
    ) -> tuple[Array, Array] | None:
        """Return the solution within a distance of a start, and its Jacobian."""
        # Lists: for so few numbers the overhead of an array exceeds the arithmetic.
        begin = start.tolist()
        unknowns, last = begin, inf
        size = 1.0 + _greatest_magnitude(begin)
        for _ in range(30):
            errors, jacobian = self._evaluate_lists(solved, unknowns)
            try:
                step = np.linalg.solve(jacobian, np.negative(errors)).tolist()
            except np.linalg.LinAlgError:
                return None
            length = _greatest_magnitude(step)
            if length >= last or length <= 4.0 * UNIT_ROUNDOFF * size:
                good = _greatest_magnitude(errors) <= _ACCEPTED * size
                return (np.array(unknowns), jacobian) if good else None
            unknowns, last = list(map(add, unknowns, step)), length
            if not _greatest_magnitude(list(map(sub, unknowns, begin))) <= farthest:
                return None
        return None

    def _nearest_open_pose(self, solved: LinkState, unknowns: Array) -> IteratedPose:
        """
        Return how near the links come, descending from the end of their assembly.

        If they would close, but in another assembly or after another number of turns, the closure
        error is the one at that end.
        """
        first = float(np.abs(self._evaluate_system(solved, unknowns)[0]).max())
        unknowns, gap = descend(partial(self._evaluate_system, solved), unknowns)
        return IteratedPose(Status.OPEN, gap if gap > _MOVED else first, unknowns.tolist(), solved)


def _greatest_magnitude(values: Sequence[float]) -> float:
    """Return the greatest absolute value; NaN if any value is NaN."""
    return nan if isnan(sum(values)) else max(map(abs, values))


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
    sliding = tuple(bool(given.slider) for given in linkage.inputs)
    inputs = tuple(
        value / scale if slides else value
        for value, slides in zip(pose.inputs, sliding, strict=True)
    )
    solved = LinkState([0.0, *inputs], [])
    for step in before:
        if not step.close(solved).status.has_pose:
            raise DefinitionError(
                'pose.inputs',
                'what comes before the iterated links does not close there',
                'give inputs that the linkage can have',
            )
    x, pins = solved
    places = {name: complex(*place) / scale for name, place in pose.points.items()}
    places |= {name: pins[i] for name, i in constraints.known_pins.items()}
    angles = {link: x[a.coordinate] + a.constant for link, a in planner.angles.items()}
    angles |= {link: angle for link, angle in pose.angles.items() if link in links}
    start = guess_unknowns(linkage, links, planner, places, angles)
    far = sum(
        max(abs(one - other) for one in points.values() for other in points.values())
        for points in planner.points.values()
    )
    slides = tuple(constraints.slides.values())
    given = grid_inputs(linkage.inputs, inputs, scale)
    return Iteration(
        tuple(constraints.constraints), slides, inputs, start, before, sliding, given, far, solved,
        constraints.turns,
    )  # fmt: skip
