# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Pacing of the tick loop: by time, by crank samples, or by the simulation's ``/clock``."""

from __future__ import annotations

from collections.abc import Callable
from threading import Event
from time import monotonic_ns, sleep, time_ns
from typing import TYPE_CHECKING

from linkage_ros.messages import NANOSECONDS
from linkage_ros.tick import Stall, TickLoop
from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.subscription import Subscription
from rclpy.time_source import TimeSource
from rosgraph_msgs.msg import Clock as ClockMessage

if TYPE_CHECKING:
    from linkage_ros.tick import Pace

CATCH_UP = 20_000_000
"""Lag up to which late ticks still run, in [ns]; beyond it they are lost."""

_FINE = 20_000_000
"""Last part of a wait, in [ns], that cannot be interrupted; a stop is checked before it."""

_LONGEST_WAIT = 100_000_000
"""Longest wait for a message, in [ns], between two checks for a stop."""


def on_steady_clock(rate: float) -> Pace:
    """
    Tick at a rate, in [Hz], on the steady clock, stamped with the system's time.

    Ticks are due at whole multiples of the period after the start, so a late tick does not shift
    the next ones.
    """
    period = NANOSECONDS / rate

    def pace(loop: TickLoop, stopping: Event) -> None:
        counts = loop.counts
        add, tick_at = counts.lateness.add_duration, loop.tick_at
        begin = monotonic_ns()
        number = 0
        while not stopping.is_set():
            number += 1
            due = begin + round(number * period)
            early = due - monotonic_ns()
            if early > _FINE and stopping.wait((early - _FINE) * 1e-9):
                return
            wait = due - monotonic_ns()
            if wait > 0:
                sleep(wait * 1e-9)
            lateness = monotonic_ns() - due
            add(lateness)
            if lateness > period:
                counts.late += 1
                if lateness > CATCH_UP:
                    lost = int(lateness // period)
                    # Another thread reads the stall where it finds ticks lost.
                    counts.last_stall = Stall(lateness, in_tick=early <= 0)
                    counts.stalls += 1
                    counts.lost += lost
                    number += lost
            tick_at(time_ns(), time_ns)

    return pace


def on_samples(context: Context, subscription: Subscription, now: Callable[[], int]) -> Pace:
    """Tick once for every crank sample, with its stamp; ``now`` checks stamps, in [ns]."""

    def pace(loop: TickLoop, stopping: Event) -> None:
        wait = _make_waiter(context, subscription)
        while not stopping.is_set():
            if wait():
                loop.tick_samples(now(), now)

    return pace


def on_clock(context: Context, clock: Subscription, rate: float) -> Pace:
    """Tick at a rate, in [Hz], of simulated time, at most once per ``/clock`` message."""
    period = round(NANOSECONDS / rate)

    def pace(loop: TickLoop, stopping: Event) -> None:
        wait = _make_waiter(context, clock)
        due = 0
        last = newest = -1

        def read_newest() -> int:
            nonlocal newest
            # The queue has depth 1, so the message taken is the newest.
            taken = clock.handle.take_message(ClockMessage, False)
            now = None if taken is None else nanoseconds_of(taken[0])
            newest = newest if now is None else now
            return newest

        while not stopping.is_set():
            now = read_newest()
            if now == last:
                wait()
                continue
            if now < last:
                due = now
            last = now
            if now >= due:
                loop.tick_at(now, read_newest)
                due = now - now % period + period

    return pace


def _make_waiter(context: Context, subscription: Subscription) -> Callable[[], bool]:
    """Return a function that waits for a message and returns whether one has arrived."""
    # Like rclpy.wait_for_message; an executor would cost more than the tick.
    wait_set = _rclpy.WaitSet(1, 0, 0, 0, 0, 0, context.handle)

    def wait_for_message() -> bool:
        wait_set.clear_entities()
        wait_set.add_subscription(subscription.handle)
        wait_set.wait(_LONGEST_WAIT)
        return bool(wait_set.get_ready_entities('subscription'))

    return wait_for_message


def nanoseconds_of(message: ClockMessage) -> int | None:
    """Return the time of a ``/clock`` message, in [ns]; None if it is invalid."""
    time = message.clock
    if time.sec < 0 or time.nanosec >= NANOSECONDS:
        return None
    return int(time.sec * NANOSECONDS + time.nanosec)


class ClockGuard:
    """Keeps invalid times from rclpy, which raises on them and so would end the executor."""

    def __init__(self, source: TimeSource) -> None:
        self._pass_on: Callable[[ClockMessage], None] = source.clock_callback
        self.refused_count = 0
        """Number of messages without a valid time."""
        self.last_heard = 0
        """Arrival of the last valid message, by the steady clock, in [ns]; 0 before the first."""
        # For a subscription made later, and for an existing one.
        source.clock_callback = self._check_message  # type: ignore[method-assign, assignment]
        if source._clock_sub is not None:  # noqa: SLF001 (rclpy offers no other way)
            source._clock_sub.callback = self._check_message  # noqa: SLF001

    def _check_message(self, message: ClockMessage) -> None:
        if nanoseconds_of(message) is None:
            self.refused_count += 1
            return
        self.last_heard = monotonic_ns()
        self._pass_on(message)
