# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A linkage as C99 that also compiles as C++."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from linkage_ros.kinematics import Grid, Status
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
    'Values are written where the status has values; else the arrays stay as they were. Nothing',
    'is allocated, and no state is kept: calls from several threads are safe. The digits are as',
    'in linkage_ros if the compiler keeps to IEEE 754: -ffp-contract=off, and never',
    '-ffast-math, which removes the checks. It needs doubles of 64 bits and libm (-lm).',
)

_CHECK = (
    '#include <float.h>', '#include <math.h>', '#include <stddef.h>', '', '#if DBL_MANT_DIG < 53',
    '#error "double has fewer than 64 bits here"', '#endif',
)  # fmt: skip

# Compilers replace a square by a product, whose last digits differ from linkage_ros, which calls
# pow().
_TWO = 'two'
_DECLARED_TWO = (
    f'    const volatile double {_TWO} = 2.0;  /* pow() is called, as linkage_ros does */'
)


_TYPES: dict[Kind, str] = {'truth': 'int ', 'other': 'double *const '}


class C(Language):
    """
    The C language.

    Parameters
    ----------
    name
        Prefix of the names of the source.
    header
        Whether the source is a header that is included, or a file that is compiled.
    jacobian
        Whether the function gives the joints and their derivatives by the inputs.

    """

    functions: ClassVar[dict[str, str]] = {'abs': 'fabs', '**': 'pow'}
    infinity = 'INFINITY'
    finite = 'isfinite'
    nearest = 'rint'
    comment = '/* {} */'

    def __init__(self, name: str, *, header: bool, jacobian: bool = False) -> None:
        self._name = name
        self._header = header
        self._jacobian = jacobian
        self._returned = (RETURNED[0], 'jacobian') if jacobian else RETURNED
        self.status = f'{name.upper()}_{{}}'

    def function_name(self, derivatives: int) -> str:
        name = 'jacobian' if self._jacobian else super().function_name(derivatives)
        return f'{self._name}_{name}'

    def write_call(self, operation: Operation, parts: list[str]) -> str:
        if operation.name == '**' and parts[1] == '2.0':
            return f'pow({parts[0]}, {_TWO})'
        if operation.name == 'found':
            return f'({parts[0]} != NULL)'
        return super().write_call(operation, parts)

    def assign(self, name: str, text: str, kind: Kind = 'real') -> str:
        return f'const {_TYPES.get(kind, "double ")}{name} = {text};'

    def write_table(self, name: str, ends: Sequence[str], rows: Sequence[str]) -> list[str]:
        width = rows[0].count(',') + 1
        return [
            f'static const double *{name}(double x)',
            '{',
            f'    static const double ends[] = {{{", ".join(ends or ["0.0"])}}};',
            f'    static const double rows[][{width}] = {{',
            *(f'        {{{row}}},' for row in rows),
            '    };',
            '    int low = 0;',
            f'    int high = {len(ends)};',
            '    while (low < high) {',
            '        const int middle = (low + high) / 2;',
            '        if (ends[middle] < x) {',
            '            low = middle + 1;',
            '        } else {',
            '            high = middle;',
            '        }',
            '    }',
            '    return rows[low];',
            '}',
        ]

    def write_grid(self, name: str, grid: Grid) -> list[str]:
        cells = self.list_cells(grid)
        inputs = range(len(grid.home))
        return [
            f'static const double *{name}({", ".join(f"double x{k}" for k in inputs)})',
            '{',
            f'    static const double widths[] = {{{self.write_list(grid.widths)}}};',
            f'    static const double home[] = {{{self.write_list(grid.home)}}};',
            f'    static const double keys[][{1 + len(inputs)}] = {{',
            *(f'        {{{self.write_list(key)}}},' for key, _ in cells),
            '    };',
            f'    static const double cells[][{len(cells[0][1])}] = {{',
            *(f'        {{{self.write_list(numbers)}}},' for _, numbers in cells),
            '    };',
            f'    const double x[] = {{{", ".join(f"x{k}" for k in inputs)}}};',
            f'    for (int level = 0; level < {len(grid.widths)}; ++level) {{',
            '        int low = 0;',
            f'        int high = {len(cells)};',
            '        while (low < high) {',
            '            const int middle = (low + high) / 2;',
            '            double way = keys[middle][0] - level;',
            f'            for (int k = 0; way == 0.0 && k < {len(inputs)}; ++k) {{',
            '                way = keys[middle][1 + k] - rint((x[k] - home[k]) / widths[level]);',
            '            }',
            '            if (way == 0.0) {',
            '                return cells[middle];',
            '            }',
            '            if (way < 0.0) {',
            '                low = middle + 1;',
            '            } else {',
            '                high = middle;',
            '            }',
            '        }',
            '    }',
            '    return NULL;',
            '}',
        ]

    def return_status(self, status: str) -> str:
        return f'return {status};'

    def return_solution(self, status: str, groups: Sequence[Sequence[str]]) -> list[str]:
        lines = [
            f'{array}[{index}] = {text};'
            for array, group in zip(self._returned, groups, strict=False)
            for index, text in enumerate(group)
        ]
        return [*lines, f'return {status};']

    def scale_rates(self, subject: Subject, groups: Sequence[Sequence[str]]) -> list[str]:
        end = 1 + len(groups)
        names = [f'scaled_{name}' for name in GIVEN[1:end]]
        returned = RETURNED[:end]
        arguments = ', '.join((GIVEN[0], *names, *returned))
        arrays = zip(names, groups, strict=True)
        valid = f'status <= {self.status.format(Status.LIMITED.name)}'
        return [
            *(f'const double {name}[] = {{{", ".join(group)}}};' for name, group in arrays),
            f'const enum {self._name}_status status =',
            f'    {self.function_name(len(groups))}({arguments});',
            f'for (int i = 0; {valid} && i < {len(subject.joints)}; ++i) {{',
            *(f'    {name}[i] *= up;' for order in (1, 2) for name in returned[order:]),
            '}',
            'return status;',
        ]

    def whole_source(
        self, subject: Subject, head: Sequence[str], tables: Sequence[str], body: Sequence[str]
    ) -> str:
        name, function = self._name, self.function_name(subject.derivatives)
        driven, joints = len(subject.closure.linkage.inputs), len(subject.joints)
        kind = f'enum {name}_status'
        parameters = [
            *(f'const double {array}[{driven}]' for array in GIVEN[: 1 + subject.derivatives]),
            *(f'double {array}[{joints}]' for array in RETURNED[: 1 + subject.derivatives]),
        ]
        if self._jacobian:
            parameters.append(f'double jacobian[{joints * driven}]')
        last = len(parameters) - 1
        signature = [
            f'{kind} {function}(',
            *(
                f'    {parameter}{")" if i == last else ","}'
                for i, parameter in enumerate(parameters)
            ),
        ]
        statuses = [
            f'    {self.status.format(status)} = {i},' for i, status in enumerate(STATUSES)
        ]
        statuses[-1] = statuses[-1].removesuffix(',')
        listed = [f'{kind} {{', *statuses, '};']
        two = [_DECLARED_TWO] if any(f'{_TWO})' in line for line in body) else []
        above = [*tables, ''] if tables else []
        definition = [*signature, '{', *two, *body, '}']
        comment = ['/*', *(f' * {line}'.rstrip() for line in (*head, *_NOTES)), ' */']
        if self._header:
            guard, once = f'{function.upper()}_H', f'{name.upper()}_STATUS'
            definition[0] = f'static inline {definition[0]}'
            # Headers of one linkage with different derivatives share the statuses.
            listed = [f'#ifndef {once}', f'#define {once}', *listed, f'#endif  /* {once} */']
            lines = [
                f'#ifndef {guard}', f'#define {guard}', '', *_CHECK, '', *listed, '', *above,
                *definition, '', f'#endif  /* {guard} */',
            ]  # fmt: skip
        else:
            declared = ['#ifdef __cplusplus', 'extern "C" {', '#endif', *listed, *signature[:-1]]
            declared += [f'{signature[-1]};', '#ifdef __cplusplus', '}', '#endif']
            heading = '/* What a caller declares: */'
            lines = [*_CHECK, '', heading, *declared, '', *above, *definition]
        return '\n'.join([*comment, '', *lines, ''])
