# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A chirp against its definition: the sine of 2π times the integral of its frequency, to 30 digits.

The integral is mpmath's, by quadrature; so are the derivatives of the position.
"""

from dataclasses import replace
from math import hypot, log2, tau

from linkage_ros.stages.drives import Chirp, ChirpDrive, CrankState
from mpmath import mp
import pytest

from .contexts import one_input, pipeline, readings

SECOND = 1_000_000_000
UP = Chirp(amplitude=0.5, start_frequency=0.5, end_frequency=8.0, seconds=4.0, mean=0.2)
DOWN = Chirp(amplitude=0.5, start_frequency=9.7, end_frequency=0.3, seconds=3.3)
LONG = Chirp(amplitude=0.1, start_frequency=100.0, end_frequency=200.0, seconds=1e6)
UP_LOG = Chirp(0.5, 0.1, 20.0, 7.0, mean=-1.0, sweep='logarithmic')
DOWN_LOG = Chirp(0.5, 30.0, 0.01, 7.0, sweep='logarithmic')
EVEN_LOG = Chirp(0.5, 3.0, 3.0, 7.0, sweep='logarithmic')
NEARLY_EVEN_LOG = Chirp(0.5, 3.0, 3.0 + 1e-12, 7.0, sweep='logarithmic')
ALL = {
    'up': UP,
    'down': DOWN,
    'long': LONG,
    'up, logarithmic': UP_LOG,
    'down, logarithmic': DOWN_LOG,
    'even, logarithmic': EVEN_LOG,
    'nearly even, logarithmic': NEARLY_EVEN_LOG,
}


def repeated(parameters):
    return replace(parameters, repeat=True)


def whole_seconds(parameters):
    """Return the length of the sweep, of whole nanoseconds, in [s]."""
    return mp.mpf(round(parameters.seconds * SECOND)) / SECOND


def frequency(parameters, t):
    """Return the frequency, in [Hz], at a time, in [s]: there, and back, and there again."""
    length = whole_seconds(parameters)
    sweeps = mp.floor(t / length)
    x = t / length - sweeps
    if sweeps % 2:
        x = 1 - x
    start, end = mp.mpf(parameters.start_frequency), mp.mpf(parameters.end_frequency)
    if parameters.sweep == 'linear':
        return start + (end - start) * x
    return start * (end / start) ** x


def periods(parameters, t):
    """Return the integral of the frequency, piece by piece where its slope jumps."""
    length = whole_seconds(parameters)
    turns = [k * length for k in range(int(t / length) + 1)]
    places = sorted({*turns, t})
    # The slope is that to the left at the end of a piece, and the frequency is continuous.
    return mp.quad(lambda s: frequency(parameters, s), places) if t > 0 else mp.zero


def check(parameters, time):
    """Check a chirp at a time, in [ns], which is none where the sweep turns."""
    with mp.workdps(30):
        t = mp.mpf(time) / SECOND
        A = mp.mpf(parameters.amplitude)

        def position(s):
            return parameters.mean + A * mp.sin(2 * mp.pi * periods(parameters, s))

        passed = periods(parameters, t)
        # A double's roundings of what the sine is taken of; the linear sweep's is below a period.
        rounding = 16e-16 * (1 if parameters.sweep == 'linear' else 1 + passed) * 2 * mp.pi
        w = 2 * mp.pi * max(parameters.start_frequency, parameters.end_frequency)
        found = parameters.motion_curve()(time)
        assert abs(found[0] - position(t)) <= A * rounding + 1e-16
        if time:
            # One step of each is exact to 1e-12 and better, as mpmath chooses it.
            assert abs(found[1] - mp.diff(position, t)) <= A * w * (rounding + 1e-11)
            assert abs(found[2] - mp.diff(position, t, 2)) <= A * w * w * (rounding + 1e-7)


@pytest.mark.sample(4)
@pytest.mark.parametrize('part', [0.0, 1e-9, 0.123456789, 0.5, 0.987654321])
@pytest.mark.parametrize('name', ALL)
def test_chirp_position_rate_and_acceleration_equal_the_definition(name, part):
    parameters = ALL[name]
    check(parameters, int(part * parameters.seconds * SECOND))


@pytest.mark.sample(3)
@pytest.mark.parametrize('part', [1.25, 1.75, 2.3, 3.9, 7.1])
@pytest.mark.parametrize('name', ['up', 'down', 'up, logarithmic', 'down, logarithmic'])
def test_repeated_chirp_sweeps_back_and_forth(name, part):
    parameters = repeated(ALL[name])
    check(parameters, int(part * parameters.seconds * SECOND))


@pytest.mark.parametrize('name', ALL)
def test_chirp_rests_at_its_end(name):
    chirp = ALL[name].motion_curve()
    end = round(ALL[name].seconds * SECOND)
    before, rate, _ = chirp(end - 1)
    rest, *still = chirp(end)
    assert abs(rest - before) <= 1.01 * abs(rate) * 1e-9 + 1e-6 * ALL[name].amplitude
    assert still == [0.0, 0.0]
    assert chirp(end + 1) == chirp(10**6 * end) == (rest, 0.0, 0.0)


@pytest.mark.parametrize('turn', [1, 2, 3, 10, 1001])
@pytest.mark.parametrize('name', ALL)
def test_chirp_reversal_keeps_position_and_rate_continuous(name, turn):
    parameters = repeated(ALL[name])
    chirp = parameters.motion_curve()
    end = turn * round(parameters.seconds * SECOND)
    w = 6.3 * max(parameters.start_frequency, parameters.end_frequency)
    before, at, after = (chirp(end + step) for step in (-1, 0, 1))
    for other in (before, after):
        # By no more than the rate, or acceleration, makes of a nanosecond, and a few roundings.
        rounding = 1e-15 * (1 + log2(turn)) * (1 + w * parameters.seconds)
        assert abs(at[0] - other[0]) <= parameters.amplitude * (1e-9 * w + rounding)
        assert abs(at[1] - other[1]) <= parameters.amplitude * w * (1.2e-9 * w + rounding)


@pytest.mark.parametrize('name', ['up', 'up, logarithmic', 'down, logarithmic'])
def test_chirp_sweeps_from_first_to_last_frequency(name):
    """Of a sine of frequency f, (θ − θ₀)² + (θ′/2πf)² is A²."""
    parameters = repeated(ALL[name])
    end = round(parameters.seconds * SECOND)
    for time, f in ((0, parameters.start_frequency), (end, parameters.end_frequency)):
        value, rate, _ = parameters.motion_curve()(time)
        swing = hypot(value - parameters.mean, rate / (tau * f))
        assert swing == pytest.approx(parameters.amplitude, rel=1e-12)


def test_chirp_drive_starts_at_its_first_tick():
    drive = ChirpDrive(0.5, 2.0, 2.0, seconds=1.0, mean=0.1).build(one_input())
    assert (drive.stamp, drive.max_age) == (0, 0)
    begin = 1_700_000_000_000_000_000
    rate = pytest.approx(float(2 * mp.pi))
    assert drive.state(begin) == CrankState((0.1,), (rate,), (0.0,), 0)
    assert drive.state(begin + SECOND // 8).angles == pytest.approx((0.6,))
    assert drive.state(begin + SECOND) == CrankState((0.1,), (0.0,), (0.0,), 0)


def test_a_scene_publishes_the_chirp():
    built = pipeline(
        'chirp: {amplitude: 0.5, start_frequency: 0.25, end_frequency: 0.75, seconds: 2}'
    )
    # Of f₀·t + (f₁ − f₀)·t²/2T there have passed 3/8 of a period after 1 s, and 1 at the end.
    slowest = 0.5 * tau * 0.25
    assert readings(built, SECOND, 2 * SECOND, 3 * SECOND) == [
        (0.0, pytest.approx(slowest)),
        (pytest.approx(0.5 * 0.5**0.5), pytest.approx(-2.0 * slowest * 0.5**0.5)),
        (pytest.approx(0.0, abs=1e-15), 0.0),
    ]
