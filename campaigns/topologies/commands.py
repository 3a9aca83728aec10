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

from dataclasses import replace
from pathlib import Path
import random
import tempfile

from campaigns.in_process import in_process
from campaigns.topologies.judge import Findings
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.scene.linkage_text import linkage_text

FILES = ('draw', 'urdf', 'mjcf')
"""Commands that write a file; beside these there are `check`, and `accuracy`, which is slow."""

_SECONDS = 600
"""A command that takes longer has not ended; on a free machine the slowest takes some 15 s."""


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
        code, said, _ = in_process(arguments, _SECONDS)
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
