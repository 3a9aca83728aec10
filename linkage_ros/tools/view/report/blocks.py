# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The messages of a bag in blocks of some thousands, with the run time of each.

Run time begins at 0 and never goes back. When the recorder's clock jumps back, run time stands
still and then goes on from there. In a bag of another program, messages on several topics may be
slightly out of order; that is not a jump.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from linkage_ros.bag import Bag, BagMessage, Contents, RECORD_SIZE, Tallies
from linkage_ros.errors import BagError
from linkage_ros.tools.view.report.decimation import Times
import numpy as np

_LATEST = 2**62
"""Latest plausible log time, in [ns]; a later one is damage."""

_MOST_MESSAGES = 8192
_MOST_BYTES = 32 * 2**20
_FARTHEST = 4
"""Factor by which a block may grow to keep messages of one log time together."""

Entry = tuple[int, int, int, bytes]
"""Number of the message, log time, publish time, bytes; none for a topic that is only counted."""

KINDS = ('samples', 'faults', 'withheld', 'resets', 'states', 'forces', 'health')
_OTHER_RECORDER = 'health'
"""Topics recorded by another thread; run time does not follow them."""


def times_of(logged: Sequence[int]) -> Times:
    """Return log times as an array; they may be any 64-bit numbers."""
    return np.minimum(np.array(logged, np.uint64), np.uint64(_LATEST)).astype(np.int64)


class RunClock:
    """
    Converts log times to run time.

    A message may come too late by ``disorder``, in [ns], without a jump of the clock.
    """

    def __init__(self, disorder: int = 0) -> None:
        # Log time at which the run begins, in [ns]; None before the first message.
        self.begin: int | None = None
        self.end = 0  # Run time of the last message, from either thread, in [ns]
        self._disorder = disorder
        self._last = self._added = self._now = 0
        self._jumps: list[tuple[int, int]] = []
        # Log times and run times of the last block, and the last of the block before it.
        self._logged = self._times = np.zeros(1, np.int64)

    def start(self, logged: int) -> None:
        """Begin the run at a log time in [ns], unless it has begun."""
        if self.begin is None:
            self.begin = self._last = logged

    def run_times(self, logged: Times) -> Times:
        """Return the run times of consecutive messages from their log times, in [ns]."""
        before = self._last, self._now
        times = logged
        if len(logged):
            self.start(int(logged[0]))
            before = self._last, self._now
            back = -np.diff(logged, prepend=self._last)
            jumps = np.where(back > self._disorder, back, 0)
            added = self._added + np.cumsum(jumps)
            since = logged - (self.begin or 0) + added
            times = np.maximum.accumulate(np.maximum(since, self._now))
            self._jumps += [(int(times[i]), int(jumps[i])) for i in np.flatnonzero(jumps)]
            self._last, self._added, self._now = int(logged[-1]), int(added[-1]), int(times[-1])
            self.end = max(self.end, self._now)
        self._logged = np.concatenate([[before[0]], logged])
        self._times = np.concatenate([[before[1]], times])
        return times

    def other_thread_times(self, logged: Times, behind: Times) -> Times:
        """
        Return the run times of messages that another thread has recorded, in [ns].

        Their log times, in [ns], may deviate a little from the first thread's. ``behind`` is how
        many messages of the last call of `run_times` precede each.
        """
        since = np.maximum(logged - self._logged[behind], 0)
        next_ones = np.append(self._times[1:], _LATEST)
        times: Times = np.minimum(self._times[behind] + since, next_ones[behind])
        self.end = max(self.end, int(times.max(initial=0)))
        return times

    def pop_jumps(self) -> Iterator[tuple[int, int]]:
        """Yield time and size of the clock's jumps since the last call, in [ns]."""
        jumps, self._jumps = self._jumps, []
        yield from jumps


class Progress(NamedTuple):
    """Called now and then with the number of bytes read; returns whether to stop."""

    report: Callable[[int], None] = lambda _read: None
    stopped: Callable[[], bool] = lambda: False


class Blocks:
    """
    Reads a bag block by block, and counts.

    A block ends between two ticks: messages of one log time stay in one block, unless there are
    more than any tick has. Of a damaged bag the part before the damage is read. Messages of topics
    that are not ``wanted`` are only counted. ``progress`` receives the progress, and says whether
    to stop.
    """

    def __init__(self, bag: Bag, wanted: Collection[str], progress: Progress) -> None:
        self._bag, self._wanted, self._progress = bag, set(wanted), progress
        self._tallies = Tallies(bag)
        self._damage, self._stopped = '', False
        self._read = 0

    def __iter__(self) -> Iterator[Mapping[str, list[Entry]]]:
        """Yield the messages of each wanted topic, block by block."""
        wanted = self._wanted
        wanted_entries: dict[str, list[Entry]] = {}
        others: dict[str, list[tuple[int, int]]] = {}
        count = size = last = 0
        for topic, logged, published, data in self._whole_blocks(self._bag.messages()):
            filled = max(count / _MOST_MESSAGES, size / _MOST_BYTES)
            if filled >= (1 if logged != last else _FARTHEST):
                yield self._count_block(wanted_entries, others)
                wanted_entries, others, count, size = {}, {}, 0, 0
                if self._progress.stopped():
                    self._stopped = True
                    return
            last = logged
            if topic in wanted:
                if topic in wanted_entries:
                    wanted_entries[topic].append((count, logged, published, data))
                else:
                    wanted_entries[topic] = [(count, logged, published, data)]
                size += len(data)
            else:
                others.setdefault(topic, []).append((logged, len(data)))
            count += 1
        if wanted_entries or others:
            yield self._count_block(wanted_entries, others)

    def count_contents(self) -> Contents:
        """Return the counts of what has been read."""
        return self._tallies.to_contents(self._damage, self._stopped)

    def _whole_blocks(self, messages: Iterable[BagMessage]) -> Iterator[BagMessage]:
        try:
            yield from messages
        except BagError as error:
            self._damage = f'{error.where}: {error.reason}'

    def _count_block(
        self,
        entries_by_topic: Mapping[str, list[Entry]],
        others: Mapping[str, list[tuple[int, int]]],
    ) -> Mapping[str, list[Entry]]:
        """Count a block, report progress, and return the entries of wanted topics."""
        for name, entries in entries_by_topic.items():
            self._count_entries(name, [(logged, len(data)) for _, logged, _, data in entries])
        for name, sizes in others.items():
            self._count_entries(name, sizes)
        self._progress.report(self._read)
        return entries_by_topic

    def _count_entries(self, name: str, entries: list[tuple[int, int]]) -> None:
        logs, sizes = zip(*entries, strict=True)
        self._tallies[name].add_messages(len(entries), sum(sizes), min(logs), max(logs))
        self._read += sum(sizes) + RECORD_SIZE * len(entries)


class MessageRows(NamedTuple):
    """Messages of one kind in a block, by their numbers; all times are in [ns]."""

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
) -> dict[str, MessageRows]:
    """
    Return the messages of a block by kind.

    ``topics`` has the kind of each topic, one of `KINDS` or its own kind; other topics are left
    out. ``own`` distinguishes the run's joint states from the samples if they share a topic.
    """
    kinds: dict[str, list[Entry]] = {kind: [] for kind in (*topics.values(), *KINDS)}
    kinds[_OTHER_RECORDER] = kinds.pop(_OTHER_RECORDER)  # the last
    for topic, entries in block.items():
        kind = topics.get(topic)
        if kind == 'states' and own is not None:
            for entry in entries:
                kinds['states' if own(entry[3]) else 'samples'].append(entry)
        elif kind is not None:
            kinds[kind] += entries
    numbers = np.array([entry[0] for entries in kinds.values() for entry in entries], np.int64)
    logged = times_of([entry[1] for entries in kinds.values() for entry in entries])
    if len(numbers):
        clock.start(int(logged[numbers.argmin()]))
    in_turn = len(numbers) - len(kinds[_OTHER_RECORDER])
    order = np.argsort(numbers[:in_turn])
    passed = np.empty_like(logged)
    passed[order] = clock.run_times(logged[order])
    behind = np.searchsorted(numbers[order], numbers[in_turn:])
    passed[in_turn:] = clock.other_thread_times(logged[in_turn:], behind)
    rows, at = {}, 0
    for kind, entries in kinds.items():
        part = slice(at, at + len(entries))
        at += len(entries)
        published = times_of([entry[2] for entry in entries])
        data = [entry[3] for entry in entries]
        rows[kind] = MessageRows(numbers[part], logged[part], published, passed[part], data)
    return rows
