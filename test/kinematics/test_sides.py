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
One rule of sides for all dyads, also at change points (docs/conventions.md).

Where a linkage folds flat, the named side holds while the crank points to one side of the line on
which it folds; beyond it the linkage goes on as it moves. Sides are read off the points' places.
"""

from __future__ import annotations

from math import pi, remainder, tau
import random

from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.status import Status
import pytest

from .defects import defect
from .flat_linkages import FLAT, Flat

COUNT = 150
_STEP = 1e-6


def drawn(kind: str, number: int) -> Flat:
    return FLAT[kind](random.Random(f'sides/{kind}/{number}'))


@pytest.mark.parametrize('kind', FLAT)
def test_the_named_side_holds_on_one_side_of_the_line_on_which_it_folds(kind: str) -> None:
    for number in range(COUNT):
        flat = drawn(kind, number)
        closure = Closure(flat.linkage)
        (side,) = flat.linkage.assembly.values()
        named = 1.0 if side in ('left', 'ahead') else -1.0
        low, high = flat.holds
        for part in (0.02, 0.3, 0.6, 0.98):
            crank = low + part * (high - low)
            position = closure.position(flat.sign * crank)
            if position.status is Status.OPEN:
                continue
            met = flat.side(closure.points(position))
            assert named * met > 0.0, (number, crank, flat)


@pytest.mark.parametrize('kind', FLAT)
def test_the_linkage_goes_on_through_its_change_points_as_it_moves(kind: str) -> None:
    for number in range(COUNT // 3):
        flat = drawn(kind, number)
        closure = Closure(flat.linkage)
        for at in flat.at:
            before, here, after = (
                closure.position(flat.sign * (at + off)) for off in (-_STEP, 0.0, _STEP)
            )
            assert here.status is Status.CHANGE_POINT, flat
            if Status.OPEN in (before.status, after.status):
                continue
            # A motion that turned back would be off by as much as it moves.
            rates = closure.velocity(here, 1.0).joints
            for j, turning in enumerate(closure.turning):
                x, y, z = (position.joints[j] for position in (before, here, after))
                moved = [y - x, z - y]
                if turning:
                    moved = [remainder(part, tau) for part in moved]
                for part in moved:
                    assert abs(part - flat.sign * _STEP * rates[j]) < 1e-3 * _STEP, (number, flat)


@pytest.mark.parametrize(
    ('name', 'joint', 'expected'),
    [
        # The block's pin lies 1.793 m ahead of the rail's, at a crank angle of 30 degrees.
        ('inv_ahead', 'b', 1.793151),
        # A millionth of a length off the change point it is the same assembly.
        ('inv_ahead2', 'b', 1.793153),
        # |AD| = 2 sin 15°, with the rail on the ground.
        ('straight_rev_ahead', 'r', 0.517638),
        ('straight_rev_behind', 'r', -0.517638),
    ],
)
def test_a_rail_on_the_ground_has_the_named_side(name: str, joint: str, expected: float) -> None:
    closure = defect(name)
    position = closure.position(pi / 6.0)
    value = position.joints[list(closure.linkage.joints).index(joint)]
    assert value == pytest.approx(expected, abs=1e-6)
