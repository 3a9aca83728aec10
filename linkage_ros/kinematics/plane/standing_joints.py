# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Where published joints stand although inputs move: the other kind of singularities.

At a toggle the inputs cannot say how the links move; here the links move and the joints do not
say so. A single input has such places for each joint: where it turns back. Several inputs have
them where the Jacobian of all published joints loses rank: its smallest singular value is 0 there.
C. Gosselin, J. Angeles, Singularity analysis of closed-loop kinematic chains, IEEE Transactions on
Robotics and Automation 6 (1990), 281–290.
"""

from __future__ import annotations

from contextlib import suppress
from itertools import product
from typing import Any

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.analysis.crank_branches import crank_branches, joint_output
from linkage_ros.kinematics.analysis.singularity_margin import signed_distance
from linkage_ros.kinematics.analysis.sweep_analysis import follow_grid, inputs_on_grid
from linkage_ros.kinematics.batch import Array, Batch, CODES
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.compiling import Compiled
from linkage_ros.kinematics.status import Status
import numpy as np

_SAME = 1e-9
"""Inputs nearer to each other than this are one, in [rad] or [m]."""

_FEW = 3
"""Most inputs of which a grid is fine enough to search from."""

_NEAR_ZERO, _ROUNDED, _ZERO = 0.25, 2e-6, 1e-7
"""
Upper bounds of the smallest singular value: on the grid next to a zero, where the search ends if
CAD has rounded the lengths, and where it is met.
"""

_ROUNDS, _LESS, _HALVED = 100, 0.999, 8
"""
Rounds of the search: each moves on to a value that is so much less, or halves its steps; and how
often steps may be halved without the value: it falls with them next to a zero.
"""


def turning_points(closure: Closure) -> dict[str, list[float]]:
    """Return for each published joint where it turns back over a single input, in its limits."""
    places_of: dict[str, list[float]] = {}
    compiled = Compiled(closure, 1, within_limits=False)
    for name in closure.joint_names:
        places: list[float] = []
        output = joint_output(closure, name)
        with suppress(DefinitionError):  # It does not move.
            for branch in crank_branches(closure, output, compiled=compiled):
                ends = zip((branch.first, branch.last), branch.turns_back, strict=True)
                for place in (end for end, turns in ends if turns):
                    if all(
                        abs(signed_distance(closure, place, known)) > _SAME for known in places
                    ):
                        places.append(place)
        if places:
            places_of[name] = sorted(places)
    return places_of


def find_standing_state(closure: Closure) -> tuple[float, ...] | None:
    """
    Return inputs at which the Jacobian of the published joints loses rank, in [rad] and [m].

    The search starts where on a grid it is nearest to that. None if it ends elsewhere, and for
    more than three inputs.
    """
    count = len(closure.input_names)
    if not 1 < count <= _FEW or not closure.joint_names:
        return None
    states: list[tuple[float, ...]] = []
    if closure.grids:
        states = [inputs for inputs, _ in follow_grid(closure)]
    grid = np.array(states or [*inputs_on_grid(closure)])
    values = _smallest_singular_values(closure, grid)
    # Symmetrical linkages have several: the first, whatever the last digits are.
    number = int(np.argmin(values.round(9)))
    best, least = grid[number], values[number]
    steps = np.array([np.diff(np.unique(axis)).min(initial=1.0) for axis in grid.T])
    around = np.array([*product((0, -1, 1), repeat=count)])
    halved, before = 0, least
    for _ in range(_ROUNDS if _ROUNDED <= least < _NEAR_ZERO else 0):
        tried = best + steps * around
        values = _smallest_singular_values(closure, tried)
        number = int(np.argmin(values))
        if values[number] < _LESS * least:
            best, least = tried[number], values[number]
        else:
            steps, halved = 0.5 * steps, halved + 1
        if least < 0.5 * before:
            halved, before = 0, least
        if least < _ZERO or halved > _HALVED or steps.max(initial=0.0) < _SAME:
            break
    return tuple(best.tolist()) if least < _ROUNDED else None


def _smallest_singular_values(closure: Closure, inputs: Array) -> Array:
    """
    Return the smallest singular value of the Jacobian at inputs (N, inputs).

    Lengths are in units of the linkage's size. It is infinite where there are no rates, or a
    joint is beyond its limits.
    """

    def solve(at: Array, rates: Array) -> Batch:
        return closure.solve(at, rates=np.tile(rates, (len(at), 1)), derivatives=1)

    # A rate of each input in turn.
    ways = np.diag([closure.scale if driven.slider else 1.0 for driven in closure.linkage.inputs])
    solved = solve(inputs, ways[0])
    known = np.isin(solved.status, [CODES[Status.CLOSED], CODES[Status.CHANGE_POINT]])
    others: list[Any] = [solve(inputs[known], rates).velocities for rates in ways[1:]]
    columns = np.stack([np.asarray(solved.velocities)[:, known], *others], -1)
    units = np.array([1.0 if turns else closure.scale for turns in closure.turning])
    jacobians = columns.transpose(1, 0, 2) / units[:, None]
    values = np.full(len(inputs), np.inf)
    values[known] = np.linalg.svd(jacobians, compute_uv=False)[:, -1]
    return values
