# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Many states at once are solved as well as one, against the reference; beside one: test_solve.

The accelerations' reference differentiates the closing equation twice, in 70 digits.
"""

from dataclasses import replace
from functools import cache
from math import pi
from typing import Any

from linkage_ros.kinematics import AssemblyPose, Closure, CODES, RevoluteJoint, Status
from linkage_ros.kinematics.compiling import numpy_blocks
import numpy as np
from numpy.typing import NDArray
import pytest

from ..linkages import four_bar_linkage
from ..reference import ANGLE, four_bar, RATE, TOGGLE, Worst
from ..samples import FOUR_BARS, four_bars, FourBarCase

COUNT = 100
ACCELERATED = 15
ACCELERATION = 4.0
"""Limit for accelerations in units of u·κ; of 12,700 loops of all families the worst had 2.3."""

STATUSES = tuple(Status)
CLOSED, TOGGLED, OPEN, INDETERMINATE = (
    CODES[s] for s in (Status.CLOSED, Status.TOGGLE, Status.OPEN, Status.INDETERMINATE)
)

CHANGE_POINTS = {
    'parallelogram': (0.04, 0.12, 0.04, 0.12),
    'parallelogram, long crank': (2.0, 1.0, 2.0, 1.0),
    'kite that folds': (1.0, 1.0, 2.0, 2.0),
    'kite whose pins meet': (2.0, 3.0, 3.0, 2.0),
    'a + b = c + d': (3.0, 2.0, 4.0, 1.0),
    'a + c = b + d': (3.0, 4.0, 2.0, 1.0),
    'a + d = b + c': (1.0, 2.0, 3.0, 4.0),
}

Array = NDArray[np.float64]


def four_bars_of(a: float, b: float, c: float, d: float, sign: int, phi: float = 1.0) -> Closure:
    """Return a four-bar that publishes the directions of coupler and rocker."""
    linkage = four_bar_linkage((a, b, c, d), 'left' if sign > 0 else 'right')
    joints = {name: RevoluteJoint('ground', name) for name in ('coupler', 'rocker')}
    return Closure(replace(linkage, joints=joints, pose=AssemblyPose((phi,), {})))


def solved(closure: Closure, phi: Any, rate: Any = 1.0, acceleration: Any = 0.0) -> list[Any]:
    """Return status, positions, velocities and accelerations."""
    return [*closure.solve(phi, rates=rate, accelerations=acceleration)]


@cache  # asked for by both half angles
def truths(family: str) -> list[tuple[FourBarCase, Any]]:
    return [(case, four_bar(*case)) for case in four_bars(family, COUNT)]


@pytest.fixture(params=['tangent', 'sine and cosine'])
def half_angle(request, monkeypatch):
    by_tangent = request.param == 'tangent' and numpy_blocks._BY_TANGENT
    monkeypatch.setattr(numpy_blocks, '_BY_TANGENT', by_tangent)


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.usefixtures('half_angle')
@pytest.mark.parametrize('family', FOUR_BARS)
def test_batch_solution_of_four_bars_equals_the_reference(family):
    worst = Worst()
    closed = 0
    for case, truth in truths(family):
        *lengths, phi, sign = case
        closure = four_bars_of(*lengths, sign, phi)
        (code,), position, velocity, acceleration = solved(closure, [phi])
        gap = float(max(truth.gap, 0))
        worst.note_status(STATUSES[code], gap, gap, sum(lengths), case)
        assert np.isnan(position).all() == (code == OPEN), case
        assert np.isnan(velocity).all() == (code != CLOSED), case
        assert np.isnan(acceleration).all() == (code != CLOSED), case
        if truth.gap > 0 or code == OPEN:
            continue
        limit = ANGLE if code == CLOSED else TOGGLE
        worst.note('θ3', truth.coupler.half_turn_error_of(position[0, 0]), limit, case)
        worst.note('θ4', truth.rocker.half_turn_error_of(position[1, 0]), limit, case)
        if code == CLOSED:
            closed += 1
            worst.note('ω3', truth.coupler_rate.error_of(velocity[0, 0]), RATE, case)
            worst.note('ω4', truth.rocker_rate.error_of(velocity[1, 0]), RATE, case)
            alpha3, alpha4 = truth.coupler_acceleration, truth.rocker_acceleration
            worst.note('α3', alpha3.error_of(acceleration[0, 0]), ACCELERATION, case)
            worst.note('α4', alpha4.error_of(acceleration[1, 0]), ACCELERATION, case)
    worst.check()
    assert closed >= ACCELERATED, 'a sweep that closes nothing proves nothing'


def test_batch_accelerations_stay_exact_near_a_change_point():
    near = [sign * 10.0**-i for i in (1, 3, 6, 9, 12, 100, 290) for sign in (1, -1)]
    # The coupler of a parallelogram does not turn, and its rocker turns with the crank.
    for turn, angles in ((0.0, near), (pi, near[:10]), (2 * pi, near[:10])):
        codes, _, _, found = solved(
            four_bars_of(*CHANGE_POINTS['parallelogram'], 1), [turn + x for x in angles], 1.0, 0.5
        )
        assert (codes < TOGGLED).all()
        assert found[0] == pytest.approx(0.0, abs=1e-15)
        assert found[1] == pytest.approx(0.5, abs=1e-15)
    # Elsewhere the reference says it; it takes digits to say.
    for name in ('kite that folds', 'kite whose pins meet', 'a + b = c + d', 'a + c = b + d'):
        lengths = CHANGE_POINTS[name]
        angles = [x for x in near if abs(x) > 1e-13]
        codes, _, _, found = solved(four_bars_of(*lengths, 1), angles)
        assert (codes < TOGGLED).all()
        for i, phi in enumerate(angles):
            truth = four_bar(*lengths, phi, 1 if phi > 0 else -1)
            exact = truth.coupler_acceleration, truth.rocker_acceleration
            expected = [float(each.value) for each in exact]
            assert found[:, i] == pytest.approx(expected, rel=2e-14, abs=1e-300)


def test_batch_accelerations_of_a_folding_rhombus_are_finite():
    angles = [sign * 10.0**-i for i in range(0, 153, 4) for sign in (1, -1)]
    codes, _, _, found = solved(four_bars_of(1.0, 1.0, 1.0, 1.0, 1), angles, 1.0, 0.5)
    assert (codes < TOGGLED).all()
    # One of the links keeps its angle, and the other turns with the crank.
    still, turning = np.sort(found, axis=0)
    assert still == pytest.approx(0.0, abs=1e-15)
    assert turning == pytest.approx(0.5, abs=1e-15)


@pytest.mark.parametrize(
    ('lengths', 'code'),
    [((2.0, 3.0, 3.0, 2.0), INDETERMINATE), ((2.0, 3.0, 3.5, 2.0), OPEN)],
    ids=['kite', 'unequal'],
)
def test_batch_returns_no_pose_where_pins_coincide(lengths, code):
    codes, *arrays = solved(four_bars_of(*lengths, 1), [1.0, 0.0, -0.0, 1e-200, 2.0])
    assert codes.tolist() == [CLOSED, code, code, code, CLOSED]
    for array in arrays:
        assert np.isnan(array).tolist() == [[False, True, True, True, False]] * 2
