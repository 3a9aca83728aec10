# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Scenes that name a solver or an accuracy, and the choice among solvers."""

from math import tau
from pathlib import Path

from linkage_ros.bag import CHOSEN, read_bag, read_run_metadata
from linkage_ros.description import (
    find_violations,
    load_scene,
    parse_scene,
    parse_yaml,
    scene_schema,
)
from linkage_ros.errors import FileError
from linkage_ros.kinematics import Closure
from linkage_ros.messages import JointStateWriter
from linkage_ros.replay import replay_ticks
from linkage_ros.solvers import (
    choose as choosing,
    choose_solver,
    NewtonClosure,
    only_closed_form,
    Solver,
    TableClosure,
)
from linkage_ros.tick import Pipeline
import pytest

from .linkages import apart, CRANK_ROCKER, crank_rocker, worst_error
from ..bag.test_replay import Run, sample
from ..support.scenes import four_bar_text, scene_of, shipped

# Scenes that name a solver or an accuracy: read, built, run and replayed.


FOUR_BAR = b'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n'
LINKAGES = Path(__file__).parents[2] / 'config' / 'linkages'
FIVE_BAR = (LINKAGES / 'five_bar.yaml').read_bytes()

SOLVERS = {
    'closed_form': ('solver: closed_form', Closure),
    'closed form as a mapping': ('solver: {closed_form: {}}', Closure),
    'nothing said': ('', Closure),
    'newton': ('solver: {newton: {tolerance: 1.0e-9}}', NewtonClosure),
    'table': ('solver: {table: {tolerance: 1.0e-6}}', TableClosure),
    'part of a table': ('solver: {table: {tolerance: 1.0e-6, span: [0.2, 2.5]}}', TableClosure),
}

BEGIN = 1_700_000_000_000_000_000


@pytest.mark.parametrize('name', SOLVERS)
def test_what_is_named_is_built(name):
    text, kind = SOLVERS[name]
    (line,) = Pipeline(scene_of(text)).linkages
    assert type(line.closure) is kind
    assert line.solver_choice is None


def error_bounds(closure):
    """Return the most by which positions, rates and accelerations at an input rate of 1 differ."""
    if isinstance(closure, NewtonClosure):
        return 1e-9, 1e-8, 1e-7  # its tolerance, and what a linkage of this shape makes of it
    if not isinstance(closure, TableClosure):
        return 0.0, 0.0, 0.0
    # The error of a cubic is h⁴/384·M, that of its second derivative h²/12·M (Birkhoff, Priver).
    span = 2.3 if closure.knots == 64 else tau
    cell = span / closure.knots
    return closure.proven, closure.proven_rate, 32.0 * closure.proven / cell**2


@pytest.mark.parametrize('name', SOLVERS)
def test_a_scene_runs_with_it(name):
    effects = 'drive: {constant_rate: {rate: 3.0}}\neffects: {acceleration: {}}\n'
    plain = Pipeline(scene_of(effects))
    pipeline = Pipeline(scene_of(effects + SOLVERS[name][0]))
    closure = plain.linkages[0].closure
    of_position, of_rate, of_acceleration = error_bounds(pipeline.linkages[0].closure)
    for index in range(3000):
        now = BEGIN + index * 1_000_000
        tick = pipeline.tick(now)
        (look,), (expected,) = tick.states, plain.tick(now).states
        assert tick.message
        assert all(tick.extras)
        assert apart(closure, look.reading.joints, expected.reading.joints) <= of_position
        for found, exact, bound in (
            (look.reading.rates, expected.reading.rates, 3.0 * of_rate),
            (look.reading.accelerations, expected.reading.accelerations, 9.0 * of_acceleration),
        ):
            assert all(abs(p - q) <= bound for p, q in zip(found, exact, strict=True))


@pytest.mark.parametrize('name', SOLVERS)
def test_ticks_that_are_not_in_the_bag_change_nothing(name):
    scene = scene_of(f'{SOLVERS[name][0]}\neffects: {{velocity: {{}}}}\nangles: wrapped')
    crank = JointStateWriter(['crank_joint']).write
    whole, part = Pipeline(scene), Pipeline(scene)
    for index in range(500):
        now = BEGIN + index * 1_000_000
        for pipeline in (whole, part):
            pipeline.offer(crank(now, (0.004 * index,), (4.0,), ()), now)
        message = whole.tick(now).message
        if index % 3 == 0:
            assert part.tick(now).message == message


@pytest.mark.parametrize('name', SOLVERS)
def test_a_bag_replays_to_the_same_bytes(tmp_path, name):
    run = Run(tmp_path / 'bag', f'{SOLVERS[name][0]}\neffects: {{velocity: {{}}}}')
    for index in range(400):
        now = BEGIN + index * 1_000_000
        if index % 2 == 0:
            run.offer(now, sample(now, 0.007 * index, 3.5))
        run.tick(now, now)
    run.recorder.stop()
    ticks = list(replay_ticks(read_bag(tmp_path / 'bag'), run.scene))
    assert len(ticks) == 400
    assert all(tick.recorded == tick.tick.message for tick in ticks)


def test_a_reset_builds_no_table_again():
    scene = scene_of('accuracy: 1.0e-6')
    first = Pipeline(scene)
    again = Pipeline(scene, first.closures)
    assert again.linkages[0].closure is first.linkages[0].closure
    assert again.linkages[0].solver_choice == first.linkages[0].solver_choice is not None


def test_linkages_may_differ(tmp_path):
    (tmp_path / 'l.yaml').write_bytes(FOUR_BAR)
    (tmp_path / 's.yaml').write_text("""
solver: {table: {tolerance: 1.0e-4}}
linkages:
  - {name: one, linkage: l.yaml}
  - {name: two, linkage: l.yaml, solver: {newton: {tolerance: 1.0e-6}}}
  - {name: three, linkage: l.yaml, accuracy: 1.0e-3}
  - {name: four, linkage: l.yaml, solver: closed_form}
""")
    lines = Pipeline(load_scene(tmp_path / 's.yaml')).linkages
    assert [type(line.closure) for line in lines[:2]] == [TableClosure, NewtonClosure]
    assert [line.solver_choice is not None for line in lines] == [False, False, True, False]
    assert type(lines[3].closure) is Closure


def test_several_inputs_take_newton():
    (line,) = Pipeline(scene_of('solver: {newton: {tolerance: 1.0e-9}}', FIVE_BAR)).linkages
    assert line.closure.position(0.5, 1.5).joints


def test_a_replay_does_not_choose_again(monkeypatch):
    def never(*_):
        raise AssertionError

    monkeypatch.setattr(choosing, 'choose_solver', never)
    files = {
        'scene.yaml': b'linkage: l.yaml\naccuracy: 1.0e-6\n',
        'linkage.yaml': FOUR_BAR,
    }
    for chosen, kind in (
        ({'table': {'tolerance': 1e-6}}, TableClosure),
        ({'newton': {'tolerance': 1e-6}}, NewtonClosure),
        ({'closed_form': {}}, Closure),
    ):
        (line,) = Pipeline(parse_scene('s', 'here', files, '', {'': chosen})).linkages
        assert type(line.closure) is kind


def test_the_bag_s_account_tells_what_was_chosen(tmp_path):
    said = f'"{CHOSEN}": {{"": {{"table": {{"tolerance": 1e-6}}}}}}'
    account = '{"scene": "s", "crank_topic": "/crank", "joint_states_topic": "/joint_states"}'
    run = Run(tmp_path / 'bag', 'accuracy: 1.0e-6', f'{account[:-1]}, {said}}}'.encode())
    run.recorder.stop()
    assert read_run_metadata(read_bag(tmp_path / 'bag')).solvers == {
        '': {'table': {'tolerance': 1e-6}}
    }


def test_forces_leave_the_closed_form_alone():
    heavy = (LINKAGES / 'four_bar.yaml').read_bytes()
    (line,) = Pipeline(scene_of('accuracy: 1.0e-6\ndrive: {torque: {}}', heavy)).linkages
    assert type(line.closure) is Solver
    assert line.solver_choice.why == 'closed form: forces start from it'


REFUSED = {
    'solver: closed_from': "solver: there is no 'closed_from'; did you mean 'closed_form'?",
    'solver: {tabel: {tolerance: 1.0e-6}}': "solver.tabel: unknown key; did you mean 'table'?",
    'solver: newton': 'solver: newton has no tolerance; write solver: {newton: {tolerance: …}}',
    'solver: {newton: {}}': "solver.newton: the key 'tolerance' is missing",
    'solver: {newton: {tolerance: 0}}': 'solver.newton.tolerance: 0 is out of bounds',
    'solver: {table: {tolerance: 1.0}}': 'solver.table.tolerance: 1.0 is out of bounds',
    'solver: {table: {tolerance: 1.0e-3, knots: 4}}': 'solver.table.knots: unknown key',
    'solver: {table: {tolerance: 1.0e-3, span: [1]}}': 'solver.table.span: [1] is not a point',
    'solver: {table: {tolerance: 1.0e-3}, newton: {}}': 'solver.newton: is a second solver',
    'solver: {}': 'solver: names no solver; write one of closed_form, newton, table',
    'solver: 5': 'solver: 5 is not a mapping',
    'accuracy: 1.0e-6\nsolver: closed_form': 'accuracy: cannot be combined with solver',
    'accuracy: fine': "accuracy: 'fine' is not a number",
    'accuracy: 1.0e-15': 'accuracy: 1e-15 is out of bounds',
}


@pytest.mark.parametrize('text', REFUSED)
def test_a_solver_that_cannot_be_is_refused_by_reader_and_schema(text):
    with pytest.raises(FileError) as caught:
        scene_of(text)
    assert REFUSED[text] in str(caught.value)
    assert find_violations(parse_yaml(f'linkage: l.yaml\n{text}'.encode(), 'f'), scene_schema())


BUILT = {
    'solver: {table: {tolerance: 1.0e-6}}\neffects: {effort: {}}': 'table computes no forces',
    'solver: {newton: {tolerance: 1.0e-6}}\ndrive: {torque: {}}': 'newton computes no forces',
    'solver: {table: {tolerance: 1.0e-6, span: [2, 1]}}': 'solver.table.span: 2 to 1 rad is empty',
    'solver: {table: {tolerance: 1.0e-6, span: [0, 1.0e6]}}': 'solver.table: tolerance',
}


@pytest.mark.parametrize('text', BUILT)
def test_refused_when_it_is_built(text):
    with pytest.raises(FileError, match=BUILT[text]):
        Pipeline(scene_of(text))


@pytest.mark.parametrize('forces', ['effects: {effort: {}}', 'drive: {torque: {}}'])
def test_the_closed_form_that_the_refusal_recommends_is_taken(forces):
    masses = ((0.2, 0.02, 1e-4), (0.3, 0.06, 1e-3), (0.2, 0.04, 1e-3))
    linkage = four_bar_text(0.04, 0.12, 0.08, 0.1, masses)
    assert Pipeline(scene_of(f'solver: closed_form\n{forces}', linkage)).linkages


def test_what_is_read_the_schema_takes():
    for text, _ in SOLVERS.values():
        content = parse_yaml(f'linkage: l.yaml\n{text}'.encode(), 'f')
        assert not find_violations(content, scene_schema())


# The cheapest solver that guarantees an accuracy: candidates, choice, and output.


def timed(monkeypatch, **times: float) -> list[set[str]]:
    """Let solvers take these times; return a list of who was timed."""
    asked = []

    def stand_in(_closed, able):
        asked.append(set(able))
        return {name: times[name] for name in able}

    monkeypatch.setattr(choosing, '_median_times', stand_in)
    return asked


# Times relative to one, and the winner: less than a tenth faster does not count as faster.
TIMINGS = [
    ({'closed_form': 1.0, 'table': 0.8, 'newton': 2.0}, 'table'),
    ({'closed_form': 1.0, 'table': 0.8, 'newton': 0.7}, 'newton'),
    ({'closed_form': 1.0, 'table': 0.95, 'newton': 2.0}, 'closed_form'),
    ({'closed_form': 1.0, 'table': 1.5, 'newton': 2.0}, 'closed_form'),
]

KINDS = {'closed_form': Solver, 'table': TableClosure, 'newton': NewtonClosure}


@pytest.mark.parametrize(('times', 'winner'), TIMINGS)
def test_the_fastest_is_chosen(monkeypatch, times, winner):
    timed(monkeypatch, **{name: 1e-6 * time for name, time in times.items()})
    found = choose_solver(crank_rocker(), 1e-6)
    assert type(found) is KINDS[winner]
    assert found.choice.solver == winner
    assert found.choice.parameters == ({} if winner == 'closed_form' else {'tolerance': 1e-6})
    assert worst_error(CRANK_ROCKER, 1.0, found.position(1.0).joints) <= 1e-6


# The accuracy that each solver guarantees.
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
def test_only_solvers_that_prove_the_accuracy_are_timed(monkeypatch, name):
    asked = timed(monkeypatch, closed_form=1e-6, table=1e-6, newton=1e-6)
    said = choose_solver(shipped(name), 1e-6).choice.why
    assert asked == [ABLE[name]]
    assert said.startswith('closed form, 1 µs a state')
    assert ('table: ' in said) == ('table' not in ABLE[name])
    assert ("Newton's method: " in said) == ('newton' not in ABLE[name])


def test_newton_does_not_prove_little(monkeypatch):
    asked = timed(monkeypatch, closed_form=1e-6, table=1e-6, newton=1e-6)
    choose_solver(crank_rocker((0.1, 2.0, 0.02, 1.95)), 1e-2)
    assert 'newton' not in asked[0]


def test_a_real_timing_names_one_that_is_able():
    found = choose_solver(crank_rocker(), 1e-6)
    assert found.choice.solver in ABLE['four_bar']
    assert found.choice.why.count(' µs') == 3


def test_the_closed_form_says_why_it_is_alone():
    found = only_closed_form(crank_rocker(), 'forces start from it')
    assert found.choice == ('closed_form', {}, 'closed form: forces start from it')
    assert found.position(1.0) == found.closed.position(1.0)
