# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Send signals at random instants to every command that starts no node.

Once its handlers are installed, a command has to end within seconds, with exit code 1 and one
line, and to leave no file but its result. Before that Python is starting, and no program can
react. A signal may also come after the command has ended.
"""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import os
from pathlib import Path
import random
import signal
import subprocess
import tempfile
import time

from campaigns.reliability.judge import Try
from campaigns.reliability.processes import LINKAGE
from linkage_ros.resources import shipped_path

_SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
_LATEST = 1.5
"""Latest instant of a signal, in [s] after the handlers are installed."""

_PATIENCE = 30.0
"""Time limit for the end of a process, in [s]; other processes use the processor too."""

_COMMANDS = {
    'check': ['jansen_leg.yaml'],
    'solve': ['jansen_leg.yaml', '--steps', '30000', '-o', 'x.csv'],
    'draw': ['jansen_leg.yaml', '-o', 'x.svg'],
    'compile': ['jansen_leg.yaml', '-o', 'x.c'],
    'urdf': ['jansen_leg.yaml', '-o', 'x.urdf'],
    'mjcf': ['jansen_leg.yaml', '-o', 'x.xml'],
    'fmu': ['jansen_leg.yaml', '-o', 'x.fmu'],
    'scene': ['jansen_leg.yaml'],
    'accuracy': ['jansen_leg.yaml', '--only', 'errors', '-o', 'x.html'],
    'synthesize': ['--function', 'log10(x)', '--range', '1', '2', '--crank-range', '0', '60',
                   '--rocker-range', '0', '90', '--free-zeros', '--candidates', '100000000'],
}  # fmt: skip


def tries(seed: int, numbers: range) -> Iterator[Try]:
    """Send signals to commands."""
    for number in numbers:
        outcome, fault = _try(random.Random(f'{seed} {number}'))
        yield outcome, fault and f'signal {seed} {number}: {fault}'


def _try(rng: random.Random) -> Try:
    command, sent = rng.choice(sorted(_COMMANDS)), rng.choice(_SIGNALS)
    instant, again = rng.uniform(0.0, _LATEST), rng.random() < 0.3
    results = [word for word in _COMMANDS[command] if word.startswith('x.')]
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / 'jansen_leg.yaml').write_bytes(
            shipped_path('linkages/jansen_leg.yaml').read_bytes()
        )
        process = subprocess.Popen(
            [*LINKAGE, command, *_COMMANDS[command]],
            cwd=folder,
            env=os.environ | {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            _wait_for_handlers(process)
            time.sleep(instant)
            for _ in range(1 + again):
                process.send_signal(sent)
            begun = time.monotonic()
            _, errors = process.communicate(timeout=_PATIENCE)
            took = time.monotonic() - begun
        except subprocess.TimeoutExpired:
            return f'{command}: no end', f'{command}, {sent.name} after {instant:.3f} s: no end'
        finally:
            process.kill()
            process.communicate()
        left = {file.name for file in Path(folder).iterdir()} - {'jansen_leg.yaml', *results}
    where = f'{command}, {sent.name} after {instant:.3f} s'
    code = process.returncode
    if left:
        return f'{command}: {code}', f'{where}: left {", ".join(sorted(left))}'
    if code == 0:
        return f'{command}: had ended', ''
    if (code, errors.splitlines()[-1:]) != (
        1,
        [f'linkage {command}: stopped'],
    ) or 'Trace' in errors:
        return f'{command}: {code}', f'{where}: {code}: {errors[:300]!r}'
    return f'{command}: stopped within {5.0 if took < 5.0 else _PATIENCE:g} s', ''


def _wait_for_handlers(process: subprocess.Popen[str]) -> None:
    status = Path(f'/proc/{process.pid}/status')
    while process.poll() is None:
        with contextlib.suppress(OSError, ValueError):
            (mask,) = [line for line in status.read_text().splitlines() if 'SigCgt' in line]
            if all(int(mask.split()[1], 16) >> (number - 1) & 1 for number in _SIGNALS):
                return
        time.sleep(0.005)
