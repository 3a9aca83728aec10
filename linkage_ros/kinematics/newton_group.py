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
there than the curve allows is rejected. With several inputs, the straight line from the inputs of
the pose is followed again for each state, with the same proof that no other assembly is met.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Mapping, Sequence
from copy import copy
from math import hypot, inf, isnan, nan
from operator import add, sub
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics.arithmetic import call, has_result, UNIT_ROUNDOFF
from linkage_ros.kinematics.branch import Branch, Continuation, Start
from linkage_ros.kinematics.built_once import keep_results
from linkage_ros.kinematics.compiling import compile_function
from linkage_ros.kinematics.equations import (
    Array,
    Constraint,
    Constraints,
    differentiate_constraints,
    evaluate_constraints,
    line_motion,
    OnLine,
    point_in_line_frame,
)
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, Step
import numpy as np

if TYPE_CHECKING:
    from linkage_ros.kinematics.solved_links import SolvedLinks

_ACCEPTED = 256.0 * UNIT_ROUNDOFF
"""Largest residual of a constraint at a solution, relative to the size of the coordinates."""

_SINGULAR = 1e-11
"""Several inputs: least ratio of smallest to largest singular value at which rates exist."""

_AROUND = 64.0
"""In [rad] or lengths: largest distance from the start in a search for a solution."""

_MOVED = 1e-6
"""In lengths: a smaller closure error is not reported."""

_EARLY_STEPS = 8
_EARLY_SINGULAR = 1e-6
"""Steps that end at a tolerance, and the conditioning below which full accuracy is needed."""


class IteratedPose(NamedTuple):
    """The links at one state."""

    # Whether they close; if not, the smallest residual that was reached.
    status: Status
    gap: float
    unknowns: list[float]  # For each body its angle and the place of its point
    jacobian: Array  # Derivatives of the constraints by the unknowns


class Iteration:
    """
    A group of links that Newton's method solves.

    There are as many constraints as unknowns. The values of ``slides`` are appended to the
    coordinates. ``inputs`` are the inputs of the pose, as coordinates, and ``sliding`` says for
    each whether it is a slide. ``start`` has the approximate angle and place of each body at the
    pose, one after the other. ``before`` are the steps before this one. No slide needs to be
    longer than ``far`` to stretch a link.
    """

    __slots__ = ('_before', '_constraints', '_far', '_slides', '_sliding', '_start', '_straight',
                 'branch', 'inputs', 'solution', 'tolerance')  # fmt: skip

    def __init__(
        self,
        constraints: tuple[Constraint, ...],
        slides: tuple[OnLine, ...],
        inputs: tuple[float, ...],
        start: Sequence[float],
        before: tuple[Step, ...],
        sliding: tuple[bool, ...],
        far: float,
    ) -> None:
        self._constraints = constraints
        self._slides = slides
        self._before = before
        self.inputs = inputs
        self._sliding = sliding
        self._far = far
        self._start = np.array(start)
        self._straight: _CompiledSystem | None = None
        # Returns the branch of a single input; None if the pose leads to no solution.
        self.branch = keep_results(self._follow_branch)
        # Returns the unknowns at the pose's inputs; None if the pose leads to no solution.
        self.solution = keep_results(self._solution_of_pose)
        # Bound of the last correction, in [rad] and in the unit of the lengths; 0 for full
        # accuracy.
        self.tolerance = 0.0

    @property
    def equation_count(self) -> int:
        """Return the number of equations solved at once."""
        return len(self._start)

    def stopped_at(self, tolerance: float) -> Iteration:
        """Return the same iteration with a tolerance; with several inputs it changes nothing."""
        stopped = copy(self)
        stopped.tolerance = tolerance
        return stopped

    def close(self, solved_state: LinkState) -> IteratedPose:
        """Append the angles of the bodies, the slides, and the places of the bodies."""
        early = self._closed_early(solved_state) if self.tolerance else None
        if early is not None:
            return early
        solved = call(
            self._closed_at,
            len(solved_state.coordinates),
            *solved_state.coordinates,
            *solved_state.pins,
        )
        if not has_result(solved):
            return self._not_closed(solved_state)
        n, bodies = self.equation_count, self.equation_count // 3
        unknowns = [solved[i] for i in range(n)]
        self._append_solution(solved_state, unknowns, [solved[n + i] for i in range(bodies)])
        return IteratedPose(Status.CLOSED, 0.0, unknowns, solved[n + bodies])

    def _closed_at(self, count: int, *numbers: Any) -> tuple[Any, ...] | None:
        """
        Return a closed solution: unknowns, angles with their turns, and the Jacobian.

        The numbers are ``count`` known coordinates, then the known pins.
        """
        solved = LinkState(list(numbers[:count]), list(numbers[count:]))
        inputs = self._inputs_of(solved)
        start = self._start_at(inputs)
        if start is None or start.is_end:
            return None
        corrected = self._solve_newton(solved, start.unknowns, start.farthest)
        if corrected is None:
            return None
        unknowns, jacobian = corrected
        if len(inputs) > 1 and _reciprocal_condition(jacobian) <= _SINGULAR:
            return None
        return (*unknowns.tolist(), *(unknowns + start.turned_angles)[0::3].tolist(), jacobian)

    def _closed_early(self, solved: LinkState) -> IteratedPose | None:
        """Append a solution within the tolerance; None if the first steps do not contract."""
        inputs = self._inputs_of(solved)
        start = self._start_at(inputs) if len(inputs) == 1 else None
        if start is None or start.is_end:
            return None
        unknowns, last = start.unknowns, start.farthest
        for _ in range(_EARLY_STEPS):
            errors, jacobian = self._evaluate_system(solved, unknowns)
            try:
                step = np.linalg.solve(jacobian, -errors)
            except np.linalg.LinAlgError:
                return None
            length = float(np.abs(step).max())
            if not length < 0.7 * last:
                return None
            unknowns, last = unknowns + step, length
            if length <= self.tolerance:
                if _reciprocal_condition(jacobian) <= _EARLY_SINGULAR:
                    return None
                values = unknowns.tolist()
                self._append_solution(
                    solved, values, (unknowns + start.turned_angles)[0::3].tolist()
                )
                return IteratedPose(Status.CLOSED, 0.0, values, jacobian)
        return None

    def _not_closed(self, solved: LinkState) -> IteratedPose:
        """Return the pose at a toggle, or the nearest one where the links are open."""
        inputs = self._inputs_of(solved)
        start = self._start_at(inputs)
        if start is None:
            return self._nearest_open_pose(solved, inputs)
        if start.is_end:
            # The Jacobian is singular here, so Newton's method would come no nearer.
            unknowns, jacobian = start.unknowns, self._evaluate_system(solved, start.unknowns)[1]
        else:
            corrected = self._solve_newton(solved, start.unknowns, start.farthest)
            if corrected is None:
                return self._nearest_open_pose(solved, inputs)
            unknowns, jacobian = corrected
        values = unknowns.tolist()
        self._append_solution(solved, values, (unknowns + start.turned_angles)[0::3].tolist())
        return IteratedPose(Status.TOGGLE, 0.0, values, jacobian)

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
                lambda x: self._known_at((x,)),
                lambda x: self._moving_at((x,)),
            ),
            solution,
            self.inputs[0],
            turning=not self._sliding[0],
            far=self._far,
        )

    def _solution_of_pose(self) -> Array | None:
        solved = self._known_at(self.inputs)
        corrected = self._solve_newton(solved, self._start, inf) if solved is not None else None
        return corrected[0] if corrected is not None else None

    def rates(self, pose: IteratedPose, solved: LinkState, velocities: LinkState) -> list[float]:
        """Append the rates of the coordinates and pins that `close` appended."""
        still = [0.0] * len(pose.unknowns)
        drift = differentiate_constraints(
            self._constraints, pose.unknowns, solved, velocities, still, None, still
        )
        rates = _cancel_drift(pose, drift)
        self._append_rates(velocities, rates)
        for slide in self._slides:
            _, rate, _ = line_motion(slide, pose.unknowns, solved, velocities, rates, None, still)
            velocities.coordinates.append(rate.real)
        return rates

    def accelerations(
        self,
        pose: IteratedPose,
        rates: list[float],
        solved_state: LinkState,
        velocities: LinkState,
        accelerations: LinkState,
    ) -> None:
        """Append the accelerations of the coordinates and pins that `close` appended."""
        still = [0.0] * len(rates)
        drift = differentiate_constraints(
            self._constraints, pose.unknowns, solved_state, velocities, rates, accelerations, still
        )
        solved = _cancel_drift(pose, drift)
        self._append_rates(accelerations, solved)
        for slide in self._slides:
            _, _, change = line_motion(
                slide, pose.unknowns, solved_state, velocities, rates, accelerations, solved
            )
            accelerations.coordinates.append(change.real)

    def conditioning(self, pose: IteratedPose) -> float:
        """Return the ratio of the Jacobian's smallest singular value to its largest."""
        return _reciprocal_condition(pose.jacobian)

    def solution_from(self, angles: Array) -> Array | None:
        """
        Return the solution at the pose's inputs that these angles lead to.

        The constraints are linear in the places, which start at the least-squares solution.
        """
        solved = self._known_at(self.inputs)
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
        start, known = self._start_at((x,)), self._known_at((x,))
        if start is None or known is None:
            return None
        corrected = self._solve_newton(known, start.unknowns, start.farthest)
        return None if corrected is None else corrected[0]

    def _append_solution(
        self, solved: LinkState, unknowns: list[float], angles: list[float]
    ) -> None:
        """Append a solution; its angles include the turns made before."""
        solved.coordinates.extend(angles)
        solved.pins.extend(_body_places(unknowns))
        for slide in self._slides:
            solved.coordinates.append(point_in_line_frame(slide, solved, unknowns).real)

    def _append_rates(self, state: LinkState, values: list[float]) -> None:
        state.coordinates.extend(values[0::3])
        state.pins.extend(_body_places(values))

    def _evaluate_system(self, solved: LinkState, unknowns: Array) -> tuple[Array, Array]:
        """Return the residuals, and their derivatives by the unknowns."""
        errors, jacobian = self._evaluate_lists(solved, unknowns.tolist())
        return np.array(errors), jacobian

    def _evaluate_lists(
        self, solved: LinkState, unknowns: Sequence[float]
    ) -> tuple[tuple[float, ...], Array]:
        numbers = [*solved.coordinates, *solved.pins, *unknowns]
        if self._straight is None:
            self._straight = _CompiledSystem(
                self._constraints, numbers, len(solved.coordinates), len(unknowns)
            )
        return self._straight.residuals_at(numbers)

    def _known_at(self, inputs: Sequence[float]) -> LinkState | None:
        """Return the state of the links solved before this step, or None."""
        solved = LinkState([0.0, *inputs], [])
        for step in self._before:
            if not step.close(solved).status.has_pose:
                return None
        return solved

    def _moving_at(
        self, inputs: Sequence[float], rates: Sequence[float] = (1.0,)
    ) -> tuple[LinkState, LinkState] | None:
        """Return the state of the links solved before and its rates, or None."""
        known, speeds = LinkState([0.0, *inputs], []), LinkState([0.0, *rates], [])
        for step in self._before:
            pose = step.close(known)
            if not pose.status.has_rates:
                return None
            step.rates(pose, known, speeds)
        return known, speeds

    def _start_at(self, inputs: Sequence[float]) -> Start | None:
        """Return where Newton's method starts; None if the assembly does not lead there."""
        if len(inputs) > 1:
            return self._along_a_line(inputs)
        branch = self.branch()
        return None if branch is None else branch.find_start(inputs[0])

    def _along_a_line(self, inputs: Sequence[float]) -> Start | None:
        """Return the start on the straight line from the pose's inputs to several inputs."""
        solution = self.solution()
        if solution is None:
            return None
        ways = [value - begin for value, begin in zip(inputs, self.inputs, strict=True)]
        length = hypot(*ways)
        still = np.zeros_like(solution)
        if not length:
            return Start(solution, inf, still, False)
        rates = [way / length for way in ways]

        def inputs_at(x: float) -> list[float]:
            return [begin + x * rate for begin, rate in zip(self.inputs, rates, strict=True)]

        continuation = Continuation(
            self._constraints,
            lambda x: self._known_at(inputs_at(x)),
            lambda x: self._moving_at(inputs_at(x), rates),
        )
        node = continuation.first_node(solution, 0.0)
        if node is None:
            return None
        cell = None
        for cell in continuation.follow_cells(node, 1.0, length):
            if cell.folds:
                return None
        if cell is None or cell.end.place[-1] < length:
            return None
        size = float(np.abs(cell.end.place - cell.begin.place).max())
        return Start(cell.end.place[:-1], 0.2 * size, still, False)

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

    def _nearest_open_pose(self, solved: LinkState, inputs: Sequence[float]) -> IteratedPose:
        """
        Return how near the links come, descending from the end of their assembly.

        If they would close, but in another assembly or after another number of turns, the closure
        error is the one at that end.
        """
        branch = self.branch() if len(inputs) == 1 else None
        end = None if branch is None else branch.nearest_end(inputs[0])
        unknowns = self._start if end is None else end
        errors, jacobian = self._evaluate_system(solved, unknowns)
        first = float(np.abs(errors).max())
        for _ in range(20):
            step = np.linalg.lstsq(jacobian, -errors, rcond=1e-6)[0]
            step *= min(1.0, 0.1 / max(float(np.abs(step).max()), 1e-300))
            trial, slope = self._evaluate_system(solved, unknowns + step)
            if np.abs(trial).max() >= np.abs(errors).max():
                break
            unknowns, errors, jacobian = unknowns + step, trial, slope
        gap = float(np.abs(errors).max())
        return IteratedPose(
            Status.OPEN, gap if gap > _MOVED else first, unknowns.tolist(), jacobian
        )


class _CompiledSystem:
    """
    The constraints and their derivatives as straight-line code.

    Most derivatives are constants, such as 0 and 1; only the others are evaluated.

    ``numbers`` are coordinates, pins and unknowns, in this order, at which the constraints can be
    evaluated; ``coordinates`` and ``unknowns`` say how many there are.
    """

    def __init__(
        self,
        constraints: Sequence[Constraint],
        numbers: Sequence[complex],
        coordinates: int,
        unknowns: int,
    ) -> None:
        def list_constants(*values: Any) -> list[float]:
            state = LinkState(list(values[:coordinates]), list(values[coordinates:-unknowns]))
            errors, rows = evaluate_constraints(constraints, values[-unknowns:], state)
            return [*errors, *(slope for row in rows for slope in row)]

        self._function = compile_function(list_constants, numbers)
        self._count = unknowns
        self._constants = np.array(self._function.results[unknowns:])
        self._places = np.array([place - unknowns for place in self._function.places[unknowns:]])

    def residuals_at(self, numbers: Sequence[complex]) -> tuple[tuple[float, ...], Array]:
        """Return the residuals, all of which vary, and the Jacobian."""
        n = self._count
        varying = self._function.varying(*numbers)
        jacobian = self._constants.copy()
        jacobian[self._places] = varying[n:]
        return varying[:n], jacobian.reshape(n, n)


def _greatest_magnitude(values: Sequence[float]) -> float:
    """Return the greatest absolute value; NaN if any value is NaN."""
    return nan if isnan(sum(values)) else max(map(abs, values))


def _body_places(values: Sequence[float]) -> list[complex]:
    return [x + 1j * y for x, y in zip(values[1::3], values[2::3], strict=True)]


def _reciprocal_condition(jacobian: Array) -> float:
    values = np.linalg.svd(jacobian, compute_uv=False)
    return float(values[-1] / values[0])


def _cancel_drift(pose: IteratedPose, drift: Sequence[float]) -> list[float]:
    """Return the rates of the unknowns that cancel the drift of the constraints."""
    rates = call(_solve_linear, pose.jacobian, *drift)
    return [rates[i] for i in range(len(drift))]


def _solve_linear(jacobian: Array, *drift: float) -> list[float]:
    rates: list[float] = np.linalg.solve(jacobian, np.negative(drift)).tolist()
    return rates


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
    start = _initial_guess(linkage, links, planner, places, angles)
    far = sum(
        max(abs(one - other) for one in points.values() for other in points.values())
        for points in planner.points.values()
    )
    slides = tuple(constraints.slides.values())
    return Iteration(tuple(constraints.constraints), slides, inputs, start, before, sliding, far)


def _initial_guess(
    linkage: Linkage,
    links: Sequence[str],
    planner: SolvedLinks,
    given: Mapping[str, complex],
    angles: dict[str, float],
) -> list[float]:
    """Return angle and place of each link, fitted to the given places of points."""
    points = planner.points

    def by_slider(link: str) -> float | None:
        """Return the angle of a link from its slider: by the other link or by the direction."""
        for name, slider in linkage.sliders.items():
            block, rail = planner.blocks[name], slider.along
            ends = slider.through, slider.point
            if link not in (block, rail):
                continue
            turn = slider.angle if link == block else 0.0
            if all(end in given for end in ends) and given[ends[0]] != given[ends[1]]:
                along = given[ends[1]] - given[ends[0]]
                return phase(along / complex(*slider.direction)) + turn
            if link == block:
                return angle_of(rail) + turn
            if block in angles:
                return angles[block] - slider.angle
        return None

    def angle_of(link: str) -> float:
        if link not in angles:
            known = [name for name in points[link] if name in given]
            apart = [n for n in known[1:] if points[link][n] != points[link][known[0]]]
            if apart:
                there = given[apart[0]] - given[known[0]]
                angles[link] = phase(there / (points[link][apart[0]] - points[link][known[0]]))
            else:
                angle = by_slider(link)
                if angle is None:
                    raise DefinitionError(
                        'pose.points',
                        f'does not say where {link!r} lies',
                        f'give two of its points: {list_names(points[link])}',
                    )
                angles[link] = angle
        return angles[link]

    start: list[float] = []
    for link in links:
        angle = angle_of(link)
        known = next((name for name in points[link] if name in given), None)
        if known is None:
            raise DefinitionError(
                'pose.points', f'does not say where {link!r} lies', 'give one of its points'
            )
        first = next(iter(points[link].values()))
        place = given[known] + rect(1.0, angle) * (first - points[link][known])
        start += (angle, place.real, place.imag)
    return start
