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
Four and five pairs: the zeros of crank and rocker are unknowns too.

Where only the turns of crank and rocker matter and not where they are counted from,
Freudenstein's equation has two unknowns more, α and β::

    k1·cos(φ + β) + k2·cos(θ + α) + k3 = cos(θ + α − φ − β)

The first pair's is taken from the others. With δ for the halves of the differences to the first
pair, m for the means with it and

    p = sin δφ·e^{i·mφ},  q = sin δθ·e^{i·mθ},  r = sin(δθ − δφ)·e^{i(mθ − mφ)},

what is left of each other pair is, by cos u − cos v = −2·sin((u + v)/2)·sin((u − v)/2),

    k1·Im(p·e^{iβ}) + k2·Im(q·e^{iα}) = Im(r·e^{i(α − β)}).

*Four pairs and one zero free.* Three equations in k1 and k2 have a solution where the determinant
of their three columns is zero. Two of the columns are linear in (cos β, sin β): a quadratic form,
so that two zeros of the rocker fit at most. Likewise two of the crank.

*Five pairs and both free.* With P = k1·e^{iβ}, Q = k2·e^{iα} and R = e^{i(α − β)} the four
equations are linear and homogeneous in six real numbers. What they leave is a plane, s·u + t·v,
and in it R·P·Q* = k1·k2 must be real: a cubic form in s and t, so that three solutions fit at
most, and one or three are real.

A solution is polished by Newton's method on the differences (`zero_solution`). Its coupler is
never imaginary: it closes the first pair, and the others with it. A zero turned by π is the same
linkage with the link reversed: zeros are in [−π/2, π/2], and lengths have signs.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Iterator, Mapping, Sequence
from math import cos, hypot, log10, pi, sin
from typing import NamedTuple

from linkage_ros.errors import SynthesisError
from linkage_ros.kinematics.rounding import SMALLEST, UNIT_ROUNDOFF
from linkage_ros.synthesis.design import Design, FourBar
from linkage_ros.synthesis.pairs.checks import check_pairs, wanted_of
from linkage_ros.synthesis.pairs.freudenstein import TRUSTED
from linkage_ros.synthesis.pairs.zero_solution import (
    Differences,
    differences,
    Lost,
    Moved,
    NOISE,
    polished,
    same,
    Solution,
)
from linkage_ros.synthesis.proof import assembled
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_NEARLY_REAL = 1e-3
"""Imaginary part of a root that is polished all the same; rounding splits a double root so."""


class Count(NamedTuple):
    """
    How many solutions the equations have; a double one counts once.

    Attributes
    ----------
    real
        Four-bars.
    imaginary
        Solutions whose zeros are no real angles.
    infinite
        With a crank or rocker infinitely long, or of no length.
    vague
        Whose links cannot be told: rounding the angles alone changes one by a tenth and more.

    """

    real: int
    imaginary: int
    infinite: int
    vague: int

    def __str__(self) -> str:
        """Return what a user reads, as '3 solutions, 2 imaginary'."""
        said = [f'{sum(self)} solution' + 's' * (sum(self) != 1)]
        kinds = ('imaginary', 'with infinite links', 'whose links cannot be told')
        said += [f'{n} {kind}' for n, kind in zip(self[1:], kinds, strict=True) if n]
        return ', '.join(said)


class FreeZeros(NamedTuple):
    """
    A solution with zeros of its own.

    Attributes
    ----------
    design
        The four-bar; its pins lie so in the frames of crank and rocker that the angles are those
        of the pairs.
    moved
        Whose zero was free.
    lengths
        Of crank, coupler and rocker, in [m]; crank and rocker are negative where the link points
        the other way.
    alpha, beta
        Zeros of crank and rocker, in [rad], in [−π/2, π/2]: what the pin's angle has over the
        link's; 0 where it was not free.
    condition
        Of the differences' derivatives by k1, k2 and the free zeros, by the 2-norm, rows and
        columns scaled to length 1. It does not know of the angles' nearness; sensitivity does.
    sensitivity
        Of crank, coupler, rocker, α and β: Σ|x ∂L/∂x| + ``abs(L)`` over all angles x. Times 2⁻⁵³
        it is what rounding the angles alone can make of each; errors are within twice that.
    among
        Of all solutions that the pairs have, this one among them.

    """

    design: Design
    moved: Moved
    lengths: tuple[float, float, float]
    alpha: float
    beta: float
    condition: float
    sensitivity: tuple[float, ...]
    among: Count

    @property
    def digits(self) -> tuple[float, float, float]:
        """Return how many digits of a, b and c can be trusted, 0 to 16."""
        lost = (
            TRUSTED * UNIT_ROUNDOFF * part / abs(length)
            for part, length in zip(self.sensitivity[:3], self.lengths, strict=True)
        )
        crank, coupler, rocker = (min(max(-log10(part), 0.0), 16.0) for part in lost)
        return crank, coupler, rocker


def four_pairs(
    crank: Sequence[float], rocker: Sequence[float], ground: float
) -> tuple[FreeZeros, ...]:
    """
    Return all four-bars that have four pairs, with the zero of the rocker free, then the crank's.

    Of each the best conditioned comes first. A four-bar that needs no zero moved is listed once.

    Parameters
    ----------
    crank, rocker
        Four angles each, in [rad].
    ground
        Length of the ground, in [m].

    Raises
    ------
    SynthesisError
        Where none is real with finite links, or any number of them fits.

    """
    check_pairs(crank, rocker, ground)
    rows = differences(crank, rocker)
    sizes = np.linalg.svd(_real(rows), compute_uv=False)
    # Of a determinant of three rows, by rounding one: with an area that the others span at most.
    noise = NOISE * np.sum(rows.noise) * sizes[0] * sizes[1]
    directions: list[tuple[Moved, float, float]] = []
    imaginary = vague = 0
    for moved, fixed, turned, back in (
        ('rocker', rows.q.imag, rows.p, -1.0),
        ('crank', rows.p.imag, rows.q, 1.0),
    ):
        # Im(z·e^{±iγ}) = cos γ·Im z ± sin γ·Re z
        even = turned.imag, rows.r.imag
        odd = turned.real, back * rows.r.real
        form = np.array(
            [
                _determinant(even[0], fixed, even[1]),
                _determinant(even[0], fixed, odd[1]) + _determinant(odd[0], fixed, even[1]),
                _determinant(odd[0], fixed, odd[1]),
            ]
        )
        if np.max(np.abs(form)) <= noise:
            vague += 2
            continue
        roots = list(_roots(form))
        imaginary += 2 - len(roots)
        for x, y in roots:
            zero = phase(complex(x, y))
            directions.append(('crank', zero, 0.0) if moved == 'crank' else ('rocker', 0.0, zero))
    if vague == 4:
        raise _undetermined(4)
    return _listed(rows, directions, {'imaginary': imaginary, 'vague': vague}, ground)


def five_pairs(
    crank: Sequence[float], rocker: Sequence[float], ground: float
) -> tuple[FreeZeros, ...]:
    """
    Return all four-bars that have five pairs with the zeros of crank and rocker free.

    The best conditioned comes first.

    Parameters
    ----------
    crank, rocker
        Five angles each, in [rad].
    ground
        Length of the ground, in [m].

    Raises
    ------
    SynthesisError
        Where none is real with finite links, or any number of them fits.

    """
    check_pairs(crank, rocker, ground)
    rows = differences(crank, rocker)
    _, sizes, vectors = np.linalg.svd(_real(rows))
    noise = NOISE * np.linalg.norm(rows.noise) / max(float(sizes[3]), SMALLEST)
    # R is found with the other sign, which is as good.
    P, Q, R = (vectors[4:, i] + 1j * vectors[4:, i + 1] for i in (0, 2, 4))
    form: Array = np.convolve(np.convolve(R, P), np.conj(Q)).imag
    p, q, r = map(np.linalg.norm, (P, Q, R))
    if np.max(np.abs(form)) <= noise * (p * q + q * r + r * p):
        raise _undetermined(5)
    directions: list[tuple[Moved, float, float]] = []
    for s, t in _roots(form):
        p, q, r = (s * z[0] + t * z[1] for z in (P, Q, R))
        # From the two that are largest: the third may be nothing but rounding.
        smallest = min(map(abs, (p, q, r)))
        alpha = phase(p) + phase(r) if abs(q) == smallest else phase(q)
        beta = phase(q) - phase(r) if abs(p) == smallest else phase(p)
        directions.append(('both', alpha, beta))
    return _listed(rows, directions, {'imaginary': 3 - len(directions)}, ground)


def _real(rows: Differences) -> Array:
    """Return rows of Im(p·P) + Im(q·Q) + Im(r·R) in real and imaginary parts; (n − 1, 6)."""
    return np.stack([x for z in (rows.p, rows.q, rows.r) for x in (z.imag, z.real)], -1)


def _determinant(one: Array, other: Array, third: Array) -> float:
    return float(np.dot(np.cross(one, other), third))


def _roots(form: Array) -> Iterator[tuple[float, float]]:
    """Yield where Σ form[j]·xⁿ⁻ʲ·yʲ is zero, as (x, y) of length 1; also what is almost real."""
    degree = len(form) - 1
    turns = np.arange(8) * pi / 8
    powers = [np.cos(turns) ** (degree - j) * np.sin(turns) ** j for j in range(degree + 1)]
    # The turn that leaves no root near infinity.
    turn = float(turns[np.argmax(np.abs(form @ powers))])
    c, s = cos(turn), sin(turn)
    for root in np.roots(_turned(form, c, s)):
        if abs(root.imag) < _NEARLY_REAL * (1.0 + abs(root)):
            x, y = c * root.real - s, s * root.real + c
            yield x / hypot(x, y), y / hypot(x, y)


def _turned(form: Array, c: float, s: float) -> Array:
    """Return a form at x = c·t − s, y = s·t + c as a polynomial in t, by falling powers."""
    degree = len(form) - 1
    total = np.zeros(degree + 1)
    for j, coefficient in enumerate(form):
        term = np.ones(1)
        for factor in (degree - j) * [(c, -s)] + j * [(s, c)]:
            term = np.convolve(term, factor)
        total += coefficient * term
    return total


def _listed(
    rows: Differences,
    directions: Sequence[tuple[Moved, float, float]],
    lost: Mapping[Lost, int],
    ground: float,
) -> tuple[FreeZeros, ...]:
    """Return the four-bars near to (whose zero is free, α, β), or say why there are none."""
    counts: dict[Lost, int] = {'imaginary': 0, 'infinite': 0, 'vague': 0, **lost}
    candidates: list[tuple[Moved, Solution]] = []
    for moved, alpha, beta in directions:
        solution = polished(rows, alpha, beta, moved)
        if isinstance(solution, str):
            counts[solution] += 1
        else:
            candidates.append((moved, solution))
    # Of two that are the same, the one that can be told better stays.
    candidates.sort(key=lambda one: float(np.sum(one[1].sensitivity)))
    found: list[tuple[Moved, Solution]] = []
    for moved, solution in candidates:
        if not any(same(solution, other) for _, other in found):
            found.append((moved, solution))
    among = Count(len(found), *counts.values())
    if not found:
        free = 'a zero of rocker or crank' if len(rows.theta) == 4 else 'both zeros'
        raise SynthesisError(
            'pairs',
            f'no four-bar has all {len(rows.theta)} with {free} free: {among}',
            'move one of the angles, or leave the zeros as they are for the nearest four-bar',
        )
    found.sort(key=lambda one: (one[0] == 'crank', one[1].condition))
    return tuple(_result(rows, moved, solution, among, ground) for moved, solution in found)


def _result(
    rows: Differences, moved: Moved, solution: Solution, among: Count, ground: float
) -> FreeZeros:
    """Return a solution on its ground."""
    a, b, c = solution.lengths.tolist()
    alpha, beta = solution.zeros.tolist()
    lengths = a * ground, b * ground, c * ground
    four_bar = FourBar.of_lengths(*lengths, ground, alpha, beta)
    design = assembled(Design(four_bar, wanted_of(rows.theta.tolist(), rows.phi.tolist())))
    scale = np.array([ground, ground, ground, 1.0, 1.0])
    sensitivity = tuple((solution.sensitivity * scale).tolist())
    return FreeZeros(design, moved, lengths, alpha, beta, solution.condition, sensitivity, among)


def _undetermined(count: int) -> SynthesisError:
    return SynthesisError(
        'pairs',
        f'the {count} equations depend on each other, so that any number of four-bars fits or '
        'none, or the pairs are too near each other to tell',
        'move one of the angles, or leave the zeros as they are',
    )
