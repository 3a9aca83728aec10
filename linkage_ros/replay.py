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
that by which the tick judged a sample, the publish time of a joint state, or a motion, that for
which it solved. So the pipeline, built from the scene in the bag, comes to the same states.
"""

from __future__ import annotations

from collections.abc import Iterator
import json
from typing import NamedTuple

from linkage_ros.bag.reader import Bag
from linkage_ros.errors import BagError
from linkage_ros.joint_state import JointStateWriter
from linkage_ros.pipeline import Pipeline, Tick
from linkage_ros.scene.load import LINKAGE_FILE, parse_scene, SCENE_FILE
from linkage_ros.scene.scene import Scene

RUN_FILE = 'run.json'
"""Name of the attachment that names scene, topics and versions of a run."""


class ReplayedTick(NamedTuple):
    """
    What a bag holds of a tick and what the same tick comes to now.

    Attributes
    ----------
    time
        Time of the tick, in [ns].
    recorded
        Its joint state in the bag; empty where only its motion is there.
    recorded_motion
        Its motion in the bag; empty where there is none.
    tick
        What the pipeline makes of the bag's samples.

    """

    time: int
    recorded: bytes
    recorded_motion: bytes
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
    return parse_scene(run.scene, str(bag.path), bag.attachments)


def replay(bag: Bag, scene: Scene) -> Iterator[ReplayedTick]:
    """Run a scene over a bag's samples; yield every tick of which the bag holds a message."""
    run = _run(bag)
    # Where crank and joint states share a topic, as in the tick: by their joints.
    shared = run.crank_topic == run.joint_states_topic
    own = JointStateWriter(list(scene.linkage.joints)).names if shared else b''
    pipeline = Pipeline(scene)
    last = 0
    ticked: ReplayedTick | None = None  # its motion may follow
    for topic, log_time, publish_time, data in bag.messages():
        if topic not in run.topics:
            continue
        if topic == run.motion_topic and ticked is not None and ticked.time == publish_time:
            yield ticked._replace(recorded_motion=data)
            ticked = None
            continue
        if ticked is not None:
            yield ticked
            ticked = None
        if log_time < last:
            pipeline = Pipeline(scene)
        last = log_time
        if topic == run.motion_topic:  # the recorder had to drop its joint state
            yield ReplayedTick(publish_time, b'', data, pipeline.tick(publish_time))
        elif topic == run.joint_states_topic and data.startswith(own, 12):
            ticked = ReplayedTick(publish_time, data, b'', pipeline.tick(publish_time))
        else:
            pipeline.offer(data, log_time)
    if ticked is not None:
        yield ticked


class _Run(NamedTuple):
    """What a run's account of itself says."""

    scene: str
    crank_topic: str
    joint_states_topic: str
    motion_topic: str
    """Empty where none was published, and in bags older than it."""

    @property
    def topics(self) -> tuple[str, ...]:
        return self[1:]


def _run(bag: Bag) -> _Run:
    missing = {RUN_FILE, SCENE_FILE, LINKAGE_FILE} - set(bag.attachments)
    if missing:
        raise BagError(
            bag.path,
            f'carries no {", ".join(sorted(missing))}',
            'name a bag that linkage_ros has recorded',
        )
    try:
        run = json.loads(bag.attachments[RUN_FILE])
        return _Run(
            scene=str(run['scene']),
            crank_topic=str(run['crank_topic']),
            joint_states_topic=str(run['joint_states_topic']),
            motion_topic=str(run.get('motion_topic', '')),
        )
    except (ValueError, KeyError, TypeError, AttributeError):
        raise BagError(bag.path, f'its {RUN_FILE} is damaged', 'name another bag') from None
