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
A bag names modules; no command runs them unless its user says so.

The canary is a package beside the bag. It writes down that it was imported.
"""

from __future__ import annotations

import argparse
from importlib import import_module
import json
import os
from pathlib import Path
import subprocess
import sys

from linkage_ros.bag.reader import read_bag
from linkage_ros.bag.writer import BagWriter
from linkage_ros.cli.main import COMMANDS, module_of
from linkage_ros.errors import FileError
from linkage_ros.pipeline import Pipeline
from linkage_ros.replay import recorded_scene
from linkage_ros.scene.load import SCENE_FILE
import pytest

from .conftest import environment
from .recorded import FOUR_BAR, scene_file
from .test_replay import recorded

ROOT = Path(__file__).parents[2]
EFFECT = 'canary.effect'
RAN = 'ran'
CANARY = f"""
from pathlib import Path
Path(__file__).parents[1].joinpath('{RAN}').write_text('')
"""
DOES_NOTHING = """
from dataclasses import dataclass

@dataclass(frozen=True, slots=True)
class PARAMETERS:
    'Nothing.'

AFTER = 'bias'

def sensor(parameters, context):
    return lambda now, reading: reading
"""

# What is typed behind the bag, by the command; of each that takes a bag at least one line.
TYPED = {
    'info': [[], ['--json']],
    'report': [[]],
    'export': [['-o', 'x.csv'], ['-o', 'x.csv', '--topic', '/joint_states']],
    'plot': [[]],
    'play': [['--rate', '1000']],
    'recover': [['-o', 'recovered']],
    'replay': [
        [],
        ['--json'],
        ['--scene', 'other.yaml'],
        ['--scene', 'other.yaml', '-o', 'new'],
    ],
}
# Commands that do take a scene, and may be told so to follow a bag.
FOLLOWS = 'linkage: l.yaml\ndrive: {bag: {file: bag}}\n'
WITH_A_SCENE = (['scene', 'follows.yaml'], ['cost', 'follows.yaml', '--ticks', '5'])


def takes_a_bag(command: str) -> bool:
    parser = argparse.ArgumentParser()
    import_module(module_of(command)).add_arguments(parser)
    return any(action.dest == 'bag' for action in parser._actions)


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a bag and the package that the bag's scene names."""
    folder = tmp_path_factory.mktemp('strange')
    whole = read_bag(recorded(folder, 'effects: {velocity: {}}\n', 60))
    files = {name: ('', data) for name, data in whole.attachments.items()}
    text = whole.attachments[SCENE_FILE].decode().replace('{velocity: {}}', f'{{{EFFECT}: {{}}}}')
    assert EFFECT in text
    files[SCENE_FILE] = ('', text.encode())
    writer = BagWriter(folder / 'strange', whole.topics, files)
    numbers = {each.name: number for number, each in enumerate(whole.topics)}
    for message in whole.messages():
        writer.write(numbers[message.topic], *message[1:])
    writer.close()
    (folder / 'canary').mkdir()
    (folder / 'canary' / '__init__.py').write_text(CANARY)
    (folder / 'canary' / 'effect.py').write_text(DOES_NOTHING)
    scene_file(folder, 'effects: {velocity: {}}\n', FOUR_BAR).rename(folder / 'other.yaml')
    (folder / 'follows.yaml').write_text(FOLLOWS.replace('file: bag', 'file: strange'))
    return folder


def typed(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run ``linkage`` in the folder of the canary, which an empty entry puts onto the path."""
    (folder / RAN).unlink(missing_ok=True)
    return subprocess.run(
        [sys.executable, '-m', 'linkage_ros.cli.main', *words],
        cwd=folder,
        env=environment(folder) | {'PYTHONPATH': f'{os.pathsep}{ROOT}'},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_every_command_that_takes_a_bag_is_tried() -> None:
    assert {name for name in COMMANDS if takes_a_bag(name)} == set(TYPED)


LINES = [[name, 'strange', *more] for name, lines in TYPED.items() for more in lines]


@pytest.mark.parametrize('words', [*LINES, *WITH_A_SCENE], ids=' '.join)
def test_nothing_that_a_bag_names_is_imported(folder: Path, words: list[str]) -> None:
    ended = typed(folder, *words)
    assert not (folder / RAN).exists(), ended.stdout
    assert 'Traceback' not in ended.stderr
    assert ended.returncode == (
        2
        if words in (['replay', 'strange'], ['replay', 'strange', '--json'], ['plot', 'strange'])
        else 0
    ), ended.stderr


def test_a_replay_says_what_it_would_import(folder: Path) -> None:
    ended = typed(folder, 'replay', 'strange')
    assert ended.stderr == (
        f'linkage replay: strange: scene.yaml:2: effects.{EFFECT}: names a module, and what a '
        f"bag names is not imported unasked; the name leads to '{folder}/canary/__init__.py' "
        'here; --trust-effects imports it\n'
    )


def test_info_names_the_effect_and_says_why_the_rest_is_not_known(folder: Path) -> None:
    account = json.loads(typed(folder, 'info', 'strange', '--json').stdout)
    (linkage,) = account['scene']['linkages']
    assert (linkage['effects'], linkage['effects_not_imported']) == ([], [EFFECT])
    assert account['messages'] > 0
    assert account['replay'] is None
    assert f'effects.{EFFECT}: names a module' in account['scene_missing']
    assert f'{EFFECT} (not imported)' in typed(folder, 'info', 'strange').stdout


def test_a_report_names_it(folder: Path) -> None:
    typed(folder, 'report', 'strange')
    page = (folder / 'strange.html').read_text()
    assert (
        f'The scene was not run again, so no linkage: strange: scene.yaml:2: effects.{EFFECT}'
        in page
    )


@pytest.mark.parametrize('command', ['info', 'report', 'plot', 'replay'])
def test_who_trusts_a_bag_is_told_first_what_runs(folder: Path, command: str) -> None:
    ended = typed(folder, command, 'strange', '--trust-effects')
    assert (folder / RAN).exists()
    assert ended.stderr.startswith(
        f'linkage: strange is trusted: imports {EFFECT}, and the name leads to '
        f"'{folder}/canary/__init__.py'\n"
    )
    # The bag was made with rates, which the scene that it now carries does not ask for.
    assert ended.returncode == (3 if command == 'replay' else 0), ended.stderr


def test_where_the_package_is_found_is_said_before_it_runs(folder: Path) -> None:
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


def test_the_scene_of_a_bag_is_not_trusted_where_nobody_says_so(folder: Path) -> None:
    scene = recorded_scene(read_bag(folder / 'strange'))
    assert scene.not_imported == (EFFECT,)
    with pytest.raises(FileError, match='leads to no module here'):
        Pipeline(scene)


@pytest.mark.parametrize(
    'name', ['__main__.effect', 'no_such_package.effect', '.effect', 'a b.effect', 'os.path', '..']
)
def test_any_name_is_told_in_a_line(name: str) -> None:
    own = import_module('linkage_ros.effects.own')
    assert own.found_in(name).isprintable()
