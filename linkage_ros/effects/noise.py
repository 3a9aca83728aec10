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


"""
Noise: the reading of a joint scatters from tick to tick, and drifts.

With n normal, of mean 0 and standard deviation 1, drawn anew at each occurrence::

    y = x + σ·n + w        w(t + Δt) = w(t) + K·√Δt·n,  w = 0 at the first tick
    ẏ = ẋ + σᵥ·n

σ, ``white``, is the standard deviation of one reading. IEEE Std 952 (annex C) and data sheets name
the density N instead; at a rate of f readings a second σ = N·√f, and the Allan variance of y is
N²/τ. K, ``walk``, is the density of a random walk: after the time t the standard deviation of w is
K·√t, whatever the ticks between, and its Allan variance is K²·τ/3. If no time passes, w stays.

σᵥ, ``rate_white``, is for sensors that measure rates: the rates do not contain the noise of y, nor
do accelerations and efforts.

Each joint and each kind of noise has its own generator, which draws once in every tick, with or
without rates: the noise of one joint does not change that of another.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import sqrt

from linkage_ros.drives.drive import Context
from linkage_ros.effects.stage import Sensor, SensorReading
from linkage_ros.files.parameters import each, number

_Source = tuple[int, float, Callable[[float, float], float]]
"""Index of the joint, size of its noise, and its generator: normal(mean, deviation)."""


@dataclass(frozen=True, slots=True)
class JointNoise:
    """Noise of a joint."""

    white: float = number(
        'standard deviation of each reading', 0.0, unit='rad or m', least=0.0, most=1e6
    )
    walk: float = number(
        'density of a random walk', 0.0, unit='rad/√s or m/√s', least=0.0, most=1e6
    )
    rate_white: float = number(
        'standard deviation of each rate', 0.0, unit='rad/s or m/s', least=0.0, most=1e6
    )


@dataclass(frozen=True, slots=True)
class NoiseParameters:
    """White noise and a random walk in the readings of joints."""

    joints: Mapping[str, JointNoise] = each('noise of a joint', 'joint', JointNoise, required=True)


PARAMETERS = NoiseParameters


def sensor(parameters: NoiseParameters, context: Context) -> Sensor:
    """Build the sensor."""

    def sources(kind: str) -> tuple[_Source, ...]:
        return tuple(
            (i, strength, context.random(f'noise/{joint}/{kind}').gauss)
            for i, joint in enumerate(context.joints)
            if joint in parameters.joints
            and (strength := getattr(parameters.joints[joint], kind)) > 0.0
        )

    return Noise(sources('white'), sources('walk'), sources('rate_white'))


class Noise:
    """
    Noise of all joints, with the state of each random walk.

    Parameters
    ----------
    white, walk, rate_white
        Noise sources, by kind.

    """

    __slots__ = ('_last', '_rate_white', '_walk', '_wandered', '_white')

    def __init__(
        self,
        white: tuple[_Source, ...],
        walk: tuple[_Source, ...],
        rate_white: tuple[_Source, ...],
    ) -> None:
        self._white = white
        self._walk = walk
        self._rate_white = rate_white
        self._wandered = [0.0] * len(walk)
        self._last: int | None = None

    def __call__(self, now: int, reading: SensorReading) -> SensorReading:
        """Return the reading with noise."""
        rates = reading.rates
        noisy = list(reading.joints)
        for i, deviation, normal in self._white:
            noisy[i] += normal(0.0, deviation)
        if self._walk:
            elapsed = 0 if self._last is None else max(now - self._last, 0)
            root = sqrt(elapsed * 1e-9)
            wandered = self._wandered
            for n, (i, density, normal) in enumerate(self._walk):
                wandered[n] += normal(0.0, density * root)
                noisy[i] += wandered[n]
            self._last = now
        if self._rate_white:
            speeds = list(rates)
            for i, deviation, normal in self._rate_white:
                drawn = normal(0.0, deviation)
                if speeds:
                    speeds[i] += drawn
            rates = tuple(speeds)
        return reading._replace(joints=tuple(noisy), rates=rates)
