# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Progress lines and tables: for the terminal, and as Markdown pages."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
import os
from pathlib import Path
import time

from bench import ROOT
from linkage_ros import cli
from linkage_ros.tools.study import alternate_order, describe_machine, spread_of


@dataclass(frozen=True, slots=True)
class Table:
    """A table of text: the names of its columns, and the cells of each row."""

    title: str
    head: Sequence[str]
    rows: list[Sequence[str]] = field(default_factory=list)

    def aligned(self) -> cli.Table:
        """Return the table with numbers aligned to the right."""
        name, *values = self.head
        return cli.Table(self.title, [name, *(f'>{value}' for value in values)], self.rows)

    def markdown(self) -> str:
        """Return the table as Markdown."""
        return '\n'.join([f'## {self.title}', '', *table_lines(self.aligned()), ''])


def table_lines(table: cli.Table) -> list[str]:
    """Return the lines of a table whose cells are Markdown; a title is left out."""
    table = table.as_texts()
    heads = [head.removeprefix('>') for head in table.heads]
    rule = ['---:' if head.startswith('>') else '---' for head in table.heads]
    return [f'| {" | ".join(line)} |' for line in (heads, rule, *table.rows)]


def part_marks(name: str) -> tuple[str, str]:
    """Return the two comments that enclose a generated part."""
    return f'<!-- {name}: begin -->', f'<!-- {name}: end -->'


def fill_marks(page: str, name: str, text: str) -> str:
    """Return a page with a text between two of its marks; the rest stays as it is."""
    begin, end = part_marks(name)
    head, _, rest = page.partition(begin)
    _, _, tail = rest.partition(end)
    return f'{head}{begin}\n{text}\n{end}{tail}'


def say(line: str) -> None:
    """Print a line of progress."""
    print(line, flush=True)


def show(table: Table) -> None:
    """Print a table, and an empty line after it."""
    cli.print_tables(table.aligned())
    say('')


def machine_table(begun: datetime, *rows: tuple[str, str]) -> Table:
    """Return the facts needed to compare the results with those of another machine."""
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


def write_page(file: Path, title: str, introduction: str, tables: Sequence[Table]) -> None:
    """Write an introduction and tables as a page of Markdown."""
    file.parent.mkdir(parents=True, exist_ok=True)
    text = '\n'.join([f'# {title}', '', introduction.strip(), '', *(t.markdown() for t in tables)])
    file.write_text(text, encoding='utf-8')
    say(f'written to {file}')


def spread(values: Sequence[float], digits: int = 1) -> str:
    """Return median and quartiles as text."""
    low, middle, high = spread_of(values)
    if len(values) == 1:
        return f'{middle:.{digits}f}'
    return f'{middle:.{digits}f} ({low:.{digits}f}–{high:.{digits}f})'


def ratios(over: Sequence[float], under: Sequence[float]) -> list[float]:
    """Return the ratios of alternating measurements, round by round."""
    return [a / b for a, b in zip(over, under, strict=True)]


def in_turn(contenders: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    """Return the durations of each contender, in [s], round by round."""
    durations: dict[str, list[float]] = {name: [] for name in contenders}
    for run in contenders.values():
        run()
    for name in alternate_order([*contenders], rounds):
        begun = time.perf_counter()
        contenders[name]()
        durations[name].append(time.perf_counter() - begun)
    say('  ' + ', '.join(f'{name} {min(times):.3g} s' for name, times in durations.items()))
    return durations


def compare(
    table: Table,
    quantity: str,
    first: str,
    second: str,
    measured: Mapping[str, Sequence[float]],
    target: str,
) -> None:
    """Add a row to a table: the first over the second, measured alternately."""
    table.rows.append(
        (
            f'{quantity}: {first} / {second}',
            spread(measured[first], 2),
            spread(measured[second], 2),
            spread(ratios(measured[first], measured[second]), 2),
            target,
        )
    )


FOLDER = ROOT / 'docs' / 'timing'

_COMERS = """\
Made by `python -m bench --only comers --write`. A node ticks with the transport in the first
column. One subscriber listens throughout. Other subscribers come one after the other, each with a
participant of its own, receive some messages and go. All subscribers use the defaults of Fast DDS,
with shared memory. *UDP only* is `config/fastdds/local.xml`; the shorter timeout is set for the
node, in such a profile.

- *stalls of 0.33 s*: gaps of 0.325 to 0.355 s between the stamps of two joint states. On a busy
  machine a gap may have that length by chance; *waited for CPU* shows how busy it was, as a sum
  over all threads of the node.
- *ticks lost*: ticks that were more than 20 ms late, of all ticks due while subscribers came and
  went.
- *longest*: the greatest lateness since the start of the node.
- *messages missed*: messages missing between the first and the last one of each subscriber.
"""

_REAL_TIME = """\
Made by `python -m bench --only real_time --write`. The node runs beside as many busy processes as
there are processors: without the three parameters, then with one, two and all of them. Crank
samples come at 500 Hz, and one subscriber listens. Lateness is that of all ticks, from the start
of each run to its end.

Discovery is LOCALHOST, which uses shared memory. In a run whose longest lateness is 0.33 s, the
ticks were lost when the subscriber came. With a priority, all other late ticks waited for threads
without one: for the interpreter's lock, or for a lock of the middleware.
"""

_COMPILED = """\
Made by `python -m bench --only compiled --write`. The plain steps of a linkage are run once on
symbols, and their operations become one Python function without branches, which gives the same
bits. Both compute all published joints with rates and accelerations, in turn, over the whole range
of each linkage. `class_3` is iterated: two steps of Newton's method from a table are compiled.

Arrays of closed states, drawn at random from the whole range, are solved by `solve` (numpy in
blocks) and by the C code that `linkage compile` writes, in a loop over the states. Both come from
the same tape.

![Time of chains of crank-rockers over their number of dyads](chains.svg)
"""

PAGES = {
    'compiled': ('Compiled linkages', _COMPILED),
    'comers': ('Subscribers that come and go', _COMERS),
    'real_time': ('Ticks beside busy processes', _REAL_TIME),
}
"""Title and introduction of each page."""
