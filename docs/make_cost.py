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


"""
Measure the cost of every effect on this machine, and write it into docs/cost.md.

Run it in the folder of the checkout, as `make cost` does: ``python -m docs.make_cost``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from linkage_ros.cli.cost import all_effects, table_of_all
from linkage_ros.cli.terminal import Table
from linkage_ros.measuring import describe_machine
from linkage_ros.pages.markdown import filled, table_lines

PAGE = Path(__file__).resolve().parent / 'cost.md'

_TICKS = 50_000
_LEFT_OUT = ('governor', 'kernel', 'rclpy', 'middleware')
"""Properties of the machine that do not concern these ticks."""


def main() -> int:
    """Measure and write."""
    costs = all_effects(_TICKS)
    assert costs is not None, 'nothing interrupts the measurement'
    text = measured(table_of_all(costs, _TICKS), describe_machine())
    PAGE.write_text(filled(PAGE.read_text('utf-8'), 'measured', text), 'utf-8')
    return 0


def measured(table: Table, machine: Sequence[tuple[str, str]]) -> str:
    """Return the measurement as Markdown: the machine and the table."""
    on = ', '.join(f'{name} {value}' for name, value in machine if name not in _LEFT_OUT)
    heads = [column.lstrip('>') for column in table.columns]
    lines = table_lines(heads, table.rows, [column.startswith('>') for column in table.columns])
    return '\n'.join([f'{table.title}; {on}.', '', *lines])


if __name__ == '__main__':
    raise SystemExit(main())
