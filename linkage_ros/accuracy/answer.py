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
The answer for a wanted accuracy: what to write, what a tick costs, which tick rate uses it.

The answer changes at the accuracies of the solvers and of the tick rates only. So all of them are
a short list, from which the page and the terminal take theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.accuracy.results import Choice, Rate, Results


class Reply(NamedTuple):
    """The answer for the wanted accuracies from one value up to that of the next answer."""

    accuracy: float  # The smallest wanted accuracy that it holds for, in [rad]
    write: str  # Text to write into the scene
    tick: str  # Time of a tick with it
    rate: str  # The tick rates at which a subscriber notices this accuracy


def replies(results: Results) -> list[Reply]:
    """Return the answers, that for the smallest accuracy first; none if nothing was solved."""
    choices = [choice for part in results.parts for choice in part.choices]
    rates = [rate for part in results.parts for rate in part.rates]
    if not choices:
        return []
    changes = sorted(
        {0.0, *(choice.accuracy for choice in choices), *(rate.error for rate in rates)}
    )
    answers: list[Reply] = []
    for wanted in changes:
        answer = Reply(wanted, *_solver(choices, wanted), _rate(rates, wanted))
        if not answers or answer[1:] != answers[-1][1:]:
            answers.append(answer)
    return answers


def reply(answers: Sequence[Reply], wanted: float) -> Reply:
    """Return the answer for a wanted accuracy, in [rad]."""
    return [answer for answer in answers if answer.accuracy <= wanted][-1]


def _solver(choices: Sequence[Choice], wanted: float) -> tuple[str, str]:
    able = [choice for choice in choices if choice.accuracy <= wanted]
    if not able:
        best = min(choice.accuracy for choice in choices)
        return f'none reaches it: the most exact is {best:.1g} rad off', '-'
    fastest = min(able, key=lambda choice: choice.tick.middle)
    # Within each other's spread the default wins, which is the last, else the least exact.
    near = [choice for choice in able if choice.tick.low <= fastest.tick.high]
    chosen = choices[-1] if choices[-1] in near else near[0]
    time = f'{chosen.tick.middle:.2g} µs ({chosen.solving.middle:.2g} µs to solve)'
    return chosen.write, time


def _rate(rates: Sequence[Rate], wanted: float) -> str:
    if not rates:
        return 'the rate of ticks was not measured'
    enough = {
        use: min(rate.rate for rate in rates if rate.use == use and rate.error <= wanted)
        for use in ('carried forward', 'held')
        if any(rate.use == use and rate.error <= wanted for rate in rates)
    }
    if enough:
        return ', '.join(f'{rate:g} Hz {use}' for use, rate in enough.items())
    best = min(rates, key=lambda rate: rate.error)
    return f'none: at {best.rate:g} Hz a state is {best.error:.1g} rad off when used'
