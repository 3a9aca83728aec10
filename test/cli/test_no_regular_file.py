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

"""What is no regular file is refused at once, by every command, in one line."""

from __future__ import annotations

import os
from pathlib import Path
import socket

import pytest

from .conftest import Run

READS = {
    'check': ['check', 'FILE'],
    'solve': ['solve', 'FILE'],
    'draw': ['draw', 'FILE'],
    'compile': ['compile', '-o', 'x.c', 'FILE'],
    'urdf': ['urdf', 'FILE'],
    'mjcf': ['mjcf', 'FILE'],
    'scene': ['scene', 'FILE'],
    'cost': ['cost', 'FILE'],
    'accuracy': ['accuracy', '-o', 'page', 'FILE'],
    'run': ['run', 'FILE'],
    'import': ['import', 'FILE'],
    'synthesize': ['synthesize', '--pairs', 'FILE'],
    'path': ['synthesize', '--path', 'FILE'],
    'replay': ['replay', 'bag', '--scene', 'FILE'],
    'linkage of a scene': ['scene', 'scene.yaml'],
    # Of a bag the folder, and what lies in it.
    'info: metadata': ['info', 'bag'],
    'recover: metadata': ['recover', 'bag'],
    'play: metadata': ['play', 'bag'],
    'info: file': ['info', 'bag_of_one'],
}
KINDS = {'pipe': 'a pipe', 'socket': 'a socket', 'device': 'a device'}


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('read', READS)
def test_what_is_no_regular_file_is_refused(
    linkage: Run, tmp_path: Path, read: str, kind: str
) -> None:
    for name in ('bag', 'bag_of_one'):
        (tmp_path / name).mkdir()
    (tmp_path / 'scene.yaml').write_text('linkage: odd\n')
    for place in ('odd', 'bag/metadata.yaml', 'bag_of_one/x_0.mcap'):
        make(kind, tmp_path / place)
    answer = linkage(*(word.replace('FILE', 'odd') for word in READS[read]))
    assert answer.returncode == 2
    (line,) = answer.stderr.splitlines()
    # Files of a bag, and those that a scene names, have words of their own for it.
    assert READS[read][-1] != 'FILE' or f'is {KINDS[kind]}, not a regular file' in line


def make(kind: str, place: Path) -> None:
    if kind == 'pipe':
        os.mkfifo(place)
    elif kind == 'device':
        place.symlink_to('/dev/zero')
    else:
        with socket.socket(socket.AF_UNIX) as end:
            # The name of a socket has room for a hundred letters.
            folder = os.open(place.parent, os.O_RDONLY)
            end.bind(f'/proc/self/fd/{folder}/{place.name}')
            os.close(folder)
