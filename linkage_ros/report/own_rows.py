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


"""The messages of a block by what they are to a run of a scene, with the time of the run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from linkage_ros.report.arrays import Times
from linkage_ros.report.blocks import Entry
from linkage_ros.report.clock import RunClock, times_of
import numpy as np

KINDS = ('samples', 'faults', 'withheld', 'resets', 'states', 'health')
_BESIDE = 'health'
"""What is not recorded by the hand of the ticks; the clock of the run does not go by it."""


class Rows(NamedTuple):
    """
    Messages of a kind in a block.

    Attributes
    ----------
    numbers
        Theirs, in the block.
    logged, published, passed
        Their times, in [ns], and that of the run.
    data
        Their bytes.

    """

    numbers: Times
    logged: Times
    published: Times
    passed: Times
    data: Sequence[bytes]


def rows_of(
    block: Mapping[str, list[Entry]],
    topics: Mapping[str, str],
    own: Callable[[bytes], bool] | None,
    clock: RunClock,
) -> dict[str, Rows]:
    """
    Return the messages of a block by kind.

    Parameters
    ----------
    block
        The messages of each topic.
    topics
        The kind of each; others are left out.
    own
        Tells the run's own joint states from the samples, where these share their topic.
    clock
        The run's.

    """
    kinds: dict[str, list[Entry]] = {kind: [] for kind in KINDS}
    for topic, entries in block.items():
        kind = topics.get(topic)
        if kind == 'states' and own is not None:
            for entry in entries:
                kinds['states' if own(entry[3]) else 'samples'].append(entry)
        elif kind is not None:
            kinds[kind] = entries
    numbers = np.array([entry[0] for found in kinds.values() for entry in found], np.int64)
    logged = times_of([entry[1] for found in kinds.values() for entry in found])
    if len(numbers):
        clock.start(int(logged[numbers.argmin()]))
    in_turn = len(numbers) - len(kinds[_BESIDE])
    order = np.argsort(numbers[:in_turn])
    passed = np.empty_like(logged)
    passed[order] = clock.passed(logged[order])
    behind = np.searchsorted(numbers[order], numbers[in_turn:])
    passed[in_turn:] = clock.beside(logged[in_turn:], behind)
    rows, at = {}, 0
    for kind, entries in kinds.items():
        part = slice(at, at + len(entries))
        at += len(entries)
        published = times_of([entry[2] for entry in entries])
        data = [entry[3] for entry in entries]
        rows[kind] = Rows(numbers[part], logged[part], published, passed[part], data)
    return rows
