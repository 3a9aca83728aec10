# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Dropout: as much is lost as it says, in bursts as long as it says, and never the same twice."""

from itertools import groupby, pairwise
from math import ceil, inf, log

from linkage_ros.errors import DefinitionError
from linkage_ros.stages.effects import DropoutEffect
import pytest

from .sensors import BEGIN, chi_square, context, likely, MS, published, reading, UNLIKELY

N = 100_000


def line(probability, burst=0.0, hold='silent', seed='seed'):
    return DropoutEffect(probability, burst, hold).sensor(context(seed=seed))


def losses(probability, burst=0.0, n=N, seed='seed'):
    """Return for each sample whether it is lost."""
    lossy, sample = line(probability, burst, seed=seed), reading(BEGIN, 1.0)
    return [lossy(BEGIN + i * MS, sample) is None for i in range(n)]


def bursts(lost, state=True):
    """Return the lengths of the runs that are whole."""
    runs = [(each, sum(1 for _ in run)) for each, run in groupby(lost)]
    return [length for each, length in runs[1:-1] if each is state]


CHAINS = [
    pytest.param(0.1, 0.0, id='independent'),
    pytest.param(0.5, 0.0, id='independent, half'),
    pytest.param(0.001, 0.0, id='independent, rare'),
    pytest.param(0.1, 5.0, id='bursts'),
    pytest.param(0.02, 40.0, id='long bursts'),
    pytest.param(0.3, 1.0, id='never two in a row'),
    pytest.param(0.75, 3.0, id='never two arrive in a row'),
    pytest.param(0.9, 30.0, id='mostly lost'),
]


@pytest.mark.parametrize(('probability', 'burst'), CHAINS)
def test_dropout_loses_the_declared_share(probability, burst):
    # The variance of a mean over a chain of two states whose correlation falls by ρ each step.
    stay = burst or 1.0 / (1.0 - probability)
    rho = 1.0 - 1.0 / stay - probability / (stay * (1.0 - probability))
    variance = probability * (1.0 - probability) * (1.0 + rho) / (1.0 - rho) / N
    lost = sum(losses(probability, burst)) / N
    if variance:
        assert likely((lost - probability) ** 2 / variance, 1)
    else:
        assert lost == pytest.approx(probability, abs=1 / N)


@pytest.mark.sample(6)
@pytest.mark.parametrize(('probability', 'burst'), CHAINS)
@pytest.mark.parametrize('state', [True, False], ids=['lost', 'arriving'])
def test_dropout_bursts_have_the_declared_lengths(probability, burst, state):
    # What goes on with the same chance q each time is longer than k with the chance q^k.
    stay = burst or 1.0 / (1.0 - probability)
    mean = stay if state else stay * (1.0 - probability) / probability
    q = 1.0 - 1.0 / mean
    lengths = bursts(losses(probability, burst), state)
    n = len(lengths)
    assert n > 40
    if q < 1e-9:
        assert set(lengths) == {1}
        return
    # Pearson's statistic over classes of about an eighth of them each.
    edges = sorted({ceil(log(1.0 - eighth / 8) / log(q)) for eighth in range(1, 8)})
    classes = list(pairwise([0, *edges, inf]))
    expected = [n * (q**longer - q**end) for longer, end in classes]
    found = [sum(longer < length <= end for length in lengths) for longer, end in classes]
    total = sum((f - e) ** 2 / e for f, e in zip(found, expected, strict=True))
    assert UNLIKELY < chi_square(total, len(classes) - 1) < 1.0 - UNLIKELY


def test_first_sample_is_lost_as_often_as_others():
    first = [losses(0.25, 10.0, 1, seed=str(seed))[0] for seed in range(4000)]
    assert likely((sum(first) - 1000) ** 2 / (4000 * 0.25 * 0.75), 1)


def test_dropout_without_bursts_loses_samples_independently():
    lost = losses(0.3)
    twice = sum(a and b for a, b in pairwise(lost)) / (N - 1)
    # Products of neighbours: 0.09 of them, and each shares one factor with the next.
    variance = 0.09 * 0.91 + 2 * (0.027 - 0.0081)
    assert likely((twice - 0.09) ** 2 / (variance / N), 1)


@pytest.mark.parametrize(('probability', 'burst'), [(0.0, 0.0), (0.0, 7.0), (1.0, 0.0)])
def test_dropout_probabilities_zero_and_one_are_exact(probability, burst):
    assert set(losses(probability, burst, 1000)) == {probability == 1.0}


def timeline(sensor, n=200):
    """Return what is published of the samples 1, 2, 3, …; 0 for nothing."""
    found = [sensor(BEGIN + i * MS, reading(BEGIN + i * MS, 1.0 + i)) for i in range(n)]
    return [0 if read is None else int(read.joints[0]) for read in found], found


def test_dropout_omits_or_repeats_lost_samples():
    silent, _ = timeline(line(0.6, 3.0))
    repeated, found = timeline(line(0.6, 3.0, 'repeat'))
    last = 0
    for index, (heard, held) in enumerate(zip(silent, repeated, strict=True)):
        assert heard in {0, index + 1}
        last = heard or last
        assert held == last
    assert silent.count(0) > 80
    assert repeated[0] == 0
    assert all(read is None or read.stamp == BEGIN + i * MS for i, read in enumerate(found))


def test_dropout_repeats_the_whole_last_reading():
    sensor = line(0.5, 0.0, 'repeat')
    arrived = None
    for i in range(100):
        now = BEGIN + i * MS
        sample = reading(now, i, rates=(2.0 * i,), accelerations=(3.0 * i,), efforts=(4.0 * i,))
        found = sensor(now, sample)
        if found == sample:
            arrived = sample
        assert found == (arrived and arrived._replace(stamp=now))


def test_dropout_draws_only_for_new_samples():
    # Of the same draws each decides over one sample: at every tick, or at every tenth.
    every = published('dropout: {probability: 0.4, burst: 2}', 20)
    some = published(
        'rate_limit: {rate: 100, hold: silent}, dropout: {probability: 0.4, burst: 2}', 200
    )
    lost = [found is None for found in every]
    assert [found is None for found in some[::10]] == lost
    assert True in lost
    assert False in lost
    assert all(found is None for n, found in enumerate(some) if n % 10)


def test_scene_with_dropout_loses_but_never_alters_readings():
    ideal, text = published('', 150), 'dropout: {probability: 0.3, burst: 4}'
    lossy = published(text, 150)
    assert all(found in {None, read} for found, read in zip(lossy, ideal, strict=True))
    assert 0 < lossy.count(None) < 150


@pytest.mark.parametrize('hundredths', range(51, 100))
def test_advised_burst_length_is_accepted(hundredths):
    with pytest.raises(DefinitionError) as raised:
        line(hundredths / 100, 1.0)
    advised = float(raised.value.remedy.split()[1])
    assert advised == pytest.approx(hundredths / (100 - hundredths), rel=1e-5)
    line(hundredths / 100, advised)
