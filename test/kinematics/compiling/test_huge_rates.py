# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Huge rates: each language says what the plain steps say, infinite where it overflows."""

from collections.abc import Sequence
from math import inf, isclose, isfinite, nan
import random

import pytest

from .emitted import needs, plain, run_c, State, states, subject, Told
from .test_c import GALLERY, limited
from .test_modules import python_of, run_javascript, told_by
from ..test_gallery import closure_of

EXPONENTS = (100.0, 119.0, 121.0, 153.0, 155.0, 200.0, 239.0, 241.0, 300.0, 308.2)


def huge_states(name: str) -> list[State]:
    """Return states of which at least one rate or acceleration is huge, or nearly."""
    rng = random.Random(name)
    closure = closure_of(name)
    n = len(closure.linkage.inputs)
    found = []
    for state in states(closure, 30, name):
        rates = [rng.choice((-1.0, 1.0)) * 10.0 ** rng.choice(EXPONENTS) for _ in range(2 * n)]
        at, given = state[:n], state[n:]
        ways = (rates, [*rates[:n], *given[n:]], [*given[:n], *rates[n:]])
        found += [(*at, *some) for some in ways]
    at = found[0][:n]
    found += [(*at, *[rate] * n, *[change] * n) for rate in (inf, nan) for change in (0.0, 1e300)]
    return found


def right(name: str, given: Sequence[State]) -> list[Told]:
    """Return what the plain steps say; a rate that is not finite is indeterminate."""
    closure = closure_of(name)
    finite = [all(map(isfinite, state)) for state in given]
    return [
        plain(closure, state) if usual else Told('INDETERMINATE', ())
        for state, usual in zip(given, finite, strict=True)
    ]


@pytest.mark.sample(3)
@needs['C99']
@pytest.mark.parametrize('name', GALLERY)
def test_c_code_equals_the_steps_at_huge_rates(name, tmp_path):
    given = huge_states(name)
    told = run_c(subject(closure_of(name)), given, tmp_path)
    assert told == right(name, given)
    assert max(abs(value) for one in told for value in one.values) > 1e120


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', GALLERY)
def test_python_module_equals_the_steps_at_huge_rates(name):
    given = huge_states(name)
    solve = python_of(subject(closure_of(name)))['motion']
    assert [told_by(solve, state) for state in given] == right(name, given)


@pytest.mark.sample(3)
@needs['JavaScript']
# Not Bennett's linkage: joints that close by redundant equations are differences of large numbers.
@pytest.mark.parametrize('name', [name for name in GALLERY if name != 'bennett'])
def test_javascript_module_equals_the_steps_at_huge_rates(name, tmp_path):
    given = huge_states(name)
    told = run_javascript(subject(closure_of(name)), given, tmp_path)
    for state, one, steps in zip(given, told, right(name, given), strict=True):
        assert one.status == steps.status, state
        for value, true in zip(one.values, steps.values, strict=True):
            assert isclose(value, true, rel_tol=1e-6, abs_tol=1e-9), state


@needs['C99']
def test_velocity_code_equals_steps_at_huge_rates_and_limits(tmp_path):
    closure = limited(rocker_joint=(1.5, 1.9))
    given = [(0.1 * i, rate, 0.0) for i in range(60) for rate in (1.0, 1e121, -1.7e308)]
    steps = [plain(closure, state) for state in given]
    expected = [Told(one.status, one.values[:4]) for one in steps]
    assert {one.status for one in expected} == {'CLOSED', 'LIMITED'}
    what = subject(closure, 1)
    assert run_c(what, given, tmp_path) == expected
    velocity = python_of(what)['velocity']
    for (x, rate, _), one in zip(given, steps, strict=True):
        _, *groups = velocity((x,), (rate,))
        assert tuple(value for group in groups for value in group) == one.values[:4]
