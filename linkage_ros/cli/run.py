# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Run a scene as a ROS 2 node, with a live display and a summary at the end."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from math import inf
from pathlib import Path
import sys
from threading import Event
from time import monotonic
from typing import Any, NamedTuple

from linkage_ros.cli.arguments import (
    add_radians,
    add_ros_arguments,
    add_set,
    bounded_number,
    DisplayUnits,
    SCENE_HELP,
)
from linkage_ros.cli.page_of_run import check_page, PageOfRun, view_command
from linkage_ros.cli.proof import LONGEST_PROOF, proof_of
from linkage_ros.cli.table import Table
from linkage_ros.cli.terminal import print_tables
from linkage_ros.kinematics import Linkage, Status
from linkage_ros.node import LinkageNode, run_linkage_node
from linkage_ros.replay import turning_joints
from linkage_ros.signals import heed_signals
from linkage_ros.tick import TickLoop

_RICH = find_spec('rich') is not None
if _RICH:
    from rich.console import Console, Group
    from rich.live import Live
    from rich.table import Table as RichTable
    from rich.text import Text

_LIVE_PERIOD, _PLAIN_PERIOD = 0.25, 1.0
_MOST_SHOWN = 24
"""Maximum number of joints that fit on a screen."""

EXAMPLE = 'linkage run worn_press --seconds 5 --set rate=500'


class JointRow(NamedTuple):
    """A joint as the display shows it; its rate is '' if it is unknown."""

    name: str
    value: str
    rate: str


class Display:
    """
    Live display of a running node: a table drawn by rich, or one line a second if ``plain``.

    It may serve a page of the run.
    """

    def __init__(self, *, plain: bool, angles: DisplayUnits, page: bool = False) -> None:
        self._angles = angles
        self._with_page = page
        self._page: PageOfRun | None = None
        live = not plain and _RICH and sys.stdout.isatty()
        self._live: Any = None
        if live:
            console = Console(file=sys.__stdout__)
            self._live = Live(console=console, transient=True, auto_refresh=False)
        self._period = _LIVE_PERIOD if live else _PLAIN_PERIOD
        self._shown = monotonic()
        self._before = (0, self._shown)
        self._entered = False

    def begin(self, node: LinkageNode) -> None:
        """Open the page of the run, or say how it is opened."""
        if self._with_page:
            self._page = PageOfRun(node.get_fully_qualified_name(), self._say_page)
        elif node.scene is None or all(
            isinstance(linkage.linkage, Linkage) for linkage in node.scene.linkages
        ):
            self._say_page(f'{view_command()}   (in a second terminal)')

    def _say_page(self, line: str) -> None:
        text = f'page      {line}'
        if self._entered:
            self._live.console.print(Text(text))
        else:
            print(text, flush=True)

    def close(self) -> None:
        """End display and page; calling it again does nothing."""
        if self._page is not None:
            self._page.end_process()
            self._page = None
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
        units = self._angles.of_file(node.scene.units)
        age, joints = _current_state(node.loop, turning_joints(node.scene), units)
        if self._live is None:
            print(_status_line(node.loop, rate, age, joints), flush=True)
            return
        if not self._entered:
            self._live.start()
            self._entered = True
        self._live.update(_status_table(node.loop, rate, age, joints), refresh=True)


def _current_state(
    loop: TickLoop, turning: Mapping[str, bool], units: DisplayUnits
) -> tuple[str, list[JointRow]]:
    """Return the input's age as text, and the inputs and joints to show."""
    tick = loop.counts.last_tick
    age = 'no crank'
    values: list[tuple[str, float, float | None]] = []
    for linkage, state in zip(loop.pipeline.linkages, tick.states if tick else (), strict=False):
        crank, position, reading = state.crank, state.position, state.reading
        if crank is None or position is None:
            continue
        if not position.joints:
            age = position.status.value
            if position.status is Status.OPEN:
                age += f', gap {units.format_length(position.gap, ".3g")}'
            continue
        scene_linkage = linkage.scene_linkage
        age = f'{crank.age * 1e-6:.2f} ms'
        if not set(scene_linkage.input_names) <= set(scene_linkage.joint_names):
            values += zip(scene_linkage.input_names, crank.angles, crank.rates, strict=True)
        if reading is not None:
            rates = reading.rates or [None] * len(reading.joints)
            values += zip(scene_linkage.joint_names, reading.joints, rates, strict=True)
    return age, [_shown_joint(*joint, turning[joint[0]], units) for joint in values[:_MOST_SHOWN]]


def _shown_joint(
    name: str, value: float, rate: float | None, turning: bool, units: DisplayUnits
) -> JointRow:
    rate_text = ''
    if rate is not None:
        unit = 'rad/s' if turning else 'm/s'
        rate_text = f'{units.convert(rate, unit):.4f} {units.name_unit(unit)}'
    return JointRow(name, units.value_text(value, turning), rate_text)


def _status_line(loop: TickLoop, rate: float, age: str, joints: Sequence[JointRow]) -> str:
    counts = loop.counts
    shown = '  '.join(f'{joint.name} {joint.value}' for joint in joints)
    return f'{rate:7.1f} ticks/s  lost {counts.lost}  late {counts.late}  age {age}  {shown}'


def _status_table(loop: TickLoop, rate: float, age: str, joints: Sequence[JointRow]) -> Any:
    counts = loop.counts
    status = Text(
        f'{rate:.1f} ticks/s   {counts.late} late   {counts.lost} lost   input age {age}   '
        f'{counts.received} samples   {counts.published} published',
        no_wrap=True,
        overflow='ellipsis',
    )
    table = RichTable()
    table.add_column('joint')
    table.add_column('position', justify='right', min_width=18)
    table.add_column('rate', justify='right', min_width=18)
    for joint in joints:
        table.add_row(*joint)
    return Group(status, table)


# The summary at the end of a run.


def summary_table(node: LinkageNode, longest: float) -> Table:
    """Return the summary of a node's last run; the proof of its bag takes a time in [s]."""
    loop = node.loop
    if loop is None:
        return Table('', ('',), [('nothing ran',)])
    counts = loop.counts
    per_second = counts.ticks / loop.run_seconds
    rows = [('ticks', f'{counts.ticks} in {loop.run_seconds:.2f} s, {per_second:.1f} a second')]
    if counts.lateness.count:
        p50, p99 = (counts.lateness.percentile(p) / 1e3 for p in (50, 99))
        longest = counts.lateness.longest / 1e3
        rows += [
            ('', f'{counts.late} late by more than a period, {counts.lost} lost'),
            ('lateness', f'p50 {p50:.0f} µs, p99 {p99:.0f} µs, max {longest:.0f} µs'),
        ]
    rows += [
        (
            'published',
            f'{counts.published} joint states; {counts.without_crank} ticks without a crank',
        ),
    ]
    if counts.suppressed:
        rows.append(
            ('withheld', f'{counts.suppressed} readings, by the sensor effects of the scene')
        )
    if node.crank_topic:
        rows.append(('samples', loop.sample_counts_text))
    rows += [
        (status.value, f'{counts.unclosed[status]} ticks')
        for status in Status
        if counts.unclosed[status]
    ]
    for memory in node.recording.memories:
        rows += [
            (
                'memory',
                f'{t.name}: {t.received} received, {t.recorded} in memory, {t.discarded} discarded'
                + (f', {t.dropped} dropped' if t.dropped else ''),
            )
            for t in memory.topics
        ]
        rows.append(('snapshots', memory.snapshots))
    for recording in node.recording.ended_bags:
        rows += [
            (
                'recorded',
                f'{t.name}: {t.recorded} of {t.received}, {t.dropped} dropped'
                + (f', {t.discarded} discarded with the oldest files' if t.discarded else ''),
            )
            for t in recording.topics
        ]
        ticks = max((t.recorded for t in recording.topics), default=0)
        rows += [
            ('bag', str(recording.folder)),
            ('proof', proof_of(recording.folder, ticks, longest)),
        ]
    if node.recording.failure:
        rows.append(('FAILED', node.recording.failure))
    return Table('', ('', ''), rows)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('scene', metavar='SCENE', help=f'{SCENE_HELP}; a linkage gets a drive')
    add_run_arguments(parser)
    add_ros_arguments(parser, 'remappings, parameters, QoS')


def add_run_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments that all commands with a run share."""
    add_set(parser)
    parser.add_argument(
        '--seconds',
        type=bounded_number(1e-9, 1e9),
        default=inf,
        help='duration; without it, until Ctrl-C',
    )
    parser.add_argument('--runs', default='', metavar='FOLDER', help='parent folder of the bags')
    parser.add_argument(
        '--plain', action='store_true', help='one line per second, no live display'
    )
    parser.add_argument(
        '--view', action='store_true', help='serve a page of the run, as linkage view --node does'
    )
    parser.add_argument(
        '--prove',
        action='store_true',
        help='replay the whole bag at the end; without it, as much as takes 2 s',
    )
    add_radians(parser)


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Run the scene."""
    ros = ['--ros-args', *arguments.ros_args] if arguments.ros_args else []
    code, _ = run_scene(arguments.scene, arguments, stop, ros)
    return code


def run_scene(
    scene: str,
    arguments: argparse.Namespace,
    stop: Event,
    ros: Sequence[str] = (),
    *,
    patience: float = 0.0,
) -> tuple[int, Path | None]:
    """Run a scene, see `run_linkage_node`; return the exit code and the bag."""
    bags: list[Path] = []

    def at_end(node: LinkageNode) -> None:
        bags.extend(recording.folder for recording in node.recording.ended_bags)
        print_tables(summary_table(node, inf if arguments.prove else LONGEST_PROOF))

    if arguments.view:
        check_page()
    display = Display(plain=arguments.plain, angles=arguments.angles, page=arguments.view)
    try:
        with heed_signals():
            code = run_linkage_node(
                stop,
                ros,
                {
                    'scene': scene,
                    'runs_directory': arguments.runs,
                    'set': arguments.set or [''],
                },
                seconds=arguments.seconds,
                patience=patience,
                view=display,
                at_end=at_end,
                raise_errors=True,
            )
    finally:
        display.close()
    return code, bags[-1] if bags else None
