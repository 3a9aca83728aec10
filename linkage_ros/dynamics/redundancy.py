# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Which forces in the joints of an over-constrained linkage are certain, and which are not.

Such a linkage has more unknown forces than equations. What its links can bear against each other
without any load, the null space of the matrix, adds to every solution: only where it has no part
is a force certain. The others depend on the elasticity of links and joints, and on how they were
assembled.
"""

from __future__ import annotations

from collections.abc import Sequence

from linkage_ros.dynamics.joint_forms import (
    ACROSS,
    ALONG,
    Direction,
    JointForm,
    NONE,
    WHOLE,
)
from linkage_ros.kinematics import Array, Position
import numpy as np

_CERTAIN = 1e-6
"""Parts of the null space below this are rounding."""

_SINGULAR = 1e-9
"""Singular values below this, relative to the largest, are those of a toggle."""

Rows = Sequence[Sequence[float]]


def find_certain(
    states: Sequence[tuple[Rows, Position]], joints: Sequence[JointForm], first: Sequence[int]
) -> tuple[tuple[int, ...], list[tuple[str, str]]]:
    """
    Return the unknowns to solve for, and what is certain of each joint's force and moment.

    ``states`` have the matrix of the forces at some positions, ``first`` the first unknown of each
    joint. The unknowns that are not solved for are 0.
    """
    idle_forces = [(_idle_forces(np.array(rows)), position) for rows, position in states]
    idle_forces = [(idle, position) for idle, position in idle_forces if len(idle)]
    parts = []
    for joint, begin in zip(joints, first, strict=True):
        middle, end = begin + len(joint.forces), begin + len(joint.forces) + len(joint.moments)
        seen = []
        for idle, position in idle_forces:
            axis = None if joint.axis is None else _vector(joint.axis, position)
            force = idle[:, begin:middle] @ _directions(joint.forces, position)
            moment = idle[:, middle:end] @ _directions(joint.moments, position)
            seen.append((force, moment, axis))
        parts.append(
            (
                _certain_part([(force, axis) for force, _, axis in seen])
                if joint.forces
                else NONE,
                _certain_part([(moment, axis) for _, moment, axis in seen]),
            )
        )
    return _independent_columns([idle for idle, _ in idle_forces]), parts


def _directions(ways: Sequence[Direction], position: Position) -> Array:
    return np.array([_vector(way, position) for way in ways]).reshape(len(ways), 3)


def _vector(way: Direction, position: Position) -> Array:
    return np.eye(3)[way] if isinstance(way, int) else np.array(way(position))


def _idle_forces(matrix: Array) -> Array:
    """Return the forces that balance each other, a row for each independent one; none if loose."""
    sizes, redundant = np.abs(matrix).max(axis=0), matrix.shape[1] - matrix.shape[0]
    _, values, directions = np.linalg.svd(matrix / sizes)
    if values[-1] < _SINGULAR * values[0]:
        return np.zeros((0, matrix.shape[1]))
    return np.asarray(directions[-redundant:] / sizes)


def _independent_columns(idle: Sequence[Array]) -> tuple[int, ...]:
    """
    Return the columns to solve for.

    Those unknowns are left out that determine the idle forces best: Gauss's elimination with the
    pivots that are largest in the worst of the states.
    """
    left = [rows / np.abs(rows).max() for rows in idle]
    out: set[int] = set()
    for _ in range(len(left[0])):
        sizes = np.min([np.abs(rows).max(axis=0) for rows in left], axis=0)
        column = int(sizes.argmax())
        out.add(column)
        for number, rows in enumerate(left):
            pivot = int(np.abs(rows[:, column]).argmax())
            row = rows[pivot] / rows[pivot, column]
            rest = np.delete(rows, pivot, axis=0)
            left[number] = rest - np.outer(rest[:, column], row)
    return tuple(column for column in range(idle[0].shape[1]) if column not in out)


def _certain_part(idle: Sequence[tuple[Array, Array | None]]) -> str:
    """Return what is certain of a force or moment, by its idle ones and the joint's axis."""
    along = across = 0.0
    for parts, axis in idle:
        # A ball has no axis.
        aligned = parts @ (np.zeros(3) if axis is None else axis)
        beside = parts if axis is None else parts - np.outer(aligned, axis)
        along = max(along, np.abs(aligned).max(initial=0.0))
        across = max(across, np.abs(beside).max(initial=0.0))
    if max(along, across) < _CERTAIN:
        return WHOLE
    return NONE if across >= _CERTAIN <= along else ACROSS if along >= _CERTAIN else ALONG
