# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The topics that a run records: the one table for node, simulation, replay and metadata."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from typing import Any, NamedTuple

from linkage_ros.bag import QosProfile, WRENCH_TOPICS
from linkage_ros.messages import JOINT_STATE_TYPE
from linkage_ros.tick.pipeline import Pipeline

JOINT_STATES = 'joint_states_topic'
DIAGNOSTICS = 'diagnostics_topic'
CRANK = 'crank_topic'
FAULTS = 'faults_topic'
WITHHELD = 'withheld_topic'
RESETS = 'resets_topic'
DESCRIPTION = 'description_topic'
EXTRA = 'extra_topics'
"""Keys of the topics in the run's metadata. `EXTRA` and `WRENCH_TOPICS` may have several."""

SENSOR_QOS: QosProfile = QosProfile(depth=100, reliability='best_effort')
"""Sensor data QoS with a deeper queue: even at a slow tick every sample gets into the bag."""

LATCHED_QOS: QosProfile = QosProfile(depth=1, durability='transient_local')
"""As robot_state_publisher and RViz expect of a robot model, whenever they start."""

FAULTS_QOS: QosProfile = QosProfile(depth=100, durability='transient_local')
"""A late subscriber has to know which faults are on."""

_MODEL = 'robot_description'
_HEALTH = 'diagnostic_msgs/msg/DiagnosticArray'
_WRENCH = 'geometry_msgs/msg/WrenchStamped'
_STRING, _TIME = 'std_msgs/msg/String', 'builtin_interfaces/msg/Time'


class RunTopic(NamedTuple):
    """A topic that a run records."""

    key: str  # In the run's metadata
    name: str  # Before remapping
    type: str  # noqa: A003  # As package/msg/Type
    # Reliable and volatile by default, as robot_state_publisher and RViz expect.
    qos: QosProfile = QosProfile()
    asked_by: str = 'record'  # Key of the scene that asks for the topic


class RecordedTopics(NamedTuple):
    """
    Handles of the topics that a run records: their numbers in the bag; None for absent topics.

    The tick offers messages to the recorder by handle.
    """

    # Published by every run.
    joint_states: int
    diagnostics: int
    resets: int  # Resets, at which the pipeline is built again
    crank: int | None  # The topic of the drives
    faults: int | None  # Begin and end of faults
    suppressed: int | None  # Ticks without a message that a replay must know of
    wrenches: tuple[int, ...]  # The topics of the wrenches on links
    extras: tuple[int, ...]  # The auxiliary topics of the pipeline


def list_run_topics(pipeline: Pipeline, *, has_description: bool = False) -> list[RunTopic]:
    """
    Return the topics that a run of a pipeline records, in the order of their handles.

    With ``has_description`` the run publishes its robot model too, before the first tick.
    """
    table = [
        (True, RunTopic(JOINT_STATES, 'joint_states', JOINT_STATE_TYPE)),
        (True, RunTopic(DIAGNOSTICS, '/diagnostics', _HEALTH, QosProfile(depth=1))),
        (pipeline.topic, RunTopic(CRANK, pipeline.topic, JOINT_STATE_TYPE, SENSOR_QOS)),
        *(
            (True, RunTopic(WRENCH_TOPICS, wrench.topic, _WRENCH, SENSOR_QOS, 'loads.wrenches'))
            for wrench in pipeline.wrenches
        ),
        (pipeline.injection, RunTopic(FAULTS, '~/faults', _STRING, FAULTS_QOS, 'faults')),
        # Withheld ticks and resets are recorded for the replay only; nothing publishes them.
        (pipeline.suppresses_ticks, RunTopic(WITHHELD, '~/withheld', _TIME)),
        *(
            (True, RunTopic(EXTRA, extra.topic, extra.message, asked_by=f'effects.{extra.effect}'))
            for extra in pipeline.extras
        ),
        (True, RunTopic(RESETS, '~/resets', _TIME)),
        (has_description, RunTopic(DESCRIPTION, _MODEL, _STRING, LATCHED_QOS, _MODEL)),
    ]
    return [topic for is_present, topic in table if is_present]


def find_handles(topics: Iterable[RunTopic]) -> RecordedTopics:
    """Return the handles of the topics of a run."""
    handles: dict[str, list[int]] = defaultdict(list)
    for handle, topic in enumerate(topics):
        handles[topic.key].append(handle)
    optional = {key: next(iter(handles[key]), None) for key in (CRANK, FAULTS, WITHHELD)}
    return RecordedTopics(
        handles[JOINT_STATES][0],
        handles[DIAGNOSTICS][0],
        handles[RESETS][0],
        optional[CRANK],
        optional[FAULTS],
        optional[WITHHELD],
        tuple(handles[WRENCH_TOPICS]),
        tuple(handles[EXTRA]),
    )


def name_topics(topics: Iterable[tuple[str, str]]) -> dict[str, Any]:
    """Return the names of topics by their keys, as the run's metadata holds them."""
    pairs = list(topics)
    wrenches = [name for key, name in pairs if key == WRENCH_TOPICS]
    return {
        **{key: name for key, name in pairs if key not in {EXTRA, WRENCH_TOPICS}},
        EXTRA: [name for key, name in pairs if key == EXTRA],
        **({WRENCH_TOPICS: wrenches} if wrenches else {}),
    }
