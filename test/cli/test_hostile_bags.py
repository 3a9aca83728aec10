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


"""What a bag says of its run may be anything: one clear line for it, and never a traceback."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
from types import ModuleType
from typing import Any

from linkage_ros.bag.reader import BagMessage, read_bag, RUN_FILE
from linkage_ros.bag.writer import BagWriter
from linkage_ros.cli import export, info, plot, replay, report
from linkage_ros.errors import BagError, LinkageError
from linkage_ros.messages.single_values import text_message
from linkage_ros.replay import read_change
import pytest

from .recorded import answer, BEGIN, MS
from .test_replay import recorded

DEEP = '[' * 100_000
LONG = '9' * 100_000

ACCOUNTS = {
    'nothing': b'',
    'no text': bytes(range(256)),
    'no object': b'[]',
    'a deep list': DEEP.encode(),
    'a deep object': b'{"a":' * 100_000,
    'cut': b'{"scene": "s", ',
}

# By key what it is replaced by, as JSON.
VALUES = {
    'a number': '3',
    'nothing': 'null',
    'a list': '[1, [2]]',
    'an object': '{"a": {}}',
    'a deep list': f'{DEEP}{"]" * 100_000}',
    'a long number': LONG,
    'infinity': '1e999',
    'control characters': json.dumps('a\n\x1b[31mb'),
    'half a character': '"\\ud800"',
}
KEYS = ('scene', 'joint_states_topic', 'crank_topic', 'withheld_topic', 'extra_topics')
# Names of files may be anything, and a scene has the name of its file.
GOOD = {('scene', 'control characters'), ('scene', 'half a character')}


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp('bag'), 'effects: {velocity: {}}\n', 60)


def rewritten(
    bag_path: Path, folder: Path, account: bytes, more: tuple[BagMessage, ...] = ()
) -> Path:
    """Write a bag once more with another account of its run, and more messages at its end."""
    bag = read_bag(bag_path)
    files = {name: ('', data) for name, data in bag.attachments.items()}
    numbers = {each.name: number for number, each in enumerate(bag.topics)}
    writer = BagWriter(folder / 'odd', bag.topics, files | {RUN_FILE: ('', account)})
    for message in (*bag.messages(), *more):
        writer.write(numbers[message.topic], *message[1:])
    writer.close()
    return writer.folder


def tried(bag: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> Iterator[str]:
    """Try every command on a bag; yield what each refuses it for, and look at what it prints."""
    commands: tuple[tuple[ModuleType, list[Any]], ...] = (
        (replay, []),
        (info, []),
        (info, ['--json']),
        (export, ['-o', folder / 'x.csv']),
        (plot, ['-o', folder / 'x.png']),
        (report, ['-o', folder / 'x.html']),
    )
    for command, typed in commands:
        line = ''
        try:
            assert answer(command, bag, *typed) in (0, 1, 3)
        except LinkageError as error:
            line = str(error)
        yield line
        out, err = capsys.readouterr()
        for each in (line, *out.splitlines(), *err.splitlines()):
            assert each.isprintable()


@pytest.mark.parametrize('name', ACCOUNTS)
def test_a_damaged_account_is_told_in_a_line(tmp_path, capsys, bag, name) -> None:
    odd = rewritten(bag, tmp_path, ACCOUNTS[name])
    lines = list(tried(odd, tmp_path, capsys))
    assert lines[0].startswith(f'{odd}: its run.json is damaged; ')


@pytest.mark.parametrize('value', VALUES)
@pytest.mark.parametrize('key', KEYS)
def test_an_account_of_wrong_values_is_told_in_a_line(tmp_path, capsys, bag, key, value) -> None:
    said = json.loads(read_bag(bag).attachments[RUN_FILE]) | {key: '@'}
    odd = rewritten(bag, tmp_path, json.dumps(said).replace('"@"', VALUES[value]).encode())
    lines = list(tried(odd, tmp_path, capsys))
    damaged = lines[0].startswith(f'{odd}: its run.json is damaged; ')
    assert damaged == ((key, value) not in GOOD)


CHANGES = {
    'nothing': b'',
    'no text': b'\0\1\0\0\xff\xff\xff\xff\xff\xff',
    'no JSON': text_message('quiet'),
    'no object': text_message('"quiet"'),
    'a deep list': text_message(DEEP),
    'a long number': text_message(LONG),
    'no switch': text_message('{"fault": "quiet"}'),
    'a switch that is a number': text_message('{"fault": "quiet", "injected": 1}'),
    'a fault that is a list': text_message('{"fault": ["quiet"], "injected": true}'),
}


@pytest.mark.parametrize('name', CHANGES)
def test_a_change_that_is_none_is_a_value_error(name: str) -> None:
    with pytest.raises(ValueError):  # noqa: PT011 (whatever it says, the bag is named elsewhere)
        read_change(CHANGES[name])


@pytest.mark.parametrize('name', CHANGES)
def test_a_change_that_is_none_is_told_in_a_line(tmp_path, capsys, name) -> None:
    bag = recorded(tmp_path, 'faults: {quiet: {silence: {}}}\n', 60)
    account = json.loads(read_bag(bag).attachments[RUN_FILE])
    account |= {'faults_topic': '/linkage/withheld', 'withheld_topic': ''}
    time = BEGIN + 60 * MS
    more = (BagMessage('/linkage/withheld', time, time, CHANGES[name]),)
    odd = rewritten(bag, tmp_path, json.dumps(account).encode(), more)
    lines = list(tried(odd, tmp_path, capsys))
    assert lines[0].startswith(f'{odd}: a message on its faults topic names no fault')


@pytest.mark.parametrize('time', [2**31 * 10**9, 2**63 - 1])
def test_a_tick_beyond_all_stamps_is_told_in_a_line(tmp_path, capsys, time) -> None:
    bag = recorded(tmp_path, 'drive: {sine: {amplitude: 1.0, frequency: 2.0}}\n', 60)
    *_, last = read_bag(bag).messages()
    more = (last._replace(log_time=time, publish_time=time),)
    odd = rewritten(bag, tmp_path, read_bag(bag).attachments[RUN_FILE], more)
    lines = list(tried(odd, tmp_path, capsys))
    assert lines[0].startswith(f'{odd}: holds what was made at {time} ns, beyond ')
    with pytest.raises(BagError, match='beyond'):
        answer(replay, odd)
