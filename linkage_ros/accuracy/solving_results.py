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


"""Results of closing the loops: diagrams, tables and conclusions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from math import floor, log10

from linkage_ros.accuracy.methods import ACCELERATION, RATE
from linkage_ros.accuracy.methods.equations import EXTENDED
from linkage_ros.accuracy.methods.formulas import TEXTBOOK
from linkage_ros.accuracy.methods.node import FROM_KNOTS, ITERATED, NODE_DEFAULTS, TABLES
from linkage_ros.accuracy.poses import BATCH, Errors, Measured, Poses, unit_of
from linkage_ros.accuracy.results import Axis, Choice, Curve, Diagram, Part, Point, Table
from linkage_ros.measuring import Spread

FLOOR = 1e-18
"""Position in the diagram of an error of 0, in [rad]."""

_TIME = Axis('time of a state', 'µs')
_ERROR = 'greatest error'
_UNIT = 'rad, or of the size'
_LEAST = 1e-19
"""Smaller errors, beyond the digits of a double, are drawn on the edge to save the scale."""

_ERRORS = Axis(_ERROR, _UNIT, least=_LEAST)

_WITH_PATH = ('easy', 'path')
"""Integration follows a path; it is shown with the easy poses."""


def part_of(results: Sequence[Measured], quick: bool, choices: Sequence[Choice] = ()) -> Part:
    """Return the results as a part of the page."""
    sets = {one.poses.key: one.poses for one in results}
    found = _exactness(results)
    return Part(
        'solving',
        'Solving the loop',
        f'{found[0].upper()}{found[1:]}.',
        [
            _outcome(results, sets['easy']),
            *(_near_trouble(results, sets[key]) for key in _TROUBLE),
        ],
        method(results, sets, quick),
        list(_diagrams(results)),
        list(_tables(results)),
        advice(results),
        found,
        choices,
    )


def _diagrams(results: Sequence[Measured]) -> Iterator[Diagram]:
    easy = _of(results, _WITH_PATH)
    where = f'of {easy[0].poses.name}'
    yield Diagram(
        'solving_easy',
        f'Position {where}, easy poses: what accuracy costs',
        _TIME,
        _ERRORS,
        _curves(easy, 'position', lambda one: one.position),
        front=True,
    )
    yield Diagram(
        'solving_acceleration',
        f'Accelerations {where}, easy poses',
        Axis('time of a state with rates and accelerations', 'µs'),
        Axis(_ERROR, 'rad/s², or of the greatest', least=_LEAST),
        _curves(easy, 'motion', lambda one: one.motion and one.motion[2]),
        front=True,
    )
    yield Diagram(
        'solving_batch',
        f'Positions {where} in arrays, easy poses',
        _TIME,
        _ERRORS,
        _curves(easy, 'batch', lambda one: one.batch and one.batch[0]),
        front=True,
    )
    for key, words in (('toggle', 'next to a toggle'), ('change_point', 'at a change point')):
        some = _of(results, (key,))
        yield Diagram(
            f'solving_{key}',
            f'Position of {some[0].poses.name} {words}: what accuracy costs',
            _TIME,
            _ERRORS,
            _curves(some, 'position', lambda one: one.position),
            front=True,
        )


def _curves(
    results: Sequence[Measured], what: str, errors_of: Callable[[Measured], Errors | None]
) -> list[Curve]:
    """Return a curve for each method; a method that failed everywhere has no point."""
    points: dict[str, list[Point]] = {}
    for one in results:
        errors, time = errors_of(one), one.times.get(what)
        if errors is None or errors.worst is None or time is None:
            continue
        failed = f'fails at {errors.failed:.0%} of the poses' if errors.failed else ''
        error = errors.worst
        if one.method.name != EXTENDED:
            error = max(error, FLOOR)
        micros = time.scaled(1e6)
        setting = ', '.join(filter(None, (one.method.setting, failed)))
        points.setdefault(one.method.name, []).append(
            Point(micros.middle, error, micros, setting=setting, fails=bool(failed))
        )
    return [Curve(name, some, joined=len(some) > 1) for name, some in points.items()]


def _tables(results: Sequence[Measured]) -> Iterator[Table]:
    for poses in {one.poses.key: one.poses for one in results}.values():
        if poses.key != 'path':
            yield _table(_of(results, _WITH_PATH if poses.key == 'easy' else (poses.key,)), poses)
    if any(one.batch is not None for one in results):
        yield _batch_table(results)
    knots = [one for one in results if one.method.memory is not None and one.poses.key == 'easy']
    if knots:
        yield _knot_table(knots)
    for key in ('toggle', 'change_point'):
        yield _distance_table(_of(results, (key,)))


def _table(results: Sequence[Measured], poses: Poses) -> Table:
    return Table.of(
        f'solving_{poses.key}',
        f'{poses.name}, {poses.title}: all methods',
        results,
        {
            'method': lambda one: one.method.name,
            'setting': lambda one: one.method.setting,
            'position [µs]': lambda one: _time(one, 'position'),
            f'greatest error [{_UNIT}]': lambda one: one.position.worst,
            'median error': lambda one: one.position.middle,
            'failed [%]': lambda one: 100.0 * one.position.failed,
            'with accelerations [µs]': lambda one: _time(one, 'motion'),
            'rates, greatest error [rad/s, or of the greatest]': lambda one: (
                one.motion[1].worst if one.motion else None
            ),
            'accelerations, greatest error [rad/s², or of the greatest]': lambda one: (
                one.motion[2].worst if one.motion else None
            ),
            'accelerations, failed [%]': lambda one: (
                100.0 * one.motion[2].failed if one.motion else None
            ),
        },
    )


def _batch_table(results: Sequence[Measured]) -> Table:
    return Table.of(
        'solving_batch',
        'Arrays of states',
        [(one, one.batch) for one in results if one.batch is not None],
        {
            'linkage': lambda each: each[0].poses.name,
            'method': lambda each: each[0].method.name,
            'setting': lambda each: each[0].method.setting,
            'position [µs]': lambda each: _time(each[0], 'batch'),
            f'greatest error [{_UNIT}]': lambda each: each[1][0].worst,
            'failed [%]': lambda each: 100.0 * each[1][0].failed,
            'with accelerations [µs]': lambda each: _time(each[0], 'batch_motion'),
            'accelerations, greatest error [rad/s², or of the greatest]': lambda each: (
                each[1][2].worst
            ),
        },
    )


def _knot_table(results: Sequence[Measured]) -> Table:
    return Table.of(
        'solving_knots',
        f'Tables of {results[0].poses.name}: what they hold and take to build',
        results,
        {
            'table': lambda one: one.method.name,
            'setting': lambda one: one.method.setting,
            'memory [kB]': lambda one: (one.method.memory or 0) / 1000.0,
            'build [ms]': lambda one: 1000.0 * (one.method.build or 0.0),
            f'greatest error [{_UNIT}]': lambda one: one.position.worst,
        },
    )


def _distance_table(results: Sequence[Measured]) -> Table:
    """Return errors by distance from the singular pose, one column for each method's best."""
    poses = results[0].poses
    best = list(best_of_each(results))
    rows = []
    for distance in sorted(set(poses.distances), reverse=True):
        at = [k for k, apart in enumerate(poses.distances) if apart == distance]
        rows.append((distance, *(_worst_at(one.position, at) for one in best)))
    where = 'the toggle' if poses.key == 'toggle' else 'the change point'
    return Table(
        f'solving_{poses.key}_distance',
        f'{poses.name}: greatest error by distance from {where}; nothing where a method fails',
        (
            f'distance [{unit_of(poses)}]',
            *(
                f'{one.method.name}{one.method.setting and ", "}{one.method.setting} [{_UNIT}]'
                for one in best
            ),
        ),
        rows,
    )


def best_of_each(results: Sequence[Measured]) -> Iterator[Measured]:
    """Yield for each method the setting that fails least and has the smallest error."""
    for name in dict.fromkeys(one.method.name for one in results):
        yield min(
            (one for one in results if one.method.name == name),
            key=lambda one: (one.position.failed, one.position.worst or 0.0),
        )


def _worst_at(errors: Errors, states: Sequence[int]) -> float | None:
    some = [errors.each[k] for k in states]
    return max((error for error in some if error is not None), default=None)


def _of(results: Sequence[Measured], keys: Sequence[str]) -> list[Measured]:
    return [one for one in results if one.poses.key in keys]


def _time(one: Measured, what: str) -> Spread | None:
    return one.times[what].scaled(1e6) if what in one.times else None


WANTED = (1e-3, 1e-6, 1e-9, 1e-12)
"""Accuracies, in [rad]."""

_TROUBLE = ('toggle', 'change_point')

_IN_A_SCENE = (*NODE_DEFAULTS, FROM_KNOTS, TABLES['hermite'])
"""Methods that ``solver`` of a scene can choose."""


def method(results: Sequence[Measured], sets: dict[str, Poses], quick: bool) -> list[str]:
    """Return paragraphs on the method of measurement."""
    easy = sets['easy']
    how = (
        f'{len(easy.inputs)} easy poses of {easy.name} were solved by each method, one call a '
        f'state in a loop, and {BATCH:,} in arrays. {_guests(sets)} A time is processor time of '
        'a state: the median over blocks with its quartiles, of all methods in turn, there and '
        'back, in one run. What starts from its last state has for it the neighbouring pose.'
    )
    confirmed = ', which were confirmed at some states of each set by interval arithmetic'
    if find_spec('flint') is None:
        confirmed = ''
    turn = sets['path'].title if 'path' in sets else 'a turn'
    errors = (
        'Errors were worked out apart from the times, at the same states: those of the worst '
        f'published joint, against fifty digits{confirmed}. A slide counts as a part of the '
        'greatest length of a link. Rates and accelerations are those at '
        f'{RATE:g} rad/s and {ACCELERATION:g} rad/s² of the input; their errors are relative '
        f'where they exceed 1. Rates that are integrated have one error, that after {turn}. '
        'An answer that is more than 0.1 rad off, or none, counts as failed and is in no error; '
        'next to a change point also one that is off by a tenth of the distance from it, since '
        'there the other assembly is as near.'
    )
    said = [how, errors]
    if quick:
        said.append('This is the quick run: fewer settings, poses and rounds.')
    said.append(
        "Where Newton's method does not converge, next to toggles and change points, it takes the "
        'state of the closed form.'
    )
    said += filter(None, [_textbook(results), _iterated(results)])
    return said


def _exactness(results: Sequence[Measured]) -> str:
    """Return how exact the node's method is, its time, and the nearest of what is cheaper."""
    easy = [one for one in results if one.poses.key == 'easy' and one.times.get('position')]
    node = next(one for one in easy if one.method.name in NODE_DEFAULTS)
    worst = node.position.worst or 0.0
    said = f'exact to {worst:.1g} rad in {_median_us(node):.2g} µs'
    cheaper = [
        one
        for one in easy
        if one.times['position'].high < node.times['position'].low
        and not one.position.failed
        and one.position.worst is not None
    ]
    if not cheaper:
        return f'{said}; nothing measured is cheaper'
    nearest = min(cheaper, key=lambda one: one.position.worst or 0.0)
    digits = floor(log10(max(nearest.position.worst or 0.0, FLOOR) / max(worst, FLOOR)))
    if digits < 1:
        return f'{said}; {_named(nearest)} is as exact in {_median_us(nearest):.2g} µs'
    return f'{said}; nothing cheaper is within {digits} digits of it'


def advice(results: Sequence[Measured]) -> list[str]:
    """Return a sentence for each accuracy: the cheapest method that a scene can choose."""
    offered = in_a_scene(results)
    winners = [cheapest(offered, wanted) for wanted in WANTED]
    node = next(one for one in offered if one.method.name in NODE_DEFAULTS)
    if all(one is node for one in winners):
        wins = (
            f'The {node.method.name} wins at every accuracy: {_median_us(node):.2g} µs a state, '
            f'{node.position.worst or 0.0:.1g} rad off at worst. Nothing else that a scene can '
            'have is cheaper beyond the spread of the times, however little accuracy is wanted.'
        )
        return [wins]
    said = []
    for wanted, one in zip(WANTED, winners, strict=True):
        if one is None:
            said.append(f'For {wanted:g} rad: nothing that a scene can have.')
            continue
        words = (
            f'For {wanted:g} rad at easy poses: {_named(one)}, {_median_us(one):.2g} µs a state, '
            f'{_compared(one, node)}'
        )
        refuge = _fails_in(results, one, wanted)
        if refuge:
            words += f'; but {refuge}'
        said.append(f'{words}.')
    said.append(
        f'The {node.method.name}, what a scene has that says nothing, takes '
        f'{_median_us(node):.2g} µs a state, in which it also tells toggles and open loops from '
        'the rest, with the gap.'
    )
    return said


def in_a_scene(results: Sequence[Measured]) -> list[Measured]:
    """Return the methods at easy poses that a scene can choose."""
    easy = [one for one in results if one.poses.key == 'easy' and one.times.get('position')]
    return [one for one in easy if one.method.name in _IN_A_SCENE]


def cheapest(results: Sequence[Measured], wanted: float) -> Measured | None:
    """Return the fastest method of those that never fail and reach the accuracy."""
    able = [one for one in results if _keeps(one, wanted)]
    if not able:
        return None
    best = min(able, key=lambda one: one.times['position'].middle)
    # Within each other's spread the node's method wins, else the one with the smallest memory.
    near = [one for one in able if one.times['position'].low <= best.times['position'].high]
    return min(
        near,
        key=lambda one: (
            one.method.name not in NODE_DEFAULTS,
            one.method.memory or 0,
            one.times['position'].middle,
        ),
    )


def _compared(one: Measured, node: Measured) -> str:
    if one is node:
        return 'and nothing is cheaper beyond the spread of the times'
    ratio = node.times['position'].middle / one.times['position'].middle
    return f'{ratio:.3g} times as fast as the {node.method.name}'


def _fails_in(results: Sequence[Measured], one: Measured, wanted: float) -> str:
    """Return where a method misses the accuracy, with its setting if that was measured."""
    bad = []
    for key in _TROUBLE:
        there = [other for other in results if other.poses.key == key]
        same = [other for other in there if other.method.name == one.method.name]
        same = [o for o in same if o.method.setting == one.method.setting] or same
        if same and not any(_keeps(other, wanted) for other in same):
            poses = same[0].poses
            bad.append(poses.title if poses.own else f'{poses.title} of other linkages')
    return f'not {" or ".join(bad)}' if bad else ''


def _keeps(one: Measured, wanted: float) -> bool:
    worst = one.position.worst
    return not one.position.failed and worst is not None and worst <= wanted


def _outcome(results: Sequence[Measured], easy: Poses) -> str:
    some = [one for one in results if one.poses.key == easy.key and one.times.get('position')]
    node = next(one for one in some if one.method.name in NODE_DEFAULTS)
    base = node.times['position'].middle
    exact = [
        one
        for one in some
        if one is not node
        and one.method.name != EXTENDED
        and not one.position.failed
        and (one.position.worst or 0.0) <= 1e-12
    ]
    words = (
        f'At easy poses the {node.method.name} takes {_median_us(node):.2g} µs a state and is '
        f'{node.position.worst or 0.0:.1g} rad off at worst.'
    )
    if exact:
        nearest = min(exact, key=lambda one: one.times['position'].middle)
        words += (
            f' Of the others that reach 1e-12 rad {_named(nearest)} is the cheapest, '
            f'{nearest.times["position"].middle / base:.2g} times the time.'
        )
    more = [one for one in some if one.method.name == EXTENDED]
    if more:
        words += (
            f' Extended precision, {more[0].method.setting}, takes '
            f'{more[0].times["position"].middle / base:,.0f} times as long.'
        )
    return words


def _near_trouble(results: Sequence[Measured], poses: Poses) -> str:
    some = [one for one in results if one.poses.key == poses.key]
    node = next(one for one in some if one.method.name in NODE_DEFAULTS)
    failing = dict.fromkeys(one.method.name for one in some if one.position.failed)
    where = poses.title[0].upper() + poses.title[1:]
    words = (
        f'{where} ({poses.name}, {max(poses.distances):.2g} to {min(poses.distances):.2g} '
        f'{unit_of(poses)} from '
        f'it) the {node.method.name} is {node.position.worst or 0.0:.1g} rad off at worst'
    )
    if node.motion and node.motion[1].worst is not None:
        words += f', its rates {node.motion[1].worst:.1g} of themselves'
    words += '. '
    return words + (
        f'At some of these poses fail: {", ".join(failing)}.'
        if failing
        else 'No method fails there.'
    )


def _textbook(results: Sequence[Measured]) -> str:
    some = [one for one in results if one.method.name == TEXTBOOK]
    if not some:
        return ''
    parts = ', '.join(f'{one.poses.title}: {one.position.failed:.0%}' for one in some)
    return (
        'The textbook form has one root for one assembly throughout, and divides by zero where '
        f"the crank's pin stands over the rocker's pivot; of the poses it fails at {parts}."
    )


def _iterated(results: Sequence[Measured]) -> str:
    some = [one for one in results if one.method.name == ITERATED]
    if not some:
        return ''
    return (
        f'No dyad covers {some[0].poses.name}: what the node does there is to iterate, from the '
        'curve of its branch.'
    )


def _guests(sets: dict[str, Poses]) -> str:
    guests = [
        f'{poses.title}: {poses.name}' for key, poses in sets.items()
        if not poses.own and key != 'path'
    ]  # fmt: skip
    return (
        f'Other linkages stand in for what it does not have ({"; ".join(guests)}).'
        if guests
        else ''
    )


def _named(one: Measured) -> str:
    return f'{one.method.name}{one.method.setting and ", "}{one.method.setting}'


def _median_us(one: Measured) -> float:
    return 1e6 * one.times['position'].middle
