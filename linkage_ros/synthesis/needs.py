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


"""What a user needs of a design, and by how much one misses it."""

from __future__ import annotations

from math import degrees, inf, log, pi
from typing import NamedTuple

from linkage_ros.errors import did_you_mean, listed, SynthesisError
from linkage_ros.synthesis.course import Array, Flags, mobility
from linkage_ros.synthesis.defects import Assessment
import numpy as np

# For each word the ends of Barker's codes that it stands for.
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

# Barker's codes by the shortest link where some link turns fully, by the longest where none does,
# by the shortest at a change point. Of equal links, as in a parallelogram, none is asked for.
_CODES = (
    ('GCRR', 'GRCR', 'GRRC', 'GCCC'),
    ('RRR2', 'RRR3', 'RRR4', 'RRR1'),
    ('SCRR', 'SRCR', 'SRRC', 'SCCC'),
)

_FAR = 10.0
"""What a defect counts for beside a miss of a number by a part of it."""


class Needs(NamedTuple):
    """
    What a design must have.

    Attributes
    ----------
    kind
        A word for what links turn, one of crank-rocker, rocker-crank, double-crank or drag-link,
        double-rocker, triple-rocker, grashof, non-grashof, turning (the crank turns fully); '' for
        any.
    transmission
        The transmission angle over the travel is nowhere below this, in [rad].
    link_ratio
        Longest link to shortest, at most.
    usable
        Whether it must be without defects.

    """

    kind: str = ''
    transmission: float = 0.0
    link_ratio: float = inf
    usable: bool = False

    @property
    def turning(self) -> bool:
        """Return whether the crank must turn fully."""
        return self.kind in _TURNING

    def check(self) -> None:
        """
        Refuse what cannot be needed.

        Raises
        ------
        SynthesisError
            With the nearest word.

        """
        if not 0.0 <= self.transmission <= 0.5 * pi:
            raise SynthesisError(
                'transmission angle',
                f'{degrees(self.transmission):g}° is none',
                'need one from 0 to 90 degrees',
            )
        if not self.link_ratio >= 1.0:
            raise SynthesisError(
                'link ratio', f'{self.link_ratio:g} is none', 'need one of 1 or more'
            )
        if self.kind and self.kind not in _WORDS:
            raise SynthesisError(
                self.kind,
                'is no kind of four-bar',
                did_you_mean(self.kind, _WORDS, f'name one of {listed(_WORDS)}'),
            )


def misses(assessment: Assessment, needs: Needs) -> tuple[str, ...]:
    """Return in a few words each what a design lacks; nothing where it has all."""
    return tuple(text for text, _ in _missed(assessment, needs))


def distance(assessment: Assessment, needs: Needs) -> float:
    """Return by how much a design misses what is needed, to order them; 0 where it does not."""
    return sum(much for _, much in _missed(assessment, needs))


def _missed(assessment: Assessment, needs: Needs) -> list[tuple[str, float]]:
    found: list[tuple[str, float]] = []
    if needs.usable:
        found += [(f'{defect.name} defect', _FAR) for defect in assessment.defects]
    if needs.kind and not _is(assessment, needs.kind):
        found.append((f'a {assessment.kind.name}, no {needs.kind}', 1.0))
    if assessment.transmission < needs.transmission:
        angle, wanted = degrees(assessment.transmission), degrees(needs.transmission)
        text = f'a transmission angle of {angle:.4g}°, not {wanted:.4g}°'
        found.append((text, 1.0 - angle / wanted))
    if assessment.link_ratio > needs.link_ratio:
        found.append(
            (
                f'a link ratio of {assessment.link_ratio:.4g}, not {needs.link_ratio:.4g}',
                log(assessment.link_ratio / needs.link_ratio),
            )
        )
    return found


def distances(lengths: Array, transmission: Array, needs: Needs) -> Array:
    """
    Return for many four-bars without defects what `distance` returns for one.

    Parameters
    ----------
    lengths
        Of crank, coupler, rocker and ground, above 0; (…, 4).
    transmission
        The least angle over the travel, in [rad]; (…).
    needs
        What is needed.

    """
    total = np.zeros(transmission.shape)
    if needs.kind:
        total += ~_are(lengths, needs.kind)
    if needs.transmission:
        total += np.maximum(1.0 - transmission / needs.transmission, 0.0)
    if needs.link_ratio < inf:
        ratio = lengths.max(-1) / lengths.min(-1)
        total += np.maximum(np.log(ratio / needs.link_ratio), 0.0)
    return total


def _is(assessment: Assessment, kind: str) -> bool:
    return assessment.turns if kind == 'turning' else _stands_for(kind, assessment.kind.code)


def _are(lengths: Array, kind: str) -> Flags:
    excess, turns = mobility(lengths)
    if kind == 'turning':
        return turns
    row = np.where(excess > 0.0, 0, np.where(excess < 0.0, 1, 2))
    link = np.where(excess < 0.0, lengths.argmax(-1), lengths.argmin(-1))
    meant = np.array([[_stands_for(kind, code) for code in codes] for codes in _CODES])
    found: Flags = meant[row, link]
    return found


def _stands_for(kind: str, code: str) -> bool:
    if kind == 'grashof':
        return code[:1] in ('G', 'S')
    if kind == 'non-grashof':
        return code in _CODES[1]
    return code.endswith(_KINDS[kind])
