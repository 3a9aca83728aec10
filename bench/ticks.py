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


"""(a), (b) What a tick costs, against the idiomatic node and the bare loop, and how late it is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
import time

from bench.cpu_time import cpu_time
from bench.processes import BenchError, Graph, Process
from bench.report import say
from bench.scenes import write_many, write_scene

_APPEARING = 15.0
"""How long a node may take to publish its first joint state, in [s]."""


@dataclass(frozen=True, slots=True)
class TickPlan:
    """
    How much is measured.

    Attributes
    ----------
    rounds
        How often each is measured, in turn.
    warm_up, window
        Time before and of a measurement, in [s].

    """

    rounds: int
    warm_up: float
    window: float


@dataclass(frozen=True, slots=True)
class Contender:
    """
    Something that ticks.

    Attributes
    ----------
    name
        What the tables call it.
    rate
        Ticks wanted a second.
    module
        What is run.
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
        Of all its threads, in [µs] a tick.
    rate
        Ticks a second, as the listener tells.
    unheard
        Messages of the window that the listener did not get.
    waited
        For how much of the time its threads waited for a processor, all together: others had it.
    health
        The node's last diagnostics that arrived, counted from its start; empty where none did.

    """

    cpu: float
    rate: float
    unheard: int
    waited: float
    health: dict[str, str]


def ours(folder: Path, rate: float, record: bool = False) -> Contender:
    """Return our node, at a rate, in [Hz]."""
    scene = write_scene(folder, rate, record)
    return Contender(
        'linkage_node + bag' if record else 'linkage_node',
        rate,
        'linkage_ros.ros.linkage_node',
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
        'linkage_ros.ros.linkage_node',
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
        How much is measured.
    busy
        How many processes beside them take all that they get of a processor.

    """
    found: dict[Contender, list[Measurement]] = {contender: [] for contender in contenders}
    with ExitStack() as stack:
        stack.enter_context(graph.run('linkage_ros.ros.crank_source'))
        listener = stack.enter_context(graph.run('bench.listener'))
        for _ in range(busy):
            stack.enter_context(graph.run('bench.busy'))
        for number in range(plan.rounds):
            # There and back again, so that a drift of the machine favours no one.
            for contender in contenders if number % 2 == 0 else reversed(contenders):
                measured = _measure(graph, contender, listener, plan)
                found[contender].append(measured)
                say(
                    f'  {number + 1}/{plan.rounds} {contender.name} at {contender.rate:g} Hz: '
                    f'{measured.cpu:.1f} µs a tick, {measured.rate:.0f} ticks a second, '
                    f'waited {measured.waited:.0%}'
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
        raise BenchError(f'{contender.name}: did not tick in {plan.window:g} s')
    return Measurement(
        cpu=(ran_then - ran) / ticks / 1e3,
        rate=ticks / duration * 1e9,
        unheard=ticks - (after['received'] - before['received']),
        waited=(waited_then - waited) / duration,
        health=listener.ask('?')['health'],
    )


def _wait_for(condition: Callable[[], bool], process: Process) -> None:
    until = time.monotonic() + _APPEARING
    while not condition():
        process.check()
        if time.monotonic() > until:
            raise BenchError(f'{process.name}: no joint state in {_APPEARING:g} s')
        time.sleep(0.05)
