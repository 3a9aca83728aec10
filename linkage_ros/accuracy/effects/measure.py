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


"""What each effect of a scene adds to the time of a tick, and what it makes of the truth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import islice

from linkage_ros.accuracy.effects.departure import Departure, departure
from linkage_ros.accuracy.results import Axis, Curve, Diagram, Part, Point, Table
from linkage_ros.accuracy.spread import Spread
from linkage_ros.cost.feed import feed
from linkage_ros.cost.measure import EffectCost, measure, SceneCost, Times
from linkage_ros.cost.variants import faults_of, Names, Variants
from linkage_ros.scene.scene import Scene

WHOLE = 'a tick of the scene'
_RATES = Names({'velocity'})


def measure_effects(scene: Scene, quick: bool, told: Callable[[str, float], None]) -> Part | None:
    """
    Measure the effects of a scene; nothing where it has none.

    Parameters
    ----------
    scene
        The scene.
    quick
        Whether a few seconds are to do.
    told
        Takes what is done and how much of it, 0 to 1, now and then.

    Raises
    ------
    FileError
        Where something in the scene does not go together.

    """
    named = Names(name for member in scene.members for name in member.effects)
    named |= faults_of(scene)
    if not named:
        return None
    told('effects', 0.0)
    ticks = 2_000 if quick else 10_000
    cost = measure(scene, ticks, leave_out=False)
    assert cost is not None, 'nobody has stopped it'
    told('effects', 0.6)
    variants = Variants(scene)

    def departs(names: Names) -> Departure:
        true = variants.pipeline(_RATES)
        return departure(true, variants.pipeline(names), islice(feed(scene, true), ticks))

    rows: list[tuple[str, Times | None, Departure | None, str]] = []
    for number, effect in enumerate(cost.effects, 1):
        found = None
        if effect.adds is not None and effect.name not in faults_of(scene):
            found = departs(Names({effect.name, effect.beside} - {''}))
        rows.append((effect.name, effect.adds, found, _remark(effect)))
        told('effects', 0.6 + 0.4 * number / (len(cost.effects) + 1))
    rows.append((WHOLE, cost.whole, departs(named - faults_of(scene)), ''))
    told('effects', 1.0)
    return Part(
        'effects',
        'What each effect costs, and what it makes of the truth',
        _text(cost, ticks),
        [diagram] if (diagram := _diagram(rows)).curves else [],
        [_table(cost, rows)],
    )


def _table(
    cost: SceneCost, rows: Sequence[tuple[str, Times | None, Departure | None, str]]
) -> Table:
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


def _diagram(rows: Sequence[tuple[str, Times | None, Departure | None, str]]) -> Diagram:
    """Return what is told of positions, by what it costs; what changes no angle is not in it."""
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


def _text(cost: SceneCost, ticks: int) -> list[str]:
    dearest = max(
        (effect for effect in cost.effects if effect.adds),
        key=lambda effect: effect.adds.median if effect.adds else 0.0,
        default=None,
    )
    said = (
        f'A tick of the scene takes {cost.whole.median:.2f} µs, without its effects '
        f'{cost.bare.median:.2f} µs.'
    )
    if dearest is not None and dearest.adds:
        said += f' {dearest.name} adds most: {dearest.adds.median:.2f} µs.'
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
    return [said, how, what]


def _remark(effect: EffectCost) -> str:
    if effect.adds is None:
        return 'cannot be measured alone'
    return f'beside {effect.beside}, without which it acts on nothing' if effect.beside else ''


def _spread(times: Times) -> Spread:
    return Spread(times.low, times.median, times.high)


def _pair(errors: tuple[float, float] | None) -> tuple[float | None, float | None]:
    return errors or (None, None)
