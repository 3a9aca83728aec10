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


"""The memory of the last seconds of a run, the snapshots taken of it, and their outcome."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from linkage_ros.bag.recorder import RecordingSummary, TopicCounts
from linkage_ros.bag.snapshot import KeptCounts, SnapshotMemory, SnapshotWriting
from linkage_ros.bag.writer import BagWriter
from linkage_ros.errors import RecordingError

Answer = Callable[[bool, str], None]
"""Takes whether the call succeeded, and the outcome as one line."""


@dataclass(frozen=True, slots=True)
class SnapshotOutcome:
    """
    The outcome of a snapshot.

    Attributes
    ----------
    bag
        Summary of the written bag; None where no bag could be made.
    failure
        Reason why it is incomplete; '' if it is complete.
    line
        The outcome as one line.

    """

    bag: RecordingSummary | None
    failure: str
    line: str


@dataclass(frozen=True, slots=True)
class MemorySummary:
    """
    Summary of a run whose last seconds were kept in memory.

    Attributes
    ----------
    topics
        Counts for each topic; messages that were kept to the end are gone now.
    snapshots
        Number of snapshots, as text.
    failure
        Reason why the memory has ended early, or lacks messages; '' if it is complete.

    """

    topics: tuple[KeptCounts, ...]
    snapshots: str
    failure: str

    def __str__(self) -> str:
        counts = ', '.join(
            f'{t.name} {t.received} received {t.kept} in memory at the end {t.let_go} let go'
            + (f' {t.dropped} dropped' if t.dropped else '')
            for t in self.topics
        )
        failure = f'{self.failure}; ' if self.failure else ''
        return f'{failure}nothing is kept any more, {self.snapshots}: {counts}'


class RunSnapshots:
    """
    A memory and its snapshots.

    Parameters
    ----------
    memory
        The memory that the tick offers to.
    new_bag
        Makes a bag, given whether the memory reaches back to the start of the run.

    """

    def __init__(self, memory: SnapshotMemory, new_bag: Callable[[bool], BagWriter]) -> None:
        self.memory = memory
        self.written = self.failed = 0
        """Number of written snapshots; a partly written one counts as failed."""
        self.last = ''
        """Folder of the last written snapshot."""
        self.failure = ''
        """Reason why the last snapshot failed; '' if it did not."""
        self._new_bag = new_bag
        self._writing: SnapshotWriting | None = None
        self._answer: Answer

    def __str__(self) -> str:
        """Return the state of the memory as text."""
        seconds = self.memory.seconds
        return f'keeping the last {seconds:g} s in memory; ~/snapshot writes them'

    @property
    def writing(self) -> bool:
        """Whether a snapshot is being written."""
        return self._writing is not None

    @property
    def count(self) -> str:
        """Return the number of snapshots as text."""
        if not self.written and not self.failed:
            return 'no snapshot was asked for: nothing was written'
        written = f'{self.written} snapshot{"s" * (self.written != 1)} written'
        return written + (f', {self.failed} failed' if self.failed else '')

    def begin(self, answer: Answer, wake: Callable[[], None]) -> str:
        """
        Begin to write the memory to a new bag, on another thread.

        Parameters
        ----------
        answer
            Called by `collect` with the outcome.
        wake
            Called on the writing thread when the outcome is ready.

        Returns
        -------
        str
            Reason why it is not begun, as one line; '' if it is begun.

        """
        if self._writing is not None:
            return 'a snapshot is being written; ask again when it is: the memory goes on'
        try:
            kept = self.memory.take()
        except RecordingError as error:
            return str(error)
        if not kept.blocks:
            return 'nothing is in memory yet; ask again when there are messages'
        self._answer = answer
        self._writing = SnapshotWriting(kept, partial(self._new_bag, kept.whole), wake)
        return ''

    def collect(self) -> SnapshotOutcome | None:
        """Send the answer for a written snapshot, and return its outcome, or None."""
        writing = self._writing
        if writing is None or writing.outcome is None:
            return None
        self._writing = None
        outcome = _outcome(writing.outcome, writing.kept.seconds)
        if outcome.bag is None or outcome.failure:
            self.failed += 1
        else:
            self.written += 1
            self.last = str(outcome.bag.folder)
        self.failure = outcome.failure
        self._answer(not outcome.failure, outcome.line)
        return outcome

    def wait(self) -> None:
        """Wait until the current snapshot, if any, is written."""
        if self._writing is not None:
            self._writing.outcome = self._writing.wait()

    def end(self) -> MemorySummary:
        """End the memory, and return its summary."""
        topics, failure = self.memory.stop(), self.memory.failure
        where = 'the memory of the last seconds'
        failure_text = str(failure) if failure else losses_text(where, topics)
        return MemorySummary(topics, self.count, failure_text)


def counts_text(summary: RecordingSummary) -> str:
    """Return the counts of a recording's messages as text."""
    return ', '.join(
        f'{t.name} {t.recorded} recorded {t.dropped} dropped'
        + (f' {t.let_go} let go' if t.let_go else '')
        for t in summary.topics
    )


def losses_text(where: object, topics: Sequence[TopicCounts] | Sequence[KeptCounts]) -> str:
    """Return the number of dropped messages as one line; '' for none."""
    dropped = sum(topic.dropped for topic in topics)
    if not dropped:
        return ''
    received = sum(topic.received for topic in topics)
    return (
        f'{where}: {dropped:,} of {received:,} messages were dropped: they came too fast, or with '
        'times that no bag can hold; record less, or to a faster disk'
    )


def _outcome(result: RecordingSummary | RecordingError, seconds: float) -> SnapshotOutcome:
    if isinstance(result, RecordingError):
        return SnapshotOutcome(None, str(result), f'no snapshot: {result}; the memory goes on')
    counts = counts_text(result)
    if result.failure:
        line = f'snapshot incomplete: {result.failure}: {counts}; the memory goes on'
        return SnapshotOutcome(result, result.failure, line)
    line = f'the last {seconds:.3f} s recorded to {result.folder}: {counts}'
    return SnapshotOutcome(result, '', line)
