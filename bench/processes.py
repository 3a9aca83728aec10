# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Processes on a ROS graph of their own: start them, ask them, end them by their pid.

Each process has a limited life: an alarm survives ``exec`` and the end of any parent, so that no
process keeps running.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
import json
import os
from pathlib import Path
import select
import signal
import subprocess
import sys
import time
from typing import Any

from bench import ROOT

_PATIENCE = 15.0
"""Time limit for an answer of a process, in [s]."""

_LONGEST = 600
"""Default time limit for a process, in [s]."""

_MOST = 5 + (os.cpu_count() or 1)
"""Maximum number of processes at once."""

_BOUNDED = (
    'import os, signal, sys; signal.alarm(int(sys.argv[1])); '
    'os.execv(sys.executable, [sys.executable, *sys.argv[2:]])'
)
"""Runs Python with the arguments after the first, for at most that many seconds."""


class MeasurementError(Exception):
    """A process, or another part of a measurement, failed."""


class Process:
    """A Python program on the graph, with its name in messages and its process id."""

    def __init__(self, name: str, popen: subprocess.Popen[bytes], log: Path) -> None:
        self.name = name
        self.pid = popen.pid
        self._popen = popen
        self._log = log
        self._rest = b''

    def ask_line(self, question: str) -> Any:
        """Write a line; return its answer, a line of JSON."""
        assert self._popen.stdin is not None
        try:
            self._popen.stdin.write(question.encode() + b'\n')
            self._popen.stdin.flush()
        except OSError:
            self.check_running()
            raise
        return self.read_answer()

    def read_answer(self, patience: float = _PATIENCE) -> Any:
        """Return the next line of JSON; ``patience`` is the time limit in [s]."""
        assert self._popen.stdout is not None
        until = time.monotonic() + patience
        while b'\n' not in self._rest:
            left = until - time.monotonic()
            if left <= 0 or not select.select([self._popen.stdout], [], [], left)[0]:
                raise MeasurementError(
                    f'{self.name}: no answer for {patience:g} s{self._last_words()}'
                )
            more = os.read(self._popen.stdout.fileno(), 1 << 16)
            if not more:
                raise MeasurementError(f'{self.name}: ended without an answer{self._last_words()}')
            self._rest += more
        line, self._rest = self._rest.split(b'\n', 1)
        return json.loads(line)

    def check_running(self) -> None:
        """Raise if the process has ended by itself."""
        if (code := self._popen.poll()) is not None:
            raise MeasurementError(f'{self.name}: ended with {code}{self._last_words()}')

    def end_process(self) -> None:
        """End the process: ask, then SIGTERM, then SIGKILL; only this very process."""
        for stop in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            if self._popen.poll() is None:
                self._popen.send_signal(stop)
                try:
                    self._popen.wait(5.0)
                except subprocess.TimeoutExpired:
                    continue
        for pipe in (self._popen.stdin, self._popen.stdout):
            if pipe is not None:
                pipe.close()

    def check_end(self, *well: int) -> None:
        """Raise if the process has ended with a code other than 0 and those given."""
        if self._popen.returncode not in (0, *well):
            raise MeasurementError(
                f'{self.name}: ended with {self._popen.returncode}{self._last_words()}'
            )

    def _last_words(self) -> str:
        lines = self._log.read_text(errors='replace').strip().splitlines()
        return f': {lines[-1]}' if lines else ''


class Graph:
    """
    A ROS graph that is isolated from others, with a folder for its logs.

    Each process ends after the longest time, in [s], even if this process dies.
    """

    def __init__(self, domain: int, folder: Path, longest: int = _LONGEST) -> None:
        self._folder = folder
        self._longest = longest
        self._alive: list[Process] = []
        self._environment = {
            **os.environ,
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'ROS_DOMAIN_ID': str(domain),
            'ROS_LOG_DIR': str(folder),
        }
        # If this variable were inherited, the rclpy wheels would not set their library path.
        self._environment.pop('_ROS_WHEELS_BOOTSTRAP_COMPLETE', None)

    @contextmanager
    def run_module(
        self, module: str, arguments: Sequence[str] = (), more: Mapping[str, str] | None = None
    ) -> Iterator[Process]:
        """Run ``python -m module`` for a with statement; ``more`` is for its environment."""
        if len(self._alive) >= _MOST:
            raise MeasurementError(f'{module}: {_MOST} processes run already')
        name = module.rsplit('.', 1)[-1]
        log = self._folder / f'{name}.log'
        command = ['-c', _BOUNDED, str(self._longest), '-m', module, *arguments]
        with log.open('wb') as errors:
            popen = subprocess.Popen(
                [sys.executable, *command],
                cwd=ROOT,
                env={**self._environment, **(more or {})},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                # Ctrl-C is for this process, which ends the others in order.
                start_new_session=True,
            )
        process = Process(name, popen, log)
        self._alive.append(process)
        try:
            yield process
        finally:
            process.end_process()
            self._alive.remove(process)
