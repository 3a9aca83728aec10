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


"""The cheapest solver that proves an accuracy: what may be chosen, what is, and what is said."""

from __future__ import annotations

from linkage_ros.solvers import choose as choosing
from linkage_ros.solvers.choose import choose, only_closed_form
from linkage_ros.solvers.newton import NewtonClosure
from linkage_ros.solvers.solver import Solver
from linkage_ros.solvers.table import TableClosure
import pytest

from .linkages import CRANK_ROCKER, crank_rocker, worst_error
from ..support.scenes import shipped


def timed(monkeypatch, **times: float) -> list[set[str]]:
    """Let solvers take these times; return a list of who was timed."""
    asked = []

    def stand_in(_closed, able):
        asked.append(set(able))
        return {name: times[name] for name in able}

    monkeypatch.setattr(choosing, '_times', stand_in)
    return asked


# Times in units of one, and who wins: what is faster by less than a tenth is not faster.
TIMINGS = [
    ({'closed_form': 1.0, 'table': 0.8, 'newton': 2.0}, 'table'),
    ({'closed_form': 1.0, 'table': 0.8, 'newton': 0.7}, 'newton'),
    ({'closed_form': 1.0, 'table': 0.95, 'newton': 2.0}, 'closed_form'),
    ({'closed_form': 1.0, 'table': 1.5, 'newton': 2.0}, 'closed_form'),
]
KINDS = {'closed_form': Solver, 'table': TableClosure, 'newton': NewtonClosure}


@pytest.mark.parametrize(('times', 'winner'), TIMINGS)
def test_the_fastest_is_chosen(monkeypatch, times, winner: str) -> None:
    timed(monkeypatch, **{name: 1e-6 * time for name, time in times.items()})
    found = choose(crank_rocker(), 1e-6)
    assert type(found) is KINDS[winner]
    assert found.choice.solver == winner
    assert found.choice.parameters == ({} if winner == 'closed_form' else {'tolerance': 1e-6})
    assert worst_error(CRANK_ROCKER, 1.0, found.position(1.0).joints) <= 1e-6


# Who proves what.
ABLE = {
    'four_bar': {'closed_form', 'table', 'newton'},
    'watt_1': {'closed_form', 'table'},
    'slider_crank': {'closed_form', 'table'},
    'class_3': {'closed_form', 'table'},
    'double_rocker': {'closed_form', 'newton'},
    'parallelogram': {'closed_form', 'newton'},
    'five_bar': {'closed_form', 'newton'},
    'peaucellier': {'closed_form'},
}


@pytest.mark.parametrize('name', ABLE)
def test_only_solvers_that_prove_the_accuracy_are_timed(monkeypatch, name: str) -> None:
    asked = timed(monkeypatch, closed_form=1e-6, table=1e-6, newton=1e-6)
    said = choose(shipped(name), 1e-6).choice.why
    assert asked == [ABLE[name]]
    assert said.startswith('closed form, 1 µs a state')
    assert ('table: ' in said) == ('table' not in ABLE[name])
    assert ("Newton's method: " in said) == ('newton' not in ABLE[name])


def test_newton_does_not_prove_little(monkeypatch) -> None:
    asked = timed(monkeypatch, closed_form=1e-6, table=1e-6, newton=1e-6)
    choose(crank_rocker((0.1, 2.0, 0.02, 1.95)), 1e-2)
    assert 'newton' not in asked[0]


def test_a_real_timing_names_one_that_is_able() -> None:
    found = choose(crank_rocker(), 1e-6)
    assert found.choice.solver in ABLE['four_bar']
    assert found.choice.why.count(' µs') == 3


def test_the_closed_form_says_why_it_is_alone() -> None:
    found = only_closed_form(crank_rocker(), 'forces start from it')
    assert found.choice == ('closed_form', {}, 'closed form: forces start from it')
    assert found.position(1.0) == found.closed.position(1.0)
