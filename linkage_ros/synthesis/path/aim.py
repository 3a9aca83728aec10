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


"""What coupler curves are fitted to, and the four-bars that are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from linkage_ros.kinematics.batch import Array, Complex
import numpy as np
from numpy.typing import NDArray


class Fitted(NamedTuple):
    """
    Four-bars and where their cranks are at the points.

    Attributes
    ----------
    rows
        (n, 9), as in `model`.
    angles
        Of the crank from the ground line at the points, (n, N).
    side
        1 for left and −1 for right, (n,).

    """

    rows: Array
    angles: Array
    side: Array

    def some(self, chosen: NDArray[np.intp]) -> Fitted:
        """Return those of these numbers."""
        return Fitted(self.rows[chosen], self.angles[chosen], self.side[chosen])


@dataclass(frozen=True, slots=True)
class Aim:
    """
    What curves are fitted to.

    Attributes
    ----------
    points
        (N,), of a path about the origin whose size is 1.
    timing
        Crank angles at the points, (N,); None where the crank may be anywhere.
    zero_free
        Whether the timing's zero is, so that only differences count.
    full_turn
        Whether the loop must be closed at every crank angle.
    shortest, longest
        Links may be; the traced point may be as far from the crank's pin, along x and along y.

    """

    points: Complex
    timing: Array | None
    zero_free: bool
    full_turn: bool
    shortest: float
    longest: float
