# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Description of a topic in a bag: type, definition and hash of the type, offered QoS.

`MessageSink` is what the messages of all topics of a run go to.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

CHANNELS_FILE = 'channels.mcap'
"""Name of an attachment of each of our files: an MCAP file with its topics and no messages."""

INFINITE = 2**63 - 1
"""Duration [ns] that rmw reads as 'no limit'; rosbag2 writes 9223372036 s 854775807 ns."""

# Up to metadata version 8 rosbag2 wrote the policies as the numbers of rmw's enumerations.
_NUMBERED = {
    'history': ('system_default', 'keep_last', 'keep_all', 'unknown'),
    'reliability': ('system_default', 'reliable', 'best_effort', 'unknown', 'best_available'),
    'durability': (
        'system_default',
        'transient_local',
        'volatile',
        'unknown',
        'best_available',
    ),
    'liveliness': (
        'system_default',
        'automatic',
        'manual_by_node',
        'manual_by_topic',
        'unknown',
        'best_available',
    ),
}


@dataclass(frozen=True, slots=True)
class QosProfile:
    """
    The quality of service that the recorded publisher offered.

    The values are rmw's: history 'keep_last' or 'keep_all', reliability 'reliable' or
    'best_effort', durability 'volatile' or 'transient_local', liveliness 'automatic' or
    'manual_by_topic'. Durations are in [ns]. `understood` is False if the profile in a bag could
    not be parsed; then the values are defaults.
    """

    history: str = 'keep_last'
    depth: int = 10
    reliability: str = 'reliable'
    durability: str = 'volatile'
    deadline: int = INFINITE
    lifespan: int = INFINITE
    liveliness: str = 'automatic'
    liveliness_lease_duration: int = INFINITE
    avoid_ros_namespace_conventions: bool = False
    understood: bool = True

    def to_mapping(self) -> dict[str, Any]:
        """Return the profile as rosbag2 writes it since metadata version 9, keys in its order."""
        return {
            'history': self.history,
            'depth': self.depth,
            'reliability': self.reliability,
            'durability': self.durability,
            'deadline': _to_time(self.deadline),
            'lifespan': _to_time(self.lifespan),
            'liveliness': self.liveliness,
            'liveliness_lease_duration': _to_time(self.liveliness_lease_duration),
            'avoid_ros_namespace_conventions': self.avoid_ros_namespace_conventions,
        }

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> QosProfile:
        """Parse the mapping that rosbag2, with any metadata version, wrote for a profile."""
        words: dict[str, Any] = {
            key: names[mapping[key]] if isinstance(mapping[key], int) else str(mapping[key])
            for key, names in _NUMBERED.items()
        }
        return cls(
            depth=int(mapping['depth']),
            deadline=_from_time(mapping['deadline']),
            lifespan=_from_time(mapping['lifespan']),
            liveliness_lease_duration=_from_time(mapping['liveliness_lease_duration']),
            avoid_ros_namespace_conventions=bool(mapping['avoid_ros_namespace_conventions']),
            **words,
        )


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic of a bag."""

    name: str  # Absolute: '/arm/joint_states'
    type: str  # noqa: A003  # 'sensor_msgs/msg/JointState'
    # Text of the type's .msg file, then for each type that it contains a line of 80 '=', a line
    # 'MSG: std_msgs/Header' and that type's text: MCAP's ros2msg.
    definition: str
    type_hash: str  # 'RIHS01_' and 64 hexadecimal digits (REP 2016)
    qos: QosProfile = QosProfile()  # Offered by the publisher


def _to_time(nanoseconds: int) -> dict[str, int]:
    sec, nsec = divmod(nanoseconds, 10**9)
    return {'sec': sec, 'nsec': nsec}


def _from_time(time: Mapping[str, int]) -> int:
    return int(time['sec']) * 10**9 + int(time['nsec'])


class MessageSink(Protocol):
    """Takes the messages of a run: a recorder, or a memory of its last seconds."""

    @property
    def offer(self) -> Callable[[int, int, int, bytes], None]:
        """Return what takes a message: topic, log time and publish time in [ns], CDR bytes."""
