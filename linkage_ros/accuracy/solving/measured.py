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


"""What was found of one method on one set of poses."""

from __future__ import annotations

from typing import NamedTuple

from linkage_ros.accuracy.solving.loop_errors import Errors
from linkage_ros.accuracy.solving.methods.method import Method
from linkage_ros.accuracy.solving.poses import Poses
from linkage_ros.accuracy.spread import Spread

BATCH = 4096
"""States of an array: the poses, over and over."""


class Measured(NamedTuple):
    """
    A method on a set of poses.

    Attributes
    ----------
    poses, method
        Which.
    position, motion, batch
        The errors of positions; of all three with rates and accelerations, alone and in arrays.
    times
        Of a state, in [s]: of its position, of its motion, of its position in an array, of its
        motion in an array; by 'position', 'motion', 'batch', 'batch_motion'.

    """

    poses: Poses
    method: Method
    position: Errors
    motion: tuple[Errors, Errors, Errors] | None
    batch: tuple[Errors, Errors, Errors] | None
    times: dict[str, Spread]
