# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Velocity: the slope of the position, none at a toggle, and nothing in a scene without it."""

from math import isfinite, remainder, tau

from hypothesis import given, strategies as st
from linkage_ros.stages.drives import Context, CrankState
from linkage_ros.stages.effects import MechanismState, VelocityEffect
import pytest

from .sensors import ANGLES, SLIDE
from ..support.scenes import closure_of

STRETCHED_AT_0 = closure_of('four_bar: {a: 1, b: 1, c: 1, d: 3}')
EVERY_OTHER = closure_of('four_bar: {a: 1, b: 1, c: 1, d: 2}')


def moved(loop, angle, rate):
    """Return the motion that leaves the stage."""
    position = loop.position(angle)
    crank = CrankState((angle,), (rate,), (0.0,), 0)
    context = Context(loop, 1000.0, True, 'seed', None, None)
    stage = VelocityEffect().stage(context)
    return stage(MechanismState(crank, position, None, None, (), (), ()))


@given(st.floats(-10.0, 10.0), st.floats(-100.0, 100.0))
@pytest.mark.parametrize('loop', [ANGLES, SLIDE], ids=['four-bar', 'slider-crank'])
def test_it_is_the_slope_of_the_position(loop, angle, rate):
    step = 1e-5
    slopes = [
        remainder(after - before, tau) / (2 * step)
        for after, before in zip(
            loop.position(angle + step).joints, loop.position(angle - step).joints, strict=True
        )
    ]
    expected = [slope * rate for slope in slopes]
    assert list(moved(loop, angle, rate).velocity.joints) == pytest.approx(
        expected, abs=1e-6 * abs(rate)
    )


@given(st.floats(-10.0, 10.0))
def test_a_crank_at_rest_has_joints_at_rest(angle):
    assert all(rate == 0.0 for rate in moved(ANGLES, angle, 0.0).velocity.joints)


@given(st.floats(-17.0, -1.0))
def test_next_to_a_toggle_rates_are_finite_or_none(exponent):
    limit = EVERY_OTHER.input_ranges[0].highest
    angle = limit - 10.0**exponent
    if EVERY_OTHER.position(angle).joints:
        found = moved(EVERY_OTHER, angle, 1e10).velocity
        assert found is None or all(map(isfinite, found.joints))
