# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Hostile bags: any content is shown safely, and none of it is executed."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
import json
from pathlib import Path
import subprocess
import sys
from types import ModuleType
from typing import Any

from linkage_ros.bag import BagMessage, read_bag, RUN_FILE, Topic
from linkage_ros.cli import (
    COMMANDS as ALL_COMMANDS,
    export,
    find_command,
    info,
    parser_of,
    PrintableStream,
    replay,
)
from linkage_ros.description import SCENE_FILE
from linkage_ros.errors import BagError, escape_unprintable, FileError, LinkageError
from linkage_ros.messages import JointStateWriter, text_message
from linkage_ros.replay import read_change, recorded_scene
from linkage_ros.tick import Pipeline
from linkage_ros.tools.drawing import plot_command as plot
from linkage_ros.tools.view import report_command as report
import pytest

from .recorded import answer, BEGIN, FOUR_BAR, JOINT_STATE, MS, rewritten, scene_file
from .test_replay import recorded
from ..support.commands import environment, linkage

# The run account of a bag may hold anything: the result is one clear line, never a traceback.


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

# The replacement of each key, as JSON.
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

# A file may have any name, and a scene has the name of its file.
GOOD = {('scene', 'control characters'), ('scene', 'half a character')}


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp('bag'), 'effects: {velocity: {}}\n', 60)


def with_account(bag: Path, folder: Path, account: bytes) -> Path:
    """Write a bag once more with another account of its run."""
    files = {**read_bag(bag).attachments, RUN_FILE: account}
    return rewritten(bag, folder / 'odd', attachments=files)


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


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', ACCOUNTS)
def test_damaged_run_json_is_reported_in_one_line(tmp_path, capsys, bag, name) -> None:
    odd = with_account(bag, tmp_path, ACCOUNTS[name])
    lines = list(tried(odd, tmp_path, capsys))
    assert lines[0].startswith(f'{odd}: its run.json is damaged; ')


@pytest.mark.sample(4)
@pytest.mark.parametrize('value', VALUES)
@pytest.mark.parametrize('key', KEYS)
def test_wrong_run_json_value_is_reported_in_one_line(tmp_path, capsys, bag, key, value) -> None:
    said = json.loads(read_bag(bag).attachments[RUN_FILE]) | {key: '@'}
    odd = with_account(bag, tmp_path, json.dumps(said).replace('"@"', VALUES[value]).encode())
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
def test_malformed_fault_change_raises_value_error(name: str) -> None:
    with pytest.raises(ValueError):  # noqa: PT011 (whatever it says, the bag is named elsewhere)
        read_change(CHANGES[name])


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', CHANGES)
def test_malformed_fault_change_is_reported_in_one_line(tmp_path, capsys, name) -> None:
    bag = recorded(tmp_path, 'faults: {quiet: {silence: {}}}\n', 60)
    account = {'faults_topic': '/linkage/withheld', 'withheld_topic': ''}
    time = BEGIN + 60 * MS
    more = (BagMessage('/linkage/withheld', time, time, CHANGES[name]),)
    odd = rewritten(bag, 'odd', more=more, **account)
    lines = list(tried(odd, tmp_path, capsys))
    assert lines[0].startswith(f'{odd}: a message on its faults topic names no fault')


@pytest.mark.parametrize('time', [2**31 * 10**9, 2**63 - 1])
def test_tick_beyond_all_stamps_is_reported_in_one_line(tmp_path, capsys, time) -> None:
    bag = recorded(tmp_path, 'drive: {sine: {amplitude: 1.0, frequency: 2.0}}\n', 60)
    *_, last = read_bag(bag).messages()
    more = (last._replace(log_time=time, publish_time=time),)
    odd = rewritten(bag, 'odd', more=more)
    lines = list(tried(odd, tmp_path, capsys))
    assert lines[0].startswith(f'{odd}: has a tick at {time} ns, beyond ')
    with pytest.raises(BagError, match='beyond'):
        answer(replay, odd)


# A bag may hold any names of topics, types, joints and files: the output is printable.
#
# Escape sequences, line breaks, characters that change the direction of writing, and lone
# surrogates are shown as Python escapes; a long text loses its middle.


ODD = {
    'an escape': 'a\x1b[31mred\x1b]0;title\x07',
    'line breaks': 'a\r\nlinkage info: all is well\x85\u2028',
    'turned': 'a\u202egnp.exe\u2066\u200f',
    'no width': 'a\u200b\ufeff\u00ad',
    'long': 'x' * 50_000,
}

COMMANDS = {
    'info': [],
    'info --json': [],
    'export': ['-o', 'x.csv'],
    'plot': [],
    'report': [],
    'replay': [],
    'recover': ['-o', 'recovered'],
}


def odd_bag(folder: Path, odd: str) -> Path:
    """Write a bag whose names are all odd; its scene is whole."""
    bag = recorded(folder, 'effects: {velocity: {}}\n', 60)
    whole = read_bag(bag)
    strange = [Topic(f'/{odd}', odd, odd, odd), Topic(f'/{odd}/joints', JOINT_STATE, '', '')]
    more = []
    for time in range(BEGIN, BEGIN + 3 * MS, MS):
        states = JointStateWriter([odd, 'rocker_joint']).write(time, (0.1, 0.2), ())
        data = text_message(odd), states
        more += [
            BagMessage(each.name, time, time, d) for each, d in zip(strange, data, strict=True)
        ]
    return rewritten(
        bag,
        'odd',
        attachments={**whole.attachments, f'{odd}.txt': b''},
        topics=[*whole.topics, *strange],
        more=more,
        custom={'linkage_ros.failure': odd, 'linkage_ros.recovered': odd, odd: odd},
        scene=odd,
        linkage_ros=odd,
        python=odd,
        effects={odd: odd},
    )


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', ODD)
def test_commands_print_no_control_characters_of_a_bag(tmp_path: Path, name: str) -> None:
    odd_bag(tmp_path, ODD[name])
    for command, more in COMMANDS.items():
        ended = linkage(tmp_path, *command.split(), 'odd', *more)
        shown = ended.stdout + ended.stderr
        assert 'Traceback' not in shown, command
        assert all(line.isprintable() for line in shown.split('\n')), command
        assert not any(line.startswith('linkage info: all is well') for line in shown.split('\n'))
        assert max(map(len, ended.stderr.split('\n'))) < 10_000, command
    page, *_ = (tmp_path / 'odd.html').read_text().partition('Plotly')
    assert all(letter.isprintable() or letter == '\n' for letter in page)


@pytest.mark.parametrize('name', ODD)
def test_error_message_is_printable_and_bounded(name: str) -> None:
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
def test_only_unprintable_characters_are_escaped(text: str, expected: str) -> None:
    assert escape_unprintable(text) == expected


def test_printable_stream_keeps_line_breaks(capsys: pytest.CaptureFixture[str]) -> None:
    import sys

    print('one\x1b[0m\ntwo\r', file=PrintableStream(sys.stdout))
    assert capsys.readouterr().out == 'one\\x1b[0m\ntwo\\r\n'


# A bag names modules; no command imports them unless the user allows it.
#
# The canary is a package beside the bag. It writes down that it was imported.


ROOT = Path(__file__).parents[2]

EFFECT = 'canary.effect'

RAN = 'ran'

CANARY = f"""
from pathlib import Path
Path(__file__).parents[1].joinpath('{RAN}').write_text('')
"""

DOES_NOTHING = """
from dataclasses import dataclass
from linkage_ros.stages.effects import SensorEffect

@dataclass(frozen=True, slots=True)
class Nothing(SensorEffect):
    'Nothing.'

    after = 'bias'

    def sensor(self, context):
        return lambda now, reading: reading
"""

# Arguments after the bag, by command; at least one line for each command that takes a bag.
TYPED = {
    'compare': [['strange']],
    'info': [[], ['--json']],
    'report': [[]],
    'export': [['-o', 'x.csv'], ['-o', 'y.csv', '--topic', '/joint_states']],
    'plot': [[]],
    'recover': [['-o', 'recovered']],
    'replay': [
        [],
        ['--json'],
        ['--scene', 'other.yaml'],
        ['--scene', 'other.yaml', '-o', 'new'],
    ],
}

# Commands that take a scene; its drive may play a bag.
FOLLOWS = 'linkage: l.yaml\ndrive: {bag: {file: bag}}\n'

WITH_A_SCENE = (
    ['scene', 'follows.yaml'],
    ['accuracy', 'follows.yaml', '--quick', '--only', 'errors', '--horizon', '0.1'],
)


def takes_a_bag(command: str) -> bool:
    parser = parser_of(command, find_command(command))
    return any(action.dest == 'bag' for action in parser._actions)


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a bag and the package that the bag's scene names."""
    folder = tmp_path_factory.mktemp('strange')
    bag = recorded(folder, 'effects: {velocity: {}}\n', 60)
    files = read_bag(bag).attachments
    text = files[SCENE_FILE].decode().replace('{velocity: {}}', f'{{{EFFECT}: {{}}}}')
    assert EFFECT in text
    rewritten(bag, 'strange', attachments={**files, SCENE_FILE: text.encode()})
    (folder / 'canary').mkdir()
    (folder / 'canary' / '__init__.py').write_text(CANARY)
    (folder / 'canary' / 'effect.py').write_text(DOES_NOTHING)
    scene_file(folder, 'effects: {velocity: {}}\n', FOUR_BAR).rename(folder / 'other.yaml')
    (folder / 'follows.yaml').write_text(FOLLOWS.replace('file: bag', 'file: strange'))
    return folder


def typed(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run ``linkage`` in the folder of the canary, which Python then finds."""
    (folder / RAN).unlink(missing_ok=True)
    return linkage(folder, *words, timeout=120.0)


def test_hostile_bags_are_tested_with_every_bag_command() -> None:
    assert {name for name in ALL_COMMANDS if takes_a_bag(name)} == set(TYPED)


LINES = [[name, 'strange', *more] for name, lines in TYPED.items() for more in lines]


@pytest.mark.sample(2)
@pytest.mark.parametrize('words', [*WITH_A_SCENE, *LINES], ids=' '.join)
def test_commands_import_no_module_named_in_a_bag(folder: Path, words: list[str]) -> None:
    ended = typed(folder, *words)
    assert not (folder / RAN).exists(), ended.stdout
    assert 'Traceback' not in ended.stderr
    assert ended.returncode == (
        2
        if words in (['replay', 'strange'], ['replay', 'strange', '--json'], ['plot', 'strange'])
        else 0
    ), ended.stderr


def test_replay_names_the_module_of_an_untrusted_effect(folder: Path) -> None:
    ended = typed(folder, 'replay', 'strange')
    assert ended.stderr == (
        f'linkage replay: strange: scene.yaml:2: effects.{EFFECT}: names a module, and what a '
        f"bag names is not imported unasked; the name leads to '{folder}/canary/__init__.py' "
        'here; --trust-effects imports it\n'
    )


def test_info_names_the_effect_that_was_not_imported(folder: Path) -> None:
    account = json.loads(typed(folder, 'info', 'strange', '--json').stdout)
    (linkage,) = account['scene']['linkages']
    assert (linkage['effects'], linkage['effects_not_imported']) == ([], [EFFECT])
    assert account['messages'] > 0
    assert account['replay'] is None
    assert f'effects.{EFFECT}: names a module' in account['scene_missing']
    assert f'{EFFECT} (not imported)' in typed(folder, 'info', 'strange').stdout


def test_report_names_the_effect_that_was_not_imported(folder: Path) -> None:
    typed(folder, 'report', 'strange')
    page = (folder / 'strange.html').read_text()
    assert (
        f'The scene was not run again, so no linkage: strange: scene.yaml:2: effects.{EFFECT}'
        in page
    )


@pytest.mark.sample(2)
@pytest.mark.parametrize('command', ['info', 'report', 'plot', 'replay'])
def test_trust_effects_prints_the_module_before_the_import(folder: Path, command: str) -> None:
    force = ['--force'] * (command in {'report', 'plot'})
    ended = typed(folder, command, 'strange', '--trust-effects', *force)
    assert (folder / RAN).exists()
    assert ended.stderr.startswith(
        f'linkage: strange is trusted: imports {EFFECT}, and the name leads to '
        f"'{folder}/canary/__init__.py'\n"
    )
    # The bag was made with rates, which the scene that it now carries does not ask for.
    assert ended.returncode == (3 if command == 'replay' else 0), ended.stderr


def test_trusted_package_path_is_printed_before_the_import(folder: Path) -> None:
    init = folder / 'canary' / '__init__.py'
    init.write_text(f'{CANARY}\nprint("runs", flush=True)\n')
    try:
        ended = subprocess.run(
            [sys.executable, '-m', 'linkage_ros.cli.main', 'info', 'strange', '--trust-effects'],
            cwd=folder,
            env=environment(folder) | {'PYTHONPATH': str(ROOT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=120,
            check=False,
        )
    finally:
        init.write_text(CANARY)
    lines = ended.stdout.splitlines()
    assert [lines[0][:27], lines[1]] == ['linkage: strange is trusted', 'runs']


def test_recorded_scene_is_not_trusted_by_default(folder: Path) -> None:
    scene = recorded_scene(read_bag(folder / 'strange'))
    assert scene.not_imported == (EFFECT,)
    with pytest.raises(FileError, match='leads to no module here'):
        Pipeline(scene)


@pytest.mark.parametrize(
    'name', ['__main__.effect', 'no_such_package.effect', '.effect', 'a b.effect', 'os.path', '..']
)
def test_module_path_of_any_effect_name_is_printable(name: str) -> None:
    own = import_module('linkage_ros.stages.effects.user_effects')
    assert own.found_in(name).isprintable()
