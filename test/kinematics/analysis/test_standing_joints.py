# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where published joints stand although inputs move: of one input, and of several."""

from math import acos, atan2, cos, pi, remainder, sin, tau

import linkage_ros as lr
from linkage_ros.kinematics import (
    find_standing_state,
    Status,
    turning_points,
    usual_inputs,
)
from linkage_ros.resources import named_file
from mpmath import mp, mpf
import numpy as np
import pytest


def four_bar_turns():
    """Return the crank in line with the coupler, by the law of cosines for O2, O4, B."""
    a, b, c, d = 0.04, 0.12, 0.08, 0.1
    return [
        acos((reach**2 + d**2 - c**2) / (2.0 * reach * d)) + (0.0 if reach > b else pi)
        for reach in (b + a, b - a)
    ]


def turned_about(point, at, axis, angle):
    """Return a point turned about a line, by Rodrigues' formula."""
    size = mp.sqrt(sum(a * a for a in axis))
    (x, y, z), k = (p - q for p, q in zip(point, at, strict=True)), [a / size for a in axis]
    across = [k[1] * z - k[2] * y, k[2] * x - k[0] * z, k[0] * y - k[1] * x]
    along = (k[0] * x + k[1] * y + k[2] * z) * (1 - mp.cos(angle))
    return [
        q + p * mp.cos(angle) + c * mp.sin(angle) + a * along
        for q, p, c, a in zip(at, (x, y, z), across, k, strict=True)
    ]


def rssr_turns():
    """Return the cranks whose pin moves across the rod, with 50 digits."""
    axis, pivot = [0, 1, mpf('0.3')], [mpf('0.15'), mpf('0.05'), mpf('0.03')]
    ball, arm = [mpf('0.1'), mpf('0.02'), mpf('0.12')], mpf('0.04')
    length = sum((p - q) ** 2 for p, q in zip(ball, [arm, 0, 0], strict=True))

    def misses(crank, rocker):
        pin = [arm * mp.cos(crank), arm * mp.sin(crank), 0]
        rod = [p - q for p, q in zip(turned_about(ball, pivot, axis, rocker), pin, strict=True)]
        return sum(p * p for p in rod) - length, rod[1] * pin[0] - rod[0] * pin[1]

    with mp.workdps(50):
        starts = [(crank, rocker) for crank in (0.3, 3.5) for rocker in (0.0, 0.5, -0.5)]
        return {float(mp.findroot(misses, start)[0]) % tau for start in starts}


TURNS = {
    'four_bar': {'rocker_joint': four_bar_turns()},
    'scotch_yoke': {'yoke_slide': [0.0, pi], 'slot_slide': [pi / 2, 3 * pi / 2]},
    'elliptic_trammel': {'cross_slide': [0.0]},
    'parallelogram': {},
    'rssr': {'rocker_joint': rssr_turns()},
    # The crank pin is in the plane of the crank's axis and the slide's.
    'spatial_slider_crank': {'slide': [k * pi - atan2(0.1, 0.12) for k in (0, 1)]},
    'hooke_joint': {'one': [0.0, pi], 'other': [pi / 2, 3 * pi / 2]},
    'bennett': {},
}
"""The inputs at which joints turn back, by joint; joints that are left out do not."""


@pytest.mark.parametrize('name', TURNS)
def test_joint_turning_points_equal_the_textbook_formulas(name):
    found, expected = turning_points(lr.load(name)), TURNS[name]
    assert found.keys() == expected.keys()
    for joint, places in expected.items():
        assert len(found[joint]) == len(places)
        for place in places:
            assert min(abs(remainder(place - one, tau)) for one in found[joint]) < 1e-12


def test_turning_points_beyond_limits_are_not_listed(tmp_path):
    file = tmp_path / 'limited.yaml'
    drawn = named_file('rssr', 'linkages').read_text()
    for low, high, count in ((-0.1, 0.1, 0), (-0.1, 3.5, 1), (-2.7, 0.1, 1), (-2.7, 0.3, 2)):
        limits = f'axis: [0, 0, 1], limits: [{low}, {high}]'
        file.write_text(drawn.replace('axis: [0, 0, 1]', limits))
        assert sum(map(len, turning_points(lr.load(file)).values())) == count


def moment(line, axis, at):
    """Return the moment of a line through two points about an axis, per metre of the line."""
    one, other = (np.array(point) for point in line)
    return np.array(axis) @ np.cross(one - np.array(at), other - one)


def ankle_margin(closure, position):
    """Return det of the rods' moments about pitch and roll: 0 where the foot moves alone."""
    points, (pitch, _) = closure.points(position), position.inputs
    axis, at = [cos(pitch), 0.0, -sin(pitch)], [-0.018 * sin(pitch), 0.0, -0.018 * cos(pitch)]
    rows = [
        [moment(rod, [0, 1, 0], [0, 0, 0]), moment(rod, axis, at)]
        for rod in ([points['b1'], points['c1']], [points['b2'], points['c2']])
    ]
    return np.linalg.det(np.array(rows)) / (0.02 * 0.15) ** 2


def five_bar_margin(closure, position):
    """Return how far the tool is from the line of the cranks' pins: there the elbows stand."""
    return closure.points(position)['left_forearm', 'P'].imag / 0.1


def delta_margin(closure, position):
    """Return the least of the moments of the rods about the axes of their arms."""
    points = closure.points(position)
    rods = [[points[f'b{n}'], points[f'c{n}']] for n in (1, 2, 3)]
    hinges = [closure.linkage.hinges[f'a{n}'] for n in (1, 2, 3)]
    size = closure.scale**2
    return min(
        abs(moment(rod, hinge.axis, hinge.at)) / size
        for rod, hinge in zip(rods, hinges, strict=True)
    )


STANDING = {'ankle': ankle_margin, 'five_bar': five_bar_margin, 'delta': delta_margin}


@pytest.mark.parametrize('name', STANDING)
def test_standing_state_search_finds_a_singular_jacobian(name):
    closure = lr.load(name)
    inputs = find_standing_state(closure)
    position = closure.position(*inputs)
    assert position.status is Status.CLOSED
    assert abs(STANDING[name](closure, position)) < 1e-6
    assert abs(STANDING[name](closure, closure.position(*usual_inputs(closure)))) > 1e-2
    values = np.linalg.svd(closure.jacobian(position), compute_uv=False)
    assert values[-1] < 1e-6 < 1e-2 < values[0]


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', ['ankle_motors', 'hexapod', 'rssr'])
def test_standing_state_search_returns_none_without_such_a_state(name):
    assert find_standing_state(lr.load(name)) is None
