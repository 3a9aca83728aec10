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


"""
Print the messages of a topic as YAML, or their rate, to Ctrl-C.

It is for installations without ros2 topic echo and ros2 topic hz. Values are those of the message:
in SI units and radians. Exit code 1: no message came within --seconds.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import inf
import sys
from threading import Event
from time import monotonic
from typing import Any

from linkage_ros.cli.arguments import bounded
from linkage_ros.errors import clean, did_you_mean, LinkageError, listed, shortened
from linkage_ros.messages.joint_values import EFFORT, JOINT_STATE, POSITION, RATE, UNITS
from linkage_ros.node.player import player_node
from linkage_ros.replay.topic_description import message_type
from linkage_ros.signals import heeded
import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
import yaml

EXAMPLE = 'linkage echo /joint_states --count 3'

_PATIENCE = 2.0
"""Time without a message after which the topics that exist are listed, in [s]."""

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
        '--count', type=bounded(1, 10**9, int), default=inf, help='end after so many messages'
    )
    parser.add_argument(
        '--seconds', type=bounded(1e-9, 1e9), default=inf, help='how long; without it, to Ctrl-C'
    )
    parser.add_argument(
        '--rate', action='store_true', help='print once a second how often messages come'
    )


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Print messages; return 1 if none came within the time limit."""
    topic = arguments.topic if arguments.topic.startswith('/') else f'/{arguments.topic}'
    end = monotonic() + arguments.seconds
    with heeded(), player_node([], 'linkage_echo') as node:
        kind = _await_type(node, topic, end, stop)
        if kind is None:
            return int(not stop.is_set())
        arrivals: list[float] = []
        _receive(node, topic, kind, arguments, arrivals, end, stop)
    if len(arrivals) > 1 and not arguments.rate:
        text = f'{topic}: {len(arrivals)} messages, {rate_text(arrivals)}'
        print(f'linkage echo: {text}', file=sys.stderr)
    return int(not arrivals and not stop.is_set())


def _await_type(node: Node, topic: str, end: float, stop: Event) -> str | None:
    """Return the type of a topic when it exists; None after the time limit or a stop request."""
    patient = monotonic() + _PATIENCE
    while not stop.is_set() and monotonic() < end:
        types = dict(node.get_topic_names_and_types()).get(topic, [])
        if len(types) > 1:
            raise LinkageError(topic, f'has several types: {listed(types)}', 'end one publisher')
        if types:
            return str(types[0])
        if monotonic() >= patient:
            patient = inf
            _say_silence(node, topic)
        stop.wait(_LOOK)
    return None


def _receive(
    node: Node,
    topic: str,
    kind: str,
    arguments: argparse.Namespace,
    arrivals: list[float],
    end: float,
    stop: Event,
) -> None:
    """Print messages, or their rate, until the end; collect their times of arrival, in [s]."""
    seen = 0

    def arrive(message: Any) -> None:
        nonlocal seen
        # More messages than asked for may wait at once.
        if seen >= arguments.count:
            return
        seen += 1
        arrivals.append(monotonic())
        if not arguments.rate:
            print(f'{as_yaml(message, kind)}---', flush=True)

    node.create_subscription(
        message_type(kind, topic), topic, arrive, _qos(node, topic), raw=arguments.rate
    )
    begin = told = monotonic()
    while not stop.is_set() and monotonic() < end and seen < arguments.count:
        rclpy.spin_once(node, timeout_sec=min(_LOOK, max(0.0, end - monotonic())))
        now = monotonic()
        if not seen and begin + _PATIENCE <= now:
            begin = inf
            _say_silence(node, topic)
        if arguments.rate and now - told >= 1.0:
            told = now
            if len(arrivals) > 1:
                print(f'{topic}: {rate_text(arrivals)}', flush=True)
            # The next rate counts from the last message of this one.
            del arrivals[:-1]
    if arguments.rate and len(arrivals) > 1:
        print(f'{topic}: {rate_text(arrivals)}', flush=True)


def _qos(node: Node, topic: str) -> QoSProfile:
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


def _say_silence(node: Node, topic: str) -> None:
    """Report on standard error that no message came, and which topics have publishers."""
    topics = {name: node.count_publishers(name) for name, _ in node.get_topic_names_and_types()}
    others = [name for name, count in topics.items() if count and name != topic]
    remedy = did_you_mean(topic, others, f'topics: {listed(others) or "none"}')
    text = f'{topic}: no message for {_PATIENCE:g} s ({topics.get(topic, 0)} publishers)'
    print(clean(f'linkage echo: {text}; {remedy}'), file=sys.stderr, flush=True)


def rate_text(arrivals: Sequence[float]) -> str:
    """Return the rate of two or more messages from their times of arrival, in [s]."""
    periods = [after - before for before, after in pairwise(arrivals)]
    # Messages that waited together can arrive at one reading of the clock.
    rate = len(periods) / max(sum(periods), 1e-9)
    return f'{rate:.1f} Hz, period {min(periods) * 1e3:.2f} to {max(periods) * 1e3:.2f} ms'


def as_yaml(message: Any, kind: str) -> str:
    """Return a message as YAML, with the units of a joint state as comments."""
    text: str = yaml.safe_dump(
        _plain(message), default_flow_style=None, sort_keys=False, allow_unicode=True, width=inf
    )
    if kind != JOINT_STATE:
        return text
    lines = []
    for line in text.splitlines():
        quantity = _FIELDS.get(line.partition(':')[0])
        lines.append(f'{line}  # {" or ".join(UNITS[quantity])}' if quantity else line)
    return '\n'.join(lines) + '\n'


def _plain(value: Any) -> Any:
    """Return a field of a message as YAML holds it; of a long one the beginning."""
    if hasattr(value, 'get_fields_and_field_types'):
        return {name: _plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, str):
        return shortened(value, _LONGEST_TEXT)
    if isinstance(value, bool | int | float | Mapping):
        return value
    items = list(value[:_MOST_ITEMS])
    more = len(value) - len(items)
    return [*map(_plain, items), *([f'… and {more} more'] if more else [])]
