# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A formula is read as written in books, by these rules alone; all else is refused in a line."""

import ast
from math import inf, isnan, nan
import pickle
import sys
import warnings

from hypothesis import example, given, strategies
from linkage_ros.errors import SynthesisError
from linkage_ros.tools.design import Expression, FUNCTIONS
from mpmath import mp
import numpy as np
import pytest

SPAN = np.linspace(0.05, 0.95, 19)

# Each formula, and the same with 50 digits.
FORMULAS = {
    'log10(x)': mp.log10,
    'x^1.5': lambda x: x ** mp.mpf('1.5'),
    'x**1.5': lambda x: x ** mp.mpf('1.5'),
    '1/x': lambda x: 1 / x,
    'sin(x)': mp.sin,
    'cos(x)': mp.cos,
    'tan(x)': mp.tan,
    'asin(x)': mp.asin,
    'acos(x)': mp.acos,
    'atan(x)': mp.atan,
    'sinh(x)': mp.sinh,
    'cosh(x)': mp.cosh,
    'tanh(x)': mp.tanh,
    'sqrt(x)': mp.sqrt,
    'cbrt(x)': mp.cbrt,
    'exp(x)': mp.exp,
    'e^x': mp.exp,
    'ln(x)': mp.ln,
    'log(x)': mp.ln,
    'log2(x)': lambda x: mp.log(x, 2),
    'abs(-x)': lambda x: x,
    'pi*x - tau/3': lambda x: mp.pi * x - 2 * mp.pi / 3,
    '3*x^2 - 2*x + 7.5e-1': lambda x: 3 * x * x - 2 * x + mp.mpf('0.75'),
    'sqrt(1 - x^2)*exp(-x/2)': lambda x: mp.sqrt(1 - x * x) * mp.exp(-x / 2),
}

# The value of each at x = 3.
RULES = {
    'x': 3.0,
    '-x^2': -9.0,
    '(-x)^2': 9.0,
    '2^-x': 0.125,
    '2^x^2': 512.0,
    '2**x**2': 512.0,
    '2^x**2': 512.0,
    '10 - x - 2': 5.0,
    '24/x/4': 2.0,
    '24/x*4': 32.0,
    '1 + 2*x^2/3': 7.0,
    '2*-x': -6.0,
    '+-+x': -3.0,
    '--x': 3.0,
    ' ( ( x ) )\t\n': 3.0,
    '.5 + 1. + 1e1 + 1E-1': 11.6,
    '2e2': 200.0,
    'cbrt(-27)*x': -9.0,
    '9^9^9': inf,
    '7': 7.0,
}


@pytest.mark.parametrize('text', FORMULAS)
def test_formula_values_equal_50_digit_references(text):
    with mp.workdps(50):
        expected = [float(FORMULAS[text](mp.mpf(float(x)))) for x in SPAN]
    # Of a sum, digits are lost where it is near 0.
    assert Expression(text)(SPAN) == pytest.approx(expected, rel=4e-15, abs=1e-15)


def test_formula_table_covers_every_function():
    assert all(any(f'{name}(' in text for text in FORMULAS) for name in FUNCTIONS)


@pytest.mark.parametrize(('text', 'value'), RULES.items())
def test_formula_operators_bind_as_in_textbooks(text, value):
    assert Expression(text)(3.0) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize('text', ['x', '2', '2*x - 1', 'ln(x)'])
def test_formula_keeps_array_shapes_and_scalars(text):
    formula = Expression(text)
    x = np.array([[0.5, 1.0, 1.5], [2.0, 2.5, 3.0]])
    values = formula(x)
    assert values.shape == x.shape
    assert values.tolist() == [[pytest.approx(formula(float(one))) for one in row] for row in x]
    assert isinstance(formula(1.5), float)
    values[:] = 0.0
    assert x.min() == 0.5, 'what is returned is not what was given'


@pytest.mark.parametrize(
    ('text', 'x', 'value'),
    [
        ('ln(x)', 0.0, -inf), ('ln(x)', -1.0, nan), ('1/x', 0.0, inf), ('0/x', 0.0, nan),
        ('sqrt(x)', -1.0, nan), ('x^0.5', -1.0, nan), ('asin(x)', 1.5, nan), ('exp(x)', 1e4, inf),
        ('x^x', 0.0, 1.0), ('(0 - 8)^(1/3)', 0.0, nan), ('x - x', inf, nan),
    ],
)  # fmt: skip
def test_formula_without_a_value_returns_inf_or_nan(text, x, value):
    formula = Expression(text)
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        found = formula(x)
        several = formula(np.array([x, x]))
    assert found == value or (isnan(found) and isnan(value))
    assert np.array_equal(several, [value, value], equal_nan=True)


def test_formulas_compare_by_text_and_can_be_pickled():
    formula = Expression('log10(x) + 1')
    assert formula == Expression('log10(x) + 1') != Expression('log10(x)+1')
    assert pickle.loads(pickle.dumps(formula))(100.0) == 3.0
    assert repr(formula) == "Expression(text='log10(x) + 1')"


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('', "'': is empty; write a formula of x, such as log10(x)"),
        (' ', "' ': is empty; write a formula of x, such as log10(x)"),
        ('logg(x)', "'logg' at character 1 is not known; did you mean 'log'?"),
        ('2*Sin(x)', "'Sin' at character 3 is not known; did you mean 'sin'?"),
        ('X + 1', "'X' at character 1 is not known; did you mean 'x'?"),
        ('2*t', "'t' at character 3 is not known; there are x, pi, e, tau, sin, "),
        ('sin x', "'sin' at character 1 is a function; write sin(…)"),
        ('2x', "'x' at character 2 follows '2' with nothing between; write * between the two"),
        ('x(x+1)', "'(' at character 2 follows 'x' with nothing between; write * between"),
        ('3 4', "'4' at character 3 follows '3' with nothing between"),
        ('(1 2)', "'2' at character 4 follows '1' with nothing between"),
        ('x +', "'+' at character 3 has nothing after it; write what it applies to"),
        ('sin(', "'(' at character 4 has nothing after it"),
        ('2*(x+1', "'(' at character 3 is not closed; write ')' where it ends"),
        ('x+1)', "')' at character 4 closes nothing; leave it out"),
        ('sin()', "')' at character 5 stands where a value is wanted"),
        ('x//2', "'/' at character 3 stands where a value is wanted"),
        ('*x', "'*' at character 1 stands where a value is wanted"),
        ('1,5*x', "',' at character 2 has no meaning in a formula; write . instead"),
        ('x − 1', "'−' at character 3 has no meaning in a formula; write - instead"),
        ('2×x', "'×' at character 2 has no meaning in a formula; write * instead"),
        ('π*x', "'π' at character 1 has no meaning in a formula; write pi instead"),
        ('x²', "'²' at character 2 has no meaning in a formula; write ^2 instead"),
        ('x % 2', "'%' at character 3 has no meaning in a formula; use numbers, x, + - * / ^"),
        ('y = x', "'=' at character 3 has no meaning in a formula"),
        ('1e400', "'1e400' at character 1 is beyond all numbers; write a smaller one"),
        ('1.2.3', "'.3' at character 4 follows '1.2' with nothing between"),
        ('x' * 201, 'is 201 characters long; keep it within 200 characters'),
        ('(' * 41, "'(' at character 41 is more than 40 levels deep; write it with fewer"),
    ],
)
def test_wrong_formula_error_names_the_place(text, message):
    with pytest.raises(SynthesisError) as caught:
        Expression(text)
    assert message in str(caught.value)
    assert str(caught.value).startswith('function ')


def test_formula_at_the_size_limits_is_accepted():
    assert Expression('x' + '+x' * 99 + ' ')(1.0) == 100.0
    assert Expression('(' * 39 + 'x' + ')' * 39)(2.0) == 2.0
    assert Expression('-' * 39 + 'x')(2.0) == -2.0


ATTACKS = [
    '__import__("os").system("true")', '__import__',
    '().__class__.__bases__[0].__subclasses__()', 'x.__class__', 'sin.__globals__',
    'sin(x).real', 'x[0]', '[x for x in (1, 2)]', '(x := 3)', 'lambda: x', 'sin(x=1)', 'sin(*x)',
    'sin(x, x)', 'eval("1")', "f'{x}'", '"a" * 10**9', "b'a'", '1 if x else 2', 'x and x',
    'x < 1', '~x', 'not x', 'x | x', '1_000', '0x10', '1j', '...', 'None', 'True', 'yield',
    'x; x', 'x\\\n+1', 'x # 1', 'x\x00', '\x00', '\ufeffx', 'ｘ', 'ｓin(x)', 'sｉn(x)', '٣',
    '１', 'x\u00a0+ 1', 'x\u202e+ 1', 'x\u0301', '\ud800', '\U0001f600', '(' * 10**6,
    '-' * 10**6, 'x' * 10**6, '9' * 199 + 'e9' * 1000, '(' * 100 + 'x' + ')' * 100,
    'sin(' * 49 + 'x' + ')' * 3, '2^' * 99 + 'x', 'x+' * 99,
]  # fmt: skip


class _Audit:
    """What Python itself tells of all that it compiles, runs, imports and opens."""

    def __init__(self) -> None:
        self.told: list[str] | None = None
        sys.addaudithook(self._hear)

    def _hear(self, event: str, _: object) -> None:
        if self.told is not None:
            self.told.append(event)


# A hook cannot be removed again.
_AUDIT = _Audit()


@pytest.mark.parametrize('text', ATTACKS, ids=lambda text: ascii(text[:20]))
def test_malicious_formulas_are_refused_without_running_code(text):
    _AUDIT.told = []
    try:
        with pytest.raises(SynthesisError) as caught:
            Expression(text)
    finally:
        told, _AUDIT.told = _AUDIT.told, None
    assert not {'compile', 'exec', 'import', 'open', 'os.system'} & set(told)
    message = str(caught.value)
    assert len(message) < 400
    assert message.isprintable(), 'no character reaches a terminal that could do something there'


def test_audit_hook_detects_compilation():
    _AUDIT.told = []
    try:
        eval('1 + 1')
    finally:
        told, _AUDIT.told = _AUDIT.told, None
    assert 'compile' in told


def _is_a_formula_or_refused(text: str) -> None:
    message = ''
    try:
        formula = Expression(text)
    except SynthesisError as error:
        message = str(error)
    else:
        assert isinstance(formula(0.5), float)
        assert formula(SPAN).shape == SPAN.shape
    assert not message or message.isprintable()


@given(strategies.text())
def test_any_text_is_a_formula_or_refused(text):
    _is_a_formula_or_refused(text)


@given(strategies.binary())
def test_any_bytes_are_a_formula_or_refused(raw):
    _is_a_formula_or_refused(raw.decode('utf-8', 'surrogateescape'))


@given(
    strategies.lists(
        strategies.sampled_from([*'x()+-*/^.,1230eE ', '**', 'pi', *(f'{f}(' for f in FUNCTIONS)]),
        max_size=30,
    )
)
def test_any_formula_parts_are_a_formula_or_refused(parts):
    _is_a_formula_or_refused(''.join(parts))


def _texts() -> strategies.SearchStrategy[str]:
    """Return formulas that Python's grammar has, too, without the parentheses of their making."""
    values = strategies.sampled_from(['x', 'pi', '2', '.5', '3.25', '1e-2', '10.'])
    spaces = strategies.sampled_from(['', ' ', '  '])

    def larger(inner: strategies.SearchStrategy[str]) -> strategies.SearchStrategy[str]:
        operators = strategies.sampled_from(['+', '-', '*', '/', '**'])
        return strategies.one_of(
            strategies.tuples(inner, spaces, operators, spaces, inner).map(''.join),
            strategies.tuples(strategies.sampled_from('+-'), inner).map(''.join),
            inner.map('({})'.format),
            strategies.tuples(strategies.sampled_from(sorted(FUNCTIONS)), inner).map(
                lambda pair: f'{pair[0]}({pair[1]})'
            ),
        )

    return strategies.recursive(values, larger, max_leaves=12).filter(lambda text: len(text) < 200)


def _walked(node: ast.AST, x: float) -> np.float64:
    """Return the value of a formula as Python's own parser has understood it."""
    match node:
        case ast.BinOp(left, operator, right):
            work = {
                ast.Add: np.add,
                ast.Sub: np.subtract,
                ast.Mult: np.multiply,
                ast.Div: np.divide,
                ast.Pow: np.power,
            }[type(operator)]
            return work(_walked(left, x), _walked(right, x))
        case ast.UnaryOp(ast.USub(), inner):
            return -_walked(inner, x)
        case ast.UnaryOp(ast.UAdd(), inner):
            return _walked(inner, x)
        case ast.Call(ast.Name(name), [inner]):
            return FUNCTIONS[name](_walked(inner, x))
        case ast.Constant(value):
            return np.float64(value)
        case ast.Name(name):
            return np.float64({'x': x, 'pi': np.pi}[name])
    raise AssertionError(node)


@given(_texts(), strategies.sampled_from([0.5, 2.0, -1.25]))
@example('2**-x**2', 2.0)
@example('-x**-x**2', 2.0)
def test_formula_values_equal_pythons_own_parser(text, x):
    with np.errstate(all='ignore'):
        expected = float(_walked(ast.parse(text, mode='eval').body, x))
    assert np.array_equal(Expression(text)(x), expected, equal_nan=True)
    assert np.array_equal(Expression(text.replace('**', '^'))(x), expected, equal_nan=True)
