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


"""Where a bag's files are, what its ``metadata.yaml`` says, and whether a file has its end."""

from __future__ import annotations

from collections.abc import Mapping
from io import SEEK_END
import os
from pathlib import Path, PurePosixPath
from typing import Any

from linkage_ros.bag.metadata import METADATA_FILE, ROOT_KEY
from linkage_ros.bounded_yaml import bounded_yaml
from linkage_ros.errors import BagError, quoted
from linkage_ros.regular_file import read_regular
from mcap.records import Metadata
from mcap.writer import MCAP0_MAGIC

MOST_METADATA = 8 * 2**20
"""How long metadata may be; of a bag with thousands of topics rosbag2 writes some megabytes."""

_WITHOUT = 'move metadata.yaml away to read the folder without it'


def custom_of(information: Mapping[str, Any]) -> dict[str, str]:
    """Return the ``custom_data`` of a bag's metadata: of what is there, what is plain text."""
    custom = information.get('custom_data')
    entries = custom.items() if isinstance(custom, dict) else ()
    # Not of lists: aliases make a small file's text as long as memory.
    return {str(k): str(v) for k, v in entries if not isinstance(v, dict | list | set | tuple)}


def information_of(folder: Path) -> dict[str, Any]:
    """Return what ``metadata.yaml`` says, nothing if it is missing: the files can do without."""
    file = folder / METADATA_FILE
    try:
        text = read_regular(file, MOST_METADATA)
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise unreadable(file, error) from None
    try:
        if len(text) > MOST_METADATA:
            raise ValueError(f'it is larger than {MOST_METADATA:,} bytes')
        information = bounded_yaml(text.decode())
        information = information.get(ROOT_KEY) if isinstance(information, dict) else None
        if not isinstance(information, dict):
            raise ValueError(f'no mapping {ROOT_KEY}')
    except ValueError as error:
        raise BagError(
            file, f"is not a bag's metadata ({error})", 'read the MCAP file by itself'
        ) from None
    return information


def serialized_metadata(record: Metadata) -> dict[str, Any]:
    """Return what rosbag2's record in an MCAP file says; nothing where it is damaged."""
    text = record.metadata.get('serialized_metadata', '')
    try:
        said = bounded_yaml(text if len(text) <= MOST_METADATA else '')
    except ValueError:
        return {}
    return said if isinstance(said, dict) else {}


def files_of(path: Path, information: Mapping[str, Any]) -> list[Path]:
    """Return the MCAP files of a bag, in the order of recording, if all lie in its folder."""
    if not path.is_dir():
        return [path]
    named = information.get('relative_file_paths')
    if isinstance(named, list) and named:
        # By name only, as rosbag2 does: old bags carry the folder too, which may have moved.
        names = [_name_of(path, PurePosixPath(str(name))) for name in named]
    else:
        names = [file.name for file in sorted(path.glob('*.mcap'), key=by_number)]
    if not names:
        raise BagError(path, 'holds no .mcap file', "name a bag's folder")
    for number, name in enumerate(names):
        if name in names[:number]:
            raise BagError(path / METADATA_FILE, f'names {quoted(name)} twice', _WITHOUT)
        within = os.path.realpath(path)
        if os.path.commonpath([within, os.path.realpath(path / name)]) != within:
            raise BagError(
                path / name, "leads out of the bag's folder", 'name the file that it leads to'
            )
    return [path / name for name in names]


def by_number(file: Path) -> tuple[int, str]:
    """Return what files are sorted by: NAME_2.mcap stands before NAME_10.mcap."""
    return len(file.name), file.name


def _name_of(folder: Path, path: PurePosixPath) -> str:
    if '..' in path.parts or not path.name or not path.name.isprintable():
        raise BagError(folder / METADATA_FILE, f'names {quoted(str(path))} as a file', _WITHOUT)
    return path.name


def is_empty(file: Path) -> bool:
    """Return whether a file is there, and nothing in it."""
    try:
        return file.stat().st_size == 0
    except OSError:
        return False


def is_finished(file: Path) -> bool:
    """Return whether the file is MCAP to its end; raise if not even its beginning is."""
    length = len(MCAP0_MAGIC)
    try:
        if file.exists() and not file.is_file():
            # To open a pipe would wait for somebody to write to it.
            raise BagError(file, 'is no file', "name a bag's folder, or its file")
        with file.open('rb') as stream:
            start = stream.read(length)
            size = stream.seek(0, SEEK_END)
            stream.seek(max(0, size - length))
            end = stream.read()
    except FileNotFoundError:
        raise BagError(file, 'does not exist', 'name the folder of a bag, or its file') from None
    except OSError as error:
        raise unreadable(file, error) from None
    if not start:
        raise BagError(file, 'is empty', 'its recording never began, or the power failed in it')
    if start != MCAP0_MAGIC:
        raise BagError(
            file, f'starts with {quoted(start)}, as no MCAP file does', 'name an MCAP file'
        )
    return size > length and end == MCAP0_MAGIC


def unreadable(file: Path, error: OSError) -> BagError:
    """Return what a user reads of a file that the system does not give."""
    reason = f'cannot be read: {error.strerror or error}'
    return BagError(file, reason, 'check its permissions and the disk')
