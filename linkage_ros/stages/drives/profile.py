# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Drive a crank along a table of times and values.

Between two rows the value is a polynomial of x, the elapsed fraction of the time between them:

- ``linear``: a straight line. The rate jumps at each row, and the acceleration is 0.
- ``cubic``: the cubic spline through all rows, with a continuous acceleration (de Boor, "A
  Practical Guide to Splines", 1978, chapter IV). It is at rest in the first row and in the last;
  with ``repeat`` it is periodic instead, and runs through them as through the others.
- ``minimum_jerk``: at rest in every row, and from row to row by 10x³ − 15x⁴ + 6x⁵, the motion of
  least jerk (Flash and Hogan, J. Neurosci. 5 (1985) 1688). Two rows of equal value are a dwell.

Before the first row and after the last the input rests. With ``repeat`` the last row is also the
first row of the next pass, and the difference between last and first value is added at each pass:
a table from 0 to 2π turns continuously, and one that returns to its start repeats exactly.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import copysign, inf, sqrt

from linkage_ros.description import choice, each_part, flag, number_rows
from linkage_ros.errors import DefinitionError
from linkage_ros.messages import NANOSECONDS
from linkage_ros.stages.drives.clocked import ClockedDrive, Curve, InputMotion
from linkage_ros.stages.drives.drive import LARGEST

_Polynomial = tuple[float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Profile(InputMotion):
    """A table of one input."""

    table: tuple[tuple[float, float], ...] = number_rows(
        'times, counted from the first tick, and values',
        ('time [s]', 'value [rad or m]'),
        most=LARGEST,
    )
    interpolation: str = choice(
        'interpolation between the rows', ('linear', 'cubic', 'minimum_jerk'), 'cubic'
    )
    repeat: bool = flag('continue with the first row after the last; else rest there', False)

    def value_range(self) -> tuple[float, float]:
        """Return the least and the greatest value of an input, in [rad] or [m]."""
        values = [value for _, value in self.table]
        gain = values[-1] - values[0] if self.repeat else 0.0
        extremes = list(values)
        if self.interpolation == 'cubic':  # the others stay between their rows
            times = [time for time, _ in self.table]
            seconds = [after - before for before, after in pairwise(times)]
            for value, (c1, c2, c3, _, _) in zip(
                values, _row_polynomials(self, seconds), strict=False
            ):
                extremes += [value + x * (c1 + x * (c2 + x * c3)) for x in _turns_at(c1, c2, c3)]
        return (-inf if gain < 0.0 else min(extremes)), (inf if gain > 0.0 else max(extremes))

    def motion_curve(self, where: str = 'drive.profile') -> Curve:
        """
        Return value, rate and acceleration as a function of time, in [ns].

        Raise `DefinitionError` if the table has less than two rows, or times that do not increase.
        """
        times = _table_times(self.table, f'{where}.table')
        values = [value for _, value in self.table]
        begin, length = times[0], times[-1] - times[0]
        starts = [time - begin for time in times[:-1]]
        seconds = [(after - before) / NANOSECONDS for before, after in pairwise(times)]
        polynomials = _row_polynomials(self, seconds)
        durations = [after - before for before, after in pairwise(times)]
        pieces = list(zip(starts, durations, values, seconds, polynomials, strict=False))
        before, after = (values[0], 0.0, 0.0), (values[-1], 0.0, 0.0)
        gain = values[-1] - values[0] if self.repeat else None

        def profile(time: int) -> tuple[float, float, float]:
            time -= begin
            gained = 0.0
            if time < 0:
                return before
            if time >= length:
                if gain is None:
                    return after
                rounds, time = divmod(time, length)
                gained = rounds * gain
            piece = pieces[bisect_right(starts, time) - 1]
            start, duration, value, h, (c1, c2, c3, c4, c5) = piece
            x = (time - start) / duration
            return (
                value + gained + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5)))),
                (c1 + x * (2 * c2 + x * (3 * c3 + x * (4 * c4 + x * 5 * c5)))) / h,
                (2 * c2 + x * (6 * c3 + x * (12 * c4 + x * 20 * c5))) / (h * h),
            )

        return profile


@dataclass(frozen=True, slots=True)
class ProfileDrive(Profile, ClockedDrive):
    """A table of times and values that the inputs follow, from the first tick on."""

    KEY = 'drive.profile'
    inputs: Mapping[str, Profile] = each_part('inputs with a different table', 'input', Profile)


def _turns_at(c1: float, c2: float, c3: float) -> list[float]:
    """Return the places between 0 and 1 where the slope c₁ + 2c₂x + 3c₃x² is 0."""
    root = c2 * c2 - 3.0 * c1 * c3
    if root < 0.0:
        return []
    # Of the two forms of a root, use the one without cancellation (Press et al., section 5.6).
    q = -(c2 + copysign(sqrt(root), c2))
    roots = [q / (3.0 * c3)] if c3 else []
    roots += [c1 / q] if q else []
    return [x for x in roots if 0.0 < x < 1.0]


def _row_polynomials(parameters: Profile, seconds: Sequence[float]) -> list[_Polynomial]:
    """Return the polynomial from each row to the next, without its constant term."""
    steps = [after - before for (_, before), (_, after) in pairwise(parameters.table)]
    if parameters.interpolation == 'linear':
        return [(step, 0.0, 0.0, 0.0, 0.0) for step in steps]
    if parameters.interpolation == 'cubic':
        return _cubic_spline(seconds, steps, periodic=parameters.repeat)
    return [(0.0, 0.0, 10 * step, -15 * step, 6 * step) for step in steps]


def _table_times(table: Sequence[tuple[float, float]], where: str) -> list[int]:
    """Return the times of a table, in [ns]."""
    if len(table) < 2:
        raise DefinitionError(where, 'has one row', 'write two or more rows [time, value]')
    first = table[0][0]
    if first < 0.0:
        raise DefinitionError(
            where, f'row 1 is at {first!r} s, before the first tick', 'begin at 0 or later'
        )
    times = [round(time * NANOSECONDS) for time, _ in table]
    for number, (before, after) in enumerate(pairwise(times), 2):
        if after <= before:
            raise DefinitionError(
                where,
                f'row {number} is at {table[number - 1][0]!r} s, not after row {number - 1} '
                f'at {table[number - 2][0]!r} s',
                'write times that increase, by 1 ns at least',
            )
    return times


def _cubic_spline(
    seconds: Sequence[float], steps: Sequence[float], *, periodic: bool
) -> list[_Polynomial]:
    """Return the coefficients of the spline from its slopes at the rows."""
    chords = [step / h for step, h in zip(steps, seconds, strict=True)]
    slopes = _spline_slopes(seconds, chords, 0.0)
    if periodic:
        # Linear in the slope at the seam, chosen to make the acceleration continuous there.
        unit = _spline_slopes(seconds, [0.0] * len(chords), 1.0)
        h0, h1 = seconds[0], seconds[-1]
        seam = (3.0 * (h0 * chords[-1] + h1 * chords[0]) - h0 * slopes[-2] - h1 * slopes[1]) / (
            2.0 * (h0 + h1) + h0 * unit[-2] + h1 * unit[1]
        )
        slopes = [
            slope + seam * correction for slope, correction in zip(slopes, unit, strict=True)
        ]
    return [
        (h * m0, 3.0 * step - h * (2.0 * m0 + m1), h * (m0 + m1) - 2.0 * step, 0.0, 0.0)
        for h, step, (m0, m1) in zip(seconds, steps, pairwise(slopes), strict=True)
    ]


def _spline_slopes(seconds: Sequence[float], chords: Sequence[float], ends: float) -> list[float]:
    """
    Return the slopes at the rows from those at both ends, in [rad/s] or [m/s].

    At each inner row, h₀ and h₁ are the times before and after it, d₀ and d₁ the slopes of the
    chords. The acceleration is continuous if h₁·m₋ + 2(h₀ + h₁)·m + h₀·m₊ = 3(h₁·d₀ + h₀·d₁).
    """
    slopes = [ends]
    upper = [0.0]
    for (h0, h1), (d0, d1) in zip(pairwise(seconds), pairwise(chords), strict=True):
        pivot = 2.0 * (h0 + h1) - h1 * upper[-1]
        slopes.append((3.0 * (h1 * d0 + h0 * d1) - h1 * slopes[-1]) / pivot)
        upper.append(h0 / pivot)
    slopes.append(ends)
    for i in range(len(slopes) - 2, 0, -1):
        slopes[i] -= upper[i] * slopes[i + 1]
    return slopes
