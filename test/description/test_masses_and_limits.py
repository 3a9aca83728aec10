# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Masses and limits in linkage files."""

from math import inf

from linkage_ros.description import linkage_text, parse_yaml, read_linkage
from linkage_ros.kinematics import Limits, Mass
import pytest

from .conftest import CONFIG
from ..support.scenes import linkage_of, scene_of

# The masses of a linkage file: valid ones, and one line for invalid ones.


FILE = (CONFIG / 'linkages' / 'four_bar.yaml').read_text('utf-8')
BEFORE = FILE[: FILE.index('masses:')]
LINE = BEFORE.count('\n') + 1
CRANK = '{mass: 0.1, center: [0.02, 0], inertia: 1.0e-5}'


def masses_of(text):
    return read_linkage(parse_yaml(text.encode(), 'linkage.yaml')).masses


def test_masses_are_read_from_the_file():
    assert masses_of(f'{BEFORE}masses:\n  crank: {CRANK}\n') == {
        'crank': Mass(mass=0.1, center=(0.02, 0.0), inertia=1e-5)
    }


@pytest.mark.parametrize('masses', ['', 'masses: {}'])
def test_linkage_may_have_no_masses(masses):
    assert masses_of(BEFORE + masses) == {}


def test_point_mass_may_have_zero_inertia():
    found = masses_of(f'{BEFORE}masses: {{crank: {{mass: 1, center: [0, 0], inertia: 0}}}}')
    assert found == {'crank': Mass(1.0, (0.0, 0.0), 0.0)}


@pytest.mark.parametrize(
    'file', ['four_bar', 'slider_crank', 'excavator_bucket', 'watt_1', 'stephenson_3']
)
def test_gallery_linkages_with_masses_weigh_every_link(file):
    linkage = read_linkage(parse_yaml((CONFIG / f'linkages/{file}.yaml').read_bytes(), file))
    assert {*linkage.masses} == {*linkage.links} - {'ground'}


# Limits in linkage files: valid ones, refused ones, and that they are written again.


SHORT = 'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1, SAID}'

LONG = """
links:
  ground: {O2: [0, 0], O4: [0.1, 0]}
  crank: {O2: [0, 0], A: [0.04, 0]}
  coupler: {A: [0, 0], B: [0.12, 0]}
  rocker: {O4: [0, 0], B: [0.08, 0]}
input: {joint: crank_joint, parent: ground, child: crankINPUT}
assembly: {B: left}
joints:
  coupler_joint: {parent: crank, child: couplerCOUPLER}
  rocker_joint: {parent: ground, child: rockerROCKER}
"""


def long(driven='', rocker='', coupler='', more=''):
    text = LONG.replace('INPUT', driven).replace('ROCKER', rocker).replace('COUPLER', coupler)
    return text + more


SAID = {
    'all': (', limits: [0.5, 1.5], velocity: 2, effort: 3.5', Limits(0.5, 1.5, 2.0, 3.5)),
    'a range alone': (', limits: [0.5, 1.5]', Limits(0.5, 1.5)),
    'no range': (', velocity: 2', Limits(velocity=2.0)),
    'none below': (', limits: [-.inf, 1.5]', Limits(high=1.5)),
    'none above': (', limits: [0.5, .inf]', Limits(low=0.5)),
    'none at all': (', limits: [-.inf, .inf]', Limits()),
}


@pytest.mark.parametrize('name', SAID)
def test_input_limits_are_read_and_written(name):
    said, limits = SAID[name]
    linkage = linkage_of(long(said))
    assert linkage.inputs[0].limits == limits
    assert linkage_of(linkage_text(linkage)) == linkage
    assert linkage_of(SHORT.replace('SAID', f'input: {{{said[2:]}}}')) == linkage


def test_published_joint_limits_are_read_and_written():
    said = 'limits: [1, 2.1], velocity: 4, effort: 5'
    linkage = linkage_of(long(rocker=f', {said}'))
    assert linkage.joints['rocker_joint'].limits == Limits(1.0, 2.1, 4.0, 5.0)
    assert linkage.limits == {'rocker_joint': Limits(1.0, 2.1, 4.0, 5.0)}
    assert linkage_of(linkage_text(linkage)) == linkage
    assert linkage_of(SHORT.replace('SAID', f'joints: {{rocker_joint: {{{said}}}}}')) == linkage


def test_missing_limits_are_infinite():
    linkage = linkage_of(long())
    assert linkage.limits == {}
    assert linkage.inputs[0].limits == Limits(-inf, inf, inf, inf)
    assert 'limits' not in linkage_text(linkage)


LIMITED = SHORT.replace('SAID', 'input: {limits: [0, 1]}').encode()


def test_beyond_limits_option_selects_silence():
    assert not scene_of('', LIMITED).linkages[0].silent_beyond_limits
    assert not scene_of('beyond_limits: publish', LIMITED).linkages[0].silent_beyond_limits
    assert scene_of('beyond_limits: silent', LIMITED).linkages[0].silent_beyond_limits
