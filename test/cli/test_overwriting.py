# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""One rule for all commands: what exists is not overwritten without ``--force``."""

from pathlib import Path
import stat
from subprocess import CompletedProcess

from linkage_ros.cli import COMMANDS, find_command, parser_of
import pytest

from .recorded import Recorded, scene_file
from ..support.commands import linkage

# Arguments without -o, what they write, and whether that name is the default.
WRITES = {
    'gallery': (['four_bar'], 'x.yaml', False),
    'solve': (['four_bar', '--at', '10'], 'x.csv', False),
    'draw': (['four_bar'], 'four_bar.png', True),
    'animate': (['four_bar', '--seconds', '0.1'], 'four_bar.svg', False),
    'compile': (['four_bar'], 'x.c', False),
    'urdf': (['four_bar'], 'x.urdf', False),
    'mjcf': (['four_bar'], 'x.xml', False),
    'check': (['four_bar'], 'x.csv', False),
    'info': (['bag'], 'x.csv', False),
    'scene': (['bare'], 'x.csv', False),
    'fmu': (['bare'], 'x.fmu', False),
    'view': (['four_bar'], 'x.html', False),
    'plot': (['bag'], 'bag.png', True),
    'report': (['bag'], 'bag.html', True),
    'compare': (['bag', 'bag'], 'x.png', False),
    'export': (['bag'], 'x.csv', False),
    'simulate': (['worn_press', '--seconds', '0.1'], 'x.csv', False),
    'synthesize': (['--pairs', 'pairs.csv'], 'x.yaml', False),
    'accuracy': (
        ['slider_crank', '--need', '5', '--quick', '--only', 'errors', '--horizon', '0.1'],
        'x.yaml',
        False,
    ),
    'import': (['x.urdf', '--close', 'b=c'], 'new.yaml', False),
}
"""Files; `FOLDERS` are bags."""

FOLDERS = {
    'simulate': ['worn_press', '--seconds', '0.1'],
    'replay': ['bag', '--set', 'angles=wrapped'],
    'recover': ['bag'],
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    scene = scene_file(tmp_path, 'rate: 100\n')
    Recorded(tmp_path / 'bag', scene, lambda tick: {'crank_joint': (0.06 * tick, 6.0)}).run(50)
    (tmp_path / 'pairs.csv').write_text('40,50\n60,61\n90,80\n')
    return tmp_path


def test_overwriting_is_tested_for_every_command_that_writes() -> None:
    writing = set()
    for command in COMMANDS:
        parser = parser_of(command, find_command(command))
        options = {option for action in parser._actions for option in action.option_strings}
        if '-o' in options:
            writing.add(command)
            assert '--force' in options, command
    assert writing == {*WRITES, *FOLDERS}


@pytest.mark.sample(3)
@pytest.mark.parametrize('command', [name for name in WRITES if name != 'import'])
def test_only_force_overwrites_a_file_and_keeps_its_mode(folder, command) -> None:
    words, name, is_default = WRITES[command]
    file = folder / name
    file.write_text('mine')
    file.chmod(0o640)
    for more in ([[]] if is_default else []) + [['-o', name]]:
        refused = linkage(folder, command, *words, *more)
        assert refused.returncode == 2
        (line,) = refused.stderr.splitlines()
        assert f'{name}: exists already; name another, or add --force' in line
        assert file.read_text() == 'mine'
    done = linkage(folder, command, *words, '-o', name, '--force')
    assert done.returncode == 0, done.stderr
    assert file.read_bytes()[:4] != b'mine'
    assert stat.S_IMODE(file.stat().st_mode) == 0o640


@pytest.mark.parametrize('command', FOLDERS)
def test_only_force_overwrites_a_bag_and_no_other_folder(folder, command) -> None:
    def run(*more: str) -> CompletedProcess[str]:
        return linkage(folder, command, *FOLDERS[command], '-o', 'new', *more)

    assert run().returncode == 0
    before = sorted((folder / 'new').iterdir())
    refused = run()
    assert refused.returncode == 2
    assert 'new: exists already' in refused.stderr
    times = [file.stat().st_mtime_ns for file in before]
    assert run('--force').returncode == 0
    assert sorted((folder / 'new').iterdir()) == before
    assert [file.stat().st_mtime_ns for file in before] != times
    (folder / 'new' / 'notes.txt').write_text('mine')
    refused = run('--force')
    assert refused.returncode == 2
    assert 'new: is a folder that holds more than a bag' in refused.stderr
    assert {file.name for file in (folder / 'new').iterdir()} > {'notes.txt', 'metadata.yaml'}


@pytest.mark.parametrize('command', ['replay', 'recover'])
@pytest.mark.parametrize('given', ['bag', 'bag/bag_0.mcap'])
def test_input_bag_is_never_overwritten(folder, command, given) -> None:
    words = [given, *FOLDERS[command][1:]]
    refused = linkage(folder, command, *words, '-o', 'bag', '--force')
    assert refused.returncode == 2
    assert 'bag: is the bag that is read' in refused.stderr
    assert linkage(folder, 'info', 'bag').returncode == 0


READS = {
    'the scene itself': ('accuracy', ['scene.yaml', '--need', '5'], 'scene.yaml'),
    'the linkage of a scene': ('accuracy', ['scene.yaml', '--need', '5'], 'linkage.yaml'),
    'a linkage of several': ('accuracy', ['both.yaml', '--need', '5'], 'linkage.yaml'),
    'a robot': ('urdf', ['robot.urdf'], 'robot.urdf'),
    'the robot of a scene': ('urdf', ['of_robot.yaml'], 'robot.urdf'),
    'the same by another name': ('urdf', ['robot.urdf'], 'link.urdf'),
    'pairs': ('synthesize', ['--pairs', 'pairs.csv'], 'pairs.csv'),
}


@pytest.mark.parametrize('kind', READS)
def test_input_file_is_never_overwritten(tmp_path, kind) -> None:
    command, words, output = READS[kind]
    files = {
        'scene.yaml': 'linkage: linkage.yaml\n',
        'both.yaml': 'linkages: [{name: a, linkage: four_bar}, {name: b, linkage: linkage.yaml}]',
        'of_robot.yaml': 'linkage: {urdf: robot.urdf, input: m}\n',
        'linkage.yaml': 'four_bar: {a: 1, b: 2, c: 2, d: 2}\n',
        'robot.urdf': '<robot name="r"/>',
        'pairs.csv': '40,50\n60,61\n90,80\n',
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    (tmp_path / 'link.urdf').symlink_to(tmp_path / 'robot.urdf')
    refused = linkage(tmp_path, command, *words, '-o', output, '--force')
    assert refused.returncode == 2
    assert f'{output}: is a file that is read; name another with -o\n' in refused.stderr
    assert {name: (tmp_path / name).read_text() for name in files} == files
