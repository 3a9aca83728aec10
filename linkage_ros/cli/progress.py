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


"""How far something long has come: a bar by rich on a terminal, a line now and then elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
import sys
from time import monotonic

Told = Callable[[int, int], None]
"""Takes how much is done, and of how much."""

_EVERY = 5.0
"""Seconds between two lines."""


@contextmanager
def progress(what: str) -> Iterator[Told]:
    """Give a function to tell progress to; what is told goes to standard error."""
    if sys.stderr.isatty() and find_spec('rich') is not None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            TextColumn,
            TimeRemainingColumn,
        )

        columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with Progress(*columns, console=Console(file=sys.__stderr__), transient=True) as bars:
            task = bars.add_task(what, total=None)
            yield lambda done, of: bars.update(task, completed=done, total=of)
        return
    told = monotonic()

    def line(done: int, of: int) -> None:
        nonlocal told
        if monotonic() - told >= _EVERY:
            told = monotonic()
            print(f'{what}: {done} of {of}', file=sys.stderr, flush=True)

    yield line
