# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A bag of a counterfactual run: the samples of another bag, and a scene's output on them."""

from __future__ import annotations

from dataclasses import replace
import json
import os
from pathlib import Path
from typing import NamedTuple

from linkage_ros.bag import (
    Bag,
    BagWriter,
    BEGUN,
    FaultEvent,
    QosProfile,
    read_raw_metadata,
    ResetEvent,
    RUN_FILE,
    RunMetadata,
    SampleEvent,
    SEED,
    Topic,
    USER_EFFECTS,
    WITH_THE_RUN,
)
from linkage_ros.description import Scene
from linkage_ros.messages import JOINT_STATE_TYPE, time_message
from linkage_ros.replay import (
    Counterfactual,
    describe_topic,
    message_type,
    ReplayEvent,
    user_effects_here,
    versions_here,
)
from linkage_ros.tick import Pipeline

_FLUSHED_EVERY = 50_000
_TIME = 'builtin_interfaces/msg/Time'
_CHANGES_QOS = QosProfile(depth=100, durability='transient_local')


class ReplaySource(NamedTuple):
    """The origin of a new bag."""

    bag: Bag  # The bag
    run: RunMetadata  # The bag's run account; blank if it has none
    recorded: Scene | None  # The scene in the bag; None if there is none that can be read
    crank_topic: str  # Topic of the crank samples


class TopicNames(NamedTuple):
    """Names of the topics written beside the samples, as the bag's run named them."""

    joint_states: str
    faults: str
    withheld: str
    resets: str
    extras: tuple[str, ...]


def names_for(source: ReplaySource, scene: Scene, counterfactual: Counterfactual) -> TopicNames:
    """Return the names of the topics that a scene publishes."""
    run = source.run
    known: dict[str, str] = {}
    if source.recorded is not None and not source.recorded.not_imported:
        private = [extra.topic for extra in Pipeline(source.recorded).extras]
        known = dict(zip(private, run.extras, strict=False))
    pairs = {
        '~/withheld': run.withheld_topic,
        '~/faults': run.faults_topic,
        '~/resets': run.resets_topic,
        **known,
    }
    joint_states = run.joint_states_topic or '/joint_states'
    nodes = [name.removesuffix(key[1:]) for key, name in pairs.items() if name.endswith(key[1:])]
    node = nodes[0] if nodes else f'{joint_states.rpartition("/")[0]}/linkage_node'
    if joint_states == source.crank_topic:
        # On a shared topic, joints distinguish samples from states: they must be the run's joints.
        own = source.recorded.joint_names if source.recorded is not None else ()
        if run.crank_topic != joint_states or scene.joint_names != own:
            joint_states = f'{node}/joint_states'

    def resolve_key(key: str) -> str:
        return pairs.get(key) or f'{node}{key[1:]}'

    return TopicNames(
        joint_states,
        resolve_key('~/faults'),
        resolve_key('~/withheld'),
        resolve_key('~/resets'),
        tuple(resolve_key(extra.topic) for extra in counterfactual.extras),
    )


class ReplayBag:
    """
    A bag that is being written, to a new folder.

    LinkageError if it cannot be created, or the definition of a message is not installed.
    """

    def __init__(
        self,
        folder: Path,
        source: ReplaySource,
        scene: Scene,
        counterfactual: Counterfactual,
        names: TopicNames,
    ) -> None:
        bag = source.bag
        own = {topic.name: topic for topic in bag.topics}
        topics = [
            ('joint_states_topic', names.joint_states, JOINT_STATE_TYPE, QosProfile()),
            ('crank_topic', source.crank_topic, JOINT_STATE_TYPE, own[source.crank_topic].qos),
        ]
        if source.run.resets_topic:
            topics.append(('resets_topic', names.resets, _TIME, QosProfile()))
        if scene.faults:
            topics.append(('faults_topic', names.faults, 'std_msgs/msg/String', _CHANGES_QOS))
        if counterfactual.suppresses_ticks:
            topics.append(('withheld_topic', names.withheld, _TIME, QosProfile()))
        self._counterfactual = counterfactual
        self._numbers = {key: index for index, (key, *_) in enumerate(topics)}
        self._first_extra = len(topics)
        named = {key: name for key, name, _, _ in topics}
        described = [_describe_topic(bag, name, kind, qos) for _, name, kind, qos in topics]
        described += [
            _describe_topic(bag, name, extra.message, QosProfile())
            for name, extra in zip(names.extras, counterfactual.extras, strict=True)
        ]
        account = {
            'scene': scene.name,
            **named,
            'extra_topics': list(names.extras),
            BEGUN: WITH_THE_RUN,
            SEED: scene.seed,
            **({USER_EFFECTS: user_effects} if (user_effects := user_effects_here(scene)) else {}),
            **versions_here(),
            'made_from': {
                'bag': os.path.relpath(bag.path.resolve(), folder.resolve()),
                'run': read_raw_metadata(bag),
            },
        }
        files = {name: ('application/yaml', data) for name, data in scene.files.items()}
        files[RUN_FILE] = ('application/json', json.dumps(account).encode())
        self._writer = BagWriter(folder, described, files)
        self._written = [0] * len(described)
        self._unflushed = 0
        self._topics = described

    @property
    def message_counts(self) -> dict[str, int]:
        """Return the number of messages written on each topic."""
        return dict(zip((topic.name for topic in self._topics), self._written, strict=True))

    def write_event(self, event: ReplayEvent) -> None:
        """Write an event; raise RecordingError if it cannot be written."""
        if isinstance(event, SampleEvent):
            self._write_message(self._numbers['crank_topic'], *event)
        elif isinstance(event, FaultEvent):
            self._write_message(self._numbers['faults_topic'], *event)
        elif isinstance(event, ResetEvent):
            self._write_message(self._numbers['resets_topic'], *event)
        else:
            log_time, time, _, tick = event
            if tick is None:
                return
            if tick.message:
                self._write_message(
                    self._numbers['joint_states_topic'], log_time, time, tick.message
                )
            for number, message in enumerate(tick.extras, self._first_extra):
                if message:
                    self._write_message(number, log_time, time, message)
            if self._counterfactual.must_record(tick):
                withheld = time_message(time)
                self._write_message(self._numbers['withheld_topic'], log_time, time, withheld)

    def _write_message(self, number: int, log_time: int, publish_time: int, data: bytes) -> None:
        self._written[number] += self._writer.write(number, log_time, publish_time, data)
        self._unflushed += 1
        if self._unflushed == _FLUSHED_EVERY:
            self._writer.flush()
            self._unflushed = 0

    def close(self) -> None:
        """Finish the bag."""
        dropped = dict.fromkeys(self.message_counts, 0)
        self._writer.close({'linkage_ros.dropped': json.dumps(dropped)})


def _describe_topic(bag: Bag, name: str, kind: str, qos: QosProfile) -> Topic:
    """Describe a topic as the bag does for its type, or as the installed packages do."""
    for topic in bag.topics:
        if topic.type == kind and topic.definition:
            return replace(topic, name=name, qos=qos)
    return describe_topic(name, message_type(kind, '--scene'), qos)
