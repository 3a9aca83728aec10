# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What `make test` takes of the tests; `make test_all` sets LINKAGE_TEST_ALL and takes all of them.

A test whose cases are many of a kind says so by a mark, `sample(COUNT)`: so many are taken, such
that they have as many values of its parameters, and pairs of values, as so many can have; none of
a test with `sample(0)`. A test that draws its cases itself asks `sample_count`. Hypothesis follows
`EXAMPLES`. Who names a test by its name gets all its cases.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
import os

TAKES_ALL = bool(os.environ.get('LINKAGE_TEST_ALL'))

EXAMPLES = 200 if TAKES_ALL else 30
"""Examples of a property that does not set their number."""

_GOLDEN = 0.5 * (5**0.5 - 1.0)


def sample_count(of_all: int, sample: int) -> int:
    """Return how many cases a test draws."""
    return of_all if TAKES_ALL else sample


def choose_covering(cases: Sequence[Mapping[str, int]], count: int) -> set[int]:
    """Return indices of cases that cover most values and pairs; a case has one value an axis."""
    seen: set[object] = set()
    chosen: set[int] = set()
    # In this order, any first few lie spread over the whole.
    waiting = sorted(range(len(cases)), key=lambda index: index * _GOLDEN % 1.0)
    while waiting and len(chosen) < count:
        best = max(waiting, key=lambda index: len({*_covered(cases[index])} - seen))
        waiting.remove(best)
        chosen.add(best)
        seen.update(_covered(cases[best]))
    return chosen


def _covered(case: Mapping[str, int]) -> Iterable[object]:
    yield from case.items()
    yield from combinations(sorted(case.items()), 2)
