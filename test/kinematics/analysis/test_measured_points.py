# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Coordinates, distances and angles as inputs: there and back by the linkage's own points."""

from math import dist, remainder, tau
import random

from linkage_ros import DefinitionError, load
from linkage_ros.kinematics import Closure, Status
import pytest

from ..linkages import four_bar_linkage
from ...support.sampling import sample_count

STATES = sample_count(12, 4)
"""States on each branch."""


def value_of(closure, position, name):
    """Return what a name describes, from the points and angles of a position."""
    points = closure.named_points(position)
    of, _, what = name.rpartition('.')
    if what == 'angle':
        return closure.link_angles(position)[of]
    if of:
        place = points[of]
        parts = (place.real, place.imag) if isinstance(place, complex) else place
        return parts['xyz'.index(what)]
    one, other = (points[end] for end in name.split('-'))
    return abs(one - other) if isinstance(one, complex) else dist(one, other)


def off_by(found, wanted, name):
    return remainder(found - wanted, tau) if name.endswith('angle') else found - wanted


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('name', 'wanted'),
    [
        ('four_bar', 'P.x'),  # a class III group
        ('four_bar', 'A.y'),  # dyads
        ('four_bar', 'O2-B'),  # a cylinder
        ('four_bar', 'O4-P'),
        ('four_bar', 'coupler.angle'),
        ('slider_crank', 'connecting_rod.angle'),
        ('jansen_leg', 'foot.y'),
        ('gripper', 'left_pad-right_pad'),
        ('gripper', 'right_pad.x'),
        ('peaucellier', 'O-P'),
        ('rssr', 'B.x'),
        ('rssr', 'B.z'),
    ],
)
def test_measured_input_gives_its_value_along_the_branch(name, wanted):
    """The crank that a value asks for brings the linkage's own points there."""
    closure = load(name)
    rng = random.Random(f'{name} {wanted}')
    cases = []
    for branch in closure.branches(wanted)[:2]:
        cranks = [branch.state_at(rng.uniform(0.15, 0.85))[1] for _ in range(STATES)]
        cases.append((closure.driven_by(wanted, branch=branch.number), cranks))
    for driven, cranks in cases:
        for crank in cranks:
            value = value_of(closure, closure.position(crank), wanted)
            position = driven.position(value)
            assert position.status is Status.CLOSED
            found = position[closure.input_names[0]]
            assert remainder(found - crank, tau) == pytest.approx(0.0, abs=1e-9)
            again = value_of(closure, closure.position(found), wanted)
            assert off_by(again, value, wanted) == pytest.approx(0.0, abs=2e-15)
            # Its rate is what was asked for, by the points' own rates.
            step = 1e-6
            rate = driven.velocity(position, 1.0)[closure.input_names[0]]
            ends = [
                value_of(closure, closure.position(found + rate * way), wanted)
                for way in (step, -step)
            ]
            assert off_by(*ends, wanted) == pytest.approx(2.0 * step, rel=1e-3)


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ('name', 'wanted'),
    [
        ('five_bar', ('P.x', 'P.y')),
        ('five_bar', ('O1-P', 'left_crank_joint')),
        ('five_bar', ('left_forearm.angle', 'P.x')),
        ('ankle_motors', ('c1.z', 'c2.z')),
        ('ankle_motors', ('b1-c2', 'roll')),
        ('delta', ('c1.z', 'x', 'y')),
    ],
)
def test_several_measured_inputs_return_the_motor_joints(name, wanted):
    closure = load(name)
    driven = closure.driven_by(*wanted)
    assert driven.input_names == wanted
    rng = random.Random(name)
    # Near the pose, so that no other assembly lies between.
    start = (1.05, 1.05) if name == 'five_bar' else closure.linkage.pose.inputs
    for _ in range(STATES):
        inputs = [at + rng.uniform(-0.03, 0.03) for at in start]
        position = closure.position(*inputs)
        joints = dict(zip(closure.input_names, inputs, strict=True)) | dict(position)
        values = [
            joints[one] if one in joints else value_of(closure, position, one) for one in wanted
        ]
        home = driven.linkage.pose.inputs
        values = [  # Links that are iterated go on from the turn of the pose.
            value - tau * round((value - at) / tau) if one.endswith('angle') else value
            for one, value, at in zip(wanted, values, home, strict=True)
        ]
        found = driven.position(*values)
        assert found.status is Status.CLOSED
        for one, value in joints.items():
            if one not in wanted:
                assert remainder(found[one] - value, tau) == pytest.approx(0.0, abs=1e-11)


@pytest.mark.parametrize(
    ('name', 'wanted', 'line'),
    [
        ('four_bar', 'A-P', 'A-P: both points are on coupler: their distance does not change'),
        ('four_bar', 'O2.x', 'O2.x: O2 is a point of the ground; name one that moves'),
        ('four_bar', 'ground.angle', 'ground.angle: the ground does not turn'),
        ('four_bar', 'O2-O4', 'both points are on ground'),
        ('four_bar', 'P.z', 'P.z: is not a joint, and describes no point, distance or angle'),
        ('four_bar', 'Q.x', 'Q.x: is not a joint'),
        ('peaucellier', 'P.x', 'P.x: does not move with the input'),
        ('five_bar', 'P.x P.x', 'name 2 different joints'),
        (
            'five_bar',
            'A.x left_crank_joint',
            'are not independent in the pose: right_crank_joint stays free',
        ),
        ('gripper', 'left_knuckle_joint', 'left_knuckle_joint: is an input'),
        ('rssr', 'A-B', 'A-B: both points are on rod'),
        ('rssr', 'O.x', 'O.x: is not a joint, and describes no point or distance'),
        ('rssr', 'rocker.angle', 'has no one angle; name a hinge, as rocker_joint'),
        ('five_bar', 'P.x A.x O1-P', '3 for 2 inputs; name 2 different joints'),
        ('ankle_motors', 'b1.z m1', 'm2 stays free; name a joint that moves with m2'),
    ],
)
def test_driven_by_refuses_wrong_measures_in_one_line(name, wanted, line):
    with pytest.raises(DefinitionError) as error:
        load(name).driven_by(*wanted.split())
    assert line in str(error.value)
    assert '\n' not in str(error.value)


@pytest.mark.sample(1)
@pytest.mark.parametrize('side', ['left', 'right'])
def test_coordinates_and_angles_drive_random_four_bars(side):
    rng = random.Random(side)
    for _ in range(4):
        lengths = tuple(rng.uniform(0.3, 1.0) for _ in range(4))
        try:
            closure = Closure(four_bar_linkage(lengths, side))
            ranges = closure.input_ranges
        except DefinitionError:
            continue
        if not ranges:
            continue
        pins = {point for points in closure.linkage.links.values() for point in points}
        ground = {*closure.linkage.links['ground']}
        moving = sorted(pins - ground)
        for wanted in (f'{moving[0]}.x', f'{moving[-1]}.y', 'coupler.angle'):
            for branch in closure.branches(wanted):
                driven = closure.driven_by(wanted, branch=branch.number)
                for share in (0.2, 0.5, 0.8):
                    value, crank = branch.state_at(share)
                    found = driven.position(value).joints[0]
                    assert found == pytest.approx(crank, abs=1e-9), (lengths, wanted)
