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


"""Bias: what is read of a joint is off by a constant, and nothing else is."""

from linkage_ros.effects import bias
from linkage_ros.effects.bias import BiasParameters
import pytest

from .sensors import BEGIN, context, MS, published, reading, SLIDE


@pytest.mark.parametrize(
    ('biases', 'expected'),
    [
        ({}, (1.0, 2.0)),
        ({'rocker_joint': 0.25}, (1.0, 2.25)),
        ({'rocker_joint': -3.0, 'coupler_joint': 0.5}, (1.5, -1.0)),
    ],
)
def test_it_is_added_to_the_position_of_the_joint_that_it_names(biases, expected):
    sensor = bias.sensor(BiasParameters(biases), context())
    for ms in range(3):
        assert sensor(BEGIN + ms * MS, reading(BEGIN, 1.0, 2.0)).joints == expected


def test_that_of_a_slide_is_in_metres():
    sensor = bias.sensor(BiasParameters({'rod_slide': 0.001}), context(SLIDE))
    assert sensor(BEGIN, reading(BEGIN, 1.0, 0.125)).joints == (1.0, 0.126)


def test_the_rest_of_the_reading_is_passed_on():
    sensor = bias.sensor(BiasParameters({'rocker_joint': 0.25}), context())
    rest = {'rates': (1.0, 2.0), 'accelerations': (3.0, 4.0), 'efforts': (5.0, 6.0)}
    assert sensor(BEGIN, reading(BEGIN, 1.0, 2.0, **rest)) == reading(BEGIN, 1.0, 2.25, **rest)
    assert sensor(BEGIN, reading(BEGIN, 1.0, 2.0)) == reading(BEGIN, 1.0, 2.25)


def test_a_scene_publishes_biased_joints_and_true_rates():
    ideal = published('')
    for i, off in zip(ideal, published('bias: {joints: {coupler_joint: 0.5}}'), strict=True):
        assert off.joints == (i.joints[0] + 0.5, i.joints[1])
        assert off.rates == i.rates
