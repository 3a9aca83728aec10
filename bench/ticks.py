# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""(a), (b) Cost and lateness of a tick, compared with the idiomatic node and the bare loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path
import time

from bench import ROOT
from bench.processes import Graph, MeasurementError, Process
from bench.report import ratios, say, spread, Table
from linkage_ros.tools.study import alternate_order

_FOUR_BAR = ROOT / 'config' / 'linkages' / 'four_bar.yaml'


def cpu_time(pid: int) -> tuple[int, int]:
    """Return run time and wait time of all threads of a process, in [ns]."""
    run = waited = 0
    for task in Path(f'/proc/{pid}/task').iterdir():
        ran, queued, _ = map(int, (task / 'schedstat').read_text().split())
        run += ran
        waited += queued
    return run, waited


def write_scene(folder: Path, rate: float, record: bool = False) -> Path:
    """Write a scene with a rate in [Hz], 0 for a tick for each sample, and return its file."""
    lines = [f'linkage: {_FOUR_BAR}', 'drive: {topic: {carry_forward: true, max_age: 0.2}}']
    if record:
        lines.append(f'record: {{directory: {folder / "bags"}}}')
    return _write(folder / f'four_bar_{rate:g}{"_recorded" if record else ""}.yaml', rate, lines)


def write_turning(folder: Path, rate: float) -> Path:
    """Write a scene of a four-bar that turns at a constant rate; return its file."""
    lines = [f'linkage: {_FOUR_BAR}', 'drive: {constant_rate: {rate: 1.0}}']
    return _write(folder / f'turning_{rate:g}.yaml', rate, lines)


def write_many(folder: Path, rate: float, count: int) -> Path:
    """Write a scene of four-bars that turn at different constant rates; return its file."""
    lines = ['linkages:']
    for index in range(count):
        lines += [
            f'  - name: bar_{index}',
            f'    linkage: {_FOUR_BAR}',
            f'    drive: {{constant_rate: {{rate: {1.0 + 0.01 * index:g}}}}}',
        ]
    return _write(folder / f'{count}_four_bars.yaml', rate, lines)


def _write(file: Path, rate: float, lines: Sequence[str]) -> Path:
    common = f'rate: {rate:g}', 'effects: {velocity: {}}'
    file.write_text('\n'.join([*common, *lines, '']), encoding='utf-8')
    return file


_APPEARING = 15.0
"""Time limit for a node's first joint state, in [s]."""


@dataclass(frozen=True, slots=True)
class TickPlan:
    """Amount of the measurement."""

    rounds: int  # Number of measurements of each, in turn
    # Time before a measurement and its duration, in [s].
    warm_up: float
    window: float


@dataclass(frozen=True, slots=True)
class Contender:
    """A Python module that ticks, with its command line, its name in tables, and its rate."""

    name: str
    rate: float
    module: str
    arguments: Sequence[str]


@dataclass(frozen=True, slots=True)
class Measurement:
    """One window of a contender."""

    cpu: float  # Processor time of all its threads, in [µs] per tick
    rate: float  # Ticks per second, from the listener
    waited: float  # Fraction of the time that its threads waited for a processor, in total
    # The node's last diagnostics, with counts since its start; empty if none arrived.
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


def with_parameters(folder: Path, rate: float, *parameters: str) -> Contender:
    """Return our node with parameters, at a rate, in [Hz]."""
    node = ours(folder, rate)
    options = [word for parameter in parameters for word in ('-p', parameter)]
    return replace(
        node,
        name=' + '.join([node.name, *(name.partition(':=')[0] for name in parameters)]),
        arguments=(*node.arguments, *options),
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
    """Measure every contender in turn, beside a number of busy processes."""
    found: dict[Contender, list[Measurement]] = {contender: [] for contender in contenders}
    with ExitStack() as stack:
        stack.enter_context(graph.run_module('linkage_ros.node.crank_source'))
        listener = stack.enter_context(graph.run_module('bench.listener'))
        for _ in range(busy):
            stack.enter_context(graph.run_module('bench.busy'))
        for contender in alternate_order(contenders, plan.rounds):
            measured = _measure(graph, contender, listener, plan)
            found[contender].append(measured)
            say(
                f'  {len(found[contender])}/{plan.rounds} {contender.name} at '
                f'{contender.rate:g} Hz: {measured.cpu:.1f} µs a tick, {measured.rate:.0f} ticks '
                f'a second, waited {measured.waited:.0%}'
            )
    return found


def _measure(graph: Graph, contender: Contender, listener: Process, plan: TickPlan) -> Measurement:
    first = listener.ask_line('forget')
    with graph.run_module(contender.module, contender.arguments) as process:
        _wait_for(lambda: listener.ask_line('?')['received'] > first['received'], process)
        time.sleep(plan.warm_up)
        before, (ran, waited) = listener.ask_line('?'), cpu_time(process.pid)
        time.sleep(plan.window)
        after, (ran_then, waited_then) = listener.ask_line('?'), cpu_time(process.pid)
        process.check_running()
    process.check_end()
    duration = after['time'] - before['time']
    ticks = after['published'] - before['published']
    if ticks <= 0:
        raise MeasurementError(f'{contender.name}: did not tick in {plan.window:g} s')
    return Measurement(
        cpu=(ran_then - ran) / ticks / 1e3,
        rate=ticks / duration * 1e9,
        waited=(waited_then - waited) / duration,
        health=listener.ask_line('?')['health'],
    )


def _wait_for(condition: Callable[[], bool], process: Process) -> None:
    until = time.monotonic() + _APPEARING
    while not condition():
        process.check_running()
        if time.monotonic() > until:
            raise MeasurementError(f'{process.name}: no joint state in {_APPEARING:g} s')
        time.sleep(0.05)


Found = dict[Contender, list[Measurement]]


def cost_table(title: str, ours: Contender, other: Contender, target: str, found: Found) -> Table:
    """Return the cost of a tick of our node and of another program, and its target ratio."""
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
    """Return the lateness of ticks and the number of lost ones, from start to end of every run."""
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
