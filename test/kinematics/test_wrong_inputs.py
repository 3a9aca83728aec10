# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Linkages and inputs that are refused, in one line."""

from collections.abc import Callable
from copy import deepcopy
from math import inf, nan
import re
from typing import Any, NamedTuple

from linkage_ros.errors import DefinitionError, LinkageError
from linkage_ros.kinematics import (
    AssemblyPose,
    Closure,
    Input,
    Linkage,
    RevoluteJoint,
    SlideJoint,
    Slider,
    Status,
)
import numpy as np
import pytest

from .linkages import (
    class_3_linkage,
    four_bar_linkage,
    inverted_slider_crank_linkage,
    scotch_yoke_linkage,
)
from .test_gallery import closure_of as shipped

# Invalid inputs: one line that names the input, or a state without a pose; never a wrong pose.


ONE, TWO = shipped('four_bar'), shipped('five_bar')
NAMES = 'left_crank_joint, right_crank_joint'


@pytest.mark.parametrize('value', [nan, inf, -inf])
def test_an_input_that_is_not_finite_has_no_pose(value):
    for position in (ONE.position(value), TWO.position(1.0, value), TWO.position(value, 1.0)):
        assert (position.status, position.gap, position.joints) == (Status.INDETERMINATE, 0.0, ())
    batch = ONE.solve([0.5, value])
    assert [list(Status)[code] for code in batch.status] == [Status.CLOSED, Status.INDETERMINATE]


@pytest.mark.parametrize(('call', 'kind', 'text'), [
    (ONE.position, ValueError, 'inputs: 0 given; give 1: crank_joint'),
    (lambda: ONE.position(1.0, 2.0), ValueError, 'inputs: 2 given; give 1: crank_joint'),
    (lambda: TWO.position(1.0), ValueError, f'inputs: 1 given; give 2: {NAMES}'),
    (lambda: ONE.position('a'), TypeError, "inputs: 'a' is not a number; solve() takes arrays"),
    (
        lambda: ONE.position([1.0, 2.0]), TypeError,
        'inputs: [1.0, 2.0] is not a number; solve() takes arrays',
    ),
    (
        lambda: ONE.position(np.ones(2)), TypeError,
        'inputs: array([1., 1.]) is not a number; solve() takes arrays',
    ),
    (ONE.solve, ValueError, 'inputs: 0 given; give 1, one for each driven joint'),
    (
        lambda: ONE.solve(['a']), TypeError,
        "inputs: 'a' is not a number",
    ),
])  # fmt: skip
def test_what_is_no_input(call, kind, text):
    with pytest.raises(kind, match=f'^{re.escape(text)}$'):
        call()


@pytest.mark.parametrize(
    ('given', 'kind', 'text'),
    [
        ((), ValueError, '{what}: 0 given; give 1: crank_joint'),
        ((1.0, 2.0), ValueError, '{what}: 2 given; give 1: crank_joint'),
        ((nan,), ValueError, '{what}: [nan] is not finite'),
        ((-inf,), ValueError, '{what}: [-inf] is not finite'),
        (('a',), TypeError, "{what}: 'a' is not a number; solve() takes arrays"),
    ],
)
def test_what_is_no_rate_and_no_acceleration(given, kind, text):
    position = ONE.position(1.0)
    velocity = ONE.velocity(position, 1.0)
    with pytest.raises(kind, match=f'^{re.escape(text.format(what="rates"))}$'):
        ONE.velocity(position, *given)
    with pytest.raises(kind, match=f'^{re.escape(text.format(what="accelerations"))}$'):
        ONE.acceleration(position, velocity, *given)


def test_a_position_without_rates_has_none():
    closure = shipped('double_rocker')
    end = closure.input_ranges[0].highest
    for value, status in ((end, 'toggle'), (end + 0.1, 'open'), (nan, 'indeterminate')):
        position = closure.position(value)
        assert position.status.value == status
        text = f'rates: a linkage that is {status} has none; check its status'
        with pytest.raises(ValueError, match=f'^{text}$'):
            closure.velocity(position, 1.0)


# A linkage that cannot be built is refused in one line with place, reason and remedy.
Fields = dict[str, Any]
Change = Callable[[Fields], None]


def fields(linkage: Linkage) -> Fields:
    """Return the fields of a linkage, which may be changed."""
    return {
        'links': {name: dict(points) for name, points in linkage.links.items()},
        'inputs': linkage.inputs,
        'assembly': dict(linkage.assembly),
        'joints': dict(linkage.joints),
        'sliders': dict(linkage.sliders),
        'traced': linkage.traced,
        'pose': linkage.pose,
    }


def put(*path_and_value: Any) -> Change:
    """Return a change that sets a value, given its path."""
    *path, last, value = path_and_value

    def change(linkage: Fields) -> None:
        for key in path:
            linkage = linkage[key]
        linkage[last] = value

    return change


def drop(*path: str) -> Change:
    """Return a change that removes what stands at a path."""

    def change(linkage: Fields) -> None:
        for key in path[:-1]:
            linkage = linkage[key]
        del linkage[path[-1]]

    return change


def rename(old: str, new: str) -> Change:
    """Return a change that gives a link another name."""

    def change(linkage: Fields) -> None:
        linkage['links'] = {new if k == old else k: v for k, v in linkage['links'].items()}

    return change


FOUR_BAR = fields(four_bar_linkage((0.04, 0.12, 0.08, 0.1), 'left'))
SLIDER_CRANK = fields(inverted_slider_crank_linkage((0.15, 0.27, 0.0), 'ahead', along=0.3))
CLASS_3 = fields(class_3_linkage())
YOKE = fields(scotch_yoke_linkage(0.04))


def swivel(**changes: Any) -> Change:
    """Return a change of the slider-crank's slider."""
    parts = {'point': 'C', 'along': 'rod', 'through': 'T', 'direction': (1.0, 0.0)} | changes
    return put('sliders', 'swivel', Slider(**parts))


class Fault(NamedTuple):
    """A sound linkage, what makes it malformed, the key that the error names, its remedy."""

    linkage: Fields
    change: Change
    key: str
    remedy: str


MALFORMED = {
    'no ground': Fault(FOUR_BAR, rename('ground', 'frame'), 'links', "name the frame 'ground'"),
    'no input': Fault(FOUR_BAR, put('inputs', ()), 'input', 'name the driven joint'),
    'an input between links without a pin': Fault(
        FOUR_BAR, put('inputs', (Input('crank_joint', 'rocker', 'crank'),)), 'links.crank',
        "name the pin about which 'crank_joint' turns on both"
    ),
    'an input of an unknown link': Fault(
        FOUR_BAR, put('inputs', (Input('crank_joint', 'ground', 'krank'),)), 'input.child',
        'name one of coupler, crank, ground, rocker'
    ),
    'an input of a link against itself': Fault(
        FOUR_BAR, put('inputs', (Input('crank_joint', 'ground', 'ground'),)), 'input.child',
        'name two links'
    ),
    'an input of an unknown slider': Fault(
        FOUR_BAR, put('inputs', (Input('cylinder', slider='bore'),)), 'input.slider',
        'this linkage has none'
    ),
    'an input twice': Fault(
        FOUR_BAR, put('inputs', (Input('crank_joint', 'ground', 'crank'),) * 2), 'input',
        'give each input its own name'
    ),
    'one input too many': Fault(
        FOUR_BAR,
        put('inputs', (
            Input('crank_joint', 'ground', 'crank'), Input('rocker_joint', 'ground', 'rocker'),
        )),
        'links.coupler', 'take one of them away'
    ),
    'a loop of inputs': Fault(
        FOUR_BAR,
        put('inputs', (
            Input('one', 'ground', 'crank'), Input('two', 'crank', 'coupler'),
            Input('three', 'coupler', 'rocker'), Input('four', 'rocker', 'ground'),
        )),
        'input.four', 'leave one of the inputs out'
    ),
    'a link of one point': Fault(
        FOUR_BAR, drop('links', 'coupler', 'A'), 'links.coupler', 'two points'
    ),
    'a link of no length': Fault(
        FOUR_BAR, put('links', 'coupler', 'B', (0.0, 0.0)), 'links.coupler.B', 'different places'
    ),
    'a link of nearly no length': Fault(
        FOUR_BAR, put('links', 'coupler', 'B', (1e-40, 0.0)), 'links.coupler.B',
        'places that are at least'
    ),
    'a link whose square underflows': Fault(
        FOUR_BAR, put('links', 'coupler', 'B', (5e-324, 0.0)), 'links.coupler.B',
        'places that are at least'
    ),
    'a ground pivot on the other': Fault(
        FOUR_BAR, put('links', 'ground', 'D', (0.0, 0.0)), 'links.ground.D', 'different places'
    ),
    'two links with two points in common': Fault(
        FOUR_BAR, put('links', 'rocker', 'A', (0.5, 0.5)), 'links.rocker',
        'rename the points that are not pins'
    ),
    'a crank without a pin on the ground': Fault(
        FOUR_BAR, put('links', 'crank', {'Q': (0.0, 0.0), 'A': (0.04, 0.0)}), 'links.crank',
        'name the pin about which'
    ),
    'a coupler without a pin on the crank': Fault(
        FOUR_BAR, put('links', 'crank', {'O': (0.0, 0.0), 'Q': (0.04, 0.0)}), 'links.coupler',
        'Q (crank) and A (coupler) each stand on one link only; the same pin?'
    ),
    'a rocker without a pin on the ground': Fault(
        FOUR_BAR, put('links', 'ground', {'O': (0.0, 0.0), 'Q': (0.1, 0.0)}), 'links.rocker',
        'Q (ground) and D (rocker) each stand on one link only; the same pin?'
    ),
    'a coupler and a rocker that are not pinned': Fault(
        FOUR_BAR, put('links', 'rocker', {'D': (0.0, 0.0), 'Q': (0.08, 0.0)}), 'links.coupler',
        'B (coupler) and Q (rocker) each stand on one link only; the same pin?'
    ),
    'a part that hangs in the air': Fault(
        FOUR_BAR, put('links', 'fifth', {'S': (0.0, 0.0), 'T': (0.08, 0.0)}), 'links.fifth',
        'name one of its points on another link too'
    ),
    'a link that swings from a pin': Fault(
        FOUR_BAR, put('links', 'fifth', {'B': (0.0, 0.0), 'E': (1.0, 0.0)}), 'links.fifth',
        'join it to one more link'
    ),
    'a link that holds crank and ground': Fault(
        FOUR_BAR, put('links', 'fifth', {'A': (0.0, 0.0), 'D': (1.0, 0.0)}), 'links.fifth',
        'take one of them away'
    ),
    'no assembly': Fault(FOUR_BAR, drop('assembly', 'B'), 'assembly', 'write B: left or right'),
    'an assembly of a pin that closes nothing': Fault(
        FOUR_BAR, put('assembly', 'A', 'left'), 'assembly.A', "name 'B'"
    ),
    'an assembly on no side': Fault(
        FOUR_BAR, put('assembly', 'B', 'ahead'), 'assembly.B',
        'write left or right (the side of A→D)'
    ),
    'a rod assembled on no side': Fault(
        SLIDER_CRANK, put('assembly', 'swivel', 'left'), 'assembly.swivel',
        'write ahead or behind'
    ),
    'no assembly of a rod': Fault(
        SLIDER_CRANK, drop('assembly', 'swivel'), 'assembly', 'write swivel: ahead or behind'
    ),
    'a slider along an unknown link': Fault(
        SLIDER_CRANK, swivel(along='rail'), 'sliders.swivel.along',
        'name one of crank, ground, rod'
    ),
    'a slider through an unknown point': Fault(
        SLIDER_CRANK, swivel(through='U'), 'sliders.swivel.through', 'name one of A, T'
    ),
    'a slider of an unknown point': Fault(
        SLIDER_CRANK, swivel(point='U'), 'sliders.swivel.point', "a link other than 'rod'"
    ),
    'a slider of its own link': Fault(
        SLIDER_CRANK, swivel(point='T'), 'sliders.swivel.point', "a link other than 'rod'"
    ),
    'a block that does not carry the point': Fault(
        SLIDER_CRANK, swivel(block='crank'), 'sliders.swivel.block', 'name one of ground'
    ),
    'a slider in no direction': Fault(
        SLIDER_CRANK, swivel(direction=(0.0, 0.0)), 'sliders.swivel.direction',
        'for example [1, 0]'
    ),
    'a slider in a direction that is nearly none': Fault(
        SLIDER_CRANK, swivel(direction=(1e-320, 0.0)), 'sliders.swivel.direction',
        'for example [1, 0]'
    ),
    'a swivel on the crank pivot': Fault(
        SLIDER_CRANK, put('links', 'ground', 'C', (0.0, 0.0)), 'links.ground.C',
        'different places'
    ),
    'a rod that slides in two swivels': Fault(
        SLIDER_CRANK, put('sliders', 'second', Slider('O', 'rod', 'T', (1.0, 0.0))),
        'sliders.second', 'take one of them away'
    ),
    'a joint of an unknown parent': Fault(
        FOUR_BAR, put('joints', 'rocker_joint', RevoluteJoint('base', 'rocker')),
        'joints.rocker_joint.parent', 'name one of coupler, crank, ground, rocker'
    ),
    'a joint of an unknown child': Fault(
        FOUR_BAR, put('joints', 'rocker_joint', RevoluteJoint('ground', 'roker')),
        'joints.rocker_joint.child', 'name one of coupler, crank, ground, rocker'
    ),
    'a joint of an unknown slider': Fault(
        SLIDER_CRANK, put('joints', 'slide_joint', SlideJoint('swivle')),
        'joints.slide_joint.slider', 'name one of swivel'
    ),
    'a slide of a linkage without sliders': Fault(
        FOUR_BAR, put('joints', 'slide_joint', SlideJoint('swivel')), 'joints.slide_joint.slider',
        'this linkage has none'
    ),
    'an unknown traced point': Fault(
        FOUR_BAR, put('traced', ('P',)), 'traced', 'name one of A, B'
    ),
    'a pose with a value too many': Fault(
        FOUR_BAR,
        put('pose', AssemblyPose((1.0, 2.0), {})),
        'pose.inputs',
        'give one for each input',
    ),
    'a class III group without a pose': Fault(CLASS_3, put('pose', None), 'pose', 'pose: {inputs'),
    'a pose that leaves a link out': Fault(
        CLASS_3, put('pose', AssemblyPose((1.0,), {})), 'pose.points',
        'give two of its points: P1, P2, P3'
    ),
    'rails that run alike': Fault(
        YOKE, put('sliders', 'slot', Slider('A', 'yoke', 'U', (1.0, 0.0))),
        'sliders.slot.direction', 'different directions'
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', MALFORMED)
def test_a_malformed_linkage_is_refused_with_its_key_and_a_remedy(name):
    fault = MALFORMED[name]
    linkage = deepcopy(fault.linkage)
    fault.change(linkage)
    with pytest.raises(DefinitionError) as caught:
        Closure(Linkage(**linkage))
    error = caught.value
    assert error.where == fault.key
    assert fault.remedy in error.remedy
    assert str(error) == f'{error.where}: {error.reason}; {error.remedy}'
    assert '\n' not in str(error)
    assert isinstance(error, LinkageError)


@pytest.mark.parametrize('sound', [FOUR_BAR, SLIDER_CRANK], ids=['four-bar', 'slider-crank'])
def test_what_the_table_makes_malformed_is_sound_before(sound):
    Closure(Linkage(**deepcopy(sound)))


def test_links_may_stand_in_any_order_and_bear_any_names():
    expected = Closure(Linkage(**deepcopy(FOUR_BAR))).position(1.0).joints
    turned = deepcopy(FOUR_BAR)
    turned['links'] = dict(reversed(list(turned['links'].items())))
    assert Closure(Linkage(**turned)).position(1.0).joints == expected


def test_points_that_only_one_link_names_are_no_pins():
    expected = Closure(Linkage(**deepcopy(FOUR_BAR))).position(1.0).joints
    traced = deepcopy(FOUR_BAR)
    traced['links']['coupler']['P'] = (0.06, 0.03)
    traced['links']['rocker']['Q'] = (0.0, 0.0)
    assert Closure(Linkage(**traced)).position(1.0).joints == expected
