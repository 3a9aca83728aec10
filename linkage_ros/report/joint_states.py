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
Many JointState messages at once, as arrays.

Messages of one publisher differ in their stamps and numbers alone. So they are laid below each
other and taken column by column; where the layout changes, as at a toggle, whose rates are empty,
those of one layout are taken together. What is no JointState is left out, and counted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.messages.joint_state import arrays_of, Rejection
from linkage_ros.messages.layout import NANOSECONDS
from linkage_ros.report.decimation import Flags, Numbers, Times
import numpy as np
from numpy.typing import NDArray

POSITION, RATE, EFFORT = range(3)

_MOST_LAYOUTS = 64
"""Of the messages of one length in a block; a publisher has a handful."""

MOST_JOINTS = 64
"""Of a topic; what has more is no machine whose joints one could look at."""

NOTHING = 'no joints or no numbers'
TWICE = 'a joint named twice'
TOO_MANY_LAYOUTS = 'ever new layouts'
TOO_MANY_JOINTS = f'joints beyond the first {MOST_JOINTS}'


class JointBlock(NamedTuple):
    """
    Messages as arrays.

    Attributes
    ----------
    good
        Which of the messages were read, of shape (messages,); all else has a row for each.
    stamps
        In [ns]; 0 where it was not read.
    numbers
        Of shape (messages, 3, joints): positions, rates and efforts; NaN where there is none.

    """

    good: Flags
    stamps: Times
    numbers: Numbers


class JointStates:
    """
    Reads the messages of a topic.

    Parameters
    ----------
    joints
        Those that come first; others follow as they turn up.
    others
        Whether others may follow; where not, they are passed over.

    Attributes
    ----------
    joints
        All that have turned up.
    left_out
        How many messages, or joints of messages, were left out, by reason.

    """

    def __init__(self, joints: Sequence[str] = (), *, others: bool = True) -> None:
        self.joints = list(joints)
        self._most = max(len(self.joints), MOST_JOINTS) if others else len(self.joints)
        self._others = others
        self.left_out: Counter[str] = Counter()

    def read(self, messages: Sequence[bytes]) -> JointBlock:
        """Return messages as arrays."""
        n = len(messages)
        good = np.zeros(n, bool)
        stamps = np.zeros(n, np.int64)
        parts: list[tuple[NDArray[np.int64], list[int], list[tuple[int, Numbers]]]] = []
        lengths: dict[int, list[int]] = {}
        for i, message in enumerate(messages):
            lengths.setdefault(len(message), []).append(i)
        for length, places in lengths.items():
            joined = b''.join([messages[i] for i in places])
            table = np.frombuffer(joined, np.uint8).reshape(len(places), length)
            left = np.array(places)
            for _ in range(_MOST_LAYOUTS):
                if not len(left):
                    break
                taken, columns, found, stamp = self._alike(table, messages[left[0]])
                which = left[taken]
                if found:
                    good[which] = True
                    stamps[which] = stamp
                    parts.append((which, columns, found))
                left, table = left[~taken], table[~taken]
            self.left_out[TOO_MANY_LAYOUTS] += len(left)
        numbers = np.full((n, 3, len(self.joints)), np.nan)
        for which, columns, found in parts:
            kept = [i for i, column in enumerate(columns) if column >= 0]
            if self._others:
                self.left_out[TOO_MANY_JOINTS] += (len(columns) - len(kept)) * len(which)
            for quantity, values in found:
                under = [columns[i] for i in kept]
                numbers[which[:, None], quantity, under] = values[:, kept]
        return JointBlock(good, stamps, numbers)

    def _alike(
        self, table: NDArray[np.uint8], first: bytes
    ) -> tuple[Flags, list[int], list[tuple[int, Numbers]], Times]:
        """Return which rows are like the first, the columns of their joints, and their numbers."""
        none = np.zeros(len(table), bool)
        none[0] = True
        found = arrays_of(first)
        reason = found.value if isinstance(found, Rejection) else _unequal(found)
        if isinstance(found, Rejection) or reason:
            self.left_out[reason] += 1
            return none, [], [], np.empty(0, np.int64)
        order, names, arrays = found
        fixed = np.ones(table.shape[1], bool)
        fixed[4:12] = False
        for count_at, n, begin in arrays:
            # Between a count and the first number there may be padding, with anything in it.
            after = count_at + 4
            end = begin + 8 * n
            fixed[after:end] = False
            last = end
        fixed[last:] = False
        pattern = np.frombuffer(first, np.uint8)[fixed]
        alike = (table[:, fixed] == pattern).all(axis=1)
        rows = table[alike]
        times = rows[:, 4:12].copy().view(f'{order}i4')
        nanoseconds = times[:, 1].view(f'{order}u4')
        stamps = times[:, 0].astype(np.int64) * NANOSECONDS + nanoseconds
        numbers = []
        for quantity, (_, n, begin) in enumerate(arrays):
            if n:
                end = begin + 8 * n
                values = rows[:, begin:end].copy().view(f'{order}f8').astype(float)
                numbers.append((quantity, values))
        return alike, [self._column(name) for name in names], numbers, stamps

    def _column(self, encoded: bytes) -> int:
        """Return the column of a joint; −1 where there is no room for it."""
        name = encoded.decode('utf-8', 'backslashreplace')
        if name in self.joints:
            return self.joints.index(name)
        if len(self.joints) >= self._most:
            return -1
        self.joints.append(name)
        return len(self.joints) - 1


def _unequal(found: tuple[str, list[bytes], Sequence[tuple[int, int, int]]]) -> str:
    """Return why a message is left out whose arrays do not fit its names; '' where they do."""
    _, names, arrays = found
    counts = {n for _, n, _ in arrays} - {0}
    # A command may have efforts alone.
    if not names or not counts:
        return NOTHING
    if len(set(names)) < len(names):
        return TWICE
    return Rejection.UNEQUAL.value if counts - {len(names)} else ''
