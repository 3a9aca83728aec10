# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Own sensors: each joint by its own rate, delay and losses, and all in one message."""

from fractions import Fraction
from math import floor

from hypothesis import given, strategies as st
from linkage_ros.stages.effects import (
    DelayEffect,
    DropoutEffect,
    JointDelay,
    JointDropout,
    JointRateLimit,
    RateLimitEffect,
)
import pytest

from .sensors import BEGIN, context, likely, MS, published, reading


def limited(rate, own, **parameters):
    use = RateLimitEffect(rate, joints={'rocker_joint': JointRateLimit(**own)}, **parameters)
    return use.sensor(context())


def delayed(seconds, own, **parameters):
    use = DelayEffect(seconds, joints={'rocker_joint': JointDelay(**own)}, **parameters)
    return use.sensor(context())


def lossy(probability, joints, seed='seed', **parameters):
    own = {joint: JointDropout(*each) for joint, each in joints.items()}
    use = DropoutEffect(probability, joints=own, **parameters)
    return use.sensor(context(seed=seed))


def values(found):
    return None if found is None else found.joints


@given(
    st.tuples(st.floats(1.0, 20_000.0), st.floats(1.0, 20_000.0)),
    st.integers(0, 20 * MS),
    st.floats(-1000.0, 1000.0),
    st.lists(st.integers(1, 5 * MS), min_size=5, max_size=40),
    st.booleans(),
)
def test_each_joint_sensor_has_its_own_clock(rates, phase, ppm, gaps, silent):
    ticks = [sum(gaps[:n]) for n in range(len(gaps))]

    def sample(now, begin, rate):
        """Return the tick of the newest sample, in [ns]; None before the first."""
        if now < begin:
            return None
        k = floor((now - begin) * rate / 10**9) + 1
        due = [
            begin + floor(n * 10**9 / rate + Fraction(1, 2)) for n in range(max(k - 2, 0), k + 1)
        ]
        last = max(time for time in due if time <= now)
        return min(tick for tick in ticks if tick >= last)

    general, own = rates
    clock = {'rate': own, 'phase': phase * 1e-9, 'ppm': ppm}
    sensor = limited(general, clock, hold='silent' if silent else 'repeat')
    of_rocker = Fraction(own) * (1 + Fraction(ppm) / 10**6)
    for now in ticks:
        found = sensor(BEGIN + now, reading(BEGIN + now, now, now))
        expected = sample(now, 0, Fraction(general)), sample(now, phase, of_rocker)
        # One that is silent says nothing where neither has a new sample.
        if None in expected or (silent and now not in expected):
            assert found is None
        else:
            assert (found.stamp, found.joints) == (BEGIN + now, expected)


def test_gap_is_delayed_like_each_joint():
    sensor, found, begins = delayed(0.001, {'seconds': 0.004}, between='sampled'), [], []
    for ms in range(16):
        now = BEGIN + ms * MS
        gap = 4 <= ms < 10
        read = sensor.gap(now) if gap else sensor(now, reading(now, ms, ms))
        found.append(values(read))
        begins += [ms] if gap and sensor.gap_begins else []
    assert found == [
        *(None, None, None, None),  # the rocker's first reading is on its way
        *((3, 0), (3, 1), (3, 2), (3, 3)),  # the coupler repeats its last one before the gap
        *(None, None, None),
        *((10, 3), (11, 3), (12, 3)),  # now the rocker
        *((13, 10), (14, 11)),
    ]
    assert begins == [4]


def test_rate_limited_joint_repeats_its_whole_reading():
    sensor = limited(1000.0, {'rate': 100.0})
    for ms in range(10):
        now, ones = BEGIN + ms * MS, (ms, ms)
        found = sensor(now, reading(now, *ones, rates=ones, accelerations=ones, efforts=ones))
        expected = reading(now, ms, 0, rates=(ms, 0), accelerations=(ms, 0), efforts=(ms, 0))
        assert found == expected


def test_repeated_reading_without_rates_publishes_no_rates():
    sensor = limited(1000.0, {'rate': 500.0})
    found = []
    for ms in range(6):
        now = BEGIN + ms * MS
        found.append(sensor(now, reading(now, ms, ms, rates=() if ms == 2 else (ms, ms))).rates)
    assert found == [(0, 0), (1, 0), (), (), (4, 4), (5, 4)]


N = 20_000
OWN = {
    'independent': (0.3, 0.0),
    'bursts': (0.2, 5.0),
}


def losses(sensor, n=N):
    """Return for coupler and rocker whether each sample is lost."""
    lost, held = [], (None, None)
    for index in range(n):
        now = BEGIN + index * MS
        held = values(sensor(now, reading(now, index, index))) or held
        lost.append(tuple(of != index for of in held))
    return list(zip(*lost, strict=True))


@pytest.mark.parametrize('chain', OWN)
def test_each_joint_loses_its_declared_share(chain):
    probability, burst = OWN[chain]
    of_coupler, of_rocker = losses(lossy(0.1, {'rocker_joint': OWN[chain]}))
    # Variances of means: of independent samples; of a chain of two states whose correlation falls
    # by ρ each step.
    stay = burst or 1.0 / (1.0 - probability)
    rho = 1.0 - 1.0 / stay - probability / (stay * (1.0 - probability))
    variance = probability * (1.0 - probability) * (1.0 + rho) / (1.0 - rho) / N
    assert likely((sum(of_coupler) / N - 0.1) ** 2 / (0.1 * 0.9 / N), 1)
    assert likely((sum(of_rocker) / N - probability) ** 2 / variance, 1)


def test_joints_lose_their_samples_independently():
    lost = losses(lossy(0.0, {'coupler_joint': (0.1,), 'rocker_joint': (0.3,)}))
    both = sum(map(all, zip(*lost, strict=True))) / N
    assert likely((both - 0.03) ** 2 / (0.03 * 0.97 / N), 1)


def test_loss_of_all_joints_publishes_nothing():
    sensor = lossy(0.5, {'rocker_joint': (0.5,)})
    found = [sensor(BEGIN + n * MS, reading(BEGIN + n * MS, n, n)) for n in range(400)]
    _, *rest = found
    assert 0.15 < rest.count(None) / len(rest) < 0.35
    assert all(n in read.joints for n, read in enumerate(found) if read is not None)


@pytest.mark.parametrize(('hold', 'samples'), [('silent', 1), ('repeat', 50)])
def test_lost_sample_of_a_slow_joint_stays_missing(hold, samples):
    # Of the rocker's samples, each 50 ms, half are lost; repeated, each is lost 50 times or fewer.
    limit = limited(1000.0, {'rate': 20.0}, hold=hold)
    line = lossy(0.0, {'rocker_joint': (0.5,)})
    changes, last, n = [], None, 20_000
    for ms in range(n):
        now = BEGIN + ms * MS
        found = line(now, limit(now, reading(now, ms, ms)))
        if found is not None and found.joints[1] != last:
            last = found.joints[1]
            changes.append(ms - last)
    if samples == 1:
        assert set(changes) == {0}
        assert likely((len(changes) - n / 100) ** 2 / (n / 50 / 4), 1)
    else:
        assert len(changes) == n / 50
        assert likely((sum(change > 0 for change in changes) - n / 100) ** 2 / (n / 50 / 4), 1)


def test_silent_joint_is_delayed_by_its_own_delay():
    # The rocker is sampled at 0, 5, 10, … ms, and its samples come in turn, 7 ms and more later.
    limit = limited(1000.0, {'rate': 200.0}, hold='silent')
    line = delayed(0.0, {'seconds': 0.0061}, between='interpolated')
    found = []
    for ms in range(20):
        now = BEGIN + ms * MS
        found.append(values(line(now, limit(now, reading(now, float(ms), float(ms))))))
    expected = [None] * 7 + [0] * 5 + [5] * 5 + [10] * 3
    assert found == [
        None if of_rocker is None else (ms, of_rocker) for ms, of_rocker in enumerate(expected)
    ]


def test_added_joint_sensor_changes_no_other_joint():
    alone, _ = losses(lossy(0.1, {'rocker_joint': (0.3,)}), 500)
    whole = DropoutEffect(0.1).sensor(context())
    told = [whole(BEGIN, reading(BEGIN, n, n)) is None for n in range(500)]
    # Before the rocker's first reading nothing is published.
    first = alone.index(False)
    assert list(alone[first:]) == told[first:]
    _, rocker = losses(lossy(0.1, {'rocker_joint': (0.3,)}), 500)
    both = losses(lossy(0.1, {'coupler_joint': (0.3,), 'rocker_joint': (0.3,)}), 500)
    assert both[1][10:] == rocker[10:]
    assert both[0] != both[1]


def test_added_random_latency_changes_no_other_joint():
    def rocker(joints):
        found = published(f'delay: {{seconds: 0, joints: {{{joints}}}}}', 200)
        return [None if read is None else read.joints[1] for read in found]

    own = '{seconds: 0.002, spread: 0.01, reorder: true}'
    one = rocker(f'rocker_joint: {own}')
    two = rocker(f'rocker_joint: {own}, coupler_joint: {own}')
    begun = next(n for n, value in enumerate(two) if value is not None)
    last = None
    for before, now in zip(one[begun:], two[begun:], strict=True):
        last = now or last  # where neither arrives nothing is published
        assert last == before
    assert len(set(one)) > 100


# Effects with the general parameters, and those of the rocker.
CHAINS = {
    'rate_limit': ('rate_limit: {{{}}}', 'rate: 250', 'rate: 70, phase: 0.004, ppm: 500'),
    'delay': ('delay: {{{}}}', 'seconds: 0.004', 'seconds: 0.0207'),
    'sampled': ('delay: {{{}}}', 'seconds: 0.0051', 'seconds: 0.0107, between: sampled'),
    'behind an encoder': (
        (
            'encoder: {{joints: {{coupler_joint: {{counts: 4096}}, rocker_joint: {{counts: 1000, '
            'incremental: true}}}}, cutoff: 20}}, rate_limit: {{{}}}'
        ),
        *('rate: 190', 'rate: 33.3'),
    ),
}


@pytest.mark.parametrize('name', CHAINS)
def test_joint_sensor_equals_the_same_general_sensor(name):
    effects, general, own = CHAINS[name]
    found = published(effects.format(f'{general}, joints: {{rocker_joint: {{{own}}}}}'), 200)
    coupler = published(effects.format(general), 200)
    rocker = published(effects.format(own), 200)
    assert sum(read is not None for read in found) > 150
    for read, one, other in zip(found, coupler, rocker, strict=True):
        assert (read is None) == (one is None or other is None)
        if read is not None:
            assert read.stamp == one.stamp
            assert read.joints == (one.joints[0], other.joints[1])
            assert read.rates == (one.rates[0], other.rates[1])


# Period and phase of sampling, and delay, in [s], of a sensor of MuJoCo; its time step is 1 s.
MUJOCO = [
    ((2.0, 0.0, 0.0), (2.5, -1.5, 0.0)),
    ((1.0, 0.0, 1.0), (1.0, 0.0, 4.0)),
    ((2.0, 0.0, 3.0), (3.7, -0.2, 6.0)),
]


@pytest.mark.parametrize('sensors', MUJOCO)
def test_joint_sensors_equal_mujoco_interval_and_delay(sensors):
    mujoco = pytest.importorskip('mujoco')
    elements = [
        f'<jointpos joint="slide" nsample="9" interval="{period} {phase}" delay="{late}"/>'
        for period, phase, late in sensors
    ]
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><option timestep="1" gravity="0 0 0"/><worldbody><body>'
        '<joint name="slide" type="slide"/><geom size="1"/></body></worldbody>'
        f'<sensor>{"".join(elements)}</sensor></mujoco>'
    )
    data = mujoco.MjData(model)
    data.qvel[0] = 1.0
    (coupler, rocker) = (
        {'rate': 1.0 / period, 'phase': period + phase if phase else 0.0}
        for period, phase, _ in sensors
    )
    limit = limited(**coupler, own=rocker)
    line = delayed(sensors[0][2], {'seconds': sensors[1][2], 'between': 'sampled'},
                   between='sampled')  # fmt: skip
    told = 0
    for second in range(60):
        mujoco.mj_forward(model, data)
        now = BEGIN + second * 1000 * MS
        read = limit(now, reading(now, data.qpos[0], data.qpos[0]))
        found = line.silence(now, False) if read is None else line(now, read)
        if found is not None:  # before, MuJoCo reads 0
            told += 1
            assert found.joints == tuple(data.sensordata)
        mujoco.mj_step(model, data)
    assert told > 45


def test_joint_rate_phase_and_delay_follow_the_timeline():
    # The rocker's samples of 10, 60, 110, … ms are 20 ms late; the coupler's, of each 10 ms, 4 ms.
    found = published(
        'rate_limit: {rate: 100, joints: {rocker_joint: {rate: 20, phase: 0.01}}}, '
        'delay: {seconds: 0.004, joints: {rocker_joint: {seconds: 0.02}}}',
        200,
    )
    ideal = published('', 200)
    assert found[:30] == [None] * 30
    for n, read in enumerate(found[30:], 30):
        coupler = (n - 4) // 10 * 10
        rocker = 10 + (n - 30) // 50 * 50
        assert read.joints == (ideal[coupler].joints[0], ideal[rocker].joints[1])
