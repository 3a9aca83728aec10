# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Scene and linkage files that cannot be used: one line says where, what and what helps."""

from importlib.util import find_spec
from pathlib import Path
import re

from linkage_ros.description import (
    linkage_schema,
    load_scene,
    parse_scene,
    parse_yaml,
    scene_schema,
)
from linkage_ros.errors import FileError
from linkage_ros.tick import Pipeline
import pytest
import yaml

from .conftest import FOUR_BAR, is_one_line, SCENE

GROUPS = yaml.safe_load(Path(__file__).with_name('refused.yaml').read_text('utf-8'))
CASES = [
    pytest.param(group, text, line, known, id=f'{name}: {text}'[:80])
    for name, group in GROUPS.items()
    for key, known in (('refused', True), ('refused_by_the_reader', False))
    for text, line in group.get(key, ())
]


@pytest.fixture(scope='module')
def valid():
    """Return a function that says whether a content is valid, by kind; None without jsonschema."""
    if find_spec('jsonschema') is None:
        return None
    from jsonschema import Draft202012Validator as validator  # where it is installed

    validators = {'scene': validator(scene_schema()), 'linkage': validator(linkage_schema())}
    return lambda kind, content: validators[kind].is_valid(content)


def files_of(group, text):
    """Return the files of a case."""
    files = {
        'scene': group.get('scene', SCENE.decode()),
        'linkage': group.get('linkage', FOUR_BAR.decode()),
    }
    into = group.get('into', 'scene')
    if isinstance(text, dict):
        ((old, new),) = text.items()
        assert files[into].count(old) == 1
        files[into] = files[into].replace(old, new)
    else:
        files[into] += text
    return {f'{kind}.yaml': content.encode() for kind, content in files.items()}


def load(files, folder, *, alone):
    """Build what the files call for; ``alone`` if one stands in place of a scene."""
    if alone:
        (folder / 'file.yaml').write_bytes(files['scene.yaml'])
        load_scene(folder / 'file.yaml')
    else:
        Pipeline(parse_scene('scene', 'here', files))


@pytest.mark.parametrize(('group', 'text', 'line', 'known'), CASES)
def test_bad_file_is_refused_by_reader_and_schema(
    tmp_path_factory, valid, group, text, line, known
):
    files = files_of(group, text)
    # Its path is short, since a message shortens a long one.
    folder = tmp_path_factory.mktemp('bad')
    with pytest.raises(FileError) as caught:
        load(files, folder, alone='alone' in group)
    assert is_one_line(caught.value)
    assert str(caught.value).removeprefix('here: ').replace(f'{folder}/', '') == line
    kind = line.partition('.')[0]
    try:
        content = parse_yaml(files[f'{kind}.yaml'], 'file').mapping
    except (FileError, KeyError):
        assert known, 'no schema is asked'
        return
    if valid is not None:
        assert valid(kind, content) != known


BOMB = b'a: &a [1, 1]\n' + b''.join(
    b'%c: &%c [%s]\n' % (k, k, b', '.join([b'*%c' % (k - 1)] * 9))
    for k in range(ord('b'), ord('p'))
)

# What no text of a YAML file can hold, or should.
LARGE = {
    '400 digits': (b'rate: ' + b'9' * 400, ':2: rate: inf is out of bounds; write a finite'),
    '9000 digits': (b'rate: ' + b'9' * 9000, ':2: rate: inf is out of bounds; write a finite'),
    'alias bomb': (BOMB + b'rate: *o', ':3: is not valid YAML (aliases are not read); correct'),
    'deep nesting': (b'rate: ' + b'[' * 3000, ': is nested too deeply; use fewer levels'),
    'NUL': (b'rate: \0', ': is a binary file, not a YAML file; name a scene or'),
    'not UTF-8': ('# Schönfließ'.encode('latin-1'), ': is not UTF-8 (byte 27); save it as UTF-8'),
    'huge': (b'# ' + b'x' * 1_000_000, ': is larger than 1000000 bytes; name a YAML file'),
}


@pytest.mark.parametrize('kind', LARGE)
def test_oversized_file_is_refused_in_one_line(build, kind):
    text, expected = LARGE[kind]
    with pytest.raises(FileError) as caught:
        build(SCENE + text)
    assert is_one_line(caught.value)
    assert f'scene.yaml{expected}' in str(caught.value)


@pytest.mark.parametrize(
    ('named', 'shown'),
    [
        (b'nowhere.yaml', 'nowhere.yaml'),
        (b'.', ''),
        (b'/dev/full', '/dev/full'),
        (b'n' * 1000, 'nnn'),
    ],
)
def test_scene_with_a_missing_linkage_file_is_refused(build, named, shown):
    with pytest.raises(FileError) as caught:
        build(b'rate: 5\nlinkage: ' + named)
    assert is_one_line(caught.value)
    assert re.search(rf':2: linkage: .*{shown}.* is not a file; name one', str(caught.value))


@pytest.mark.parametrize('named', [b'hoekens', b'hoeken.yaml'])
def test_misnamed_gallery_linkage_error_suggests_the_name(build, named):
    with pytest.raises(FileError, match=f"{named.decode()}' is not a file; did you mean 'hoeken'"):
        build(b'linkage: ' + named)


def test_long_path_error_keeps_the_file_name(tmp_path):
    folder = tmp_path / 'a_folder_with_a_long_name' / 'that_is_in_one_of_its_kind' / 'and_so_on'
    folder.mkdir(parents=True)
    (folder / 'scene.yaml').write_bytes(b'linkage: nowhere.yaml')
    with pytest.raises(FileError, match=r"….*nowhere\.yaml' is not a file"):
        load_scene(folder / 'scene.yaml')


@pytest.mark.parametrize('name', ['nowhere.yaml', '.', 'n' * 1000, 'nul\0', 'scene.yaml/x'])
def test_unreadable_scene_is_refused(tmp_path, name):
    (tmp_path / 'scene.yaml').write_bytes(SCENE)
    with pytest.raises(FileError) as caught:
        load_scene(f'{tmp_path}/{name}')
    assert len(str(caught.value).splitlines()) == 1
    assert re.search('; name a (file|scene)', str(caught.value))
