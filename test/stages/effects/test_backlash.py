# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Backlash: timelines of a motor and what the crank makes of it."""

from math import pi, remainder, sin, tau

from hypothesis import given, strategies as st
from linkage_ros.kinematics import Closure
from linkage_ros.stages.drives import Context, CrankState
from linkage_ros.stages.effects import BacklashEffect
import pytest

from ...support.messages import read_joint_state
from ...support.scenes import closure_of, pipeline_of, shipped

FOUR_BAR = closure_of('four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}')
TWO_CRANKS = Closure(shipped('five_bar'))
CYLINDER = closure_of("""
links:
  ground: {K: [0, 0], I: [1, 0]}
  tube: {K: [0, 0]}
  rod: {C: [0, 0]}
  lever: {I: [0, 0], C: [0.5, 0]}
sliders:
  bore: {point: C, block: rod, angle: 0, along: tube, through: K, direction: [1, 0]}
input: {joint: cylinder, slider: bore}
assembly: {C: left}
joints: {lever_joint: {parent: ground, child: lever}}
""")


def stage(play, loop=FOUR_BAR, **inputs):
    context = Context(loop, 1000.0, True, 'seed', None, None)
    return BacklashEffect(play, inputs).drive_stage(context)


def crank(angle, rate=0.0, acceleration=0.0, age=0):
    return CrankState((angle,), (rate,), (acceleration,), age)


def followed(stage, motor):
    """Return where the crank is when the motor comes to these places, one after the other."""
    return [stage(crank(angle)).angles[0] for angle in motor]


def test_crank_stands_still_within_the_play():
    motor = [1.0 + 0.1 * sin(0.1 * i) for i in range(1000)]
    assert set(followed(stage(0.2000001), motor)) == {1.0}


def test_backlash_passes_rates_only_while_the_motor_pushes():
    held = stage(0.2)
    timeline = [
        # motor: place, rate, acceleration → crank
        ((0.00, 9.0, 2.0), (0.0, 0.0, 0.0)),  # in the middle, it moves alone
        ((0.05, 9.0, 2.0), (0.0, 0.0, 0.0)),
        ((0.15, 9.0, 2.0), (0.05, 9.0, 2.0)),  # it pushes
        ((0.25, 5.0, -4.0), (0.15, 5.0, -4.0)),  # and slows down: the crank with it
        ((0.25, 0.0, -4.0), (0.15, 0.0, 0.0)),  # turns back: the crank stays
        ((0.15, -5.0, -4.0), (0.15, 0.0, 0.0)),
        ((0.00, -5.0, -4.0), (0.10, -5.0, -4.0)),  # it pushes at the other end
        ((0.00, 0.0, 0.0), (0.10, 0.0, 0.0)),  # stands
        ((0.00, 0.0, -3.0), (0.10, 0.0, -3.0)),  # begins to push
        ((0.00, 0.0, 3.0), (0.10, 0.0, 0.0)),  # begins to leave
        ((0.20, 0.0, 3.0), (0.10, 0.0, 3.0)),  # begins to push at the first end
        ((0.20, 0.0, -3.0), (0.10, 0.0, 0.0)),
    ]
    for motor, (angle, rate, acceleration) in timeline:
        found = held(crank(*motor))
        assert found.angles == pytest.approx((angle,), abs=1e-15)
        assert (found.rates, found.accelerations) == ((rate,), (acceleration,))


@given(st.lists(st.floats(-1e3, 1e3), min_size=1))
def test_the_crank_is_never_beyond_the_play(motor):
    wide = stage(2.0, CYLINDER)
    for place, angle in zip(motor, followed(wide, motor), strict=True):
        assert abs(place - angle) <= 1.0 + 1e-12


steps = st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=30)


@given(steps, st.floats(0.0, 2.0))
def test_backlash_is_independent_of_the_tick_rate(motor, play):
    # A play operator is rate-independent: places in between, on the way, change nothing.
    finer = [motor[0]]
    for place in motor[1:]:
        finer += [0.5 * (finer[-1] + place), place]
    coarse, fine = followed(stage(play, CYLINDER), motor), followed(stage(play, CYLINDER), finer)
    assert fine[::2] == pytest.approx(coarse, abs=1e-13)


@given(steps)
def test_two_plays_in_series_equal_their_sum(motor):
    first, second = stage(0.3, CYLINDER), stage(0.5, CYLINDER)
    behind = followed(second, followed(first, motor))
    assert behind == pytest.approx(followed(stage(0.8, CYLINDER), motor), abs=1e-13)


numbers = st.floats(-1e6, 1e6)


@given(st.lists(st.tuples(numbers, numbers, numbers, st.integers(0, 10**9)), min_size=1))
def test_zero_play_leaves_the_crank_unchanged(motor):
    tight = stage(0.0, CYLINDER)
    for place, rate, acceleration, age in motor:
        state = crank(place, rate, acceleration, age)
        assert tight(state) == state


@given(st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=30))
def test_backlash_follows_wrapped_motor_angles(turned):
    place, motor = 0.0, []
    for step in turned:
        place += step
        motor.append(place)
    plain = followed(stage(0.4), motor)
    wrapped = followed(stage(0.4), [remainder(place, tau) for place in motor])
    for one, other in zip(plain, wrapped, strict=True):
        assert remainder(one - other, tau) == pytest.approx(0.0, abs=1e-9)


def test_each_input_has_its_own_play():
    right = TWO_CRANKS.linkage.inputs[1].joint
    both = stage(0.2, TWO_CRANKS, **{right: 0.4})
    assert both(CrankState((0.0, pi), (1.0, 1.0), (2.0, 2.0), 7)).angles == (0.0, pi)
    found = both(CrankState((0.3, pi + 0.3), (3.0, -4.0), (5.0, 6.0), 8))
    assert found.angles == pytest.approx((0.2, pi + 0.1))
    assert found[1:] == ((3.0, 0.0), (5.0, 0.0), 8)


def test_scene_publishes_the_crank_behind_the_backlash():
    pipeline = pipeline_of(
        'drive: {sine: {mean: 1, amplitude: 0.5, frequency: 1}}\n'
        'effects: {backlash: {play: 0.2}, velocity: {}}'
    )
    cranks, rates = [], []
    for i in range(100):
        message = pipeline.tick(10**9 + i * 10**7).message
        state = read_joint_state(message)
        assert state.name[0] == 'crank_joint'
        cranks.append(state.position[0])
        rates.append(list(state.velocity))
        expected = FOUR_BAR.position(cranks[-1]).joints
        assert state.position[1:] == pytest.approx(list(expected), abs=1e-12)
    # At first it waits; then it goes up to 1.4, and stays there until the motor is at 1.3.
    assert cranks[:3] == [1.0] * 3
    assert cranks[25] == max(cranks) == pytest.approx(1.4)
    motor = [1.0 + 0.5 * sin(tau * i / 100) for i in range(100)]
    waiting = [i for i in range(26, 75) if motor[i] > 1.3001]
    assert {cranks[i] for i in waiting} == {cranks[25]}
    assert all(rates[i] == [0.0, 0.0, 0.0] for i in waiting)
    assert min(cranks) == pytest.approx(0.6)
