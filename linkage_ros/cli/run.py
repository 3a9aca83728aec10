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

"""Run a scene as a ROS 2 node, with a live display and a summary at the end."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from importlib.util import find_spec
from math import inf
from pathlib import Path
import sys
from threading import Event
from time import monotonic
from typing import Any

from linkage_ros.bag.reader import read_bag
from linkage_ros.cli.bag_reading import gaps
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics.status import Status
from linkage_ros.node.node import LinkageNode
from linkage_ros.node.run import run_linkage_node
from linkage_ros.node.tick_loop import TickLoop
from linkage_ros.pipeline.pipeline import Pipeline
from linkage_ros.replay.replay import recorded_scene, ReplayedTick
from linkage_ros.replay.verify import beginning_text, DIFFERENT, UNTOLD, verify_replay
from linkage_ros.signals import heeded

_RICH = find_spec('rich') is not None
if _RICH:
    from rich.console import Console, Group
    from rich.live import Live
    from rich.table import Table
    from rich.text import Text

_LIVE_PERIOD, _PLAIN_PERIOD = 0.25, 1.0
_MOST_SHOWN = 24
"""Maximum number of joints that fit on a screen."""

_Shown = tuple[str, float, float | None]


class Display:
    """
    Live display of a running node: a table drawn by rich, or one line a second.

    Parameters
    ----------
    plain
        Whether to print lines even where a live display is possible.

    """

    def __init__(self, *, plain: bool) -> None:
        live = not plain and _RICH and sys.stdout.isatty()
        self._live: Any = None
        if live:
            console = Console(file=sys.__stdout__)
            self._live = Live(console=console, transient=True, auto_refresh=False)
        self._period = _LIVE_PERIOD if live else _PLAIN_PERIOD
        self._shown = monotonic()
        self._before = (0, self._shown)
        self._entered = False

    def close(self) -> None:
        """End the display; calling it again does nothing."""
        if self._entered:
            self._live.stop()
            self._entered = False

    def show(self, node: LinkageNode) -> None:
        """Show the current state of the node, if an update is due."""
        now = monotonic()
        if node.loop is None or node.scene is None or now - self._shown < self._period:
            return
        self._shown = now
        ticks = node.loop.counts.ticks
        rate = (ticks - self._before[0]) / (now - self._before[1])
        self._before = (ticks, now)
        if self._live is None:
            print(_line(node.loop, rate), flush=True)
            return
        if not self._entered:
            self._live.start()
            self._entered = True
        self._live.update(_table(node.loop, rate), refresh=True)


def _state(loop: TickLoop) -> tuple[str, list[_Shown]]:
    """Return the input's age as text; name, value and rate of inputs and joints."""
    tick = loop.counts.last
    age = 'no crank'
    values: list[_Shown] = []
    for line, (crank, position, _, reading) in zip(
        loop.pipeline.lines, tick.looks if tick else (), strict=False
    ):
        if crank is None or position is None:
            continue
        if not position.joints:
            age = position.status.value
            if position.status is Status.OPEN:
                age += f', gap {position.gap:.3g} m'
            continue
        member = line.member
        age = f'{crank.age * 1e-6:.2f} ms'
        if not set(member.inputs) <= set(member.joints):
            values += zip(member.inputs, crank.angles, crank.rates, strict=True)
        if reading is not None:
            rates = reading.rates or [None] * len(reading.joints)
            values += zip(member.joints, reading.joints, rates, strict=True)
    return age, values[:_MOST_SHOWN]


def _line(loop: TickLoop, rate: float) -> str:
    age, values = _state(loop)
    counts = loop.counts
    shown = '  '.join(f'{name} {value:+.4f}' for name, value, _ in values)
    return f'{rate:7.1f} ticks/s  lost {counts.lost}  late {counts.late}  age {age}  {shown}'


def _table(loop: TickLoop, rate: float) -> Any:
    age, values = _state(loop)
    counts = loop.counts
    status = Text(
        f'{rate:.1f} ticks/s   {counts.late} late   {counts.lost} lost   input age {age}   '
        f'{counts.received} samples   {counts.published} published',
        no_wrap=True,
        overflow='ellipsis',
    )
    table = Table()
    table.add_column('joint')
    table.add_column('position [rad, m]', justify='right', min_width=18)
    table.add_column('rate [1/s]', justify='right', min_width=14)
    for name, value, speed in values:
        table.add_row(name, f'{value:+.6f}', '' if speed is None else f'{speed:+.5f}')
    return Group(status, table)


# The summary at the end of a run.


def summary(node: LinkageNode) -> str:
    """Return the summary of a node's last run."""
    loop = node.loop
    if loop is None:
        return 'nothing ran'
    counts = loop.counts
    per_second = counts.ticks / loop.seconds
    rows = [('ticks', f'{counts.ticks} in {loop.seconds:.2f} s, {per_second:.1f} a second')]
    if counts.lateness.count:
        p50, p99 = (counts.lateness.percentile(p) / 1e3 for p in (50, 99))
        longest = counts.lateness.longest / 1e3
        rows += [
            ('', f'{counts.late} late by more than a period, {counts.lost} lost'),
            ('lateness', f'p50 {p50:.0f} µs, p99 {p99:.0f} µs, max {longest:.0f} µs'),
        ]
    rows += [
        ('published', f'{counts.published} joint states; {counts.silent} ticks without a crank'),
    ]
    if counts.withheld:
        rows.append(('withheld', f'{counts.withheld} readings, by what the scene does to sensors'))
    if node.crank_topic:
        rows.append(('samples', loop.samples))
    rows += [
        (status.value, f'{counts.unclosed[status]} ticks')
        for status in Status
        if counts.unclosed[status]
    ]
    for memory in node.recording.memories:
        rows += [
            (
                'memory',
                f'{t.name}: {t.received} received, {t.kept} in it at the end, {t.let_go} let go'
                + (f', {t.dropped} dropped' if t.dropped else ''),
            )
            for t in memory.topics
        ]
        rows.append(('snapshots', memory.snapshots))
    for recording in node.recording.ended:
        rows += [
            (
                'recorded',
                f'{t.name}: {t.recorded} of {t.received}, {t.dropped} dropped'
                + (f', {t.let_go} let go with the oldest files' if t.let_go else ''),
            )
            for t in recording.topics
        ]
        rows += [('bag', str(recording.folder)), ('proof', _proof(recording.folder))]
    if node.recording.failure:
        rows.append(('FAILED', node.recording.failure))
    return '\n'.join(f'{name:<14}{text}' for name, text in rows)


def _proof(folder: Path) -> str:
    """Replay a bag: check that it gives the same bytes, and how well its loop closed."""
    worst = 0.0

    def look(replayed: ReplayedTick) -> None:
        nonlocal worst
        for closure, seen in zip(closures, replayed.tick.looks, strict=True):
            if seen.position is not None and seen.position.joints:
                worst = max(worst, closure.residual(seen.position))

    try:
        bag = read_bag(folder)
        # The run was the user's, and has imported these modules already.
        scene = recorded_scene(bag, trust_effects=True)
        pipeline = Pipeline(scene)
        closures = pipeline.closures
        proof = verify_replay(bag, scene, bag.messages(), look)
    except LinkageError as error:
        return str(error)
    if proof.verdict == UNTOLD:
        return f'{UNTOLD}: {beginning_text(proof)}'
    names = ['joint states', *(extra.topic.removeprefix('~/') for extra in pipeline.extras)]
    same = ' and '.join(
        f'{topic.same} of {topic.recorded} {name}'
        for name, topic in zip(names, proof.comparison.topics, strict=True)
    )
    notes = [beginning_text(proof)] if proof.beginning else []
    if proof.verdict == DIFFERENT:
        notes += gaps(bag)
    notes.append(f'worst loop residual {worst:.1e} m')
    return f'{same} replay to the same bytes; {"; ".join(notes)}'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('scene', help='the scene file; or a linkage file, which it moves')
    add_run_arguments(parser)
    parser.add_argument(
        '--ros-args', nargs=argparse.REMAINDER, default=[], help='remappings, parameters, QoS'
    )


def add_run_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments that all commands with a run share."""
    parser.add_argument(
        '--seconds', type=_seconds, default=inf, help='how long; without it, until Ctrl-C'
    )
    parser.add_argument('--runs', default='', metavar='FOLDER', help="folder of the bags' folders")
    parser.add_argument('--plain', action='store_true', help='a line a second, no live display')


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Run the scene."""
    ros = ['--ros-args', *arguments.ros_args] if arguments.ros_args else []
    code, _ = run_scene(arguments.scene, arguments, stop, ros)
    return code


def run_scene(
    scene: str, arguments: argparse.Namespace, stop: Event, ros: Sequence[str] = ()
) -> tuple[int, Path | None]:
    """Run a scene; return the exit code and the bag."""
    bags: list[Path] = []

    def at_end(node: LinkageNode) -> None:
        bags.extend(recording.folder for recording in node.recording.ended)
        print(summary(node))

    with heeded():
        code = run_linkage_node(
            stop,
            ros,
            {'scene': scene, 'runs_directory': arguments.runs},
            seconds=arguments.seconds,
            view=Display(plain=arguments.plain),
            at_end=at_end,
        )
    return code, bags[-1] if bags else None


def _seconds(text: str) -> float:
    seconds = float(text)
    if not 0.0 < seconds < 1e9:
        raise argparse.ArgumentTypeError(f'{text} is not a time; write seconds, more than 0')
    return seconds
