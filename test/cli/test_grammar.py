# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The command line as one grammar: examples, near misses, outputs, shipped names, completion."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from math import tau
from pathlib import Path
import re
import shlex
import shutil
import subprocess
import sys

from linkage_ros.cli import COMMANDS, EXIT_CODES, find_command, Parser, parser_of, SHELLS
from linkage_ros.description import load_scene, SCENE_FILE
from linkage_ros.errors import LinkageError
from linkage_ros.resources import linkage_names, named_file, scene_names, spatial_linkage_names
import pytest

from .recorded import Recorded, scene_file
from ..support.commands import environment, linkage

CONFIG = Path(__file__).parents[2] / 'config'


def parser(command: str) -> Parser:
    return parser_of(command, find_command(command))


def example(command: str) -> str:
    found = find_command(command).EXAMPLE
    return found if isinstance(found, str) else found[command]


def options() -> Iterator[tuple[str, argparse.Action]]:
    for command in COMMANDS:
        for action in parser(command)._actions:
            yield command, action


# Examples.


SHORTENED = {
    '--seconds 10': '--seconds 0.3',
    '--seconds 5': '--seconds 0.3',
    '--quick': '--quick --only errors --horizon 0.2',
    '--rate 0.5': '--rate 10',
}
"""Parts of examples that would take seconds, and what the test types instead."""


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with what the examples name and do not write: a bag, and a URDF."""
    folder = tmp_path_factory.mktemp('examples')
    scene = scene_file(folder, 'rate: 100\n')
    Recorded(folder / 'my_bag', scene, lambda tick: {'crank_joint': (tau * tick / 100, tau)}).run(
        100
    )
    shutil.copytree(folder / 'my_bag', folder / 'other_bag')
    return folder


@pytest.mark.parametrize('command', COMMANDS)
def test_help_ends_with_an_example(command: str) -> None:
    text = parser(command).format_help()
    assert text.endswith(f'example:\n  {example(command)}\n')
    assert example(command).split()[:2] == ['linkage', command]


# A topic needs a publisher: test/node/test_echo.py has one.
@pytest.mark.sample(3)
@pytest.mark.parametrize('command', [name for name in COMMANDS if name != 'echo'])
def test_example_of_the_help_exits_with_code_0(folder: Path, command: str) -> None:
    line = example(command)
    for part, instead in SHORTENED.items():
        line = line.replace(part, instead)
    if command == 'import':
        assert linkage(folder, 'urdf', 'four_bar', '-o', 'four_bar.urdf').returncode == 0
    answer = linkage(folder, *shlex.split(line)[1:])
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout


def test_synthesize_example_designs_a_crank_rocker_without_defects(tmp_path: Path) -> None:
    answer = linkage(tmp_path, *shlex.split(example('synthesize'))[1:])
    assert 'crank-rocker (GCRR), the crank turns fully' in answer.stdout
    assert 'none: order, branch and circuit are right' in answer.stdout


def test_help_lists_exit_codes_and_commands() -> None:
    answer = subprocess.run(
        [sys.executable, '-m', 'linkage_ros', '--help'],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert all(f'  {code}  {text}\n' in answer.stdout for code, text in EXIT_CODES.items())
    assert all(f'  {name:<10} {text}\n' in answer.stdout for name, text in COMMANDS.items())


# Near misses.


def refused(capsys: pytest.CaptureFixture[str], command: str, *typed: str) -> str:
    """Return the one line for which a command line is refused."""
    with pytest.raises(SystemExit) as ended:
        parser(command).parse_args(typed)
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


@pytest.mark.parametrize('command', COMMANDS)
def test_misspelt_command_names_the_nearest_command(tmp_path: Path, command: str) -> None:
    answer = linkage(tmp_path, f'{command}x')
    assert (answer.returncode, answer.stdout) == (2, '')
    assert answer.stderr == (
        f"linkage: argument COMMAND: there is no '{command}x'; did you mean {command!r}? "
        '(see linkage --help)\n'
    )


@pytest.mark.parametrize('command', COMMANDS)
def test_misspelt_option_names_the_nearest_option(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for action in parser(command)._actions:
        for option in action.option_strings:
            if option.startswith('--'):
                line = refused(capsys, command, f'{option}x')
                assert line == (
                    f"linkage {command}: there is no option '{option}x'; did you mean {option!r}? "
                    f'(see linkage {command} --help)'
                )


def test_misspelt_choice_names_the_nearest_choice(capsys: pytest.CaptureFixture[str]) -> None:
    tried = 0
    for command, action in options():
        for choice in action.choices or ():
            if isinstance(choice, str):
                tried += 1
                line = refused(capsys, command, *action.option_strings[:1], f'{choice}x')
                assert f"there is no '{choice}x'; did you mean {choice!r}?" in line
    assert tried > 5


@pytest.mark.parametrize('name', [*linkage_names(), *spatial_linkage_names(), *scene_names()])
def test_misspelt_shipped_name_names_the_nearest_one(name: str) -> None:
    with pytest.raises(LinkageError, match=f'did you mean .{name}.?'):
        named_file(f'{name}x', 'scenes', 'linkages')


# Metavars and outputs.


METAVARS = {
    'BAG',
    'FILE',
    'FILE|SCENE|BAG',
    'NAME',
    'OTHER',
    'SCENE',
    'SHELL',
    'TOPIC',
    'URDF',
}
"""How arguments without an option are called, in all commands."""


def test_positional_arguments_have_the_same_names_in_all_commands() -> None:
    assert {
        str(action.metavar) for _, action in options() if not action.option_strings
    } == METAVARS


def test_options_of_one_name_have_one_metavar() -> None:
    typed = [(c, o) for c, o in options() if o.option_strings and o.nargs != 0 and not o.choices]
    # Of kinds of their own in some commands.
    several = {'output', 'rate', 'at', 'input', 'joint', 'need'}
    for command, action in typed:
        where = command, action.dest
        assert not re.search(r'\((here|default) ', action.help or ''), where
        if getattr(action.type, '__name__', '') in {'whole number', 'int'}:
            assert action.metavar == 'N', where
        names = {str(o.metavar or o.dest.upper()) for _, o in typed if o.dest == action.dest}
        assert len(names) == 1 or action.dest in several, (*where, names)


def test_output_option_refuses_an_unknown_ending(tmp_path: Path) -> None:
    written = {command: action for command, action in options() if action.dest == 'output'}
    folders = {command for command, action in written.items() if action.metavar == 'FOLDER'}
    assert folders == {'recover', 'replay'}
    for command in written.keys() - folders:
        read = written[command].type
        assert callable(read)
        wrong = {'x.xyz': "ends in '.xyz'", 'x': 'has no ending'}
        if written[command].metavar == 'FOLDER|OUTPUT':
            del wrong['x']
        for name, found in wrong.items():
            with pytest.raises(LinkageError, match=f'^{name}: {found}; name a file that ends in'):
                read(name)


# Keys that are set.


SCENE = """\
linkage: l.yaml
rate: 100
drive: {sine: {amplitude: 0.5, frequency: 1.0}}
effects: {velocity: {}, noise: {joints: {rocker_joint: {white: 1.0e-3}}}}
record: {directory: '1e-3'}
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    return scene_file(tmp_path, SCENE)


def test_set_changes_named_keys_of_a_scene_only(scene: Path, tmp_path: Path) -> None:
    loaded = load_scene(scene, ['rate=500', 'drive.sine.amplitude=0.3', 'effects.markers={}'])
    (scene_linkage,) = loaded.linkages
    name, sine = scene_linkage.drive
    assert (loaded.rate, name, sine.amplitude, sine.frequency) == (500.0, 'sine', 0.3, 1.0)
    assert list(scene_linkage.effects) == ['velocity', 'noise', 'markers']
    assert loaded.record is not None
    assert loaded.record.directory == '1e-3'
    assert load_scene(scene).rate == 100.0


def test_scene_file_of_a_bag_holds_the_set_keys(scene: Path) -> None:
    settings = ['rate=500', 'effects.noise.joints.rocker_joint.white=2e-3']
    loaded = load_scene(scene, settings)
    scene.write_bytes(loaded.files[SCENE_FILE])
    again = load_scene(scene)
    assert again.linkages[0].effects == loaded.linkages[0].effects
    assert (again.rate, again.seed, again.record) == (500.0, loaded.seed, loaded.record)
    assert again.files[SCENE_FILE].startswith(b'# --set rate=500\n# --set effects.noise.')


def test_set_changes_keys_of_a_linkage_without_a_scene() -> None:
    assert load_scene('jansen_leg', ['rate=250']).rate == 250.0
    assert load_scene(named_file('hoeken', 'linkages'), ['rate=250']).rate == 250.0


TWO = """\
rate: 100
linkages:
- {name: left, linkage: l.yaml, drive: {sine: {amplitude: 0.5, frequency: 1.0}}}
- {name: right, linkage: l.yaml}
drive: {sine: {amplitude: 0.4, frequency: 1.0}}
"""


def test_set_changes_keys_of_one_linkage_by_name(tmp_path: Path) -> None:
    scene = scene_file(tmp_path, TWO)
    settings = [
        'linkages.left.drive.sine.amplitude=0.3',
        'linkages.right.prefix=r_',
        'linkages.right.effects={velocity: {}}',
    ]
    loaded = load_scene(scene, settings)
    left, right = loaded.linkages
    assert (left.drive[1].amplitude, right.drive[1].amplitude) == (0.3, 0.4)
    assert (left.prefix, right.prefix) == ('left_', 'r_')
    assert (list(left.effects), list(right.effects)) == ([], ['velocity'])
    scene.write_bytes(loaded.files[SCENE_FILE])
    assert load_scene(scene).linkages == loaded.linkages


OF_SEVERAL = {
    'linkages.lft.prefix=l_': "there is no linkage 'lft'; did you mean 'left'?",
    'linkages.1.prefix=l_': "there is no linkage '1'; there are: left, right",
    'linkages.left=3': "linkages is [{'name': 'left', 'linkage': 'l.yaml'",
    'linkages.left.linkage.a=3': "linkage is 'l.yaml'; name a key in a mapping",
    'linkages.left.rate=5': 'linkages[1].rate: unknown key; ',
    'linkages.right.prefix=5': 'linkages[2].prefix: 5 is not',
    'linkages=3': 'linkages: 3 is not a mapping',
}


@pytest.mark.parametrize('setting', OF_SEVERAL)
def test_wrong_setting_of_one_linkage_is_named(tmp_path: Path, setting: str) -> None:
    with pytest.raises(LinkageError) as caught:
        load_scene(scene_file(tmp_path, TWO), [setting])
    assert str(caught.value).startswith(f'--set {setting}: {OF_SEVERAL[setting]}')


WRONG = {
    'rate': "'rate' is not a setting; write KEY=VALUE: rate=500",
    '=3': "'=3' is not a setting; write KEY=VALUE",
    'rate=-1': 'rate: -1 is out of bounds; write a finite number, at least 0',
    'rate=fast': "rate: 'fast' is not a number",
    'rtae=1': "rtae: unknown key; did you mean 'rate'?",
    'rate.hz=1': 'rate is 100; name a key in a mapping',
    'rate=[': 'is not valid YAML',
    'rate=1\nseed: 2': "'rate=1\\nseed: 2' is not a setting",
    'rate=\udc80': "'rate=\\udc80' is not a setting",
    'drive.sine.amplitud=1': "drive.sine.amplitud: unknown key; did you mean 'amplitude'?",
    'drive.topic.max_age=1': 'drive.topic: is a second drive',
    'effects.noise.joints={x: {white: 1}}': 'effects.noise.joints.x',
}


@pytest.mark.parametrize('setting', WRONG)
def test_wrong_setting_is_named_instead_of_the_file(scene: Path, setting: str) -> None:
    with pytest.raises(LinkageError) as caught:
        load_scene(scene, [setting])
    assert str(caught.value).startswith('--set ')
    assert WRONG[setting] in str(caught.value)
    assert 'scene of mine' not in str(caught.value)


def test_error_in_the_scene_file_names_the_file(scene: Path) -> None:
    scene.write_text(SCENE.replace('frequency: 1.0', 'frequency: -1.0'))
    with pytest.raises(LinkageError, match=r'scene of mine.yaml:3: drive.sine.frequency: -1'):
        load_scene(scene, ['drive.sine.amplitude=0.3'])


@pytest.mark.parametrize('command', ['run', 'scene', 'accuracy', 'replay'])
def test_commands_refuse_a_wrong_setting_in_one_line(folder: Path, command: str) -> None:
    typed = ['my_bag'] if command == 'replay' else ['two_fingers']
    answer = linkage(folder, command, *typed, '--set', 'rate=-1')
    assert answer.returncode == 2
    assert '--set rate=-1: rate: -1 is out of bounds' in answer.stderr
    assert answer.stderr.count('\n') == 1


@pytest.mark.parametrize('typed', ['scene --list', 'scene --schema scene'])
def test_set_without_a_scene_is_refused(tmp_path: Path, typed: str) -> None:
    answer = linkage(tmp_path, *typed.split(), '--set', 'rate=5')
    assert (answer.returncode, answer.stdout) == (2, '')
    assert '--set rate=5: is for a scene; name one' in answer.stderr


def test_replay_runs_the_recorded_scene_with_changed_keys(folder: Path) -> None:
    setting = 'effects={bias: {joints: {rocker_joint: 0.5}}}'
    answer = linkage(folder, 'replay', 'my_bag', '--set', setting, '-o', 'biased')
    assert answer.returncode == 0, answer.stderr
    row = next(line for line in answer.stdout.splitlines() if line.startswith('rocker_joint'))
    assert '0.5' in row.split()
    assert 'identical' in linkage(folder, 'replay', 'biased').stdout


# The gallery.


def test_gallery_lists_every_linkage_and_scene(tmp_path: Path) -> None:
    lines = linkage(tmp_path, 'gallery').stdout.splitlines()
    names = [line.split()[0] for line in lines if line]
    linkages = [*linkage_names(), *spatial_linkage_names()]
    assert names == ['linkages', *linkages, 'scenes', *scene_names()]
    assert all(len(line.split()) > 3 for line in lines if line not in ('', 'linkages', 'scenes'))


def test_gallery_prints_a_file_as_shipped(tmp_path: Path) -> None:
    for typed, file in (
        (['hoeken'], 'linkages/hoeken'),
        (['demo'], 'scenes/demo'),
        (['jansen_leg'], 'linkages/jansen_leg'),
        (['ankle'], 'linkages/space/ankle'),
        (['jansen_leg', '--scene'], 'scenes/jansen_leg'),
    ):
        answer = linkage(tmp_path, 'gallery', *typed)
        assert answer.stdout == (CONFIG / f'{file}.yaml').read_text('utf-8')


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', scene_names())
def test_copied_scene_loads_with_all_its_files(tmp_path: Path, name: str) -> None:
    answer = linkage(tmp_path, 'gallery', name, '--scene', '-o', 'mine.yaml')
    copied, shipped = load_scene(tmp_path / 'mine.yaml'), load_scene(name)
    assert [one.linkage for one in copied.linkages] == [one.linkage for one in shipped.linkages]
    assert copied.rate == shipped.rate
    assert answer.stdout.split() == [
        'mine.yaml',
        *sorted({*answer.stdout.split()} - {'mine.yaml'}),
    ]
    assert {file.name for file in tmp_path.iterdir()} == {*answer.stdout.split()}


def test_copied_scene_replaces_no_linkage_of_another_content(tmp_path: Path) -> None:
    (tmp_path / 'four_bar.yaml').write_text('mine')
    answer = linkage(tmp_path, 'gallery', 'demo', '-o', 'x.yaml')
    assert answer.returncode == 2
    assert 'four_bar.yaml: is another file, and the scene needs a linkage of this' in answer.stderr
    assert [file.name for file in tmp_path.iterdir()] == ['four_bar.yaml']


# Completion.


COMPLETED = {
    'linkage che': {'check'},
    'linkage check jan': {'jansen_leg'},
    'linkage check m': {'mine.yaml', 'my_bag/'},
    'linkage scene worn': {'worn_press'},
    'linkage accuracy --q': {'--quick'},
    'linkage solve four_bar --at ': set(),
    'linkage gallery jan': {'jansen_leg'},
    'linkage info my_b': {'my_bag/'},
    'linkage completion ': {'--help', *SHELLS},
}


@pytest.mark.sample(4)
@pytest.mark.parametrize('line', COMPLETED)
def test_shell_completes_commands_options_names_and_files(tmp_path: Path, line: str) -> None:
    pytest.importorskip('argcomplete')
    (tmp_path / 'mine.yaml').touch()
    (tmp_path / 'my_bag').mkdir()
    completed = tmp_path / 'completed'
    subprocess.run(
        [sys.executable, '-m', 'linkage_ros'],
        cwd=tmp_path,
        env=environment(tmp_path)
        | {
            '_ARGCOMPLETE': '1',
            '_ARGCOMPLETE_IFS': '\n',
            '_ARGCOMPLETE_SHELL': 'fish',
            '_ARGCOMPLETE_SUPPRESS_SPACE': '1',
            '_ARGCOMPLETE_STDOUT_FILENAME': str(completed),
            'COMP_LINE': line,
            'COMP_POINT': str(len(line)),
        },
        timeout=60,
        check=True,
    )
    found = completed.read_text().split('\n') if completed.exists() else []
    assert {entry.partition('\t')[0].strip() for entry in found} - {''} == COMPLETED[line]


@pytest.mark.parametrize('shell', SHELLS)
def test_completion_prints_a_script_for_each_shell(tmp_path: Path, shell: str) -> None:
    pytest.importorskip('argcomplete')
    answer = linkage(tmp_path, 'completion', shell)
    assert answer.returncode == 0
    assert '_ARGCOMPLETE' in answer.stdout
    assert 'linkage' in answer.stdout


def test_completion_without_argcomplete_names_what_to_install(tmp_path: Path) -> None:
    program = (
        'import importlib.util, sys; sys.modules["argcomplete"] = None; '
        'from linkage_ros.cli.main import main; sys.exit(main())'
    )
    answer = subprocess.run(
        [sys.executable, '-c', program, 'completion', 'bash'],
        env=environment(tmp_path),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert answer.returncode == 2
    assert answer.stderr.startswith('linkage completion: argcomplete: is not installed; pip insta')


def test_check_does_not_import_argcomplete(tmp_path: Path) -> None:
    program = (
        'import sys; from linkage_ros.cli.main import main; main(["check", "four_bar"]); '
        'sys.exit("argcomplete" in sys.modules)'
    )
    subprocess.run([sys.executable, '-c', program], env=environment(tmp_path), check=True)
