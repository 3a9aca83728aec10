# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What commands print: each file of ``approved`` is a session that a person has read and approved.

A line that begins with ``$`` is typed; what follows is printed, where ``!`` marks standard error
and ``= 2`` an exit code other than 0. ``$ cat > FILE`` writes the lines up to ``EOF``. To approve
what commands print now: ``LINKAGE_APPROVE=1 pytest test/cli/test_approved.py``, then read the
difference.
"""

from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path
import re
from shlex import split

import pytest

from .conftest import json_keys
from ..support import commands

ROOT = Path(__file__).parents[2]
SESSIONS = sorted((Path(__file__).parent / 'approved').glob('*.txt'))
PLACES = {
    'RECORDED': str(ROOT / 'test' / 'bag' / 'recorded'),
    'TEST': str(ROOT / 'test'),
    'ROOT': str(ROOT),
}
"""Folders, by what stands for them in a session."""


def _round_numbers(found: re.Match[str]) -> str:
    return re.sub(r'-?\d+\.\d{7,}', lambda number: f'{float(number[0]):.6g}', found[0])


MASKS = (
    (r'(?<=\"python\": ).*|(?<=\"machine\": ).*', 'VERSION'),
    (r'[-+]?\d(?:\.\d+)?e-1[4-9]|[-+]?0\.0+e\+00', 'ROUNDING'),
    (r'(worst residual +)\S+ (\S+), (of \d+ positions, )?at .*', r'\1ROUNDING \2, \3at PLACE'),
    (r'("residual_m": )[^,]+(,\s+"inputs": \[)[^\]]*', r'\1ROUNDING\2PLACE'),
    (r'(?<=made and replayed by ).*|(?<=made by ).*|(?<=replayed by ).*', 'VERSIONS'),
    # Where a value is greatest, it is flat.
    (r'(?<="conditioning": )[\d.]+,\s+"inputs": \[[^\]]*', _round_numbers),
    (r'-?\d+\.\d{13,}(?:e[-+]\d+)?', lambda found: f'{float(found[0]):.12g}'),
)
"""What differs from machine to machine, and what is written in its place."""


PROGRESS = re.compile(r': \d+( of \d+)?$|: ended after [\d.]+ s$')
"""A line that a command prints only if it takes long."""


def _blocks(text: str) -> Iterator[tuple[str, str]]:
    """Yield each typed line of a session with what follows it."""
    for block in re.split(r'^\$ ', text, flags=re.MULTILINE)[1:]:
        typed, _, rest = block.partition('\n')
        yield typed, rest


def _play_session(text: str, folder: Path) -> str:
    """Return a session with what is printed now."""
    told = []
    for typed, rest in _blocks(text):
        program, *words = split(typed)
        if program == 'cat':
            (folder / words[1]).write_text(rest.partition('EOF\n')[0], 'utf-8')
            told.append(f'$ {typed}\n{rest}')
            continue
        for name, place in PLACES.items():
            words = [word.replace(f'${name}', place) for word in words]
        if program == 'show':
            printed, code, errors = (folder / words[0]).read_text('utf-8'), 0, ''
        else:
            answer = commands.linkage(folder, *words, TZ='UTC')
            printed, code, errors = answer.stdout, answer.returncode, answer.stderr
        printed += ''.join(
            f'! {line}\n' for line in errors.splitlines() if not PROGRESS.search(line)
        )
        printed += f'= {code}\n' * (code != 0)
        for name, place in (PLACES | {'FOLDER': str(folder)}).items():
            printed = printed.replace(place, f'${name}')
        for pattern, mask in MASKS:
            printed = re.sub(pattern, mask, printed)
        told.append(f'$ {typed}\n{printed}')
    return ''.join(told)


@pytest.mark.parametrize('session', SESSIONS, ids=lambda file: file.stem)
def test_terminal_session_prints_the_approved_text(session: Path, tmp_path: Path) -> None:
    approved = session.read_text('utf-8')
    now = _play_session(approved, tmp_path)
    if os.environ.get('LINKAGE_APPROVE'):
        session.write_text(now, 'utf-8')
        return
    for said, approved_block in zip(_blocks(now), _blocks(approved), strict=True):
        assert said == approved_block


def test_json_has_the_documented_keys() -> None:
    """What the sessions print as JSON has the keys that the reference lists."""
    seen = set()
    for session in SESSIONS:
        for typed, printed in _blocks(session.read_text('utf-8')):
            if '--json' not in typed or not printed.startswith('{') or '--list' in typed:
                continue
            _, command, *words = split(typed)
            if command == 'replay' and {'--scene', '--set'}.intersection(words):
                command = 'replay --scene'
            keys = re.findall(r'^ "(\w+)"', printed, re.MULTILINE)
            if command == 'check' and 'hinges' in keys:
                command = 'check of a spatial linkage'
            assert {*keys} - {'branches'} == json_keys(command), typed
            seen.add(command)
    assert {'check', 'compare', 'gallery', 'info', 'replay', 'replay --scene', 'scene'} <= seen
    assert {'solve', 'synthesize'} <= seen
