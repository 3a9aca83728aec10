# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Tolerance in space: parts that deviate are put together as they would be in a workshop."""

from dataclasses import replace
from itertools import combinations
from random import Random

from linkage_ros.description import load
from linkage_ros.errors import DefinitionError, FileError
from linkage_ros.kinematics import (
    Closure,
    direction_of,
    put_together,
    SpatialMass,
    unit_across,
)
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


def tilted(axis, angles):
    """Return the rotation by angles about what is across an axis: as near z as can be, and on."""
    across = unit_across(tuple(axis))
    turn = angles[0] * np.array(across) + angles[1] * np.cross(axis, across)
    return Rotation.from_rotvec(turn)


def test_tilted_axes_are_the_dimensions_of_a_spherical_linkage():
    """On each part the axes have other angles; the parts are assembled by rotations alone."""
    drawn = load('spherical_four_bar').linkage
    axes = {name: np.array(direction_of(hinge.axis)) for name, hinge in drawn.hinges.items()}
    random = np.random.default_rng(50)
    holes = [(end, name) for name, h in drawn.hinges.items() for end in (h.parent, h.child)]
    tilts = {hole: tuple(random.normal(0.0, 0.01, 2)) for hole in holes}
    closure = Closure(put_together(drawn, {}, tilts))
    turned = {hole: tilted(axes[hole[1]], tilts[hole]) for hole in holes}

    def axis_at(joint, value, link, other):
        """Return another axis of a link that hangs by a joint on the ground."""
        onto = Rotation.from_rotvec(value * turned['ground', joint].apply(axes[joint]))
        placed = onto * turned['ground', joint] * turned[link, joint].inv()
        return placed.apply(turned[link, other].apply(axes[other]))

    cosine = turned['b', 'coupler'].apply(axes['coupler']) @ turned['b', 'last'].apply(
        axes['last']
    )
    for theta in (0.0, 0.5, 1.2, -0.9):
        outer = axis_at('crank', theta, 'a', 'coupler')
        near = load('spherical_four_bar').position(theta).joints[0]

        def missed(psi, outer=outer):
            return axis_at('rocker', psi, 'c', 'last') @ outer - cosine

        expected = brentq(missed, near - 0.2, near + 0.2, xtol=1e-15)
        assert closure.position(theta).joints[0] == pytest.approx(expected, abs=1e-12)
        assert abs(expected - near) > 1e-3


def test_tilted_axis_of_a_crank_moves_its_pin_on_another_circle():
    tilts = {('ground', 'crank_joint'): (0.02, 0.0), ('crank', 'crank_joint'): (0.0, -0.01)}
    closure = Closure(put_together(RSSR, {}, tilts))
    one, other = (tilted([0.0, 0.0, 1.0], angles) for angles in tilts.values())
    rod = np.linalg.norm(B - A)
    for theta in (0.0, 0.7, 2.5):
        about = Rotation.from_rotvec(theta * one.apply([0.0, 0.0, 1.0]))
        pin = (about * one * other.inv()).apply(A)

        def missed(psi, pin=pin):
            place = PIVOT + Rotation.from_rotvec(psi * AXIS).apply(B - PIVOT)
            return np.linalg.norm(place - pin) - rod

        near = load('rssr').position(theta).joints[0]
        expected = brentq(missed, near - 0.1, near + 0.1, xtol=1e-15)
        assert closure.position(theta).joints[0] == pytest.approx(expected, abs=1e-12)
        assert abs(expected - near) > 1e-5


@pytest.mark.parametrize('along', [0.0, 0.05, -0.02])
@pytest.mark.parametrize('hinge', ['crank_joint', 'rocker_joint'])
def test_points_on_an_axis_stay_on_it(hinge, along):
    """A point that both links of a hinge name on its axis adds no equation to the hinge's."""
    drawn = RSSR.hinges[hinge]
    place = tuple(np.array(drawn.at) + along * np.array(drawn.axis))
    links = {**RSSR.links, 'ground': ('O',), drawn.child: (*RSSR.links[drawn.child], 'O')}
    named = replace(RSSR, points={**RSSR.points, 'O': place}, links=links)
    deviations = {hole: (1e-4, -2e-4, 3e-4) for hole in RSSR.holes if hole[0] != 'rod'}
    tilts = {(drawn.child, hinge): (0.01, -0.02), ('ground', hinge): (0.004, 0.0)}
    plain = Closure(put_together(RSSR, deviations, tilts))
    closure = Closure(put_together(named, deviations, tilts))
    for theta in (0.0, 0.7, 2.5):
        expected = plain.position(theta).joints
        assert closure.position(theta).joints == pytest.approx(expected, abs=1e-12)


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', ['ankle', 'ankle_motors', 'delta', 'hooke_joint', 'wishbone'])
def test_tilts_are_drawn_after_deviations_and_scale(name):
    drawn = load(name).linkage
    holes = made(ToleranceEffect(1e-5), drawn)
    both = made(ToleranceEffect(1e-5, axis_standard_deviation=1e-12), drawn)
    for point, place in holes.points.items():
        assert both.points[point] == pytest.approx(place, abs=1e-10)
    once, twice = (
        made(ToleranceEffect(axis_standard_deviation=by), drawn).hinges for by in (1e-6, 2e-6)
    )
    moved = 0.0
    for hinge in drawn.hinges:
        axes = [np.array(direction_of(each[hinge].axis)) for each in (drawn.hinges, once, twice)]
        assert axes[2] - axes[0] == pytest.approx(2.0 * (axes[1] - axes[0]), abs=1e-9)
        moved = max(moved, np.abs(axes[1] - axes[0]).max())
    assert moved > 1e-7
    position = Closure(both).position(*drawn.pose.inputs)
    assert position.joints


def test_tilted_axes_of_a_planar_linkage_are_refused():
    with pytest.raises(DefinitionError, match=r'axis_standard_deviation: the axes of a planar'):
        made(ToleranceEffect(axis_standard_deviation=1e-3), load('four_bar').linkage)


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
    refused = (
        r'the parts do not fit: they miss each other by .* m at the least; let only what need'
    )
    for parameters in (ToleranceEffect(1e-4), ToleranceEffect(axis_standard_deviation=1e-3)):
        with pytest.raises(DefinitionError, match=refused):
            made(parameters, bennett)


def test_spatial_scene_takes_tolerances_of_three_numbers():
    at_work = pipeline('tolerance: {standard_deviation: 1.0e-4}, pin_forces: {}')
    (line,) = at_work.linkages
    assert line.closure.linkage.points['B'] != pytest.approx(RSSR.points['B'], abs=1e-6)
    with pytest.raises(FileError, match=r'rod\.A: \[1, 2\] is not .*\[x, y, z\]|three'):
        pipeline('tolerance: {given: {rod.A: [1, 2]}}, pin_forces: {}')
    with pytest.raises(FileError, match=r'rod\.C'):
        pipeline('tolerance: {given: {rod.C: [1, 2, 3]}}, pin_forces: {}')
