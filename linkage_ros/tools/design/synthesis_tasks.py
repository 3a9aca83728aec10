# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Solve the tasks of ``linkage synthesize``: angle pairs, function, path, motion.

Angles in texts are in degrees; whoever shows them in another unit converts them there.
"""

from __future__ import annotations

import argparse
from cmath import phase
from collections.abc import Iterator, Sequence
from math import degrees, hypot, isfinite, pi, radians, remainder
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.cli import DisplayUnits, ProgressCallback
from linkage_ros.description import numbers_of
from linkage_ros.errors import LinkageError, list_names
from linkage_ros.tools.design.defects import assess, Assessment, Needs, unmet_needs
from linkage_ros.tools.design.design import Design
from linkage_ros.tools.design.pairs.freudenstein import exact_four_bar, fit_equation, ThreePairs
from linkage_ros.tools.design.proof import AchievedPosition

if TYPE_CHECKING:
    from linkage_ros.tools.design.function.task import FunctionTask, StructuralError

CANDIDATES = 200_000
"""Default number of candidates of a search."""

_SHIFT = 0.01
"""Error of an angle for which the sensitivity is shown, in degrees: a good protractor's."""

Angles = Sequence[float]

_LINKS = ('crank', 'coupler', 'rocker')


class DesignAnswer(NamedTuple):
    """A solution."""

    title: str  # How the design was made
    # The design, and its quality.
    design: Design
    assessment: Assessment
    facts: Sequence[tuple[str, str]] = ()  # Names and values that describe how it was solved
    # Crank angles and the rocker's error there, in [rad]; None if the task gives only positions.
    curve: tuple[Sequence[float], Sequence[float]] | None = None


class DesignSearch(NamedTuple):
    """Requirements and effort of a search."""

    needs: Needs
    seed: int
    candidates: int
    keep: int
    address: str
    progress: ProgressCallback

    def meets_needs(self, design: Design) -> bool:
        """Return whether a design meets the requirements."""
        return not unmet_needs(assess(design), self.needs)


def find_answers(typed: argparse.Namespace, search: DesignSearch) -> list[DesignAnswer]:
    """
    Return all solutions, the best first.

    A LinkageError is raised if there is no solution, or the arguments are not a task.
    """
    tasks = {
        '--pair': typed.pair or typed.pairs,
        '--function': typed.function,
        '--path': typed.path or typed.point,
        '--pose': typed.pose,
        '--swing': typed.swing is not None or typed.time_ratio is not None,
    }
    named = [option for option, value in tasks.items() if value]
    if len(named) != 1:
        raise LinkageError(
            list_names(named, ' and ') or 'the task',
            'stand for two tasks' if named else 'is not given',
            f'name one of {list_names(tasks)}',
        )
    work = {
        '--pair': _solve_pairs,
        '--function': _solve_function,
        '--path': _solve_path,
        '--pose': _solve_motion,
        '--swing': _dead_centres,
    }
    return work[named[0]](typed, search)


def _solve_pairs(typed: argparse.Namespace, search: DesignSearch) -> list[DesignAnswer]:
    rows = typed.pair or numbers_of(typed.pairs, (2,))
    crank, rocker = ([typed.angles.to_radians(row[i]) for row in rows] for i in (0, 1))
    return _of_pairs(crank, rocker, typed, search)


def _of_pairs(
    crank: Angles, rocker: Angles, typed: argparse.Namespace, search: DesignSearch
) -> list[DesignAnswer]:
    ground, free = typed.ground, typed.free_zeros
    count = len(crank)
    if count < 3:
        raise LinkageError(
            'pairs', f'there are {count}', 'three make a four-bar, more a nearest one'
        )
    if count == 3 and free:
        return _search_answers(crank, rocker, ground, search)
    if count == 3:
        design, solution = exact_four_bar(crank, rocker, ground)
        return [
            DesignAnswer(
                'three pairs, exact', design, assess(design), list(_pairs_facts(solution))
            )
        ]
    if count <= 5 and free:
        return _with_zeros(crank, rocker, ground)
    return [_fit_answer(crank, rocker, ground, free)]


def _pairs_facts(pairs: ThreePairs) -> list[tuple[str, str]]:
    k1, k2, k3 = pairs.k
    slopes = abs(pairs.gradient).max(-1) / abs(pairs.lengths) * radians(_SHIFT)
    digits = [
        f'{link} {value:.0f}' for link, value in zip(_LINKS, pairs.reliable_digits, strict=True)
    ]
    moves = [f'{link} {value:.2g}' for link, value in zip(_LINKS, 100.0 * slopes, strict=True)]
    return [
        ('k1, k2, k3', f'{k1:.12g}, {k2:.12g}, {k3:.12g}'),
        ('condition', f'{pairs.condition:.4g}'),
        ('digits to trust', f'{", ".join(digits)}, of lengths worked out from these angles'),
        (f'{_SHIFT}° on one angle', f'moves {" %, ".join(moves)} %, at most'),
    ]


def _search_answers(
    crank: Angles, rocker: Angles, ground: float, search: DesignSearch
) -> list[DesignAnswer]:
    from linkage_ros.tools.design.pairs.zero_search import search_zeros

    designs = search_zeros(
        crank,
        rocker,
        ground,
        search.needs,
        seed=search.seed,
        count=search.candidates,
        keep=search.keep,
        progress=search.progress,
        address=search.address,
    )
    return [_turned_answer('three pairs', design) for design in designs]


def _turned_answer(what: str, design: Design) -> DesignAnswer:
    """Return a solution whose zero angles were free; its title names them."""
    four_bar = design.four_bar
    zeros = [
        f'{link} at {degrees(remainder(phase(pin), pi)):+.6g}°'
        for link, pin in (('crank', four_bar.crank), ('rocker', four_bar.rocker))
        if pin.imag
    ]
    title = f'{what}, zero of {" and ".join(zeros)}' if zeros else what
    return DesignAnswer(title, design, assess(design))


def _with_zeros(crank: Angles, rocker: Angles, ground: float) -> list[DesignAnswer]:
    from linkage_ros.tools.design.pairs.free_zeros import five_pairs, four_pairs

    solve, what = (four_pairs, 'four pairs') if len(crank) == 4 else (five_pairs, 'five pairs')
    answers = []
    for solution in solve(crank, rocker, ground):
        answer = _turned_answer(what, solution.design)
        digits = [
            f'{link} {value:.0f}'
            for link, value in zip(_LINKS, solution.reliable_digits, strict=True)
        ]
        facts = [
            ('found', str(solution.solution_counts)),
            ('condition', f'{solution.condition:.4g}'),
            ('digits to trust', ', '.join(digits)),
        ]
        answers.append(answer._replace(facts=facts))
    return sorted(answers, key=_rank_answer)


def _rank_answer(answer: DesignAnswer) -> tuple[int, float]:
    return len(answer.assessment.defects), answer.assessment.link_ratio


def _fit_answer(crank: Angles, rocker: Angles, ground: float, free: bool) -> DesignAnswer:
    from linkage_ros.tools.design.pairs.angle_fit import nearest_four_bar

    start = fit_equation(crank, rocker, ground)
    design = nearest_four_bar(crank, rocker, ground, free_zeros=free)
    answer = _turned_answer(f'{len(crank)} pairs, nearest', design)
    met = answer.assessment.met
    facts = [
        ('rocker off, by the equation', _errors_text(assess(start).met)),
        ('rocker off, fitted', _errors_text(met)),
    ]
    return answer._replace(
        facts=facts,
        curve=([wanted.crank for wanted in design.wanted], [position.angle for position in met]),
    )


def _errors_text(met: Sequence[AchievedPosition]) -> str:
    closed = [position.angle for position in met if position.is_closed]
    if not closed:
        return 'no position can be assembled'
    rms, most = hypot(*closed) / len(closed) ** 0.5, max(map(abs, closed))
    missed = len(met) - len(closed)
    unassembled = f'; {missed} position(s) cannot be assembled' if missed else ''
    return f'{degrees(rms):.4g}° rms, {degrees(most):.4g}° at most{unassembled}'


def _solve_function(typed: argparse.Namespace, search: DesignSearch) -> list[DesignAnswer]:
    from linkage_ros.tools.design.function.expression import Expression
    from linkage_ros.tools.design.function.task import (
        angle_pairs,
        chebyshev_points,
        FunctionTask,
        structural_error,
        wanted_rocker,
    )

    for name in ('range', 'crank_range', 'rocker_range'):
        if getattr(typed, name) is None:
            option = f'--{name.replace("_", "-")}'
            raise LinkageError('--function', f'{option} is missing', f'add {option} FROM TO')
    task = FunctionTask(
        Expression(typed.function),
        tuple(typed.range),
        _read_range(typed.angles, typed.crank_range),
        _read_range(typed.angles, typed.rocker_range),
    )
    low, high = typed.range
    points = typed.at or chebyshev_points(low, high, typed.points)
    answers = []
    for answer in _of_pairs(*angle_pairs(task, points), typed=typed, search=search):
        error = structural_error(
            answer.design, lambda angles: wanted_rocker(task, angles), *task.crank_range
        )
        facts = list(_structural_facts(task, error))
        curve = list(error.crank), list(error.error)
        answers.append(answer._replace(facts=[*answer.facts, *facts], curve=curve))
    return answers


def _structural_facts(task: FunctionTask, error: StructuralError) -> Iterator[tuple[str, str]]:
    from linkage_ros.tools.design.function.task import on_scale

    if error.opens_at is not None:
        opens = degrees(error.opens_at)
        yield 'structural error', f'the loop opens on the way, with the crank at {opens:.6g}°'
    if isfinite(error.greatest):
        worst = on_scale(task, error.greatest_at, error.greatest)
        greatest, rms = degrees(error.greatest), degrees(error.rms)
        yield 'structural error', f'{greatest:+.4g}° at most, {rms:.4g}° rms'
        part = f'{worst.error:+.4g}, {worst.percent:+.3g} % of its range'
        yield '', f'at x = {worst.x:.6g}, where y = {worst.y:.6g} is off by {part}'


def _read_range(angles: DisplayUnits, typed: Sequence[float]) -> tuple[float, float]:
    start, end = map(angles.to_radians, typed)
    return start, end


def _solve_path(typed: argparse.Namespace, search: DesignSearch) -> list[DesignAnswer]:
    from linkage_ros.tools.design.path.curves import PathTask
    from linkage_ros.tools.design.path.generate import generate_path

    rows = typed.point or numbers_of(typed.path, (2, 3))
    timing = typed.timing
    if len(rows[0]) == 3:
        timing = [row[2] for row in rows]
    task = PathTask(
        tuple(complex(row[0], row[1]) for row in rows),
        typed.closed,
        None if timing is None else tuple(map(typed.angles.to_radians, timing)),
        typed.free_zeros,
        search.needs.needs_full_turn,
    )
    paths = generate_path(
        task,
        seed=search.seed,
        count=search.candidates,
        keep=search.keep,
        accept=search.meets_needs,
        progress=search.progress,
        address=search.address,
    )
    return [
        DesignAnswer(
            f'{len(rows)} points of a curve',
            result.design,
            assess(result.design),
            [('points off', f'{result.rms:.4g} m rms, {result.greatest:.4g} m at most')],
        )
        for result in paths.found or paths.refused
    ]


def _dead_centres(typed: argparse.Namespace, search: DesignSearch) -> list[DesignAnswer]:
    from linkage_ros.tools.design.dead_centres import crank_rockers, DeadCentreTask

    for name in ('swing', 'time_ratio'):
        if getattr(typed, name) is None:
            option = f'--{name.replace("_", "-")}'
            raise LinkageError('--swing and --time-ratio', f'{option} is missing', f'add {option}')
    task = DeadCentreTask(typed.angles.to_radians(typed.swing), typed.time_ratio, typed.ground)
    offset = f'{degrees(task.imbalance_angle):.6g}° more than half a turn for the longer stroke'
    return [
        DesignAnswer('dead centres', design, assess(design), [('crank', offset)])
        for design in crank_rockers(task, search.keep)
    ]


def _solve_motion(typed: argparse.Namespace, _search: DesignSearch) -> list[DesignAnswer]:
    from linkage_ros.tools.design.motion import from_fixed_pivots, from_moving_pivots, Pose

    fixed, moving = typed.fixed_pivot, typed.moving_pivot
    if bool(fixed) == bool(moving):
        raise LinkageError(
            '--pose',
            'fixed and moving pivots are given' if fixed else 'no pivots are given',
            'name --fixed-pivot twice or --moving-pivot twice',
        )
    kind = 'fixed' if fixed else 'moving'
    pivots = [complex(*place) for place in fixed or moving]
    if len(pivots) != 2:
        reason = f'was given {len(pivots)} time(s)'
        raise LinkageError(f'--{kind}-pivot', reason, "name the crank's and the rocker's")
    poses = [Pose(complex(x, y), typed.angles.to_radians(angle)) for x, y, angle in typed.pose]
    solve = from_fixed_pivots if fixed else from_moving_pivots
    design, links = solve(poses, *pivots)
    (first, first_digits), (second, second_digits) = (
        (f'({pivot.real:.10g}, {pivot.imag:.10g})', f'{digits:.0f}')
        for pivot, digits in zip(
            links.pivots.tolist(), links.reliable_digits.tolist(), strict=True
        )
    )
    computed = ('O2 and O4 in the ground', 'A and B in the coupler')[bool(fixed)]
    facts = [
        (computed, f'{first} and {second} m'),
        ('digits to trust', f'{first_digits} and {second_digits}'),
    ]
    return [DesignAnswer(f'three poses, from {kind} pivots', design, assess(design), facts)]
