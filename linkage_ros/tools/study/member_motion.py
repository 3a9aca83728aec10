# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What one linkage of a scene does: its inputs at any time, and the commands that move it.

Whatever noise, delay or fault the scene adds is not part of its motion: it is wanted. Its joints
are compared with the exact ones, for inputs that are not the exact ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations
from math import dist, inf, nan, pi, tau
from random import Random
from typing import Any, NamedTuple

from linkage_ros.description import SceneLinkage
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import Closure, Linkage, RevoluteJoint, SpaceLinkage
from linkage_ros.messages import EffortCommand, NANOSECONDS
from linkage_ros.stages.drives import Context, CrankState, TorqueCrank, TorqueDrive
from linkage_ros.tools.study.budget import JointError
import numpy as np

BEGIN = NANOSECONDS
"""Time of the first tick, in [ns]."""

_LOOK = 2e-3
"""Time between two looks at a torque drive, in [s], or its step if that is longer."""

_BEYOND = 0.5 * pi
"""A step over more than this, in [rad], follows no motion: the input runs away."""

Crank = tuple[tuple[float, ...], tuple[float, ...]]
"""Values and rates of the inputs."""

Path = Callable[[int], Crank | None]
"""Values and rates of the inputs at a time since the first tick, in [ns]."""


class Command(NamedTuple):
    """Commands of a torque drive, in the units that it takes."""

    time: int  # Arrival after the first tick, in [ns]
    efforts: tuple[float | None, ...]  # Of each input; None for one without a command


class LinkageMotion(NamedTuple):
    """What one linkage of a scene does."""

    scene_linkage: SceneLinkage
    closure: Closure  # The closed form of its linkage, with the deviations of its parts
    context: Context
    path: Path | None  # Its inputs at any time; None for a torque drive
    commands: Sequence[Command] = ()
    # When the samples of a topic drive are taken and when they come, after the first tick, in
    # [ns]; () if they come at the rate of `sample_rate`, at once.
    samples: Sequence[tuple[int, int]] = ()
    sample_rate: float = 0.0  # Samples of a topic drive per second; 0 for other drives
    length: float = inf  # How long it is known, in [s]
    note: str = ''  # The assumption, in a sentence; '' for none


def cranks_at(motion: LinkageMotion, times: Sequence[int], **changes: Any) -> list[Crank | None]:
    """
    Return the crank at some times since the first tick, in [ns] and in order.

    ``changes`` are parameters of a torque drive that differ from the scene's: its method, or its
    step. A LinkageError is raised if the input runs away before the last time.
    """
    if motion.path is not None:
        return [motion.path(time) for time in times]
    drive = build_drive(motion, **changes)
    step = changes.get('step', motion.scene_linkage.drive[1].step)
    look = max(1, round(_LOOK / step)) * round(step * NANOSECONDS)
    commands, number = motion.commands, 0
    passed = 0
    drive.state(BEGIN)
    cranks: list[Crank | None] = []
    for time in times:
        # A drive that is asked too seldom leaves time out, and a runaway is to be seen early.
        for stop in (*range(passed - passed % look + look, time, look), time):
            while number < len(commands) and commands[number].time <= stop:
                arrival, efforts = commands[number]
                drive.offer(EffortCommand(0, efforts), BEGIN + arrival)
                number += 1
            crank = drive.state(BEGIN + stop)
            _check_bounded(crank, stop, step)
        passed = time
        cranks.append((crank.angles, crank.rates))
    return cranks


def draw_instants(length: float, most: int) -> list[float]:
    """
    Return random instants up to a length, one in each of equal parts, and the length itself.

    There are as many parts as whole units in the length, but no more than ``most``. Equidistant
    instants would meet one phase only of a motion whose period divides their distance. They are
    the same at each call, so that settings are compared at the same ones.
    """
    random = Random(0)
    parts = max(1, min(most, int(length)))
    return [*((part + random.random()) * length / parts for part in range(parts)), length]


def draw_ticks(rate: float, horizon: float, most: int) -> list[int]:
    """Return the times of random ticks up to the horizon, in [ns], the last one too."""
    count = max(1, int(horizon * rate * (1.0 + 1e-12)))
    chosen = sorted({max(1, round(instant)) for instant in draw_instants(count, most)})
    return [round(number * NANOSECONDS / rate) for number in chosen]


def draw_times(horizon: float, most: int) -> list[int]:
    """Return random times up to the horizon, in [ns], the horizon too."""
    return [round(instant) for instant in draw_instants(horizon * NANOSECONDS, most)]


def scene_key(scene_linkage: SceneLinkage, key: str) -> str:
    """Return where a key of a linkage stands in its scene: in its own entry, or for all."""
    own = scene_linkage.name and key in scene_linkage.content
    return f'linkages.{scene_linkage.name}.{key}' if own else key


def refuse_horizon(time: float, why: str) -> LinkageError:
    """Return the error of a motion that has no end at the horizon; the time is in [s]."""
    return LinkageError(
        '--horizon',
        f'lies beyond the motion: after {time:.3g} s {why}',
        f'take less: --horizon {0.5 * time:.2g}',
    )


def _check_bounded(crank: CrankState, time: int, step: float) -> None:
    """Refuse a rate that is too fast for the step."""
    passed = max(map(abs, crank.rates)) * step
    if not passed <= _BEYOND:
        why = f'the input runs away and passes {passed:.2g} rad in a step'
        raise refuse_horizon(time * 1e-9, why)


def build_drive(motion: LinkageMotion, **changes: Any) -> TorqueCrank:
    """Return the torque drive at its start, with other parameters."""
    drive: TorqueDrive = replace(motion.scene_linkage.drive[1], **changes)
    return drive.build(motion.context)


def size_of(linkage: Linkage | SpaceLinkage) -> float:
    """Return the greatest distance between two points of a link, in space of the pose, in [m]."""
    if isinstance(linkage, SpaceLinkage):
        places = [*linkage.points.values(), *(hinge.at for hinge in linkage.hinges.values())]
        return max((dist(*pair) for pair in combinations(places, 2)), default=1.0) or 1.0
    return max(
        abs(complex(*first) - complex(*second))
        for points in linkage.links.values()
        for first, second in combinations(points.values(), 2)
    )


def joints_at(closure: Closure, cranks: Sequence[Crank | None]) -> tuple[Any, Any]:
    """
    Return joints and their rates for some states of the crank, (joints, states) each.

    The units are [rad] or [m], and per [s]; NaN where the crank is unknown or the loops do not
    close.
    """
    count = len(closure.linkage.inputs)
    nothing = ((nan,) * count, (nan,) * count)
    rows = np.array([crank or nothing for crank in cranks])
    values, rates = rows[:, 0, :].T, rows[:, 1, :].T
    batch = closure.solve(*values, rates=[*rates], derivatives=1)
    return batch.positions, batch.velocities


def joint_distances(closure: Closure, joints: Any, exact: Any) -> Any:
    """
    Return for each state the greatest distance of a joint from the exact one.

    It is in [rad]; slides in parts of the linkage's size. NaN where either does not exist.
    """
    apart = joints - exact
    for index, joint in enumerate(closure.linkage.joints.values()):
        if isinstance(joint, RevoluteJoint):
            apart[index] -= tau * np.round(apart[index] / tau)
        else:
            apart[index] /= size_of(closure.linkage)
    return np.abs(apart).max(axis=0)


def error_of(apart: Sequence[Any]) -> JointError | None:
    """Return the error of some distances, of all linkages together; None if there are none."""
    known = np.fmax.reduce([np.ravel(distances) for distances in apart])
    known = known[np.isfinite(known)]
    if not len(known):
        return None
    return JointError(float(np.sqrt(np.mean(known * known))), float(known.max()))
