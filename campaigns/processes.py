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

"""The parts of a campaign, shared among processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import multiprocessing
from typing import TypeVar

Part = TypeVar('Part')
Result = TypeVar('Result')


def results_of(do: Callable[[Part], Result], work: Sequence[Part], jobs: int) -> Iterator[Result]:
    """Yield what all parts come to, as they are done; one job is this process."""
    if jobs == 1:
        yield from map(do, work)
        return
    # Spawned, not forked: whoever calls may have threads.
    with multiprocessing.get_context('spawn').Pool(jobs) as pool:
        yield from pool.imap_unordered(do, work)
