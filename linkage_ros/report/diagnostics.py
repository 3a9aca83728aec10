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
from struct import error as StructError
from struct import Struct
from typing import NamedTuple

from linkage_ros.cdr import aligned, STAMP_END

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
    """Return what a message says; nothing of one that is damaged."""
    order = {b'\x00\x00': '>', b'\x00\x01': '<'}.get(data[:2])
    if order is None:
        return []
    try:
        return _Cursor(data, Struct(f'{order}I')).statuses()
    except (StructError, IndexError):
        return []


class _Cursor:
    """Goes through a message from its header on."""

    def __init__(self, data: bytes, count: Struct) -> None:
        self._data, self._count, self._at = data, count, STAMP_END
        self._text()

    def statuses(self) -> list[Status]:
        return [self._status() for _ in range(self._size())]

    def _status(self) -> Status:
        level = self._data[self._at]
        self._at += 1
        name, message, _ = self._text(), self._text(), self._text()
        pairs = [(self._text(), self._text()) for _ in range(self._size())]
        return Status(level, name, message, dict(pairs))

    def _size(self) -> int:
        at = aligned(self._at, 4)
        self._at = at + 4
        (number,) = self._count.unpack_from(self._data, at)
        if number > _MOST:
            raise StructError
        return int(number)

    def _text(self) -> str:
        at = aligned(self._at, 4)
        (length,) = self._count.unpack_from(self._data, at)
        start = at + 4
        self._at = start + length
        if self._at > len(self._data):
            raise StructError
        end = self._at - 1
        return self._data[start:end].decode('utf-8', 'backslashreplace')
