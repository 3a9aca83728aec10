# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Bags of scenes that ran without a node: the pipeline by hand, recorded as the tick loop does."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from itertools import chain
import json
from pathlib import Path
from threading import Event
from types import ModuleType
from typing import Any

from linkage_ros.bag import (
    BagMessage,
    BagWriter,
    QosProfile,
    read_bag,
    RUN_FILE,
    Storage,
    Topic,
)
from linkage_ros.description import load_scene
from linkage_ros.messages import JointStateWriter, time_message
from linkage_ros.tick import Pipeline
from rosbags.highlevel import AnyReader

from ..support.messages import joint_state, STORE

JOINT_STATE = 'sensor_msgs/msg/JointState'
SECOND = 1_000_000_000
BEGIN = 1_700_000_000 * SECOND
MS = 1_000_000

FOUR_BAR = 'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n'
Crank = Callable[[int], Mapping[str, Any]]
"""Gives for each tick the joints that a sample names, with angle and rate, or with an effort."""

COMMANDS = '/crank_commands'
"""Topic of efforts."""


def topic(name: str, kind: str, reliability: str = 'reliable') -> Topic:
    """Describe a topic as the node does."""
    definition, _ = STORE.generate_msgdef(kind, ros_version=2)
    return Topic(
        name, kind, definition, STORE.hash_rihs01(kind), QosProfile(reliability=reliability)
    )


class Recorded:
    """
    A run.

    Parameters
    ----------
    folder
        The bag.
    scene
        The scene file.
    crank
        What comes from elsewhere, at every tick; nothing where the scene has a drive of its own.
    crank_topic
        On which.
    resets
        The numbers of the ticks before which somebody asks for a reset.
    drop
        Tells by the number of the tick and the topic's name whether the recorder has to drop it.

    """

    def __init__(
        self,
        folder: Path,
        scene: Path,
        crank: Crank | None = None,
        crank_topic: str = '/crank_states',
        resets: Collection[int] = (),
        drop: Callable[[int, str], bool] = lambda _number, _topic: False,
    ) -> None:
        loaded = load_scene(scene)
        self.folder = folder
        self._scene, self._resets = loaded, resets
        self.pipeline = Pipeline(loaded)
        self.rate = loaded.rate or 1000.0
        self._crank, self._crank_topic, self._drop = crank, crank_topic, drop
        self._extras = [f'/linkage/{extra.topic[2:]}' for extra in self.pipeline.extras]
        run: dict[str, Any] = {
            'scene': loaded.name,
            'seed': loaded.seed,
            'joint_states_topic': '/joint_states',
            'withheld_topic': '/linkage/withheld',
            'extra_topics': self._extras,
            'linkage_ros': '9.8.7',
            'python': '3.99.1',
            'machine': 'abacus',
        }
        topics = [
            topic('/joint_states', JOINT_STATE),
            topic('/linkage/withheld', 'builtin_interfaces/msg/Time'),
            *(
                topic(name, extra.message)
                for name, extra in zip(self._extras, self.pipeline.extras, strict=True)
            ),
        ]
        if crank:
            run['crank_topic'] = crank_topic
            if crank_topic != '/joint_states':
                topics.append(topic(crank_topic, JOINT_STATE, 'best_effort'))
        if resets:
            run['resets_topic'] = '/linkage/resets'
            topics.append(topic('/linkage/resets', 'builtin_interfaces/msg/Time'))
        self._numbers = {each.name: index for index, each in enumerate(topics)}
        self._writer = BagWriter(
            folder,
            topics,
            {name: ('application/yaml', data) for name, data in loaded.files.items()}
            | {RUN_FILE: ('application/json', json.dumps(run).encode())},
        )

    def run(self, ticks: int, dropped: Mapping[str, int] | None = None) -> Path:
        """Tick, and close the bag; return its folder."""
        for index in range(ticks):
            stamp = BEGIN + round(index * SECOND / self.rate)
            now = stamp + MS // 4  # when the tick takes its sample
            if index in self._resets:
                self.pipeline = Pipeline(self._scene)
                self._write(index, '/linkage/resets', now, now, time_message(now))
            if self._crank:
                states = self._crank(index)
                message = self._sample(stamp, states)
                self._write(index, self._crank_topic, now, stamp + MS // 8, message)
                self.pipeline.offer(message, now)
            tick = self.pipeline.tick(stamp)
            if tick.message:
                self._write(index, '/joint_states', now, stamp, tick.message)
                for name, message in zip(self._extras, tick.extras, strict=bool(tick.extras)):
                    if message:
                        self._write(index, name, now, stamp, message)
            elif any(look.position for look in tick.states):
                self._write(index, '/linkage/withheld', now, stamp, time_message(stamp))
        counts = dict.fromkeys(self._numbers, 0) | dict(dropped or {})
        self._writer.close({'linkage_ros.dropped': json.dumps(counts)})
        return self.folder

    def _sample(self, stamp: int, states: Mapping[str, Any]) -> bytes:
        if self._crank_topic == COMMANDS:
            return joint_state(states, efforts=[*states.values()])
        angles, rates = zip(*states.values(), strict=True) if states else ((), ())
        return JointStateWriter(list(states)).write(stamp, angles, rates)

    def _write(self, number: int, name: str, log: int, publish: int, data: bytes) -> None:
        if not self._drop(number, name):
            self._writer.write(self._numbers[name], log, publish, data)


def scene_file(folder: Path, text: str, linkage: str = FOUR_BAR) -> Path:
    """Write a scene and its linkage; return the scene's file."""
    (folder / 'l.yaml').write_text(linkage)
    scene = folder / 'scene of mine.yaml'
    scene.write_text(text if 'linkage' in text else f'linkage: l.yaml\n{text}')
    return scene


Edit = Callable[[int, BagMessage], BagMessage | None]
"""Makes of a message, by its number, what is written; nothing for none."""


def rewritten(
    bag_path: Path,
    name: str | Path,
    edit: Edit = lambda _, message: message,
    *,
    attachments: Mapping[str, bytes] | None = None,
    topics: Sequence[Topic] = (),
    more: Sequence[BagMessage] = (),
    storage: Storage | None = None,
    custom: Mapping[str, str] | None = None,
    **said: object,
) -> Path:
    """
    Write a bag once more beside it, so that its checksums fit.

    ``attachments`` and ``topics`` stand for its own, ``more`` messages come last, and
    its run account says also what is ``said``.
    """
    bag = read_bag(bag_path)
    files = dict(bag.attachments if attachments is None else attachments)
    if said:
        files[RUN_FILE] = json.dumps(json.loads(files[RUN_FILE]) | said).encode()
    topics = topics or bag.topics
    numbers = {each.name: index for each_of in (topics, bag.topics)
               for index, each in enumerate(each_of)}  # fmt: skip
    attached = {key: ('', data) for key, data in files.items()}
    writer = BagWriter(bag_path.parent / name, topics, attached, storage)
    for index, message in enumerate(chain(bag.messages(), more)):
        edited = edit(index, message)
        if edited:
            writer.write(numbers[edited.topic], *edited[1:])
    writer.close(custom)
    return writer.folder


def told(folder: Path) -> Iterator[tuple[str, int, Any]]:
    """Yield topic, log time and message of a bag, as rosbags reads it."""
    with AnyReader([folder]) as reader:
        for connection, time, data in reader.messages():
            yield connection.topic, time, reader.deserialize(data, connection.msgtype)


def stamp_of(message: Any) -> int:
    """Return the stamp of a message of rosbags, in [ns]."""
    return int(message.header.stamp.sec) * SECOND + int(message.header.stamp.nanosec)


def answer(command: ModuleType, *typed: object, stop: Event | None = None) -> int:
    """Run a subcommand in this process, as ``linkage`` would; return its exit code."""
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return int(command.run(parser.parse_args([str(word) for word in typed]), stop or Event()))
