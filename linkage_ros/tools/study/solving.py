# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The error of solving the loops, and what other ways to solve them cost.

The exact joints are from `linkage_ros.tools.study.enclosure`: balls that are proved to hold
the solution. The states are from the scene's own motion. What a scene cannot ask for stands
and, to compare with the closed form: numbers of 32 bits, the textbook form, Newton's method, a
spline through a table, thirty digits; and of links that close only together the steps of Newton's
method, and the size of the cells that these start from. Newton's method is on the constraint
equations, in the places and turns of the links: it shares no formula with the closed form.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from math import inf, sqrt
from time import process_time
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.errors import check_installed, LinkageError
from linkage_ros.kinematics import (
    Closure,
    InputSweep,
    is_iterated,
    PlanarClosure,
    usual_inputs,
)
from linkage_ros.tools.study.budget import JointError, Knob, Price, Setting
from linkage_ros.tools.study.budget_text import error_text
from linkage_ros.tools.study.four_bar_formulas import (
    plain_four_bar,
    Solve,
    solve_by_textbook,
    solve_in_single_precision,
)
from linkage_ros.tools.study.measuring import Candidate, time_in_turn
from linkage_ros.tools.study.member_motion import cranks_at, draw_times, LinkageMotion, size_of
import numpy as np

if TYPE_CHECKING:
    from linkage_ros.tools.study.exact_constraints import ExactConstraints

NAME = 'solving'

CLOSED_FORM, ITERATED = 'closed form', 'iterated'

_STATES, _QUICK_STATES = 48, 12
_TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
_KNOTS = (64, 1024, 16_384)
_ITERATIONS = ((1, 0), (1, 2), (2, 0), (2, 2), (3, 0))
"""Steps of Newton's method, and how often the cells are halved that they start from."""

_QUICK_COMPARED = 2.0
"""Time after which a quick measurement looks at no further method, in [s]."""

_BITS = 104
"""Precision of thirty digits."""

_FAR = 0.1
"""Larger errors, in [rad], mean another pose: the method has failed."""

_MOST = 50
"""Most iterations of Newton's method; more mean no convergence."""

_BEHIND = 0.01
"""How far behind a state Newton's method starts, in [rad] or parts of the size."""


class SolvingMethod(NamedTuple):
    """A way to solve a linkage."""

    label: str
    solve: Solve


def measure_solving(
    motions: Sequence[LinkageMotion],
    rate: float,
    horizon: float,
    *,
    quick: bool = False,
    seconds: float = 2.0,
) -> Knob:
    """
    Return the error of solving the linkages of a scene along their motion.

    The comparisons are made for the first of the motions. The rate is in [Hz], the horizon in [s];
    ``seconds`` is the time for the prices. A ``quick`` measurement takes fewer states.

    A LinkageError is raised if a package for the proof is missing, or nothing can be proved of the
    motion.
    """
    check_installed('flint')
    begun, left_out = process_time(), []
    count = _QUICK_STATES if quick else _STATES
    times = draw_times(horizon, count)
    errors: list[JointError] = []
    candidates: list[tuple[str, JointError, Candidate]] = []
    unproved = 0
    for index, motion in enumerate(motions):
        closure = motion.closure
        states = [
            crank[0]
            for crank in cranks_at(motion, times)
            if crank is not None and motion.closure.position(*crank[0]).joints
        ]
        known, exact = exact_joints(closure, states)
        unproved += len(states) - len(known)
        if not known:
            continue
        own = scene_solver(closure)
        errors.append(compare_solver(closure, own.solve, known, exact)[0])
        if index:
            continue
        candidates.append((own.label, errors[0], _timed_candidate(own.solve, known)))
        for solver in comparison_solvers(closure):
            if quick and process_time() - begun > _QUICK_COMPARED:
                left_out.append('other methods are left out for lack of time')
                break
            error, failed = compare_solver(closure, solver.solve, known, exact)
            if not failed:
                candidates.append((solver.label, error, _timed_candidate(solver.solve, known)))
    if not candidates:
        raise LinkageError(
            'solving',
            'nothing can be proved along the motion: it stays at a toggle or a change point',
            'move it, or leave the errors out: --only effects',
        )
    worst = JointError(
        sqrt(sum(e.rms**2 for e in errors) / len(errors)), max(e.worst for e in errors)
    )
    times_of = time_in_turn([candidate for _, _, candidate in candidates], seconds)
    settings = [
        Setting(label, error, Price(spread.scale(1e6), rate), None)
        for (label, error, _), spread in zip(candidates, times_of, strict=True)
    ]
    settings[0] = settings[0]._replace(error=worst, changes=())
    if unproved:
        left_out.append(f'{unproved} states too near a toggle or change point to be proved')
    return Knob(NAME, settings, 0, note='; '.join(left_out))


def unproved_reason(closure: Closure) -> str:
    """Return why nothing can be proved of a linkage in any state; '' if it can."""
    check_installed('flint')
    from linkage_ros.tools.study.enclosure import (
        constraints_of,  # local import: an optional dependency
    )
    from linkage_ros.tools.study.exact_constraints import (
        SingularError,  # local import: an optional dependency
    )

    if closure.linkage.ratios:
        return 'the reference knows no ratios'
    try:
        constraints_of(closure, usual_inputs(closure))
    except SingularError as error:
        return str(error)
    return ''


def exact_joints(
    closure: Closure, states: Sequence[Sequence[float]]
) -> tuple[list[Sequence[float]], list[Sequence[Any]]]:
    """Return the states at which joints can be proved, and their balls."""
    from linkage_ros.tools.study.enclosure import prove  # local import: an optional dependency
    from linkage_ros.tools.study.exact_constraints import (
        SingularError,  # local import: an optional dependency
    )

    known: list[Sequence[float]] = []
    exact: list[Sequence[Any]] = []
    for state in states:
        try:
            proof = prove(closure, state)
        except (SingularError, ValueError):
            continue
        known.append(state)
        exact.append(proof.joints)
    return known, exact


def compare_solver(
    closure: Closure,
    solve: Solve,
    states: Sequence[Sequence[float]],
    exact: Sequence[Sequence[Any]],
    far: Sequence[float] | None = None,
) -> tuple[JointError, int]:
    """Return the error of a method, and at how many states it has no answer or a wrong one."""
    limits = far or [_FAR] * len(states)
    errors: list[float] = []
    for state, balls, limit in zip(states, exact, limits, strict=True):
        joints = solve(*state)
        error = largest_distance(closure, joints, balls) if len(joints) else inf
        if error <= limit:
            errors.append(error)
    if not errors:
        return JointError(inf, inf), len(states)
    rms = sqrt(sum(error * error for error in errors) / len(errors))
    return JointError(rms, max(errors)), len(states) - len(errors)


def largest_distance(closure: Closure, joints: Sequence[Any], balls: Sequence[Any]) -> float:
    """Return the greatest distance of joints from balls, slides in parts of the size."""
    from flint import arb, ctx  # local import: an optional dependency

    before, ctx.prec = ctx.prec, 512
    try:
        worst = 0.0
        for turning, value, ball in zip(closure.turning, joints, balls, strict=True):
            apart = (value if isinstance(value, arb) else arb(float(value))) - ball
            if turning:
                turn = 2 * arb.pi()
                apart -= turn * round(float((apart / turn).mid()))
                worst = max(worst, abs(float(apart.mid())))
            else:
                worst = max(worst, abs(float(apart.mid())) / size_of(closure.linkage))
    finally:
        ctx.prec = before
    return worst


def scene_solver(closure: Closure) -> SolvingMethod:
    """Return what a scene solves with, as a tick does."""
    compiled = closure.compile_linkage(0)
    fast, plain = compiled.fast, compiled.run_interpreted

    def position(*inputs: float) -> Sequence[Any]:
        (joints,) = fast(*inputs) or plain(*inputs).values or ((),)
        return joints

    return SolvingMethod(ITERATED if is_iterated(closure) else CLOSED_FORM, position)


def comparison_solvers(closure: Closure) -> Iterator[SolvingMethod]:
    """Yield ways to solve a linkage which no scene can ask for."""
    linkage = closure.linkage
    shape = plain_four_bar(linkage) if isinstance(closure, PlanarClosure) else None
    if shape is not None:
        yield SolvingMethod('float32', solve_in_single_precision(shape))
        yield SolvingMethod('textbook form', solve_by_textbook(shape))
    for steps, halvings in _ITERATIONS if is_iterated(closure) else ():
        yield _iterated_solver(closure, steps, halvings)
    for tolerance in _TOLERANCES:
        yield SolvingMethod(
            f'Newton to {error_text(tolerance)}', solve_by_newton(closure, tolerance)
        )
    if len(linkage.inputs) == 1 and find_spec('scipy') is not None:
        for knots in _KNOTS:
            spline = _solve_by_spline(closure, knots)
            if spline is not None:
                yield SolvingMethod(f'spline, {knots:,} knots', spline)
    yield SolvingMethod('30 digits', _solve_to_digits(closure))


def _iterated_solver(closure: Closure, steps: int, halvings: int) -> SolvingMethod:
    """Return what a scene solves with, but by so many steps from cells halved so often."""
    changed = type(closure)(closure.linkage)
    for step in changed.steps:
        step.iterate_by(steps, halvings)
    label = f'{ITERATED}, {steps} step{"s" * (steps > 1)}'
    label += f' from cells 1/{2**halvings} as wide' if halvings else ''
    return SolvingMethod(label, scene_solver(changed).solve)


def _solve_to_digits(closure: Closure) -> Solve:
    from linkage_ros.tools.study.enclosure import solve  # local import: an optional dependency
    from linkage_ros.tools.study.exact_constraints import (
        SingularError,  # local import: an optional dependency
    )

    def position(*inputs: float) -> Sequence[Any]:
        try:
            return solve(closure, inputs, _BITS)
        except (SingularError, ValueError):
            return ()

    return position


def _solve_by_spline(closure: Closure, knots: int) -> Solve | None:
    """Return a cubic spline through states over the widest range; None if it does not close."""
    from scipy.interpolate import CubicSpline  # local import: an optional dependency

    interval = InputSweep(closure).widest_range
    if interval is None:
        return None
    low, width = interval.lowest, interval.highest - interval.lowest
    places = np.linspace(low, low + width, knots + 1)
    inner = 1e-9 * width
    places[0], places[-1] = places[0] + inner, places[-1] - inner
    joints = closure.solve(places, derivatives=0).positions
    if not np.all(np.isfinite(joints)):
        return None
    for row, turning in zip(joints, closure.turning, strict=True):
        if turning:
            row[:] = np.unwrap(row)
    spline = CubicSpline(places, joints.T)
    whole = interval.is_whole

    def position(value: float) -> Sequence[Any]:
        if whole:
            value = low + (value - low) % width
        elif interval.turning:
            value += interval.shift(value)
        joints: Sequence[Any] = spline(value)
        return joints

    return position


def _timed_candidate(solve: Solve, states: Sequence[Sequence[float]]) -> Candidate:
    # In an order that ends next to the first, so that a method finds its start near by.
    forward_and_backward = [*states[::2], *states[1::2][::-1]]

    def run() -> None:
        for state in forward_and_backward:
            solve(*state)

    return Candidate(run, len(forward_and_backward))


class _RoundedConstraints:
    """The constraints at some inputs as sums c·x_i·x_j of doubles."""

    def __init__(self, exact: ExactConstraints) -> None:
        self._exact, self._count = exact, exact.count
        terms = [
            (row, float(factor.mid()), i, j)
            for row, products in enumerate(exact.constraints)
            for (factor, *_), i, j in products
        ]
        rows, factors, first, other = zip(*terms, strict=True)
        self._rows, self._factors = np.array(rows), np.array(factors)
        self._one, self._other = np.array(first), np.array(other)
        # The places of both derivatives of each product in the flat Jacobian.
        width = exact.count + 1
        self._places = np.concatenate(
            [self._rows * width + self._one, self._rows * width + self._other]
        )

    def newton_step(self, unknowns: Any) -> Any:
        """Return a step of Newton's method; the first unknown is 1 and stays."""
        first, second = unknowns[self._one], unknowns[self._other]
        errors = np.bincount(self._rows, self._factors * first * second, self._count)
        slopes = np.concatenate([self._factors * second, self._factors * first])
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
        units = [closure.scale if driven.slider else 1.0 for driven in linkage.inputs]
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
