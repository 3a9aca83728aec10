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

"""Tables and Newton's method have their orders, against the reference."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import log, tau

from linkage_ros.accuracy.methods import ACCELERATION, Method, RATE
from linkage_ros.accuracy.methods.node import COLD, FROM_KNOTS, newton, STARTS, table, WARM
from linkage_ros.accuracy.poses import easy, five_dyads, off, shipped_linkage
from linkage_ros.accuracy.reference import Reference, Truth
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.kinematics.survey import Way
from linkage_ros.solvers.table import Order
import pytest

SOME = ('four_bar', 'slider_crank', 'jansen_leg', 'class_3', 'five dyads')


def linkage_of(name: str) -> Linkage:
    return five_dyads() if name == 'five dyads' else shipped_linkage(name)


def truths_of(linkage: Linkage, states: Sequence[tuple[float, ...]]) -> list[Truth]:
    reference = Reference(linkage)
    return [reference.solve(inputs, [RATE], [ACCELERATION]) for inputs in states]


def worst(
    method: Method,
    linkage: Linkage,
    states: Sequence[tuple[float, ...]],
    truths: Sequence[Truth],
    order: int = 0,
) -> float:
    assert method.motion is not None
    return max(
        off(linkage, method.motion(*inputs)[order], truth, order)
        for inputs, truth in zip(states, truths, strict=True)
    )


def slope(errors: Sequence[float], factor: float) -> float:
    """Return by which power the last two errors fall where the step is so many times shorter."""
    return [log(one / other, factor) for one, other in pairwise(errors)][-1]


@pytest.mark.parametrize('name', SOME)
@pytest.mark.parametrize(
    ('kind', 'orders'), [('linear', (2, 1, None)), ('hermite', (4, 3, 2))]
)  # of positions, rates and accelerations; a chord has no acceleration of its own
def test_tables_have_their_orders(name: str, kind: Order, orders: tuple[int | None, ...]) -> None:
    linkage = linkage_of(name)
    cells = (135, 405, 1215)
    interval = Way(Closure(linkage)).widest_range
    assert interval is not None
    # A quarter into a cell is three quarters into one of a third, and a quarter again: where the
    # errors of all derivatives are of the same part of their bounds.
    length = (interval.highest - interval.lowest) / cells[0]
    states = [(interval.lowest + (k + 0.25) * length,) for k in range(4, cells[0], 9)]
    truths = truths_of(linkage, states)
    tables = [table(linkage, n, kind) for n in cells]
    for derivative, order in enumerate(orders):
        if order is not None:
            errors = [worst(one, linkage, states, truths, derivative) for one in tables]
            assert slope(errors, 3.0) == pytest.approx(order, abs=0.25), (derivative, errors)


@pytest.mark.parametrize('kind', ['linear', 'hermite'])
def test_a_table_holds_what_its_knots_need(kind: Order) -> None:
    linkage = shipped_linkage('four_bar')
    small, large = (table(linkage, n, kind) for n in (64, 256))
    assert small.memory
    assert large.memory
    assert small.build is not None
    assert 3.5 < large.memory / small.memory < 4.5
    # Two joints, two or four coefficients each, of eight bytes.
    assert small.memory >= 64 * 2 * 8 * (2 if kind == 'linear' else 4)


# Iterated links start from the curve of their branch, wherever the last state was.
@pytest.mark.parametrize('name', ['four_bar', 'slider_crank', 'jansen_leg'])
def test_a_step_of_newton_squares_the_distance_that_it_starts_from(name: str) -> None:
    linkage = linkage_of(name)
    begin = tau / 256 * 40
    errors = []
    for distance in (4e-3, 2e-3, 1e-3):
        # At a knot the first state is exact; the next one is within the tolerance in one step.
        method = newton(linkage, 1e-2, WARM)
        assert method.position is not None
        method.position(begin)
        truth = Reference(linkage).solve([begin + distance])
        errors.append(off(linkage, method.position(begin + distance), truth))
    assert slope(errors, 2.0) == pytest.approx(2.0, abs=0.15), errors


@pytest.mark.parametrize('name', SOME)
@pytest.mark.parametrize('start', STARTS)
def test_what_newton_leaves_is_of_the_square_of_the_tolerance(name: str, start: str) -> None:
    linkage = linkage_of(name)
    states = easy(Closure(linkage), 24)
    truths = truths_of(linkage, states)
    for tolerance in (1e-2, 1e-4, 1e-6, 1e-15):
        error = worst(newton(linkage, tolerance, start), linkage, states, truths)
        # A chain hands its error on from dyad to dyad.
        assert error < 200.0 * tolerance**2 + 2e-14, tolerance


def test_newton_is_called_by_where_it_starts() -> None:
    linkage = shipped_linkage('four_bar')
    assert {start: newton(linkage, 1e-6, start).remembers for start in STARTS} == {
        FROM_KNOTS: False,
        WARM: True,
        COLD: False,
    }
