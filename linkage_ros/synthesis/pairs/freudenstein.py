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
Freudenstein's equation: the four-bar whose crank and rocker stand at given pairs of angles.

The loop a·e^{iθ} + b·e^{iγ} = d + c·e^{iφ}, freed of the coupler's angle γ, is linear in three
numbers (F. Freudenstein, Approximate synthesis of four-bar linkages, Transactions of the ASME 77
(1955) 853-861)::

    k1·cos φ + k2·cos θ + k3 = cos(θ − φ)
    k1 = d/a,  k2 = −d/c,  k3 = (a² − b² + c² + d²)/(2ac)

Three pairs fix them (`system.py`). What error the lengths have is that of the angles: each is
within 4·2⁻⁵³ of its sensitivity κ, the sum of what a relative change of each angle makes of it
(`sensitivity.py`), and where that says nothing any more, no digit is trusted. More pairs are met
as well as may be. The coupler is real wherever the angles are: b² is the mean of the squares of
what crank and rocker pin are apart in the pairs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.errors import SynthesisError
from linkage_ros.kinematics.rounding import UNIT_ROUNDOFF
from linkage_ros.synthesis.design import Design, FourBar
from linkage_ros.synthesis.double_double import Array
from linkage_ros.synthesis.pairs.checks import centred, check_pairs, dependent, MOVE, wanted_of
from linkage_ros.synthesis.pairs.sensitivity import condition, doubt, gradient
from linkage_ros.synthesis.pairs.system import solved
from linkage_ros.synthesis.proof import assembled
import numpy as np
from numpy.typing import ArrayLike

TRUSTED = 4.0
"""Units of roundoff times sensitivity that the error of a length stays within; measured."""

LONGEST = 1e9
"""In grounds: a link beyond it is an infinite one but for rounding."""

_NOISE = TRUSTED * UNIT_ROUNDOFF
_SHAKEN = 0.1

_BLOCK = 2048
"""Threes of pairs that are worked on at once: they stay near the processor."""


class Links(NamedTuple):
    """
    The links of a four-bar with a ground of length 1; any number of them at once.

    Attributes
    ----------
    k
        Freudenstein's k1, k2, k3; (…, 3).
    lengths
        Of crank, coupler and rocker; (…, 3). Crank and rocker are negative where the link points
        the other way. Infinite or nan where there is no such link.

    """

    k: Array
    lengths: Array


class ThreePairs(NamedTuple):
    """
    What three pairs come to, and what it is worth; any number of them at once.

    Attributes
    ----------
    k, lengths
        As in `Links`.
    condition
        Of the matrix of rows (cos φ, cos θ, 1), by the 2-norm; (…).
    doubt
        Σ|x ∂y/∂x| over the six angles x; (…, 2). Of the logarithm y of the system's determinant,
        and of the coupler's angle y in the first pair, in [rad].
    sensitivity
        Of each length L, Σ|x ∂L/∂x| + ``abs(L)`` over the six angles x; (…, 3). Times 2⁻⁵³ it is
        what rounding the angles alone can make of a length.
    gradient
        ∂L/∂x of each length by the three crank angles, then by the three rocker angles, per
        [rad]; (…, 3, 6).

    """

    k: Array
    lengths: Array
    condition: Array
    doubt: Array
    sensitivity: Array
    gradient: Array

    @property
    def digits(self) -> Array:
        """Return how many digits of each length can be trusted, 0 to 16; (…, 3)."""
        with np.errstate(all='ignore'):
            return np.asarray(np.clip(-np.log10(self.lost), 0.0, 16.0))

    @property
    def lost(self) -> Array:
        """
        Return what part of each length may be the rounding of the angles; (…, 3).

        It is 4·2⁻⁵³ of the sensitivity, and the square of the greatest such part that lengths,
        determinant and direction of the coupler have, for what is not linear. Where that is a
        tenth and more, the first derivatives say nothing any more: then it is 1 for all three.
        """
        with np.errstate(all='ignore'):
            linear = _NOISE * self.sensitivity / np.abs(self.lengths)
            shaken = np.maximum(linear.max(-1), _NOISE * self.doubt.max(-1))[..., None]
            return np.where(shaken < _SHAKEN, linear + shaken * shaken, 1.0)


def links(crank: ArrayLike, rocker: ArrayLike) -> Links:
    """
    Solve for three pairs, or for many threes at once.

    Nothing is raised: what does not exist is infinite or nan.

    Parameters
    ----------
    crank, rocker
        Angles θ and φ, in [rad]; (…, 3).

    """
    theta, phi = _columns(crank), _columns(rocker)
    k, lengths = np.empty((2, *theta.shape))
    for block in _blocks(theta.shape[1]):
        system = solved(theta[:, block], phi[:, block])
        k[:, block], lengths[:, block] = system.k, system.lengths
    shape = np.shape(crank)
    return Links(k.T.reshape(shape), lengths.T.reshape(shape))


def three_pairs(crank: ArrayLike, rocker: ArrayLike) -> ThreePairs:
    """
    Solve for three pairs, or for many threes at once, and say what the result is worth.

    Nothing is raised: what does not exist is infinite or nan.

    Parameters
    ----------
    crank, rocker
        Angles θ and φ, in [rad]; (…, 3).

    """
    theta, phi = _columns(crank), _columns(rocker)
    count = theta.shape[1]
    k, lengths, kappa = np.empty((3, 3, count))
    conditions, doubts, slopes = np.empty(count), np.empty((2, count)), np.empty((3, 6, count))
    for block in _blocks(count):
        t, p = theta[:, block], phi[:, block]
        system = solved(t, p)
        k[:, block], lengths[:, block] = system.k, system.lengths
        with np.errstate(all='ignore'):
            conditions[block] = condition(system)
            by_angle = gradient(system)
            slopes[..., block] = by_angle[:3]
            *sums, turned = (np.abs(by_angle) * np.abs(np.concatenate((t, p)))).sum(1)
            kappa[:, block] = sums + np.abs(system.lengths)
            doubts[:, block] = doubt(system), turned
    shape = np.shape(crank)
    return ThreePairs(
        k.T.reshape(shape),
        lengths.T.reshape(shape),
        conditions.reshape(shape[:-1]),
        doubts.T.reshape((*shape[:-1], 2)),
        kappa.T.reshape(shape),
        np.moveaxis(slopes, 2, 0).reshape((*shape, 6)),
    )


def exact(
    crank: Sequence[float], rocker: Sequence[float], ground: float
) -> tuple[Design, ThreePairs]:
    """
    Design the four-bar of three pairs.

    Parameters
    ----------
    crank, rocker
        Three angles each, in [rad].
    ground
        Length of the ground, in [m].

    Raises
    ------
    SynthesisError
        Where two pairs contradict or repeat each other, or no one four-bar of finite links has
        the three.

    """
    check_pairs(crank, rocker, ground)
    found = three_pairs(crank, rocker)
    if not _NOISE * found.doubt[0] < _SHAKEN:
        raise dependent(crank, rocker)
    a, b, c = (float(length) for length in found.lengths)
    parts = _NOISE * found.sensitivity / np.abs(found.lengths)
    for link, length, part in (('crank', a, parts[0]), ('rocker', c, parts[2])):
        if not (part < 1.0 and abs(length) < LONGEST):
            raise SynthesisError(
                f'the {link}',
                'would be infinitely long, and is a slider on a straight line then',
                MOVE,
            )
    if not found.digits.all():
        raise SynthesisError(
            'the pairs',
            f'do not tell how long the links are: rounding their angles changes one by '
            f'{parts.max():.0%}',
            'move the pairs apart',
        )
    four_bar = FourBar.of_lengths(a * ground, b * ground, c * ground, ground)
    return assembled(Design(four_bar, wanted_of(crank, rocker))), found


def fit_equation(crank: Sequence[float], rocker: Sequence[float], ground: float) -> Design:
    """
    Design the four-bar that comes nearest to three pairs or more, by Freudenstein's equation.

    What is least is the sum of squares of what the equation leaves, not of the rocker's error;
    `angle_fit.nearest` starts from here.

    Parameters
    ----------
    crank, rocker
        As many angles each, in [rad].
    ground
        Length of the ground, in [m].

    Raises
    ------
    SynthesisError
        Where two pairs contradict or repeat each other, or all together do not fix a four-bar of
        finite links.

    """
    check_pairs(crank, rocker, ground)
    P, Q, R = centred(crank, rocker)
    sizes = np.array((np.linalg.norm(P), np.linalg.norm(Q)))
    size = np.linalg.norm((crank, rocker))
    k, _, rank, _ = np.linalg.lstsq(
        np.stack((P, Q), 1) / sizes, R, max(UNIT_ROUNDOFF * size / sizes.min(), 1e-12)
    )
    if rank < 2:
        raise dependent(crank, rocker)
    k1, k2 = (k / sizes).tolist()
    for link, inverse in (('crank', k1), ('rocker', k2)):
        if not abs(inverse) * LONGEST > 1.0:
            raise SynthesisError(
                f'the {link}',
                'of the nearest four-bar would be infinitely long, and is a slider then',
                MOVE,
            )
    a, c = 1.0 / k1, -1.0 / k2
    apart = 1.0 + c * np.exp(1j * np.array(rocker)) - a * np.exp(1j * np.array(crank))
    b = float(np.sqrt((np.abs(apart) ** 2).mean()))
    four_bar = FourBar.of_lengths(a * ground, b * ground, c * ground, ground)
    return assembled(Design(four_bar, wanted_of(crank, rocker)))


def _columns(angles: ArrayLike) -> Array:
    """Return threes of angles as (3, n)."""
    return np.ascontiguousarray(np.asarray(angles, np.float64).reshape(-1, 3).T)


def _blocks(count: int) -> list[slice]:
    return [slice(start, start + _BLOCK) for start in range(0, count, _BLOCK)]
