# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Friction that grows with the force in its joint, and the forces that it changes.

The friction is T = µ·ρ·|F| in a pin of radius ρ, and T = µ·|F| in a slider, against the motion;
the moment that keeps a slider from turning does not count. By the balance of all links, the force
F in a joint is linear in the input's acceleration q̈ and in all these frictions::

    F = F₀ + q̈·F₁ + Σ T_k·P_k

If q̈ follows from them, as q̈ = p − Σ T_k·|ψ'_k|·sign(q̇)/I, it is found with them. Newton's
method finds the T_k from 0 on. Where there are none, the linkage jams (R. L. Norton, Design of
Machinery, ch. 11, on the friction circle; on self-locking F. Reuleaux, Theoretische Kinematik,
1875).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ROUNDS = 50
_STAYS = 4e-15
"""Change at which a friction stays, as a fraction of what it is made of."""

Unknown = tuple[int, bool, float]
"""Of a joint: its first unknown in the linear system, whether it is a pin, and its factor."""


class LoadDependentFriction(NamedTuple):
    """A joint with such friction, and the force in it; of a slider, the force is a real number."""

    factor: float  # µ·ρ, in [m], or µ
    lever: float  # |ψ'|, the rate of the joint at a rate of the input of 1
    free: complex  # F₀, in [N]
    by_acceleration: complex  # F₁, in [N] for a unit of q̈
    by_frictions: tuple[complex, ...]  # P_k, in [N] for a unit of each T_k


def solve_frictions(
    joints: Sequence[LoadDependentFriction], pull: float, mobility: float = 0.0
) -> list[float] | None:
    """
    Return the friction in each joint, in [N·m] or [N]; None if the linkage jams.

    ``pull`` is q̈ without this friction, in [rad/s²] or [m/s²]. ``mobility`` says how much q̈
    falls with a unit of this friction at the input: sign(q̇)/I; 0 if q̈ is given.
    """
    found = [0.0] * len(joints)
    places = range(len(joints))
    free = [joint.free + pull * joint.by_acceleration for joint in joints]
    more = [
        [
            by_friction - mobility * other.lever * joint.by_acceleration
            for by_friction, other in zip(joint.by_frictions, joints, strict=True)
        ]
        for joint in joints
    ]
    sizes = [
        _STAYS * joint.factor * (abs(joint.free) + abs(pull * joint.by_acceleration))
        for joint in joints
    ]
    for _ in range(_ROUNDS):
        missing, slopes = [], []
        for i in places:
            force = free[i] + sum(found[k] * more[i][k] for k in places)
            size = abs(force)
            along = joints[i].factor * force.conjugate() / size if size else 0j
            missing.append(joints[i].factor * size - found[i])
            slopes.append([(i == k) - (along * more[i][k]).real for k in places])
        if all(abs(missing[i]) <= sizes[i] + _STAYS * abs(found[i]) for i in places):
            return found
        try:
            steps = np.linalg.solve(slopes, missing).tolist()
        except np.linalg.LinAlgError:
            return None
        found = [now + step for now, step in zip(found, steps, strict=True)]
    return None


def friction_effort(
    unknowns: Sequence[Unknown],
    forces: Sequence[float],
    levers: Sequence[float],
    pull: float,
    mobility: float,
) -> float | None:
    """
    Return the friction effort at the input, in [N·m] or [N]; None if the linkage jams.

    ``forces`` are as in `forces_in`, for F₀, F₁ and the P_k; ``levers`` are |ψ'| of each joint;
    ``pull`` and ``mobility`` are as in `solve_frictions`.
    """
    count, numbers = len(unknowns), iter(forces)
    joints = []
    for (_, _, factor), lever in zip(unknowns, levers, strict=True):
        free, by_pull, *others = [complex(*islice(numbers, 2)) for _ in range(count + 2)]
        joints.append(LoadDependentFriction(factor, lever, free, by_pull, tuple(others)))
    found = solve_frictions(joints, pull, mobility)
    if found is None:
        return None
    return sum(joint.lever * friction for joint, friction in zip(joints, found, strict=True))


def solve_pressed(unknowns: Sequence[Unknown], matrix: Array, *sides: float) -> list[float] | None:
    """
    Return the solution of a linear system with such friction, and the friction in each joint.

    ``sides`` are the right sides: first without this friction, then of a unit of each.
    """
    solutions = _solve_sides(matrix, sides)
    if solutions is None:
        return None
    free, *units = solutions
    joints = []
    for first, pin, factor in unknowns:
        by_frictions = tuple(_joint_force(unit, first, pin) for unit in units)
        joints.append(
            LoadDependentFriction(factor, 0.0, _joint_force(free, first, pin), 0j, by_frictions)
        )
    found = solve_frictions(joints, 0.0)
    if found is None:
        return None
    for friction, unit in zip(found, units, strict=True):
        free = [force + friction * more for force, more in zip(free, unit, strict=True)]
    return [*free, *found]


def forces_in(unknowns: Sequence[Unknown], matrix: Array, *sides: float) -> list[float] | None:
    """Return the force in each joint, x and y, for right sides one after the other."""
    solutions = _solve_sides(matrix, sides)
    if solutions is None:
        return None
    forces = [_joint_force(each, first, pin) for first, pin, _ in unknowns for each in solutions]
    return [part for force in forces for part in (force.real, force.imag)]


def _solve_sides(matrix: Array, sides: Sequence[float]) -> list[list[float]] | None:
    """Return the solutions of a linear system for right sides one after the other, or None."""
    try:
        found = np.linalg.solve(matrix, np.reshape(sides, (-1, len(matrix))).T).T
    except np.linalg.LinAlgError:
        return None
    return found.tolist() if np.isfinite(found).all() else None


def _joint_force(solution: Sequence[float], first: int, pin: bool) -> complex:
    return complex(solution[first], solution[first + 1] if pin else 0.0)
