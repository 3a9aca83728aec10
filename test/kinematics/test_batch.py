# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Many states at once are solved as well as one: against the reference, and against the scalar dyad.

The accelerations' reference differentiates the closing equation twice, in 70 digits.
"""

from dataclasses import replace
from functools import cache
from math import inf, nan, pi, remainder
from typing import Any
import warnings

from hypothesis import given, settings, strategies as st
from linkage_ros.kinematics import AssemblyPose, Closure, CODES, RevoluteJoint, Status
from linkage_ros.kinematics.compiling import numpy_blocks
import numpy as np
from numpy.typing import NDArray
import pytest

from .linkages import four_bar_linkage, FourBar
from .reference import ANGLE, four_bar, RATE, TOGGLE, Worst
from .samples import FOUR_BARS, four_bars, FourBarCase

COUNT = 100
ACCELERATED = 15
ACCELERATION = 4.0
"""Limit for accelerations in units of u·κ; of 12,700 loops of all families the worst had 2.3."""

STATUSES = tuple(Status)
CLOSED, TOGGLED, OPEN, INDETERMINATE = (
    CODES[s] for s in (Status.CLOSED, Status.TOGGLE, Status.OPEN, Status.INDETERMINATE)
)

# Lengths a, b, c, d.
SHAPES = {
    'crank-rocker': (0.04, 0.12, 0.08, 0.1),
    'crank-rocker, long rocker': (0.04, 0.08, 0.12, 0.1),
    'drag link': (0.1, 0.12, 0.08, 0.04),
    'stretches': (4.0, 5.0, 3.0, 6.5),
    'folds': (4.0, 2.0, 4.5, 5.0),
    'short pair': (40.0, 3.0, 2.5, 41.0),
}
CHANGE_POINTS = {
    'parallelogram': (0.04, 0.12, 0.04, 0.12),
    'parallelogram, long crank': (2.0, 1.0, 2.0, 1.0),
    'kite that folds': (1.0, 1.0, 2.0, 2.0),
    'kite whose pins meet': (2.0, 3.0, 3.0, 2.0),
    'a + b = c + d': (3.0, 2.0, 4.0, 1.0),
    'a + c = b + d': (3.0, 4.0, 2.0, 1.0),
    'a + d = b + c': (1.0, 2.0, 3.0, 4.0),
}

length = st.floats(0.1, 10.0)
cranks = st.lists(st.floats(-7.0, 7.0), min_size=1, max_size=20)
side = st.sampled_from((1, -1))
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


@pytest.mark.sample(3)
@pytest.mark.slow
@pytest.mark.usefixtures('half_angle')
@pytest.mark.parametrize('family', FOUR_BARS)
def test_all_is_right_in_every_family(family):
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


def check_against_scalar(
    lengths: tuple[float, float, float, float],
    sign: int,
    phi: list[float],
    rate: float = 1.0,
    acceleration: float = 0.0,
) -> set[Status]:
    """
    Compare every state; angles not modulo 2π, since a motion is to go on as the scalar's does.

    What a rounding error does to the triangle grows with the lengths' square over the cross
    product. In units of it, over 170,000 states angles differed by 9e-16, rates by 1.1e-14 and
    accelerations by 3.3e-14, the latter two as a part of themselves, or of 1 where smaller.
    """
    found = solved(four_bars_of(*lengths, sign), phi, rate, acceleration)
    scalar = FourBar(*lengths, sign)
    for i, angle in enumerate(phi):
        code, position, velocity, change = (array[..., i] for array in found)
        pose = scalar.close(angle + 0.0)  # an input of −0.0 is 0.0
        condition = max(lengths) ** 2 / abs(pose.cross) if pose.cross else inf
        if condition > 1e6 and STATUSES[code] is not pose.status:
            # Which float next to a limit is the last that closes, or toggles, may differ.
            assert INDETERMINATE not in (code, CODES[pose.status])
            continue
        assert STATUSES[code] is pose.status, angle
        if code in (OPEN, INDETERMINATE):
            assert np.isnan([*position, *velocity, *change]).all()
            continue
        limit = 2e-15 * min(condition, 1e8)
        assert position == pytest.approx([pose.first, pose.second], rel=0.0, abs=limit)
        if code == TOGGLED:
            assert np.isnan([*velocity, *change]).all()
        else:
            for one, other, digits in (
                (velocity, scalar.rates(pose, rate), 3e-14),
                (change, scalar.accelerations(pose, rate, acceleration), 1e-13),
            ):
                limit = digits * condition
                assert one == pytest.approx(other, rel=limit, abs=limit)
    return {STATUSES[code] for code in found[0]}


@settings(derandomize=True)
@given(length, length, length, length, cranks, side)
def test_any_lengths_are_solved_as_by_the_scalar_dyad(a, b, c, d, phi, sign):
    check_against_scalar((a, b, c, d), sign, phi, 1.0, 0.3)


@pytest.mark.sample(7)
@pytest.mark.parametrize('name', [*SHAPES, *CHANGE_POINTS])
@pytest.mark.parametrize('sign', [1, -1])
def test_every_shape_is_solved_as_by_the_scalar_dyad_over_four_turns(name, sign):
    # Off the change points, near which the scalar dyad's accelerations lose their digits.
    angles = (np.arange(1, 2000) * 0.0126 - 4 * pi + 1e-3).tolist()
    found = check_against_scalar({**SHAPES, **CHANGE_POINTS}[name], sign, angles, 1.0, 0.3)
    limited = {'stretches', 'folds', 'short pair'}
    assert found == ({Status.CLOSED, Status.OPEN} if name in limited else {Status.CLOSED})


@pytest.mark.parametrize('name', CHANGE_POINTS)
@pytest.mark.parametrize('at', [0.0, pi, 2 * pi, -pi])
def test_change_points_are_passed_as_by_the_scalar_dyad(name, at):
    lengths = CHANGE_POINTS[name]
    near = [10.0**-i for i in (1, 3, 6, 9, 12)] + ([] if at else [1e-100, 1e-150])
    angles = [at, *(at + sign * x for x in near for sign in (1, -1))]
    codes, positions, velocities, _ = solved(four_bars_of(*lengths, 1), angles)
    scalar = FourBar(*lengths, 1)
    for i, angle in enumerate(angles):
        pose = scalar.close(angle)
        assert STATUSES[codes[i]] is pose.status
        if pose.status.has_pose:
            assert positions[:, i] == pytest.approx([pose.first, pose.second], rel=0, abs=2e-15)
        if pose.status.has_rates:
            assert velocities[:, i] == pytest.approx(scalar.rates(pose, 1.0), rel=3e-15, abs=3e-15)


def test_accelerations_keep_their_digits_at_a_change_point():
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


def test_accelerations_of_a_rhombus_that_folds_are_numbers():
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
def test_where_the_pins_meet_there_is_no_pose(lengths, code):
    codes, *arrays = solved(four_bars_of(*lengths, 1), [1.0, 0.0, -0.0, 1e-200, 2.0])
    assert codes.tolist() == [CLOSED, code, code, code, CLOSED]
    for array in arrays:
        assert np.isnan(array).tolist() == [[False, True, True, True, False]] * 2


def test_no_state_makes_numpy_warn():
    angles = [0.0, -0.0, pi, 1e-310, 1e308, nan, inf, *np.linspace(-7.0, 7.0, 50)]
    with warnings.catch_warnings(), np.errstate(all='warn'):
        warnings.simplefilter('error')
        for lengths in (*SHAPES.values(), *CHANGE_POINTS.values(), (1.0, 1e-29, 1e-29, 1.0)):
            solved(four_bars_of(*lengths, 1), angles)


def test_angles_go_on_steadily_through_change_points():
    phi = np.linspace(-9.0, 9.0, 9000)
    for lengths in CHANGE_POINTS.values():
        _, positions, velocities, _ = solved(four_bars_of(*lengths, 1), phi)
        for angle, rate in zip(positions, velocities, strict=True):
            steps = np.abs([remainder(step, 2 * pi) for step in np.diff(angle)])
            assert (steps <= 0.002 * 1.5 * (np.abs(rate).max() + 1e-9)).all()
