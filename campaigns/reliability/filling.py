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

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from itertools import product
import os
from pathlib import Path
import pickle
import select
import shutil
import socket
import subprocess
from tempfile import TemporaryDirectory
from threading import Event, Thread
from time import monotonic, sleep
from typing import NamedTuple

from bench.report import say, Table
from campaigns.reliability.judge import Expectation, judge, Outcome
from campaigns.reliability.processes import forked
from campaigns.reliability.recording import (
    ATTACHMENTS,
    expected_messages,
    message,
    NumberedMessage,
    record,
    Recorded,
    time_of,
    TOPICS,
    wait_for,
)
from linkage_ros.bag import BagWriter, Recorder, Storage

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
_BURST = 50
_MOST_WAITING = 400

STORAGES: Mapping[str, Storage] = {
    'one file': Storage(flush_period=0.05),
    'one file, a floor': Storage(flush_period=0.05, min_free_bytes=FLOOR),
    'split': Storage(flush_period=0.05, split_bytes=300_000),
    'split, zstd, a floor': Storage(
        flush_period=0.05, split_bytes=300_000, compression='zstd', min_free_bytes=FLOOR
    ),
    'ring of 3': Storage(flush_period=0.05, split_bytes=300_000, keep_files=3),
}


FILLERS: Mapping[str, bool | None] = {
    # Whether another process, if there is one, continues to take all space that becomes free.
    'the recording alone': None,
    'another process too': False,
    'another process, which takes all free space': True,
}
_SPEED = 2e6  # of that process [bytes/s]


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
    how, hungry = STORAGES[storage], FILLERS[filler]
    with (
        TemporaryDirectory(prefix='linkage_ros_full_') as name,
        mounted(disk, Path(name)) as folder,
    ):
        # The recording's user needs access.
        Path(name).chmod(0o755)
        recording = partial(_record, folder / 'bag', how, count, disk.user)
        with forked(recording) as (_, ours), _beside(folder, hungry) as least:
            done = _answer_of(ours)
        free = free_on(folder)
        # Make space for the recovered bag.
        (folder / 'other').unlink(missing_ok=True)
        expectation = Expectation(expected_messages(done.offered if done else 0))
        outcome = judge(done, folder / 'bag', expectation, Path(name) / 'recovered')
        if done and how.keep_files and hungry is None and done.failure:
            outcome.faults.append('a ring that fits on the disk ended')
        below = how.min_free_bytes - least[0]
        if how.min_free_bytes and hungry is None and below > 0:
            outcome.faults.append(f'{below:,} bytes below the floor')
        failure = (done.refused or done.failure or '') if done else ''
        failure = failure.replace(f'{folder}/bag: ', '')
        return Filled(disk.name, storage, filler, outcome, least[0], free, failure)


def _record(folder: Path, storage: Storage, count: int, user: int, theirs: socket.socket) -> None:
    """Record in a process of its own, as a user, until the recorder fails or all is offered."""

    def messages(recorder: Recorder) -> Iterator[NumberedMessage]:
        for index in range(count):
            if index % _BURST == 0:
                wait_for(recorder, _MOST_WAITING)
                if recorder.failure is not None:
                    return
            yield message(index, time_of(index))

    if user != os.geteuid():
        os.setuid(user)
    done = record(lambda: BagWriter(folder, TOPICS, ATTACHMENTS, storage), messages)
    theirs.sendall(pickle.dumps(done))
    theirs.close()


@contextmanager
def _beside(folder: Path, hungry: bool | None) -> Iterator[list[int]]:
    """Watch the least free space, and write to the disk beside the recording, if wanted."""
    ended, least = Event(), [free_on(folder)]

    def watch() -> None:
        begin, written, full = monotonic(), 0, hungry is None
        with Path(os.devnull if full else folder / 'other').open('wb', buffering=0) as file:
            while not ended.is_set():
                least[0] = min(least[0], free_on(folder))
                try:
                    while not full and written < _SPEED * (monotonic() - begin):
                        written += file.write(bytes(_BLOCK)) or 0
                except OSError:
                    full = not hungry
                sleep(0.0002)

    thread = Thread(target=watch)
    thread.start()
    try:
        yield least
    finally:
        ended.set()
        thread.join()


def _answer_of(ours: socket.socket) -> Recorded | None:
    """Return the outcome of a recording in another process; None if it does not end."""
    answer, until = b'', monotonic() + _PATIENCE
    while select.select([ours], [], [], max(0.0, until - monotonic()))[0]:
        part = ours.recv(1 << 16)
        if not part:
            return pickle.loads(answer) if answer else None
        answer += part
    return None


def fill_all(count: int) -> tuple[list[Table], list[str]]:
    """Let all disks fill in all ways; return the table of the outcomes, and the faults."""
    table = Table(
        'Disks that fill',
        ('disk, storage', 'filled by', 'verdict', 'received', 'recorded',
         'removed by the ring', 'least free, kB', 'free at the end, kB', 'faults'),
    )  # fmt: skip
    faults: list[str] = []
    cases = [*product(DISKS, FILLERS, STORAGES)]
    for disk, filler, storage in cases:
        one = fill(disk, storage, filler, count)
        outcome = one.outcome
        faults += [f'{fault}: {one[:3]}' for fault in outcome.faults]
        numbers = (outcome.offered, outcome.recorded, outcome.discarded)
        table.rows.append(
            (
                f'{one.disk}; {one.storage}',
                one.filler,
                outcome.verdict,
                *(f'{number:,}' for number in numbers),
                f'{one.least_free / 1e3:,.0f}',
                f'{one.free / 1e3:,.0f}',
                '; '.join(outcome.faults) or 'none',
            )
        )
        say(f'{len(table.rows)} of {len(cases)} disks that fill')
    return [table], faults
