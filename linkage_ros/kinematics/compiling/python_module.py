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

"""A linkage as a Python module that needs only `math`."""

from __future__ import annotations

from collections.abc import Sequence

from linkage_ros.kinematics.compiling.source import (
    GIVEN,
    Language,
    STATUSES,
    Subject,
    WIDTH,
)
from linkage_ros.kinematics.compiling.tape import Operation

_NOTES = (
    '',
    'It returns the status and a tuple for each group of values, empty where the status has none.',
)

_IMPORTS = 'from math import atan2, copysign, cos, inf, isfinite, sin, sqrt'


class PythonModule(Language):
    """
    Python.

    Parameters
    ----------
    derivatives
        Number of derivatives that the function gives.

    """

    infinity = 'inf'
    conjunction = 'and'
    disjunction = 'or'

    def __init__(self, derivatives: int) -> None:
        self._groups = 1 + derivatives

    def call(self, operation: Operation, parts: list[str]) -> str:
        """Write the call of a function."""
        if operation.name == '**':
            return f'(({parts[0]}) ** {parts[1]})'
        if operation.name == 'hypot':
            # The root that C's hypot() gives; the last digits of math.hypot() differ.
            return f'abs(complex({parts[0]}, {parts[1]}))'
        return super().call(operation, parts)

    def choice(self, condition: str, one: str, other: str) -> str:
        """Write a choice between two expressions."""
        return f'{one} if {condition} else {other}'

    def negated(self, condition: str) -> str:
        """Write that a condition does not hold; this is true for NaN too."""
        return f'not {condition}' if condition.isidentifier() else f'not ({condition})'

    def block(self, condition: str, lines: Sequence[str]) -> list[str]:
        """Write lines that run if a condition holds."""
        return [f'if {condition}:', *(f'    {line}' for line in lines)]

    def wrapped(self, line: str) -> list[str]:
        """Break a line of code that is too long."""
        if len(line) > WIDTH:
            name, equals, text = line.partition(' = ')
            if equals:
                line = f'{name} = ({text})'
            elif line.lstrip().startswith('if '):
                indent, _, condition = line.partition('if ')
                line = f'{indent}if ({condition[:-1]}):'
        return super().wrapped(line)

    def assigned(self, name: str, text: str, truth: bool = False) -> str:
        """Write a line that assigns a number, or a truth value, to a name."""
        return f'{name} = {text}'

    def commented(self, line: str, text: str) -> str:
        """Write a comment behind a line."""
        return f'{line}  # {text}'

    def finite(self, name: str) -> str:
        """Write that a number is finite."""
        return f'isfinite({name})'

    def rounded(self, text: str) -> str:
        """Write the nearest integer."""
        return f'round({text})'

    def status(self, name: str) -> str:
        """Write a status."""
        return name

    def left(self, status: str) -> str:
        """Write a line that returns a status without values."""
        return f'return ({", ".join([status, *["()"] * self._groups])})'

    def solved(self, status: str, groups: Sequence[Sequence[str]]) -> list[str]:
        """Write lines that return a status and values."""
        tuples = (f'({", ".join(group)},)' for group in groups)
        return [f'return ({", ".join([status, *tuples])})']

    def whole(self, subject: Subject, head: Sequence[str], body: Sequence[str]) -> str:
        """Write the source."""
        name = self.function(subject.derivatives)
        lines = [
            *(f'# {line}'.rstrip() for line in (*head, *_NOTES)), '', _IMPORTS, '',
            *(f'{status} = {number}' for number, status in enumerate(STATUSES)), '', '',
            f'def {name}({", ".join(GIVEN[: self._groups])}):', *body,
        ]  # fmt: skip
        return '\n'.join([*lines, ''])
