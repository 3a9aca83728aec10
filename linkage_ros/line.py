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
One linkage of a scene at work: drive, closure, and the stages that the scene calls for.

Building puts in only what the scene names; a tick asks no scene.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from operator import add
from types import ModuleType
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.drives.drive import Context, CrankState, Drive, DRIVES
from linkage_ros.effects.stage import (
    Begin,
    EFFECTS,
    LOADED,
    Motion,
    NEEDS,
    PUBLISHED_WITH,
    Reading,
    Sensor,
    Writer,
)
from linkage_ros.effects.turns import Continuous, Wrapped
from linkage_ros.errors import DefinitionError
from linkage_ros.joint_state import Rejection
from linkage_ros.kinematics.closure import Closure, Position
from linkage_ros.scene.scene import Member, Scene
from linkage_ros.tuples import new

if TYPE_CHECKING:
    from linkage_ros.faults.injection import Injection


class Look(NamedTuple):
    """
    What a linkage comes to at a tick.

    Attributes
    ----------
    crank
        The crank; nothing where there is none.
    position
        The loop; nothing where there is no crank.
    motion
        What the mechanism does; nothing where the loop has no pose, or no stage asks.
    reading
        What is published of it; nothing where nothing is.

    """

    crank: CrankState | None
    position: Position | None
    motion: Motion | None
    reading: Reading | None


_NO_CRANK = Look(None, None, None, None)


class Extra(NamedTuple):
    """
    A message beside the joint states.

    Attributes
    ----------
    effect
        What calls for it.
    topic, message
        Its topic and its type: package/msg/Type.
    write
        Writes it.

    """

    effect: str
    topic: str
    message: str
    write: Writer


class Line:
    """
    A linkage at work. To reset it, build it again.

    Parameters
    ----------
    scene
        The scene.
    member
        Its linkage, drive and effects.
    closure
        The linkage, where it has been solved before: it remembers nothing, and serves every reset.
    injection
        The faults of the scene, if it has any.

    Raises
    ------
    FileError
        Where something does not go together; where the linkage does not close.

    """

    def __init__(
        self, scene: Scene, member: Member, closure: Closure | None, injection: Injection | None
    ) -> None:
        self.member = member
        try:
            self._build(scene, closure, injection)
        except DefinitionError as error:
            raise member.content.error(error.where, error.reason, error.remedy) from None

    def _build(self, scene: Scene, closure: Closure | None, injection: Injection | None) -> None:
        member = self.member
        drive, drive_parameters = member.drive
        drive_module = import_module(DRIVES[drive])
        named = set(member.effects)
        named |= {also for effect in named for also in PUBLISHED_WITH.get(effect, ())}
        computed = named | {need for effect in named for need in NEEDS.get(effect, ())}
        modules = {name: import_module(EFFECTS[name]) for name in EFFECTS if name in computed}
        forced = drive == 'torque' or not computed.isdisjoint(LOADED)
        _refuse_idle(member, forced)

        seed = f'{scene.seed}/{member.name}'
        parameters = {
            name: member.effects.get(name) or module.PARAMETERS()
            for name, module in modules.items()
        }
        self.closure = closure or _closure(member, modules, parameters, seed)
        friction = modules.get('friction')
        self.context = Context(
            closure=self.closure,
            rate=scene.rate,
            needs_rate='velocity' in computed,
            seed=seed,
            loads=member.loads,
            friction=friction.friction(parameters['friction']) if friction else None,
            prefix=member.prefix,
        )
        self.topic: str = getattr(drive_module, 'TOPIC', '')
        """Topic that the drive listens to; '' for none."""
        self.drive: Drive = drive_module.build(drive_parameters, self.context)
        self._read = drive_module.reader(self.context) if self.topic else None

        def built(function: str) -> list[Any]:
            return [
                getattr(module, function)(parameters[name], self.context)
                for name, module in modules.items()
                if hasattr(module, function)
            ]

        mechanism: list[Any] = []
        faulty: list[Sensor] = []
        self._spoil: list[Callable[[bytes], bytes]] = []
        if injection is not None:
            mechanism = injection.build('mechanism', self.context)
            faulty = injection.build('sensor', member.joints)
            self._spoil = injection.build('message')
            if self._spoil and not self.topic:
                raise DefinitionError(
                    'faults', f'not_a_number spoils messages, and {drive} has none', 'leave it out'
                )
        sensing: list[Any] = built('sensor')
        if 'delay' in modules:
            *before, delay = sensing
            sensing = [_delayed(before, delay)]
        sensors = _sensors(scene, self.closure, [*sensing, *faulty])
        stages = built('stage')
        drive_stages = built('drive_stage')
        (begin,) = built('begin') or [_at_rest]
        state, close = self.drive.state, self.closure.position
        self.look: Callable[[int], Look]
        """Returns what the linkage comes to at a time, in [ns]."""
        if begin is not _at_rest or drive_stages or mechanism:
            observe = _observer(named, len(self.closure.linkage.joints))
            self.look = _look(
                state, drive_stages, close, mechanism, begin, stages, observe, sensors
            )
        else:
            self.look = _plain_look(state, close, sensors)
        self.extras = [
            Extra(
                name,
                f'~/{member.name}/{module.TOPIC[2:]}' if member.name else module.TOPIC,
                module.MESSAGE,
                module.writer(self.context),
            )
            for name, module in modules.items()
            if name in named and hasattr(module, 'TOPIC')
        ]
        self.stages = tuple(modules)
        """Names of the effects that are computed, in physical order."""

    def offer(self, message: bytes, now: int) -> Rejection | None:
        """Take a message of the drive's topic, serialized, at a time in [ns], or say why not."""
        if self._read is None:
            return Rejection.MISSING
        for spoil in self._spoil:
            message = spoil(message)
        sample = self._read(message)
        if isinstance(sample, Rejection):
            return sample
        rejection: Rejection | None = self.drive.offer(sample, now)  # type: ignore[attr-defined]
        return rejection


def _refuse_idle(member: Member, forced: bool) -> None:
    """Refuse what acts on nothing."""
    for given, key in (
        (member.loads, 'loads'),
        ('friction' in member.effects, 'effects.friction'),
    ):
        if given and not forced:
            raise DefinitionError(
                key,
                'acts on nothing here: no effect and no drive asks for forces',
                f'leave it out, drive by torque, or name one of {", ".join(LOADED)}',
            )


def _closure(
    member: Member, modules: dict[str, ModuleType], parameters: dict[str, Any], seed: str
) -> Closure:
    linkage = member.linkage
    for name, module in modules.items():
        if hasattr(module, 'alter'):
            linkage = module.alter(parameters[name], linkage, Context.generator(seed, name))
    return Closure(linkage)


def _sensors(scene: Scene, closure: Closure, sensors: list[Sensor]) -> tuple[Sensor, ...]:
    """Return the sensors, what makes angles run on before them, and what wraps them behind."""
    if scene.wrapped:
        wrapped = Wrapped(closure.turning)
        return (Continuous(closure.turning), *sensors, wrapped) if sensors else (wrapped,)
    return (Continuous(closure.turning), *sensors)


def _delayed(sensors: list[Sensor], delay: Any) -> Sensor:
    """Return the sensors with the delay behind them, which is told their silence too."""

    def late(now: int, reading: Reading) -> Reading | None:
        found: Reading | None = reading
        for sensor in sensors:
            if found is None:
                break
            found = sensor(now, found)
        arrived: Reading | None = delay(now, found)
        return arrived

    return late


def _plain_look(
    state: Callable[[int], CrankState | None],
    close: Callable[..., Position],
    sensors: tuple[Sensor, ...],
) -> Callable[[int], Look]:
    """Put a tick together that asks for positions and for nothing that moves or pushes."""
    first, others = sensors[0], sensors[1:]

    def look(now: int) -> Look:
        crank = state(now)
        if crank is None:
            return _NO_CRANK
        position = close(*crank[0])
        joints = position[2]
        if not joints:
            return new(Look, (crank, position, None, None))
        reading = first(now, new(Reading, (now, joints, (), (), ())))
        for sensor in others:
            if reading is None:
                break
            reading = sensor(now, reading)
        return new(Look, (crank, position, None, reading))

    return look


def _look(
    state: Callable[[int], CrankState | None],
    drive_stages: list[Any],
    close: Callable[..., Position],
    mechanism: list[Any],
    begin: Begin,
    stages: list[Any],
    observe: Callable[[int, Motion], Reading],
    sensors: tuple[Sensor, ...],
) -> Callable[[int], Look]:
    """Put a tick together."""
    first, others = sensors[0], sensors[1:]

    def look(now: int) -> Look:
        crank = state(now)
        if crank is None:
            return _NO_CRANK
        for stage in drive_stages:
            crank = stage(crank)
        position = close(*crank[0])
        for harm in mechanism:
            position = harm(position)
        if not position[2]:
            return new(Look, (crank, position, None, None))
        motion = begin(crank, position)
        for stage in stages:
            motion = stage(motion)
        reading = first(now, observe(now, motion))
        for sensor in others:
            if reading is None:
                break
            reading = sensor(now, reading)
        return new(Look, (crank, position, motion, reading))

    return look


def _at_rest(crank: CrankState, position: Position) -> Motion:
    """Return the motion of which only the pose is asked for."""
    return new(Motion, (crank, position, None, None, (), (), ()))


def _observer(named: set[str], joints: int) -> Callable[[int, Motion], Reading]:
    """Return what makes the reading of an ideal sensor: what is named, and no more."""
    if named.isdisjoint(_OBSERVED):
        return _positions
    if named & _OBSERVED == {'velocity'}:
        return _positions_and_rates
    return _Observer(named, joints).observe


_OBSERVED = {'velocity', 'acceleration', 'effort', 'compliance', 'clearance'}


def _positions(now: int, motion: Motion) -> Reading:
    return new(Reading, (now, motion[1][2], (), (), ()))


def _positions_and_rates(now: int, motion: Motion) -> Reading:
    velocity = motion[2]
    return new(Reading, (now, motion[1][2], velocity[0] if velocity else (), (), ()))


class _Observer:
    """Reads off a motion what is published of it."""

    def __init__(self, named: set[str], joints: int) -> None:
        self._joints = joints
        self._rates = _rates if 'velocity' in named else _nothing
        self._accelerations = _accelerations if 'acceleration' in named else _nothing
        self._efforts = self._drive_efforts if 'effort' in named else _nothing

    def observe(self, now: int, motion: Motion) -> Reading:
        joints, shift = motion[1][2], motion[6]
        if shift:
            joints = tuple(map(add, joints, shift))
        rates, accelerations = self._rates(motion), self._accelerations(motion)
        return new(Reading, (now, joints, rates, accelerations, self._efforts(motion)))

    def _drive_efforts(self, motion: Motion) -> tuple[float, ...]:
        """Return the efforts of the inputs, which are published first; 0 for the others."""
        efforts = motion[4]
        return (*efforts, *(0.0,) * (self._joints - len(efforts))) if efforts else ()


def _rates(motion: Motion) -> tuple[float, ...]:
    velocity = motion[2]
    return velocity[0] if velocity else ()


def _accelerations(motion: Motion) -> tuple[float, ...]:
    acceleration = motion[3]
    return acceleration[0] if acceleration else ()


def _nothing(_motion: Motion) -> tuple[float, ...]:
    return ()
