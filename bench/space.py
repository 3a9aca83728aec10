# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Speed of spatial linkages with accelerations, beside the planar four-bar in the same run."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any

from bench.processes import MeasurementError
from bench.report import compare, in_turn, Table
from linkage_ros.description import load
from linkage_ros.kinematics import Batch, Status
from linkage_ros.kinematics.compiling import Compiled
import numpy as np

RATE, ACCELERATION = 3.0, 0.5
TARGETS = {'rssr': '≤ 1.6', 'delta': '≤ 4', 'ankle': '≤ 5'}
_REACH = 0.3
"""How far states lie from the pose, in [rad] of each input."""
_KNOT, _KNOT_TARGET = 'ankle_motors', '≤ 15'
"""What closes only together, with rates."""


def measure_space(rounds: int, states: int, batch: int) -> Table:
    """Return the time of a state, and the states of a batch in a second, over the four-bar's."""
    table = Table(
        f'spatial linkages with acceleration, one run, in turn; batch of {batch:,} states',
        ('', 'first', 'second', 'ratio', 'target'),
    )
    closures = {name: load(name) for name in ('four_bar', *TARGETS)}
    solvers = {name: _over_states(closure, states) for name, closure in closures.items()}
    times = {
        name: [1e6 * seconds / states for seconds in found]
        for name, found in in_turn(solvers, rounds).items()
    }
    for name, target in TARGETS.items():
        compare(table, 'µs a state', name, 'four_bar', times, target)
    solvers = {name: _over_states(load(name), states, 1) for name in ('four_bar', _KNOT)}
    times = {
        name: [1e6 * seconds / states for seconds in found]
        for name, found in in_turn(solvers, rounds).items()
    }
    compare(table, 'µs a state, with rates', _KNOT, 'four_bar', times, _KNOT_TARGET)
    batches = {name: _over_batch(closures[name], batch) for name in ('four_bar', 'rssr')}
    speeds = {
        name: [batch / seconds / 1e6 for seconds in found]
        for name, found in in_turn(batches, rounds).items()
    }
    compare(table, 'Mstates/s', 'rssr', 'four_bar', speeds, '≥ 0.8')
    return table


def _over_states(closure: Any, count: int, derivatives: int = 2) -> Callable[[], None]:
    """Return a function that solves states about the pose, one at a time."""
    random, solve = Random(closure.name), Compiled(closure, derivatives).fast
    pose = closure.linkage.pose.inputs if closure.linkage.pose else (1.0,)
    given: list[list[float]] = []
    while len(given) < count:
        inputs = [value + random.uniform(-_REACH, _REACH) for value in pose]
        if closure.position(*inputs).status is Status.CLOSED:  # Not beyond limits
            state = [*inputs, *[RATE] * len(pose), *[ACCELERATION] * len(pose)]
            given.append(state[: len(pose) * (1 + derivatives)])
    if any(solve(*state) is None for state in given):
        raise MeasurementError(f'{closure.name}: leaves the compiled function')

    def run() -> None:
        for state in given:
            solve(*state)

    return run


def _over_batch(closure: Any, count: int) -> Callable[[], object]:
    angles = np.linspace(0.0, 2.0 * np.pi, count)
    joints = len(closure.joint_names)
    out = Batch(np.empty(count, np.uint8), *np.empty((3, joints, count)))
    return lambda: closure.solve(angles, rates=RATE, accelerations=ACCELERATION, out=out)
