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


"""How the chunks of a new bag are packed, as far as the libraries are here."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

from linkage_ros.bag.writing.storage import NONE
from linkage_ros.errors import RecordingError
from mcap.exceptions import UnsupportedCompressionError
from mcap.writer import CompressionType, Writer

_TYPES: Mapping[str, CompressionType] = {
    NONE: CompressionType.NONE,
    'lz4': CompressionType.LZ4,
    'zstd': CompressionType.ZSTD,
}
_LIBRARIES = {'lz4': 'lz4', 'zstd': 'zstandard'}


def compression_type(name: str, folder: Path) -> CompressionType:
    """
    Return mcap's compression of a name.

    Raises
    ------
    RecordingError
        Its library is missing here; ``folder`` is what was to be recorded to.

    """
    kind = _TYPES[name]
    try:
        Writer(BytesIO(), compression=kind)
    except UnsupportedCompressionError:
        library = _LIBRARIES[name]
        raise RecordingError(
            folder,
            f'cannot be packed with {name}: the Python package {library} is missing',
            f'install {library}, or set record.compression: {NONE}',
        ) from None
    return kind
