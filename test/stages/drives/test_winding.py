# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A motor's winding with an inductance: against the matrix exponential and phases by hand."""

from math import exp, log

from linkage_ros.dynamics import Loads
from linkage_ros.errors import DefinitionError
from linkage_ros.stages.drives import PlayParameters
import numpy as np
import pytest
from scipy.linalg import expm

from .test_motor import CONSTANT, drive, INERTIA, RATIO, RESISTANCE, under

# A time constant L/R of 20 ms beside one of the wheel of 0.4 s, or both of one size: it swings.
LARGE, HUGE = 0.016, 0.4


def by_exponential(t, voltage, inductance, inertia=INERTIA, rate=0.0):
    """Return value, rate and current of a wheel on a voltage, as a linear system."""
    factor = CONSTANT * RATIO
    system = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, factor / inertia, 0.0],
            [0.0, -factor / inductance, -RESISTANCE / inductance, voltage / inductance],
            [0.0, 0.0, 0.0, 0.0],
        ]
    )
    value, rate, current, _ = expm(system * t) @ (0.0, rate, 0.0, 1.0)
    return value, rate, current


@pytest.mark.sample(2)
@pytest.mark.parametrize('inductance', [LARGE, HUGE])
@pytest.mark.parametrize(
    ('motor', 'command', 'voltage', 'rate'),
    [
        ({}, 12.0, 12.0, 0.0),
        ({}, -3.0, -3.0, 5.0),
        ({'voltage': 9.0}, 12.0, 9.0, 0.0),
        ({'command': 'current', 'voltage': 9.0}, 1e3, 9.0, 0.0),
        ({'command': 'effort', 'voltage': 9.0}, 1e3, 9.0, 0.0),
    ],
)
def test_inductive_motor_runs_up_as_the_matrix_exponential(
    motor, inductance, command, voltage, rate
):
    errors = []
    for step in (0.004, 0.002):
        built = drive({'inductance': inductance, **motor}, rate=rate, step=step)
        error = 0.0
        for t, value, speed, pull in under(built, command, 2000, 40):
            known = by_exponential(t, voltage, inductance, rate=rate)
            found = value, speed, pull * INERTIA / (CONSTANT * RATIO)
            error = max(error, *(abs(a - b) for a, b in zip(found, known, strict=True)))
        errors.append(error)
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert errors[1] < 2e-3 * abs(voltage) / RESISTANCE


def test_winding_current_rises_at_full_voltage_to_the_command():
    # The wheel is so heavy that it hardly moves: 4 A of 15 are reached after L/R·ln(15/11).
    lag = LARGE / RESISTANCE
    arrives = lag * log(15.0 / 11.0)
    motor = {'command': 'current', 'voltage': 12.0, 'inductance': LARGE}
    built = drive(motor, loads=Loads(drive_inertia=1e6), step=1e-4)
    for t, _, _, pull in under(built, 4.0, 12, 1):
        current = pull * 1e6 / (CONSTANT * RATIO)
        known = 15.0 * (1.0 - exp(-t / lag)) if t < arrives else 4.0
        assert current == pytest.approx(known, rel=1e-6, abs=1e-9)


def test_current_limit_holds_the_winding_current():
    built = drive({'current': 4.0, 'inductance': LARGE}, loads=Loads(drive_inertia=1e6), step=1e-4)
    *_, (_, _, _, pull) = under(built, 12.0, 100)
    assert pull * 1e6 / (CONSTANT * RATIO) == pytest.approx(4.0, rel=1e-12)


def test_inductive_motor_behind_play_runs_up_alone():
    built = drive({'inductance': LARGE}, play=PlayParameters(100.0, 0.1), step=1e-4)
    for t, *crank in under(built, 12.0, 100, 20):
        assert crank == [0.0, 0.0, 0.0]
        angle, rate, torque = built.motor
        found = angle / RATIO, rate / RATIO, torque / CONSTANT
        known = by_exponential(t, 12.0, LARGE, inertia=0.1)
        assert found == pytest.approx(known, rel=1e-4, abs=1e-6)


def test_command_timeout_switches_the_current_off():
    built = drive({'inductance': LARGE}, timeout=0.1)
    pulls = {round(t * 1e3): pull for t, _, _, pull in under(built, 12.0, 300)}
    assert pulls[50] > 1.0
    assert pulls[150] == pulls[300] == 0.0


@pytest.mark.parametrize(('motor', 'more', 'told'), [
    ({'command': 'current'}, {}, 'motor.inductance: the current is commanded, and without a'),
    ({'resistance': 0.01}, {},
     r'motor: its current and its rate change too fast for a step of 0'),
    ({}, {'step': 0.01},
     r'inductance: the current changes within 0\.00125 s, and a step is 0\.01 s'),
])  # fmt: skip
def test_invalid_inductance_is_refused(motor, more, told):
    with pytest.raises(DefinitionError, match=told):
        drive({'inductance': 1e-3, **motor}, loads=Loads(drive_inertia=1e-4), **more)
