# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A scene that another program steps: inputs, ticks, outputs.

The other program keeps the clock, counted in ticks: tick n is at n/rate seconds after the
first. No other clock is read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice
from math import isfinite
from typing import NamedTuple

from linkage_ros.description import Scene, SceneLinkage
from linkage_ros.errors import LinkageError, list_names
from linkage_ros.kinematics import Input, RevoluteJoint, SlideJoint, Status
from linkage_ros.messages import (
    JOINT_STATE_TYPE,
    JointStateWriter,
    MessageValues,
    NANOSECONDS,
    Rejection,
)
from linkage_ros.stages.drives import DRIVES
from linkage_ros.tick import LinkagePipeline, LinkageState, Pipeline

FIRST_TICK = NANOSECONDS
"""Time of the first tick, in [ns]; not 0, since a sample stamped 0 is rejected as unstamped."""

NO_CRANK = 0
"""Status without a known state of the crank; the members of `Status` count from 1, in order."""

STATUS_NUMBERS: Mapping[Status, int] = {status: n for n, status in enumerate(Status, 1)}

LARGEST_SEED = 2**53
"""As for the key ``seed`` of a scene."""

_INPUT_FIELDS = {'topic': ('position', 'velocity'), 'torque': ('effort',)}
"""Fields of the messages that a drive reads, by name of the drive."""

_UNITS = {
    'position': ('rad', 'm'),
    'velocity': ('rad/s', 'm/s'),
    'acceleration': ('rad/s2', 'm/s2'),
    'effort': ('N.m', 'N'),
    'current': ('A', 'A'),
    'voltage': ('V', 'V'),
}
"""Units of each quantity, of a joint that turns and of one that slides."""

_MOST_TICKS = 10_000_000
"""Most ticks of one step: hours of computing."""

_OF_A_TICK = 1e-3
"""How far a step may be from whole ticks, in ticks: what rounding of sums of steps takes."""

_READ_AS = {
    'position': 'joints',
    'velocity': 'rates',
    'acceleration': 'accelerations',
    'effort': 'efforts',
}
"""Name of each field in a `SensorReading`."""


class Variable(NamedTuple):
    """A number that goes in or comes out, named as ``joint_states.rocker_joint.position``."""

    name: str
    unit: str
    description: str


class _Sender:
    """Sends the input values of a linkage as the message that its drive reads from a topic."""

    def __init__(self, line: LinkagePipeline) -> None:
        scene_linkage = line.scene_linkage
        drive, parameters = scene_linkage.drive
        self._fields = _INPUT_FIELDS[drive]
        self._count = len(scene_linkage.sampled_joints)
        self._write = JointStateWriter(scene_linkage.sampled_joints).write
        parts: Sequence[Input | RevoluteJoint | SlideJoint] = scene_linkage.linkage.inputs
        if others := scene_linkage.instead_of_inputs:
            joints = scene_linkage.closure.measuring(*others).linkage.joints
            parts = [joints[joint] for joint in others]
        inputs = [driven.joint for driven in scene_linkage.linkage.inputs]
        self.variables = []
        for field in self._fields:
            for own, joint, driven in zip(
                inputs, scene_linkage.sampled_joints, parts, strict=True
            ):
                # A motor may be commanded by another quantity, which the message calls an effort.
                motor = parameters.for_input(own).motor if drive == 'torque' else None
                quantity = motor.command if motor else field
                about = f'{quantity} of the input {joint}'
                if quantity != field:
                    about = f'{quantity} that is commanded to the motor of {joint}'
                unit = _UNITS[quantity][driven.unit == 'm']
                self.variables.append(Variable(f'{line.topic}.{joint}.{quantity}', unit, about))

    def write_message(self, stamp: int, values: Sequence[float]) -> bytes:
        """Return the message of a time, in [ns], with values in the order of the variables."""
        numbers = iter(values)
        of = {field: tuple(islice(numbers, self._count)) for field in self._fields}
        # A reader of efforts ignores the positions, which every message has.
        return self._write(
            stamp,
            of.get('position', (0.0,) * self._count),
            of.get('velocity', ()),
            of.get('effort', ()),
        )


class LinkageOutputs:
    """The newest reading of a linkage, and whether it is of the last tick."""

    def __init__(self, line: LinkagePipeline) -> None:
        scene_linkage = line.scene_linkage
        self.prefix = f'{scene_linkage.name}.' if scene_linkage.name else ''
        """What its variables that belong to no joint begin with."""
        turning = line.closure.turning
        self.variables = {
            field: [
                Variable(
                    f'joint_states.{joint}.{field}',
                    _UNITS[field][not turns],
                    f'{field} of {joint}, as its sensor reads it',
                )
                for joint, turns in zip(scene_linkage.joint_names, turning, strict=True)
            ]
            for field in _published_fields(scene_linkage)
        }
        """The variables of each field."""
        self.values = {field: [0.0] * len(of) for field, of in self.variables.items()}
        """The newest values of each field, in the order of the variables; 0 before the first."""
        self.valid = dict.fromkeys(self.variables, False)
        """Whether the last tick had values of each field."""
        self.status = NO_CRANK
        """Status of the linkage at the last tick, as a number."""

    def set_state(self, full_state: LinkageState) -> None:
        """Take the state of the linkage at a tick."""
        position, reading = full_state.position, full_state.reading
        self.status = NO_CRANK if position is None else STATUS_NUMBERS[position.status]
        for field, values in self.values.items():
            newest: tuple[float, ...] = ()
            if reading is not None:
                newest = getattr(reading, _READ_AS[field])
            self.valid[field] = bool(newest) and all(map(isfinite, newest))
            if self.valid[field]:
                values[:] = newest


def _published_fields(scene_linkage: SceneLinkage) -> list[str]:
    """Return the fields that a linkage publishes."""
    named = {also for effect in scene_linkage.effects.values() for also in effect.publishes_with}
    named |= {'position', *scene_linkage.effects}
    return [field for field in _READ_AS if field in named]


class MotorOutputs:
    """Readings of the motors' encoders: the newest ``~/motor`` message, by its writer."""

    def __init__(self, line: LinkagePipeline, writer: int) -> None:
        scene_linkage = line.scene_linkage
        inputs = scene_linkage.linkage.inputs
        _, parameters = scene_linkage.drive
        motors = [parameters.for_input(driven.joint).motor for driven in inputs]
        fields = ('position', 'velocity', 'effort')[: 3 if any(motors) else 2]
        self.variables = [
            # Without a motor at an input, the reading is of what is commanded: the input itself.
            Variable(
                f'motor.{driven.joint}_motor.{field}',
                _UNITS[field][bool(driven.slider) and motor is None],
                f'{field} of the motor of {driven.joint}, as its encoder reads it',
            )
            for field in fields
            for driven, motor in zip(inputs, motors, strict=True)
        ]
        self.values = [0.0] * len(self.variables)
        """The newest values, in the order of the variables; 0 before the first."""
        self._writer, self._read = writer, MessageValues(JOINT_STATE_TYPE).read

    def set_messages(self, messages: Sequence[bytes]) -> None:
        """Take the auxiliary messages of a tick."""
        values = self._read(messages[self._writer]) if messages else ''
        if not isinstance(values, str):
            self.values[:] = values.numbers


class SteppedScene:
    """
    A scene that is stepped from outside. To reset it, build it again.

    A FileError is raised if the scene cannot be stepped: it has no tick rate, needs further files
    or modules, or sets its own clock.
    """

    def __init__(self, scene: Scene) -> None:
        _refuse_scene(scene)
        self._scene = scene
        self._pipeline = Pipeline(scene)
        self._ticks = 0
        self._senders = [_Sender(linkage) for linkage in self._pipeline.linkages if linkage.topic]
        self.inputs = [variable for sender in self._senders for variable in sender.variables]
        """What goes in, in order."""
        self.outputs = [LinkageOutputs(linkage) for linkage in self._pipeline.linkages]
        """What comes out of each linkage."""
        extras = [
            (linkage, extra) for linkage in self._pipeline.linkages for extra in linkage.extras
        ]
        self.motors = [
            MotorOutputs(line, index)
            for index, (line, extra) in enumerate(extras)
            if extra.effect in DRIVES
        ]
        """What comes out of each motor that has an encoder."""
        self.rejections: dict[Rejection, int] = {}
        """How many samples were rejected, by reason."""

    @property
    def period(self) -> float:
        """Time between two ticks, in [s]."""
        return 1.0 / self._scene.rate

    def start(self, seed: int, inputs: Sequence[float]) -> None:
        """
        Do the first tick, with a seed of all random numbers, and the inputs at that time.

        A LinkageError says that the seed is out of bounds, or that no linkage can be made of it.
        """
        if not 0 <= seed <= LARGEST_SEED:
            raise LinkageError('seed', f'{seed} is out of bounds', f'write 0 to {LARGEST_SEED}')
        if seed != self._scene.seed:
            self._pipeline = Pipeline(replace(self._scene, seed=seed))
        self._offer_inputs(inputs)
        self._run_tick()

    def whole_ticks(self, begin: float, seconds: float) -> int:
        """
        Return how many ticks a step takes; its begin is in [s] since the first tick.

        A LinkageError is raised if the step does not begin where the last one ended, or is not a
        whole number of ticks.
        """
        rate = self._scene.rate
        # Written so that NaN is refused too.
        if not abs(begin * rate - self._ticks) <= _OF_A_TICK:
            raise LinkageError(
                f'a step from {begin:.9g} s',
                f'the last one ended at {self._ticks / rate:.9g} s',
                'go on from there, or reset',
            )
        ticks = seconds * rate
        if not 0.5 < ticks <= _MOST_TICKS or abs(ticks - round(ticks)) > _OF_A_TICK:
            raise LinkageError(
                f'a step of {seconds:.9g} s',
                f'is not 1 to {_MOST_TICKS} ticks at {rate:g} Hz',
                f'step by a whole multiple of {self.period:.9g} s',
            )
        return round(ticks)

    def step(self, ticks: int, inputs: Sequence[float]) -> None:
        """
        Take the values of the inputs at the end of the last step, then do these ticks.

        A drive takes them once, as one message.
        """
        self._offer_inputs(inputs)
        for _ in range(ticks):
            self._ticks += 1
            self._run_tick()

    def _tick_time(self) -> int:
        """Return the time of the last tick, in [ns]; lets faults begin and end."""
        now = FIRST_TICK + round(self._ticks * NANOSECONDS / self._scene.rate)
        if self._pipeline.injection is not None:
            self._pipeline.injection.advance(now)
        return now

    def _offer_inputs(self, inputs: Sequence[float]) -> None:
        now = self._tick_time()
        first = 0
        for sender in self._senders:
            end = first + len(sender.variables)
            rejection = self._pipeline.offer(sender.write_message(now, inputs[first:end]), now)
            first = end
            if rejection is not None:
                self.rejections[rejection] = self.rejections.get(rejection, 0) + 1

    def _run_tick(self) -> None:
        tick = self._pipeline.tick(self._tick_time())
        for outputs, look in zip(self.outputs, tick.states, strict=True):
            outputs.set_state(look)
        for motor in self.motors:
            motor.set_messages(tick.extras)


def _refuse_scene(scene: Scene) -> None:
    """Refuse a scene that needs more than its files and a clock from outside."""
    content = scene.linkages[0].content
    if scene.rate == 0.0:
        raise content.error(
            'rate', '0 is one tick for every message, and there are none', 'name a rate'
        )
    for name, fault in scene.faults.items():
        if fault.kind == 'time_jump':
            raise content.error(
                f'faults.{name}', 'sets the clock, which the importer keeps', 'leave it out'
            )
    for scene_linkage in scene.linkages:
        drive, parameters = scene_linkage.drive
        if parameters.reads_bag:
            raise scene_linkage.content.error(
                'drive.bag',
                'the bag does not travel with the scene',
                'name another drive; topic takes the crank as an input',
            )
        topic = parameters.listens_to
        if topic and drive not in _INPUT_FIELDS:
            raise scene_linkage.content.error(
                f'drive.{drive}',
                f'listens to {topic}, for which an FMU has no inputs',
                f'name one of {list_names(_INPUT_FIELDS)}, or a drive that moves by itself',
            )
        if scene_linkage.loads is not None and scene_linkage.loads.applied.wrenches:
            raise scene_linkage.content.error(
                'loads.wrenches',
                'come on topics, for which an FMU has no inputs',
                'leave them out',
            )
        for effect in scene_linkage.effects:
            if '.' in effect:
                raise scene_linkage.content.error(
                    f'effects.{effect}',
                    'is a module of your own, which does not travel with the scene',
                    'leave it out',
                )
