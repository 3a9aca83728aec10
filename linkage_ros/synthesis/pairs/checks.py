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


"""Pairs of a crank angle and a rocker angle: which cannot be met, and why."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import degrees, inf, remainder, tau

from linkage_ros.errors import SynthesisError
from linkage_ros.synthesis.design import Wanted
from linkage_ros.synthesis.double_double import Array
from linkage_ros.synthesis.pairs.system import differences
import numpy as np

MOVE = 'move one of the angles'

_SAME = 1e-12
"""Angles nearer than this are the same, in [rad]."""

_FARTHEST = 1e9
"""An angle beyond this, in [rad], has lost the digits that say where in its turn it is."""

_CONSISTENT = 1e-9
"""Equations that leave a smaller part of themselves do not contradict each other."""


def wanted_of(crank: Sequence[float], rocker: Sequence[float]) -> tuple[Wanted, ...]:
    """Return pairs as positions that are wanted."""
    return tuple(Wanted(t, p) for t, p in zip(crank, rocker, strict=True))


def check_pairs(crank: Sequence[float], rocker: Sequence[float], ground: float) -> None:
    """
    Refuse pairs that no four-bar can have, or that say one thing twice.

    Raises
    ------
    SynthesisError
        With the numbers of the pairs, counted from 1.

    """
    if not 0.0 < ground < inf:
        raise SynthesisError('ground', f'{ground!r} m is no length', 'give it one above 0')
    pairs = [*enumerate(zip(crank, rocker, strict=True), 1)]
    for number, pair in pairs:
        if not all(abs(angle) <= _FARTHEST for angle in pair):
            raise SynthesisError(
                f'pair {number}',
                f'{_said(pair)} is no pair of angles',
                f'write two numbers of at most {degrees(_FARTHEST):.1g}°',
            )
    for (i, one), (j, other) in combinations(pairs, 2):
        theta, phi = (abs(remainder(u - v, tau)) for u, v in zip(one, other, strict=True))
        if theta < _SAME and phi < _SAME:
            raise SynthesisError(
                f'pairs {i} and {j}', f'are the same, {_said(one)}', 'give each position once'
            )
        if theta < _SAME:
            raise SynthesisError(
                f'pairs {i} and {j}',
                f'want the rocker at {_degrees(one[1])} and at {_degrees(other[1])} for the same '
                f'crank angle, {_degrees(one[0])}, which needs both assemblies',
                'change one of the crank angles',
            )


def centred(crank: Sequence[float], rocker: Sequence[float]) -> tuple[Array, Array, Array]:
    """
    Return what each pair's cos φ, cos θ and cos(θ − φ) have over their means, by −2; (n,) each.

    Freudenstein's k3 is what makes the rest zero on the whole: against the means it falls out.
    """
    theta, phi = np.array(crank, np.float64), np.array(rocker, np.float64)
    columns = differences(theta[:, None], phi[:, None])
    P, Q, R = (np.append(0.0, high[:, 0]) for high, _ in columns)
    return P - P.mean(), Q - Q.mean(), R - R.mean()


def dependent(crank: Sequence[float], rocker: Sequence[float]) -> SynthesisError:
    """Return why the equations of pairs do not fix a four-bar, as far as that can be told."""
    pairs = [*enumerate(zip(crank, rocker, strict=True), 1)]
    if all(abs(remainder(theta - phi, tau)) < _SAME for _, (theta, phi) in pairs):
        return SynthesisError(
            'the pairs',
            'turn crank and rocker by the same angles, as parallelograms of any crank length do',
            'change one, or draw a parallelogram',
        )
    for (i, one), (j, other) in combinations(pairs, 2):
        if all(abs(remainder(u + v, tau)) < _SAME for u, v in zip(one, other, strict=True)):
            return SynthesisError(
                f'pairs {i} and {j}',
                f'{_said(one)} and {_said(other)} are mirror images in the ground line: a '
                'four-bar that has one has the other',
                'give another pair in place of one of them',
            )
    P, Q, R = centred(crank, rocker)
    matrix = np.stack((P, Q), 1)
    rest = R - matrix @ np.linalg.lstsq(matrix, R, _CONSISTENT)[0]
    if np.linalg.norm(rest) < _CONSISTENT * np.linalg.norm(R):
        return SynthesisError(
            'the pairs', 'say so little that any number of four-bars has them all', MOVE
        )
    return SynthesisError(
        'the pairs',
        'contradict each other: no four-bar of finite links has them all',
        f'{MOVE}, or let the zero angles be free',
    )


def _said(pair: tuple[float, float]) -> str:
    return ' → '.join(map(_degrees, pair))


def _degrees(angle: float) -> str:
    return f'{degrees(angle):.10g}°'
