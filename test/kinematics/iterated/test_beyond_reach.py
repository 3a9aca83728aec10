# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""A state beyond reach is searched for once, however long its command lasts."""

from itertools import combinations
from math import dist
import random

from linkage_ros.description import load
from linkage_ros.kinematics import Closure, Grid, Status
from linkage_ros.kinematics.iterated.group import IteratedGroup
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ..defects import defect
from ..platforms import linkage_of, platform


def two_motors():
    return load('ankle_motors'), (3.0, 3.0)


def six_legs():
    return load('hexapod'), (0.002,) * 6


def one_crank():
    return defect('class3_beyond_range'), (6.75324,)


def one_slide():
    closure = Closure(linkage_of(platform(random.Random(11), turning=False), random.Random(3)))
    return closure, (closure.closing_ranges[0].highest + 0.3,)


CASES = [two_motors, six_legs, one_crank, one_slide]


def count_searches(monkeypatch):
    """Return a list that grows by one with each search for a state."""
    searches = []
    for kind in IteratedGroup.__subclasses__():
        find = kind._find_slowly

        def search(self, solved, find=find):
            searches.append(solved)
            return find(self, solved)

        monkeypatch.setattr(kind, '_find_slowly', search)
    return searches


@pytest.mark.sample(2)
@pytest.mark.parametrize('case', CASES)
def test_unreachable_state_is_searched_only_once(monkeypatch, case):
    closure, beyond = case()
    searches = count_searches(monkeypatch)
    first = closure.close_unlimited(*beyond)
    assert first.status is Status.OPEN
    assert first.gap > 0.0
    count = len(searches)
    assert count
    for _ in range(5):
        assert closure.close_unlimited(*closure.linkage.pose.inputs).status is Status.CLOSED
        again = closure.close_unlimited(*beyond)
        assert (again.status, again.gap) == (first.status, first.gap)
    assert len(searches) == count


@pytest.mark.sample(2)
@pytest.mark.parametrize('case', CASES)
def test_forgotten_unreachable_states_give_the_same_gap_again(monkeypatch, case):
    monkeypatch.setattr('linkage_ros.kinematics.iterated.group._REMEMBERED', 2)
    closure, beyond = case()
    states = [tuple(value + 0.01 * k for value in beyond) for k in range(5)]
    gaps = [closure.close_unlimited(*state).gap for state in states]
    fresh, _ = case()
    assert [fresh.close_unlimited(*state).gap for state in reversed(states)] == gaps[::-1]
    assert [closure.close_unlimited(*state).gap for state in states] == gaps


# What no pose of the links can reach is known without a search.

BASE = [(193, -52), (193, 52), (-52, 193), (-141, 141), (-141, -141), (-52, -193)]
TOP = [(85, -85), (85, 85), (31, 116), (-116, 31), (-116, -31), (31, -116)]


def test_hexapod_gap_equals_the_shortfall_of_its_legs(monkeypatch):
    closure = load('hexapod')
    legs = (0.002, 0.003, 0.002, 0.004, 0.002, 0.002)
    gaps = []
    for i, k in combinations(range(6), 2):
        bars = sorted(
            (1e-3 * dist(BASE[i], BASE[k]), 1e-3 * dist(TOP[i], TOP[k]), legs[i], legs[k])
        )
        gaps.append(bars[3] - sum(bars[:3]))
    monkeypatch.setattr(Grid, '_follow', None)
    position = closure.position(*legs)
    assert position.status is Status.OPEN
    assert position.gap == pytest.approx(max(gaps), rel=1e-12)


def test_reachable_hexapod_poses_have_no_shortfall():
    (grid,) = load('hexapod').grids
    shortfall, scale = grid._group.shortfall, load('hexapod').scale
    rng = np.random.default_rng(7)
    base, top = (np.array([(*place, 0.0) for place in places]) * 1e-3 for places in (BASE, TOP))
    for _ in range(2000):
        turn = Rotation.random(random_state=rng).as_matrix()
        # Also with the platform in the plane of the base, and legs of no length.
        ends = top @ turn.T + rng.uniform(-0.3, 0.3, 3) * rng.integers(0, 2)
        legs = np.linalg.norm(ends - base, axis=1) / scale
        assert shortfall(legs.tolist()) == 0.0
