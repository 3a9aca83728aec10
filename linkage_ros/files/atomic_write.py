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


"""Write files atomically: at every instant the whole old file is there, or the whole new one."""

from __future__ import annotations

from contextlib import suppress
import os
from pathlib import Path
from secrets import token_hex

from linkage_ros.errors import LinkageError


def atomic_write(file: str | Path, data: bytes) -> None:
    """
    Write or replace a file: write it beside the target, then rename it.

    Parameters
    ----------
    file
        Target; a symbolic link is followed.
    data
        Its content.

    Raises
    ------
    LinkageError
        The file cannot be written.

    """
    try:
        target = Path(file).resolve()
        if target.exists() and not target.is_file():
            raise LinkageError(file, 'is there already and is no file', 'name another file')
        if target.exists() and not os.access(target, os.W_OK):
            raise PermissionError(0, 'Permission denied')
        atomic_replace(target, data)
    except (OSError, ValueError, RuntimeError) as error:  # RuntimeError: a circle of links
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise LinkageError(file, f'cannot be written ({reason})', 'name another file') from None


def atomic_replace(target: Path, data: bytes) -> None:
    """
    Write a file as `atomic_write`, whatever exists there; do not follow a link.

    Raises
    ------
    OSError
        The file cannot be written; the old file stays, and nothing is left beside it.

    """
    temporary = target.parent / f'.{os.getpid()}.{token_hex(8)}.tmp'
    try:
        with temporary.open('xb') as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(target)
    except BaseException:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise
