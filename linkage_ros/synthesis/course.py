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
Which way a four-bar goes through its positions: branch, circuit, order, transmission angle.

A four-bar has two assemblies. Where the crank turns fully they never meet, and each is a circuit:
what lies on the other can be reached only by taking the linkage apart. Else the crank moves
between toggles, in one range where no link turns fully, in two where one does; in a range both
assemblies join at the toggles, so that they are two branches of one circuit (T. R. Chase and J. A.
Mirth, Circuits and branches of single-degree-of-freedom planar linkages, Journal of Mechanical
Design 115 (1993) 223-230).

All functions take any number of linkages at once. Directions of the crank are those of the vector
O2→A less that of O2→O4, in [rad].
"""

from __future__ import annotations

from typing import NamedTuple

from linkage_ros.kinematics.diagonal import UNIT_ROUNDOFF
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_TURN = 2.0 * np.pi


class Course(NamedTuple):
    """
    How four-bars go through their positions.

    Attributes
    ----------
    turns
        Whether the crank turns fully; (…).
    one_branch
        Whether all positions are on one assembly; (…).
    one_circuit
        Whether all can be reached without taking the linkage apart; (…).
    in_order
        Whether the crank visits them in their order, going one way, for one turn at most; (…).
    start, end
        Directions of the crank at the first and the last position, with the turns between them;
        (…). The shorter way where both are in order; of no meaning where none is.

    """

    turns: Flags
    one_branch: Flags
    one_circuit: Flags
    in_order: Flags
    start: Array
    end: Array

    @property
    def usable(self) -> Flags:
        """Return whether a crank that goes one way moves through all positions, in order."""
        return self.one_branch & self.one_circuit & self.in_order


def course(lengths: Array, directions: Array, left: Flags) -> Course:
    """
    Return how four-bars go through their positions.

    Parameters
    ----------
    lengths
        Of crank, coupler, rocker and ground, above 0; (…, 4).
    directions
        Of the crank at each position, in [rad]; (…, n).
    left
        Whether the position is met on the left assembly; (…, n).

    """
    a, b, c, d = (lengths[..., i] for i in range(4))
    ordered = np.sort(lengths, -1)
    shortest = ordered[..., 0]
    excess = (ordered[..., 1] - shortest) - (ordered[..., 3] - ordered[..., 2])
    grashof = excess >= -8.0 * UNIT_ROUNDOFF * ordered[..., 3]
    turns = grashof & (np.minimum(a, d) == shortest)
    one_branch = (left == left[..., :1]).all(-1)

    # A crank that does not turn fully stays on one side of the ground line where some link does;
    # else its one range lies about the direction in which the linkage closes, 0 or π.
    upper = np.sin(directions) >= 0.0
    one_side = (upper == upper[..., :1]).all(-1)
    one_circuit = np.where(turns, one_branch, ~grashof | one_side)

    by = np.diff(directions, axis=-1)
    ahead, back = np.mod(by, _TURN).sum(-1), np.mod(-by, _TURN).sum(-1)
    about_zero = (np.abs(d - a) >= np.abs(b - c)) & (np.abs(d - a) <= b + c)
    wrapped = directions - _TURN * np.round(directions / _TURN)
    within = np.where((grashof | about_zero)[..., None], wrapped, np.mod(directions, _TURN))
    steps = np.diff(within, axis=-1)
    one_way = (steps > 0.0).all(-1) | (steps < 0.0).all(-1)
    in_order = np.where(turns, np.minimum(ahead, back) <= _TURN, one_way)
    travel = np.where(ahead <= back, ahead, -back)
    start = within[..., 0]
    end = np.where(turns, start + travel, within[..., -1])
    return Course(turns, one_branch, one_circuit, in_order, start, end)


def transmission(lengths: Array, direction: Array) -> Array:
    """
    Return the angle between coupler and rocker, acute, in [rad]; 0 where the loop is open.

    With s the distance from A to O4, tan²(μ/2) = (s² − (b − c)²)/((b + c)² − s²), and
    s² = (d − a)² + 4ad·sin²(δ/2), which loses nothing where A comes close to O4.

    Parameters
    ----------
    lengths
        Of crank, coupler, rocker and ground; (…, 4).
    direction
        Of the crank, in [rad]; (…).

    """
    a, b, c, d = (lengths[..., i] for i in range(4))
    swing = 4.0 * a * d * np.sin(0.5 * direction) ** 2
    below = ((d - a) - (b - c)) * ((d - a) + (b - c)) + swing
    above = ((b + c) - (d - a)) * ((b + c) + (d - a)) - swing
    angle = 2.0 * np.arctan2(np.sqrt(np.maximum(below, 0.0)), np.sqrt(np.maximum(above, 0.0)))
    acute: Array = np.minimum(angle, np.pi - angle)
    return acute


def least_transmission(lengths: Array, start: Array, end: Array) -> tuple[Array, Array]:
    """
    Return the least transmission angle of a travel, in [rad], and the direction where it is.

    Between two passes of the ground line, at direction 0 or π, the distance s goes one way, and
    the angle with it; so the least is at one of the ends or of these.

    Parameters
    ----------
    lengths
        Of crank, coupler, rocker and ground; (…, 4).
    start, end
        Directions of the crank, in [rad], at most a turn from each other; (…).

    """
    low, high = np.minimum(start, end), np.maximum(start, end)
    first = np.ceil(low / np.pi) * np.pi
    places = np.stack((start, end, *(np.minimum(first + i * np.pi, high) for i in range(3))), -1)
    angles = transmission(lengths[..., None, :], places)
    least = np.argmin(angles, -1)[..., None]
    return (
        np.take_along_axis(angles, least, -1)[..., 0],
        np.take_along_axis(places, least, -1)[..., 0],
    )
