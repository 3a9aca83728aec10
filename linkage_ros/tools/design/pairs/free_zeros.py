# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Four and five pairs: the zeros of crank and rocker are unknowns too.

If only the rotations of crank and rocker matter and not their zeros, Freudenstein's equation has
two more unknowns, α and β::

    k1·cos(φ + β) + k2·cos(θ + α) + k3 = cos(θ + α − φ − β)

The equation of the first pair is subtracted from the others. With δ for half the differences from
the first pair, m for the means with it and

    p = sin δφ·e^{i·mφ},  q = sin δθ·e^{i·mθ},  r = sin(δθ − δφ)·e^{i(mθ − mφ)},

each other pair gives, by cos u − cos v = −2·sin((u + v)/2)·sin((u − v)/2),

    k1·Im(p·e^{iβ}) + k2·Im(q·e^{iα}) = Im(r·e^{i(α − β)}).

*Four pairs and one free zero.* Three equations in k1 and k2 have a solution if the determinant of
their three columns is zero. Two of the columns are linear in (cos β, sin β): a quadratic form, so
at most two zeros of the rocker are solutions. Likewise two of the crank.

*Five pairs and both zeros free.* With P = k1·e^{iβ}, Q = k2·e^{iα} and R = e^{i(α − β)} the four
equations are linear and homogeneous in six real numbers. Their solutions form a plane, s·u + t·v,
and in it R·P·Q* = k1·k2 must be real: a cubic form in s and t, so there are at most three
solutions, of which one or three are real.

A solution is polished by Newton's method on the differences. The last step computes the residuals
in sums of two doubles: they may be smaller than the rounding of their terms, and no more digits
may be lost than rounding the angles loses. The coupler is never imaginary: it closes the first
pair, and with it the others. A zero turned by π is the same linkage with the link reversed: zeros
are in [−π/2, π/2], and lengths have signs.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Iterator, Mapping, Sequence
from math import cos, hypot, log10, pi, sin
from typing import Literal, NamedTuple

from linkage_ros.errors import SynthesisError
from linkage_ros.kinematics import SMALLEST, UNIT_ROUNDOFF
from linkage_ros.tools.design.design import Design, FourBar
from linkage_ros.tools.design.double_double import (
    add,
    divide,
    multiply,
    sine,
    sine_cosine,
    subtract,
    two_sum,
    Twofold,
)
from linkage_ros.tools.design.pairs.freudenstein import check_pairs, LONGEST, TRUSTED, wanted_of
from linkage_ros.tools.design.proof import assemble
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Moved = Literal['rocker', 'crank', 'both']
Lost = Literal['imaginary', 'infinite', 'vague']

NOISE = 8.0
"""Multiple of the effect of rounding the angles: smaller values may be zero."""

_UNKNOWNS: dict[Moved, list[int]] = {'crank': [0, 1, 2], 'rocker': [0, 1, 3], 'both': [0, 1, 2, 3]}
"""Indices of the unknowns among k1, k2, α, β."""

_STEPS = 8
"""Most steps of Newton's method: two reach rounding level, except for a double root."""

_VAGUE = 0.1
"""Largest relative uncertainty of a link."""

_NEARLY_REAL = 1e-3
"""Largest imaginary part of a root that is still polished; rounding splits a double root so."""


class DividedDifferences(NamedTuple):
    """The equations of the other pairs minus the first, as rows of length 1."""

    # All angles; (n,).
    theta: Array
    phi: Array
    # As above, complex, divided by the size; (n − 1,).
    p: NDArray[np.complex128]
    q: NDArray[np.complex128]
    r: NDArray[np.complex128]
    size: Array  # Root of abs(p)² + abs(q)² + abs(r)²; (n − 1,)
    noise: Array  # Effect of rounding the angles on each row; (n − 1,)


class Solution(NamedTuple):
    """A four-bar on a ground of length 1."""

    lengths: Array  # Lengths of crank, coupler and rocker, the first and the last signed; (3,)
    zeros: Array  # α and β, in [−π/2, π/2]; (2,)
    # As in `free_zeros.FreeZeros`.
    condition: float
    sensitivity: Array


def equation_differences(crank: Sequence[float], rocker: Sequence[float]) -> DividedDifferences:
    """Return the equations of the other pairs minus the first; angles in [rad], (n,)."""
    theta, phi = np.asarray(crank, np.float64), np.asarray(rocker, np.float64)
    by_theta, by_phi = 0.5 * (theta[1:] - theta[0]), 0.5 * (phi[1:] - phi[0])
    mean_theta, mean_phi = 0.5 * (theta[1:] + theta[0]), 0.5 * (phi[1:] + phi[0])
    p = np.sin(by_phi) * np.exp(1j * mean_phi)
    q = np.sin(by_theta) * np.exp(1j * mean_theta)
    r = np.sin(by_theta - by_phi) * np.exp(1j * (mean_theta - mean_phi))
    size: Array = np.sqrt(np.abs(p) ** 2 + np.abs(q) ** 2 + np.abs(r) ** 2)
    angles = np.abs(theta) + np.abs(phi)
    noise = UNIT_ROUNDOFF * (1.0 + (angles[1:] + angles[0]) / size)
    return DividedDifferences(theta, phi, p / size, q / size, r / size, size, noise)


def polish(rows: DividedDifferences, alpha: float, beta: float, moved: Moved) -> Solution | Lost:
    """Return the four-bar nearest to these zeros, or the reason why there is none."""
    columns = np.stack(_equation_columns(rows, alpha, beta), -1)
    k1, k2, scaling = np.linalg.svd(columns * (1.0, 1.0, -1.0))[2][2]
    if abs(scaling) * LONGEST <= max(abs(k1), abs(k2)):
        return 'infinite'
    free = _UNKNOWNS[moved]
    best = np.array([k1 / scaling, k2 / scaling, alpha, beta])
    least = _largest_residual(rows, best)
    for _ in range(_STEPS):
        tried = best.copy()
        # A double root has no full rank: the shortest step is as good as any.
        slopes = _residual_slopes(rows, best)[:, free]
        tried[free] -= np.linalg.lstsq(slopes, _residuals(rows, best), rcond=None)[0]
        residual = _largest_residual(rows, tried)
        if not residual < least:
            break
        best, least = tried, residual
    if not least <= NOISE:
        return 'imaginary'
    if not 1.0 / LONGEST < min(abs(best[:2])) <= max(abs(best[:2])) < LONGEST:
        return 'infinite'
    with np.errstate(all='ignore'):
        solution = _value_solution(rows, best, free)
        lost = TRUSTED * UNIT_ROUNDOFF * solution.sensitivity[:3] / np.abs(solution.lengths)
    return solution if np.all(lost < _VAGUE) else 'vague'


def are_same(first: Solution, second: Solution) -> bool:
    """Return whether two differ only by rounding, as solutions near a double root may."""
    (pins, lost), (others, lost_too) = _pin_places(first), _pin_places(second)
    return bool(np.all(np.abs(pins - others) <= NOISE * UNIT_ROUNDOFF * (lost + lost_too)))


def _equation_columns(
    rows: DividedDifferences, alpha: float, beta: float
) -> tuple[Array, Array, Array]:
    """Return Im(p·e^{iβ}), Im(q·e^{iα}) and Im(r·e^{i(α − β)}); (n − 1,) each."""
    return (
        (rows.p * rect(1.0, beta)).imag,
        (rows.q * rect(1.0, alpha)).imag,
        (rows.r * rect(1.0, alpha - beta)).imag,
    )


def _residuals(rows: DividedDifferences, unknowns: Array) -> Array:
    """Return the residuals of the equations; (n − 1,)."""
    k1, k2, alpha, beta = unknowns
    P, Q, R = _equation_columns(rows, alpha, beta)
    left: Array = k1 * P + k2 * Q - R
    return left


def _left_exactly(rows: DividedDifferences, unknowns: Array) -> Array:
    """Return the residuals of the equations, by sums of two doubles; (n − 1,)."""
    k1, k2, alpha, beta = _as_twofold(unknowns)
    by_theta, by_phi = (_halve_angle(two_sum(z[1:], -z[:1])) for z in (rows.theta, rows.phi))
    theta, phi = (_halve_angle(two_sum(z[1:], z[:1])) for z in (rows.theta, rows.phi))
    theta, phi = add(theta, alpha), add(phi, beta)
    P, Q = multiply(sine(phi), sine(by_phi)), multiply(sine(theta), sine(by_theta))
    R = multiply(sine(subtract(theta, phi)), sine(subtract(by_theta, by_phi)))
    left: Array = subtract(add(multiply(k1, P), multiply(k2, Q)), R)[0] / rows.size
    return left


def _solve_links(
    rows: DividedDifferences, unknowns: Array, rest: Array
) -> tuple[float, float, complex, complex, complex]:
    """
    Return the lengths of crank and rocker, and the directions of the links in the first pair.

    By sums of two doubles: with a short coupler, crank and rocker cancel.
    """
    (unit,) = _as_twofold(np.ones(1))
    parts = zip(_as_twofold(unknowns), _as_twofold(rest), strict=True)
    k1, k2, alpha, beta = (add(value, low) for value, low in parts)
    a, c = divide(unit, k1), divide((-unit[0], unit[1]), k2)
    crank = [multiply(a, z) for z in sine_cosine(add((rows.theta[:1], unit[1]), alpha))]
    rocker = [multiply(c, z) for z in sine_cosine(add((rows.phi[:1], unit[1]), beta))]
    y, x = subtract(rocker[0], crank[0]), add(unit, subtract(rocker[1], crank[1]))
    turned = [complex(x[0].item(), y[0].item()) for y, x in (crank, rocker, (y, x))]
    return a[0].item(), c[0].item(), turned[0], turned[1], turned[2]


def _as_twofold(values: Array) -> list[Twofold]:
    return [(value, np.zeros(1)) for value in values[:, None]]


def _halve_angle(angle: Twofold) -> Twofold:
    return 0.5 * angle[0], 0.5 * angle[1]


def _largest_residual(rows: DividedDifferences, unknowns: Array) -> float:
    """Return the largest residual, relative to the effect of rounding the angles on it."""
    left = np.abs(_residuals(rows, unknowns)) / rows.noise
    return float(np.max(left)) / float(max(1.0, *np.abs(unknowns[:2])))


def _residual_slopes(rows: DividedDifferences, unknowns: Array) -> Array:
    """Return the derivatives of the residuals by k1, k2, α and β; (n − 1, 4)."""
    k1, k2, alpha, beta = unknowns
    P, Q, _ = _equation_columns(rows, alpha, beta)
    of_p, of_q = (rows.p * rect(1.0, beta)).real, (rows.q * rect(1.0, alpha)).real
    of_r = (rows.r * rect(1.0, alpha - beta)).real
    return np.stack((P, Q, k2 * of_q - of_r, k1 * of_p + of_r), -1)


def _value_solution(rows: DividedDifferences, unknowns: Array, free: list[int]) -> Solution:
    """
    Return the links, and their accuracy.

    The equation of a pair changes with its own angles by g = sin(θ + α − φ − β) − k2·sin(θ + α)
    and h = −sin(θ + α − φ − β) − k1·sin(φ + β), its difference by −g/2 and −h/2; with the angles
    of the first pair all differences change by the opposite.
    """
    k1, k2, alpha, beta = unknowns
    slopes = _residual_slopes(rows, unknowns)[:, free]
    across = np.linalg.norm(slopes, axis=0)
    scaled = slopes / across
    condition = float(np.linalg.cond(scaled / np.linalg.norm(scaled, axis=1)[:, None]))
    inverse = np.zeros((4, len(free)))
    inverse[free] = _invert_matrix(scaled) / across[:, None] / rows.size
    t, p = rows.theta + alpha, rows.phi + beta
    by = np.sin(t - p)
    parts = np.concatenate((-inverse.sum(-1, keepdims=True), inverse), -1) / 2.0
    of_k1, of_k2, of_alpha, of_beta = np.concatenate(
        (parts * (by - k2 * np.sin(t)), -parts * (by + k1 * np.sin(p))), -1
    )
    rest = np.zeros(4)
    rest[free] = -inverse[free] @ (rows.size * _left_exactly(rows, unknowns))
    a, c, crank, rocker, coupler = _solve_links(rows, unknowns, rest)
    of_a, of_c = -a * a * of_k1, c * c * of_k2
    # The coupler closes the first pair, whose angles also turn crank and rocker.
    of_t, of_p = of_alpha.copy(), of_beta.copy()
    of_t[0] += 1.0
    of_p[len(p)] += 1.0
    moved = rocker * (of_c / c + 1j * of_p) - crank * (of_a / a + 1j * of_t)
    of_b = (np.conj(coupler) * moved).real / abs(coupler)
    (alpha, sign_a), (beta, sign_c) = _acute_angle(alpha + rest[2]), _acute_angle(beta + rest[3])
    values = np.array([sign_a * a, abs(coupler), sign_c * c, alpha, beta])
    angles = np.abs(np.concatenate((rows.theta, rows.phi)))
    lost = np.abs(np.stack((of_a, of_b, of_c, of_alpha, of_beta)))
    sensitivity: Array = lost @ angles + np.abs(values)
    return Solution(values[:3], values[3:], condition, sensitivity)


def _invert_matrix(matrix: Array) -> Array:
    try:
        return np.asarray(np.linalg.inv(matrix), np.float64)
    except np.linalg.LinAlgError:
        return np.full_like(matrix, np.nan)


def _acute_angle(angle: float) -> tuple[float, float]:
    """Return an angle minus its half turns, in [−π/2, π/2], and −1.0 if these are odd."""
    halves = round(angle / pi)
    return angle - pi * halves, -1.0 if halves % 2 else 1.0


def _pin_places(solution: Solution) -> tuple[NDArray[np.complex128], Array]:
    """Return the pins of crank and rocker in their frames, and their sensitivities; (2,)."""
    lengths = solution.lengths[::2]
    sensitivity = solution.sensitivity[[0, 2]] + np.abs(lengths) * solution.sensitivity[3:]
    return lengths * np.exp(1j * solution.zeros), sensitivity


class Count(NamedTuple):
    """The number of solutions of the equations; a double one counts once."""

    real: int  # Real four-bars
    imaginary: int  # Solutions whose zeros are not real angles
    infinite: int  # Solutions with a crank or rocker of infinite length, or of no length
    # Solutions with uncertain links: rounding the angles alone changes one by a tenth or more.
    vague: int

    def __str__(self) -> str:
        """Return the text for a user, such as '3 solutions, 2 imaginary'."""
        parts = [f'{sum(self)} solution' + 's' * (sum(self) != 1)]
        kinds = ('imaginary', 'with infinite links', 'with uncertain links')
        parts += [f'{n} {kind}' for n, kind in zip(self[1:], kinds, strict=True) if n]
        return ', '.join(parts)


class FreeZeros(NamedTuple):
    """A solution with free zeros."""

    # The four-bar; the places of its pins in the frames of crank and rocker make the angles those
    # of the pairs.
    design: Design
    moved: Moved  # The link whose zero was free
    # Lengths of crank, coupler and rocker, in [m]; crank and rocker are negative if the link
    # points the other way.
    lengths: tuple[float, float, float]
    # Zeros of crank and rocker, in [rad], in [−π/2, π/2]: the angle of the pin minus that of the
    # link; 0 if it was not free.
    alpha: float
    beta: float
    # Condition number of the differences' derivatives by k1, k2 and the free zeros, by the 2-norm,
    # with rows and columns scaled to length 1. It does not include the nearness of the angles; the
    # sensitivity does.
    condition: float
    # Σ|x ∂L/∂x| + ``abs(L)`` of crank, coupler, rocker, α and β over all angles x. Times 2⁻⁵³ it
    # bounds the error that rounding the angles alone causes; errors are within twice that.
    sensitivity: tuple[float, ...]
    solution_counts: Count  # The number of all solutions of the pairs, including this one

    @property
    def reliable_digits(self) -> tuple[float, float, float]:
        """Return the number of reliable digits of a, b and c, 0 to 16."""
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
    Return all four-bars for four pairs, with the zero of the rocker free, then the crank's.

    Of each the best conditioned comes first. A four-bar with both zeros at 0 is listed once.
    Angles are in [rad], the ground in [m]. A SynthesisError says that none is real with finite
    links, or that infinitely many exist.
    """
    check_pairs(crank, rocker, ground)
    rows = equation_differences(crank, rocker)
    sizes = np.linalg.svd(_real_rows(rows), compute_uv=False)
    # Rounding error of a determinant: the error of one row times the largest area of the others.
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
                _triple_product(even[0], fixed, even[1]),
                _triple_product(even[0], fixed, odd[1]) + _triple_product(odd[0], fixed, even[1]),
                _triple_product(odd[0], fixed, odd[1]),
            ]
        )
        if np.max(np.abs(form)) <= noise:
            vague += 2
            continue
        roots = list(_form_roots(form))
        imaginary += 2 - len(roots)
        for x, y in roots:
            zero = phase(complex(x, y))
            directions.append(('crank', zero, 0.0) if moved == 'crank' else ('rocker', 0.0, zero))
    if vague == 4:
        raise _undetermined_error(4)
    return _list_solutions(rows, directions, {'imaginary': imaginary, 'vague': vague}, ground)


def five_pairs(
    crank: Sequence[float], rocker: Sequence[float], ground: float
) -> tuple[FreeZeros, ...]:
    """
    Return all four-bars for five pairs with the zeros of crank and rocker free.

    The best conditioned comes first. Units and errors are as in `four_pairs`.
    """
    check_pairs(crank, rocker, ground)
    rows = equation_differences(crank, rocker)
    _, sizes, vectors = np.linalg.svd(_real_rows(rows))
    noise = NOISE * np.linalg.norm(rows.noise) / max(float(sizes[3]), SMALLEST)
    # R has the opposite sign here, which is equivalent.
    P, Q, R = (vectors[4:, i] + 1j * vectors[4:, i + 1] for i in (0, 2, 4))
    form: Array = np.convolve(np.convolve(R, P), np.conj(Q)).imag
    p, q, r = map(np.linalg.norm, (P, Q, R))
    if np.max(np.abs(form)) <= noise * (p * q + q * r + r * p):
        raise _undetermined_error(5)
    directions: list[tuple[Moved, float, float]] = []
    for s, t in _form_roots(form):
        p, q, r = (s * z[0] + t * z[1] for z in (P, Q, R))
        # From the two largest: the third may be nothing but rounding.
        smallest = min(map(abs, (p, q, r)))
        alpha = phase(p) + phase(r) if abs(q) == smallest else phase(q)
        beta = phase(q) - phase(r) if abs(p) == smallest else phase(p)
        directions.append(('both', alpha, beta))
    return _list_solutions(rows, directions, {'imaginary': 3 - len(directions)}, ground)


def _real_rows(rows: DividedDifferences) -> Array:
    """Return rows of Im(p·P) + Im(q·Q) + Im(r·R) in real and imaginary parts; (n − 1, 6)."""
    return np.stack([x for z in (rows.p, rows.q, rows.r) for x in (z.imag, z.real)], -1)


def _triple_product(first: Array, second: Array, third: Array) -> float:
    return float(np.dot(np.cross(first, second), third))


def _form_roots(form: Array) -> Iterator[tuple[float, float]]:
    """Yield the roots of Σ form[j]·xⁿ⁻ʲ·yʲ as (x, y) of length 1; also roots almost real."""
    degree = len(form) - 1
    turns = np.arange(8) * pi / 8
    powers = [np.cos(turns) ** (degree - j) * np.sin(turns) ** j for j in range(degree + 1)]
    # The rotation that leaves no root near infinity.
    turn = float(turns[np.argmax(np.abs(form @ powers))])
    c, s = cos(turn), sin(turn)
    for root in np.roots(_turned_form(form, c, s)):
        if abs(root.imag) < _NEARLY_REAL * (1.0 + abs(root)):
            x, y = c * root.real - s, s * root.real + c
            yield x / hypot(x, y), y / hypot(x, y)


def _turned_form(form: Array, c: float, s: float) -> Array:
    """Return a form at x = c·t − s, y = s·t + c as a polynomial in t, by falling powers."""
    degree = len(form) - 1
    total = np.zeros(degree + 1)
    for j, coefficient in enumerate(form):
        term = np.ones(1)
        for factor in (degree - j) * [(c, -s)] + j * [(s, c)]:
            term = np.convolve(term, factor)
        total += coefficient * term
    return total


def _list_solutions(
    rows: DividedDifferences,
    directions: Sequence[tuple[Moved, float, float]],
    lost: Mapping[Lost, int],
    ground: float,
) -> tuple[FreeZeros, ...]:
    """Return the four-bars near to (moved, α, β), or raise the reason why there are none."""
    counts: dict[Lost, int] = {'imaginary': 0, 'infinite': 0, 'vague': 0, **lost}
    candidates: list[tuple[Moved, Solution]] = []
    for moved, alpha, beta in directions:
        solution = polish(rows, alpha, beta, moved)
        if isinstance(solution, str):
            counts[solution] += 1
        else:
            candidates.append((moved, solution))
    # Of two equal ones, the less sensitive stays.
    candidates.sort(key=lambda candidate: float(np.sum(candidate[1].sensitivity)))
    four_bars: list[tuple[Moved, Solution]] = []
    for moved, solution in candidates:
        if not any(are_same(solution, four_bar) for _, four_bar in four_bars):
            four_bars.append((moved, solution))
    among = Count(len(four_bars), *counts.values())
    if not four_bars:
        free = 'a zero of rocker or crank' if len(rows.theta) == 4 else 'both zeros'
        raise SynthesisError(
            'pairs',
            f'no four-bar has all {len(rows.theta)} with {free} free: {among}',
            'move one of the angles, or leave the zeros as they are for the nearest four-bar',
        )
    four_bars.sort(key=lambda four_bar: (four_bar[0] == 'crank', four_bar[1].condition))
    return tuple(
        _scale_solution(rows, moved, solution, among, ground) for moved, solution in four_bars
    )


def _scale_solution(
    rows: DividedDifferences, moved: Moved, solution: Solution, among: Count, ground: float
) -> FreeZeros:
    """Return a solution scaled to its ground."""
    a, b, c = solution.lengths.tolist()
    alpha, beta = solution.zeros.tolist()
    lengths = a * ground, b * ground, c * ground
    four_bar = FourBar.of_lengths(*lengths, ground, alpha, beta)
    design = assemble(Design(four_bar, wanted_of(rows.theta.tolist(), rows.phi.tolist())))
    scale = np.array([ground, ground, ground, 1.0, 1.0])
    sensitivity = tuple((solution.sensitivity * scale).tolist())
    return FreeZeros(design, moved, lengths, alpha, beta, solution.condition, sensitivity, among)


def _undetermined_error(count: int) -> SynthesisError:
    return SynthesisError(
        'pairs',
        f'the {count} equations depend on each other, so that any number of four-bars fits or '
        'none, or the pairs are too close to decide',
        'move one of the angles, or leave the zeros as they are',
    )
