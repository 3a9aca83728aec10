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


"""A design as it is drawn: its poses at the positions, and its branches between them."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import NamedTuple

from linkage_ros.errors import LinkageError
from linkage_ros.kinematics.closure import Closure, Position
from linkage_ros.kinematics.ranges import InputRange
from linkage_ros.kinematics.sweep_analysis import Way
from linkage_ros.synthesis.design import Assembly, COUPLER, Design, Wanted
from linkage_ros.synthesis.proof import closed_position, closure_of, Met, prove, SIDES
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SAMPLES = 481
_TURNS = (False, False)


class Pose(NamedTuple):
    """
    A design at one of its positions, in the assembly that meets it.

    Attributes
    ----------
    number
        Of the position, counted from 1.
    wanted, met
        What was asked for, and what it came to.
    own
        Whether it is met on the design's own assembly.
    closure, position
        The linkage in that assembly, and its position there.

    """

    number: int
    wanted: Wanted
    met: Met
    own: bool
    closure: Closure
    position: Position

    @property
    def points(self) -> dict[tuple[str, str], complex]:
        """Return every point of every link, in [m]."""
        return self.closure.points(self.position)


class Branch(NamedTuple):
    """
    One assembly, as the crank goes through a range.

    Attributes
    ----------
    own
        Whether it is the design's own assembly.
    limited
        Whether the range ends at toggles.
    crank, rocker, coupler
        Angles of the links, in [rad], without jumps; (n,).
    trace
        Places of the traced point, in [m]; (n,). Empty where there is none.

    """

    own: bool
    limited: bool
    crank: Array
    rocker: Array
    coupler: Array
    trace: tuple[complex, ...]


def poses(design: Design) -> tuple[list[Pose], list[int]]:
    """
    Return a design at its positions, and the numbers of those where it does not close.

    Raises
    ------
    LinkageError
        Where it closes at none.

    """
    closures = {side: closure_of(design, side) for side in SIDES}
    found, open_ = [], []
    for number, (wanted, met) in enumerate(zip(design.wanted, prove(design), strict=True), 1):
        closure = closures[met.side]
        position = closed_position(closure, wanted.crank)
        if position.joints:
            own = met.side == design.four_bar.side
            found.append(Pose(number, wanted, met, own, closure, position))
        else:
            open_.append(number)
    if not found:
        raise LinkageError(
            'the design', 'closes at none of its positions', 'there is nothing to draw'
        )
    return found, open_


def branches(design: Design, shown: Sequence[Pose]) -> list[Branch]:
    """Return the assemblies on which positions are met, over the ranges of the crank around."""
    cranks = [pose.wanted.crank for pose in shown]
    found: list[Branch] = []
    for side in SIDES:
        if any(pose.met.side == side for pose in shown):
            way = Way(closure_of(design, side))
            own = design.four_bar.side
            found += [_branch(way, interval, side, own) for interval in _ranges(way, cranks)]
    return found


def _ranges(way: Way, cranks: Sequence[float]) -> list[InputRange]:
    """Return the ranges in which positions lie; of a whole turn the one about them."""
    found: list[InputRange] = []
    for crank in cranks:
        interval = way.range_about(crank)
        if interval is None:
            continue
        if interval.whole:
            low, high = min(cranks), max(cranks)
            half = max(pi, 0.5 * (high - low))
            return [InputRange(0.5 * (low + high) - half, 0.5 * (low + high) + half, True, _TURNS)]
        if not any(interval.lowest <= known.highest <= interval.highest for known in found):
            found.append(interval)
    return found


def _branch(way: Way, interval: InputRange, side: Assembly, own: Assembly) -> Branch:
    low, high = interval.lowest, interval.highest
    part = np.linspace(0.0, 1.0, _SAMPLES)
    limited = interval.limited != _TURNS
    if limited:
        # Near a toggle the rocker goes as the root of the crank: closer there, for a round curve.
        part = 0.5 - 0.5 * np.cos(pi * part)
    crank, joints, trace = [], [], []
    for value in (low + (high - low) * part).tolist():
        position = way.position(min(max(value, low), high))
        if position.joints:
            crank.append(value)
            joints.append(position.joints)
            if way.closure.linkage.traced:
                trace.append(way.closure.points(position)[COUPLER, 'P'])
    relative, rocker = np.unwrap(np.array(joints), axis=0).T
    at = np.array(crank)
    return Branch(side == own, limited, at, rocker, relative + at, tuple(trace))
