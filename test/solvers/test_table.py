# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Tables, and the proof behind them."""

from math import acos, degrees, log2, tau
import random

from hypothesis import example, given, settings, strategies as st
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import Closure
from linkage_ros.solvers import (
    Cells,
    Disc,
    enclose_coordinates,
    jet_product,
    LoopFinder,
    multiply_discs,
    sum_discs,
    TableClosure,
    unit_vector,
)
from mpmath import mp, mpc, mpf
import numpy as np
import pytest

from .linkages import (
    apart,
    CRANK_ROCKER,
    crank_rocker,
    crank_rockers,
    true_joints,
    worst_error,
)
from ..kinematics.linkages import four_bar_linkage
from ..kinematics.reference import turned
from ..support.scenes import shipped

# Tables: their orders, their guarantees, and where they are refused.


# Values between the knots, which no doubling of the knots meets.
PLACES = [tau * (k + 0.137) / 97.0 for k in range(97)]


@pytest.mark.parametrize(
    ('kind', 'orders'), [('linear', (2.0, 1.0)), ('hermite', (4.0, 3.0, 2.0))]
)
def test_tables_have_the_order_of_their_polynomial(kind, orders):
    def errors(knots: int) -> list[float]:
        table = TableClosure(crank_rocker(), knots=knots, order=kind)
        closure = table.closed
        worst = [0.0] * 3
        for phi in PLACES:
            position, true = table.position(phi), closure.position(phi)
            velocity, speed = table.velocity(position, 1.0), closure.velocity(true, 1.0)
            change = table.acceleration(position, velocity, 0.0).joints
            expected = closure.acceleration(true, speed, 0.0).joints
            found = (
                worst_error(CRANK_ROCKER, phi, position.joints),
                apart(closure, velocity.joints, speed.joints),
                apart(closure, change, expected),
            )
            worst = list(map(max, worst, found))
        return worst

    coarse, fine = errors(256), errors(1024)
    for order, one, other in zip(orders, coarse, fine, strict=False):
        # The places are not the worst of each cell.
        assert log2(one / other) / 2.0 == pytest.approx(order, abs=0.2)


@settings(max_examples=40, deadline=None)
@given(
    crank_rockers(),
    st.sampled_from([1e-2, 1e-4, 1e-6, 1e-9]),
    st.sampled_from(['hermite', 'hermite', 'linear']),
    st.integers(0, 2**32),
)
def test_what_is_proven_holds(lengths, tolerance, kind, seed):
    if kind == 'linear':
        tolerance = max(tolerance, 1e-6)
    table = TableClosure(crank_rocker(lengths), tolerance, order=kind)
    assert table.proven <= tolerance
    draw = random.Random(seed)
    closure = table.closed
    for _ in range(60):
        phi = draw.uniform(-10.0, 10.0)
        position = table.position(phi)
        assert worst_error(lengths, phi, position.joints) <= table.proven
        speed = closure.velocity(closure.position(phi), 1.0)
        assert apart(closure, table.velocity(position, 1.0).joints, speed.joints) <= (
            table.proven_rate + 1e-12
        )


@pytest.mark.parametrize(
    'name', ['andrews_squeezer', 'class_3', 'drag_link', 'jansen_leg', 'slider_crank', 'watt_1']
)
def test_chains_sliders_and_iterated_links_are_proven_too(name):
    table = TableClosure(shipped(name), 1e-6)
    draw = random.Random(name)
    for _ in range(200):
        phi = draw.uniform(0.0, tau)
        found, true = table.position(phi), table.closed.position(phi)
        assert apart(table, found.joints, true.joints) <= table.proven <= 1e-6


def test_the_knots_are_no_more_than_about_what_it_takes():
    table = TableClosure(crank_rocker(), 1e-6)
    half = TableClosure(crank_rocker(), knots=table.knots // 2)
    worst = max(worst_error(CRANK_ROCKER, phi, half.position(phi).joints) for phi in PLACES)
    assert worst > 1e-6


def test_a_crank_that_has_turned_for_long():
    table = TableClosure(crank_rocker(), 1e-9)
    for turns in (-(10**9), -3, 7, 10**6, 10**10):
        phi = 1.25 + turns * tau
        assert worst_error(CRANK_ROCKER, phi, table.position(phi).joints) <= table.proven


def test_beyond_its_range_the_closed_form_goes_on():
    linkage = shipped('double_rocker')
    closure = Closure(linkage)
    table = TableClosure(linkage, 1e-6, span=(0.9, 1.4))
    for value in (0.0, 0.5, 0.899, 1.4, 1.5, 3.0):
        found = table.position(value)
        assert found == closure.position(value)
        if found.joints:
            velocity = table.velocity(found, 2.0)
            assert velocity == closure.velocity(found, 2.0)
            assert table.acceleration(found, velocity, 1.0) == closure.acceleration(
                found, velocity, 1.0
            )
    assert table.position(1.0) != closure.position(1.0)


def test_what_is_not_tabled_is_that_of_the_closed_form():
    table = TableClosure(shipped('watt_1'), 1e-6)
    closure = table.closed
    position, true = table.position(1.0), closure.position(1.0)
    velocity, speed = table.velocity(position, 2.0), closure.velocity(true, 2.0)
    change = table.acceleration(position, velocity, 3.0)
    assert table.singularity_margin(position) == closure.singularity_margin(true)
    assert table.points(position) == closure.points(true)
    assert table.link_angles(position) == closure.link_angles(true)
    assert table.point_motion(position, velocity, change) == closure.point_motion(
        true, speed, closure.acceleration(true, speed, 3.0)
    )
    assert table.input_ranges == closure.input_ranges


TOGGLES = {
    # Of crank a, coupler b, rocker c and ground d: the limit is where b and c are in line.
    'a crank that swings': ((4.0, 5.0, 3.0, 6.5), None, 'near the toggle or change point at'),
    'a change point': ((1.0, 2.0, 1.0, 2.0), None, 'near the toggle or change point at 0°'),
    'beyond a limit': ((4.0, 5.0, 3.0, 6.5), (0.0, 3.0), 'near the toggle or change point at'),
    'open throughout': ((4.0, 5.0, 3.0, 6.5), (2.5, 3.0), 'cannot be proven near'),
    'next to a change point': (
        (1.0, 2.0 + 1e-10, 1.0, 2.0),
        None,
        'cannot be proven near',
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', TOGGLES)
def test_a_toggle_in_the_way_is_refused(name):
    lengths, span, said = TOGGLES[name]
    with pytest.raises(DefinitionError) as caught:
        TableClosure(four_bar_linkage(lengths, 'left'), 1e-6, span=span)
    assert str(caught.value).startswith('solver.table: tolerance 1e-06 [rad] ')
    assert said in str(caught.value)
    assert str(caught.value).endswith(
        'write solver: closed_form, or a span: [low, high] that keeps away from it'
    )


def test_the_toggle_is_named_where_it_is():
    # b + c = 8 is the third side of a triangle with a = 4 and d = 6.5.
    limit = degrees(acos((4.0**2 + 6.5**2 - 8.0**2) / (2.0 * 4.0 * 6.5)))
    with pytest.raises(DefinitionError, match=f'change point at -{limit:.2f}°'):
        TableClosure(four_bar_linkage((4.0, 5.0, 3.0, 6.5), 'left'), 1e-6)


@pytest.mark.parametrize(
    ('name', 'span', 'said'),
    [
        ('five_bar', None, 'needs a linkage with one input, and this one has 2'),
        ('four_bar', (2.0, 1.0), '2 to 1 rad is empty'),
        ('jansen_leg', None, 'is finer than rounding allows here'),
    ],
)
def test_a_table_that_cannot_be_proved_is_refused(name, span, said):
    with pytest.raises(DefinitionError, match=said):
        TableClosure(shipped(name), 1e-12, span=span)


def test_more_knots_than_there_may_be():
    with pytest.raises(DefinitionError, match='takes more than 1048576 knots'):
        TableClosure(crank_rocker(), 1e-12, order='linear')


def test_it_tells_its_size():
    small, large = (TableClosure(crank_rocker(), knots=n) for n in (16, 1024))
    assert (small.knots, large.knots) == (16, 1024)
    # Two joints, four doubles each.
    assert small.memory == 16 * 2 * 4 * 8
    assert large.memory == 64 * small.memory
    assert large.build_time > 0.0


def test_knots_that_are_given_reach_the_toggles():
    closure = Closure(four_bar_linkage((4.0, 5.0, 3.0, 6.5), 'left'))
    table = TableClosure(closure.linkage, knots=256)
    ((low, high, *_),) = closure.input_ranges
    for value in (low, low + 0.1, high - 0.1):
        assert apart(closure, table.position(value).joints, closure.position(value).joints) < 1e-3


def test_arrays_are_solved_state_by_state():
    table = TableClosure(crank_rocker(), 1e-6)
    batch = table.solve([0.5, 1.0])
    for k, phi in enumerate((0.5, 1.0)):
        assert tuple(batch.positions[:, k]) == table.position(phi).joints


def test_the_residual_tells_of_the_table():
    table = TableClosure(shipped('four_bar'), knots=64)
    errors, residuals = [], []
    for k in range(100):
        position, true = table.position(0.063 * k), table.closed.position(0.063 * k)
        pairs = zip(position.joints, true.joints, strict=True)
        errors.append(max(abs(ours - exact) for ours, exact in pairs))
        residuals.append(table.residual(position))
    # By the angle that a joint is off, at the end of the coupler, the longest link of 0.12 m.
    longest = max(
        abs(complex(*points[a]) - complex(*points[b]))
        for points in table.linkage.links.values()
        for a in points
        for b in points
    )
    assert residuals == pytest.approx([longest * error for error in errors], abs=1e-15)
    assert max(residuals) > 1e-8


# The guarantee of a table: discs that contain the truth, and a bound of every derivative.


reals = st.floats(-3.0, 3.0)
radii = st.floats(0.0, 0.5)
shares = st.floats(0.0, 1.0)


def within(disc: Disc, share: float, turn: float):
    """Return a number of a disc."""
    return mpc(disc.center) + mpf(float(disc.radius)) * share * mp.expj(turn)


@example(0.0, 0.5, 0.0, 5e-324, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # it underflows
@example(1e-200, 0.0, 1e-200, 0.0, 1e-210, 1e-210, 1.0, 1.0, 0.0, 0.0)
@given(reals, reals, reals, reals, radii, radii, shares, shares, reals, reals)
def test_a_disc_holds_what_comes_of_its_numbers(a, b, c, d, r, s, p, q, t, u):
    one, other = Disc(complex(a, b), r), Disc(complex(c, d), s)
    with mp.workdps(50):
        x, y = within(one, p, t), within(other, q, u)
        for found, true in ((multiply_discs(one, other), x * y), (sum_discs([one, other]), x + y)):
            assert abs(mpc(complex(found.center)) - true) <= mpf(float(found.radius))


@given(st.lists(st.tuples(reals, st.floats(0.0, 0.1)), min_size=5, max_size=5), shares)
def test_a_direction_holds_its_series(angle, share):
    jet = [Disc(center, radius) for center, radius in angle]
    found = unit_vector(jet)
    with mp.workdps(40):
        taken = [mpf(center) + (2 * mpf(share) - 1) * radius for center, radius in angle]

        def direction(t):
            return mp.expj(sum(value * t**k for k, value in enumerate(taken)))

        true = mp.taylor(direction, 0, 4)
        for k in range(5):
            off = abs(mpc(complex(found[k].center)) - true[k])
            assert off <= mpf(float(found[k].radius)) + mpf(10) ** -12
    squared = jet_product(found, found)
    assert abs(squared[0].center) == pytest.approx(1.0)


def enclosed(linkage, edges):
    """Return what holds over the cells between some edges."""
    closure = Closure(linkage)
    groups = LoopFinder(linkage, closure.structure, closure._known).find_loops()
    middle, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * (edges[1:] - edges[:-1])
    states = [closure.position(x).state.coordinates for x in middle.tolist()]
    cells = Cells(middle, half, np.array(states).T, np.zeros((1, len(middle)), complex))
    return closure, enclose_coordinates(groups, cells, 4)


@settings(max_examples=15, deadline=None)
@given(crank_rockers(), st.integers(0, 511), shares)
def test_the_bounds_hold_the_derivatives(lengths, cell, share):
    edges = np.linspace(0.0, tau, 513)
    _, found = enclosed(crank_rocker(lengths), edges)
    if not found.proven[cell]:
        return
    phi = edges[cell] + share * (edges[cell + 1] - edges[cell])
    rocker = found.jets[3]
    with mp.workdps(40):
        _, base = true_joints(lengths, phi)

        def angle(at):
            return turned(true_joints(lengths, at)[1] - base)

        for k in range(1, 5):
            true = mp.diff(angle, mpf(phi), k, h=mpf(10) ** -6) / mp.factorial(k)
            off = abs(mpf(float(rocker[k].center[cell])) - true)
            assert off <= mpf(float(rocker[k].radius[cell])) + mpf(10) ** -5


@pytest.mark.parametrize('name', ['watt_1', 'whitworth_quick_return', 'slider_crank'])
def test_over_every_cell_it_holds_the_closed_form(name):
    edges = np.linspace(0.0, tau, 1025)
    closure, found = enclosed(shipped(name), edges)
    assert found.proven.all()
    for k in range(0, 1024, 7):
        for share in (0.01, 0.5, 0.99):
            x = float(edges[k] + share * (edges[k + 1] - edges[k]))
            position = closure.position(x)
            velocity = closure.velocity(position, 1.0)
            for number, jet in found.jets.items():
                if number < 2:
                    continue
                off = position.state.coordinates[number] - jet[0].center[k]
                assert abs(np.remainder(off + np.pi, tau) - np.pi) <= jet[0].radius[k] + 1e-14
                rate = velocity.state.coordinates[number]
                assert abs(rate - jet[1].center[k]) <= jet[1].radius[k] + 1e-12


def test_cells_over_a_toggle_are_not_proven():
    linkage = crank_rocker((4.0, 5.0, 3.0, 6.5))
    ((_, high, *_),) = Closure(linkage).input_ranges
    edges = np.array([high - 0.2, high - 0.1, high - 1e-3, high])
    _, found = enclosed(linkage, edges)
    assert not found.proven[-1]


def test_another_assembly_is_not_taken_for_the_same():
    # What the closed form has in the middle belongs to another cell: nothing may be proven.
    linkage = crank_rocker()
    closure = Closure(linkage)
    groups = LoopFinder(linkage, closure.structure, closure._known).find_loops()
    states = np.array([closure.position(x).state.coordinates for x in (1.0, 2.0)]).T
    cells = Cells(np.array([2.0, 1.0]), np.full(2, 1e-3), states, np.zeros((1, 2), complex))
    assert not enclose_coordinates(groups, cells, 1).proven.any()
