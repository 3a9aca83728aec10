# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Read the inputs of a linkage from messages that each name one, some or all of them.

A router finds those whose joints a message names: linkages, or inputs of one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import nan
from typing import Generic, TypeVar

from linkage_ros.messages.joint_state import CrankSample, head_of, JointStateReader, Rejection
from linkage_ros.messages.layout import STAMP_END

_MOST = 1000
"""Most kinds of messages in the cache; a limit against ever new names."""

_LONGEST = 100_000
"""Greatest end of the names for the cache [bytes]; a limit against huge messages."""

Receiver = TypeVar('Receiver')


class SampleRouter(Generic[Receiver]):
    """
    Finds the receivers of a message; parses a message only if its joint names are new.

    A message must name one of the joints that its receiver wants.
    """

    __slots__ = ('_all', '_ends', '_found', '_wanted')

    def __init__(self, wanted_joints: Mapping[Receiver, Sequence[str]]) -> None:
        self._all = tuple(wanted_joints)
        self._wanted = {
            to: {joint.encode() for joint in joints} for to, joints in wanted_joints.items()
        }
        self._ends: dict[int, list[int]] = {}
        """Possible ends of the names, by length of the message."""
        self._found: dict[bytes, tuple[Receiver, ...]] = {}

    def find_receivers(self, message: bytes) -> tuple[Receiver, ...]:
        """Return the receivers of a serialized JointState; of a malformed one, all receivers."""
        for end in self._ends.get(len(message), ()):
            known = self._found.get(message[STAMP_END:end])
            if known is not None:
                return known
        head = head_of(message)
        if head is None:
            return self._all
        names, end = head
        receivers = tuple(to for to, joints in self._wanted.items() if joints & names)
        if end > _LONGEST:
            return receivers
        if len(self._found) >= _MOST:
            self._ends.clear()
            self._found.clear()
        ends = self._ends.setdefault(len(message), [])
        if end not in ends:
            ends.append(end)
        self._found[message[STAMP_END:end]] = receivers
        return receivers


def input_reader(
    inputs: Sequence[str], with_efforts: bool = False
) -> Callable[[bytes], CrankSample | Rejection]:
    """
    Return a function that reads the inputs that a serialized JointState names.

    ``with_efforts``: whether a sample has their efforts too.
    """
    if len(inputs) == 1:
        return JointStateReader(inputs, with_efforts).read
    return _SeveralInputs(inputs, with_efforts).read


class _SeveralInputs:
    """Reads each input on its own: publishers of one topic may each name some of them."""

    __slots__ = ('_readers', '_router')

    def __init__(self, inputs: Sequence[str], with_efforts: bool) -> None:
        self._readers = [JointStateReader((name,), with_efforts) for name in inputs]
        self._router = SampleRouter({index: (name,) for index, name in enumerate(inputs)})

    def read(self, data: bytes) -> CrankSample | Rejection:
        """Return a sample of the named inputs, NaN for the others, or why it is rejected."""
        # A message that names none is rejected by any reader.
        named = self._router.find_receivers(data) or (0,)
        angles, rates, efforts = ([nan] * len(self._readers) for _ in range(3))
        stamp, mask = 0, 0
        for index in named:
            sample = self._readers[index].read(data)
            if isinstance(sample, Rejection):
                return sample
            stamp, (angles[index],), rate, _, effort = sample
            if rate is not None:
                (rates[index],) = rate
            if effort is not None:
                (efforts[index],) = effort
            mask |= 1 << index
        return CrankSample(stamp, tuple(angles), tuple(rates), mask, tuple(efforts))
