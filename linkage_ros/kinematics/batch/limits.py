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


"""Which of many states are beyond the limits of their joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from linkage_ros.kinematics.batch.arrays import BLOCK, LIMITED
from linkage_ros.kinematics.batch.solve import Batch
from linkage_ros.kinematics.limits import Bounds
import numpy as np
from numpy.typing import ArrayLike


def mark_limited(bounds: Bounds, inputs: Sequence[ArrayLike], batch: Batch) -> None:
    """
    Give those states of a batch their status that are poses beyond the limits.

    Parameters
    ----------
    bounds
        The limits.
    inputs
        Of each driven joint the values, as `Closure.solve` has taken them.
    batch
        What it found; changed in place, block by block.

    """
    count = len(batch.status)
    given: list[Any] = [np.broadcast_to(np.asarray(v, np.float64), count) for v in inputs]
    for start in range(0, count, BLOCK):
        part = slice(start, start + BLOCK)
        status = batch.status[part]
        beyond = bounds.beyond([values[part] for values in given], batch.positions[:, part])
        status[beyond & (status < LIMITED)] = LIMITED
