# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A crank that turns at one rate, published by the tests."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
import time
from typing import Any

from .graph import crank, NS

OMEGA = 3.0
"""Its rate, in [rad/s]."""


def angle_at(stamp: int) -> float:
    """Return its angle at a time, in [ns]: as a double that of the time alone is too coarse."""
    return OMEGA * ((stamp - _BEGUN) / NS)


@contextmanager
def turning(publisher: Any, name: str = 'crank_joint') -> Iterator[None]:
    """Publish it 200 times a second."""
    ending = Event()

    def publish() -> None:
        while not ending.wait(0.005):
            stamp = time.time_ns()
            publisher.publish(crank(angle_at(stamp), OMEGA, stamp, name))

    thread = Thread(target=publish)
    thread.start()
    try:
        yield
    finally:
        ending.set()
        thread.join()


_BEGUN = time.time_ns()
