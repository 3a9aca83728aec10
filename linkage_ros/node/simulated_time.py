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


"""Simulated time from ``/clock``: ignores invalid times and detects silence."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic_ns

from linkage_ros.messages.layout import NANOSECONDS
from rclpy.time_source import TimeSource
from rosgraph_msgs.msg import Clock as ClockMessage


def nanoseconds_of(message: ClockMessage) -> int | None:
    """Return the time of a ``/clock`` message, in [ns]; None if it is invalid."""
    time = message.clock
    if time.sec < 0 or time.nanosec >= NANOSECONDS:
        return None
    return int(time.sec * NANOSECONDS + time.nanosec)


class ClockGuard:
    """
    Keeps invalid times from rclpy, which raises on them and so would end the executor.

    Parameters
    ----------
    source
        The source that sets the node's clock.

    """

    def __init__(self, source: TimeSource) -> None:
        self._pass_on: Callable[[ClockMessage], None] = source.clock_callback
        self.refused = 0
        """Number of messages without a valid time."""
        self.heard = 0
        """Arrival of the last valid message, by the steady clock, in [ns]; 0 before the first."""
        # For a subscription made later, and for an existing one.
        source.clock_callback = self._look  # type: ignore[method-assign, assignment]
        if source._clock_sub is not None:  # noqa: SLF001 (rclpy offers no other way)
            source._clock_sub.callback = self._look  # noqa: SLF001

    def _look(self, message: ClockMessage) -> None:
        if nanoseconds_of(message) is None:
            self.refused += 1
            return
        self.heard = monotonic_ns()
        self._pass_on(message)
