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


"""What the steps of the torque drive cost: error and drift against time, for each method."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from math import log10

from linkage_ros.accuracy.dynamics.energy_integral import NoReferenceError
from linkage_ros.accuracy.dynamics.free_motion import (
    free_motion,
    FreeMotion,
    integrate,
    Integrated,
    SECONDS,
)
from linkage_ros.accuracy.results import Axis, Curve, Diagram, Part, Point, Table
from linkage_ros.accuracy.spread import Spread, spread_of
from linkage_ros.dynamics.integrators.method import METHODS
from linkage_ros.scene.scene import Member, Scene

STEPS = {
    'semi_implicit_euler': (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4),
    'rk4': (2e-2, 1e-2, 5e-3, 2e-3, 1e-3, 5e-4),
    'gauss_legendre': (5e-2, 2e-2, 1e-2, 5e-3, 2e-3, 1e-3),
}
"""For each method lengths of its step, in [s]."""

_QUICK = 4
"""How many of them where a few seconds are to do, the longest first."""

_ROUNDED = 1e-11
_WANTED = (1e-2, 1e-4, 1e-6, 1e-8)
_ROUNDS = 3


def measure_dynamics(scene: Scene, quick: bool, told: Callable[[str, float], None]) -> Part | None:
    """
    Measure the integration of a scene's first linkage that a torque drives; nothing without one.

    Parameters
    ----------
    scene
        The scene.
    quick
        Whether a few seconds are to do.
    told
        Takes what is done and how much of it, 0 to 1, now and then.

    """
    driven = [member for member in scene.members if member.drive[0] == 'torque']
    if not driven:
        return None
    told('dynamics', 0.0)
    member = driven[0]
    title = 'What the steps of the torque drive cost'
    try:
        motion = free_motion(member)
    except NoReferenceError as error:
        return Part('dynamics', title, [f'Not measured: {error}.'])
    told('dynamics', 0.2)
    settings = _settings(member, quick)
    found = {setting: integrate(motion, *setting) for setting in settings}
    rounds = 1 if quick else _ROUNDS
    for number in range(1, rounds):
        told('dynamics', 0.2 + 0.8 * number / rounds)
        # There and back again, so that a drift of the machine favours no one.
        for setting in reversed(settings) if number % 2 else settings:
            once = found[setting]
            again = integrate(motion, *setting)
            found[setting] = once._replace(times=[*once.times, *again.times])
    told('dynamics', 1.0)
    results = list(found.values())
    drive = member.drive[1]
    own = found[drive.method, drive.step]
    return Part(
        'dynamics',
        title,
        _text(motion, own, rounds),
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


def _settings(member: Member, quick: bool) -> list[tuple[str, float]]:
    """Return methods and steps, those of the scene among them."""
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
                times = Spread(*(1e3 * time for time in spread_of(result.times)))
                points.append(
                    Point(
                        times.middle,
                        value(result),
                        times,
                        setting=f'step {1e3 * result.step:g} ms',
                    )
                )
        curves.append(Curve(method, points))
    time = Axis('processor time for a second of motion', 'ms')
    return Diagram(key, title, time, axis, curves)


def _table(results: Sequence[Integrated], unit: str) -> Table:
    return Table(
        'dynamics',
        f'A free motion of {SECONDS:g} s, integrated',
        (
            'method',
            'step [ms]',
            'time for a second of motion [ms]',
            f'error of the input [{unit}]',
            'greatest error of the energy [of its range]',
        ),
        [
            (
                result.method,
                1e3 * result.step,
                Spread(*(1e3 * time for time in spread_of(result.times))),
                result.error,
                result.drift,
            )
            for result in results
        ],
    )


def _slopes(results: Sequence[Integrated]) -> Table:
    rows: list[tuple[str | int | float | None, ...]] = []
    for method in STEPS:
        own = [result for result in results if result.method == method]
        rows.append(
            (
                method,
                import_module(METHODS[method]).ORDER,
                slope([(result.step, result.error) for result in own]),
                slope([(result.step, result.drift) for result in own]),
            )
        )
    return Table(
        'dynamics_slopes',
        'By which power of the step errors fall',
        ('method', 'its order', 'of the error', 'of the energy'),
        rows,
    )


def slope(errors: Sequence[tuple[float, float]]) -> float | None:
    """
    Return by which power of the step an error falls, between the two shortest steps that tell it.

    Errors near what rounding does tell nothing.

    Parameters
    ----------
    errors
        Steps, from the longest on, and errors.

    """
    points = [(log10(step), log10(error)) for step, error in errors if error > _ROUNDED]
    if len(points) < 2:
        return None
    (x1, y1), (x2, y2) = points[-2:]
    return (y2 - y1) / (x2 - x1)


def _text(motion: FreeMotion, own: Integrated, rounds: int) -> list[str]:
    time = 1e3 * spread_of(own.times).middle
    said = (
        f'As the scene has it, {own.method} with steps of {1e3 * own.step:g} ms, '
        f'{SECONDS:g} s of free motion end {own.error:.2g} {motion.unit} off, the energy drifts '
        f'by {own.drift:.2g} of its range, and a second of motion takes {time:.3g} ms of a '
        'processor.'
    )
    how = (
        f'The linkage moved for {SECONDS:g} s under its weight and springs alone, without '
        f'friction, dampers and commands: {motion.words}. Where it then is, is known from its '
        'energy by an integral, not from steps: summed in 40 digits over its links, whose places '
        'come from the same reference as those of the first part.'
    )
    times = (
        f'All methods and steps ran in turn, {rounds} times; looks at the energy are not timed.'
    )
    return [said, how, times]


def _advice(results: Sequence[Integrated], unit: str) -> Iterator[str]:
    """Yield for some accuracies what takes the least time."""
    for wanted in _WANTED:
        enough = [result for result in results if result.error <= wanted]
        words = f'For {wanted:g} {unit} after {SECONDS:g} s'
        if not enough:
            yield f'{words}: none of these steps will do.'
            continue
        best = min(enough, key=lambda result: spread_of(result.times).middle)
        yield (
            f'{words}: {best.method} with steps of {1e3 * best.step:g} ms, '
            f'{1e3 * spread_of(best.times).middle:.3g} ms for a second of motion.'
        )
