# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The messages that make the motion of a scene, for measurements of its ticks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

from linkage_ros.description import Scene
from linkage_ros.messages import JointStateWriter
from linkage_ros.stages.drives import TorqueDrive
from linkage_ros.tick import Pipeline
from linkage_ros.tools.study.member_motion import BEGIN, Crank, LinkageMotion
from linkage_ros.tools.study.prices import Feed, turn_crank, USUAL_RATE


def feed_of(motions: Sequence[LinkageMotion]) -> Feed:
    """Return the messages that make this motion, for a measurement of ticks."""
    if not any(motion.sample_rate or motion.commands for motion in motions):
        return turn_crank

    def feed_messages(scene: Scene, pipeline: Pipeline) -> Iterator[tuple[int, bytes]]:
        if pipeline.topic == TorqueDrive.listens_to:
            return _commands_and_ticks(scene, motions)
        return (
            _samples_and_ticks(scene, motions) if pipeline.topic else turn_crank(scene, pipeline)
        )

    return feed_messages


def _samples_and_ticks(
    scene: Scene, motions: Sequence[LinkageMotion]
) -> Iterator[tuple[int, bytes]]:
    """Yield ticks, each with a sample; the last one again and again after the end of a bag."""
    driven = [each for each in motions if each.scene_linkage.drive[1].is_measured]
    if any(each.scene_linkage.instead_of_inputs for each in driven):
        yield from turn_crank(scene, Pipeline(scene))
        return
    write = JointStateWriter(
        [name for each in driven for name in each.scene_linkage.sampled_joints]
    ).write
    period = 1e9 / (scene.rate or USUAL_RATE)
    known: list[Crank] = [((0.0,) * len(e.scene_linkage.sampled_joints),) * 2 for e in driven]
    number = 0
    while True:
        now = BEGIN + round(number * period)
        found = [each.path(now - BEGIN) for each in driven if each.path]
        known = [new or old for new, old in zip(found, known, strict=True)]
        values = [value for crank in known for value in crank[0]]
        rates = [rate for crank in known for rate in crank[1]]
        yield now, write(now, values, rates, (0.0,) * len(values))
        number += 1


def _commands_and_ticks(
    scene: Scene, motions: Sequence[LinkageMotion]
) -> Iterator[tuple[int, bytes]]:
    """Yield ticks, with the commands that have come since the last one."""
    driven = [each for each in motions if each.scene_linkage.drive[1].gives_torque]
    names = [name for each in driven for name in each.context.inputs_in_messages]
    write = JointStateWriter(names).write
    zeros = (0.0,) * len(names)
    period = 1e9 / scene.rate
    number, next_ones = 0, [0] * len(driven)
    newest = [[0.0] * len(each.context.inputs_in_messages) for each in driven]
    while True:
        elapsed = round(number * period)
        fresh = False
        for k, each in enumerate(driven):
            while next_ones[k] < len(each.commands) and (
                each.commands[next_ones[k]].time <= elapsed
            ):
                commanded = zip(each.commands[next_ones[k]].efforts, newest[k], strict=True)
                newest[k] = [old if new is None else new for new, old in commanded]
                next_ones[k] += 1
                fresh = True
        efforts = [*chain(*newest)]
        yield BEGIN + elapsed, write(BEGIN, zeros, zeros, efforts) if fresh else b''
        number += 1
