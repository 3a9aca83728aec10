# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Compare the package's solution of one linkage with the equations and the geometry."""

from __future__ import annotations

from math import tau
import random
from typing import Any, NamedTuple

from campaigns.tally import Judgement, QUANTITIES
from campaigns.topologies.constraints import (
    Array,
    condition_numbers,
    Equations,
    Motion,
    Real,
    TURN,
    UNIT_ROUNDOFF,
)
from campaigns.topologies.geometry import Geometry, Places
from campaigns.topologies.topology import follow, Topology, Walks
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import Closure, GROUND, Status
import numpy as np

STATES = 16
"""Number of states at which each linkage is solved."""

_AT_LIMIT = 1e-12
"""Relative to a dyad's lengths. With a smaller margin any status is accepted."""

_ILL = 1e9
"""Condition number above which nothing is compared: rounding causes an error of 1e-7."""

LIMIT = 16.0
"""In u·κ. A greater error is a finding; κ is an estimate from five draws, and may be too small."""

_GROSS = 1e6
"""In u·κ. A position with a greater error belongs to another pose."""

_BESIDE = 1e-4
"""Distance of the states on both sides of a change point, in [rad]."""

_STILL = 2.0**-10
"""Least κ of a joint, relative to the greatest κ of the state."""

CLOSED, OPEN, AT_LIMIT, UNKNOWN = 'closed', 'open', 'at limit', 'unknown'


class States(NamedTuple):
    """Inputs with their rates and accelerations, (inputs, N) each."""

    inputs: Array
    rates: Array
    accelerations: Array


class Truth:
    """Solution of the equations for some states: which of them close, and the poses there."""

    def __init__(self, topology: Topology, inputs: Array, walks: Walks | None = None) -> None:
        self.equations = Equations(topology.linkage)
        self.inputs = inputs
        if topology.groups is None:
            unknowns, self.state = follow(topology, self.equations, inputs, walks)
            self.missed = np.full(inputs.shape[1], np.nan)
        else:
            geometry = Geometry(topology.linkage, topology.groups, topology.sides)
            places = geometry.place(inputs)
            self.state, self.missed = _decide(places, inputs.shape[1])
            unknowns = self.equations.unknowns(
                {link: _pose(places, link) for link in self.equations.links}
            )
        self.unknowns = unknowns
        closed = self.state == CLOSED
        solved, good = self.equations.correct(unknowns[:, closed], inputs[:, closed])
        self.unknowns[:, closed] = solved
        index = np.flatnonzero(closed)
        self.state[index[~good]] = AT_LIMIT


def _pose(places: Places, link: str) -> tuple[Array, Array, Array]:
    unit, origin = places.units[link], places.origins[link]
    return np.angle(unit), origin.real, origin.imag


def _decide(places: Places, count: int) -> tuple[Array, Array]:
    """Return the states by the first dyad that does not close, and its closure error, in [m]."""
    state = np.full(count, CLOSED, object)
    missed = np.full(count, np.nan)
    for margin in places.margins:
        with np.errstate(invalid='ignore'):
            near = np.abs(margin.spare) <= _AT_LIMIT * margin.grain
            off = margin.spare < -_AT_LIMIT * margin.grain
        undecided = state == CLOSED
        state[undecided & off] = OPEN
        missed[undecided & off] = -margin.spare[undecided & off]
        state[undecided & near] = AT_LIMIT
        state[undecided & ~np.isfinite(margin.spare)] = AT_LIMIT
    return state, missed


def judge_states(
    topology: Topology,
    closure: Closure,
    rng: random.Random,
    findings: Judgement,
    walks: Walks | None,
) -> None:
    """Compare positions, rates, accelerations and statuses at random states."""
    inputs = np.array([_values(topology, rng, i) for i in range(len(topology.start))], Real)
    rates, accelerations = (
        np.array([[rng.gauss(0.0, 1.0) for _ in range(STATES)] for _ in inputs], Real)
        for _ in range(2)
    )
    states = States(inputs, rates, accelerations)
    truth = Truth(topology, inputs, walks)
    answers = _scalar_answers(closure, states, findings)
    _compare_arrays(closure, states, answers, truth, findings)
    _compare(topology, closure, truth, answers, states, findings)
    for at in topology.change_points:
        _judge_change_point(topology, closure, at, findings)


def closure_of(topology: Topology, findings: Judgement) -> Closure | None:
    """Return the closure of a linkage that closes by construction."""
    try:
        return Closure(topology.linkage)
    except DefinitionError as error:
        findings.find('refused', str(error))
    except Exception as error:  # noqa: BLE001 - any exception is counted
        findings.find('traceback: Closure', repr(error))
    return None


def _values(topology: Topology, rng: random.Random, number: int) -> list[float]:
    """Return values of an input: that of the pose it was made in, near it, and anywhere."""
    start, step = topology.start[number], topology.step[number]
    turning = not topology.linkage.inputs[number].slider
    values = [start]
    while len(values) < STATES // 2 + 1:
        values.append(start + rng.gauss(0.0, step))
    while len(values) < STATES:
        # Class III is followed for one turn about its pose; dyads have no such limit.
        far = tau / 2 if topology.groups is None else tau
        values.append(start + rng.uniform(-far, far) if turning else start * rng.uniform(-2, 3))
    return values


def _scalar_answers(
    closure: Closure, states: States, findings: Judgement
) -> list[tuple[Any, tuple[tuple[float, ...], ...]] | None]:
    """Return the position and joints with their derivatives; None for an exception."""
    answers: list[tuple[Any, tuple[tuple[float, ...], ...]] | None] = []
    for k in range(STATES):
        x, v, a = ([float(value) for value in row[:, k]] for row in states)
        call = 'position'
        try:
            position = closure.position(*x)
            joints: tuple[tuple[float, ...], ...] = (position.joints,)
            if position.status.has_rates:
                call = 'velocity'
                velocity = closure.velocity(position, *v)
                call = 'acceleration'
                acceleration = closure.acceleration(position, velocity, *a)
                joints = (position.joints, velocity.joints, acceleration.joints)
        except Exception as error:  # noqa: BLE001 - any exception is counted
            findings.find(f'traceback: {call}', f'at {x}: {error!r}')
            answers.append(None)
            continue
        answers.append((position, joints))
    return answers


def _compare_arrays(
    closure: Closure, states: States, answers: list[Any], truth: Truth, findings: Judgement
) -> None:
    """Compare the solution of arrays with that of single states."""
    from linkage_ros.kinematics import CODES  # local import: with numpy only

    inputs, rates, accelerations = (values.astype(float) for values in states)
    try:
        for derivatives in (0, 1, 2):
            batch = closure.solve(
                *inputs, rates=rates, accelerations=accelerations, derivatives=derivatives
            )
    except Exception as error:  # noqa: BLE001 - any exception is counted
        findings.find('traceback: solve', f'derivatives={derivatives}: {error!r}')
        return
    for k, answer in enumerate(answers):
        if answer is None or truth.state[k] in (AT_LIMIT, UNKNOWN):
            continue
        position, joints = answer
        if CODES[position.status] != batch.status[k]:
            note = f'at {inputs[:, k].tolist()}: {position.status} and {batch.status[k]}'
            findings.find('arrays: status', note)
            continue
        for name, one, many in zip(QUANTITIES, joints, batch[1:], strict=False):
            if not one or many is None:
                continue
            off = np.abs(many[:, k] - np.array(one))
            # Far from a toggle the two differ by rounding only.
            if not (off <= 1e-6 * (1.0 + np.abs(one).max())).all():
                findings.find(f'arrays: {name}', f'at {inputs[:, k].tolist()}: {off.max():.2g}')


def _compare(
    topology: Topology,
    closure: Closure,
    truth: Truth,
    answers: list[Any],
    states: States,
    findings: Judgement,
) -> None:
    closed = []
    for k, answer in enumerate(answers):
        if answer is None:
            continue
        position, state = answer[0], truth.state[k]
        at = f'at {[float(v) for v in truth.inputs[:, k]]}'
        findings.counts[f'states {state}'] += 1
        if state in (AT_LIMIT, UNKNOWN):
            continue
        if state == OPEN:
            if position.joints:
                findings.find('false closure', f'{at}: {position.status.name}, but is open')
            elif topology.groups is not None:
                missed = truth.missed[k]
                if not abs(position.gap - missed) <= 1e-9 * (missed + closure.scale):
                    findings.find('gap', f'{at}: {position.gap:.6g}, in truth {missed:.6g}')
            continue
        closed.append(k)
    if not closed:
        return
    inputs, rates, accelerations = (values[:, closed] for values in states)
    motion = truth.equations.motion(truth.unknowns[:, closed], inputs, rates, accelerations)
    kappa = condition_numbers(topology.linkage, motion, inputs, rates, accelerations, 1)
    for column, k in enumerate(closed):
        at = f'at {[float(v) for v in inputs[:, column]]}'
        position, joints = answers[k]
        if not kappa[0][:, column].max() < _ILL * max(1.0, closure.scale):
            findings.counts['states ill'] += 1
            continue
        if not position.status.has_rates:
            findings.find('missed closure', f'{at}: {position.status.name}, but closes')
            continue
        errors = []
        for order, values in enumerate(joints):
            off = np.array(values, Real) - motion.joints[order][:, column]
            condition = kappa[order][:, column]
            if order == 0:
                turns = np.array(closure.turning)
                off[turns] -= TURN * np.round(off[turns] / TURN)
                condition = condition + np.where(turns, np.pi + np.abs(values), 0.0)
            off = np.abs(off)
            # A joint that does not move is computed from terms that do.
            condition = np.maximum(condition, max(_STILL * condition.max(), 1e-300))
            errors.append(
                float(np.nan_to_num(off / (UNIT_ROUNDOFF * condition), nan=np.inf).max())
            )
        if errors[0] > _GROSS:
            _other_pose(topology, closure, truth, position, inputs[:, [column]], at, findings)
            continue
        for name, error in zip(QUANTITIES, errors, strict=True):
            findings.note_errors(name, k, [error])
            if error > LIMIT:
                findings.find(f'error: {name}', f'{at}: {error:.3g} u·κ')
        if column == 0:
            _compare_points(closure, truth.equations, motion, position, at, findings)


def _other_pose(
    topology: Topology,
    closure: Closure,
    truth: Truth,
    position: Any,
    inputs: Array,
    at: str,
    findings: Judgement,
) -> None:
    """Find out whether a wrong pose closes at all."""
    residual = closure.residual(position)
    if residual < 1e-9 * closure.scale * max(1.0, truth.equations.size / closure.scale):
        findings.find('wrong assembly', f'{at}: {dict(topology.linkage.assembly) or "class III"}')
    else:
        findings.find('not closed', f'{at}: reported as closed, off by {residual:.2g} m')


def _compare_points(
    closure: Any,
    equations: Equations,
    motion: Motion,
    position: Any,
    at: str,
    findings: Judgement,
) -> None:
    """Compare the positions of all points."""
    angles = motion.unknowns[0::3, 0]
    places = closure.points(position)
    worst = 0.0
    for (link, point), place in places.items():
        if link not in closure.linkage.links:
            continue
        x, y = closure.linkage.links[link][point]
        true = complex(x, y)
        if link != GROUND:
            i = equations.links.index(link)
            turn = complex(np.cos(angles[i]), np.sin(angles[i]))
            origin = complex(*(float(v) for v in motion.unknowns[slice(3 * i + 1, 3 * i + 3), 0]))
            true = origin + turn * true
        worst = max(worst, abs(place - true))
    if not worst < 1e-6 * (closure.scale + equations.size):
        findings.find('points', f'{at}: off by {worst:.2g} m')


def _judge_change_point(
    topology: Topology, closure: Closure, value: float, findings: Judgement
) -> None:
    """Compare a passed change point with the states close to it on both sides."""
    steps = _BESIDE * np.array([-1, 1, -2, 2], Real)
    beside = value + steps[None, :]
    one, zero = np.ones_like(beside), np.zeros_like(beside)
    truth = Truth(topology, beside)
    if (truth.state != CLOSED).any():
        return
    motion = truth.equations.motion(truth.unknowns, beside, one, zero)
    jumps = np.array(closure.turning)[:, None]
    places = motion.joints[0] - motion.joints[0][:, :1]
    places -= np.where(jumps, TURN * np.round(places / TURN), 0.0)
    wanted, doubt = [], []
    for values in (motion.joints[0][:, :1] + places, motion.joints[1]):
        near, far = values[:, :2].mean(1), values[:, 2:].mean(1)
        wanted.append(near)
        # The error of the mean is a third of its change from the double distance.
        doubt.append(np.abs(far - near))
    try:
        position = closure.position(value)
        if position.status is Status.INDETERMINATE:
            # The pins of a straight rod coincide, exactly or to rounding.
            findings.counts['coincident pins'] += 1
            return
        joints = [position.joints]
        if position.status.has_rates:
            joints.append(closure.velocity(position, 1.0).joints)
    except Exception as error:  # noqa: BLE001 - any exception is counted
        findings.find('traceback: change point', f'at {value}: {error!r}')
        return
    if not position.status.has_pose or (value == 0.0 and not position.status.has_rates):
        findings.find('change point: status', f'at {value}: {position.status.name}')
    for name, values, true, off_by in zip(QUANTITIES, joints, wanted, doubt, strict=False):
        off = np.array(values, Real) - true if values else np.zeros(1, Real)
        if values and name == 'position':
            off -= np.where(jumps[:, 0], TURN * np.round(off / TURN), 0.0)
        if not (np.abs(off) < 1e-5 * (1.0 + np.abs(true).max()) + off_by).all():
            findings.find(f'change point: {name}', f'at {value}: off by {np.abs(off).max():.2g}')
