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
The fenced blocks of the documentation, and which of them are commands.

``sh`` and ``console`` blocks are commands; in a console block a line that begins with ``$`` is
one, and the others are what it shows: ``…`` stands for anything, as a line for lines. A block
whose fence goes on with ``no-test: WHY`` is not run.

A block of another language whose first line is ``# FILE.yaml`` or ``// FILE.c`` is that file,
which the commands behind it on the page find.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import re
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *(ROOT / 'docs').rglob('*.md')])

_FENCE = re.compile(r'^( *)(`{3,}|:{3,})([^\n`]*)\n(.*?)^\1\2 *$', re.MULTILINE | re.DOTALL)
_FILE = re.compile(r'(?:#|//) ([\w./-]+\.(?:yaml|py|csv|c|js))\n')
COMMANDS = ('sh', 'console')


class Block(NamedTuple):
    """
    A fenced block.

    Attributes
    ----------
    page, line
        Where it stands.
    language
        The first word of its fence.
    more
        What stands behind it.
    text
        What is in it.

    """

    page: str
    line: int
    language: str
    more: str
    text: str

    @property
    def why_not(self) -> str:
        """Say why it is not run; '' where it is."""
        return self.more.removeprefix('no-test: ') if self.more.startswith('no-test: ') else ''

    @property
    def file(self) -> str:
        """Return the file that it is; '' for none."""
        found = _FILE.match(self.text)
        return found[1] if found and self.language not in COMMANDS else ''


def blocks(page: Path) -> Iterator[Block]:
    """Yield the blocks of a page."""
    text = page.read_text('utf-8')
    name = page.relative_to(ROOT).as_posix()
    for found in _FENCE.finditer(text):
        language, _, more = found[3].strip().partition(' ')
        line = text.count('\n', 0, found.start()) + 1
        yield Block(name, line, language, more, found[4])


class Command(NamedTuple):
    """What is typed, and the lines that are shown below it."""

    typed: str
    shown: list[str]


def commands(block: Block) -> list[Command]:
    """Return the commands of a block: of ``sh`` all as one, which shows nothing."""
    if block.language == 'sh':
        return [Command(block.text, [])]
    found: list[Command] = []
    for line in block.text.splitlines():
        if line.startswith('$ '):
            found.append(Command(line[2:], []))
        elif line.startswith('> '):
            found[-1] = found[-1]._replace(typed=f'{found[-1].typed}\n{line[2:]}')
        else:
            found[-1].shown.append(line)
    return found


def missing(shown: list[str], out: str) -> str:
    """Return the first line that is shown and does not come in its place; '' where all do."""
    lines = iter(out.splitlines())
    for line in shown:
        if line.strip() in ('', '…'):
            continue
        parts = [re.escape(' '.join(part.split())) for part in line.split('…')]
        pattern = re.compile('.*'.join(parts))
        if not any(pattern.fullmatch(' '.join(came.split())) for came in lines):
            return line
    return ''
