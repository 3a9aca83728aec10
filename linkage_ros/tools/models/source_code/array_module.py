# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage as a Python module for arrays of NumPy, PyTorch, JAX and CuPy, by the array API standard.

The tree of the other languages becomes one straight line: each path has a mask of the states that
take it, and `where` merges what the paths come to. Autodiff runs through all paths at every state.
An infinite slope off the path that a state takes would make its gradient NaN: 0 · inf. So
roots, quotients and angles get a harmless argument there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from typing import Any

from linkage_ros.kinematics import Grid, StartTable, Status
from linkage_ros.kinematics.compiling import (
    DecisionBranch,
    Kind,
    Operation,
    Program,
    SolvedLeaf,
    TextWriter,
    Tree,
    WrittenText,
)
from linkage_ros.tools.models.source_code.python_module import CODING, PythonModule
from linkage_ros.tools.models.source_code.source import (
    compile_subject,
    FUNCTIONS,
    GIVEN,
    head_lines,
    SourceBody,
    STATUSES,
    Subject,
    UNDECIDED,
)

_COARSE = 64
"""Rounding errors of 1 within which Newton's method ends at any precision."""

_SINGULAR = {'sqrt': ('_root', 0), 'atan2': ('_angle', 1)}
"""Functions without a slope at 0: one that has it, and which argument must not be 0 elsewhere."""

_ATOM = 9

_NOTES = """
Arguments and results are arrays with these numbers along their last axis; the axes before it
are those of the states. So are inputs (..., {inputs}), joints (..., {joints}), the status (...).
They are arrays of NumPy, PyTorch, JAX or CuPy, of float64 or float32. A state without values
has NaN in all of them, and gradients 0. Rates whose squares overflow give no finite numbers.
"""

_JACOBIAN = '''

def jacobian(inputs):
    """Return the derivatives of joints by inputs, (..., joints, inputs); NaN without values."""
    xp = array_namespace(inputs)
    unit_rates = xp.eye(inputs.shape[-1], dtype=inputs.dtype, device=device(inputs))
    while unit_rates.ndim <= inputs.ndim:
        unit_rates = xp.expand_dims(unit_rates, axis=1)
    return xp.moveaxis(velocity(inputs, unit_rates)[2], 0, -1)
'''

_HELPERS = {
    '_root': '''
def _root(xp, x):
    """Return the root of x, with the slope 0 at 0."""
    above = x > 0.0
    return xp.where(above, xp.sqrt(xp.where(above, x, 1.0)), 0.0)
''',
    '_angle': '''
def _angle(xp, y, x):
    """Return the angle of (x, y), with finite slopes at 0."""
    return xp.atan2(y, xp.where((x == 0.0) & (y == 0.0), xp.copysign(x + 1.0, x), x))
''',
    '_length': '''
def _length(xp, x, y):
    """
    Return the length of (x, y), right to the last digit; with the slope 0 at 0.

    From C. F. Borges, Algorithm 1014, ACM Trans. Math. Softw. 47 (2021).
    """
    x, y = abs(x), abs(y)
    none = (x == 0.0) & (y == 0.0)
    more, less = xp.where(none, 1.0, xp.maximum(x, y)), xp.minimum(x, y)
    tiny = float(xp.finfo(x.dtype).smallest_normal)
    up = xp.where(more < tiny**0.5, xp.zeros_like(more) + 1.0 / tiny, 1.0)
    more, less = more * up, less * up
    root = xp.sqrt(more * more + less * less)
    a, b = root - less, root - more
    near = more * (2.0 * a - more) + (a - 2.0 * (more - less)) * a
    far = 2.0 * b * (more - 2.0 * less) + (4.0 * b - less) * less + b * b
    root = root - xp.where(root <= 2.0 * less, near, far) / (2.0 * root)
    return xp.where(none, 0.0, root / up)
''',
    '_stack': '''
def _stack(xp, numbers):
    """Return numbers of states along a last axis."""
    return xp.stack(xp.broadcast_arrays(*numbers), axis=-1)
''',
    '_take': '''
def _take(xp, columns, row, like):
    """Return each column at the rows: an array (columns, ...)."""
    numbers = xp.asarray(columns, dtype=like.dtype, device=device(like))
    return xp.reshape(xp.take(numbers, xp.reshape(row, (-1,)), axis=1), (-1, *row.shape))
''',
}
"""Functions of a module, of which it has those that it uses."""


class ArrayModule(PythonModule):
    """Python for arrays; `write_arrays` writes the functions."""

    finite = 'xp.isfinite'
    nearest = 'xp.round'
    conjunction = '&'
    disjunction = '|'

    def write_call(self, operation: Operation, parts: list[str]) -> str:
        name = operation.name
        if name == 'call':
            return f'{parts[0]}(xp, {", ".join(parts[1:])})'
        if name == 'found':
            return f'{parts[0]}_found'
        if name in ('abs', '**', 'item', 'round'):
            return super().write_call(operation, parts)
        if name == 'remainder':
            number, period = parts
            return f'({number} - {period} * xp.round(({number}) / {period}))'
        return f'xp.{name}({", ".join(parts)})'

    def write_choice(self, condition: str, value: str, otherwise: str) -> str:
        return f'xp.where({condition}, {value}, {otherwise})'

    def negate(self, condition: str) -> str:
        return f'~{condition}' if condition.isidentifier() else f'~({condition})'

    def write_outside(self, number: str, low: str, high: str) -> str:
        return f'(({number} < {low}) | ({number} > {high}))'

    def write_threshold(self, name: str, value: float) -> str:
        # In double precision these are the value itself.
        return '4.0 * tiny' if name == 'smallest' else '8.0 * eps'

    def assign(self, name: str, text: str, kind: Kind = 'real') -> str:
        return f'{name}, {name}_found = {text}' if kind == 'other' else f'{name} = {text}'

    def write_table(self, name: str, ends: Sequence[str], rows: Sequence[str]) -> list[str]:
        columns = zip(*(row.split(', ') for row in rows), strict=True)
        return [
            f'_{name}_ends = ({"".join(f"{end}, " for end in ends).rstrip()})',
            f'_{name}_columns = (',
            *(f'    ({", ".join(column)},),' for column in columns),
            ')',
            '',
            '',
            f'def {name}(xp, x):',
            f'    ends = xp.asarray(_{name}_ends, dtype=x.dtype, device=device(x))',
            f'    return _take(xp, _{name}_columns, xp.searchsorted(ends, x), x), None',
            '',
            '',
        ]

    def write_grid(self, name: str, grid: Grid) -> list[str]:
        cells = self.list_cells(grid)
        columns = zip(*(numbers for _, numbers in cells), strict=True)
        return [
            f'_{name}_levels = (',
            *(
                f'    ({self.write_constant(grid.widths[level])}, {first}, {axes}),'
                for level, first, axes in _ranked_levels([key for key, _ in cells])
            ),
            ')',
            f'_{name}_columns = (',
            *(f'    ({self.write_list(column)},),' for column in columns),
            ')',
            '',
            '',
            f'def {name}(xp, *inputs):',
            f'    home = ({self.write_list(grid.home)},)',
            '    cell = -xp.ones_like(inputs[0], dtype=xp.int32)',
            f'    for width, first, axes in _{name}_levels:',
            '        within, rank = cell < 0, 0',
            '        for x, middle, (low, count, known) in zip(inputs, home, axes):',
            '            key = xp.round((x - middle) / width) - low',
            '            within = within & (key >= 0.0) & (key < count)',
            '            at = rank * count + xp.astype(xp.clip(key, 0.0, count - 1.0), xp.int32)',
            '            codes = xp.asarray(known, dtype=xp.int32, device=device(cell))',
            '            rank = xp.astype(xp.searchsorted(codes, at), xp.int32)',
            '            rank = xp.clip(rank, 0, len(known) - 1)',
            '            there = xp.reshape(xp.take(codes, xp.reshape(rank, (-1,))), rank.shape)',
            '            within = within & (there == at)',
            '        cell = xp.where(within, first + rank, cell)',
            '    found = cell >= 0',
            f'    row = _take(xp, _{name}_columns, xp.where(found, cell, 0), inputs[0])',
            '    return row, found',
            '',
            '',
        ]


def _ranked_levels(
    keys: Sequence[tuple[int, ...]],
) -> Iterator[tuple[int, int, tuple[tuple[int, int, tuple[int, ...]], ...]]]:
    """
    Yield each level of sorted cells, the number of its first cell, and its axes.

    An axis has the lowest place, the count of places, and the sorted codes of cells by their
    places so far. A code is the rank of the one before, times that count, plus the place.
    """
    for level in sorted({key[0] for key in keys}):
        places = [key[1:] for key in keys if key[0] == level]
        ranks, axes = [0] * len(places), []
        for axis in map(list, zip(*places, strict=True)):
            low, count = min(axis), max(axis) - min(axis) + 1
            codes = [rank * count + at - low for rank, at in zip(ranks, axis, strict=True)]
            known = {code: rank for rank, code in enumerate(sorted({*codes}))}
            ranks = [known[code] for code in codes]
            axes.append((low, count, tuple(known)))
        yield level, next(k for k, key in enumerate(keys) if key[0] == level), tuple(axes)


class _MaskedWriter(TextWriter):
    """Writes operations that are harmless where the states of a mask do not need them."""

    mask = ''
    """The mask of the path; empty if all states take it."""
    of_condition = False
    """Whether states that take another path may need the operation for its condition."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        # Operations that differ outside the mask for which they are written, or need such ones.
        self._masked: set[Operation] = set()
        self._guards: dict[tuple[str, str], str] = {}

    @contextmanager
    def open_block(self) -> Iterator[list[str]]:
        """Collect the lines of another path; what no mask changes stays known after it."""
        with super().open_block() as lines:
            yield lines
            written = self._texts
        shared = ((name, text) for name, text in written.items() if name not in self._masked)
        self._texts = {**dict(shared), **self._texts}

    def _format_expression(self, operation: Operation) -> WrittenText:
        name, arguments = operation.name, operation.arguments
        if name == '+' and _is_zero_product(arguments[0]) and arguments[1] == 0.0:
            # Some compilers take x + 0.0 for x, and −0.0 turns an angle once round.
            return WrittenText('zero', _ATOM, 0)
        parts = [self.expression_text(argument) for argument in arguments]
        depth = 1 + max((part.depth for part in parts), default=0)
        constant = [not isinstance(argument, Operation) for argument in arguments]
        # Functions of some libraries take no plain numbers.
        texts = [
            f'zero + {part.in_parentheses(5)}' if plain else part.text
            for part, plain in zip(parts, constant, strict=True)
        ]
        if any(operand in self._masked for operand in operation.operands()):
            self._masked.add(operation)
        text = ''
        if name == '/' and self.mask and not constant[1]:
            text = f'{parts[0].in_parentheses(5)} / {self._guard(operation, texts[1])}'
            return WrittenText(text, 5, depth)
        if name in ('<', '<=', '>', '>=') and _is_accuracy(arguments[1]):
            most = f'max({parts[1].text}, {_COARSE}.0 * eps)'
            return WrittenText(f'{parts[0].in_parentheses(4)} {name} {most}', 2, depth)
        if name == 'where' and all(constant[1:]):
            text = f'xp.where({parts[0].text}, {texts[1]}, {parts[2].text})'
        elif name == 'copysign':
            text = f'xp.copysign({", ".join(texts)})'
        elif name == 'hypot':
            text = f'_length(xp, {", ".join(texts)})'
        elif name in _SINGULAR:
            helper, number = _SINGULAR[name]
            if self.of_condition:
                text = f'{helper}(xp, {", ".join(texts)})'
            else:
                if self.mask:
                    texts[number] = self._guard(operation, texts[number])
                text = f'xp.{name}({", ".join(texts)})'
        if not text:
            return super()._format_expression(operation)
        return WrittenText(text, _ATOM, depth)

    def _guard(self, operation: Operation, text: str) -> str:
        """Return the name of an argument that is 1 outside the mask."""
        self._masked.add(operation)
        key = (self.mask, text)
        if key not in self._guards:
            self._guards[key] = name = f'g{len(self._guards)}'
            self.lines.append(f'{name} = xp.where({self.mask}, {text}, 1.0)')
        return self._guards[key]


def _is_zero_product(number: Any) -> bool:
    return isinstance(number, Operation) and number.name == '*' and 0.0 in number.arguments


def _is_accuracy(bound: Any) -> bool:
    """Return whether a bound is as small as the last step of an iteration in double precision."""
    return isinstance(bound, float) and _COARSE * 2.0**-52 < bound < 1e-6


class _ArrayBody(SourceBody):
    """Writes the lines of a function of arrays."""

    writer_class = _MaskedWriter
    _writer: _MaskedWriter

    def __init__(self, subject: Subject, language: ArrayModule, program: Program) -> None:
        super().__init__(subject, language, program)
        self._numbers = 0
        self._merged: set[str] = set()

    def write_lines(self) -> list[str]:
        inputs, writer = self._program.inputs, self._writer
        count = len(self._subject.closure.linkage.inputs)
        names = [symbol.name for symbol in inputs]
        lines = []
        for number, operation in enumerate(inputs):
            array, index = divmod(number, count)
            lines.append(f'{operation.name} = {GIVEN[array]}[..., {index}]')
            writer.name_operation(operation, operation.name)
        # Where an input is not finite, a state that is known to be closed takes its place.
        lines.append(f'm0 = {self._all_finite(names[:count])}')
        write = self._language.write_constant
        lines += (
            f'{symbol.name} = xp.where(m0, {symbol.name}, {write(symbol.value)})'
            for symbol in inputs[:count]
        )
        if names[count:]:
            lines.append(f'moving = {self._all_finite(names[count:])}')
            lines += (f'{name} = xp.where(moving, {name}, 0.0)' for name in names[count:])
        lines += ['zero = xp.zeros_like(q0)', 'status = xp.zeros_like(m0, dtype=xp.int32)']
        lines.append(f'status = xp.where(m0, {UNDECIDED}, status + {Status.INDETERMINATE.name})')
        writer.lines += lines
        self._write_tree(self._program.tree)
        results = self._result_names()
        without = (name for group in results for name in group if name not in self._merged)
        writer.lines += (f'{name} = zero + nan' for name in without)
        groups = [f'_stack(xp, ({", ".join(group)},))' for group in results]
        if names[count:]:
            writer.lines.append(f'status = xp.where(moving, status, {Status.INDETERMINATE.name})')
        writer.lines.append(f'return (status, {", ".join(groups)})')
        constants = list(self._constant_lines())
        head = ['xp = array_namespace(inputs)']
        finfo = [
            f'{name} = float(xp.finfo(inputs.dtype).{of})'
            for name, of in (('eps', 'eps'), ('tiny', 'smallest_normal'))
            if any(name in line for line in chain(constants, writer.lines))
        ]
        code = (f'    {line}' for line in (*head, *finfo, *constants, *writer.lines))
        return [part for line in code for part in self._language.wrap_line(line)]

    def _all_finite(self, names: Sequence[str]) -> str:
        return ' & '.join(f'xp.isfinite({name})' for name in names)

    def _result_names(self) -> list[list[str]]:
        groups = range(1 + self._subject.derivatives)
        return [[f'{"jvb"[i]}{k}' for k in range(len(self._subject.joints))] for i in groups]

    def _write_tree(self, tree: Tree, mask: str = 'm0') -> None:
        """Write a tree for the states of a mask."""
        writer = self._writer
        while isinstance(tree, DecisionBranch):
            writer.mask, writer.of_condition = '' if mask == 'm0' else mask, True
            self._numbers += 1
            condition = f'c{self._numbers}'
            writer.lines.append(f'{condition} = {writer.write(tree.condition)}')
            usual, unusual, holds = tree.held, tree.failed, condition
            if not tree.usual:
                usual, unusual = unusual, usual
                holds = f'~{condition}'
            fails = f'~{condition}' if tree.usual else condition
            if isinstance(unusual, DecisionBranch | SolvedLeaf):
                # What only these states need is written again for others.
                with writer.open_block() as lines:
                    lines.append(f'm{self._numbers}b = {mask} & {fails}')
                    self._write_tree(unusual, f'm{self._numbers}b')
                writer.lines += lines
            elif unusual is not None:
                writer.lines.append(f'status = xp.where({mask} & {fails}, {unusual.name}, status)')
            before, mask = mask, f'm{condition[1:]}'
            writer.lines.append(f'{mask} = {before} & {holds}')
            tree = usual
        writer.mask, writer.of_condition = '' if mask == 'm0' else mask, False
        if isinstance(tree, SolvedLeaf):
            self._write_merged(tree, mask)
        elif tree is not None:
            writer.lines.append(f'status = xp.where({mask}, {tree.name}, status)')

    def _write_merged(self, leaf: SolvedLeaf, mask: str) -> None:
        """Write the numbers of a leaf into those of the whole."""
        writer, outside = self._writer, self._write_limits(leaf)
        writer.lines.append(f'status = xp.where({mask}, {leaf.status.name}, status)')
        if outside:
            limited = f'status = xp.where({mask} & ({outside}), {Status.LIMITED.name}, status)'
            writer.lines.append(limited)
        if self._subject.derivatives:
            writer.lines.append(f'taken = {mask} & moving')
            mask = 'taken'
        for names, group in zip(self._result_names(), leaf.outputs[:-1], strict=True):
            for name, number in zip(names, group, strict=True):
                text = writer.write(number)
                if not isinstance(number, Operation):
                    text = f'zero + {text}'
                known = name if name in self._merged else 'nan'
                writer.lines.append(f'{name} = xp.where({mask}, {text}, {known})')
                self._merged.add(name)


def write_arrays(subject: Subject) -> str:
    """
    Return a linkage as a Python module for arrays.

    It has a function for each number of derivatives up to the subject's, and with one derivative
    the Jacobian.

    Raises
    ------
    DefinitionError
        If the linkage cannot be compiled.

    """
    language = ArrayModule(subject.derivatives)
    tables: dict[StartTable | Grid, str] = {}
    functions: list[str] = []
    for order in range(1 + subject.derivatives):
        part = subject._replace(derivatives=order)
        body = _ArrayBody(part, language, compile_subject(part))
        body.tables = tables
        arguments = ', '.join(GIVEN[: 1 + order])
        functions += ['', '', f'def {FUNCTIONS[order]}({arguments}):', *body.write_lines()]
    if subject.derivatives:
        functions += _JACOBIAN.splitlines()
    code = '\n'.join([*body.table_lines(), *functions])
    helpers = [text for name, text in _HELPERS.items() if f'{name}(xp, ' in code]
    closure = subject.closure
    notes = _NOTES.format(inputs=len(closure.linkage.inputs), joints=len(subject.joints))
    name = FUNCTIONS[subject.derivatives]
    lines = [
        CODING,
        *(f'# {line}'.rstrip() for line in (*head_lines(subject, name), *notes.splitlines())),
        '',
        'from math import inf, nan',
        '',
        'from array_api_compat import array_namespace, device',
        '',
        *(f'{status} = {index}' for index, status in enumerate(STATUSES)),
        *(line for text in helpers for line in ('', *text.splitlines())),
        '',
        '',
    ]
    return '\n'.join([*lines, code.strip(), ''])
