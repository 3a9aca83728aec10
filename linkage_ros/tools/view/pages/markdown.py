# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Generated Markdown: tables, and the part of a page between two marks."""

from __future__ import annotations

from linkage_ros.cli import Table


def table_lines(table: Table) -> list[str]:
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
