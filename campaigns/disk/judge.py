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


"""A short recording that uses every function of a writer, and its outcome against its input."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from pathlib import Path
import shutil
from time import monotonic_ns, sleep
from typing import Any

from campaigns.kills.plan import ATTACHMENTS, expected, message, TOPICS
from linkage_ros.bag.metadata import BagSummary, METADATA_FILE, ROOT_KEY
from linkage_ros.bag.reader import Bag, BagMessage, read_bag
from linkage_ros.bag.recorder import Recorder
from linkage_ros.bag.recording_stats import FAILURE, UNFINISHED
from linkage_ros.bag.recover import recover
from linkage_ros.bag.storage import Storage
from linkage_ros.bag.writer import BagWriter
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
    """
    The outcome of a recording, as its caller sees it.

    Attributes
    ----------
    refused
        Why it could not begin; '' where it did.
    escaped
        An exception other than RecordingError; '' if none.
    offered
        Messages.
    counts
        Received, recorded, dropped, let go and waiting, of each topic.
    failure
        Why it ended early; None where it did not.
    longest_offer
        The longest that `Recorder.offer` took [ns].

    """

    refused: str = ''
    escaped: str = ''
    offered: int = 0
    counts: list[tuple[int, int, int, int, int]] = field(default_factory=list)
    failure: str | None = None
    longest_offer: int = 0

    @property
    def recorded(self) -> int:
        """Messages that are counted as recorded."""
        return sum(counts[1] for counts in self.counts)

    @property
    def let_go(self) -> int:
        """Messages that are counted as let go."""
        return sum(counts[3] for counts in self.counts)


def record(folder: Path, storage: Storage, tell: Callable[[str], None]) -> Recorded:
    """
    Record; flushes and renewals come after messages, not after times.

    Parameters
    ----------
    folder
        The bag's.
    storage
        How it is stored.
    tell
        Is told when the recording has begun, and when it is closed.

    """
    done = Recorded()
    try:
        writer = _ByCount(folder, storage, tell)
    except RecordingError as error:
        done.refused = str(error)
        return done
    except Exception as error:  # noqa: BLE001 (this is what is looked for)
        done.escaped = f'{type(error).__name__}: {error}'
        return done
    try:
        recorder = Recorder(writer, flush_period=storage.flush_period)
        for number in range(MESSAGES):
            offered = message(number, time_of(number))
            begin = monotonic_ns()
            recorder.offer(*offered)
            done.longest_offer = max(done.longest_offer, monotonic_ns() - begin)
            done.offered += 1
        _end(done, recorder)
    except Exception as error:  # noqa: BLE001
        done.escaped = f'{type(error).__name__}: {error}'
    return done


def offer_all(folder: Path, storage: Storage, count: int) -> Recorded:
    """
    Record until the recorder gives up, or so many messages were offered.

    Parameters
    ----------
    folder
        The bag's.
    storage
        How it is stored.
    count
        Messages that are offered at most.

    """
    done = Recorded()
    try:
        writer = BagWriter(folder, TOPICS, ATTACHMENTS, storage)
    except RecordingError as error:
        done.refused = str(error)
        return done
    try:
        recorder = Recorder(writer, flush_period=storage.flush_period)
        while done.offered < count and recorder.failure is None:
            for number in range(done.offered, done.offered + _BURST):
                recorder.offer(*message(number, time_of(number)))
            done.offered += _BURST
            # As fast as the recorder's thread can follow.
            while not recorder.failure and _waiting(recorder) > _MOST_WAITING:
                sleep(0.001)
        _end(done, recorder)
    except Exception as error:  # noqa: BLE001
        done.escaped = f'{type(error).__name__}: {error}'
    return done


def _waiting(recorder: Recorder) -> int:
    return sum(counts.waiting for counts in recorder.inspect())


def _end(done: Recorded, recorder: Recorder) -> None:
    summary = recorder.stop(timeout=10.0)
    done.counts = [
        (c.received, c.recorded, c.dropped, c.let_go, c.waiting) for c in summary.topics
    ]
    done.failure = summary.failure


def time_of(number: int) -> int:
    """Return when a message is offered [ns]."""
    return _START + number * _PERIOD


def expected_messages(count: int) -> list[BagMessage]:
    """Return the first messages, as a bag has to give them."""
    return [expected(number, time_of(number)) for number in range(count)]


class _ByCount(BagWriter):
    """Flushes and renews its metadata after so many messages, so that every run is the same."""

    def __init__(self, folder: Path, storage: Storage, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._written = 0
        super().__init__(folder, TOPICS, ATTACHMENTS, storage)
        tell('recording')

    def write(self, topic: int, log_time: int, publish_time: int, data: bytes) -> bool:
        if self._written and self._written % _FLUSH_EVERY == 0:
            self._due = 0.0
            self.flush()
        taken = super().write(topic, log_time, publish_time, data)
        self._written += 1
        return taken

    def close(self, custom: Mapping[str, str] | None = None) -> BagSummary:
        self._tell('closing')
        return super().close(custom)


REFUSED = 'refused at the beginning, and said so'
LEFT = 'refused, said so, what was begun could not be removed'
WHOLE = 'went on to the end, whole'
EARLY = 'ended early and said so; a bag'
AT_RECOVERY = 'ended early and said so; all that was counted, by recover'


@dataclass(slots=True)
class Outcome:
    """
    The outcome of a recording.

    Attributes
    ----------
    verdict
        In words; '' where there is no more than faults.
    faults
        The violations.
    offered, recorded, let_go
        Messages.

    """

    verdict: str = ''
    faults: list[str] = field(default_factory=list)
    offered: int = 0
    recorded: int = 0
    let_go: int = 0


class Expectation:
    """
    The expected outcome of a recording.

    Parameters
    ----------
    messages
        What it was offered, in order.
    keeps_all
        Whether the recording may lose nothing.
    may_leave
        Whether what is not wanted any more may lie there still: it could not be removed.
    loses_pages
        Whether what was not flushed may be gone from the files; then recover only is asked.
    may_be_silent
        Whether the metadata may say nothing of a failure: they had been written before it.

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
    done: Recorded | None, folder: Path, expectation: Expectation, beside: Path | None = None
) -> Outcome:
    """
    Judge a recording.

    Parameters
    ----------
    done
        Its outcome; None if it did not end.
    folder
        The bag's.
    expectation
        What is expected.
    beside
        Where to recover to, to be removed again.

    """
    beside = beside or folder.with_name(f'{folder.name}_recovered')
    if done is None:
        return Outcome(faults=['came to no end'])
    outcome = Outcome(offered=done.offered, recorded=done.recorded, let_go=done.let_go)
    if done.escaped:
        outcome.faults.append(f'escaped: {done.escaped}')
        return outcome
    said = done.refused or done.failure
    if said and not _is_line(said, folder):
        outcome.faults.append(f'said badly: {said}')
    if said and expectation.keeps_all:
        outcome.faults.append(f'ended by what is harmless: {said}')
    if done.refused:
        outcome.verdict = LEFT if folder.exists() else REFUSED
        if folder.exists() and not expectation.may_leave:
            outcome.faults.append('refused, and something left behind')
        return outcome
    outcome.faults += _account(done)
    outcome.faults += _metadata(folder)
    if done.failure is None:
        outcome.verdict = WHOLE
        outcome.faults += _whole(done, folder, expectation)
    else:
        outcome.verdict = EARLY
        _ended_early(outcome, done, folder, expectation, beside)
    if not expectation.may_leave:
        outcome.faults += [
            f'left behind: {path.name}'
            for path in folder.iterdir()
            if path.name != METADATA_FILE and path.suffix != '.mcap'
        ]
    return outcome


def _is_line(said: str, folder: Path) -> bool:
    """Return whether it has place, reason and remedy, on one line."""
    where, _, rest = said.partition(': ')
    reason, _, remedy = rest.partition('; ')
    return (
        where == str(folder)
        and bool(reason and remedy)
        and said.isprintable()
        and ('please report' not in said)
    )


def _account(done: Recorded) -> list[str]:
    """Return in what the counts do not add up, topic by topic."""
    faults = []
    for number, (received, recorded, dropped, let_go, waiting) in enumerate(done.counts):
        offered = len(range(number, done.offered, len(TOPICS)))
        if received != offered:
            faults.append(f'{offered} offered, {received} received')
        if received != recorded + dropped + let_go or waiting or min(recorded, dropped) < 0:
            faults.append(f'the account is open: {done.counts[number]}')
    return faults


def _whole(done: Recorded, folder: Path, expectation: Expectation) -> list[str]:
    """Return what a recording lacks that says nothing of a failure."""
    lacks = []
    try:
        bag = read_bag(folder)
        run = expectation.run_of(list(bag.messages()))
    except BagError as error:
        return [f'says nothing, and cannot be read: {error}']
    if run is None:
        return ['a false message']
    if (run.start, run.stop) != (done.let_go, done.offered) or len(run) != done.recorded:
        lacks.append(f'says nothing, and holds {run} of {done.offered}')
    if UNFINISHED in bag.custom or FAILURE in bag.custom:
        lacks.append('says nothing, but its metadata do')
    return lacks + _rosbags(bag, folder)


def _ended_early(
    outcome: Outcome, done: Recorded, folder: Path, expectation: Expectation, beside: Path
) -> None:
    """Judge what is left of a recording that says why it ended."""
    counted = range(done.let_go, done.let_go + done.recorded)
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
            outcome.faults.append('its metadata say nothing of a failure')
        if not bag.truncated and not expectation.loses_pages:
            outcome.faults += _rosbags(bag, folder)
    if bag is None or not _holds(run, counted):
        outcome.verdict = AT_RECOVERY
    outcome.faults += _recovered(counted, folder, expectation, beside)


def _recovered(counted: range, folder: Path, expectation: Expectation, target: Path) -> list[str]:
    """Return the counted messages that recover lost."""
    try:
        recover(folder, target)
        found = list(read_bag(target).messages())
        if expectation.may_leave:
            # A file that made way, and could not be removed, comes behind those that are named.
            found.sort(key=attrgetter('log_time'))
        run = expectation.run_of(found)
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
        said: Any = yaml.safe_load((folder / METADATA_FILE).read_text(encoding='utf-8'))
        named = said[ROOT_KEY]['relative_file_paths']
    except Exception as error:  # noqa: BLE001
        return [f'metadata: {type(error).__name__}']
    missing = [name for name in named if not (folder / name).is_file()]
    return [f'metadata name what is not there: {missing}'] if missing else []


def _rosbags(bag: Bag, folder: Path) -> list[str]:
    """Return in what rosbags disagrees with our reader."""
    ours = sorted((m.topic, m.log_time, m.data) for m in bag.messages())
    try:
        with AnyReader([folder]) as reader:
            theirs = sorted((c.topic, time, bytes(data)) for c, time, data in reader.messages())
    except Exception as error:  # noqa: BLE001
        return [f'rosbags: {type(error).__name__}: {error}']
    return [] if ours == theirs else [f'rosbags reads {len(theirs)} messages, not {len(ours)}']
