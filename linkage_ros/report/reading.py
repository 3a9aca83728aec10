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


"""
Read a bag once, from beginning to end, for its page; memory does not grow with the bag.

A bag without a scene of this package is shown by all its joint state topics, as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from linkage_ros.bag.contents import Contents
from linkage_ros.bag.reader import Bag
from linkage_ros.bag.run_events import run_account
from linkage_ros.errors import LinkageError
from linkage_ros.replay.replay import recorded_scene
from linkage_ros.report.blocks import Blocks, Entry, Progress, RunClock, times_of
from linkage_ros.report.curves import Kept, NO_ROOM, UNITS
from linkage_ros.report.decimation import STATE_BYTES
from linkage_ros.report.joint_states import JointStates
from linkage_ros.report.labels import short
from linkage_ros.report.run import APART, Column, Lane, Run, Silences, Window
from linkage_ros.report.scene_run import SceneRun
from linkage_ros.scene.scene import Scene
import numpy as np

_TYPE = 'sensor_msgs/msg/JointState'
_MOST_TOPICS = 6
_DISORDER = 1_000_000_000
"""By how much a message may come late in a bag of another program, in [ns]."""

_MORE_TOPICS = f'topics of joint states beyond the first {_MOST_TOPICS}'
_LATER_JOINTS = 'messages with joints that turn up later'


class ForeignRun:
    """
    Reads a bag without a scene, block by block.

    Parameters
    ----------
    bag
        The bag.
    window
        The part of the run to show.

    """

    def __init__(self, bag: Bag, window: Window) -> None:
        found = [topic.name for topic in bag.topics if topic.type == _TYPE]
        self._window, self._clock = window, RunClock(_DISORDER)
        self.topics = set(found[:_MOST_TOPICS])
        self._more = found[_MOST_TOPICS:]
        self._readers = {topic: JointStates() for topic in found[:_MOST_TOPICS]}
        self._kept: dict[str, Kept] = {}
        self._widths: dict[str, int] = {}
        self._lanes = {'jump': Lane(window=window)}
        # Among several topics, none is known to publish all the time.
        if len(self._readers) == 1:
            self._lanes['silent'] = Lane(APART, window=window)
            self._silences = Silences(self._lanes['silent'], 0)
        self._later: dict[str, int] = {}

    def take(self, block: Mapping[str, list[Entry]]) -> None:
        """Add the messages of a block."""
        entries = sorted(
            (*entry, topic) for topic in self.topics for entry in block.get(topic, ())
        )
        passed = self._clock.passed(times_of([entry[1] for entry in entries]))
        for time, by in self._clock.jumps():
            self._lanes['jump'].add(time, time, f'by {by / 1e9:.6g} s')
        for topic, reader in self._readers.items():
            own = [i for i, entry in enumerate(entries) if entry[4] == topic]
            if not own:
                continue
            read = reader.read([entries[i][3] for i in own])
            times, numbers = passed[own][read.good], read.numbers[read.good]
            if not len(times):
                continue
            if topic not in self._kept:
                # The message has no unit; the joint may be revolute or prismatic.
                columns = [
                    Column(short(name), quantity, ' or '.join(units))
                    for quantity, units in UNITS.items()
                    for name in reader.joints
                ]
                space = STATE_BYTES // len(self._readers)
                self._kept[topic] = Kept(topic, columns, space, self._window)
                self._widths[topic] = len(reader.joints)
            width = self._widths[topic]
            if numbers.shape[2] > width:
                later = ~np.isnan(numbers[:, :, width:]).all(axis=(1, 2))
                self._later[topic] = self._later.get(topic, 0) + int(later.sum())
            self._kept[topic].add(times, numbers[:, :, :width].reshape(len(times), 3 * width))
            if len(self._readers) == 1:
                self._silences.add(times)

    def end(self, contents: Contents) -> Run:
        """Return the run, with the counts of all messages."""
        if len(self._readers) == 1:
            self._silences.end(self._clock.end)
        found = [curves for kept in self._kept.values() if (curves := kept.curves()) is not None]
        left_out = {
            (topic, reason): count
            for topic, reader in self._readers.items()
            for reason, count in reader.left_out.items()
            if count
        }
        left_out |= {
            (topic, _LATER_JOINTS): count for topic, count in self._later.items() if count
        }
        left_out |= {
            (topic, NO_ROOM): kept.left_out for topic, kept in self._kept.items() if kept.left_out
        }
        counts = {topic.topic.name: topic.messages for topic in contents.topics}
        left_out |= {(topic, _MORE_TOPICS): counts.get(topic, 0) for topic in self._more}
        return Run(
            begin=self._clock.begin,
            end=self._clock.end,
            window=self._window,
            contents=contents,
            curves=found,
            lanes=self._lanes,
            left_out=left_out,
        )


def read_run(
    bag: Bag,
    window: Window,
    progress: Progress,
    scene_of: Callable[[Bag], Scene] = recorded_scene,
) -> tuple[Run, Scene | None, str]:
    """
    Read a bag for its page.

    Parameters
    ----------
    bag
        The bag. If it is damaged, the part before the damage is shown.
    window
        The part of the run to show.
    progress
        Called with the progress; returns whether to stop.
    scene_of
        Returns the scene that a bag carries.

    Returns
    -------
    run
        Its contents.
    scene
        Its scene, if it carries one.
    missing
        Why the scene is missing, or cannot be built here; '' if it is complete.

    """
    scene, missing = None, ''
    reader: SceneRun | ForeignRun
    try:
        scene = scene_of(bag)
        reader = SceneRun(bag, run_account(bag), scene, window)
    except LinkageError as error:
        # A page is passed on to others: it shows the bag's name, not its path.
        missing = f'{Path(error.where).name}: {error.reason}'
        reader = ForeignRun(bag, window)
    blocks = Blocks(bag, reader.topics, progress)
    for block in blocks:
        reader.take(block)
    return reader.end(blocks.contents()), scene, missing
