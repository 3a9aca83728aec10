# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Bags in other forms: packed files are unpacked; formats that are not MCAP get one line.

rosbag2 with file compression writes ``NAME_0.mcap.zstd``. Such a file is unpacked into the folder
for temporary files, once in a process, and removed at its end. Its unpacked size is bounded.
"""

from __future__ import annotations

import atexit
from functools import cache
from importlib import import_module
from pathlib import Path
import shutil
from tempfile import mkdtemp
from typing import Any

from linkage_ros.errors import BagError, name_instead

MCAP_SUFFIXES = '.mcap', '.mcap.zstd'
BAG_SUFFIXES = *MCAP_SUFFIXES, '.db3', '.db3.zstd', '.bag'
"""Suffixes of files that are bags, or parts of one; MCAP files are read."""

MOST_UNPACKED, MOST_TIMES = 256 * 2**20, 200
"""Bounds on the unpacked size of a file: bytes, or multiples of its own size."""

_ZSTD = b'\x28\xb5\x2f\xfd'
_PIECE = 2**20

_SQLITE = (
    'convert it: ros2 bag convert -i BAG -o x.yaml, where x.yaml holds '
    'output_bags: [{uri: NEW, storage_id: mcap, all: true}]'
)
_ROS_1 = (
    'convert it: rosbags-convert --src X.bag --dst NEW --dst-storage mcap (pip install rosbags; '
    'ros2 bag convert does not read ROS 1)'
)
_OTHERS = {
    b'SQLite format 3\0': ('is a bag in SQLite (.db3), not an MCAP file', _SQLITE),
    b'#ROSBAG': ('is a bag of ROS 1, not an MCAP file', _ROS_1),
}

LONGEST_MAGIC = max(map(len, _OTHERS))
"""How much of a file's start tells its format [bytes]."""


def is_bag_name(path: Path) -> bool:
    """Return whether a path is a folder, or has the name of a bag's file."""
    return path.is_dir() or path.name.lower().endswith(BAG_SUFFIXES)


def refuse_other_format(file: Path, start: bytes) -> None:
    """Raise a BagError that says how to convert, if a file starts as bags of other formats do."""
    for magic, (reason, remedy) in _OTHERS.items():
        if start.startswith(magic):
            raise BagError(file, reason, remedy)


def unpacked_file(file: Path) -> Path:
    """
    Return a file, or the unpacked one if it is packed with zstd.

    Raise `BagError` if it is damaged from its start or too large, or if there is no space for it.
    """
    try:
        if not file.is_file():
            return file
        with file.open('rb') as stream:
            if stream.read(len(_ZSTD)) != _ZSTD:
                return file
        status = file.stat()
    except OSError:
        return file  # whoever reads it says why it cannot be read
    return _decompressed_file(file, status.st_size, status.st_mtime_ns)


@cache
def _decompressed_file(file: Path, size: int, _changed: int) -> Path:
    try:
        zstandard: Any = import_module('zstandard')
    except ImportError:
        raise BagError(
            file, 'is packed with zstd, and the Python package is missing', 'install zstandard'
        ) from None
    most = max(MOST_UNPACKED, MOST_TIMES * size)
    name = file.name.removesuffix('.zstd')
    try:
        target = Path(mkdtemp(dir=_temporary_folder())) / name
        name_instead(target, file)
        with file.open('rb') as packed, target.open('wb') as content:
            pieces = zstandard.ZstdDecompressor().read_to_iter(packed, write_size=_PIECE)
            for piece in pieces:
                most -= len(piece)
                if most < 0:
                    raise BagError(
                        file,
                        f'would unpack to more than {content.tell():,} bytes: no recording '
                        'packs as densely',
                        'ask who made it',
                    )
                content.write(piece)
    except zstandard.ZstdError as error:
        raise BagError(file, f'cannot be unpacked: {error}', 'unpack it with zstd -d') from None
    except OSError as error:
        raise BagError(
            file,
            f'cannot be unpacked: {error.strerror or error}',
            'name a folder with free space in TMPDIR',
        ) from None
    return target


@cache
def _temporary_folder() -> Path:
    """Return a folder that is removed when the process ends."""
    folder = mkdtemp(prefix='linkage_')
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)
