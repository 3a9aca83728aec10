# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Rigorous enclosures of the joints of a linkage and their derivatives, over cells of its input.

Numbers are discs: a centre, real or complex, and a radius that bounds the distance of the number
from it, including the rounding of the centre (circular arithmetic: I. Gargantini and P. Henrici,
Numer. Math. 18, 1972). All are arrays over the cells of a range; apart from overflow, each bound
is rigorous.

Over a cell, an interval T of the input with the middle t, the loop equations F(T, y) = 0 of a
group of links are proven to have exactly one solution y within ρ of the closed form at t, by the
operator of Krawczyk (R. Krawczyk, Computing 4, 1969). With Y near F_y⁻¹ the condition is::

    |Y·F(T, y(t))| + |1 − Y·F_y(T, y(t) ± ρ)|·ρ < ρ

All Taylor coefficients of y by the input follow from F_y·y_k = −(F_k with y_k = 0), as discs that
hold them over the whole cell. Groups are enclosed in the order of solution, each with the discs of
the groups before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from linkage_ros.solvers.loops import Loops, Vector
import numpy as np
from numpy.typing import NDArray

_ROUNDING = 2.0**-50
"""Relative bound of a centre's error: a product of complex numbers, a sine of numpy."""

_LEAST = 2.0**-1020
"""Bound of the error of a product that underflows."""

_UP = 1.0 + 2.0**-48
"""Factor that covers the rounding of a radius."""

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_LEAST_BOX = 2.0**-44
"""Relative to the size of an unknown, or to 1: a narrower box would be lost in its rounding."""

_UP_MATRIX = 1.0 + 2.0**-40
"""Factor that covers the rounding of bounds that are computed by matrices."""


class Disc(NamedTuple):
    """Numbers within a radius of a centre."""

    center: Any
    radius: Any

    @property
    def magnitude(self) -> Any:
        """Return a bound of the absolute value."""
        return (np.abs(self.center) + self.radius) * _UP


Jet = list[Disc]
"""The coefficients of a Taylor series, from order 0 on."""

ZERO = Disc(0.0, 0.0)


def sum_discs(discs: Sequence[Disc]) -> Disc:
    """Return the sum."""
    center = sum(disc.center for disc in discs)
    sizes = sum(np.abs(disc.center) for disc in discs)
    return Disc(center, sum(disc.radius for disc in discs) * _UP + len(discs) * _ROUNDING * sizes)


def multiply_discs(one: Disc, other: Disc) -> Disc:
    """Return the product."""
    a, b = np.abs(one.center), np.abs(other.center)
    radius = (a * other.radius + b * one.radius + one.radius * other.radius) * _UP
    return Disc(one.center * other.center, radius + _ROUNDING * a * b + _LEAST)


def scale_disc(disc: Disc, factor: complex) -> Disc:
    """Return the product with an exact number."""
    size = abs(factor)
    radius = disc.radius * size * _UP + _ROUNDING * size * np.abs(disc.center) + _LEAST
    return Disc(disc.center * factor, radius)


def unit_vector(angle: Jet) -> Jet:
    """
    Return e^{iφ}; its coefficient of order k is i/k·Σ j·φ_j·e_(k−j).

    An arc is no shorter than its chord, so the radius of an angle is also one of its direction.
    """
    center = np.exp(1j * np.asarray(angle[0].center))
    jet = [Disc(center, angle[0].radius * _UP + _ROUNDING)]
    for k in range(1, len(angle)):
        parts = [scale_disc(multiply_discs(angle[j], jet[k - j]), 1j * j) for j in range(1, k + 1)]
        jet.append(scale_disc(sum_discs(parts), 1.0 / k))
    return jet


def jet_product(one: Jet, other: Jet) -> Jet:
    """Return the product of two series."""
    return [
        sum_discs([multiply_discs(one[j], other[k - j]) for j in range(k + 1)])
        for k in range(len(one))
    ]


class Cells(NamedTuple):
    """Cells of the input, in the coordinate of the input, and the closed form at their middles."""

    # Middle and half width of each cell.
    middle: Array
    half: Array
    coordinates: Array  # A row for each coordinate, NaN if the loops do not close
    pins: NDArray[np.complex128]  # Likewise for the pins that iterations have placed


class Unknowns(NamedTuple):
    """The solution of a group over each cell; arrays of shape (cells, unknowns)."""

    middle: Array  # Values of the closed form
    box: Array  # ρ: within this distance there is no other solution
    radius: Array  # Within this distance there is the solution
    turning: Mask  # For each unknown whether it is an angle


class Enclosure(NamedTuple):
    """The enclosure of each cell."""

    proven: Mask  # Whether there is exactly one solution
    # For each coordinate its Taylor coefficients by the coordinate of the input.
    jets: dict[int, Jet]
    groups: list[Unknowns]  # The unknowns of each group


def enclose_coordinates(groups: Sequence[Loops], cells: Cells, order: int) -> Enclosure:
    """Enclose all coordinates over the cells, up to an order of the Taylor coefficients."""
    zero = [ZERO] * (order + 1)
    given: Jet = [Disc(cells.middle, cells.half), Disc(1.0, 0.0), *zero][: order + 1]
    jets: dict[int, Jet] = {0: zero, 1: given}
    pins: dict[int, Jet] = {}
    proven: Mask = np.asarray(np.isfinite(cells.coordinates).all(axis=0))
    solved = []
    for loops in groups:
        group = _EnclosedGroup(loops, cells, jets, pins)
        unknowns, held = group.find_unknowns(order)
        proven &= held
        solved.append(unknowns)
    return Enclosure(proven, jets, solved)


class _EnclosedGroup:
    """A group of links, and the jets known before it."""

    def __init__(
        self, loops: Loops, cells: Cells, jets: dict[int, Jet], pins: dict[int, Jet]
    ) -> None:
        self._loops = loops
        self._jets, self._pins = jets, pins
        self._count = len(cells.middle)
        rows = [cells.coordinates[k] for k in loops.coordinates]
        rows += [part for k in loops.pins for part in (cells.pins[k].real, cells.pins[k].imag)]
        self._middle = np.nan_to_num(np.array(rows)).T
        turning = {k for equation in loops.equations for vector in equation for k, _ in vector[1]}
        self._turning = np.array(
            [k in turning for k in loops.coordinates] + [False] * (2 * len(loops.pins))
        )

    def find_unknowns(self, order: int) -> tuple[Unknowns, Mask]:
        """Append the jets of the unknowns; return their solution, and where it is proven."""
        middle = self._middle
        self._set_unknowns(0, middle, np.zeros_like(middle))
        slopes, _ = self._equation_slopes()
        inverse, regular = _invert_matrices(slopes)
        step, spread = self._newton_step(0, inverse)
        first = np.abs(step) + spread
        # A pin on the ground that a group places moves only by rounding.
        box = 2.0 * first + _LEAST_BOX * (1.0 + np.abs(middle))
        radius, held = self._distance_within(box, first, inverse)
        if not held.all():
            # The box of an unknown that does not move may be too narrow for the others' effect.
            box = np.where(held[:, None], box, np.maximum(box, 1.5 * radius))
            radius, held = self._distance_within(box, first, inverse)
        proven = regular & held
        self._set_unknowns(0, middle, radius)
        loss = self._contraction_bound(inverse)
        worst = loss.sum(axis=2).max(axis=1)
        proven &= worst < 1.0
        for k in range(1, order + 1):
            for jets, numbers in (
                (self._jets, self._loops.coordinates),
                (self._pins, self._loops.pins),
            ):
                for number in numbers:
                    jets[number].append(ZERO)
            step, spread = self._newton_step(k, inverse)
            with np.errstate(all='ignore'):
                largest = (np.abs(step) + spread).max(axis=1) / (1.0 - worst)
            self._set_unknowns(
                k, step, (spread + loss.sum(axis=2) * largest[:, None]) * _UP_MATRIX
            )
        return Unknowns(middle, box, radius, self._turning), proven

    def _distance_within(self, box: Array, first: Array, inverse: Array) -> tuple[Array, Mask]:
        """Return the distance of a solution from the middle, and where it is within the box."""
        self._set_unknowns(0, self._middle, box)
        radius: Array = (
            first + _matrix_products(self._contraction_bound(inverse), box)
        ) * _UP_MATRIX
        held: Mask = np.asarray((radius < box).all(axis=1))
        return radius, held

    def _newton_step(self, order: int, inverse: Array) -> tuple[Array, Array]:
        """Return −Y·F at an order: middles and radii."""
        errors, spread = self._equation_values(order)
        n = errors.shape[1]
        radius = _matrix_products(np.abs(inverse), spread + n * _ROUNDING * np.abs(errors))
        return -_matrix_products(inverse, errors), radius * _UP_MATRIX

    def _contraction_bound(self, inverse: Array) -> Array:
        """Return a bound of |1 − Y·F_y| over the current unknowns."""
        slopes, spread = self._equation_slopes()
        n = slopes.shape[1]
        size = np.abs(inverse)
        off = np.abs(np.eye(n) - inverse @ slopes) + n * _ROUNDING * (size @ np.abs(slopes) + 1.0)
        loss: Array = (off + size @ spread) * _UP_MATRIX
        return loss

    def _set_unknowns(self, order: int, middle: Array, radius: Array) -> None:
        """Set the unknowns of an order."""
        coordinates, pins = self._loops.coordinates, self._loops.pins
        for column, k in enumerate(coordinates):
            jet = self._jets.setdefault(k, [ZERO])
            jet[order] = Disc(middle[:, column], radius[:, column])
        for index, k in enumerate(pins):
            column = len(coordinates) + 2 * index
            jet = self._pins.setdefault(k, [ZERO])
            place = middle[:, column] + 1j * middle[:, column + 1]
            jet[order] = Disc(place, radius[:, column] + radius[:, column + 1])

    def _equation_values(self, order: int) -> tuple[Array, Array]:
        """Return the values of the equations at an order: middles, radii, (cells, equations)."""
        middles, radii = [], []
        for equation in self._loops.equations:
            residual = sum_discs([self._vector_jet(vector, order)[order] for vector in equation])
            middles += [np.real(residual.center), np.imag(residual.center)]
            radii += [residual.radius, residual.radius]
        for terms, constant, turning in self._loops.balances:
            parts = [scale_disc(self._jets[k][order], sign) for k, sign in terms]
            residual = sum_discs([*parts, Disc(constant if order == 0 else 0.0, 0.0)])
            center = np.real(residual.center)
            if turning and order == 0:
                center = np.remainder(center + np.pi, 2.0 * np.pi) - np.pi
            middles.append(center)
            radii.append(residual.radius + 4.0 * _ROUNDING)
        shape = (self._count,)
        return (
            np.stack([np.broadcast_to(one, shape) for one in middles], axis=1),
            np.stack([np.broadcast_to(one, shape) for one in radii], axis=1),
        )

    def _vector_jet(self, vector: Vector, order: int) -> Jet:
        factor, turns, slide, pin = vector
        if pin >= 0:
            return [scale_disc(disc, factor) for disc in self._pins[pin][: order + 1]]
        if turns:
            angle = [
                sum_discs([scale_disc(self._jets[k][i], sign) for k, sign in turns])
                for i in range(order + 1)
            ]
            way = unit_vector(angle)
        else:
            way = [Disc(1.0 + 0j, 0.0), *[ZERO] * order]
        if slide >= 0:
            way = jet_product(way, self._jets[slide][: order + 1])
        return [scale_disc(disc, factor) for disc in way]

    def _equation_slopes(self) -> tuple[Array, Array]:
        """Return the derivatives of equations by unknowns, (cells, equations, unknowns)."""
        coordinates, pins = self._loops.coordinates, self._loops.pins
        n = self._middle.shape[1]
        middle, radius = np.zeros((2, self._count, n, n))
        for index, equation in enumerate(self._loops.equations):
            row = 2 * index
            for vector in equation:
                for column, slope in self._by_unknowns(vector, coordinates, pins):
                    middle[:, row, column] += np.real(slope.center)
                    middle[:, row + 1, column] += np.imag(slope.center)
                    radius[:, [row, row + 1], column] += np.broadcast_to(
                        slope.magnitude * _ROUNDING + slope.radius, (self._count,)
                    )[:, None]
        for row, balance in enumerate(self._loops.balances, 2 * len(self._loops.equations)):
            for k, sign in balance.terms:
                if k in coordinates:
                    middle[:, row, coordinates.index(k)] += sign
        return middle, radius

    def _by_unknowns(
        self, vector: Vector, coordinates: tuple[int, ...], pins: tuple[int, ...]
    ) -> list[tuple[int, Disc]]:
        factor, turns, slide, pin = vector
        if pin in pins:
            column = len(coordinates) + 2 * pins.index(pin)
            return [(column, Disc(factor, 0.0)), (column + 1, Disc(1j * factor, 0.0))]
        slopes: list[tuple[int, Disc]] = []
        whole = self._vector_jet(vector, 0)[0]
        for k, sign in turns:
            if k in coordinates:
                slopes.append((coordinates.index(k), scale_disc(whole, sign * 1j)))
        if slide in coordinates:
            unit = self._vector_jet(vector._replace(slide=-1), 0)[0]
            slopes.append((coordinates.index(slide), unit))
        return slopes


def _matrix_products(matrix: Array, vector: Array) -> Array:
    """Return the products of matrices and vectors, cell by cell."""
    image: Array = np.einsum('cij,cj->ci', matrix, vector)
    return image


def _invert_matrices(matrices: Array) -> tuple[Array, Mask]:
    """Return the inverse of each matrix, and which matrices have one."""
    regular: Mask = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    safe = np.where(regular[:, None, None], matrices, np.eye(matrices.shape[1]))
    regular &= np.abs(np.linalg.det(safe)) > 0.0
    safe = np.where(regular[:, None, None], safe, np.eye(matrices.shape[1]))
    return np.linalg.inv(safe), regular
