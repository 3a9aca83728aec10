# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Run a scene as fast as possible, without ROS: once, to a bag or a table, or often, as a study.

A study runs the scene with other seeds and other values of its keys. It writes a table with a row
for each run, or a picture of the spread over time. Tables have the units of the scene's file. A
stopped study continues when it is called again with the same scene and options: OUTPUT.part holds
its finished runs until then.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from contextlib import closing
from math import nan
from os import cpu_count
from pathlib import Path
import re
import sys
from tempfile import TemporaryDirectory
from threading import Event

from linkage_ros.cli.arguments import add_force, add_set, bounded_number, PICTURES, SCENE_HELP
from linkage_ros.cli.export import export_bag, shown_unit
from linkage_ros.cli.terminal import show_progress
from linkage_ros.description import (
    check_kind,
    check_output_name,
    load_scene,
    remove_bag,
    Scene,
    scene_notes,
    table_file,
    TABLE_KINDS,
)
from linkage_ros.errors import escape_unprintable, LinkageError, name_instead
from linkage_ros.messages import EFFORT, Key, POSITION, RATE, unit_in_si
from linkage_ros.replay import (
    check_simulated,
    FinishedRuns,
    instants_of,
    Outcome,
    ParameterSweep,
    run_outcomes,
    runs_of,
    Settings,
    simulate_run,
    Statistics,
    Study,
    sweep_of,
)
from linkage_ros.signals import StoppedError
from linkage_ros.workbench import find_tool

EXAMPLE = 'linkage simulate torque_crank --seconds 1 -o my_run.csv'

_MOST_NAMED = 3
"""Reasons of runs that failed and are named."""

_NUMBER = re.compile(r'[-+.\d]+(?:e[-+]?\d+)?')

_Failure = tuple[Settings, str]
"""The settings of a run that failed, and why."""

_WHOLE = ('run', 'seed', 'ticks', 'messages')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('scene', metavar='SCENE', help=SCENE_HELP)
    parser.add_argument(
        '--seconds',
        type=bounded_number(0.0, 1e9),
        default=10.0,
        help='duration of a run, in the time of the scene (default: 10)',
    )
    parser.add_argument(
        '-o',
        '--output',
        type=_read_output,
        required=True,
        metavar='FOLDER|OUTPUT',
        help='folder of a new bag; or a table of the joints, OUTPUT.csv, .xlsx or .parquet; for a '
        'study a table of its runs, or a picture of the spread, OUTPUT.png, .svg or .pdf',
    )
    add_force(parser)
    add_set(parser)
    study = parser.add_argument_group('a study')
    study.add_argument(
        '--seeds',
        type=bounded_number(1, 1e12, int),
        default=1,
        metavar='N',
        help='number of seeds, each in a run',
    )
    study.add_argument(
        '--sweep',
        action='append',
        default=[],
        metavar='KEY=VALUES',
        help='run with each value of a key of the scene: KEY=LOW:HIGH:N or KEY=a,b,c; several '
        'keys give all combinations',
    )
    study.add_argument(
        '--workers',
        type=bounded_number(1, 1024, int),
        metavar='N',
        help='processes (default: one per processor)',
    )
    study.add_argument('--dask', metavar='ADDRESS', default='', help='scheduler of the workers')


def _read_output(text: str) -> Path:
    """Read the name of a folder, which has no suffix, or of a table or picture."""
    file = Path(text)
    if file.suffix:
        check_output_name(file, (*TABLE_KINDS, *PICTURES))
    return file


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Simulate; return 1 if a signal stopped it."""
    sweeps = [sweep_of(text) for text in arguments.sweep]
    if arguments.seeds > 1 or sweeps:
        return _run_study(arguments, sweeps, stop)
    for is_set, option in (
        (arguments.workers, '--workers'),
        (arguments.dask, '--dask'),
    ):
        if is_set:
            raise LinkageError(option, 'is for a study', 'add --seeds or --sweep')
    output: Path = arguments.output
    if output.suffix:
        check_output_name(output, TABLE_KINDS)
        check_kind(output)
    scene = _load_scene(arguments)
    ticks = check_simulated(scene, arguments.seconds)
    if not output.suffix:
        remove_bag(output, force=arguments.force)
        counts = _simulate_into(scene, output, ticks, stop)
        parts = ', '.join(
            f'{count} on {escape_unprintable(name)}' for name, count in counts.items() if count
        )
        print(f'{output}: {parts or "no messages"}')
        return int(stop.is_set())
    with TemporaryDirectory() as folder:
        bag = Path(folder) / 'run'
        name_instead(bag, f'the run of {arguments.scene}')
        counts = _simulate_into(scene, bag, ticks, stop)
        if stop.is_set():
            return 1
        if not counts['/joint_states']:
            raise LinkageError(
                arguments.scene,
                f'publishes no joint states in {ticks:,} ticks',
                'name a folder by -o, and linkage info says why',
            )
        try:
            survey = export_bag(bag, output, None, stop)
        except StoppedError:
            print('linkage simulate: stopped; nothing was written', file=sys.stderr)
            return 1
    print(f'{output}: {survey.rows} rows, {4 + len(survey.keys)} columns')
    return 0


def _load_scene(arguments: argparse.Namespace) -> Scene:
    """Read the scene, and show the notes on it."""
    scene = load_scene(arguments.scene, arguments.set)
    for note in scene_notes(scene):
        print(f'linkage simulate: note: {note}', file=sys.stderr)
    return scene


def _simulate_into(scene: Scene, folder: Path, ticks: int, stop: Event) -> dict[str, int]:
    """Run a scene into a bag, and return its counts; say so if a signal stopped it."""
    stopped_at: int | None = None
    warnings: list[str] = []
    with show_progress('ticks') as advance:

        def goes_on(number: int) -> bool:
            nonlocal stopped_at
            advance(number, ticks)
            if stop.is_set():
                stopped_at = number
            return stopped_at is None

        counts = simulate_run(scene, folder, ticks, goes_on, warnings.append)
    for warning in warnings:
        print(f'linkage simulate: {warning}', file=sys.stderr)
    if stopped_at is not None:
        print(
            f'linkage simulate: stopped after {stopped_at:,} of {ticks:,} ticks', file=sys.stderr
        )
    return counts


def _run_study(
    arguments: argparse.Namespace, sweeps: Sequence[ParameterSweep], stop: Event
) -> int:
    """Run a study; return 1 if a signal stopped it, or no run succeeded."""
    output: Path = arguments.output
    check_output_name(output, (*TABLE_KINDS, *PICTURES))  # not a folder
    if output.suffix in TABLE_KINDS:
        check_kind(output)
    else:
        # Without matplotlib, say so before the study is run.
        find_tool('spread').picture_settings()
    scene = _load_scene(arguments)
    ticks = check_simulated(scene, arguments.seconds)
    runs = runs_of(sweeps, arguments.seeds, scene.seed)
    instants = instants_of(len(runs), len(scene.joint_names), ticks)
    study = Study(scene.name, scene.files, scene.folder, arguments.seconds, instants)
    with closing(FinishedRuns(output, study, runs)) as finished:
        outcomes = finished.outcomes
        if outcomes:
            _print_note(f'continues after {len(outcomes)} of {len(runs)} runs, of {finished.file}')
        waiting = [part for part in enumerate(runs) if part[0] not in outcomes]
        workers = max(1, min(arguments.workers or cpu_count() or 1, len(waiting)))
        try:
            with show_progress('runs') as advance:
                for number, outcome in run_outcomes(study, waiting, workers, arguments.dask):
                    finished.add_run(number, outcome)
                    advance(len(outcomes), len(runs))
                    if stop.is_set():
                        raise StoppedError
        except StoppedError:
            kept = f'{len(outcomes)} of {len(runs)} runs are kept in {finished.file}'
            _print_note(f'stopped; {kept}; the same command continues' if outcomes else 'stopped')
            return 1
        return _write_results(arguments, scene, runs, finished)


def _write_results(
    arguments: argparse.Namespace,
    scene: Scene,
    runs: Sequence[Settings],
    finished: FinishedRuns,
) -> int:
    """Write the results of a study; return 1 if no run succeeded."""
    output, outcomes = arguments.output, finished.outcomes
    failed = [(runs[number], outcomes[number].failure) for number in sorted(outcomes)
              if outcomes[number].failure]  # fmt: skip
    for alike in _group_by_reason(failed)[:_MOST_NAMED]:
        settings, failure = alike[0]
        count = len(alike) - 1
        others = f'; likewise {count} other run{"s" * (count > 1)}' if count else ''
        _print_note(f'{_settings_text(settings)}: {failure}{others}')
    if failed:
        _print_note(f'{len(failed)} of {len(runs)} runs failed')
    if len(failed) == len(runs):
        finished.remove_file()
        return 1
    if output.suffix in TABLE_KINDS:
        heads, rows = _runs_table(scene, runs, outcomes)
        with table_file(output, heads, _WHOLE) as write:
            write(rows)
        print(f'{output}: {len(rows)} runs, {len(heads)} columns')
    else:
        _draw_runs(scene, arguments.seconds, outcomes, output)
        print(output)
    finished.remove_file()
    return 0


def _group_by_reason(failed: Sequence[_Failure]) -> list[list[_Failure]]:
    """Return the failed runs by their reason, whatever the numbers in it."""
    alike: dict[str, list[_Failure]] = {}
    for failure in failed:
        alike.setdefault(_NUMBER.sub('', failure[1]), []).append(failure)
    return [*alike.values()]


def _print_note(text: str) -> None:
    print(f'linkage simulate: {text}', file=sys.stderr)


def _settings_text(settings: Settings) -> str:
    return ', '.join(f'{key}={value:g}' if key != 'seed' else f'seed={value}'
                     for key, value in settings)  # fmt: skip


def _revolute_joints(scene: Scene) -> dict[str, bool]:
    """Return whether each joint turns, by its name in messages."""
    return {
        joint: turns
        for scene_linkage in scene.linkages
        for joint, turns in zip(
            scene_linkage.joint_names, scene_linkage.closure.turning, strict=True
        )
    }


def _runs_table(
    scene: Scene, runs: Sequence[Settings], outcomes: Mapping[int, Outcome]
) -> tuple[list[str], list[list[float | int | None]]]:
    """Return headings and rows of the table of runs; a run that failed has no numbers."""
    keys = [key for key, _ in runs[0]]
    columns = list(
        dict.fromkeys(key for outcome in outcomes.values() for key in outcome.statistics)
    )
    turning = _revolute_joints(scene)
    units = [shown_unit(scene.units, unit_in_si(_key_of(column), turning)) for column in columns]
    heads = ['run', *keys, 'ticks', 'messages']
    for column, (unit, _) in zip(columns, units, strict=True):
        heads += [f'{column} {name} [{unit}]' for name in Statistics._fields]
    nothing = Statistics(nan, nan, nan, nan)
    rows: list[list[float | int | None]] = []
    for index, settings in enumerate(runs):
        outcome = outcomes[index]
        row: list[float | int | None] = [index + 1, *(value for _, value in settings)]
        row += [outcome.ticks, outcome.messages]
        for column, (_, factor) in zip(columns, units, strict=True):
            row += [value / factor for value in outcome.statistics.get(column, nothing)]
        rows.append(row)
    return heads, rows


def _key_of(column: str) -> Key:
    """Return joint and quantity of a column of statistics."""
    joint, _, quantity = column.partition(' ')
    return joint, {'': POSITION, 'rate': RATE, 'effort': EFFORT}[quantity]


def _draw_runs(
    scene: Scene, seconds: float, outcomes: Mapping[int, Outcome], picture: Path
) -> None:
    """Draw the spread of the runs that succeeded."""
    import numpy as np  # local import: only for a picture

    spread = find_tool('spread')
    good = [outcomes[number] for number in sorted(outcomes) if not outcomes[number].failure]
    turning = _revolute_joints(scene)
    joints = [
        spread.JointSpread(
            joint,
            'rad' if turning[joint] else 'm',
            np.array([outcome.positions[index] for outcome in good]),
        )
        for index, joint in enumerate(scene.joint_names)
    ]
    title = f'{scene.name}: {len(good)} runs of {seconds:g} s'
    spread.draw_spread(title, seconds, joints, picture)
