# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The bags of a run, and the memory of its last seconds: description, snapshots, outcome."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from os.path import lexists
from pathlib import Path
from typing import TYPE_CHECKING

from linkage_ros.bag import MID_RUN, Storage, Topic, WITH_THE_RUN
from linkage_ros.description import RecordParameters, Scene
from linkage_ros.errors import LinkageError, missing_packages_reported, RecordingError
from linkage_ros.replay import scene_files, to_attachments
from linkage_ros.tick import DESCRIPTION, TickLoop
from rclpy.impl.rcutils_logger import RcutilsLogger

if TYPE_CHECKING:
    from linkage_ros.bag import (
        BagWriter,
        Recorder,
        RecordingSummary,
        SnapshotMemory,
        SnapshotWriting,
        TopicCounts,
    )

_DEFAULT = RecordParameters(directory='runs', name='', queue=20_000)
"""Recording settings for a service call if the scene has none."""


Answer = Callable[[bool, str], None]
"""Takes whether the call succeeded, and the outcome as one line."""


class RunRecording:
    """Starts and stops the bags of a node, or its memory of the last seconds; reports on them."""

    def __init__(self, logger: RcutilsLogger) -> None:
        self._logger = logger
        self.ended_bags: list[RecordingSummary] = []
        """Summaries of finished recordings and snapshots."""
        self.memories: list[MemorySummary] = []
        """Summaries of finished memories."""
        self.failure = ''
        """Reason why a recording is incomplete or could not be started; '' otherwise."""
        self._last_state: tuple[RecordingError, bool] | None = None
        self.recorder: Recorder | None = None
        """Recorder of the bag; None when nothing is recorded, or only kept in memory."""
        self.snapshots: RunSnapshots | None = None
        """The memory; None when a bag is recorded continuously."""

    def start(
        self,
        scene: Scene,
        loop: TickLoop,
        directory: str,
        topics: Callable[[], Sequence[tuple[str, Topic]]],
        description: bytes = b'',
    ) -> str:
        """
        Start a bag that describes its own run, or a memory; return the outcome, as one line.

        The loop passes on the messages that it takes and publishes. ``directory``: parent of the
        bag's folder; '' for the scene's own. ``topics`` returns the topics in the order of their
        handles, each with its key in the run's account; topics with the same key form a list.
        ``description``: message on topic `DESCRIPTION` that begins each file; empty for none.
        """
        record = scene.record or _DEFAULT
        storage = record.storage
        # The bag lacks what a running tick remembers: a replay has to know that.
        with_the_run = not loop.is_running

        def new_bag(whole: bool) -> BagWriter:
            begun = WITH_THE_RUN if whole and with_the_run else MID_RUN
            folder = _new_folder(runs, record.name, scene.name)
            names = [(key, topic.name) for key, topic in described]
            files = scene_files(scene, names, begun, folder)
            opening = [
                (index, description)
                for index, (key, _) in enumerate(described)
                if key == DESCRIPTION
            ]
            return BagWriter(
                folder, [t for _, t in described], to_attachments(files), storage, opening
            )

        try:
            with missing_packages_reported():
                from linkage_ros.bag import (  # local import: many nodes record nothing
                    BagWriter,
                    compression_type,
                    Recorder,
                )
            # The client of a service does not know the working directory of this process.
            runs = Path(directory or record.directory).absolute()
            described = topics()
            if storage.snapshot_seconds:
                compression_type(storage.compression, runs)  # fails now, not at the first snapshot
                return self._start_memory(loop, storage, [t for _, t in described], new_bag)
            writer = new_bag(True)
        except (LinkageError, FileNotFoundError) as error:  # no working directory any more
            self.failure = f'not recording: {error}'
            self._logger.error(self.failure)
            return self.failure
        loop.recorder = self.recorder = Recorder(
            writer, capacity=record.queue, flush_period=storage.flush_period
        )
        line = f'recording to {writer.folder}'
        if record.name and writer.folder.name != record.name:
            line += f': {record.name} exists already'
        self._logger.info(line)
        return line

    @property
    def state_text(self) -> str:
        """Return the state of the recording as text; '' for none."""
        if self.snapshots is not None:
            return str(self.snapshots)
        if self.recorder is None:
            return ''
        waits = '' if self.recorder.is_recording else f'; {self.recorder.failure}'
        return f'recording to {self.recorder.folder}{waits}'

    @property
    def has_ended(self) -> bool:
        """Return whether a bag has failed for good and is not reported on yet."""
        return self.recorder is not None and self.recorder.has_ended

    def begin_snapshot(self, answer: Answer, wake: Callable[[], None]) -> str:
        """Begin to write the memory to a bag; as `RunSnapshots.begin_snapshot`."""
        if self.snapshots is None:
            return (
                'nothing is kept in memory; write record.snapshot_seconds in the scene, or call '
                '~/start_recording'
            )
        return self.snapshots.begin_snapshot(answer, wake)

    def collect_snapshot(self) -> None:
        """Finish a snapshot that has been written, if any: log it and send the answer."""
        outcome = self.snapshots.collect_snapshot() if self.snapshots is not None else None
        if outcome is None:
            return
        if outcome.bag is not None:
            self.ended_bags.append(outcome.bag)
        if outcome.failure:
            self.failure = outcome.line
            self._logger.error(outcome.line)
        else:
            self._logger.info(outcome.line)

    def check_failure(self, loop: TickLoop) -> bool:
        """Log that the recording has failed, or goes on again; return whether it logged."""
        if self.snapshots is not None:
            if has_failed := self.snapshots.memory.failure is not None:
                self.stop(loop)
            return has_failed
        recorder = self.recorder
        if recorder is None or recorder.failure is None:
            return False
        state = recorder.failure, recorder.is_recording
        if state == self._last_state:
            return False
        self._last_state, self.failure = state, str(recorder.failure)
        if recorder.is_recording:
            line = f'recording to {recorder.folder} again, in a new file'
            self._logger.info(line)
        else:
            self._logger.error(self.failure)
        return True

    def stop(self, loop: TickLoop) -> tuple[bool, str]:
        """Close the bag or end the memory; return whether it is complete, and one line of text."""
        recorder, self.recorder, loop.recorder = self.recorder, None, None
        if self.snapshots is not None:
            return self._end_memory(self.snapshots)
        if recorder is None:
            return False, 'not recording'
        summary = recorder.stop()
        self.ended_bags.append(summary)
        failure = summary.failure or losses_text(summary.folder, summary.topics)
        if failure:
            self.failure = failure
            line = f'{failure}: {counts_text(summary)}'
            self._logger.error(line)
        else:
            line = f'recorded {summary.folder}: {counts_text(summary)}'
            self._logger.info(line)
        return not failure, line

    def _start_memory(
        self,
        loop: TickLoop,
        storage: Storage,
        topics: Sequence[Topic],
        new_bag: Callable[[bool], BagWriter],
    ) -> str:
        from linkage_ros.bag import SnapshotMemory  # local import: few scenes keep one

        memory = SnapshotMemory(topics, storage.snapshot_seconds, storage.snapshot_bytes)
        self.snapshots = RunSnapshots(memory, new_bag)
        loop.recorder = memory
        line = str(self.snapshots)
        self._logger.info(line)
        return line

    def _end_memory(self, snapshots: RunSnapshots) -> tuple[bool, str]:
        snapshots.wait_for_snapshot()
        self.collect_snapshot()
        self.snapshots, summary = None, snapshots.end_memory()
        self.memories.append(summary)
        if summary.failure:
            self.failure = summary.failure
            self._logger.error(str(summary))
        else:
            self._logger.info(str(summary))
        return not summary.failure, str(summary)


def _new_folder(directory: Path, name: str, scene: str) -> Path:
    """Return a folder for a bag that does not exist yet, by adding a number if needed."""
    name = name or f'{scene}_{datetime.now().astimezone():%Y-%m-%d_%H-%M-%S}'
    folder, number = directory / name, 1
    while lexists(folder):
        number += 1
        folder = directory / f'{name}_{number}'
    return folder


@dataclass(frozen=True, slots=True)
class SnapshotOutcome:
    """The outcome of a snapshot."""

    bag: RecordingSummary | None  # Summary of the written bag; None where no bag could be made
    failure: str  # Reason why it is incomplete; '' if it is complete
    line: str  # The outcome as one line


@dataclass(frozen=True, slots=True)
class MemorySummary:
    """Summary of a run whose last seconds were kept in memory."""

    # Counts for each topic; messages that were kept to the end are gone now.
    topics: tuple[TopicCounts, ...]
    snapshots: str  # Number of snapshots, as text
    failure: str  # Reason why the memory has ended early, or lacks messages; '' if it is complete

    def __str__(self) -> str:
        counts = '; '.join(
            f'{t.name} {t.received} received, {t.recorded} in memory, {t.discarded} discarded'
            + (f', {t.dropped} dropped' if t.dropped else '')
            for t in self.topics
        )
        failure = f'{self.failure}; ' if self.failure else ''
        return f'{failure}the memory has ended, {self.snapshots}: {counts}'


class RunSnapshots:
    """
    A memory and its snapshots.

    ``new_bag`` makes a bag, given whether the memory reaches back to the start of the run.
    """

    def __init__(self, memory: SnapshotMemory, new_bag: Callable[[bool], BagWriter]) -> None:
        self.memory = memory
        self.written = self.failed = 0
        """Number of written snapshots; a partly written one counts as failed."""
        self.last_folder = ''
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
    def is_writing(self) -> bool:
        """Whether a snapshot is being written."""
        return self._writing is not None

    @property
    def count_text(self) -> str:
        """Return the number of snapshots as text."""
        if not self.written and not self.failed:
            return 'no snapshot was requested: nothing was written'
        written = f'{self.written} snapshot{"s" * (self.written != 1)} written'
        return written + (f', {self.failed} failed' if self.failed else '')

    def begin_snapshot(self, answer: Answer, wake: Callable[[], None]) -> str:
        """
        Begin to write the memory to a new bag, on another thread; return why not, or ''.

        `collect_snapshot` calls ``answer`` with the outcome; the writing thread calls ``wake``
        when it is ready.
        """
        if self._writing is not None:
            return (
                'a snapshot is being written; call again when it has ended; the memory continues'
            )
        try:
            kept = self.memory.take_content()
        except RecordingError as error:
            return str(error)
        if not kept.blocks:
            return 'nothing is in memory yet; call again when there are messages'
        from linkage_ros.bag import SnapshotWriting  # local import: as above

        self._answer = answer
        self._writing = SnapshotWriting(kept, partial(self._new_bag, kept.is_complete), wake)
        return ''

    def collect_snapshot(self) -> SnapshotOutcome | None:
        """Send the answer for a written snapshot, and return its outcome, or None."""
        writing = self._writing
        if writing is None or writing.outcome is None:
            return None
        self._writing = None
        outcome = _make_outcome(writing.outcome, writing.kept.seconds)
        if outcome.bag is None or outcome.failure:
            self.failed += 1
        else:
            self.written += 1
            self.last_folder = str(outcome.bag.folder)
        self.failure = outcome.failure
        self._answer(not outcome.failure, outcome.line)
        return outcome

    def wait_for_snapshot(self) -> None:
        """Wait until the current snapshot, if any, is written."""
        if self._writing is not None:
            self._writing.outcome = self._writing.wait()

    def end_memory(self) -> MemorySummary:
        """End the memory, and return its summary."""
        topics, failure = self.memory.stop(), self.memory.failure
        where = 'the memory of the last seconds'
        failure_text = str(failure) if failure else losses_text(where, topics)
        return MemorySummary(topics, self.count_text, failure_text)


def counts_text(summary: RecordingSummary) -> str:
    """Return the counts of a recording's messages as text."""
    return ', '.join(
        f'{t.name} {t.recorded} recorded {t.dropped} dropped'
        + (f' {t.discarded} discarded' if t.discarded else '')
        for t in summary.topics
    )


def losses_text(where: object, topics: Sequence[TopicCounts]) -> str:
    """Return the number of dropped messages as one line; '' for none."""
    dropped = sum(topic.dropped for topic in topics)
    if not dropped:
        return ''
    received = sum(topic.received for topic in topics)
    return (
        f'{where}: {dropped:,} of {received:,} messages were dropped: they came too fast, or with '
        'times that no bag can hold; record less, or to a faster disk'
    )


def _make_outcome(result: RecordingSummary | RecordingError, seconds: float) -> SnapshotOutcome:
    if isinstance(result, RecordingError):
        return SnapshotOutcome(None, str(result), f'no snapshot: {result}; the memory continues')
    counts = counts_text(result)
    if result.failure:
        line = f'snapshot incomplete: {result.failure}: {counts}; the memory continues'
        return SnapshotOutcome(result, result.failure, line)
    line = f'the last {seconds:.3f} s recorded to {result.folder}: {counts}'
    return SnapshotOutcome(result, '', line)
