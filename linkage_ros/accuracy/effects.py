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
Cost of each effect of a scene per tick, and the error that it adds to the output.

The truth is the scene without its effects: the linkage as defined, at the crank angle that its
drive gives at the time of the tick. Both pipelines run over the same times and the same crank
messages. A delayed message is compared at the time of the tick, not of its stamp: this is the
error that a consumer sees.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from math import remainder, sqrt, tau
from typing import NamedTuple

from linkage_ros.accuracy.results import Axis, Curve, Diagram, Part, Point, Table
from linkage_ros.cost import (
    EffectCost,
    faults_of,
    feed,
    measure,
    Names,
    SceneCost,
    Times,
    Variants,
)
from linkage_ros.effects.stage import SensorReading
from linkage_ros.measuring import Progress, Spread
from linkage_ros.pipeline.pipeline import Pipeline
from linkage_ros.scene.scene import Scene


class Departure(NamedTuple):
    """The error of the published states."""

    # Root mean square and maximum, in [rad], in [m], in [rad/s] or [m/s]; None if none is
    # published.
    angles: tuple[float, float] | None
    slides: tuple[float, float] | None
    rates: tuple[float, float] | None
    silent: float  # Fraction of the ticks at which the truth is known but no state is published


class _Errors:
    """Accumulates errors: root mean square and maximum."""

    def __init__(self) -> None:
        self._count, self._squares, self._worst = 0, 0.0, 0.0

    def add(self, error: float) -> None:
        self._count += 1
        self._squares += error * error
        self._worst = max(self._worst, abs(error))

    def both(self) -> tuple[float, float] | None:
        return (sqrt(self._squares / self._count), self._worst) if self._count else None


def departure(true: Pipeline, real: Pipeline, fed: Iterable[tuple[int, bytes]]) -> Departure:
    """
    Return the error of the states that a pipeline publishes against the true ones.

    Parameters
    ----------
    true
        The pipeline that gives the truth, with rates.
    real
        The pipeline to judge.
    fed
        Times, in [ns], each with its crank message; b'' if the drives listen to no topic.

    """
    angles, slides, rates = _Errors(), _Errors(), _Errors()
    known = silent = 0
    for now, message in fed:
        if message:
            true.offer(message, now)
            real.offer(message, now)
        looks = zip(true.closures, true.tick(now).looks, real.tick(now).looks, strict=True)
        for closure, (*_, truth), (*_, reading) in looks:
            if truth is None:
                continue
            known += 1
            silent += reading is None
            if reading is not None:
                _compare(closure.turning, truth, reading, (angles, slides, rates))
    return Departure(angles.both(), slides.both(), rates.both(), silent / known if known else 0.0)


def _compare(
    turning: Sequence[bool],
    truth: SensorReading,
    reading: SensorReading,
    errors: tuple[_Errors, _Errors, _Errors],
) -> None:
    angles, slides, rates = errors
    for turns, there, found in zip(turning, truth.joints, reading.joints, strict=True):
        if turns:
            angles.add(remainder(found - there, tau))
        else:
            slides.add(found - there)
    if truth.rates and reading.rates:
        for there, found in zip(truth.rates, reading.rates, strict=True):
            rates.add(found - there)


Row = tuple[str, Times | None, Departure | None, str]
"""An effect: its name, what it adds to a tick, what it makes of the truth, and a remark."""

WHOLE = 'a tick of the scene'
_RATES = Names({'velocity'})


def measure_effects(scene: Scene, quick: bool, progress: Progress) -> Part | None:
    """
    Measure the effects of a scene; None if it has none.

    A FileError says which parts of the scene cannot be combined.
    """
    named = Names(name for member in scene.members for name in member.effects)
    named |= faults_of(scene)
    if not named:
        return None
    progress(0.0)
    ticks = 2_000 if quick else 10_000
    cost = measure(scene, ticks, leave_out=False)
    assert cost is not None, 'nobody has stopped it'
    progress(0.6)
    variants = Variants(scene)

    def departs(names: Names) -> Departure:
        true = variants.pipeline(_RATES)
        return departure(true, variants.pipeline(names), islice(feed(scene, true), ticks))

    rows: list[Row] = []
    for number, effect in enumerate(cost.effects, 1):
        found = None
        if effect.adds is not None and effect.name not in faults_of(scene):
            found = departs(Names({effect.name, effect.beside} - {''}))
        rows.append((effect.name, effect.adds, found, _remark(effect)))
        progress(0.6 + 0.4 * number / (len(cost.effects) + 1))
    rows.append((WHOLE, cost.whole, departs(named - faults_of(scene)), ''))
    progress(1.0)
    return part_of(cost, rows, ticks)


def part_of(cost: SceneCost, rows: Sequence[Row], ticks: int) -> Part:
    """Return the results as a part of the page."""
    return Part(
        'effects',
        'What each effect costs, and what it makes of the truth',
        _headline(cost),
        list(_sentences(rows)),
        _method(ticks),
        [diagram] if (diagram := _diagram(rows)).curves else [],
        [_table(cost, rows)],
    )


def _table(cost: SceneCost, rows: Sequence[Row]) -> Table:
    whole = cost.whole.median
    lines: list[tuple[float | str | Spread | None, ...]] = [
        ('a tick without effects', _spread(cost.bare), 100.0 * cost.bare.median / whole)
        + (None,) * 7
        + ('',)
    ]
    for name, times, found, remark in rows:
        lines.append(
            (
                name,
                _spread(times) if times else None,
                100.0 * times.median / whole if times else None,
                *_pair(found and found.angles),
                *_pair(found and found.slides),
                *_pair(found and found.rates),
                100.0 * found.silent if found else None,
                remark,
            )
        )
    return Table(
        'effects',
        'What each effect adds to a tick and to the truth',
        (
            'effect',
            'adds to a tick [µs]',
            'of the tick [%]',
            'angles, rms error [rad]',
            'angles, greatest [rad]',
            'slides, rms error [m]',
            'slides, greatest [m]',
            'rates, rms error [rad/s or m/s]',
            'rates, greatest [rad/s or m/s]',
            'silent ticks [%]',
            'remark',
        ),
        lines,
    )


def _diagram(rows: Sequence[Row]) -> Diagram:
    """Return the error of positions against cost, without effects that change no angle."""
    curves = [
        Curve(name, [Point(times.median, found.angles[0], _spread(times))], joined=False)
        for name, times, found, _ in rows
        if times and found and found.angles and found.angles[0] > 0.0
    ]
    return Diagram(
        'effects',
        'What an effect makes of the published angles, against what it adds to a tick',
        Axis('adds to the time of a tick', 'µs', logarithmic=False),
        Axis('rms error of the published angles', 'rad'),
        curves,
    )


def _headline(cost: SceneCost) -> str:
    dearest = max(
        (effect for effect in cost.effects if effect.adds),
        key=lambda effect: effect.adds.median if effect.adds else 0.0,
        default=None,
    )
    said = f'A tick takes {cost.whole.median:.3g} µs, {cost.bare.median:.3g} µs without effects'
    if dearest is not None and dearest.adds:
        said += f'; {dearest.name} adds {dearest.adds.median:.2g} µs'
    return f'{said}.'


def _sentences(rows: Sequence[Row]) -> Iterator[str]:
    """Yield what all effects together and the largest of them make of the truth."""
    changed = {
        name: found.angles[0] for name, _, found, _ in rows if found and found.angles is not None
    }
    *others, (_, _, whole, _) = rows
    assert whole is not None, 'the whole scene was compared'
    if changed.get(WHOLE):
        yield f'Together they put the published angles {changed[WHOLE]:.2g} rad (rms) off.'
    single = {name: error for name, *_ in others if (error := changed.get(name, 0.0))}
    if single:
        most = max(single, key=single.__getitem__)
        yield f'{most} alone changes the angles most: by {single[most]:.2g} rad (rms).'
    else:
        yield 'No effect alone changes an angle: they add to the message, or act on other values.'
    if whole.silent:
        yield f'At {whole.silent:.0%} of the ticks nothing is published.'


def _method(ticks: int) -> list[str]:
    how = (
        f'Each effect was put alone, with what it starts from, on the scene without effects; all '
        f'variants ticked in turn, {ticks:,} ticks each in blocks of 100, over the same times and '
        'crank messages, in process and without a graph. A time is the difference of medians, '
        'with the quartiles of the differences of blocks.'
    )
    what = (
        'The truth is the linkage as it is drawn, solved in closed form at the crank as the drive '
        'has it at the time of the tick. An error is what is published less the truth, over all '
        'joints that turn, that slide, and over all rates. Random effects have the '
        "scene's own seed. Faults are timed while none is injected."
    )
    return [how, what]


def _remark(effect: EffectCost) -> str:
    if effect.adds is None:
        return 'cannot be measured alone'
    return f'beside {effect.beside}, without which it acts on nothing' if effect.beside else ''


def _spread(times: Times) -> Spread:
    return Spread(times.low, times.median, times.high)


def _pair(errors: tuple[float, float] | None) -> tuple[float | None, float | None]:
    return errors or (None, None)
