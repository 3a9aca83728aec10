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

"""How a path is written for arrays: what is asked, what is kept, and how constants are written."""

from __future__ import annotations

from math import inf, nan

from linkage_ros.kinematics.arithmetic import sin, sqrt
from linkage_ros.kinematics.compiled.array_form import ArrayForm
from linkage_ros.kinematics.compiled.blocks import BlockFunction
from linkage_ros.kinematics.compiled.tape import Tape
import numpy as np
import pytest


def written(root: object, condition: object = True, **given: int) -> BlockFunction:
    form = ArrayForm(given)
    held = form.number(condition)
    return BlockFunction(['q0', 'w0'], ['q0'], [form.number(root)], held)


def values_of(function: BlockFunction, x: np.ndarray, rate: float = 1.0) -> np.ndarray:
    found = np.empty_like(x)
    rows = np.empty((function.rows, len(x)))
    function([x, rate], [found], rows, np.empty((function.masks, len(x)), bool))
    return found


def passes(function: BlockFunction) -> int:
    return function.source.count('out=')


def test_a_condition_that_bounds_settle_is_not_asked() -> None:
    tape = Tape()
    sine = sin(tape.given('q0', 0.3))
    assert written(sine.operation, (sine * sine + 0.5 > 0.4).operation).masks == 0
    assert written(sine.operation, (sine * sine + 0.5 > 0.6).operation).masks > 0


def test_constants_are_drawn_together_and_nothing_is_worked_out_of_0() -> None:
    tape = Tape()
    x, rate = tape.given('q0', 0.3), tape.given('w0', 1.25)
    function = written((2.0 * (3.0 * x) / 4.0).operation)
    assert passes(function) == 1
    assert values_of(function, np.array([2.0])).tolist() == [3.0]
    assert passes(written((rate * (x * x + 1.0)).operation, w0=0)) == 0
    assert passes(written((rate * (x * x)).operation, w0=1)) == 1


@pytest.mark.parametrize('constant', [0.5, np.float64(0.5), -0.0, inf, -inf, nan, 3])
def test_every_constant_is_written_as_it_is(constant: float) -> None:
    found = values_of(written(constant), np.zeros(4))
    np.testing.assert_array_equal(found, np.full(4, constant))
    assert np.signbit(found).all() == np.signbit(constant)


def test_a_row_is_used_again_when_nobody_needs_what_is_in_it() -> None:
    tape = Tape()
    total = x = tape.given('q0', 0.3)
    for k in range(30):
        total = sqrt(total + float(k)) * x
    assert written(total.operation).rows <= 2
