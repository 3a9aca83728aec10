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


"""The proof behind a table: discs that hold, and a bound that no derivative exceeds."""

from __future__ import annotations

from math import tau

from hypothesis import example, given, settings
from hypothesis import strategies as st
from linkage_ros.kinematics.closure import Closure
from linkage_ros.solvers.loops import LoopFinder
from linkage_ros.solvers.validated_enclosure import (
    Cells,
    Disc,
    enclose,
    facing,
    jet_product,
    product,
    total,
)
from mpmath import mp, mpc, mpf
import numpy as np
import pytest

from .linkages import crank_rocker, crank_rockers, Lengths, true_joints
from ..kinematics.reference import turned
from ..support.scenes import shipped

reals = st.floats(-3.0, 3.0)
radii = st.floats(0.0, 0.5)
shares = st.floats(0.0, 1.0)


def within(disc: Disc, share: float, turn: float):
    """Return a number of a disc."""
    return mpc(disc.center) + mpf(float(disc.radius)) * share * mp.expj(turn)


@example(0.0, 0.5, 0.0, 5e-324, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # it underflows
@example(1e-200, 0.0, 1e-200, 0.0, 1e-210, 1e-210, 1.0, 1.0, 0.0, 0.0)
@given(reals, reals, reals, reals, radii, radii, shares, shares, reals, reals)
def test_a_disc_holds_what_comes_of_its_numbers(a, b, c, d, r, s, p, q, t, u) -> None:
    one, other = Disc(complex(a, b), r), Disc(complex(c, d), s)
    with mp.workdps(50):
        x, y = within(one, p, t), within(other, q, u)
        for found, true in ((product(one, other), x * y), (total([one, other]), x + y)):
            assert abs(mpc(complex(found.center)) - true) <= mpf(float(found.radius))


@given(st.lists(st.tuples(reals, st.floats(0.0, 0.1)), min_size=5, max_size=5), shares)
def test_a_direction_holds_its_series(angle, share) -> None:
    jet = [Disc(center, radius) for center, radius in angle]
    found = facing(jet)
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
    groups = LoopFinder(linkage, closure.structure, closure._known).find()
    middle, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * (edges[1:] - edges[:-1])
    states = [closure.position(x).state.coordinates for x in middle.tolist()]
    cells = Cells(middle, half, np.array(states).T, np.zeros((1, len(middle)), complex))
    return closure, enclose(groups, cells, 4)


@settings(max_examples=15, deadline=None)
@given(crank_rockers(), st.integers(0, 511), shares)
def test_the_bounds_hold_the_derivatives(lengths: Lengths, cell: int, share: float) -> None:
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
def test_over_every_cell_it_holds_the_closed_form(name: str) -> None:
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


def test_cells_over_a_toggle_are_not_proven() -> None:
    linkage = crank_rocker((4.0, 5.0, 3.0, 6.5))
    ((_, high, *_),) = Closure(linkage).input_ranges
    edges = np.array([high - 0.2, high - 0.1, high - 1e-3, high])
    _, found = enclosed(linkage, edges)
    assert not found.proven[-1]


def test_another_assembly_is_not_taken_for_the_same() -> None:
    # What the closed form has in the middle belongs to another cell: nothing may be proven.
    linkage = crank_rocker()
    closure = Closure(linkage)
    groups = LoopFinder(linkage, closure.structure, closure._known).find()
    states = np.array([closure.position(x).state.coordinates for x in (1.0, 2.0)]).T
    cells = Cells(np.array([2.0, 1.0]), np.full(2, 1e-3), states, np.zeros((1, 2), complex))
    assert not enclose(groups, cells, 1).proven.any()
