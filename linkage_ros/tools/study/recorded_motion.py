# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The motion of a recorded bag: the samples of its crank, or the commands of its drive."""

from __future__ import annotations

from bisect import bisect_right
from operator import attrgetter
from typing import Any, NamedTuple

from linkage_ros.bag import Bag, read_raw_metadata
from linkage_ros.dynamics import LARGEST
from linkage_ros.errors import BagError, list_names
from linkage_ros.messages import input_reader, JOINT_STATE_TYPE, Rejection
from linkage_ros.stages.drives import sample_inputs, TopicDrive
from linkage_ros.tools.study.member_motion import Command, Crank, LinkageMotion


class _Sample(NamedTuple):
    """A good sample of a crank, with its stamp and arrival, in [ns]."""

    stamp: int
    arrival: int
    values: tuple[float, ...]
    rates: tuple[float, ...]


def follow_samples(
    motion: LinkageMotion, bag: Bag, topic: str = '', pace: float = 0.0
) -> LinkageMotion:
    """
    Return the motion through the samples of a bag: cubics by their values and rates.

    Without a ``topic`` it takes the run's topic, else the topic with most samples. With a
    ``pace``, in [Hz], each tick takes one sample, whatever its time. A BagError is raised if the
    bag has no motion of the input.
    """
    samples = _samples_of(motion, bag, topic)
    if pace:
        scale = 1e-9 * pace * (samples[-1].stamp - samples[0].stamp) / (len(samples) - 1)
        samples = [
            sample._replace(
                stamp=round(k * 1e9 / pace), rates=tuple(scale * rate for rate in sample.rates)
            )
            for k, sample in enumerate(samples)
        ]
    stamps = [sample.stamp - samples[0].stamp for sample in samples]
    gap = motion.scene_linkage.drive[1].max_age

    def path_at(time: int) -> Crank | None:
        number = bisect_right(stamps, time) - 1
        if number < 0 or number + 1 >= len(stamps):
            return None
        one, other = samples[number], samples[number + 1]
        length = (other.stamp - one.stamp) * 1e-9
        if length > gap:
            return None
        part = (time - stamps[number]) * 1e-9 / length
        ends = zip(one.values, one.rates, other.values, other.rates, strict=True)
        found = [_evaluate_cubic(part, length, *four) for four in ends]
        return tuple(value for value, _ in found), tuple(rate for _, rate in found)

    note = f'the crank moves as recorded in {bag.path.name}'
    length = stamps[-1] * 1e-9
    if pace:
        return motion._replace(path=path_at, note=note, length=length)
    return motion._replace(
        path=path_at,
        length=length,
        samples=[(sample.stamp - samples[0].stamp, sample.arrival - samples[0].stamp)
                 for sample in samples],
        sample_rate=(len(stamps) - 1) * 1e9 / stamps[-1],
        note=note,
    )  # fmt: skip


def _samples_of(motion: LinkageMotion, bag: Bag, topic: str) -> list[_Sample]:
    """Return the good samples of the topic that has most of them."""
    _, use = motion.scene_linkage.drive
    read: Any = input_reader(motion.context.inputs_in_messages)
    if use.is_measured:
        read = use.reader(motion.context)
    else:
        use = TopicDrive(max_age=use.max_age)
    topic = topic or str(read_raw_metadata(bag).get('crank_topic') or '')
    of_type = {each.name for each in bag.topics if each.type == JOINT_STATE_TYPE}
    received: dict[str, list[tuple[int, Any]]] = {}
    for heard, log_time, _, data in bag.messages():
        if heard in of_type and (heard == topic or not topic):
            sample = read(data)
            if not isinstance(sample, Rejection):
                received.setdefault(heard, []).append((log_time, sample))
    most = max(received.values(), key=len, default=[])
    drive = sample_inputs(use, True, motion.closure.linkage.inputs)
    found: list[_Sample] = []
    for log_time, sample in sorted(most, key=lambda one: one[0]):
        if drive.offer(sample, log_time) is None and drive.sample is not None:
            stamp, values, rates, _ = drive.sample
            if not found or stamp > found[-1].stamp:
                found.append(_Sample(stamp, log_time, values, rates))
    if len(found) < 2:
        names = list_names(motion.context.inputs_in_messages)
        raise BagError(
            bag.path, f'holds no motion of {names}', 'name a bag with samples of the crank'
        )
    return found


def _evaluate_cubic(
    part: float, length: float, begin: float, start: float, end: float, stop: float
) -> tuple[float, float]:
    """Return value and rate of the cubic through two values and rates, at a part of its length."""
    s, rest = part, 1.0 - part
    value = begin + (end - begin) * s * s * (3.0 - 2.0 * s)
    value += length * s * rest * (start * rest - stop * s)
    rate = 6.0 * s * rest * (end - begin) / length
    rate += start * rest * (1.0 - 3.0 * s) + stop * s * (3.0 * s - 2.0)
    return value, rate


def follow_commands(motion: LinkageMotion, bag: Bag) -> LinkageMotion:
    """Return the motion of a torque drive by the commands of a bag, as they came; or by none."""
    read = motion.scene_linkage.drive[1].reader(motion.context)
    topic = read_raw_metadata(bag).get('crank_topic')
    of_type = {each.name for each in bag.topics if each.type == JOINT_STATE_TYPE}
    heard: dict[str, list[Command]] = {}
    begin = end = None
    for name, log_time, _, data in bag.messages():
        begin = log_time if begin is None else min(begin, log_time)
        end = log_time if end is None else max(end, log_time)
        if name in of_type and (name == topic or not topic):
            command = read(data)
            if isinstance(command, Rejection):
                continue
            if all(abs(effort) <= LARGEST for effort in command.efforts if effort is not None):
                heard.setdefault(name, []).append(Command(log_time, command.efforts))
    if begin is None or end is None or end == begin:
        raise BagError(bag.path, 'holds no run', 'name another bag')
    most = max(heard.values(), key=len, default=[])
    most.sort(key=attrgetter('time'))
    return motion._replace(
        commands=[each._replace(time=each.time - begin) for each in most],
        length=(end - begin) * 1e-9,
        note=f'{len(most) or "no"} commands come, as recorded in {bag.path.name}',
    )
