# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Friction that falls with the rate, and more at rest: against scipy and closed forms.

On a crank alone, whose inertia about its pivot is 0.23 kg·m².
"""

from math import cos, exp

from hypothesis import given, strategies as st
from linkage_ros.dynamics import Friction, JointFriction, JointLoad, Loads, Mechanics
import pytest
from scipy.integrate import solve_ivp

from .loaded import closed, STATES, swing
from ..support.scenes import closure_of, PENDULUM

INERTIA = 0.05 + 2.0 * 0.3**2
CURVE = JointFriction(0.05, 0.4, 0.6, 2.0)
METHODS = ('rk4', 'gauss_legendre')
RISING = {'efforts': {'drive_joint': JointLoad(over_time=((0.0, 0.0), (5.0, 5.0)))}}


def slowing(rate):
    """Return the resistance to a motion forward, continued smoothly beyond rest."""
    return 0.05 * rate + 0.4 + 0.2 * exp(-((rate / 2.0) ** 2))


def resisting(rate):
    """Return the resistance to a motion in either direction."""
    if rate == 0.0:
        return 0.0
    return slowing(rate) if rate > 0.0 else -slowing(-rate)


@given(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0))
def test_drive_effort_follows_the_friction_curve(rate, pull):
    mechanics = Mechanics(closure_of(PENDULUM), friction=Friction({'O': CURVE}))
    position = mechanics.closure.position(0.3)
    velocity = mechanics.closure.velocity(position, rate)
    acceleration = mechanics.closure.acceleration(position, velocity, pull)
    efforts = mechanics.drive_efforts(position, velocity, acceleration)
    assert efforts == pytest.approx((INERTIA * pull + resisting(rate),), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize('method', METHODS)
def test_crank_with_friction_curve_stops_as_scipy_integrates(method):
    after = swing(friction=Friction({'O': CURVE}), rate=4.0, method=method)
    rest = lambda _, state: state[1]  # noqa: E731
    rest.terminal = True
    known = solve_ivp(
        lambda _, state: [state[1], -slowing(state[1]) / INERTIA],
        (0.0, 9.0), [0.0, 4.0], 'DOP853', events=rest, rtol=1e-12, atol=1e-13, dense_output=True,
    )  # fmt: skip
    for share in (0.2, 0.7, 0.95):
        seconds = round(share * known.t[-1], 6)
        assert after(seconds)[:2] == pytest.approx(tuple(known.sol(seconds)), abs=1e-9)
    assert after(known.t[-1] + 0.5) == pytest.approx((known.y[0, -1], 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize('stribeck', [0.0, 2.0])
def test_rising_effort_overcomes_the_breakaway_friction(method, stribeck):
    # The effort t [N·m] beats the breakaway friction at 0.6 s.
    joint = JointFriction(0.0, 0.4, 0.6, stribeck)
    after = swing(friction=Friction({'O': joint}), applied=RISING, method=method, step=0.007)
    assert after(0.5999) == (0.0, 0.0, 0.0)
    if stribeck:
        known = solve_ivp(
            lambda t, y: [y[1], (t - 0.4 - 0.2 * exp(-((y[1] / 2.0) ** 2))) / INERTIA],
            (0.6, 1.5), [0.0, 0.0], 'DOP853', rtol=1e-12, atol=1e-14, dense_output=True,
        ).sol  # fmt: skip
    else:
        known = lambda t: (  # noqa: E731
            (0.1 * (t - 0.6) ** 2 + (t - 0.6) ** 3 / 6.0) / INERTIA,
            (0.2 * (t - 0.6) + 0.5 * (t - 0.6) ** 2) / INERTIA,
        )
    for seconds in (0.61, 0.9, 1.4):
        assert after(seconds)[:2] == pytest.approx(tuple(known(seconds)), abs=2e-8)


@pytest.mark.parametrize('angle', [0.0, 0.4, 1.2, 1.5, 2.8])
def test_holding_friction_reduces_the_effort_at_rest(angle):
    weight = 2.0 * 9.81 * 0.3 * cos(angle)
    for holds, rate, expected in (
        (False, 0.0, weight),
        (True, 0.0, max(0.0, abs(weight) - 0.6) * (1.0 if weight > 0.0 else -1.0)),
        (True, 1e-3, weight + resisting(1e-3)),
    ):
        friction = Friction({'O': CURVE}, holds)
        mechanics = Mechanics(closure_of(PENDULUM), Loads((0.0, -9.81)), friction)
        position = mechanics.closure.position(angle)
        velocity = mechanics.closure.velocity(position, rate)
        still = mechanics.closure.acceleration(position, velocity, 0.0)
        efforts = mechanics.drive_efforts(position, velocity, still)
        assert efforts == pytest.approx((expected,), abs=1e-12)


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', [name for name in STATES if name != 'five_bar'])
def test_compiled_friction_curve_equals_the_interpreted_one(name):
    closure = closed(name)
    joints = {joint.name: CURVE for joint in closure.structure.joints}
    mechanics = Mechanics(closure, friction=Friction(joints))
    for (q,) in STATES[name]:
        assert mechanics.motion_equation(q) == mechanics.motion_terms(closure.position(q))
