# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Scene and linkage files that cannot be used: one line says where, what and what helps."""

import re

from linkage_ros.description import load_scene
from linkage_ros.errors import FileError
import pytest

from .conftest import CONFIG, FOUR_BAR, is_one_line, SCENE

# An invalid scene: one line with place, reason and remedy.
#
# Linkages follow in `test_bad_linkages`; `test_damaged_files` damages the shipped files at
# random.


BOMB = b'a: &a [1, 1]\n' + b''.join(
    b'%c: &%c [%s]\n' % (k, k, b', '.join([b'*%c' % (k - 1)] * 9))
    for k in range(ord('b'), ord('p'))
)

# Appended to a good scene; the error's place and reason, and a part of its remedy.
SCENES = {
    'unknown key': (b'rtae: 5', ":2: rtae: unknown key; did you mean 'rate'?"),
    'unlike any key': (b'x: 5', ':2: x: unknown key; known: angles, beyond_limits, '),
    'key twice': (b'rate: 1\nrate: 2', ':3: rate: is a duplicate (first in line 2); remove one'),
    'key twice, deep': (
        b'drive: {topic: {max_age: 1, max_age: 2}}',
        ':2: max_age: is a duplicate (first in line 2); remove one',
    ),
    'text for a number': (b'rate: fast', ":2: rate: 'fast' is not a number; write a number"),
    'flag for a number': (b'rate: true', ':2: rate: True is not a number; write a number'),
    'nothing for a number': (b'rate:', ':2: rate: None is not a number; write a number'),
    'NaN': (b'rate: .nan', ':2: rate: nan is out of bounds; write a finite number, at least 0'),
    'infinite': (b'rate: .inf', ':2: rate: inf is out of bounds; write a finite number'),
    'negative rate': (b'rate: -1', ':2: rate: -1 is out of bounds; write a finite number'),
    'absurd rate': (b'rate: 1e9', ':2: rate: 1000000000.0 is out of bounds; write a finite'),
    'hardly a rate': (b'rate: 1e-9', ':2: rate: 1e-09 is out of bounds; write 0.01 to 20000 [Hz]'),
    'beyond doubles': (b'rate: 1e999', ':2: rate: inf is out of bounds; write a finite number'),
    '400 digits': (b'rate: ' + b'9' * 400, ':2: rate: inf is out of bounds; write a finite'),
    '9000 digits': (b'rate: ' + b'9' * 9000, ':2: rate: inf is out of bounds; write a finite'),
    'YAML 1.1 flag': (
        b'drive: {topic: {carry_forward: yes}}',
        ":2: drive.topic.carry_forward: 'yes' is not true or false; write true or false",
    ),
    'YAML 1.1 off': (b'rate: off', ":2: rate: 'off' is not a number; write a number"),
    'YAML 1.1 time': (b'rate: 1:30', ":2: rate: '1:30' is not a number; write a number"),
    'YAML 1.1 thousands': (b'rate: 1_000', ":2: rate: '1_000' is not a number; write a number"),
    'YAML 1.1 date': (b'rate: 2026-01-01', ":2: rate: '2026-01-01' is not a number; write"),
    'merge key': (b'<<: {rate: 1}', ':2: <<: unknown key; known:'),
    'choice': (
        b'angles: unwrapped',
        ":2: angles: 'unwrapped' is not a choice; write continuous or",
    ),
    'list for a mapping': (
        b'effects: [velocity]',
        ":2: effects: ['velocity'] is not a mapping; write effects: {velocity: {}}",
    ),
    'nothing for a mapping': (
        b'effects: {velocity: }',
        ':2: effects.velocity: is empty; write velocity: {…}',
    ),
    'unknown effect': (
        b'effects: {velocty: {}}',
        ":2: effects.velocty: unknown key; did you mean 'velocity'?",
    ),
    'unknown parameter of an effect': (
        b'effects: {velocity: {gain: 2}}',
        ':2: effects.velocity.gain: unknown key; leave it out',
    ),
    'unknown drive': (b'drive: {tropic: {}}', ':2: drive.tropic: unknown key; did you mean'),
    'age of zero': (
        b'drive: {topic: {max_age: 0}}',
        ':2: drive.topic.max_age: 0 is out of bounds;',
    ),
    'bag in a folder': (
        b'record: {name: a/b}',
        ":2: record.name: 'a/b' is not a plain name; leave out the folders",
    ),
    'bag above': (b'record: {name: ..}', ":2: record.name: '..' is not a plain name; leave out"),
    'bag name a number': (
        b'record: {name: 7}',
        ':2: record.name: 7 is not a string; write a name',
    ),
    'line break in a name': (
        b'record: {name: "a\\nb"}',
        ":2: record.name: 'a\\nb' is not a string; write a name",
    ),
    'half a message': (b'record: {queue: 100.5}', ':2: record.queue: 100.5 is not whole; write'),
    'flush at every tick': (
        b'record: {flush_period: 0.001}',
        ':2: record.flush_period: 0.001 is out of bounds; write a finite number, at least 0.05',
    ),
    'file of a byte': (
        b'record: {split_bytes: 1}',
        ':2: record.split_bytes: 1 is too small; write 1000000 or more, or 0',
    ),
    'file of a moment': (
        b'record: {split_seconds: 0.5}',
        ':2: record.split_seconds: 0.5 is too small; write 1 or more, or 0',
    ),
    'ring of one file': (
        b'record: {keep_files: 2, split_bytes: 0}',
        ':2: record.keep_files: the bag has only one file; write split_bytes or split_seconds too',
    ),
    'memory of a moment': (
        b'record: {snapshot_seconds: 0.05}',
        ':2: record.snapshot_seconds: 0.05 is too small; write 0.1 or more, or 0',
    ),
    'memory in files': (
        b'record:\n  snapshot_seconds: 30\n  split_seconds: 60',
        (
            ':4: record.split_seconds: is for a bag that is written as the run goes, and '
            'snapshot_seconds keeps the run in memory; leave one of the two out'
        ),
    ),
    'memory in a ring': (
        b'record: {snapshot_seconds: 30, split_bytes: 0, keep_files: 3}',
        ':2: record.keep_files: is for a bag that is written as the run goes',
    ),
    'memory that is flushed': (
        b'record: {flush_period: 1, snapshot_seconds: 30}',
        ':2: record.flush_period: is for a bag that is written as the run goes',
    ),
    'memory that waits for the disk': (
        b'record: {queue: 1000, snapshot_seconds: 30}',
        ':2: record.queue: is for a bag that is written as the run goes',
    ),
    'room for nothing': (
        b'record: {snapshot_bytes: 5000000}',
        ':2: record.snapshot_bytes: nothing is kept in memory; write snapshot_seconds too',
    ),
    'unknown packing': (
        b'record: {compression: gzip}',
        ":2: record.compression: 'gzip' is not a choice; write none or lz4 or zstd",
    ),
    'tab': (b'drive:\n\ttopic: {}', ':3: has a tab; write spaces instead of tabs'),
    'open bracket': (
        b'effects: {velocity: {}',
        ':2: has a { that does not end, or no comma; close it',
    ),
    'two documents': (b'---\nrate: 1', ':2: is not valid YAML (but found another document);'),
    'alias loop': (b'rate: &a [*a]', ':2: is not valid YAML (aliases are not read); correct'),
    'alias bomb': (BOMB + b'rate: *o', ':3: is not valid YAML (aliases are not read); correct'),
    'Python object': (b'rate: !!python/name:os.system', ':2: is not valid YAML (could not'),
    'tagged list': (b'rate: !!int [1]', ':2: is not valid YAML (expected a scalar node'),
    'tagged text': (b'drive: !!map [a, b]', ':2: is not valid YAML (expected a mapping);'),
    'tag that does not fit': (b'rate: !!int fast', ': is not valid YAML (invalid literal for int'),
    'deep nesting': (b'rate: ' + b'[' * 3000, ': is nested too deeply; use fewer levels'),
    'NUL': (b'rate: \0', ': is a binary file, not a YAML file; name a scene or'),
    'NUL in a key': (b'"ra\\0te": 1', ":2: the key 'ra\\x00te' is not a name; write a name"),
    'half a surrogate': (b'"\\ud800": 1', ":2: the key '\\ud800' is not a name; write a name"),
    'number as a key': (b'5: 1', ':2: the key 5 is not a name; write a name'),
    'nothing as a key': (b'~: 1', ':2: the key None is not a name; write a name'),
    'mapping as a key': (b'? {a: 1}\n: 1', ":2: the key {'a': 1} is not a name; write a name"),
    'not UTF-8': ('# Schönfließ'.encode('latin-1'), ': is not UTF-8 (byte 27); save it as UTF-8'),
    'huge': (b'# ' + b'x' * 1_000_000, ': is larger than 1000000 bytes; name a YAML file'),
}


@pytest.mark.parametrize('kind', SCENES)
def test_a_bad_scene_is_refused_in_a_line(build, kind):
    text, expected = SCENES[kind]
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
def test_a_linkage_that_is_no_file(build, named, shown):
    with pytest.raises(FileError) as caught:
        build(b'rate: 5\nlinkage: ' + named)
    assert is_one_line(caught.value)
    assert re.search(rf':2: linkage: .*{shown}.* is not a file; name one', str(caught.value))


@pytest.mark.parametrize('named', [b'hoekens', b'hoeken.yaml'])
def test_a_linkage_that_comes_with_the_package_is_meant(build, named):
    with pytest.raises(FileError, match=f"{named.decode()}' is not a file; did you mean 'hoeken'"):
        build(b'linkage: ' + named)


def test_the_name_of_a_file_far_down_is_told(tmp_path):
    folder = tmp_path / 'a_folder_with_a_long_name' / 'that_is_in_one_of_its_kind' / 'and_so_on'
    folder.mkdir(parents=True)
    (folder / 'scene.yaml').write_bytes(b'linkage: nowhere.yaml')
    with pytest.raises(FileError, match=r"….*nowhere\.yaml' is not a file"):
        load_scene(folder / 'scene.yaml')


@pytest.mark.parametrize('name', ['nowhere.yaml', '.', 'n' * 1000, 'nul\0', 'scene.yaml/x'])
def test_a_scene_that_cannot_be_read(tmp_path, name):
    (tmp_path / 'scene.yaml').write_bytes(SCENE)
    with pytest.raises(FileError) as caught:
        load_scene(f'{tmp_path}/{name}')
    assert len(str(caught.value).splitlines()) == 1
    assert re.search('; name a (file|scene)', str(caught.value))


# An invalid linkage file: one line with place, reason and remedy.


# Without its first line, which is for editors.
WRITTEN_OUT = (CONFIG / 'linkages' / 'four_bar.yaml').read_bytes().partition(b'\n')[2]
SLIDER = b'inverted_slider_crank: {a: 0.15, swivel: [0.25, 0.1]}'

# The whole linkage file.
LINKAGES = {
    'empty': (b'', ': is empty, not a YAML file; linkage gallery four_bar prints an example'),
    'a list': (b'- four_bar', ": holds ['four_bar']; write a mapping (key: value)"),
    'nothing known': (b'bars: 4', ':1: bars: unknown key; known: angles, assembly, four_bar'),
    'shorthand misspelt': (b'fourbar: {}', ":1: fourbar: unknown key; did you mean 'four_bar'?"),
    'shorthand without a side': (
        b'four_bar: {a: 1, b: 1, c: 1}',
        ":1: four_bar: the key 'd' is missing; add d: a number in [m]",
    ),
    'zero length': (
        FOUR_BAR.replace(b'0.04', b'0'),
        ':1: four_bar.a: 0 is out of bounds; write a finite number, more than 0 and at most 1e+09',
    ),
    'negative length': (FOUR_BAR.replace(b'0.04', b'-1'), ':1: four_bar.a: -1 is out of bounds;'),
    'NaN length': (FOUR_BAR.replace(b'0.04', b'.nan'), ':1: four_bar.a: nan is out of bounds;'),
    'a length beyond squaring': (
        FOUR_BAR.replace(b'0.04', b'1e200'),
        ':1: four_bar.a: 1e+200 is out of bounds; write a finite number',
    ),
    'side of another shape': (
        FOUR_BAR.replace(b'}', b', assembly: ahead}'),
        ":1: four_bar.assembly: 'ahead' is not a choice; write left or right",
    ),
    'two shorthands': (
        FOUR_BAR + SLIDER,
        ':2: inverted_slider_crank: unknown key; known: angles, four_bar, units',
    ),
    'shorthand and links': (
        FOUR_BAR + b'links: {}',
        ':2: links: unknown key; known: angles, four_bar, units',
    ),
    'closes nowhere': (
        FOUR_BAR.replace(b'0.1}', b'1.0}'),
        # d − a − b − c
        'the loops close at no value of the input; coupler and rocker miss each other by 0.76 m ',
    ),
    'swivel that is no point': (
        SLIDER.replace(b', 0.1', b''),
        ':1: inverted_slider_crank.swivel: [0.25] is not a point; write two finite numbers',
    ),
    'swivel on the pivot': (
        SLIDER.replace(b'0.25, 0.1', b'0, 0'),
        ":1: inverted_slider_crank.swivel: [0, 0] is the crank's pivot; give the swivel",
    ),
    'point of three': (
        WRITTEN_OUT.replace(b'[0.040, 0]', b'[0.040, 0, 0]'),
        ':6: links.crank.A: [0.04, 0, 0] is not a point; write two finite numbers: [x, y]',
    ),
    'point far away': (
        WRITTEN_OUT.replace(b'[0.040, 0]', b'[1e300, 0]'),
        ':6: links.crank.A: [1e+300, 0] is out of bounds; write numbers of at most 1e+09',
    ),
    'link without length': (
        WRITTEN_OUT.replace(b'[0.040, 0]', b'[0, 0]'),
        "lies on 'O2'; give the two points different places",
    ),
    'no ground': (
        WRITTEN_OUT.replace(b'ground:', b'base:'),
        ":4: links: no link is named 'ground'",
    ),
    'no pin': (
        WRITTEN_OUT.replace(b'rocker: {O4', b'rocker: {O5'),
        ':8: links.rocker: is free: its pins and sliders do not hold it',
    ),
    'crank that is no link': (
        WRITTEN_OUT.replace(b'child: crank}', b'child: krank}'),
        ":9: input.child: 'krank' is not a link; name one of coupler, crank, ground, rocker",
    ),
    'no side': (
        WRITTEN_OUT.replace(b'B: left', b''),
        ":10: assembly: 'B' is missing; write B: left",
    ),
    'joint of no link': (
        WRITTEN_OUT.replace(b'child: coupler}', b'child: copler}'),
        ":12: joints.coupler_joint.child: 'copler' is not a link; name one of coupler, crank, gr",
    ),
    'the input published': (
        WRITTEN_OUT.replace(b'rocker_joint', b'crank_joint'),
        ':13: joints.crank_joint: is the input joint; publish the dependent joints',
    ),
    'joint of no text': (
        WRITTEN_OUT.replace(b'crank_joint', b'"\\udc00"'),
        ":9: input.joint: '\\udc00' is not a string; write a name",
    ),
    'nothing to publish': (
        WRITTEN_OUT[: WRITTEN_OUT.index(b'joints:')] + b'joints: {}',
        ':11: joints: publishes nothing; name a joint',
    ),
    'slide of no slider': (
        WRITTEN_OUT.replace(b'{parent: crank, child: coupler}', b'{slider: rod}'),
        ":12: joints.coupler_joint.slider: 'rod' is not a slider; this linkage has none",
    ),
}


@pytest.mark.parametrize('kind', LINKAGES)
def test_a_bad_linkage_is_refused_in_a_line(build, kind):
    text, expected = LINKAGES[kind]
    with pytest.raises(FileError) as caught:
        build(SCENE, text)
    assert is_one_line(caught.value)
    assert expected in str(caught.value)
