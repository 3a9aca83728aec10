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


"""The bags of a run: where they go, what they say of themselves, and how they went."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime
import json
from os.path import lexists
from pathlib import Path
import platform

from linkage_ros import __version__
from linkage_ros.bag.reading.reader import RUN_FILE
from linkage_ros.bag.reading.run_events import BEGUN, MID_RUN, WITH_THE_RUN
from linkage_ros.bag.topic import Topic
from linkage_ros.bag.writing.recorder import Recorder, RecordingSummary
from linkage_ros.bag.writing.writer import BagWriter
from linkage_ros.errors import RecordingError
from linkage_ros.ros.tick_loop import TickLoop
from linkage_ros.scene.scene import RecordParameters, Scene
from rclpy.impl.rcutils_logger import RcutilsLogger

_DEFAULT = RecordParameters(directory='runs', name='', queue=20_000)
"""How a run is recorded that a service asks for where the scene says nothing."""


EXTRA = 'extra'
"""The key of a topic of which there may be several."""


class RunRecording:
    """
    Starts and stops the bags of a node, and keeps account of them.

    Parameters
    ----------
    logger
        Where it says what it does.

    """

    def __init__(self, logger: RcutilsLogger) -> None:
        self._logger = logger
        self.ended: list[RecordingSummary] = []
        """The recordings that have ended."""
        self.failure = ''
        """Why a recording could not be started or ended early; '' while none has."""

    def start(
        self,
        scene: Scene,
        loop: TickLoop,
        directory: str,
        topics: Callable[[], Sequence[tuple[str, Topic]]],
    ) -> str:
        """
        Start a bag that explains itself; return what came of it, as one line.

        Parameters
        ----------
        scene
            What is run; its files go into the bag.
        loop
            The tick, which from here on hands over what it takes and publishes.
        directory
            Where the bag's folder is made; '' for where the scene says.
        topics
            Returns what will be recorded, in the order of the tick's topic numbers, each with the
            key under which the bag's account of the run names it; that of several names a list.

        """
        record = scene.record or _DEFAULT
        try:
            described = topics()
            folder = _folder(Path(directory or record.directory), record.name, scene.name)
            # What a running tick remembers is not in the bag: a replay has to know.
            begun = MID_RUN if loop.running else WITH_THE_RUN
            files = _attachments(scene, described, begun)
            writer = BagWriter(folder, [t for _, t in described], files, record.storage)
        except RecordingError as error:
            self.failure = f'not recording: {error}'
            self._logger.error(self.failure)
            return self.failure
        loop.recorder = Recorder(
            writer, capacity=record.queue, flush_period=record.storage.flush_period
        )
        line = f'recording to {folder}'
        if record.name and folder.name != record.name:
            line += f': {record.name} exists already'
        self._logger.info(line)
        return line

    def stop(self, loop: TickLoop) -> str:
        """Close the bag, if there is one, and return what came of it, as one line."""
        if loop.recorder is None:
            return 'not recording'
        recorder, loop.recorder = loop.recorder, None
        summary = recorder.stop()
        self.ended.append(summary)
        counts = ', '.join(
            f'{t.name} {t.recorded} recorded {t.dropped} dropped'
            + (f' {t.let_go} let go' if t.let_go else '')
            for t in summary.topics
        )
        if summary.failure:
            self.failure = f'recording ended early: {summary.failure}'
            line = f'{self.failure}: {counts}'
            self._logger.error(line)
        else:
            line = f'recorded {summary.folder}: {counts}'
            self._logger.info(line)
        return line


def _attachments(
    scene: Scene, topics: Sequence[tuple[str, Topic]], begun: str
) -> dict[str, tuple[str, bytes]]:
    named = {key: topic.name for key, topic in topics if key != EXTRA}
    run = {
        'scene': scene.name,
        'scene_folder': str(Path(scene.folder).resolve()),
        **named,
        'extra_topics': [topic.name for key, topic in topics if key == EXTRA],
        BEGUN: begun,
        'linkage_ros': __version__,
        'python': platform.python_version(),
        'machine': platform.machine(),
    }
    return {
        **{name: ('application/yaml', data) for name, data in scene.files.items()},
        RUN_FILE: ('application/json', json.dumps(run).encode()),
    }


def _folder(directory: Path, name: str, scene: str) -> Path:
    """Return where a bag goes: one that exists keeps its name, and this one gets a number."""
    name = name or f'{scene}_{datetime.now().astimezone():%Y-%m-%d_%H-%M-%S}'
    folder, number = directory / name, 1
    while lexists(folder):
        number += 1
        folder = directory / f'{name}_{number}'
    return folder
