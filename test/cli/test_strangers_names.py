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
A bag calls its topics, types, joints and files what it likes: what is shown is printable.

Escapes of a terminal, line breaks, letters that turn the direction of writing, and halves of
letters come out as Python writes them; what is too long loses its middle.
"""

from __future__ import annotations

import json
from pathlib import Path

from linkage_ros.bag.reader import read_bag, RUN_FILE
from linkage_ros.bag.topic import Topic
from linkage_ros.bag.writer import BagWriter
from linkage_ros.cli.outlet import Outlet
from linkage_ros.errors import clean, LinkageError
from linkage_ros.messages.joint_state import JointStateWriter
from linkage_ros.messages.single_values import text_message
import pytest

from .recorded import BEGIN, JOINT_STATE, MS
from .test_bounds import told
from .test_replay import recorded

ODD = {
    'an escape': 'a\x1b[31mred\x1b]0;title\x07',
    'line breaks': 'a\r\nlinkage info: all is well\x85\u2028',
    'turned': 'a\u202egnp.exe\u2066\u200f',
    'no width': 'a\u200b\ufeff\u00ad',
    'long': 'x' * 331_000,
}
COMMANDS = {
    'info': [],
    'info --json': [],
    'export': ['-o', 'x.csv'],
    'plot': [],
    'report': [],
    'replay': [],
    'recover': ['-o', 'recovered'],
    'play': ['--rate', '1000'],
}


def odd_bag(folder: Path, odd: str) -> Path:
    """Write a bag whose names are all odd; its scene is whole."""
    whole = read_bag(recorded(folder, 'effects: {velocity: {}}\n', 60))
    account = json.loads(whole.attachments[RUN_FILE])
    account |= {'scene': odd, 'linkage_ros': odd, 'python': odd, 'effects': {odd: odd}}
    files = {name: ('', data) for name, data in whole.attachments.items()}
    files[RUN_FILE] = ('', json.dumps(account).encode())
    files[f'{odd}.txt'] = ('', b'')
    strange = [Topic(f'/{odd}', odd, odd, odd), Topic(f'/{odd}/joints', JOINT_STATE, '', '')]
    topics = [*whole.topics, *strange]
    numbers = {each.name: number for number, each in enumerate(topics)}
    writer = BagWriter(folder / 'odd', topics, files)
    for message in whole.messages():
        writer.write(numbers[message.topic], *message[1:])
    for number in range(3):
        time = BEGIN + number * MS
        writer.write(len(topics) - 2, time, time, text_message(odd))
        states = JointStateWriter([odd, 'rocker_joint']).write(time, (0.1, 0.2), ())
        writer.write(len(topics) - 1, time, time, states)
    writer.close({'linkage_ros.failure': odd, 'linkage_ros.recovered': odd, odd: odd})
    return writer.folder


@pytest.mark.parametrize('name', ODD)
def test_what_is_shown_is_printable(tmp_path: Path, name: str) -> None:
    odd_bag(tmp_path, ODD[name])
    for command, more in COMMANDS.items():
        ended = told(tmp_path, *command.split(), 'odd', *more)
        shown = ended.stdout + ended.stderr
        assert 'Traceback' not in shown, command
        assert all(line.isprintable() for line in shown.split('\n')), command
        assert not any(line.startswith('linkage info: all is well') for line in shown.split('\n'))
        assert max(map(len, ended.stderr.split('\n'))) < 10_000, command
    page, *_ = (tmp_path / 'odd.html').read_text().partition('Plotly')
    assert all(letter.isprintable() or letter == '\n' for letter in page)


@pytest.mark.parametrize('name', ODD)
def test_an_error_is_a_printable_line_with_an_end(name: str) -> None:
    odd = ODD[name]
    error = LinkageError(odd, odd, odd)
    for text in (str(error), error.where, error.reason, error.remedy):
        assert text.isprintable()
        assert len(text) < 6_100


@pytest.mark.parametrize(
    ('text', 'expected'),
    [
        ('µ [rad/s²]', 'µ [rad/s²]'),
        ("it's 'so'", "it's 'so'"),
        ('a\tb\x1b', r'a\tb\x1b'),
        ('\u202e', r'\u202e'),
        ('\ud800', r'\ud800'),
        ('\U000e0001', r'\U000e0001'),
    ],
)
def test_only_what_is_not_printable_is_written_otherwise(text: str, expected: str) -> None:
    assert clean(text) == expected


def test_lines_stay_lines(capsys: pytest.CaptureFixture[str]) -> None:
    import sys

    print('one\x1b[0m\ntwo\r', file=Outlet(sys.stdout))
    assert capsys.readouterr().out == 'one\\x1b[0m\ntwo\\r\n'
