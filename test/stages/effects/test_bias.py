# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Bias: what is read of a joint is off by a constant, and nothing else is."""

from hypothesis import given, strategies as st
from linkage_ros.errors import DefinitionError
from linkage_ros.stages.effects import BiasEffect, EccentricDisc, EncoderEffect, JointEncoder
from mpmath import mp
import pytest

from .sensors import BEGIN, context, likely, MS, published, reading, SLIDE


@pytest.mark.parametrize(
    ('biases', 'expected'),
    [
        ({'rocker_joint': 0.0}, (1.0, 2.0)),
        ({'rocker_joint': 0.25}, (1.0, 2.25)),
        ({'rocker_joint': -3.0, 'coupler_joint': 0.5}, (1.5, -1.0)),
    ],
)
def test_bias_shifts_only_the_named_joint_position(biases, expected):
    sensor = BiasEffect(biases).sensor(context())
    for ms in range(3):
        assert sensor(BEGIN + ms * MS, reading(BEGIN, 1.0, 2.0)).joints == expected


def test_slide_bias_is_in_metres():
    sensor = BiasEffect({'rod_slide': 0.001}).sensor(context(SLIDE))
    assert sensor(BEGIN, reading(BEGIN, 1.0, 0.125)).joints == (1.0, 0.126)


def test_a_scene_publishes_biased_joints_and_true_rates():
    ideal = published('')
    for i, off in zip(ideal, published('bias: {joints: {coupler_joint: 0.5}}'), strict=True):
        assert off.joints == (i.joints[0] + 0.5, i.joints[1])
        assert off.rates == i.rates


def test_bias_deviation_is_drawn_once_per_seed():
    # Over seeds it spreads by its deviation; in a run it stays.
    drawn = []
    for seed in range(2000):
        parameters = BiasEffect({'rocker_joint': 5.0}, deviations={'rocker_joint': 0.25})
        sensor = parameters.sensor(context(seed=f'{seed}'))
        first, later = (sensor(BEGIN + ms * MS, reading(BEGIN, 1.0, 2.0)).joints for ms in (0, 9))
        assert first == later
        assert first[0] == 1.0
        drawn.append((first[1] - 7.0) / 0.25)
    assert likely(sum(number**2 for number in drawn), 2000)
    assert likely(sum(drawn) ** 2 / 2000, 1)


@pytest.mark.parametrize(
    ('kind', 'field', 'expected'),
    [('rates', 'rates', (3.0, 4.5)), ('efforts', 'efforts', (5.0, 6.5))],
)
def test_rates_and_efforts_have_their_own_bias(kind, field, expected):
    sensor = BiasEffect(**{kind: {'rocker_joint': 0.5}}).sensor(context())
    rest = {'rates': (3.0, 4.0), 'efforts': (5.0, 6.0)}
    found = sensor(BEGIN, reading(BEGIN, 1.0, 2.0, **rest))
    assert found == reading(BEGIN, 1.0, 2.0, **{**rest, field: expected})
    assert sensor(BEGIN, reading(BEGIN, 1.0, 2.0)) == reading(BEGIN, 1.0, 2.0)


@given(st.floats(-20.0, 20.0), st.floats(-9.0, 9.0), st.floats(-0.1, 0.1), st.floats(-4.0, 4.0))
def test_scale_and_eccentricity_change_angle_and_rate_consistently(angle, rate, scale, phase):
    # The rate that is read is the slope of what is read, by mpmath.
    parameters = BiasEffect(
        scales={'rocker_joint': scale},
        eccentricities={'rocker_joint': EccentricDisc(0.01, phase)},
    )
    sensor = parameters.sensor(context())
    found = sensor(BEGIN, reading(BEGIN, 1.0, angle, rates=(7.0, rate)))

    def read(x):
        return x + scale * x + mp.mpf(0.01) * mp.sin(x - phase)

    with mp.workdps(40):
        assert found.joints[1] == pytest.approx(float(read(mp.mpf(angle))), rel=1e-14, abs=1e-15)
        slope = mp.diff(read, mp.mpf(angle))
        assert found.rates[1] == pytest.approx(float(slope * mp.mpf(rate)), rel=1e-12, abs=1e-13)
    assert (found.joints[0], found.rates[0]) == (1.0, 7.0)


@pytest.mark.parametrize(
    ('sensor', 'parameters', 'line'),
    [
        (BiasEffect, {'eccentricities': {'rod_slide': EccentricDisc(0.1)}}, 'has no disc'),
        (EncoderEffect, {'joints': {'rod_slide': JointEncoder(8, multi_turn=True)}}, 'a slide'),
    ],
)
def test_rotary_sensor_errors_on_a_slide_are_refused(sensor, parameters, line):
    with pytest.raises(DefinitionError, match=f'rod_slide.*{line}'):
        sensor(**parameters).sensor(context(SLIDE))
