# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""What is found over a range: its limits as a user says them, extremes, residuals, four-bars."""

from __future__ import annotations

from dataclasses import replace
from math import acos, cos, degrees, hypot, pi, radians, remainder, sin, sqrt, tau
from pathlib import Path
import random

from hypothesis import given
from hypothesis import strategies as st
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.four_bars import four_bars
from linkage_ros.kinematics.linkage import Pose
from linkage_ros.kinematics.ranges import InputRange
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.survey import (
    extremes,
    grid,
    samples,
    transmission_angles,
    usual_inputs,
    Way,
    worst_residual,
)
import pytest

from .linkages import four_bar_linkage
from .test_gallery import closure_of as shipped

LINKAGES = Path(__file__).parents[2] / 'config' / 'linkages'
FILES = sorted(LINKAGES.glob('*.yaml'))


def four_bar(a: float, b: float, c: float, d: float) -> Way:
    return Way(Closure(four_bar_linkage((a, b, c, d), 'left')))


def test_a_full_turn_begins_at_0() -> None:
    assert four_bar(2.0, 7.0, 9.0, 6.0).ranges == (InputRange(0.0, tau),)


def test_a_single_change_point_needs_two_turns() -> None:
    assert four_bar(1.0, 4.0, 3.0, 2.0).ranges == (InputRange(0.0, 2.0 * tau),)
    assert four_bar(1.0, 2.0, 1.0, 2.0).ranges == (InputRange(0.0, tau),)  # a parallelogram: one


def test_a_limited_range_lies_about_its_middle() -> None:
    """Its limit follows from one triangle: O, B and a point that is 0.075 m from B."""
    ((low, high, *_),) = Way(shipped('peaucellier')).ranges
    # The arms close where |OB| = 0.125 − 0.05, and |OB| = 2·0.05·cos(φ/2).
    limit = 2.0 * acos(0.75)
    assert low == pytest.approx(-limit, abs=1e-14)
    assert high == pytest.approx(limit, abs=1e-14)


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_every_shipped_linkage_has_a_usual_pose_inside_its_range(file: Path) -> None:
    closure = shipped(file.stem)
    inputs = usual_inputs(closure)
    assert closure.position(*inputs).status is Status.CLOSED
    interval = Way(closure, inputs).range_about(inputs[0])
    assert interval is not None
    assert interval.lowest < inputs[0] < interval.highest


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_every_shipped_linkage_closes_to_rounding_all_over_its_range(file: Path) -> None:
    closure = shipped(file.stem)
    found = worst_residual(closure)
    assert found is not None
    worst, at, count = found
    assert worst < 1e-14 * closure.scale
    assert closure.residual(closure.position(*at)) == worst
    assert count > 400


# A pose, and where a linkage is shown and starts then; of a crank-rocker, and one that folds.
POSES = {
    'none': ((2.0, 7.0, 9.0, 6.0), None, radians(60.0)),
    'a start': ((2.0, 7.0, 9.0, 6.0), Pose((0.436,), {}), 0.436),
    'a start some turns away': ((2.0, 7.0, 9.0, 6.0), Pose((-20.0,), {}), -20.0),
    'a start of one that folds': ((4.0, 8.0, 3.0, 6.0), Pose((2.5,), {}), 2.5),
    # It closes beyond acos(27/48) only: from there to as far on the other side, two thirds.
    'a start where it is open': (
        (4.0, 8.0, 3.0, 6.0),
        Pose((0.5,), {}),
        acos(0.5625) + (tau - 2.0 * acos(0.5625)) * 2.0 / 3.0,
    ),
    'where an iteration would start': (
        (2.0, 7.0, 9.0, 6.0),
        Pose((0.436,), {'A': (1.8, 0.8)}),
        radians(60.0),
    ),
}


@pytest.mark.parametrize('kind', POSES)
def test_a_pose_without_points_says_where_a_linkage_starts(kind: str) -> None:
    lengths, pose, expected = POSES[kind]
    linkage = replace(four_bar_linkage(lengths, 'left'), pose=pose)
    assert usual_inputs(Closure(linkage)) == (pytest.approx(expected, abs=1e-14),)


@pytest.mark.parametrize(
    ('inputs', 'expected'),
    [((1.3, 1.7), (1.3, 1.7)), ((pi, 0.0), (radians(60.0), radians(60.0)))],
    ids=['closes', 'open: the elbows are 0.3 m apart, 0.22 at most'],
)
def test_several_inputs_start_from_their_pose(
    inputs: tuple[float, float], expected: tuple[float, float]
) -> None:
    linkage = replace(shipped('five_bar').linkage, pose=Pose(inputs, {}))
    assert usual_inputs(Closure(linkage)) == pytest.approx(expected)


def test_the_other_inputs_are_held_along_a_way() -> None:
    """The elbows of the five-bar are 0.22 m apart at the ends of the left crank's way."""
    closure = shipped('five_bar')
    way = Way(closure, (radians(60.0), radians(60.0)))
    ((low, high, *_),) = way.ranges
    b = complex(0.12 + 0.09 * cos(radians(60.0)), 0.09 * sin(radians(60.0)))
    for end in (low, high):
        a = complex(0.09 * cos(end), 0.09 * sin(end))
        assert abs(b - a) == pytest.approx(0.22, abs=1e-14)
    assert way.closes(radians(60.0))
    assert not way.closes(high + 1e-9)


def test_a_range_is_found_from_any_turn() -> None:
    way = four_bar(4.0, 8.0, 3.0, 6.0)  # folds: its range is about 180 degrees
    (interval,) = way.ranges
    middle = 0.5 * (interval.lowest + interval.highest)
    found = way.range_about(middle - 3.0 * tau)
    assert found is not None
    assert found.lowest == pytest.approx(interval.lowest - 3.0 * tau)
    assert way.range_about(0.0) is None


@pytest.mark.parametrize('whole', [True, False])
def test_samples_go_from_end_to_end(whole: bool) -> None:
    interval = InputRange(0.0, tau) if whole else InputRange(-0.7, 1.1)
    values = samples(interval, 50)
    assert values[0] == interval.lowest
    assert values[-1] == interval.highest
    assert values == sorted(values)
    assert len(values) == 51


@given(st.floats(-3.0, 3.0), st.floats(0.05, 2.0), st.floats(0.0, 0.9), st.integers(1, 7))
def test_extremes_are_found_wherever_they_lie(
    place: float, size: float, other: float, times: int
) -> None:
    """A cosine with a smaller one of a higher order: lowest value known where they agree."""

    def function(x: float) -> float:
        return -size * cos(x - place) - other * 0.1 * size * cos(times * (x - place))

    found = extremes(function, [InputRange(0.0, tau)])
    assert found.lowest.value == pytest.approx(function(place), rel=1e-12)
    # A value within 1e-13 of the best counts as the best: at a curvature of the size, so far off.
    off = sqrt(2e-13 / size)
    assert any(abs(remainder(at - place, tau)) < 1.1 * off for at in found.lowest.at)


def test_what_does_not_change_has_its_extreme_nowhere() -> None:
    found = extremes(lambda _: 1.25, [InputRange(0.0, tau)])
    assert found == ((1.25, ()), (1.25, ()))


def test_the_ends_of_a_limited_range_count() -> None:
    found = extremes(lambda x: x, [InputRange(-0.5, 2.0)])
    assert found == ((-0.5, (-0.5,)), (2.0, (2.0,)))


def test_the_least_transmission_angle_of_a_crank_rocker_is_that_of_the_textbook() -> None:
    """It is met where the crank lies along the ground: cos μ = (b² + c² − (d ∓ a)²)/(2bc)."""
    rng = random.Random(7)
    for _ in range(20):
        a = rng.uniform(0.5, 1.0)
        b, c, d = (rng.uniform(2.0, 3.0) for _ in range(3))
        if a + max(b, c, d) >= b + c + d - max(b, c, d):
            continue
        angles = [acos((b * b + c * c - s * s) / (2.0 * b * c)) for s in (d - a, d + a)]
        folded = [min(angle, pi - angle) for angle in angles]
        ((_, found),) = transmission_angles(four_bar(a, b, c, d)).items()
        assert found.lowest.value == pytest.approx(min(folded), abs=1e-12)
        assert found.lowest.at == (pytest.approx((0.0, pi)[folded.index(min(folded))], abs=1e-6),)
        if angles[0] < pi / 2.0 < angles[1]:
            assert found.highest.value == pytest.approx(pi / 2.0, abs=1e-12)


def test_a_slider_crank_s_is_least_where_the_crank_pin_is_farthest_from_the_line() -> None:
    ((_, found),) = transmission_angles(Way(shipped('slider_crank'))).items()
    assert degrees(found.lowest.value) == pytest.approx(degrees(acos(0.05 / 0.14)), abs=1e-9)
    assert [degrees(at) for at in found.lowest.at] == [pytest.approx(270.0, abs=1e-5)]


def test_a_chain_s_four_bars_are_seen_from_what_is_known_first() -> None:
    first, second = four_bars(shipped('watt_1').structure)
    assert first.links == ('crank', 'coupler', 'rocker', 'ground')
    assert second.links == ('rocker', 'output_link', 'upper_link', 'coupler')
    # B to D on the rocker, D to E, E to C, C to B on the coupler.
    known = (hypot(0.01, 0.05), 0.1, 0.08, hypot(0.03, 0.05))
    assert second.lengths == pytest.approx(known, rel=1e-15)


@pytest.mark.parametrize(
    ('name', 'count'), [('klann_leg', 1), ('stephenson_3', 1), ('five_bar', 0)]
)
def test_a_loop_of_five_links_is_no_four_bar(name: str, count: int) -> None:
    assert len(list(four_bars(shipped(name).structure))) == count


def test_a_dyad_that_an_input_stretches_is_no_four_bar() -> None:
    (bar,) = four_bars(shipped('excavator_bucket').structure)
    assert bar.links == ('rocker', 'bucket_link', 'bucket', 'ground')


def test_a_grid_goes_over_all_inputs() -> None:
    found = list(grid(shipped('five_bar'), 6))
    assert len({inputs for inputs, _ in found}) == len(found) == 36
