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


"""The bag of a run: where it goes, what it says of itself, and how it went."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
import json
from pathlib import Path
import platform

from linkage_ros import __version__
from linkage_ros.bag.recorder import Recorder, RecordingSummary
from linkage_ros.bag.replay import RUN_FILE
from linkage_ros.bag.topic import Topic
from linkage_ros.bag.writer import BagWriter
from linkage_ros.ros.tick_loop import CRANK, JOINT_STATES
from linkage_ros.scene.scene import RecordParameters, Scene

_DEFAULT = RecordParameters(directory='runs', name='', queue=20_000)
"""How a run is recorded that a service asks for where the scene says nothing."""


def start_recording(scene: Scene, directory: str, topics: Sequence[Topic]) -> Recorder:
    """
    Start a bag that explains itself.

    Parameters
    ----------
    scene
        What is run; its files go into the bag.
    directory
        Where the bag's folder is made; '' for where the scene says.
    topics
        What will be recorded, in the order of the tick's topic numbers.

    Raises
    ------
    RecordingError
        Where the folder exists or cannot be written.

    """
    record = scene.record or _DEFAULT
    run = {
        'scene': scene.name,
        'crank_topic': topics[CRANK].name,
        'joint_states_topic': topics[JOINT_STATES].name,
        'linkage_ros': __version__,
        'python': platform.python_version(),
        'machine': platform.machine(),
    }
    attachments = {
        **{name: ('application/yaml', data) for name, data in scene.files.items()},
        RUN_FILE: ('application/json', json.dumps(run).encode()),
    }
    folder = _folder(Path(directory or record.directory), record.name, scene.name)
    return Recorder(BagWriter(folder, topics, attachments), capacity=record.queue)


def counted(summary: RecordingSummary) -> str:
    """Return the counts of a recording as one line."""
    return ', '.join(f'{t.name} {t.recorded} recorded {t.dropped} dropped' for t in summary.topics)


def _folder(directory: Path, name: str, scene: str) -> Path:
    if name:
        return directory / name
    dated = f'{scene}_{datetime.now().astimezone():%Y-%m-%d_%H-%M-%S}'
    folder, number = directory / dated, 1
    while folder.exists():
        number += 1
        folder = directory / f'{dated}_{number}'
    return folder
