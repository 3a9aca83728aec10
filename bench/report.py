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


"""Progress lines and tables: with rich where it is installed, plain where not, and as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

try:
    from rich.console import Console
    from rich.table import Table as RichTable
except ImportError:
    _console = None
else:
    _console = Console()
    if not _console.is_terminal:
        _console = Console(width=120)


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

    def plain(self) -> str:
        """Return it as aligned text."""
        lines = [list(self.head), *map(list, self.rows)]
        widths = [max(len(line[i]) for line in lines) for i in range(len(self.head))]
        text = [
            '  '.join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
            for line in lines
        ]
        return '\n'.join([self.title, text[0], '-' * max(map(len, text)), *text[1:], ''])

    def markdown(self) -> str:
        """Return it as Markdown."""
        rule = ['---', *(['---:'] * (len(self.head) - 1))]
        lines = [self.head, rule, *self.rows]
        return '\n'.join(
            [f'## {self.title}', '', *(f'| {" | ".join(line)} |' for line in lines), '']
        )


def say(line: str) -> None:
    """Print a line of progress."""
    if _console is None:
        print(line, flush=True)
    else:
        _console.print(line, highlight=False, markup=False, style='dim')


def show(table: Table) -> None:
    """Print a table."""
    if _console is None:
        print(table.plain(), flush=True)
        return
    rich = RichTable(title=table.title, title_justify='left')
    for number, name in enumerate(table.head):
        rich.add_column(name, justify='right' if number else 'left')
    for row in table.rows:
        rich.add_row(*row)
    _console.print(rich)
