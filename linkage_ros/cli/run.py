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


"""A run as it goes: a table that renews itself with rich, a line a second without."""

from __future__ import annotations

from importlib.util import find_spec
import sys
from time import monotonic
from typing import Any

from linkage_ros.kinematics.status import Status
from linkage_ros.node.node import LinkageNode
from linkage_ros.node.tick_loop import TickLoop

_RICH = find_spec('rich') is not None
if _RICH:
    from rich.console import Console, Group
    from rich.live import Live
    from rich.table import Table
    from rich.text import Text

_LIVE_PERIOD, _PLAIN_PERIOD = 0.25, 1.0
_MOST_SHOWN = 24
"""Joints beyond this do not fit on a screen."""

_Shown = tuple[str, float, float | None]


class Display:
    """
    Shows a running node.

    Parameters
    ----------
    plain
        Whether to print lines also where a live display is possible.

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
        """Show the node as it is now, if it is time."""
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
    """Return the input's age as text, and name, value and rate of inputs and joints."""
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
