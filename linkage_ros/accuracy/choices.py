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
The solvers among which a scene can choose, each with the time of a tick of the scene.

For each of several accuracies the cheapest method is built into the scene and ticks in turn with
the others. A method that the scene refuses is no choice: a table without a proof, or a solver
without poses where forces need them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from itertools import islice
from statistics import median

from linkage_ros.accuracy.methods.node import FROM_KNOTS, NODE_DEFAULTS
from linkage_ros.accuracy.page.numbers import number_text
from linkage_ros.accuracy.poses import Measured
from linkage_ros.accuracy.results import Choice
from linkage_ros.accuracy.solving_results import cheapest, in_a_scene, WANTED
from linkage_ros.cost import feed, Variant
from linkage_ros.errors import LinkageError
from linkage_ros.measuring import Spread, spread_of
from linkage_ros.pipeline.pipeline import Pipeline
from linkage_ros.scene.scene import Scene
from linkage_ros.solvers.registry import SOLVERS

_BLOCK, _WARM_UP = 100, 2
"""Ticks of a block, and number of blocks before the first that counts."""


def scene_choices(scene: Scene, results: Sequence[Measured], ticks: int) -> list[Choice]:
    """
    Return the cheapest solver for each of several accuracies, the least exact first.

    The last is the default of a scene. Only the solver of the first linkage differs. The results
    are of all methods at easy poses, timed; a choice is timed over so many ticks.
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
