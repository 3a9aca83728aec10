# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A bag of a counterfactual run: the samples of another bag, and a scene's output on them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
import json
import os
from pathlib import Path
from typing import NamedTuple

from linkage_ros.bag import (
    Bag,
    BagWriter,
    BEGUN,
    DirectRecorder,
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
from linkage_ros.messages import time_message
from linkage_ros.replay import (
    Counterfactual,
    CounterfactualTick,
    describe_topic,
    message_type,
    ReplayEvent,
    to_attachments,
    user_effects_here,
    versions_here,
)
from linkage_ros.tick import (
    CRANK,
    DIAGNOSTICS,
    EXTRA,
    FAULTS,
    JOINT_STATES,
    name_topics,
    Pipeline,
    RESETS,
    RunTopic,
    WITHHELD,
)

_EVENT_KEYS: dict[type[ReplayEvent], str] = {
    SampleEvent: CRANK,
    FaultEvent: FAULTS,
    ResetEvent: RESETS,
}
"""Key of the topic of each event that is a message."""


class ReplaySource(NamedTuple):
    """The origin of a new bag."""

    bag: Bag  # The bag
    run: RunMetadata  # The bag's run account; blank if it has none
    recorded: Scene | None  # The scene in the bag; None if there is none that can be read
    crank_topic: str  # Topic of the crank samples


TopicNames = Mapping[RunTopic, str]
"""Names of the topics of a new bag, as the source's run named them."""


def names_for(source: ReplaySource, scene: Scene, counterfactual: Counterfactual) -> TopicNames:
    """Return the names of the topics that a scene publishes, in the order of the bag."""
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
    chosen = {JOINT_STATES: joint_states, CRANK: source.crank_topic}
    left_out = {DIAGNOSTICS} if run.resets_topic else {DIAGNOSTICS, RESETS}
    return {
        topic: chosen.get(topic.key) or pairs.get(topic.name) or f'{node}{topic.name[1:]}'
        for topic in counterfactual.topics
        if topic.key not in left_out
    }


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
        self._counterfactual = counterfactual
        keys = [topic.key for topic in names]
        self._handles = {key: keys.index(key) for key in keys}
        described = [
            _describe_topic(
                bag,
                name,
                topic.type,
                own[name].qos if topic.key == CRANK else topic.qos,
            )
            for topic, name in names.items()
        ]
        account = {
            'scene': scene.name,
            **name_topics(zip(keys, names.values(), strict=True)),
            BEGUN: WITH_THE_RUN,
            SEED: scene.seed,
            **({USER_EFFECTS: user_effects} if (user_effects := user_effects_here(scene)) else {}),
            **versions_here(),
            'made_from': {
                'bag': os.path.relpath(bag.path.resolve(), folder.resolve()),
                'run': read_raw_metadata(bag),
            },
        }
        files = to_attachments({**scene.files, RUN_FILE: json.dumps(account).encode()})
        self._recorder = DirectRecorder(BagWriter(folder, described, files))

    @property
    def message_counts(self) -> dict[str, int]:
        """Return the number of messages written on each topic."""
        return self._recorder.message_counts

    def write_event(self, event: ReplayEvent) -> None:
        """Write an event; raise RecordingError if it cannot be written."""
        offer, handles = self._recorder.offer, self._handles
        if not isinstance(event, CounterfactualTick):
            offer(handles[_EVENT_KEYS[type(event)]], *event)
            return
        log_time, time, tick = event.log_time, event.time, event.tick
        if tick is None:
            return
        if tick.message:
            offer(handles[JOINT_STATES], log_time, time, tick.message)
        for number, message in enumerate(tick.extras, handles.get(EXTRA, 0)):
            if message:
                offer(number, log_time, time, message)
        if self._counterfactual.must_record(tick):
            offer(handles[WITHHELD], log_time, time, time_message(time))

    def close(self) -> None:
        """Finish the bag."""
        self._recorder.close()


def _describe_topic(bag: Bag, name: str, kind: str, qos: QosProfile) -> Topic:
    """Describe a topic as the bag does for its type, or as the installed packages do."""
    for topic in bag.topics:
        if topic.type == kind and topic.definition:
            return replace(topic, name=name, qos=qos)
    return describe_topic(name, message_type(kind, '--scene'), qos)
