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


"""What accuracy costs, printed: the tables of its parts, and what to take."""

from __future__ import annotations

from linkage_ros.accuracy.page.numbers import cell_text, numeric_columns
from linkage_ros.accuracy.results import Results
from linkage_ros.accuracy.results import Table as Measured
from linkage_ros.cli.terminal import show, Table


def print_results(results: Results) -> None:
    """Print all tables, each part under its title, and the advice of all parts at the end."""
    for part in results.parts:
        print(f'{part.title}\n')
        for table in part.tables:
            show(printed(table))
            print()
    for part in results.parts:
        if part.advice:
            print(part.title)
            for advice in part.advice:
                print(f'  {advice}')


def printed(table: Measured) -> Table:
    """Return a table as texts; columns of numbers are set right."""
    columns = zip(table.columns, numeric_columns(table), strict=True)
    return Table(
        table.title,
        [f'>{name}' if number else name for name, number in columns],
        [[cell_text(cell) for cell in row] for row in table.rows],
    )
