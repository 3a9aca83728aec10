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

"""Linkages and inputs that are refused, in one line."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from math import inf, nan
import re
from typing import Any

from linkage_ros.errors import DefinitionError, LinkageError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.kinematics.status import Status
import numpy as np
import pytest

from .malformed import Fields, FOUR_BAR, MALFORMED, SLIDER_CRANK
from .test_gallery import closure_of as shipped

# Invalid inputs: one line that names the input, or a state without a pose; never a wrong pose.


ONE, TWO = shipped('four_bar'), shipped('five_bar')


NAMES = 'left_crank_joint, right_crank_joint'


@pytest.mark.parametrize('value', [nan, inf, -inf])
def test_an_input_that_is_not_finite_has_no_pose(value: float) -> None:
    for position in (ONE.position(value), TWO.position(1.0, value), TWO.position(value, 1.0)):
        assert (position.status, position.gap, position.joints) == (Status.INDETERMINATE, 0.0, ())
    batch = ONE.solve([0.5, value])
    assert [list(Status)[code] for code in batch.status] == [Status.CLOSED, Status.INDETERMINATE]


@pytest.mark.parametrize(
    ('call', 'kind', 'text'),
    [
        (ONE.position, ValueError, 'inputs: 0 given; give 1: crank_joint'),
        (lambda: ONE.position(1.0, 2.0), ValueError, 'inputs: 2 given; give 1: crank_joint'),
        (lambda: TWO.position(1.0), ValueError, f'inputs: 1 given; give 2: {NAMES}'),
        (
            lambda: ONE.position('a'),
            TypeError,
            "inputs: 'a' is not a number; solve() takes arrays",
        ),
        (
            lambda: ONE.position([1.0, 2.0]),
            TypeError,
            'inputs: [1.0, 2.0] is not a number; solve() takes arrays',
        ),
        (
            lambda: ONE.position(np.ones(2)),
            TypeError,
            'inputs: array([1., 1.]) is not a number; solve() takes arrays',
        ),
        (ONE.solve, ValueError, 'inputs: 0 given; give 1, one for each driven joint'),
        (
            lambda: ONE.solve(['a']),
            ValueError,
            "inputs: not an array of numbers: could not convert string to float: 'a'",
        ),
    ],
)
def test_what_is_no_input(call: Callable[[], object], kind: type[Exception], text: str) -> None:
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
def test_what_is_no_rate_and_no_acceleration(
    given: tuple[Any, ...], kind: type[Exception], text: str
) -> None:
    position = ONE.position(1.0)
    velocity = ONE.velocity(position, 1.0)
    with pytest.raises(kind, match=f'^{re.escape(text.format(what="rates"))}$'):
        ONE.velocity(position, *given)
    with pytest.raises(kind, match=f'^{re.escape(text.format(what="accelerations"))}$'):
        ONE.acceleration(position, velocity, *given)


def test_a_position_without_rates_has_none() -> None:
    closure = shipped('double_rocker')
    end = closure.input_ranges[0].highest
    for value, status in ((end, 'toggle'), (end + 0.1, 'open'), (nan, 'indeterminate')):
        position = closure.position(value)
        assert position.status.value == status
        text = f'rates: a linkage that is {status} has none; ask its status'
        with pytest.raises(ValueError, match=f'^{text}$'):
            closure.velocity(position, 1.0)


# A linkage that cannot be built is refused in one line with place, reason and remedy.


@pytest.mark.parametrize('name', MALFORMED)
def test_a_malformed_linkage_is_refused_with_its_key_and_a_remedy(name: str) -> None:
    sound, change, key, remedy = MALFORMED[name]
    linkage = deepcopy(sound)
    change(linkage)
    with pytest.raises(DefinitionError) as caught:
        Closure(Linkage(**linkage))
    error = caught.value
    assert error.where == key
    assert remedy in error.remedy
    assert str(error) == f'{error.where}: {error.reason}; {error.remedy}'
    assert '\n' not in str(error)
    assert isinstance(error, LinkageError)


@pytest.mark.parametrize('sound', [FOUR_BAR, SLIDER_CRANK], ids=['four-bar', 'slider-crank'])
def test_what_the_table_makes_malformed_is_sound_before(sound: Fields) -> None:
    Closure(Linkage(**deepcopy(sound)))


def test_links_may_stand_in_any_order_and_bear_any_names() -> None:
    expected = Closure(Linkage(**deepcopy(FOUR_BAR))).position(1.0).joints
    turned = deepcopy(FOUR_BAR)
    turned['links'] = dict(reversed(list(turned['links'].items())))
    assert Closure(Linkage(**turned)).position(1.0).joints == expected


def test_points_that_only_one_link_names_are_no_pins() -> None:
    expected = Closure(Linkage(**deepcopy(FOUR_BAR))).position(1.0).joints
    traced = deepcopy(FOUR_BAR)
    traced['links']['coupler']['P'] = (0.06, 0.03)
    traced['links']['rocker']['Q'] = (0.0, 0.0)
    assert Closure(Linkage(**traced)).position(1.0).joints == expected
