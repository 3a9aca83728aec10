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
A four-bar cut where coupler and rocker meet, and Newton's method on the gap.

So engines of rigid bodies close it, which know a tree of links, where a point of it is and how it
moves, but no loops.
"""

from __future__ import annotations

from collections.abc import Callable

from linkage_ros.accuracy.solving.methods.four_bar import PlainFourBar
from linkage_ros.accuracy.solving.methods.method import Joints, Method
import numpy as np
from numpy.typing import NDArray

Gap = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Takes the angles of crank, coupler to crank, and rocker [rad]; returns the gap, (2,) [m]."""

Slopes = Callable[[], NDArray[np.float64]]
"""Returns the gap's derivatives by the latter two there, (2, 2) [m]."""

_ENOUGH = 1e-14
"""Of the linkage's size: a gap at which the iteration ends."""

_STEPS = 20


def newton_on_the_cut(shape: PlainFourBar, name: str, gap: Gap, slopes: Slopes) -> Method:
    """Return it as a method of this name, which starts where it was last."""
    enough, joints = _ENOUGH * (shape.a + shape.b + shape.c + shape.d), shape.joints
    angles = np.zeros(3)
    told = False

    def position(angle: float) -> Joints:
        nonlocal told
        angles[0] = theta = shape.turn * angle + shape.offset
        if not told:
            coupler, rocker = shape.closed_at(theta)
            angles[1:] = coupler - theta, rocker
            told = True
        for _ in range(_STEPS):
            apart = gap(angles)
            if abs(apart[0]) + abs(apart[1]) <= enough:
                break
            try:
                angles[1:] -= np.linalg.solve(slopes(), apart)
            except np.linalg.LinAlgError:
                return ()
        _, coupler, rocker = angles.tolist()
        return joints((0.0, theta, theta + coupler, rocker))

    return Method(name, 'Newton on the loop', position, remembers=True)
