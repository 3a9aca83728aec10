# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The JSON Schemas say what the strict reader takes: of shipped files, bad files, random ones."""

from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
import json
from math import pi
from pathlib import Path
from typing import Any

from hypothesis import given, HealthCheck, settings, strategies as st
from linkage_ros.description import (
    as_text,
    choice,
    ChoiceOf,
    declared_fields,
    Each,
    each_part,
    File,
    file,
    Flag,
    flag,
    KINDS,
    linkage_schema,
    load_scene,
    Name,
    NameOrNames,
    NamesOf,
    Number,
    number,
    number_list,
    number_rows,
    NumberList,
    parameter_section,
    parameter_types,
    ParameterGroup,
    parameters_schema,
    parse_scene,
    parse_yaml,
    part_name,
    part_names,
    Point,
    point,
    read_parameters,
    RowsOf,
    scene_schema,
    Section,
    text,
    TextOf,
    Units,
    whole_number,
)
from linkage_ros.errors import FileError
from linkage_ros.stages.drives import DRIVES
from linkage_ros.stages.effects import EFFECTS
from linkage_ros.stages.faults import FAULTS
import pytest
import yaml

from .conftest import CONFIG

Validator = pytest.importorskip('jsonschema').Draft202012Validator
SCENES = sorted((CONFIG / 'scenes').glob('*.yaml'))
LINKAGES = sorted((CONFIG / 'linkages').glob('*.yaml'))
SCHEMAS = {'scene': scene_schema, 'linkage': linkage_schema}


@pytest.fixture(scope='module')
def valid():
    """Return a function that says whether contents are valid, by the kind of file."""
    validators = {kind: Validator(schema()) for kind, schema in SCHEMAS.items()}
    return lambda kind, content: validators[kind].is_valid(content)


def content_of(data: bytes) -> Any:
    return parse_yaml(data, 'file').mapping


@pytest.mark.parametrize('kind', SCHEMAS)
def test_schema_is_valid_json_schema(kind):
    schema = SCHEMAS[kind]()
    assert schema['$schema'] == 'https://json-schema.org/draft/2020-12/schema'
    Validator.check_schema(schema)


@pytest.mark.parametrize('kind', SCHEMAS)
def test_published_schema_file_equals_the_code(kind):
    published = (CONFIG / 'schema' / f'{kind}.schema.json').read_text('utf-8')
    assert published == as_text(SCHEMAS[kind]()), 'run make schema'


@pytest.mark.parametrize('path', SCENES + LINKAGES, ids=lambda path: path.stem)
def test_a_shipped_file_is_valid_and_names_its_schema(path, valid):
    kind = path.parent.name.removesuffix('s')
    data = path.read_bytes()
    assert valid(kind, content_of(data))
    first, _, _ = data.decode().partition('\n')
    assert first == f'# yaml-language-server: $schema=../schema/{kind}.schema.json'
    assert (path.parent / first.partition('=')[2]).is_file()


def test_schema_lists_all_drives_effects_and_faults():
    schema = scene_schema()
    own = schema['$defs']
    assert list(own['drive']['properties']) == list(DRIVES)
    assert list(own['effects']['properties']) == list(EFFECTS)
    fault = schema['properties']['faults']['additionalProperties']['properties']
    assert list(fault) == [*FAULTS, 'at', 'seconds']
    for types in (parameter_types(DRIVES), parameter_types(EFFECTS), FAULTS):
        for of in types.values():
            assert list(parameters_schema(of)['properties']) == [
                f.name for f, _ in declared_fields(of)
            ]


def test_schema_mappings_allow_no_unknown_keys():
    def mappings(schema):
        if isinstance(schema, dict):
            if schema.get('type') == 'object':
                yield schema
            for inner in schema.values():
                yield from mappings(inner)
        elif isinstance(schema, list):
            for inner in schema:
                yield from mappings(inner)

    for schema in (scene_schema(), linkage_schema()):
        found = list(mappings(schema))
        assert len(found) > 10
        for one in found:
            # Either keys are known, or they are names and their values are.
            assert one['additionalProperties'] is False or 'properties' not in one
            assert one['additionalProperties'] != {}


@pytest.mark.parametrize(
    'scene',
    [
        'linkages: {name: a, linkage: linkage.yaml}',
        'seed: 2\nlinkages: [{name: a, linkage: linkage.yaml, effects: {velocity: {}}}]',
        'linkage: linkage.yaml\nrate: 0',
        'linkage: linkage.yaml\nrate: 0.01\nseed: 5.0\nrecord: {name: ""}',
        'linkage: linkage.yaml\nrecord: {keep_files: 0, split_bytes: 0, split_seconds: 0}',
        'linkage: linkage.yaml\nrecord: {keep_files: 2}',
        'linkage: linkage.yaml\nrecord: {keep_files: 2, split_bytes: 0, split_seconds: 9}',
        'linkage: linkage.yaml\nrecord: {keep_files: 2, split_seconds: 1, min_free_bytes: 1}',
        'linkage: linkage.yaml\nrecord: {keep_files: 1, split_bytes: 1.0e6, compression: lz4}',
        'linkage: linkage.yaml\nrecord: {snapshot_seconds: 0.5, snapshot_bytes: 1.0e7}',
        'linkage: linkage.yaml\nrecord: {snapshot_seconds: 30, split_bytes: 0, keep_files: 0}',
        'linkage: linkage.yaml\nrecord: {snapshot_seconds: 0, split_seconds: 1, queue: 100}',
        'linkage: linkage.yaml\nrecord: {snapshot_seconds: 9, compression: lz4, name: a}',
        'linkage: linkage.yaml\nfaults: {f: {freeze: {}, at: [0, 1], seconds: 0.5}}',
        'linkage: linkage.yaml\nfaults: {f: {freeze: {}, at: []}}',
        'linkage: linkage.yaml\ndrive: {}\neffects: {}',
    ],
)
def test_schema_accepts_valid_scenes(scene, build, valid):
    build(scene.encode())
    assert valid('scene', content_of(scene.encode()))


ODD = [
    None, True, 0, -1, 1e-300, 1e300, 10**400, '', 'left', 'ground', 'O2', 'crank', [], [0, 0],
    [1e9, -1e9], [True, 0], {}, {'O2': [0, 0]}, [[0]], '\0', 'é',
]  # fmt: skip


def places(content: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the path of each key, through lists too."""
    for key, value in content.items() if isinstance(content, dict) else enumerate(content):
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from places(value, (*path, key))


def files_of(path: Path) -> dict[str, Any]:
    """Return the contents of a scene's files, as a bag names them."""
    scene = yaml.safe_load(path.read_bytes())
    entries = scene.get('linkages', [scene])
    linkages = [yaml.safe_load((path.parent / one['linkage']).read_bytes()) for one in entries]
    return {'scene.yaml': scene} | {f'linkage_{i}.yaml': one for i, one in enumerate(linkages)}


@cache
def shipped() -> list[dict[str, Any]]:
    """Return the contents of the files of all shipped scenes."""
    return [files_of(path) for path in SCENES]


@given(data=st.data())
def test_schema_accepts_all_files_the_reader_accepts(data, valid):
    contents = deepcopy(data.draw(st.sampled_from(shipped())))
    damaged = contents[data.draw(st.sampled_from(sorted(contents)))]
    for _ in range(data.draw(st.integers(1, 2))):
        *path, key = data.draw(st.sampled_from(sorted(places(damaged), key=str) or [('x',)]))
        parent = damaged
        for part in path:
            parent = parent[part]
        if data.draw(st.booleans()) or isinstance(parent, list):
            parent[key] = deepcopy(data.draw(st.sampled_from(ODD)))
        else:
            parent.pop(key, None)
    files = {name_: yaml.safe_dump(content).encode() for name_, content in contents.items()}
    try:
        parse_scene('damaged', 'bag', files)
    except FileError:
        return
    for name_, text_ in files.items():
        assert valid(name_.partition('_')[0].partition('.')[0], content_of(text_)), name_


@dataclass(frozen=True, slots=True)
class One:
    """Of each."""

    size: float = number('how large', unit='kg', above=0.0, most=2.0)
    loud: bool = flag('whether it is', False)


@dataclass(frozen=True, slots=True)
class Within:
    """Within others."""

    depth: int = whole_number('how deep', 3, least=1, most=9)


@dataclass(frozen=True, slots=True)
class AllKinds:
    """Parameters of every kind."""

    must: float = number('that must be there', unit='s', least=-1.0, most=1.0)
    table: tuple[tuple[float, ...], ...] = number_rows(
        'a table', ('time [s]', 'load [N]'), most=5.0
    )
    path: str = file('where')
    ones: Mapping[str, One] = each_part('of each', 'pin', One, required=True)
    count: int = whole_number('that is whole', 1, least=0, most=100)
    some: tuple[float, ...] = number_list('some', (), most=10.0)
    on: bool = flag('whether', True)
    word: str = choice('which', ('one', 'other'), 'one')
    title: str = text('what it is called', 'none')
    place: tuple[float, float] = point('where', (0.0, 0.0), unit='N', most=3.0)
    joint: str = part_name('which', 'joint', 'rocker')
    joints: tuple[str, ...] = part_names('which', 'joint')
    gains: Mapping[str, float] = each_part('of each', 'joint', Number('gain', '', least=0.0))
    shifts: Mapping[str, Any] = each_part('of each', 'link', Point('[x, y]', 'N', 1.0))
    within: Within = parameter_section('further', Within)  # noqa: RUF009 (a field)


PARTS = dict.fromkeys(KINDS, ('rocker', 'crank'))
STRANGE = st.sampled_from(
    [None, True, -7, 7, 0.5, '', 'rocker', [], [1], [1, 2, 3], {}, {'rocker': 'x'}]
)
FINITE = st.floats(-12.0, 12.0) | st.integers(-12, 12) | st.just(1e300)


def values_of(kind: Any) -> st.SearchStrategy[Any]:
    """Return values of which about half are what a kind of parameter takes."""
    part = st.sampled_from(['rocker', 'crank'])
    pair = st.lists(FINITE, min_size=1, max_size=3)
    match kind:
        case Number():
            good = FINITE
        case NumberList():
            good = st.lists(FINITE, max_size=3)
        case RowsOf():
            width = len(kind.columns)
            good = st.lists(st.lists(FINITE, min_size=width, max_size=width), max_size=3)
        case Flag():
            good = st.booleans()
        case ChoiceOf():
            good = st.sampled_from([*kind.words, 'neither'])
        case TextOf() | File():
            good = st.sampled_from(['a b', 'ü', 'a\nb', '\u2028', '\xa0', '0'])
        case Point():
            good = pair
        case Name():
            good = part
        case NameOrNames():
            good = part | st.lists(part, max_size=3)
        case NamesOf():
            good = st.lists(part | st.just(''), max_size=2)
        case ParameterGroup():
            good = contents_of(kind.of)
        case Each():
            inner = contents_of(kind.of) if isinstance(kind.of, type) else values_of(kind.of)
            good = st.dictionaries(part, inner, max_size=2)
    return st.one_of(good, good, good, STRANGE)


def contents_of(of: Any) -> st.SearchStrategy[dict[str, Any]]:
    """Return contents of a section of such parameters, most of them near what it takes."""
    required = {entry.name: values_of(kind) for entry, kind in declared_fields(of)}
    whole_section = st.fixed_dictionaries({}, optional=required)
    stranger = st.sampled_from([{}, {}, {}, {'stranger': 1}])
    return st.builds(lambda content, more: content | more, whole_section, stranger)


TYPES = {
    'all kinds': AllKinds,
    **{
        f'{what} {name_}': of
        for what, types in (
            ('drive', parameter_types(DRIVES)),
            ('effect', parameter_types(EFFECTS)),
            ('fault', FAULTS),
        )
        for name_, of in types.items()
    },
}


def reads(content: dict[str, Any], of: Any) -> bool:
    try:
        # A schema has the bounds of the smallest units.
        section = Section('scene.yaml', '', content, units=Units('mm', 'degrees', slides=True))
        read_parameters(section, of, PARTS)
    except FileError:
        return False
    return True


@pytest.mark.sample(5)
@pytest.mark.parametrize('what', TYPES)
def test_schema_and_reader_accept_the_same_parameters(what):
    of = TYPES[what]
    validator = Validator(parameters_schema(of))

    @settings(
        max_examples=200 if of is AllKinds else 60,
        deadline=None,
        suppress_health_check=[HealthCheck.too_slow],
    )
    @given(contents_of(of))
    def same(content):
        assert validator.is_valid(content) == reads(content, of)

    same()


GOOD = {
    'must': 0.5, 'table': [[0, 1], [1, 2.5]], 'path': 'a.csv', 'ones': {'rocker': {'size': 2}},
}  # fmt: skip


@pytest.mark.parametrize(
    ('change', 'taken'),
    [
        ({}, True),
        ({'must': 1.0}, True),
        ({'must': 1.0000001}, False),
        ({'must': True}, False),
        ({'count': 100}, True),
        ({'count': 7.0}, True),
        ({'count': 7.5}, False),
        ({'count': 101}, False),
        ({'table': []}, False),
        ({'table': [[0, 1], [1]]}, False),
        ({'table': [[0, 6]]}, False),
        ({'some': [-10, 10]}, True),
        ({'some': [-10.5]}, False),
        ({'word': 'other'}, True),
        ({'word': 'third'}, False),
        ({'title': ''}, False),
        ({'place': [-3, 3]}, True),
        ({'place': [3.5, 0]}, False),
        ({'place': [0, 0, 0]}, False),
        ({'joints': []}, True),
        ({'joints': ['']}, False),
        ({'gains': {}}, True),
        ({'gains': {'rocker': -1}}, False),
        ({'shifts': {'crank': [1, -1]}}, True),
        ({'shifts': {'crank': [1, -2]}}, False),
        ({'ones': {}}, True),
        ({'ones': {'rocker': {}}}, False),
        ({'ones': {'rocker': {'size': 0}}}, False),
        ({'within': {}}, True),
        ({'within': {'depth': 10}}, False),
        ({'within': {'width': 1}}, False),
        ({'stranger': 1}, False),
    ],
    ids=str,
)
def test_schema_and_reader_agree_on_parameter_declarations(change, taken):
    content = GOOD | change
    assert Validator(parameters_schema(AllKinds)).is_valid(content) == taken
    assert reads(content, AllKinds) == taken


def test_schema_describes_unit_bounds_and_default():
    said = parameters_schema(AllKinds)
    assert said['description'] == 'Parameters of every kind.'
    assert said['required'] == ['must', 'table', 'path', 'ones']
    assert said['properties']['must'] == {
        'description': 'that must be there [s]', 'type': 'number', 'minimum': -1, 'maximum': 1,
    }  # fmt: skip
    assert said['properties']['ones']['additionalProperties']['properties']['size'] == {
        'description': 'how large [kg]', 'type': 'number', 'maximum': 2, 'exclusiveMinimum': 0,
    }  # fmt: skip
    defaults = {key: value.get('default') for key, value in said['properties'].items()}
    assert defaults == {
        'must': None, 'count': 1, 'some': [], 'table': None, 'on': True, 'word': 'one',
        'title': 'none', 'path': None, 'place': [0.0, 0.0], 'joint': 'rocker', 'joints': [],
        'gains': {}, 'shifts': {}, 'ones': None, 'within': {'depth': 3},
    }  # fmt: skip


def test_schema_bounds_cover_every_file_unit():
    one = Number('where', 'rad/s or m/s', least=-0.5, most=2.0).json_schema()
    assert (one['minimum'], one['maximum']) == (-500, 2000)  # [mm/s]
    one = Number('where', 'rad', least=0.0, most=0.5 * pi).json_schema()
    assert (one['minimum'], one['maximum']) == (0, 90)  # [deg]


def test_every_shipped_scene_loads():
    # That a file is valid says nothing if nobody reads it.
    for path in SCENES:
        assert load_scene(path).linkages
    assert json.loads(as_text(scene_schema()))['title'] == 'Scene'


def test_schema_refuses_backlash_beside_a_torque_drive(valid):
    play, torque = {'backlash': {'play': 0.1}}, {'torque': {}}
    here = {'linkage': 'l', 'drive': torque, 'effects': play}
    assert not valid('scene', here)
    assert valid('scene', {**here, 'drive': {'sine': {'amplitude': 1, 'frequency': 1}}})
    assert valid('scene', {**here, 'effects': {}})
    one = {'name': 'a', **here}
    assert not valid('scene', {'linkages': [one]})
    # What the scene says for all, each linkage may say otherwise: the reader decides there.
    other = {'name': 'a', 'linkage': 'l', 'effects': {}}
    assert valid('scene', {'linkages': [other], 'drive': torque, 'effects': play})
