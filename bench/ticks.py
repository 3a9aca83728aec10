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


"""(a), (b) Cost and lateness of a tick, against the idiomatic node and the bare loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path
import time

from bench import ROOT
from bench.report import ratios, say, spread, Table
from linkage_ros.measuring import alternating
from linkage_ros.processes import Graph, MeasurementError, Process


def cpu_time(pid: int) -> tuple[int, int]:
    """Return run time and wait time of all threads of a process, in [ns]."""
    run = waited = 0
    for task in Path(f'/proc/{pid}/task').iterdir():
        ran, queued, _ = map(int, (task / 'schedstat').read_text().split())
        run += ran
        waited += queued
    return run, waited


def write_scene(folder: Path, rate: float, record: bool = False) -> Path:
    """
    Write a scene and return its file.

    Parameters
    ----------
    folder
        Folder of the scene and its bag.
    rate
        Ticks per second; 0 for one tick per sample.
    record
        Whether the scene records a bag.

    """
    file = folder / f'four_bar_{rate:g}{"_recorded" if record else ""}.yaml'
    lines = [
        f'linkage: {ROOT / "config" / "linkages" / "four_bar.yaml"}',
        f'rate: {rate:g}',
        'drive: {topic: {carry_forward: true, max_age: 0.2}}',
        'effects: {velocity: {}}',
    ]
    if record:
        lines.append(f'record: {{directory: {folder / "bags"}}}')
    file.write_text('\n'.join(lines) + '\n', encoding='utf-8')
    return file


def write_turning(folder: Path, rate: float) -> Path:
    """Write a scene of a four-bar that turns by itself, at a rate in [Hz]; return its file."""
    file = folder / f'turning_{rate:g}.yaml'
    lines = [
        f'linkage: {ROOT / "config" / "linkages" / "four_bar.yaml"}',
        f'rate: {rate:g}',
        'drive: {constant_rate: {rate: 1.0}}',
        'effects: {velocity: {}}',
    ]
    file.write_text('\n'.join(lines) + '\n', encoding='utf-8')
    return file


def write_many(folder: Path, rate: float, count: int) -> Path:
    """
    Write a scene of several four-bars that turn by themselves, each at a speed of its own.

    Parameters
    ----------
    folder
        The folder.
    rate
        Ticks per second.
    count
        How many.

    """
    file = folder / f'{count}_four_bars.yaml'
    linkage = ROOT / 'config' / 'linkages' / 'four_bar.yaml'
    lines = [f'rate: {rate:g}', 'effects: {velocity: {}}', 'linkages:']
    for number in range(count):
        lines += [
            f'  - name: bar_{number}',
            f'    linkage: {linkage}',
            f'    drive: {{constant_rate: {{rate: {1.0 + 0.01 * number:g}}}}}',
        ]
    file.write_text('\n'.join(lines) + '\n', encoding='utf-8')
    return file


_APPEARING = 15.0
"""Time limit for a node's first joint state, in [s]."""


@dataclass(frozen=True, slots=True)
class TickPlan:
    """
    Amount of the measurement.

    Attributes
    ----------
    rounds
        Number of measurements of each, in turn.
    warm_up, window
        Time before a measurement and its duration, in [s].

    """

    rounds: int
    warm_up: float
    window: float


@dataclass(frozen=True, slots=True)
class Contender:
    """
    A program that ticks.

    Attributes
    ----------
    name
        Its name in tables.
    rate
        Requested ticks per second.
    module
        The Python module to run.
    arguments
        Its command line.

    """

    name: str
    rate: float
    module: str
    arguments: Sequence[str]


@dataclass(frozen=True, slots=True)
class Measurement:
    """
    One window of a contender.

    Attributes
    ----------
    cpu
        Processor time of all its threads, in [µs] per tick.
    rate
        Ticks per second, from the listener.
    waited
        Fraction of the time that its threads waited for a processor, in total.
    health
        The node's last diagnostics, with counts since its start; empty if none arrived.

    """

    cpu: float
    rate: float
    waited: float
    health: dict[str, str]


def ours(folder: Path, rate: float, record: bool = False) -> Contender:
    """Return our node, at a rate, in [Hz]."""
    scene = write_scene(folder, rate, record)
    return Contender(
        'linkage_node + bag' if record else 'linkage_node',
        rate,
        'linkage_ros.node.linkage_node',
        ('--ros-args', '-p', f'scene:={scene}'),
    )


def asking(folder: Path, rate: float, *parameters: str) -> Contender:
    """Return our node with parameters, at a rate, in [Hz]."""
    node = ours(folder, rate)
    given = [word for parameter in parameters for word in ('-p', parameter)]
    return replace(
        node,
        name=' + '.join([node.name, *(name.partition(':=')[0] for name in parameters)]),
        arguments=(*node.arguments, *given),
    )


def many(folder: Path, rate: float, count: int) -> Contender:
    """Return our node with many linkages in one scene, at a rate, in [Hz]."""
    scene = write_many(folder, rate, count)
    return Contender(
        f'{count} four-bars in one node',
        rate,
        'linkage_ros.node.linkage_node',
        ('--ros-args', '-p', f'scene:={scene}'),
    )


def idiomatic(folder: Path, rate: float) -> Contender:
    """Return the idiomatic node, at a rate, in [Hz]."""
    scene = write_scene(folder, rate)
    return Contender('idiomatic node', rate, 'bench.idiomatic_node', (str(scene), f'{rate:g}'))


def bare(rate: float) -> Contender:
    """Return the bare loop, at a rate, in [Hz]."""
    return Contender('bare loop', rate, 'bench.bare_loop', (f'{rate:g}',))


def measure_ticks(
    graph: Graph, contenders: Sequence[Contender], plan: TickPlan, busy: int = 0
) -> dict[Contender, list[Measurement]]:
    """
    Measure every contender in turn, as many rounds as planned, and return what came.

    Parameters
    ----------
    graph
        Where they run.
    contenders
        Whom to measure.
    plan
        Amount of the measurement.
    busy
        How many processes beside them take all that they get of a processor.

    """
    found: dict[Contender, list[Measurement]] = {contender: [] for contender in contenders}
    with ExitStack() as stack:
        stack.enter_context(graph.run('linkage_ros.node.crank_source'))
        listener = stack.enter_context(graph.run('bench.listener'))
        for _ in range(busy):
            stack.enter_context(graph.run('bench.busy'))
        for contender in alternating(contenders, plan.rounds):
            measured = _measure(graph, contender, listener, plan)
            found[contender].append(measured)
            say(
                f'  {len(found[contender])}/{plan.rounds} {contender.name} at '
                f'{contender.rate:g} Hz: {measured.cpu:.1f} µs a tick, {measured.rate:.0f} ticks '
                f'a second, waited {measured.waited:.0%}'
            )
    return found


def _measure(graph: Graph, contender: Contender, listener: Process, plan: TickPlan) -> Measurement:
    heard = listener.ask('forget')
    with graph.run(contender.module, contender.arguments) as process:
        _wait_for(lambda: listener.ask('?')['received'] > heard['received'], process)
        time.sleep(plan.warm_up)
        before, (ran, waited) = listener.ask('?'), cpu_time(process.pid)
        time.sleep(plan.window)
        after, (ran_then, waited_then) = listener.ask('?'), cpu_time(process.pid)
        process.check()
    process.check_end()
    duration = after['time'] - before['time']
    ticks = after['published'] - before['published']
    if ticks <= 0:
        raise MeasurementError(f'{contender.name}: did not tick in {plan.window:g} s')
    return Measurement(
        cpu=(ran_then - ran) / ticks / 1e3,
        rate=ticks / duration * 1e9,
        waited=(waited_then - waited) / duration,
        health=listener.ask('?')['health'],
    )


def _wait_for(condition: Callable[[], bool], process: Process) -> None:
    until = time.monotonic() + _APPEARING
    while not condition():
        process.check()
        if time.monotonic() > until:
            raise MeasurementError(f'{process.name}: no joint state in {_APPEARING:g} s')
        time.sleep(0.05)


Found = dict[Contender, list[Measurement]]


def cost_table(title: str, ours: Contender, other: Contender, target: str, found: Found) -> Table:
    """
    Return the cost of a tick of ours beside that of another.

    Parameters
    ----------
    title
        Of the table.
    ours, other
        Whom to compare.
    target
        For the ratio; '' where there is none.
    found
        What was measured.

    """
    table = Table(title, ('', 'CPU µs a tick', 'ticks a second', 'ratio', 'target'))
    ratio = ratios([m.cpu for m in found[ours]], [m.cpu for m in found[other]])
    for contender in (ours, other):
        table.rows.append(
            (
                contender.name,
                spread([m.cpu for m in found[contender]]),
                spread([m.rate for m in found[contender]], 0),
                spread(ratio, 3) if contender is ours else '1',
                target if contender is ours else '',
            )
        )
    return table


def lateness_table(contenders: Sequence[Contender], found: Found, load: str = '') -> Table:
    """
    Return how late ticks were and how many were lost, from start to end of every run.

    Parameters
    ----------
    contenders
        Whom to show: nodes that tell in their diagnostics.
    found
        What was measured.
    load
        What else ran.

    """
    table = Table(
        f'lateness{load} from start to end of each run; target: no tick lost on a quiet core',
        ('', 'p50 µs', 'p99 µs', 'longest µs', '> period', 'lost', 'of ticks', 'CPU µs',
         'bag dropped', 'waited for CPU'),
    )  # fmt: skip
    for contender in contenders:
        healths = [m.health for m in found[contender] if m.health]
        table.rows.append(
            (
                f'{contender.name}, {contender.rate / 1e3:g} kHz',
                spread([float(h['Lateness p50 (us)']) for h in healths], 0),
                spread([float(h['Lateness p99 (us)']) for h in healths], 0),
                f'{max((float(h["Lateness max (us)"]) for h in healths), default=nan):.0f}',
                str(sum(int(h['Late by more than a period']) for h in healths)),
                str(sum(int(h['Lost ticks']) for h in healths)),
                str(sum(int(h['Events since startup']) for h in healths)),
                spread([m.cpu for m in found[contender]]),
                str(sum(_dropped(h) for h in healths)),
                spread([100.0 * m.waited for m in found[contender]], 0) + ' %',
            )
        )
    return table


def _dropped(health: dict[str, str]) -> int:
    return sum(int(value) for key, value in health.items() if key.startswith('Dropped: '))
