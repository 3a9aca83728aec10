# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Linkages that solvers are tried on, and what they are held against."""

from math import remainder, tau
from pathlib import Path

from hypothesis import strategies as st
from linkage_ros.kinematics import Closure, Linkage
from mpmath import mp, mpf

from ..kinematics.linkages import four_bar_linkage
from ..kinematics.reference import four_bar, turned

GALLERY = [
    file
    for file in sorted((Path(__file__).parents[2] / 'config' / 'linkages').glob('*.yaml'))
    if file.stem != 'gripper'  # other solvers refuse ratios
]
Lengths = tuple[float, float, float, float]
CRANK_ROCKER: Lengths = (0.04, 0.12, 0.08, 0.1)


def crank_rocker(lengths: Lengths = CRANK_ROCKER) -> Linkage:
    """Return a four-bar of crank, coupler, rocker and ground."""
    return four_bar_linkage(lengths, 'left')


def true_joints(lengths: Lengths, phi: float) -> tuple[mpf, mpf]:
    """Return the joints of `crank_rocker`, to 50 digits, where two circles meet."""
    with mp.workdps(50):
        found = four_bar(*lengths, phi, 1)
        assert found.coupler is not None
        assert found.rocker is not None
        return found.coupler.value - mpf(phi), found.rocker.value


def worst_error(lengths: Lengths, phi: float, joints: tuple[float, ...]) -> float:
    """Return the largest error of joints, in [rad], whole turns apart."""
    with mp.workdps(50):
        true = true_joints(lengths, phi)
        return max(
            float(abs(turned(mpf(one) - other))) for one, other in zip(joints, true, strict=True)
        )


def apart(closure: Closure, one: tuple[float, ...], other: tuple[float, ...]) -> float:
    """Return the largest difference of joints, in [rad] or [m], whole turns apart."""
    return max(
        abs(remainder(p - q, tau) if turns else p - q)
        for p, q, turns in zip(one, other, closure.turning, strict=True)
    )


@st.composite
def crank_rockers(draw: st.DrawFn) -> Lengths:
    """Draw a four-bar whose crank turns fully and that does not come next to folding."""
    a = draw(st.floats(0.1, 1.0))
    slack, share = draw(st.floats(0.05, 1.0)), draw(st.floats(0.1, 0.9))
    d = a * draw(st.floats(1.5, 6.0))
    # |b − c| < d − a and d + a < b + c: Grashof, with room on both sides.
    difference = (d - a) * (2.0 * share - 1.0) * 0.9
    total = (d + a) * (1.0 + slack)
    return (a, 0.5 * (total + difference), 0.5 * (total - difference), d)
