# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Joints that do not meet exactly move the linkage: the first order of the exact solution.

The exact solution is Newton's method on the poses of all links (`newton.py`), or the closure of a
linkage with other lengths. Half the offset leaves a quarter of the error.
"""

from cmath import rect
from dataclasses import replace
from itertools import pairwise
import random

from linkage_ros.dynamics import Mechanics, Reactions
from linkage_ros.kinematics import Closure
import numpy as np
import pytest

from .loaded import closed, STATES, weighed
from .newton import displaced

SIZES = (4e-4, 2e-4, 1e-4)
"""Of the offsets, in [m], of links of some 0.1 m."""


def assert_quarters(errors, moved):
    """Refuse errors that do not fall with the square of the offsets, or were never small."""
    if max(errors) < 1e-12 * moved:
        return  # Of links that cannot turn the first order is all there is.
    for coarse, fine in pairwise(errors):
        assert coarse / fine == pytest.approx(4.0, rel=0.1)
    assert errors[-1] < 0.03 * moved


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', STATES)
def test_joint_offsets_shift_joints_to_first_order(name):
    closure = closed(name)
    reactions = Reactions(Mechanics(closure))
    rng = random.Random(f'shift of {name}')
    ways = [rect(rng.uniform(0.5, 1.0), rng.uniform(-3.0, 3.0)) for _ in reactions.joints]
    for q in STATES[name]:
        position = closure.position(*q)
        # From an offset of nothing, so that whole turns of the start are the same.
        exact = displaced(closure, q, [0j] * len(ways))
        errors = []
        for size in SIZES:
            offsets = [size * way for way in ways]
            moved = displaced(closure, q, offsets) - exact
            errors.append(np.abs(moved - reactions.joint_deflections(position, offsets)).max())
        assert_quarters(errors, np.abs(moved).max())


@pytest.mark.parametrize('joint', range(4))
def test_single_joint_offset_shifts_a_four_bar(joint):
    closure = closed('four_bar')
    reactions = Reactions(Mechanics(closure))
    (q,) = STATES['four_bar'][0]
    position = closure.position(q)
    exact = displaced(closure, (q,), [0j] * 4)
    for way in (1 + 0j, 1j):
        errors = []
        for size in SIZES:
            offsets = [0j] * 4
            offsets[joint] = size * way
            moved = displaced(closure, (q,), offsets) - exact
            errors.append(np.abs(moved - reactions.joint_deflections(position, offsets)).max())
        assert_quarters(errors, np.abs(moved).max())


# A link, the pin of it that lies farther out, and the sign in the joint that this pin is: the link
# is the joint's `link` (−) or its `to` (+).
STRETCHED = [
    ('four_bar', 'crank', 'A', 1.0),
    ('four_bar', 'coupler', 'B', 1.0),
    ('four_bar', 'rocker', 'B', -1.0),
    ('slider_crank', 'connecting_rod', 'B', 1.0),
    ('watt_1', 'upper_link', 'E', 1.0),
    ('watt_1', 'output_link', 'E', -1.0),
    ('excavator_bucket', 'bucket', 'E', -1.0),
]


@pytest.mark.parametrize(('name', 'link', 'pin', 'sign'), STRETCHED)
def test_longer_link_shifts_joints_as_an_offset(name, link, pin, sign):
    linkage = weighed(name)
    closure = Closure(linkage)
    reactions = Reactions(Mechanics(closure))
    number = reactions.names.index(pin)
    joint = reactions.joints[number]
    assert link == (joint.to if sign > 0 else joint.link)
    q = STATES[name][0]
    position = closure.position(*q)
    x, y = linkage.links[link][pin]
    along = complex(x, y) / abs(complex(x, y))
    errors = []
    for size in SIZES:
        longer = (x + size * along.real, y + size * along.imag)
        links = {**linkage.links, link: {**linkage.links[link], pin: longer}}
        stretched = Closure(replace(linkage, links=links)).position(*q)
        moved = np.subtract(stretched.joints, position.joints)
        stretch = size * along * rect(1.0, closure.link_angles(position)[link])
        offsets = [0j] * len(reactions.joints)
        offsets[number] = sign * stretch
        errors.append(np.abs(moved - reactions.joint_deflections(position, offsets)).max())
    assert_quarters(errors, np.abs(moved).max())


def test_slider_offset_counts_only_across_its_line():
    closure = closed('slider_crank')
    reactions = Reactions(Mechanics(closure))
    position = closure.position(1.0)
    along, across, both = (
        reactions.joint_deflections(position, [0j, 0j, 0j, offset])
        for offset in (1e-4 + 0j, 1e-4j, 1e-4 + 1e-4j)
    )
    assert along == pytest.approx((0.0, 0.0), abs=1e-18)
    assert across == pytest.approx(both)
    assert max(map(abs, across)) > 1e-5


def test_zero_offsets_shift_no_joint():
    closure = closed('watt_1')
    reactions = Reactions(Mechanics(closure))
    assert reactions.joint_deflections(closure.position(1.0), [0j] * 7) == (0.0, 0.0, 0.0, 0.0)
