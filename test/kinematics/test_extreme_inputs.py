# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Any finite input, rate and acceleration has an answer, in plane and space and inverted."""

from math import inf, isnan

from linkage_ros import linkage_names, load
from linkage_ros.resources import spatial_linkage_names
import pytest

from ..support.scenes import ONE_INPUT

EXTREMES = (5e-324, -1e-310, -0.0, 1e-300, 1e16, 1e200, -1.7976931348623157e308)
RATES = (5e-324, 1e200, -1.7976931348623157e308)


def check_motion(closure, position):
    """Ask for huge and tiny rates and accelerations; none of them raises."""
    count = len(closure.input_names)
    for rate in RATES:
        velocity = closure.velocity(position, *[rate] * count)
        assert len(velocity.joints) == len(position.joints)
        for change in RATES:
            found = closure.acceleration(position, velocity, *[change] * count)
            assert len(found.joints) == len(position.joints)


def check_position(closure, *inputs):
    position = closure.position(*inputs)
    assert not isnan(position.gap)
    assert bool(position.joints) == position.status.has_pose
    assert not any(map(isnan, position.joints))
    assert all(abs(value) < inf for value in position.joints)
    return position


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', [*linkage_names(), *spatial_linkage_names()])
def test_extreme_inputs_and_rates_raise_no_error(name):
    closure = load(name)
    count = len(closure.input_names)
    usual = [
        0.0 if closure.linkage.pose is None else closure.linkage.pose.inputs[k]
        for k in range(count)
    ]
    for extreme in EXTREMES:
        check_position(closure, *[extreme] * count)
        check_position(closure, *usual[:-1], extreme)
    position = check_position(closure, *usual)
    if position.status.has_rates:
        check_motion(closure, position)


@pytest.mark.sample(4)
@pytest.mark.parametrize('name', ONE_INPUT)
def test_extreme_inputs_of_an_inverse_raise_no_error(name):
    closure = load(name)
    joint = closure.joint_names[-1]
    branch = closure.branches(joint)[-1]
    inverse = closure.driven_by(joint, branch=branch.number)
    for extreme in EXTREMES:
        check_position(inverse, extreme)
    for part in (0.0, 0.3, 1.0):
        position = check_position(inverse, branch.low + part * (branch.high - branch.low))
        if position.status.has_rates:
            check_motion(inverse, position)
