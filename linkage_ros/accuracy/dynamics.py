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
Error and energy drift of the torque drive against time, for each method and step.

The test is a motion whose end is known. The linkage moves under its weight and its springs alone:
with other forces there is no reference solution. If its input can turn fully, it starts with
enough rate to keep turning; otherwise it is released where it swings clear of its stops.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import inf, log10, sqrt, tau
from time import perf_counter
from typing import NamedTuple

from linkage_ros.accuracy.energy_integral import (
    ExactEnergy,
    NoReferenceError,
    State,
    swung,
    turned,
)
from linkage_ros.accuracy.results import Axis, Curve, Diagram, Part, Point, Table
from linkage_ros.dynamics.integrators import METHODS
from linkage_ros.dynamics.loads import AppliedLoads, Loads
from linkage_ros.dynamics.mechanics import Mechanics
from linkage_ros.dynamics.motion import Motion, OneFreedom
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.results import InputRange
from linkage_ros.measuring import alternating, Progress, spread_of
from linkage_ros.scene.scene import Scene, SceneLinkage

SECONDS = 10.0

_LOOKS = 100
"""Number of times at which the energy is evaluated."""


class FreeMotion(NamedTuple):
    """A motion without friction, damping and command."""

    mechanics: Mechanics  # The linkage and its loads
    start: State  # State at the start
    end: State  # State after `SECONDS`
    scale: float  # Range of its potential energy, in [J]; a drift is given as a fraction of it
    unit: str  # Unit of the input: 'rad' or 'm'
    words: str  # Description of the motion


class Integrated(NamedTuple):
    """The result of a method with one step."""

    # The method's name, and its step in [s].
    method: str
    step: float
    error: float  # Error of the input after `SECONDS`, in [rad] or [m]
    drift: float  # Greatest error of the energy, as a fraction of the motion's scale
    times: Sequence[float]  # Processor time per second of motion, in [s], one for each round


def free_motion(member: SceneLinkage) -> FreeMotion:
    """
    Return a free motion of a linkage, with its known end.

    A NoReferenceError is raised if no free motion stays off its stops, or has a reference.
    """
    given = member.loads or Loads()
    springs = tuple(replace(spring, damping=0.0) for spring in given.springs)
    loads = replace(given, springs=springs, applied=AppliedLoads())
    closure = Closure(member.linkage)
    mechanics = Mechanics(closure, loads)
    energy = ExactEnergy(member.linkage, loads)
    unit = member.linkage.inputs[0].unit
    start: float = member.drive[1].start
    interval = next((each for each in closure.input_ranges if _holds(each, start)), None)
    if interval is not None and interval.whole:
        places = [start + tau * k / 360 for k in range(360)]
        heights = [_potential(mechanics, place) for place in places]
        climb = max(heights) - heights[0]
        inertia = _inertia(mechanics, start)
        # Three times the energy to pass the highest position, and at least one turn per second.
        rate = max(sqrt(2.0 * 4.0 * climb / inertia), tau)
        begin = State(start, rate)
        scale = 0.5 * inertia * rate * rate + heights[0] - min(heights)
        words = f'its crank turns round, at {rate:.3g} rad/s where it begins'
        return FreeMotion(mechanics, begin, turned(energy, begin, SECONDS), scale, unit, words)
    if interval is None:
        raise NoReferenceError('no loop closes where the drive starts')
    low, high, scale = _swing(mechanics, interval)
    words = f'its input is let go at {low:.4g} {unit} and swings to {high:.4g} {unit}'
    end = swung(energy, low, high, SECONDS)
    return FreeMotion(mechanics, State(low, 0.0), end, scale, unit, words)


def integrate(motion: FreeMotion, method: str, step: float) -> Integrated:
    """Integrate a motion once; the evaluations of its energy are not timed."""
    mechanics = motion.mechanics
    freedom = OneFreedom(mechanics.equation, METHODS[method].step)
    at = freedom.at(*motion.start)
    assert at is not None, 'the reference has moved it'
    whole = _energy(mechanics, at)
    count = round(SECONDS / step)
    looks = {count * k // _LOOKS for k in range(1, _LOOKS + 1)}
    spent = worst = 0.0
    done = 0
    for end in sorted(looks):
        begun = perf_counter()
        for _ in range(end - done):
            at = freedom.advance(at, step, 0.0)
        spent += perf_counter() - begun
        done = end
        worst = max(worst, abs(_energy(mechanics, at) - whole))
    return Integrated(
        method, step, abs(at.value - motion.end.value), worst / motion.scale, [spent / SECONDS]
    )


def _energy(mechanics: Mechanics, at: Motion) -> float:
    return mechanics.energy(mechanics.closure.position(at.value), at.rate)


def _potential(mechanics: Mechanics, value: float) -> float:
    return mechanics.potential(mechanics.closure.position(value))


def _inertia(mechanics: Mechanics, value: float) -> float:
    terms = mechanics.terms(mechanics.closure.position(value))
    if terms is None:
        raise NoReferenceError('nothing can be moved where the drive starts')
    return terms.inertia


def _holds(interval: InputRange, value: float) -> bool:
    if interval.whole:
        return True
    value += interval.shift(value)
    return interval.lowest <= value <= interval.highest


def _swing(mechanics: Mechanics, interval: InputRange) -> tuple[float, float, float]:
    """Return two inputs of equal potential with a lower one between, and its depth in [J]."""
    width = interval.highest - interval.lowest
    places = [interval.lowest + width * k / 1000 for k in range(50, 951)]
    heights = [_potential(mechanics, place) for place in places]
    bottom = min(range(len(heights)), key=heights.__getitem__)
    after = bottom + 1
    sides = max(heights[:bottom], default=-inf), max(heights[after:], default=-inf)
    height = heights[bottom] + 0.5 * (min(sides) - heights[bottom])
    if not height > heights[bottom]:
        raise NoReferenceError('under its weight and springs it falls against a stop')
    low = max(k for k in range(bottom) if heights[k] >= height)
    high = min(k for k in range(after, len(heights)) if heights[k] >= heights[low])
    return places[low], places[high], heights[low] - heights[bottom]


STEPS = {
    'semi_implicit_euler': (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4),
    'rk4': (2e-2, 1e-2, 5e-3, 2e-3, 1e-3, 5e-4),
    'gauss_legendre': (5e-2, 2e-2, 1e-2, 5e-3, 2e-3, 1e-3),
}
"""Steps of each method, in [s]."""

_TITLE = 'What the steps of the torque drive cost'
_QUICK = 4
"""Number of steps in a quick measurement, the longest first."""

_ROUNDED = 1e-11
_WANTED = (1e-2, 1e-4, 1e-6, 1e-8)
_ROUNDS = 3


def measure_dynamics(scene: Scene, quick: bool, progress: Progress) -> Part | None:
    """Measure the integration of the first linkage that a torque drives; None without one."""
    driven = [member for member in scene.members if member.drive[0] == 'torque']
    if not driven:
        return None
    progress(0.0)
    member = driven[0]
    try:
        motion = free_motion(member)
    except NoReferenceError as error:
        return Part('dynamics', _TITLE, f'Not measured: {error}.')
    progress(0.2)
    settings = _settings(member, quick)
    found: dict[tuple[str, float], Integrated] = {}
    rounds = 1 if quick else _ROUNDS
    for done, setting in enumerate(alternating(settings, rounds)):
        progress(0.2 + 0.8 * done / (rounds * len(settings)))
        again = integrate(motion, *setting)
        before = found[setting].times if setting in found else []
        found[setting] = again._replace(times=[*before, *again.times])
    progress(1.0)
    results = list(found.values())
    drive = member.drive[1]
    own = found[drive.method, drive.step]
    return part_of(motion, results, own, rounds)


def part_of(
    motion: FreeMotion, results: Sequence[Integrated], own: Integrated, rounds: int
) -> Part:
    """Return the results, with the method and step of the scene, as a part of the page."""
    return Part(
        'dynamics',
        _TITLE,
        _headline(motion, own),
        list(_sentences(results, own)),
        _method(motion, rounds),
        [
            _diagram(
                'dynamics_error',
                f'The error after {SECONDS:g} s, against the time that it takes',
                Axis('error of the input', motion.unit),
                results,
                lambda result: result.error,
            ),
            _diagram(
                'dynamics_energy',
                'How far the energy drifts, against the time that it takes',
                Axis('greatest error of the energy', 'of its range'),
                results,
                lambda result: result.drift,
            ),
        ],
        [_table(results, motion.unit), _slopes(results)],
        list(_advice(results, motion.unit)),
    )


def _settings(member: SceneLinkage, quick: bool) -> list[tuple[str, float]]:
    """Return methods and steps, with those of the scene."""
    drive = member.drive[1]
    settings = [
        (method, step)
        for method, steps in STEPS.items()
        for step in (steps[:_QUICK] if quick else steps)
    ]
    return sorted(
        {*settings, (drive.method, drive.step)}, key=lambda s: (list(STEPS).index(s[0]), -s[1])
    )


def _diagram(
    key: str,
    title: str,
    axis: Axis,
    results: Sequence[Integrated],
    value: Callable[[Integrated], float],
) -> Diagram:
    curves = []
    for method in STEPS:
        points = []
        for result in results:
            if result.method == method and value(result) > 0.0:
                times = spread_of(result.times).scaled(1e3)
                setting = f'step {1e3 * result.step:g} ms'
                points.append(Point(times.middle, value(result), times, setting=setting))
        curves.append(Curve(method, points))
    time = Axis('processor time for a second of motion', 'ms')
    return Diagram(key, title, time, axis, curves, front=True)


def _table(results: Sequence[Integrated], unit: str) -> Table:
    return Table.of(
        'dynamics',
        f'A free motion of {SECONDS:g} s, integrated',
        results,
        {
            'method': lambda one: one.method,
            'step [ms]': lambda one: 1e3 * one.step,
            'time for a second of motion [ms]': lambda one: spread_of(one.times).scaled(1e3),
            f'error of the input [{unit}]': lambda one: one.error,
            'greatest error of the energy [of its range]': lambda one: one.drift,
        },
    )


def _slopes(results: Sequence[Integrated]) -> Table:
    def errors(method: str, error: Callable[[Integrated], float]) -> list[tuple[float, float]]:
        return [(one.step, error(one)) for one in results if one.method == method]

    return Table.of(
        'dynamics_slopes',
        'By which power of the step errors fall',
        STEPS,
        {
            'method': lambda method: method,
            'its order': lambda method: METHODS[method].order,
            'of the error': lambda method: slope(errors(method, lambda one: one.error)),
            'of the energy': lambda method: slope(errors(method, lambda one: one.drift)),
        },
    )


def slope(errors: Sequence[tuple[float, float]]) -> float | None:
    """
    Return the order of convergence, from the two shortest steps that show it.

    The longest step comes first. Errors near the rounding error do not count.
    """
    points = [(log10(step), log10(error)) for step, error in errors if error > _ROUNDED]
    if len(points) < 2:
        return None
    (x1, y1), (x2, y2) = points[-2:]
    return (y2 - y1) / (x2 - x1)


def _headline(motion: FreeMotion, own: Integrated) -> str:
    return (
        f'{own.method}, {1e3 * own.step:g} ms a step: {own.error:.1g} {motion.unit} off after '
        f'{SECONDS:g} s, for {_milliseconds(own):.2g} ms a second.'
    )


def _milliseconds(one: Integrated) -> float:
    """Return the processor time for a second of motion, in [ms]."""
    return 1e3 * spread_of(one.times).middle


def _sentences(results: Sequence[Integrated], own: Integrated) -> Iterator[str]:
    yield (
        f'That is the setting of the scene; the energy drifts by {own.drift:.1g} of its range, '
        f'and a second of motion takes {_milliseconds(own):.2g} ms of a processor.'
    )
    best = min((one for one in results if one.error <= own.error), key=_milliseconds)
    if best is own:
        yield 'Of all methods and steps measured, none is as exact in less time.'
    else:
        yield (
            f'{best.method} with steps of {1e3 * best.step:g} ms is as exact for '
            f'{_milliseconds(best):.2g} ms.'
        )
    most = min(results, key=lambda one: one.error)
    yield (
        f'The most exact is {most.method} with steps of {1e3 * most.step:g} ms: {most.error:.1g} '
        f'off, for {_milliseconds(most):.2g} ms.'
    )


def _method(motion: FreeMotion, rounds: int) -> list[str]:
    how = (
        f'The linkage moved for {SECONDS:g} s under its weight and springs alone, without '
        f'friction, dampers and commands: {motion.words}. Where it then is, is known from its '
        'energy by an integral, not from steps: summed in 40 digits over its links, whose places '
        'come from the same reference as those of the first part.'
    )
    times = (
        f'All methods and steps ran in turn, {rounds} times; looks at the energy are not timed.'
    )
    return [how, times]


def _advice(results: Sequence[Integrated], unit: str) -> Iterator[str]:
    """Yield the fastest setting for each of several accuracies."""
    for wanted in _WANTED:
        enough = [result for result in results if result.error <= wanted]
        words = f'For {wanted:g} {unit} after {SECONDS:g} s'
        if not enough:
            yield f'{words}: none of these steps will do.'
            continue
        best = min(enough, key=_milliseconds)
        yield (
            f'{words}: {best.method} with steps of {1e3 * best.step:g} ms, '
            f'{_milliseconds(best):.3g} ms for a second of motion.'
        )
