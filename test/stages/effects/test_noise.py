# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Noise: as strong as it says, each of its own, and the same again from the same seed."""

from itertools import accumulate, cycle, islice, pairwise
from math import exp, sqrt

from linkage_ros.stages.effects import JointNoise, NoiseEffect
import pytest

from .sensors import BEGIN, context, likely, MS, published, reading, SLIDE

N = 20_000
REGULAR = [BEGIN + i * MS for i in range(N)]
IRREGULAR = list(accumulate(islice(cycle((MS, 50, 7 * MS, 0, 300_000)), N - 1), initial=BEGIN))


def noisy(joints, times=REGULAR, *, seed='seed', loop=None, rates=lambda _: (0.0, 0.0)):
    """Return what is read of a mechanism at rest."""
    where = context(seed=seed) if loop is None else context(loop, seed)
    sensor = NoiseEffect(joints).sensor(where)
    return [sensor(now, reading(now, 0.0, 0.0, rates=rates(now))) for now in times]


def values(found, joint=1):
    return [read.joints[joint] for read in found]


def squares(numbers, deviation):
    return sum((number / deviation) ** 2 for number in numbers)


def assert_white(numbers, deviation):
    """Hold numbers to be normal in mean and variance, and each new to the one before."""
    n = len(numbers)
    assert likely(squares(numbers, deviation), n)
    # Means of n, and products with the one before, are normal to within what n terms leave.
    assert likely((sum(numbers) / deviation) ** 2 / n, 1)
    products = sum(a * b for a, b in pairwise(numbers)) / deviation**2
    assert likely(products**2 / (n - 1), 1)


@pytest.mark.parametrize('deviation', [1e-9, 0.002, 1e3])
def test_white_noise_has_its_deviation_and_no_correlation(deviation):
    found = noisy({'rocker_joint': JointNoise(white=deviation)})
    assert_white(values(found), deviation)
    assert set(values(found, 0)) == {0.0}
    assert all(read.rates == (0.0, 0.0) for read in found)


def test_white_noise_has_the_normal_fourth_moment():
    # Of a normal number the fourth moment is 3, and that of its estimate 96/n.
    numbers = values(noisy({'rocker_joint': JointNoise(white=0.5)}))
    fourth = sum((number / 0.5) ** 4 for number in numbers) / N
    assert likely((fourth - 3.0) ** 2 / (96.0 / N), 1)


def test_rate_noise_changes_only_the_rates():
    found = noisy({'rocker_joint': JointNoise(rate_white=0.3)})
    assert_white([read.rates[1] for read in found], 0.3)
    assert all(read.joints == (0.0, 0.0) for read in found)
    assert all(read.rates[0] == 0.0 for read in found)


@pytest.mark.parametrize('times', [REGULAR, IRREGULAR], ids=['1 kHz', 'irregular ticks'])
def test_walk_steps_grow_with_the_root_of_time(times):
    walk = values(noisy({'rocker_joint': JointNoise(walk=0.25)}, times))
    assert walk[0] == 0.0
    steps = []
    for (before, after), (begin, end) in zip(pairwise(walk), pairwise(times), strict=True):
        if begin == end:
            assert before == after
        else:
            steps.append((after - before) / sqrt((end - begin) * 1e-9))
    assert_white(steps, 0.25)


def test_walk_deviation_does_not_depend_on_the_ticks():
    # After 0.1 s the standard deviation is K·√0.1, in one step or in a hundred.
    for times in ([BEGIN, BEGIN + 100 * MS], [BEGIN + i * MS for i in range(101)]):
        ends = [
            values(noisy({'rocker_joint': JointNoise(walk=2.0)}, times, seed=str(seed)))[-1]
            for seed in range(300)
        ]
        assert likely(squares(ends, 2.0 * sqrt(0.1)), 300)


def test_white_noise_and_walk_add_up():
    white, walk = JointNoise(white=0.01), JointNoise(walk=0.3)
    both = JointNoise(white=0.01, walk=0.3)
    alone = [values(noisy({'rocker_joint': kind})) for kind in (white, walk)]
    summed = [a + b for a, b in zip(*alone, strict=True)]
    assert values(noisy({'rocker_joint': both})) == summed


@pytest.mark.parametrize('times', [REGULAR, IRREGULAR])
def test_drift_has_its_deviation_and_correlation_time(times):
    # What is new at each reading is white: d₂ − φ·d₁, of variance s²·(1 − φ²).
    noise = JointNoise(drift=0.02, correlation_time=0.05)
    drifted = values(noisy({'rocker_joint': noise}, times))
    new = [drifted[0] / 0.02]
    for (before, one), (now, other) in pairwise(zip(times, drifted, strict=True)):
        kept = exp(-(now - before) * 1e-9 / 0.05)
        if now > before:
            new.append((other - kept * one) / (0.02 * sqrt(1.0 - kept * kept)))
        else:
            assert other == one
    assert_white(new, 1.0)


def test_drift_spreads_equally_from_the_first_reading():
    noise = {'rocker_joint': JointNoise(drift=0.5, correlation_time=0.01)}
    runs = [values(noisy(noise, REGULAR[:30], seed=f'{seed}')) for seed in range(1000)]
    for reading_number in (0, 3, 29):
        assert likely(squares([run[reading_number] for run in runs], 0.5), 1000)


def test_noise_density_scales_with_the_root_of_rate():
    # The context of these tests ticks at 1 kHz.
    assert_white(values(noisy({'rocker_joint': JointNoise(density=1e-3)})), 1e-3 * sqrt(1000.0))


def test_effort_noise_changes_only_the_efforts():
    where = context(seed='seed')
    sensor = NoiseEffect({'rocker_joint': JointNoise(effort_white=0.3)}).sensor(where)
    found = [sensor(now, reading(now, 0.0, 0.0)._replace(efforts=(0.0, 0.0))) for now in REGULAR]
    assert_white([read.efforts[1] for read in found], 0.3)
    assert {read.joints for read in found} == {(0.0, 0.0)}
    assert sensor(BEGIN, reading(BEGIN, 0.0, 0.0)).efforts == ()


def test_noise_of_one_joint_does_not_change_another():
    one = JointNoise(white=0.01, walk=0.3, rate_white=1.0)
    alone, beside = (
        noisy({'rocker_joint': one}),
        noisy({'coupler_joint': one, 'rocker_joint': one}),
    )
    assert values(alone) == values(beside)
    assert [read.rates[1] for read in alone] == [read.rates[1] for read in beside]
    assert values(beside, 0) != values(beside, 1)


def test_noise_of_two_joints_is_independent():
    one = JointNoise(white=1.0)
    found = noisy({'coupler_joint': one, 'rocker_joint': one})
    products = sum(a * b for a, b in zip(values(found, 0), values(found, 1), strict=True))
    assert likely(products**2 / N, 1)


def test_noise_kinds_of_one_joint_are_independent():
    found = noisy({'rocker_joint': JointNoise(white=1.0, rate_white=1.0)})
    products = sum(read.joints[1] * read.rates[1] for read in found)
    assert likely(products**2 / N, 1)


def test_slide_noise_is_in_metres():
    found = noisy({'rod_slide': JointNoise(white=1e-5)}, loop=SLIDE)
    assert_white(values(found), 1e-5)


def test_scene_publishes_only_the_named_noise():
    text = 'noise: {joints: {rocker_joint: {white: 0.01, walk: 0.1}}}'
    ideal, first = published('', 2000 // 10), published(text, 2000 // 10)
    errors = [a.joints[1] - b.joints[1] for a, b in zip(first, ideal, strict=True)]
    # Differences of white noise have twice its variance, the steps of the walk add their own.
    steps = [after - before for before, after in pairwise(errors)][::2]
    assert likely(squares(steps, sqrt(2 * 0.01**2 + 0.1**2 * 0.001)), len(steps))
    assert [read.joints[0] for read in first] == [read.joints[0] for read in ideal]
