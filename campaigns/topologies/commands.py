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


"""The commands of ``linkage`` on a file of any linkage: done, or one line that says why not."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import replace
import io
from pathlib import Path
import random
import signal
import tempfile
import traceback
from typing import Any
from unittest import mock

from campaigns.topologies.judge import Findings
from linkage_ros.cli import main as command_line
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.scene.linkage_text import linkage_text
from linkage_ros.stop import Stop

FILES = ('draw', 'urdf', 'mjcf')
"""Commands that write a file; beside these there are `check`, and `accuracy`, which is slow."""

_SECONDS = 600
"""A command that takes longer has not ended; on a free machine the slowest takes some 15 s."""


class _TooLongError(BaseException):
    """No `Exception`: nothing that a command catches."""


def judge_command(command: str, linkage: Linkage, findings: Findings, closes: bool = True) -> None:
    """
    Run a command on a linkage.

    Parameters
    ----------
    command
        `check`, `accuracy`, or one of `FILES`.
    linkage
        The linkage.
    findings
        Where what is found goes.
    closes
        Whether it is a linkage that closes somewhere: the command has no reason to refuse it.

    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / 'linkage.yaml'
        file.write_text(linkage_text(linkage), encoding='utf-8')
        output = {'draw': 'png', 'urdf': 'urdf', 'mjcf': 'xml'}.get(command)
        arguments = [command, str(file)]
        if command == 'accuracy':
            arguments.append('--quick')
            arguments += ['-o', str(Path(folder) / 'page')]
        if output:
            arguments += ['-o', str(Path(folder) / f'out.{output}')]
        code, said = _run(arguments)
    said = said.replace(folder, '')
    if code == 0:
        findings.counts[f'{command}: done'] += 1
    elif code == 2 and len(said.strip().splitlines()) == 1:
        findings.counts[f'{command}: refused'] += 1
        if closes:
            findings.find(f'{command} refuses', said.strip())
    else:
        last = said.strip().splitlines()[-1:] or ['']
        findings.find(f'{command}: {code}', last[0])


def _run(arguments: list[str]) -> tuple[Any, str]:
    """Run ``linkage``; return its exit code, or how else it ended, and what it said of that."""
    said, shown = io.StringIO(), io.StringIO()
    try:
        with redirect_stdout(shown), redirect_stderr(said), _bounded():
            return command_line.main(arguments), said.getvalue()
    except _TooLongError:
        return 'no end', f'more than {_SECONDS} s'
    except SystemExit as stopped:
        return stopped.code, said.getvalue()
    except Exception:  # noqa: BLE001 - whatever it is, a user would see it
        return 'traceback', _place(traceback.format_exc())


def _place(text: str) -> str:
    """Return the last line of a traceback with the last place of ours in it."""
    lines = text.strip().splitlines()
    ours = [line.strip() for line in lines if 'linkage_ros/' in line and 'File' in line]
    place = ours[-1].rpartition('linkage_ros/')[2] if ours else ''
    return f'{lines[-1]} ({place.replace(chr(34), "")})'


@contextmanager
def _bounded() -> Iterator[None]:
    def stop(_number: int, _frame: Any) -> None:
        raise _TooLongError

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, _SECONDS)
    try:
        # The signals stay the campaign's: a pool ends its processes by them.
        with mock.patch.object(command_line, 'stop_on_signals', Stop):
            yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def spoilt(linkage: Linkage, rng: random.Random) -> Linkage:
    """Return a linkage with one or two numbers changed, as a typing error would, or worse."""
    for _ in range(rng.choice((1, 1, 2))):
        link = rng.choice(list(linkage.links))
        point = rng.choice(list(linkage.links[link]))
        place = list(linkage.links[link][point])
        k = rng.choice((0, 1))
        others = [part for points in linkage.links.values() for p in points.values() for part in p]
        place[k] = rng.choice(
            (
                0.0,
                -place[k],
                place[k] * 10.0 ** rng.choice((-9, -3, -1, 1, 3, 9)),
                rng.choice(others),
                place[k] + rng.gauss(0.0, 1.0),
            )
        )
        links = {name: dict(points) for name, points in linkage.links.items()}
        links[link][point] = (place[0], place[1])
        linkage = replace(linkage, links=links)
    return linkage
