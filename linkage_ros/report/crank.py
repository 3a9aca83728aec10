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

"""Where the crank was: by the newest good sample, carried forward by its rate."""

from __future__ import annotations

from collections.abc import Sequence

from linkage_ros.report.arrays import Flags, Numbers, Times
from linkage_ros.scene.scene import Member
import numpy as np


class Crank:
    """
    The driven joints of a linkage, by the newest good sample.

    Parameters
    ----------
    member
        The linkage in its scene, driven from a topic.
    columns
        Of its inputs among those of the samples.

    """

    def __init__(self, member: Member, columns: Sequence[int]) -> None:
        self._columns = list(columns)
        self._carried = bool(getattr(member.drive[1], 'carry_forward', False))
        width = len(columns)
        self._number = np.array([-1])
        self._stamp = np.zeros(1, np.int64)
        self._angles, self._rates = np.full((1, width), np.nan), np.zeros((1, width))

    def take(self, numbers: Times, stamps: Times, good: Flags, values: Numbers) -> Flags:
        """
        Take samples; return which were for this linkage.

        Parameters
        ----------
        numbers
            Of the messages in their block, rising.
        stamps
            Theirs, in [ns].
        good
            Which were not refused.
        values
            As `JointBlock.numbers` has them.

        """
        angles, rates = values[:, 0, self._columns], values[:, 1, self._columns]
        own: Flags = good & ~np.isnan(angles).any(axis=1)
        # The last one of before stands before the first message of this block.
        self._number = np.concatenate([[-1], numbers[own]])
        self._stamp = np.concatenate([self._stamp[-1:], stamps[own]])
        self._angles = np.concatenate([self._angles[-1:], angles[own]])
        self._rates = np.concatenate([self._rates[-1:], np.nan_to_num(rates[own])])
        return own

    def at(self, numbers: Times, times: Times) -> tuple[Numbers, Times]:
        """
        Return where the crank was at messages of the block, in [rad] or [m], and its stamp.

        Parameters
        ----------
        numbers
            Of the messages in their block.
        times
            That were solved for, in [ns].

        """
        places = np.searchsorted(self._number, numbers) - 1
        stamps, angles = self._stamp[places], self._angles[places]
        if self._carried:
            ages = (times - stamps) * 1e-9
            angles = angles + self._rates[places] * ages[:, None]
        return angles, stamps
