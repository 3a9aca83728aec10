# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Effect on the ticks of subscribers that come and go, by the transport of Fast DDS.

A publisher opens the shared-memory port of every new subscriber, on the publishing thread. If no
process has written to that port for long, its check waits for a third of the
``healthy_check_timeout_ms`` of the process that created the port: 0.33 s (Fast-DDS issue 6535).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
import time
from typing import Any

from bench.processes import Graph, MeasurementError, Process
from bench.report import say, Table
from bench.ticks import cpu_time, write_turning
from linkage_ros.resources import shipped_path

_APPEARING = 15.0
"""Time limit for the node's first tick, in [s]."""

_DIAGNOSTICS = 1.3
"""Time after which the node has published new diagnostics, in [s]."""

_TIMEOUT = 30
"""Health-check timeout of the profile with a shorter one, in [ms]."""

_SHARED = f"""\
    <transport_descriptor>
      <transport_id>shm</transport_id>
      <type>SHM</type>
      <healthy_check_timeout_ms>{_TIMEOUT}</healthy_check_timeout_ms>
    </transport_descriptor>
"""


@dataclass(frozen=True, slots=True)
class ComersPlan:
    """Amount of the measurement."""

    comers: int  # Number of subscribers that come and go, one after the other
    listens: float  # Time for which each listens, in [s]
    busy: int  # Number of processes that each occupy a processor under load


def measure_comers(
    graph: Graph, folder: Path, rates: tuple[float, ...], plan: ComersPlan
) -> Table:
    """Let subscribers come and go for each transport, rate and load, and return the table."""
    table = Table(
        f'{plan.comers} subscribers with default settings come and go',
        ('', 'stalls of 0.33 s', 'ticks lost', 'of', 'longest µs', 'CPU µs a tick',
         'waited for CPU', 'subscribers without a message', 'messages missed'),
    )  # fmt: skip
    for rate in rates:
        scene = write_turning(folder, rate)
        for busy in dict.fromkeys((0, plan.busy)):
            for name, environment in _transports(folder).items():
                load = f', {busy} busy processes' if busy else ''
                cells = _measure(graph, scene, environment, busy, plan)
                table.rows.append((f'{name}, {rate / 1e3:g} kHz{load}', *cells))
                say('  ' + ', '.join(table.rows[-1]))
    return table


def _transports(folder: Path) -> Mapping[str, Mapping[str, str]]:
    """Return the node's environment for each transport; all stay on the machine."""
    local = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SYSTEM_DEFAULT'}
    profile = shipped_path('fastdds/local.xml')
    text = profile.read_text('utf-8')
    for mark, more in (
        ('  </transport_descriptors>', _SHARED),
        ('        <transport_id>udp<', '        <transport_id>shm</transport_id>\n'),
    ):
        text = text.replace(mark, more + mark)
    short = folder / 'short.xml'
    short.write_text(text, encoding='utf-8')
    return {
        'shared memory': {},
        'UDP only': {**local, 'FASTRTPS_DEFAULT_PROFILES_FILE': str(profile)},
        f'shared memory, timeout {_TIMEOUT} ms': {
            **local,
            'FASTRTPS_DEFAULT_PROFILES_FILE': str(short),
        },
        'shared memory, asynchronous': {'RMW_FASTRTPS_PUBLICATION_MODE': 'ASYNCHRONOUS'},
    }


def _measure(
    graph: Graph, scene: Path, environment: Mapping[str, str], busy: int, plan: ComersPlan
) -> Sequence[str]:
    """Return one row of the table."""
    with ExitStack() as stack:
        run = stack.enter_context
        listener = run(graph.run_module('bench.listener'))
        ours = ('--ros-args', '-p', f'scene:={scene}')
        node = run(graph.run_module('linkage_ros.node.linkage_node', ours, environment))
        before = _report(listener, node)
        for _ in range(busy):
            run(graph.run_module('bench.busy'))
        ran, waited = cpu_time(node.pid)
        comers = run(graph.run_module('bench.comers', (str(plan.comers), f'{plan.listens:g}')))
        counts = comers.read_answer(60.0 + plan.comers * (plan.listens + 2.0))
        ran_then, waited_then = cpu_time(node.pid)
        time.sleep(_DIAGNOSTICS)
        listener.ask_line('forget')
        after = _report(listener, node)
    ticks, lost = (
        int(after['health'][key]) - int(before['health'][key])
        for key in ('Events since startup', 'Lost ticks')
    )
    wait = (waited_then - waited) / (after['time'] - before['time'])
    return (
        str(after['stalls'] - before['stalls']),
        str(lost),
        str(ticks + lost),
        f'{float(after["health"]["Lateness max (us)"]):.0f}',
        f'{(ran_then - ran) / max(ticks, 1) / 1e3:.1f}',
        f'{wait:.0%}',
        str(counts['silent']),
        f'{counts["missed"]} of {counts["received"]}',
    )


def _report(listener: Process, node: Process) -> dict[str, Any]:
    """Return the listener's report, as soon as it has diagnostics of the node."""
    until = time.monotonic() + _APPEARING
    while not (report := listener.ask_line('?'))['health']:
        node.check_running()
        if time.monotonic() > until:
            raise MeasurementError(f'{node.name}: no diagnostics in {_APPEARING:g} s')
        time.sleep(0.1)
    return dict(report)
