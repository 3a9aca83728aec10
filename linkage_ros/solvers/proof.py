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
How many knots a table needs, so that a tolerance is met at every input: a proof.

What a polynomial between knots is off by follows from a bound of the second or fourth derivative
over the range (see `table`). `cells` gives that bound: the range is cut into cells, each as small
as it takes to enclose the loops' solution and its derivatives over all of it. At the ends of the
cells, and at the knots, the closed form's values are enclosed likewise: so the solutions of
neighbouring cells are one, the closed form is on it and on no other assembly, and what its values
and slopes are off by is known and counted. The proof rests on IEEE 754 arithmetic, on sines of
numpy's that are good to 4 units in the last place, and on nothing that was sampled.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.solvers.range_proof import MOST_KNOTS, RangeProof
from linkage_ros.solvers.task import refusal, refuse_trouble, Task


class Proven(NamedTuple):
    """
    What is proven.

    Attributes
    ----------
    knots
        How many cells there are to each range.
    position
        What positions are off by at most, in [rad] or [m].
    rate
        And their derivatives by the input.

    """

    knots: int
    position: float
    rate: float


def knots_for(task: Task, ranges: Sequence[tuple[float, float]]) -> Proven:
    """
    Return how many cells each range of the input needs, and what is proven of the error then.

    Parameters
    ----------
    task
        What is to be proven.
    ranges
        Of the input, in [rad] or [m].

    Raises
    ------
    DefinitionError
        Where a toggle or a change point is in the way, or it takes more than `MOST_KNOTS`.

    """
    refuse_trouble(task, ranges)
    found = [RangeProof(task, low, high) for low, high in ranges]
    knots = max(one.knots() for one in found)
    while True:
        if knots > MOST_KNOTS:
            raise refusal(task, f'takes more than {MOST_KNOTS} knots', 'ask for less')
        position, rate = map(max, zip(*(one.errors(knots) for one in found), strict=True))
        if position <= task.tolerance:
            return Proven(knots, position, rate)
        if position > 2.0 * task.tolerance:
            least = f'{position:.1g}'
            raise refusal(task, f'is finer than rounding allows here, {least}', 'ask for less')
        knots *= 2
