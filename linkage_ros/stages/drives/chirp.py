# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Drive a crank through a range of frequencies: θ = θ₀ + A·sin φ, with φ′ = 2π·f(t).

During the T seconds of the sweep, with x = t/T, the frequency and the periods passed, φ/2π, are

- linear: f = f₀ + (f₁ − f₀)·x and f₀·t + (f₁ − f₀)·x·t/2;
- logarithmic: f = f₀·(f₁/f₀)^x and f₀·T·((f₁/f₀)^x − 1)/ln(f₁/f₀),

the latter is the exponential sweep of Farina, "Simultaneous measurement of impulse response and
distortion with a swept-sine technique", AES 108th Convention (2000), preprint 5093.

Both start at φ = 0. For the linear sweep, whole periods are subtracted in integers, before any
rounding. For the logarithmic one, the number of periods is a double with an error of a few ulps.
After the end the crank rests at the value reached. With ``repeat`` the sweep runs back,
f(T + t) = f(T − t), and so on: neither angle nor rate jumps where it reverses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import cos, exp, expm1, inf, log, sin, tau
from typing import NamedTuple

from linkage_ros.description import choice, each_part, flag, number
from linkage_ros.messages import NANOSECONDS
from linkage_ros.stages.drives.clocked import as_integers, ClockedDrive, Curve, InputMotion
from linkage_ros.stages.drives.drive import LARGEST

_FINEST = 2**60


@dataclass(frozen=True, slots=True)
class Chirp(InputMotion):
    """A chirp of one input."""

    amplitude: float = number('amplitude', unit='rad or m', least=0.0, most=LARGEST)
    start_frequency: float = number('frequency at the start', unit='Hz', above=0.0, most=1e6)
    end_frequency: float = number('frequency at the end', unit='Hz', above=0.0, most=1e6)
    seconds: float = number('duration of the sweep', unit='s', least=1e-6, most=1e9)
    mean: float = number('mean', 0.0, unit='rad or m', least=-LARGEST, most=LARGEST)
    sweep: str = choice('growth of the frequency', ('linear', 'logarithmic'), 'linear')
    repeat: bool = flag('at the end sweep back, and so on; else rest there', False)

    def value_range(self) -> tuple[float, float]:
        """Return the least and the greatest value of an input, in [rad] or [m]."""
        mean, A = self.mean, self.amplitude
        length = round(self.seconds * NANOSECONDS)
        sweep = _linear_sweep if self.sweep == 'linear' else _logarithmic_sweep
        periods, below, _ = sweep(self.start_frequency, self.end_frequency, length)
        passed = inf if self.repeat else periods(length) / below
        # The sine begins at 0; its maximum is a quarter of a period later, its minimum three.
        there = sin(tau * passed) if passed < 1.0 else 0.0
        return mean + A * (-1.0 if passed >= 0.75 else min(0.0, there)), mean + A * (
            1.0 if passed >= 0.25 else there
        )

    def motion_curve(self, _where: str = '') -> Curve:
        """Return value, rate and acceleration as a function of time, in [ns]."""
        mean, A = self.mean, self.amplitude
        length = round(self.seconds * NANOSECONDS)
        sweep = _linear_sweep if self.sweep == 'linear' else _logarithmic_sweep
        periods, below, frequency = sweep(self.start_frequency, self.end_frequency, length)
        there = periods(length)
        rest = None if self.repeat else (mean + A * sin(tau * (there % below / below)), 0.0, 0.0)

        def chirp(time: int) -> tuple[float, float, float]:
            if time < length:
                passed = periods(time)
                f, slope = frequency(time)
            elif rest:
                return rest
            else:
                sweeps, time = divmod(time, length)
                if sweeps % 2:
                    passed = (sweeps + 1) * there - periods(length - time)
                    f, slope = frequency(length - time)
                    slope = -slope
                else:
                    passed = sweeps * there + periods(time)
                    f, slope = frequency(time)
            phase = tau * (passed % below / below)
            w = tau * f
            s, c = sin(phase), cos(phase)
            return mean + A * s, A * w * c, A * (tau * slope * c - w * w * s)

        return chirp


@dataclass(frozen=True, slots=True)
class ChirpDrive(Chirp, ClockedDrive):
    """A sine of the inputs whose frequency sweeps through a range, from the first tick on."""

    KEY = 'drive.chirp'
    inputs: Mapping[str, Chirp] = each_part('inputs with a different chirp', 'input', Chirp)


class _FrequencySweep(NamedTuple):
    """A sweep as functions of the time since its start, in [ns]."""

    periods: Callable[[int], int]
    """Periods passed, in units of one period over ``below``."""
    below: int
    frequency: Callable[[int], tuple[float, float]]
    """Frequency, in [Hz], and its slope, in [Hz/s]."""


def _linear_sweep(start: float, end: float, length: int) -> _FrequencySweep:
    (first, last), below = as_integers(start, end)
    at_start, growth = 2 * length * first, last - first
    slope = (end - start) / (length / NANOSECONDS)

    def periods(time: int) -> int:
        return time * (at_start + growth * time)

    def frequency(time: int) -> tuple[float, float]:
        return start + (end - start) * (time / length), slope

    return _FrequencySweep(periods, 2 * length * below * NANOSECONDS, frequency)


def _logarithmic_sweep(start: float, end: float, length: int) -> _FrequencySweep:
    growth = log(end / start)
    if growth == 0.0:
        return _linear_sweep(start, end, length)
    seconds = length / NANOSECONDS
    scale = start * seconds / growth

    def periods(time: int) -> int:
        return int(scale * expm1(growth * (time / length)) * _FINEST)

    def frequency(time: int) -> tuple[float, float]:
        f = start * exp(growth * (time / length))
        return f, f * growth / seconds

    return _FrequencySweep(periods, _FINEST, frequency)
