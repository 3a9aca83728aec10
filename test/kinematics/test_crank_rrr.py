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
"""The dyad that is written out is the one that is not, to the last bit, wherever it applies."""

from __future__ import annotations

from linkage_ros.kinematics.dyads.crank_rrr import CrankRRRDyad
from linkage_ros.kinematics.dyads.rrr import crank_diagonal, RRRDyad
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import State
import pytest

from .samples import FOUR_BARS, four_bars

COUNT = 2000


def motion(dyad: RRRDyad, phi: float) -> tuple[Status, float, State, State, State]:
    """Return status, gap and what a dyad appends to positions, velocities and accelerations."""
    known, speeds, changes = (State([0.1, value], []) for value in (phi, 1.7, -0.6))
    pose = dyad.close(known)
    if pose.status is Status.CLOSED:
        rates = dyad.rates(pose, known, speeds)
        dyad.accelerations(pose, rates, known, speeds, changes)
    return pose.status, pose.gap, known, speeds, changes


@pytest.mark.parametrize('family', FOUR_BARS)
def test_it_gives_the_same_bits(family: str) -> None:
    compared = 0
    for a, b, c, d, phi, sign in four_bars(family, COUNT):
        diagonal = crank_diagonal(a, b, c, d, offset=0.2)
        if not CrankRRRDyad.fits(diagonal):
            continue
        plain = motion(RRRDyad(diagonal, b, c, sign), phi)
        assert motion(CrankRRRDyad(diagonal, b, c, sign), phi) == plain, (a, b, c, d, phi, sign)
        compared += 1
    assert compared >= (10 if family == 'short pair' else COUNT / 10)


def test_it_leaves_change_points_and_short_pairs_alone() -> None:
    assert CrankRRRDyad.fits(crank_diagonal(0.04, 0.12, 0.08, 0.1))
    assert not CrankRRRDyad.fits(crank_diagonal(0.3, 1.6, 0.3, 1.6))
    assert not CrankRRRDyad.fits(crank_diagonal(2.0, 0.6, 0.5, 1.9))
