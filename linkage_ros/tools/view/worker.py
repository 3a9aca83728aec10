# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A process that answers requests, so that the server itself always answers at once.

A process can be ended at any moment, a thread cannot: a request that takes too long ends its
process, and the next request starts another one. A frame on the standard input of a process is
the number of a page and the length of the message, 4 bytes each, then the message; on its standard
output the length of the answer, then the answer.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
import json
import os
from pathlib import Path
import signal
import struct
import subprocess
import sys
from typing import BinaryIO
import warnings

from linkage_ros.errors import escape_unprintable, LinkageError
from linkage_ros.tools.view.requests import read_request, RequestHandler
from linkage_ros.tools.view.sensors import SceneFiles

_ASKED, _ANSWERED = struct.Struct('>II'), struct.Struct('>I')

_SPARE = 5.0
"""Time after its limit, in [s], at which a process ends by itself, if its server has gone."""


class Worker:
    """
    Answers requests in a process of its own, one after the other, within a time limit in [s].

    It has the name of the linkage and the scene with which the server was opened.
    """

    def __init__(self, name: str, scene: SceneFiles | None, longest: float) -> None:
        self._opening = json.dumps([name, scene, longest]).encode()
        self.longest = longest
        self._one = asyncio.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._ended = False

    @property
    def pid(self) -> int:
        """Return the id of the process; 0 before it is started."""
        return 0 if self._process is None else self._process.pid

    async def start(self) -> None:
        """Start the process before it is needed."""
        async with self._one:
            await asyncio.to_thread(self._start_process)

    async def send_request(self, page: int, do: str, message: str) -> str:
        """
        Return the answer to a page's request, as JSON.

        A LinkageError says that there is no answer in time, or that the process ended.
        """
        async with self._one:
            answered = False
            try:
                exchange = asyncio.to_thread(self._exchange_frames, page, message.encode())
                answer = await asyncio.wait_for(exchange, self.longest)
                answered = True
            except asyncio.TimeoutError:
                reason, remedy = f'took longer than {self.longest:g} s', 'make it smaller'
                raise LinkageError(do, reason, remedy) from None
            except (EOFError, OSError):
                reason, remedy = 'ended the process that computes it', 'please report it'
                raise LinkageError(do, reason, remedy) from None
            finally:
                if not answered:
                    await asyncio.to_thread(self._end_process)
            return answer

    async def end(self) -> None:
        """End the process, whatever it computes."""
        self._ended = True
        if self._process is not None:
            self._process.kill()  # a request that waits for it then ends
        async with self._one:
            await asyncio.to_thread(self._end_process)

    def _start_process(self) -> subprocess.Popen[bytes]:
        if self._ended:
            raise LinkageError('linkage view', 'has ended', 'start it again')
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, '-m', __name__],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                # It imports the same package, and the user's own effects, as this process.
                cwd=Path(__file__).parents[2],
                env=os.environ | {'PYTHONPATH': os.pathsep.join(map(os.path.abspath, sys.path))},
                # Ctrl-C is for the server, which then ends this process.
                start_new_session=True,
            )
            self._write_request(0, self._opening)
        return self._process

    def _exchange_frames(self, page: int, message: bytes) -> str:
        process = self._start_process()
        assert process.stdout is not None
        self._write_request(page, message)
        head = process.stdout.read(_ANSWERED.size)
        if len(head) < _ANSWERED.size:
            raise EOFError
        (length,) = _ANSWERED.unpack(head)
        answer = process.stdout.read(length)
        if len(answer) < length:
            raise EOFError
        return answer.decode()

    def _write_request(self, page: int, message: bytes) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        self._process.stdin.write(_ASKED.pack(page, len(message)) + message)
        self._process.stdin.flush()

    def _end_process(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            for pipe in (process.stdin, process.stdout):
                with suppress(OSError):  # what is left in it
                    pipe.close()  # type: ignore[union-attr]


def main() -> None:
    """Answer the frames on standard input until it ends."""
    warnings.simplefilter('ignore')  # the page shows what matters
    asked, answers = sys.stdin.buffer, os.fdopen(os.dup(1), 'wb')
    os.dup2(2, 1)  # nothing that a library prints gets between the frames
    opening = _read_frame(asked)
    if opening is None:
        return
    name, scene, longest = json.loads(opening[1])
    handler = RequestHandler(name, None if scene is None else SceneFiles(*scene), report_line)
    while (frame := _read_frame(asked)) is not None:
        # The alarm ends this process, if nobody else does.
        signal.setitimer(signal.ITIMER_REAL, longest + _SPARE)
        page, message = frame
        answer = handler.answer_request(page, read_request(message)).encode()
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        try:
            answers.write(_ANSWERED.pack(len(answer)) + answer)
            answers.flush()
        except BrokenPipeError:
            return


def report_line(line: str) -> None:
    """Write a line to the terminal of the server."""
    sys.stderr.write(f'linkage view: {escape_unprintable(line)}\n')
    sys.stderr.flush()


def _read_frame(stream: BinaryIO) -> tuple[int, str] | None:
    """Return the number of a page and its message; None where the server has gone."""
    head = stream.read(_ASKED.size)
    if len(head) < _ASKED.size:
        return None
    page, length = _ASKED.unpack(head)
    message = stream.read(length)
    return (page, message.decode()) if len(message) == length else None


if __name__ == '__main__':
    main()
