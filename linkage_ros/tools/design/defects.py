# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The defects that make a design useless in practice, and the requirements on a design.

Every design is checked for the defects. Their names are the textbooks' (R. L. Norton,
Design of Machinery, ch. 5; J. M. McCarthy and G. S. Soh, Geometric Design of Linkages, ch. 4):
branch, circuit and order.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Iterable
from math import degrees, inf, log, pi, remainder, tau
from typing import NamedTuple

from linkage_ros.errors import did_you_mean, list_names, SynthesisError
from linkage_ros.kinematics import (
    CHANGE_POINTS,
    four_bar_type,
    FourBarType,
    GRASHOF,
    TRIPLE_ROCKERS,
)
from linkage_ros.tools.design.design import Design
from linkage_ros.tools.design.proof import (
    AchievedPosition,
    Array,
    closure_of,
    Flags,
    least_transmission,
    lift_directions,
    mobility,
    prove,
    SAME,
    Traversal,
    traverse_positions,
)
import numpy as np

_IN_LINE = 1e-5
"""Below this transmission angle coupler and rocker are in line, in [rad]; near a toggle the angle
is the root of the rounding error of the lengths."""

# For each word the ends of Barker's codes that match it.
_KINDS = {
    'crank-rocker': ('CRR',),
    'rocker-crank': ('RRC',),
    'double-crank': ('CCC',),
    'drag-link': ('CCC',),
    'double-rocker': ('GRCR', 'SRCR'),
    'triple-rocker': ('RRR1', 'RRR2', 'RRR3', 'RRR4'),
}
_TURNING = ('crank-rocker', 'double-crank', 'drag-link', 'turning')
_WORDS = (*_KINDS, 'grashof', 'non-grashof', 'turning')

# Barker's codes by the shortest link if some link turns fully, by the longest if none does, by the
# shortest at a change point. No word selects equal links, as in a parallelogram.
_CODES = tuple(
    tuple(code for code, _ in names) for names in (GRASHOF, TRIPLE_ROCKERS, CHANGE_POINTS)
)

_FAR = 10.0
"""Weight of a defect, relative to a number that misses its requirement by its own size."""


class Defect(NamedTuple):
    """A reason why a linkage cannot move as designed: a name, and a sentence."""

    name: str
    text: str


class Assessment(NamedTuple):
    """
    The analysis of a design.

    Attributes
    ----------
    met
        The result of each position.
    kind
        Type after Grashof.
    turns
        Whether the crank turns fully.
    defects
        The defects, the worst first.
    travel
        Crank angles at the first and the last position, with the turns between them, in [rad];
        None if the crank cannot move from one to the other.
    transmission, at
        The least acute angle between coupler and rocker over the travel, and its crank angle, in
        [rad]; without a travel, over the positions.
    full_transmission
        The least over a full turn, in [rad]; None if the crank does not turn fully.
    link_ratio
        Ratio of the longest link to the shortest.

    """

    met: tuple[AchievedPosition, ...]
    kind: FourBarType
    turns: bool
    defects: tuple[Defect, ...]
    travel: tuple[float, float] | None
    transmission: float
    at: float
    full_transmission: float | None
    link_ratio: float


def assess(design: Design) -> Assessment:
    """Assess a design; its positions are solved again, by `proof.prove`."""
    four_bar = design.four_bar
    o2, o4 = four_bar.pivots
    # From the angle of the crank's frame to the direction of O2→A relative to the ground line.
    zero = phase(four_bar.crank) - phase(o4 - o2)
    lengths = np.array(four_bar.lengths)
    directions = np.array([wanted.crank for wanted in design.wanted]) + zero
    # With a single change point two turns may differ: the actual turns are proven.
    turns = tau * np.round((lift_directions(lengths, directions) - directions) / tau)
    moved = [
        position._replace(crank=position.crank + float(by))
        for position, by in zip(design.wanted, turns, strict=True)
    ]
    met = prove(design._replace(wanted=tuple(moved)))
    path = traverse_positions(
        lengths, directions, np.array([position.side == 'left' for position in met])
    )
    defects = _find_defects(design, met, path)
    if defects:
        travel = None
        # Only at the positions: the crank cannot move between them.
        ends = path.directions, path.directions
    else:
        travel = moved[0].crank, moved[-1].crank
        ends = path.directions[:1], path.directions[-1:]
    angles, places = least_transmission(lengths, *ends)
    least, at = min(zip(angles.tolist(), (places - zero).tolist(), strict=True))
    if travel and least < _IN_LINE:
        defects = (
            Defect(
                'transmission',
                f'coupler and rocker are in line at a crank angle of {_degrees_text(at)}, and the '
                'rocker may go either way from there',
            ),
        )
    full = None
    if path.turns:
        full = float(least_transmission(lengths, np.array(0.0), np.array(pi))[0])
    ratio = max(four_bar.lengths) / min(four_bar.lengths)
    kind = four_bar_type(*four_bar.lengths)
    return Assessment(met, kind, bool(path.turns), defects, travel, least, at, full, ratio)


def _find_defects(
    design: Design, met: tuple[AchievedPosition, ...], path: Traversal
) -> tuple[Defect, ...]:
    """Return the defects of a linkage; one that cannot be assembled hides all others."""
    missed = [
        (number, position.gap) for number, position in enumerate(met, 1) if not position.is_closed
    ]
    if missed:
        worst = max(gap for _, gap in missed)
        return (
            Defect(
                'open',
                f'{_positions_text(number for number, _ in missed)} cannot be assembled, the '
                'links '
                f'miss each other by up to {worst:.3g} m',
            ),
        )
    if not path.one_circuit:
        return (_circuit_defect(met, path),)
    defects = []
    if not path.one_branch:
        defects.append(_branch_defect(design, met))
    if not path.in_order:
        defects.append(_order_defect(design, path))
    return tuple(defects)


def _branch_defect(design: Design, met: tuple[AchievedPosition, ...]) -> Defect:
    crank = design.wanted[0].crank
    closure = closure_of(design, met[0].side)
    between = []
    for interval in closure.input_ranges:
        middle, half = (
            0.5 * (interval.highest + interval.lowest),
            0.5 * (interval.highest - interval.lowest),
        )
        if abs(remainder(crank - middle, tau)) <= half + SAME:
            between = [
                singular.value
                for singular in closure.singular_inputs
                if abs(remainder(singular.value - middle, tau)) <= half + SAME
            ]
    where = ' and '.join(sorted({_degrees_text(remainder(angle, tau)) for angle in between}))
    return Defect(
        'branch',
        f'{_sides_text(met)}; they meet only where coupler and rocker are in line, at crank '
        'angles of '
        f'{where}, and a crank does not lead from one to the other',
    )


def _circuit_defect(met: tuple[AchievedPosition, ...], path: Traversal) -> Defect:
    if path.turns:
        where = _sides_text(met)
    else:
        upper = np.sin(path.directions) >= 0.0
        here, there = (_positions_text(np.flatnonzero(upper == end) + 1) for end in (True, False))
        where = f'the crank moves in two ranges, with {here} in one and {there} in the other'
    return Defect('circuit', f'{where}; only taking it apart leads from one to the other')


def _order_defect(design: Design, path: Traversal) -> Defect:
    directions: Array = path.directions - path.directions[0]
    visited = np.argsort(np.mod(directions, tau) if path.turns else directions)
    visits = ', '.join(f'{i + 1} ({_degrees_text(design.wanted[i].crank)})' for i in visited)
    return Defect(
        'order', f'a crank that turns one way passes the positions in the order {visits}'
    )


def _sides_text(met: tuple[AchievedPosition, ...]) -> str:
    left, right = (
        _positions_text(number for number, position in enumerate(met, 1) if position.side == side)
        for side in ('left', 'right')
    )
    return f'{left} on the left assembly, {right} on the right one'


def _positions_text(numbers: Iterable[int]) -> str:
    listed = list(map(str, numbers))
    if len(listed) == 1:
        return f'position {listed[0]}'
    return f'positions {", ".join(listed[:-1])} and {listed[-1]}'


def _degrees_text(angle: float) -> str:
    return f'{degrees(angle):.6g}°'


class Needs(NamedTuple):
    """The requirements on a design."""

    # A word for the links that turn: crank-rocker, rocker-crank, double-crank or drag-link,
    # double-rocker, triple-rocker, grashof, non-grashof, turning (the crank turns fully); '' for
    # any.
    kind: str = ''
    transmission: float = 0.0  # Lower bound of the transmission angle over the travel, in [rad]
    link_ratio: float = inf  # Upper bound of the ratio of the longest link to the shortest
    usable: bool = False  # Whether it must have no defects

    @property
    def needs_full_turn(self) -> bool:
        """Return whether the crank must turn fully."""
        return self.kind in _TURNING

    def check(self) -> None:
        """Raise a SynthesisError, with the most similar word, if no design can meet them."""
        if not 0.0 <= self.transmission <= 0.5 * pi:
            raise SynthesisError(
                'transmission angle',
                f'{degrees(self.transmission):g}° is not in its range',
                'write 0° to 90°',
            )
        if not self.link_ratio >= 1.0:
            raise SynthesisError(
                'link ratio', f'{self.link_ratio:g} is not a ratio', 'write 1 or more'
            )
        if self.kind and self.kind not in _WORDS:
            raise SynthesisError(
                self.kind,
                'is not a kind of four-bar',
                did_you_mean(self.kind, _WORDS, f'name one of {list_names(_WORDS)}'),
            )


def unmet_needs(assessment: Assessment, needs: Needs) -> tuple[str, ...]:
    """Return the unmet requirements of a design, in a few words each."""
    return tuple(text for text, _ in _missed_needs(assessment, needs))


def needs_penalty(assessment: Assessment, needs: Needs) -> float:
    """Return the weighted sum of unmet requirements, to sort designs; 0 if all are met."""
    return sum(much for _, much in _missed_needs(assessment, needs))


def _missed_needs(assessment: Assessment, needs: Needs) -> list[tuple[str, float]]:
    missed: list[tuple[str, float]] = []
    if needs.usable:
        missed += [(f'{defect.name} defect', _FAR) for defect in assessment.defects]
    if needs.kind and not _is_kind(assessment, needs.kind):
        missed.append((f'a {assessment.kind.name}, not {needs.kind}', 1.0))
    if assessment.transmission < needs.transmission:
        angle, wanted = degrees(assessment.transmission), degrees(needs.transmission)
        text = f'a transmission angle of {angle:.4g}°, not {wanted:.4g}°'
        missed.append((text, 1.0 - angle / wanted))
    if assessment.link_ratio > needs.link_ratio:
        missed.append(
            (
                f'a link ratio of {assessment.link_ratio:.4g}, not {needs.link_ratio:.4g}',
                log(assessment.link_ratio / needs.link_ratio),
            )
        )
    return missed


def needs_penalties(lengths: Array, transmission: Array, needs: Needs) -> Array:
    """
    Return `needs_penalty` for many four-bars without defects.

    ``lengths``: crank, coupler, rocker and ground, above 0, (…, 4). ``transmission``: the least
    angle over the travel, in [rad], (…).
    """
    total = np.zeros(transmission.shape)
    if needs.kind:
        total += ~_are_kind(lengths, needs.kind)
    if needs.transmission:
        total += np.maximum(1.0 - transmission / needs.transmission, 0.0)
    if needs.link_ratio < inf:
        ratio = lengths.max(-1) / lengths.min(-1)
        total += np.maximum(np.log(ratio / needs.link_ratio), 0.0)
    return total


def _is_kind(assessment: Assessment, kind: str) -> bool:
    return assessment.turns if kind == 'turning' else _stands_for(kind, assessment.kind.code)


def _are_kind(lengths: Array, kind: str) -> Flags:
    excess, turns = mobility(lengths)
    if kind == 'turning':
        return turns
    row = np.where(excess > 0.0, 0, np.where(excess < 0.0, 1, 2))
    link = np.where(excess < 0.0, lengths.argmax(-1), lengths.argmin(-1))
    meant = np.array([[_stands_for(kind, code) for code in codes] for codes in _CODES])
    matches: Flags = meant[row, link]
    return matches


def _stands_for(kind: str, code: str) -> bool:
    if kind == 'grashof':
        return code[:1] in ('G', 'S')
    if kind == 'non-grashof':
        return code in _CODES[1]
    return code.endswith(_KINDS[kind])
