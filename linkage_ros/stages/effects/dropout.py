# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Dropout: samples are lost, one by one or in bursts.

The line is a Markov chain of two states: in the good one every sample arrives, in the bad one none
does (E. N. Gilbert, Capacity of a burst-noise channel, Bell System Technical Journal 39, 1960;
with a loss probability in either: E. O. Elliott, Estimates of error rates for codes on burst-noise
channels, ibid. 42, 1963). From one sample to the next the transition probabilities are::

    good → bad    p = L/(B·(1 − L))
    bad → good    r = 1/B

Then a stay in the bad state lasts B samples on average, ``burst``, and a fraction p/(p + r) = L of
all samples is lost, ``probability``. Between two bursts at least one sample arrives: p ≤ 1, so B
is at least L/(1 − L). Losses are independent of each other if p = 1 − r = L, at B = 1/(1 − L);
``burst: 0`` stands for this value. The first state is bad with probability L, so that all samples
have the same distribution.

Each sample takes one random draw, whatever its fate. A sample is a reading that a tick has to
publish: a repeated reading of a slower sensor is lost or not each time; a silent sensor has no
sample to lose.

``hold: silent`` publishes nothing for a lost sample; ``repeat`` publishes the last one that
arrived, with the stamp of the tick, and nothing before the first.

A joint under ``joints`` has its own line, with its own losses: see `own_sensors`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Context as Rounding
from random import Random

from linkage_ros.description import choice, number, own_parameters
from linkage_ros.errors import DefinitionError
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.effect import SensorEffect
from linkage_ros.stages.effects.stage import restamp, Sensor, SensorReading


@dataclass(frozen=True, slots=True)
class JointDropout:
    """Losses on the line of a joint's own sensor."""

    probability: float = number('fraction of all samples that is lost', least=0.0, most=1.0)
    burst: float = number(
        'mean length of a burst, 1 or more; 0: each is lost independently',
        0.0,
        unit='samples',
        least=0.0,
        most=1e9,
    )


@dataclass(frozen=True, slots=True)
class DropoutEffect(JointDropout, SensorEffect):
    """Samples are lost, one by one or in bursts."""

    hold: str = choice(
        'instead of a lost sample: publish nothing, or repeat the last one that arrived',
        ('silent', 'repeat'),
        'silent',
    )
    joints: Mapping[str, JointDropout] | None = own_parameters('own line of a joint', JointDropout)

    suppresses_ticks = True
    is_recoverable = False
    sample = '{probability: 0.1, burst: 3}'

    def sensor(self, context: Context) -> Sensor:
        """Build the sensor; raise `DefinitionError` if the bursts are too short for the losses."""
        if self.joints is None:
            return Dropout(self, context.random('dropout'))
        from linkage_ros.stages.effects.own_sensors import (
            own_sensors,  # local import: only for joints
        )

        return own_sensors('dropout', self, context)


def _loss_probabilities(loss: float, burst: float) -> tuple[float, float]:
    """Return the loss probability after a sample that arrived, and after a lost one."""
    if burst == 0.0:
        return loss, loss
    if burst < 1.0:
        raise DefinitionError(
            'effects.dropout.burst',
            f'{burst:g} is less than a sample',
            'write 1 or more [samples], or 0 for losses that are independent',
        )
    if _too_short(burst, loss):
        remedy = 'write 0'
        if loss < 1.0:
            remedy = f'write {_least_burst(loss)} or more [samples], or a lower probability'
        raise DefinitionError(
            'effects.dropout.burst',
            f'bursts of {burst:g} on average cannot lose {loss:g} of all samples, since one '
            'arrives between two bursts',
            remedy,
        )
    return min(loss / (burst * (1.0 - loss)), 1.0), 1.0 - 1.0 / burst


def _too_short(burst: float, loss: float) -> bool:
    """Return whether the bursts are too short for the loss, by more than rounding."""
    return loss > burst * (1.0 - loss) * (1.0 + 1e-12)


def _least_burst(loss: float) -> str:
    """Return the least burst for a loss, to six digits, rounded so that it is accepted."""
    rounding = Rounding(prec=6)
    least = rounding.create_decimal(repr(loss / (1.0 - loss)))
    while _too_short(float(least), loss):
        least = rounding.next_plus(least)
    return f'{least.normalize():f}'


class Dropout:
    """Sensor stage that loses samples."""

    __slots__ = ('_begins', '_chance', '_goes_on', '_last', '_random', '_repeat')

    def __init__(self, use: DropoutEffect, random: Random) -> None:
        self._begins, self._goes_on = _loss_probabilities(use.probability, use.burst)
        self._chance = use.probability
        self._repeat = use.hold == 'repeat'
        self._random = random.random
        self._last: SensorReading | None = None

    def __call__(self, _now: int, reading: SensorReading) -> SensorReading | None:
        """Return the arriving reading; None if it is lost and not repeated."""
        if self._random() >= self._chance:
            self._chance = self._begins
            self._last = reading
            return reading
        self._chance = self._goes_on
        last = self._last
        if last is None or not self._repeat:
            return None
        return restamp(last, reading.stamp)
