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

"""
Show what accuracy costs in time, on a scene and on this machine: tables here, a page in a folder.

How exactly loops are solved and how fast; what the rate of ticks buys; what effects cost; what the
steps of the torque drive cost; what the recording costs. Every error is one against a reference
that is known to 50 digits; every time is a median with its quartiles.
"""

from __future__ import annotations

import argparse
from importlib.util import find_spec
from pathlib import Path
from threading import Event

from linkage_ros.accuracy.measure import measure_accuracy, PARTS
from linkage_ros.accuracy.page.files import check_folder, PAGE, write_page
from linkage_ros.accuracy.page.numbers import cell_text, numeric_columns
from linkage_ros.accuracy.results import Results
from linkage_ros.accuracy.results import Table as Measured
from linkage_ros.cli.terminal import progress, ProgressCallback, show, Table
from linkage_ros.errors import did_you_mean, LinkageError, listed
from linkage_ros.scene.load import load_scene

# The printed result: the tables of each part, and the advice.


def print_results(results: Results) -> None:
    """Print all tables, each part under its title, and the advice of all parts at the end."""
    for part in results.parts:
        print(f'{part.title}\n')
        for table in part.tables:
            show(printed(table))
            print()
    for part in results.parts:
        if part.advice:
            print(part.title)
            for advice in part.advice:
                print(f'  {advice}')


def printed(table: Measured) -> Table:
    """Return a table as texts; columns of numbers are aligned to the right."""
    columns = zip(table.columns, numeric_columns(table), strict=True)
    return Table(
        table.title,
        [f'>{name}' if number else name for name, number in columns],
        [[cell_text(cell) for cell in row] for row in table.rows],
    )


_REFERENCE = 'mpmath'
"""The package that computes the reference; it comes with the extra `report`."""

_SHARES = {'solving': 60, 'ticking': 45, 'effects': 5, 'dynamics': 25, 'recording': 30}
"""Approximate relative durations of the parts."""


class _StoppedError(Exception):
    """A stop was requested."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('scene', help='the scene file, or a linkage file')
    parser.add_argument(
        '-o',
        '--output',
        type=Path,
        metavar='FOLDER',
        help='where the page goes; nothing is overwritten (here accuracy_SCENE)',
    )
    parser.add_argument(
        '--quick',
        action='store_true',
        help='in some 15 s, with fewer points and no other packages',
    )
    parser.add_argument(
        '--only',
        default=','.join(PARTS),
        metavar='PARTS',
        help=f'parts to measure, separated by commas, of {listed(PARTS)}',
    )


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Measure, print and write; return 1 if stopped."""
    parts = _parts(arguments.only)
    if find_spec(_REFERENCE) is None:
        raise LinkageError(_REFERENCE, 'is not installed', 'pip install linkage_ros[report]')
    scene = load_scene(arguments.scene)
    folder = arguments.output or Path(f'accuracy_{scene.name}')
    check_folder(folder)
    try:
        with progress(f'accuracy of {scene.name}') as told:
            results = measure_accuracy(
                scene,
                parts,
                arguments.quick,
                folder.absolute().parent,
                _Overall(parts, told, stop),
            )
    except _StoppedError:
        return 1
    print_results(results)
    write_page(results, folder)
    print(f'page      {folder / PAGE}')
    return 0


class _Overall:
    """Converts the progress of a part to the progress of the whole."""

    def __init__(self, parts: list[str], told: ProgressCallback, stop: Event) -> None:
        self._told, self._stop = told, stop
        self._done = dict.fromkeys(parts, 0.0)

    def __call__(self, name: str, share: float) -> None:
        if self._stop.is_set():
            raise _StoppedError
        self._done[name] = share
        done = sum(_SHARES[part] * part_done for part, part_done in self._done.items())
        self._told(round(done), sum(_SHARES[part] for part in self._done))


def _parts(text: str) -> list[str]:
    parts = [part.strip() for part in text.split(',')]
    for part in parts:
        if part not in PARTS:
            remedy = did_you_mean(part, PARTS, f'known: {listed(PARTS)}')
            raise LinkageError(f'--only {part}', 'there is no such part', remedy)
    return parts
