# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Publish a bag on the graph, at its own pace or another, to its end or Ctrl-C.

Types, qualities of service and bytes are as recorded, in the order of the log times. Topics that
cannot be published are left out and named.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from math import inf
import sys
from threading import Event

from linkage_ros.bag import Bag, is_in_use, LogTimeOrder, Topic
from linkage_ros.cli.arguments import add_bag, add_ros_arguments, bounded_number
from linkage_ros.cli.bag_reading import open_bag
from linkage_ros.cli.terminal import ProgressCallback, show_progress
from linkage_ros.errors import BagError, did_you_mean, escape_unprintable, LinkageError
from linkage_ros.messages import NANOSECONDS
from linkage_ros.node import (
    CLOCK,
    create_publishers,
    LATE,
    play,
    Playback,
    PlaybackOptions,
    PlaybackPart,
    player_node,
)
from linkage_ros.signals import heed_signals

_CLOCK_RATE = 40.0  # as ``ros2 bag play``

EXAMPLE = 'linkage play my_bag --rate 0.5'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_bag(parser)
    parser.add_argument(
        '--rate',
        type=bounded_number(0.01, 1000.0),
        default=1.0,
        metavar='FACTOR',
        help='seconds of the bag a second, 0.01 to 1000; without it 1',
    )
    parser.add_argument(
        '--clock',
        type=bounded_number(0.1, 10_000.0),
        nargs='?',
        const=_CLOCK_RATE,
        default=0.0,
        metavar='HZ',
        help=f"publish the bag's time on {CLOCK} at this rate [Hz]; without a number 40",
    )
    parser.add_argument(
        '--topics', nargs='+', metavar='TOPIC', help='play these only; without it, all'
    )
    parser.add_argument(
        '--start',
        type=bounded_number(0.0, 1e9),
        default=0.0,
        metavar='SECONDS',
        help='skip this time at the beginning of the bag',
    )
    parser.add_argument(
        '--seconds',
        type=bounded_number(1e-9, 1e9),
        default=inf,
        help="how long to play, in the bag's time; without it, to its end",
    )
    parser.add_argument('--loop', action='store_true', help='begin again at the end')
    parser.add_argument(
        '--wait',
        type=bounded_number(0.0, 1e6),
        default=0.0,
        metavar='SECONDS',
        help='how long to wait at most for a subscriber to one of the topics',
    )
    add_ros_arguments(parser, 'remappings: -r OLD:=NEW')


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Play the bag; return 1 if it is damaged and was played only up to the damage."""
    bag = open_bag(arguments.bag, stop)
    if bag.truncated:
        _say_truncated(bag)
    topics = _choose_topics(bag, arguments.topics)
    if arguments.clock:
        topics = _without_clock(topics)
    order = LogTimeOrder(bag)
    begin = order.begin
    if begin is None:
        raise BagError(bag.path, 'holds no messages', 'there is nothing to play')
    first = begin + round(arguments.start * NANOSECONDS)
    if order.end is not None and first > order.end:
        raise LinkageError(
            f'--start {arguments.start:g}',
            f'is behind the end of {bag.path}',
            f'it lasts {(order.end - begin) / 1e9:g} s',
        )
    ros = ['--ros-args', *arguments.ros_args] if arguments.ros_args else []
    with heed_signals(), player_node(ros) as node, show_progress('played [s]') as advance:
        publishers = create_publishers(node, topics, _print_error)
        if not publishers:
            raise BagError(bag.path, 'has no topic that can be published', 'nothing to play')
        part = PlaybackPart(
            first, first + arguments.seconds * NANOSECONDS, publishers, arguments.loop
        )
        options = PlaybackOptions(arguments.rate, arguments.clock, arguments.wait)
        last = min(part.last, inf if order.end is None else order.end)
        tell = partial(_report_progress, advance, first, last)
        playback, error = play(node, publishers, order, part, options, stop, tell)
    if not any(playback.counts.values()) and not stop.is_set():
        raise error or BagError(
            bag.path, 'holds no message of these topics at these times', 'nothing to play'
        )
    print(_summary_text(playback, arguments.rate))
    if error is not None:
        _print_error(error, 'ended early: ')
    return int(error is not None)


def _say_truncated(bag: Bag) -> None:
    """Report that a bag has no end; raise if it is still being written."""
    for file in bag.files:
        if is_in_use(file):
            raise BagError(file, 'is being written', 'end its recording first')
    print(
        f'linkage play: {bag.path}: unfinished: its recording was killed; its content is played',
        file=sys.stderr,
    )


def _choose_topics(bag: Bag, names: Sequence[str] | None) -> list[Topic]:
    """Return the topics to play."""
    if not bag.topics:
        raise BagError(bag.path, 'has no topics', 'there is nothing to play')
    topics = {topic.name: topic for topic in bag.topics}
    if names is None:
        return list(topics.values())
    for name in names:
        if name not in topics:
            others = f'there are: {escape_unprintable(", ".join(topics))}'
            remedy = did_you_mean(name, topics, others)
            raise LinkageError(name, f'{bag.path} has no such topic', remedy)
    return [topics[name] for name in dict.fromkeys(names)]


def _without_clock(topics: Sequence[Topic]) -> list[Topic]:
    """Return the topics without the clock's: two clocks would disagree."""
    if any(topic.name == CLOCK for topic in topics):
        _print_error(LinkageError(CLOCK, 'is left out', '--clock publishes its own'), '')
    return [topic for topic in topics if topic.name != CLOCK]


def _print_error(error: LinkageError, what: str = 'left out: ') -> None:
    print(f'linkage play: {what}{escape_unprintable(str(error))}', file=sys.stderr)


def _report_progress(advance: ProgressCallback, first: int, last: float, now: int) -> None:
    end = now if last == inf else int(last)
    advance((now - first) // NANOSECONDS, (end - first) // NANOSECONDS)


def _summary_text(playback: Playback, rate: float) -> str:
    """Return a summary of what was played."""
    of, took = f'{playback.played / 1e9:.3f} s of the bag', f'{playback.took / 1e9:.3f} s'
    sent = sum(playback.counts.values())
    late = f'{playback.late} of {sent} messages by more than {LATE / 1e6:g} ms'
    rows = [
        ('played', f'{of} in {took}, at a rate of {rate:g}'),
        *(('', f'{escape_unprintable(name)}: {count}') for name, count in playback.counts.items()),
        ('late', f'{late}; at most {playback.latest / 1e6:.1f} ms'),
    ]
    return '\n'.join(f'{head:<8}{text}' for head, text in rows)
