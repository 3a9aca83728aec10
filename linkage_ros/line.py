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
from types import ModuleType
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.drives.drive import Context, Drive, DRIVES
from linkage_ros.effects.stage import (
    in_order,
    LOADED,
    module_of,
    needs,
    OpenWriter,
    PUBLISHED_WITH,
    Sensor,
    Writer,
)
from linkage_ros.errors import DefinitionError, listed
from linkage_ros.joint_state import Rejection
from linkage_ros.kinematics.closure import Closure
from linkage_ros.look import (
    at_rest,
    Delayed,
    full_look,
    gap_seen,
    in_line,
    Look,
    observer,
    plain_look,
    sensing,
    silent_beyond,
)
from linkage_ros.scene.scene import Member, Scene
from linkage_ros.solvers.registry import SOLVERS

if TYPE_CHECKING:
    from linkage_ros.faults.injection import Injection
    from linkage_ros.solvers.solver import Choice


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
    write_open
        Writes it where the loop has no pose; nothing where it has nothing to say then.
    of_reading
        Whether it is made of the reading alone, and so also of one that arrives where the loop has
        no pose.

    """

    effect: str
    topic: str
    message: str
    write: Writer
    write_open: OpenWriter | None
    of_reading: bool


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
            of_linkage = error.where.startswith('masses')
            content = member.linkage_content if of_linkage else member.content
            raise content.error(error.where, error.reason, error.remedy) from None

    def _build(self, scene: Scene, closure: Closure | None, injection: Injection | None) -> None:
        member = self.member
        _refuse_not_imported(member)
        drive, drive_parameters = member.drive
        drive_module = import_module(DRIVES[drive])
        named = set(member.effects)
        named |= {also for effect in named for also in PUBLISHED_WITH.get(effect, ())}
        moves_by_rates = getattr(drive_parameters, 'carry_forward', True)
        starting = named - _between_readings(member, named, moves_by_rates)
        computed = named | {need for effect in starting for need in needs(effect)}
        modules = {name: module_of(name) for name in in_order(computed)}
        forced = drive == 'torque' or not computed.isdisjoint(LOADED)
        _refuse_idle(member, forced)
        _refuse_solver(member, forced)

        seed = f'{scene.seed}/{member.name}'
        parameters = {
            name: member.effects.get(name) or module.PARAMETERS()
            for name, module in modules.items()
        }
        self.closure = closure or _closure(member, modules, parameters, seed, forced)
        friction = modules.get('friction')
        self.context = Context(
            closure=self.closure,
            rate=scene.rate,
            needs_rate='velocity' in computed,
            seed=seed,
            loads=member.loads,
            friction=friction.friction(parameters['friction']) if friction else None,
            prefix=member.prefix,
            dependent=scene.dependent_joints,
            effects=frozenset(member.effects),
            moves_by_rates=moves_by_rates,
        )
        self.topic: str = getattr(drive_module, 'TOPIC', '')
        """Topic that the drive listens to; '' for none."""
        self.drive: Drive = drive_module.build(drive_parameters, self.context)
        self._read = drive_module.reader(self.context) if self.topic else None

        def built(function: str) -> dict[str, Any]:
            return {
                name: getattr(module, function)(parameters[name], self.context)
                for name, module in modules.items()
                if hasattr(module, function)
            }

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
        by_effect: dict[str, Any] = built('sensor')
        if {'encoder', 'rate_limit'} <= set(by_effect):
            by_effect['rate_limit'].read_by(by_effect['encoder'])
        sensors = list(by_effect.values())
        if 'delay' in modules:
            *before, delay = sensors
            sensors = [Delayed(before, delay)]
        with_rates = 'velocity' in named or 'velocity' not in computed
        line = in_line([*sensors, *faulty], self.closure, scene.wrapped, with_rates)
        sense, gap = sensing(line), gap_seen(line)
        self._seeing_gaps: list[Any] = [sensor for sensor in line if hasattr(sensor, 'gap')]
        stages = list(built('stage').values())
        drive_stages = list(built('drive_stage').values())
        begin = built('begin').get('velocity', at_rest)
        state, close = self.drive.state, self.closure.position
        if member.silent_beyond_limits and self.closure.bounds:
            close = silent_beyond(close, self.closure)
        self.look: Callable[[int], Look]
        """Returns what the linkage comes to at a time, in [ns]."""
        publishing = {
            name: module
            for name, module in modules.items()
            if name in named and hasattr(module, 'TOPIC')
        }
        if begin is not at_rest or drive_stages or mechanism or publishing:
            read = named | ({'velocity'} & computed)
            observe = observer(read, len(self.closure.linkage.joints))
            self.look = full_look(
                state, drive_stages, close, mechanism, begin, stages, observe, sense, gap
            )
        else:
            self.look = plain_look(state, close, sense, gap)
        self.extras = [
            _extra(name, module, module.writer(parameters[name], self.context), member.name)
            for name, module in publishing.items()
        ]
        self.stages = tuple(modules)
        """Names of the effects that are computed, in physical order."""

    @property
    def gap_begins(self) -> bool:
        """Return whether a gap began with the last tick, if that had no pose."""
        return any(sensor.gap_begins for sensor in self._seeing_gaps)

    @property
    def choice(self) -> Choice | None:
        """Return what closes the loops and why, where an accuracy is asked for; else nothing."""
        found: Choice | None = getattr(self.closure, 'choice', None)
        return found

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


def _between_readings(member: Member, named: set[str], moves_by_rates: bool) -> set[str]:
    """Return the effects that mix readings, where they do so without rates or not at all."""
    found = {'jitter', 'delay'} & named
    if moves_by_rates and 'delay' in found:
        delay = module_of('delay')
        parameters = member.effects.get('delay') or delay.PARAMETERS()
        return set() if delay.interpolates(parameters, named) else {'delay'}
    return set() if moves_by_rates else found


def _extra(name: str, module: ModuleType, write: Writer, member: str) -> Extra:
    topic: str = f'~/{member}/{module.TOPIC[2:]}' if member else module.TOPIC
    of_reading = getattr(module, 'OF_READING', False)
    return Extra(name, topic, module.MESSAGE, write, getattr(write, 'no_pose', None), of_reading)


def _refuse_not_imported(member: Member) -> None:
    if member.not_imported:
        from linkage_ros.effects.own import found_in  # local import: only where a scene has one

        name = member.not_imported[0]
        raise DefinitionError(
            f'effects.{name}',
            f'names a module, and what a bag names is not imported unasked; the name leads to '
            f'{found_in(name)} here',
            '--trust-effects imports it',
        )


def _refuse_idle(member: Member, forced: bool) -> None:
    """Refuse what acts on nothing."""
    # Of several linkages those without forces may share what others need.
    own = member.content
    for given, key in (
        (member.loads and 'loads' in own, 'loads'),
        ('friction' in member.effects and 'effects' in own, 'effects.friction'),
    ):
        if given and not forced:
            raise DefinitionError(
                key,
                'acts on nothing here: no effect and no drive asks for forces',
                f'leave it out, drive by torque, or name one of {listed(LOADED)}',
            )


def _refuse_solver(member: Member, forced: bool) -> None:
    """Refuse what has no poses of dyads where forces start from these."""
    if forced and member.solver is not None and member.solver[0] != 'closed_form':
        raise DefinitionError(
            'solver',
            f'{member.solver[0]} finds no forces, and an effect or the drive asks for them',
            f'write closed_form, or leave {listed(LOADED)} and torque out',
        )


def _closure(
    member: Member,
    modules: dict[str, ModuleType],
    parameters: dict[str, Any],
    seed: str,
    forced: bool,
) -> Closure:
    linkage = member.linkage
    for name, module in modules.items():
        if hasattr(module, 'alter'):
            linkage = module.alter(parameters[name], linkage, Context.generator(seed, name))
    if member.accuracy is not None:
        from linkage_ros.solvers import choose  # local import: only where an accuracy is asked for

        if forced:
            return choose.only_closed_form(linkage, 'forces start from it')
        return choose.choose(linkage, member.accuracy)
    if member.solver is not None:
        name, solving = member.solver
        closure: Closure = import_module(SOLVERS[name]).build(solving, linkage)
        return closure
    return Closure(linkage)
