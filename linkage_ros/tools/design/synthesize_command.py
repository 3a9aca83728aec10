# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Design a four-bar: from pairs of angles, a function, a traced curve, poses or dead centres.

Angles are typed and shown in degrees, or in radians with --radians; lengths in metres.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from fractions import Fraction
from math import inf
from pathlib import Path
from shlex import quote
import sys
from threading import Event
from typing import Any, Literal

from linkage_ros.cli import (
    add_output,
    add_radians,
    add_result,
    bounded_number,
    Column,
    DisplayUnits,
    facts_table,
    finite_or_none,
    LINKAGES,
    output_path,
    PICTURES,
    ProgressCallback,
    Result,
    RESULTS,
    show_progress,
    show_result,
    Table,
    table_of_rows,
)
from linkage_ros.description import check_new, write_linkage
from linkage_ros.errors import LinkageError
from linkage_ros.tools.design.defects import Assessment, Needs, needs_penalty, unmet_needs
from linkage_ros.tools.design.design import FourBar
from linkage_ros.tools.design.synthesis_tasks import (
    CANDIDATES,
    DesignAnswer,
    DesignSearch,
    find_answers,
)

_NOT_MET = 1
"""Exit code if there are solutions, but none meets the requirements."""

_LISTED = 3
"""Default number of solutions that a search lists."""

_LONG_GROUND = 30.0
"""Length above which metres were probably mistaken for millimetres, in [m]."""

EXAMPLE = 'linkage synthesize --pair 30 60 --pair 60 70 --pair 90 85 -o design.yaml'


# Tables of a designed four-bar: its links, its proof, its quality.


def _angle_text(angle: float | None, units: DisplayUnits) -> str:
    return '' if angle is None else units.format_angle(angle)


def _small_angle_text(angle: float | None, units: DisplayUnits) -> str:
    return '' if angle is None else f'{units.convert(angle):+.2e}'


_LINK = (Column('link', 'link'), Column('>length', 'length_m', 'm', '.10g'), Column('', 'note'))


def _position_columns(answer: DesignAnswer, units: DisplayUnits) -> list[Column]:
    """Return the columns of positions; optional ones only if they were asked for."""
    rocker, coupler, place = (
        any(getattr(position, what) is not None for position in answer.design.wanted)
        for what in ('rocker', 'coupler', 'place')
    )
    columns = (
        (True, Column('>', 'position')),
        (True, Column('>crank', 'crank', 'rad', _angle_text)),
        (place, Column('>x', 'x_m', 'm', '.6g')),
        (place, Column('>y', 'y_m', 'm', '.6g')),
        (rocker, Column('>rocker', 'rocker', 'rad', _angle_text)),
        (coupler, Column('>coupler', 'coupler', 'rad', _angle_text)),
        (True, Column('assembly', 'assembly')),
        (place, Column('>off', 'off_m', 'm', '.2e')),
        (rocker or coupler,
         Column(f'>off [{units.angle}]', 'off_angle', 'rad', _small_angle_text)),
    )  # fmt: skip
    return [column for is_wanted, column in columns if is_wanted]


def _link_rows(four_bar: FourBar) -> Iterator[dict[str, Any]]:
    names = ('crank', 'coupler', 'rocker', 'ground')
    pins = (four_bar.crank, None, four_bar.rocker, None)
    for name, length, pin in zip(names, four_bar.lengths, pins, strict=True):
        note = ''
        if pin is not None and pin.imag == 0.0 and pin.real < 0.0:
            note = f'{pin.real:.10g}, reversed: it points away from its angle'
        yield {'link': name, 'length_m': length, 'note': note}


def _position_rows(answer: DesignAnswer) -> Iterator[dict[str, Any]]:
    """Yield how each position is met."""
    pairs = zip(answer.design.wanted, answer.assessment.met, strict=True)
    for number, (wanted, met) in enumerate(pairs, 1):
        yield {
            'position': number,
            'crank': wanted.crank,
            'x_m': None if wanted.place is None else wanted.place.real,
            'y_m': None if wanted.place is None else wanted.place.imag,
            'rocker': wanted.rocker,
            'coupler': wanted.coupler,
            'assembly': met.side if met.is_closed else f'open by {met.gap:.3g} m',
            'off_m': finite_or_none(met.distance) if met.is_closed else None,
            'off_angle': finite_or_none(met.angle) if met.is_closed else None,
        }


def _solution_json(answer: DesignAnswer, needs: Needs, units: DisplayUnits) -> dict[str, Any]:
    """Return a solution as JSON holds it; angles in [rad], texts as they are printed."""
    assessment = answer.assessment
    return {
        'title': units.convert_text(answer.title),
        'links': [*_link_rows(answer.design.four_bar)],
        'facts': [
            {'name': units.convert_text(name), 'value': units.convert_text(value)}
            for name, value in answer.facts
        ],
        'positions': [*_position_rows(answer)],
        'kind': assessment.kind.name,
        'crank_turns': assessment.turns,
        'travel': assessment.travel and list(assessment.travel),
        'least_transmission': finite_or_none(assessment.transmission),
        'link_ratio': finite_or_none(assessment.link_ratio),
        'defects': [
            {'name': defect.name, 'text': units.convert_text(defect.text)}
            for defect in assessment.defects
        ],
        'missing': [units.convert_text(missed) for missed in unmet_needs(assessment, needs)],
    }


def _solution_tables(
    answer: DesignAnswer, solution: dict[str, Any], title: str, needs: Needs, units: DisplayUnits
) -> Iterator[Table]:
    """Yield the tables of a solution."""
    yield table_of_rows(units.convert_text(title), 'links', _LINK, solution['links'])
    if answer.facts:
        yield facts_table('', [(fact['name'], fact['value']) for fact in solution['facts']])
    columns = _position_columns(answer, units)
    title = 'Proof: each position, analysed again'
    yield table_of_rows(title, 'positions', columns, solution['positions'])
    yield facts_table('', _assessment_facts(answer.assessment, needs, units))


def _assessment_facts(
    assessment: Assessment, needs: Needs, angles: DisplayUnits
) -> Iterator[tuple[str, str]]:
    kind = assessment.kind
    turns = 'the crank turns fully' if assessment.turns else 'the crank does not turn fully'
    yield 'kind', f'{kind.name} ({kind.code}), {turns}'
    if assessment.travel is not None:
        start, end = map(angles.format_angle, assessment.travel)
        yield 'crank goes', f'{start} to {end}, through all positions'
    where = 'on the way' if assessment.travel is not None else 'of the positions'
    least = angles.format_angle(assessment.transmission, 2)
    yield (
        'transmission',
        f'{least} at least {where}, with the crank at {angles.format_angle(assessment.at)}',
    )
    if assessment.full_transmission is not None:
        yield '', f'{angles.format_angle(assessment.full_transmission, 2)} over the full turn'
    yield 'link ratio', f'{assessment.link_ratio:.4g}, longest to shortest'
    for defect in assessment.defects:
        yield f'{defect.name} defect', angles.convert_text(defect.text)
    if not assessment.defects:
        yield 'defects', 'none: order, branch and circuit are right'
    for missed in unmet_needs(assessment, needs):
        yield 'lacks what is needed', angles.convert_text(missed)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_radians(parser, 'type angles, also in CSV files, and show them')
    _add_tasks(parser)
    _add_freedoms(parser)
    needs = parser.add_argument_group('what a solution needs')
    needs.add_argument(
        '--need', default='', metavar='KIND', help='crank-rocker, double-crank, grashof, …'
    )
    needs.add_argument(
        '--min-transmission',
        type=float,
        default=0.0,
        metavar='ANGLE',
        help='least transmission angle from the first to the last position',
    )
    needs.add_argument(
        '--max-link-ratio',
        type=float,
        default=inf,
        metavar='RATIO',
        help='longest link to shortest',
    )
    needs.add_argument('--usable', action='store_true', help='no order, branch or circuit defect')
    written = parser.add_argument_group('what is written')
    add_result(written, output=False)
    add_output(
        written,
        (*LINKAGES, *RESULTS),
        'the result is printed; a .yaml file is the linkage of a solution',
    )
    written.add_argument(
        '--pick', type=int, default=1, metavar='N', help='the solution to write (default: 1)'
    )
    written.add_argument(
        '--draw',
        type=output_path(PICTURES),
        metavar='OUTPUT',
        help='picture of the solution at its positions, OUTPUT.png, .svg or .pdf; of several '
        'OUTPUT-1, OUTPUT-2, …',
    )


def _add_tasks(parser: argparse.ArgumentParser) -> None:
    pairs = parser.add_argument_group('pairs of crank and rocker angles')
    _add_numbers(
        pairs,
        '--pair',
        ('CRANK', 'ROCKER'),
        'angles of crank and rocker in one position; three or more times',
        action='append',
    )
    pairs.add_argument(
        '--pairs', type=Path, metavar='CSV', help='the same as a CSV of two columns'
    )
    pairs.add_argument(
        '--ground', type=float, default=1.0, metavar='M', help='length of the ground (default: 1)'
    )

    function = parser.add_argument_group('a function')
    function.add_argument('--function', metavar='FORMULA', help='of x, such as "log10(x)"')
    _add_numbers(function, '--range', ('X0', 'X1'), 'of x')
    for link in ('crank', 'rocker'):
        text = f"the {link}'s angles over the range"
        _add_numbers(function, f'--{link}-range', ('FROM', 'TO'), text)
    _add_count(function, '--points', 0, 3, 'points, by Chebyshev (default: 3)')
    _add_numbers(function, '--at', 'X', 'points of your own, instead')

    path = parser.add_argument_group('a traced curve')
    _add_numbers(path, '--point', ('X', 'Y'), 'in metres', action='append')
    path.add_argument(
        '--path',
        type=Path,
        metavar='CSV',
        help='columns x, y in metres, and the crank angle where that is wanted too',
    )
    path.add_argument('--closed', action='store_true', help='the last point leads to the first')
    _add_numbers(path, '--timing', 'CRANK', "the crank's angle at each point")

    rocker = parser.add_argument_group('the dead centres of a crank-rocker')
    rocker.add_argument('--swing', type=float, metavar='ANGLE', help='of the rocker')
    rocker.add_argument(
        '--time-ratio',
        type=_read_ratio,
        metavar='RATIO',
        help='longer stroke to shorter one, as 10/9 or 1.2',
    )

    motion = parser.add_argument_group('poses of the coupler')
    text = 'place in metres, and angle; three times'
    _add_numbers(motion, '--pose', ('X', 'Y', 'ANGLE'), text, action='append')
    for kind, frame in (('fixed', 'ground'), ('moving', 'coupler')):
        text = f"in the {frame}'s frame; twice: crank's and rocker's"
        _add_numbers(motion, f'--{kind}-pivot', ('X', 'Y'), text, action='append')


def _add_numbers(
    group: argparse._ArgumentGroup,
    option: str,
    names: str | tuple[str, ...],
    text: str,
    action: Literal['store', 'append'] = 'store',
) -> None:
    """Declare an option that takes as many numbers as there are names; one or more for a text."""
    count: int | str = '+' if isinstance(names, str) else len(names)
    group.add_argument(option, nargs=count, type=float, action=action, metavar=names, help=text)


def _add_count(
    group: argparse._ArgumentGroup,
    option: str,
    least: int,
    default: int | None,
    text: str,
) -> None:
    """Declare an option that takes an integer of at least 0 or 1."""
    kind = bounded_number(least, 2**53 - 1, int)
    group.add_argument(option, type=kind, default=default, metavar='N', help=text)


def _read_ratio(text: str) -> float:
    """Read a number, or a fraction such as 10/9."""
    try:
        return float(Fraction(text))
    except (ValueError, ZeroDivisionError, OverflowError):
        raise argparse.ArgumentTypeError(f'{text!r} is not a ratio; write 10/9 or 1.2') from None


def _add_freedoms(parser: argparse.ArgumentParser) -> None:
    freedoms = parser.add_argument_group('what is free, and the search')
    freedoms.add_argument(
        '--free-zeros',
        action='store_true',
        help='only how far crank and rocker turn matters, not from where: with three pairs the '
        'best are searched for, with four and five all are listed, with more they are fitted',
    )
    _add_count(freedoms, '--seed', 0, 0, 'of the search (default: 0)')
    text = f'how many are tried in a search (default: {CANDIDATES})'
    _add_count(freedoms, '--candidates', 1, CANDIDATES, text)
    text = f'how many are listed (of a search {_LISTED}, else all)'
    _add_count(freedoms, '--best', 1, None, text)
    freedoms.add_argument(
        '--dask',
        default='',
        metavar='ADDRESS',
        help='scheduler of a Dask cluster that shares the search, as tcp://host:8786',
    )


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Design; return 1 if no solution meets the requirements."""
    try:
        return _run_design(arguments)
    except LinkageError as error:
        if arguments.angles.in_degrees:
            raise
        told = arguments.angles.convert_text
        raise LinkageError(told(error.where), told(error.reason), told(error.remedy)) from None


def _run_design(arguments: argparse.Namespace) -> int:
    with show_progress('candidates') as advance:
        answers, meeting = find_solutions(arguments, advance)
    if arguments.ground > _LONG_GROUND:
        told = f'--ground: {arguments.ground:g} m is long; if it is in millimetres, divide by 1000'
        print(f'linkage synthesize: note: {told}', file=sys.stderr)
    needs, units = needs_of(arguments), arguments.angles
    shown = answers[: arguments.best]
    solutions = [_solution_json(answer, needs, units) for answer in shown]
    parts: list[Table | str] = []
    if not meeting:
        parts.append(f'None of {len(answers)} solution(s) has what is needed. Nearest to it:')
    for number, (answer, solution) in enumerate(zip(shown, solutions, strict=True), 1):
        title = answer.title if len(shown) == 1 else f'{number}: {answer.title}'
        parts += _solution_tables(answer, solution, title, needs, units)
    account = {'meets_needs': meeting, 'solutions': solutions}
    show_result(Result(account, parts), arguments, units)
    _draw_solutions(arguments.draw, shown, force=arguments.force)
    if not meeting:
        return _NOT_MET
    if arguments.output is not None and arguments.output.suffix.lower() in LINKAGES:
        if not arguments.json and not arguments.csv:
            print()
        _write_solution(arguments, shown)
    return 0


def find_solutions(
    typed: argparse.Namespace, advance: ProgressCallback
) -> tuple[list[DesignAnswer], bool]:
    """Return the solutions that meet the requirements and True; or the nearest ones and False."""
    needs = needs_of(typed)
    keep = typed.best or _LISTED
    answers = find_answers(
        typed, DesignSearch(needs, typed.seed, typed.candidates, keep, typed.dask, advance)
    )
    meeting = [answer for answer in answers if not unmet_needs(answer.assessment, needs)]
    if meeting:
        return meeting, True
    return sorted(answers, key=lambda answer: needs_penalty(answer.assessment, needs)), False


def needs_of(typed: argparse.Namespace) -> Needs:
    """Return the requirements; if there are any, a solution must also be free of defects."""
    needs = Needs(
        typed.need, typed.angles.to_radians(typed.min_transmission), typed.max_link_ratio
    )
    needs.check()
    return needs._replace(usable=typed.usable or needs != Needs())


def _draw_solutions(file: Path | None, shown: Sequence[DesignAnswer], *, force: bool) -> None:
    if file is None:
        return
    from linkage_ros.tools.design.picture import draw_design

    for number, answer in enumerate(shown, 1):
        own = file if len(shown) == 1 else file.with_stem(f'{file.stem}-{number}')
        check_new(own, force=force)
        draw_design(answer.design, answer.title, own, error=answer.curve)
        print(own)


def _write_solution(arguments: argparse.Namespace, shown: Sequence[DesignAnswer]) -> None:
    if not 1 <= arguments.pick <= len(shown):
        raise LinkageError(
            f'--pick {arguments.pick}',
            f'there are {len(shown)} solution(s)',
            f'name one of 1 to {len(shown)}',
        )
    answer = shown[arguments.pick - 1]
    first = answer.design.wanted[0].crank
    command = ' '.join(['linkage synthesize', *map(quote, sys.argv[2:])])
    defects = [f'{defect.name} defect: {defect.text}' for defect in answer.assessment.defects]
    told = arguments.angles.convert_text
    lines = [told(f'Designed: {answer.title}'), command, *map(told, defects)]
    write_linkage(answer.design.four_bar.linkage(first), arguments.output, lines)
    names = ' and '.join(defect.name for defect in answer.assessment.defects)
    print(f'{arguments.output}  ({names} defect: see above)' if names else arguments.output)
