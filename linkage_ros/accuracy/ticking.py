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
Effect of the tick rate: the error of the state that a subscriber has when it uses it.

A node and a subscriber run in processes of their own and communicate over DDS, in a domain of
their own; no message leaves the machine. The crank moves so that a stale state shows: by a chirp,
and by a constant acceleration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib.util import find_spec
import json
from math import sqrt
import os
from pathlib import Path
import tempfile
from time import monotonic
from typing import NamedTuple

from linkage_ros.accuracy.results import Axis, Curve, Diagram, Part, Point, Rate, Table
from linkage_ros.drives.chirp import Chirp, curve
from linkage_ros.errors import LinkageError
from linkage_ros.files.linkage_text import linkage_text
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.kinematics.sweep_analysis import InputSweep, usual_inputs
from linkage_ros.measuring import Progress, spread_of
from linkage_ros.messages.layout import NANOSECONDS
from linkage_ros.processes import Graph, MeasurementError, private_domain
from linkage_ros.scene.scene import Scene

CHIRP, ACCELERATION = 'chirp', 'constant acceleration'

_FREQUENCIES = (0.2, 5.0)  # [Hz]
_SWING = 1.0  # [rad]
_GROWTH = 10.0  # [rad/s²]
_PART = 0.8
"""Fraction of its range through which an input moves if it cannot turn fully."""

CrankAt = Callable[[int], tuple[float, float]]
"""Value and rate of the input, in [rad] or [m], and per [s], at a time since the start in [ns]."""


class Motions(NamedTuple):
    """The motions of a linkage's input."""

    by_name: Mapping[str, CrankAt]  # `CHIRP` and `ACCELERATION`
    # For each the maximum rate and acceleration of the input, in [rad/s] and [rad/s²], or [m].
    greatest: Mapping[str, tuple[float, float]]


def motions_of(closure: Closure, seconds: float) -> Motions:
    """Return motions of some seconds each, within the range where the loops of one input close."""
    (start,) = usual_inputs(closure)
    widest = InputSweep(closure).widest_range
    length = round(seconds * NANOSECONDS)
    middle, swing, begin, growth = start, _SWING, start, _GROWTH
    if widest is not None and not widest.whole:
        width = widest.highest - widest.lowest
        middle, swing = widest.lowest + 0.5 * width, min(swing, 0.5 * _PART * width)
        begin = widest.lowest + 0.5 * (1.0 - _PART) * width
        growth = min(growth, 2.0 * _PART * width / seconds**2)
    sweep = curve(Chirp(swing, *_FREQUENCIES, seconds, middle, 'linear', repeat=False))

    def chirp(time: int) -> tuple[float, float]:
        value, rate, _ = sweep(min(max(time, 0), length - 1))
        return value, rate

    def accelerated(time: int) -> tuple[float, float]:
        t = min(max(time, 0), length) * 1e-9
        return begin + 0.5 * growth * t * t, growth * t

    steps = [sweep(length * k // 4000) for k in range(4000)]
    return Motions(
        {CHIRP: chirp, ACCELERATION: accelerated},
        {
            CHIRP: (max(abs(s[1]) for s in steps), max(abs(s[2]) for s in steps)),
            ACCELERATION: (growth * seconds, growth),
        },
    )


HELD, CARRIED = 'held', 'carried forward'
"""How a state is used: unchanged, or extrapolated by its rates from its stamp to now."""

CRANK_RATE = 1000.0
USE_RATE = 500.0
"""Samples of the crank, and uses of a state, per second."""

_LINKAGE_FILE, _SCENE_FILE = 'linkage.yaml', 'ticking.yaml'
_PATIENCE = 30.0  # [s]


class Used(NamedTuple):
    """The states that a subscriber used, at one tick rate and in one motion of the crank."""

    rate: float  # Tick rate, in [Hz]
    motion: str  # Motion of the crank
    age: Sequence[float]  # Age of the states when used, in [s]
    # By `HELD` and `CARRIED`: for each use the maximum error of a joint.
    errors: dict[str, Sequence[float]]
    unused: int  # Number of uses before the first state arrived
    cpu: float  # Processor time of the node, as a fraction of a core


def use_states(folder: Path, linkage: Linkage, rate: float, seconds: float) -> list[Used]:
    """
    Run a node at a rate in [Hz], and a subscriber that uses its states; a motion takes seconds.

    The folder is empty, for their files. A LinkageError says that one of the two failed.
    """
    inputs = {given.joint for given in linkage.inputs}
    joints = {name: joint for name, joint in linkage.joints.items() if name not in inputs}
    published = 'true' if len(joints) < len(linkage.joints) else 'false'
    text = linkage_text(replace(linkage, joints=joints))
    (folder / _LINKAGE_FILE).write_text(text, 'utf-8')
    scene = folder / _SCENE_FILE
    scene.write_text(
        f'linkage: {_LINKAGE_FILE}\nrate: {rate:g}\ndrive: {{topic: {{}}}}\n'
        f'publish_input: {published}\neffects: {{velocity: {{}}}}\n',
        'utf-8',
    )
    task = {
        'scene': str(scene),
        'seconds': seconds,
        'crank_rate': CRANK_RATE,
        'use_rate': USE_RATE,
    }
    graph = Graph(private_domain(), folder)
    arguments = ('--ros-args', '-p', f'scene:={scene}')
    found = []
    with (
        _in_one_line(),
        graph.run('linkage_ros.node.linkage_node', arguments) as server,
        graph.run('linkage_ros.node.staleness_probe', [json.dumps(task)]) as consumer,
    ):
        for _ in range(2):
            consumer.read(_PATIENCE)
            begun, spent = monotonic(), _processor_time(server.pid)
            said = consumer.read(_PATIENCE)
            spent = _processor_time(server.pid) - spent
            found.append(
                Used(
                    rate,
                    said['motion'],
                    [age * 1e-9 for age in said['ages']],
                    {HELD: said['held'], CARRIED: said['carried']},
                    said['unused'],
                    spent / (monotonic() - begun),
                )
            )
    if not all(used.age for used in found):
        raise LinkageError(str(scene), 'no joint state came', 'see that DDS works on this machine')
    return found


@contextmanager
def _in_one_line() -> Iterator[None]:
    """Turn a failure of a process into an error of one line for the user."""
    try:
        yield
    except MeasurementError as error:
        reason = f'node and subscriber did not meet: {error}'
        raise LinkageError('ticking', reason, 'run it by hand') from None


def _processor_time(pid: int) -> float:
    """Return the processor time that a process has used, in [s]."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


RATES = (20, 50, 100, 200, 500, 1000, 2000)
"""Tick rates, in [Hz]."""

QUICK_RATES = (100, 1000)

_WANTED = (1e-1, 1e-2, 1e-3, 1e-4)
_SHOWN = 1e-2
"""The accuracy beside the picture."""

_UNIT = {True: 'rad', False: 'm'}


def measure_ticking(scene: Scene, quick: bool, progress: Progress) -> Part | None:
    """
    Measure the states that a subscriber gets; None without rclpy or with several inputs.

    A LinkageError says that the node or the subscriber failed.
    """
    linkage = scene.members[0].linkage
    if find_spec('rclpy') is None or len(linkage.inputs) > 1:
        return None
    rates = QUICK_RATES if quick else RATES
    seconds = 0.6 if quick else 2.0
    closure = Closure(linkage)
    results: list[Used] = []
    with tempfile.TemporaryDirectory(prefix='linkage_ticking_') as folder:
        for number, rate in enumerate(rates):
            progress(number / len(rates))
            results += use_states(Path(folder), linkage, rate, seconds)
    progress(1.0)
    return part_of(closure, seconds, results)


def part_of(closure: Closure, seconds: float, results: Sequence[Used]) -> Part:
    """Return the results as a part of the page."""
    unit = _UNIT[any(closure.turning)]
    advice = list(_advice(results, unit))
    chosen = (HELD, CARRIED) if unit == _UNIT[True] else ()
    return Part(
        'ticking',
        'What the rate of ticks buys',
        _headline(results, unit),
        [*_gains(results, unit), advice[_WANTED.index(_SHOWN)]],
        _method(closure, seconds),
        [
            _diagram('ticking_rate', 'The faster the ticks, the nearer the state in use', results,
                     unit, Axis('ticks a second', 'Hz'), lambda used: used.rate),
            _diagram('ticking_cpu', 'What that costs the processor', results, unit,
                     Axis('processor time of the node', '% of a core'),
                     lambda used: 100.0 * used.cpu, front=True),
        ],
        [_table(results, unit)],
        advice,
        rates=[
            Rate(rate, max(rms(used.errors[use]) for used in results if used.rate == rate), use)
            for rate in dict.fromkeys(used.rate for used in results)
            for use in chosen
        ],
    )  # fmt: skip


def rms(values: Sequence[float]) -> float:
    """Return the root mean square."""
    return sqrt(sum(value * value for value in values) / len(values))


def _diagram(
    key: str,
    title: str,
    results: Sequence[Used],
    unit: str,
    axis: Axis,
    place: Callable[[Used], float],
    *,
    front: bool = False,
) -> Diagram:
    curves = []
    for motion in dict.fromkeys(used.motion for used in results):
        for way in (HELD, CARRIED):
            chosen = [
                (used, spread_of(used.errors[way])) for used in results if used.motion == motion
            ]
            points = [
                Point(place(used), spread.middle, y_spread=spread, setting=f'{used.rate:g} Hz')
                for used, spread in chosen
            ]
            curves.append(Curve(f'{motion}, {way}', points))
    return Diagram(key, title, axis, Axis('error of a joint when used', unit), curves, front)


def _table(results: Sequence[Used], unit: str) -> Table:
    return Table.of(
        'ticking',
        'The state that a subscriber has, when it uses it',
        results,
        {
            'ticks a second [Hz]': lambda used: used.rate,
            'motion of the crank': lambda used: used.motion,
            'age of the state [ms]': lambda used: spread_of(used.age).scaled(1e3),
            f'held, error [{unit}]': lambda used: spread_of(used.errors[HELD]),
            f'held, rms [{unit}]': lambda used: rms(used.errors[HELD]),
            f'carried forward, error [{unit}]': lambda used: spread_of(used.errors[CARRIED]),
            f'carried forward, rms [{unit}]': lambda used: rms(used.errors[CARRIED]),
            'processor [% of a core]': lambda used: 100.0 * used.cpu,
            'uses': lambda used: len(used.age),
            'before the first state': lambda used: used.unused,
        },
    )


def _headline(results: Sequence[Used], unit: str) -> str:
    slow, fast = (
        max(rms(used.errors[CARRIED]) for used in results if used.rate == rate)
        for rate in (results[0].rate, results[-1].rate)
    )
    return (
        f'From {results[0].rate:g} to {results[-1].rate:g} ticks a second, a state carried '
        f'forward is {slow:.1g} to {fast:.1g} {unit} off.'
    )


def _method(closure: Closure, seconds: float) -> list[str]:
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
    return [how]


def _gains(results: Sequence[Used], unit: str) -> Iterator[str]:
    """Yield for each motion the gain of the highest tick rate over the lowest."""
    slow, fast = results[0].rate, results[-1].rate
    for motion in dict.fromkeys(used.motion for used in results):
        ends = {
            used.rate: used
            for used in results
            if used.motion == motion and used.rate in (slow, fast)
        }
        if len(ends) == 2:
            yield _gain(motion, ends[slow], ends[fast], unit)


def _gain(motion: str, slow: Used, fast: Used, unit: str) -> str:
    """Return the gain of the highest tick rate over the lowest."""
    parts = [
        f'{way} from {rms(slow.errors[way]):.2g} to {rms(fast.errors[way]):.2g} {unit}'
        for way in (HELD, CARRIED)
    ]
    return (
        f'{motion[0].upper()}{motion[1:]}: from {slow.rate:g} to {fast.rate:g} ticks a second the '
        f'rms error falls, {" and ".join(parts)}; the node takes {100.0 * slow.cpu:.0f} % of a '
        f'core, then {100.0 * fast.cpu:.0f} %.'
    )


def _advice(results: Sequence[Used], unit: str) -> Iterator[str]:
    """Yield the lowest tick rate that reaches each of several accuracies, in both motions."""
    for wanted in _WANTED:
        held, carried = (_slowest(results, way, wanted) for way in (HELD, CARRIED))
        words = f'For {wanted:g} {unit} (rms) when used: '
        if carried is None and held is None:
            yield f'{words}none of these rates will do.'
        elif held is None or (carried is not None and carried < held):
            more = f', {held:g} where they are {HELD}' if held else ''
            yield f'{words}{carried:g} ticks a second where states are {CARRIED}{more}.'
        else:
            yield f'{words}{held:g} ticks a second.'


def _slowest(results: Sequence[Used], way: str, wanted: float) -> float | None:
    poor = {used.rate for used in results if rms(used.errors[way]) > wanted}
    return min((used.rate for used in results if used.rate not in poor), default=None)
