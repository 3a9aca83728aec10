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
The defects that make a solution on paper useless, looked for in every design, and named.

What they are called is as in the textbooks (R. L. Norton, Design of Machinery, ch. 5;
J. M. McCarthy and G. S. Soh, Geometric Design of Linkages, ch. 4): branch, circuit and order.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Iterable
from math import degrees
from typing import NamedTuple

from linkage_ros.kinematics.grashof import four_bar_type, FourBarType
from linkage_ros.synthesis.course import course, least_transmission
from linkage_ros.synthesis.design import Design
from linkage_ros.synthesis.proof import Met, prove
import numpy as np


class Defect(NamedTuple):
    """Why a linkage does not do on the bench what it does on paper: a name, and a sentence."""

    name: str
    text: str


class Assessment(NamedTuple):
    """
    What a design is worth.

    Attributes
    ----------
    met
        How each position is met.
    kind
        After Grashof.
    turns
        Whether the crank turns fully.
    defects
        What is wrong, the worst first; empty where nothing is.
    travel
        Crank angles at the first and the last position, with the turns between them, in [rad];
        None where the crank does not get from one to the other.
    transmission, at
        The least angle between coupler and rocker over the travel, acute, and the crank angle
        where it is, in [rad]; where there is no travel, over the positions.
    full_transmission
        The least over a full turn, in [rad]; None where the crank does not turn fully.
    link_ratio
        Longest link to shortest.

    """

    met: tuple[Met, ...]
    kind: FourBarType
    turns: bool
    defects: tuple[Defect, ...]
    travel: tuple[float, float] | None
    transmission: float
    at: float
    full_transmission: float | None
    link_ratio: float


def assess(design: Design) -> Assessment:
    """Assess a design; its positions are analysed again, by `proof.prove`."""
    four_bar = design.four_bar
    met = prove(design)
    o2, o4 = four_bar.pivots
    # From the angle of the crank's frame to the direction of the vector O2→A off the ground line.
    zero = phase(four_bar.crank) - phase(o4 - o2)
    lengths = np.array(four_bar.lengths)
    cranks = np.array([wanted.crank for wanted in design.wanted])
    found = course(lengths, cranks + zero, np.array([one.side == 'left' for one in met]))
    defects = tuple(
        defect
        for defect in (
            _open(met),
            None if found.one_circuit else _circuit(met, bool(found.turns)),
            None if found.one_branch or not found.one_circuit else _branch(met),
            None if found.in_order or not found.one_circuit else _order(design),
        )
        if defect is not None
    )
    start = float(cranks[0])
    if defects:
        travel = None
        pieces = [least_transmission(lengths, d, d) for d in cranks + zero]
        least, at = min((float(angle), float(d)) for angle, d in pieces)
        at -= zero
    else:
        travel = (start, start + float(found.end - found.start))
        angle, place = least_transmission(lengths, found.start, found.end)
        least, at = float(angle), start + float(place - found.start)
    full = None
    if found.turns:
        full = float(least_transmission(lengths, np.array(0.0), np.array(np.pi))[0])
    return Assessment(
        met,
        four_bar_type(*four_bar.lengths),
        bool(found.turns),
        defects,
        travel,
        least,
        at,
        full,
        max(four_bar.lengths) / min(four_bar.lengths),
    )


def _open(met: tuple[Met, ...]) -> Defect | None:
    missed = [(number, one) for number, one in enumerate(met, 1) if not one.closed]
    if not missed:
        return None
    worst = max(one.gap for _, one in missed)
    return Defect(
        'open',
        f'{_positions(number for number, _ in missed)} cannot be assembled, the links miss each '
        f'other by up to {worst:.3g} m',
    )


def _branch(met: tuple[Met, ...]) -> Defect:
    return Defect(
        'branch', f'{_sides(met)}, and between the two lies a toggle that the crank cannot pass'
    )


def _circuit(met: tuple[Met, ...], turns: bool) -> Defect:
    where = _sides(met) if turns else 'the positions lie in two ranges of the crank'
    return Defect('circuit', f'{where}, and only taking it apart leads from one to the other')


def _order(design: Design) -> Defect:
    said = ', '.join(f'{degrees(wanted.crank):.4g}°' for wanted in design.wanted)
    return Defect('order', f'a crank that goes one way does not come by in the order {said}')


def _sides(met: tuple[Met, ...]) -> str:
    left, right = (
        _positions(number for number, one in enumerate(met, 1) if one.side == side)
        for side in ('left', 'right')
    )
    return f'{left} on the left assembly, {right} on the right one'


def _positions(numbers: Iterable[int]) -> str:
    listed = list(map(str, numbers))
    if len(listed) == 1:
        return f'position {listed[0]}'
    return f'positions {", ".join(listed[:-1])} and {listed[-1]}'
