# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Linkages with ratios in C, Python and JavaScript: the same trace, the same values."""

from pathlib import Path

from linkage_ros.kinematics import Closure, Ratio
import pytest

from .emitted import COUNT, needs, plain, run_c, states, subject
from .test_modules import _ULPS, off, python_of, run_javascript, told_by
from ..test_ratios import geared_five_bar, rack_and_pinion, two_four_bars

CASES = {
    'gears': lambda: geared_five_bar((1.0, 0.3, 1.2, 1.1, 0.4), Ratio('theta2', -0.5, 0.3)),
    'rack': lambda: rack_and_pinion(0.012),
    'joint solved before': lambda: two_four_bars(Ratio('rocker_joint', -1.5, 0.3)),
}


@pytest.mark.parametrize('name', CASES)
def test_python_with_ratios_equals_the_steps_bit_for_bit(name: str) -> None:
    closure = Closure(CASES[name]())
    solve = python_of(subject(closure))['motion']
    for state in states(closure, 100, name):
        assert told_by(solve, state) == plain(closure, state), state


@needs['C99']
@pytest.mark.parametrize('name', CASES)
def test_c_with_ratios_equals_the_steps_bit_for_bit(name: str, tmp_path: Path) -> None:
    closure = Closure(CASES[name]())
    given = states(closure, 100, name)
    for state, told in zip(given, run_c(subject(closure), given, tmp_path), strict=True):
        assert told == plain(closure, state), state


@needs['JavaScript']
@pytest.mark.parametrize('name', CASES)
def test_javascript_with_ratios_equals_the_steps_within_rounding(
    name: str, tmp_path: Path
) -> None:
    what = subject(Closure(CASES[name]()))
    given = states(what.closure, max(COUNT // 5, 100), name)
    assert off(what, run_javascript(what, given, tmp_path), given) <= _ULPS
