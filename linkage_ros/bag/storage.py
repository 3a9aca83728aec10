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


"""How a bag lies on the disk, and when it gets there: as the run goes, or when one asks for it."""

from __future__ import annotations

from dataclasses import dataclass
import os
from pathlib import Path

NONE = 'none'
COMPRESSIONS = (NONE, 'lz4', 'zstd')

FLUSH_AFTER = 0.9
"""
The part of the flush period after which the next flush begins: to wake, to write and to wait for
the disk take time too, and what is older than the period shall be on the disk.
"""

# What is written between two looks, a chunk and what a flush adds [bytes]: with it there is never
# less than was asked for.
_ON_ITS_WAY = 256 * 1024


@dataclass(frozen=True, slots=True)
class Storage:
    """
    How a bag is stored; by default as the run goes, in files of 1 GiB, not packed.

    Until a file ends, mcap keeps in memory where each of its chunks lies, and what is in it: that
    bounds a file.

    Attributes
    ----------
    flush_period
        What a power cut may cost [s]: how often the disk is waited for, and a tenth more.
    split_bytes
        Size at which the next file begins [bytes]; 0 for never.
    split_seconds
        Time after which the next file begins [s], by the log times; 0 for never.
    keep_files
        How many files are kept; 0 for all.
    min_free_bytes
        What stays free on the disk [bytes].
    compression
        'none', 'lz4' or 'zstd'.
    snapshot_seconds
        How much of the run is kept in memory until one asks for it [s], by the log times; 0 for a
        bag that is written as the run goes.
    snapshot_bytes
        How much memory that may take [bytes].

    """

    flush_period: float = 1.0
    split_bytes: int = 2**30
    split_seconds: float = 0.0
    keep_files: int = 0
    min_free_bytes: int = 0
    compression: str = NONE
    snapshot_seconds: float = 0.0
    snapshot_bytes: int = 256_000_000


def scarcity(folder: Path, least: int) -> str:
    """Return how much too little is free on the disk of a folder; '' where it is enough."""
    if not least:
        return ''
    disk = os.statvfs(folder)
    free = disk.f_bavail * disk.f_frsize
    if free >= least + _ON_ITS_WAY:
        return ''
    return (
        f'{free:,} bytes are free on its disk, fewer than min_free_bytes: {least:,} '
        f'and {_ON_ITS_WAY:,} to go on'
    )
