# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The page of a run: `linkage view --node` in a separate process, which ends with the run.

As a program, this module is that process. It ends by SIGTERM as soon as its standard input is
closed: that happens even where the run is killed.
"""

from __future__ import annotations

from collections.abc import Callable
import os
import signal
import subprocess
import sys
from threading import Thread

from linkage_ros.errors import check_installed

_GRAPH = ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_DOMAIN_ID', 'RMW_IMPLEMENTATION')
"""Variables that a second terminal needs to be on the same graph."""

_PATIENCE = 5.0
"""How long the process has to end, in [s]."""


def check_page() -> None:
    """Raise LinkageError if a package is missing that serves pages."""
    for package in ('plotly', 'aiohttp'):
        check_installed(package, "pip install 'linkage_ros[view]'")


def view_command() -> str:
    """Return the command that opens the page of a run in a second terminal."""
    values = [f'{name}={os.environ[name]}' for name in _GRAPH if os.environ.get(name)]
    return ' '.join([*values, 'linkage view --node'])


class PageOfRun:
    """
    The process that serves the page of a run; ``say`` receives its lines, on another thread.

    In a process, a page costs the ticks of the run no more than any other subscriber does.
    """

    def __init__(self, node: str, say: Callable[[str], None]) -> None:
        self._say: Callable[[str], None] | None = say
        self._process = subprocess.Popen(
            [sys.executable, '-m', __name__, node],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,  # Ctrl-C goes to this process only, which ends the other
        )
        self._reading = Thread(target=self._forward_lines, name='page', daemon=True)
        self._reading.start()

    def end_process(self) -> None:
        """End the process."""
        self._say = None
        self._process.terminate()
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reading.join()

    def _forward_lines(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                if (say := self._say) is not None:
                    say(line.rstrip('\n'))


def _end_with_the_run() -> None:
    while os.read(sys.stdin.fileno(), 1):  # with no lock, which the end of Python would wait for
        pass
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == '__main__':
    from linkage_ros.cli.main import main

    Thread(target=_end_with_the_run, daemon=True).start()
    sys.exit(main(['view', '--node', *sys.argv[1:]]))
