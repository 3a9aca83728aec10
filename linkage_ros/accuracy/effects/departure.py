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
How far what a scene publishes is from the truth.

The truth is the scene without its effects: the linkage as it is drawn, at the crank as its drive
has it at the time of the tick. Both run over the same times and the same crank messages. What is
delayed is compared by the time of the tick, not by its stamp: this is what a consumer meets.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import remainder, sqrt, tau
from typing import NamedTuple

from linkage_ros.effects.stage import Reading
from linkage_ros.pipeline import Pipeline


class Departure(NamedTuple):
    """
    How far what is published is from the truth.

    Attributes
    ----------
    angles, slides, rates
        Root of the mean square and greatest, in [rad], in [m], in [rad/s] or [m/s]; nothing where
        none is published.
    silent
        The part of the ticks at which the truth is known and nothing is published.

    """

    angles: tuple[float, float] | None
    slides: tuple[float, float] | None
    rates: tuple[float, float] | None
    silent: float


class _Errors:
    """Adds up errors."""

    def __init__(self) -> None:
        self._count, self._squares, self._worst = 0, 0.0, 0.0

    def add(self, error: float) -> None:
        self._count += 1
        self._squares += error * error
        self._worst = max(self._worst, abs(error))

    def both(self) -> tuple[float, float] | None:
        return (sqrt(self._squares / self._count), self._worst) if self._count else None


def departure(true: Pipeline, real: Pipeline, fed: Iterable[tuple[int, bytes]]) -> Departure:
    """
    Return how far what one pipeline publishes is from what another does.

    Parameters
    ----------
    true
        What knows the truth, rates too.
    real
        What is judged.
    fed
        Times, in [ns], each with its crank message; b'' where nobody listens.

    """
    angles, slides, rates = _Errors(), _Errors(), _Errors()
    known = silent = 0
    for now, message in fed:
        if message:
            true.offer(message, now)
            real.offer(message, now)
        looks = zip(true.closures, true.tick(now).looks, real.tick(now).looks, strict=True)
        for closure, (*_, truth), (*_, reading) in looks:
            if truth is None:
                continue
            known += 1
            silent += reading is None
            if reading is not None:
                _compare(closure.turning, truth, reading, (angles, slides, rates))
    return Departure(angles.both(), slides.both(), rates.both(), silent / known if known else 0.0)


def _compare(
    turning: Sequence[bool],
    truth: Reading,
    reading: Reading,
    errors: tuple[_Errors, _Errors, _Errors],
) -> None:
    angles, slides, rates = errors
    for turns, there, found in zip(turning, truth.joints, reading.joints, strict=True):
        if turns:
            angles.add(remainder(found - there, tau))
        else:
            slides.add(found - there)
    if truth.rates and reading.rates:
        for there, found in zip(truth.rates, reading.rates, strict=True):
            rates.add(found - there)
