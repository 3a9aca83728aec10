# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Each key of each grammar, left out, doubled or of a wrong type: the file is refused in one line.

The keys come from the schemas: the files below have to have all of them.
"""

from copy import deepcopy
from functools import partial
import json
from pathlib import Path
from random import Random

from linkage_ros.description import (
    linkage_schema,
    load_scene,
    parse_yaml,
    read_any_closure,
    scene_schema,
)
from linkage_ros.errors import FileError
import pytest
import yaml

from .conftest import CONFIG, is_one_line
from .test_damaged_files import at, damaged_places

WHOLE = {
    'space': """
units: mm
angles: degrees
points: {A: [40, 0, 0], B: [100, 20, 120], T: [0, 0, 50], S: [0, 300, 0], U: [0, 400, 0]}
links: {crank: [A], rod: [A, B], rocker: [B, T], ground: [S], cart: [U]}
hinges:
  crank_joint: {parent: ground, child: crank, at: [0, 0, 0], axis: [0, 0, 1], value: 0,
                limits: [-40, 40], velocity: 90, effort: 3}
  rocker_joint: {parent: ground, child: rocker, through: [T, S]}
  gear: {parent: ground, child: wheel, at: [0, 0, 0], axis: [0, 0, 1]}
slides: {way: {parent: ground, child: cart, axis: [0, 1, 0], value: 0, limits: [-9, 9],
               velocity: 9, effort: 9}}
struts: {leg: [S, U]}
ratios: {gear: {of: crank_joint, ratio: 2, offset: 0, also: {}}}
input: [crank_joint, leg]
joints: [rocker_joint, gear]
traced: [A]
""",
    'plane': """
units: mm
angles: degrees
axes: xz
links:
  ground: {O2: [0, 0], O4: [100, 0]}
  crank: {O2: [0, 0], A: [40, 0]}
  coupler: {A: [0, 0], B: [120, 0]}
  rocker: {O4: [0, 0], B: [80, 0]}
input: {joint: crank_joint, parent: ground, child: crank, limits: [0, 90], velocity: 9, effort: 9}
pose: {inputs: [30], points: {B: [120, 80]}}
joints:
  rocker_joint: {parent: ground, child: rocker, limits: [0, 180], velocity: 9, effort: 9}
  coupler_joint: {parent: crank, child: coupler, turns: -1}
ratios: {}
""",
    'geared': """
links:
  ground: {O2: [0, 0], O4: [0.1, 0], M: [0.2, 0]}
  crank: {O2: [0, 0], A: [0.04, 0]}
  coupler: {A: [0, 0], B: [0.12, 0]}
  rocker: {O4: [0, 0], B: [0.08, 0]}
  wheel: {M: [0, 0]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {B: left}
joints:
  rocker_joint: {parent: ground, child: rocker}
  wheel_joint: {parent: ground, child: wheel}
ratios: {wheel_joint: {of: crank_joint, ratio: -2, offset: 0.5}}
""",
    'four_bar': """
four_bar:
  {a: 0.04, b: 0.12, c: 0.08, d: 0.1, input: {limits: [0, 1], velocity: 9, effort: 9},
   pose: {inputs: [0.5], angles: {coupler: 0.4}, points: {}},
   joints: {rocker_joint: {limits: [0, 3], velocity: 9, effort: 9},
            coupler_joint: {limits: [-9, 9], velocity: 9, effort: 9}}}
""",
    'inverted': """
inverted_slider_crank:
  {a: 0.15, swivel: [0.25, 0.1], assembly: ahead, input: {limits: [0, 1], velocity: 9, effort: 9},
   pose: {inputs: [0.5], angles: {rod: 0.4}, points: {}},
   joints: {rod_joint: {limits: [-3, 3], velocity: 9, effort: 9},
            rod_slide: {limits: [-3, 3], velocity: 9, effort: 9}}}
""",
}
LOADS = """{gravity: [0, -9.81], drive_inertia: 0.1,
  efforts: {rocker_joint: {constant: 1, over_position: [[0, 1], [1, 2]],
                           over_rate: [[0, 1], [1, 2]], over_time: [[0, 1], [1, 2]]}},
  forces: {P: {constant: 1, direction: [0, 1], frame: world, over_position: [[0, 1], [1, 2]],
               over_rate: [[0, 1], [1, 2]], over_time: [[0, 1], [1, 2]]}},
  joint_springs: {rocker_joint: {stiffness: 1, free: 0, damping: 0.1}},
  springs: {s: {from: [ground, O2], to: [rocker, B], stiffness: 1, free_length: 0.1,
                damping: 0.1}},
  stops: {rocker_joint: {stiffness: 1, damping: 0.1}},
  wrenches: {w: {topic: x, point: P, frame: world, max_age: 1}}}"""
RECORD = """{compression: lz4, directory: ., flush_period: 1, keep_files: 2, min_free_bytes: 1,
  name: a, queue: 9, snapshot_bytes: 9000000, snapshot_seconds: 1, split_bytes: 1000000,
  split_seconds: 9}"""
SCENES = {
    'scene': f"""
linkage: linkage.yaml
units: m
angles: radians
rate: 100
seed: 2
prefix: a_
publish_input: true
robot_description: true
model_joints: true
beyond_limits: stop
loads: {LOADS}
record: {RECORD}
""",
    'scenes': f"""
linkages:
  - {{name: one, linkage: linkage.yaml, prefix: a_, publish_input: true, beyond_limits: stop,
      drive: {{}}, effects: {{}}, loads: {LOADS}}}
  - name: two
    linkage: {{urdf: robot.urdf, input: [m], at: {{m: 1}}, near: true, close: [a=b]}}
""",
    'robot': 'linkage: {urdf: robot.urdf, input: [m], at: {m: 1}, near: true, close: [a=b]}\n',
}
ROBOTS = Path(__file__).parents[1] / 'tools' / 'models' / 'robots'
TYPES = [None, True, -1, 1e300, float('nan'), '', 'nobody', [], [0], [[]], {}, {'nobody': 0}]


def schema_keys(schema, root, path=()):
    """Yield the path of each key of a schema; names are *."""
    if not isinstance(schema, dict):
        return
    while '$ref' in schema:
        schema = root['$defs'][schema['$ref'].rpartition('/')[2]]
    for key, inner in schema.get('properties', {}).items():
        yield (*path, key)
        yield from schema_keys(inner, root, (*path, key))
    yield from schema_keys(schema.get('additionalProperties'), root, (*path, '*'))
    for word in ('then', 'else', 'items'):
        yield from schema_keys(schema.get(word), root, path)
    for one in schema.get('anyOf', ()):
        yield from schema_keys(one, root, path)


def is_in(path, content):
    """Return whether content has a key at a path, in any of its names and list items."""
    if isinstance(content, list):
        return any(is_in(path, one) for one in content)
    if not path:
        return True
    if not isinstance(content, dict):
        return False
    key, *rest = path
    return any(is_in(rest, content[name]) for name in content if key in ('*', name))


GALLERY = {path.stem: path.read_text('utf-8') for path in (CONFIG / 'linkages').rglob('*.yaml')}
LINKAGES = {f'gallery {name}': text for name, text in GALLERY.items()} | WHOLE


@pytest.mark.parametrize('kind', ['then', 'else', 'scene'])
def test_sample_files_contain_every_schema_key(kind):
    root = scene_schema() if kind == 'scene' else linkage_schema()
    files = [*map(yaml.safe_load, (SCENES if kind == 'scene' else LINKAGES).values())]
    for path in set(schema_keys(root if kind == 'scene' else root[kind], root)):
        # Parameters of drives, effects and faults are drawn in test_schema.py.
        if not {'drive', 'effects', 'faults'}.intersection(path):
            assert any(is_in(path, content) for content in files), path


def flow(content, doubled=(), path=()):
    """Return a content as YAML in one line, with one key twice."""
    if isinstance(content, dict):
        keys = [key for key in content for _ in range(2 if (*path, key) == doubled else 1)]
        inner = (f'{json.dumps(key)}: {flow(content[key], doubled, (*path, key))}' for key in keys)
        return f'{{{", ".join(inner)}}}'
    if isinstance(content, list):
        return f'[{", ".join(flow(one, doubled, (*path, n)) for n, one in enumerate(content))}]'
    return {'nan': '.nan', 'inf': '.inf'}.get(str(content)) or json.dumps(content)


def damaged(content, within=()):
    """Yield texts of a content with each key left out, doubled, and of wrong types."""
    random = Random(48)
    for path in damaged_places(content):
        if path[: len(within)] != within:
            continue
        *above, last = path
        if isinstance(last, int) or above[:3] == ['linkages', 0, 'loads']:
            continue
        changed = deepcopy(content)
        at(changed, tuple(above)).pop(last)
        yield path, flow(changed)
        if not any(isinstance(part, int) for part in path):
            yield path, flow(content, path)
        for wrong in random.sample(TYPES, 2):
            changed = deepcopy(content)
            at(changed, tuple(above))[last] = wrong
            yield path, flow(changed)


def refusal(read):
    """Return how a file is refused; None if it is not."""
    try:
        read()
    except FileError as error:
        return error


def read_text(text):
    return read_any_closure(parse_yaml(text.encode(), 'file.yaml'))


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('name', 'within'), [*((name, ()) for name in WHOLE), ('gallery hexapod', ('balls',))]
)
def test_linkage_with_damaged_keys_is_refused_in_one_line(name, within):
    read_any_closure(parse_yaml(LINKAGES[name].encode(), 'file.yaml'))
    for path, text in damaged(yaml.safe_load(LINKAGES[name]), within):
        error = refusal(partial(read_text, text))
        assert error is None or is_one_line(error), (path, str(error))


@pytest.mark.parametrize('name', SCENES)
def test_scene_with_damaged_keys_is_refused_in_one_line(name, tmp_path):
    (tmp_path / 'linkage.yaml').write_text(GALLERY['four_bar'], 'utf-8')
    robot = ROBOTS / 'four_bar.urdf'
    (tmp_path / 'robot.urdf').write_bytes(robot.read_bytes())
    file = tmp_path / 'scene.yaml'
    for path, text in damaged(yaml.safe_load(SCENES[name])):
        file.write_text(text, 'utf-8')
        error = refusal(lambda: load_scene(file))
        assert error is None or is_one_line(error), (path, str(error))


@pytest.mark.parametrize('name', ['rssr', 'bennett', 'spatial_slider_crank', 'hooke_joint'])
def test_missing_input_error_names_a_joint_that_drives(name):
    content = yaml.safe_load(LINKAGES[f'gallery {name}'])
    del content['input']
    content.pop('joints', None)
    with pytest.raises(FileError, match=r"^file.yaml: the key 'input' is missing; add") as caught:
        read_text(flow(content))
    key, joint = caught.value.remedy.removeprefix('add ').split(': ')
    read_text(flow(content | {key: joint}))


SPATIAL = [name for name, text in LINKAGES.items() if 'points' in yaml.safe_load(text)]


@pytest.mark.parametrize('name', SPATIAL)
def test_misspelt_joint_link_error_suggests_the_name(name):
    content, random = yaml.safe_load(LINKAGES[name]), Random(name)
    links = {'ground', *content.get('links', {})}
    ends = [path for path in damaged_places(content) if path[-1] in ('parent', 'child')]
    geared = {*content.get('ratios', {}), *(of['of'] for of in content.get('ratios', {}).values())}
    for path in ends:
        link = at(content, path)
        if link not in links or len(link) < 4 or path[1] in geared:
            continue
        changed, place = deepcopy(content), random.randrange(len(link))
        typo = ''.join(letter for k, letter in enumerate(link) if k != place)
        if typo in links:
            continue
        at(changed, path[:-1])[path[-1]] = typo
        error = refusal(partial(read_text, flow(changed)))
        assert error.key == '.'.join(path)
        assert error.remedy.startswith('did you mean '), error


STEWART = """
points: {A: [0, 0, 0], B: [1, 0, 0], C: [0, 1, 0], P: [0, 0, 1], Q: [1, 0, 1], R: [0, 1, 1]}
links: {base: [A, B, C], top: [P, Q, R]}
struts: {a: [A, P], b: [B, P], c: [B, Q], d: [C, Q], e: [C, R], f: [A, R]}
input: [a, b, c, d, e, f]
"""


@pytest.mark.parametrize(
    ('base', 'reason', 'remedy'),
    [
        ('base', 'no link is called ground', 'call the one that stands still ground'),
        ('ground', 'is held by one ball at most, and free', 'hang it on three slides and a ball'),
    ],
)
def test_strut_platform_error_names_the_missing_ground(base, reason, remedy):
    text = STEWART.replace('base', base)
    with pytest.raises(FileError, match=f'{reason}; .*{remedy}'):
        read_any_closure(parse_yaml(text.encode(), 'x'))
