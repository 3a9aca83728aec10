# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Spatial linkages from file to joints: exact, consistent, and those of the books."""

from dataclasses import replace
from functools import cache
from math import acos, atan2, cos, dist, hypot, pi, radians, remainder, sin, sqrt, tan, tau
from pathlib import Path
from random import Random

import linkage_ros as lr
from linkage_ros.description import parse_yaml, read_any_closure
from linkage_ros.kinematics import (
    CarriedPoints,
    find_freedom,
    Freedom,
    SpaceClosure,
    SpaceLinkage,
    SpatialJoint,
    Status,
)
from linkage_ros.resources import named_file, spatial_linkage_names
from mpmath import mp, mpf
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ...support.spatial import load_in_space

FOLDER = Path(__file__).parent / 'linkages'
NAMES = [*spatial_linkage_names(), *sorted(path.stem for path in FOLDER.glob('*.yaml'))]


def closure_of(name):
    own = FOLDER / f'{name}.yaml'
    return load_in_space(own if own.is_file() else name)


shared_closure = cache(closure_of)
"""The same for tests that only ask it: it is planned once."""


def test_numpy_numbers_give_the_same_bits():
    for name in spatial_linkage_names():
        linkage = closure_of(name).linkage
        joints = [
            {
                each: replace(joint, axis=np.array(joint.axis), at=np.array(joint.at))
                for each, joint in kind.items()
            }
            for kind in (linkage.hinges, linkage.slides)
        ]
        points = {each: np.array(place) for each, place in linkage.points.items()}
        other = SpaceClosure(
            replace(linkage, points=points, hinges=joints[0], slides=joints[1]), name
        )
        inputs = [value + 0.01 for value in linkage.pose.inputs]
        assert other.position(*inputs) == closure_of(name).position(*inputs)


def states_of(closure, count, reach=0.3):
    """Yield inputs about the pose at which a linkage closes, rates and accelerations."""
    random = Random(closure.name)
    while count:
        inputs, rates, changes = (
            [random.uniform(-1.0, 1.0) for _ in closure.input_names] for _ in range(3)
        )
        inputs = [
            value + reach * part * (0.1 if given.slider else 1.0)
            for value, part, given in zip(
                closure.linkage.pose.inputs, inputs, closure.linkage.inputs, strict=True
            )
        ]
        if closure.position(*inputs).status.has_rates:
            count -= 1
            yield inputs, rates, changes


def turned_about(point, at, axis, angle):
    turn = Rotation.from_rotvec(angle * np.array(axis) / np.linalg.norm(axis))
    return np.array(at) + turn.apply(np.array(point) - at)


def joints_at(closure, inputs):
    return np.array(closure.position(*inputs).joints)


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', NAMES)
def test_drawn_pose_is_solved_at_its_inputs(name):
    closure = shared_closure(name)
    linkage = closure.linkage
    position = closure.position(*linkage.pose.inputs)
    assert position.status is Status.CLOSED
    drawn = [linkage.pose_value(joint) for joint in closure.joint_names]
    assert position.joints == pytest.approx(drawn, abs=1e-14)
    for point, place in closure.points(position).items():
        assert dist(place, linkage.points[point]) < 1e-15, point
    for link, (_, quaternion) in closure.frames(position).items():
        assert quaternion == pytest.approx((0.0, 0.0, 0.0, 1.0), abs=1e-14), link


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', NAMES)
def test_rates_and_accelerations_equal_numerical_derivatives(name):
    closure, step = shared_closure(name), 1e-4
    for inputs, rates, changes in states_of(closure, 10, 0.2):
        start, first, second = np.array(inputs), np.array(rates), np.array(changes)
        before, now, after = (
            closure.position(*(start + first * t + second * t * t / 2.0))
            for t in (-step, 0.0, step)
        )
        velocity = closure.velocity(now, *rates)
        acceleration = closure.acceleration(now, velocity, *changes)
        scale = 1.0 + max(map(abs, (*velocity.joints, *acceleration.joints))) ** 2
        joints = [np.array(each.joints) for each in (before, now, after)]
        first, second = _differences(joints, step)
        assert np.abs(first - velocity.joints).max() < 1e-6 * scale, inputs
        assert np.abs(second - acceleration.joints).max() < 1e-5 * scale, inputs
        assert closure.jacobian(now) @ rates == pytest.approx(velocity.joints, rel=1e-9)
        motion = closure.named_motion(now, velocity, acceleration)
        assert list(motion) == list(closure.linkage.traced)
        for point, (_, *found) in motion.items():
            places = [np.array(each.points[point]) for each in (before, now, after)]
            for difference, value in zip(_differences(places, step), found, strict=True):
                assert np.abs(difference - value).max() < 1e-5 * scale


def _differences(values, step):
    before, now, after = values
    return (after - before) / (2.0 * step), (after - 2.0 * now + before) / step**2


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', NAMES)
def test_spatial_links_keep_their_lengths_and_axes(name):
    closure = shared_closure(name)
    linkage = closure.linkage
    for inputs, _, _ in states_of(closure, 20):
        position = closure.position(*inputs)
        assert closure.residual(position) < 1e-14
        places, frames = closure.points(position), closure.frames(position)
        for points in linkage.links.values():
            for one in points:
                for other in points:
                    drawn = dist(linkage.points[one], linkage.points[other])
                    assert dist(places[one], places[other]) == pytest.approx(drawn, abs=1e-14)
        for hinge in linkage.hinges.values():
            axes = [_rotate(frames[link][1], hinge.axis) for link in (hinge.parent, hinge.child)]
            assert axes[0] == pytest.approx(axes[1], abs=1e-13)


def _rotate(quaternion, vector):
    """Return a vector rotated by a quaternion (x, y, z, w)."""
    *axis, w = quaternion
    once = np.cross(axis, vector)
    return vector + 2.0 * (w * once + np.cross(axis, once))


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', NAMES)
def test_compiled_spatial_linkages_equal_the_steps(name):
    closure = shared_closure(name)
    compiled = closure.compile_linkage(2)
    states = list(states_of(closure, 30, 0.1))
    fast = 0
    for inputs, rates, changes in states:
        position = closure.position(*inputs)
        velocity = closure.velocity(position, *rates)
        expected = (
            position.joints, velocity.joints,
            closure.acceleration(position, velocity, *changes).joints,
        )  # fmt: skip
        answer = compiled(*inputs, *rates, *changes)
        assert answer.values == expected
        fast += compiled.fast(*inputs, *rates, *changes) is not None
    assert fast == len(states)
    columns = [list(zip(*each, strict=True)) for each in zip(*states, strict=True)]
    given = columns if len(closure.input_names) > 1 else [each[0] for each in columns]
    batch = closure.solve(*columns[0], rates=given[1], accelerations=given[2])
    one = [compiled(*inputs, *rates, *changes).values for inputs, rates, changes in states]
    for order, values in enumerate(batch[1:]):
        assert pytest.approx(np.array([each[order] for each in one]), abs=1e-9) == values.T


def test_delta_inverse_and_delta_return_the_inputs():
    arms, platform = shared_closure('delta_inverse'), shared_closure('delta')
    for inputs, _, _ in states_of(arms, 200):
        there = arms.position(*inputs)
        back = platform.position(*there.joints)
        assert back.joints == pytest.approx(inputs, abs=1e-14)
        product = platform.jacobian(back) @ arms.jacobian(there)
        assert product == pytest.approx(np.eye(3), abs=1e-11)


@pytest.mark.parametrize('angle', np.linspace(-3.0, 3.0, 25).tolist())
def test_universal_joint_follows_the_textbook_formula(angle):
    """tan(out) = tan(in)·cos β if the fork of the input lies in the plane of the shafts."""
    closure = shared_closure('hooke_joint')
    position = closure.position(angle)
    # In the pose the pin of the input is across that plane: in = 90° of the formula.
    expected = atan2(cos(radians(30)) * sin(angle), cos(angle))
    across = atan2(sin(angle), cos(angle) * cos(radians(30)))
    found = position['out']
    assert min(abs(remainder(found - each, tau)) for each in (expected, across)) < 1e-14
    assert abs(remainder(found - expected, tau)) < 1e-14


@pytest.mark.parametrize('angle', np.linspace(-3.0, 3.0, 25).tolist())
def test_bennett_linkage_follows_the_textbook_formula(angle):
    """tan(θ1/2)·tan(θ2/2) is constant: sin((β + α)/2)/sin((β − α)/2) (Bennett, 1914)."""
    closure = shared_closure('bennett')
    position = closure.position(angle)
    alpha, beta, start = radians(40), radians(75), radians(70)
    constant = sin((beta + alpha) / 2) / sin((beta - alpha) / 2)
    second = 2.0 * atan2(constant, tan(start / 2))
    expected = 2.0 * atan2(constant * cos((start + angle) / 2), sin((start + angle) / 2)) - second
    assert abs(remainder(position['h2'] - expected, tau)) < 1e-12
    assert abs(remainder(position['h3'] + angle, tau)) < 1e-12


def test_planar_four_bar_in_space_equals_the_planar_one(tmp_path):
    planar = tmp_path / 'planar.yaml'
    b, c = dist((0.0, 0.04), (0.11, 0.08)), dist((0.1, 0.0), (0.11, 0.08))
    lengths = f'{{a: 0.04, b: {b!r}, c: {c!r}, d: 0.1, assembly: left}}'
    planar.write_text(f'four_bar: {lengths}\n')
    flat, space = lr.load(planar), shared_closure('four_bar')
    start = flat.position(pi / 2.0)
    for angle in np.linspace(0.0, 6.0, 50).tolist():
        one, other = flat.position(angle), space.position(angle)
        for name, joint in (('rocker', 'rocker_joint'), ('coupler', 'coupler_joint')):
            moved_by = one[joint] - start[joint]
            assert abs(remainder(other[name] - moved_by, tau)) < 1e-14


def test_wishbone_states_do_not_depend_on_their_order():
    closure = shared_closure('wishbone')
    states = [inputs for inputs, _, _ in states_of(closure, 100)]
    forward = [closure.position(*inputs).joints for inputs in states]
    assert [closure.position(*inputs).joints for inputs in reversed(states)] == forward[::-1]


def test_planar_jacobian_holds_the_joint_rates():
    closure = lr.load('five_bar')
    position = closure.position(1.9, 1.2)
    columns = [closure.velocity(position, *rates).joints for rates in ((1.0, 0.0), (0.0, 1.0))]
    assert closure.jacobian(position).T.tolist() == [list(column) for column in columns]
    with pytest.raises(ValueError, match='has none'):
        closure.jacobian(closure.position(pi, 0.0))


@pytest.mark.parametrize('angle', np.linspace(-3.0, 3.0, 13).tolist())
def test_spatial_slider_crank_follows_the_textbook_formula(angle):
    """The crank pin is at (0, 0.1 + r·sin, 0.12 + r·cos); the rod is 0.3 m long (Haug, 1989)."""
    closure = shared_closure('spatial_slider_crank')
    position = closure.position(angle)
    y, z = 0.1 - 0.08 * sin(angle), 0.12 + 0.08 * cos(angle)
    assert position['slide'] == pytest.approx(sqrt(0.3**2 - y * y - z * z), abs=1e-15)


@pytest.mark.parametrize('angle', np.linspace(-1.2, 1.5, 13).tolist())
def test_spherical_four_bar_keeps_angles_between_its_axes(angle):
    """The rocker of a·cos q + b·sin q + c = 0, which says that coupler and last keep their arc."""
    closure = shared_closure('spherical_four_bar')
    position = closure.position(angle)
    axes = {name: np.array(hinge.axis) for name, hinge in closure.linkage.hinges.items()}
    units = {name: axis / np.linalg.norm(axis) for name, axis in axes.items()}
    coupler = turned_about(units['coupler'], [0, 0, 0], [0, 0, 1], angle)
    last, rocker = units['last'], units['rocker']
    along = (rocker @ last) * (rocker @ coupler)
    a, b = coupler @ last - along, coupler @ np.cross(rocker, last)
    c = along - units['coupler'] @ last
    ways = [atan2(b, a) + side * acos(-c / hypot(a, b)) for side in (-1, 1)]
    start = closure.position(0.0)['rocker']
    assert start == pytest.approx(0.0, abs=1e-15)
    off = [abs(remainder(position['rocker'] - way, tau)) for way in ways]
    assert min(off) < 1e-13


def test_delta_platform_equals_the_intersection_of_three_spheres():
    """About the elbows, moved by the platform's points: two planes, and the lower of two roots."""
    closure = shared_closure('delta')
    points = {name: np.array(place) for name, place in closure.linkage.points.items()}
    platform = np.array([0.0, 0.0, -0.5])
    for inputs, _, _ in states_of(closure, 20):
        centers = []
        for number, angle in enumerate(inputs, 1):
            hinge = closure.linkage.hinges[f'a{number}']
            elbow = turned_about(points[f'b{number}'], hinge.at, hinge.axis, angle)
            centers.append(elbow - (points[f'c{number}'] - platform))
        squares = [dist(points[f'b{n}'], points[f'c{n}']) ** 2 for n in (1, 2, 3)]
        rows = np.array([centers[0] - centers[1], centers[0] - centers[2]])
        sides = [
            0.5 * (squares[k] - squares[0] + centers[0] @ centers[0] - centers[k] @ centers[k])
            for k in (1, 2)
        ]
        way = np.cross(*rows)
        foot = np.linalg.lstsq(rows, np.array(sides), rcond=None)[0]
        p, q = (foot - centers[0]) @ way / (way @ way), (foot - centers[0]) @ (foot - centers[0])
        roots = [-p + side * sqrt(p * p - (q - squares[0]) / (way @ way)) for side in (-1, 1)]
        expected = min((foot + root * way for root in roots), key=lambda place: place[2])
        assert closure.position(*inputs).joints == pytest.approx(expected, abs=1e-14)


def test_wishbone_points_equal_a_40_digit_solution():
    """Upper ball and steering ball are found from their distances, to 40 digits (mpmath)."""
    closure = shared_closure('wishbone')
    drawn = {name: [mpf(part) for part in place] for name, place in closure.linkage.points.items()}
    ends = [
        *(('upper', one) for one in ('u1', 'u2', 'lower')),
        *(('steer', one) for one in ('lower', 'upper', 'rack_end')),
    ]
    for inputs, _, _ in states_of(closure, 6):
        found = closure.position(*inputs).points
        pose = {name: np.array(place) for name, place in closure.linkage.points.items()}
        axis = pose['f1'] - pose['f2']
        lower = turned_about(pose['lower'], pose['f2'], axis, inputs[0])
        with mp.workdps(40):
            x, y, z = drawn['rack_end']
            known = drawn | {
                'lower': [*map(mpf, lower)],
                'rack_end': [x, y + inputs[1], z],
            }

            def gaps(*parts, known=known):
                now = known | {'upper': parts[:3], 'steer': parts[3:]}
                return [
                    sum((a - b) ** 2 for a, b in zip(now[one], now[other], strict=True))
                    - sum((a - b) ** 2 for a, b in zip(drawn[one], drawn[other], strict=True))
                    for one, other in ends
                ]

            exact = mp.findroot(gaps, (*found['upper'], *found['steer']))
            for point, places in (('upper', exact[:3]), ('steer', exact[3:])):
                assert [*map(float, places)] == pytest.approx(found[point], abs=1e-14)


def test_idle_rod_is_named_and_does_not_spin():
    closure = shared_closure('rssr')
    assert closure.idle == ('rod',)
    position = closure.position(0.5)
    places = closure.points(position)
    _, quaternion = closure.frames(position)['rod']
    drawn = closure.linkage.points
    way = np.subtract(drawn['B'], drawn['A'])
    assert _rotate(quaternion, way) == pytest.approx(np.subtract(places['B'], places['A']))
    assert np.dot(quaternion[:3], way) == pytest.approx(0.0, abs=1e-16)


def test_ratio_that_holds_only_in_the_pose_is_refused(tmp_path):
    """To first order it is redundant; over the range it is missed."""
    closure = shared_closure('rssr')
    slope = closure.jacobian(closure.position(0.0))[0, 0].item()
    file = tmp_path / 'rssr.yaml'
    text = named_file('rssr', 'linkages').read_text('utf-8')
    file.write_text(f'{text}ratios: {{rocker_joint: {{of: crank_joint, ratio: {slope!r}}}}}\n')
    with pytest.raises(
        lr.FileError, match='over-constrained: 1 equation more than needed, missed by'
    ):
        lr.load(file)


@pytest.mark.parametrize('length', [0.15027, 0.1503, 0.16])
def test_bennett_lengths_beyond_cad_rounding_are_refused(tmp_path, length):
    file = tmp_path / 'bennett.yaml'
    text = named_file('bennett', 'linkages').read_text('utf-8')
    file.write_text(text.replace('-0.15027138229377354', f'-{length}'))
    if length == 0.15027:
        closure = lr.load(file)
        assert 1e-7 < closure.residual(closure.position(1.0)) < 1e-5
        return
    with pytest.raises(lr.FileError, match='over-constrained'):
        lr.load(file)


LIFTED = """
points: {{a: [0, 0, 0], b: [{0!r}, 0, {1!r}]}}
links: {{ground: [a], arm: [b]}}
hinges: {{q: {{parent: ground, child: arm, at: [{1!r}, 0, 0], axis: [0, 1, 0]}}}}
struts: {{s: [a, b]}}
input: [s]
"""
PUSHED = """
points: {{a: [{1!r}, 0, 0], b: [{0!r}, 0, {1!r}]}}
links: {{block: [a], arm: [b], rod: [a, b]}}
slides: {{s: {{parent: ground, child: block, axis: [1, 0, 0], value: {1!r}}}}}
hinges: {{q: {{parent: ground, child: arm, at: [0, 0, 0], axis: [0, 1, 0]}}}}
input: [s]
"""


def turned(q, x, z, pivot):
    """Return x and z of a place that turns about the y axis through a pivot on the x axis."""
    return pivot + cos(q) * (x - pivot) + sin(q) * z, cos(q) * z - sin(q) * (x - pivot)


@pytest.mark.parametrize('power', range(-12, 9))
def test_strut_and_slide_inputs_work_at_any_size(power):
    size, half = 10.0**power, 0.5 * 10.0**power
    lifted = read_any_closure(parse_yaml(LIFTED.format(size, half).encode(), 'x.yaml'))
    q = lifted.position(1.2 * size)['q']
    x, z = turned(q, size, half, half)
    assert hypot(x, z) == pytest.approx(1.2 * size, rel=1e-12)
    pushed = read_any_closure(parse_yaml(PUSHED.format(size, half).encode(), 'x.yaml'))
    q = pushed.position(0.55 * size)['q']
    x, z = turned(q, size, half, 0.0)
    assert hypot(x - 0.55 * size, z) == pytest.approx(hypot(half, half), rel=1e-12)


CYLINDER = """
points: {{a: [1, 0, 0], b: [0, 0, 2]}}
links: {{ground: [a], arm: [b], {carrying_a}: [a], {carrying_b}: [b]}}
hinges:
  arm_joint: {{parent: ground, child: arm, at: [0, 0, 0], axis: [0, 1, 0]}}
  foot: {{parent: ground, child: {carrying_a}, at: [1, 0, 0], axis: [0, 1, 0]}}
slides:
  s: {{parent: barrel, child: piston, axis: {axis}, value: 0.5, limits: [0.2, 0.8]}}
input: [s]
"""


@pytest.mark.sample(6)
@pytest.mark.parametrize('beside', [0.0, 0.5])
@pytest.mark.parametrize('turned_round', [False, True])
@pytest.mark.parametrize('value', [0.25, 0.4, 0.5, 0.75])
def test_cylinder_length_equals_its_slide_value(beside, turned_round, value):
    """The axis leads from the point of the parent to that of the child, or past it."""
    way = np.array([-1.0, 0.0, 2.0 + beside])
    links = {'carrying_a': 'barrel', 'carrying_b': 'piston'}
    if turned_round:
        links = {'carrying_a': 'piston', 'carrying_b': 'barrel'}
        way = -way
    text = CYLINDER.format(axis=way.tolist(), **links)
    q = read_any_closure(parse_yaml(text.encode(), 'x.yaml')).position(value)['arm_joint']
    rod = np.array([1.0, 0.0, -2.0] if turned_round else [-1.0, 0.0, 2.0])
    along = rod @ way / np.linalg.norm(way)
    moved = hypot(along + value - 0.5, sqrt(max(0.0, rod @ rod - along**2)))
    x, z = turned(q, 0.0, 2.0, 0.0)
    assert hypot(x - 1.0, z) == pytest.approx(moved, rel=1e-14)
    assert hypot(x, z) == pytest.approx(2.0, rel=1e-15)


TRIPOD = """
points: {p0: [0, 0, 0], p1: [2, 0, 0], p2: [0.5, 1.5, 0], x: [0.8, 0.5, 1.2]}
links: {ground: [p0, p1, p2], rod0: [p0, x], rod1: [p1, x], barrel: [p2], piston: [x]}
hinges:
  u: {parent: ground, child: cross, at: [0.5, 1.5, 0], axis: [1, 0, 0]}
  w: {parent: cross, child: barrel, at: [0.5, 1.5, 0], axis: [0, 1.2, 1]}
slides: {s: {parent: barrel, child: piston, axis: [0.3, -1, 1.2], value: 0.5}}
input: [s]
traced: [x]
"""


def test_tripod_toggle_distance_equals_its_closed_form():
    """It turns about the line of the ends of two rods; the third ends in the ground's plane."""
    closure = read_any_closure(parse_yaml(TRIPOD.encode(), 'x.yaml'))
    assert closure.groups[0].kind == 'three distances'
    radius, drawn = hypot(0.5, 1.2), sqrt(0.3**2 + 1.0 + 1.2**2)
    ends = [0.5 - drawn + hypot(0.3, radius + side * 1.5) for side in (-1.0, 1.0)]
    (whole,) = closure.closing_ranges
    assert [whole.lowest, whole.highest] == pytest.approx(ends, abs=1e-13)
    singular = closure.singular_inputs
    assert [one.status for one in singular] == [Status.TOGGLE] * 2
    assert [one.value for one in singular] == pytest.approx(ends, abs=1e-13)
    for part in np.linspace(0.01, 0.99, 25).tolist():
        value = ends[0] + part * (ends[1] - ends[0])
        size = drawn + value - 0.5
        # |x − p2|² = 0.3² + r² + 1.5² − 3·r·cos of the angle between the planes
        angle = acos((0.3**2 + radius**2 + 1.5**2 - size**2) / (3.0 * radius))
        position = closure.position(value)
        x = radius * cos(angle), radius * sin(angle)
        assert closure.points(position)['x'] == pytest.approx((0.8, *x), abs=1e-13)
        margin = closure.singularity_margin(position)
        assert margin.transmission_angle == pytest.approx(min(angle, pi - angle), abs=1e-12)
        assert margin.toggle_distance == pytest.approx(
            min(value - ends[0], ends[1] - value), abs=1e-12
        )


@pytest.mark.parametrize('drawn', [1.2, -1.2])
def test_tripod_point_keeps_its_drawn_side(drawn):
    """The sign of ((P1 − P0) × (P2 − P0))·(X − P0), in the assembly that the file draws."""
    text = TRIPOD.replace('1.2', str(drawn)).replace('--', '')
    closure = read_any_closure(parse_yaml(text.encode(), 'x.yaml'))
    number = next(k for k, step in enumerate(closure.steps) if step.has_transmission_angle)
    p0, p1, p2 = np.array([0.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0]), np.array([0.5, 1.5, 0.0])
    for value in (0.2, 0.5, 0.9):
        position = closure.position(value)
        side = np.cross(p1 - p0, p2 - p0) @ (np.array(closure.points(position)['x']) - p0)
        assert side * drawn > 0.0
        assert closure.steps[number].side_of(position.poses[number]) * side > 0.0


def sharing_links(links, points):
    """Return a hinged link, and others that share all of its points."""
    random = Random(1)
    places = {f'p{n}': tuple(random.uniform(-1.0, 1.0) for _ in range(3)) for n in range(points)}
    hinge = SpatialJoint('ground', 'l0', (0.0, 0.0, 1.0))
    carried = {f'l{n}': tuple(places) for n in range(links)}
    return SpaceLinkage(places, carried, {'h': hinge}, {}, {}, ('h',), ())


@pytest.mark.parametrize('points', [3, 4, 12, 40])
@pytest.mark.parametrize('links', [2, 3, 8])
def test_links_sharing_three_points_count_as_one_body(links, points):
    """Two bodies with three balls between them are one: whatever is beyond 6 is redundant."""
    linkage = sharing_links(links, points)
    freedom = find_freedom(linkage, CarriedPoints(linkage, 1.0))
    assert freedom == Freedom(1, (links - 1) * (3 * points - 6), (), 0)


@pytest.mark.parametrize(('links', 'points'), [(120, 3), (60, 200)])
def test_linkage_with_too_many_parts_is_refused(links, points):
    with pytest.raises(lr.DefinitionError) as caught:
        SpaceClosure(sharing_links(links, points))
    told = f'links: {links + 1} with {links * points} points; keep 120 links, and 10000 points'
    assert str(caught.value) == f'{told} of links, at most'


@pytest.mark.parametrize(
    ('name', 'count'),
    # By hand: rods with two balls, and the carrier of a wishbone, whose arms share points of
    # their hinges' axes with the ground.
    [('rssr', 2), ('ankle', 4), ('delta', 6), ('wishbone', 4), ('bennett', 0), ('hexapod', 0)],
)
def test_balls_are_points_that_no_hinge_joins(name, count):
    assert shared_closure(name).ball_count == count
