# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Lost ticks, drops and warnings from the diagnostics of a run.

``diagnostic_msgs/msg/DiagnosticArray`` messages are decoded here, with bounds: any program may
have written the messages of a bag.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from linkage_ros.messages import MalformedError, parse_declaration, parse_message
from linkage_ros.tools.view.report.labels import shorten_text
from linkage_ros.tools.view.report.run import EventTrack

DIAGNOSTIC_ARRAY = parse_declaration(
    'Time stamp, string frame_id, DiagnosticStatus[] status',
    DiagnosticStatus=parse_declaration(
        'uint8 level, string name, string message, string hardware_id, KeyValue[] values',
        KeyValue=parse_declaration('string key, string value'),
    ),
)

_MOST_ITEMS = 10_000
"""Maximum number of statuses of a message, and of values of a status; more means damage."""

_LEVELS = {1: 'warning', 2: 'error', 3: 'stale'}
_TASKS = ('tick', 'crank', 'loop closure', 'recording', 'faults')

_COUNTED = {
    'Lost ticks': ('lost', ''),
    'Ticks open': ('told_open', 'open'),
    'Ticks indeterminate': ('told_open', 'indeterminate'),
    'Ticks at a toggle': ('told_toggle', ''),
    'Ticks beyond limits': ('told_limited', ''),
}
"""Counters that only grow, with the lane and the text of their events."""

_DROPPED = 'Dropped: '

MOST_VALUES = 500
"""Maximum number of values kept; our node reports some sixty."""


class DiagnosticStatus(NamedTuple):
    """The status of one task, with texts by key; level 0 is OK, 1 WARN, 2 ERROR, 3 STALE."""

    level: int
    name: str
    message: str
    values: Mapping[str, str]


def read_statuses(data: bytes) -> list[DiagnosticStatus]:
    """Return the statuses of a message; none if it is damaged."""
    try:
        statuses = parse_message(data, DIAGNOSTIC_ARRAY, _MOST_ITEMS)['status']
    except MalformedError:
        return []
    return [
        DiagnosticStatus(
            data[status['level'].first],
            _decode_text(status['name']),
            _decode_text(status['message']),
            {
                _decode_text(value['key']): _decode_text(value['value'])
                for value in status['values']
            },
        )
        for status in statuses
    ]


def _decode_text(text: bytes) -> str:
    return text.decode('utf-8', 'backslashreplace')


class RecordedDiagnostics:
    """
    Collects the diagnostics, and the tracks of their events by kind.

    The kinds are lost, told_open, told_toggle, told_limited, dropped and health. Counters start at
    0 if the bag holds the beginning of the run.
    """

    def __init__(
        self, event_tracks: Mapping[str, EventTrack], from_beginning: bool = True
    ) -> None:
        # The last values, by task and key; at most `MOST_VALUES`.
        self.last_values: dict[tuple[str, str], str] = {}
        self._lanes, self._from_beginning = event_tracks, from_beginning
        self._before = 0
        self._counts: dict[tuple[str, str], int] = {}

    def add_message(self, message: bytes, time: int) -> None:
        """Add a message at a run time in [ns]."""
        ours = [
            (task, status)
            for status in read_statuses(message)
            for task in _TASKS
            if status.name.endswith(f': {task}')
        ]
        for task, status in ours:
            self._add_status(task, status, time)
        if ours:
            self._before = time

    def _add_status(self, task: str, status: DiagnosticStatus, time: int) -> None:
        if status.level in _LEVELS:
            text = f'{_LEVELS[status.level]}, {task}: {status.message}'
            self._lanes['health'].add(self._before, time, text)
        for key, value in status.values.items():
            named = task, shorten_text(key)
            if named not in self.last_values and len(self.last_values) >= MOST_VALUES:
                continue
            self.last_values[named] = shorten_text(value)
            if key in _COUNTED:
                lane, what = _COUNTED[key]
                self._add_count(lane, what, named, value, time)
            elif key.startswith(_DROPPED):
                topic = key.removeprefix(_DROPPED)
                self._add_count('dropped', f'messages of {topic}', named, value, time)

    def _add_count(
        self, track: str, what: str, of: tuple[str, str], value: str, time: int
    ) -> None:
        if not value.isdecimal() or len(value) > 18:
            return
        count = int(value)
        known = self._counts.get(of, 0 if self._from_beginning else count)
        self._counts[of] = count
        # A counter of a restarted node begins at 0 again.
        more = count - known if count >= known else count
        if more:
            self._lanes[track].add(self._before, time, what, more)
