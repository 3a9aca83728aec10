# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage scene``: what a user types and reads, on good files and on bad ones."""

from __future__ import annotations

import argparse
from dataclasses import fields
from importlib.util import find_spec
import json
from math import inf
from pathlib import Path
from threading import Event

from linkage_ros.cli import parameters_of, REGISTRIES, scene as command, table_of, table_text
from linkage_ros.description import as_text
from linkage_ros.errors import FileError, LinkageError
from linkage_ros.messages import JOINT_STATE_TYPE
import pytest

from .conftest import json_keys, Run

CONFIG = Path(__file__).parents[2] / 'config'
SCENES = sorted((CONFIG / 'scenes').glob('*.yaml'))
FOUR_BAR = CONFIG / 'linkages' / 'four_bar.yaml'

needs_jsonschema = pytest.mark.skipif(find_spec('jsonschema') is None, reason='needs jsonschema')


def run(*typed: str) -> int:
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return command.run(parser.parse_args(typed), Event())


@pytest.mark.parametrize('path', SCENES, ids=lambda path: path.stem)
def test_every_shipped_scene_is_explained(path, capsys):
    assert run(str(path)) == 0
    said = capsys.readouterr().out
    for words in (str(path), 'joints', 'ticks', 'Stages', 'Topics', 'joint_states'):
        assert words in said


SCENE = f"""\
linkage: {FOUR_BAR}
rate: 500
drive: {{constant_rate: {{rate: 6.28}}}}
loads: {{gravity: [0, -9.81]}}
effects:
  effort: {{}}
  pin_forces: {{}}
  backlash: {{play: 0.01}}
  delay: {{seconds: 0.002}}
faults:
  stop: {{freeze: {{}}, at: [1, 2.5], seconds: 0.5}}
"""


def test_stages_come_in_their_order_and_say_who_brings_them_in(tmp_path, capsys):
    (tmp_path / 'scene.yaml').write_text(SCENE)
    assert run(str(tmp_path / 'scene.yaml')) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    stages = [line[1] for line in lines if line and line[0].isdigit()]
    assert stages == [
        'constant_rate', 'backlash', 'velocity', 'acceleration', 'effort', 'pin_forces', 'delay',
    ]  # fmt: skip
    by_name = {line[1]: ' '.join(line) for line in lines if line and line[0].isdigit()}
    assert by_name['velocity'].endswith('needed by effort, pin_forces, delay')
    assert 'between motor and crank' in by_name['backlash']
    assert by_name['delay'].endswith('seconds 0.002 s')
    assert by_name['constant_rate'].endswith('rate 6.28 rad/s or m/s')
    said = [' '.join(line) for line in lines]
    assert 'ticks 500 a second' in said
    assert 'recorded no' in said
    assert 'stop freeze at 1, 2.5 s, for 0.5 s' in said
    assert 'publishes ~/pin_forces sensor_msgs/msg/MultiDOFJointState' in said
    assert not any(line.startswith('listens to') for line in said)


@pytest.mark.parametrize('path', SCENES, ids=lambda path: path.stem)
def test_json_of_every_shipped_scene_has_the_documented_keys(path, capsys):
    assert run(str(path), '--json') == 0
    account = json.loads(capsys.readouterr().out)
    assert set(account) == json_keys('scene')
    assert {'name': 'joint_states', 'type': JOINT_STATE_TYPE, 'what': 'publishes'} in account[
        'topics'
    ]


def test_json_of_a_scene_holds_each_stage_with_its_parameters(tmp_path, capsys):
    (tmp_path / 'scene.yaml').write_text(SCENE)
    assert run(str(tmp_path / 'scene.yaml'), '--json') == 0
    account = json.loads(capsys.readouterr().out)
    assert account['rate_hz'] == 500.0
    (linkage,) = account['linkages']
    stages = {stage['name']: stage for stage in linkage['stages']}
    assert stages['constant_rate']['parameters']['rate'] == 6.28
    assert stages['delay']['parameters']['seconds'] == 0.002
    assert stages['velocity']['needed_by'] == ['effort', 'pin_forces', 'delay']
    (fault,) = account['fault_parameters']
    assert (fault['kind'], fault['at_s'], fault['seconds']) == ('freeze', [1.0, 2.5], 0.5)
    assert account['services'] == ['~/inject/stop']


def test_json_describes_a_file_and_not_the_lists():
    with pytest.raises(LinkageError, match='--json: describes one file; name a scene'):
        run('--list', '--json')


BAD = f"""\
linkage: {FOUR_BAR}
rtae: 5
drive:
  topic: {{max_age: 0, mx_lead: 1}}
effects:
  velocty: {{}}
  delay:
    seconds: soon
  encoder: {{joints: {{rocker_joint: {{counts: 1.5}}}}}}
  noise: {{}}
faults: {{f: {{freeze: {{}}, at: [1, x]}}}}
loads:
  gravity: [0]
record: {{name: a/b}}
"""

BAD_SAID = [
    ":2: rtae: unknown key; did you mean 'rate'?",
    ':4: drive.topic.max_age: 0 is out of bounds; write a number, at least 1e-06 and at most 3600',
    ":4: drive.topic.mx_lead: unknown key; did you mean 'max_lead'?",
    ":6: effects.velocty: unknown key; did you mean 'velocity'?",
    ":8: effects.delay.seconds: 'soon' is not a number; write a number, at least 0 and at most ",
    ':9: effects.encoder.joints.rocker_joint.counts: 1.5 is not a whole number; write a whole ',
    ":10: effects.noise: the key 'joints' is missing; add joints: ",
    ":11: faults.f: the key 'seconds' is missing; add seconds",
    ":11: faults.f.at[2]: 'x' is not a number; write a number, at least 0",
    ':13: loads.gravity: [0] is too short; write 2 of them (gravity: [x, y] [m/s²])',
    ":14: record.name: 'a/b' does not fit; write a string on one line (name of the bag's folder;",
]


@needs_jsonschema
def test_everything_that_is_wrong_is_said_at_once(linkage: Run, tmp_path):
    (tmp_path / 'bad.yaml').write_text(BAD)
    answer = linkage('scene', 'bad.yaml')
    assert answer.returncode == 2
    assert answer.stdout == ''
    said = answer.stderr.splitlines()
    assert len(said) == len(BAD_SAID)
    for line, expected in zip(said, BAD_SAID, strict=True):
        assert line.startswith(f'linkage scene: bad.yaml{expected}')


def test_where_the_library_is_missing_the_first_thing_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(command, 'find_spec', lambda _name: None)
    (tmp_path / 'bad.yaml').write_text(BAD)
    with pytest.raises(FileError) as caught:
        run(str(tmp_path / 'bad.yaml'))
    assert 'drive.topic.max_age: 0 is out of bounds' in str(caught.value)


WRONG = [
    # the scene, the linkage, what is said
    (
        'linkage: l.yaml\n',
        'four_bar: {a: 0, b: 1, c: x}\n',
        [
            "l.yaml:1: four_bar: the key 'd' is missing; add d: ground [m]",
            'l.yaml:1: four_bar.a: 0 is out of bounds; write a number, more than 0 (crank [m]',
            "l.yaml:1: four_bar.c: 'x' is not a number; write a number, more than 0",
        ],
    ),
    (
        'linkage: l.yaml\n',
        'four_bar: {a: 1, b: 1, c: 1, d: 1}\nlinks: {}\n',
        ["l.yaml: 'links' does not fit; write units or angles or four_bar"],
    ),
    (
        'linkages:\n- {name: a, linkage: l.yaml}\n- {name: b, linkage: l.yaml, rate: 5}\n',
        'four_bar: {a: 1, b: 2, c: 2, d: 2}\n',
        ['s.yaml:3: linkages[2].rate: unknown key; known: beyond_limits, drive, ef'],
    ),
    (
        'linkage: l.yaml\nfaults: {a-b: {freeze: {}, silence: {}}}\n',
        'four_bar: {a: 1, b: 2, c: 2, d: 2}\n',
        [
            "s.yaml:2: faults: 'a-b' does not fit; write a string on one line (a name: letters",
            's.yaml:2: faults.a-b: names 2 kinds of fault; leave all but one of',
        ],
    ),
    (
        'drive: {topic: {}, sine: {amplitude: 1, frequency: 1}}\nlinkage: nowhere.yaml\n',
        '',
        ['s.yaml:1: drive: topic, sine cannot be combined; leave all but 1 out'],
    ),
    (
        'linkage: l.yaml\nsolver: table\n',
        'four_bar: {a: 1, b: 2, c: 2, d: 2}\n',
        ['s.yaml:2: solver: unknown key; known: angles, beyond_limits, drive, effects, '],
    ),
    ('linkage: nowhere.yaml\n', '', ["s.yaml:1: linkage: 'nowhere.yaml' is not a file; name one"]),
    ('rate: [\n', '', ['s.yaml:2: is not valid YAML']),
    (
        'linkage: l.yaml\neffects: {bias: {joints: {rocker_jont: 1}}}\n',
        'four_bar: {a: 1, b: 2, c: 2, d: 2}\n',
        ["s.yaml:2: effects.bias.joints.rocker_jont: there is no joint 'rocker_jont'; did you me"],
    ),
    (
        'linkage: l.yaml\neffects: {effort: {}}\n',
        'four_bar: {a: 1, b: 2, c: 2, d: 2}\n',
        ["l.yaml: masses: link 'crank' has no mass"],
    ),
    (
        'linkage: l.yaml\nrate: .nan\n',
        'four_bar: {a: 1, b: 2, c: 2, d: 2}\n',
        ['s.yaml:2: rate: nan is out of bounds'],
    ),
]


@needs_jsonschema
@pytest.mark.parametrize(('scene', 'drawn', 'said'), WRONG, ids=[row[2][0][:40] for row in WRONG])
def test_wrong_files_are_refused_in_a_line(linkage: Run, tmp_path, scene, drawn, said):
    (tmp_path / 's.yaml').write_text(scene)
    (tmp_path / 'l.yaml').write_text(drawn)
    answer = linkage('scene', 's.yaml')
    assert answer.returncode == 2
    assert answer.stdout == ''
    lines = answer.stderr.splitlines()
    assert len(lines) == len(said)
    for line, expected in zip(lines, said, strict=True):
        assert line.startswith(f'linkage scene: {expected}')


def test_the_list_has_everything(capsys):
    assert run('--list') == 0
    said = capsys.readouterr().out
    for what, registry in REGISTRIES.items():
        for name in registry:
            assert f'{what} {name}: ' in said


def test_the_list_tells_unit_default_bounds_and_meaning(capsys):
    assert run('--list', 'topic', 'tolerance', 'freeze') == 0
    topic, tolerance, freeze = capsys.readouterr().out.split('\n\n')
    title, heads, *_ = topic.splitlines()
    assert title.startswith('drive topic: ')
    assert heads.split() == ['parameter', 'unit', 'default', 'values', 'meaning']
    (age,) = [row for row in topic.splitlines() if row.startswith('max_age')]
    assert ' '.join(age.split()) == (
        'max_age s 0.2 1e-6 to 3600 age of the newest sample beyond which there is no crank'
    )
    assert 'carry_forward' in topic
    assert 'true or false' in topic
    assert 'links' in tolerance
    assert '  all  ' in tolerance
    assert 'given.LINK.POINT' in tolerance
    assert freeze.splitlines()[1] == 'no parameters'


@pytest.mark.parametrize(
    ('name', 'said'),
    [
        (
            'encodr',
            "--list encodr: there is no such drive, effect or fault; did you mean '",
        ),
        ('xyz', '--list xyz: there is no such drive, effect or fault; known: topic, '),
    ],
)
def test_a_name_that_is_none(name, said):
    with pytest.raises(LinkageError) as caught:
        run('--list', name)
    assert str(caught.value).startswith(said)


def test_every_parameter_has_a_unit_or_values_and_a_meaning():
    for what, registry in REGISTRIES.items():
        for name in registry:
            table = table_of(what, name)
            assert table_text(table).startswith(f'{what} {name}: ')
            declared = [field.name for field in fields(parameters_of(what, name))]
            rows = table.rows if declared else []
            # A parameter of parameters, as `motor`, has its own rows after it, with a dot.
            assert [row[0] for row in rows if '.' not in row[0]] == declared
            for _, _, _, values, meaning in rows:
                assert values
                assert meaning
                assert str(inf) not in values


@pytest.mark.parametrize('kind', ['scene', 'linkage'])
def test_the_schema_is_printed_as_it_is_published(kind, capsys):
    assert run('--schema', kind) == 0
    said = capsys.readouterr().out
    assert said == as_text(command.SCHEMAS[kind]())
    assert said == (CONFIG / 'schema' / f'{kind}.schema.json').read_text('utf-8')


@pytest.mark.parametrize(
    'typed', [(), ('x.yaml', '--list'), ('--schema', 'bag'), ('--list', '--schema', 'scene')]
)
def test_one_thing_at_a_time(typed, capsys):
    with pytest.raises(SystemExit) as caught:
        run(*typed)
    assert caught.value.code == 2
    assert 'usage:' in capsys.readouterr().err


@pytest.mark.parametrize('path', [FOUR_BAR, CONFIG / 'linkages/excavator_bucket.yaml'])
def test_a_linkage_file_is_shown_as_the_scene_that_it_stands_for(path, capsys):
    assert run(str(path)) == 0
    said = [' '.join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert said[0] == str(path)
    assert 'ticks 1000 a second' in said
    assert 'recorded no' in said
    stages = [line.split()[1] for line in said if line[:1].isdigit()]
    assert stages == ['constant_rate' if path == FOUR_BAR else 'sine', 'velocity']


@needs_jsonschema
def test_a_bad_linkage_file_is_one_by_the_schema_of_linkages(linkage: Run, tmp_path):
    (tmp_path / 'bad.yaml').write_text(
        'links: {ground: {A: 1}}\ntrcaed: []\njoints: {}\ninput: {joint: a, slider: b}\n'
    )
    answer = linkage('scene', 'bad.yaml')
    assert answer.returncode == 2
    said = answer.stderr.splitlines()
    assert [line.partition(':')[2].partition(';')[0] for line in said] == [
        ' bad.yaml:1: links.ground.A: 1 is not a list',
        ' bad.yaml:2: trcaed: unknown key',
        ' bad.yaml:3: joints: is empty',
    ]
