# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Recordings on a small disk that fills, by the recording itself or by another process.

The disks have a few MiB and are mounted temporarily, where that is permitted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import pickle
import select
import shutil
import signal
import subprocess
from tempfile import TemporaryDirectory
from threading import Event, Thread
from time import monotonic, sleep
from typing import NamedTuple

from campaigns.disk.judge import (
    Expectation,
    expected_messages,
    judge,
    offer_all,
    Outcome,
    Recorded,
)
from linkage_ros.bag import Storage

_NOBODY = 65534


class NotPermittedError(Exception):
    """This disk cannot be mounted here; the text is the reason."""


class Disk(NamedTuple):
    """A small disk."""

    name: str  # Its name in reports
    kind: str  # 'tmpfs' or 'ext4'; the latter is an image on a loop device
    size: int  # Its size in [MiB]
    # The share that only root may fill [percent]; if not 0, another user records.
    reserved: int = 0

    @property
    def user(self) -> int:
        """Return the user id of the recording."""
        return _NOBODY if self.reserved else os.geteuid()


DISKS = (
    Disk('tmpfs, 4 MiB', 'tmpfs', 4),
    Disk('ext4, 8 MiB', 'ext4', 8),
    Disk('ext4, 12 MiB, 40 % of them reserved', 'ext4', 12, reserved=40),
)


@contextmanager
def mounted(disk: Disk, work: Path) -> Iterator[Path]:
    """
    Mount a disk, empty, for the length of a with statement; its image and mount point are in work.

    A NotPermittedError says that it cannot be made or mounted here.
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
    """Return the free space of a disk for users other than root [bytes]."""
    disk = os.statvfs(folder)
    return disk.f_bavail * disk.f_frsize


def _do(*command: str) -> None:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        raise NotPermittedError(f'there is no {command[0]}') from None
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or ['it failed'])[0]
        raise NotPermittedError(f'{command[0]}: {reason}')


FLOOR = 1_500_000
_PATIENCE = 120.0  # [s]
_BLOCK = 4096

STORAGES: Mapping[str, Storage] = {
    'one file': Storage(flush_period=0.05),
    'one file, a floor': Storage(flush_period=0.05, min_free_bytes=FLOOR),
    'split': Storage(flush_period=0.05, split_bytes=300_000),
    'split, zstd, a floor': Storage(
        flush_period=0.05, split_bytes=300_000, compression='zstd', min_free_bytes=FLOOR
    ),
    'ring of 3': Storage(flush_period=0.05, split_bytes=300_000, keep_files=3),
}


class Filler(NamedTuple):
    """
    Another process that writes to the disk at a rate in [bytes/s].

    If it is hungry, it continues to take all space that becomes free.
    """

    speed: float
    hungry: bool


FILLERS: Mapping[str, Filler | None] = {
    'the recording alone': None,
    'another process too': Filler(2e6, hungry=False),
    'another process, which takes all free space': Filler(2e6, hungry=True),
}


class Filled(NamedTuple):
    """
    A recording and its outcome, with the names of its disk, storage and filler.

    Free space, the least and that at its end, is in [bytes]. Its failure is an error message, or
    ''.
    """

    disk: str
    storage: str
    filler: str
    outcome: Outcome
    least_free: int
    free: int
    failure: str


def fill(disk: Disk, storage: str, filler: str, count: int) -> Filled:
    """
    Record a number of messages to a small disk, and judge.

    Storage and filler are named in `STORAGES` and `FILLERS`. A NotPermittedError says that the
    disk cannot be mounted here.
    """
    how = STORAGES[storage]
    with (
        TemporaryDirectory(prefix='linkage_ros_full_') as name,
        mounted(disk, Path(name)) as folder,
    ):
        # The recording's user needs access.
        Path(name).chmod(0o755)
        other = _Other(folder, FILLERS[filler])
        done = _in_child(lambda: offer_all(folder / 'bag', how, count), disk.user, other.start)
        other.stop()
        free = free_on(folder)
        outcome = Outcome(faults=['did not end'])
        if done is not None:
            # Make space for the recovered bag.
            other.make_room()
            expectation = Expectation(expected_messages(done.offered))
            outcome = judge(done, folder / 'bag', expectation, Path(name) / 'recovered')
            if how.keep_files and filler == 'the recording alone' and done.failure:
                outcome.faults.append('a ring that fits on the disk ended')
        if how.min_free_bytes and FILLERS[filler] is None and other.least < how.min_free_bytes:
            below = how.min_free_bytes - other.least
            outcome.faults.append(f'{below:,} bytes below the floor')
        failure = (done.refused or done.failure or '') if done else ''
        failure = failure.replace(f'{folder}/bag: ', '')
        return Filled(disk.name, storage, filler, outcome, other.least, free, failure)


def cases(disks: Sequence[Disk]) -> Iterator[tuple[Disk, str, str]]:
    """Yield all combinations of disk, storage and filler."""
    for disk in disks:
        for filler in FILLERS:
            for storage in STORAGES:
                yield disk, storage, filler


class _Other:
    """Watches the free space, and writes to the disk if it has a filler."""

    def __init__(self, folder: Path, filler: Filler | None) -> None:
        self._folder = folder
        self._filler = filler
        self._ended = Event()
        self._thread = Thread(target=self._run)
        self.least = free_on(folder)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._ended.set()
        if self._thread.ident is not None:
            self._thread.join()

    def make_room(self) -> None:
        (self._folder / 'other').unlink(missing_ok=True)

    def _run(self) -> None:
        begin, written, full = monotonic(), 0, False
        file = os.open(self._folder / 'other', os.O_WRONLY | os.O_CREAT) if self._filler else -1
        try:
            while not self._ended.is_set():
                self.least = min(self.least, free_on(self._folder))
                if self._filler is not None and not full:
                    try:
                        while written < self._filler.speed * (monotonic() - begin):
                            written += os.write(file, bytes(_BLOCK))
                    except OSError:
                        full = not self._filler.hungry
                sleep(0.0002)
        finally:
            if file >= 0:
                os.close(file)


def _in_child(
    do: Callable[[], Recorded], user: int, started: Callable[[], None]
) -> Recorded | None:
    """Record in a process of its own, as a user; return None if it does not end."""
    reads, writes = os.pipe()
    process = os.fork()
    if not process:
        try:
            os.close(reads)
            if user != os.geteuid():
                os.setuid(user)
            answer = pickle.dumps(do())
            with os.fdopen(writes, 'wb') as pipe:
                pipe.write(answer)
        finally:
            os._exit(0)
    os.close(writes)
    # Start threads only after the fork.
    started()
    answer, until = b'', monotonic() + _PATIENCE
    try:
        while select.select([reads], [], [], max(0.0, until - monotonic()))[0]:
            part = os.read(reads, 1 << 16)
            if not part:
                return pickle.loads(answer) if answer else None
            answer += part
        return None
    finally:
        os.close(reads)
        os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)
