# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Every command with a file of every wrong kind: one line says what the file is."""

from __future__ import annotations

from pathlib import Path
import shutil
from threading import Event

from linkage_ros.cli import find_command, parser_of
from linkage_ros.errors import LinkageError
import pytest

from .recorded import Recorded, scene_file

OF_LINKAGES = {
    'check': '', 'solve': '', 'draw': '-o x.svg', 'animate': '-o x.svg', 'compile': '-o x.c',
}  # fmt: skip
OF_SCENES = {
    'scene': '', 'simulate': '--seconds 1 -o x.csv', 'fmu': '-o x.fmu', 'urdf': '',
    'mjcf': '', 'view': '-o x.html', 'accuracy': '--quick',
}  # fmt: skip
OF_BAGS = {
    'plot': '-o x.svg', 'info': '', 'report': '-o x.html', 'export': '-o x.csv', 'replay': '',
}  # fmt: skip
WITH_BAGS_TOO = {'accuracy', 'animate', 'view'}

FILES = {
    'urdf': (b'<?xml version="1.0"?>\n<!-- by hand -->\n<robot name="r"/>\n', 'a URDF'),
    'xml': (b'<mujocoinclude/>', 'an XML file'),
    'html': (b'<!doctype html>\n<html></html>', 'a web page'),
    'svg': (b'<svg xmlns="http://www.w3.org/2000/svg"/>', 'a picture'),
    'png': (b'\x89PNG\r\n\x1a\n' + bytes(range(256)), 'a picture'),
    'fmu': (b'PK\x03\x04\x14\0', 'a ZIP file'),
    'db3': (b'SQLite format 3\0' + bytes(84), 'an SQLite file'),
    'bag': (b'#ROSBAG V2.0\n\x45\0\0\0', 'a bag of ROS 1'),
    'bin': (bytes(range(256)) * 10, 'a binary file'),
    'empty': (b' \n', 'empty'),
}
"""Content of a file, and how a person calls it."""

LINKAGE = b'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n'
SCENE = b'linkage: four_bar\nrate: 100\n'


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('kinds')
    for kind, (content, _) in FILES.items():
        (folder / f'x_{kind}.yaml').write_bytes(content)
    (folder / 'linkage.yaml').write_bytes(LINKAGE)
    (folder / 'scene.yaml').write_bytes(SCENE)
    (folder / 'folder').mkdir()
    bag = folder / 'my_bag'
    Recorded(bag, scene_file(folder, 'rate: 100\n'), lambda _: {'crank_joint': (1.0, 1.0)}).run(9)
    shutil.copy(next(bag.glob('*.mcap')), folder / 'x.mcap')
    return folder


def answer(command: str, *typed: str) -> str:
    """Return the one line for which a command refuses its file."""
    module = find_command(command)
    parser = parser_of(command, module)
    with pytest.raises(LinkageError) as refused:
        module.run(parser.parse_args(typed), Event())
    line = str(refused.value)
    for dress in ('\n', 'None', 'load_scene', 'Is a directory', '[ERROR]'):
        assert dress not in line
    return line


@pytest.mark.parametrize('command', [*OF_LINKAGES, *OF_SCENES, *OF_BAGS, 'import'])
@pytest.mark.parametrize('kind', FILES)
def test_file_of_another_kind_is_named_by_its_kind(
    folder: Path, command: str, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    name, noun = f'x_{kind}.yaml', FILES[kind][1]
    if (command, kind) == ('import', 'urdf'):
        pytest.skip('the right kind')
    more = {**OF_LINKAGES, **OF_SCENES, **OF_BAGS}.get(command, '').split()
    line = answer(command, name, *more)
    assert line.startswith(f'{name}: ')
    if command in OF_BAGS and kind in ('bin', 'db3', 'bag'):
        return  # the reader of bags shows how it starts, or how to convert it
    if command == 'import' and kind in ('xml', 'svg'):
        assert line.startswith(f'{name}: is XML, and not a <robot>')
    else:
        assert f' is {noun}' in line
    if kind == 'urdf' and command not in OF_BAGS:
        assert line.endswith('linkage import makes a linkage file of a URDF')


@pytest.mark.parametrize('command', sorted({*OF_LINKAGES, *OF_SCENES} - WITH_BAGS_TOO))
@pytest.mark.parametrize('bag', ['my_bag', 'x.mcap'])
def test_bag_given_as_a_linkage_is_named_a_bag(
    folder: Path, command: str, bag: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    line = answer(command, bag, *{**OF_LINKAGES, **OF_SCENES}[command].split())
    assert line.startswith(f'{bag}: is a bag, ')
    assert line.endswith('linkage info, plot and report read bags')


@pytest.mark.parametrize('command', sorted(OF_LINKAGES))
def test_scene_given_as_a_linkage_names_its_linkage(
    folder: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    (folder / 'below').mkdir(exist_ok=True)
    (folder / 'below' / 's.yaml').write_text('linkage: l.yaml\n')
    more = OF_LINKAGES[command].split()
    assert answer(command, 'scene.yaml', *more) == (
        'scene.yaml: is a scene; name its linkage, four_bar'
    )
    assert answer(command, 'below/s.yaml', *more).endswith('name its linkage, below/l.yaml')


@pytest.mark.parametrize('command', [*OF_BAGS, 'import'])
@pytest.mark.parametrize(('name', 'noun'), [('linkage', 'linkage'), ('scene', 'scene')])
def test_linkage_given_as_a_bag_is_named_a_linkage(
    folder: Path, command: str, name: str, noun: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    line = answer(command, f'{name}.yaml', *OF_BAGS.get(command, '').split())
    assert f'is a {noun} file, not a' in line


# Words that are typed.


@pytest.mark.parametrize(
    'line',
    [
        'draw four_bar -o no/x.svg', 'solve four_bar -o no/x.csv', 'animate four_bar -o no/x.gif',
        'compile four_bar -o no/x.c', 'urdf four_bar -o no/x.urdf', 'fmu four_bar -o no/x.fmu',
        'gallery four_bar -o no/x.yaml', 'simulate demo --seconds 1 -o no/x.csv',
        'simulate demo --seconds 1 --seeds 2 -o no/x.svg', 'view four_bar -o no/x.html',
    ],
)  # fmt: skip
def test_missing_output_folder_is_named_before_the_work(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    command, *words = line.split()
    assert answer(command, *words) == (f'{words[-1]}: there is no folder no; make it: mkdir -p no')


@pytest.mark.parametrize('at', ['1e300', '-1e17', '1e15'])
def test_solve_prints_large_numbers_in_short(capsys: pytest.CaptureFixture[str], at: str) -> None:
    module = find_command('solve')
    module.run(parser_of('solve', module).parse_args(['four_bar', f'--at={at}']), Event())
    assert max(map(len, capsys.readouterr().out.split())) < 30
