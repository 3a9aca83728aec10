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

"""Methods are as accurate, and of the order, that their theory says."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from math import cos, log, log2, pi, radians, tau
from typing import Any

from linkage_ros.accuracy.methods import ACCELERATION, Method, RATE
from linkage_ros.accuracy.methods.equations import extended, integration
from linkage_ros.accuracy.methods.formulas import plain_four_bar, single_precision, textbook
from linkage_ros.accuracy.methods.node import (
    CLOSED_FORM,
    closed_form,
    COLD,
    FROM_KNOTS,
    ITERATED,
    newton,
    STARTS,
    table,
    WARM,
)
from linkage_ros.accuracy.poses import easy, five_dyads, off, path, Poses, shipped_linkage
from linkage_ros.accuracy.reference import Reference, Truth
from linkage_ros.accuracy.solving import PEERS
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Input, Linkage, RevoluteJoint
from linkage_ros.kinematics.sweep_analysis import InputSweep
import numpy as np
import pytest

from ..kinematics.linkages import four_bar_linkage

# Every method has the accuracy of its theory, and fails where it says, against the reference.


FOUR_BARS = ('four_bar', 'double_rocker', 'drag_link', 'parallelogram', 'hoeken')


def turned_about() -> Linkage:
    """Return a four-bar whose frames lie anywhere and whose input counts the other way."""
    return Linkage(
        links={
            'ground': {'O2': (0.3, -0.2), 'O4': (0.25, 0.6)},
            'crank': {'O2': (0.1, 0.0), 'A': (0.1, 0.2)},
            'coupler': {'A': (-0.3, 0.1), 'B': (0.2, 0.7)},
            'rocker': {'O4': (0.0, 0.0), 'B': (-0.5, 0.5)},
        },
        inputs=(Input('crank_joint', 'crank', 'ground'),),
        assembly={'B': 'right'},
        joints={
            'coupler_joint': RevoluteJoint('coupler', 'crank'),
            'rocker_joint': RevoluteJoint('ground', 'rocker'),
            'between': RevoluteJoint('rocker', 'coupler'),
        },
        sliders={},
    )


def linkage_of(name: str) -> Linkage:
    if name == 'crank too':
        linkage = shipped_linkage('four_bar')
        crank = RevoluteJoint('ground', 'crank')
        return replace(linkage, joints={'crank_joint': crank, **linkage.joints})
    return turned_about() if name == 'turned about' else shipped_linkage(name)


def truth_at(linkage: Linkage, *inputs: float) -> Truth:
    driven = len(inputs)
    return Reference(linkage).solve(inputs, [RATE] * driven, [ACCELERATION] * driven)


MADE: dict[str, tuple[Callable[[Linkage], Method | None], float]] = {
    'closed form': (closed_form, 2e-15),
    'closed form, float32': (single_precision, 2e-6),
    'textbook form': (textbook, 1e-12),
    'extended precision': (extended, 1e-30),
}


@pytest.mark.parametrize('name', [*FOUR_BARS, 'turned about', 'crank too'])
@pytest.mark.parametrize('made', MADE)
def test_a_four_bar_is_solved_to_the_digits_of_the_method(name, made):
    linkage = linkage_of(name)
    make, bound = MADE[made]
    method = make(linkage)
    assert method is not None
    assert method.name == made
    assert method.position is not None
    for inputs in easy(Closure(linkage), 7):
        joints, truth = method.position(*inputs), truth_at(linkage, *inputs)
        if made == 'textbook form' and off(linkage, joints, truth) > 0.1:
            continue  # The wrong root: a test of its own.
        assert off(linkage, joints, truth) < bound
        if method.motion:
            for order, values in enumerate(method.motion(*inputs)):
                assert off(linkage, values, truth, order) < 30 * bound


@pytest.mark.parametrize('name', [*FOUR_BARS, 'turned about', 'crank too'])
@pytest.mark.parametrize('make', PEERS)
def test_peers_solve_the_same_four_bars(name, make):
    pytest.importorskip(make.__name__)
    linkage = linkage_of(name)
    method = make(linkage)
    assert method is not None
    assert method.position is not None
    first = easy(Closure(linkage), 5)[0][0]
    for k in range(6):
        found = method.position(first + 0.02 * k)
        assert off(linkage, found, truth_at(linkage, first + 0.02 * k)) < 1e-11


@pytest.mark.parametrize('make', [single_precision, textbook, *PEERS])
@pytest.mark.parametrize('name', ['jansen_leg', 'slider_crank', 'class_3', 'five_bar', 'watt_1'])
def test_what_is_no_four_bar_is_not_taken_for_one(name, make):
    assert plain_four_bar(shipped_linkage(name)) is None
    assert make(shipped_linkage(name)) is None


def test_what_is_iterated_is_not_called_a_closed_form():
    assert closed_form(shipped_linkage('class_3')).name == ITERATED
    assert closed_form(shipped_linkage('jansen_leg')).name == CLOSED_FORM


@pytest.mark.parametrize('name', ['four_bar', 'crank too', 'jansen_leg', 'slider_crank'])
@pytest.mark.parametrize('make', [closed_form, single_precision])
def test_arrays_hold_what_single_states_do(name, make):
    linkage = linkage_of(name)
    method = make(linkage)
    if method is None:
        assert name in ('jansen_leg', 'slider_crank')
        return
    assert method.batch is not None
    assert method.motion is not None
    inputs = easy(Closure(linkage), 9)
    batch = method.batch([np.array([x for (x,) in inputs])], 2)
    single = [method.motion(*one) for one in inputs]
    for order, rows in enumerate(batch):
        expected = np.array([motion[order] for motion in single]).T
        assert rows.dtype == expected.dtype
        assert np.allclose(rows, expected, rtol=0.0, atol=30 * np.finfo(rows.dtype).eps)


def test_float32_is_float32_all_the_way():
    method = single_precision(shipped_linkage('four_bar'))
    assert method is not None
    assert method.motion is not None
    assert method.batch is not None
    for values in method.motion(1.0):
        assert {type(value) for value in values} == {np.float32}
    assert {rows.dtype for rows in method.batch([np.array([1.0])], 2)} == {np.dtype(np.float32)}
    coarse = off(shipped_linkage('four_bar'), method.motion(1.0)[0], truth_at(
        shipped_linkage('four_bar'), 1.0))  # fmt: skip
    assert coarse > 1e-9


def wrong(angle: float, d: float = 1.0) -> float | None:
    """Return what the textbook form is off by in the linkage 2, 3, 3, d; nothing: no answer."""
    linkage = four_bar_linkage((2.0, 3.0, 3.0, d), 'left')
    method = textbook(linkage)
    assert method is not None
    assert method.position is not None
    joints = method.position(angle)
    return off(linkage, joints, truth_at(linkage, angle)) if joints else None


def test_the_textbook_form_has_no_answer_where_the_pin_stands_over_the_pivot():
    # numerics.md: a = 2, b = c = 3, d = 1 at 60 degrees; in doubles 2·cos 60° is 1 + 2⁻⁵².
    assert wrong(radians(60.0), d=2.0 * cos(radians(60.0))) is None


def test_the_textbook_form_is_wrong_by_the_inverse_square_next_to_it():
    # numerics.md: both roots 0.2 to 0.3 rad off at 1e-9 rad, as 1/(d − Ax)² farther away.
    near = [abs(wrong(radians(60.0) + side * 1e-9) or 0.0) for side in (-1, 1)]
    assert max(near) > 0.1
    # Of the side on which its root is that of the assembly.
    far = [max(wrong(pi / 3 + distance * k) or 0.0 for k in (1.0, 1.1, 1.2, 1.3, 1.4))
           for distance in (1e-6, 1e-5, 1e-4)]  # fmt: skip
    assert far[0] > 20 * far[1] > 400 * far[2] > 0.0


def test_the_textbook_root_is_the_other_assembly_beyond_it():
    assert (wrong(1.2) or 0.0) < 1e-13
    assert (wrong(0.9) or 0.0) > 0.5


@pytest.mark.parametrize('name', ['double_rocker', 'excavator_bucket', 'class_3'])
@pytest.mark.parametrize(('method', 'order'), [('Euler', 1), ('Runge-Kutta 4', 4)])
def test_integration_has_its_order(name, method, order):
    linkage = shipped_linkage(name)
    inputs = easy(Closure(linkage), 8)
    way = path(Poses('easy', '', name, linkage, inputs), 32)
    assert way is not None
    half = way._replace(inputs=way.inputs[:17])
    truth = Reference(linkage).solve(half.inputs[-1])
    errors = [_end_error(half, method, steps, False, truth) for steps in (2, 4, 8)]
    slopes = [log2(one / other) for one, other in pairwise(errors)]
    assert slopes[-1] == pytest.approx(order, abs=0.3), errors
    projected = _end_error(half, method, 8, True, truth)
    assert projected < 0.1 * errors[-1]


def _end_error(way: Poses, name: str, steps: int, projected: bool, truth: Any) -> float:
    solve = integration(way, name, steps, projected).position
    assert solve is not None
    for inputs in way.inputs:
        joints = solve(*inputs)
    return off(way.linkage, joints, truth)


# The order of convergence of tables and of Newton's method, against the reference.


SOME = ('four_bar', 'slider_crank', 'jansen_leg', 'class_3', 'five dyads')


def dyads_of(name: str) -> Linkage:
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
def test_tables_have_their_orders(name, kind, orders):
    linkage = dyads_of(name)
    cells = (135, 405, 1215)
    interval = InputSweep(Closure(linkage)).widest_range
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
def test_a_table_holds_what_its_knots_need(kind):
    linkage = shipped_linkage('four_bar')
    small, large = (table(linkage, n, kind) for n in (64, 256))
    assert small.memory
    assert large.memory
    assert small.build is not None
    assert 3.5 < large.memory / small.memory < 4.5
    # Two joints, two or four coefficients each, of eight bytes.
    assert small.memory >= 64 * 2 * 8 * (2 if kind == 'linear' else 4)


# Iterated links start from the curve of their branch, whatever the last state was.
@pytest.mark.parametrize('name', ['four_bar', 'slider_crank', 'jansen_leg'])
def test_a_step_of_newton_squares_the_distance_that_it_starts_from(name):
    linkage = dyads_of(name)
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
def test_what_newton_leaves_is_of_the_square_of_the_tolerance(name, start):
    linkage = dyads_of(name)
    states = easy(Closure(linkage), 24)
    truths = truths_of(linkage, states)
    for tolerance in (1e-2, 1e-4, 1e-6, 1e-15):
        error = worst(newton(linkage, tolerance, start), linkage, states, truths)
        # A chain hands its error on from dyad to dyad.
        assert error < 200.0 * tolerance**2 + 2e-14, tolerance


def test_newton_is_called_by_where_it_starts():
    linkage = shipped_linkage('four_bar')
    assert {start: newton(linkage, 1e-6, start).remembers for start in STARTS} == {
        FROM_KNOTS: False,
        WARM: True,
        COLD: False,
    }
