# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Read regular files only, and write files atomically.

Opening a named pipe waits for a writer, a device may never end, and opening either may have an
effect. So the file type is checked first. Of a file that
is written, at every instant the whole old one is there, or the whole new one.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from errno import EINVAL, EISDIR
import os
from pathlib import Path
from secrets import token_hex
from shutil import rmtree
import stat
from typing import BinaryIO

from linkage_ros.errors import LinkageError, list_names

_KINDS = (
    (stat.S_ISFIFO, 'is a pipe'),
    (stat.S_ISSOCK, 'is a socket'),
    (stat.S_ISCHR, 'is a device'),
    (stat.S_ISBLK, 'is a device'),
)


def open_regular(file: str | Path) -> BinaryIO:
    """
    Open a file for reading.

    OSError if it cannot be opened or is not a regular file; ValueError for a NUL in its name.
    """
    _check_regular(Path(file).stat(), file)
    # The file may have been replaced since the check.
    descriptor = os.open(file, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
    try:
        _check_regular(os.fstat(descriptor), file)
        return os.fdopen(descriptor, 'rb')
    except BaseException:
        os.close(descriptor)
        raise


def read_regular(file: str | Path, largest: int) -> bytes:
    """Read a file as `open_regular`, but at most one byte more than a number of bytes."""
    with open_regular(file) as stream:
        return stream.read(largest + 1)


def _check_regular(status: os.stat_result, file: str | Path) -> None:
    if stat.S_ISREG(status.st_mode):
        return
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(EISDIR, os.strerror(EISDIR), str(file))
    what = next((reason for kind, reason in _KINDS if kind(status.st_mode)), 'is not a file')
    raise OSError(EINVAL, f'{what}, not a regular file', str(file))


def check_output_name(file: Path, suffixes: Collection[str]) -> None:
    """Check the name of a file to write: its suffix, whatever its case, and its folder."""
    ending = file.suffix.lower()
    if ending not in suffixes:
        raise LinkageError(
            file,
            f'ends in {ending!r}' if ending else 'has no ending',
            f'name a file that ends in {list_names(suffixes, " or ")}',
        )
    _check_folder(file)


def _check_folder(file: Path) -> None:
    if not os.path.lexists(file.parent):
        raise LinkageError(
            file, f'there is no folder {file.parent}', f'make it: mkdir -p {file.parent}'
        )


def check_new(path: Path, *, force: bool) -> None:
    """Refuse to write what exists, unless ``force`` says so; never replace a folder but a bag."""
    if not os.path.lexists(path):
        return
    if not force:
        raise LinkageError(path, 'exists already', 'name another, or add --force to overwrite it')
    if path.is_dir() and not all(map(_is_of_a_bag, path.iterdir())):
        raise LinkageError(
            path, 'is a folder that holds more than a bag', 'name another: it is not overwritten'
        )


def remove_bag(folder: Path, *, force: bool) -> None:
    """Remove a bag that `check_new` has found, to make room for another."""
    check_new(folder, force=force)
    if folder.is_dir():
        for file in folder.iterdir():
            file.unlink()
        folder.rmdir()


def _is_of_a_bag(file: Path) -> bool:
    return file.is_file() and (file.suffix == '.mcap' or file.name == 'metadata.yaml')


def atomic_write(file: str | Path, data: bytes) -> None:
    """
    Write or replace a file: write it next to the target, then rename it.

    A symbolic link is followed, and an old file's permissions are kept. A LinkageError says that
    the file cannot be written.
    """
    try:
        _check_folder(Path(file))
        target = Path(file).resolve()
        if target.exists() and not target.is_file():
            raise LinkageError(file, 'exists and is not a file', 'name another file')
        if target.exists() and not os.access(target, os.W_OK):
            raise PermissionError(0, 'Permission denied')
        with replace_file(target) as stream:
            stream.write(data)
    except (OSError, ValueError, RuntimeError) as error:  # RuntimeError: a circle of links
        raise _unwritable_error(file, error, 'name another file') from None


def _unwritable_error(path: str | Path, error: Exception, remedy: str) -> LinkageError:
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return LinkageError(path, f'cannot be written ({reason})', remedy)


def write_folder(folder: Path, files: Mapping[str, bytes]) -> None:
    """
    Write a folder with the files of these paths in it, or nothing.

    They are written next to the folder first. In a folder that exists each then replaces the old
    one, and other files stay. A LinkageError says that the folder cannot be written.
    """
    temporary = _temporary_name(folder)
    try:
        _check_folder(folder)
        for path, data in files.items():
            (temporary / path).parent.mkdir(parents=True, exist_ok=True)
            (temporary / path).write_bytes(data)
        if not folder.exists():
            temporary.rename(folder)
            return
        for path in files:
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (temporary / path).replace(folder / path)
    except (OSError, ValueError) as error:
        raise _unwritable_error(folder, error, 'name another folder') from None
    finally:
        rmtree(temporary, ignore_errors=True)


def _temporary_name(target: Path) -> Path:
    return target.parent / f'.{os.getpid()}.{token_hex(8)}.tmp'


@contextmanager
def replace_file(target: Path) -> Iterator[BinaryIO]:
    """
    Yield a stream for the new content of a file, whatever exists there; do not follow a link.

    On an OSError the old file stays, and no other file is left.
    """
    temporary = _temporary_name(target)
    try:
        with temporary.open('xb') as stream:
            with suppress(FileNotFoundError):
                # Before anything is written: what nobody else might read, nobody else may.
                os.fchmod(stream.fileno(), stat.S_IMODE(target.stat().st_mode))
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(target)
    except BaseException:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise
