# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Read the inputs of a linkage from messages that each name one, some or all of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import nan

from linkage_ros.messages.joint_state import CrankSample, JointStateReader, Rejection
from linkage_ros.messages.sample_router import SampleRouter


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
