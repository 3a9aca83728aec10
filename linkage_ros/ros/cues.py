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


"""Which messages of a bag are played, in which order; read before they are due."""

from __future__ import annotations

from collections.abc import Collection, Generator, Iterator
from queue import Empty, Full, Queue
from threading import Event, Thread
from typing import NamedTuple

from linkage_ros.bag.order import TimeOrder
from linkage_ros.errors import LinkageError

_BATCH = 256
_BATCH_SIZE = 2**20
_BATCHES = 8
"""How many batches of how many messages, or bytes, are read ahead."""

_LOOK = 0.1


class Part(NamedTuple):
    """
    What of a bag is played.

    Attributes
    ----------
    first, last
        Log times between which messages are played, in [ns].
    topics
        Their topics.
    loop
        Whether it begins again at its end.

    """

    first: int
    last: float
    topics: Collection[str]
    loop: bool


class Cue(NamedTuple):
    """
    A message and its time.

    Attributes
    ----------
    base
        What the passes before this one took, in [ns] of the bag's time.
    log_time
        In [ns].
    topic, data
        The message.

    """

    base: int
    log_time: int
    topic: str
    data: bytes


def cues(order: TimeOrder, part: Part) -> Iterator[Cue]:
    """
    Yield the messages that are played.

    Raises
    ------
    BagError
        The bag is damaged; what lies before the damage has been given by then.
    LinkageError
        A loop would take no time.

    """
    base = 0
    while True:
        newest = part.first
        for topic, log_time, _, data in order.messages(part.first):
            if log_time > part.last:
                break
            if topic in part.topics:
                newest = max(newest, log_time)
                yield Cue(base, log_time, topic, data)
        if not part.loop:
            return
        if newest == part.first:
            raise LinkageError(
                '--loop', 'all that is played is of one instant', 'play it without --loop'
            )
        base += newest - part.first


def read_ahead(messages: Iterator[Cue], stop: Event) -> Generator[Cue, None, None]:
    """
    Yield messages that a thread of its own has read before they are asked for, until the event.

    It reads some batches ahead and no further. What is raised while reading is raised here, behind
    the messages that were read before.
    """
    batches: Queue[list[Cue] | Exception] = Queue(_BATCHES)
    ended = Event()

    def hand_over(batch: list[Cue] | Exception) -> bool:
        while not ended.is_set():
            try:
                batches.put(batch, timeout=_LOOK)
            except Full:
                continue
            return True
        return False

    def read() -> None:
        batch: list[Cue] = []
        size = 0
        error: Exception | None = None
        try:
            for cue in messages:
                batch.append(cue)
                size += len(cue.data)
                if len(batch) == _BATCH or size > _BATCH_SIZE:
                    if not hand_over(batch):
                        return
                    batch, size = [], 0
        except Exception as raised:  # noqa: BLE001 (it goes to who reads)
            error = raised
        if batch and not hand_over(batch):
            return
        hand_over(error or [])

    reader = Thread(target=read, name='read ahead', daemon=True)
    reader.start()
    try:
        while not stop.is_set():
            try:
                batch = batches.get(timeout=_LOOK)
            except Empty:
                continue
            if isinstance(batch, Exception):
                raise batch
            if not batch:
                return
            yield from batch
    finally:
        # The reader is not waited for: what it passes over on its way to a start may be long.
        ended.set()
