# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``python -m bench``: measure, and print and store tables with their targets."""

from __future__ import annotations

import argparse
from datetime import datetime
import os
from pathlib import Path
import sys
from tempfile import TemporaryDirectory
import time

from bench.arrays import measure_modules
from bench.coming import ComersPlan, measure_comers
from bench.compiled import measure_arrays, measure_chains, measure_gallery
from bench.empty_scene import measure_empty_scene
from bench.inverse import measure_inverse
from bench.kinematics_speed import measure_speed, SpeedPlan
from bench.latency import LatencyPlan, measure_latency
from bench.processes import Graph, MeasurementError
from bench.report import FOLDER, machine_table, PAGES, say, show, Table, write_page
from bench.space import measure_space
from bench.ticks import (
    bare,
    cost_table,
    idiomatic,
    lateness_table,
    many,
    measure_ticks,
    ours,
    TickPlan,
    with_parameters,
)
from bench.transmissions import measure_transmissions
from linkage_ros.domains import private_domain

SLOW, FAST = 1000.0, 10_000.0

_TICKS = TickPlan(rounds=5, warm_up=0.7, window=1.7)
_TICKS_QUICK = TickPlan(rounds=1, warm_up=0.2, window=0.6)
_LATENCY = LatencyPlan(rate=1000.0, size=500, parts=12)
_LATENCY_QUICK = LatencyPlan(rate=1000.0, size=200, parts=3)
_SPEED = SpeedPlan(rounds=11, states=5000, batch=1_000_000)
_COMERS = ComersPlan(comers=200, listens=0.05, busy=2)
_COMERS_QUICK = ComersPlan(comers=2, listens=0.05, busy=0)
_SPEED_QUICK = SpeedPlan(rounds=3, states=1000, batch=100_000)


def main() -> int:
    """Measure what the command line asks for and return the exit code."""
    parser = argparse.ArgumentParser('python -m bench', description=__doc__)
    parser.add_argument('--quick', action='store_true', help='less than half a minute, rougher')
    parser.add_argument(
        '--only',
        choices=(
            'a',
            'b',
            'c',
            'many',
            'empty',
            'kinematics',
            'compiled',
            'arrays',
            'real_time',
            'comers',
        ),
        help='only one of the comparisons',
    )
    parser.add_argument('--runs', type=Path, default=Path('runs'), help='folder of the tables')
    parser.add_argument(
        '--write', action='store_true', help=f'write a page too, for {" or ".join(PAGES)}'
    )
    arguments = parser.parse_args()
    if arguments.write and arguments.only not in PAGES:
        parser.error(f'--write needs --only {" or ".join(PAGES)}')
    parts = dict.fromkeys(
        ('kinematics', 'compiled', 'arrays', 'empty', 'many', 'real_time', 'comers'), ''
    )
    wanted = parts.get(arguments.only, arguments.only or 'abc')
    started = time.monotonic()
    begin = datetime.now().astimezone()
    tables = [machine_table(begin)]
    try:
        with TemporaryDirectory(prefix='linkage_ros_bench_') as name:
            folder = Path(name)
            # Below 102, so that the ports stay below the kernel's ephemeral ones.
            graph = Graph(private_domain(), folder)
            if 'c' in wanted:
                plan = _LATENCY_QUICK if arguments.quick else _LATENCY
                tables.append(measure_latency(graph, folder, plan))
            if wanted not in ('', 'c'):
                tables += _ticks(graph, folder, wanted, arguments.quick)
            if arguments.only in (None, 'many'):
                tables.append(_many(graph, folder, arguments.quick))
            if arguments.only in (None, 'real_time'):
                rates = (SLOW,) if arguments.quick else (SLOW, FAST)
                tables += [_real_time(graph, folder, rate, arguments.quick) for rate in rates]
            if arguments.only == 'comers':
                say('subscribers that come and go')
                rates = (SLOW,) if arguments.quick else (SLOW, FAST)
                plan_of_comers = _COMERS_QUICK if arguments.quick else _COMERS
                tables.append(measure_comers(graph, folder, rates, plan_of_comers))
            if arguments.only in (None, 'empty'):
                say('a tick of the empty scene')
                tables.append(measure_empty_scene(*((3, 1000) if arguments.quick else (31, 5000))))
            if arguments.only in (None, 'kinematics'):
                say('kinematics: linkages solved with acceleration')
                tables.append(measure_speed(_SPEED_QUICK if arguments.quick else _SPEED))
                tables.append(measure_inverse(*((3, 500) if arguments.quick else (11, 5000))))
                amount = (3, 500, 20_000) if arguments.quick else (11, 5000, 1_000_000)
                tables.append(measure_space(*amount))
            if arguments.only in (None, 'compiled'):
                say('compiled linkages against their plain steps')
                amount = (1, 100) if arguments.quick else (11, 2000)
                picture = FOLDER / 'chains.svg' if arguments.write else None
                tables += [measure_gallery(*amount), measure_chains(*amount, picture)]
                amount = (1, 20_000) if arguments.quick else (11, 1_000_000)
                tables.append(measure_arrays(folder, *amount))
                amount = (1, 20_000) if arguments.quick else (11, 500_000)
                tables.append(measure_transmissions(folder, *amount))
            if arguments.only in (None, 'arrays'):
                say('linkages as modules for arrays')
                amount = (1, 20_000) if arguments.quick else (3, 1_000_000)
                tables.append(measure_modules(folder, *amount))
    except MeasurementError as error:
        print(f'bench: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        say('stopped')
        return 130
    for table in tables:
        show(table)
    if arguments.write:
        write_page(FOLDER / f'{arguments.only}.md', *PAGES[arguments.only], tables)
    arguments.runs.mkdir(parents=True, exist_ok=True)
    file = arguments.runs / f'bench_{begin:%Y-%m-%d_%H-%M-%S}.md'
    file.write_text('\n'.join(table.markdown() for table in tables), encoding='utf-8')
    say(f'{time.monotonic() - started:.0f} s; written to {file}')
    return 0


def _ticks(graph: Graph, folder: Path, wanted: str, quick: bool) -> list[Table]:
    slow, fast = ours(folder, SLOW), ours(folder, FAST)
    slow_idiomatic, fast_idiomatic = idiomatic(folder, SLOW), idiomatic(folder, FAST)
    slow_bare, fast_bare = bare(SLOW), bare(FAST)
    slow_recording, fast_recording = ours(folder, SLOW, True), ours(folder, FAST, True)
    # Compared contenders run next to each other.
    contenders = [
        *([slow_idiomatic] if 'a' in wanted else []),
        slow,
        *([slow_bare, fast_bare] if 'b' in wanted else []),
        fast,
        *([fast_idiomatic] if 'a' in wanted else []),
        *([slow_recording, fast_recording] if wanted == 'abc' else []),
    ]
    say(f'CPU of a tick: {", ".join(f"{c.name} {c.rate:g} Hz" for c in contenders)}')
    found = measure_ticks(graph, contenders, _TICKS_QUICK if quick else _TICKS)
    tables = []
    if 'a' in wanted:
        title = '(a) CPU of a tick against the idiomatic node'
        tables += [
            cost_table(f'{title}, 1 kHz', slow, slow_idiomatic, '≤ 0.25', found),
            cost_table(
                f'{title}, 10 kHz wanted', fast, fast_idiomatic, '≤ 0.25 where reached', found
            ),
        ]
    if 'b' in wanted:
        title = '(b) CPU of a tick against the bare loop'
        tables += [
            cost_table(f'{title}, 1 kHz', slow, slow_bare, '≤ 1.2', found),
            cost_table(f'{title}, 10 kHz', fast, fast_bare, '≤ 1.2', found),
        ]
    late = [c for c in (slow, fast, slow_recording, fast_recording) if c in found]
    return [*tables, lateness_table(late, found)]


def _real_time(graph: Graph, folder: Path, rate: float, quick: bool) -> Table:
    """Measure ticks under load, with real-time priority among others."""
    busy = os.cpu_count() or 1
    say(f'{busy} busy processes, {rate:g} Hz')
    parameters = ('thread_priority:=80', f'cpu_affinity:=[{busy - 1}]', 'lock_memory:=true')
    contenders = [
        with_parameters(folder, rate, *parameters[:count]) for count in range(len(parameters) + 1)
    ]
    plan = _TICKS_QUICK if quick else _TICKS
    found = measure_ticks(graph, contenders, plan, busy)
    return lateness_table(contenders, found, f' beside {busy} busy processes')


def _many(graph: Graph, folder: Path, quick: bool) -> Table:
    hundred = many(folder, SLOW, 100)
    say(f'{hundred.name} at {SLOW:g} Hz')
    found = measure_ticks(graph, [hundred], _TICKS_QUICK if quick else _TICKS)
    return lateness_table([hundred], found)


if __name__ == '__main__':
    sys.exit(main())
