# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""(c) Latency from a crank sample to its joint state, compared with a relay of bytes."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from math import isnan
from pathlib import Path

from bench.processes import Graph
from bench.report import ratios, say, spread, Table
from bench.ticks import write_scene
from linkage_ros.tools.study import percentile

TARGET = 1.25

_OURS, _RELAY = 'linkage_node', 'raw_relay'


@dataclass(frozen=True, slots=True)
class LatencyPlan:
    """Amount of the measurement."""

    rate: float  # Samples per second, for both nodes together
    size: int  # Samples for each node in a part
    parts: int  # Number of parts, each with a median; an additional first part is not counted


def measure_latency(graph: Graph, folder: Path, plan: LatencyPlan) -> Table:
    """Probe both nodes in turn, sample by sample, and return the table."""
    scene = write_scene(folder, rate=0.0)
    say(f'(c) latency: {plan.parts} × {plan.size} samples each, in turn, {plan.rate:g} Hz in all')
    trips: dict[str, list[list[int]]] = {_OURS: [], _RELAY: []}
    missing = {_OURS: 0, _RELAY: 0}
    with ExitStack() as stack:
        run = stack.enter_context
        ours = run(
            graph.run_module(
                'linkage_ros.node.linkage_node',
                ['--ros-args', '-p', f'scene:={scene}', *_remapped(_OURS)],
            )
        )
        relay = run(graph.run_module('bench.raw_relay', ['--ros-args', *_remapped(_RELAY)]))
        counts = [f'{plan.rate:g}', str(plan.size), str(plan.parts + 1)]
        prober = run(graph.run_module('bench.prober', [*counts, _OURS, _RELAY]))
        patience = 20.0 + 2.0 * plan.size * 2 / plan.rate
        for part in range(plan.parts + 1):
            answers = prober.read_answer(patience)
            ours.check_running()
            relay.check_running()
            if part == 0:
                continue
            for name, (times, lost) in answers.items():
                trips[name].append(times)
                missing[name] += lost
            medians = {name: percentile(parts[-1], 50.0) / 1e3 for name, parts in trips.items()}
            say(f'  {part}: ' + ', '.join(f'{n} {m:.0f} µs' for n, m in medians.items()))
    for process in (ours, relay, prober):
        process.check_end()
    return _table(trips, missing)


def _table(trips: dict[str, list[list[int]]], missing: dict[str, int]) -> Table:
    table = Table(
        '(c) crank sample to joint state, round trip, rate: 0',
        ('', 'median µs', 'p99 µs', 'longest µs', 'unanswered', 'median: ratio', 'target'),
    )
    medians = {name: [percentile(p, 50.0) for p in parts] for name, parts in trips.items()}
    ratio = [r for r in ratios(medians[_OURS], medians[_RELAY]) if not isnan(r)]
    for name, parts in trips.items():
        table.rows.append(
            (
                name,
                spread([m / 1e3 for m in medians[name]]),
                spread([percentile(p, 99.0) / 1e3 for p in parts]),
                f'{max((t for p in parts for t in p), default=0) / 1e3:.0f}',
                str(missing[name]),
                spread(ratio, 2) if name == _OURS else '1',
                f'≤ {TARGET:g}' if name == _OURS else '',
            )
        )
    return table


def _remapped(namespace: str) -> list[str]:
    return [
        argument
        for topic in ('crank_states', 'joint_states')
        for argument in ('-r', f'{topic}:={namespace}/{topic}')
    ]
