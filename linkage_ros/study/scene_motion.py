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
The motion that a scene makes: its inputs at any time, and the joints that belong to them.

A drive that computes its crank is asked itself. A `topic` drive has no motion of its own: it is
said what its crank does, by a sine or by the samples of a bag. To a `torque` drive commands come:
those of a bag, or a sine of effort; without either it moves by its start, weight and loads alone.

Whatever noise, delay or fault the scene adds is no part of its motion: that is asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import cos, pi, sin, tau
from typing import Any

from linkage_ros.bag.reader import Bag, read_bag
from linkage_ros.drives.drive import CrankState
from linkage_ros.drives.torque import TorqueDrive
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.sweep_analysis import InputSweep, usual_inputs
from linkage_ros.messages.joint_state import EffortCommand
from linkage_ros.messages.layout import NANOSECONDS
from linkage_ros.pipeline.pipeline import LinkagePipeline, Pipeline
from linkage_ros.scene.scene import Scene, SceneLinkage
from linkage_ros.study.member_motion import Command, Crank, MemberMotion, Path
from linkage_ros.study.prices import USUAL_RATE
from linkage_ros.study.recorded_motion import follow_commands, follow_samples

BEGIN = NANOSECONDS
"""Time of the first tick, in [ns]."""

SINE = 'sine'
"""What ``like`` is for a sine; anything else is the path of a bag."""

COMMAND_PERIOD = 0.05
"""Longest time between two commands of a torque drive, in [s]."""

_FREQUENCY, _AMPLITUDE, _PART = 0.5, pi, 0.4
"""
Of the sine of a crank, in [Hz] and [rad]; for a limited one, as a fraction of its range.

So a crank that turns passes through all its poses, some 1.6 turns a second at most.
"""

_LOOK = 2e-3
"""Time between two looks at a torque drive, in [s], or its step if that is longer."""

_BEYOND = 0.5 * pi
"""A step over more than this, in [rad], follows no motion: the input runs away."""

_STANDS = 1e-9
"""Motions smaller than this, in [rad] or [m], are none."""


def motions_of(scene: Scene, like: str | None, horizon: float) -> list[MemberMotion]:
    """
    Return what the linkages of a scene do.

    Parameters
    ----------
    scene
        The scene.
    like
        `SINE`, or the path of a bag with the samples or commands; None for the scene's own.
    horizon
        How long it is looked at, in [s].

    Raises
    ------
    LinkageError
        A topic drive has no motion; a bag cannot be read or has no samples.

    """
    scene = without_deliberate(scene)
    pipeline = Pipeline(scene)
    bag = None if like in (None, SINE) else read_bag(str(like))
    return [_motion(scene, line, like, bag, horizon) for line in pipeline.lines]


def without_deliberate(scene: Scene) -> Scene:
    """Return a scene without recording, faults and what its sensors and wear change."""
    kept = ('velocity', 'friction', 'tolerance')
    members = tuple(
        replace(member, effects={k: v for k, v in member.effects.items() if k in kept})
        for member in scene.members
    )
    members = tuple(
        member
        if member.drive[0] == 'torque'
        else replace(
            member,
            loads=None,
            effects={k: v for k, v in member.effects.items() if k != 'friction'},
        )
        for member in members
    )
    return replace(scene, members=members, faults={}, record=None)


def _motion(
    scene: Scene, line: LinkagePipeline, like: str | None, bag: Bag | None, horizon: float
) -> MemberMotion:
    member, context = line.member, line.context
    closure = line.closure
    if type(closure) is not Closure:
        closure = Closure(closure.linkage)
    motion = MemberMotion(member, closure, context, None)
    drive, parameters = member.drive
    if drive == 'torque':
        return _commanded(motion, like, bag, horizon)
    if drive == 'bag':
        opened = read_bag(parameters.file, allow_truncated=parameters.allow_truncated)
        fast = scene.rate if parameters.pace == 'fast' else 0.0
        return follow_samples(motion, opened, parameters.topic, fast)
    if drive != 'topic':
        return motion._replace(path=_path_of(line))
    if bag is not None:
        return follow_samples(motion, bag)
    if like is None:
        raise member.content.error(
            'drive',
            'topic has no motion of its own',
            'say what its crank does: --like sine, or --like BAG with its samples',
        )
    return motion._replace(
        path=_sines(closure),
        sample_rate=scene.rate or USUAL_RATE,
        note=f'the crank moves by a sine of {_FREQUENCY:g} Hz',
    )


def _path_of(line: LinkagePipeline) -> Path:
    """Return the path of a drive that computes its crank as a function of the time."""
    drive = line.drive
    drive.state(BEGIN)

    def path(time: int) -> Crank | None:
        crank: CrankState | None = drive.state(BEGIN + time)
        return None if crank is None else (crank.angles, crank.rates)

    return path


def _sines(closure: Closure) -> Path:
    """Return sines of all inputs, within the range where the loops close."""
    speed = tau * _FREQUENCY
    centers = usual_inputs(closure)
    sizes = [0.01 * (closure.scale if each.slider else 1.0) for each in closure.linkage.inputs]
    if len(centers) == 1:
        widest = InputSweep(closure).widest_range
        assert widest is not None, 'reading the file has proved that it closes somewhere'
        sizes = [_AMPLITUDE]
        if not widest.whole:
            centers = (0.5 * (widest.lowest + widest.highest),)
            sizes = [min(_AMPLITUDE, _PART * (widest.highest - widest.lowest))]

    def path(time: int) -> Crank:
        s, c = sin(speed * time * 1e-9), cos(speed * time * 1e-9)
        values = tuple(at + size * s for at, size in zip(centers, sizes, strict=True))
        return values, tuple(size * speed * c for size in sizes)

    return path


def _commanded(
    motion: MemberMotion, like: str | None, bag: Bag | None, horizon: float
) -> MemberMotion:
    """Return the motion of a torque drive, with the commands that come to it."""
    if bag is not None:
        return follow_commands(motion, bag)
    if like is None and moves(motion, horizon):
        return motion._replace(note='no command comes')
    effort = _usual_effort(motion)
    timeout = motion.member.drive[1].timeout
    period = round(min(COMMAND_PERIOD, 0.5 * timeout) * NANOSECONDS)
    commands = [
        Command(time, effort * sin(0.5 * tau * time * 1e-9))
        for time in range(period, round(horizon * NANOSECONDS), period)
    ]
    motor = motion.member.drive[1].motor
    slides = motion.closure.linkage.inputs[0].slider
    units = {'effort': 'N' if slides else 'N·m', 'current': 'A', 'voltage': 'V'}
    unit = units[motor.command if motor else 'effort']
    note = f'commands are a sine of 0.5 Hz and {effort:.3g} {unit}, {1e9 / period:g} a second'
    if like is None:
        note += ', since nothing moves without'
    return motion._replace(commands=commands, note=note)


def cranks_at(motion: MemberMotion, times: Sequence[int], **changes: Any) -> list[Crank | None]:
    """
    Return the crank at some times since the first tick, in [ns] and in order.

    Parameters
    ----------
    motion
        What the linkage does.
    times
        The times.
    **changes
        Parameters of a torque drive that differ from the scene's: its method, or its step.

    Raises
    ------
    LinkageError
        The input runs away before the last time.

    """
    if motion.path is not None:
        return [motion.path(time) for time in times]
    drive = built(motion, **changes)
    step = changes.get('step', motion.member.drive[1].step)
    look = max(1, round(_LOOK / step)) * round(step * NANOSECONDS)
    commands, number = motion.commands, 0
    passed = 0
    drive.state(BEGIN)
    found: list[Crank | None] = []
    for time in times:
        # A drive that is asked too seldom leaves time out, and a runaway is to be seen early.
        for stop in (*range(passed - passed % look + look, time, look), time):
            while number < len(commands) and commands[number].time <= stop:
                arrival, effort = commands[number]
                drive.offer(EffortCommand(0, effort), BEGIN + arrival)
                number += 1
            crank = drive.state(BEGIN + stop)
            _check_bounded(crank, stop, step)
        passed = time
        found.append((crank.angles, crank.rates))
    return found


def tick_times(rate: float, horizon: float, most: int) -> list[int]:
    """Return the times of some ticks up to the horizon, in [ns], the last one too."""
    count = max(1, int(horizon * rate * (1.0 + 1e-12)))
    chosen = sorted({round(count * k / most) for k in range(1, most + 1)} - {0})
    return [round(number * NANOSECONDS / rate) for number in chosen]


def scene_key(member: SceneLinkage, key: str) -> str:
    """Return where a key of a linkage stands in its scene: in its own entry, or for all."""
    own = member.name and key in member.content
    return f'linkages.{member.name}.{key}' if own else key


def refuse_horizon(time: float, why: str) -> LinkageError:
    """Return the error of a motion that has no end at the horizon; the time is in [s]."""
    return LinkageError(
        '--horizon',
        f'lies beyond the motion: after {time:.3g} s {why}',
        f'take less: --horizon {0.5 * time:.2g}',
    )


def _check_bounded(crank: CrankState, time: int, step: float) -> None:
    """Refuse a rate that is too fast for the step."""
    passed = abs(crank.rates[0]) * step
    if not passed <= _BEYOND:
        why = f'the input runs away and passes {passed:.2g} rad in a step'
        raise refuse_horizon(time * 1e-9, why)


def moves(motion: MemberMotion, horizon: float) -> bool:
    """Return whether a torque drive moves without commands."""
    looks = [round(horizon * NANOSECONDS * k / 100) for k in range(101)]
    values = [crank[0][0] for crank in cranks_at(motion, looks) if crank]
    return max(values) - min(values) > _STANDS


def built(motion: MemberMotion, **changes: Any) -> TorqueDrive:
    """Return the torque drive at its start, with other parameters."""
    from linkage_ros.drives import torque  # local import: only with forces

    return torque.build(replace(motion.member.drive[1], **changes), motion.context)


def _usual_effort(motion: MemberMotion) -> float:
    """Return the amplitude of the commands: they pass friction and a fifth of the weight."""
    equation = motion.context.mechanics.equation
    drive = built(motion)
    start = motion.member.drive[1].start
    low, high = (min(max(end, start - tau), start + tau) for end in drive.acting(None)[0].stops)
    found = [terms for k in range(90) if (terms := equation(low + (high - low) * k / 90.0))]
    least = min(terms.inertia for terms in found)
    rubbing = max(terms.coulomb + terms.breakaway for terms in found)
    weight = max(abs(terms.potential_slope) for terms in found)
    unit = motion.closure.scale if motion.closure.linkage.inputs[0].slider else 1.0
    effort = rubbing + 0.2 * weight + 2.0 * unit * least
    motor = motion.member.drive[1].motor
    if motor is None or motor.command == 'effort':
        return effort
    current: float = effort / (motor.torque_constant * motor.ratio * motor.efficiency)
    if motor.command == 'current':
        return current
    voltage: float = motor.resistance * current + motor.torque_constant * motor.ratio * unit
    return voltage
