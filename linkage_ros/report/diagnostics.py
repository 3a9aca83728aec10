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
What ``diagnostic_msgs/msg/DiagnosticArray`` messages say, read as bytes.

The reader stands on its own: what a bag holds may have been written anywhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from linkage_ros.messages.layout import declared, MalformedError, parsed

DIAGNOSTIC_ARRAY = declared(
    'Time stamp, string frame_id, DiagnosticStatus[] status',
    DiagnosticStatus=declared(
        'uint8 level, string name, string message, string hardware_id, KeyValue[] values',
        KeyValue=declared('string key, string value'),
    ),
)

_MOST = 10_000
"""Statuses of a message, and values of a status; what says to have more is damaged."""


class Status(NamedTuple):
    """
    What one task says.

    Attributes
    ----------
    level
        0 OK, 1 WARN, 2 ERROR, 3 STALE.
    name
        Of the task.
    message
        In words.
    values
        By key, as text.

    """

    level: int
    name: str
    message: str
    values: Mapping[str, str]


def statuses(data: bytes) -> list[Status]:
    """Return the statuses of a message; none of one that is damaged."""
    try:
        found = parsed(data, DIAGNOSTIC_ARRAY, _MOST)['status']
    except MalformedError:
        return []
    return [
        Status(
            data[status['level'].first],
            _text(status['name']),
            _text(status['message']),
            {_text(value['key']): _text(value['value']) for value in status['values']},
        )
        for status in found
    ]


def _text(text: bytes) -> str:
    return text.decode('utf-8', 'backslashreplace')
