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


"""Progress lines and tables: for the terminal, and as Markdown pages."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
import os
from pathlib import Path
import time

from bench import ROOT
from linkage_ros.cli import terminal
from linkage_ros.measuring import alternating, describe_machine, spread_of
from linkage_ros.pages.markdown import table_lines


@dataclass(frozen=True, slots=True)
class Table:
    """
    A table of text.

    Attributes
    ----------
    title
        What it shows.
    head
        The columns.
    rows
        The cells, as many in each row as there are columns.

    """

    title: str
    head: Sequence[str]
    rows: list[Sequence[str]] = field(default_factory=list)

    def for_terminal(self) -> terminal.Table:
        """Return the table for the terminal, with numbers aligned to the right."""
        name, *values = self.head
        return terminal.Table(self.title, [name, *(f'>{value}' for value in values)], self.rows)

    def markdown(self) -> str:
        """Return the table as Markdown."""
        numbers = [False, *[True] * (len(self.head) - 1)]
        lines = table_lines(self.head, self.rows, numbers)
        return '\n'.join([f'## {self.title}', '', *lines, ''])


def say(line: str) -> None:
    """Print a line of progress."""
    print(line, flush=True)


def show(table: Table) -> None:
    """Print a table, and an empty line after it."""
    terminal.show(table.for_terminal())
    say('')


def machine_table(begun: datetime, *rows: tuple[str, str]) -> Table:
    """Return the facts needed to compare the numbers with those of another machine."""
    cpu_load = ', '.join(
        f'{load:.1f} over {minutes} min'
        for load, minutes in zip(os.getloadavg(), (1, 5, 15), strict=True)
    )
    known = [
        *describe_machine(),
        *rows,
        ('begun', f'{begun:%F %T}'),
        ('load at the end', cpu_load),
    ]
    return Table('Machine', ('', ''), [*known])


def write_page(file: Path, title: str, intro: str, found: Sequence[Table]) -> None:
    """Write tables as a page of Markdown, after an introduction."""
    file.parent.mkdir(parents=True, exist_ok=True)
    text = '\n'.join([f'# {title}', '', intro.strip(), '', *(t.markdown() for t in found)])
    file.write_text(text, encoding='utf-8')
    say(f'kept in {file}')


def spread(values: Sequence[float], digits: int = 1) -> str:
    """Return median and quartiles as text."""
    low, middle, high = spread_of(values)
    if len(values) == 1:
        return f'{middle:.{digits}f}'
    return f'{middle:.{digits}f} ({low:.{digits}f}–{high:.{digits}f})'


def ratios(over: Sequence[float], under: Sequence[float]) -> list[float]:
    """Return the ratios of alternating measurements; a quotient of medians would mix rounds."""
    return [a / b for a, b in zip(over, under, strict=True)]


def in_turn(contenders: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    """Return the times of each, in [s], round by round."""
    found: dict[str, list[float]] = {name: [] for name in contenders}
    for run in contenders.values():
        run()
    for name in alternating([*contenders], rounds):
        begun = time.perf_counter()
        contenders[name]()
        found[name].append(time.perf_counter() - begun)
    say('  ' + ', '.join(f'{name} {min(times):.3g} s' for name, times in found.items()))
    return found


def compare(
    table: Table,
    what: str,
    first: str,
    second: str,
    found: Mapping[str, Sequence[float]],
    target: str,
) -> None:
    """Add a row to a table: the first over the second, measured alternately."""
    table.rows.append(
        (
            f'{what}: {first} / {second}',
            spread(found[first], 2),
            spread(found[second], 2),
            spread(ratios(found[first], found[second]), 2),
            target,
        )
    )


FOLDER = ROOT / 'docs' / 'timing'

_COMERS = """\
Made by `python -m bench --only comers --write`. A node ticks with what stands in the first column;
a client listens throughout, and other clients come one after the other, each a participant of its
own that hears some messages and goes. All clients have the defaults of Fast DDS, with shared
memory. *UDP only* is `config/fastdds/local.xml`; the shorter timeout is the node's, in such a
profile.

- *stood still for 0.33 s*: gaps of 0.325 to 0.355 s between the stamps of two joint states. Where
  processors are scarce a gap may have that length by chance; *waited for CPU* says how scarce they
  were, as a sum over all threads of the node.
- *lost*: ticks that were more than 20 ms late, of all that were due while clients came and went.
- *longest*: the greatest lateness since the node began.
- *messages missed*: between the first and the last that each client heard.
"""

_REAL_TIME = """\
Made by `python -m bench --only real_time --write`: the node beside as many busy processes as there
are processors, with nothing asked for and with each of the three parameters more. A crank comes at
500 Hz, and one client listens. Lateness is that of all ticks, from the start of each run to its
end.

Discovery is LOCALHOST, which brings shared memory: of the ticks that are lost, those of a run
whose longest lateness is 0.33 s stood still when the client came. What else is lost or late with a
priority waited for threads that have none: for the interpreter's lock, or for one of the
middleware.
"""

_COMPILED = """\
Made by `python -m bench --only compiled --write`. The plain steps of a linkage are run on symbols
once, and what they do is kept as one straight Python function, which gives the same bits. Both are
asked for all published joints with rates and accelerations, in turn, over the whole range of each
linkage. `class_3` is iterated: its constraints are a straight line, the iteration is a call.

Arrays of closed states, drawn at random from the whole range, are solved by `solve` (numpy in
blocks) and by the C that `linkage compile` writes, in a loop over the states; both come of the
same tape.

![What chains of crank-rockers take over their number of dyads](chains.svg)
"""

PAGES = {
    'compiled': ('Compiled linkages', _COMPILED),
    'comers': ('Clients that come and go', _COMERS),
    'real_time': ('Ticks beside busy processes', _REAL_TIME),
}
"""Title and introduction of each page."""
