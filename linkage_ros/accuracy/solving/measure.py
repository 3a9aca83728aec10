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
What closing the loops costs: the error of a state against its time, for all methods.

Errors are against fifty digits and worked out once; times are measured apart from them, of all
methods on all poses in turn.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import inf
from time import perf_counter
from typing import Any

from linkage_ros.accuracy.reference.confirmation import confirmed
from linkage_ros.accuracy.reference.reference import Reference, Truth
from linkage_ros.accuracy.results import Part
from linkage_ros.accuracy.solving.loop_errors import (
    batch_errors,
    Errors,
    FAR,
    motion_errors,
    off,
    position_errors,
)
from linkage_ros.accuracy.solving.measured import BATCH, Measured
from linkage_ros.accuracy.solving.methods.integration import integrations
from linkage_ros.accuracy.solving.methods.ladder import methods_for
from linkage_ros.accuracy.solving.methods.method import ACCELERATION, Method, RATE
from linkage_ros.accuracy.solving.poses import path, pose_sets, Poses, there_and_back
from linkage_ros.accuracy.solving.shown import part_of
from linkage_ros.accuracy.solving.timing import Contender, in_turn
from linkage_ros.scene.scene import Scene
import numpy as np

STATES = 64
"""Of a turn, where rates are integrated."""

_ARRAY = 2e-2
"""In [s]: where a full array takes longer, it is no longer than the poses."""

_PASS = 5e-3
"""A pass over states that takes longer than this is timed on the first of them only, in [s]."""


def measure_solving(scene: Scene, quick: bool, told: Callable[[str, float], None]) -> Part:
    """
    Measure how a scene's first linkage is solved.

    Parameters
    ----------
    scene
        The scene.
    quick
        Whether a few seconds are to do.
    told
        Takes what is done and how much of it, 0 to 1, now and then.

    """
    member = scene.members[0]
    sets = pose_sets(member.name or scene.name, member.linkage, 24 if quick else 128)
    found: list[Measured] = []
    for number, poses in enumerate(sets):
        told('solving', 0.3 * number / len(sets))
        found += judge(poses, quick)
    take_times(found, 1.0 if quick else 40.0, lambda part: told('solving', 0.3 + 0.7 * part))
    return part_of(found, quick)


def judge(poses: Poses, quick: bool) -> list[Measured]:
    """
    Return the errors of all methods on a set of poses, without times; they do not vary.

    Raises
    ------
    ArithmeticError
        Where two references differ.

    """
    truths = true_states(poses)
    confirmed(poses, truths)
    methods = methods_for(poses.linkage, poses.key, quick)
    found = [_judged(method, poses, truths) for method in methods]
    if poses.key == 'easy':
        found += _integrated(poses, quick)
    return found


def take_times(
    found: Sequence[Measured], seconds: float, told: Callable[[float], None] = lambda _: None
) -> None:
    """Time all that was judged, in turn, in about so many seconds."""
    jobs = [(one, what, job) for one in found for what, job in _contenders(one)]
    times = in_turn([job for _, _, job in jobs], seconds, told)
    for (one, what, _), time in zip(jobs, times, strict=True):
        one.times[what] = time


def true_states(poses: Poses) -> list[Truth]:
    """Return the truth at every state of a set."""
    reference = Reference(poses.linkage)
    driven = len(poses.linkage.inputs)
    rates, accelerations = [RATE] * driven, [ACCELERATION] * driven
    return [reference.solve(inputs, rates, accelerations) for inputs in poses.inputs]


def _integrated(poses: Poses, quick: bool) -> Iterator[Measured]:
    """Yield what integration along a turn comes to; its error is that at the end."""
    way = path(poses, STATES)
    if way is None:
        return
    (truth,) = true_states(way._replace(inputs=way.inputs[-1:]))
    for method in integrations(way, quick):
        assert method.position is not None
        for inputs in way.inputs:
            joints = method.position(*inputs)
        error = off(way.linkage, joints, truth) if joints else inf
        errors = Errors((error,), 0.0) if error <= FAR else Errors((None,), 1.0)
        yield Measured(way, method, errors, None, None, {})


def _judged(method: Method, poses: Poses, truths: Sequence[Truth]) -> Measured:
    motion = motion_errors(method, poses, truths) if method.motion else None
    position = motion[0] if motion and method.together else position_errors(method, poses, truths)
    batch = None
    # What is iterated is so one state at a time; in arrays it is no faster.
    if method.batch is not None and poses.key in ('easy', 'five_dyads'):
        batch = batch_errors(method.batch, poses, truths)
    return Measured(poses, method, position, motion, batch, {})


def _contenders(one: Measured) -> Iterator[tuple[str, Contender]]:
    poses, method = one.poses, one.method
    for what, solve in (('position', method.position), ('motion', method.motion)):
        if solve is not None:
            yield what, _looped(solve, poses)
    if one.batch is not None and method.batch is not None:
        rows = [np.array(row) for row in zip(*poses.inputs, strict=True)]
        begun = perf_counter()
        method.batch(rows, 2)
        each = (perf_counter() - begun) / len(rows[0])
        if each * BATCH < _ARRAY:
            rows = [np.resize(row, BATCH) for row in rows]
        yield 'batch', _at_once(method.batch, rows, 0)
        yield 'batch_motion', _at_once(method.batch, rows, 2)


def _looped(solve: Callable[..., Any], poses: Poses) -> Contender:
    states = poses.inputs
    if poses.key == 'path':
        # The first state is a new start and no step.
        solve(*states[0])
        states = states[1:]
    done, begun = 0, perf_counter()
    while done < len(states) and perf_counter() - begun < _PASS:
        solve(*states[done])
        done += 1
    chosen = states[:done]
    if poses.key == 'path' or done < len(states):
        chosen = there_and_back(chosen)

    def run() -> None:
        for inputs in chosen:
            solve(*inputs)

    return Contender(run, len(chosen))


def _at_once(
    solve: Callable[[Sequence[Any], int], object], arrays: Sequence[Any], derivatives: int
) -> Contender:
    return Contender(lambda: solve(arrays, derivatives), len(arrays[0]))
