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

"""Times of states and ticks."""

import gc
from itertools import pairwise
from statistics import median

from linkage_ros.accuracy.ticking import (
    ACCELERATION,
    CARRIED,
    CHIRP,
    HELD,
    measure_ticking,
    motions_of,
    use_states,
)
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.ranges import describe
from linkage_ros.measuring import BLOCK, Contender, FEWEST, in_turn, MOST
from linkage_ros.resources import shipped
from linkage_ros.scene.load import load_scene
import pytest

# Times are per state, of all methods in turn, and nothing else runs meanwhile.


class Clock:
    """A clock that only what is timed moves."""

    def __init__(self) -> None:
        self.now = 0.0
        self.log: list[str] = []
        self.collecting: list[bool] = []

    def __call__(self) -> float:
        return self.now

    def contender(self, name: str, seconds: float, states: int) -> Contender:
        def run() -> None:
            self.now += seconds
            self.log.append(name)
            self.collecting.append(gc.isenabled())

        return Contender(run, states)


def test_a_time_is_that_of_a_state():
    clock = Clock()
    contenders = [clock.contender('a', 0.25, 10), clock.contender('b', 2.0**-13, 1)]
    ten, one = in_turn(contenders, 1.0, clock=clock)
    assert ten == pytest.approx((0.025,) * 3)
    assert one == pytest.approx((2.0**-13,) * 3)


def test_blocks_follow_each_other_there_and_back():
    clock = Clock()
    in_turn([clock.contender(name, 1.0, 1) for name in 'abc'], 0.0, clock=clock)
    # Twice each to warm up and to see how long it takes; then round by round.
    assert ''.join(clock.log) == 'aabbcc' + 'abccbaabccbaabc'
    assert FEWEST == 5


def test_a_short_run_is_repeated_until_its_block_is_long_for_the_clock():
    clock = Clock()
    in_turn([clock.contender('a', BLOCK / 64, 1)], 0.0, clock=clock)
    assert len(clock.log) == 2 + 64 * FEWEST


def test_rounds_fill_the_time_and_no_more_than_is_of_use():
    for seconds, rounds in ((10.0, 10), (1e9, MOST)):
        clock = Clock()
        in_turn([clock.contender('a', 0.5, 1), clock.contender('b', 0.5, 1)], seconds, clock=clock)
        assert clock.log.count('b') == 2 + rounds


def test_no_garbage_is_collected_within_a_block_and_it_is_afterwards():
    clock = Clock()
    in_turn([clock.contender('a', 1.0, 1)], 0.0, clock=clock)
    assert clock.collecting == [True, True] + [False] * FEWEST
    assert gc.isenabled()


def test_collection_is_switched_on_again_where_a_method_raises():
    calls = iter([None, None, None])

    def run() -> None:
        next(calls)

    with pytest.raises(StopIteration):
        in_turn([Contender(run, 1)], 0.0, clock=Clock())
    assert gc.isenabled()


def test_progress_ends_at_one():
    clock, told = Clock(), []
    in_turn([clock.contender('a', 1.0, 1)], 0.0, told.append, clock=clock)
    assert told == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])


def test_of_nothing_there_are_no_times():
    assert in_turn([], 1.0) == []


# The error of the joint states when a subscriber uses them, over DDS.


LINKAGES = ('four_bar', 'double_rocker', 'scotch_yoke', 'excavator_bucket', 'class_3')


def linkage_of(name):
    return load_scene(shipped(f'linkages/{name}.yaml')).members[0].linkage


@pytest.mark.parametrize('name', LINKAGES)
@pytest.mark.parametrize('motion', [CHIRP, ACCELERATION])
def test_the_crank_stays_where_the_loops_close(name, motion):
    closure = Closure(linkage_of(name))
    crank = motions_of(closure, 2.0).by_name[motion]
    for k in range(201):
        value, _ = crank(k * 10_000_000)
        assert closure.position(value).joints, f'{value}, of {describe(closure.input_ranges)}'


@pytest.mark.parametrize('motion', [CHIRP, ACCELERATION])
def test_the_rate_is_that_of_the_value(motion):
    motions = motions_of(Closure(linkage_of('four_bar')), 2.0)
    crank, step = motions.by_name[motion], 1000
    times = range(10_000_000, 1_990_000_000, 12_345_678)
    for time in times:
        (before, _), (_, rate), (after, _) = (crank(time + d) for d in (-step, 0, step))
        assert (after - before) / (2 * step * 1e-9) == pytest.approx(rate, abs=1e-4, rel=1e-4)
        assert abs(rate) <= motions.greatest[motion][0] * (1 + 1e-3)
    steps = [(b - a) / 0.012345678 for a, b in pairwise(crank(t)[1] for t in times)]
    assert max(map(abs, steps)) <= motions.greatest[motion][1] * (1 + 1e-3)


@pytest.fixture(scope='module')
def used(tmp_path_factory):
    """Return what one meets at 50 ticks a second who uses a rocker that turns as its crank."""
    return use_states(tmp_path_factory.mktemp('ticking'), linkage_of('parallelogram'), 50.0, 1.0)


@pytest.mark.ros
def test_states_are_used_in_both_motions(used):
    assert [each.motion for each in used] == [CHIRP, ACCELERATION]
    for each in used:
        assert len(each.age) == len(each.errors[HELD]) == len(each.errors[CARRIED]) > 100
        assert min(each.age) > 0.0
        assert 0.0 <= each.cpu < 2.0


@pytest.mark.ros
def test_angles_that_run_on_are_compared_as_directions(tmp_path):
    # The first joints of a leg come out a turn away from where the closure alone has them.
    for each in use_states(tmp_path, linkage_of('jansen_leg'), 200.0, 0.5):
        assert median(each.errors[CARRIED]) < 0.5


@pytest.mark.ros
def test_what_is_held_is_behind_by_rate_times_age(used):
    accelerated = used[1]
    # ω grows from 0 to 10 rad/s; the crank that the node has is carried, and may be older still.
    behind = [
        error / age for error, age in zip(accelerated.errors[HELD], accelerated.age, strict=True)
    ]
    assert 1.0 < median(behind) < 10.5


@pytest.mark.ros
def test_what_is_carried_forward_is_behind_by_the_square_of_the_age(used):
    accelerated = used[1]
    assert median(accelerated.errors[CARRIED]) < 0.1 * median(accelerated.errors[HELD])


def test_several_inputs_have_no_such_part():
    scene = load_scene(shipped('linkages/five_bar.yaml'))
    assert measure_ticking(scene, True, lambda *said: None) is None


@pytest.mark.ros
def test_the_part_says_what_a_rate_buys(monkeypatch):
    monkeypatch.setattr('linkage_ros.accuracy.ticking.QUICK_RATES', (25, 250))
    part = measure_ticking(load_scene(shipped('scenes/demo.yaml')), True, lambda *said: None)
    (table,) = part.tables
    assert [row[:2] for row in table.rows] == [
        (rate, motion) for rate in (25, 250) for motion in (CHIRP, ACCELERATION)
    ]
    assert all(len(row) == len(table.columns) for row in table.rows)
    for diagram in part.diagrams:
        assert [curve.name for curve in diagram.curves] == [
            f'{motion}, {way}' for motion in (CHIRP, ACCELERATION) for way in (HELD, CARRIED)
        ]
        assert {len(curve.points) for curve in diagram.curves} == {2}
        # A mark is the median, between the quartiles of its arms.
        for point in (point for curve in diagram.curves for point in curve.points):
            assert point.y_spread.low <= point.y <= point.y_spread.high
    assert len(part.advice) == 4
    assert len(part.sentences) == 3
    assert [(rate.rate, rate.use) for rate in part.rates] == [
        (rate, use) for rate in (25, 250) for use in (HELD, CARRIED)
    ]
