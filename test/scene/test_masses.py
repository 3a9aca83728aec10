# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""The masses of a linkage file: what they say, and one line for what they cannot."""

from __future__ import annotations

from linkage_ros.errors import FileError
from linkage_ros.kinematics.linkage import Mass
from linkage_ros.scene.linkage_file import read_linkage
from linkage_ros.scene.yaml_file import parse_yaml
import pytest

from .files import CONFIG, is_one_line

FILE = (CONFIG / 'linkages' / 'four_bar.yaml').read_text('utf-8')
BEFORE = FILE[: FILE.index('masses:')]
LINE = BEFORE.count('\n') + 1
CRANK = '{mass: 0.1, center: [0.02, 0], inertia: 1.0e-5}'


def masses_of(text):
    return read_linkage(parse_yaml(text.encode(), 'linkage.yaml')).masses


def test_masses_are_read_as_the_file_says():
    assert masses_of(f'{BEFORE}masses:\n  crank: {CRANK}\n') == {
        'crank': Mass(mass=0.1, center=(0.02, 0.0), inertia=1e-5)
    }


@pytest.mark.parametrize('masses', ['', 'masses: {}'])
def test_a_linkage_needs_none(masses):
    assert masses_of(BEFORE + masses) == {}


def test_a_point_mass_has_no_inertia():
    found = masses_of(f'{BEFORE}masses: {{crank: {{mass: 1, center: [0, 0], inertia: 0}}}}')
    assert found == {'crank': Mass(1.0, (0.0, 0.0), 0.0)}


@pytest.mark.parametrize(
    'file', ['four_bar', 'slider_crank', 'excavator_bucket', 'watt_1', 'stephenson_3']
)
def test_shipped_linkages_that_forces_can_move(file):
    linkage = read_linkage(parse_yaml((CONFIG / f'linkages/{file}.yaml').read_bytes(), file))
    assert {*linkage.masses} == {*linkage.links} - {'ground'}


# What stands after `masses: `, and what is said.
BAD = {
    'a list': ('[crank]', "masses: ['crank'] is not a mapping; write masses: {…}"),
    'a number': ('{crank: 0.1}', 'masses.crank: 0.1 is not a mapping; write crank: {…}'),
    'no such link': (
        f'{{krank: {CRANK}}}',
        "masses.krank: 'krank' is not a link; name one of coupler, crank, rocker",
    ),
    'the ground': (
        f'{{ground: {CRANK}}}',
        'masses.ground: the ground does not move; leave its mass out',
    ),
    'no mass': (
        '{crank: {center: [0, 0], inertia: 0}}',
        "masses.crank: the key 'mass' is missing; add mass: a number in [kg]",
    ),
    'a mass of zero': (
        '{crank: {mass: 0, center: [0, 0], inertia: 0}}',
        'masses.crank.mass: 0 is out of bounds; write a finite number, more than 0 and at most 1e',
    ),
    'a mass that is none': (
        '{crank: {mass: .nan, center: [0, 0], inertia: 0}}',
        'masses.crank.mass: nan is out of bounds;',
    ),
    'an inertia below zero': (
        '{crank: {mass: 1, center: [0, 0], inertia: -1e-9}}',
        'masses.crank.inertia: -1e-09 is out of bounds; write a finite number, at least 0 and at',
    ),
    'no inertia': (
        '{crank: {mass: 1, center: [0, 0]}}',
        "masses.crank: the key 'inertia' is missing; add inertia: a number in [kg·m²]",
    ),
    'a centre of three': (
        '{crank: {mass: 1, center: [0, 0, 0], inertia: 0}}',
        'masses.crank.center: [0, 0, 0] is not a point; write two finite numbers: [x, y]',
    ),
    'a key misspelt': (
        '{crank: {mass: 1, center: [0, 0], inertia: 0, inertai: 1}}',
        "masses.crank.inertai: unknown key; did you mean 'inertia'?",
    ),
}


@pytest.mark.parametrize('kind', BAD)
def test_bad_masses_are_refused_in_a_line(kind):
    text, expected = BAD[kind]
    with pytest.raises(FileError) as caught:
        masses_of(f'{BEFORE}masses: {text}\n')
    assert is_one_line(caught.value)
    assert str(caught.value).startswith(f'linkage.yaml:{LINE}: {expected}')
