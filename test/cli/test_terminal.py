# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Tables and progress: folded to the width of a terminal, whole in a pipe."""

from __future__ import annotations

import os
from pathlib import Path
import pty
import re
import subprocess
import sys
from threading import Thread

from linkage_ros.cli import (
    FIRST_LINE,
    fold_table,
    print_tables,
    show_progress,
    Table,
    table_text,
    terminal,
)
from linkage_ros.cli.main import main
from linkage_ros.progress import progress_told_to, tell_progress
import pytest

from .conftest import on_terminal

LINKAGES = Path(__file__).parents[2] / 'config' / 'linkages'


def words(tables: list[Table]) -> list[str]:
    return sorted(' '.join(map(table_text, tables)).split())


def test_table_that_fits_is_not_folded():
    table = Table('title', ['a', '>b'], [['x', '1']])
    assert fold_table(table, 80) == [table]


def test_long_cell_is_wrapped_at_spaces():
    table = Table('', ('', ''), [['one', 'some words that are too many'], ['two', 'x']])
    (part,) = fold_table(table, 30)
    assert table_text(part).splitlines() == [
        'one  some words that are',
        '     too many',
        'two  x',
    ]


def test_blocks_of_a_folded_table_repeat_the_first_column():
    heads = ['>crank [°]', *(f'>joint_{i} [°]' for i in range(8))]
    rows = [[f'{row}.5', *(f'{row}{i}.123456' for i in range(8))] for row in range(3)]
    parts = fold_table(Table('title', heads, rows), 50)
    assert len(parts) > 1
    assert [part.title for part in parts] == ['title', *[''] * (len(parts) - 1)]
    for part in parts:
        assert [row[0] for row in part.rows] == ['0.5', '1.5', '2.5']
        assert max(map(len, table_text(part).splitlines())) <= 50
    columns = [column for part in parts for column in part.columns[1:]]
    assert [column.replace('\n', ' ') for column in columns] == heads[1:]


def test_folded_table_breaks_no_word():
    path = '/a/path/that/is/longer/than/the/terminal.yaml'
    table = Table(path, ['a', '>b c'], [[path, '1 2'], ['x', path]])
    parts = fold_table(table, 20)
    assert set(words(parts)) == set(words([table]))


@pytest.mark.parametrize('columns', [60, 80, 120])
def test_folded_lines_fit_the_width_of_the_terminal(tmp_path, columns):
    shown = on_terminal(
        tmp_path,
        *('solve', str(LINKAGES / 'jansen_leg.yaml'), '--steps', '2', '--rate', '60'),
        columns=columns,
    )
    lines = re.sub('\x1b\\[[0-9;]*m', '', shown).splitlines()
    assert max(map(len, lines)) <= columns
    assert sum('crank_joint' in line for line in lines) > 1


def test_piped_table_has_one_line_per_row(capsys):
    print_tables(Table('', ['a', 'b'], [['x ' * 200, 'y ' * 200], ['1', '2']]))
    assert len(capsys.readouterr().out.splitlines()) == 3


class Clock:
    """A clock that a test sets, in [s]."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(terminal, 'monotonic', made)
    monkeypatch.setattr(terminal, 'FIRST_LINE', FIRST_LINE)
    return made


def test_progress_bar_is_erased_after_the_task():
    pytest.importorskip('rich')
    ours, theirs = pty.openpty()
    program = (
        'from linkage_ros.cli import show_progress\n'
        'with show_progress("parts") as advance:\n    advance(1, 2)\n    advance(2, 2)\n'
    )
    subprocess.run(
        [sys.executable, '-c', program], stderr=theirs, env={'TERM': 'xterm'}, check=True
    )
    os.close(theirs)
    shown = os.read(ours, 65536).decode()
    os.close(ours)
    text = re.sub('\x1b\\[[0-9;?]*[a-zA-Z]', '', shown)
    assert re.search('parts ━+ 2/2', text)
    assert shown.endswith('\x1b[1A\x1b[2K')  # up, and the line is erased


def test_short_task_prints_no_progress_in_a_pipe(capsys, clock):
    with show_progress('parts') as advance:
        clock.now = 1.9
        advance(1, 2)
    assert capsys.readouterr().err == ''


def test_long_task_prints_progress_and_end_in_a_pipe(capsys, clock):
    with show_progress('parts') as advance:
        for clock.now in (1.0, 2.0, 3.0, 31.0, 32.0):
            advance(int(clock.now), 40)
        clock.now = 40.0
    assert capsys.readouterr().err.splitlines() == [
        'parts: 2 of 40', 'parts: 32 of 40', 'parts: ended after 40.0 s',
    ]  # fmt: skip


@pytest.mark.parametrize(
    ('command', 'told'),
    [
        ('check class_3', {'turns of a branch followed', 'states examined'}),
        ('check stephenson_3', {'values of the input tried', 'states examined'}),
        (
            'check ankle_motors',
            {'cells of links that close only together made', 'starts of other assemblies tried'},
        ),
        ('solve ankle_motors --at 10 10', {'steps planned'}),
        ('draw class_3 -o x.svg', {'turns of a branch followed'}),
        ('compile ankle_motors -o x.c', {'cells of links that close only together made'}),
    ],
)
def test_slow_command_prints_progress_of_each_part(command, told, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(terminal, 'FIRST_LINE', 0.0)
    monkeypatch.setattr(terminal, '_EVERY', 0.0)
    assert main(command.split()) == 0
    lines = capsys.readouterr().err.splitlines()
    counted = [re.fullmatch(r'(.*): (\d+)(?: of (\d+))?', line) for line in lines]
    found = [each.groups() for each in counted if each]
    assert told <= {what for what, _, _ in found}
    assert all(int(done) <= int(of) for _, done, of in found if of)


def test_progress_is_reported_to_the_waiting_thread_only():
    """A tick has a thread of its own, and never writes on what it builds."""
    heard = []
    with progress_told_to(lambda *told: heard.append(told)):
        tell_progress('here', 1, 2)
        ticking = Thread(target=tell_progress, args=('there', 1))
        ticking.start()
        ticking.join()
        with progress_told_to(None):
            tell_progress('within a bar', 1)
    tell_progress('afterwards', 1)
    assert heard == [('here', 1, 2)]
