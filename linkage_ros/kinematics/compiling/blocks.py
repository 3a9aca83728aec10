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

"""A path as numpy: one function that passes a block of states through buffers that it reuses."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan
from typing import Any, Final

from linkage_ros.generated_code import written
from linkage_ros.kinematics.batch import Array, Mask
from linkage_ros.kinematics.compiling.numpy_blocks import Number
from linkage_ros.kinematics.compiling.tape import Operation
from linkage_ros.kinematics.compiling.writer import uses
import numpy as np

_FUNCTIONS: Final[dict[str, Any]] = {
    '+': np.add,
    '-': np.subtract,
    '*': np.multiply,
    '/': np.divide,
    'abs': np.abs,
    'sin': np.sin,
    'cos': np.cos,
    'tan': np.tan,
    'sqrt': np.sqrt,
    'atan2': np.arctan2,
    'copysign': np.copysign,
    'maximum': np.maximum,
    'minimum': np.minimum,
    '<': np.less,
    '<=': np.less_equal,
    '>': np.greater,
    '>=': np.greater_equal,
    '==': np.equal,
    '!=': np.not_equal,
    'and': np.logical_and,
    'or': np.logical_or,
    'not': np.logical_not,
    'where': np.where,
}


class BlockFunction:
    """
    Numbers of a path, of many states at once.

    Parameters
    ----------
    inputs
        Names of the path's inputs.
    arrays
        Those that are arrays; the others are numbers.
    roots
        What it finds.
    condition
        Where that holds.

    Attributes
    ----------
    rows, masks
        How many rows of scratch it needs, and how many of truths.
    source
        As it is written.

    """

    def __init__(
        self,
        inputs: Sequence[str],
        arrays: Sequence[str],
        roots: Sequence[Number],
        condition: Number = True,
    ) -> None:
        writer = _Writer(arrays, roots, condition)
        self.rows, self.masks = writer.rows.count, writer.masks.count
        names = [
            (inputs, 'given'),
            ([f'o{k}' for k in range(len(roots))], 'out'),
            ([f'r{k}' for k in range(self.rows)], 'rows'),
            ([f'm{k}' for k in range(self.masks)], 'masks'),
        ]
        head = [f'{", ".join(each)}, = {of}' for each, of in names if each]
        lines = '\n'.join(f'    {line}' for line in (*head, *writer.lines))
        self.source = f'def run(given, out, rows, masks):\n{lines}\n'
        functions = (*_FUNCTIONS.values(), np.copyto, np.count_nonzero)
        namespace: dict[str, Any] = {'inf': inf, 'nan': nan}
        namespace |= {function.__name__: function for function in functions}
        self._run = written(self.source, 'run', namespace)

    def __call__(
        self, given: Sequence[Array | float], out: Sequence[Array], rows: Array, masks: Mask
    ) -> Mask | None:
        """
        Write what it finds of a block.

        Parameters
        ----------
        given
            The inputs.
        out
            An array for each root; what it gets where the condition does not hold means nothing.
            Nothing is written where it holds for less than half of the states.
        rows, masks
            Scratch, as long as the block.

        Returns
        -------
        Mask | None
            Where the condition holds, in the scratch; None where it always does.

        """
        holds: Mask | None = self._run(given, out, rows, masks)
        return holds


class _Room:
    """Names of buffers, which are given out and taken back."""

    def __init__(self, letter: str) -> None:
        self._letter = letter
        self._free: list[str] = []
        self.count = 0

    def take(self) -> str:
        """Return one that is free."""
        if self._free:
            return self._free.pop()
        self.count += 1
        return f'{self._letter}{self.count - 1}'

    def give_back(self, name: str) -> None:
        """Take back what it has given out."""
        if name.startswith(self._letter):
            self._free.append(name)


class _Writer:
    """Writes operations as passes over arrays, each after its operands."""

    def __init__(self, arrays: Sequence[str], roots: Sequence[Number], condition: Number) -> None:
        self.rows, self.masks = _Room('r'), _Room('m')
        self.lines: list[str] = []
        self._arrays = arrays
        self._names: dict[Operation, str] = {}
        self._of_states: set[Operation] = set()
        self._left = uses([condition, *roots])
        self._wanted: dict[Operation, str] = {}
        for k, root in enumerate(roots):
            if isinstance(root, Operation) and not root.is_input:
                self._wanted.setdefault(root, f'o{k}')
        self._write(condition)
        held = self._text(condition) if isinstance(condition, Operation) else None
        if held:
            self.lines.append(f'if 2 * count_nonzero({held}) < {held}.size: return {held}')
        for k, root in enumerate(roots):
            self._write(root)
            place = f'o{k}'
            if self._text(root) != place:
                self.lines.append(f'copyto({place}, {self._text(root)})')
        self.lines.append(f'return {held}')

    def _text(self, number: Number) -> str:
        if isinstance(number, Operation):
            return self._names[number]
        # A linkage may have numbers of numpy's, of which repr() tells the type.
        return repr(number if isinstance(number, bool) else float(number))

    def _write(self, root: Number) -> None:
        """Write what a number needs that is not written yet, and itself."""
        waiting = [(root, False)] if isinstance(root, Operation) else []
        while waiting:
            operation, ready = waiting.pop()
            if operation in self._names:
                continue
            if ready or operation.is_input:
                self._place(operation)
            else:
                waiting.append((operation, True))
                waiting += [(operand, False) for operand in reversed(operation.operands())]

    def _place(self, operation: Operation) -> None:
        operands = operation.operands()
        if operation.is_input:
            self._names[operation] = operation.name
            if operation.name in self._arrays:
                self._of_states.add(operation)
            return
        texts = [self._text(argument) for argument in operation.arguments]
        if not any(operand in self._of_states for operand in operands):
            # One number for all states.
            self._names[operation] = f't{operation.number}'
            self.lines.append(
                f't{operation.number} = {_FUNCTIONS[operation.name].__name__}({", ".join(texts)})'
            )
            return
        self._of_states.add(operation)
        if operation.name == 'where':
            self._choose(operation, texts)
        else:
            self._done_with(operands)
            into = self._into(operation)
            self.lines.append(
                f'{_FUNCTIONS[operation.name].__name__}({", ".join(texts)}, out={into})'
            )

    def _into(self, operation: Operation) -> str:
        """Return the buffer that an operation goes to."""
        wanted = self._wanted.get(operation)
        if wanted is None:
            wanted = (self.masks if operation.kind == 'truth' else self.rows).take()
        self._names[operation] = wanted
        return wanted

    def _done_with(self, operands: Sequence[Operation]) -> None:
        """Count uses, and take back what has no more of them."""
        for operand in operands:
            self._left[operand] -= 1
            if not self._left[operand]:
                for room in (self.rows, self.masks):
                    room.give_back(self._names[operand])

    def _choose(self, operation: Operation, texts: Sequence[str]) -> None:
        """Write a choice: the one number over the other, where a condition holds."""
        condition, one, other = texts
        last = operation.arguments[2]
        if self._left.get(last) == 1 and operation not in self._wanted and other[0] == 'r':
            # Nobody else needs the other number: it is written over where it stands.
            into = self._names[operation] = other
            self._left[last] += 1
        else:
            into = self._into(operation)
            self.lines.append(f'copyto({into}, {other})')
        self.lines.append(f'copyto({into}, {one}, where={condition})')
        self._done_with(operation.operands())
