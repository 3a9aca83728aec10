# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The node's own tick loop, with its recorder and without DDS: its messages come from a list."""

from collections.abc import Iterable
from functools import partial
from itertools import count
import json
from pathlib import Path
from typing import NamedTuple

from linkage_ros.bag import Bag, BagWriter, read_bag, Recorder, Topic
from linkage_ros.description import load_scene
from linkage_ros.messages import text_message
from linkage_ros.replay import change_text
from linkage_ros.tick import Pipeline, TickLoop


class Moment(NamedTuple):
    """
    A tick at a time in [ns], and what comes before it.

    `asked` turns faults on or off; `wrenches` are messages by the number of their topic.
    """

    time: int
    messages: tuple[bytes, ...] = ()
    reset: bool = False
    asked: tuple[tuple[str, bool], ...] = ()
    wrenches: tuple[tuple[int, bytes], ...] = ()


class Run(NamedTuple):
    """A run: its bag, the joint states and the extras that it published, and what was counted."""

    bag: Bag
    published: list[bytes]
    extras: list[bytes]
    loop: TickLoop


def _first(waiting: list[tuple[bytes, dict[str, int]]]) -> tuple[bytes, dict[str, int]] | None:
    return waiting.pop(0) if waiting else None


def run(folder: Path, scene_file: Path, moments: Iterable[Moment], taking: int = 0) -> Run:
    """
    Run a scene through these moments, into a bag in the folder.

    To take a message takes the time ``taking``, in [ns].
    """
    scene = load_scene(scene_file)
    pipeline = Pipeline(scene)
    closures, injection = pipeline.closures, pipeline.injection
    waiting: list[tuple[bytes, dict[str, int]]] = []
    pushing: list[list[tuple[bytes, dict[str, int]]]] = [[] for _ in pipeline.wrenches]
    published: list[bytes] = []
    extras: list[bytes] = []
    loop = TickLoop(
        partial(Pipeline, scene, closures, injection),
        partial(_first, waiting) if pipeline.topic else None,
        published.append,
        publish_extras=[extras.append] * len(pipeline.extras),
        publish_change=lambda c: text_message(change_text(c, scene.faults[c.name].kind)),
        take_wrenches=[partial(_first, each) for each in pushing],
    )
    others = [f'/extra_{index}' for index in range(len(pipeline.extras))]
    loads = [f'/wrench_{index}' for index in range(len(pushing))]
    names = {
        'joint_states_topic': '/joint_states',
        'diagnostics_topic': '/diagnostics',
        **({'crank_topic': '/crank'} if pipeline.topic else {}),
        **{name: name for name in loads},
        **({'faults_topic': '/faults'} if injection else {}),
        **({'withheld_topic': '/withheld'} if pipeline.suppresses_ticks else {}),
        **{name: name for name in others},
        'resets_topic': '/resets',
    }
    folder_of_scene = str(scene_file.parent)
    said = {'scene': 's', 'scene_folder': folder_of_scene, 'seed': scene.seed}
    said |= {'extra_topics': others, 'wrench_topics': loads, **names}
    files = {name: ('application/yaml', data) for name, data in scene.files.items()}
    kinds = {name: each.message for name, each in zip(others, pipeline.extras, strict=True)}
    topics = [
        Topic(name, kinds.get(name, 'sensor_msgs/msg/JointState'), '', '')
        for name in names.values()
    ]
    attached = {**files, 'run.json': ('application/json', json.dumps(said).encode())}
    recorder = Recorder(BagWriter(folder, topics, attached), capacity=1_000_000)
    loop.recorder = recorder
    tick = loop.tick_at if scene.rate else loop.tick_samples
    for time, messages, reset, asked, wrenches in moments:
        for number, message in wrenches:
            pushing[number].append((message, {'source_timestamp': time}))
        waiting += [(message, {'source_timestamp': time}) for message in messages]
        loop.reset_requested |= reset
        for name, on in asked:
            injection.request_change(name, on)
        tick(time, count(time, taking).__next__)
    recorder.stop()
    return Run(read_bag(folder), published, extras, loop)
