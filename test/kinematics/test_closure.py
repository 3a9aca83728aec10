# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A closure: published joints, steps alone and together, and points that are followed."""

from cmath import rect
from math import cos, pi, remainder, sin
import random

from linkage_ros.description import read_linkage, read_yaml
from linkage_ros.kinematics import (
    Closure,
    Input,
    InputSweep,
    Linkage,
    pose_alone,
    RevoluteJoint,
    SlideJoint,
    Slider,
    Status,
    transmission_angles,
    usual_inputs,
)
import pytest

from .analysis.test_ranges import FILES
from .linkages import four_bar_linkage, Frame, inverted_slider_crank_linkage
from .reference import four_bar, inverted_slider_crank
from .test_gallery import closure_of, FOLDER

# Published joints are child minus parent, and slides in metres, whatever the links' frames.


CRANK_ANGLES = [-3.0, -1.2, 0.1, 0.9, 2.2, 3.1]
FOUR_BAR = (0.04, 0.12, 0.08, 0.1)
SLIDER_CRANK = (0.15, 0.27, -0.02)


def odd_frames(seed: int, links: tuple[str, ...]) -> dict[str, Frame]:
    """Return frames that are nowhere near a link's pins, nor along it."""
    rng = random.Random(seed)
    return {
        link: (rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), rng.uniform(-pi, pi))
        for link in links
    }


@pytest.mark.parametrize('crank_angle', CRANK_ANGLES)
@pytest.mark.parametrize(('side', 'sign'), [('left', 1), ('right', -1)])
def test_four_bar_joint_equals_child_angle_minus_parent_angle(crank_angle, side, sign):
    closure = Closure(four_bar_linkage(FOUR_BAR, side))
    position = closure.position(crank_angle)
    truth = four_bar(*FOUR_BAR, crank_angle, sign)
    coupler, rocker = position.joints
    assert remainder(
        coupler - (float(truth.coupler.value) - crank_angle), 2 * pi
    ) == pytest.approx(0.0, abs=4e-15)
    assert remainder(rocker - float(truth.rocker.value), 2 * pi) == pytest.approx(0.0, abs=4e-15)
    assert closure.velocity(position, 3.0).joints == pytest.approx(
        (3.0 * float(truth.coupler_rate.value) - 3.0, 3.0 * float(truth.rocker_rate.value)),
        rel=1e-14,
    )


@pytest.mark.parametrize('crank_angle', CRANK_ANGLES)
@pytest.mark.parametrize('side', ['left', 'right'])
@pytest.mark.parametrize('seed', range(5))
def test_turned_link_frames_shift_the_four_bar_joints(crank_angle, side, seed):
    frames = odd_frames(seed, ('ground', 'crank', 'coupler', 'rocker'))
    turned = {link: angle for link, (_, _, angle) in frames.items()}
    plain, odd = (Closure(four_bar_linkage(FOUR_BAR, side, f)) for f in (None, frames))
    # A link drawn at +angle in its frame has its frame at -angle.
    one = plain.position(crank_angle)
    other = odd.position(crank_angle - turned['crank'] + turned['ground'])
    shifts = (turned['crank'] - turned['coupler'], turned['ground'] - turned['rocker'])
    assert other.status is one.status is Status.CLOSED
    for value, before, shift in zip(other.joints, one.joints, shifts, strict=True):
        assert remainder(value - before - shift, 2 * pi) == pytest.approx(0.0, abs=2e-14)
    expected = plain.velocity(one, 2.0).joints
    assert odd.velocity(other, 2.0).joints == pytest.approx(expected, rel=1e-12)
    assert odd.residual(other) < 4e-16


@pytest.mark.parametrize('crank_angle', CRANK_ANGLES)
@pytest.mark.parametrize(('side', 'sign'), [('ahead', 1), ('behind', -1)])
@pytest.mark.parametrize('along', [0.0, 0.11, -0.2])
def test_slide_is_measured_from_its_named_point(crank_angle, side, sign, along):
    closure = Closure(inverted_slider_crank_linkage(SLIDER_CRANK, side, along=along))
    truth = inverted_slider_crank(*SLIDER_CRANK, crank_angle, sign)
    position = closure.position(crank_angle)
    rod, slide = position.joints
    assert remainder(rod - (float(truth.rod.value) - crank_angle), 2 * pi) == pytest.approx(
        0.0, abs=4e-15
    )
    assert slide == pytest.approx(float(truth.slide.value) - along, abs=4e-16)
    assert closure.velocity(position, 3.0).joints == pytest.approx(
        (3.0 * float(truth.rod_rate.value) - 3.0, 3.0 * float(truth.slide_rate.value)), rel=1e-14
    )
    assert closure.turning == (True, False)


@pytest.mark.parametrize('crank_angle', CRANK_ANGLES)
@pytest.mark.parametrize('side', ['ahead', 'behind'])
@pytest.mark.parametrize('seed', range(5))
def test_turned_link_frames_shift_the_rod_joint_only(crank_angle, side, seed):
    frames = odd_frames(seed, ('ground', 'crank', 'rod'))
    turned = {link: angle for link, (_, _, angle) in frames.items()}
    plain, odd = (
        Closure(inverted_slider_crank_linkage(SLIDER_CRANK, side, f, along=0.07))
        for f in (None, frames)
    )
    one = plain.position(crank_angle)
    other = odd.position(crank_angle - turned['crank'] + turned['ground'])
    shift = turned['crank'] - turned['rod']
    assert remainder(other.joints[0] - one.joints[0] - shift, 2 * pi) == pytest.approx(
        0, abs=2e-14
    )
    assert other.joints[1] == pytest.approx(one.joints[1], abs=2e-15)
    expected = plain.velocity(one, 2.0).joints
    assert odd.velocity(other, 2.0).joints == pytest.approx(expected, rel=1e-12, abs=1e-13)
    assert odd.residual(other) < 4e-16


def test_published_joints_close_the_loop_of_the_file():
    # Frames that no formula of the package prefers, walked by hand from joint to joint.
    ground = {'O': (0.3, -0.1), 'D': (0.2, 0.35)}
    crank = {'O': (0.01, 0.02), 'A': (-0.05, 0.11)}
    coupler = {'A': (0.5, 0.5), 'B': (0.2, 0.8)}
    rocker = {'B': (-0.1, 0.0), 'D': (0.25, 0.1)}
    linkage = Linkage(
        links={'rocker': rocker, 'coupler': coupler, 'crank': crank, 'ground': ground},
        inputs=(Input('crank_joint', 'ground', 'crank'),),
        assembly={'B': 'right'},
        joints={
            'elbow': RevoluteJoint('coupler', 'rocker'),
            'wrist': RevoluteJoint('crank', 'coupler'),
        },
        sliders={},
    )
    closure = Closure(linkage)
    for crank_angle in (0.4, 2.0, -2.5):
        position = closure.position(crank_angle)
        elbow, wrist = position.joints
        pin = ground['O']
        angle = 0.0
        for points, start, end, turn in (
            (crank, 'O', 'A', crank_angle),
            (coupler, 'A', 'B', wrist),
            (rocker, 'B', 'D', elbow),
        ):
            angle += turn
            x, y = (points[end][i] - points[start][i] for i in (0, 1))
            pin = (
                pin[0] + x * cos(angle) - y * sin(angle),
                pin[1] + x * sin(angle) + y * cos(angle),
            )
        assert pin == pytest.approx(ground['D'], abs=1e-15)


def test_residual_detects_a_tiny_loop_error():
    closure = Closure(four_bar_linkage(FOUR_BAR, 'left'))
    position = closure.position(1.0)
    position.state.coordinates[3] += 1e-9
    assert closure.residual(position) == pytest.approx(FOUR_BAR[2] * 1e-9, rel=1e-5)


def test_open_loop_has_a_gap_and_no_joints():
    closure = Closure(four_bar_linkage((0.04, 0.02, 0.03, 0.05), 'left'))
    position = closure.position(pi)
    assert (position.status, position.joints) == (Status.OPEN, ())
    assert position.gap == pytest.approx(0.04, rel=1e-15)


@pytest.mark.parametrize(
    ('lengths', 'side', 'build'),
    [
        ((0.04, 0.02, 0.03, 0.10), 'left', four_bar_linkage),
        ((0.04, 0.12, 0.03, 0.04), 'right', four_bar_linkage),
        ((0.04, 0.05, 0.10), 'ahead', inverted_slider_crank_linkage),
    ],
)
def test_linkage_that_never_closes_has_no_range(lengths, side, build):
    closure = Closure(build(lengths, side))
    assert closure.input_ranges == ()
    assert closure.position(1.0).status is Status.OPEN


def test_slide_direction_may_have_any_length():
    plain = inverted_slider_crank_linkage(SLIDER_CRANK, 'ahead', along=0.05)
    slider = plain.sliders['swivel']
    for factor in (1e-8, 1.0, 1e8):
        direction = (factor * slider.direction[0], factor * slider.direction[1])
        linkage = Linkage(
            plain.links,
            plain.inputs,
            plain.assembly,
            {'slide': SlideJoint('swivel')},
            {'swivel': Slider('C', 'rod', 'T', direction)},
        )
        expected = Closure(plain).position(1.0).joints[1]
        assert Closure(linkage).position(1.0).joints == pytest.approx((expected,), rel=1e-15)


# A step closed alone gives the same pose as in an array, to the last bit.


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', [file.stem for file in FILES])
def test_single_step_equals_the_step_within_its_closure(name):
    closure = closure_of(name)
    usual = usual_inputs(closure)
    inputs = [[value + 0.02 * i for value in usual] for i in range(-150, 150)]
    closed = [one for one in inputs if closure.position(*one).status.has_pose]
    assert usual in map(tuple, closed)
    for index in range(len(closure.steps)):
        pose = pose_alone(closure, index, *closed[0])
        for one in closed:
            assert repr(pose(*one)) == repr(closure.position(*one).poses[index])


def side_by_side(count: int) -> Closure:
    """Return four-bars that one crank drives."""
    links = {'ground': {'O': (0.0, 0.0)}, 'crank': {'O': (0.0, 0.0), 'A': (0.04, 0.0)}}
    for i in range(count):
        links['ground'][f'P{i}'] = (0.1, 0.001 * i)
        links[f'coupler{i}'] = {'A': (0.0, 0.0), f'B{i}': (0.12, 0.0)}
        links[f'rocker{i}'] = {f'P{i}': (0.0, 0.0), f'B{i}': (0.08, 0.0)}
    return Closure(
        Linkage(
            links,
            (Input('crank_joint', 'ground', 'crank'),),
            {f'B{i}': 'left' for i in range(count)},
            {'rocker_joint': RevoluteJoint('ground', 'rocker0')},
            {},
        )
    )


def test_range_search_cost_per_loop_stays_constant(monkeypatch):
    taken = []
    for count in (2, 20):
        closings = [0]
        kinds = {type(s) for s in side_by_side(1).steps if hasattr(s, 'transmission_angle')}
        with monkeypatch.context() as patch:
            for kind in kinds:
                patch.setattr(kind, 'close', counted(kind.close, closings))
            transmission_angles(InputSweep(side_by_side(count)))
        taken.append(closings[0] / count)
    # Their ranges are searched for together; without that the ratio is 10.
    assert taken[1] < 3.0 * taken[0]


def counted(close, closings):
    def counting(self, known):
        closings[0] += 1
        return close(self, known)

    return counting


# Tracked points: each moves with its link, and its rates are the derivatives of its position.
#
# Positions are compared with those of two named points of the link, which the closure computes by
# steps of their own; velocities and accelerations with differences of the positions.


# Values of the inputs: at all of them every loop closes, away from toggles.
INPUTS = {
    'four_bar': (0.7,),
    'slider_crank': (2.5,),
    'excavator_bucket': (1.05,),
    'scotch_yoke': (2.0,),
    'inverted_slider_crank': (1.7,),
    'elliptic_trammel': (0.05,),
    'whitworth_quick_return': (2.0,),
    'class_3': (1.5,),
    'windscreen_wiper': (0.4,),
    'five_bar': (1.2, 1.9),
}

OFF = 0.03 - 0.05j
"""From the first point of a link to one that has no name, in the link's frame."""


@pytest.fixture(params=INPUTS)
def case(request):
    closure = Closure(read_linkage(read_yaml(FOLDER / f'{request.param}.yaml')[0]))
    names = [(link, name) for link, points in closure.structure.links.items() for name in points]
    frames = {
        link: complex(*next(iter(p.values()))) for link, p in closure.structure.links.items()
    }
    points = [(k, complex(*closure.structure.links[k][name])) for k, name in names]
    points += [(link, first + OFF) for link, first in frames.items()]
    return closure, INPUTS[request.param], names, points


def test_point_tracker_places_equal_the_link_points(case):
    closure, inputs, names, points = case
    position = closure.position(*inputs)
    follower = closure.point_tracker(points)
    places = follower.places(position)
    expected, angles = closure.points(position), closure.link_angles(position)
    wanted = [expected[name] for name in names]
    for link, carried in closure.structure.links.items():
        wanted.append(expected[link, next(iter(carried))] + rect(1.0, angles[link]) * OFF)
    for index, place in zip(follower.indices, wanted, strict=True):
        assert places[index] == pytest.approx(place, rel=1e-14, abs=1e-15)


def test_point_tracker_rates_equal_numerical_derivatives(case):
    closure, inputs, _, points = case
    follower, step = closure.point_tracker(points), 1e-4
    rates, pulls = [0.9, -0.6][: len(inputs)], [0.4, 1.1][: len(inputs)]

    def at(t):
        moved = [q + v * t + 0.5 * a * t * t for q, v, a in zip(inputs, rates, pulls, strict=True)]
        return follower.places(closure.position(*moved))

    position = closure.position(*inputs)
    velocity = closure.velocity(position, *rates)
    acceleration = closure.acceleration(position, velocity, *pulls)
    places = follower.places(position)
    speeds = follower.velocities(position, velocity, places)
    changes = follower.accelerations(position, velocity, acceleration, places)
    before, after = at(-step), at(step)
    assert set(follower.indices) <= set(range(len(places)))
    for i in follower.indices:
        assert speeds[i] == pytest.approx((after[i] - before[i]) / (2 * step), abs=1e-6)
        bend = (after[i] - 2 * places[i] + before[i]) / step**2
        assert changes[i] == pytest.approx(bend, rel=1e-5, abs=1e-5)


def test_point_tracker_computes_a_repeated_point_once():
    closure = Closure(read_linkage(read_yaml(FOLDER / 'four_bar.yaml')[0]))
    follower = closure.point_tracker([('coupler', 0.06 + 0j)] * 3)
    assert len(set(follower.indices)) == 1


def test_ground_point_has_no_velocity():
    closure = Closure(read_linkage(read_yaml(FOLDER / 'four_bar.yaml')[0]))
    position = closure.position(1.0)
    velocity = closure.velocity(position, 5.0)
    follower = closure.point_tracker([('ground', 0.3 + 0.4j)])
    places = follower.places(position)
    assert places == [0.3 + 0.4j]
    assert follower.velocities(position, velocity, places) == [0j]
