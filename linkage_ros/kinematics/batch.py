# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Many states of a linkage, as arrays."""

from __future__ import annotations

from typing import Final, NamedTuple, TypeAlias

from linkage_ros.kinematics.status import Status
import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Complex: TypeAlias = NDArray[np.complex128]
Codes: TypeAlias = NDArray[np.uint8]
Mask: TypeAlias = NDArray[np.bool_]

CODES: Final = {status: code for code, status in enumerate(Status)}
"""
The code of each status in an array: closed is 0, and a greater code is worse.

Codes below the toggle's have rates; codes up to it have a pose.
"""


class Batch(NamedTuple):
    """
    Many states of a linkage.

    Attributes
    ----------
    status
        Code of each state, by `CODES`: 0 is closed.
    positions
        A row for each published joint, in [rad] or [m]; NaN in a state that is open or
        indeterminate.
    velocities, accelerations
        Likewise, in [rad/s] or [m/s], [rad/s²] or [m/s²]; NaN at a toggle too. None if they were
        not requested.

    """

    status: Codes
    positions: Array
    velocities: Array | None = None
    accelerations: Array | None = None
