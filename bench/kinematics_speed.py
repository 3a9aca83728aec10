# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Speed of solving linkages with accelerations: one state at a time, and a million at once.

They are compared with pylinkage, and with the formulas of a four-bar in one straight-line function
without status, pose and steps. That function is valid for linkages whose crank turns fully and
passes no change point. Its arithmetic is that of `linkage_ros.kinematics.plane.dyads.rrr` over
`linkage_ros.kinematics.plane.diagonals`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from math import atan2, cos, sin, sqrt, tau

from bench import ROOT
from bench.processes import MeasurementError
from bench.report import compare, in_turn, say, Table
from linkage_ros.description import load
from linkage_ros.kinematics import Batch, Closure
from linkage_ros.kinematics.compiling import Compiled
import numpy as np
from numpy.typing import ArrayLike

try:
    from pylinkage.actuators import Crank
    from pylinkage.components import Ground
    from pylinkage.dyads import RRRDyad
    from pylinkage.simulation import Linkage
except ImportError:
    AVAILABLE = False
else:
    AVAILABLE = True

HAS_NUMBA = find_spec('numba') is not None
"""With this package pylinkage compiles the solution of all states in one call."""


def stepping(
    a: float, b: float, c: float, d: float, steps: int, rate: float, acceleration: float
) -> tuple[Callable[[], object], Callable[[], object]]:
    """
    Return two functions that turn a four-bar once: state by state, and in one call.

    Both compute positions, velocities and accelerations of its pins in so many steps a turn, from
    crank, coupler, rocker and ground, and the rate and acceleration of the crank.
    """
    pivot, other = Ground(0.0, 0.0), Ground(d, 0.0)
    crank = Crank(anchor=pivot, radius=a, angular_velocity=tau / steps)
    pin = RRRDyad(anchor1=crank.output, anchor2=other, distance1=b, distance2=c)
    linkage = Linkage([pivot, other, crank, pin])
    linkage.set_input_velocity(crank, rate, acceleration)

    def one_by_one() -> None:
        for _ in linkage.step_with_derivatives(iterations=steps):
            pass

    def at_once() -> object:
        return linkage.step_fast_with_kinematics(iterations=steps)

    return one_by_one, at_once


Joints = tuple[float, float]
Solve = Callable[[float, float, float], tuple[Joints, Joints, Joints]]
"""Takes angle, rate and acceleration of the crank and returns those of both joints."""


def straight_line(a: float, b: float, c: float, d: float, sign: float) -> Solve:
    """Return the function of the four-bar with crank a, coupler b, rocker c and ground d."""
    twice_a, apart, apart_square, root = 2.0 * a, d - a, (d - a) * (d - a), 2.0 * sqrt(a * d)
    fold = (abs(d - a) - abs(b - c)) * (abs(d - a) + abs(b - c))
    stretch = (b + c - a - d) * (a + b + c + d)
    difference, lengths = (b - c) * (b + c), (d - a) * (d + a)
    constant_more, constant_less = difference + apart_square, difference - apart_square
    along = a * (d - a)

    def solve(phi: float, rate: float, acceleration: float) -> tuple[Joints, Joints, Joints]:
        half = 0.5 * phi
        half_sine, half_cosine = sin(half), cos(half)
        near, far = root * half_sine, root * half_cosine
        near_square, far_square = near * near, far * far
        square = apart_square + near_square
        fold_root, stretch_root = sqrt(fold + near_square), sqrt(stretch + far_square)
        cross = sign * fold_root * stretch_root
        direction = atan2(
            -twice_a * half_sine * half_cosine, apart + twice_a * half_sine * half_sine
        )
        more, less = constant_more + near_square, constant_less - near_square
        coupler = direction + atan2(cross, more)
        rocker = direction + atan2(cross, less)

        p, q = (along - 0.5 * near * near) / square, 0.5 * near * far / square
        cot_beta, cot_gamma = more / cross, less / cross
        coupler_part, rocker_part = q * cot_gamma - p, q * cot_beta - p

        bend = fold * (far / fold_root) * (far / fold_root)
        bend -= stretch * (near / stretch_root) * (near / stretch_root)
        bend = 0.25 * bend / square
        swirl = q * (lengths / square) - 2.0 * q * (q * (difference / cross))
        whirl = rate * rate
        return (
            (coupler - phi, rocker),
            (rate * coupler_part - rate, rate * rocker_part),
            (
                acceleration * coupler_part + whirl * (swirl + cot_gamma * bend) - acceleration,
                acceleration * rocker_part + whirl * (swirl + cot_beta * bend),
            ),
        )

    return solve


LENGTHS = (0.04, 0.12, 0.08, 0.1)
"""Crank, coupler, rocker and ground of config/linkages/four_bar.yaml."""

RATE, ACCELERATION = 3.0, 0.5

_AGREEMENT = 1e-9
"""Maximum difference between the results of two contenders; more means that one is wrong."""


@dataclass(frozen=True, slots=True)
class SpeedPlan:
    """Amount of the measurement."""

    rounds: int  # Number of measurements of each, in turn
    states: int  # Number of states solved one at a time, per round
    batch: int  # Number of states of a batch


def measure_speed(plan: SpeedPlan) -> Table:
    """Measure all and return the table."""
    table = Table(
        f'linkages solved with acceleration, one run, in turn; batch of {plan.batch:,} states',
        ('', 'first', 'second', 'ratio', 'target'),
    )
    _one_at_a_time(plan, table)
    _batches(plan, table)
    return table


def _one_at_a_time(plan: SpeedPlan, table: Table) -> None:
    four_bar, leg = (Compiled(_closure(name), 2).fast for name in ('four_bar', 'jansen_leg'))
    line = straight_line(*LENGTHS, 1.0)
    angles = [tau * i / plan.states for i in range(plan.states)]
    for angle in angles[:: plan.states // 10]:
        found = four_bar(angle, RATE, ACCELERATION)
        if found is None:
            raise MeasurementError('four-bar: leaves the compiled function')
        for one, other in zip(found, line(angle, RATE, ACCELERATION), strict=True):
            _agree('straight line', one, other)

    def all_of(solve: Callable[[float, float, float], object]) -> Callable[[], None]:
        def run() -> None:
            for angle in angles:
                solve(angle, RATE, ACCELERATION)

        return run

    contenders: dict[str, Callable[[], object]] = {
        'straight line': all_of(line),
        'four-bar': all_of(four_bar),
        'Jansen leg': all_of(leg),
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
        ('four-bar', 'straight line', '≤ 1.2'),
        ('pylinkage', 'four-bar', '≥ 8'),
        ('Jansen leg', 'four-bar', '≤ 4'),
    ):
        if first in times:
            compare(table, 'µs a state', first, second, times, target)


def _batches(plan: SpeedPlan, table: Table) -> None:
    four_bar = _closure('four_bar')
    phi = np.linspace(0.0, tau, plan.batch)
    out = Batch(np.empty(plan.batch, np.uint8), *np.empty((3, 2, plan.batch)))

    def solve_all() -> Batch:
        return four_bar.solve(phi, rates=RATE, accelerations=ACCELERATION, out=out)

    if not AVAILABLE:
        return
    counts = {'numpy': plan.batch, 'pylinkage': plan.batch}
    if not HAS_NUMBA:
        say('  pylinkage has no numba: a hundredth of the batch')
        counts['pylinkage'] = plan.batch // 100
    _, stepped = stepping(*LENGTHS, counts['pylinkage'], RATE, ACCELERATION)
    speeds = {
        name: [counts[name] / seconds / 1e6 for seconds in found]
        for name, found in in_turn({'numpy': solve_all, 'pylinkage': stepped}, plan.rounds).items()
    }
    compare(table, 'Mstates/s', 'numpy', 'pylinkage', speeds, '≥ 6')


def _closure(name: str) -> Closure:
    return load(ROOT / 'config' / 'linkages' / f'{name}.yaml')


def _agree(name: str, one: ArrayLike, other: ArrayLike) -> None:
    difference = float(np.max(np.abs(np.remainder(np.subtract(one, other) + 1.0, tau) - 1.0)))
    if not difference < _AGREEMENT:
        raise MeasurementError(f'{name}: differs by {difference:.2g}')
