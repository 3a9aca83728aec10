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


"""What a scene says, as frozen types."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from linkage_ros.drives.topic import TopicParameters
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.scene.section import Section


@dataclass(frozen=True, slots=True)
class RecordParameters:
    """
    How a run is recorded.

    Attributes
    ----------
    directory
        Folder in which the bags' own folders are made, relative to where the node was started.
    name
        Name of the bag's folder; '' for the scene's name and the time.
    queue
        How many messages wait for the disk before further ones are dropped.

    """

    directory: str
    name: str
    queue: int


@dataclass(frozen=True, slots=True)
class Scene:
    """
    A linkage, its drive, its effects and its recording.

    Attributes
    ----------
    name
        The scene file's name without its ending.
    linkage
        The linkage.
    rate
        Ticks a second, in [Hz]; 0 for one tick for every crank sample.
    wrapped
        Whether published angles are wrapped to (−π, π], or run on beyond a turn.
    drive
        Where the crank comes from.
    effects
        What is called for beyond positions, as written: its modules read it when it is built.
    record
        How the run is recorded; absent for no bag.
    files
        The scene and linkage files as they stand, by a name for each.

    """

    name: str
    linkage: Linkage
    rate: float
    wrapped: bool
    drive: TopicParameters
    effects: Section
    record: RecordParameters | None
    files: Mapping[str, bytes]
