# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A budget made by hand: a torque bench with an encoder, as `measure_budget` would find it."""

from __future__ import annotations

from linkage_ros.tools.study import Budget, JointError, Knob, Price, RecordingLoss, Setting, Spread


def price(middle: float, half: float = 0.1, rate: float = 1000.0) -> Price:
    """Return a price in [µs] with its quartiles."""
    return Price(Spread(middle - half, middle, middle + half), rate)


def error(worst: float) -> JointError:
    """Return an error."""
    return JointError(0.6 * worst, worst)


def step(method: str, seconds: float, worst: float, more: float | None) -> Setting:
    """Return a setting of the torque drive."""
    changes = (('drive.torque.method', method), ('drive.torque.step', seconds))
    return Setting(
        f'{method}, {seconds * 1e3:g} ms',
        error(worst),
        price(6.2, 0.2) if more is None else price(more),
        () if more is None else changes,
    )


STEP = Knob(
    'step of the drive',
    [
        step('rk4', 0.002, 0.31, -3.0),
        step('rk4', 0.001, 0.021, None),
        step('rk4', 0.0005, 1.2e-3, 6.1),
        step('rk4', 0.00025, 8e-5, 18.0),
        step('gauss_legendre', 0.002, 0.05, 9.0),
        step('gauss_legendre', 0.001, 3e-3, 21.0),
    ],
    1,
    after=10.0,
)


def rate(hertz: float, words: str, worst: float) -> Setting:
    """Return a setting of the rate of ticks, or how a listener uses it."""
    if hertz == 1000.0 and words == 'held':
        return Setting('1 kHz, held', error(worst), None)
    changes = (('rate', hertz),) if hertz != 1000.0 else ()
    advice = 'carry the state forward by its rates' if words != 'held' else ''
    return Setting(
        f'{hertz:g} Hz, {words}',
        error(worst),
        None if hertz == 1000.0 else price(0.02, rate=hertz),
        changes,
        advice,
    )


AGE = Knob(
    'age in use',
    [
        rate(100.0, 'held', 0.03),
        rate(500.0, 'held', 4.8e-3),
        rate(1000.0, 'held', 2.4e-3),
        rate(2000.0, 'held', 1.2e-3),
        rate(1000.0, 'carried forward', 1.1e-6),
        rate(2000.0, 'carried forward', 2.8e-7),
    ],
    2,
)

SOLVING = Knob(
    'solving',
    [
        Setting('closed form', error(6e-16), price(0.6, 0.05)),
        Setting('float32', error(3e-7), price(0.1), None),
        Setting('textbook form', error(2e-15), price(0.4), None),
        Setting('Newton to 1e-6', error(4e-8), price(7.0), None),
        Setting('spline table', error(2e-9), price(2.0), None),
        Setting('30 digits', error(1e-30), price(900.0, 9.0), None),
    ],
    0,
    note='nothing is cheaper',
)

ENCODER = Knob('encoder', [Setting('as it is', error(1.8e-3), price(0.4))], 0, is_deliberate=True)
EFFORT = Knob('effort', [Setting('as it is', error(0.0), price(0.2, 0.5))], 0, is_deliberate=True)

BUDGET = Budget(
    'hil',
    1000.0,
    price(61.0, 0.9),
    (STEP, AGE, SOLVING, ENCODER, EFFORT),
    (
        RecordingLoss('record.flush_period: 1', 0.9, price(7.5, 0.4), 0),
        RecordingLoss('record.flush_period: 0.2', 0.19, price(9.1, 0.4), 0),
    ),
    (('day', '2026-01-01'), ('processor', 'made by hand')),
    ('all but one period of the recorder',),
)
