# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The motion that a scene makes.

A drive that computes its crank is asked itself. A `topic` drive has no motion of its own: it is
said what its crank does, by a sine or by the samples of a bag. To a `torque` drive commands come:
those of a bag, or a sine of effort for each input, of frequencies that differ; without either it
moves by its start, weight and loads alone. `feed_of` makes the messages of the motion.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain
from math import sin, tau
from operator import attrgetter
from typing import Any, NamedTuple

from linkage_ros.bag import Bag, read_bag, read_raw_metadata
from linkage_ros.description import Scene
from linkage_ros.dynamics import LARGEST
from linkage_ros.errors import BagError, list_names
from linkage_ros.kinematics import Closure
from linkage_ros.messages import (
    input_reader,
    JOINT_STATE_TYPE,
    JointStateWriter,
    NANOSECONDS,
    Rejection,
)
from linkage_ros.stages.drives import CrankState, sample_inputs, TopicDrive, TorqueDrive
from linkage_ros.tick import LinkagePipeline, Pipeline
from linkage_ros.tools.study.member_motion import (
    BEGIN,
    build_drive,
    Command,
    Crank,
    LinkageMotion,
    Path,
)
from linkage_ros.tools.study.prices import Feed, swinging_inputs, turn_crank, USUAL_RATE

SINE = 'sine'
"""What ``like`` is for a sine; anything else is the path of a bag."""

COMMAND_PERIOD = 0.05
"""Longest time between two commands of a torque drive, in [s]."""

_COMMANDED = 0.5
"""Of the sine of the first input's commands, in [Hz]; those of others are slower."""

_FREQUENCY = 0.5
"""Of the sine of a crank, in [Hz]: one that turns makes 1.6 turns a second at most."""

_LOOK = 0.1
"""Time between two looks whether anything moves, in [s]."""

_STANDS = 1e-9
"""Motions smaller than this, in [rad] or [m], are none."""


def motions_of(scene: Scene, like: str | None, horizon: float) -> list[LinkageMotion]:
    """
    Return the motions of a scene's linkages over a horizon, in [s].

    ``like`` is `SINE`, or the path of a bag with the samples or commands; None for the scene's
    own. A LinkageError is raised if a topic drive has no motion, or a bag cannot be read or has no
    samples.
    """
    scene = without_deliberate(scene)
    pipeline = Pipeline(scene)
    bag = None if like in (None, SINE) else read_bag(str(like))
    return [_linkage_motion(scene, linkage, like, bag, horizon) for linkage in pipeline.linkages]


def without_deliberate(scene: Scene) -> Scene:
    """Return a scene without recording, faults and what its sensors and wear change."""
    members = []
    for scene_linkage in scene.linkages:
        forced = scene_linkage.drive[1].gives_torque
        kept = {'velocity', 'tolerance', *(('friction',) if forced else ())}
        effects = {name: use for name, use in scene_linkage.effects.items() if name in kept}
        loads = scene_linkage.loads if forced else None
        members.append(replace(scene_linkage, effects=effects, loads=loads))
    return replace(scene, linkages=tuple(members), faults={}, record=None)


def _linkage_motion(
    scene: Scene, linkage: LinkagePipeline, like: str | None, bag: Bag | None, horizon: float
) -> LinkageMotion:
    scene_linkage, context = linkage.scene_linkage, linkage.context
    motion = LinkageMotion(scene_linkage, linkage.closure, context, None)
    _, drive = scene_linkage.drive
    if drive.gives_torque:
        return _commanded_motion(motion, like, bag, horizon)
    if drive.reads_bag:
        opened = read_bag(drive.file, allow_truncated=drive.allow_truncated)
        fast = scene.rate if drive.pace == 'fast' else 0.0
        return _follow_samples(motion, opened, drive.topic, fast)
    if not drive.is_measured:
        return motion._replace(path=_path_of(linkage))
    if bag is not None:
        return _follow_samples(motion, bag)
    if like is None:
        raise scene_linkage.content.error(
            'drive',
            'topic has no own motion',
            'choose a motion of its crank: --like sine, or --like BAG with its samples',
        )
    return motion._replace(
        path=_sine_path(motion.closure),
        sample_rate=scene.rate or USUAL_RATE,
        note=f'the crank moves by a sine of {_FREQUENCY:g} Hz',
    )


def _path_of(linkage: LinkagePipeline) -> Path:
    """Return the path of a drive that computes its crank as a function of the time."""
    drive = linkage.drive
    drive.state(BEGIN)

    def crank_at(time: int) -> Crank | None:
        crank: CrankState | None = drive.state(BEGIN + time)
        return None if crank is None else (crank.angles, crank.rates)

    return crank_at


def _sine_path(closure: Closure) -> Path:
    """Return sines of all inputs, within the range where the loops close."""
    paths = swinging_inputs(closure, _FREQUENCY)

    def crank_at(time: int) -> Crank:
        values, rates = zip(*[path(time * 1e-9) for path in paths], strict=True)
        return values, rates

    return crank_at


def _commanded_motion(
    motion: LinkageMotion, like: str | None, bag: Bag | None, horizon: float
) -> LinkageMotion:
    """Return the motion of a torque drive, with the commands that come to it."""
    if bag is not None:
        return _follow_commands(motion, bag)
    if like is None and moves_without_commands(motion, horizon):
        return motion._replace(note='no command comes')
    use, inputs = motion.scene_linkage.drive[1], motion.closure.linkage.inputs
    uses = [use.for_input(driven.joint) for driven in inputs]
    needed = [_needed_effort(motion)] if len(inputs) == 1 else _needed_efforts(motion)
    period = round(min(COMMAND_PERIOD, 0.5 * use.timeout) * NANOSECONDS)
    sines, said = [], []
    for k, (driven, own, effort) in enumerate(zip(inputs, uses, needed, strict=True)):
        unit = motion.closure.scale if driven.slider else 1.0
        size, hertz = _commanded_size(own.motor, effort, unit), _COMMANDED / (1.0 + 0.25 * k)
        sines.append((size, tau * hertz))
        units = {'effort': 'N' if driven.slider else 'N·m', 'current': 'A', 'voltage': 'V'}
        unit_name = units[own.motor.command if own.motor else 'effort']
        said.append(f'a sine of {hertz:.3g} Hz and {size:.3g} {unit_name}')
    commands = [
        Command(time, tuple(size * sin(speed * time * 1e-9) for size, speed in sines))
        for time in range(period, round(horizon * NANOSECONDS), period)
    ]
    note = f'commands are {list_names(said)}, {1e9 / period:g} a second'
    if like is None:
        note += ', since nothing moves without'
    return motion._replace(commands=commands, note=note)


def moves_without_commands(motion: LinkageMotion, horizon: float) -> bool:
    """Return whether a torque drive moves without commands."""
    drive = build_drive(motion)
    begin = drive.state(BEGIN).angles
    for index in range(1, 2 + int(horizon / _LOOK)):
        time = BEGIN + round(index * _LOOK * NANOSECONDS)
        moved = zip(drive.state(time).angles, begin, strict=True)
        if max(abs(now - then) for now, then in moved) > _STANDS:
            return True
    return False


def _needed_efforts(motion: LinkageMotion) -> list[float]:
    """Return efforts of several inputs as `_needed_effort`, by what is needed at the start."""
    terms = build_drive(motion).motion
    terms = getattr(terms, 'moved', terms).terms
    mechanics, inputs = motion.context.mechanics, motion.closure.linkage.inputs
    efforts = []
    for k, driven in enumerate(inputs):
        rubbing = zip(terms.slips, mechanics.dry_frictions, strict=True)
        friction = sum(abs(slip.levers[k]) * of.holding for slip, of in rubbing)
        unit = motion.closure.scale if driven.slider else 1.0
        inertia = 1.0 / terms.mobility[k][k]
        efforts.append(friction + 0.2 * abs(terms.bias[k]) + 2.0 * unit * inertia)
    return efforts


def _needed_effort(motion: LinkageMotion) -> float:
    """Return the amplitude of efforts that pass friction and a fifth of the weight."""
    equation = motion.context.mechanics.motion_equation
    drive = build_drive(motion)
    start = motion.scene_linkage.drive[1].for_input(motion.closure.input_names[0]).start
    low, high = (
        min(max(end, start - tau), start + tau) for end in drive.actuation_for(None)[0].stops
    )
    terms_by_angle = [
        terms for k in range(90) if (terms := equation(low + (high - low) * k / 90.0))
    ]
    least = min(terms.inertia for terms in terms_by_angle)
    friction = max(terms.coulomb + terms.breakaway for terms in terms_by_angle)
    weight = max(abs(terms.potential_slope) for terms in terms_by_angle)
    unit = motion.closure.scale if motion.closure.linkage.inputs[0].slider else 1.0
    return friction + 0.2 * weight + 2.0 * unit * least


def _commanded_size(motor: Any, effort: float, unit: float) -> float:
    """Return the command under which a motor gives an effort; ``unit`` is the rate of 1."""
    if motor is None or motor.command == 'effort':
        return effort
    current: float = effort / (motor.torque_constant * motor.ratio * motor.efficiency)
    if motor.command == 'current':
        return current
    voltage: float = motor.resistance * current + motor.torque_constant * motor.ratio * unit
    return voltage


def feed_of(motions: Sequence[LinkageMotion]) -> Feed:
    """Return the messages that make this motion, for a measurement of ticks."""
    if not any(motion.sample_rate or motion.commands for motion in motions):
        return turn_crank

    def feed_messages(scene: Scene, pipeline: Pipeline) -> Iterator[tuple[int, bytes]]:
        if pipeline.topic == TorqueDrive.listens_to:
            return _commands_and_ticks(scene, motions)
        return (
            _samples_and_ticks(scene, motions) if pipeline.topic else turn_crank(scene, pipeline)
        )

    return feed_messages


def _samples_and_ticks(
    scene: Scene, motions: Sequence[LinkageMotion]
) -> Iterator[tuple[int, bytes]]:
    """Yield ticks, each with a sample; the last one again and again after the end of a bag."""
    driven = [motion for motion in motions if motion.scene_linkage.drive[1].is_measured]
    if any(motion.scene_linkage.instead_of_inputs for motion in driven):
        yield from turn_crank(scene, Pipeline(scene))
        return
    write = JointStateWriter(
        [name for motion in driven for name in motion.scene_linkage.sampled_joints]
    ).write
    period = 1e9 / (scene.rate or USUAL_RATE)
    known: list[Crank] = [((0.0,) * len(e.scene_linkage.sampled_joints),) * 2 for e in driven]
    number = 0
    while True:
        now = BEGIN + round(number * period)
        samples = [motion.path(now - BEGIN) for motion in driven if motion.path]
        known = [new or old for new, old in zip(samples, known, strict=True)]
        values = [value for crank in known for value in crank[0]]
        rates = [rate for crank in known for rate in crank[1]]
        yield now, write(now, values, rates, (0.0,) * len(values))
        number += 1


def _commands_and_ticks(
    scene: Scene, motions: Sequence[LinkageMotion]
) -> Iterator[tuple[int, bytes]]:
    """Yield ticks, with the commands that have come since the last one."""
    driven = [motion for motion in motions if motion.scene_linkage.drive[1].gives_torque]
    names = [name for motion in driven for name in motion.context.inputs_in_messages]
    write = JointStateWriter(names).write
    zeros = (0.0,) * len(names)
    period = 1e9 / scene.rate
    number, next_ones = 0, [0] * len(driven)
    newest = [[0.0] * len(motion.context.inputs_in_messages) for motion in driven]
    while True:
        elapsed = round(number * period)
        fresh = False
        for k, motion in enumerate(driven):
            while next_ones[k] < len(motion.commands) and (
                motion.commands[next_ones[k]].time <= elapsed
            ):
                commanded = zip(motion.commands[next_ones[k]].efforts, newest[k], strict=True)
                newest[k] = [old if new is None else new for new, old in commanded]
                next_ones[k] += 1
                fresh = True
        efforts = [*chain(*newest)]
        yield BEGIN + elapsed, write(BEGIN, zeros, zeros, efforts) if fresh else b''
        number += 1


class _Sample(NamedTuple):
    """A good sample of a crank, with its stamp and arrival, in [ns]."""

    stamp: int
    arrival: int
    values: tuple[float, ...]
    rates: tuple[float, ...]


def _follow_samples(
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
        before, after = samples[number], samples[number + 1]
        length = (after.stamp - before.stamp) * 1e-9
        if length > gap:
            return None
        part = (time - stamps[number]) * 1e-9 / length
        ends = zip(before.values, before.rates, after.values, after.rates, strict=True)
        states = [_evaluate_cubic(part, length, *four) for four in ends]
        return tuple(value for value, _ in states), tuple(rate for _, rate in states)

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
    of_type = {topic.name for topic in bag.topics if topic.type == JOINT_STATE_TYPE}
    received: dict[str, list[tuple[int, Any]]] = {}
    for heard, log_time, _, data in bag.messages():
        if heard in of_type and (heard == topic or not topic):
            sample = read(data)
            if not isinstance(sample, Rejection):
                received.setdefault(heard, []).append((log_time, sample))
    most = max(received.values(), key=len, default=[])
    drive = sample_inputs(use, True, motion.closure.linkage.inputs)
    samples: list[_Sample] = []
    for log_time, sample in sorted(most, key=lambda entry: entry[0]):
        if drive.offer(sample, log_time) is None and drive.sample is not None:
            stamp, values, rates, _ = drive.sample
            if not samples or stamp > samples[-1].stamp:
                samples.append(_Sample(stamp, log_time, values, rates))
    if len(samples) < 2:
        names = list_names(motion.context.inputs_in_messages)
        raise BagError(
            bag.path, f'holds no motion of {names}', 'name a bag with samples of the crank'
        )
    return samples


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


def _follow_commands(motion: LinkageMotion, bag: Bag) -> LinkageMotion:
    """Return the motion of a torque drive by the commands of a bag, as they came; or by none."""
    read = motion.scene_linkage.drive[1].reader(motion.context)
    topic = read_raw_metadata(bag).get('crank_topic')
    of_type = {topic.name for topic in bag.topics if topic.type == JOINT_STATE_TYPE}
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
        commands=[command._replace(time=command.time - begin) for command in most],
        length=(end - begin) * 1e-9,
        note=f'{len(most) or "no"} commands come, as recorded in {bag.path.name}',
    )
