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


"""Where in a damaged file the next chunk or attachment begins whose checksum fits."""

from __future__ import annotations

from contextlib import suppress
import re

from linkage_ros.bag.reading.compression import DamagedError, LARGEST
from linkage_ros.bag.reading.records import HEAD, is_whole_attachment, is_whole_chunk, Source
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

_WINDOW = 2**20
_BLOCK = 4096
_BEYOND = max(HEAD.size, len(MCAP0_MAGIC))
# Of a record's length the upper half is zero: none of 4 GiB is taken. The look ahead consumes
# nothing, so that none is overlooked in the bytes of another.
_BEGINNING = re.compile(rb'[\x06\x09](?=.{4}\x00{4})|' + re.escape(MCAP0_MAGIC), re.DOTALL)
_MOST_IN_VAIN = 16
"""How often the size of the file is read for what only looks like a chunk."""


def next_whole(source: Source, at: int) -> int:
    """
    Return where the first chunk or attachment begins, from there on; the file's size if none does.

    What looks like one has to have a checksum that fits. A whole MCAP file within the file, as in
    an attachment, is passed over: its messages are not those of this file.
    """
    budget = _MOST_IN_VAIN * source.size + LARGEST
    while at < source.size:
        window, size = _window(source, at)
        goes_on = at + size
        for match in _BEGINNING.finditer(window):
            place = at + match.start()
            if place >= goes_on:
                break
            if match.group() == MCAP0_MAGIC:
                end = _end_of_file_at(source, place)
                if end:
                    goes_on = end
                    break
            elif _is_whole(source, place):
                return place
            else:
                budget -= max(source.head(place)[1] - place, 0)
                if budget < 0:
                    return source.size
        at = goes_on
    return source.size


def _window(source: Source, at: int) -> tuple[bytes, int]:
    """Return some bytes, and of how many of them the beginnings are to be looked at."""
    try:
        return source.read(at, min(_WINDOW + _BEYOND, source.size - at)), _WINDOW
    except DamagedError:
        # The disk cannot read them all; what is before and behind a bad block it can.
        with suppress(DamagedError):
            return source.read(at, min(_BLOCK + _BEYOND, source.size - at)), _BLOCK
    return b'', _BLOCK


def _is_whole(source: Source, at: int) -> bool:
    opcode, end = source.head(at)
    if end > source.size:
        return False
    if opcode == Opcode.CHUNK:
        return is_whole_chunk(source, at)
    return is_whole_attachment(source, at)


def _end_of_file_at(source: Source, at: int) -> int:
    """Return where an MCAP file that begins there ends, if it does before this one; else 0."""
    place = at + len(MCAP0_MAGIC)
    while place < source.size:
        window, size = _window(source, place)
        found = window.find(MCAP0_MAGIC)
        if found >= 0:
            end = place + found + len(MCAP0_MAGIC)
            return end if end < source.size else 0
        place += size
    return 0
