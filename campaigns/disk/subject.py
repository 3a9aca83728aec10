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

"""The recording on the disk that fails: short, with all that a writer does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic_ns, sleep

from campaigns.kills.plan import ATTACHMENTS, expected, message, TOPICS
from linkage_ros.bag.metadata import BagSummary
from linkage_ros.bag.reader import BagMessage
from linkage_ros.bag.recorder import Recorder
from linkage_ros.bag.storage import Storage
from linkage_ros.bag.writer import BagWriter
from linkage_ros.errors import RecordingError

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
    How a recording went, as whoever made it sees it.

    Attributes
    ----------
    refused
        Why it could not begin; '' where it did.
    escaped
        What came out that is no RecordingError; '' for nothing.
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
