# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""All inputs at which joints have values: as many as geometry says, each closed by the linkage."""

from cmath import phase, rect
from itertools import product
from math import acos, atan2, cos, hypot, remainder, sin, tau
import random

from linkage_ros import load
from linkage_ros.kinematics import search_inputs, Status
import pytest

from ...support.sampling import sample_count

STATES = sample_count(12, 3)


def turned_apart(one, other):
    """Return how far inputs are apart, without whole turns."""
    return max(abs(remainder(a - b, tau)) for a, b in zip(one, other, strict=True))


def cranks_to(place, pivot, crank, rod):
    """Return the two angles of a crank whose rod ends at a place; none if it is too far."""
    way = place - pivot
    cosine = (crank**2 + abs(way) ** 2 - rod**2) / (2.0 * crank * abs(way))
    return [phase(way) + side * acos(cosine) for side in (1, -1)] if abs(cosine) < 1.0 else []


def test_input_search_finds_all_cranks_of_a_five_bar():
    """Of both elbows on both sides those in which the pin lies right of B→A, as the file says."""
    closure, rng, cases = load('five_bar'), random.Random(1), 0
    for _ in range(STATES):
        place = complex(rng.uniform(-0.05, 0.17), rng.uniform(0.05, 0.18))
        expected = []
        for left, right in product(
            cranks_to(place, 0j, 0.09, 0.11), cranks_to(place, 0.12 + 0j, 0.09, 0.11)
        ):
            a, b = rect(0.09, left), 0.12 + rect(0.09, right)
            if ((a - b).conjugate() * (place - b)).imag < 0.0:
                expected.append((left, right))
        found = search_inputs(closure, {'P.x': place.real, 'P.y': place.imag}).inputs
        assert len(found) == len(expected)
        for inputs in found:
            assert abs(closure.position(*inputs).points['P'] - place) < 1e-14
            assert min(turned_apart(inputs, other) for other in expected) < 1e-9
        cases += len(expected)
    assert cases > STATES


def test_input_search_finds_all_arm_angles_of_a_delta():
    """Each arm has two angles; of the eight robots those that hang below their elbows."""
    closure, rng = load('delta'), random.Random(2)
    for _ in range(STATES):
        place = [rng.uniform(-0.08, 0.08), rng.uniform(-0.08, 0.08), rng.uniform(-0.5, -0.42)]
        arms = []
        for turn in (0.0, tau / 3.0, -tau / 3.0):
            # The end of the rod in the plane of the arm, and beside it.
            x = place[0] * cos(turn) + place[1] * sin(turn) + 0.04 - 0.1
            beside = place[1] * cos(turn) - place[0] * sin(turn)
            z, arm, rod = place[2], hypot(0.1, 0.15), hypot(0.16, 0.35)
            far = hypot(x, z)
            opening = acos((arm**2 + far**2 - rod**2 + beside**2) / (2.0 * arm * far))
            start = atan2(-0.15, 0.1)
            # About the y axis, positive from z to x.
            arms.append([start - atan2(z, x) + side * opening for side in (1, -1)])
        names = ('x', 'y', 'z')
        expected = []
        for inputs in product(*arms):
            position = closure.position(*inputs)
            if position.joints and all(
                abs(position[name] - value) < 1e-9
                for name, value in zip(names, place, strict=True)
            ):
                expected.append(inputs)
        found = search_inputs(closure, dict(zip(names, place, strict=True))).inputs
        assert expected
        assert len(found) == len(expected)
        for inputs in found:
            assert min(turned_apart(inputs, other) for other in expected) < 1e-9


CASES = [
    ('five_bar', ('left_forearm.angle', 'P.x')),
    ('five_bar', ('A-B', 'P.y')),
    ('ankle', ('m1', 'm2')),
    ('ankle', ('c1.z', 'roll')),
    ('ankle_motors', ('b1-c2', 'c2.x')),
    ('wishbone', ('wheel.z', 'rack')),
    ('wishbone', ('wheel.z', 'wheel.y')),
    ('delta', ('a1', 'y', 'c3.z')),
]


@pytest.mark.sample(1)
@pytest.mark.parametrize(('name', 'joints'), CASES)
def test_searched_inputs_reproduce_the_requested_values(name, joints):
    """The state that a value is taken from is among them; rates are those of the linkage."""
    closure, rng = load(name), random.Random(name)
    measured = closure.measuring(*joints)
    pose = closure.linkage.pose.inputs if closure.linkage.pose else (1.05, 1.05)
    start = [value + rng.uniform(0.01, 0.05) for value in pose]
    position = measured.position(*start)
    values = {joint: position[joint] for joint in joints}
    found = [
        inputs
        for inputs in search_inputs(closure, values).inputs
        if closure.position(*inputs).status is Status.CLOSED
    ]
    assert min(turned_apart(inputs, start) for inputs in found) < 1e-9
    for inputs in found:
        state = measured.position(*inputs)
        for joint, value in values.items():
            off = state[joint] - value
            off = remainder(off, tau) if joint.endswith('angle') else off
            assert off == pytest.approx(0.0, abs=1e-13)
        inverse = closure.driven_by(*joints, near=inputs)
        home = inverse.linkage.pose.inputs
        again = inverse.position(*home)
        assert again.status is Status.CLOSED
        velocity = measured.velocity(state, *([0.3] * len(inputs)))
        rates = dict(zip(measured.joint_names, velocity.joints, strict=True))
        back = inverse.velocity(again, *(rates[joint] for joint in joints))
        for former, value in zip(closure.input_names, inputs, strict=True):
            if former not in joints:
                assert remainder(again[former] - value, tau) == pytest.approx(0.0, abs=1e-12)
                assert back[former] == pytest.approx(0.3, abs=1e-9)
