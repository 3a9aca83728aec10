# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A sample of the campaign of random topologies: no findings, and errors would be found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import random
from typing import Any

from campaigns.campaign import Tallies, tallies_of
from campaigns.tally import Judgement, QUANTITIES, Tally
from campaigns.topologies.constraints import Equations, Real
from campaigns.topologies.families import FAMILIES
from campaigns.topologies.judge import closure_of, judge_states
from campaigns.topologies.judge_ranges import judge_ranges
from campaigns.topologies.run import (
    CHECK,
    CHECK_ALTERED,
    FILE,
    judge_part,
    KINEMATICS,
    make,
    parts,
)
from campaigns.topologies.topology import start_of, Topology
from linkage_ros.kinematics import Closure, InputRange, SingularInput, Status
import numpy as np
import pytest

from ..support.sampling import sample_count

SEED = 20261122
"""Another seed than the campaign's, whose findings are fixed."""

WANTED = {KINEMATICS: 1, CHECK: 8, CHECK_ALTERED: 8, FILE: 2}


@pytest.fixture(scope='module')
def tallies() -> Tallies:
    return tallies_of(judge_part, parts(SEED, WANTED), jobs=2)


def notes_of(tally: Tally, family: str, test: str) -> str:
    return '\n'.join(
        f'{name}: {note.text}; see python -m campaigns topologies --seed {SEED} '
        f'--test "{test}" --show "{family}" {note.linkage}'
        for name, note in tally.findings()
    )


@pytest.mark.sample(0)
@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize('family', FAMILIES)
def test_random_topologies_have_no_findings(tallies: Tallies, family: str) -> None:
    tally = tallies[KINEMATICS][family]
    assert not tally.notes, notes_of(tally, family, KINEMATICS)
    assert tally.counts['states closed'] > 0.1 * 16 * tally.counts['linkages']
    assert {*tally.quantities} == {*QUANTITIES}


@pytest.mark.sample(0)
@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize('test', [CHECK, CHECK_ALTERED, FILE])
def test_commands_succeed_or_refuse_in_one_line(tallies: Tallies, test: str) -> None:
    notes = [notes_of(tally, family, test) for family, tally in tallies[test].items()]
    assert not any(notes), '\n'.join(filter(None, notes))
    assert sum(tally.counts['linkages'] for tally in tallies[test].values()) == WANTED[test]


@pytest.mark.sample(2)
@pytest.mark.parametrize('family', [name for name in FAMILIES if name.startswith('class III')])
def test_random_platforms_have_no_findings(family: str) -> None:
    """Platforms on rails fix angles up to whole turns, which no dyad does."""
    work = parts(SEED, {KINEMATICS: sample_count(2, 1)}, [family])
    tally = tallies_of(judge_part, work, jobs=1)[KINEMATICS][family]
    assert not tally.notes, notes_of(tally, family, KINEMATICS)


def test_topology_result_is_independent_of_the_process_count() -> None:
    work = parts(
        SEED,
        {KINEMATICS: sample_count(6, 2), CHECK: sample_count(4, 1)},
        ['RRR moving–ground', 'RPR input–ground'],
    )
    alone, shared = (tallies_of(judge_part, *how) for how in ((work, 1), (work[::-1], 2)))
    for test, families in alone.items():
        for family, tally in families.items():
            other = shared[test][family]
            assert (tally.counts, tally.notes) == (other.counts, other.notes)
            assert all(
                errors.worst == other.quantities[name].worst
                for name, errors in tally.quantities.items()
            )


def topology_of(family: str, accepted: Callable[[Topology], bool] = lambda _: True) -> Topology:
    return next(made for i in range(100) if accepted(made := make(SEED, family, i)[0]))


def judged(topology: Topology, linkage: Any = None, closure: Any = None) -> Judgement:
    findings = Judgement()
    solved = closure or Closure(linkage or topology.linkage)
    judge_states(topology, solved, random.Random(1), findings, None)
    return findings


def test_judge_detects_another_assembly() -> None:
    topology = topology_of('RRR input–ground')
    ((pin, side),) = topology.linkage.assembly.items()
    other = replace(topology.linkage, assembly={pin: 'right' if side == 'left' else 'left'})
    assert judged(topology, other).counts['wrong assembly']


def test_judge_detects_a_slightly_changed_linkage() -> None:
    topology = topology_of('RRR input–ground')
    links = {name: dict(points) for name, points in topology.linkage.links.items()}
    link = next(name for name in links if name.startswith('link'))
    point, (x, y) = list(links[link].items())[-1]
    links[link][point] = (x * (1.0 + 1e-12), y * (1.0 + 1e-12))
    errors = judged(topology, replace(topology.linkage, links=links)).errors
    assert max(error for *_, error in errors['position']) > 100.0


class Wrong:
    """A closure with wrong attributes."""

    def __init__(self, closure: Closure, **other: Any) -> None:
        self._closure = closure
        self.__dict__.update(other)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._closure, name)


def has_limits(topology: Topology) -> bool:
    closure = closure_of(topology, Judgement())
    turning = not topology.linkage.inputs[0].slider
    return closure is not None and turning and not closure.input_ranges[0].is_whole


def test_judge_detects_wrong_ranges_and_singular_inputs() -> None:
    topology = topology_of('RRR input–ground', has_limits)
    closure = Closure(topology.linkage)
    (low, high, *_), *_ = closure.input_ranges
    other = SingularInput(0.5 * (low + high), Status.TOGGLE)
    passed = [one._replace(status=Status.CHANGE_POINT) for one in closure.singular_inputs]
    for wrong, finding in (
        ({'input_ranges': (InputRange(low, high - 0.01),)}, 'range: a part is missing'),
        ({'input_ranges': (InputRange(low, high + 0.01),)}, 'range: too wide'),
        ({'singular_inputs': ()}, 'singular: toggle not listed'),
        ({'singular_inputs': (*closure.singular_inputs, other)}, 'singular: listed, but regular'),
        ({'singular_inputs': passed}, 'singular: toggle has another status'),
    ):
        findings = Judgement()
        judge_ranges(topology, Wrong(closure, **wrong), findings, None)  # type: ignore[arg-type]
        assert findings.counts[finding], findings.counts
    findings = Judgement()
    judge_ranges(topology, closure, findings, None)
    assert not findings.notes


def test_judge_detects_wrong_gaps_and_statuses() -> None:
    topology = topology_of('RRR input–ground', has_limits)
    closure = Closure(topology.linkage)

    def position(*inputs: float) -> Any:
        found = closure.position(*inputs)
        return replace(found, gap=found.gap * 1.001)

    assert judged(topology, closure=Wrong(closure, position=position)).counts['gap']
    moved = Wrong(closure, position=lambda x: closure.position(x + 0.5))
    assert judged(topology, closure=moved).notes


@pytest.mark.parametrize('family', ['chain of 3', 'cylinder and crank', 'class III two inputs'])
def test_constraint_equations_agree_with_their_differences(family: str) -> None:
    topology = topology_of(family)
    equations = Equations(topology.linkage)
    start, begin = start_of(topology, equations)
    _, jacobian, _ = equations.residuals(start, begin)
    step = Real(2.0**-20) * equations.size
    for k in range(equations.count):
        sides = []
        for sign in (1, -1):
            moved = start.copy()
            moved[k] += sign * step
            sides.append(equations.residuals(moved, begin)[0])
        slope = (sides[0] - sides[1])[:, 0] / (2 * step)
        assert np.abs(slope - jacobian[0, :, k]).max() < 1e-9 * (1.0 + equations.size)
    # Rates and accelerations: by differences of solutions beside each other, in time.
    rates = np.array([[0.7 - 0.4 * i] for i in range(len(begin))], Real)
    pulls = np.array([[0.3 + 0.5 * i] for i in range(len(begin))], Real)
    motion = equations.motion(start, begin, rates, pulls)
    time = Real(2.0**-13) / (1.0 + np.abs(motion.rates).max())
    beside = []
    for t in (-time, time):
        inputs = begin + t * rates + 0.5 * t * t * pulls
        guess = start + t * motion.rates + 0.5 * t * t * motion.accelerations
        beside.append(equations.correct(guess, inputs)[0])
    speed = (beside[1] - beside[0]) / (2 * time)
    bend = (beside[1] - 2 * start + beside[0]) / (time * time)
    assert np.abs(speed - motion.rates).max() < 1e-6 * (1.0 + np.abs(motion.rates).max())
    assert np.abs(bend - motion.accelerations).max() < 1e-6 * (
        1.0 + np.abs(motion.accelerations).max()
    )


def test_equal_seeds_make_equal_linkages() -> None:
    for family in FAMILIES:
        assert make(SEED, family, 3)[0] == make(SEED, family, 3)[0]
