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

"""
Open files for reading: regular files only.

Opening a named pipe waits for a writer, a device may never end, and opening either may have an
effect. So the file type is checked first.
"""

from __future__ import annotations

from errno import EINVAL, EISDIR
import os
from pathlib import Path
import stat
from typing import BinaryIO

_KINDS = (
    (stat.S_ISFIFO, 'is a pipe'),
    (stat.S_ISSOCK, 'is a socket'),
    (stat.S_ISCHR, 'is a device'),
    (stat.S_ISBLK, 'is a device'),
)


def open_regular(file: str | Path) -> BinaryIO:
    """
    Open a file for reading.

    Raises
    ------
    OSError
        It cannot be opened, or is no regular file; the message names its type.
    ValueError
        Its name contains a NUL.

    """
    _check(Path(file).stat(), file)
    # The file may have been replaced since the check.
    descriptor = os.open(file, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
    try:
        _check(os.fstat(descriptor), file)
        return os.fdopen(descriptor, 'rb')
    except BaseException:
        os.close(descriptor)
        raise


def read_regular(file: str | Path, largest: int) -> bytes:
    """
    Read a file; if it exceeds a number of bytes, read one byte more than that.

    Raises
    ------
    OSError, ValueError
        As in `open_regular`.

    """
    with open_regular(file) as stream:
        return stream.read(largest + 1)


def _check(status: os.stat_result, file: str | Path) -> None:
    if stat.S_ISREG(status.st_mode):
        return
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(EISDIR, os.strerror(EISDIR), str(file))
    what = next((reason for kind, reason in _KINDS if kind(status.st_mode)), 'is no file')
    raise OSError(EINVAL, f'{what}, not a regular file', str(file))
