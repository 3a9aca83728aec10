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


"""Measure several functions in turn, in one process, and set two of them side by side."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import time

from bench.report import say, Table
from bench.spread import ratios, spread


def in_turn(contenders: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    """Return for each how long it took, in [s], round by round."""
    found: dict[str, list[float]] = {name: [] for name in contenders}
    for run in contenders.values():
        run()
    for number in range(rounds):
        # There and back again, so that a drift of the machine favours no one.
        for name in found if number % 2 == 0 else reversed(found):
            begun = time.perf_counter()
            contenders[name]()
            found[name].append(time.perf_counter() - begun)
    say('  ' + ', '.join(f'{name} {min(times):.3g} s' for name, times in found.items()))
    return found


def compare(
    table: Table,
    what: str,
    first: str,
    second: str,
    found: Mapping[str, Sequence[float]],
    target: str,
) -> None:
    """Add a row to a table: the first over the second, of what was measured in turn."""
    table.rows.append(
        (
            f'{what}: {first} / {second}',
            spread(found[first], 2),
            spread(found[second], 2),
            spread(ratios(found[first], found[second]), 2),
            target,
        )
    )
