# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The finished runs of a study on the disk, so that a study that was ended goes on.

They lie beside the output, a line for each run, until the output is written. The first line is a
key of what decides their numbers: version, files of the scene with its settings, runs, duration.
"""

from __future__ import annotations

from base64 import b64decode, b64encode
from hashlib import sha256
import json
import os
from os.path import lexists
from pathlib import Path
from typing import Any, BinaryIO, cast

from linkage_ros import __version__
from linkage_ros.errors import LinkageError
from linkage_ros.replay.study import Outcome, Settings, Statistics, Study
import numpy as np


class FinishedRuns:
    """
    The outcomes of a study by the numbers of the runs; each is written to the disk at once.

    Raise `LinkageError` if the file belongs to another study, or cannot be read or written.
    """

    def __init__(self, output: Path, study: Study, runs: list[Settings]) -> None:
        self.file = output.with_name(f'{output.name}.part')
        self.outcomes: dict[int, Outcome] = {}
        self._stream: BinaryIO | None = None
        decides = (__version__, sorted(study.files.items()), study.seconds, study.instants, runs)
        self._head = f'{sha256(repr(decides).encode()).hexdigest()}\n'.encode()
        try:
            if lexists(self.file):
                self._read_runs(len(runs))
        except OSError as error:
            raise self._unusable_error(error) from None

    def _read_runs(self, count: int) -> None:
        """Read the runs; of a line that was cut, and behind it, nothing is kept."""
        with self._open_file('r+b') as stream:
            head = stream.readline(len(self._head))
            if head != self._head:
                raise LinkageError(
                    self.file,
                    'holds the runs of another study (of other files, settings or duration)',
                    'remove it, or name another output',
                )
            whole = stream.tell()
            for line in stream:
                try:
                    number, outcome = _outcome_of(line)
                except (ValueError, TypeError, KeyError, RecursionError):
                    break
                if not line.endswith(b'\n') or not 0 <= number < count:
                    break
                self.outcomes[number] = outcome
                whole += len(line)
            stream.truncate(whole)

    def _open_file(self, mode: str) -> BinaryIO:
        """Open the file, but not where its name is a link, which may be another user's."""

        def open_no_link(path: str, flags: int) -> int:
            return os.open(path, flags | os.O_NOFOLLOW, 0o666)

        return cast(BinaryIO, open(self.file, mode, opener=open_no_link))

    def add_run(self, number: int, outcome: Outcome) -> None:
        """Keep the outcome of a run."""
        self.outcomes[number] = outcome
        try:
            if self._stream is None:
                self._stream = self._open_file('ab')
                if not self._stream.tell():
                    self._stream.write(self._head)
            self._stream.write(_line_of(number, outcome))
            self._stream.flush()
        except OSError as error:
            raise self._unusable_error(error) from None

    def remove_file(self) -> None:
        """Remove the file, when the output is written."""
        self.close()
        self.file.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the file."""
        if self._stream is not None:
            self._stream.close()
            self._stream = None

    def _unusable_error(self, error: OSError) -> LinkageError:
        return LinkageError(
            self.file, f'cannot be read and written ({error.strerror})', 'name another output'
        )


def _line_of(number: int, outcome: Outcome) -> bytes:
    fields: dict[str, Any] = {'run': number, **outcome._asdict()}
    fields['shape'] = outcome.positions.shape
    fields['positions'] = b64encode(outcome.positions.astype('<f8').tobytes()).decode()
    return f'{json.dumps(fields)}\n'.encode()


def _outcome_of(line: bytes) -> tuple[int, Outcome]:
    fields = json.loads(line)
    positions = np.frombuffer(b64decode(fields['positions']), '<f8').reshape(fields['shape'])
    statistics = {name: Statistics(*of) for name, of in fields['statistics'].items()}
    ticks, messages = int(fields['ticks']), int(fields['messages'])
    failure = str(fields['failure'])
    return int(fields['run']), Outcome(failure, ticks, messages, statistics, positions)
