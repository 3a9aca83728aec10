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


"""Every command and Python block of the documentation runs, in a folder with what its page has."""

from __future__ import annotations

from importlib.util import find_spec
import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest

from .blocks import Block, blocks, COMMANDS, commands, missing, PAGES, ROOT

BLOCKS = {page.relative_to(ROOT).as_posix(): list(blocks(page)) for page in PAGES}
ALL = [block for found in BLOCKS.values() for block in found if block.language in COMMANDS]
WITH_COMMANDS = [
    name for name, found in BLOCKS.items() if {b.language for b in found} & {*COMMANDS, 'python'}
]

NOT_RUN = {
    'builds .venv, and runs all tests': 1,
    'installs from a package index': 1,
    'needs RViz': 1,
    'needs a ROS installation': 12,
    'needs rosdep and a ROS installation': 1,
    'needs the ros2 command line': 2,
}
"""Why how many blocks are not run."""

HERE = Path(sys.executable).parent
"""Where the commands of this package lie."""

LONGEST = 60.0
"""How long one command may take, in [s]."""

FIVE = '50,100\n60,102\n75,108\n90,116\n110,125\n'
OVAL = (
    '0.080,0.060\n0.070,0.075\n0.050,0.080\n0.030,0.075\n0.020,0.060\n0.030,0.045\n'
    '0.050,0.040\n0.070,0.045\n'
)


def given_a_scene(folder: Path) -> None:
    """Lay out linkages, and a scene of one's own."""
    for file in (ROOT / 'config' / 'linkages').iterdir():
        shutil.copy(file, folder)
    (folder / 'my_scene.yaml').write_text('linkage: four_bar.yaml\neffects: {velocity: {}}\n')


def given_to_the_readme(folder: Path) -> None:
    """Lay out what the README takes for granted: linkages, data, a run, and a damaged bag."""
    given_a_scene(folder)
    (folder / 'five.csv').write_text(FIVE)
    (folder / 'curve.csv').write_text(OVAL)
    scene = 'linkage: four_bar.yaml\ndrive: {sine: {amplitude: 1.0, frequency: 2.0}}\n'
    (folder / 'demo.yaml').write_text(f'{scene}record: {{}}\n')
    typed = 'linkage run demo.yaml --seconds 2 --plain && cp runs/demo_*/*.mcap damaged.mcap'
    done = run(f'{typed} && truncate -s -5000 damaged.mcap', folder)
    assert done.returncode == 0, done.stderr


GIVEN = {'README.md': given_to_the_readme, 'docs/accuracy.md': given_a_scene}
"""What is laid out beforehand, by page."""

NEEDS = {'docs/how_to/compile.md': 'cc'}
"""Programs that are no part of this package and that a page's commands start."""


def environment(folder: Path) -> dict[str, str]:
    clean = {key: value for key, value in os.environ.items() if key != 'PYTHONPATH'}
    return clean | {
        'PATH': f'{HERE}{os.pathsep}{clean["PATH"]}',
        'HOME': str(folder.parent),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_DOMAIN_ID': str(1 + (os.getpid() + 50) % 101),
        'ROS_LOG_DIR': str(folder.parent / 'log'),
        'RCUTILS_COLORIZED_OUTPUT': '0',
        'MPLBACKEND': 'agg',
    }


def run(
    typed: str, folder: Path, own: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ['bash', '-euo', 'pipefail', '-c', typed],
        cwd=folder,
        env=environment(folder) | (own or {}),
        capture_output=True,
        text=True,
        timeout=LONGEST,
        check=False,
    )


def exported(typed: str, folder: Path) -> dict[str, str]:
    """Return what ``export NAME=VALUE`` leaves for the commands behind it."""
    words = typed.split()
    if len(words) != 2 or words[0] != 'export':
        return {}
    name, _, value = words[1].partition('=')
    return {name: value.replace('$PWD', str(folder))}


def work_through(block: Block, folder: Path, own: dict[str, str]) -> None:
    """Run a block's commands; fail where one does not do what the page says."""
    where = f'{block.page}:{block.line}'
    for command in commands(block):
        if (exports := exported(command.typed, folder)) and not command.shown:
            own |= exports
            continue
        # What a reader of a page does in one terminal, a command may do after a `;`.
        lenient = '; echo' in command.typed
        done = run(f'set +e; {command.typed}' if lenient else command.typed, folder, own)
        told = f'{where}: $ {command.typed}\n{done.stdout}{done.stderr}'
        assert done.returncode == 0, told
        line = missing(command.shown, done.stdout)
        assert not line, f'{where}: did not come: {line}\n{told}'


@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.skipif(find_spec('rclpy') is None, reason='needs rclpy')
@pytest.mark.skipif(not (HERE / 'linkage').is_file(), reason='needs an installed linkage')
@pytest.mark.parametrize('page', WITH_COMMANDS)
def test_the_commands_of_a_page_do_what_it_says(page, tmp_path):
    if (needed := NEEDS.get(page)) and shutil.which(needed) is None:
        pytest.skip(f'needs {needed}')
    folder = tmp_path / 'here'
    folder.mkdir()
    GIVEN.get(page, lambda _folder: None)(folder)
    own: dict[str, str] = {}
    for block in BLOCKS[page]:
        if block.file:
            (folder / block.file).parent.mkdir(exist_ok=True)
            (folder / block.file).write_text(block.text)
        elif block.language == 'python':
            (folder / 'block.py').write_text(block.text)
            done = run(f'{sys.executable} block.py', folder, own)
            assert done.returncode == 0, f'{block.page}:{block.line}:\n{done.stderr}'
        elif block.language in COMMANDS and not block.why_not:
            work_through(block, folder, own)


def test_what_is_not_run_says_why_and_is_counted():
    reasons = [block.why_not for block in ALL if block.why_not]
    assert {reason: reasons.count(reason) for reason in sorted({*reasons})} == NOT_RUN


def test_most_blocks_of_the_documentation_are_run():
    assert len(ALL) - sum(NOT_RUN.values()) >= 30


def test_a_fence_of_commands_says_nothing_else():
    for block in ALL:
        assert block.why_not or not block.more, (
            f'{block.page}:{block.line}: what is {block.more!r}?'
        )


def test_every_block_of_commands_has_its_language():
    for name, found in BLOCKS.items():
        for block in found:
            assert block.language not in ('bash', 'shell', 'zsh'), f'{name}:{block.line}: write sh'
            is_typed = block.text.startswith(('linkage ', '$ ', 'ros2 '))
            assert not is_typed or block.language in COMMANDS, f'{name}:{block.line}'


@pytest.mark.parametrize(
    ('shown', 'out', 'expected'),
    [
        (['a', 'c'], 'a\nb\nc\n', ''),
        (['c', 'a'], 'a\nb\nc\n', 'a'),
        (['x … y'], 'x  12  y\n', ''),
        (['x … y'], 'x  12  z\n', 'x … y'),
        (['…', 'c'], 'a\nb\nc\n', ''),
        (['a.c'], 'abc\n', 'a.c'),
        (['a'], '', 'a'),
    ],
)
def test_shown_lines_have_to_come_in_their_order(shown, out, expected):
    assert missing(shown, out) == expected
