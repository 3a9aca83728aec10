# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A few linear equations, solved by an elimination that is the same on every machine.

It makes no decision by a number: which entries are zero, and the order of the pivots, come from
the structure of the matrix alone. So it can be recorded on a tape, and becomes a straight line.
Entries that are the constants 1 and −1 are eliminated first, exactly. The others are rotated away:
from the entries a and b of a column, the rows r and s become (a·r + b·s)/ρ and (a·s − b·r)/ρ with
ρ = √(a² + b²). A rotation enlarges no error, so no pivot is searched for (W. Givens, Computation
of plane unitary rotations transforming a general matrix to triangular form, J. SIAM 6, 1958).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from linkage_ros.kinematics.arithmetic import SMALLEST, sqrt

_NUMBERS = (float, complex, int)


def is_zero(number: Any) -> bool:
    """Return whether a number is the constant 0; a symbol is not."""
    return isinstance(number, _NUMBERS) and number == 0


def multiply(first: Any, second: Any) -> Any:
    """Return a product, without an operation if a factor is 0, 1 or −1."""
    if is_zero(first) or is_zero(second):
        return 0.0
    for factor, number in ((first, second), (second, first)):
        if isinstance(factor, float) and abs(factor) == 1.0:
            return number if factor > 0.0 else -number
    return first * second


def add(first: Any, second: Any) -> Any:
    """Return a sum, without an operation if a term is 0."""
    return second if is_zero(first) else first if is_zero(second) else first + second


def subtract(first: Any, second: Any) -> Any:
    """Return a difference, without an operation if a term is 0."""
    return -second if is_zero(first) else first if is_zero(second) else first - second


class _RowOperation(NamedTuple):
    """A row operation: row ``row`` is subtracted ``factor`` times, or two rows are rotated."""

    row: int
    other: int
    along: Any
    across: Any = None

    def apply(self, first: Any, second: Any) -> tuple[Any, Any]:
        """Return the numbers of a column, in both rows, after the operation."""
        if self.across is None:
            return first, subtract(second, multiply(self.along, first))
        return (
            add(multiply(self.along, first), multiply(self.across, second)),
            subtract(multiply(self.along, second), multiply(self.across, first)),
        )


class Elimination:
    """
    A matrix (n, n), eliminated; it solves equations for any right side.

    ``unit_pivots`` are entries, by row and column, that are the constant 1 or −1 and are
    eliminated first; in their rows and columns no other of them comes before.
    """

    def __init__(
        self, matrix: Sequence[Sequence[Any]], unit_pivots: Sequence[tuple[int, int]]
    ) -> None:
        self._rows = [
            {k: entry for k, entry in enumerate(row) if not is_zero(entry)} for row in matrix
        ]
        self._operations: list[_RowOperation] = []
        self._pivots: list[tuple[int, int]] = []
        left = set(range(len(matrix)))
        for row, column in unit_pivots:
            self._take_pivot(row, column, left)
        while (unit := self._constant_row(left)) is not None:
            self._take_pivot(*unit, left)
        while left:
            column, rows = self._next_column(left)
            pivot, *others = rows
            for other in others:
                a, b = self._rows[pivot][column], self._rows[other][column]
                # Where both are 0 the rows stay as they are: another one may have the pivot.
                scale = 1.0 / (sqrt(a * a + b * b) + SMALLEST)
                along = (a + SMALLEST) * scale
                self._operate(_RowOperation(pivot, other, along, b * scale), column)
            left.discard(pivot)
            self._pivots.append((pivot, column))

    @property
    def divisors(self) -> list[Any]:
        """Return the pivots that are not constants; the matrix is singular if one is 0."""
        pivots = [self._rows[row][column] for row, column in self._pivots]
        return [pivot for pivot in pivots if not isinstance(pivot, float)]

    def solve(self, right: Sequence[Any]) -> list[Any]:
        """Return the solution for a right side."""
        totals = list(right)
        for operation in self._operations:
            totals[operation.row], totals[operation.other] = operation.apply(
                totals[operation.row], totals[operation.other]
            )
        solution: list[Any] = [0.0] * len(totals)
        for row, column in reversed(self._pivots):
            total = totals[row]
            entries = dict(self._rows[row])
            pivot = entries.pop(column)
            for k, entry in entries.items():
                total = subtract(total, multiply(entry, solution[k]))
            if isinstance(pivot, float) and abs(pivot) == 1.0:
                solution[column] = multiply(pivot, total)
            else:
                solution[column] = 0.0 if is_zero(total) else total / pivot
        return solution

    def _constant_row(self, left: set[int]) -> tuple[int, int] | None:
        """Return a row of constants, as of two parallel links, with a column where it is ±1."""
        for row in sorted(left):
            entries = self._rows[row]
            units = (
                [k for k, entry in entries.items() if abs(entry) == 1.0]
                if all(isinstance(entry, float) for entry in entries.values())
                else []
            )
            if units:
                return row, units[0]
        return None

    def _next_column(self, left: set[int]) -> tuple[int, list[int]]:
        """Return the column in the fewest rows, and these, the shortest row first."""
        rows_of: dict[int, list[int]] = {}
        for row in sorted(left):
            for column in self._rows[row]:
                rows_of.setdefault(column, []).append(row)
        if not rows_of:
            raise ArithmeticError('the equations do not depend on all unknowns')
        column = min(rows_of, key=lambda k: (len(rows_of[k]), k))
        return column, sorted(rows_of[column], key=lambda row: len(self._rows[row]))

    def _take_pivot(self, row: int, column: int, left: set[int]) -> None:
        """Eliminate a column by a row whose entry is 1 or −1."""
        pivot = self._rows[row][column]
        left.discard(row)
        self._pivots.append((row, column))
        for other_row in sorted(left):
            entry = self._rows[other_row].get(column)
            if entry is not None:
                self._operate(_RowOperation(row, other_row, multiply(entry, pivot)), column)

    def _operate(self, operation: _RowOperation, column: int) -> None:
        """Apply a row operation that makes a column 0 in the other row."""
        self._operations.append(operation)
        first, second = self._rows[operation.row], self._rows[operation.other]
        for k in sorted({**first, **second}):
            new, left = operation.apply(first.get(k, 0.0), second.get(k, 0.0))
            for entries, entry in ((first, new), (second, left)):
                if is_zero(entry) or (entries is second and k == column):
                    entries.pop(k, None)
                else:
                    entries[k] = entry
