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
The crank samples of a bag, as plain numbers.

They take 8 bytes for the time of each, and 16 for each input: an hour at 1 kHz is 86 MB.
"""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Mapping

from linkage_ros.bag.reader import Bag
from linkage_ros.bag.run_events import run_said
from linkage_ros.drives.topic import TopicDrive, TopicParameters
from linkage_ros.errors import BagError, listed
from linkage_ros.messages.joint_state import JointStateReader, Rejection

_TYPE = 'sensor_msgs/msg/JointState'


class Samples:
    """
    Good samples, in the order of their stamps.

    Parameters
    ----------
    inputs
        Names of the driven joints.
    use
        How they are used, which decides whether they need rates.
    needs_rate
        As for `TopicDrive`.

    """

    __slots__ = ('_inputs', '_read', '_sieve', '_values', 'offsets', 'rejected')

    offsets: array[int]
    """Times since the first sample, in [ns]."""
    rejected: Counter[Rejection]
    """How many messages were skipped, and why."""

    def __init__(self, inputs: tuple[str, ...], use: TopicParameters, needs_rate: bool) -> None:
        self._inputs = len(inputs)
        self._read = JointStateReader(inputs).read
        self._sieve = TopicDrive(use, needs_rate)
        self._values = array('d')
        self.offsets = array('q')
        self.rejected = Counter()

    def add(self, message: bytes) -> None:
        """Add a message, serialized, or count why it is not good."""
        sample = self._read(message)
        if isinstance(sample, Rejection):
            self.rejected[sample] += 1
            return
        last = self._sieve.stamp
        rejection = self._sieve.offer(sample, sample.stamp)
        if rejection is not None:
            self.rejected[rejection] += 1
            return
        self.offsets.append(self.offsets[-1] + sample.stamp - last if self.offsets else 0)
        self._values.extend(sample.angles)
        self._values.extend(sample.rates or (0.0,) * self._inputs)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.offsets)

    def __getitem__(self, number: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the angles and the rates of a sample."""
        n = self._inputs
        first = 2 * n * number
        middle, end = first + n, first + 2 * n
        return tuple(self._values[first:middle]), tuple(self._values[middle:end])


def read_samples(
    bag: Bag, topic: str, inputs: tuple[str, ...], use: TopicParameters, needs_rate: bool
) -> Samples:
    """
    Return the samples of a bag's crank topic.

    Parameters
    ----------
    bag
        The bag.
    topic
        The topic; '' for that which the bag's own account of its run names, or, where there is
        none, for the only one with good samples.
    inputs, use, needs_rate
        As for `Samples`.

    Raises
    ------
    BagError
        Where no topic, or more than one, has good samples; where the bag is damaged.

    """
    of_type = [each.name for each in bag.topics if each.type == _TYPE]
    if topic and topic not in of_type:
        known = listed(of_type) or 'no other'
        raise BagError(bag.path, f'holds no topic {topic!r} of {_TYPE}', f'it holds {known}')
    own = topic or _crank_topic_of_run(bag)
    found = {
        name: Samples(inputs, use, needs_rate) for name in ([own] if own in of_type else of_type)
    }
    for name, _, _, data in bag.messages():
        if name in found:
            found[name].add(data)
    good = {name: samples for name, samples in found.items() if len(samples)}
    if len(good) == 1:
        (samples,) = good.values()
        return samples
    if good:
        raise BagError(
            bag.path,
            f'holds crank samples on {listed(good)}',
            'name one of them as drive.bag.topic',
        )
    raise BagError(
        bag.path,
        f'holds no crank sample of {listed(inputs)}{_why(found)}',
        'name another bag, or its topic as drive.bag.topic',
    )


def _why(found: Mapping[str, Samples]) -> str:
    """Return what most messages of each topic were refused for."""
    reasons = (
        f'{name}: {samples.rejected.most_common(1)[0][0].value}'
        for name, samples in found.items()
        if samples.rejected
    )
    return ''.join(f', {reason}' for reason in reasons)


def _crank_topic_of_run(bag: Bag) -> str:
    """Return the crank topic of a bag of ours; '' where it does not say."""
    said = run_said(bag).get('crank_topic')
    return said if isinstance(said, str) else ''
