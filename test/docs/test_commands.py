# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Every command and Python block of the documentation runs, in a folder that begins empty."""

from __future__ import annotations

from importlib.util import find_spec
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys

from linkage_ros.domains import private_domain
import pytest

from .blocks import Block, blocks, COMMANDS, commands, missing, PAGES, ROOT

BLOCKS = {page.relative_to(ROOT).as_posix(): list(blocks(page)) for page in PAGES}
ALL = [block for page in BLOCKS.values() for block in page if block.language in COMMANDS]
WITH_COMMANDS = [
    name for name, page in BLOCKS.items() if {b.language for b in page} & {*COMMANDS, 'python'}
]
RUN = [
    name
    for name in sorted(WITH_COMMANDS, key=lambda name: name != 'README.md')
    if any(
        b.language == 'python' or (b.language in COMMANDS and not b.why_not) for b in BLOCKS[name]
    )
]
"""Pages with something to run; the README first, which any sample holds."""

NOT_RUN = {
    'builds .venv, and runs all tests': 1,
    'installs from a package index': 5,
    'needs Gazebo': 1,
    'needs PlotJuggler': 1,
    'needs RViz': 1,
    'needs a ROS installation with ros2_control': 1,
    'needs a ROS installation': 19,
    'needs a second machine': 3,
    "needs bloom, rosdep's lists and Debian's tools": 1,
    'needs a demo that runs in another terminal': 1,
    'needs the ros2 command line': 2,
    'opens a browser': 3,
    'the importer is another program': 1,
}
"""Number of blocks that are not run, by reason."""

HERE = Path(sys.executable).parent
"""Folder of the commands of this package."""

LONGEST = 60.0
"""Time limit of a command, in [s]."""

NEEDS = {'docs/how_to/compile.md': 'cc'}
"""Programs of other packages that the commands of a page start."""


def environment(folder: Path) -> dict[str, str]:
    clean = {key: value for key, value in os.environ.items() if key != 'PYTHONPATH'}
    return clean | {
        'PATH': f'{HERE}{os.pathsep}{clean["PATH"]}',
        'HOME': str(folder.parent),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_DOMAIN_ID': str(private_domain()),
        'ROS_LOG_DIR': str(folder.parent / 'log'),
        'RCUTILS_COLORIZED_OUTPUT': '0',
        'MPLBACKEND': 'agg',
    }


def run(
    typed: str, folder: Path, exports: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ['bash', '-euo', 'pipefail', '-c', typed],
        cwd=folder,
        env=environment(folder) | (exports or {}),
        capture_output=True,
        text=True,
        timeout=LONGEST,
        check=False,
    )


def exported(typed: str, folder: Path) -> dict[str, str]:
    """Return the variable that ``export NAME=VALUE`` sets for later commands."""
    words = typed.split()
    if len(words) != 2 or words[0] != 'export':
        return {}
    name, _, value = words[1].partition('=')
    return {name: value.replace('$PWD', str(folder))}


def run_block(block: Block, folder: Path, exports: dict[str, str]) -> None:
    """Run the commands of a block; fail if the output differs from the page."""
    where = f'{block.page}:{block.line}'
    for command in commands(block):
        if (variable := exported(command.typed, folder)) and not command.shown:
            exports |= variable
            continue
        # A command may show the exit code of the one before it.
        lenient = '; echo' in command.typed
        done = run(f'set +e; {command.typed}' if lenient else command.typed, folder, exports)
        output = f'{where}: $ {command.typed}\n{done.stdout}{done.stderr}'
        assert done.returncode == 0, output
        line = missing(command.shown, done.stdout)
        assert not line, f'{where}: missing: {line}\n{output}'


@pytest.mark.sample(2)
@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.skipif(find_spec('rclpy') is None, reason='needs rclpy')
@pytest.mark.skipif(not (HERE / 'linkage').is_file(), reason='needs an installed linkage')
@pytest.mark.parametrize('page', RUN)
def test_documented_commands_print_the_shown_output(page, tmp_path):
    if (needed := NEEDS.get(page)) and shutil.which(needed) is None:
        pytest.skip(f'needs {needed}')
    folder = tmp_path / 'here'
    folder.mkdir()
    exports: dict[str, str] = {}
    for block in BLOCKS[page]:
        if block.language == 'python':
            (folder / 'block.py').write_text(block.text)
            done = run(f'{sys.executable} block.py', folder, exports)
            assert done.returncode == 0, f'{block.page}:{block.line}:\n{done.stderr}'
        elif block.language in COMMANDS and not block.why_not:
            run_block(block, folder, exports)


def test_skipped_blocks_have_counted_reasons():
    reasons = [block.why_not for block in ALL if block.why_not]
    assert {reason: reasons.count(reason) for reason in sorted({*reasons})} == NOT_RUN


@pytest.mark.parametrize('page', WITH_COMMANDS)
def test_skipped_blocks_name_only_files_of_the_page(page):
    made: set[str] = set()
    for block in BLOCKS[page]:
        if block.language in COMMANDS:
            text = re.sub(r' #.*|\$PWD/', '', block.text)
            made |= set(re.findall(r'(?:> |-o )([\w.]+)', text))
            if block.why_not:
                named = set(re.findall(r'(?<![\w/])\w+\.(?:yaml|urdf)\b', text))
                assert named <= made, f'{page}:{block.line}'


def test_readme_has_at_most_160_lines():
    assert len((ROOT / 'README.md').read_text('utf-8').splitlines()) <= 160


def test_most_blocks_of_the_documentation_are_run():
    assert len(ALL) - sum(NOT_RUN.values()) >= 30


def test_command_fence_holds_language_and_reason_only():
    for block in ALL:
        assert block.why_not or not block.more, (
            f'{block.page}:{block.line}: unexpected {block.more!r}'
        )


def test_every_command_block_names_its_language():
    for name, page in BLOCKS.items():
        for block in page:
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
def test_output_lines_are_expected_in_their_order(shown, out, expected):
    assert missing(shown, out) == expected
