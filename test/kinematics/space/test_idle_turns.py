# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Rods and rings that may turn alone, as robots' files have them: balls are three hinges."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from linkage_ros import load
from linkage_ros.dynamics import Loads, Mechanics, Reactions
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import SpaceClosure, SpaceLinkage, SpatialJoint, SpatialMass
import numpy as np
import pytest

from ...tools.models.heads import head, IDLE_TURNS, WAYS
from ...tools.models.walked import Walked

ROBOT = Path(__file__).parents[2] / 'tools' / 'models' / 'robots' / 'rods_on_three_hinges.urdf'
WITH_RODS = ('rssr', 'delta', 'ankle', 'ankle_motors')
RNG = np.random.default_rng(29)


def axes_across(rng):
    """Return three directions at right angles, as exporters write them; one along no rod."""
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return axes.T


def written_as_hinges(linkage, rod, point, rng):
    """Return the linkage with a rod's ball as three hinges through two links of their own."""
    on = next(link for link in linkage.links if point in linkage.links[link] and link != rod)
    ends = [on, f'{point}_1', f'{point}_2', rod]
    hinges = dict(linkage.hinges)
    pairs = zip(pairwise(ends), axes_across(rng), strict=True)
    for number, (joined, axis) in enumerate(pairs):
        one, other = joined[:: rng.choice((1, -1))]
        # Any point of the axis, with the noise of CAD.
        at = linkage.points[point] + axis * rng.uniform(-1, 1) + rng.normal(size=3) * 1e-12
        hinges[f'{point}_hinge{number}'] = SpatialJoint(one, other, tuple(axis), tuple(at))
    names = rng.permutation(list(hinges))
    left = tuple(other for other in linkage.links[rod] if other != point)
    links = {**linkage.links, rod: left}
    return replace(linkage, hinges={name: hinges[name] for name in names}, links=links)


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', WITH_RODS)
@pytest.mark.parametrize('both', [False, True], ids=['one end', 'both ends'])
@pytest.mark.parametrize('seed', range(2))
def test_three_hinge_balls_give_the_states_of_balls(name, both, seed):
    rng = np.random.default_rng(seed)
    balls = load(name)
    linkage = balls.linkage
    for rod in balls.idle:
        ends = rng.permutation(linkage.links[rod])
        for point in ends[: 2 if both else 1]:
            linkage = written_as_hinges(linkage, rod, str(point), rng)
    added = [name for name in linkage.hinges if name not in balls.linkage.hinges]
    closure = SpaceClosure(replace(linkage, published=(*linkage.published, *added)))
    assert len(closure.held) == len(balls.idle)
    count = len(balls.joint_names)
    pose = np.array(balls.linkage.pose.inputs)
    for inputs in pose + rng.uniform(-0.2, 0.2, (20, len(pose))):
        expected, found = balls.position(*inputs), closure.position(*inputs)
        assert found.status is expected.status
        assert found.joints[:count] == pytest.approx(expected.joints, abs=1e-8)
        values = dict(zip(closure.joint_names, found.joints, strict=True))
        assert all(values[each] == 0.0 for each in closure.held)


def in_random_order(linkage, rng):
    """Return the linkage with its hinges and links in another order."""
    hinges, links = (rng.permutation([*part]) for part in (linkage.hinges, linkage.links))
    return replace(
        linkage,
        hinges={str(name): linkage.hinges[name] for name in hinges},
        links={str(name): linkage.links[name] for name in links},
    )


@pytest.mark.parametrize('name', WITH_RODS)
@pytest.mark.parametrize('seed', range(3))
def test_order_of_a_file_does_not_choose_what_is_held(name, seed):
    """Any of the hinges of a ball along a rod, or at a ring, could keep its value."""
    rng = np.random.default_rng(seed)
    drawn = load(name)
    linkage = drawn.linkage
    for rod in drawn.idle:
        for point in linkage.links[rod]:
            linkage = written_as_hinges(linkage, rod, point, rng)
    for hinge in drawn.linkage.hinges:
        if hinge not in linkage.driven:
            linkage = with_ring(linkage, hinge, rng)
    linkage = replace(linkage, published=(*linkage.hinges.keys() - {*linkage.driven},))
    first, *others = (SpaceClosure(in_random_order(linkage, rng)) for _ in range(3))
    for other in others:
        assert {*other.held} == {*first.held}
        for inputs in first.linkage.pose.inputs + rng.uniform(-0.1, 0.1, (5, len(linkage.driven))):
            found = other.position(*inputs).joints
            assert found == pytest.approx(first.position(*inputs).joints, abs=1e-8)


def test_robot_with_hinge_balls_closes_its_urdf_tree():
    """The values of pitch and roll are of own Newton; the tree is walked by yourdfpy."""
    closure = load(ROBOT, {'input': ['m1', 'm2']})
    at = closure.position(*np.radians((5.0, -3.0)))
    named = dict(zip(closure.joint_names, at.joints, strict=True))
    assert np.degrees((named['pitch'], named['roll'])) == pytest.approx(
        (-2.901734, 1.129640), abs=1e-6
    )
    walked = Walked(ROBOT.read_bytes())
    for m1, m2 in RNG.uniform(-0.3, 0.3, (50, 2)):
        found = closure.position(m1, m2)
        walked.pose((*closure.input_names, *closure.joint_names), (m1, m2, *found.joints))
        assert walked.gap() < 1e-12


@pytest.mark.sample(1)
@pytest.mark.parametrize('named', [{}, {'top1_a': 'neck_x', 'top1_b': 'neck_rz'}])
def test_six_rod_head_closes_its_urdf_tree(tmp_path, named):
    """
    Nothing but rods carries the head: no joint leads to it, and it has no closed form.

    Hinges may be named as those that its plan adds would be.
    """
    robot, text = tmp_path / 'head.urdf', head(RNG)
    for old, new in named.items():
        text = text.replace(f'"{old}"', f'"{new}"')
    robot.write_text(text)
    closure = load(robot, {'input': [f'motor{number}' for number in range(1, 7)]})
    assert len(closure.held) == 6
    walked = Walked(robot.read_bytes())
    for motors in RNG.uniform(-0.1, 0.1, (50, 6)):
        found = closure.position(*motors)
        walked.pose((*closure.input_names, *closure.joint_names), (*motors, *found.joints))
        assert walked.gap() < 1e-12


@pytest.mark.sample(2)
@pytest.mark.parametrize('seed', range(6))
def test_legs_written_in_any_way_close_their_tree(tmp_path, seed):
    """Rods are whole, welded, joined by a hinge or a ring, or slide; in any order of the file."""
    rng = np.random.default_rng(seed)
    first, *others = (str(way) for way in rng.choice(WAYS, 6))
    ways = ['slide' if first == 'slide' else 'ball', *others]
    robot = tmp_path / 'head.urdf'
    robot.write_text(head(rng, ways))
    closure = load(robot, {'input': [f'motor{number}' for number in range(1, 7)]})
    assert len(closure.held) == sum(IDLE_TURNS[way] for way in ways)
    walked = Walked(robot.read_bytes())
    far = np.array([0.01 if way == 'slide' else 0.1 for way in ways])
    for motors in far * rng.uniform(-1, 1, (20, 6)):
        found = closure.position(*motors)
        walked.pose((*closure.input_names, *closure.joint_names), (*motors, *found.joints))
        assert walked.gap() < 1e-12
        values = dict(zip(closure.joint_names, found.joints, strict=True))
        assert not any(values.get(each) for each in closure.held)


def with_ring(linkage, name, rng):
    """Return the linkage with a ring at a hinge, which turns on both of its links."""
    hinge = linkage.hinges[name]
    ends = [hinge.parent, f'{name}_ring', hinge.child]
    at = [np.array(hinge.at) + np.array(hinge.axis) * rng.uniform(-1, 1) for _ in range(2)]
    halves = {
        half: SpatialJoint(*joined, hinge.axis, tuple(place))
        for half, joined, place in zip((name, f'{name}_2'), pairwise(ends), at, strict=True)
    }
    hinges = {**linkage.hinges, **halves}
    order = rng.permutation(list(hinges))
    return replace(linkage, hinges={each: hinges[each] for each in order})


@pytest.mark.parametrize('name', ['bennett', 'hooke_joint', 'rssr', 'wishbone'])
@pytest.mark.parametrize('seed', range(2))
def test_rings_at_hinges_change_no_state(name, seed):
    rng = np.random.default_rng(seed)
    plain = load(name)
    linkage, doubled = plain.linkage, []
    for hinge in plain.linkage.hinges:
        if hinge not in linkage.driven:
            linkage, doubled = with_ring(linkage, hinge, rng), [*doubled, hinge]
    halves = [f'{hinge}_2' for hinge in doubled]
    closure = SpaceClosure(replace(linkage, published=(*doubled, *halves)))
    assert len(closure.held) == len(doubled)
    whole = SpaceClosure(replace(plain.linkage, published=tuple(doubled)))
    for inputs in whole.linkage.pose.inputs + rng.uniform(-0.02, 0.02, (10, len(linkage.driven))):
        found = closure.position(*inputs)
        values = dict(zip(closure.joint_names, found.joints, strict=True))
        sums = [values[hinge] + values[f'{hinge}_2'] for hinge in doubled]
        assert sums == pytest.approx(whole.position(*inputs).joints, abs=1e-9)


def with_traced_point(linkage, link, place):
    """Return the linkage with a traced point P of a link."""
    points = {**linkage.points, 'P': tuple(map(float, place))}
    links = {**linkage.links, link: (*linkage.links.get(link, ()), 'P')}
    return replace(linkage, points=points, links=links, traced=('P',))


@pytest.mark.parametrize('carrier', ['ring', 'rod'])
def test_traced_point_beside_an_idle_axis_is_refused(carrier):
    """Nothing says where a ring or a rod turns such a point; one on the axis has its place."""
    linkage, rng = load('rssr').linkage, np.random.default_rng(5)
    if carrier == 'ring':
        linkage, link = with_ring(linkage, 'rocker_joint', rng), 'rocker_joint_ring'
        hinge = linkage.hinges['rocker_joint']
        at, axis = np.array(hinge.at), np.array(hinge.axis)
    else:
        link, (one, other) = 'rod', linkage.links['rod']
        at = np.array(linkage.points[one])
        axis = np.array(linkage.points[other]) - at
        linkage = written_as_hinges(linkage, 'rod', one, rng)
    beside = 0.01 * np.cross(axis, (0.3, 0.5, 0.7)) / np.linalg.norm(axis)
    SpaceClosure(with_traced_point(linkage, link, at + 0.4 * axis))
    with pytest.raises(DefinitionError, match=f"'P' is on {link}, which may turn about itself"):
        SpaceClosure(with_traced_point(linkage, link, at + 0.4 * axis + beside))


def test_driven_rod_spin_stays_an_input():
    closure = load(ROBOT, {'input': ['m1', 'm2', 'r1z', 'r2z']})
    assert closure.held == ()
    assert closure.position(0.05, -0.03, 0.4, -0.2).joints[:2] == pytest.approx(
        load(ROBOT, {'input': ['m1', 'm2']}).position(0.05, -0.03).joints[:2], abs=1e-9
    )


def test_three_hinges_that_miss_a_point_are_refused():
    """The third axis misses the point of the first two by 1 mm."""
    balls = load('rssr')
    linkage = written_as_hinges(balls.linkage, 'rod', 'A', np.random.default_rng(3))
    hinge = linkage.hinges['A_hinge2']
    away = np.cross(hinge.axis, (0.3, 0.5, 0.7))
    off = replace(hinge, at=tuple(np.array(hinge.at) + 1e-3 * away / np.linalg.norm(away)))
    with pytest.raises(DefinitionError, match='1 input for 2 degrees of freedom'):
        SpaceClosure(replace(linkage, hinges={**linkage.hinges, 'A_hinge2': off}))


def test_free_plate_between_two_balls_is_refused_by_name():
    points = {'A': (0.04, 0.0, 0.0), 'B': (0.1, 0.02, 0.12), 'P': (0.05, 0.1, 0.05)}
    linkage = load('rssr').linkage
    plate = replace(linkage, points=points, links={**linkage.links, 'rod': ('A', 'B', 'P')})
    with pytest.raises(DefinitionError, match='2 degrees of freedom: rod stays free; '):
        SpaceClosure(plate)


def test_hinge_balls_equal_balls_beside_a_flat_parallelogram():
    """At a change point freedom is judged beside the pose."""
    balls = load('rssr').linkage
    linkage = written_as_hinges(balls, 'rod', 'A', np.random.default_rng(8))
    ends = [('ground', 'near', 1.0), ('near', 'long', 1.1), ('long', 'far', 1.4)]
    flat = {
        f'flat{number}': SpatialJoint(*joined, (0.0, 0.0, 1.0), (x, 0.0, 0.0))
        for number, (*joined, x) in enumerate([*ends, ('ground', 'far', 1.3)])
    }
    closure = SpaceClosure(
        replace(
            linkage,
            hinges={**linkage.hinges, **flat},
            driven=('crank_joint', 'flat0'),
            published=('rocker_joint', 'flat3'),
        )
    )
    for crank, near in RNG.uniform(-0.5, 0.5, (5, 2)):
        (rocker,) = SpaceClosure(balls).position(crank).joints
        assert closure.position(crank, near).joints == pytest.approx((rocker, near), abs=1e-9)


def test_joint_forces_at_rings_balance_the_drive():
    """What balances every link is the effort that the power of the weights asks for."""
    linkage = with_ring(load('rssr').linkage, 'rocker_joint', np.random.default_rng(4))
    inertia = (2e-3, 0.0, 0.0, 3e-3, 0.0, 2e-3)
    masses = {
        'crank': SpatialMass(1.0, (0.02, 0.01, 0.0), inertia),
        'rocker': SpatialMass(2.0, (0.1, 0.02, 0.1), inertia),
    }
    closure = SpaceClosure(linkage.with_masses(masses, massless=linkage.link_names[1:]))
    assert len(closure.held) == 1
    mechanics = Mechanics(closure, Loads((0.0, 0.0, -9.81)))
    position = closure.position(0.4)
    velocity = closure.velocity(position, 2.0)
    motion = position, velocity, closure.acceleration(position, velocity, -3.0)
    found = Reactions(mechanics).drive_efforts(*motion)
    assert found == pytest.approx(mechanics.drive_efforts(*motion), rel=1e-9)
    assert abs(found[0]) > 0.01


def test_door_on_two_hinges_is_refused_by_name():
    linkage = load('rssr').linkage
    doors = {
        f'door{number}': SpatialJoint('ground', 'door', (0.0, 0.0, 1.0), (0.3, 0.0, 0.1 * number))
        for number in range(2)
    }
    with pytest.raises(DefinitionError, match='door stays free'):
        SpaceClosure(replace(linkage, hinges={**linkage.hinges, **doors}))


@pytest.mark.parametrize('seed', range(4))
def test_spherical_five_bar_needs_both_motors(seed):
    """Four hinges through one point are a mechanism, and none of its links turns alone."""
    rng = np.random.default_rng(seed)
    bars = ['ground', 'a', 'b', 'c', 'd', 'ground']
    hinges = {}
    for number, joined in enumerate(pairwise(bars)):
        axis = tuple(rng.normal(size=3))
        hinges[f'j{number}'] = SpatialJoint(*joined, axis, tuple(np.multiply(0.1, axis)))
    linkage = SpaceLinkage({}, {}, hinges, {}, {}, ('j0',), ('j1',))
    with pytest.raises(DefinitionError, match='1 input for 2 degrees of freedom'):
        SpaceClosure(linkage)
    assert SpaceClosure(replace(linkage, driven=('j0', 'j4'))).held == ()
