# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages of a single value: ``builtin_interfaces/msg/Time`` and ``std_msgs/msg/String``."""

from __future__ import annotations

from linkage_ros.messages.layout import (
    compile_packing,
    NANOSECONDS,
    pack_message,
    parse_declaration,
    parse_message,
)

_PACK_TIME, (_ENCAPSULATION,) = compile_packing(
    pack_message(parse_declaration('Time time'), {}), ()
)
_STRING = parse_declaration('string data')

TIME_END = 2**31 * NANOSECONDS
"""Upper bound of message stamps (exclusive), in [ns]."""


def time_message(time: int) -> bytes:
    """Return a ``builtin_interfaces/msg/Time``, of a time in [ns]."""
    return _PACK_TIME(_ENCAPSULATION, *divmod(time, NANOSECONDS))


def text_message(text: str) -> bytes:
    """Return a ``std_msgs/msg/String``."""
    return pack_message(_STRING, {'data': text})


def text_of(message: bytes) -> str:
    """Return the text of a ``std_msgs/msg/String``; raise `ValueError` for other bytes."""
    data: bytes = parse_message(message, _STRING)['data']
    return data.decode()
