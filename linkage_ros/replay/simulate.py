# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A run without a ROS graph: the node's tick loop, as fast as it goes, on its own time.

Tick k is at `BEGIN` plus k periods, to the whole nanosecond. The bag is what a node of this
scene would record, so that its replay gives the same bytes. Nothing of rclpy is imported.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import floor
from pathlib import Path
from typing import TYPE_CHECKING

from linkage_ros.bag import BagWriter, DirectRecorder, WITH_THE_RUN
from linkage_ros.description import Scene
from linkage_ros.errors import LinkageError
from linkage_ros.messages import text_message
from linkage_ros.replay.node_messages import change_text
from linkage_ros.replay.run_files import scene_files, to_attachments
from linkage_ros.replay.topic_description import describe_topic, message_type
from linkage_ros.signals import heed_signals
from linkage_ros.stages.drives import describe_chatter
from linkage_ros.tick import list_run_topics, Pipeline, TickLoop

if TYPE_CHECKING:
    from linkage_ros.stages.faults import FaultChange

BEGIN = 1_000_000_000
"""Time of the first tick, in [ns]: a stamp of 0 means none in ROS."""

MOST_TICKS = 100_000_000

_NODE = '/linkage_node'
_ASKED_EVERY = 50


def check_simulated(scene: Scene, seconds: float) -> int:
    """
    Return the number of ticks of a simulation, the last at its end.

    Raise `FileError` if a drive or a load waits for messages, and `LinkageError` if there are too
    many ticks.
    """
    for scene_linkage in scene.linkages:
        if scene_linkage.drive[1].is_measured:
            raise scene_linkage.content.error(
                'drive',
                'topic waits for samples, and there are none',
                'write another drive, such as constant_rate; bag takes the samples of a run',
            )
        if scene_linkage.loads is not None and scene_linkage.loads.applied.wrenches:
            raise scene_linkage.content.error(
                'loads.wrenches',
                'wait for messages, and there are none',
                'leave them out, or write forces and efforts over_time instead',
            )
    ticks = floor(seconds * scene.rate * (1.0 + 1e-12)) + 1
    if ticks > MOST_TICKS:
        raise LinkageError(
            '--seconds', f'{seconds:g} are {ticks:,} ticks, more than {MOST_TICKS:,}', 'take fewer'
        )
    return ticks


def tick_times(scene: Scene, ticks: int) -> Sequence[int]:
    """Return the times of ticks, in [ns]."""
    return [BEGIN + round(index * 1e9 / scene.rate) for index in range(ticks)]


def simulate_run(
    scene: Scene,
    folder: Path,
    ticks: int,
    keep_going: Callable[[int], bool],
    warn: Callable[[str], None] = lambda _: None,
) -> dict[str, int]:
    """
    Run a scene, and write what its node would record; return the number of messages by topic.

    ``folder`` must not exist yet. ``keep_going`` is called now and then with the number of ticks
    so far; if it returns False, the run ends and the bag is complete up to there. Signals only set
    the stop event: ``keep_going`` has to look at it. ``warn`` receives, at the end, a line on what
    a node would have warned of. Raise `LinkageError` if parts of the scene do not fit together, or
    if the bag cannot be written.
    """
    first = Pipeline(scene)
    kinds = {name: fault.kind for name, fault in scene.faults.items()}

    def change_message(change: FaultChange) -> bytes:
        return text_message(change_text(change, kinds[change.name]))

    def ignore_message(_message: bytes) -> None:
        """Take a message that nobody receives."""

    loop = TickLoop(
        partial(Pipeline, scene, first.closures, first.injection),
        None,
        ignore_message,
        None,
        [ignore_message] * len(first.extras),
        change_message,
    )
    table = list_run_topics(first)
    topics = [
        describe_topic(_resolve(topic.name), message_type(topic.type, 'scene'), topic.qos)
        for topic in table
    ]
    names = [(row.key, topic.name) for row, topic in zip(table, topics, strict=True)]
    files = scene_files(scene, names, WITH_THE_RUN, folder)
    # A signal ends the run between two ticks: raised here, it would cut a record of the bag.
    with heed_signals():
        writer = BagWriter(folder, topics, to_attachments(files))
        loop.recorder = recorder = DirectRecorder(writer)
        try:
            for index, now in enumerate(tick_times(scene, ticks)):
                if not index % _ASKED_EVERY and not keep_going(index):
                    break
                loop.tick_at(now)
        finally:
            recorder.close()
    for linkage in loop.pipeline.linkages:
        if linkage.drive.chatter_count:
            warn(describe_chatter(linkage.drive.chatter_count))
    return recorder.message_counts


def _resolve(name: str) -> str:
    """Return a name as the node resolves it, without a namespace and without remapping."""
    return f'/{name}'.replace('//', '/').replace('/~', _NODE)
