# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Decode many JointState messages at once, as arrays.

Messages of one publisher differ only in stamps and numbers. They are stacked and decoded column by
column. Where the layout changes, as at a toggle, whose rates are empty, messages of one layout are
decoded together. Messages that are not a valid JointState are left out and counted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.messages import arrays_of, NANOSECONDS, Rejection
from linkage_ros.tools.view.report.decimation import Flags, Numbers, Times
import numpy as np
from numpy.typing import NDArray

POSITION, RATE, EFFORT = range(3)

_MOST_LAYOUTS = 64
"""Maximum number of layouts per message length in a block; a publisher has a handful."""

MOST_JOINTS = 64
"""Maximum number of joints of a topic; a page could not show more."""

NOTHING = 'no joints or no numbers'
TWICE = 'a joint named twice'
TOO_MANY_LAYOUTS = 'ever new layouts'
TOO_MANY_JOINTS = f'joints beyond the first {MOST_JOINTS}'


class JointBlock(NamedTuple):
    """Messages as arrays."""

    # Which messages were decoded, of shape (messages,); all other arrays have a row for each.
    good: Flags
    stamps: Times  # In [ns]; 0 for a message that was not decoded
    # Positions, rates and efforts, of shape (messages, 3, joints); NaN if missing.
    numbers: Numbers


class JointStates:
    """
    Decodes the messages of a topic.

    The given joints come first. With ``others``, other joints follow in the order of their
    appearance; else they are ignored.
    """

    def __init__(self, joints: Sequence[str] = (), *, others: bool = True) -> None:
        self.joints = list(joints)  # All joints so far
        self._most = max(len(self.joints), MOST_JOINTS) if others else len(self.joints)
        self._others = others
        # Number of messages, or joints of messages, left out, by reason.
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
                taken, columns, values_read, stamp = self._read_alike(table, messages[left[0]])
                which = left[taken]
                if values_read:
                    good[which] = True
                    stamps[which] = stamp
                    parts.append((which, columns, values_read))
                left, table = left[~taken], table[~taken]
            self.left_out[TOO_MANY_LAYOUTS] += len(left)
        numbers = np.full((n, 3, len(self.joints)), np.nan)
        for which, columns, values_read in parts:
            kept = [i for i, column in enumerate(columns) if column >= 0]
            if self._others:
                self.left_out[TOO_MANY_JOINTS] += (len(columns) - len(kept)) * len(which)
            for quantity, values in values_read:
                under = [columns[i] for i in kept]
                numbers[which[:, None], quantity, under] = values[:, kept]
        return JointBlock(good, stamps, numbers)

    def _read_alike(
        self, table: NDArray[np.uint8], first: bytes
    ) -> tuple[Flags, list[int], list[tuple[int, Numbers]], Times]:
        """Return the rows with the layout of the first, their joints' columns and numbers."""
        none = np.zeros(len(table), bool)
        none[0] = True
        layout = arrays_of(first)
        reason = layout.value if isinstance(layout, Rejection) else _mismatch_reason(layout)
        if isinstance(layout, Rejection) or reason:
            self.left_out[reason] += 1
            return none, [], [], np.empty(0, np.int64)
        order, names, arrays = layout
        fixed = np.ones(table.shape[1], bool)
        fixed[4:12] = False
        for count_at, n, begin in arrays:
            # Padding between a count and the first number may contain any bytes.
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
        return alike, [self._joint_column(name) for name in names], numbers, stamps

    def _joint_column(self, encoded: bytes) -> int:
        """Return the column of a joint; −1 beyond the size limit."""
        name = encoded.decode('utf-8', 'backslashreplace')
        if name in self.joints:
            return self.joints.index(name)
        if len(self.joints) >= self._most:
            return -1
        self.joints.append(name)
        return len(self.joints) - 1


def _mismatch_reason(layout: tuple[str, list[bytes], Sequence[tuple[int, int, int]]]) -> str:
    """Return why a message whose arrays do not fit its names is left out; '' if they fit."""
    _, names, arrays = layout
    counts = {n for _, n, _ in arrays} - {0}
    # A command may have only efforts.
    if not names or not counts:
        return NOTHING
    if len(set(names)) < len(names):
        return TWICE
    return Rejection.UNEQUAL.value if counts - {len(names)} else ''
