# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Linkages and inputs that are refused, in one line."""

from dataclasses import replace
from math import inf, nan
import re

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import (
    AssemblyPose,
    Closure,
    Slider,
    Status,
)
import numpy as np
import pytest

from .linkages import (
    class_3_linkage,
    four_bar_linkage,
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
    (lambda: ONE.position([1.0, 2.0]), TypeError,
     'inputs: [1.0, 2.0] is not a number; solve() takes arrays'),
    (lambda: ONE.position(np.ones(2)), TypeError,
     'inputs: array([1., 1.]) is not a number; solve() takes arrays'),
    (ONE.solve, ValueError, 'inputs: 0 given; give 1, one for each driven joint'),
    (lambda: ONE.solve(['a']), TypeError, "inputs: 'a' is not a number"),
])  # fmt: skip
def test_position_refuses_wrong_inputs_in_one_line(call, kind, text):
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
def test_velocity_and_acceleration_refuse_wrong_rates_in_one_line(given, kind, text):
    position = ONE.position(1.0)
    velocity = ONE.velocity(position, 1.0)
    with pytest.raises(kind, match=f'^{re.escape(text.format(what="rates"))}$'):
        ONE.velocity(position, *given)
    with pytest.raises(kind, match=f'^{re.escape(text.format(what="accelerations"))}$'):
        ONE.acceleration(position, velocity, *given)


def test_velocity_refuses_a_position_without_rates():
    closure = shipped('double_rocker')
    end = closure.input_ranges[0].highest
    for value, status in ((end, 'toggle'), (end + 0.1, 'open'), (nan, 'indeterminate')):
        position = closure.position(value)
        assert position.status.value == status
        text = f'rates: a linkage that is {status} has none; check its status'
        with pytest.raises(ValueError, match=f'^{text}$'):
            closure.velocity(position, 1.0)


# A linkage that cannot be built, and that no file says: those of files are in refused.yaml.

FOUR_BAR = four_bar_linkage((0.04, 0.12, 0.08, 0.1), 'left')
CLASS_3, YOKE = class_3_linkage(), scotch_yoke_linkage(0.04)
ALIKE = {**YOKE.sliders, 'slot': Slider('A', 'yoke', 'U', (1.0, 0.0))}


@pytest.mark.parametrize(('linkage', 'line'), [
    (replace(FOUR_BAR, inputs=()), 'input: no joint is driven; name the driven joint'),
    (replace(FOUR_BAR, assembly={'B': 'ahead'}), "assembly.B: 'ahead' is not a side; write left"),
    (replace(CLASS_3, pose=None), 'pose: is missing: no dyad covers platform, arm_1, arm_2, arm'),
    (replace(CLASS_3, pose=AssemblyPose((1.0,), {})),
     "pose.points: does not say where 'platform' lies; give two of its points: P1, P2, P3"),
    (replace(YOKE, sliders=ALIKE), 'sliders.slot.direction: is parallel to the direction of'),
])  # fmt: skip
def test_malformed_linkage_error_names_key_and_remedy(linkage, line):
    with pytest.raises(DefinitionError) as caught:
        Closure(linkage)
    error = caught.value
    assert str(error).startswith(line)
    assert str(error) == f'{error.where}: {error.reason}; {error.remedy}'
    assert '\n' not in str(error)


def test_link_order_and_extra_points_do_not_change_joints():
    expected = Closure(FOUR_BAR).position(1.0).joints
    links = {link: dict(points) for link, points in reversed(FOUR_BAR.links.items())}
    links['coupler']['P'] = (0.06, 0.03)
    links['rocker']['Q'] = (0.0, 0.0)
    assert Closure(replace(FOUR_BAR, links=links)).position(1.0).joints == expected
