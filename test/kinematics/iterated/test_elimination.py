# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Elimination without a decision by numbers: its accuracy, its structure, its line of code."""

from collections.abc import Sequence
from itertools import permutations
import random

from linkage_ros.kinematics import Closure, Elimination, StartTable
from linkage_ros.kinematics.compiling import compile_line, count_uses
from mpmath import lu_solve, matrix, mp, mpf, svd_r
import pytest

from ..linkages import class_3_linkage

_U = 2.0**-53
Rows = list[list[float]]


def random_matrix(rng: random.Random, size: int, zeros: float) -> Rows:
    """Return a matrix with rows of different sizes, and with some entries that are 0."""
    while True:
        rows = [
            [
                0.0 if i != k and rng.random() < zeros else rng.gauss(0.0, 1.0) * weight
                for k in range(size)
            ]
            for i in range(size)
            for weight in [2.0 ** rng.uniform(-6.0, 6.0)]
        ]
        rng.shuffle(rows)
        if all(map(any, rows)):
            return rows


def error_of(rows: Rows, right: Sequence[float], found: Sequence[float]) -> float:
    """Return the relative error in units of u·κ, with κ of the rows scaled to length 1."""
    with mp.workdps(40):
        exact = lu_solve(matrix(rows), matrix(list(right)))
        lengths = [mp.sqrt(sum(mpf(entry) ** 2 for entry in row)) for row in rows]
        scaled = [[entry / size for entry in row] for row, size in zip(rows, lengths, strict=True)]
        values = svd_r(matrix(scaled), compute_uv=False)
        worst = max(abs(mpf(one) - other) for one, other in zip(found, exact, strict=True))
        size = max(map(abs, exact))
        return float(worst / size * values[len(rows) - 1] / values[0] / _U)


@pytest.mark.parametrize('zeros', [0.0, 0.3, 0.6])
@pytest.mark.parametrize('size', [1, 2, 3, 4, 6])
def test_elimination_error_stays_within_the_condition_bound(size, zeros):
    rng = random.Random(f'{size} {zeros}')
    for _ in range(12):
        rows = random_matrix(rng, size, zeros)
        right = [rng.gauss(0.0, 1.0) for _ in rows]
        assert error_of(rows, right, Elimination(rows, []).solve(right)) < 4.0 * size


def test_compiled_elimination_handles_permuted_zero_entries():
    """Slides along the axes: the structure has all entries, the numbers are a permutation."""
    rng = random.Random(5)

    def solved(*numbers):
        rows = [list(row) for row in zip(*[iter(numbers[:9])] * 3, strict=True)]
        return Elimination(rows, []).solve(numbers[9:])

    line = compile_line(solved, [rng.gauss(0.0, 1.0) for _ in range(12)])
    for order in permutations(range(3)):
        scales = [rng.uniform(0.1, 2.0) for _ in order]
        entries = [scales[i] * (k == column) for i, column in enumerate(order) for k in range(3)]
        right = [rng.gauss(0.0, 1.0) for _ in order]
        (found,) = line(*entries, *right)
        wanted = [right[order.index(k)] / scales[order.index(k)] for k in range(3)]
        assert list(found) == pytest.approx(wanted, rel=1e-15)


def test_unit_pivots_are_eliminated_without_division():
    # The first two rows give x and y; the third is parallel links; the last one is left.
    rows = [
        [1.0, 0.0, 0.3, 0.0],
        [0.0, -1.0, 0.7, 0.0],
        [0.0, 0.0, 1.0, -1.0],
        [2.0, 3.0, 0.5, 4.0],
    ]
    eliminated = Elimination(rows, [(0, 0), (1, 1)])
    assert eliminated.divisors == []
    right = [1.0, 2.0, 0.25, 3.0]
    assert error_of(rows, right, eliminated.solve(right)) < 4.0


@pytest.mark.parametrize('size', [2, 4, 6])
def test_compiled_elimination_equals_the_interpreted_one(size):
    rng = random.Random(size)

    def solve(*numbers: float) -> list[float]:
        *rows, right = map(list, zip(*[iter(numbers)] * size, strict=True))
        return Elimination(rows, []).solve(right)

    def draw() -> list[float]:
        return [rng.gauss(0.0, 1.0) for _ in range(size * size + size)]

    line = compile_line(solve, draw())
    for _ in range(20):
        numbers = draw()
        assert line(*numbers) == (tuple(solve(*numbers)),)


def test_singular_matrix_gives_a_zero_divisor():
    rows = [[1.5, 3.0], [3.0, 6.0]]

    def divisors(*numbers: float) -> list[float]:
        return Elimination([list(numbers[:2]), list(numbers[2:])], []).divisors

    ((one, other),) = compile_line(divisors, (1.5, 3.0, 3.0, 7.0))(*rows[0], *rows[1]) or ((),)
    assert min(abs(one), abs(other)) < 1e-15
    ((one, other),) = compile_line(divisors, (1.5, 3.0, 3.0, 7.0))(0.0, 1.0, 0.0, 2.0) or ((),)
    assert min(abs(one), abs(other)) == 0.0


def test_compiled_iterated_state_calls_only_its_start_table():
    (path,) = Closure(class_3_linkage()).compile_linkage(2).paths
    operations = count_uses(number for group in path.outputs for number in group)
    called = [one.arguments[0] for one in operations if one.name == 'call']
    assert [type(function) for function in called] == [StartTable]
