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
A motion of a torque-driven linkage whose end is known, and what each method of steps makes of it.

The linkage moves under its weight and its springs alone: what acts besides has no solution that
one could compare with. Where its input turns round, it begins with enough rate to go on turning;
else it is let go where it swings and stays off its stops.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from math import inf, sqrt, tau
from time import perf_counter
from typing import NamedTuple

from linkage_ros.accuracy.dynamics.energy_integral import (
    ExactEnergy,
    NoReferenceError,
    State,
    swung,
    turned,
)
from linkage_ros.dynamics.integrators.method import METHODS
from linkage_ros.dynamics.loads import Loads
from linkage_ros.dynamics.mechanics import Mechanics
from linkage_ros.dynamics.motion import Motion, OneFreedom
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.ranges import InputRange
from linkage_ros.scene.scene import Member

SECONDS = 10.0

_LOOKS = 100
"""How often the energy is looked at."""


class FreeMotion(NamedTuple):
    """
    A motion without friction, damping and command.

    Attributes
    ----------
    mechanics
        The linkage and what acts on it.
    start
        Where it begins.
    end
        Where it is after `SECONDS`.
    scale
        What its energy goes up and down by, in [J]: a drift is told in parts of it.
    unit
        Of the input: 'rad' or 'm'.
    words
        What it does.

    """

    mechanics: Mechanics
    start: State
    end: State
    scale: float
    unit: str
    words: str


class Integrated(NamedTuple):
    """
    What a method comes to with a step.

    Attributes
    ----------
    method, step
        The method's name, and its step in [s].
    error
        Of the input after `SECONDS`, in [rad] or [m].
    drift
        The greatest that the energy was off by, of the motion's scale.
    times
        Processor time for a second of motion, in [s], round by round.

    """

    method: str
    step: float
    error: float
    drift: float
    times: Sequence[float]


def free_motion(member: Member) -> FreeMotion:
    """
    Return a free motion of a linkage and where it leads to.

    Raises
    ------
    NoReferenceError
        Where it has none that stays off its stops, or no reference for it.

    """
    given = member.loads or Loads()
    loads = replace(given, springs=tuple(replace(s, damping=0.0) for s in given.springs))
    closure = Closure(member.linkage)
    mechanics = Mechanics(closure, loads)
    energy = ExactEnergy(member.linkage, loads)
    unit = 'm' if member.linkage.inputs[0].slider else 'rad'
    start: float = member.drive[1].start
    interval = next((each for each in closure.input_ranges if _holds(each, start)), None)
    if interval is not None and interval.whole:
        places = [start + tau * k / 360 for k in range(360)]
        heights = [_potential(mechanics, place) for place in places]
        climb = max(heights) - heights[0]
        inertia = _inertia(mechanics, start)
        # Three times the climb over the highest place, and a turn a second at least.
        rate = max(sqrt(2.0 * 4.0 * climb / inertia), tau)
        begin = State(start, rate)
        scale = 0.5 * inertia * rate * rate + heights[0] - min(heights)
        words = f'its crank turns round, at {rate:.3g} rad/s where it begins'
        return FreeMotion(mechanics, begin, turned(energy, begin, SECONDS), scale, unit, words)
    if interval is None:
        raise NoReferenceError('no loop closes where the drive starts')
    low, high, scale = _swing(mechanics, interval)
    words = f'its input is let go at {low:.4g} {unit} and swings to {high:.4g} {unit}'
    end = swung(energy, low, high, SECONDS)
    return FreeMotion(mechanics, State(low, 0.0), end, scale, unit, words)


def integrate(motion: FreeMotion, method: str, step: float) -> Integrated:
    """Integrate a motion once, and time it without the looks at its energy."""
    mechanics = motion.mechanics
    freedom = OneFreedom(mechanics.equation, import_module(METHODS[method]).step)
    at = freedom.at(*motion.start)
    assert at is not None, 'the reference has moved it'
    whole = _energy(mechanics, at)
    count = round(SECONDS / step)
    looks = {count * k // _LOOKS for k in range(1, _LOOKS + 1)}
    spent = worst = 0.0
    done = 0
    for end in sorted(looks):
        begun = perf_counter()
        for _ in range(end - done):
            at = freedom.advance(at, step, 0.0)
        spent += perf_counter() - begun
        done = end
        worst = max(worst, abs(_energy(mechanics, at) - whole))
    return Integrated(
        method, step, abs(at.value - motion.end.value), worst / motion.scale, [spent / SECONDS]
    )


def _energy(mechanics: Mechanics, at: Motion) -> float:
    return mechanics.energy(mechanics.closure.position(at.value), at.rate)


def _potential(mechanics: Mechanics, value: float) -> float:
    return mechanics.potential(mechanics.closure.position(value))


def _inertia(mechanics: Mechanics, value: float) -> float:
    terms = mechanics.terms(mechanics.closure.position(value))
    if terms is None:
        raise NoReferenceError('nothing can be moved where the drive starts')
    return terms.inertia


def _holds(interval: InputRange, value: float) -> bool:
    if interval.whole:
        return True
    value += interval.shift(value)
    return interval.lowest <= value <= interval.highest


def _swing(mechanics: Mechanics, interval: InputRange) -> tuple[float, float, float]:
    """Return two places as high between which it is lower, and by how much, in [J]."""
    width = interval.highest - interval.lowest
    places = [interval.lowest + width * k / 1000 for k in range(50, 951)]
    heights = [_potential(mechanics, place) for place in places]
    bottom = min(range(len(heights)), key=heights.__getitem__)
    after = bottom + 1
    sides = max(heights[:bottom], default=-inf), max(heights[after:], default=-inf)
    height = heights[bottom] + 0.5 * (min(sides) - heights[bottom])
    if not height > heights[bottom]:
        raise NoReferenceError('under its weight and springs it falls against a stop')
    low = max(k for k in range(bottom) if heights[k] >= height)
    high = min(k for k in range(after, len(heights)) if heights[k] >= heights[low])
    return places[low], places[high], heights[low] - heights[bottom]
