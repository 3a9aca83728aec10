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


"""
Dyads on a rocker that lie flat, have parallel lines, or whose pins meet.

The rocker is that of a parallelogram: it turns as the crank does, so that all that follows is
known without solving anything.
"""

from __future__ import annotations

from math import cos, pi, remainder

from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.status import Status
import numpy as np
import pytest

from ..support.scenes import closure_of

PARALLELOGRAM = """
links:
  ground:  {{O2: [0, 0], O4: [2, 0]{ground}}}
  crank:   {{O2: [0, 0], A: [1, 0]}}
  coupler: {{A: [0, 0], B: [2, 0]}}
  rocker:  {{O4: [0, 0], B: [1, 0], C: [0, 1]}}
  {link}
sliders:
  S: {slider}
input: {{joint: crank_joint, parent: ground, child: crank}}
assembly: {{B: left{side}}}
joints:
  s: {{slider: S}}
"""
"""The rocker's pin C lies a quarter of a turn ahead of its B."""


def closure(slider: str, link: str = '', ground: str = '', side: str = ', S: ahead') -> Closure:
    text = PARALLELOGRAM.format(slider=slider, link=link, ground=ground, side=side)
    return closure_of(text)


def statuses_at(solved: Closure, value: float) -> set[Status]:
    return {
        one.status
        for one in solved.singular_inputs
        if abs(remainder(one.value - value, 2 * pi)) < 1e-6
    }


def test_a_rod_as_long_as_the_rocker_goes_on_through_both_of_its_change_points() -> None:
    # C at the height cos φ over the line, the rod 1: it lies flat where the rocker is across, and
    # C and the rod's end are mirrored then: s = 2·cos(φ + π/2).
    solved = closure(
        '{point: E, along: ground, through: O4, direction: [1, 0]}',
        'rod: {C: [0, 0], E: [1, 0]}',
    )
    values = np.linspace(-3.0, 3.0, 41) + 0.001
    batch = solved.solve(values)
    sign = 0.0
    for k, value in enumerate(values):
        position = solved.position(value)
        assert position.status is Status.CLOSED
        wanted = 2.0 * cos(value + 0.5 * pi)
        # The named side says which of both motions it is: the one that starts ahead.
        sign = sign or position.joints[0] / wanted
        assert position.joints[0] == pytest.approx(sign * wanted, abs=1e-12)
        assert batch.positions[0, k] == pytest.approx(sign * wanted, abs=1e-12)
    assert sign == pytest.approx(1.0)
    assert statuses_at(solved, 0.0) == statuses_at(solved, pi) == {Status.CHANGE_POINT}


def test_where_the_pins_of_a_straight_rod_meet_in_a_chain_no_pose_can_be_told() -> None:
    solved = closure(
        '{point: D, along: rod, through: C, direction: [1, 0]}',
        'rod: {C: [0, 0]}',
        ', D: [2.6, 0.8]',
    )
    # C stands at the angle φ + π/2, the swivel at the direction of (3, 4).
    meeting = np.arctan2(0.8, 0.6) - 0.5 * pi
    assert Status.INDETERMINATE in statuses_at(solved, meeting)
    near = solved.nearness(solved.position(meeting + 0.01))
    assert near.toggle_distance == pytest.approx(0.01, abs=1e-6)


@pytest.mark.parametrize('turn', np.arange(0.1, 1.5, 0.1).tolist())
def test_where_two_lines_are_parallel_in_a_chain_no_pose_can_be_told(turn: float) -> None:
    solved = closure(
        '{point: E, block: one, along: ground, through: O2, direction: '
        f'[{np.cos(turn)}, {np.sin(turn)}]}}\n'
        '  T: {point: E, along: rocker, through: C, direction: [1, 0]}',
        'one: {E: [0, 0]}',
        side='',
    )
    for value in (turn, turn - pi):
        assert statuses_at(solved, value) == {Status.INDETERMINATE}
