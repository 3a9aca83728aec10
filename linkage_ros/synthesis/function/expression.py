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
A formula of x, as somebody types it, and as nothing but a formula.

It is read by the few rules below, and by nothing else: Python never sees it, so that there is
nothing in it to run::

    sum      product, then any number of + product or - product
    product  signed, then any number of * signed or / signed
    signed   + signed, - signed or power
    power    value, or value ^ signed; ** is the same, and -x^2 is -(x^2)
    value    a number, x, pi, e, tau, (sum) or function(sum)

``log`` is the natural logarithm, as ``ln`` is; the one to the base of 10 is ``log10``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import e, isfinite, pi, tau
import re
from typing import NamedTuple, overload

from linkage_ros.errors import did_you_mean, listed, quoted, SynthesisError
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FUNCTIONS: dict[str, np.ufunc] = {
    'sin': np.sin,
    'cos': np.cos,
    'tan': np.tan,
    'asin': np.arcsin,
    'acos': np.arccos,
    'atan': np.arctan,
    'sinh': np.sinh,
    'cosh': np.cosh,
    'tanh': np.tanh,
    'sqrt': np.sqrt,
    'cbrt': np.cbrt,
    'exp': np.exp,
    'ln': np.log,
    'log': np.log,
    'log10': np.log10,
    'log2': np.log2,
    'abs': np.absolute,
}

CONSTANTS = {'pi': pi, 'e': e, 'tau': tau}

_X = 'x'

_OPERATORS: dict[str, np.ufunc] = {
    '+': np.add,
    '-': np.subtract,
    '*': np.multiply,
    '/': np.divide,
    '^': np.power,
    '**': np.power,
}

_LONGEST = 200
"""Characters."""

_DEEPEST = 40
"""Levels of parentheses, powers and signs; Python's own stack must bear them."""

_TOKEN = re.compile(
    r'(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)'
    r'|(?P<name>[A-Za-z_][A-Za-z_0-9]*)'
    r'|(?P<operator>\*\*|[-+*/^()])'
)

_SPACES = re.compile(r'[ \t\r\n]*')

_MEANT = {
    '\N{MINUS SIGN}': '-',
    '\N{EN DASH}': '-',
    '\N{MULTIPLICATION SIGN}': '*',
    '\N{MIDDLE DOT}': '*',
    '\N{DIVISION SIGN}': '/',
    '\N{GREEK SMALL LETTER PI}': 'pi',
    '\N{SQUARE ROOT}': 'sqrt',
    '\N{SUPERSCRIPT TWO}': '^2',
    '\N{SUPERSCRIPT THREE}': '^3',
    ',': '.',
    '[': '(',
    ']': ')',
}
"""What is meant by characters that come with formulas copied from elsewhere."""

_Step = float | np.ufunc | None
"""A number, what is done to the one or two values before it, or x."""


@dataclass(frozen=True, slots=True)
class Expression:
    """
    A formula of x.

    Parameters
    ----------
    text
        The formula, such as ``log10(x)``.

    Raises
    ------
    SynthesisError
        Where it is none: with the part that is wrong, and its place, counted from 1.

    """

    text: str
    _steps: tuple[_Step, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, '_steps', _Reader(self.text).steps)

    @overload
    def __call__(self, x: float) -> float: ...

    @overload
    def __call__(self, x: Array) -> Array: ...

    def __call__(self, x: float | Array) -> float | Array:
        """
        Return the values; inf or nan where there are none.

        Parameters
        ----------
        x
            A number, or an array of any shape.

        """
        values = np.asarray(x, np.float64)
        stack: list[Array | float] = []
        with np.errstate(all='ignore'):
            for step in self._steps:
                if step is None:
                    stack.append(values)
                elif isinstance(step, float):
                    stack.append(step)
                else:
                    first = len(stack) - step.nin
                    stack[first:] = [step(*stack[first:])]
        (result,) = stack
        if values.ndim:
            # Of a formula without an x, a number; and x itself is not given away.
            return np.array(np.broadcast_to(result, values.shape))
        return float(result)


class _Token(NamedTuple):
    """A part of a formula: its kind as the pattern has it, or 'end', and where it begins."""

    kind: str
    text: str
    at: int


class _Reader:
    """
    What reads a formula, from its beginning to its end.

    Its steps are in the order in which they are done: values first, then what is done to them.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        if len(text) > _LONGEST:
            raise self._error(
                f'is {len(text)} characters long', f'keep it within {_LONGEST} characters'
            )
        self._tokens = self._split()
        self._next = 0
        self._depth = 0
        self._found: list[_Step] = []
        if self._token.kind == 'end':
            raise self._error('is empty', 'write a formula of x, such as log10(x)')
        self._sum()
        if self._token.kind != 'end':
            raise self._leftover()
        self.steps = tuple(self._found)

    @property
    def _token(self) -> _Token:
        return self._tokens[self._next]

    def _split(self) -> list[_Token]:
        found: list[_Token] = []
        at = 0
        while True:
            spaces = _SPACES.match(self._text, at)
            at = spaces.end() if spaces else at
            if at == len(self._text):
                return [*found, _Token('end', '', at)]
            match = _TOKEN.match(self._text, at)
            if match is None:
                character = self._text[at]
                meant = _MEANT.get(character)
                raise self._wrong(
                    _Token('', character, at),
                    'has no meaning in a formula',
                    f'write {meant} instead' if meant else 'use numbers, x, + - * / ^ and ( )',
                )
            found.append(_Token(match.lastgroup or '', match.group(), at))
            at = match.end()

    def _takes(self, *operators: str) -> str:
        """Step over one of these and return it; '' if none stands here."""
        kind, text, _ = self._token
        if kind != 'operator' or text not in operators:
            return ''
        self._next += 1
        return text

    def _sum(self) -> None:
        self._product()
        while sign := self._takes('+', '-'):
            self._product()
            self._found.append(_OPERATORS[sign])

    def _product(self) -> None:
        self._signed()
        while sign := self._takes('*', '/'):
            self._signed()
            self._found.append(_OPERATORS[sign])

    def _signed(self) -> None:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise self._wrong(
                self._token, f'is more than {_DEEPEST} levels deep', 'write it with fewer'
            )
        if sign := self._takes('+', '-'):
            self._signed()
            if sign == '-':
                self._found.append(np.negative)
        else:
            self._power()
        self._depth -= 1

    def _power(self) -> None:
        self._value()
        if sign := self._takes('^', '**'):
            self._signed()
            self._found.append(_OPERATORS[sign])

    def _value(self) -> None:
        token = self._token
        if self._takes('('):
            self._inner(token)
        elif token.kind == 'number':
            self._next += 1
            number = float(token.text)
            if not isfinite(number):
                raise self._wrong(token, 'is beyond all numbers', 'write a smaller one')
            self._found.append(number)
        elif token.kind == 'name':
            self._next += 1
            self._name(token)
        elif token.kind == 'end':
            before = self._tokens[self._next - 1]
            raise self._wrong(before, 'has nothing after it', 'write what it applies to')
        else:
            raise self._wrong(
                token, 'stands where a value is wanted', 'write a number or x before it'
            )

    def _name(self, token: _Token) -> None:
        name = token.text
        if name == _X:
            self._found.append(None)
        elif name in CONSTANTS:
            self._found.append(CONSTANTS[name])
        elif name in FUNCTIONS:
            opening = self._token
            if not self._takes('('):
                raise self._wrong(token, 'is a function', f'write {name}(…)')
            self._inner(opening)
            self._found.append(FUNCTIONS[name])
        else:
            known = [_X, *CONSTANTS, *FUNCTIONS]
            raise self._wrong(
                token,
                'is not known',
                did_you_mean(name.lower(), known, f'there are {listed(known)}'),
            )

    def _inner(self, opening: _Token) -> None:
        """Read what is in parentheses."""
        self._sum()
        if not self._takes(')'):
            if self._token.kind == 'end':
                raise self._wrong(opening, 'is not closed', "write ')' where it ends")
            raise self._leftover()

    def _leftover(self) -> SynthesisError:
        """Return what is wrong with something that follows a whole formula."""
        token = self._token
        if token.text == ')':
            return self._wrong(token, 'closes nothing', "leave it out, or write '(' before")
        before = self._tokens[self._next - 1]
        return self._wrong(
            token, f'follows {quoted(before.text)} with nothing between', 'write * between the two'
        )

    def _wrong(self, token: _Token, reason: str, remedy: str) -> SynthesisError:
        return self._error(f'{quoted(token.text)} at character {token.at + 1} {reason}', remedy)

    def _error(self, reason: str, remedy: str) -> SynthesisError:
        return SynthesisError(named(self._text), reason, remedy)


def named(text: str) -> str:
    """Return a formula as errors name it."""
    return f'function {quoted(text)}'
