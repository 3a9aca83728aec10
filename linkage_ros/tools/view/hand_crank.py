# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A crank that a hand turns: sparse, jumping angles in, a smooth angle with its rate out.

The angle follows the hand as a critically damped second-order filter follows its target::

    x'' = ω²·(target − x) − 2·ω·x'

Its exact solution over a step is used, so the rate is the derivative of the angle at any step, and
the crank comes to rest at the target without passing it. It lags behind a steady hand by 2/ω.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, remainder, tau

_QUICKNESS = 40.0
"""Natural frequency ω of the filter, in [rad/s]: it lags by 50 ms."""

HELD = 1.0
"""Time after the last message of a hand when the crank is released, in [s]."""


class HandCrank:
    """
    The inputs of a linkage, as hands on pages turn them.

    ``whole_turns`` marks inputs that turn without bounds: their angles continue across whole
    turns, on the shorter way.
    """

    def __init__(self, whole_turns: Sequence[bool]) -> None:
        self._whole_turns = tuple(whole_turns)
        self._targets: list[float] = []
        self._values: list[float] = []
        self._rates: list[float] = []
        self._turned = self._time = 0.0

    def set_target(self, number: int, target: float, at: Sequence[float], now: float) -> None:
        """
        Turn an input to a target in [rad] or [m], at a time in [s].

        All inputs are ``at`` these values if no hand has held them.
        """
        if not self.is_held(now):
            self._targets, self._values = list(at), list(at)
            self._rates = [0.0] * len(at)
            self._time = now
        if self._whole_turns[number]:
            before = self._targets[number]
            target = before + remainder(target - before, tau)
        self._targets[number] = target
        self._turned = now

    def is_held(self, now: float) -> bool:
        """Return whether a hand has held an input within the last second."""
        return bool(self._targets) and now - self._turned <= HELD

    def advance_to(self, now: float) -> tuple[list[float], list[float]] | None:
        """Return values and rates of the inputs at a time, in [s]; None if no hand holds them."""
        if not self.is_held(now):
            self._targets = []
            return None
        step = max(0.0, now - self._time)
        self._time = now
        fading = exp(-_QUICKNESS * step)
        for i, target in enumerate(self._targets):
            off, rate = self._values[i] - target, self._rates[i]
            drift = rate + _QUICKNESS * off
            self._values[i] = target + (off + drift * step) * fading
            self._rates[i] = (rate - _QUICKNESS * drift * step) * fading
        return list(self._values), list(self._rates)
