# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Noise: the reading of a joint scatters from tick to tick, and drifts.

With n normal, of mean 0 and standard deviation 1, drawn anew at each occurrence::

    y = x + σ·n + w + d    w(t + Δt) = w(t) + K·√Δt·n,  w = 0 at the first tick
                           d(t + Δt) = φ·d(t) + s·√(1 − φ²)·n,  φ = e^(−Δt/T)
    ẏ = ẋ + σᵥ·n           τ̂ = τ + σₑ·n

σ, ``white``, is the standard deviation of one reading. IEEE Std 952 (annex C) and data sheets name
the density N instead, here ``density``; at a rate of f readings a second σ = N·√f, and the Allan
variance of y is N²/τ. K, ``walk``, is the density of a random walk: after the time t the standard
deviation of w is K·√t, whatever the ticks between, and its Allan variance is K²·τ/3. If no time
passes, w stays.

d is a Gauss–Markov process of order one, as IEEE Std 952 has it for exponentially correlated
noise: s, ``drift``, is its standard deviation at any time, and T, ``correlation_time``, the time
in which its correlation falls to 1/e. It stands for the drift of a bias that stays within bounds.
Over times far below T it is a walk of K = s·√(2/T).

σᵥ, ``rate_white``, is for sensors that measure rates, and σₑ, ``effort_white``, for those that
measure torque or force: rates and efforts do not contain the noise of y, nor do accelerations.

Each joint and each kind of noise has its own generator, which draws once in every tick, with or
without rates: the noise of one joint does not change another joint's noise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import exp, sqrt

from linkage_ros.description import each_part, number
from linkage_ros.errors import DefinitionError
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.effect import SensorEffect
from linkage_ros.stages.effects.stage import Sensor, SensorReading

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
    effort_white: float = number(
        'standard deviation of each effort', 0.0, unit='N·m or N', least=0.0, most=1e9
    )
    density: float = number(
        'density of white noise, in the place of white',
        0.0,
        unit='rad/√Hz or m/√Hz',
        least=0.0,
        most=1e6,
    )
    drift: float = number(
        'standard deviation of a drift that stays within bounds',
        0.0,
        unit='rad or m',
        least=0.0,
        most=1e6,
    )
    correlation_time: float = number(
        'time in which the correlation of the drift falls to 1/e',
        0.0,
        unit='s',
        least=0.0,
        most=1e9,
    )


@dataclass(frozen=True, slots=True)
class NoiseEffect(SensorEffect):
    """White noise, a random walk and a drift in the readings of joints."""

    joints: Mapping[str, JointNoise] = each_part(
        'noise of a joint', 'joint', JointNoise, required=True
    )

    is_recoverable = False
    sample = '{joints: {rocker_joint: {white: 0.001, walk: 0.001, rate_white: 0.01}}}'

    def sensor(self, context: Context) -> Sensor:
        """
        Build the sensor.

        Raise `DefinitionError` if kinds of noise of a joint exclude or lack each other, or a
        density has no rate.
        """
        for joint, noise in self.joints.items():
            _check_noise(f'effects.noise.joints.{joint}', noise, context.rate)

        def make_sources(kind: str, factor: float = 1.0) -> tuple[_Source, ...]:
            return tuple(
                (i, factor * strength, context.random(f'noise/{joint}/{kind}').gauss)
                for i, joint in enumerate(context.joints)
                if joint in self.joints and (strength := getattr(self.joints[joint], kind)) > 0.0
            )

        times = [
            self.joints[joint].correlation_time
            for joint in context.joints
            if joint in self.joints and self.joints[joint].drift
        ]
        return Noise(
            (*make_sources('white'), *make_sources('density', sqrt(context.rate))),
            make_sources('walk'),
            make_sources('rate_white'),
            make_sources('effort_white'),
            tuple(map(_Drift, make_sources('drift'), times)),
        )


def _check_noise(key: str, noise: JointNoise, rate: float) -> None:
    if noise.density and noise.white:
        raise DefinitionError(f'{key}.density', 'is white noise too', 'leave white or density out')
    if noise.density and not rate:
        raise DefinitionError(
            f'{key}.density', 'needs a rate of readings, and rate is 0', 'write white, or a rate'
        )
    if bool(noise.drift) != bool(noise.correlation_time):
        here, missing = sorted(
            ('drift', 'correlation_time'), key=lambda of: not getattr(noise, of)
        )
        raise DefinitionError(f'{key}.{here}', f'needs {missing}', f'write {missing} too')


class _Drift:
    """A Gauss–Markov process of order one, with its correlation time T, in [s]."""

    __slots__ = ('_deviation', '_last', '_normal', '_time', '_value', 'joint')

    def __init__(self, source: _Source, correlation_time: float) -> None:
        self.joint, self._deviation, self._normal = source
        self._time = correlation_time
        self._last: int | None = None
        self._value = 0.0

    def drift_at(self, now: int) -> float:
        """Return the drift at a time, in [ns], in [rad] or [m]."""
        kept = 0.0
        if self._last is not None:
            kept = exp(-max(now - self._last, 0) * 1e-9 / self._time)
        self._last = now
        drawn = self._normal(0.0, self._deviation * sqrt(1.0 - kept * kept))
        self._value = kept * self._value + drawn
        return self._value


class Noise:
    """Noise of all joints, by kind, with the state of each random walk."""

    __slots__ = (
        '_drifts', '_effort_white', '_last', '_rate_white', '_walk', '_wandered', '_white',
    )  # fmt: skip

    def __init__(
        self,
        white: tuple[_Source, ...],
        walk: tuple[_Source, ...],
        rate_white: tuple[_Source, ...],
        effort_white: tuple[_Source, ...] = (),
        drifts: tuple[_Drift, ...] = (),
    ) -> None:
        self._white = white
        self._walk = walk
        self._rate_white = rate_white
        self._effort_white = effort_white
        self._drifts = drifts
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
        for drift in self._drifts:
            noisy[drift.joint] += drift.drift_at(now)
        if self._effort_white:
            efforts = list(reading.efforts)
            for i, deviation, normal in self._effort_white:
                drawn = normal(0.0, deviation)
                if efforts:
                    efforts[i] += drawn
            reading = reading._replace(efforts=tuple(efforts))
        if self._rate_white:
            speeds = list(rates)
            for i, deviation, normal in self._rate_white:
                drawn = normal(0.0, deviation)
                if speeds:
                    speeds[i] += drawn
            rates = tuple(speeds)
        return reading._replace(joints=tuple(noisy), rates=rates)
