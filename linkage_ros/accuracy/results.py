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
The results of measurements as data: parts, diagrams and tables.

The modules that measure and those that present share only these types.

The answer for a wanted accuracy (what to write, what a tick costs, which tick rate uses it)
changes at the accuracies of the solvers and of the tick rates only. So all answers are a short
list, from which the page and the terminal take theirs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple, TypeVar

from linkage_ros.measuring import Spread

Result = TypeVar('Result')

Cell = float | int | str | Spread | None
"""What a table holds; None is an empty cell."""


class Axis(NamedTuple):
    """An axis of a diagram."""

    name: str  # The quantity, for example 'error'
    unit: str  # Its unit, for example 'rad'; '' for a number
    logarithmic: bool = True  # Whether the axis is logarithmic
    # For a logarithmic axis, the smallest value drawn at its own position; 0 for any.
    least: float = 0.0

    @property
    def title(self) -> str:
        """Return the name with the unit."""
        return f'{self.name} [{self.unit}]' if self.unit else self.name


class Point(NamedTuple):
    """A point of a curve."""

    # Coordinates: medians.
    x: float
    y: float
    # The quartiles, if it was measured several times.
    x_spread: Spread | None = None
    y_spread: Spread | None = None
    setting: str = ''  # The setting of the method: 'tolerance 1e-6', '256 knots'
    # Whether the method has no answer for some states; such a point is on no front.
    fails: bool = False


class Curve(NamedTuple):
    """The results of a method, in the order of its settings, and whether a line joins them."""

    name: str
    points: Sequence[Point]
    joined: bool = True


class Diagram(NamedTuple):
    """A diagram with one message."""

    key: str  # File name without suffix
    title: str  # The message, in a sentence
    # Its axes.
    x: Axis
    y: Axis
    # The curves; the same name has the same colour and mark in all diagrams.
    curves: Sequence[Curve]
    # Whether less is better on both axes: the front of best points is drawn, all others pale.
    front: bool = False


class Table(NamedTuple):
    """
    A table; each column's name has its unit: 'time [µs]'.

    The ``key`` is its file name without suffix. A cell of None is empty.
    """

    key: str
    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]

    @classmethod
    def of(
        cls,
        key: str,
        title: str,
        results: Iterable[Result],
        columns: Mapping[str, Callable[[Result], Cell]],
    ) -> Table:
        """Return the table with a row for each result, from the value of each column."""
        rows = [tuple(value(result) for value in columns.values()) for result in results]
        return cls(key, title, tuple(columns), rows)


class Choice(NamedTuple):
    """A solver that a scene can choose, and its cost."""

    # Its greatest error at easy poses, in [rad]; slides relative to the linkage's size.
    accuracy: float
    write: str  # Text to write into the scene
    solving: Spread  # Time of a position, in [µs]
    tick: Spread  # Time of a tick of the scene with it, in [µs]


class Rate(NamedTuple):
    """A tick rate, and the error of a state when a subscriber uses it."""

    rate: float  # Tick rate, in [Hz]
    error: float  # Root mean square, in [rad]; the greatest of all motions of the crank
    use: str  # How the state is used: 'held', or 'carried forward' by its rates


class Part(NamedTuple):
    """A part of the page."""

    key: str  # 'solving', 'ticking', 'effects', 'dynamics' or 'recording'
    title: str  # Its subject
    headline: str  # Its result, in a sentence of at most some 80 characters
    # Up to three sentences beside its picture; no text of a part has markup.
    sentences: Sequence[str] = ()
    method: Sequence[str] = ()  # The method of measurement, in paragraphs
    diagrams: Sequence[Diagram] = ()  # The picture of the part, and more pictures
    tables: Sequence[Table] = ()  # The numbers
    # The cheapest method for some accuracies, a sentence each, derived from the data.
    advice: Sequence[str] = ()
    clause: str = ''  # Its clause of the headline of the page; '' if it has none
    # Solvers to choose from, the least exact first, the default last; the part on solving has
    # them.
    choices: Sequence[Choice] = ()
    rates: Sequence[Rate] = ()  # Tick rates to choose from; the part on the rate of ticks has them


class Results(NamedTuple):
    """All measurements of a scene."""

    scene: str  # Its name
    machine: Sequence[tuple[str, str]]  # Day, machine and versions: names and values
    parts: Sequence[Part]  # The parts in order; a scene without torque has no part on dynamics

    @property
    def headline(self) -> str:
        """Return the result for the scene in a sentence."""
        clauses = '; '.join(part.clause for part in self.parts if part.clause)
        return f'{self.scene}: {clauses or "measured"}.'


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
