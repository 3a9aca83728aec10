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


"""
A node at work, and one who uses its joint states, each in a process of its own.

Over DDS, in a domain of their own; nothing leaves the machine.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
import json
import os
from pathlib import Path
import select
import subprocess
import sys
from time import monotonic
from typing import Any, NamedTuple

from linkage_ros.errors import LinkageError
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.scene.linkage_text import linkage_text

HELD, CARRIED = 'held', 'carried forward'
"""How a state is used: as it is, or carried by its rates from its stamp to now."""

CRANK_RATE = 1000.0
USE_RATE = 500.0
"""Samples of the crank and uses of a state, a second."""

_LINKAGE_FILE, _SCENE_FILE = 'linkage.yaml', 'ticking.yaml'
_PATIENCE = 30.0  # [s]
_DOMAINS = 101
"""Domain ids up to this one are safe with the ports of every operating system."""


class Used(NamedTuple):
    """
    What a subscriber met at a rate of ticks, in one motion of the crank.

    Attributes
    ----------
    rate
        Ticks a second, in [Hz].
    motion
        Of the crank.
    age
        Of the states when used, in [s].
    errors
        By `HELD` and `CARRIED`: of each use the greatest error of a joint.
    unused
        Uses at which no state had come yet.
    cpu
        Of the node, the share of a core.

    """

    rate: float
    motion: str
    age: Sequence[float]
    errors: dict[str, Sequence[float]]
    unused: int
    cpu: float


def use_states(folder: Path, linkage: Linkage, rate: float, seconds: float) -> list[Used]:
    """
    Run a node and let its states be used.

    Parameters
    ----------
    folder
        An empty one, for its files.
    linkage
        What the node solves.
    rate
        Ticks a second, in [Hz].
    seconds
        How long each motion takes.

    Raises
    ------
    LinkageError
        Where node or user do not do their part.

    """
    inputs = {given.joint for given in linkage.inputs}
    joints = {name: joint for name, joint in linkage.joints.items() if name not in inputs}
    published = 'true' if len(joints) < len(linkage.joints) else 'false'
    text = linkage_text(replace(linkage, joints=joints))
    (folder / _LINKAGE_FILE).write_text(text, 'utf-8')
    scene = folder / _SCENE_FILE
    scene.write_text(
        f'linkage: {_LINKAGE_FILE}\nrate: {rate:g}\ndrive: {{topic: {{}}}}\n'
        f'publish_input: {published}\neffects: {{velocity: {{}}}}\n',
        'utf-8',
    )
    task = {
        'scene': str(scene),
        'seconds': seconds,
        'crank_rate': CRANK_RATE,
        'use_rate': USE_RATE,
    }
    node = ('linkage_ros.ros.linkage_node', '--ros-args', '-p', f'scene:={scene}')
    found = []
    with (
        _process(folder, *node) as server,
        _process(folder, 'linkage_ros.ros.consumer', json.dumps(task)) as consumer,
    ):
        for _ in range(2):
            _answer(consumer, folder)
            begun, spent = monotonic(), _processor_time(server.pid)
            said = _answer(consumer, folder)
            spent = _processor_time(server.pid) - spent
            found.append(
                Used(
                    rate,
                    said['motion'],
                    [age * 1e-9 for age in said['ages']],
                    {HELD: said['held'], CARRIED: said['carried']},
                    said['unused'],
                    spent / (monotonic() - begun),
                )
            )
    if not all(used.age for used in found):
        raise LinkageError(str(scene), 'no joint state came', 'see that DDS works on this machine')
    return found


@contextmanager
def _process(folder: Path, module: str, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Have a module run in a process of its own, on a graph that nobody else hears."""
    environment = {
        **os.environ,
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_DOMAIN_ID': str(1 + os.getpid() % _DOMAINS),
        'ROS_LOG_DIR': str(folder),
    }
    # With this one inherited, the rclpy wheels believe that their library path is set already.
    environment.pop('_ROS_WHEELS_BOOTSTRAP_COMPLETE', None)
    with (folder / f'{module}.log').open('wb') as log:
        process = subprocess.Popen(
            [sys.executable, '-m', module, *arguments],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=log,
            start_new_session=True,  # Ctrl-C is for this process, which ends the others
        )
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(10.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if process.stdout is not None:
            process.stdout.close()


def _answer(process: subprocess.Popen[bytes], folder: Path) -> dict[str, Any]:
    """Return the next line of a consumer."""
    assert process.stdout is not None
    if select.select([process.stdout], [], [], _PATIENCE)[0]:
        line = process.stdout.readline()
        if line:
            answer: dict[str, Any] = json.loads(line)
            return answer
    logs = [log.read_text(errors='replace').strip() for log in sorted(folder.glob('*.log'))]
    last = next((text.splitlines()[-1] for text in logs if text), 'nothing was said')
    raise LinkageError('ticking', f'node and subscriber did not meet: {last}', 'run it by hand')


def _processor_time(pid: int) -> float:
    """Return what a process has used of processors, in [s]."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')
