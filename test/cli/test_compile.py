# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage compile``: what it writes runs, and what it cannot write it says in one line."""

from __future__ import annotations

from pathlib import Path
import shutil
import subprocess

import pytest

from .conftest import Run

LINKAGES = Path(__file__).parents[2] / 'config' / 'linkages'
FOUR_BAR = str(LINKAGES / 'four_bar.yaml')

ODD = {
    'the end of a comment': 'crank */ #error',
    'the begin of a comment': 'crank /* //',
    'a trigraph': 'crank ??/',
    'a backslash': r'crank \\',
}
"""Names of links, as they stand between double quotes in YAML."""


def refused(linkage: Run, *typed: str) -> str:
    """Return the one line by which a command refuses what was typed."""
    answer = linkage('compile', *typed)
    assert (answer.returncode, answer.stdout) == (2, '')
    # Before it, what takes long tells how far it is.
    lines = answer.stderr.splitlines()
    (line,) = (line for line in lines if ' made: ' not in line and ' planned: ' not in line)
    return line.removeprefix('linkage compile: ')


def test_file_name_that_is_no_c_name_is_refused(linkage: Run, tmp_path: Path) -> None:
    shutil.copy(FOUR_BAR, tmp_path / '4.yaml')
    said = "4.yaml: '4' cannot be a name in C; write one, as --name four_bar"
    assert refused(linkage, '4.yaml', '-o', 'a.c') == said
    assert linkage('compile', '4.yaml', '-o', 'a.c', '--name', 'four').stdout == 'a.c\n'
    assert 'four_motion(' in (tmp_path / 'a.c').read_text()
    # In a module nothing is named after the file.
    assert linkage('compile', '4.yaml', '-o', 'a.py').returncode == 0


def test_compile_names_the_line_of_inputs_with_too_many_cells(
    linkage: Run, tmp_path: Path
) -> None:
    shutil.copy(LINKAGES / 'space' / 'hexapod.yaml', tmp_path)
    said = refused(linkage, 'hexapod.yaml', '-o', 'a.c')
    assert said.startswith('hexapod.yaml:35: input: 6 inputs move links that close only together')
    assert not (tmp_path / 'a.c').exists()


@pytest.mark.parametrize('ending', ['c', 'h', 'js', 'py'])
def test_iterated_links_with_one_input_are_compiled(
    linkage: Run, tmp_path: Path, ending: str
) -> None:
    shutil.copy(LINKAGES / 'class_3.yaml', tmp_path)
    assert linkage('compile', 'class_3.yaml', '-o', f'a.{ending}').stdout == f'a.{ending}\n'
    assert 'row' in (tmp_path / f'a.{ending}').read_text('utf-8')


def test_compile_asks_for_a_pose_where_no_loop_closes(linkage: Run, tmp_path: Path) -> None:
    text = (LINKAGES / 'five_bar.yaml').read_text('utf-8').replace('O2: [0.120, 0]', 'O2: [9, 0]')
    (tmp_path / 'apart.yaml').write_text(text, 'utf-8')
    said = 'no state is found at which the linkage is closed; write one at which it is: pose: '
    assert said in refused(linkage, 'apart.yaml', '-o', 'a.c')


@pytest.mark.sample(6)
@pytest.mark.skipif(shutil.which('cc') is None, reason='needs cc')
@pytest.mark.parametrize('odd', ODD)
@pytest.mark.parametrize('ending', ['c', 'h', 'js', 'py', 'py --arrays'])
def test_odd_names_of_links_stay_in_the_comments(
    linkage: Run, tmp_path: Path, ending: str, odd: str
) -> None:
    text = Path(FOUR_BAR).read_text('utf-8').replace('crank:', f'"{ODD[odd]}":')
    text = text.replace('child: crank', f'child: "{ODD[odd]}"')
    text = text.replace('parent: crank', f'parent: "{ODD[odd]}"')
    (tmp_path / 'odd.yaml').write_text(text, 'utf-8')
    answer = linkage('compile', 'odd.yaml', '-o', *f'a.{ending}'.split())
    ending = ending.partition(' ')[0]
    assert answer.returncode == 0, answer.stderr
    source = (tmp_path / f'a.{ending}').read_text('utf-8')
    assert '#error' in source or '#error' not in ODD[odd]
    if ending == 'py':
        compile(source, 'a.py', 'exec')
    elif ending == 'js':
        comment, _, code = source.partition('*/')
        assert 'crank' in comment
        assert 'crank' not in code.replace('crank_joint', '')
    else:
        typed = ['cc', '-std=c99', '-Wall', '-Wextra', '-Wpedantic', '-Werror', '-x', 'c']
        done = subprocess.run(
            [*typed, '-c', f'a.{ending}', '-o', 'a.o'], cwd=tmp_path, capture_output=True,
            text=True, timeout=60, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr


def test_arrays_are_written_as_a_python_module_only(linkage: Run, tmp_path: Path) -> None:
    said = '--arrays: a.c is not a Python module; name it x.py'
    assert refused(linkage, FOUR_BAR, '-o', 'a.c', '--arrays') == said
    assert linkage('compile', FOUR_BAR, '-o', 'a.py', '--arrays').stdout == 'a.py\n'
    text = (tmp_path / 'a.py').read_text()
    assert [name for name in ('motion', 'jacobian') if f'def {name}(' in text] == [
        'motion',
        'jacobian',
    ]


def test_compile_refuses_arrays_for_six_inputs(linkage: Run, tmp_path: Path) -> None:
    said = refused(linkage, 'hexapod', '-o', 'a.py', '--arrays')
    assert 'hexapod.yaml:35: input: 6 inputs move links that close only together, and' in said
    assert not (tmp_path / 'a.py').exists()
