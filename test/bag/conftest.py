# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Fixtures of the tests of bags: joint states by rosbags, and the readers of mcap and rosbags."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from linkage_ros.bag import QosProfile, Topic
from mcap.reader import make_reader
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores

from ..support import disks

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPE = 'sensor_msgs/msg/JointState'
START = 1_700_000_000_000_000_000


class Written(NamedTuple):
    """A message as a test gives it to the writer."""

    topic: int
    log_time: int
    publish_time: int
    data: bytes


def _topic(name: str, qos: QosProfile) -> Topic:
    definition, _ = STORE.generate_msgdef(TYPE, ros_version=2)
    return Topic(name, TYPE, definition, STORE.hash_rihs01(TYPE), qos)


@pytest.fixture
def topics():
    """Return what the node records: the crank that came in, the joints that went out."""
    return (
        _topic('/crank', QosProfile(depth=5, reliability='best_effort')),
        _topic('/arm/joint_states', QosProfile()),
    )


@pytest.fixture(scope='session')
def messages():
    """Return 12000 joint states on two topics; the log times of the two are out of order."""
    joint_state = STORE.types[TYPE]
    header = STORE.types['std_msgs/msg/Header']
    time = STORE.types['builtin_interfaces/msg/Time']
    written = []
    for index in range(12_000):
        tick, topic = divmod(index, 2)
        stamp = START + tick * 1_000_000
        message = joint_state(
            header(time(stamp // 10**9, stamp % 10**9), f'frame {index}'),
            ['coupler_joint', 'rocker_joint'],
            np.array([0.001 * tick, -0.002 * index]),
            np.array([1.0, -2.0]),
            np.array([]),
        )
        data = bytes(STORE.serialize_cdr(message, TYPE))
        # The joints go out 1.3 ms before the crank that came in is handed over, every fifth time.
        log_time = stamp + 100_000 - (1_300_000 if topic and tick % 5 == 0 else 0)
        written.append(Written(topic, log_time, stamp, data))
    return written


class Readers:
    """The two readers that the bags have to satisfy."""

    @staticmethod
    def mcap(file: Path) -> list[tuple[str, int, int, bytes]]:
        """Return topic, log time, publish time and bytes, in the order of the file."""
        with file.open('rb') as stream:
            return [
                (channel.topic, message.log_time, message.publish_time, message.data)
                for _, channel, message in make_reader(stream, validate_crcs=True).iter_messages(
                    log_time_order=False
                )
            ]

    @staticmethod
    def rosbags(folder: Path) -> list[tuple[str, int, bytes]]:
        """Return topic, log time and bytes, in the order of log times."""
        with AnyReader([folder]) as reader:
            return [
                (connection.topic, log_time, bytes(data))
                for connection, log_time, data in reader.messages()
            ]

    @staticmethod
    def deserialized(folder: Path) -> Iterator[tuple[str, Any]]:
        """Yield topic and message, by the type that the bag itself carries."""
        with AnyReader([folder]) as reader:
            for connection, _, data in reader.messages():
                yield connection.topic, reader.deserialize(data, connection.msgtype)

    def agree(self, folder: Path, topics: tuple[Topic, ...], written: list[Written]) -> None:
        """Assert that both find these messages and no others."""
        expected = [(topics[m.topic].name, m.log_time, m.publish_time, m.data) for m in written]
        assert self.mcap(folder / f'{folder.name}_0.mcap') == expected
        assert sorted(self.rosbags(folder)) == sorted(
            (n, log, data) for n, log, _, data in expected
        )


@pytest.fixture
def readers():
    return Readers()


@pytest.fixture
def small_disk(tmp_path):
    """Return a disk of 2 MiB, where it can be mounted."""
    with disks.small_disk(tmp_path, 2) as folder:
        yield folder
