# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The order of the operations of a program, and their expressions."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

from linkage_ros.kinematics.compiling.tape import Operation

_DEEPEST = 12
"""Deepest nesting of an expression: compilers have limits, and readers too."""

_PRECEDENCE = {'+': 4, '-': 4, '*': 5, '/': 5, 'negative': 6, '**': 7}
_COMPARISONS = frozenset(('<', '<=', '>', '>=', '==', '!='))

_ATOM = 9


def count_uses(roots: Iterable[Any]) -> dict[Operation, int]:
    """Return how often each operation is used, by others that the roots need or as a root."""
    counts: dict[Operation, int] = {}
    waiting = [root for root in roots if isinstance(root, Operation)]
    for root in waiting:
        counts[root] = counts.get(root, 0) + 1
    seen = set()
    while waiting:
        operation = waiting.pop()
        if operation not in seen:
            seen.add(operation)
            for operand in operation.operands():
                counts[operand] = counts.get(operand, 0) + 1
                waiting.append(operand)
    return counts


def needed_operations(root: Operation, known: Container[Operation]) -> Iterator[Operation]:
    """Yield an operation and those that it needs, unless known, each after its operands."""
    waiting: list[tuple[Operation, bool]] = [(root, False)]
    while waiting:
        operation, ready = waiting.pop()
        if operation in known:
            continue
        if ready:
            yield operation
            continue
        waiting.append((operation, True))
        waiting += [(operand, False) for operand in reversed(operation.operands())]


class WrittenText(NamedTuple):
    """An expression: its text, how tightly it binds, and how deep it is nested."""

    text: str
    precedence: int
    depth: int

    def in_parentheses(self, precedence: int) -> str:
        """Return it as a part of an expression of a precedence."""
        return self.text if self.precedence >= precedence else f'({self.text})'


class TextWriter:
    """
    Writes operations as lines of a language with the operators of C.

    An operation that is used once is written inline; one that is used more often gets a name.

    ``roots`` are all results that the program needs: its conditions and its outputs. ``call``
    takes an operation and its arguments, ``choice`` a condition and two expressions, ``assign`` a
    name, an expression and its operation.
    """

    def __init__(
        self,
        roots: Sequence[Any],
        constant: Callable[[Any], str],
        call: Callable[[Operation, list[str]], str],
        choice: Callable[[str, str, str], str],
        assign: Callable[[str, str, Operation], str],
    ) -> None:
        self._uses = count_uses(roots)
        self._constant = constant
        self._call = call
        self._choice = choice
        self._assign = assign
        self._texts: dict[Operation, WrittenText] = {}
        self.lines: list[str] = []

    def name_operation(self, operation: Operation, text: str) -> None:
        """Give a name to an operation, such as an input."""
        self._texts[operation] = WrittenText(text, _ATOM, 0)

    @contextmanager
    def open_block(self) -> Iterator[list[str]]:
        """Collect the lines of a block; names assigned in it are unknown after it."""
        texts, lines = self._texts, self.lines
        self._texts, self.lines = dict(texts), []
        yield self.lines
        self._texts, self.lines = texts, lines

    def write(self, root: Any) -> str:
        """Return the text of a number, after the lines that it needs."""
        return self.expression_text(root).text

    def expression_text(self, root: Any) -> WrittenText:
        """Return a number as an expression, after the lines that it needs."""
        if not isinstance(root, Operation):
            return WrittenText(
                self._constant(root), _ATOM if not str(root).startswith('-') else 6, 0
            )
        for operation in needed_operations(root, self._texts):
            self._texts[operation] = self._place_operation(operation)
        return self._texts[root]

    def _place_operation(self, operation: Operation) -> WrittenText:
        text = self._format_expression(operation)
        if self._uses[operation] < 2 and text.depth < _DEEPEST and operation.name != 'call':
            return text
        name = f't{operation.number}'
        self.lines.append(self._assign(name, text.text, operation))
        return WrittenText(name, _ATOM, 0)

    def _format_expression(self, operation: Operation) -> WrittenText:
        parts = [self.expression_text(argument) for argument in operation.arguments]
        depth = 1 + max((part.depth for part in parts), default=0)
        name = operation.name
        if name in _PRECEDENCE and name not in ('negative', '**'):
            precedence = _PRECEDENCE[name]
            first, second = parts
            # Sums and products associate to the left: the right operand needs brackets.
            return WrittenText(
                f'{first.in_parentheses(precedence)} {name} '
                f'{second.in_parentheses(precedence + 1)}',
                precedence,
                depth,
            )
        if name == 'negative':
            precedence = _PRECEDENCE[name]
            return WrittenText(f'-{parts[0].in_parentheses(precedence + 1)}', precedence, depth)
        if name in _COMPARISONS:
            first, second = parts
            return WrittenText(
                f'{first.in_parentheses(4)} {name} {second.in_parentheses(4)}', 2, depth
            )
        if name == 'where':
            condition, first, second = parts
            return WrittenText(
                self._choice(
                    condition.in_parentheses(2), first.in_parentheses(2), second.in_parentheses(2)
                ),
                0,
                depth,
            )
        return WrittenText(self._call(operation, [part.text for part in parts]), _ATOM, depth)
