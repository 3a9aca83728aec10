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


"""The part of the page on closing the loops: diagrams and tables of what was measured."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from linkage_ros.accuracy.results import Axis, Curve, Diagram, Part, Point, Table
from linkage_ros.accuracy.solving.advice import advice, text
from linkage_ros.accuracy.solving.loop_errors import Errors
from linkage_ros.accuracy.solving.measured import Measured
from linkage_ros.accuracy.solving.methods import extended
from linkage_ros.accuracy.solving.poses import Poses, unit_of
from linkage_ros.accuracy.spread import Spread

FLOOR = 1e-18
"""Where an answer in doubles that is exactly right is drawn, in [rad]."""

_TIME = Axis('time of a state', 'µs')
_ERROR = 'greatest error'
_UNIT = 'rad, or of the size'
_LEAST = 1e-19
"""Less is drawn on the edge: what has more digits than a double has would flatten all else."""

_ERRORS = Axis(_ERROR, _UNIT, least=_LEAST)

_WITH_PATH = ('easy', 'path')
"""What is integrated goes along a path; it is drawn and told with the easy poses."""


def part_of(found: Sequence[Measured], quick: bool) -> Part:
    """Return the part."""
    return Part(
        'solving',
        'Solving the loop',
        text(found, quick),
        list(_diagrams(found)),
        list(_tables(found)),
        advice(found),
    )


def _diagrams(found: Sequence[Measured]) -> Iterator[Diagram]:
    easy = _of(found, _WITH_PATH)
    where = f'of {easy[0].poses.name}'
    yield Diagram(
        'solving_easy',
        f'Position {where}, easy poses: what accuracy costs',
        _TIME,
        _ERRORS,
        _curves(easy, 'position', lambda one: one.position),
    )
    yield Diagram(
        'solving_acceleration',
        f'Accelerations {where}, easy poses',
        Axis('time of a state with rates and accelerations', 'µs'),
        Axis(_ERROR, 'rad/s², or of the greatest', least=_LEAST),
        _curves(easy, 'motion', lambda one: one.motion and one.motion[2]),
    )
    yield Diagram(
        'solving_batch',
        f'Positions {where} in arrays, easy poses',
        _TIME,
        _ERRORS,
        _curves(easy, 'batch', lambda one: one.batch and one.batch[0]),
    )
    for key, words in (('toggle', 'next to a toggle'), ('change_point', 'at a change point')):
        some = _of(found, (key,))
        yield Diagram(
            f'solving_{key}',
            f'Position of {some[0].poses.name} {words}: what accuracy costs',
            _TIME,
            _ERRORS,
            _curves(some, 'position', lambda one: one.position),
        )


def _curves(
    found: Sequence[Measured], what: str, errors_of: Callable[[Measured], Errors | None]
) -> list[Curve]:
    """Return a curve for each method; a method that failed everywhere has no point."""
    points: dict[str, list[Point]] = {}
    for one in found:
        errors, time = errors_of(one), one.times.get(what)
        if errors is None or errors.worst is None or time is None:
            continue
        failed = f'fails at {errors.failed:.0%} of the poses' if errors.failed else ''
        error = errors.worst
        if one.method.name != extended.NAME:
            error = max(error, FLOOR)
        micros = _micros(time)
        points.setdefault(one.method.name, []).append(
            Point(
                micros.middle,
                error,
                micros,
                setting=', '.join(filter(None, (one.method.setting, failed))),
            )
        )
    return [Curve(name, some, joined=len(some) > 1) for name, some in points.items()]


def _tables(found: Sequence[Measured]) -> Iterator[Table]:
    for poses in _sets(found):
        if poses.key != 'path':
            yield _table(_of(found, _WITH_PATH if poses.key == 'easy' else (poses.key,)), poses)
    batch = [one for one in found if one.batch is not None]
    if batch:
        yield _batch_table(batch)
    knots = [one for one in found if one.method.memory is not None and one.poses.key == 'easy']
    if knots:
        yield _knot_table(knots)
    for key in ('toggle', 'change_point'):
        yield _distance_table(_of(found, (key,)))


def _table(found: Sequence[Measured], poses: Poses) -> Table:
    return Table(
        f'solving_{poses.key}',
        f'{poses.name}, {poses.title}: all methods',
        (
            'method',
            'setting',
            'position [µs]',
            f'greatest error [{_UNIT}]',
            'median error',
            'failed [%]',
            'with accelerations [µs]',
            'rates, greatest error [rad/s, or of the greatest]',
            'accelerations, greatest error [rad/s², or of the greatest]',
            'accelerations, failed [%]',
        ),
        [
            (
                one.method.name,
                one.method.setting,
                _time(one, 'position'),
                one.position.worst,
                one.position.middle,
                100.0 * one.position.failed,
                _time(one, 'motion'),
                one.motion[1].worst if one.motion else None,
                one.motion[2].worst if one.motion else None,
                100.0 * one.motion[2].failed if one.motion else None,
            )
            for one in found
        ],
    )


def _batch_table(found: Sequence[Measured]) -> Table:
    return Table(
        'solving_batch',
        'Arrays of states',
        (
            'linkage',
            'method',
            'setting',
            'position [µs]',
            f'greatest error [{_UNIT}]',
            'failed [%]',
            'with accelerations [µs]',
            'accelerations, greatest error [rad/s², or of the greatest]',
        ),
        [
            (
                one.poses.name,
                one.method.name,
                one.method.setting,
                _time(one, 'batch'),
                one.batch[0].worst,
                100.0 * one.batch[0].failed,
                _time(one, 'batch_motion'),
                one.batch[2].worst,
            )
            for one in found
            if one.batch is not None
        ],
    )


def _knot_table(found: Sequence[Measured]) -> Table:
    return Table(
        'solving_knots',
        f'Tables of {found[0].poses.name}: what they hold and take to build',
        ('table', 'setting', 'memory [kB]', 'build [ms]', f'greatest error [{_UNIT}]'),
        [
            (
                one.method.name,
                one.method.setting,
                (one.method.memory or 0) / 1000.0,
                1000.0 * (one.method.build or 0.0),
                one.position.worst,
            )
            for one in found
        ],
    )


def _distance_table(found: Sequence[Measured]) -> Table:
    """Return the errors by the distance from trouble, a column for each method at its best."""
    poses = found[0].poses
    best = list(best_of_each(found))
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


def best_of_each(found: Sequence[Measured]) -> Iterator[Measured]:
    """Yield of each method the setting that fails least and is nearest to the truth."""
    for name in dict.fromkeys(one.method.name for one in found):
        yield min(
            (one for one in found if one.method.name == name),
            key=lambda one: (one.position.failed, one.position.worst or 0.0),
        )


def _worst_at(errors: Errors, states: Sequence[int]) -> float | None:
    some = [errors.each[k] for k in states]
    return max((error for error in some if error is not None), default=None)


def _of(found: Sequence[Measured], keys: Sequence[str]) -> list[Measured]:
    return [one for one in found if one.poses.key in keys]


def _sets(found: Sequence[Measured]) -> list[Poses]:
    return list({one.poses.key: one.poses for one in found}.values())


def _time(one: Measured, what: str) -> Spread | None:
    return _micros(one.times[what]) if what in one.times else None


def _micros(time: Spread) -> Spread:
    return Spread(*(1e6 * value for value in time))
