# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Limits of joints: the states beyond them, and the range that they leave to an input."""

from dataclasses import replace
from math import inf, nextafter, pi, remainder, tau
import random

from hypothesis import assume, given, settings, strategies as st
from linkage_ros.errors import FileError
from linkage_ros.kinematics import Closure, CODES, InputSweep, Limits, Status
import numpy as np
import pytest

from .platforms import linkage_of, platform
from ..support.scenes import closure_of, symmetric_five_bar

CLOSED, LIMITED, TOGGLE, OPEN = Status.CLOSED, Status.LIMITED, Status.TOGGLE, Status.OPEN
CRANK_ROCKER = 'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1LIMITS}'
DOUBLE_ROCKER = 'four_bar: {a: 0.1, b: 0.07, c: 0.06, d: 0.05LIMITS}'
SLIDER_CRANK = """
links:
  ground: {O: [0, 0]}
  crank: {O: [0, 0], A: [0.04, 0]}
  rod: {A: [0, 0], B: [0.14, 0]}
sliders: {guide: {point: B, along: ground, through: O, direction: [1, 0]}}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {guide: ahead}
joints: {slide: {slider: guideLIMITS}}
"""


def closed(text, limits=''):
    return closure_of(text.replace('LIMITS', limits))


# Linkage, limits, and the result at values of the input.
STATES = {
    'within': (CRANK_ROCKER, ', input: {limits: [0.5, 1.5]}', {0.5: CLOSED, 1.0: CLOSED}),
    'beyond, either way': (CRANK_ROCKER, ', input: {limits: [0.5, 1.5]}',
                           {0.499: LIMITED, 1.501: LIMITED}),
    'an input counts with its turns': (CRANK_ROCKER, ', input: {limits: [0.5, 1.5]}',
                                       {1.0 + tau: LIMITED, 1.0 - tau: LIMITED}),
    'limits of more than a turn': (CRANK_ROCKER, ', input: {limits: [-7, 7]}',
                                   {6.9: CLOSED, -6.9: CLOSED, 7.1: LIMITED}),
    'one limit': (CRANK_ROCKER, ', input: {limits: [0, .inf]}', {1e6: CLOSED, -0.1: LIMITED}),
    'the other': (CRANK_ROCKER, ', input: {limits: [-.inf, 0]}', {-1e6: CLOSED, 0.1: LIMITED}),
    'no limits but of rate and effort': (CRANK_ROCKER, ', input: {velocity: 1, effort: 1}',
                                         {1e6: CLOSED}),
    'a published angle': (CRANK_ROCKER, ', joints: {rocker_joint: {limits: [1.5, 2]}}',
                          {2.0: CLOSED, 1.0: LIMITED, 3.0: LIMITED}),
    'a published angle in another turn is the same pose': (
        CRANK_ROCKER,
        ', joints: {rocker_joint: {limits: [-4.783185307179586, -4.283185307179586]}}',
        {2.0: CLOSED, 1.0: LIMITED, 3.0: LIMITED},
    ),
    'limits of a turn let a published angle be anything': (
        CRANK_ROCKER, ', joints: {rocker_joint: {limits: [-3.1416, 3.1416]}}',
        {0.0: CLOSED, 2.0: CLOSED, 5.0: CLOSED},
    ),
    'a published slide': (SLIDER_CRANK, ', limits: [0.12, 0.16]',
                          {0.0: LIMITED, 1.0: CLOSED, pi: LIMITED}),
    'open is worse than limited': (DOUBLE_ROCKER, ', input: {limits: [-0.5, 0.5]}',
                                   {3.0: OPEN, 0.6: LIMITED}),
}  # fmt: skip


@pytest.mark.parametrize('name', STATES)
def test_joint_limits_give_the_expected_statuses(name):
    text, limits, states = STATES[name]
    closure = closed(text, limits)
    assert {value: closure.position(value).status for value in states} == states
    batch = closure.solve(np.array([*states]))
    assert batch.status.tolist() == [CODES[status] for status in states.values()]


def test_toggle_beyond_the_limits_keeps_its_status():
    """It has no rates, which is worse; only what is published goes by the limits still."""
    toggle = closed(DOUBLE_ROCKER).input_ranges[0].highest
    closure = closed(DOUBLE_ROCKER, ', input: {limits: [-0.5, 0.5]}')
    assert closure.position(toggle).status is TOGGLE
    assert closure.solve(np.array([toggle])).status.tolist() == [CODES[TOGGLE]]
    assert closure.limit_exceeded(closure.position(toggle)).startswith('crank_joint at ')


def test_limited_states_keep_their_values_and_rates():
    free = closed(CRANK_ROCKER)
    closure = closed(CRANK_ROCKER, ', input: {limits: [0.5, 1.5]}')
    position, same = closure.position(2.0), free.position(2.0)
    assert position.joints == same.joints
    rates, theirs = closure.velocity(position, 1.0), free.velocity(same, 1.0)
    assert rates.joints == theirs.joints
    assert closure.acceleration(position, rates, 0.0).joints == (
        free.acceleration(same, theirs, 0.0).joints
    )
    batch, free_batch = closure.solve(np.array([2.0])), free.solve(np.array([2.0]))
    for found, expected in zip(batch[1:], free_batch[1:], strict=True):
        assert np.array_equal(found, expected)


def test_unlimited_linkage_has_no_limit_check():
    """What is called is the method itself, and no object stands between."""
    assert 'position' not in vars(closed(CRANK_ROCKER))
    assert 'position' not in vars(closed(CRANK_ROCKER, ', input: {velocity: 1}'))
    assert 'position' in vars(closed(CRANK_ROCKER, ', input: {limits: [0, 1]}'))


# Linkage, limits; the ranges, and what ends them.
RANGES = {
    'all of it': (CRANK_ROCKER, ', input: {limits: [0.5, 1.5]}', [(0.5, 1.5)], 'crank_joint'),
    'more than a turn': (CRANK_ROCKER, ', input: {limits: [-7, 7]}', [(-7, 7)], 'crank_joint'),
    'a toggle and a limit': (DOUBLE_ROCKER, ', input: {limits: [-0.5, 3]}', [(-0.5, 'toggle')],
                             'crank_joint'),
    'a published angle': (CRANK_ROCKER, ', joints: {rocker_joint: {limits: [1.5, 2]}}',
                          [('rocker', 'rocker'), ('rocker', 'rocker')], 'rocker_joint'),
    'a slide within a stroke': (SLIDER_CRANK, ', limits: [0.12, 0.16]',
                                [('slide', 'slide'), ('slide', 'slide')], 'slide'),
}  # fmt: skip


@pytest.mark.parametrize('name', RANGES)
def test_input_ranges_end_at_joint_limits(name):
    text, limits, expected, joint = RANGES[name]
    closure = closed(text, limits)
    assert len(closure.input_ranges) == len(expected)
    for found, ends in zip(closure.input_ranges, expected, strict=True):
        for end, by, wanted, outward in zip(found[:2], found.by, ends, (-1, 1), strict=True):
            outside = closure.position(end + outward * 1e-9).status
            if wanted == 'toggle':
                assert (by, outside) == ('', OPEN)
                continue
            assert (by, outside) == (joint, LIMITED)
            if not isinstance(wanted, str):
                assert end == wanted
            assert closure.position(end).status is CLOSED


def test_input_range_may_be_unlimited_on_one_side():
    (one,) = closed(CRANK_ROCKER, ', input: {limits: [0.5, .inf]}').input_ranges
    assert (one.lowest, one.limited, one.by, one.is_whole) == (
        0.5, (True, False), ('crank_joint', ''), False,
    )  # fmt: skip
    assert str(one) == '0.5 rad and more'


def test_range_search_finds_a_narrow_gap_of_limits():
    """At its summit the rocker is beyond its limit for a thousandth of a radian of the crank."""
    free = closed(CRANK_ROCKER)
    values = np.linspace(0.0, tau, 200_001)
    rocker = free.solve(values, derivatives=0).positions[1]
    summit, least = values[rocker.argmax()], rocker.min()
    high = float(free.position(summit + 5e-4).joints[1])
    closure = closed(
        CRANK_ROCKER, f', joints: {{rocker_joint: {{limits: [{least - 0.1}, {high}]}}}}'
    )
    assert closure.position(summit).status is LIMITED
    (one,) = closure.input_ranges
    assert tau - (one.highest - one.lowest) == pytest.approx(1e-3, rel=0.05)
    assert not one.is_whole


@pytest.mark.sample(5)
@pytest.mark.parametrize('near', [1e-2, 1e-4, 1e-5, 1e-6, 1e-8])
@pytest.mark.parametrize('width', [1e-3, 1e-2, 0.1])
def test_range_search_finds_narrow_joint_windows_near_toggles(near, width):
    """Next to a toggle joints move as the square root: a window is crossed in a short range."""
    draw = random.Random(f'{near} {width}')
    missed = []
    for _ in range(8):
        sides = dict(zip('abcd', (draw.uniform(0.2, 1.0) for _ in range(4)), strict=True))
        try:
            free = closure_of(f'four_bar: {sides}'.replace("'", ''))
        except FileError:
            continue
        one = free.input_ranges[0]
        if one.is_whole:
            continue
        inside = near * (one.highest - one.lowest)
        value = draw.choice((one.lowest + inside, one.highest - inside))
        name, joint = next(iter(free.linkage.joints.items()))
        angle = free.position(value).joints[0]
        limits = Limits(angle - width, angle + width)
        joints = {**free.linkage.joints, name: replace(joint, limits=limits)}
        ranges = Closure(replace(free.linkage, joints=joints)).input_ranges
        if not any(part.lowest < value < part.highest for part in ranges):
            missed.append((sides, value, limits))
    assert not missed


@settings(max_examples=30)
@given(
    sides=st.tuples(*[st.floats(0.2, 1.0)] * 4),
    own=st.none() | st.tuples(st.floats(-8.0, 8.0), st.floats(0.01, 9.0)),
    rocker=st.none() | st.tuples(st.floats(-pi, pi), st.floats(0.01, 3.0)),
    coupler=st.none() | st.tuples(st.floats(-pi, pi), st.floats(0.01, 3.0)),
)
def test_positions_batches_and_ranges_agree_on_limits(sides, own, rocker, coupler):
    """Random four-bars with random limits agree with the same linkage without, limited here."""
    a, b, c, d = sides
    try:
        free = closed(f'four_bar: {{a: {a!r}, b: {b!r}, c: {c!r}, d: {d!r}}}')
    except FileError:
        assume(False)
    linkage = free.linkage
    drawn = {'crank_joint': own, 'rocker_joint': rocker, 'coupler_joint': coupler}
    given_limits = {
        name: Limits(ends[0], ends[0] + ends[1]) for name, ends in drawn.items() if ends
    }
    (driven,) = linkage.inputs
    closure = Closure(
        replace(
            linkage,
            inputs=(replace(driven, limits=given_limits.get('crank_joint', Limits())),),
            joints={
                name: replace(joint, limits=given_limits.get(name, Limits()))
                for name, joint in linkage.joints.items()
            },
        )
    )

    def margin(value, joints):
        found = [inf]
        for name, limits in given_limits.items():
            if name == 'crank_joint':
                found.append(min(value - limits.low, limits.high - value))
                continue
            angle = joints[list(linkage.joints).index(name)]
            turns = (angle + n * tau for n in range(-3, 4))
            found.append(max(min(one - limits.low, limits.high - one) for one in turns))
        return min(found)

    # Where a single change point is passed, two turns lead back to where it was.
    one = free.input_ranges[0]
    place = 0.3 * one.lowest + 0.7 * one.highest
    here, there = free.position(place).joints, free.position(place + tau).joints
    same = there and all(
        abs(remainder(p - q, tau)) < 1e-6 for p, q in zip(here, there, strict=True)
    )
    period = 2 * tau if not same and (rocker or coupler) else tau
    values = np.linspace(-8.0, 8.0, 801)
    batch = closure.solve(values, derivatives=0)
    ranges = closure.input_ranges
    for value, code in zip(values.tolist(), batch.status.tolist(), strict=True):
        before, now = free.position(value), closure.position(value)
        assert CODES[now.status] == code
        assert now.joints == before.joints
        if not before.joints:
            assert now.status is before.status
            continue
        left = margin(value, before.joints)
        if abs(left) < 1e-9:
            continue
        beyond = left < 0.0
        if before.status is not TOGGLE:
            assert (now.status is LIMITED) == beyond
        # Within a range, by as many turns as an input without limits may be away from it.
        away = [0.0] if own is not None else [n * period for n in range(-3, 4)]
        inside = [
            min(value + turn - one.lowest, one.highest - value - turn)
            for one in ranges
            for turn in away
        ]
        if not any(one.is_whole for one in ranges) and all(abs(end) > 1e-7 for end in inside):
            assert any(end > 0.0 for end in inside) == (not beyond)
    about = [
        value
        for value in values.tolist()
        if closure.position(value).status is CLOSED
        and margin(value, closure.position(value).joints) > 1e-9
    ]
    for value in about[:: max(1, len(about) // 5)]:
        interval = InputSweep(closure).range_about(value)
        assert interval is not None
        assert interval.is_whole or interval.lowest <= value <= interval.highest


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ('lines', 'seed', 'turns'),
    [(0, 10, 0), (0, 50, 0), (1, 27, 0), (2, 11, 0), (2, 38, 0), (0, 0, 1), (0, 2, 1)],
)
def test_iterated_platforms_keep_joint_limits(lines, seed, turns):
    """Platforms whose branch has other poses a turn on (turns 0), or the same (1)."""
    rng = random.Random(seed)
    linkage = linkage_of(platform(rng, lines=lines), rng)
    free = Closure(linkage)
    (whole,) = free.input_ranges
    assert whole.turns == turns
    low, high = (whole.lowest, whole.highest) if not whole.is_whole else (-tau, tau)
    values = np.linspace(low + 1e-6, high - 1e-6, 601)
    angles = free.solve(values, derivatives=0).positions[0]
    (driven,) = linkage.inputs
    assert linkage.pose is not None
    (start,) = linkage.pose.inputs
    for draw in range(6):
        own = published = Limits()
        if draw % 3 != 1:
            own = Limits(start - rng.uniform(0.0, 5.0), start + rng.uniform(0.0, 5.0))
        if draw % 3:
            middle = rng.choice(angles.tolist())
            published = Limits(middle - rng.uniform(0.05, 1.5), middle + rng.uniform(0.05, 1.5))
        joints = {**linkage.joints}
        name = next(iter(joints))
        joints[name] = replace(joints[name], limits=published)
        closure = Closure(replace(linkage, inputs=(replace(driven, limits=own),), joints=joints))
        batch = closure.solve(values, derivatives=0)
        ranges = closure.input_ranges
        for value, angle, code in zip(
            values.tolist(), angles.tolist(), batch.status.tolist(), strict=True
        ):
            turned = max(
                min(angle + n * tau - published.low, published.high - angle - n * tau)
                for n in range(-4, 5)
            )
            left = min(value - own.low, own.high - value, turned)
            now = closure.position(value)
            assert CODES[now.status] == code
            if abs(left) < 1e-6:
                continue
            assert (now.status is LIMITED) == (left < 0.0)
            away = [0.0] if own.low > -inf or not turns else [n * tau for n in range(-3, 4)]
            inside = any(
                one.is_whole or one.lowest - 1e-6 <= value + turn <= one.highest + 1e-6
                for one in ranges
                for turn in away
            )
            # In a narrow part the pose may be missed, but none may be too wide.
            assert inside == (left > 0.0)


def test_limits_tolerate_the_rounding_of_decimal_sums():
    """0.45 + 0.35 is 0.7999999999999999 or 0.8; a sum may be a rounding beyond a limit."""
    closure = closed(CRANK_ROCKER, ', input: {limits: [0.1, 0.3]}')
    assert 0.1 + 0.2 > 0.3
    assert closure.position(0.1 + 0.2).status is CLOSED
    assert closure.position(nextafter(0.3 * (1 + 1e-15), inf)).status is LIMITED


def test_five_bar_limits_hold_for_every_joint():
    text = symmetric_five_bar(', limits: [1, 2]', rod=', limits: [-1.5, 0.5]')
    closure = closed(text)
    rod = closure.position(1.5, 1.5).joints[0]
    assert -1.5 < rod < 0.5
    assert closure.position(1.5, 1.5).status is CLOSED
    assert closure.position(0.9, 1.5).status is LIMITED
    batch = closure.solve(np.array([1.5, 0.9]), np.array([1.5, 1.5]), derivatives=0)
    assert batch.status.tolist() == [CODES[CLOSED], CODES[LIMITED]]
    (one,) = InputSweep(closure, (1.5, 1.5)).ranges
    assert one.lowest >= 1.0
    assert one.highest <= 2.0
    for end, by, outward in zip(one[:2], one.by, (-1, 1), strict=True):
        assert by in ('left_joint', 'rod_joint')
        assert InputSweep(closure, (1.5, 1.5)).position_at(end + outward * 1e-6).status is LIMITED
    assert remainder(rod, tau) == rod


@pytest.mark.parametrize(
    'limits', [dict.fromkeys(names, ', limits: [-2, 2]') for names in
               (('left',), ('left', 'right'), ('rod',), ('left', 'right', 'rod'))]
)  # fmt: skip
def test_five_bar_with_limits_has_no_input_ranges(limits):
    closure = closed(symmetric_five_bar(**{'left': '', **limits}))
    assert closure.input_ranges == ()
    assert closure.bounds.inputs or closure.bounds.joints
