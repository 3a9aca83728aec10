# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Where Newton's method starts on a branch, as a table of cubics.

The branch is cut into rows, each with a cubic of the input for every free unknown, through four
solutions. A row ends where two steps of Newton's method would not be certain to end within the
rounding. At a toggle the unknowns have no series in the input x, but one in √|x − end|: the cubics
of the row there are in the root.

All numbers of the table are rounded to some 24 binary digits: a start needs no more, and so the
table, and with it each state, is the same whatever the last digits of numpy are.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from math import frexp, ldexp
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.arithmetic import call, sqrt as root_of, where
from linkage_ros.kinematics.built_once import BuiltProperty

if TYPE_CHECKING:
    from linkage_ros.kinematics.batch import Array, Mask

_DIGITS = 24
"""Binary digits of the numbers of a row, relative to the largest change in it."""

_INPUT_DIGITS = 38
"""The same for the inputs at the ends of rows, relative to the length of a row."""

_DEEPEST = 12
"""How often a cell of the branch is halved at most."""

_SHORTEST = 2.0**-20
"""The shortest row that is halved, of the branch: next to some toggles none ever fits."""

_THIRDS = (0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0)
_TRIED = (0.125, 0.875)
"""Where a cubic goes through the solutions, and where it is farthest from them."""

_HEAD = 4
"""Numbers of a row before the coefficients: see `StartTable`."""


class StartRow(NamedTuple):
    """A piece of a branch between two inputs."""

    low: float
    high: float
    folds: float  # −1 or 1 if the branch turns back at the low or the high end, otherwise 0
    is_away: bool = False  # Whether links are far away there

    def input_at(self, part: float) -> float:
        """Return the input at a part of the row, of the root where the branch turns back."""
        low, high, folds, _ = self
        begin, length = (high, low - high) if folds > 0.0 else (low, high - low)
        return begin + length * (part * part if folds else part)

    def halve(self) -> tuple[StartRow, StartRow]:
        """Return both halves."""
        low, high, folds, is_away = self
        middle = _round_binary(self.input_at(0.5), high - low, _INPUT_DIGITS)
        return (
            StartRow(low, middle, min(folds, 0.0), is_away),
            StartRow(middle, high, max(folds, 0.0), is_away),
        )


class StartTable:
    """
    Rows over the inputs up to each of ``ends``, as a function from an input to its row.

    A row holds an input and a factor, which lead to the part p of the row from 0 to 1; whether p
    is the root of that; the farthest that a solution may be from the start; and for each unknown
    four coefficients of p.
    """

    def __init__(self, ends: Sequence[float], rows: Sequence[tuple[float, ...]]) -> None:
        self.ends = tuple(ends[:-1])
        self.rows = tuple(rows)
        self._has_folds = any(row[2] for row in rows)

    def __call__(self, x: float) -> tuple[float, ...]:
        """Return the row of an input."""
        return self.rows[bisect_left(self.ends, x)]

    def rows_at(self, x: Array) -> tuple[Array, Mask]:
        """Return the rows of inputs, one a column, and that each has one."""
        import numpy as np  # local import: sources of linkages need only the table

        return self._columns[:, np.searchsorted(self.ends, x)], np.ones(len(x), bool)

    @BuiltProperty
    def _columns(self) -> Array:
        import numpy as np  # local import: as above

        return np.array(self.rows).T

    def find_start(self, x: Any) -> tuple[list[Any], Any]:
        """Return the unknowns at which Newton's method starts, and how far it may lead."""
        row = call(self, x)
        part = (x - row[0]) * row[1]
        if self._has_folds:
            part = where(row[2] > 0.0, root_of(abs(part)), part)
        unknowns = []
        for k in range(_HEAD, len(self.rows[0]), 4):
            a, b, c, d = (row[k + i] for i in range(4))
            unknowns.append(a + part * (b + part * (c + part * d)))
        return unknowns, row[3]


def make_start_table(
    pieces: Sequence[StartRow],
    solution_at: Callable[[float], Array | None],
    converges: Callable[[float, Array], bool],
    halvings: int = 0,
) -> StartTable | None:
    """
    Return the table over adjacent pieces of a branch, in ascending order; None if there are none.

    ``solution_at`` gives the free unknowns at an input. ``converges`` says whether Newton's method
    converges fast enough from free unknowns. Each piece is halved so often at least.
    """
    for _ in range(halvings):
        pieces = [half for piece in pieces for half in piece.halve()]
    ends, rows = [], []
    shortest = _SHORTEST * (pieces[-1].high - pieces[0].low) if pieces else 0.0
    for piece in pieces:
        # A piece that is shorter from the start is halved a few times. Far away there are hundreds
        # of pieces, and no motion leads through them: they are not.
        halvings = 0 if piece.is_away else _DEEPEST
        shortest_row = min(shortest, 0.25 * (piece.high - piece.low))
        for end, row in _fit_rows(piece, solution_at, converges, (halvings, shortest_row)):
            ends.append(end)
            rows.append(row)
    if not any(row[3] for row in rows):
        return None
    # A piece without a fit has a row from which no start is near enough.
    width = max(map(len, rows))
    return StartTable(ends, [row + (0.0,) * (width - len(row)) for row in rows])


def _fit_rows(
    piece: StartRow,
    solution_at: Callable[[float], Array | None],
    converges: Callable[[float, Array], bool],
    halvings: tuple[int, float],
) -> Iterator[tuple[float, tuple[float, ...]]]:
    """Yield the end and the numbers of each row of a piece, halved at most so often and so far."""
    import numpy as np  # local import: sources of linkages need only the table

    low, high, folds, _ = piece
    begin, length = (high, low - high) if folds > 0.0 else (low, high - low)
    solutions = [solution_at(piece.input_at(part)) for part in _THIRDS]
    known = [solution for solution in solutions if solution is not None]
    if len(known) == len(solutions) and length:
        values = np.array(known)
        size = float(np.abs(values - values[0]).max())
        cubics = np.linalg.solve(np.vander(_THIRDS, increasing=True), values)
        cubics = _round_binary(cubics, size or 1.0, _DIGITS)
        tried = [(piece.input_at(part), np.power(part, range(4)) @ cubics) for part in _TRIED]
        if all(converges(*start) for start in tried):
            farthest = min(2.0**-10, ldexp(1.0, frexp(size or 1.0)[1] - 4))
            start = _round_binary(begin, length, _INPUT_DIGITS) if folds else begin
            head = (
                start,
                _round_binary(1.0 / length, 1.0 / length, _DIGITS),
                float(bool(folds)),
                farthest,
            )
            yield high, (*head, *cubics.T.ravel().tolist())
            return
    left, shortest = halvings
    if not left or not length or high - low <= shortest:
        yield high, (begin, 0.0, 0.0, 0.0)
        return
    for half in piece.halve():
        yield from _fit_rows(half, solution_at, converges, (left - 1, shortest))


def _round_binary(values: Any, size: float, digits: int) -> Any:
    """Return numbers with as many binary digits as one of a size has."""
    import numpy as np  # local import: as above

    unit = ldexp(1.0, frexp(size)[1] - digits)
    rounded = np.round(values / unit) * unit
    return rounded if rounded.ndim else float(rounded)
