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

"""Poses are near what they claim, errors repeat to the last bit, and advice follows from data."""

from math import inf, nan, pi

from linkage_ros.accuracy.methods import Method
from linkage_ros.accuracy.poses import (
    DISTANCES,
    easy,
    Errors,
    five_dyads,
    near_change_point,
    near_toggle,
    off,
    pose_sets,
    Poses,
    position_errors,
    shipped_linkage,
)
from linkage_ros.accuracy.reference import Reference
from linkage_ros.accuracy.solving import judge, KNOTS, Measured, true_states
from linkage_ros.accuracy.solving_results import advice, part_of
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.topology import Dyad
from linkage_ros.measuring import Spread
from mpmath import mp, mpf
import pytest

EVERYWHERE = ('four_bar', 'double_rocker', 'jansen_leg', 'excavator_bucket', 'elliptic_trammel',
              'five_bar', 'class_3')  # fmt: skip


# Poses.


@pytest.mark.parametrize('name', EVERYWHERE)
def test_easy_poses_are_many_different_closed_and_away_from_trouble(name):
    closure = Closure(shipped_linkage(name))
    poses = easy(closure, 24)
    assert len(poses) == len(set(poses)) == 24
    for inputs in poses:
        near = closure.singularity_margin(closure.position(*inputs))
        assert near.conditioning > 0.02
        # Of an input that slides the distance is in metres.
        assert near.toggle_distance > (0.005 if closure.linkage.inputs[0].slider else 0.05)


def test_easy_poses_are_a_path_there_and_back():
    values = [x for (x,) in easy(Closure(shipped_linkage('four_bar')), 40)]
    span = max(values) - min(values)
    assert span > 0.95 * 2 * pi
    steps = [abs(b - a) for a, b in zip(values, values[1:] + values[:1], strict=True)]
    assert max(steps) < 2.5 * span / 40


@pytest.mark.parametrize('count', [48, 128])
def test_easy_poses_lie_anywhere_between_the_knots_of_tables(count):
    values = [x for (x,) in easy(Closure(shipped_linkage('four_bar')), count)]
    for knots in KNOTS:
        places = [(x + pi) / (2 * pi) * knots % 1.0 for x in values]
        assert min(places) < 0.2 < 0.8 < max(places), knots


def test_poses_near_a_toggle_are_as_far_from_it_as_they_say():
    linkage = shipped_linkage('double_rocker')
    inputs, distances = near_toggle(Closure(linkage))
    assert distances == DISTANCES
    a, b, c, d = (mpf(x) for x in (0.2, 0.08, 0.2, 0.16))
    with mp.workdps(40):
        # Coupler and right rocker in line: (b ± c)² = a² + d² − 2ad·cos φ.
        cosines = [(a**2 + d**2 - (b + sign * c) ** 2) / (2 * a * d) for sign in (1, -1)]
        limits = [mp.acos(cosine) for cosine in cosines]
        for (x,), distance in zip(inputs, distances, strict=True):
            away = min(abs(abs(x) - limit) for limit in limits)
            assert abs(away - distance) < 1e-15 + 1e-9 * distance
    assert min(distances) < 1.001e-9 < 0.999e-2 < max(distances)


def test_poses_at_a_change_point_pass_through_it():
    inputs, distances = near_change_point(Closure(shipped_linkage('parallelogram')))
    values = [x for (x,) in inputs]
    assert values == sorted(values)
    assert values == [-x for x in reversed(values)]
    assert [abs(x) for x in values] == list(distances)
    for distance in (1e-3, 1e-6, 1e-9):
        assert any(abs(x - distance) < 1e-6 * distance for x in values)


def test_what_a_linkage_does_not_have_a_guest_shows():
    sets = {poses.key: poses for poses in pose_sets('mine', shipped_linkage('four_bar'), 8)}
    assert {key: (poses.name, poses.own) for key, poses in sets.items()} == {
        'easy': ('mine', True),
        'toggle': ('double_rocker', False),
        'change_point': ('parallelogram', False),
        'five_dyads': ('chain of five four-bars', False),
        'class_3': ('class_3', False),
    }
    own = {poses.key: poses.own for poses in pose_sets('p', shipped_linkage('parallelogram'), 8)}
    assert own['change_point']
    own = {poses.key: poses.own for poses in pose_sets('p', shipped_linkage('double_rocker'), 8)}
    assert own['toggle']


def test_the_chain_has_five_dyads_and_closes_everywhere():
    closure = Closure(five_dyads())
    assert [isinstance(group, Dyad) for group in closure.structure.groups].count(True) == 5
    (interval,) = closure.input_ranges
    assert interval.whole


# Errors.


def poses_of(name: str, *inputs: float, key: str = 'easy', away: float = 0.0) -> Poses:
    states = tuple((x,) for x in inputs)
    return Poses(key, key, name, shipped_linkage(name), states, (away,) * len(states))


def test_an_angle_counts_modulo_a_turn_and_a_slide_by_the_size():
    linkage = shipped_linkage('slider_crank')
    truth = Reference(linkage).solve([1.0])
    turning = Closure(linkage).turning
    assert sorted(turning) == [False, True]
    joints = [float(x) for x in truth.joints]
    size = max(
        abs(complex(*p) - complex(*q)) for points in linkage.links.values()
        for p in points.values() for q in points.values()
    )  # fmt: skip
    assert off(linkage, [x + 8 * pi * t for x, t in zip(joints, turning, strict=True)],
               truth) < 1e-14  # fmt: skip
    assert off(linkage, [x + 1e-3 * t for x, t in zip(joints, turning, strict=True)],
               truth) == pytest.approx(1e-3)  # fmt: skip
    assert off(linkage, [x + 1e-3 * (not t) for x, t in zip(joints, turning, strict=True)],
               truth) == pytest.approx(1e-3 / size)  # fmt: skip


def test_no_answer_and_another_pose_count_as_failed():
    poses = poses_of('four_bar', 0.5, 1.0, 1.5, 2.0)
    truths = true_states(poses)
    answers = {
        inputs: [float(x) + by for x in truth.joints]
        for inputs, truth, by in zip(poses.inputs, truths, (1e-5, 0.5, nan, 1e-3), strict=True)
    }
    method = Method('made up', '', lambda x: answers[x,] if x != 2.0 else ())
    errors = position_errors(method, poses, truths)
    assert errors.failed == 0.75
    assert errors.each[1:] == (None, None, None)
    assert errors.worst == errors.middle == pytest.approx(1e-5)


def test_next_to_a_change_point_the_other_assembly_is_a_failure():
    poses = poses_of('parallelogram', 1e-4, 1e-4, key='change_point', away=1e-4)
    truths = true_states(poses)
    answers = iter([[float(x) + by for x in truths[0].joints] for by in (1e-6, 2e-4)])
    errors = position_errors(Method('made up', '', lambda _: next(answers)), poses, truths)
    assert errors.failed == 0.5
    assert errors.worst == pytest.approx(1e-6)


def test_what_remembers_is_judged_on_its_second_way():
    poses = poses_of('four_bar', 0.5, 1.0)
    truths = true_states(poses)
    calls: list[float] = []

    def position(x: float) -> list[float]:
        calls.append(x)
        by = 0.05 if len(calls) == 1 else 0.0
        return [float(joint) + by for joint in truths[x == 1.0].joints]

    errors = position_errors(Method('made up', '', position, remembers=True), poses, truths)
    assert calls == [0.5, 1.0, 0.5, 1.0]
    assert (errors.worst or inf) < 1e-15


def test_errors_of_two_runs_are_the_same_to_the_last_bit():
    linkage = shipped_linkage('four_bar')
    poses = Poses('easy', 'easy poses', 'four_bar', linkage, easy(Closure(linkage), 6))
    one, other = (
        [(x.method.name, x.method.setting, x.position, x.motion, x.batch)
         for x in judge(poses, quick=True)]
        for _ in range(2)
    )  # fmt: skip
    assert one == other
    assert len(one) > 15


# Texts and diagrams.


def found(name: str, micros: float, error: float, key: str = 'easy', spread: float = 0.01,
          failed: float = 0.0, setting: str = '') -> Measured:  # fmt: skip
    poses = Poses(key, f'at {key}', 'some', shipped_linkage('four_bar'), ((1.0,),), (1e-3,))
    errors = Errors((error,), failed)
    time = Spread(*(1e-6 * micros * (1.0 + k * spread) for k in (-1, 0, 1)))
    return Measured(poses, Method(name, setting, lambda _: ()), errors, None, None,
                    {'position': time})  # fmt: skip


def test_where_the_closed_form_wins_everywhere_advice_says_so_plainly():
    (said,) = advice([found('closed form', 2.0, 1e-16), found('table, Hermite', 3.0, 1e-7)])
    assert said.startswith('The closed form wins at every accuracy')


def test_where_another_is_cheaper_advice_names_it_for_what_it_reaches():
    said = advice([
        found('closed form', 2.0, 1e-16),
        found('table, Hermite', 1.0, 5e-7, setting='256 knots'),
        found('table, Hermite', 1.2, 5e-10, setting='4096 knots'),
        found('table, Hermite', 0.5, 1e-16, failed=0.01),
    ])  # fmt: skip
    assert 'For 0.001 rad at easy poses: table, Hermite, 256 knots, 1 µs' in said[0]
    assert '2 times as fast as the closed form' in said[0]
    assert 'For 1e-06 rad at easy poses: table, Hermite, 256 knots' in said[1]
    assert 'For 1e-09 rad at easy poses: table, Hermite, 4096 knots' in said[2]
    assert 'For 1e-12 rad at easy poses: closed form' in said[3]


def test_what_a_scene_cannot_have_is_not_advised():
    (said,) = advice([found('closed form', 2.0, 1e-16), found('textbook form', 1.0, 1e-16)])
    assert said.startswith('The closed form wins')


def test_what_is_cheaper_within_the_spread_only_does_not_win():
    (said,) = advice(
        [found('closed form', 2.0, 1e-16, spread=0.1), found('table, Hermite', 1.9, 1e-16)]
    )
    assert 'wins at every accuracy' in said


def test_advice_says_where_the_cheapest_does_not_hold():
    said = advice([
        found('closed form', 2.0, 1e-16),
        found('table, Hermite', 1.0, 1e-16),
        found('table, Hermite', 1.0, 1e-2, key='toggle'),
        found('table, Hermite', 1.0, 1e-16, key='change_point', failed=0.5),
    ])  # fmt: skip
    assert 'but not at toggle or at change_point' in said[0]


def test_of_what_takes_the_same_time_the_smallest_table_is_named():
    large, small = (
        found('table, Hermite', 1.0 + by, 1e-7, setting=f'{knots} knots')
        for by, knots in ((0.0, 1024), (0.001, 64))
    )
    large = large._replace(method=large.method._replace(memory=16384))
    small = small._replace(method=small.method._replace(memory=1024))
    said = advice([found('closed form', 2.0, 1e-16), large, small])
    assert 'table, Hermite, 64 knots' in said[0]


@pytest.mark.parametrize(
    ('other', 'said'),
    [
        (found('textbook form', 3.0, 1e-16), 'nothing measured is cheaper'),
        (found('textbook form', 1.99, 1e-16), 'nothing measured is cheaper'),
        (found('textbook form', 1.0, 1e-7), 'nothing cheaper is within 9 digits of it'),
        (found('textbook form', 1.0, 5e-16), 'textbook form is as exact in 1 µs'),
        (found('textbook form', 1.0, 1e-16, failed=0.1), 'nothing measured is cheaper'),
    ],
)
def test_the_headline_names_the_nearest_of_what_is_cheaper(other, said):
    some = [found('closed form', 2.0, 1e-16, key) for key in ('easy', 'toggle', 'change_point')]
    part = part_of([*some, other], quick=True)
    assert part.headline == f'Exact to 1e-16 rad in 2 µs; {said}.'


def test_a_part_shows_every_method_with_its_setting_and_its_failures():
    some = [
        one
        for key in ('easy', 'toggle', 'change_point')
        for one in (
            found('closed form', 2.0, 0.0, key),
            found('table, Hermite', 1.0, 1e-5, key, setting='16 knots'),
            found('table, Hermite', 1.0, 1e-7, key, setting='64 knots', failed=0.25),
        )
    ]
    part = part_of(some, quick=True)
    diagrams = {diagram.key: diagram for diagram in part.diagrams}
    assert {'solving_easy', 'solving_toggle', 'solving_change_point'} <= set(diagrams)
    closed, table = diagrams['solving_easy'].curves
    # What is exactly right has a place on a logarithmic axis.
    assert closed.points[0].y == 1e-18
    assert closed.points[0].x == pytest.approx(2.0)
    assert [point.setting for point in table.points] == [
        '16 knots',
        '64 knots, fails at 25% of the poses',
    ]
    assert table.joined
    tables = {table.key: table for table in part.tables}
    assert len(tables) == len(part.tables)
    for table in tables.values():
        assert all(len(row) == len(table.columns) for row in table.rows)
    assert tables['solving_easy'].rows[0][3] == 0.0
