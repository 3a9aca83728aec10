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
What the rate of ticks buys: how far the state that a subscriber has is from the truth when used.

Measured over DDS, between processes, as an application has it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from math import sqrt
from pathlib import Path
import tempfile

from linkage_ros.accuracy.results import Axis, Curve, Diagram, Part, Point, Table
from linkage_ros.accuracy.spread import Spread, spread_of
from linkage_ros.accuracy.ticking.crank_motions import motions_of
from linkage_ros.accuracy.ticking.use_of_states import (
    CARRIED,
    CRANK_RATE,
    HELD,
    USE_RATE,
    use_states,
    Used,
)
from linkage_ros.kinematics.closure import Closure
from linkage_ros.scene.scene import Scene

RATES = (20, 50, 100, 200, 500, 1000, 2000)
"""Ticks a second, in [Hz]."""

QUICK_RATES = (100, 1000)

_WANTED = (1e-1, 1e-2, 1e-3, 1e-4)
_UNIT = {True: 'rad', False: 'm'}


def measure_ticking(scene: Scene, quick: bool, told: Callable[[str, float], None]) -> Part | None:
    """
    Measure what a subscriber gets of a scene's first linkage; nothing without rclpy or one input.

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
    LinkageError
        Where the node or the subscriber does not do its part.

    """
    linkage = scene.members[0].linkage
    if find_spec('rclpy') is None or len(linkage.inputs) > 1:
        return None
    rates = QUICK_RATES if quick else RATES
    seconds = 0.6 if quick else 2.0
    closure = Closure(linkage)
    found: list[Used] = []
    with tempfile.TemporaryDirectory(prefix='linkage_ticking_') as folder:
        for number, rate in enumerate(rates):
            told('ticking', number / len(rates))
            found += use_states(Path(folder), linkage, rate, seconds)
    told('ticking', 1.0)
    unit = _UNIT[any(closure.turning)]
    return Part(
        'ticking',
        'What the rate of ticks buys',
        _text(closure, seconds, found, unit),
        [
            _diagram('ticking_rate', 'The faster the ticks, the nearer the state in use', found,
                     unit, Axis('ticks a second', 'Hz'), lambda used: used.rate),
            _diagram('ticking_cpu', 'What that costs the processor', found, unit,
                     Axis('processor time of the node', '% of a core'),
                     lambda used: 100.0 * used.cpu),
        ],
        [_table(found, unit)],
        list(_advice(found, unit)),
    )  # fmt: skip


def rms(values: Sequence[float]) -> float:
    """Return the root of the mean square."""
    return sqrt(sum(value * value for value in values) / len(values))


def _diagram(
    key: str,
    title: str,
    found: Sequence[Used],
    unit: str,
    axis: Axis,
    place: Callable[[Used], float],
) -> Diagram:
    curves = []
    for motion in dict.fromkeys(used.motion for used in found):
        for way in (HELD, CARRIED):
            chosen = [
                (used, spread_of(used.errors[way])) for used in found if used.motion == motion
            ]
            points = [
                Point(place(used), spread.middle, y_spread=spread, setting=f'{used.rate:g} Hz')
                for used, spread in chosen
            ]
            curves.append(Curve(f'{motion}, {way}', points))
    return Diagram(key, title, axis, Axis('error of a joint when used', unit), curves)


def _table(found: Sequence[Used], unit: str) -> Table:
    return Table(
        'ticking',
        'The state that a subscriber has, when it uses it',
        (
            'ticks a second [Hz]',
            'motion of the crank',
            'age of the state [ms]',
            f'held, error [{unit}]',
            f'held, rms [{unit}]',
            f'carried forward, error [{unit}]',
            f'carried forward, rms [{unit}]',
            'processor [% of a core]',
            'uses',
            'before the first state',
        ),
        [
            (
                used.rate,
                used.motion,
                Spread(*(1e3 * age for age in spread_of(used.age))),
                spread_of(used.errors[HELD]),
                rms(used.errors[HELD]),
                spread_of(used.errors[CARRIED]),
                rms(used.errors[CARRIED]),
                100.0 * used.cpu,
                len(used.age),
                used.unused,
            )
            for used in found
        ],
    )


def _text(closure: Closure, seconds: float, found: Sequence[Used], unit: str) -> list[str]:
    greatest = motions_of(closure, seconds).greatest
    of = {True: 'rad', False: 'm'}[not closure.linkage.inputs[0].slider]
    moves = '; '.join(
        f'{name}: up to {rate:.3g} {of}/s and {acceleration:.3g} {of}/s²'
        for name, (rate, acceleration) in greatest.items()
    )
    how = (
        'The node ran the linkage with its rates, in a process of its own; another process turned '
        f'its crank ({CRANK_RATE:g} samples a second over DDS; {moves}), and at random instants, '
        f'{USE_RATE:g} a second, used the newest joint state that had come: held as it was, or '
        'carried forward by its rates from its stamp to the instant of use. The error is that of '
        'the worst joint against the linkage solved at the exact crank of that instant. So it has '
        'all in it: the crank sample on its way, the wait for the tick, the tick, the way back.'
    )
    slow, fast = found[0].rate, found[-1].rate
    said = []
    for motion in greatest:
        ends = {
            used.rate: used
            for used in found
            if used.motion == motion and used.rate in (slow, fast)
        }
        if len(ends) == 2:
            said.append(_gain(motion, ends[slow], ends[fast], unit))
    return [how, *said]


def _gain(motion: str, slow: Used, fast: Used, unit: str) -> str:
    """Return what the fastest ticks gain over the slowest."""
    parts = [
        f'{way} from {rms(slow.errors[way]):.2g} to {rms(fast.errors[way]):.2g} {unit}'
        for way in (HELD, CARRIED)
    ]
    return (
        f'{motion[0].upper()}{motion[1:]}: from {slow.rate:g} to {fast.rate:g} ticks a second the '
        f'rms error falls, {" and ".join(parts)}; the node takes {100.0 * slow.cpu:.0f} % of a '
        f'core, then {100.0 * fast.cpu:.0f} %.'
    )


def _advice(found: Sequence[Used], unit: str) -> Iterator[str]:
    """Yield for some accuracies the slowest ticks that give it, in both motions."""
    for wanted in _WANTED:
        held, carried = (_slowest(found, way, wanted) for way in (HELD, CARRIED))
        words = f'For {wanted:g} {unit} (rms) when used: '
        if carried is None and held is None:
            yield f'{words}none of these rates will do.'
        elif held is None or (carried is not None and carried < held):
            more = f', {held:g} where they are {HELD}' if held else ''
            yield f'{words}{carried:g} ticks a second where states are {CARRIED}{more}.'
        else:
            yield f'{words}{held:g} ticks a second.'


def _slowest(found: Sequence[Used], way: str, wanted: float) -> float | None:
    poor = {used.rate for used in found if rms(used.errors[way]) > wanted}
    return min((used.rate for used in found if used.rate not in poor), default=None)
