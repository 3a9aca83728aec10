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
A run once more, from its bag: the same pipeline over the same samples in the same order.

The bag holds the messages in the order in which the tick took and published them. The log time is
that by which the tick judged a sample, the publish time of a joint state that for which it solved.
So the pipeline, built from the scene in the bag, comes to the same states.
"""

from __future__ import annotations

from collections.abc import Iterator
import json
from typing import NamedTuple

from linkage_ros.bag.reader import Bag
from linkage_ros.errors import BagError
from linkage_ros.pipeline import Pipeline, Tick
from linkage_ros.scene.load import LINKAGE_FILE, parse_scene, SCENE_FILE
from linkage_ros.scene.scene import Scene

RUN_FILE = 'run.json'
"""Name of the attachment that names scene, topics and versions of a run."""


class ReplayedTick(NamedTuple):
    """
    A joint state of a bag and what the same tick comes to now.

    Attributes
    ----------
    time
        Time of the tick, in [ns].
    recorded
        The message in the bag.
    tick
        What the pipeline makes of the bag's samples.

    """

    time: int
    recorded: bytes
    tick: Tick


def recorded_scene(bag: Bag) -> Scene:
    """
    Return the scene that a bag carries.

    Raises
    ------
    BagError
        Where it carries none.
    FileError
        Where this version cannot read it.

    """
    run = _run(bag)
    return parse_scene(str(run['scene']), str(bag.path), bag.attachments)


def replay(bag: Bag, scene: Scene) -> Iterator[ReplayedTick]:
    """Run a scene over a bag's samples; yield a tick for every recorded joint state."""
    run = _run(bag)
    pipeline = Pipeline(scene)
    last = 0
    for message in bag.messages():
        if message.log_time < last and message.topic != '/diagnostics':
            pipeline = Pipeline(scene)
        if message.topic == run['joint_states_topic']:
            tick = pipeline.tick(message.publish_time)
            yield ReplayedTick(message.publish_time, message.data, tick)
        elif message.topic == run['crank_topic']:
            pipeline.offer(message.data, message.log_time)
        else:
            continue
        last = message.log_time


def _run(bag: Bag) -> dict[str, str]:
    missing = {RUN_FILE, SCENE_FILE, LINKAGE_FILE} - set(bag.attachments)
    if missing:
        raise BagError(
            bag.path,
            f'carries no {", ".join(sorted(missing))}',
            'name a bag that linkage_ros has recorded',
        )
    try:
        run = json.loads(bag.attachments[RUN_FILE])
        return {key: str(run[key]) for key in ('scene', 'crank_topic', 'joint_states_topic')}
    except (ValueError, KeyError, TypeError):
        raise BagError(bag.path, f'its {RUN_FILE} is damaged', 'name another bag') from None
