# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The error that the step of a torque drive makes, for its methods and steps.

The drive runs as in the node, with the same commands at the same times, and its joints at the
ticks are compared with the exact ones. These come from `linkage_ros.tools.study.exact_drive`, and
their own error from a second run at ten times the tolerance: it falls as the power 7/8 of the
tolerance at least, so a sixth of the difference is at least the error of the first. Where
scipy is not installed, a winding adds a state or there are several inputs, the exact motion is
that of the drive itself at a sixteenth of its step, or what there is time for, by rk4 if its own
method is of order 1; its own error is a third of the difference from twice that step, as for a
method of order 2.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from math import inf
from time import process_time
from typing import Any

from linkage_ros.dynamics import METHODS
from linkage_ros.errors import DefinitionError
from linkage_ros.messages import NANOSECONDS
from linkage_ros.stages.drives import TorqueDrive
from linkage_ros.tools.study.budget import JointError, Knob, Price, Setting
from linkage_ros.tools.study.measuring import Candidate, Progress, time_in_turn
from linkage_ros.tools.study.member_motion import (
    build_drive,
    Crank,
    cranks_at,
    draw_ticks,
    error_of,
    joint_distances,
    joints_at,
    LinkageMotion,
    refuse_horizon,
)
import numpy as np

NAME = 'step of the drive'

_TICKS = 500
"""Ticks at which joints are compared, at most."""

_FACTORS = (4.0, 2.0, 1.0, 0.5, 0.25)
_LONGEST, _SHORTEST = 0.1, 1e-6
"""Bounds of a step, in [s]."""

_UNSURE = 1e-3
"""Where the exact motion itself is known no better than this, in [rad], it cannot be foretold."""

_EVALUATIONS = {'semi_implicit_euler': 1.0, 'rk4': 4.0, 'gauss_legendre': 14.0}
"""Evaluations of the equation of motion in a step, about."""


def measure_drive_step(
    motion: LinkageMotion,
    rate: float,
    horizon: float,
    *,
    key: str = 'drive.torque',
    quick: bool = False,
    seconds: float = inf,
    progress: Progress = lambda _: None,
) -> tuple[Knob, list[str]]:
    """
    Return the errors of methods and steps, and what was left out for lack of time.

    The linkage has a torque drive; ``key`` is its key in the scene. The rate is in [Hz],
    ``horizon`` is the duration of the run, in [s], and ``seconds`` the processor time that the
    measurement may take. A ``quick`` measurement has few settings; ``progress`` gets the fraction
    that is done.

    A LinkageError is raised if the input runs away, or stops at a toggle, before the horizon.
    """
    begun = process_time()
    use: TorqueDrive = motion.scene_linkage.drive[1]
    ticks = draw_ticks(rate, horizon, _TICKS)
    own = cranks_at(motion, ticks)
    taken = process_time() - begun
    # However little time it has, it repeats some runs.
    span, time = (0.2, 0.3) if quick else (1.0, 2.0)
    price = _measure_price(motion, rate, min(horizon, span), time)
    slower = _EVALUATIONS[_exact_method(use)] / _EVALUATIONS[use.method]
    finest = next((n for n in (16, 8) if 1.5 * n * slower * taken <= seconds), 4)
    exact, doubt = exact_cranks(motion, ticks, finest)
    joints, _ = joints_at(motion.closure, exact)
    floor = doubt or JointError(0.0, 0.0)
    settings = [
        Setting(
            _setting_label(use.method, use.step), _measure_error(motion, own, joints, floor), price
        ),
    ]
    left_out: list[str] = []
    wanted = list(_other_settings(use, quick))
    for index, (method, step) in enumerate(wanted):
        progress((index + 1) / (len(wanted) + 1))
        work = taken * _EVALUATIONS[method] / _EVALUATIONS[use.method] * use.step / step
        if process_time() - begun + work > seconds:
            left_out.append(_setting_label(method, step))
            continue
        try:
            cranks = cranks_at(motion, ticks, method=method, step=step)
        except DefinitionError:
            continue  # The scene refuses a step that is too long for its forces.
        changes: list[tuple[str, object]] = (
            [(f'{key}.method', method)] if method != use.method else []
        )
        changes += [(f'{key}.step', step)] if step != use.step else []
        error = _measure_error(motion, cranks, joints, floor)
        settings.append(Setting(_setting_label(method, step), error, None, changes))
    progress(1.0)
    note = motion.note
    if _stands_in(motion):
        note += f'; for the exact motion stands the drive at 1/{finest} of its step by '
        note += f'{_exact_method(use)}, known to {floor.worst:.1g} rad'
    if floor.worst > _UNSURE:
        note += f'; two motions that are nearly equal part: this one is known to {floor.worst:.1g}'
    if left_out:
        left_out = [f'for lack of time: {"; ".join(left_out)}']
    return Knob(NAME, settings, 0, horizon, note=note), left_out


def _measure_price(motion: LinkageMotion, rate: float, horizon: float, seconds: float) -> Price:
    """Return what the drive takes of a tick, with its commands."""
    period = NANOSECONDS / rate
    ticks = [round(index * period) for index in range(1, max(2, int(horizon * rate)))]

    def run() -> None:
        cranks_at(motion, ticks)

    (spread,) = time_in_turn([Candidate(run, len(ticks))], seconds)
    return Price(spread.scale(1e6), rate)


def exact_cranks(
    motion: LinkageMotion, times: Sequence[int], finest: int = 16
) -> tuple[list[Crank | None], JointError | None]:
    """
    Return the exact motion at some times, in [ns], and its own error.

    Where the drive itself stands in for it, its step is divided by ``finest``. A
    LinkageError is raised if the motion ends before the last time.
    """
    use: TorqueDrive = motion.scene_linkage.drive[1]
    if _stands_in(motion):
        steps = (max(_SHORTEST, use.step / finest), max(2.0 * _SHORTEST, 2.0 * use.step / finest))
        method = _exact_method(use)
        coarse, fine = (cranks_at(motion, times, method=method, step=step) for step in steps)
        part = 3.0
    else:
        coarse, fine = (_integrate_exactly(motion, times, factor) for factor in (1.0, 10.0))
        part = 6.0
    doubt = error_of([_distances_to_exact(motion, fine, joints_at(motion.closure, coarse)[0])])
    return coarse, doubt and JointError(doubt.rms / part, doubt.worst / part)


def _stands_in(motion: LinkageMotion) -> bool:
    """Return whether the drive itself, with a short step, stands in for the exact motion."""
    motor = motion.scene_linkage.drive[1].for_input(motion.closure.input_names[0]).motor
    wound = motor is not None and motor.inductance > 0.0
    return wound or len(motion.closure.input_names) > 1 or find_spec('scipy') is None


def _exact_method(use: TorqueDrive) -> str:
    """Return the method by which the drive stands in for the exact motion."""
    return use.method if METHODS[use.method].order > 1 else 'rk4'


def _integrate_exactly(
    motion: LinkageMotion, times: Sequence[int], factor: float
) -> list[Crank | None]:
    from linkage_ros.tools.study import exact_drive  # local import: scipy is optional

    drive = build_drive(motion)
    use: TorqueDrive = motion.scene_linkage.drive[1]
    motor = use.for_input(motion.closure.input_names[0]).motor
    changes: list[tuple[float, float | None]] = [(0.0, None)]
    delay = motor.delay if motor else 0.0
    for command in motion.commands:
        at = command.time * 1e-9 + delay
        if len(changes) > 1 and at > changes[-1][0] + use.timeout:
            changes.append((changes[-1][0] + use.timeout, None))
        (effort,) = command.efforts
        changes.append((at, effort))
    if motion.commands:
        changes.append((changes[-1][0] + use.timeout, None))
    acting = [
        exact_drive.AppliedEffort(at, *drive.actuation_for(effort)) for at, effort in changes
    ]
    seconds = [time * 1e-9 for time in times]
    try:
        states = exact_drive.exact_motion(
            drive.motion, acting, seconds, exact_drive.TOLERANCE * factor
        )
    except exact_drive.NoMotionError as error:
        raise refuse_horizon(error.time, 'its exact motion ends') from None
    return [((value,), (rate,)) for value, rate in states]


def _distances_to_exact(motion: LinkageMotion, cranks: Sequence[Crank | None], exact: Any) -> Any:
    return joint_distances(motion.closure, joints_at(motion.closure, cranks)[0], exact)


def _measure_error(
    motion: LinkageMotion, cranks: Sequence[Crank | None], exact: Any, floor: JointError
) -> JointError:
    """Return the error of a run, no less than what the exact motion is known to."""
    error = error_of([_distances_to_exact(motion, cranks, exact)])
    if error is None:
        return JointError(np.nan, np.nan)
    return JointError(max(error.rms, floor.rms), max(error.worst, floor.worst))


def _other_settings(use: TorqueDrive, quick: bool) -> Iterator[tuple[str, float]]:
    """Yield other methods and steps, those that tell most first."""
    own = [(use.method, use.step * factor) for factor in (0.5, 2.0)]
    others = [(method, use.step) for method in METHODS if method != use.method]
    yield from (s for s in (*own, *others) if _SHORTEST <= s[1] <= _LONGEST)
    if quick:
        return
    rest = [(method, use.step * factor) for method in METHODS for factor in _FACTORS]
    known = {*own, *others, (use.method, use.step)}
    yield from (s for s in rest if s not in known and _SHORTEST <= s[1] <= _LONGEST)


def _setting_label(method: str, step: float) -> str:
    return f'{method}, {1e3 * step:g} ms'
