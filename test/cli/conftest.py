# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The command line as its user types it, in processes of its own."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
import os
from pathlib import Path
import pty
import re
import subprocess
import sys

import pytest

from ..support import commands

Run = Callable[..., 'subprocess.CompletedProcess[str]']

if find_spec('rclpy') is None:
    collect_ignore_glob = ['test_*.py']


def on_terminal(folder: Path, *arguments: str, columns: int = 120, progress: bool = False) -> str:
    """Return what ``linkage`` shows on a terminal, where it ends well; or its progress instead."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, '-m', 'linkage_ros.cli.main', *arguments],
        cwd=folder,
        env=commands.environment(folder)
        | {'TERM': 'xterm-256color', 'COLUMNS': str(columns), 'LINES': '40'},
        stdout=subprocess.DEVNULL if progress else theirs,
        stderr=theirs if progress else subprocess.DEVNULL,
    )
    os.close(theirs)
    shown = b''
    while True:
        try:
            part = os.read(ours, 65536)
        except OSError:  # a pty's way to say that the other end is closed
            break
        shown += part
    os.close(ours)
    assert process.wait(30) == 0
    return shown.decode()


def json_keys(command: str) -> set[str]:
    """Return the keys that the reference documents for ``linkage COMMAND --json``."""
    return set(re.findall(r'^\| `(\w+)` ', _json_section(command), re.MULTILINE))


def json_keys_of(command: str, key: str) -> set[str]:
    """Return the keys that the reference names in the value of a key."""
    row = rf'^\| `{key}` \| (.*) \|$'
    (value,) = re.findall(row, _json_section(command), re.MULTILINE)
    return set(re.findall(r'`(\w+)`', value))


def _json_section(command: str) -> str:
    page = (Path(__file__).parents[2] / 'docs' / 'reference' / 'json.md').read_text('utf-8')
    return page.split(f'\n## linkage {command}\n')[1].split('\n## ')[0]


@pytest.fixture
def linkage(tmp_path: Path) -> Run:
    """Return a function that runs ``linkage`` in an empty folder."""
    return partial(commands.linkage, tmp_path)
