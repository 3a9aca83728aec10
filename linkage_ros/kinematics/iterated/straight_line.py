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
from typing import Any

from linkage_ros.kinematics.arithmetic import UndecidedError
from linkage_ros.kinematics.built_once import BUILD_LOCK
from linkage_ros.kinematics.compiling import compile_line
from linkage_ros.kinematics.step import LinkState

_PARTS = (list, tuple)


class StraightLine:
    """
    A function of states, or of lists, as straight-line code for numbers, with a tape's bits.

    ``examples`` returns states as symbols; what is a number there is the same at all states.
    Without them the code is compiled at the first states. It returns None where the function
    would decide otherwise.
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

    def __call__(self, *states: Sequence[Any]) -> list[float] | None:
        """Return the numbers of the function."""
        if self._line is None:
            with BUILD_LOCK:
                self._line = self._compile(self._examples() or states)
        try:
            found = self._line(*list_numbers(states))
        except (ValueError, OverflowError, ZeroDivisionError):
            return None  # Numbers overflow: it is no function of them.
        return found and list(found[0])

    def _compile(self, states: Sequence[Sequence[Any]]) -> Callable[..., Any]:
        examples = list_numbers(states)
        varying = list(map(_is_symbol, examples))
        values = [one.operation.value if _is_symbol(one) else one for one in examples]
        if not any(varying):
            varying = [True] * len(varying)

        def compute(*numbers: Any) -> Sequence[Any]:
            given = zip(numbers, values, varying, strict=True)
            left = iter([number if varies else value for number, value, varies in given])
            return self.function(*(_fill_numbers(state, left) for state in states))

        try:
            return compile_line(compute, values)
        except UndecidedError:
            return lambda *_: None


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
    """Return whether any number of states is a symbol."""
    return any(map(_is_symbol, list_numbers(states)))
