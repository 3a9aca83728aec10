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


"""What the end of a file says of its recording, where our writer has ended it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from linkage_ros.bag.account import ACCOUNT
from linkage_ros.bag.reading.compression import DamagedError
from linkage_ros.bag.reading.file_index import index_of
from linkage_ros.bag.reading.folder import custom_of, serialized_metadata
from linkage_ros.bag.reading.records import HEAD, Source, strict
from mcap.records import Metadata


class Ending(NamedTuple):
    """
    What the end of a file says.

    Attributes
    ----------
    custom
        ``custom_data`` of the bag, as it was when the file was ended.
    accounted
        Whether the account is there, the last record of a recording.

    """

    custom: Mapping[str, str]
    accounted: bool


def ending_of(file: Path) -> Ending:
    """Return what the end of a file says; nothing where it has no end, or a damaged one."""
    custom: Mapping[str, str] = {}
    accounted = False
    try:
        with file.open('rb') as stream:
            source = Source(stream)
            records = index_of(source).metadata
            accounted = any(each.name == ACCOUNT for each in records)
            # Where there are several, the last says what came of it in the end.
            said = [each for each in records if each.name == 'rosbag2'][-1:]
            for each in said:
                content = source.read(each.offset, each.length)
                # What others say there may take seconds to understand, and tells us nothing.
                if b'linkage_ros.' in content:
                    head = HEAD.size
                    record = strict(Metadata, content[head:])
                    custom = custom_of(serialized_metadata(record))
    except (DamagedError, OSError):
        pass  # to be met, and told, when the messages are read
    return Ending(custom, accounted)
