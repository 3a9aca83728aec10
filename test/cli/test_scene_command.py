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
import json
from math import inf
from pathlib import Path
from threading import Event

from linkage_ros.cli import parameters_of, REGISTRIES, scene as command, table_of, table_text
from linkage_ros.description import as_text
from linkage_ros.messages import JOINT_STATE_TYPE
import pytest

from .conftest import json_keys

CONFIG = Path(__file__).parents[2] / 'config'
SCENES = sorted((CONFIG / 'scenes').glob('*.yaml'))
FOUR_BAR = CONFIG / 'linkages' / 'four_bar.yaml'


def run(*typed: str) -> int:
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return command.run(parser.parse_args(typed), Event())


@pytest.mark.sample(5)
@pytest.mark.parametrize('path', SCENES, ids=lambda path: path.stem)
def test_scene_json_has_the_documented_keys(path, capsys):
    assert run(str(path), '--json') == 0
    account = json.loads(capsys.readouterr().out)
    assert set(account) == json_keys('scene')
    assert {'name': 'joint_states', 'type': JOINT_STATE_TYPE, 'what': 'publishes'} in account[
        'topics'
    ]


def test_every_parameter_has_values_and_a_meaning():
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
def test_printed_schema_equals_the_published_schema(kind, capsys):
    assert run('--schema', kind) == 0
    said = capsys.readouterr().out
    assert said == as_text(command.SCHEMAS[kind]())
    assert said == (CONFIG / 'schema' / f'{kind}.schema.json').read_text('utf-8')


@pytest.mark.parametrize(
    'typed', [(), ('x.yaml', '--list'), ('--schema', 'bag'), ('--list', '--schema', 'scene')]
)
def test_scene_command_refuses_two_requests_at_once(typed, capsys):
    with pytest.raises(SystemExit) as caught:
        run(*typed)
    assert caught.value.code == 2
    assert 'usage:' in capsys.readouterr().err
