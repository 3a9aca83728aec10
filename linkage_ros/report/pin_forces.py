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


"""Curves of the forces in pins and sliders, from the messages that `pin_forces` publishes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from linkage_ros.messages.joint_values import MessageValues, Values, WRENCHES
from linkage_ros.report.curves import BoundedCurves
from linkage_ros.report.decimation import FORCE_BYTES, Times
from linkage_ros.report.joint_states import MOST_JOINTS
from linkage_ros.report.labels import short
from linkage_ros.report.run import Column, Curves, Window
import numpy as np

LATER_PINS = 'pins that turn up later'


class PinForces:
    """
    Collects the forces of the window from their topics, one of each linkage.

    Messages, or pins of messages, that are ``left_out`` are counted by reason.
    """

    def __init__(self, topics: str, window: Window) -> None:
        self._topics, self._window = topics, window
        self._reader = MessageValues(WRENCHES)
        self._places: dict[str, int] = {}
        self._kept: BoundedCurves | None = None
        self.left_out: Counter[str] = Counter()

    def add(self, times: Times, messages: Sequence[bytes]) -> None:
        """Add messages at run times in [ns]; those of one time, of several linkages, are a row."""
        good: list[tuple[int, Values]] = []
        for time, message in zip(times.tolist(), messages, strict=True):
            values = self._reader.read(message)
            if isinstance(values, str):
                self.left_out[values] += 1
            elif values.numbers:
                good.append((time, values))
        if not good:
            return
        if self._kept is None:
            names = list(dict.fromkeys(name for _, values in good for name in values.names))
            self._places = {name: place for place, name in enumerate(names[:MOST_JOINTS])}
            columns = [
                Column(short(name), quantity, unit)
                for quantity, unit in (('force', 'N'), ('moment', 'N·m'))
                for name in self._places
            ]
            self._kept = BoundedCurves(self._topics, columns, FORCE_BYTES, self._window)
        rows = {time: row for row, time in enumerate(sorted({time for time, _ in good}))}
        numbers = np.full((len(rows), 2, len(self._places)), np.nan)
        for time, values in good:
            wrenches = np.reshape(values.numbers, (-1, 3))
            for name, (x, y, moment) in zip(values.names, wrenches, strict=True):
                if name in self._places:
                    numbers[rows[time], :, self._places[name]] = np.hypot(x, y), moment
                else:
                    self.left_out[LATER_PINS] += 1
        self._kept.add(np.array([*rows]), numbers.reshape(len(rows), -1))

    def curves(self) -> Curves | None:
        """Return the curves, without moments that are zero, as in pins; None without messages."""
        found = None if self._kept is None else self._kept.curves()
        if found is None:
            return None
        first, second = found.intervals.first, found.intervals.second
        kept = [
            place
            for place, column in enumerate(found.columns)
            if column.quantity == 'force'
            or np.nan_to_num([first[:, place], second[:, place]]).any()
        ]
        return found._replace(
            columns=[found.columns[place] for place in kept],
            intervals=found.intervals._replace(first=first[:, kept], second=second[:, kept]),
        )
