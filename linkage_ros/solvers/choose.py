# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The cheapest solver that is proven to reach an accuracy of positions, by a short timing.

The closed form always qualifies: its error is a few times the one that rounding the lengths alone
causes. A table qualifies by `table_proof`. Newton's method qualifies for a single RRR dyad: after
a last correction δ the error of the angles is less than::

    (1 + r)·δ²/(2·sin μ)      r the ratio of the two links, sin μ ≥ `LEAST_SINE`

which bounds the second order of the loop (L. V. Kantorovich, 1948). In a chain, errors of one dyad
grow in the next by an unknown factor, so Newton's method is not chosen there.

A solver must be faster by a tenth to replace the closed form. A timing is not repeatable: a
recording stores the choice, and its replay does not choose again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from statistics import median
from time import perf_counter
from typing import Any

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import Closure, Dyad, InputSweep, Iterated, Linkage, usual_inputs
from linkage_ros.solvers.newton import LEAST_SINE, NewtonClosure
from linkage_ros.solvers.solver import Solver, SolverChoice
from linkage_ros.solvers.table import TableClosure

_LONGEST = 0.1
"""Longest timing of one solver, in [s]."""

_STATES = 32
_ROUNDS = 25
_FASTER = 0.9
_NAMES = {'closed_form': 'closed form', 'newton': "Newton's method", 'table': 'table'}


def choose_solver(linkage: Linkage, accuracy: float) -> Closure:
    """Return the fastest closure that is proven to reach an accuracy, in [rad] or [m]."""
    closed = Solver(Closure(linkage))
    able: dict[str, Solver] = {'closed_form': closed}
    against = {}
    for name, build in (('table', TableClosure), ('newton', _build_newton)):
        attempt = _try_solver(build, linkage, accuracy)
        if isinstance(attempt, Solver):
            able[name] = attempt
        else:
            against[name] = attempt
    times = _median_times(closed, able)
    fastest = min(times, key=lambda name: times[name])
    if times[fastest] > _FASTER * times['closed_form']:
        fastest = 'closed_form'
    chosen = able[fastest]
    why = [f'{_NAMES[fastest]}{_proof_text(chosen)}, {1e6 * times[fastest]:.2g} µs a state']
    why += [
        f'{_NAMES[name]} {1e6 * time:.2g} µs' for name, time in times.items() if name != fastest
    ]
    why += [f'{_NAMES[name]}: {reason}' for name, reason in against.items()]
    parameters = {} if fastest == 'closed_form' else {'tolerance': accuracy}
    chosen.choice = SolverChoice(fastest, parameters, '; '.join(why))
    return chosen


def _try_solver(
    build: Callable[[Linkage, float], Solver], linkage: Linkage, accuracy: float
) -> Solver | str:
    """Return a solver that is proven to reach an accuracy, or the reason why there is none."""
    try:
        return build(linkage, accuracy)
    except DefinitionError as error:
        return error.reason


def only_closed_form(linkage: Linkage, why: str) -> Closure:
    """Return the closed form if no other solver is possible, with the reason."""
    closed = Solver(Closure(linkage))
    closed.choice = SolverChoice('closed_form', {}, f'closed form: {why}')
    return closed


def _build_newton(linkage: Linkage, accuracy: float) -> NewtonClosure:
    """Return Newton's method with a tolerance that proves an accuracy, or refuse."""
    newton = NewtonClosure(linkage, accuracy)
    groups = [g for g in newton.structure.groups if isinstance(g, Dyad | Iterated)]
    if len(groups) > 1 or not isinstance(groups[0], Dyad) or groups[0].kind != 'RRR':
        raise DefinitionError('accuracy', 'proven for one RRR dyad only', '')
    dyad = groups[0]
    if any(len(body) > 1 for body in dyad.bodies):
        raise DefinitionError('accuracy', 'not proven for links that change their length', '')
    lengths = []
    for link, outer in zip((dyad.inner.link, dyad.inner.to), dyad.outer, strict=True):
        points = newton.structure.links[link]
        lengths.append(abs(complex(*points[dyad.inner.name]) - complex(*points[outer.name])))
    ratio = max(lengths) / min(lengths)
    if 2.0 * (1.0 + ratio) * accuracy > LEAST_SINE:
        raise DefinitionError('accuracy', 'not proven for such a low accuracy', '')
    return newton


def _proof_text(solver: Solver) -> str:
    if not isinstance(solver, TableClosure):
        return ''
    return f' of {solver.knots} knots, proven to {solver.proven:.2g}'


def _median_times(closed: Closure, able: dict[str, Solver]) -> dict[str, float]:
    """Return the median time of a state of each solver, in [s]; the solvers take turns."""
    states = _trial_states(closed)
    spent: dict[str, list[float]] = {name: [] for name in able}
    # Call each solver as a tick does.
    ways = {
        name: solver.compile_linkage(0).fast if solver.by_steps else solver.position
        for name, solver in able.items()
    }
    for way in ways.values():
        _time_states(way, states)  # work that is done only once is not timed
    for _ in range(_ROUNDS):
        for name, way in ways.items():
            if sum(spent[name]) * len(states) < _LONGEST:
                spent[name].append(_time_states(way, states))
    return {name: median(times) for name, times in spent.items()}


def _time_states(position: Callable[..., Any], states: Sequence[tuple[float, ...]]) -> float:
    begun = perf_counter()
    for inputs in states:
        position(*inputs)
    return (perf_counter() - begun) / len(states)


def _trial_states(closed: Closure) -> list[tuple[float, ...]]:
    """Return inputs to try: along the widest range, or about the pose of several inputs."""
    if len(closed.linkage.inputs) > 1:
        usual = usual_inputs(closed)
        return [tuple(x + 1e-3 * k for x in usual) for k in range(_STATES)]
    interval = InputSweep(closed).widest_range
    assert interval is not None, 'reading the file has proved that it closes somewhere'
    low, high = interval.lowest, interval.highest
    return [(low + (high - low) * (k + 0.5) / _STATES,) for k in range(_STATES)]
