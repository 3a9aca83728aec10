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


"""A four-bar as pylinkage has it: pins that are found one after the other, turn step by step."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from math import tau

try:
    from pylinkage.actuators import Crank
    from pylinkage.components import Ground
    from pylinkage.dyads import RRRDyad
    from pylinkage.simulation import Linkage
except ImportError:
    AVAILABLE = False
else:
    AVAILABLE = True

HAS_NUMBA = find_spec('numba') is not None
"""With it pylinkage compiles what finds all states in one call."""


def stepping(
    a: float, b: float, c: float, d: float, steps: int, rate: float, acceleration: float
) -> tuple[Callable[[], object], Callable[[], object]]:
    """
    Return two functions that turn a four-bar once: state by state, and all states in one call.

    Both find places, velocities and accelerations of its pins.

    Parameters
    ----------
    a, b, c, d
        Lengths of crank, coupler, rocker and ground.
    steps
        States of a turn.
    rate, acceleration
        The crank's, in [rad/s] and [rad/s²].

    """
    pivot, other = Ground(0.0, 0.0), Ground(d, 0.0)
    crank = Crank(anchor=pivot, radius=a, angular_velocity=tau / steps)
    pin = RRRDyad(anchor1=crank.output, anchor2=other, distance1=b, distance2=c)
    linkage = Linkage([pivot, other, crank, pin])
    linkage.set_input_velocity(crank, rate, acceleration)

    def one_by_one() -> None:
        for _ in linkage.step_with_derivatives(iterations=steps):
            pass

    def at_once() -> object:
        return linkage.step_fast_with_kinematics(iterations=steps)

    return one_by_one, at_once
