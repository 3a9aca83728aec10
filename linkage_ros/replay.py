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
that by which the tick judged a sample, the publish time of what it published that for which it
solved. So the pipeline, built from the scene in the bag, comes to the same states. Faults begin
and end where the bag says so, not by the scene's timeline: somebody may have asked for one.
"""

from __future__ import annotations

from collections.abc import Iterator
import json
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.bag.reader import Bag, RUN_FILE
from linkage_ros.cdr import text_of
from linkage_ros.errors import BagError
from linkage_ros.joint_state import JointStateWriter
from linkage_ros.pipeline import Pipeline, Tick
from linkage_ros.scene.load import LINKAGE_FILE, parse_scene, SCENE_FILE
from linkage_ros.scene.scene import Scene

if TYPE_CHECKING:
    from linkage_ros.faults.injection import Change


class ReplayedTick(NamedTuple):
    """
    What a bag holds of a tick and what the same tick comes to now.

    Attributes
    ----------
    time
        Time of the tick, in [ns].
    recorded
        Its joint state in the bag; empty where there is none.
    recorded_extras
        For each of the pipeline's extras its message in the bag; empty where there is none.
    tick
        What the pipeline makes of the bag's samples.

    """

    time: int
    recorded: bytes
    recorded_extras: tuple[bytes, ...]
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
    files = {name: data for name, data in bag.attachments.items() if name.endswith('.yaml')}
    if len(files) < 2:
        raise BagError(
            bag.path, f'carries no {LINKAGE_FILE}', 'name a bag that linkage_ros has recorded'
        )
    return parse_scene(run.scene, str(bag.path), files, run.scene_folder)


def replay(bag: Bag, scene: Scene) -> Iterator[ReplayedTick]:
    """Run a scene over a bag's samples; yield every tick of which the bag holds a message."""
    run = _run(bag)
    # Where crank and joint states share a topic, as in the tick: by their joints.
    shared = run.crank_topic == run.joint_states_topic
    own = JointStateWriter(scene.joints).names if shared else b''
    outputs = {topic: number for number, topic in enumerate((run.joint_states_topic, *run.extras))}
    pipeline = Pipeline(scene)
    closures, injection = pipeline.closures, pipeline.injection
    last = 0
    open_tick: tuple[int, list[bytes], Tick] | None = None  # more of its messages may follow
    for topic, log_time, publish_time, data in bag.messages():
        published = outputs.get(topic)
        if topic == run.crank_topic and not (published == 0 and data.startswith(own, 12)):
            published = None
        elif published is None and topic not in (run.faults_topic, run.withheld_topic):
            continue
        if published is not None and open_tick is not None:
            time, recorded, _ = open_tick
            if time == publish_time and not any(recorded[published:]):
                recorded[published] = data
                continue
        if open_tick is not None:
            yield _replayed(open_tick)
            open_tick = None
        if log_time < last:
            pipeline = Pipeline(scene, closures, injection)
        last = log_time
        if published is not None:
            open_tick = publish_time, [b''] * len(outputs), pipeline.tick(publish_time)
            open_tick[1][published] = data
        elif topic == run.faults_topic:
            if injection is not None:
                injection.turn(*read_change(data))
        elif topic == run.withheld_topic:
            pipeline.tick(publish_time)
        else:
            pipeline.offer(data, log_time)
    if open_tick is not None:
        yield _replayed(open_tick)


def _replayed(tick: tuple[int, list[bytes], Tick]) -> ReplayedTick:
    time, (joint_states, *extras), now = tick
    return ReplayedTick(time, joint_states, tuple(extras), now)


def change_text(change: Change, kind: str) -> str:
    """Return that a fault has begun or ended, as the text that is published and recorded."""
    return json.dumps({'fault': change.name, 'kind': kind, 'injected': change.on})


def read_change(message: bytes) -> tuple[str, bool]:
    """Return what a message of the faults' topic says: of which fault, and whether it began."""
    said = json.loads(text_of(message))
    return str(said['fault']), bool(said['injected'])


class _Run(NamedTuple):
    """What a run's account of itself says; of topics that there are not, ''."""

    scene: str
    scene_folder: str
    crank_topic: str
    joint_states_topic: str
    faults_topic: str
    withheld_topic: str
    extras: tuple[str, ...]


def _run(bag: Bag) -> _Run:
    missing = {RUN_FILE, SCENE_FILE} - set(bag.attachments)
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
            scene_folder=str(run.get('scene_folder', '')),
            crank_topic=str(run.get('crank_topic', '')),
            joint_states_topic=str(run['joint_states_topic']),
            faults_topic=str(run.get('faults_topic', '')),
            withheld_topic=str(run.get('withheld_topic', '')),
            extras=tuple(map(str, run.get('extra_topics', ()))),
        )
    except (ValueError, KeyError, TypeError, AttributeError):
        raise BagError(bag.path, f'its {RUN_FILE} is damaged', 'name another bag') from None
