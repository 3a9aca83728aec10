# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Show where the error of the published joints comes from, what each digit costs, what to write.

The first lines answer; the table has a row for each source of error and for what the scene makes
different on purpose, with its price and its next settings. A bag stands for its scene, moved as
it was recorded. docs/accuracy/method.md says how it is measured.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from threading import Event
from typing import NamedTuple

from linkage_ros.cli import (
    add_output,
    add_result,
    add_set,
    bounded_number,
    LINKAGES,
    open_bag,
    Result,
    RESULTS,
    scene_of,
    show_progress,
    show_result,
    Table,
)
from linkage_ros.description import atomic_write, load_scene, Scene
from linkage_ros.errors import did_you_mean, LinkageError, list_names
from linkage_ros.tools.study.budget import Budget, NeedAnswer
from linkage_ros.tools.study.budget_text import (
    budget_json,
    budget_table,
    closing_lines,
    lead_lines,
)
from linkage_ros.tools.study.measure import EFFECTS, measure_budget, PARTS, RECORDING
from linkage_ros.tools.study.need import answer_need, answers_of, tune_scene
from linkage_ros.tools.study.picture import budget_svg
from linkage_ros.tools.view.pages import facts_html, html_document, table_html

EXAMPLE = 'linkage accuracy slider_crank --need 1e-3 --quick'

_SHOWN = ('.html', '.svg')
_HERE = 'linkage_ros.tools.study'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        'scene',
        metavar='SCENE',
        help='scene file or linkage file, a name of linkage gallery, or a bag: its scene and '
        'its motion',
    )
    add_set(parser)
    parser.add_argument(
        '--need',
        type=bounded_number(1e-15, 10.0),
        metavar='RAD',
        help='print the cheapest settings with no more error than this, or what prevents it',
    )
    add_output(
        parser,
        (*LINKAGES, *_SHOWN, *RESULTS),
        'the result is printed; .yaml is the scene that meets --need, .html a page for the '
        'browser, .svg a picture of error against cost',
    )
    parser.add_argument(
        '--horizon',
        type=bounded_number(0.1, 1000.0),
        default=10.0,
        metavar='S',
        help='how long the motion is followed, in s; errors that grow are those at its end '
        '(default: 10)',
    )
    parser.add_argument(
        '--like',
        metavar='sine|BAG',
        help='what the crank of a topic drive does: a sine, or as a bag has it',
    )
    parser.add_argument(
        '--only',
        default=','.join(PARTS),
        metavar='PARTS',
        help=f'parts to measure, separated by commas, of {list_names(PARTS)}',
    )
    parser.add_argument(
        '--quick', action='store_true', help='take 20 s at most, and print what is left out'
    )
    add_result(parser, output=False)


class _StudyStoppedError(Exception):
    """A stop was requested."""


class _StudySource(NamedTuple):
    """What is measured: a scene, and what its motion is like."""

    scene: Scene
    like: str | None
    is_bag: bool


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Measure and answer; return 1 if stopped, or if nothing measured meets the need."""
    parts = _read_parts(arguments.only)
    _check_options(arguments, parts)
    scene, like, is_bag = _load_source(arguments, stop)
    _check_content(scene, parts)
    if is_bag and _names_scene(arguments.output):
        raise LinkageError('-o', 'the scene is in a bag', 'write the lines into its file by hand')
    try:
        with show_progress(f'accuracy of {scene.name}, percent') as advance:

            def report_progress(share: float) -> None:
                if stop.is_set():
                    raise _StudyStoppedError
                advance(round(100.0 * share), 100)

            budget = measure_budget(
                scene,
                horizon=arguments.horizon,
                like=like,
                quick=arguments.quick,
                parts=parts,
                progress=report_progress,
            )
    except _StudyStoppedError:
        return 1
    answer = None if arguments.need is None else answer_need(budget, arguments.need)
    _write_file(arguments, scene, budget, answer)
    account = budget_json(budget)
    if answer is not None:
        account['need'] = {
            'rad': arguments.need,
            'is_met': answer.is_met,
            'error': answer.error,
            'write': dict(answer.changes),
            'answer': answer.text,
        }
    shown: list[Table | str] = [answer.text] if answer is not None else []
    shown += [*lead_lines(budget), budget_table(budget), *closing_lines(budget)]
    show_result(Result(account, shown), arguments)
    return 0 if answer is None or answer.is_met else 1


def _names_scene(output: Path | None) -> bool:
    return output is not None and output.suffix.lower() in LINKAGES


def _read_parts(text: str) -> list[str]:
    parts = [part.strip() for part in text.split(',')]
    for part in parts:
        if part not in PARTS:
            remedy = did_you_mean(part, PARTS, f'known: {list_names(PARTS)}')
            raise LinkageError(f'--only {part}', 'is not a part to measure', remedy)
    return parts


def _check_options(arguments: argparse.Namespace, parts: Sequence[str]) -> None:
    """Raise if options do not fit together, before anything is measured."""
    if _names_scene(arguments.output) and arguments.need is None:
        raise LinkageError('-o', 'is the scene that meets a need', 'add --need 1e-3')
    if arguments.need is not None and 'errors' not in parts:
        raise LinkageError('--need', 'is for errors', f'write --only errors,{arguments.only}')


def _check_content(scene: Scene, parts: Sequence[str]) -> None:
    """Raise if a scene has nothing of what alone is to be measured."""
    has_effects = scene.faults or any(scene_linkage.effects for scene_linkage in scene.linkages)
    if parts == [EFFECTS] and not has_effects:
        raise LinkageError('--only effects', 'the scene has none, and no fault', 'leave it out')
    if parts == [RECORDING] and scene.record is None:
        raise LinkageError(
            '--only recording', 'the scene records no bag', 'add --set record.directory=runs'
        )


def _load_source(arguments: argparse.Namespace, stop: Event) -> _StudySource:
    """Return the scene of a file, or of a bag with its motion."""
    path = Path(arguments.scene)
    is_bag = path.suffix == '.mcap' or any(path.glob('*.mcap')) if path.exists() else False
    if is_bag and arguments.like:
        raise LinkageError('--like', 'the bag itself has the motion', 'leave one of them out')
    if is_bag:
        scene = scene_of(open_bag(path, stop), trust_effects=False, settings=arguments.set)
    else:
        scene = load_scene(arguments.scene, arguments.set)
    return _StudySource(scene, arguments.scene if is_bag else arguments.like, is_bag=is_bag)


def _write_file(
    arguments: argparse.Namespace, scene: Scene, budget: Budget, answer: NeedAnswer | None
) -> None:
    """Write a scene, a page or a picture, by the suffix of the file that was asked for."""
    file: Path | None = arguments.output
    if file is None:
        return
    if _names_scene(file) and answer is not None and answer.is_met:
        text = tune_scene(scene, arguments.scene, answer.changes, file.resolve().parent)
        atomic_write(file, text)
    elif file.suffix.lower() == '.html':
        atomic_write(file, budget_html(budget, answers_of(budget)).encode())
    elif file.suffix.lower() == '.svg':
        svg = budget_svg(budget)
        if not svg:
            raise LinkageError(file, 'shows errors, and none were measured', 'leave -o out')
        atomic_write(file, svg.encode())


def budget_html(budget: Budget, answers: Sequence[NeedAnswer]) -> str:
    """
    Return the page.

    The answers are those to all needs that differ, from the greatest error to the least; the last
    one is to a need that nothing meets. Its field shows the first that reaches what is typed.
    """
    data = {'answers': [{'error': answer.error, 'text': answer.text} for answer in answers]}
    body = _page_body(budget, has_field=bool(answers))
    title = f'Accuracy of {budget.scene}'
    return html_document(title, body, data, _HERE, ('page.css', 'page.js'), has_plots=False)


def _page_body(budget: Budget, *, has_field: bool) -> Iterator[str]:
    yield f'<header><h1>Accuracy of {escape(budget.scene)}</h1>'
    yield from (f'<p class="lead">{escape(line)}</p>' for line in lead_lines(budget))
    yield '</header><main>'
    if has_field:
        yield '<p class="field" hidden><label>I need <input id="need" value="0.001" size="8" '
        yield 'inputmode="decimal"> rad</label> <output id="answer" for="need"></output></p>'
    picture = budget_svg(budget)
    if picture:
        yield f'<figure><figcaption>Error against cost</figcaption>{picture}</figure>'
    title = 'Where the error comes from, and what each setting costs'
    yield from table_html(budget_table(budget)._replace(title=title))
    yield from (f'<p class="note">{escape(line)}</p>' for line in closing_lines(budget))
    yield '</main><footer>'
    yield from facts_html(budget.machine)
    yield '</footer>'
