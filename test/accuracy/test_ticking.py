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


"""What a subscriber has of the joint states when it uses them, over DDS."""

from __future__ import annotations

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
from linkage_ros.scene.load import load_scene
from linkage_ros.shipped import shipped
import pytest

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
