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


"""The points that a linkage shall pass."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import degrees, inf, isfinite, tau

from linkage_ros.errors import SynthesisError


@dataclass(frozen=True, slots=True)
class PathTask:
    """
    Points to pass, in their order.

    Attributes
    ----------
    points
        Places in the ground's frame, in [m]; three at least.
    closed
        Whether the path returns to its first point; the crank turns fully then.
    timing
        Crank angles at the points, in [rad], all up or all down and within a turn; None where
        the crank may be anywhere.
    zero_free
        Whether only the differences of these angles count. Else they are those of the crank's
        pin itself, from the x axis.
    full_turn
        Whether the crank shall turn fully also where the path is open.
    links
        How short and how long links may be, and how far the traced point may be from the crank's
        pin along x and y of the coupler, as multiples of the path's size.

    Raises
    ------
    SynthesisError
        Where no path is described.

    """

    points: tuple[complex, ...]
    closed: bool = False
    timing: tuple[float, ...] | None = None
    zero_free: bool = True
    full_turn: bool = False
    links: tuple[float, float] = (0.2, 4.0)

    def __post_init__(self) -> None:
        _check_points(self.points, self.closed)
        if self.timing is not None:
            _check_timing(self.timing, len(self.points), self.closed)
        shortest, longest = self.links
        if not 0.0 < shortest < longest < inf:
            raise SynthesisError(
                'links', f'from {shortest:g} to {longest:g} of the path', 'say e.g. 0.2 to 4'
            )

    @property
    def size(self) -> float:
        """Return the diagonal of the box about the points, in [m]."""
        return _size(self.points)


def _check_points(points: tuple[complex, ...], closed: bool) -> None:
    if len(points) < 3:
        raise SynthesisError('path', f'{len(points)} points', 'give three at least')
    for number, point in enumerate(points, 1):
        if not (isfinite(point.real) and isfinite(point.imag)):
            raise SynthesisError(
                f'point {number}', f'({point.real:g}, {point.imag:g}) is no place', 'correct it'
            )
    for number, (point, after) in enumerate(pairwise(points), 1):
        if point == after:
            raise SynthesisError(
                f'points {number} and {number + 1}',
                f'both at ({point.real:g}, {point.imag:g})',
                'leave one out',
            )
    if closed and points[0] == points[-1]:
        raise SynthesisError(
            f'point {len(points)}',
            'is the first one again',
            'leave it out: a closed path returns by itself',
        )
    if not isfinite(_size(points)):
        raise SynthesisError('path', 'its size is beyond a double', 'use another unit')


def _check_timing(timing: tuple[float, ...], points: int, closed: bool) -> None:
    if len(timing) != points:
        raise SynthesisError(
            'timing', f'{len(timing)} crank angles for {points} points', 'give one for each'
        )
    steps = [after - before for before, after in pairwise(timing)]
    if not (all(step > 0.0 for step in steps) or all(step < 0.0 for step in steps)):
        raise SynthesisError(
            'timing',
            'the crank angles go neither up nor down all the way',
            'write on beyond 360 or below 0 degrees where they wrap',
        )
    travel = abs(timing[-1] - timing[0])
    # A few roundings of degrees are no more than a turn.
    if not travel < tau * (1.0 + 1e-12) or (closed and travel > tau * (1.0 - 1e-12)):
        raise SynthesisError(
            'timing',
            f'the crank travels {degrees(travel):g} degrees',
            'the points must be within one turn'
            + (', the last before the first again' if closed else ''),
        )


def _size(points: tuple[complex, ...]) -> float:
    x, y = [point.real for point in points], [point.imag for point in points]
    return abs(complex(max(x) - min(x), max(y) - min(y)))
