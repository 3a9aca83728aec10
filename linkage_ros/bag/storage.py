# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How a bag is stored: its files, their compression, and what stays in memory."""

from dataclasses import dataclass

NONE = 'none'

COMPRESSIONS = (NONE, 'lz4', 'zstd')
"""Names of compressions; `bag_file.compression_type` is mcap's."""


@dataclass(frozen=True, slots=True)
class Storage:
    """
    Storage settings of a bag; by default written continuously, in uncompressed files of 1 GiB.

    Until a file ends, mcap keeps in memory the positions of its chunks and messages, so the size
    of a file must be limited.
    """

    # Time whose messages a power cut may lose [s]: the flush period, and a tenth more.
    flush_period: float = 1.0
    split_bytes: int = 2**30  # Size after which the next file begins [bytes]; 0 for never
    # Duration after which the next file begins [s], by log times; 0 for never.
    split_seconds: float = 0.0
    keep_files: int = 0  # Number of files to keep; 0 for all
    min_free_bytes: int = 0  # Space to leave free on the disk [bytes]
    compression: str = NONE  # 'none', 'lz4' or 'zstd'
    # Duration of the run to keep in memory until a snapshot is requested [s], by log times; 0 to
    # write the bag continuously.
    snapshot_seconds: float = 0.0
    snapshot_bytes: int = 256_000_000  # Most memory for it [bytes]
