# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Budgets drawn at random, for what must hold for all of them."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
import os
from random import Random

from linkage_ros.tools.study import Budget, JointError, Knob, Price, RecordingLoss, Setting, Spread

COUNT = int(os.environ.get('LINKAGE_STATES', '300'))

LABELS = (
    'rk4, 1 ms',
    'held',
    '100 Hz, carried forward',
    'a<b & "c"',
    'Newton to 1e-6',
    '30 digits',
)
CHANGES = (None, (), (('rate', 500.0),), (('drive.torque.step', 0.00025),))


def random_budgets(count: int = COUNT) -> Iterator[Budget]:
    """Yield budgets."""
    for seed in range(count):
        yield _budget(Random(seed))


def _budget(random: Random) -> Budget:
    rate = random.choice([50.0, 1000.0, 20_000.0])
    knobs = []
    for index in range(random.randint(1, 5)):
        chosen = _setting(random, rate)._replace(changes=(), advice='')
        others = [
            _setting(random, rate * random.choice([0.5, 1.0, 2.0]))
            for _ in range(random.randint(0, 7))
        ]
        place = random.randint(0, len(others))
        knobs.append(
            Knob(
                f'source {index}',
                [*others[:place], chosen, *others[place:]],
                place,
                random.choice([None, 10.0]),
                random.random() < 0.3,
                random.choice(['', 'nothing is cheaper']),
            )
        )
    tick = Price(_spread(random, random.uniform(1000.0, 2000.0)), rate)
    losses = [RecordingLoss('record.flush_period: 1', 0.9, Price(Spread(7.0, 7.5, 8.0), rate), 0)]
    return Budget('scene', rate, tick, knobs, losses, [('day', 'today')])


def _setting(random: Random, rate: float) -> Setting:
    """Return a setting: with keys, with advice alone, or for comparison only."""
    worst = random.choice([0.0, inf, *(10.0 ** random.uniform(-18.0, 1.0) for _ in range(12))])
    price = Price(_spread(random, random.uniform(-50.0, 900.0)), rate)
    return Setting(
        random.choice(LABELS),
        JointError(worst * random.uniform(0.1, 1.0), worst),
        random.choice([None, price]),
        random.choice(CHANGES),
        random.choice(['', 'carry the state forward']),
    )


def _spread(random: Random, middle: float) -> Spread:
    most = random.choice([0.1, 2.0, 100.0])
    return Spread(middle - random.uniform(0.0, most), middle, middle + random.uniform(0.0, most))
