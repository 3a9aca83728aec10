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


"""
Linkages followed from the pose that they were made in, by their equations alone.

A step predicts by rates and accelerations and corrects by Newton's method. It is taken where the
correction is small beside the step, and, unless the linkage has exact change points, where the
determinant keeps its sign; else it is halved. Where it gets too small the linkage is at its limit.
"""

from __future__ import annotations

from math import tau
from typing import NamedTuple

from campaigns.topologies.constraints import Array, Equations, Real
from campaigns.topologies.topology import Topology
import numpy as np

_KNOTS = 180
"""Steps to a turn, or to three lengths of a slide."""

_SMALLEST = 2.0**-26
_CLOSE = 0.05
"""What a correction may be, of what the step moves by, and at most of the linkage's size."""


class Walk(NamedTuple):
    """
    A linkage followed along a path of its inputs.

    Attributes
    ----------
    values
        How far along the path each knot lies.
    unknowns
        (n, knots).
    end
        How far it came; the last knot where it came to the end of the path.
    complete
        Whether it did.

    """

    values: list[float]
    unknowns: list[Array]
    end: float
    complete: bool


def walk(
    equations: Equations,
    start: Array,
    begin: Array,
    direction: Array,
    length: float,
    spacing: float,
) -> Walk:
    """
    Follow a linkage from a solution at ``begin`` along ``direction`` for a length.

    Parameters
    ----------
    equations
        The linkage.
    start
        (n, 1), a solution.
    begin, direction
        (inputs, 1); the inputs at a distance s are begin + s·direction.
    length, spacing
        How far to go, and the longest step.

    """
    values, knots = [0.0], [start[:, 0]]
    at, done, step = start, 0.0, spacing
    still = np.zeros_like(direction)
    motion = equations.motion(at, begin, direction, still)
    sign = np.linalg.slogdet(equations.residuals(at, begin)[1].astype(float))[0][0]
    while done < length:
        step = min(step, length - done)
        target = done + step
        guess = at + step * motion.rates + 0.5 * step * step * motion.accelerations
        ahead = begin + Real(target) * direction
        found, good = equations.correct(guess, ahead, steps=6)
        taken = False
        if good.all():
            moved = np.abs(found - at).max()
            off = np.abs(found - guess).max()
            there = np.linalg.slogdet(equations.residuals(found, ahead)[1].astype(float))[0][0]
            taken = bool(off <= _CLOSE * min(moved, 10 * equations.size)) and there == sign
        if not taken:
            step *= 0.5
            if step < _SMALLEST * spacing:
                return Walk(values, knots, done, False)
            continue
        at, done = found, target
        values.append(done)
        knots.append(at[:, 0])
        motion = equations.motion(at, ahead, direction, still)
        step = min(2.0 * step, spacing)
    return Walk(values, knots, done, True)


def start_of(topology: Topology, equations: Equations) -> tuple[Array, Array]:
    """Return the pose that a linkage was made in, corrected, and its inputs."""
    begin = np.array([[value] for value in topology.start], Real)
    rough = np.array([[part] for link in equations.links for part in topology.pose[link]], Real)
    return equations.correct(rough, begin)[0], begin


Walks = tuple[Walk, Walk]
"""A linkage with a single input followed down and up from where it was made."""


def follow(
    topology: Topology, equations: Equations, inputs: Array, both: Walks | None
) -> tuple[Array, Array]:
    """
    Return poses (n, N) at inputs, and whether the linkage can be followed there.

    From the pose that it was made in it goes straight to the inputs. One with a single input that
    turns may go the other way round, where that direction is reached so: what holds there is not
    judged ('unknown').
    """
    start, begin = start_of(topology, equations)
    count = inputs.shape[1]
    unknowns = np.zeros((equations.count, count), Real)
    state = np.full(count, 'unknown', object)
    if both is not None:
        for k in range(count):
            value = float(inputs[0, k] - begin[0, 0])
            part = both[value > 0]
            if abs(value) <= part.end:
                nearest = int(np.argmin(np.abs(np.array(part.values) - abs(value))))
                found = _to(equations, part, nearest, begin, inputs[:, [k]], value)
                if found is not None:
                    unknowns[:, [k]], state[k] = found, 'closed'
                continue
            turning = not topology.linkage.inputs[0].slider
            around = tau - abs(value)
            if not turning or around > max(0.0, both[value <= 0].end):
                state[k] = 'open'
        return unknowns, state
    for k in range(count):
        way = inputs[:, [k]] - begin
        if not way.any():
            unknowns[:, [k]], state[k] = start, 'closed'
            continue
        part = walk(equations, start, begin, way, 1.0, 0.05)
        if part.complete:
            unknowns[:, k], state[k] = part.unknowns[-1], 'closed'
        elif part.end < 0.999:
            state[k] = 'open'
    return unknowns, state


def both_ways(topology: Topology, turns: float = 1.25) -> Walks:
    """Return a linkage with a single input followed down and up from where it was made."""
    equations = Equations(topology.linkage)
    start, begin = start_of(topology, equations)
    length, spacing = turns * tau, tau / _KNOTS
    if topology.linkage.inputs[0].slider:
        length = 10.0 * topology.step[0]
        spacing = length / _KNOTS
    down, up = (
        walk(equations, start, begin, np.array([[sign]], Real), length, spacing)
        for sign in (-1.0, 1.0)
    )
    return down, up


def _to(
    equations: Equations, part: Walk, nearest: int, begin: Array, inputs: Array, value: float
) -> Array | None:
    """Return the pose at inputs from that at a knot."""
    sign = 1.0 if value > 0 else -1.0
    knot = part.values[nearest]
    start = part.unknowns[nearest][:, None]
    at = begin + Real(sign * knot)
    length = abs(value) - knot
    if length == 0.0:
        return start
    way = np.array([[sign if length > 0 else -sign]], Real)
    rest = walk(equations, start, at, way, abs(length), abs(length))
    return rest.unknowns[-1][:, None] if rest.complete else None
