# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Keys with dots in their names, as those of points, set beside a scene's file."""

from linkage_ros.description import load_scene
from linkage_ros.errors import FileError
import pytest

from ..support.scenes import four_bar_text

FORCES = 'loads: {forces: {crank.A: {direction: [1, 0], constant: 5}}}'
PUSHED = '{direction: [0, 1], constant: 3}'


@pytest.fixture
def scene(tmp_path):
    """Return a function that writes a scene, and loads it with settings."""
    (tmp_path / 'linkage.yaml').write_text(four_bar_text(0.04, 0.12, 0.08, 0.1), 'utf-8')

    def load(text, *settings):
        file = tmp_path / 'scene.yaml'
        head = 'linkage: linkage.yaml\ndrive: {constant_rate: {rate: 1}}\n'
        file.write_text(f'{head}effects: {{velocity: {{}}}}\n{text}\n', 'utf-8')
        return load_scene(file, settings)

    return load


SET = {
    'a point that is there': (FORCES, ('loads.forces.crank.A.constant=7',), {'crank.A': 7.0}),
    'the same in quotes': (FORCES, ('loads.forces."crank.A".constant=7',), {'crank.A': 7.0}),
    'every part in quotes': (FORCES, ('"loads"."forces"."crank.A"."constant"=7',), {'crank.A': 7}),
    'a new point': (
        FORCES, (f'loads.forces."rocker.B"={PUSHED}',), {'crank.A': 5.0, 'rocker.B': 3.0},
    ),
    'a new point, and then a key of it': (
        '', (f'loads.forces."rocker.B"={PUSHED}', 'loads.forces.rocker.B.constant=4'),
        {'rocker.B': 4.0},
    ),
    'all points': (FORCES, (f'loads.forces={{rocker.B: {PUSHED}}}',), {'rocker.B': 3.0}),
}  # fmt: skip


@pytest.mark.parametrize('kind', SET)
def test_set_option_reaches_keys_with_dots(kind, scene):
    text, settings, expected = SET[kind]
    loaded = scene(text, *settings)
    (scene_linkage,) = loaded.linkages
    forces = scene_linkage.loads.applied.forces
    assert {name: force.constant for name, force in forces.items()} == expected
    # What a bag holds of the scene says the same by itself.
    assert b'--set' in loaded.files[next(iter(loaded.files))]


REFUSED = {
    'loads.forces.rocker.B.constant=7': "loads.forces.rocker: there is no point 'rocker'; did you",
    'loads.forces."crank.A".constat=7': 'loads.forces.crank.A.constat: unknown key; did you mean',
    'loads.forces."crank.A=7': 'is not a setting; write KEY=VALUE',
    'loads.forces."crank.A"x=7': 'is not a setting; write KEY=VALUE',
    'loads.forces."".x=7': 'is not a setting; write KEY=VALUE',
    'loads..forces=7': 'is not a setting; write KEY=VALUE',
    '.=7': 'is not a setting; write KEY=VALUE',
    '=7': 'is not a setting; write KEY=VALUE',
}


@pytest.mark.parametrize('setting', REFUSED)
def test_set_option_refuses_unknown_keys_in_one_line(setting, scene):
    with pytest.raises(FileError) as caught:
        scene(FORCES, setting)
    line = str(caught.value)
    assert line.startswith(f'--set {setting}: ')
    assert REFUSED[setting] in line
