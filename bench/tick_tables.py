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


"""Tables of what a tick costs and how late it is."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan

from bench.report import Table
from bench.spread import ratios, spread
from bench.ticks import Contender, Measurement

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
