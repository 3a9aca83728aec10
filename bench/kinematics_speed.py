# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""How fast linkages are solved with acceleration: one state at a time, and a million at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import tau
from pathlib import Path

from bench.in_turn import compare, in_turn
from bench.kinematics_compiled import Array, compiled, compiler
from bench.kinematics_pylinkage import AVAILABLE, HAS_NUMBA, stepping
from bench.kinematics_straight import straight_line
from bench.processes import BenchError, ROOT
from bench.report import say, Table
from linkage_ros.kinematics.batch import Batch
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.structure import Iterated
from linkage_ros.kinematics.survey import usual_inputs
from linkage_ros.scene.linkage_file import read_linkage
from linkage_ros.scene.yaml_file import read_yaml
import numpy as np
from numpy.typing import ArrayLike

LENGTHS = (0.04, 0.12, 0.08, 0.1)
"""Crank, coupler, rocker and ground of config/linkages/four_bar.yaml."""

RATE, ACCELERATION = 3.0, 0.5

_AGREEMENT = 1e-9
"""What results of two contenders may differ by; else they did not do the same."""


@dataclass(frozen=True, slots=True)
class SpeedPlan:
    """
    How much is measured.

    Attributes
    ----------
    rounds
        How often each is measured, in turn.
    states
        States that are solved one at a time, in a round.
    batch
        States of a batch.

    """

    rounds: int
    states: int
    batch: int


def measure_speed(folder: Path, plan: SpeedPlan) -> Table:
    """
    Measure all and return the table.

    Parameters
    ----------
    folder
        Where what is compiled goes.
    plan
        How much is measured.

    """
    table = Table(
        f'linkages solved with acceleration, one run, in turn; batch of {plan.batch:,} states',
        ('', 'first', 'second', 'ratio', 'target'),
    )
    _one_at_a_time(plan, table)
    _batches(plan, table)
    if compiler():
        for file in sorted((ROOT / 'config' / 'linkages').glob('*.yaml')):
            _beside_c(folder, plan, table, file.stem)
    else:
        say('  no C compiler (cc): left out')
    return table


def _one_at_a_time(plan: SpeedPlan, table: Table) -> None:
    four_bar, leg = (_closure(name) for name in ('four_bar', 'jansen_leg'))
    line = straight_line(*LENGTHS, 1.0)
    angles = [tau * i / plan.states for i in range(plan.states)]
    for angle in angles[:: plan.states // 10]:
        for one, other in zip(
            _solve(four_bar, angle), line(angle, RATE, ACCELERATION), strict=True
        ):
            _agree('straight line', one, other)

    def straight() -> None:
        for angle in angles:
            line(angle, RATE, ACCELERATION)

    contenders: dict[str, Callable[[], object]] = {
        'straight line': straight,
        'four-bar': lambda: _walk(four_bar, angles),
        'Jansen leg': lambda: _walk(leg, angles),
    }
    if AVAILABLE:
        contenders['pylinkage'], _ = stepping(*LENGTHS, plan.states, RATE, ACCELERATION)
    else:
        say('  pylinkage is not installed: left out')
    times = {
        name: [1e6 * seconds / plan.states for seconds in found]
        for name, found in in_turn(contenders, plan.rounds).items()
    }
    for first, second, target in (
        ('four-bar', 'straight line', '≤ 2'),
        ('pylinkage', 'four-bar', '≥ 6'),
        ('Jansen leg', 'four-bar', '≤ 6'),
    ):
        if first in times:
            compare(table, 'µs a state', first, second, times, target)


def _batches(plan: SpeedPlan, table: Table) -> None:
    if not AVAILABLE:
        return
    four_bar = _closure('four_bar')
    phi = np.linspace(0.0, tau, plan.batch)
    out = _batch(four_bar, plan.batch)

    def solve_all() -> Batch:
        return four_bar.solve(phi, rates=RATE, accelerations=ACCELERATION, out=out)

    count = plan.batch
    if not HAS_NUMBA:
        say('  pylinkage has no numba: a hundredth of the batch')
        count //= 100
    _, theirs = stepping(*LENGTHS, count, RATE, ACCELERATION)
    found = in_turn({'numpy': solve_all, 'pylinkage': theirs}, plan.rounds)
    counts = {'numpy': plan.batch, 'pylinkage': count}
    compare(table, 'Mstates/s', 'numpy', 'pylinkage', _speeds(found, counts), '≥ 6')


def _beside_c(folder: Path, plan: SpeedPlan, table: Table, name: str) -> None:
    """Set a linkage solved in arrays beside the C that is compiled from it."""
    closure = _closure(name)
    if any(isinstance(group, Iterated) for group in closure.structure.groups):
        return
    n = len(closure.linkage.inputs)
    count = plan.batch if name == 'four_bar' else plan.batch // 10
    inputs = _states(closure, count)
    ours, theirs = _batch(closure, count), _batch(closure, count)
    solve = compiled(folder, name, closure)

    def in_arrays() -> None:
        closure.solve(*inputs, rates=(RATE,) * n, accelerations=(ACCELERATION,) * n, out=ours)

    def in_c() -> None:
        solve(inputs, RATE, ACCELERATION, theirs)

    in_arrays()
    in_c()
    if not np.array_equal(ours.status, theirs.status) or ours.status.any():
        raise BenchError(f'{name}: not all states are closed')
    for one, other in zip(ours[1:], theirs[1:], strict=True):
        _agree(f'{name} in C', one, other)
    found = in_turn({'numpy': in_arrays, 'C': in_c}, plan.rounds)
    target = '≥ 0.9' if name == 'four_bar' else '≥ 0.5'
    speeds = _speeds(found, dict.fromkeys(found, count))
    compare(table, f'{name}, Mstates/s', 'numpy', 'C', speeds, target)


def _batch(closure: Closure, count: int) -> Batch:
    numbers = np.empty((3, len(closure.linkage.joints), count))
    return Batch(np.empty(count, np.uint8), *numbers)


def _states(closure: Closure, count: int) -> list[Array]:
    """Return closed states: over the widest range, or near the usual ones of several inputs."""
    if len(closure.linkage.inputs) > 1:
        near = np.linspace(-0.1, 0.1, count)
        return [value + near for value in usual_inputs(closure)]
    widest = max(closure.closing_ranges, key=lambda each: each.highest - each.lowest)
    # Off the ends, where there may be a toggle.
    clear = 0.05 * (widest.highest - widest.lowest)
    return [np.linspace(widest.lowest + clear, widest.highest - clear, count)]


def _speeds(
    found: Mapping[str, Sequence[float]], counts: Mapping[str, int]
) -> dict[str, list[float]]:
    return {name: [counts[name] / s / 1e6 for s in times] for name, times in found.items()}


def _closure(name: str) -> Closure:
    content, _ = read_yaml(ROOT / 'config' / 'linkages' / f'{name}.yaml')
    return Closure(read_linkage(content))


def _solve(closure: Closure, angle: float) -> tuple[tuple[float, ...], ...]:
    position = closure.position(angle)
    velocity = closure.velocity(position, RATE)
    acceleration = closure.acceleration(position, velocity, ACCELERATION)
    return position.joints, velocity.joints, acceleration.joints


def _walk(closure: Closure, angles: Sequence[float]) -> None:
    solve_position, solve_velocity = closure.position, closure.velocity
    solve_acceleration = closure.acceleration
    for angle in angles:
        position = solve_position(angle)
        velocity = solve_velocity(position, RATE)
        solve_acceleration(position, velocity, ACCELERATION)


def _agree(name: str, one: ArrayLike, other: ArrayLike) -> None:
    difference = float(np.max(np.abs(np.remainder(np.subtract(one, other) + 1.0, tau) - 1.0)))
    if not difference < _AGREEMENT:
        raise BenchError(f'{name}: differs by {difference:.2g}')
