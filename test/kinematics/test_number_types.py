# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Numbers of any type, from callers: doubles or one clear error, for one state and for many alike.

Also the two zeros, which are one input, and rates that overflow.
"""

from __future__ import annotations

from datetime import date, timedelta
from decimal import Decimal
from fractions import Fraction
from math import copysign, inf, isfinite, nan
import warnings

import linkage_ros as lr
from linkage_ros.description import parse_yaml, read_closure
from linkage_ros.kinematics import CODES, Status
from mpmath import mp, mpf
import numpy as np
import pytest

from .test_gallery import KINDS

FOUR_BAR = lr.load('four_bar')
LIMITED = b'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1, input: {limits: [-0.5, 0.5]}}'

# Each with the double that it is rounded to.
NUMBERS = {
    'double': (0.7, 0.7),
    'int': (1, 1.0),
    'bool': (True, 1.0),
    'decimal': (Decimal('0.7'), 0.7),
    'fraction': (Fraction(7, 10), 0.7),
    'float16': (np.float16(0.7), 0.7001953125),
    'float32': (np.float32(0.7), 0.699999988079071),
    'float64': (np.float64(0.7), 0.7),
    'longdouble': (np.longdouble('0.7'), 0.7),
    'int8': (np.int8(1), 1.0),
    'uint64': (np.uint64(2**63), 2.0**63),
    'numpy bool': (np.True_, 1.0),
    '0-d': (np.array(0.7), 0.7),
    '0-d object': (np.array(Decimal('0.7'), object), 0.7),
    '0-d big-endian': (np.array(0.7, '>f8'), 0.7),
    'mpmath': (mpf('0.5'), 0.5),
    'large int': (10**400, inf),
    'negative large int': (-(10**400), -inf),
    'large decimal': (Decimal('1e400'), inf),
    'large fraction': (Fraction(10**400), inf),
    'large longdouble': (np.longdouble('1e4000'), inf),
    'nan': (Decimal('nan'), nan),
}

WRONG = {
    'text': '1',
    'bytes': b'1',
    'none': None,
    'complex': 1j,
    'numpy complex': np.complex128(1.0),
    'date': date(2020, 1, 1),
    'duration': timedelta(1),
    'numpy date': np.datetime64('2020-01-01'),
    'numpy duration': np.timedelta64(1, 's'),
    'numpy text': np.str_('1'),
    'structured': np.zeros((), [('x', float)])[()],
    'signalling nan': Decimal('snan'),
    'object': object(),
    'dict': {},
}


def statuses(batch):
    return [list(CODES)[code] for code in batch.status]


@pytest.fixture(autouse=True)
def _no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        yield


CLOSURES = {
    'steps': FOUR_BAR,
    'class III': lr.load('class_3'),
    'limited': read_closure(parse_yaml(LIMITED, 'x.yaml')),
}


@pytest.mark.parametrize('kind', CLOSURES)
@pytest.mark.parametrize('name', NUMBERS)
def test_closure_accepts_any_number_type_as_double(name, kind):
    value, double = NUMBERS[name]
    closure = CLOSURES[kind]
    found, expected = closure.position(value), closure.position(double)
    assert (found.status, found.joints) == (expected.status, expected.joints)
    assert all(type(joint) is float for joint in found.joints)
    many = closure.solve([value], derivatives=0)
    np.testing.assert_array_equal(many.positions, closure.solve([double], derivatives=0).positions)
    assert statuses(many) == [expected.status]
    if not expected.status.has_rates or not isfinite(double):
        return
    velocity = closure.velocity(found, value)
    assert velocity.joints == closure.velocity(expected, double).joints
    acceleration = closure.acceleration(found, velocity, value)
    assert acceleration.joints == closure.acceleration(expected, velocity, double).joints
    assert all(type(each) is float for each in (*velocity.joints, *acceleration.joints))
    for many, other in zip(
        closure.solve([value], rates=value, accelerations=[value]),
        closure.solve([double], rates=double, accelerations=[double]),
        strict=True,
    ):
        np.testing.assert_array_equal(many, other)


@pytest.mark.parametrize('name', WRONG)
def test_closure_refuses_values_that_are_no_numbers(name):
    value = WRONG[name]
    position = FOUR_BAR.position(1.0)
    velocity = FOUR_BAR.velocity(position, 1.0)
    calls = [
        ('inputs', lambda: FOUR_BAR.position(value)),
        ('rates', lambda: FOUR_BAR.velocity(position, value)),
        ('accelerations', lambda: FOUR_BAR.acceleration(position, velocity, value)),
        ('inputs', lambda: FOUR_BAR.solve([value, value])),
        ('rates', lambda: FOUR_BAR.solve([1.0, 2.0], rates=[value, value])),
        ('accelerations', lambda: FOUR_BAR.solve([1.0], accelerations=[value])),
        ('inputs', lambda: FOUR_BAR.solve(np.array([value, value], object))),
    ]
    for what, call in calls:
        with pytest.raises(TypeError, match=rf'^{what}: [^\n]* is not a number') as caught:
            call()
        assert len(str(caught.value)) < 150


ARRAYS = {
    'list': [0.5, 1.0],
    'tuple': (0.5, 1.0),
    'ints': [0, 1],
    'mixed': [Decimal('0.5'), 1, np.float32(0.25)],
    'large': [10**400, 0.5],
    'float16': np.array([0.5, 0.7], np.float16),
    'float32': np.array([0.5, 0.7], np.float32),
    'longdouble': np.array([0.5, 0.7], np.longdouble),
    'object': np.array([Fraction(1, 2), 1.0], object),
    'bool': np.array([True, False]),
    'big-endian': np.array([0.5, 0.7], '>f8'),
    'every second': np.arange(6.0)[::2],
    'backwards': np.arange(3.0)[::-1],
    'a column': np.arange(6.0).reshape(3, 2)[:, 1],
    'broadcast': np.broadcast_to(0.5, 3),
    'unaligned': np.frombuffer(b'x' + np.arange(3.0).tobytes(), np.uint8)[1:].view(np.float64),
    'read-only': np.frombuffer(np.arange(3.0).tobytes()),
    'masked, none of them': np.ma.array([0.5, 0.7], mask=[0, 0]),
    'a field': np.array([(0.5, 1), (0.7, 2)], [('x', float), ('n', int)])['x'],
    'a matrix row': np.asmatrix([0.5, 0.7]).A1,
    'empty': [],
}


@pytest.mark.parametrize('name', ARRAYS)
def test_solve_accepts_any_array_type_as_doubles(name):
    given = ARRAYS[name]
    doubles = [
        inf if isinstance(value, int) and value > 1e300 else float(value) for value in given
    ]
    expected = FOUR_BAR.solve(np.array(doubles), rates=np.array(doubles))
    for one, other in zip(FOUR_BAR.solve(given, rates=given), expected, strict=True):
        np.testing.assert_array_equal(one, other)
        assert one.dtype == other.dtype


WRONG_ARRAYS = {
    'masked': (np.ma.array([1.0, 2.0], mask=[0, 1]), ValueError, 'some values are masked; fill'),
    'dates': (np.array(['2020-01-01'], 'datetime64[D]'), TypeError, 'is not a number'),
    'durations': (np.array([1], 'timedelta64[s]'), TypeError, 'is not a number'),
    'complex': (np.array([1j]), TypeError, '1j is not a number'),
    'texts': (np.array(['1', '2']), TypeError, "'1' is not a number"),
    'no texts': (np.array([], 'U1'), TypeError, 'is not a number'),
    'structured': (np.zeros(2, [('x', float)]), TypeError, 'is not a number'),
    'mixed with a text': ([1.0, 'a'], TypeError, 'is not a number'),
    'ragged': ([[1.0], [1.0, 2.0]], ValueError, 'rows of different lengths form no array'),
}


@pytest.mark.parametrize('name', WRONG_ARRAYS)
def test_solve_refuses_arrays_that_hold_no_numbers(name):
    given, kind, text = WRONG_ARRAYS[name]
    for what, call in (
        ('inputs', lambda: FOUR_BAR.solve(given)),
        ('rates', lambda: FOUR_BAR.solve([1.0] * 2, rates=given)),
        ('accelerations', lambda: FOUR_BAR.solve([1.0] * 2, accelerations=given)),
    ):
        with pytest.raises(kind, match=rf'^{what}: [^\n]*{text}'):
            call()


def test_position_refuses_a_masked_number():
    with pytest.raises(ValueError, match=r'^inputs: some values are masked'):
        FOUR_BAR.position(np.ma.masked)


# The two zeros are one input.


def zeros():
    for name in KINDS:
        closure = lr.load(name)
        if len(closure.input_names) == 1:
            yield name


@pytest.mark.sample(7)
@pytest.mark.parametrize('name', zeros())
def test_positive_and_negative_zero_give_the_same_bits(name):
    closure = lr.load(name)
    one, other = closure.position(0.0), closure.position(-0.0)
    assert (one.status, repr(one.joints)) == (other.status, repr(other.joints))
    many = closure.solve([0.0, -0.0])
    for values in (many.positions, many.velocities, many.accelerations):
        np.testing.assert_array_equal(values[:, 0], values[:, 1])
    if one.status is Status.CLOSED:
        fast = closure.compile_linkage(2)
        assert repr(fast(0.0, 1.0, 0.5)) == repr(fast(-0.0, 1.0, 0.5))
        assert fast(-0.0, 1.0, 0.5).values[0] == one.joints
        np.testing.assert_allclose(many.positions[:, 1], one.joints, atol=1e-12)


# Rates that overflow are infinite, with the sign of the true value; no other number is NaN.

HUGE = [1e130, -1e153, 1e154, 1e155, -1e160, 1e300, 1.7e308]
MACHINES = ['four_bar', 'slider_crank', 'jansen_leg', 'drag_link', 'class_3',
            'whitworth_quick_return', 'scotch_yoke']  # fmt: skip


def exact(closure, x, rate, change):
    """
    Return rates and accelerations in 50 digits, from those at rates of 1.

    They are f'·ẋ and f'·ẍ + f''·ẋ².
    """
    position = closure.position(x)
    unit = closure.velocity(position, 1.0)
    bent = closure.acceleration(position, unit, 0.0).joints
    with mp.workdps(50):
        rates = [mpf(one) * rate for one in unit.joints]
        changes = [
            mpf(one) * change + mpf(two) * mpf(rate) ** 2
            for one, two in zip(unit.joints, bent, strict=True)
        ]
    return rates, changes


def agrees(found, true):
    """Return whether a double is a number of 50 digits, or infinite as it is."""
    if abs(true) > 1.79e308:
        return abs(found) == inf and copysign(1.0, found) == mp.sign(true)
    return abs(found - true) <= 1e-9 * abs(true) + 1e-300


@pytest.mark.sample(12)
@pytest.mark.parametrize('rate', HUGE)
@pytest.mark.parametrize('name', MACHINES)
@pytest.mark.parametrize('change', [0.0, -1.7e308])
def test_overflowing_rates_are_infinite_in_all_solvers(name, rate, change):
    closure = lr.load(name)
    x = 0.7
    true = exact(closure, x, rate, change)
    position = closure.position(x)
    velocity = closure.velocity(position, rate)
    acceleration = closure.acceleration(position, velocity, change)
    compiled = closure.compile_linkage(2)(x, rate, change).values
    for number in (rate, [rate]):
        many = closure.solve([x], rates=number, accelerations=change)
        for found in (
            (velocity.joints, acceleration.joints),
            compiled[1:],
            (many.velocities[:, 0], many.accelerations[:, 0]),
        ):
            for ours, expected in zip(found, true, strict=True):
                for one, other in zip(ours, expected, strict=True):
                    assert agrees(one, other), (name, rate, change, one, other)


def test_huge_rates_do_not_change_usual_rates_beside_them():
    rates = np.array([1.0, 1e160, nan, inf, 2.0])
    inputs = np.full(5, 0.7)
    many = FOUR_BAR.solve(inputs, rates=rates)
    alone = FOUR_BAR.solve(inputs[:1], rates=rates[:1])
    np.testing.assert_array_equal(many.velocities[:, :1], alone.velocities)
    np.testing.assert_allclose(many.accelerations[:, :1], alone.accelerations, rtol=1e-13)
    np.testing.assert_allclose(many.velocities[:, 4], 2.0 * many.velocities[:, 0], rtol=1e-13)
    assert np.isinf(many.accelerations[:, 1]).all()
    assert np.isnan(many.velocities[:, 2]).all()
    assert not many.status.any()


@pytest.mark.sample(7)
@pytest.mark.parametrize('name', MACHINES)
@pytest.mark.parametrize('other', [nan, inf, -inf])
def test_infinite_rates_do_not_change_huge_rates_beside_them(name, other):
    closure = lr.load(name)
    many = closure.solve([0.7, 0.7], rates=[1e160, other], accelerations=[1.0, other])
    rates, changes = exact(closure, 0.7, 1e160, 1.0)
    for found, true in ((many.velocities, rates), (many.accelerations, changes)):
        assert all(map(agrees, found[:, 0], true))


def test_slider_acceleration_stays_right_at_overflowing_rates():
    trammel = lr.load('elliptic_trammel')
    position = trammel.position(0.05)
    assert trammel.scale < 1.0
    velocity = trammel.velocity(position, 1.7e308)
    found = trammel.acceleration(position, velocity, 1e239).joints
    for one, true in zip(found, exact(trammel, 0.05, 1.7e308, 1e239)[1], strict=True):
        assert agrees(one, true)


def test_point_motion_stays_right_at_huge_rates():
    position = FOUR_BAR.position(0.7)
    velocity = FOUR_BAR.velocity(position, 1e160)
    moved = FOUR_BAR.point_motion(position, velocity, FOUR_BAR.acceleration(position, velocity, 0))
    usual = FOUR_BAR.velocity(position, 1.0)
    one = FOUR_BAR.point_motion(position, usual, FOUR_BAR.acceleration(position, usual, 0.0))
    for key, motion in moved.items():
        assert motion.velocity == pytest.approx(1e160 * one[key].velocity, rel=1e-12)
