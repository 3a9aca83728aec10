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
Files that are changed at random, through every command that takes one and starts no node.

Each has to end in time and within memory: with what was asked for, or with exit code 2 and a
line that is no longer than a screen. Whatever else comes of it is a finding.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
import random
from typing import Any
import warnings

from campaigns.attacks.mutations import mutated
from campaigns.in_process import confined, in_process
from campaigns.processes import tried_in_parts
from linkage_ros.shipped import shipped

_PART = 50
"""Files that a process takes before it tells."""

_SECONDS = 60.0
"""A command that takes longer has not ended. The slowest takes seconds, of a shared processor."""

_LONGEST_LINE = 1000

_LINKAGE = {
    'check': [],
    'solve': ['--steps', '8', '--rate', '1', '--points'],
    'draw': ['-o', 'x.svg'],
    'compile': ['-o', 'x.c'],
    'urdf': [],
    'mjcf': [],
    'scene': [],
    'cost': ['--ticks', '2'],
}
_SCENE = ('scene', 'cost', 'urdf', 'mjcf')
_TABLES = {
    'pairs': b'crank,rocker\n0,0\n30,17\n60,38\n',
    'path': b'0.1;0.2\n0.15;0.25\n0.2;0.2\n0.15;0.1\n0.12;0.1\n',
}


def attack(count: int, seed: int, jobs: int = 1) -> tuple[dict[str, int], list[str]]:
    """
    Try files.

    Parameters
    ----------
    count
        How many.
    seed
        Another seed changes them otherwise.
    jobs
        How many processes share them.

    Returns
    -------
    tried : dict
        By command and how it ended how often it did.
    findings : list
        What must not be, a line each.

    """
    return tried_in_parts(_part, count, seed, _PART, jobs)


def _part(part: tuple[int, int, int]) -> tuple[Counter[str], list[str]]:
    seed, begin, end = part
    tried, findings = Counter[str](), []
    with warnings.catch_warnings(), confined() as folder:
        warnings.simplefilter('default')
        originals = _originals(folder)
        for number in range(begin, end):
            how, finding = _try(originals, f'{seed} {number}')
            tried[how] += 1
            if finding:
                findings.append(f'file {seed} {number}: {finding}')
    return tried, findings


def _originals(folder: Path) -> dict[str, dict[str, bytes]]:
    """Return whole files by their kind and name, and lay the linkages beside the scenes."""
    linkages = shipped('linkages/four_bar.yaml').parent
    (folder / 'linkages').symlink_to(linkages)
    (folder / 'scenes').mkdir()
    found: dict[str, dict[str, bytes]] = {
        'linkage': {file.name: file.read_bytes() for file in sorted(linkages.glob('*.yaml'))},
        'scene': {
            file.name: file.read_bytes()
            for file in sorted(shipped('scenes/demo.yaml').parent.glob('*.yaml'))
        },
        'urdf': {},
        'table': _TABLES,
    }
    for name in ('four_bar', 'slider_crank', 'watt_1'):
        in_process(['urdf', f'linkages/{name}.yaml', '-o', f'{name}.urdf'], _SECONDS)
        found['urdf'][name] = Path(f'{name}.urdf').read_bytes()
    return found


def _try(originals: dict[str, dict[str, bytes]], seed: str) -> tuple[str, str]:
    """Try a file; return the command and how it ended, and what must not be."""
    rng = random.Random(seed)
    kind = rng.choice(('linkage', 'linkage', 'linkage', 'scene', 'scene', 'urdf', 'table'))
    name = rng.choice(sorted(originals[kind]))
    done, data = mutated(originals[kind][name], rng)
    file = Path('scenes/x.yaml')
    file.write_bytes(data)
    match kind:
        case 'linkage':
            command = rng.choice(sorted(_LINKAGE))
            arguments = [command, str(file), *_LINKAGE[command]]
        case 'scene':
            command = rng.choice(_SCENE)
            arguments = [command, str(file), *_LINKAGE[command]]
        case 'urdf':
            command, arguments = 'import', ['import', str(file)]
        case _:
            command, arguments = 'synthesize', ['synthesize', f'--{name}', str(file)]
            arguments += ['--candidates', '200']
    code, said, _ = in_process(arguments, _SECONDS)
    wrong = judged(command, code, said)
    return f'{command}: {code}', wrong and f'{name}: {done}: {" ".join(arguments)}: {wrong}'


def judged(command: str, code: Any, said: str) -> str:
    """Return what is wrong with an end, in a line; nothing where it is as it should be."""
    lines = [line for line in said.splitlines() if not line.startswith('left out: ')]
    if code == 0 or (command, code) == ('synthesize', 1):
        return f'said {lines[0][:200]}' if lines else ''
    if code != 2:
        return f'{code}: {said.strip()[:300]}'
    longest = max(map(len, lines), default=0)
    # With jsonschema a scene is told all that is wrong with it.
    if not lines or (len(lines) > 1 and command != 'scene'):
        return f'{len(lines)} lines: {said.strip()[:300]}'
    return f'a line of {longest} letters: {said[:100]}' if longest > _LONGEST_LINE else ''
