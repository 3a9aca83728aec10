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
Show what accuracy costs in time, on a scene and on this machine: twelve lines here, and a page.

The lines say how exactly the loops are solved and how fast; what to write into the scene for some
accuracies, what a tick then costs and at which rate of ticks a subscriber notices; then what
effects, steps of the torque drive and recording cost. The page has pictures, a field for the
accuracy that you need, and all tables. Every error is one against a reference that is known to 50
digits; every time is a median with its quartiles.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from textwrap import wrap
from threading import Event

from linkage_ros.accuracy import measure_accuracy, PARTS
from linkage_ros.accuracy.page.files import check_folder, PAGE, write_page
from linkage_ros.accuracy.page.numbers import number_text
from linkage_ros.accuracy.results import replies, reply, Results
from linkage_ros.cli.arguments import add_set, SCENE_HELP
from linkage_ros.cli.terminal import progress
from linkage_ros.errors import check_installed, did_you_mean, LinkageError, listed
from linkage_ros.scene.load import load_scene

EXAMPLE = 'linkage accuracy worn_press --quick'

_WIDTH = 80
"""Columns of the printed result."""

_WANTED = (1e-2, 1e-4, 1e-8)
"""Wanted accuracies in the printed result, in [rad]."""


def print_results(results: Results) -> None:
    """Print the headline, the answers for some accuracies, and the headline of each part."""
    said = [results.headline]
    answers = replies(results)
    for wanted in _WANTED if answers else ():
        answer = reply(answers, wanted)
        cost = f'{number_text(wanted)} rad: {answer.tick} a tick'
        said.append(f'{cost}; {answer.rate}; {answer.write}')
    # The other headlines are in the first line, or in the answers.
    said += [each.headline for each in results.parts if not (each.clause or each.rates)]
    for text in said:
        print('\n'.join(wrap(text, _WIDTH, subsequent_indent='  ')))


def results_json(results: Results, page: Path) -> str:
    """Return the same as JSON, with the three sentences of each part."""
    parts = [
        {'key': each.key, 'headline': each.headline, 'sentences': [*each.sentences]}
        for each in results.parts
    ]
    answers = [each._asdict() for each in replies(results)]
    said = {'scene': results.scene, 'headline': results.headline, 'machine': dict(results.machine)}
    return json.dumps({**said, 'answers': answers, 'parts': parts, 'page': str(page)}, indent=2)


_SHARES = {'solving': 60, 'ticking': 45, 'effects': 5, 'dynamics': 25, 'recording': 30}
"""Approximate relative durations of the parts."""


class _StoppedError(Exception):
    """A stop was requested."""


EXAMPLE = 'linkage accuracy demo --quick -o accuracy_demo'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('scene', metavar='SCENE', help=SCENE_HELP)
    add_set(parser)
    parser.add_argument(
        '-o',
        '--output',
        type=Path,
        metavar='FOLDER',
        help='where the page goes; nothing is overwritten (default: accuracy_SCENE)',
    )
    parser.add_argument(
        '--quick',
        action='store_true',
        help='in some 15 s, with fewer points and no other packages',
    )
    parser.add_argument(
        '--json',
        action='store_true',
        help='print JSON: headline, answers, and the result of each part',
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
    check_installed('mpmath')  # computes the reference
    scene = load_scene(arguments.scene, arguments.set)
    folder = arguments.output or Path(f'accuracy_{scene.name}')
    check_folder(folder)
    try:
        with progress(f'accuracy of {scene.name}') as advance:
            done = dict.fromkeys(parts, 0.0)

            def report(name: str, share: float) -> None:
                """Convert the progress of a part to the progress of the whole."""
                if stop.is_set():
                    raise _StoppedError
                done[name] = share
                whole = sum(_SHARES[part] for part in done)
                advance(round(sum(_SHARES[part] * done[part] for part in done)), whole)

            results = measure_accuracy(
                scene, parts, arguments.quick, folder.absolute().parent, report
            )
    except _StoppedError:
        return 1
    write_page(results, folder)
    if arguments.json:
        print(results_json(results, folder / PAGE))
    else:
        print_results(results)
        print(f'page      {folder / PAGE}')
    return 0


def _parts(text: str) -> list[str]:
    parts = [part.strip() for part in text.split(',')]
    for part in parts:
        if part not in PARTS:
            remedy = did_you_mean(part, PARTS, f'known: {listed(PARTS)}')
            raise LinkageError(f'--only {part}', 'there is no such part', remedy)
    return parts
