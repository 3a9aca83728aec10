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
from linkage_ros.errors import FileError
from linkage_ros.kinematics import Limits, Mass
import pytest

from .conftest import CONFIG, is_one_line
from ..support.scenes import linkage_of, scene_of, symmetric_five_bar

# The masses of a linkage file: valid ones, and one line for invalid ones.


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


# The text after `masses: `, and the error.
BAD = {
    'a list': ('[crank]', "masses: ['crank'] is not a mapping; write masses: {crank: {}}"),
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
    'a mass below zero': (
        '{crank: {mass: -1e-9, center: [0, 0], inertia: 0}}',
        'masses.crank.mass: -1e-09 is out of bounds; write a finite number, at least 0 and at',
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
def test_what_an_input_may_say(name):
    said, limits = SAID[name]
    linkage = linkage_of(long(said))
    assert linkage.inputs[0].limits == limits
    assert linkage_of(linkage_text(linkage)) == linkage
    assert linkage_of(SHORT.replace('SAID', f'input: {{{said[2:]}}}')) == linkage


def test_what_a_published_joint_may_say():
    said = 'limits: [1, 2.1], velocity: 4, effort: 5'
    linkage = linkage_of(long(rocker=f', {said}'))
    assert linkage.joints['rocker_joint'].limits == Limits(1.0, 2.1, 4.0, 5.0)
    assert linkage.limits == {'rocker_joint': Limits(1.0, 2.1, 4.0, 5.0)}
    assert linkage_of(linkage_text(linkage)) == linkage
    assert linkage_of(SHORT.replace('SAID', f'joints: {{rocker_joint: {{{said}}}}}')) == linkage


def test_where_nothing_is_said_there_are_none():
    linkage = linkage_of(long())
    assert linkage.limits == {}
    assert linkage.inputs[0].limits == Limits(-inf, inf, inf, inf)
    assert 'limits' not in linkage_text(linkage)


START = 'pose: {inputs: [1.0]}\n'

# Text of the input, the rocker and the coupler, and the text after it; the error and its remedy.
REFUSED = {
    'one number': ([', limits: 3'], ':7: input.limits: 3 is not two numbers; write [low, high]'),
    'three': ([', limits: [1, 2, 3]'], ':7: input.limits: [1, 2, 3] is not two numbers; write'),
    'a text': ([', limits: wide'], ":7: input.limits: 'wide' is not two numbers; write"),
    'a list of texts': ([', limits: [a, b]'], ":7: input.limits: ['a', 'b'] is not two numbers;"),
    'not a number': ([', limits: [.nan, 1]'], ':7: input.limits: [nan, 1] is not two numbers;'),
    'crossing': (
        [', limits: [2, 1]'],
        ":7: input.limits: [2, 1] rad of 'crank_joint' cross; write [low, high]",
    ),
    'equal': ([', limits: [1, 1]'], ":7: input.limits: [1, 1] rad of 'crank_joint' are the same"),
    'both infinite above': (
        [', limits: [.inf, .inf]'],
        ":7: input.limits: [inf, inf] rad of 'crank_joint' are not valid limits; write ",
    ),
    'beyond machines': ([', limits: [0, 1e12]'], ':7: input.limits: [0, 1000000000000.0] is out'),
    'no rate': (
        [', velocity: 0'],
        ':7: input.velocity: 0 is out of bounds; write a finite number',
    ),
    'negative rate': (
        [', velocity: -1'],
        ':7: input.velocity: -1 is out of bounds; write a finit',
    ),
    'negative effort': ([', effort: -1'], ':7: input.effort: -1 is out of bounds; write a finite'),
    'misspelt': ([', limit: [0, 1]'], ":7: input.limit: unknown key; did you mean 'limits'?"),
    'a published angle on one side': (
        ['', ', limits: [1, .inf]'],
        ':11: joints.rocker_joint.limits: [1, inf] rad limits the angle on one side, and',
    ),
    'a published joint, crossing': (
        ['', ', limits: [2, 1]'],
        ":11: joints.rocker_joint.limits: [2, 1] rad of 'rocker_joint' cross; write",
    ),
    'the start is beyond': (
        [', limits: [1.5, 2]', '', '', START],
        ":12: pose.inputs: 1 rad is beyond the limits [1.5, 2] rad of 'crank_joint'; start within",
    ),
    'the start brings a joint beyond': (
        ['', ', limits: [1.5, 2]', '', START],
        ":12: pose.inputs: bring 'rocker_joint' to 1.11226 rad, beyond its limits [1.5, 2] rad",
    ),
    'never met by a joint': (
        ['', ', limits: [0.1, 0.2]'],
        " [0.1, 0.2] rad of 'rocker_joint' are never met: it goes from 0.958196 to 2.24593 rad",
    ),
    'never met by a joint while the input is within its own': (
        [', limits: [2, 2.5]', ', limits: [1, 1.2]'],
        ":11: joints.rocker_joint.limits: [1, 1.2] rad of 'rocker_joint' are never met: it goes",
    ),
    'never met together': (
        ['', ', limits: [0.95, 1]', ', limits: [-2, -1.9]'],
        ":9: joints: the limits of 'coupler_joint', 'rocker_joint' are met, but never together",
    ),
}


@pytest.mark.parametrize('name', REFUSED)
def test_limits_that_cannot_be_are_refused_in_a_line(name):
    said, expected = REFUSED[name]
    with pytest.raises(FileError) as error:
        linkage_of(long(*said))
    assert expected in str(error.value)
    assert is_one_line(error.value)


def test_limits_that_the_range_never_meets():
    text = 'four_bar: {a: 0.1, b: 0.07, c: 0.06, d: 0.05, input: {limits: [2.5, 3]}}'
    with pytest.raises(FileError) as error:
        linkage_of(text)
    assert str(error.value) == (
        "linkage.yaml:1: four_bar.input.limits: [2.5, 3] rad of 'crank_joint' never meet its "
        'range, -2.0264 to 2.0264 rad; widen them'
    )


def test_limits_of_several_inputs_that_nothing_meets():
    """The sides stand so that the pin between the two bars is out of reach."""
    text = symmetric_five_bar(', limits: [3.0, 3.3]', ', limits: [-0.1, 0.1]')
    with pytest.raises(FileError) as error:
        linkage_of(text)
    assert "no state was found within the limits of 'left_joint', 'right_joint'" in str(
        error.value
    )
    assert is_one_line(error.value)


LIMITED = SHORT.replace('SAID', 'input: {limits: [0, 1]}').encode()


def test_what_is_published_beyond_them_is_a_choice():
    assert not scene_of('', LIMITED).linkages[0].silent_beyond_limits
    assert not scene_of('beyond_limits: publish', LIMITED).linkages[0].silent_beyond_limits
    assert scene_of('beyond_limits: silent', LIMITED).linkages[0].silent_beyond_limits


SCENES = {
    'another word': (
        'beyond_limits: stop',
        LIMITED,
        "'stop' is not a choice; write publish or silent",
    ),
    'no limits': (
        'beyond_limits: silent',
        SHORT.replace(', SAID', '').encode(),
        ':2: beyond_limits: no joint of the linkage has limits; leave it out, or write limits:',
    ),
}


@pytest.mark.parametrize('name', SCENES)
def test_refused_in_a_scene(name):
    said, linkage, expected = SCENES[name]
    with pytest.raises(FileError) as error:
        scene_of(said, linkage)
    assert expected in str(error.value)
    assert is_one_line(error.value)
