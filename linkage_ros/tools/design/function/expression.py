# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A formula of x, as a user types it.

Each token of the text is checked: only numbers, x, constants, functions, operators and parentheses
are accepted, in a valid order. The text is then parsed as Python, which gives the precedence
(-x^2 is -(x^2), 2^x^2 is 2^(x^2)), and is never executed. ``^`` and ``**`` are the same; ``log``
is the natural logarithm, like ``ln``; ``log10`` has base 10.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import e, isfinite, pi, tau
import re
from typing import cast, NamedTuple, overload

from linkage_ros.errors import did_you_mean, list_names, quote, SynthesisError
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

_OPERATORS: dict[type[ast.operator], np.ufunc] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}

_LONGEST = 200
"""Most characters of a formula."""

_DEEPEST = 40
"""Levels of parentheses, powers and signs: a limit for Python's parser and stack."""

_TOKEN = re.compile(
    r'(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)'
    r'|(?P<name>[A-Za-z_][A-Za-z_0-9]*)'
    r'|(?P<operator>\*\*|[-+*/^()])'
)

_SPACES = ' \t\r\n'

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
"""Meaning of characters that come with formulas copied from elsewhere."""

_Step = float | np.ufunc | None
"""A number, an operation on the one or two values before it, or None for x."""


@dataclass(frozen=True, slots=True)
class Expression:
    """
    A formula of x, such as ``log10(x)``.

    A SynthesisError names the wrong part of a text that is not a formula, and its place, counted
    from 1.
    """

    text: str
    _steps: tuple[_Step, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        formula = ast.parse(_as_python(self.text), mode='eval')
        object.__setattr__(self, '_steps', tuple(_evaluation_steps(formula.body)))

    @overload
    def __call__(self, x: float) -> float: ...

    @overload
    def __call__(self, x: Array) -> Array: ...

    def __call__(self, x: float | Array) -> float | Array:
        """Return the values for an x of any shape; inf or NaN where the formula has none."""
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
            # A formula without x gives a number; and the array x itself must not be returned.
            return np.array(np.broadcast_to(result, values.shape))
        return float(result)


class _Token(NamedTuple):
    """A part of a formula: its kind in the pattern, its text and its start."""

    kind: str
    text: str
    at: int


def _evaluation_steps(node: ast.expr) -> Iterator[_Step]:
    """Yield values, then the operations on them, in the order of evaluation."""
    match node:
        case ast.Constant():
            yield cast('float', node.value)
        case ast.Name():
            yield CONSTANTS.get(node.id)
        case ast.Call():
            yield from _evaluation_steps(node.args[0])
            yield FUNCTIONS[cast('ast.Name', node.func).id]
        case ast.UnaryOp():
            yield from _evaluation_steps(node.operand)
            if isinstance(node.op, ast.USub):
                yield np.negative
        case ast.BinOp():
            yield from _evaluation_steps(node.left)
            yield from _evaluation_steps(node.right)
            yield _OPERATORS[type(node.op)]


def _as_python(text: str) -> str:
    """Return a formula in Python syntax; refuse a text that is not a formula."""
    if len(text) > _LONGEST:
        raise _formula_error(
            text, f'is {len(text)} characters long', f'keep it within {_LONGEST} characters'
        )
    tokens = list(_split_tokens(text))
    if not tokens:
        raise _formula_error(text, 'is empty', 'write a formula of x, such as log10(x)')
    opened: list[_Token] = []
    depths = [1]  # of each open parenthesis: how many signs and powers the next value is within
    has_value = False
    for index, token in enumerate(tokens):
        before = tokens[index - 1]
        if has_value:
            if token.text == ')':
                if not opened:
                    raise _token_error(
                        text, token, 'closes nothing', "leave it out, or write '(' before"
                    )
                opened.pop()
                depths.pop()
            elif token.kind != 'operator' or token.text == '(':
                reason = f'follows {quote(before.text)} with nothing between'
                raise _token_error(text, token, reason, 'write * between the two')
            else:
                has_value = False
                depths[-1] = depths[-1] + 1 if token.text in ('^', '**') else 1
        elif sum(depths) > _DEEPEST:
            raise _token_error(
                text, token, f'is more than {_DEEPEST} levels deep', 'write it with fewer'
            )
        elif token.text == '(':
            opened.append(token)
            depths.append(1)
        elif token.text in ('+', '-'):
            depths[-1] += 1
        else:
            after = tokens[index + 1] if index + 1 < len(tokens) else None
            has_value = _is_value(text, token, after)
    if not has_value:
        raise _token_error(text, tokens[-1], 'has nothing after it', 'write what it applies to')
    if opened:
        raise _token_error(text, opened[-1], 'is not closed', "write ')' where it ends")
    return ' '.join(
        repr(float(token.text)) if token.kind == 'number' else token.text.replace('^', '**')
        for token in tokens
    )


def _split_tokens(text: str) -> Iterator[_Token]:
    at = len(text) - len(text.lstrip(_SPACES))
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            meant = _MEANT.get(text[at])
            raise _token_error(
                text,
                _Token('', text[at], at),
                'has no meaning in a formula',
                f'write {meant} instead' if meant else 'use numbers, x, + - * / ^ and ( )',
            )
        yield _Token(match.lastgroup or '', match.group(), at)
        end = match.end()
        at = len(text) - len(text[end:].lstrip(_SPACES))


def _is_value(text: str, token: _Token, after: _Token | None) -> bool:
    """Return whether a token is a value; a function before its parenthesis is not."""
    if token.kind == 'number':
        if not isfinite(float(token.text)):
            raise _token_error(text, token, 'is beyond all numbers', 'write a smaller one')
        return True
    if token.kind != 'name':
        remedy = 'write a number or x before it'
        raise _token_error(text, token, 'stands where a value is wanted', remedy)
    if token.text in FUNCTIONS:
        if after is None or after.text != '(':
            raise _token_error(text, token, 'is a function', f'write {token.text}(…)')
        return False
    known = [_X, *CONSTANTS, *FUNCTIONS]
    if token.text not in known:
        remedy = did_you_mean(token.text.lower(), known, f'there are {list_names(known)}')
        raise _token_error(text, token, 'is not known', remedy)
    return True


def _token_error(text: str, token: _Token, reason: str, remedy: str) -> SynthesisError:
    return _formula_error(
        text, f'{quote(token.text)} at character {token.at + 1} {reason}', remedy
    )


def _formula_error(text: str, reason: str, remedy: str) -> SynthesisError:
    return SynthesisError(formula_name(text), reason, remedy)


def formula_name(text: str) -> str:
    """Return the name of a formula in errors."""
    return f'function {quote(text)}'
