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


"""The joint states of a bag that carries no scene of ours: every topic of them, as it is."""

from __future__ import annotations

from collections.abc import Mapping

from linkage_ros.bag.contents import Contents
from linkage_ros.bag.reader import Bag
from linkage_ros.report.blocks import Entry
from linkage_ros.report.clock import RunClock, times_of
from linkage_ros.report.joint_states import JointStates
from linkage_ros.report.own_curves import Kept, NO_ROOM, UNITS
from linkage_ros.report.room import STATES
from linkage_ros.report.run import Column, Run, Window
from linkage_ros.report.silences import Silences
from linkage_ros.report.spans import APART, Lane
from linkage_ros.report.words import short
import numpy as np

_TYPE = 'sensor_msgs/msg/JointState'
_MOST_TOPICS = 6
_DISORDER = 1_000_000_000
"""How late a message may stand in a bag that others have written, in [ns]."""

_MORE_TOPICS = f'topics of joint states beyond the first {_MOST_TOPICS}'
_LATER_JOINTS = 'messages with joints that turn up later'


class ForeignRun:
    """
    Reads a bag block by block.

    Parameters
    ----------
    bag
        The bag.
    window
        Which part is told.

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
        # Of several topics none is the one that must not be silent.
        if len(self._readers) == 1:
            self._lanes['silent'] = Lane(APART, window=window)
            self._silences = Silences(self._lanes['silent'], 0)
        self._later: dict[str, int] = {}

    def take(self, block: Mapping[str, list[Entry]]) -> None:
        """Take the messages of a block."""
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
                # The unit is not said: it is that of what turns, or of what slides.
                columns = [
                    Column(short(name), quantity, ' or '.join(units))
                    for quantity, units in UNITS.items()
                    for name in reader.joints
                ]
                room = STATES // len(self._readers)
                self._kept[topic] = Kept(topic, columns, room, self._window)
                self._widths[topic] = len(reader.joints)
            width = self._widths[topic]
            if numbers.shape[2] > width:
                later = ~np.isnan(numbers[:, :, width:]).all(axis=(1, 2))
                self._later[topic] = self._later.get(topic, 0) + int(later.sum())
            self._kept[topic].add(times, numbers[:, :, :width].reshape(len(times), 3 * width))
            if len(self._readers) == 1:
                self._silences.add(times)

    def end(self, contents: Contents) -> Run:
        """Return what there is to tell; with the counts of all messages."""
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
