# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A function of the states of links, compiled for numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import count
from typing import Any

from linkage_ros.generated_code import define_function
from linkage_ros.kinematics.arithmetic import UndecidedError
from linkage_ros.kinematics.built_once import BUILD_LOCK
from linkage_ros.kinematics.compiling import compile_line
from linkage_ros.kinematics.step import LinkState

_PARTS = (list, tuple)


class StraightLine:
    """
    A function of states, or of lists, as straight-line code for numbers, with a tape's bits.

    ``examples`` returns states as symbols; what is a number there is the same at all states.
    Without them the code is compiled at the first states. What it returns is nested as what the
    function returns; None where the function would decide otherwise.
    """

    __slots__ = ('_examples', '_line', 'function')

    def __init__(
        self,
        function: Callable[..., Sequence[Any]],
        examples: Callable[[], Sequence[Sequence[Any]] | None],
    ) -> None:
        self.function = function
        self._examples = examples
        self._line: Callable[..., Any] | None = None

    def __call__(self, *states: Sequence[Any]) -> Any:
        """Return what the function returns, or None."""
        if self._line is None:
            with BUILD_LOCK:
                self._line = self._compile(self._examples() or states)
        try:
            return self._line(*states)
        except (ValueError, OverflowError, ZeroDivisionError):
            return None  # Numbers overflow: it is not a function of them.

    def _compile(self, states: Sequence[Sequence[Any]]) -> Callable[..., Any]:
        examples, result = list_numbers(states), None
        varying = list(map(_is_symbol, examples))
        values = [
            example.operation.value if _is_symbol(example) else example for example in examples
        ]
        if not any(varying):
            varying = [True] * len(varying)

        def compute(*numbers: Any) -> Sequence[Any]:
            nonlocal result
            triples = zip(numbers, values, varying, strict=True)
            left = iter([number if varies else value for number, value, varies in triples])
            result = self.function(*(_fill_numbers(state, left) for state in states))
            return list_numbers(result)

        try:
            return _nest_call(compile_line(compute, values), states, result)
        except UndecidedError:
            return lambda *_: None


def _nest_call(line: Callable[..., Any], states: Sequence[Any], result: Any) -> Callable[..., Any]:
    """Return a line that takes and returns numbers as one of states, nested as the result."""
    parameters = [f'x{k}' for k in range(len(list_numbers(states)))]
    types: dict[str, Any] = {}
    returned = _part_text(result, (f'found[{k}]' for k in count()), types)
    source = f"""\
def call(*states):
    {_part_text(tuple(states), iter(parameters))} = states
    found = line({', '.join(parameters)})
    if found is not None:
        found, = found
        return {returned}
"""
    return define_function(source, 'call', {'line': line, **types})  # type: ignore[no-any-return]


def _part_text(part: Any, names: Iterator[str], types: dict[str, Any] | None = None) -> str:
    """Return the text of nested names; with ``types``, which it fills, tuples with fields too."""
    if not isinstance(part, _PARTS):
        return next(names)
    text = ''.join(f'{_part_text(item, names, types)}, ' for item in part)
    if isinstance(part, list):
        return f'[{text}]'
    if types is None or not hasattr(part, '_fields'):
        return f'({text})'
    types[type(part).__name__] = type(part)
    return f'{type(part).__name__}({text})'


def list_numbers(parts: Sequence[Any]) -> list[Any]:
    """Return all numbers in states, also those of vectors, frames and motions."""
    numbers: list[Any] = []
    for part in parts:
        # Most are numbers, and this is called for each start of an iteration.
        if type(part) is not float and isinstance(part, _PARTS):
            numbers += list_numbers(part)
        else:
            numbers.append(part)
    return numbers


def _fill_numbers(example: Any, numbers: Iterator[Any]) -> Any:
    """Return a state like an example, with other numbers."""
    if not isinstance(example, list | tuple):
        return next(numbers)
    parts = [_fill_numbers(part, numbers) for part in example]
    if isinstance(example, list):
        return parts
    return type(example)(*parts) if hasattr(example, '_fields') else tuple(parts)


def _is_symbol(number: Any) -> bool:
    return hasattr(number, 'apply')


def has_symbols(*states: LinkState) -> bool:
    """Return whether any number of states is a symbol: then an input, a coordinate, is one."""
    return any(_is_symbol(number) for state in states for number in state.coordinates)
