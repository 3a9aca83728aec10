# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Measure where the error of five scenes comes from, for docs/accuracy.md and the README.

A scene takes some two minutes, on a machine that does nothing else. Run it in the folder of the
checkout, as `make accuracy_page` does: ``python -m docs.make_accuracy``.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
import sys
from typing import NamedTuple

from bench.report import fill_marks, table_lines
from linkage_ros.cli import Table
from linkage_ros.description import LINKAGE_FILE, load, load_scene, parse_scene, Scene, SCENE_FILE
from linkage_ros.errors import check_installed, list_names
from linkage_ros.kinematics import InputSweep, PlanarClosure, Status
from linkage_ros.resources import shipped_path
from linkage_ros.stages.effects import effect_class, EFFECTS, ForceEffect, needed_effects
from linkage_ros.tools.study import (
    Budget,
    budget_svg,
    budget_table,
    closing_lines,
    compare_runs,
    compare_solver,
    comparison_solvers,
    describe_machine,
    error_text,
    exact_joints,
    lead_lines,
    leave_out,
    measure_budget,
    PARTS,
    price_scenes,
    price_text,
    Progress,
    scene_solver,
    tick_price,
    turn_crank,
)

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / 'accuracy.md'
METHOD, EFFECT_COSTS = DOCS / 'accuracy/method.md', DOCS / 'accuracy/effects.md'
FOUR_BAR = shipped_path('linkages/four_bar.yaml')

_MARK = 'measured'

DISTANCES = tuple(10.0 ** (-k / 2.0) for k in range(4, 19))
"""Distances of hard cases from a toggle or change point: 1e-2 to 1e-9."""


class Shown(NamedTuple):
    """A scene of the page."""

    scene: str
    title: str
    like: str | None = None  # What the crank of a topic drive does
    horizon: float = 10.0  # [s]
    about: str = ''  # What the scene is, if it is not a shipped one


SHOWN = (
    Shown('demo', 'A measured crank', like='sine'),
    Shown('torque_crank', 'A torque bench'),
    Shown('jansen_leg', 'A walking leg', like='sine'),
    Shown(
        'torque_delta.yaml',
        'A delta under three torques',
        'sine',
        2.0,
        "The gallery's delta with masses, drive inertias of 0.05 kg·m² and drag of 1 N·m·s/rad in "
        'each arm, and gravity.',
    ),
    Shown('torque_ankle', 'An ankle from its motors', like='sine'),
)

DELTA = (
    b'linkage: delta\nrate: 500\nloads: {gravity: [0, 0, -9.81], drive_inertia: 0.05}\n'
    b'drive: {torque: {}}\neffects:\n  velocity: {}\n'
    b'  friction: {joints: {a1: {viscous: 1}, a2: {viscous: 1}, a3: {viscous: 1}}}\n'
)
DELTA_MASSES = b"""masses:
  arm1: {mass: 0.2, center: [150, 0, -75], inertia: [1.0e-4, 0, 0, 5.0e-4, 0, 5.0e-4]}
  arm2: {mass: 0.2, center: [-75, 129.9, -75], inertia: [4.0e-4, 0, 0, 2.0e-4, 0, 5.0e-4]}
  arm3: {mass: 0.2, center: [-75, -129.9, -75], inertia: [4.0e-4, 0, 0, 2.0e-4, 0, 5.0e-4]}
  rod1: {mass: 0.05}
  rod2: {mass: 0.05}
  rod3: {mass: 0.05}
  xs: {mass: 0}
  ys: {mass: 0}
  platform: {mass: 0.3, center: [0, 0, -500], inertia: [1.0e-4, 0, 0, 1.0e-4, 0, 2.0e-4]}
"""

EVERY_EFFECT = (
    'linkage: four_bar\npublish_input: true\nrate: 1000\nloads: {gravity: [0, -9.81]}\neffects:\n'
    + ''.join(f'  {name}: {effect_class(name).sample}\n' for name in EFFECTS)
)
"""A scene with every effect, each on one joint, pin or link of the four-bar."""


def main() -> int:
    """Measure and write."""
    parser = argparse.ArgumentParser('python -m docs.make_accuracy', description=__doc__)
    parser.add_argument('--quick', action='store_true', help='faster, to see the page only')
    quick = parser.parse_args().quick
    lines: list[str] = []
    for shown in SHOWN:
        scene = _delta() if shown.about else load_scene(shown.scene)
        budget = measure_budget(
            scene,
            horizon=shown.horizon,
            like=shown.like,
            quick=quick,
            parts=PARTS,
            progress=_progress(shown.scene),
        )
        picture = METHOD.with_name(f'{scene.name}.svg')
        picture.write_text(budget_svg(budget), 'utf-8')
        lines += _section(shown, budget, picture.name, quick=quick)
    lines += hard_lines()
    fill(PAGE, lines)
    fill(METHOD, [f'- {name}: {value}' for name, value in describe_machine()])
    fill(EFFECT_COSTS, effect_lines(quick=quick))
    return 0


def _progress(name: str) -> Progress:
    said: set[int] = set()

    def report(share: float) -> None:
        tenth = int(10.0 * share)
        if tenth not in said:
            said.add(tenth)
            sys.stderr.write(f'{name}: {10 * tenth} %\n')

    return report


def fill(page: Path, lines: Sequence[str]) -> None:
    """Write lines between the marks of a page."""
    page.write_text(fill_marks(page.read_text('utf-8'), _MARK, '\n'.join(lines)), 'utf-8')


def _delta() -> Scene:
    """Return a delta robot with masses, whose arms are under torques."""
    linkage = shipped_path('linkages/space/delta.yaml').read_bytes() + DELTA_MASSES
    return parse_scene('torque_delta', 'torque_delta', {SCENE_FILE: DELTA, LINKAGE_FILE: linkage})


def _section(shown: Shown, budget: Budget, picture: str, *, quick: bool) -> Iterator[str]:
    options = f' --like {shown.like}' if shown.like else ''
    options += f' --horizon {shown.horizon:g}' if shown.horizon < 10.0 else ''
    options += ' --quick' if quick else ''
    yield f'## {shown.title}'
    yield ''
    yield f'{shown.about} `linkage accuracy {shown.scene}{options}`:'.strip()
    yield ''
    yield from (f'> {escaped(line)}<br>' for line in lead_lines(budget))
    yield ''
    yield f'![Error against cost of {Path(shown.scene).stem}](accuracy/{picture})'
    yield ''
    made = budget_table(budget).as_texts()
    yield from table(made.heads, made.rows)
    yield ''
    yield from (f'{escaped(line).capitalize()}.' for line in closing_lines(budget)[:1])
    yield ''


class HardCase(NamedTuple):
    """How a way to solve does next to a singular pose."""

    place: str  # 'toggle of double_rocker'
    solver: str
    worst: float  # Greatest error where it answers, in [rad]
    failed: int  # States without an answer, or with another pose
    states: int  # All states, `DISTANCES` from the singular pose


def compare_hard_cases() -> Iterator[HardCase]:
    """Yield who fails next to a toggle and at a change point, on linkages of the package."""
    check_installed('flint')
    for name, place, near in (
        ('double_rocker', 'toggle', _near_toggle),
        ('parallelogram', 'change point', _near_change_point),
    ):
        closure = load(name)
        states, distances = near(closure)
        known, exact = exact_joints(closure, states)
        # Next to a change point the other assembly is as near as the change point itself.
        limits = [0.1 * distances[states.index(tuple(state))] for state in known]
        far = limits if place == 'change point' else None
        for solver in (scene_solver(closure), *comparison_solvers(closure)):
            error, failed = compare_solver(closure, solver.solve, known, exact, far)
            yield HardCase(f'{place} of {name}', solver.label, error.worst, failed, len(known))


def _near_toggle(closure: PlanarClosure) -> tuple[list[tuple[float, ...]], list[float]]:
    interval = InputSweep(closure).widest_range
    assert interval is not None, 'it has one'
    unit = 1.0 if interval.turning else closure.slide_bound
    return _closing_states(closure, interval.highest, [-unit * distance for distance in DISTANCES])


def _near_change_point(closure: PlanarClosure) -> tuple[list[tuple[float, ...]], list[float]]:
    places = [x.value for x in closure.singular_inputs if x.status is Status.CHANGE_POINT]
    offsets = [*(-distance for distance in DISTANCES), *reversed(DISTANCES)]
    return _closing_states(closure, min(places, key=abs), offsets)


def _closing_states(
    closure: PlanarClosure, place: float, offsets: Sequence[float]
) -> tuple[list[tuple[float, ...]], list[float]]:
    kept = [o for o in offsets if closure.position(place + o).status is Status.CLOSED]
    return [(place + offset,) for offset in kept], [abs(offset) for offset in kept]


def hard_lines() -> Iterator[str]:
    """Yield who fails next to a toggle and at a change point."""
    yield '## Hard cases'
    yield ''
    nearest, farthest = error_text(min(DISTANCES)), error_text(max(DISTANCES))
    yield (
        f'Poses {farthest} to {nearest} rad away from a toggle and a change point: the worst '
        'error of those that each way to solve finds, and how many it misses, by no answer or by '
        'that of another pose.'
    )
    yield ''
    cases = [*compare_hard_cases()]
    places = [*dict.fromkeys(case.place for case in cases)]
    found = {(case.place, case.solver): case for case in cases}
    rows = []
    for solver in dict.fromkeys(case.solver for case in cases):
        row = [solver]
        for place in places:
            case = found.get((place, solver))
            row += (
                ['–', '–'] if case is None else [_worst(case), f'{case.failed} of {case.states}']
            )
        rows.append(row)
    missing = list_names(dict.fromkeys(case.solver for case in cases if case.failed))
    yield f'{missing or "nobody"} {"miss some" if missing else "misses any"}.'
    yield ''
    heads = [text for place in places for text in (f'>{place}, worst [rad]', '>missed')]
    yield from table(['solving', *heads], rows)


def _worst(case: HardCase) -> str:
    return '–' if case.failed == case.states else error_text(case.worst)


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a table of text as Markdown."""
    return table_lines(Table('', heads, [[escaped(cell) for cell in row] for row in rows]))


def escaped(text: str) -> str:
    """Return a text in which nothing is markup."""
    return text.replace('|', r'\|').replace('<', '&lt;').replace('*', r'\*')


def effect_lines(*, quick: bool) -> Iterator[str]:
    """Yield a table of each effect alone, on a scene without any."""
    files = {SCENE_FILE: EVERY_EFFECT.encode(), LINKAGE_FILE: FOUR_BAR.read_bytes()}
    scene = parse_scene('effects', 'effects', files)
    (scene_linkage,) = scene.linkages
    names = [*scene_linkage.effects]
    # Friction acts on nothing without an effect that needs forces.
    forces = [name for name in names if issubclass(effect_class(name), ForceEffect)]
    beside = dict.fromkeys(forces, ('effort',))
    alone = [_only(scene, name, *beside.get(name, ())) for name in names]
    without = [_only(scene, *beside.get(name, ())) for name in names]
    bare = tick_price(_only(scene))
    rows = []
    for name, one, other in zip(names, alone, without, strict=True):
        (price,) = price_scenes(other, [one], 0.2 if quick else 2.0)
        (found,) = compare_runs(one, [other], turn_crank, 2000)
        needed = [*needed_effects(name), *effect_class(name).publishes_with]
        rows.append(
            (
                name,
                price_text(price),
                error_text(found.error.rms) if found.error.worst else '–',
                error_text(found.error.worst) if found.error.worst else '–',
                list_names(dict.fromkeys([*needed, *beside.get(name, ())])),
            )
        )
    yield f'A tick without effects takes {price_text(bare)} µs.'
    yield ''
    heads = ('effect', '>adds to a tick [µs]', '>rms [rad]', '>worst [rad]', 'with')
    yield from table(heads, rows)


def _only(scene: Scene, *names: str) -> Scene:
    """Return the scene with these of its effects only."""
    (scene_linkage,) = scene.linkages
    return leave_out(scene, frozenset(scene_linkage.effects).difference(names))


if __name__ == '__main__':
    raise SystemExit(main())
