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

"""Disks of a few MiB, mounted for a while, where that is permitted."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import shutil
import subprocess
from typing import NamedTuple

_NOBODY = 65534


class NotPermittedError(Exception):
    """This disk cannot be had here; the text says why."""


class Disk(NamedTuple):
    """
    A small disk.

    Attributes
    ----------
    name
        What it is called in reports.
    kind
        'tmpfs' or 'ext4'; the latter is an image on a loop device.
    size
        In [MiB].
    reserved
        How much of it only root may fill [percent]; then the recording is not root's.

    """

    name: str
    kind: str
    size: int
    reserved: int = 0

    @property
    def user(self) -> int:
        """Return as whom to record."""
        return _NOBODY if self.reserved else os.geteuid()


DISKS = (
    Disk('tmpfs, 4 MiB', 'tmpfs', 4),
    Disk('ext4, 8 MiB', 'ext4', 8),
    Disk('ext4, 12 MiB, 40 % of them reserved', 'ext4', 12, reserved=40),
)


@contextmanager
def mounted(disk: Disk, work: Path) -> Iterator[Path]:
    """
    Mount a disk, empty, for the length of a with statement.

    Parameters
    ----------
    disk
        Which.
    work
        Where its image and its folder go.

    Raises
    ------
    NotPermittedError
        It cannot be made or mounted here.

    """
    if os.geteuid():
        raise NotPermittedError('only root may mount a disk')
    folder = work / 'disk'
    folder.mkdir()
    if disk.kind == 'tmpfs':
        _do('mount', '-t', 'tmpfs', '-o', f'size={disk.size}m', 'tmpfs', str(folder))
    else:
        image = work / 'image'
        with image.open('wb') as file:
            file.truncate(disk.size << 20)
        _do('mkfs.ext4', '-q', '-F', '-m', str(disk.reserved), str(image))
        _do('mount', '-o', 'loop', str(image), str(folder))
    try:
        shutil.rmtree(folder / 'lost+found', ignore_errors=True)
        os.chown(folder, disk.user, -1)
        yield folder
    finally:
        subprocess.run(['umount', '--lazy', str(folder)], check=False)
        (work / 'image').unlink(missing_ok=True)
        folder.rmdir()


def free_on(folder: Path) -> int:
    """Return what may still be written to a disk by who is not root [bytes]."""
    disk = os.statvfs(folder)
    return disk.f_bavail * disk.f_frsize


def _do(*command: str) -> None:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        raise NotPermittedError(f'there is no {command[0]}') from None
    if done.returncode:
        said = (done.stderr.strip().splitlines() or ['it failed'])[0]
        raise NotPermittedError(f'{command[0]}: {said}')
