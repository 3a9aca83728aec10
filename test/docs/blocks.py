# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The fenced blocks of the documentation, and which of them are commands.

``sh`` and ``console`` blocks are commands. In a console block a line that begins with ``$`` is a
command, and the other lines are its output: ``…`` stands for any text, as a line for any lines. A
block whose fence has ``no-test: REASON`` after its language is not run.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import re
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *(ROOT / 'docs').rglob('*.md')])

_FENCE = re.compile(r'^( *)(`{3,}|:{3,})([^\n`]*)\n(.*?)^\1\2 *$', re.MULTILINE | re.DOTALL)
COMMANDS = ('sh', 'console')


class Block(NamedTuple):
    """A fenced block: the first word of its fence is the language, ``more`` the rest."""

    page: str
    line: int
    language: str
    more: str
    text: str

    @property
    def why_not(self) -> str:
        """Return the reason why it is not run; '' if it is run."""
        return self.more.removeprefix('no-test: ') if self.more.startswith('no-test: ') else ''


def blocks(page: Path) -> Iterator[Block]:
    """Yield the blocks of a page."""
    text = page.read_text('utf-8')
    name = page.relative_to(ROOT).as_posix()
    for match in _FENCE.finditer(text):
        language, _, more = match[3].strip().partition(' ')
        line = text.count('\n', 0, match.start()) + 1
        yield Block(name, line, language, more, match[4])


class Command(NamedTuple):
    """A command, and the lines of its output on the page."""

    typed: str
    shown: list[str]


def commands(block: Block) -> list[Command]:
    """Return the commands of a block; an ``sh`` block is one command without output."""
    if block.language == 'sh':
        return [Command(block.text, [])]
    result: list[Command] = []
    for line in block.text.splitlines():
        if line.startswith('$ '):
            result.append(Command(line[2:], []))
        elif line.startswith('> '):
            result[-1] = result[-1]._replace(typed=f'{result[-1].typed}\n{line[2:]}')
        else:
            result[-1].shown.append(line)
    return result


def missing(shown: list[str], out: str) -> str:
    """Return the first line of the page that is missing in the output; '' for none."""
    lines = iter(out.splitlines())
    for line in shown:
        if line.strip() in ('', '…'):
            continue
        parts = [re.escape(' '.join(part.split())) for part in line.split('…')]
        pattern = re.compile('.*'.join(parts))
        if not any(pattern.fullmatch(' '.join(printed.split())) for printed in lines):
            return line
    return ''
