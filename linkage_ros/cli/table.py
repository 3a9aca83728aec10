# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The one table: values in SI, from which text, HTML, Markdown, CSV, sheets and JSON are made.

A column names its key in JSON and in files, its heading, its unit in SI and its format;
`DisplayUnits` holds the units that a person reads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
import re
from typing import Any, NamedTuple

from linkage_ros.cli.arguments import DEGREES, DisplayUnits, fixed_text

Form = str | Callable[[Any, DisplayUnits], str]
"""Format of a number; or a function that returns a value, in SI, as text with its unit."""

UNIT = 'unit'
"""Key of the column that names the unit of a row."""

_UNIT_SUFFIX = re.compile('_(?:m|rad)$')


class Quantity(NamedTuple):
    """A number in SI with a unit of its own, or with the text that a person reads."""

    value: float | None
    unit: str = ''
    shown: str = ''

    def text(self, units: DisplayUnits) -> str:
        """Return the quantity for a person."""
        return self.shown or units.value_text(self.value or 0.0, self.unit == 'rad')


class Column(NamedTuple):
    """A column of a table."""

    # On a terminal and on pages; a leading ``>`` aligns to the right; None: only in files
    heading: str | None
    key: str = ''  # In JSON and in files, where a dot leads into an object; '' for not in JSON
    unit: str = ''  # In SI
    form: Form = ''

    def head(self, units: DisplayUnits) -> str:
        """Return the heading, with the unit if the cells are without."""
        heading = self.heading or ''
        if not self.unit or (callable(self.form) and not heading.endswith(' []')):
            return heading
        return f'{heading.removesuffix(" []")} [{units.name_unit(self.unit)}]'

    def file_head(self, units: DisplayUnits) -> str:
        """Return the heading in a file."""
        name = self.key or (self.heading or '').removeprefix('>')
        if not self.unit:
            return name
        return f'{_UNIT_SUFFIX.sub("", name)} [{units.file.file_unit(self.unit)}]'

    def text(self, value: Any, units: DisplayUnits) -> str:
        """Return a cell for a person."""
        if isinstance(value, Quantity):
            return value.text(units)
        if callable(self.form):
            return self.form(value, units)
        if value is None:
            return ''
        if isinstance(value, str):
            return value
        shown = units.convert(value, self.unit) if self.unit else value
        if self.form.endswith('f'):
            return fixed_text(shown, int(self.form[1:-1]))
        return format(shown, self.form)

    def cell(self, value: Any, units: DisplayUnits) -> Any:
        """Return a cell for a file: a number in the units of the file, a text, or None."""
        if isinstance(value, Quantity):
            return self._replace(unit=value.unit or self.unit).cell(value.value, units)
        if isinstance(value, bool):
            return str(value).lower()
        if self.key == UNIT:
            return units.file.file_unit(value)
        if value is None or isinstance(value, str | int):
            return value
        if isinstance(value, float):
            return units.file.to_file_unit(value, self.unit)
        return self.text(value, units)


class Table(NamedTuple):
    """A table of values in SI; a column that is a text is the heading of texts."""

    title: str  # '' for no title
    columns: Sequence[Column | str]
    rows: Sequence[Sequence[Any]]
    key: str = ''  # In JSON
    folded: bool = False  # Whether a page shows the title alone at first

    @property
    def heads(self) -> list[str]:
        """Return the headings, without units."""
        return [column.heading for column in self.typed_columns if column.heading is not None]

    @property
    def typed_columns(self) -> list[Column]:
        """Return the columns."""
        return [Column(column) if isinstance(column, str) else column for column in self.columns]

    def as_texts(self, units: DisplayUnits = DEGREES) -> Table:
        """Return the table as text."""
        shown = [pair for pair in enumerate(self.typed_columns) if pair[1].heading is not None]
        return Table(
            self.title,
            [column.head(units) for _, column in shown],
            [[column.text(row[place], units) for place, column in shown] for row in self.rows],
            self.key,
            self.folded,
        )


def attributes_json(of: object, columns: Iterable[Column]) -> dict[str, Any]:
    """Return the attributes of an object that columns name, as JSON holds them."""
    return {column.key: getattr(of, column.key) for column in columns}


def table_of_rows(
    title: str, key: str, columns: Sequence[Column], rows: Iterable[Mapping[str, Any]]
) -> Table:
    """Return a table of rows as JSON holds them."""
    return Table(title, columns, [[row[column.key] for column in columns] for row in rows], key)


def facts_table(title: str, facts: Iterable[tuple[str, str]]) -> Table:
    """Return facts, each with its name."""
    return Table(title, ('', ''), [*facts])
