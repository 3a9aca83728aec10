# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Publish the messages of a bag on the ROS graph."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
import sys
from threading import Event
from time import monotonic

from linkage_ros.bag import LogTimeOrder
from linkage_ros.errors import LinkageError
from linkage_ros.messages import NANOSECONDS, TIME_END, time_message
from linkage_ros.node.playback import (
    ClockTicks,
    Playback,
    playback_queue,
    PlaybackPart,
    read_ahead,
    SteadyClock,
)
from linkage_ros.node.real_time import leave_out_shared_memory
from linkage_ros.signals import bounded_end
import rclpy
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock

CLOCK = '/clock'

_SWITCH_INTERVAL = 1e-4
_LOOK = 0.05
_ACQUAINTANCE = 0.3
"""Time that a subscriber may take to match a publisher that has matched it, in [s]."""

_DELIVERY = 1.0
"""Longest wait at the end for subscribers to confirm the last messages, in [s]."""


@dataclass(frozen=True, slots=True)
class PlaybackOptions:
    """Options of a playback."""

    rate: float = 1.0  # Seconds of bag time per second
    clock: float = 0.0  # Rate of ``/clock``, in [Hz]; 0 for never
    wait: float = 0.0  # Longest wait for a subscriber to one of the topics, in [s]


@contextmanager
def player_node(arguments: Sequence[str], name: str = 'linkage_player') -> Iterator[Node]:
    """
    Create a node for a command, within a context; ``arguments`` follow the program's name.

    LinkageError if ROS is not installed, or does not accept the arguments.
    """
    # As for the tick: else a message would wait for the thread that reads ahead.
    sys.setswitchinterval(_SWITCH_INTERVAL)
    leave_out_shared_memory()
    try:
        rclpy.init(args=[name, *arguments], signal_handler_options=SignalHandlerOptions.NO)
        node = Node(name, start_parameter_services=False)
    except Exception as error:  # noqa: BLE001 (rcl's errors have no common base class)
        rclpy.try_shutdown()
        reason = ' '.join(str(error).strip().splitlines()[:1]) or type(error).__name__
        raise LinkageError('--ros-args', reason, 'write -r OLD:=NEW') from None
    try:
        yield node
    finally:
        with bounded_end():
            node.destroy_node()
            rclpy.try_shutdown()


def play(
    node: Node,
    publishers: Mapping[str, Publisher],
    order: LogTimeOrder,
    part: PlaybackPart,
    options: PlaybackOptions,
    stop: Event,
    progress: Callable[[int], None],
) -> tuple[Playback, LinkageError | None]:
    """
    Publish messages until there are no more or the event is set.

    Return the playback, and the reason for an early end, such as a damaged bag, or None.
    ``progress`` receives the log time, in [ns], now and then. LinkageError if ``/clock`` cannot
    represent the times of the bag.
    """
    ticks = None
    if options.clock:
        _clock_message(part.first)  # checks the time before anything is sent
        publish = node.create_publisher(Clock, CLOCK, 10).publish
        ticks = ClockTicks(NANOSECONDS / options.clock, lambda time: publish(_clock_message(time)))
    if options.wait:
        _wait_for_listener(publishers.values(), stop, options.wait)
    playback = Playback(
        part.first,
        options.rate,
        {name: publisher.publish for name, publisher in publishers.items()},
        SteadyClock(stop),
        ticks,
        progress,
    )
    error = None
    try:
        with closing(read_ahead(playback_queue(order, part), stop)) as messages:
            playback.send_messages(messages)
    except LinkageError as raised:
        error = raised
    if not stop.is_set():
        _wait_for_delivery(publishers.values())
    return playback, error


def _clock_message(time: int) -> bytes:
    """Return a serialized ``rosgraph_msgs/msg/Clock``, whose only field is a time."""
    if not 0 <= time < TIME_END:
        raise LinkageError(
            '--clock', f'{time} ns is beyond the times of messages', 'play it without --clock'
        )
    return time_message(time)


def _wait_for_listener(publishers: Collection[Publisher], stop: Event, seconds: float) -> None:
    """Wait until one of the publishers has a subscriber, for a time, in [s], at most."""
    deadline = monotonic() + seconds
    while monotonic() < deadline and not stop.is_set():
        if any(publisher.get_subscription_count() for publisher in publishers):
            stop.wait(_ACQUAINTANCE)
            return
        stop.wait(_LOOK)


def _wait_for_delivery(publishers: Collection[Publisher]) -> None:
    """Wait until the last reliable messages have reached the subscribers."""
    deadline = monotonic() + _DELIVERY
    for publisher in publishers:
        left = max(0.0, deadline - monotonic())
        publisher.wait_for_all_acked(Duration(nanoseconds=round(left * NANOSECONDS)))
