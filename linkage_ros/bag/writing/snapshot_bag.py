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


"""A snapshot on its way to the disk: what was in memory at an instant, written into a bag."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
import threading
import time

from linkage_ros.bag.account import Account
from linkage_ros.bag.metadata import BagSummary
from linkage_ros.bag.writing.handover import BATCH, NAP, POLL
from linkage_ros.bag.writing.last_seconds import Kept
from linkage_ros.bag.writing.recorder import Recorder, RecordingSummary
from linkage_ros.bag.writing.writer import BagWriter
from linkage_ros.errors import RecordingError

_AHEAD = 5000
"""How many messages are handed to the recorder before it has written them."""

_PATIENCE = 10.0
"""How long a disk that does not answer is waited for, in [s]."""


class SnapshotWriting:
    """
    A bag that is written from memory on a thread of its own.

    Parameters
    ----------
    kept
        What goes into it.
    make
        Makes the bag, on that thread.
    done
        Called on that thread when the outcome is there.

    Attributes
    ----------
    kept
        As given.
    outcome
        How the recording went, or why there is none; None until then.

    """

    def __init__(
        self, kept: Kept, make: Callable[[], BagWriter], done: Callable[[], None]
    ) -> None:
        self.kept = kept
        self.outcome: RecordingSummary | RecordingError | None = None
        self._make = make
        self._done = done
        self._seen = time.monotonic()
        # A daemon: a disk that never answers must not keep the process from ending.
        self._thread = threading.Thread(target=self._run, name='snapshot', daemon=True)
        self._thread.start()

    def wait(self) -> RecordingSummary | RecordingError:
        """Return the outcome as soon as it is there, or a disk has not answered for too long."""
        # The thread has some patience of its own, and has to close a bag then.
        while self.outcome is None and time.monotonic() - self._seen < 3.0 * _PATIENCE:
            self._thread.join(POLL)
        return self.outcome or RecordingError(
            'snapshot', 'the disk does not answer', 'what was flushed before is readable'
        )

    def _run(self) -> None:
        try:
            self.outcome = self._write(self._make())
        except RecordingError as error:
            self.outcome = error
        except Exception as error:  # noqa: BLE001 (nothing may end the thread in silence)
            reason = f'{type(error).__name__}: {error}'
            self.outcome = RecordingError('snapshot', reason, 'please report this')
        self._done()

    def _write(self, writer: BagWriter) -> RecordingSummary:
        recorder = Recorder(writer, capacity=_AHEAD + BATCH)
        writer.account = partial(self._account, writer)
        for number, message in enumerate(self.kept.messages()):
            if number % BATCH == 0:
                time.sleep(NAP)
                if not self._is_taken(recorder, _AHEAD):
                    break
            recorder.offer(*message)
        self._is_taken(recorder, 0)
        summary = recorder.stop(timeout=_PATIENCE)
        # After a failure not all was offered.
        topics = [
            replace(topic, received=there, dropped=there - topic.recorded)
            for topic, there in zip(summary.topics, self._received(writer), strict=True)
        ]
        return replace(summary, topics=tuple(topics))

    def _is_taken(self, recorder: Recorder, most: int) -> bool:
        """Wait until no more messages than that wait; return whether the disk goes on."""
        left = -1
        while not recorder.failure:
            before, left = left, sum(topic.waiting for topic in recorder.inspect())
            if left != before:
                self._seen = time.monotonic()
            if left <= most:
                return True
            if time.monotonic() - self._seen > _PATIENCE:
                break
            time.sleep(POLL)
        return False

    def _received(self, writer: BagWriter) -> list[int]:
        """Return how many messages of each topic there are to be written."""
        return list(map(sum, zip(self.kept.counts, writer.opened, strict=True)))

    def _account(self, writer: BagWriter, summary: BagSummary) -> Account:
        received = self._received(writer)
        dropped = [
            there - written for there, written in zip(received, summary.counts, strict=True)
        ]
        return Account(received, summary.counts, dropped, (0,) * len(dropped))
