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


"""Chunks made larger again, and never larger than they say."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

LARGEST = 256 * 2**20
"""
What one record may take in memory, packed or unpacked [bytes].

rosbag2 makes chunks of less than 1 MiB. A few kilobytes that claim to be gigabytes are no bag.
"""


class DamagedError(Exception):
    """A record that is not whole, or not what it says; the text says why."""


def unpacked(data: bytes, compression: str, size: int) -> bytes:
    """
    Return the content of a chunk.

    Parameters
    ----------
    data
        As it stands in the file.
    compression
        '', 'lz4' or 'zstd'.
    size
        What it says to be when unpacked [bytes]; no byte more is unpacked to find out.

    Raises
    ------
    DamagedError
        It is of another size, or one that is not allowed, or cannot be unpacked.

    """
    if size > LARGEST:
        raise DamagedError(f'would be {size:,} bytes unpacked; no more than {LARGEST:,} are taken')
    if compression == '':
        content = data
    elif compression in _UNPACKERS:
        try:
            content = _UNPACKERS[compression](data, size + 1)
        except ImportError:
            raise DamagedError(
                f'is packed with {compression}, and Python knows no {compression} here'
            ) from None
        except Exception as error:  # noqa: BLE001 (each library has its own)
            raise DamagedError(f'cannot be unpacked: {error}') from None
    else:
        raise DamagedError(f'is packed in an unknown way, {compression!r}')
    if len(content) != size:
        raise DamagedError(f'is not of the {size:,} bytes that it says to be')
    return content


def _lz4(data: bytes, most: int) -> bytes:
    lz4: Any = import_module('lz4.frame')
    content: bytes = lz4.LZ4FrameDecompressor().decompress(data, max_length=most)
    return content


def _zstd(data: bytes, most: int) -> bytes:
    zstandard: Any = import_module('zstandard')
    with zstandard.ZstdDecompressor().stream_reader(data, read_across_frames=True) as stream:
        content: bytes = stream.read(most)
    return content


_UNPACKERS: dict[str, Callable[[bytes, int], bytes]] = {'lz4': _lz4, 'zstd': _zstd}
