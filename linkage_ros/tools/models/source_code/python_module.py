# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A linkage as a Python module that needs only `math`."""

from __future__ import annotations

from collections.abc import Sequence

from linkage_ros.kinematics import Grid
from linkage_ros.kinematics.compiling import Kind, Operation
from linkage_ros.tools.models.source_code.source import (
    GIVEN,
    Language,
    RETURNED,
    STATUSES,
    Subject,
    WIDTH,
)

_NOTES = (
    '',
    'It returns the status and a tuple for each group of values, empty where the status has none.',
)

CODING = '# -*- coding: utf-8 -*-'
"""First line: Python looks for an encoding in the second, which holds a name, only without it."""

_IMPORTS = 'from math import atan2, copysign, cos, inf, isfinite, sin, sqrt'


class PythonModule(Language):
    """Python; the function gives a number of derivatives."""

    infinity = 'inf'
    finite = 'isfinite'
    nearest = 'round'
    comment = '# {}'
    conjunction = 'and'
    disjunction = 'or'

    def __init__(self, derivatives: int) -> None:
        self._groups = 1 + derivatives

    def write_call(self, operation: Operation, parts: list[str]) -> str:
        if operation.name == '**':
            return f'(({parts[0]}) ** {parts[1]})'
        if operation.name == 'hypot':
            # The root that C's hypot() gives; the last digits of math.hypot() differ.
            return f'abs(complex({parts[0]}, {parts[1]}))'
        if operation.name == 'found':
            return f'({parts[0]} is not None)'
        return super().write_call(operation, parts)

    def write_choice(self, condition: str, value: str, otherwise: str) -> str:
        return f'{value} if {condition} else {otherwise}'

    def negate(self, condition: str) -> str:
        return f'not {condition}' if condition.isidentifier() else f'not ({condition})'

    def write_below(self, number: str, most: str) -> str:
        return f'-{most} < {number} < {most}'  # takes half the time of a call

    def write_block(self, condition: str, lines: Sequence[str]) -> list[str]:
        return [f'if {condition}:', *(f'    {line}' for line in lines)]

    def wrap_line(self, line: str) -> list[str]:
        if len(line) > WIDTH:
            name, equals, text = line.partition(' = ')
            if equals:
                line = f'{name} = ({text})'
            elif line.lstrip().startswith('if '):
                indent, _, condition = line.partition('if ')
                line = f'{indent}if ({condition[:-1]}):'
        return super().wrap_line(line)

    def assign(self, name: str, text: str, kind: Kind = 'real') -> str:
        return f'{name} = {text}'

    def write_table(self, name: str, ends: Sequence[str], rows: Sequence[str]) -> list[str]:
        return [
            f'_{name}_ends = ({"".join(f"{end}, " for end in ends).rstrip()})',
            f'_{name}_rows = (',
            *(f'    ({row}),' for row in rows),
            ')',
            '',
            '',
            f'def {name}(x):',
            f'    return _{name}_rows[bisect_left(_{name}_ends, x)]',
            '',
            '',
        ]

    def write_grid(self, name: str, grid: Grid) -> list[str]:
        cells = self.list_cells(grid)
        return [
            f'_{name}_cells = {{',
            *(f'    {key}: ({self.write_list(cell)}),' for key, cell in cells),
            '}',
            '',
            '',
            f'def {name}(*inputs):',
            f'    for level, width in enumerate(({self.write_list(grid.widths)})):',
            f'        home = ({self.write_list(grid.home)},)',
            '        key = (level, *(round((x - at) / width) for x, at in zip(inputs, home)))',
            f'        if key in _{name}_cells:',
            f'            return _{name}_cells[key]',
            '    return None',
            '',
            '',
        ]

    def return_status(self, status: str) -> str:
        return f'return ({", ".join([status, *["()"] * self._groups])})'

    def return_solution(self, status: str, groups: Sequence[Sequence[str]]) -> list[str]:
        tuples = (f'({", ".join(group)},)' for group in groups)
        return [f'return ({", ".join([status, *tuples])})']

    def scale_rates(self, subject: Subject, groups: Sequence[Sequence[str]]) -> list[str]:
        names = RETURNED[: self._groups]
        arguments = ''.join(f', ({", ".join(group)},)' for group in groups)
        tuples = (
            f', tuple({"map(up.__mul__, " * order}{name}{")" * order})'
            for order, name in enumerate(names[1:], 1)
        )
        return [
            f'status, {", ".join(names)} = {self.function_name(len(groups))}(inputs{arguments})',
            f'return (status, {names[0]}{"".join(tuples)})',
        ]

    def whole_source(
        self, subject: Subject, head: Sequence[str], tables: Sequence[str], body: Sequence[str]
    ) -> str:
        name = self.function_name(subject.derivatives)
        imports = ['from bisect import bisect_left'] if tables else []
        more = ', remainder' if any('remainder(' in line for line in body) else ''
        imports.append(_IMPORTS.replace(', sin', f'{more}, sin'))
        lines = [
            CODING, *(f'# {line}'.rstrip() for line in (*head, *_NOTES)), '', *imports, '',
            *(f'{status} = {index}' for index, status in enumerate(STATUSES)), '', '', *tables,
            f'def {name}({", ".join(GIVEN[: self._groups])}):', *body,
        ]  # fmt: skip
        return '\n'.join([*lines, ''])
