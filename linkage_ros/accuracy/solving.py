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
Cost of closing the loops: the error of a state against its time, for all methods.

Errors are relative to the reference with fifty digits and computed once. Times are measured
separately, for all methods on all poses in turn.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from itertools import islice
from math import inf
from statistics import median
from time import perf_counter
from typing import Any

from linkage_ros.accuracy.methods import ACCELERATION, Method, RATE
from linkage_ros.accuracy.methods.equations import extended, integrations
from linkage_ros.accuracy.methods.formulas import single_precision, textbook
from linkage_ros.accuracy.methods.node import (
    closed_form,
    COLD,
    FROM_KNOTS,
    ITERATED,
    newton,
    NODE_DEFAULTS,
    STARTS,
    table,
    WARM,
)
from linkage_ros.accuracy.methods.peers import casadi, mujoco, pinocchio, pylinkage
from linkage_ros.accuracy.page.numbers import number_text
from linkage_ros.accuracy.poses import (
    BATCH,
    batch_errors,
    Errors,
    FAR,
    Measured,
    motion_errors,
    off,
    path,
    pose_sets,
    Poses,
    position_errors,
    there_and_back,
)
from linkage_ros.accuracy.reference import Reference, Truth
from linkage_ros.accuracy.results import Choice, Part
from linkage_ros.accuracy.solving_results import cheapest, in_a_scene, part_of, WANTED
from linkage_ros.cost import feed, Variant
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics.linkage import Linkage, RevoluteJoint
from linkage_ros.measuring import Contender, in_turn, Progress, Spread, spread_of
from linkage_ros.pipeline.pipeline import Pipeline
from linkage_ros.scene.scene import Scene
from linkage_ros.solvers.registry import SOLVERS
from linkage_ros.solvers.table import ORDERS
import numpy as np

STATES = 64
"""Number of steps of a turn over which rates are integrated."""

_ARRAY = 2e-2
"""If a full array takes longer than this, in [s], it is reduced to the poses."""

_PASS = 5e-3
"""If a pass over the states takes longer, only the first states are timed, in [s]."""

_BLOCK, _WARM_UP = 100, 2
"""Ticks of a block, and number of blocks before the first that counts."""


def measure_solving(scene: Scene, quick: bool, progress: Progress) -> Part:
    """Measure how a scene's first linkage is solved."""
    member = scene.members[0]
    sets = pose_sets(member.name or scene.name, member.linkage, 24 if quick else 128)
    results: list[Measured] = []
    for number, poses in enumerate(sets):
        progress(0.3 * number / len(sets))
        results += judge(poses, quick)
    _take_times(results, 1.0 if quick else 40.0, lambda share: progress(0.3 + 0.65 * share))
    choices = scene_choices(scene, results, 2_000 if quick else 10_000)
    progress(1.0)
    return part_of(results, quick, choices)


def judge(poses: Poses, quick: bool) -> list[Measured]:
    """
    Return the errors of all methods on a set of poses, without times.

    An ArithmeticError says that two references differ.
    """
    truths = true_states(poses)
    confirmed(poses, truths)
    methods = _methods_for(poses.linkage, poses.key, quick)
    results = [_judged(method, poses, truths) for method in methods]
    if poses.key == 'easy':
        results += _integrated(poses, quick)
    return results


def _take_times(
    results: Sequence[Measured], seconds: float, progress: Progress = lambda _: None
) -> None:
    """Time all judged methods in turn, for about a number of seconds."""
    jobs = [(one, what, job) for one in results for what, job in _contenders(one)]
    times = in_turn([job for _, _, job in jobs], seconds, progress)
    for (one, what, _), time in zip(jobs, times, strict=True):
        one.times[what] = time


def true_states(poses: Poses) -> list[Truth]:
    """Return the reference state at every state of a set."""
    reference = Reference(poses.linkage)
    driven = len(poses.linkage.inputs)
    rates, accelerations = [RATE] * driven, [ACCELERATION] * driven
    return [reference.solve(inputs, rates, accelerations) for inputs in poses.inputs]


def _integrated(poses: Poses, quick: bool) -> Iterator[Measured]:
    """Yield the results of integration along a turn; the error is that at its end."""
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
    # Iteration solves one state at a time; arrays make it no faster.
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
        # The first state is a new start, not a step.
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


TOLERANCES = tuple(10.0**-k for k in range(2, 16))
KNOTS = tuple(2**k for k in range(4, 21))

PEERS = (pylinkage, casadi, mujoco, pinocchio)
"""Methods of other packages, if installed; importing some of them takes a second."""

_FEW = {FROM_KNOTS: (1e-8,), WARM: (1e-2, 1e-8, 1e-14), COLD: (1e-8,)}
"""Tolerances, by the start value of Newton's method."""

_LARGEST = 2**22
"""Maximum size of a table, knots times joints, because of memory."""

_LARGEST_ITERATED = 2**14
"""Maximum number of knots if each is iterated."""


def _methods_for(linkage: Linkage, key: str, quick: bool) -> Iterator[Method]:
    """Yield the methods that apply to a linkage; all settings only for easy poses."""
    closed = closed_form(linkage)
    yield closed
    for made in (single_precision, textbook, *(() if quick else PEERS)):
        method = made(linkage)
        if method is not None:
            yield method
    whole = key == 'easy' and not quick
    for start in STARTS:
        many = TOLERANCES if start == WARM else TOLERANCES[::3]
        for tolerance in many if whole else _FEW[start]:
            yield newton(linkage, tolerance, start)
    if len(linkage.inputs) == 1:
        many_knots = _knots_of(linkage, closed.name == ITERATED, key, quick)
        for order in ORDERS:
            for knots in many_knots:
                yield table(linkage, knots, order)
    yield extended(linkage)


def _knots_of(linkage: Linkage, iterated: bool, key: str, quick: bool) -> Sequence[int]:
    if quick and key != 'easy':
        return KNOTS[4:5] if iterated else KNOTS[6:7]
    if quick or key != 'easy':
        return KNOTS[2:11:4]
    largest = _LARGEST_ITERATED if iterated else _LARGEST // len(linkage.joints)
    return [knots for knots in KNOTS if knots <= largest]


PROVED = 1e-40
"""Maximum radius of a verifying ball, absolute below 1, else relative."""

_SAMPLE = 3


def confirmed(poses: Poses, truths: Sequence[Truth]) -> int:
    """
    Return the number of states that balls verify; 0 if python-flint is not installed.

    An ArithmeticError says that the references differ.
    """
    if find_spec('flint') is None:
        return 0
    from linkage_ros.accuracy.enclosure import prove  # local import: an optional dependency

    driven = len(poses.linkage.inputs)
    rates, accelerations = [RATE] * driven, [ACCELERATION] * driven
    chosen = range(0, len(truths), max(1, len(truths) // _SAMPLE))
    for k in chosen:
        proof = prove(poses.linkage, poses.inputs[k], rates, accelerations)
        if not same(poses.linkage, proof, truths[k]):
            raise ArithmeticError(f'{poses.name} at {poses.inputs[k]}: the references differ')
    return len(chosen)


def same(linkage: Linkage, proof: Any, truth: Truth) -> bool:
    """Return whether small balls hold the reference's joints and derivatives, angles mod 2π."""
    from flint import arb, ctx  # local import: an optional dependency

    before, ctx.prec = ctx.prec, 512
    try:
        for order, (balls, values) in enumerate(zip(proof, truth.orders, strict=True)):
            joints = linkage.joints.values()
            for joint, ball, value in zip(joints, balls, values, strict=True):
                number = arb(value.context.nstr(value, 100))
                if isinstance(joint, RevoluteJoint) and not order:
                    turn = 2 * arb.pi()
                    number -= turn * round(float(((number - ball) / turn).mid()))
                enough = PROVED * max(1.0, abs(float(value)))
                if float(ball.rad()) > enough or not (number + arb(0, enough)).overlaps(ball):
                    return False
    finally:
        ctx.prec = before
    return True


def scene_choices(scene: Scene, results: Sequence[Measured], ticks: int) -> list[Choice]:
    """
    Return the cheapest solver for each of several accuracies, the least exact first.

    The last is the default of a scene. Only the solver of the first linkage differs. The results
    are of all methods at easy poses, timed; the choices tick in turn, so many ticks each. A method
    that the scene refuses is no choice: a table without a proof, or a solver without poses where
    forces need them.
    """
    offered = in_a_scene(results)
    (node,) = (one for one in offered if one.method.name in NODE_DEFAULTS)
    built: dict[str, tuple[float, Measured, Pipeline]] = {}
    for wanted in WANTED:
        one = cheapest(offered, wanted)
        if one is None or one is node:
            continue
        solver = 'newton' if one.method.name == FROM_KNOTS else 'table'
        try:
            pipeline = _pipeline(scene, solver, wanted)
        except LinkageError:
            continue
        built[f'solver: {{{solver}: {{tolerance: {number_text(wanted)}}}}}'] = (
            wanted,
            one,
            pipeline,
        )
    worst = node.position.worst or 0.0
    built['solver: closed_form # the default'] = worst, node, _pipeline(scene, 'closed_form')
    times = _tick_times(scene, [pipeline for *_, pipeline in built.values()], ticks)
    return [
        Choice(accuracy, write, one.times['position'].scaled(1e6), time)
        for (write, (accuracy, one, _)), time in zip(built.items(), times, strict=True)
    ]


def _pipeline(scene: Scene, solver: str, tolerance: float | None = None) -> Pipeline:
    parameters = import_module(SOLVERS[solver]).PARAMETERS
    given = parameters() if tolerance is None else parameters(tolerance)
    first, *others = scene.members
    first = replace(first, solver=(solver, given), accuracy=None)
    return Pipeline(replace(scene, members=(first, *others), faults={}, record=None))


def _tick_times(scene: Scene, pipelines: Sequence[Pipeline], ticks: int) -> list[Spread]:
    """Return the time of a tick of each with its crank message, in [µs]."""
    variants = [Variant(pipeline) for pipeline in pipelines]
    blocks: dict[Variant, list[float]] = {one: [] for one in variants}
    fed = feed(scene, pipelines[0])
    for number in range(_WARM_UP + ticks // _BLOCK):
        nows, messages = zip(*islice(fed, _BLOCK), strict=True)
        for one in variants if number % 2 else reversed(variants):
            one.forget()
            one.run(nows, messages)
            if number >= _WARM_UP:
                blocks[one].append(median(one.ticks) * 1e-3)
    return [spread_of(times) for times in blocks.values()]
