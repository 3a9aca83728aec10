# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A linkage as a JavaScript module."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from linkage_ros.kinematics import Grid
from linkage_ros.kinematics.compiling import Kind, Operation
from linkage_ros.tools.models.source_code.source import (
    GIVEN,
    Language,
    RETURNED,
    STATUSES,
    Subject,
)

_NOTES = (
    '',
    'It returns {status, joints, ...}: arrays, which are empty where the status has no values.',
)

_COPYSIGN = """
function copysign(size, sign) {
    const negative = sign < 0.0 || Object.is(sign, -0.0);
    return negative ? -Math.abs(size) : Math.abs(size);
}
"""

_REMAINDER = """
function remainder(number, period) {
    return number - period * Math.round(number / period);
}
"""

_FOR_A_PAGE = ('joints', 'rates', 'accelerations', 'frames', 'frameRates')
"""What the function of a page returns after its status."""

_ORDERS = {RETURNED[1]: 1, RETURNED[2]: 2, 'rates': 1, 'accelerations': 2, 'frameRates': 1}
"""Which of all results are derivatives, and of what order."""


class JavaScript(Language):
    """
    JavaScript as an ECMAScript 2015 module.

    For a page of this package (``for_page``) it exports nothing, and returns frames too.
    """

    def __init__(self, *, for_page: bool = False) -> None:
        self._export = '' if for_page else 'export '
        self._names = _FOR_A_PAGE if for_page else RETURNED

    functions: ClassVar[dict[str, str]] = {
        '**': 'Math.pow',
        **{name: f'Math.{name}' for name in ('abs', 'sin', 'cos', 'sqrt', 'atan2', 'hypot')},
    }
    infinity = 'Infinity'
    finite = 'Number.isFinite'
    nearest = 'Math.round'
    status = 'Status.{}'

    def write_call(self, operation: Operation, parts: list[str]) -> str:
        if operation.name == 'found':
            return f'({parts[0]} !== null)'
        return super().write_call(operation, parts)

    def assign(self, name: str, text: str, kind: Kind = 'real') -> str:
        return f'const {name} = {text};'

    def write_table(self, name: str, ends: Sequence[str], rows: Sequence[str]) -> list[str]:
        return [
            f'const {name}Ends = [{", ".join(ends)}];',
            f'const {name}Rows = [',
            *(f'    [{row}],' for row in rows),
            '];',
            f'function {name}(x) {{',
            '    let low = 0;',
            f'    let high = {name}Ends.length;',
            '    while (low < high) {',
            '        const middle = Math.floor((low + high) / 2);',
            f'        if ({name}Ends[middle] < x) {{',
            '            low = middle + 1;',
            '        } else {',
            '            high = middle;',
            '        }',
            '    }',
            f'    return {name}Rows[low];',
            '}',
        ]

    def write_grid(self, name: str, grid: Grid) -> list[str]:
        return [
            f'const {name}Cells = new Map([',
            *(
                f"    ['{','.join(map(str, key))}', [{self.write_list(numbers)}]],"
                for key, numbers in self.list_cells(grid)
            ),
            ']);',
            f'function {name}(...inputs) {{',
            f'    const home = [{self.write_list(grid.home)}];',
            f'    for (const [level, width] of [{self.write_list(grid.widths)}].entries()) {{',
            '        const places = inputs.map((x, k) => Math.round((x - home[k]) / width));',
            f"        const cell = {name}Cells.get([level, ...places].join(','));",
            '        if (cell) {',
            '            return cell;',
            '        }',
            '    }',
            '    return null;',
            '}',
        ]

    def return_status(self, status: str) -> str:
        return f'return nothing({status});'

    def return_solution(self, status: str, groups: Sequence[Sequence[str]]) -> list[str]:
        arrays = (
            f', {name}: [{", ".join(group)}]'
            for name, group in zip(self._names, groups, strict=False)
        )
        return [f'return {{status: {status}{"".join(arrays)}}};']

    def scale_rates(self, subject: Subject, groups: Sequence[Sequence[str]]) -> list[str]:
        arguments = ''.join(f', [{", ".join(group)}]' for group in groups)
        return [
            f'const found = {self.function_name(len(groups))}(inputs{arguments});',
            *(
                f'found.{name} = found.{name}.map((each) => each{" * up" * _ORDERS[name]});'
                for name in self._returned_values(subject)
                if name in _ORDERS
            ),
            'return found;',
        ]

    def _returned_values(self, subject: Subject) -> Sequence[str]:
        return self._names if subject.frames else self._names[: 1 + subject.derivatives]

    def whole_source(
        self, subject: Subject, head: Sequence[str], tables: Sequence[str], body: Sequence[str]
    ) -> str:
        parameters = GIVEN[: 1 + subject.derivatives]
        empty = ', '.join(f'{name}: []' for name in self._returned_values(subject))
        comment = (f' * {line}'.rstrip() for line in (*head, *_NOTES))
        statuses = (f'    {status}: {index},' for index, status in enumerate(STATUSES))
        name = self.function_name(subject.derivatives)
        lines = [
            '/*', *comment, ' */', '',
            f'{self._export}const Status = Object.freeze({{', *statuses, '});',
            '', 'function nothing(status) {', f'    return {{status, {empty}}};', '}',
            *(_COPYSIGN.splitlines() if any('copysign(' in line for line in body) else ()),
            *(_REMAINDER.splitlines() if any('remainder(' in line for line in body) else ()),
            *(('', *tables) if tables else ()), '',
            f'{self._export}function {name}({", ".join(parameters)}) {{', *body, '}',
        ]  # fmt: skip
        return '\n'.join([*lines, ''])
