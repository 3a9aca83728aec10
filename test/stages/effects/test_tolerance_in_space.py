# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Tolerance in space: parts that deviate are put together as they would be in a workshop."""

from itertools import combinations
from random import Random

from linkage_ros.description import load
from linkage_ros.errors import DefinitionError, FileError
from linkage_ros.kinematics import Closure, SpatialMass
from linkage_ros.stages.effects import ToleranceEffect
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from .test_forces_in_space import pipeline

RSSR = load('rssr').linkage
A, B = np.array(RSSR.points['A']), np.array(RSSR.points['B'])
PIVOT, AXIS = np.array([0.15, 0.05, 0.03]), np.array([0.0, 1.0, 0.3]) / np.hypot(1.0, 0.3)


def made(parameters, drawn=RSSR, seed='seed'):
    return parameters.alter(drawn, Random(seed))


def test_deviating_rssr_moves_by_its_own_lengths():
    off = {
        'crank.A': (3e-4, -2e-4, 1e-4),
        'crank.crank_joint': (0.0, 1e-4, -3e-4),
        'ground.crank_joint': (2e-4, 1e-4, 1e-4),
        'ground.rocker_joint': (-1e-4, 2e-4, 3e-4),
        'rocker.rocker_joint': (1e-4, -4e-4, 0.0),
        'rocker.B': (2e-4, 2e-4, -1e-4),
        'rod.A': (0.0, 0.0, -5e-4),
        'rod.B': (0.0, 1e-4, 4e-4),
    }
    closure = Closure(made(ToleranceEffect(given=off)))
    d = {name: np.array(by) for name, by in off.items()}
    rod = np.linalg.norm((B + d['rod.B']) - (A + d['rod.A']))
    for theta in (0.0, 0.7, 2.5, -1.9):
        crank = Rotation.from_rotvec([0.0, 0.0, theta])
        one = d['ground.crank_joint'] + crank.apply(A + d['crank.A'] - d['crank.crank_joint'])

        def missed(psi, one=one):
            arm = B + d['rocker.B'] - PIVOT - d['rocker.rocker_joint']
            other = PIVOT + d['ground.rocker_joint'] + Rotation.from_rotvec(psi * AXIS).apply(arm)
            return np.linalg.norm(other - one) - rod

        near = load('rssr').position(theta).joints[0]
        expected = brentq(missed, near - 0.1, near + 0.1, xtol=1e-15)
        assert closure.position(theta).joints[0] == pytest.approx(expected, abs=1e-12)
        assert abs(expected - near) > 1e-4


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', ['ankle', 'ankle_motors', 'delta', 'hexapod', 'wishbone'])
def test_deviating_parts_keep_the_inputs_of_the_pose(name):
    drawn = load(name).linkage
    holes = [hole for hole in drawn.holes if hole[1] in drawn.points]
    random = np.random.default_rng(7)
    off = {hole: random.normal(0.0, 2e-4, 3) for hole in holes}
    given = {'.'.join(hole): tuple(by) for hole, by in off.items()}
    altered = made(ToleranceEffect(given=given), drawn)
    assert altered.pose.inputs == pytest.approx(drawn.pose.inputs, abs=1e-12)
    moved = 0.0
    for link, names in drawn.links.items():
        for one, other in combinations(names, 2):
            own = [
                drawn.points[each] + off.get((link, each), np.zeros(3)) for each in (one, other)
            ]
            told = np.linalg.norm(np.subtract(altered.points[one], altered.points[other]))
            assert told == pytest.approx(np.linalg.norm(own[0] - own[1]), abs=1e-12)
            moved = max(moved, np.linalg.norm(np.subtract(altered.points[one], drawn.points[one])))
    assert moved > 1e-5
    closure = Closure(altered)
    position = closure.position(*altered.pose.inputs)
    assert position.joints
    assert closure.residual(position) < 1e-10


def test_draws_follow_the_seed_and_scale_with_deviation():
    one, again, other, double = (
        made(ToleranceEffect(by), seed=seed).points['B']
        for by, seed in ((1e-8, 'a'), (1e-8, 'a'), (1e-8, 'b'), (2e-8, 'a'))
    )
    assert one == again
    assert one != other
    assert np.subtract(double, B) == pytest.approx(2.0 * np.subtract(one, B), rel=1e-3)
    assert made(ToleranceEffect()) is RSSR
    rod = made(ToleranceEffect(1e-4, links=('rod',)))
    assert rod.points['A'] == pytest.approx(RSSR.points['A'], abs=1e-12)
    assert rod.points['B'] != RSSR.points['B']


def test_masses_stay_on_their_parts():
    masses = {
        'crank': SpatialMass(0.1, (0.02, 0.0, 0.0), (1e-4, 0, 0, 2e-4, 0, 2.5e-4)),
        'rod': SpatialMass(0.0),
        'rocker': SpatialMass(0.3, (0.12, 0.03, 0.08), (3e-4, 0, 1e-5, 2e-4, 0, 1e-4)),
    }
    drawn = RSSR.with_masses(masses, ())
    altered = made(ToleranceEffect(given={'rod.B': (0.0, 0.0, 4e-3)}), drawn)
    assert altered.masses['crank'].center == pytest.approx(masses['crank'].center, abs=1e-12)
    turned = Rotation.from_rotvec(altered.hinges['rocker_joint'].value * AXIS)
    assert abs(altered.hinges['rocker_joint'].value) > 1e-3
    center = PIVOT + turned.apply(np.array(masses['rocker'].center) - PIVOT)
    assert altered.masses['rocker'].center == pytest.approx(center, abs=1e-12)
    tensor = np.array([[3e-4, 0, 1e-5], [0, 2e-4, 0], [1e-5, 0, 1e-4]])
    expected = turned.as_matrix() @ tensor @ turned.as_matrix().T
    found = altered.masses['rocker'].inertia
    assert found == pytest.approx(expected[np.triu_indices(3)], abs=1e-15)


def test_tolerance_of_an_overconstrained_linkage_is_refused():
    bennett = load('bennett').linkage
    with pytest.raises(DefinitionError, match=r'the parts do not fit: they miss each other by'):
        made(ToleranceEffect(1e-4), bennett)


def test_spatial_scene_takes_tolerances_of_three_numbers():
    at_work = pipeline('tolerance: {standard_deviation: 1.0e-4}, pin_forces: {}')
    (line,) = at_work.linkages
    assert line.closure.linkage.points['B'] != pytest.approx(RSSR.points['B'], abs=1e-6)
    with pytest.raises(FileError, match=r'rod\.A: \[1, 2\] is not .*\[x, y, z\]|three'):
        pipeline('tolerance: {given: {rod.A: [1, 2]}}, pin_forces: {}')
    with pytest.raises(FileError, match=r'rod\.C'):
        pipeline('tolerance: {given: {rod.C: [1, 2, 3]}}, pin_forces: {}')
