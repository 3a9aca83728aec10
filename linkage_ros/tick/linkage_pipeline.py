# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Compute the state of one linkage at a tick: crank, closure, mechanism, sensors.

Only the stages that the scene names are built; a tick never reads the scene. Combinations of
effects that act on nothing are refused.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from operator import add
from typing import Any, NamedTuple, TYPE_CHECKING, TypeVar

from linkage_ros.description import Scene, SceneLinkage
from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics import Closure, Position, Status
from linkage_ros.messages import Rejection
from linkage_ros.stages.drives import Context, Crank, CrankState, Drive
from linkage_ros.stages.effects import (
    Continuous,
    DriveEffect,
    Effect,
    effect_class,
    first_values,
    force_effects,
    ForceEffect,
    in_order,
    LinkageEffect,
    MechanismEffect,
    MechanismState,
    MessageEffect,
    needed_effects,
    SensorEffect,
    SensorReading,
    SensorStage,
    wrap_all,
    WriterStage,
)
from linkage_ros.tick.linkage_state import LinkageState

if TYPE_CHECKING:
    from linkage_ros.dynamics import AppliedForces, HeldWrench
    from linkage_ros.stages.faults import Injection

_Base = TypeVar('_Base', bound=Effect)


class AuxiliaryOutput(NamedTuple):
    """A message published as well as the joint states."""

    effect: str  # The effect that asks for it
    # Name and type (package/msg/Type) of the topic.
    topic: str
    message: str
    writer: WriterStage  # Serializes the message

    @property
    def forces_only(self) -> bool:
        """Return whether the message contains joint forces only."""
        return self.writer.of_forces


class LinkagePipeline:
    """
    The pipeline of one linkage. To reset it, build it again.

    A given closure is reused: it has no state. Raise `FileError` if parts of the scene do not fit
    together, or if the linkage does not close.
    """

    def __init__(
        self,
        scene: Scene,
        scene_linkage: SceneLinkage,
        closure: Closure | None,
        injection: Injection | None,
    ) -> None:
        self.scene_linkage = scene_linkage
        try:
            self._build_stages(scene, closure, injection)
        except DefinitionError as error:
            of_linkage = error.where.startswith('masses')
            content = scene_linkage.linkage_content if of_linkage else scene_linkage.content
            if error.where == 'masses' and 'urdf' in content:
                remedy = 'add <inertial> to the links of the robot, or leave gravity out'
                reason = 'no link of its loops has a mass, and forces are asked for'
                raise content.error('urdf', reason, remedy) from None
            raise content.locate_error(error) from None

    def _build_stages(
        self, scene: Scene, closure: Closure | None, injection: Injection | None
    ) -> None:
        scene_linkage = self.scene_linkage
        self.wanted = wanted = choose_effects(scene_linkage)
        mechanism = wanted.of_kind(MechanismEffect)
        self._computed_fields = frozenset(effect.gives for effect in mechanism.values()) - {''}
        self.published_fields = self._computed_fields - frozenset(
            effect.gives for name, effect in mechanism.items() if name not in wanted.named
        )
        """Fields of the reading that are published in addition to the joints."""
        seed = f'{scene.seed}/{scene_linkage.name}'
        self.closure = closure or _make_closure(scene_linkage, wanted, seed)
        self.context = Context(
            closure=self.closure,
            rate=scene.rate,
            needs_rate='rates' in self._computed_fields,
            seed=seed,
            loads=scene_linkage.loads,
            friction=next((f.friction for f in wanted.of_kind(ForceEffect).values()), None),
            prefix=scene_linkage.prefix,
            dependent=scene.dependent_joints,
            effects=frozenset(scene_linkage.effects),
            moves_by_rates=wanted.moves_by_rates,
            takes_efforts=any(effect.takes_efforts for effect in wanted.effects.values()),
            instead_of_inputs=scene_linkage.instead_of_inputs,
        )
        self._build_drive(wanted, injection)
        self._build_mechanism(wanted, injection)
        self._build_sensors(wanted, injection, wrapped=scene.wrapped)
        self._build_outputs(wanted)

    def _build_drive(self, wanted: WantedEffects, injection: Injection | None) -> None:
        """Build what gives the crank state: the drive, its messages and the effects on it."""
        drive: Drive
        name, drive = self.scene_linkage.drive
        if self.context.takes_efforts and not drive.is_measured:
            raise DefinitionError(
                'effects.effort.measured',
                f'the drive {name} takes no samples with efforts',
                'write drive: {topic: {}}',
            )
        self.topic = drive.listens_to
        """Topic of the drive; '' for none."""
        self.drive: Crank = drive.build(self.context)
        self._parse_sample = drive.reader(self.context) if self.topic else None
        self._message_faults = (
            injection.build_functions('message') if injection is not None else []
        )
        if self._message_faults and not self.topic:
            raise DefinitionError(
                'faults', f'not_a_number corrupts messages, and {name} has none', 'leave it out'
            )
        self.drive_stages = [
            effect.drive_stage(self.context) for effect in wanted.of_kind(DriveEffect).values()
        ]

    def _build_mechanism(self, wanted: WantedEffects, injection: Injection | None) -> None:
        """Build what gives the motion: the closure, the wrenches, the faults and the effects."""
        loads = self.scene_linkage.loads if wanted.computes_forces else None
        self.changing_loads: AppliedForces | None = None
        """Loads that change with the time or by messages; None without any."""
        self.wrenches: dict[str, HeldWrench] = {}
        """The wrenches that messages give, by the name of the link."""
        if loads is not None and (loads.applied.changes_with_time or loads.applied.wrenches):
            self.changing_loads = self.context.mechanics.applied
            assert self.changing_loads is not None
            self.wrenches = self.changing_loads.wrenches
        self._solve_loops = self.closure.position
        if self.scene_linkage.silent_beyond_limits and self.closure.bounds:
            self._solve_loops = _suppress_beyond_limits(self._solve_loops, self.closure)
        self.mechanism_faults = (
            injection.build_functions('mechanism', self.context) if injection is not None else []
        )
        mechanism = wanted.of_kind(MechanismEffect).values()
        self.mechanism_stages = [effect.stage(self.context) for effect in mechanism]

    def _build_sensors(
        self, wanted: WantedEffects, injection: Injection | None, *, wrapped: bool
    ) -> None:
        """Build what makes the published reading of the ideal one."""
        sensors: dict[str, Any] = {}
        for name, effect in wanted.of_kind(SensorEffect).items():
            sensors[name] = effect.sensor(self.context)
            if effect.reads in sensors:
                sensors[name].read_by(sensors[effect.reads])
        joints = self.scene_linkage.joint_names
        broken = injection.build_functions('sensor', joints) if injection is not None else []
        angles = Continuous(self.closure.turning, first_values(self.closure))
        behind = [*sensors.values(), *broken]
        self.running = angles if behind or not wrapped else None
        if behind and 'rates' in self._computed_fields - self.published_fields:
            # Only used between readings; not published.
            self.published_fields |= {'rates'}
            behind.append(_remove_rates)
        if wrapped:
            behind.append(wrap_all(self.closure.turning))
        running = [] if self.running is None else [self.running]
        self._sensor_stages = [SensorStage.from_sensor(sensor) for sensor in (*running, *behind)]
        self.apply_later_sensors = (
            partial(self._apply_sensors, first=len(running)) if behind else None
        )

    def _build_outputs(self, wanted: WantedEffects) -> None:
        """Build the messages other than the joint states: of the effects, and of the drive."""
        scene_linkage = self.scene_linkage
        self.extras = [
            _make_output(
                name,
                effect.topic,
                effect.message,
                effect.writer(self.context),
                scene_linkage.name,
                of_reading=effect.of_reading,
                of_forces=effect.of_forces,
            )
            for name, effect in wanted.of_kind(MessageEffect).items()
            if name in wanted.named
        ]
        """The topics other than that of the joint states."""
        name, drive = scene_linkage.drive
        if (written := drive.writer(self.context, self.drive)) is not None:
            self.extras.append(
                _make_output(
                    name,
                    drive.publishes,
                    drive.message,
                    written,
                    scene_linkage.name,
                    of_reading=True,
                )
            )

    @property
    def writes_forces(self) -> bool:
        """Return whether a message contains joint forces only."""
        return any(extra.forces_only for extra in self.extras)

    def interpret(self, now: int) -> LinkageState:
        """Return the state of the linkage at a time, in [ns], step by step."""
        crank = self.drive.state(now)
        if crank is not None:
            for stage in self.drive_stages:
                crank = stage(crank)
        return self.interpret_from(now, crank)

    def interpret_from(self, now: int, crank: CrankState | None) -> LinkageState:
        """Return the state of the linkage, step by step from the crank state on."""
        if crank is None:
            reading = self._apply_sensors_in_gap(now)
            return LinkageState(self.solve_mechanism, None, reading, solution=(None, None))
        position = self._solve_loops(*crank.angles)
        for fault in self.mechanism_faults:
            position = fault(position)
        if not position.joints:
            reading = self._apply_sensors_in_gap(now)
            return LinkageState(self.solve_mechanism, crank, reading, solution=(position, None))
        # The time of the loads begins here: a bag does not know of ticks before the first pose.
        loads = self.changing_loads.given_at(now) if self.changing_loads is not None else ()
        if self.context.takes_efforts:
            loads += self.drive.efforts
        motion = self._mechanism_motion(crank, position, loads)
        reading = self._apply_sensors(now, self.observe(now, motion))
        return LinkageState(self.solve_mechanism, crank, reading, (), loads, (position, motion))

    def solve_mechanism(
        self, crank: CrankState, loads: tuple[float, ...]
    ) -> tuple[Position, MechanismState]:
        """Return position and motion of the linkage for a crank state of a compiled tick."""
        position = self._solve_loops(*crank.angles)
        return position, self._mechanism_motion(crank, position, loads)

    def _mechanism_motion(
        self, crank: CrankState, position: Position, loads: tuple[float, ...]
    ) -> MechanismState:
        """Return the motion of the mechanism in a pose."""
        motion = MechanismState(crank, position, None, None, (), (), (), loads)
        for stage in self.mechanism_stages:
            motion = stage(motion)
        return motion

    def observe(self, now: int, motion: MechanismState) -> SensorReading:
        """Return the ideal reading of a motion, with the values that the scene asks for."""
        position, velocity, acceleration = motion.position, motion.velocity, motion.acceleration
        efforts: tuple[float, ...] = ()
        if 'efforts' in self.published_fields and motion.efforts:
            # Efforts of the inputs, which are published first; 0 for the other joints.
            efforts = (*motion.efforts, *(0.0,) * (len(position.joints) - len(motion.efforts)))
        return SensorReading(
            now,
            tuple(map(add, position.joints, motion.deflection))
            if motion.deflection
            else position.joints,
            velocity.joints if velocity and 'rates' in self.published_fields else (),
            acceleration.joints
            if acceleration and 'accelerations' in self.published_fields
            else (),
            efforts,
        )

    def _apply_sensors(
        self, now: int, ideal: SensorReading, first: int = 0
    ) -> SensorReading | None:
        """Apply the sensor stages, from index `first` on, to an ideal reading."""
        reading: SensorReading | None = ideal
        gap = False
        for sensor in self._sensor_stages[first:]:
            if reading is not None:
                reading = sensor.read(now, reading)
                gap = sensor.gap is not None
            elif sensor.silence is not None:
                reading = sensor.silence(now, gap)
        return reading

    def _apply_sensors_in_gap(self, now: int) -> SensorReading | None:
        """Return the sensor reading where the linkage has no pose."""
        reading: SensorReading | None = None
        for sensor in self._sensor_stages:
            if reading is not None:
                reading = sensor.read(now, reading)
            elif sensor.gap is not None:
                reading = sensor.gap(now)
        return reading

    def write_extras(self, now: int, state: LinkageState) -> list[bytes]:
        """Return the auxiliary messages at a time, in [ns]; b'' for none."""
        return [_write_extra(extra, now, state) for extra in self.extras]

    @property
    def gap_begins(self) -> bool:
        """Return whether a gap in the readings began at the last tick, if that had no pose."""
        return any(sensor.gap_begins for sensor in self._sensor_stages)

    def is_idle(self, now: int) -> bool:
        """Return whether a tick at a time, in [ns], would give nothing; False if it may do so."""
        if self.scene_linkage.drive[1].keeps_state or any(
            sensor.gap is not None for sensor in self._sensor_stages
        ):
            return False
        crank = self.drive.state(now)
        if crank is None:
            return True
        speaks = any(extra.writer.no_pose is not None for extra in self.extras)
        return not (speaks or self.drive_stages or self._solve_loops(*crank.angles).joints)

    def is_stale(self, now: int, number: int = 0) -> bool:
        """Return whether an input's newest sample is too old at a time, in [ns]."""
        return now - self.drive.stamps[number] > self.drive.max_age > 0

    def silent_inputs(self, now: int) -> Iterator[tuple[str, int]]:
        """Yield the inputs without a sample at a time, in [ns], and their newest stamps."""
        stamps = self.drive.stamps
        for index, name in enumerate(self.scene_linkage.sampled_joints):
            number = min(index, len(stamps) - 1)  # One stamp is that of all inputs.
            if self.is_stale(now, number):
                yield name, stamps[number]

    def offer(self, message: bytes, now: int) -> Rejection | None:
        """Take a serialized message of the drive's topic at a time, in [ns]; or return why not."""
        if self._parse_sample is None:
            return Rejection.MISSING
        for spoil in self._message_faults:
            message = spoil(message)
        sample = self._parse_sample(message)
        if isinstance(sample, Rejection):
            return sample
        rejection: Rejection | None = self.drive.offer(sample, now)  # type: ignore[attr-defined]
        return rejection


def _write_extra(extra: AuxiliaryOutput, now: int, state: LinkageState) -> bytes:
    writer, reading = extra.writer, state.reading
    if writer.due is not None and not writer.due(now):
        return b''
    if writer.of_reading:
        return b'' if reading is None else writer.write(now, None, reading)
    if state.is_compiled and extra.forces_only:
        return b'' if reading is None else writer.write(now, state, reading)
    if state.motion is not None:
        return b'' if reading is None else writer.write(now, state.motion, reading)
    if state.position is None or writer.no_pose is None:
        return b''
    return writer.no_pose(now, state.position)


def _make_output(
    name: str, topic: str, message: str, writer: Any, linkage_name: str, **made_of: bool
) -> AuxiliaryOutput:
    within = f'~/{linkage_name}/{topic[2:]}' if linkage_name else topic
    return AuxiliaryOutput(name, within, message, WriterStage.from_writer(writer, **made_of))


def _remove_rates(_now: int, reading: SensorReading) -> SensorReading:
    """Remove the rates, which were only used between readings."""
    return reading._replace(rates=())


def _suppress_beyond_limits(
    close: Callable[..., Position], closure: Closure
) -> Callable[..., Position]:
    """Wrap a closure function so that a pose beyond the joint limits publishes no joints."""

    def close_within(*inputs: float) -> Position:
        position = close(*inputs)
        if position.joints and closure.bounds.first_exceeded(inputs, position.joints) is not None:
            return replace(position, status=Status.LIMITED, joints=())
        return position

    return close_within


def _make_closure(scene_linkage: SceneLinkage, wanted: WantedEffects, seed: str) -> Closure:
    """Return the closure of a linkage as its effects alter it."""
    linkage: Any = scene_linkage.linkage
    for name, effect in wanted.of_kind(LinkageEffect).items():
        linkage = effect.alter(linkage, Context.generator(seed, name))
    return scene_linkage.closure if linkage is scene_linkage.closure.linkage else Closure(linkage)


@dataclass(frozen=True)
class WantedEffects:
    """The effects that a linkage computes, with their parameters."""

    named: frozenset[str]  # Those that the scene names, and those published with them
    effects: Mapping[str, Effect]  # All that are computed, by name, in physical order
    computes_forces: bool  # Whether an effect or the drive asks for forces
    moves_by_rates: bool  # Whether the drive moves the crank on by its rates between samples

    def of_kind(self, base: type[_Base]) -> dict[str, _Base]:
        """Return the effects that act in the place of a base, by name, in physical order."""
        return {name: effect for name, effect in self.effects.items() if isinstance(effect, base)}


def choose_effects(scene_linkage: SceneLinkage) -> WantedEffects:
    """Return the effects of a linkage, and those that they start from."""
    _refuse_not_imported(scene_linkage)
    _, drive = scene_linkage.drive
    effects = dict(scene_linkage.effects)
    for effect in scene_linkage.effects.values():
        for also in effect.publishes_with:
            effects.setdefault(also, effect_class(also)())
    named = frozenset(effects)
    moves_by_rates = drive.moves_by_rates
    needs = {
        need
        for effect in effects.values()
        for need in effect.needs_here(named, moves_by_rates=moves_by_rates)
    }
    for name in needs.union(*map(needed_effects, needs)):
        effects.setdefault(name, effect_class(name)())
    computes_forces = drive.gives_torque or any(e.computes_forces for e in effects.values())
    _refuse_idle(scene_linkage, computes_forces)
    ordered = {name: effects[name] for name in in_order(effects)}
    return WantedEffects(named, ordered, computes_forces, moves_by_rates)


def _refuse_not_imported(scene_linkage: SceneLinkage) -> None:
    if scene_linkage.not_imported:
        from linkage_ros.stages.effects import found_in

        name = scene_linkage.not_imported[0]
        raise DefinitionError(
            f'effects.{name}',
            f'names a module, and what a bag names is not imported unasked; the name leads to '
            f'{found_in(name)} here',
            '--trust-effects imports it',
        )


def _refuse_idle(scene_linkage: SceneLinkage, forced: bool) -> None:
    """Refuse an effect that has nothing to act on."""
    # With several linkages, one without forces may share an effect that another one needs.
    section = scene_linkage.content
    idle = ['loads'] if scene_linkage.loads and 'loads' in section else []
    if 'effects' in section:
        effects = scene_linkage.effects.items()
        idle += [f'effects.{name}' for name, effect in effects if isinstance(effect, ForceEffect)]
    if idle and not forced:
        raise DefinitionError(
            idle[0],
            'acts on nothing here: no effect and no drive asks for forces',
            f'leave it out, drive by torque, or name one of {list_names(force_effects())}',
        )
