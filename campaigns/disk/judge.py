# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A short recording that uses every function of a writer, and the judgement of its outcome."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from pathlib import Path
import shutil
from time import monotonic_ns, sleep
from typing import Any

from campaigns.kills.plan import ATTACHMENTS, expected, message, TOPICS
from linkage_ros.bag import (
    Bag,
    BagMessage,
    BagSummary,
    BagWriter,
    FAILURE,
    METADATA_FILE,
    read_bag,
    Recorder,
    recover_bag,
    ROOT_KEY,
    Storage,
    UNFINISHED,
)
from linkage_ros.errors import BagError, RecordingError
from rosbags.highlevel import AnyReader
import yaml

MESSAGES = 240
_FLUSH_EVERY = 40
_BURST = 50
_MOST_WAITING = 400
_START = 1_700_000_000_000_000_000
_PERIOD = 500_000  # between two messages [ns]

SETTINGS: Mapping[str, Storage] = {
    'one file': Storage(flush_period=1e9, min_free_bytes=1),
    'split, zstd': Storage(flush_period=1e9, split_bytes=4_000, compression='zstd'),
    'ring of 2, lz4': Storage(
        flush_period=1e9, split_seconds=0.03, keep_files=2, compression='lz4'
    ),
}


@dataclass(slots=True)
class Recorded:
    """The outcome of a recording, as its caller sees it."""

    refused: str = ''  # The error that kept it from beginning; '' for none
    escaped: str = ''  # An exception other than RecordingError; '' for none
    offered: int = 0  # Number of messages offered
    # Received, recorded, dropped, discarded and waiting, of each topic.
    counts: list[tuple[int, int, int, int, int]] = field(default_factory=list)
    failure: str | None = None  # The error that ended it early; None for none
    longest_offer: int = 0  # The longest duration of `Recorder.offer` [ns]

    @property
    def recorded(self) -> int:
        """Return the number of messages that are counted as recorded."""
        return sum(counts[1] for counts in self.counts)

    @property
    def discarded(self) -> int:
        """Return the number of messages that are counted as removed by the ring."""
        return sum(counts[3] for counts in self.counts)


def record(folder: Path, storage: Storage, enter_phase: Callable[[str], None]) -> Recorded:
    """Record; flush and renew the metadata after numbers of messages, and announce each phase."""
    done = Recorded()
    try:
        writer = _ByCount(folder, storage, enter_phase)
    except RecordingError as error:
        done.refused = str(error)
        return done
    except Exception as error:  # noqa: BLE001 (a fault)
        done.escaped = f'{type(error).__name__}: {error}'
        return done
    try:
        recorder = Recorder(writer, flush_period=storage.flush_period)
        for index in range(MESSAGES):
            offered = message(index, time_of(index))
            begin = monotonic_ns()
            recorder.offer(*offered)
            done.longest_offer = max(done.longest_offer, monotonic_ns() - begin)
            done.offered += 1
        _end(done, recorder)
    except Exception as error:  # noqa: BLE001
        done.escaped = f'{type(error).__name__}: {error}'
    return done


def offer_all(folder: Path, storage: Storage, count: int) -> Recorded:
    """Record until the recorder fails, or ``count`` messages are offered."""
    done = Recorded()
    try:
        writer = BagWriter(folder, TOPICS, ATTACHMENTS, storage)
    except RecordingError as error:
        done.refused = str(error)
        return done
    try:
        recorder = Recorder(writer, flush_period=storage.flush_period)
        while done.offered < count and recorder.failure is None:
            for index in range(done.offered, done.offered + _BURST):
                recorder.offer(*message(index, time_of(index)))
            done.offered += _BURST
            # Wait until the recorder's thread has caught up.
            while not recorder.failure and _waiting(recorder) > _MOST_WAITING:
                sleep(0.001)
        _end(done, recorder)
    except Exception as error:  # noqa: BLE001
        done.escaped = f'{type(error).__name__}: {error}'
    return done


def _waiting(recorder: Recorder) -> int:
    return sum(counts.waiting for counts in recorder.read_counts())


def _end(done: Recorded, recorder: Recorder) -> None:
    summary = recorder.stop(timeout=10.0)
    done.counts = [
        (c.received, c.recorded, c.dropped, c.discarded, c.waiting) for c in summary.topics
    ]
    done.failure = summary.failure


def time_of(number: int) -> int:
    """Return the time at which a message is offered [ns]."""
    return _START + number * _PERIOD


def expected_messages(count: int) -> list[BagMessage]:
    """Return the first messages, as they have to be in the bag."""
    return [expected(index, time_of(index)) for index in range(count)]


class _ByCount(BagWriter):
    """Flushes and renews its metadata after numbers of messages, so that all runs are equal."""

    def __init__(self, folder: Path, storage: Storage, enter_phase: Callable[[str], None]) -> None:
        self._enter_phase = enter_phase
        self._written = 0
        super().__init__(folder, TOPICS, ATTACHMENTS, storage)
        enter_phase('recording')

    def write(self, topic: int, log_time: int, publish_time: int, data: bytes) -> bool:
        if self._written and self._written % _FLUSH_EVERY == 0:
            self._due = 0.0
            self.flush()
        accepted = super().write(topic, log_time, publish_time, data)
        self._written += 1
        return accepted

    def close(self, custom: Mapping[str, str] | None = None) -> BagSummary:
        self._enter_phase('closing')
        return super().close(custom)


REFUSED = 'refused at the beginning'
LEFT = 'refused, but files could not be removed'
COMPLETE = 'complete'
EARLY = 'ended early, bag readable'
AT_RECOVERY = 'ended early, complete after recovery'


@dataclass(slots=True)
class Outcome:
    """The outcome of a recording, with counts of messages; no verdict if it has only faults."""

    verdict: str = ''
    faults: list[str] = field(default_factory=list)
    offered: int = 0
    recorded: int = 0
    discarded: int = 0


class Expectation:
    """
    The expected outcome of a recording.

    Parameters
    ----------
    messages
        The offered messages, in order.
    keeps_all
        Whether the recording must not lose a message.
    may_leave
        Whether unwanted files may remain, because they could not be removed.
    loses_pages
        Whether data that was not flushed may be lost from the files; then only recovery is judged.
    may_be_silent
        Whether the metadata may lack the failure, because they were written before it.

    """

    def __init__(
        self,
        messages: Sequence[BagMessage],
        *,
        keeps_all: bool = False,
        may_leave: bool = False,
        loses_pages: bool = False,
        may_be_silent: bool = False,
    ) -> None:
        self.messages = messages
        self.keeps_all = keeps_all
        self.may_leave = may_leave
        self.loses_pages = loses_pages
        self.may_be_silent = may_be_silent
        self._numbers = {message.log_time: at for at, message in enumerate(messages)}

    def run_of(self, found: Sequence[BagMessage]) -> range | None:
        """Return the numbers of these consecutive messages, byte for byte; None if they differ."""
        if not found:
            return range(0)
        first = self._numbers.get(found[0].log_time, 0)
        end = first + len(found)
        return range(first, end) if list(self.messages[first:end]) == list(found) else None


def judge(
    done: Recorded | None, folder: Path, expectation: Expectation, recovered: Path | None = None
) -> Outcome:
    """Judge a recording, None if it did not end; the recovered bag is removed afterwards."""
    recovered = recovered or folder.with_name(f'{folder.name}_recovered')
    if done is None:
        return Outcome(faults=['did not end'])
    outcome = Outcome(offered=done.offered, recorded=done.recorded, discarded=done.discarded)
    if done.escaped:
        outcome.faults.append(f'escaped: {done.escaped}')
        return outcome
    error = done.refused or done.failure
    if error and not _is_line(error, folder):
        outcome.faults.append(f'bad error message: {error}')
    if error and expectation.keeps_all:
        outcome.faults.append(f'ended by a harmless fault: {error}')
    if done.refused:
        outcome.verdict = LEFT if folder.exists() else REFUSED
        if folder.exists() and not expectation.may_leave:
            outcome.faults.append('refused, but files left behind')
        return outcome
    outcome.faults += _counts(done)
    outcome.faults += _metadata(folder)
    if done.failure is None:
        outcome.verdict = COMPLETE
        outcome.faults += _complete(done, folder, expectation)
    else:
        outcome.verdict = EARLY
        _ended_early(outcome, done, folder, expectation, recovered)
    if not expectation.may_leave:
        outcome.faults += [
            f'left behind: {path.name}'
            for path in folder.iterdir()
            if path.name != METADATA_FILE and path.suffix != '.mcap'
        ]
    return outcome


def _is_line(error: str, folder: Path) -> bool:
    """Return whether an error has place, reason and remedy on one line."""
    where, _, rest = error.partition(': ')
    reason, _, remedy = rest.partition('; ')
    return (
        where == str(folder)
        and bool(reason and remedy)
        and error.isprintable()
        and ('please report' not in error)
    )


def _counts(done: Recorded) -> list[str]:
    """Return the faults of the counts, topic by topic."""
    faults = []
    for index, (received, recorded, dropped, discarded, waiting) in enumerate(done.counts):
        offered = len(range(index, done.offered, len(TOPICS)))
        if received != offered:
            faults.append(f'{offered} offered, {received} received')
        if received != recorded + dropped + discarded or waiting or min(recorded, dropped) < 0:
            faults.append(f'the counts do not add up: {done.counts[index]}')
    return faults


def _complete(done: Recorded, folder: Path, expectation: Expectation) -> list[str]:
    """Return the faults of a recording that reports no failure."""
    faults = []
    try:
        bag = read_bag(folder)
        run = expectation.run_of(list(bag.messages()))
    except BagError as error:
        return [f'reports no failure, but cannot be read: {error}']
    if run is None:
        return ['a false message']
    if (run.start, run.stop) != (done.discarded, done.offered) or len(run) != done.recorded:
        faults.append(f'reports no failure, but holds {run} of {done.offered}')
    if UNFINISHED in bag.custom or FAILURE in bag.custom:
        faults.append('reports no failure, but its metadata do')
    return faults + _rosbags(bag, folder)


def _ended_early(
    outcome: Outcome, done: Recorded, folder: Path, expectation: Expectation, target: Path
) -> None:
    """Judge the bag of a recording that reports a failure."""
    counted = range(done.discarded, done.discarded + done.recorded)
    run: range | None = range(0)
    try:
        bag = read_bag(folder, allow_truncated=True)
        run = expectation.run_of(list(bag.messages()))
    except BagError:
        bag = None
    except Exception as error:  # noqa: BLE001
        outcome.faults.append(f'reading: {type(error).__name__}: {error}')
        bag = None
    if run is None:
        outcome.faults.append('a false message')
        return
    if bag is not None:
        if FAILURE in bag.custom and bag.custom[FAILURE] != done.failure:
            outcome.faults.append('another failure in the metadata')
        silent = FAILURE not in bag.custom and UNFINISHED not in bag.custom
        if silent and not expectation.may_be_silent:
            outcome.faults.append('its metadata report no failure')
        if not bag.truncated and not expectation.loses_pages:
            outcome.faults += _rosbags(bag, folder)
    if bag is None or not _holds(run, counted):
        outcome.verdict = AT_RECOVERY
    outcome.faults += _recovered(counted, folder, expectation, target)


def _recovered(counted: range, folder: Path, expectation: Expectation, target: Path) -> list[str]:
    """Return the faults of the recovered bag."""
    try:
        recover_bag(folder, target)
        messages = list(read_bag(target).messages())
        if expectation.may_leave:
            # An old file of the ring that could not be removed comes after the named files.
            messages.sort(key=attrgetter('log_time'))
        run = expectation.run_of(messages)
    except BagError as error:
        return [f'recover: {error}'] if counted else []
    except Exception as error:  # noqa: BLE001
        return [f'recover: {type(error).__name__}: {error}']
    finally:
        shutil.rmtree(target, ignore_errors=True)
    if run is None:
        return ['recover: a false message']
    return [] if _holds(run, counted) else [f'counted {counted}, recovered {run}']


def _holds(run: range, counted: range) -> bool:
    return not counted or (run.start <= counted.start and counted.stop <= run.stop)


def _metadata(folder: Path) -> list[str]:
    """Return the faults of ``metadata.yaml``."""
    try:
        content: Any = yaml.safe_load((folder / METADATA_FILE).read_text(encoding='utf-8'))
        named = content[ROOT_KEY]['relative_file_paths']
    except Exception as error:  # noqa: BLE001
        return [f'metadata: {type(error).__name__}']
    missing = [name for name in named if not (folder / name).is_file()]
    return [f'metadata name missing files: {missing}'] if missing else []


def _rosbags(bag: Bag, folder: Path) -> list[str]:
    """Return the faults that reading by rosbags finds."""
    ours = sorted((m.topic, m.log_time, m.data) for m in bag.messages())
    try:
        with AnyReader([folder]) as reader:
            theirs = sorted((c.topic, time, bytes(data)) for c, time, data in reader.messages())
    except Exception as error:  # noqa: BLE001
        return [f'rosbags: {type(error).__name__}: {error}']
    return [] if ours == theirs else [f'rosbags reads {len(theirs)} messages, not {len(ours)}']
