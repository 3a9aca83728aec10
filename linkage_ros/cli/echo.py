# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Print the messages of a topic as YAML, or their rate, until Ctrl-C.

It is for installations without ros2 topic echo and ros2 topic hz. Values are unchanged: SI units
and radians. Exit code 1: no message came, or fewer than --count.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import pairwise
from math import inf, isfinite
import sys
from threading import Event
from time import monotonic
from typing import Any

from linkage_ros.cli.arguments import bounded_number
from linkage_ros.errors import did_you_mean, escape_unprintable, LinkageError, list_names, shorten
from linkage_ros.messages import EFFORT, JOINT_STATE_TYPE, POSITION, RATE, UNITS
from linkage_ros.node import leave_out_shared_memory
from linkage_ros.replay import message_type
from linkage_ros.signals import bounded_end, heed_signals
import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
import yaml

EXAMPLE = 'linkage echo /joint_states --count 3'

_PATIENCE = 2.0
"""Time without a message after which the topics that exist are listed, in [s]."""

_TIMEOUT = 10.0
"""Time without a message after which a command with a count ends, in [s]."""

_LOOK = 0.1
"""Time between two looks at the stop event, in [s]."""

_DEPTH = 1000
"""Messages that may wait to be printed."""

_MOST_ITEMS, _LONGEST_TEXT = 128, 1000
"""How much of a long array and of a long text is printed."""

_FIELDS = {'position': POSITION, 'velocity': RATE, 'effort': EFFORT}
"""Quantities of the fields of a joint state."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        'topic',
        nargs='?',
        default='/joint_states',
        metavar='TOPIC',
        help='the topic; without it, /joint_states',
    )
    parser.add_argument(
        '--count',
        type=bounded_number(1, 10**9, int),
        default=inf,
        metavar='N',
        help='end after this number of messages',
    )
    parser.add_argument(
        '--seconds',
        type=bounded_number(1e-9, 1e9),
        default=inf,
        help='duration; without it, until Ctrl-C',
    )
    parser.add_argument(
        '--timeout',
        type=bounded_number(1e-9, 1e9),
        metavar='SECONDS',
        help='how long to wait for a message before the end; without it, '
        f'{_TIMEOUT:g} with --count, else never',
    )
    parser.add_argument(
        '--rate', action='store_true', help='print the rate of messages once a second'
    )


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Print messages; return 1 if fewer came than were asked for."""
    topic = arguments.topic if arguments.topic.startswith('/') else f'/{arguments.topic}'
    end = monotonic() + arguments.seconds
    timeout = arguments.timeout or (_TIMEOUT if isfinite(arguments.count) else inf)
    seen = 0
    with heed_signals(), _listening_node() as node:
        silence = _SilenceTimer(node, topic, timeout)
        kind = _await_type(node, topic, silence, end, stop)
        if kind is not None:
            seen = _receive_messages(node, topic, kind, arguments, silence, end, stop)
    missing = not seen or (isfinite(arguments.count) and seen < arguments.count)
    return int(missing and not stop.is_set())


@contextmanager
def _listening_node() -> Iterator[Node]:
    """Create a node within a context; LinkageError if it cannot be."""
    leave_out_shared_memory()
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        node = Node('linkage_echo', start_parameter_services=False)
    except Exception as error:  # noqa: BLE001 (rcl's errors have no common base class)
        rclpy.try_shutdown()
        reason = ' '.join(str(error).strip().splitlines()[:1]) or type(error).__name__
        raise LinkageError('ROS', reason, 'see ROS_DOMAIN_ID and RMW_IMPLEMENTATION') from None
    try:
        yield node
    finally:
        with bounded_end(1):
            node.destroy_node()
            rclpy.try_shutdown()


class _SilenceTimer:
    """The time without a message: reported once; too long after ``timeout``, in [s]."""

    def __init__(self, node: Node, topic: str, timeout: float) -> None:
        self._node, self._topic, self._timeout = node, topic, timeout
        self._reported = False
        self.since = monotonic()

    def too_long(self) -> bool:
        """Report the silence if it is time to; return whether it is too long."""
        silent = monotonic() - self.since
        patience = min(_PATIENCE, self._timeout)
        if silent >= patience and not self._reported:
            self._reported = True
            _print_note(f'{self._topic}: no message for {patience:g} s {self._publishers_text()}')
        if silent < self._timeout:
            return False
        _print_note(
            f'{self._topic}: ended after {self._timeout:g} s without a message (--timeout)'
        )
        return True

    def _publishers_text(self) -> str:
        """Return how many publishers the topic has, and which topics have some."""
        topics = {
            name: self._node.count_publishers(name)
            for name, _ in self._node.get_topic_names_and_types()
        }
        others = [name for name, count in topics.items() if count and name != self._topic]
        remedy = did_you_mean(self._topic, others, f'topics: {list_names(others) or "none"}')
        return f'({topics.get(self._topic, 0)} publishers); {remedy}'


def _await_type(
    node: Node, topic: str, silence: _SilenceTimer, end: float, stop: Event
) -> str | None:
    """Return the type of a topic when it exists; None if the wait ended before."""
    while not stop.is_set() and monotonic() < end and not silence.too_long():
        types = dict(node.get_topic_names_and_types()).get(topic, [])
        if len(types) > 1:
            raise LinkageError(
                topic, f'has several types: {list_names(types)}', 'end one publisher'
            )
        if types:
            return str(types[0])
        stop.wait(_LOOK)
    return None


def _receive_messages(
    node: Node,
    topic: str,
    kind: str,
    arguments: argparse.Namespace,
    silence: _SilenceTimer,
    end: float,
    stop: Event,
) -> int:
    """Print messages, or their rate, until the end; return how many came."""
    seen = 0
    arrivals: list[float] = []

    def take_message(message: Any) -> None:
        nonlocal seen
        # More messages than asked for may wait at once.
        if seen >= arguments.count:
            return
        seen += 1
        silence.since = monotonic()
        arrivals.append(silence.since)
        if not arguments.rate:
            print(f'{as_yaml(message, kind)}---', flush=True)

    node.create_subscription(
        message_type(kind, topic),
        topic,
        take_message,
        _compatible_qos(node, topic),
        raw=arguments.rate,
    )
    last_report = monotonic()
    while not stop.is_set() and monotonic() < end and seen < arguments.count:
        rclpy.spin_once(node, timeout_sec=min(_LOOK, max(0.0, end - monotonic())))
        if silence.too_long():
            break
        now = monotonic()
        if arguments.rate and now - last_report >= 1.0:
            last_report = now
            if len(arrivals) > 1:
                print(f'{topic}: {rate_text(arrivals)}', flush=True)
            # The next rate counts from the last message of this one.
            del arrivals[:-1]
    if len(arrivals) > 1:
        if arguments.rate:
            print(f'{topic}: {rate_text(arrivals)}', flush=True)
        else:
            _print_note(f'{topic}: {seen} messages, {rate_text(arrivals)}')
    return seen


def _compatible_qos(node: Node, topic: str) -> QoSProfile:
    """Return a quality of service that is compatible with all publishers of a topic."""
    offered = [info.qos_profile for info in node.get_publishers_info_by_topic(topic)]
    reliable = all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offered)
    latched = all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered)
    return QoSProfile(
        depth=_DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=(
            DurabilityPolicy.TRANSIENT_LOCAL if latched and offered else DurabilityPolicy.VOLATILE
        ),
    )


def _print_note(text: str) -> None:
    print(escape_unprintable(f'linkage echo: {text}'), file=sys.stderr, flush=True)


def rate_text(arrivals: Sequence[float]) -> str:
    """Return the rate of two or more messages from their times of arrival, in [s]."""
    periods = [after - before for before, after in pairwise(arrivals)]
    # Messages that waited together can arrive at one reading of the clock.
    rate = len(periods) / max(sum(periods), 1e-9)
    return f'{rate:.1f} Hz, period {min(periods) * 1e3:.2f} to {max(periods) * 1e3:.2f} ms'


def as_yaml(message: Any, kind: str) -> str:
    """Return a message as YAML, with the units of a joint state as comments."""
    text: str = yaml.safe_dump(
        _yaml_value(message),
        default_flow_style=None,
        sort_keys=False,
        allow_unicode=True,
        width=inf,
    )
    if kind != JOINT_STATE_TYPE:
        return text
    lines = []
    for line in text.splitlines():
        quantity = _FIELDS.get(line.partition(':')[0])
        lines.append(f'{line}  # {" or ".join(UNITS[quantity])}' if quantity else line)
    return '\n'.join(lines) + '\n'


def _yaml_value(value: Any) -> Any:
    """Return a field of a message as YAML holds it; of a long one the beginning."""
    if hasattr(value, 'get_fields_and_field_types'):
        return {
            name: _yaml_value(getattr(value, name)) for name in value.get_fields_and_field_types()
        }
    if isinstance(value, str):
        return shorten(value, _LONGEST_TEXT)
    if isinstance(value, bool | int | float | Mapping):
        return value
    items = list(value[:_MOST_ITEMS])
    more = len(value) - len(items)
    return [*map(_yaml_value, items), *([f'… and {more} more'] if more else [])]
