# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A recorded crank: the samples of a bag, at their times or one per tick.

Samples that the `topic` drive would reject are skipped and counted: messages without the input
joints, numbers beyond its bounds, stamps that go back. Absent rates are differenced as there. The
lead of a stamp over the clock does not matter, since the first sample counts as taken at the first
tick.

The messages are ordered by their log times, whatever their order in the file: other writers do
not keep it. The drive reads the bag when it is built, and again at every reset. A sample takes 8
bytes for its time and 16 for each input: 86 MB for an hour at 1 kHz, and some 150 MB while the bag
is read.
"""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import nan

from linkage_ros.bag import Bag, read_bag, read_raw_metadata
from linkage_ros.description import choice, file, flag, number, text
from linkage_ros.errors import BagError, DefinitionError, list_names
from linkage_ros.kinematics import Input
from linkage_ros.messages import CrankSample, input_reader, Rejection
from linkage_ros.stages.drives.drive import Context, Crank, CrankState, Drive
from linkage_ros.stages.drives.topic import sample_inputs, TopicDrive

_TYPE = 'sensor_msgs/msg/JointState'


class BagSamples:
    """
    Good samples, in the order of their log times and stamps.

    ``use`` decides whether they need rates.
    """

    __slots__ = (
        '_at_arrival',
        '_inputs',
        '_log_times',
        '_named',
        '_read',
        '_sieve',
        '_stamps',
        '_values',
        'offsets',
        'rejected',
    )

    offsets: array[int]
    """Times since the first sample, in [ns]."""
    rejected: Counter[Rejection]
    """Number of skipped messages, by reason."""

    def __init__(self, use: TopicDrive, context: Context) -> None:
        inputs = context.closure.linkage.inputs
        self._inputs = len(inputs)
        self._read = input_reader(context.inputs_in_messages)
        self._sieve = sample_inputs(use, context.needs_rate, inputs)
        self._at_arrival = use.stamp == 'arrival'
        self._log_times, self._stamps = array('Q'), array('Q')
        self._named, self._values = array('q'), array('d')
        self.offsets = array('q')
        self.rejected = Counter()

    def add(self, log_time: int, message: bytes) -> None:
        """Add a message, or count the reason for its rejection; see `sort_and_check`."""
        sample = self._read(message)
        if isinstance(sample, Rejection):
            self.rejected[sample] += 1
            return
        self._log_times.append(log_time)
        self._stamps.append(sample.stamp)
        self._named.append(sample.named)
        self._values.extend(sample.angles)
        self._values.extend(sample.rates or (nan,) * self._inputs)

    def sort_and_check(self) -> None:
        """Put the added samples in the order of their log times, and reject what is not good."""
        times = self._log_times
        order: Sequence[int] = range(len(times))
        if any(later < time for time, later in pairwise(times)):
            order = sorted(order, key=times.__getitem__)
        values, first = array('d'), 0
        for place in order:
            stamp = self._stamps[place]
            sample = CrankSample(stamp, *self[place], self._named[place])
            rejection = self._sieve.offer(sample, times[place] if self._at_arrival else stamp)
            if rejection is not None:
                self.rejected[rejection] += 1
            elif (good := self._sieve.sample) is not None:
                stamp, angles, rates, _ = good
                first = first if self.offsets else stamp
                self.offsets.append(stamp - first)
                values.extend(angles + rates)
        self._values = values
        del self._log_times[:], self._stamps[:], self._named[:]

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.offsets)

    def __getitem__(self, number: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the angles and the rates of a sample."""
        n = self._inputs
        first = 2 * n * number
        middle, end = first + n, first + 2 * n
        return tuple(self._values[first:middle]), tuple(self._values[middle:end])


def read_samples(bag: Bag, topic: str, use: TopicDrive, context: Context) -> BagSamples:
    """
    Return the samples of a topic of a bag, or raise `BagError`.

    If the topic is '', it is the crank topic of the run or, without a run's account in the bag,
    the only topic with good samples.
    """
    of_type = [topic.name for topic in bag.topics if topic.type == _TYPE]
    if topic and topic not in of_type:
        known = list_names(of_type) or 'no other'
        raise BagError(bag.path, f'holds no topic {topic!r} of {_TYPE}', f'it holds {known}')
    crank_topic = topic or _crank_topic_of_run(bag)
    samples_of = {
        name: BagSamples(use, context)
        for name in ([crank_topic] if crank_topic in of_type else of_type)
    }
    for name, log_time, _, data in bag.messages():
        if name in samples_of:
            samples_of[name].add(log_time, data)
    for samples in samples_of.values():
        samples.sort_and_check()
    good = {name: samples for name, samples in samples_of.items() if len(samples)}
    if len(good) == 1:
        (samples,) = good.values()
        return samples
    if good:
        raise BagError(
            bag.path,
            f'holds crank samples on {list_names(good)}',
            'name one of them as drive.bag.topic',
        )
    raise BagError(
        bag.path,
        'holds no crank sample of '
        f'{list_names(context.inputs_in_messages)}{_rejection_text(samples_of)}',
        'name another bag, or its topic as drive.bag.topic',
    )


def _rejection_text(samples_of: Mapping[str, BagSamples]) -> str:
    """Return the most frequent reason for rejected messages, for each topic."""
    reasons = (
        f'{name}: {samples.rejected.most_common(1)[0][0].value}'
        for name, samples in samples_of.items()
        if samples.rejected
    )
    return ''.join(f', {reason}' for reason in reasons)


def _crank_topic_of_run(bag: Bag) -> str:
    """Return the crank topic from the run's account in a bag; '' if the bag has none."""
    name = read_raw_metadata(bag).get('crank_topic')
    return name if isinstance(name, str) else ''


@dataclass(frozen=True, slots=True)
class BagDrive(Drive):
    """The crank samples of a recorded bag, from the first tick on."""

    file: str = file("the bag's folder, or its MCAP file")
    topic: str = text('topic of the samples; absent, the topic with the input joints', '')
    pace: str = choice(
        'recorded: samples follow each other as recorded; fast: one for every tick, as it is',
        ('recorded', 'fast'),
        'recorded',
    )
    carry_forward: bool = flag(
        "at the recorded pace, carry the crank to the tick's time by its rate; else hold it", True
    )
    max_age: float = number(
        'at the recorded pace, age of the newest sample beyond which there is no crank',
        0.2,
        unit='s',
        least=1e-6,
        most=3600.0,
    )
    stamp: str = choice(
        'time of a sample: its stamp, or when it was recorded', ('measured', 'arrival'), 'measured'
    )
    repeat: bool = flag(
        'after the last sample begin again, a mean interval later; else there is no crank', False
    )
    allow_truncated: bool = flag('take a bag whose recording was killed, as far as it goes', False)

    reads_bag = True

    @property
    def moves_by_rates(self) -> bool:
        """Return whether the crank moves at its rates between samples."""
        return self.carry_forward

    def build(self, context: Context) -> RecordedPace | FastPace:
        """
        Read the bag and build the drive.

        Raise `BagError` if the bag cannot be read, or if no topic, or more than one, has the input
        joints; raise `DefinitionError` if the samples should repeat, but take no time.
        """
        recorded = self.pace == 'recorded'
        use = TopicDrive(
            carry_forward=self.carry_forward and recorded,
            max_age=self.max_age,
            stamp=self.stamp,
        )
        bag = read_bag(self.file, allow_truncated=self.allow_truncated)
        samples = read_samples(bag, self.topic, use, context)
        if recorded:
            return RecordedPace(samples, use, context.closure.linkage.inputs, repeat=self.repeat)
        return FastPace(samples, repeat=self.repeat)


class RecordedPace(Crank):
    """
    Recorded samples at their times: each as long after the first tick as after the first sample.

    A `TopicDrive` makes the crank state between and after them. If they ``repeat``, but take no
    time, `DefinitionError` is raised.
    """

    __slots__ = ('_newest', '_period', '_start', '_topic', 'max_age', 'samples')

    max_age: int
    """Age of the newest sample above which there is no crank state, in [ns]."""

    def __init__(
        self, samples: BagSamples, use: TopicDrive, inputs: Sequence[Input], *, repeat: bool
    ) -> None:
        self.samples = samples
        self._topic = sample_inputs(replace(use, stamp='measured'), False, inputs)
        self.max_age = self._topic.max_age
        self._start: int | None = None
        self._newest = (-1, -1)
        length, intervals = samples.offsets[-1], len(samples) - 1
        if repeat and not length:
            raise DefinitionError(
                'drive.bag.repeat', 'all samples have the same time', 'leave repeat out'
            )
        self._period = length + length // intervals if repeat else 0

    @property
    def stamp(self) -> int:
        """Time at which the newest sample counts as taken, in [ns]; 0 before the first tick."""
        return 0 if self._start is None else self._start + self._topic.stamp - 1

    def state(self, now: int) -> CrankState | None:
        """Return the crank state at a time, in [ns]; None if the newest sample is too old."""
        if self._start is None:
            self._start = now
        elapsed = time = now - self._start
        rounds = 0
        if self._period:
            rounds, time = divmod(elapsed, self._period)
        number = bisect_right(self.samples.offsets, time) - 1
        # The time of the inner drive begins at 1 ns, since a stamp of 0 means no stamp.
        if self._newest != (rounds, number):
            self._newest = (rounds, number)
            stamp = elapsed - time + self.samples.offsets[number] + 1
            self._topic.offer(CrankSample(stamp, *self.samples[number]), elapsed + 1)
        return self._topic.state(elapsed + 1)


class FastPace(Crank):
    """Recorded samples one by one: each tick takes the next one as measured, whatever the time."""

    __slots__ = ('_next', '_repeat', 'samples')

    stamp = 0
    max_age = 0

    def __init__(self, samples: BagSamples, *, repeat: bool) -> None:
        self.samples = samples
        self._repeat = repeat
        self._next = 0

    def state(self, _now: int) -> CrankState | None:
        """Return the next sample; None after the last."""
        number = self._next
        if number == len(self.samples):
            if not self._repeat:
                return None
            number = 0
        self._next = number + 1
        angles, rates = self.samples[number]
        return CrankState(angles, rates, (0.0,) * len(angles), 0)
