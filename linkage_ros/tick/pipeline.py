# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Compute the tick of a scene, top to bottom: crank, closure, mechanism, sensors, message.

Only the stages that the scene names are built; a tick never reads the scene.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from importlib import import_module
from itertools import chain
from operator import add
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.description import Scene, SceneLinkage
from linkage_ros.errors import DefinitionError, quote
from linkage_ros.kinematics import all_finite, Closure, Position, Status
from linkage_ros.messages import JointStateWriter, Rejection
from linkage_ros.stages.drives import Context, CrankState, Drive, DRIVES
from linkage_ros.stages.effects import (
    Continuous,
    first_values,
    FORCE_EFFECTS,
    MechanismState,
    SensorReading,
    SensorStage,
    wrap_all,
    WriterStage,
)
from linkage_ros.tick.compiled_tick import (
    compile_contribution,
    compile_linkage_state,
    compile_scene_tick,
    compile_tick,
    CompiledState,
    CompiledTick,
    StateTuple,
)
from linkage_ros.tick.sample_router import SampleRouter
from linkage_ros.tick.wanted_effects import choose_effects, WantedEffects

if TYPE_CHECKING:
    from linkage_ros.dynamics import AppliedForces, HeldWrench
    from linkage_ros.kinematics.compiling import TracedMotion as CompiledMotion
    from linkage_ros.stages.faults import Injection
    from linkage_ros.tick.wrench_topics import WrenchTopic

_SUPPRESSING = {'rate_limit', 'dropout', 'delay', 'jitter'}
"""Effects that may suppress the message of a tick."""

_RUNNING_IN_GAPS = {'backlash'}
"""Effects that keep running while a loop is open."""

_KINEMATIC = ('velocity', 'acceleration')
"""Stages of the mechanism that a compiled linkage computes itself, by its derivatives."""

_FORCES_ONLY = {'pin_forces'}
"""Effects whose messages contain joint forces only."""


class LinkageState(NamedTuple):
    """The state of one linkage at a tick, step by step."""

    crank: CrankState | None  # State of the crank; None without a crank state
    position: Position | None  # Solution of the loops; None without a crank state
    motion: MechanismState | None  # Motion of the mechanism; None where the loops do not close
    # Published values; None where nothing is published. A delay stage may publish a reading
    # although the linkage has no pose.
    reading: SensorReading | None


class Tick(NamedTuple):
    """
    The result of a tick.

    Attributes
    ----------
    message
        The serialized JointState; empty where nothing is published.
    extras
        One serialized message for each auxiliary topic, b'' where that topic has none; an empty
        tuple where no auxiliary topic has a message.
    states
        State of each linkage, as far as the message needed it.
    linkages
        The linkage pipelines.

    """

    message: bytes
    extras: tuple[bytes, ...]
    states: Sequence[LinkageState | CompiledState | StateTuple]
    linkages: Sequence[LinkagePipeline]

    @property
    def full_states(self) -> tuple[LinkageState, ...]:
        """State of each linkage in full; computes here what the message did not need."""
        return tuple(
            linkage.complete_state(state)
            for linkage, state in zip(self.linkages, self.states, strict=True)
        )


class AuxiliaryOutput(NamedTuple):
    """A message published beside the joint states."""

    effect: str  # The effect that asks for it
    # Name and type (package/msg/Type) of the topic.
    topic: str
    message: str
    writer: WriterStage  # Serializes the message


@dataclass(frozen=True)
class _OutputSelection:
    """Picks the values that the scene publishes from the motion of a compiled linkage."""

    # Two objects with equal keys pick the same values.
    key: list[Any]
    select_values: Callable[..., Sequence[Sequence[float]]] = field(compare=False)

    def __call__(self, motion: CompiledMotion, *given: float) -> Sequence[Sequence[float]]:
        """Return the values, in groups."""
        return self.select_values(motion, *given)


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
            raise content.locate_error(error) from None

    def _build_stages(
        self, scene: Scene, closure: Closure | None, injection: Injection | None
    ) -> None:
        scene_linkage = self.scene_linkage
        wanted = choose_effects(scene_linkage)
        self.effect_names = tuple(effect.name for effect in wanted.effects)
        """Names of the computed effects, in physical order."""
        seed = f'{scene.seed}/{scene_linkage.name}'
        self.closure = closure or _make_closure(scene_linkage, wanted, seed)
        friction = wanted.parameters.get('friction')
        self.context = Context(
            closure=self.closure,
            rate=scene.rate,
            needs_rate='velocity' in self.effect_names,
            seed=seed,
            loads=scene_linkage.loads,
            friction=friction.friction if friction is not None else None,
            prefix=scene_linkage.prefix,
            dependent=scene.dependent_joints,
            effects=frozenset(scene_linkage.effects),
            moves_by_rates=wanted.moves_by_rates,
        )
        self._build_drive(wanted, injection)
        self._build_mechanism(wanted, injection)
        self._build_sensors(wanted, injection, wrapped=scene.wrapped)
        self._build_outputs(wanted)
        self._compiled_tick = self._compile_tick(wanted)

    def _build_drive(self, wanted: WantedEffects, injection: Injection | None) -> None:
        """Build what gives the crank state: the drive, its messages and the effects on it."""
        drive, parameters = self.scene_linkage.drive
        module = import_module(DRIVES[drive])
        self.topic: str = getattr(module, 'TOPIC', '')
        """Topic of the drive; '' for none."""
        self.drive: Drive = module.build(parameters, self.context)
        self._parse_sample = module.reader(parameters, self.context) if self.topic else None
        self._message_faults = (
            injection.build_functions('message') if injection is not None else []
        )
        if self._message_faults and not self.topic:
            raise DefinitionError(
                'faults', f'not_a_number corrupts messages, and {drive} has none', 'leave it out'
            )
        self._drive_stages = [*wanted.build('drive_stage', self.context).values()]

    def _build_mechanism(self, wanted: WantedEffects, injection: Injection | None) -> None:
        """Build what gives the motion: the closure, the wrenches, the faults and the effects."""
        loads = self.scene_linkage.loads if wanted.computes_forces else None
        self._applied: AppliedForces | None = None
        """Loads that change with the time or by messages; None without any."""
        self.wrenches: dict[str, HeldWrench] = {}
        """The wrenches that messages give, by the name of the link."""
        if loads is not None and (loads.applied.changes_with_time or loads.applied.wrenches):
            self._applied = self.context.mechanics.applied
            assert self._applied is not None
            self.wrenches = self._applied.wrenches
        self._solve_loops = self.closure.position
        if self.scene_linkage.silent_beyond_limits and self.closure.bounds:
            self._solve_loops = _suppress_beyond_limits(self._solve_loops, self.closure)
        self._mechanism_faults = (
            injection.build_functions('mechanism', self.context) if injection is not None else []
        )
        self._mechanism_stages = [*wanted.build('stage', self.context).values()]

    def _build_sensors(
        self, wanted: WantedEffects, injection: Injection | None, *, wrapped: bool
    ) -> None:
        """Build what makes the published reading of the ideal one."""
        sensors = wanted.build('sensor', self.context)
        if {'encoder', 'rate_limit'} <= set(sensors):
            sensors['rate_limit'].read_by(sensors['encoder'])
        joints = self.scene_linkage.joint_names
        broken = injection.build_functions('sensor', joints) if injection is not None else []
        angles = Continuous(self.closure.turning, first_values(self.closure))
        behind = [*sensors.values(), *broken]
        self._running = angles if behind or not wrapped else None
        self._observed_effects = wanted.named
        if behind and 'velocity' in self.effect_names and 'velocity' not in wanted.named:
            # Only used between readings; not published.
            self._observed_effects |= {'velocity'}
            behind.append(_remove_rates)
        if wrapped:
            behind.append(wrap_all(self.closure.turning))
        running = [] if self._running is None else [self._running]
        self._sensor_stages = [SensorStage.from_sensor(sensor) for sensor in (*running, *behind)]
        self._apply_later_sensors = (
            partial(self._apply_sensors, first=len(running)) if behind else None
        )

    def _build_outputs(self, wanted: WantedEffects) -> None:
        """Build the messages beside the joint states: of the effects, and of the drive."""
        scene_linkage = self.scene_linkage
        writers = wanted.build('writer', self.context, wanted.named)
        self.extras = [
            _make_output(
                effect.name,
                effect.topic,
                effect.message,
                writers[effect.name],
                scene_linkage.name,
                of_reading=effect.of_reading,
            )
            for effect in wanted.effects
            if effect.name in writers
        ]
        """The topics beside the joint states."""
        drive, parameters = scene_linkage.drive
        module = import_module(DRIVES[drive])
        if (of_drive := getattr(module, 'writer', None)) is not None:
            written = of_drive(parameters, self.context, self.drive)
            if written is not None:
                topic, message = module.EXTRA_TOPIC, module.EXTRA_MESSAGE
                self.extras.append(
                    _make_output(
                        drive, topic, message, written, scene_linkage.name, of_reading=True
                    )
                )

    def _compile_tick(self, wanted: WantedEffects) -> CompiledTick | None:
        """Generate the tick up to the reading; None where a part has no generated form."""
        moved = {effect.name for effect in wanted.effects if effect.stage is not None}
        if self._mechanism_faults:
            return None
        if not moved <= {*_KINEMATIC, *FORCE_EFFECTS}:
            return None
        outputs, applied = None, None if moved.isdisjoint(FORCE_EFFECTS) else self._applied
        if 'acceleration' in moved:
            of = [wanted.parameters[name] for name in self.effect_names if name in moved]
            of += [self._observed_effects, self.context.loads, self.context.friction]
            outputs = _OutputSelection(of, self._symbolic_outputs)
        compiled = self.closure.compile_linkage(
            len(moved.intersection(_KINEMATIC)), outputs, applied.given_count if applied else 0
        )
        # Where the forces have no solution, a compiled path has fewer values.
        if len({tuple(map(len, path.outputs)) for path in compiled.paths}) != 1:
            return None
        return compile_tick(self.drive, self._drive_stages, compiled, self._running, applied)

    @property
    def whole_tick(self) -> CompiledTick | None:
        """Return the generated tick up to the reading; None if a stage is not generated."""
        of_seen = all(
            extra.writer.of_reading or extra.effect in _FORCES_ONLY for extra in self.extras
        )
        return self._compiled_tick if self._apply_later_sensors is None and of_seen else None

    @cached_property
    def compute_state(self) -> Callable[[int], LinkageState | CompiledState]:
        """Return a function from the time, in [ns], to the state of the linkage."""
        if self._compiled_tick is None:
            return self._interpret_state
        return compile_linkage_state(
            self._compiled_tick, self._apply_later_sensors, self.interpret_from_crank
        )

    def _interpret_state(self, now: int) -> LinkageState:
        """Return the state of the linkage at a time, in [ns], step by step."""
        crank = self.drive.state(now)
        if crank is not None:
            for stage in self._drive_stages:
                crank = stage(crank)
        return self.interpret_from_crank(now, crank)

    def interpret_from_crank(self, now: int, crank: CrankState | None) -> LinkageState:
        """Return the state of the linkage, given the crank state."""
        if crank is None:
            return LinkageState(None, None, None, self._apply_sensors_in_gap(now))
        position = self._solve_loops(*crank.angles)
        for fault in self._mechanism_faults:
            position = fault(position)
        if not position.joints:
            return LinkageState(crank, position, None, self._apply_sensors_in_gap(now))
        # The time of the loads begins here: a bag does not know of ticks before the first pose.
        given = self._applied.given_at(now) if self._applied is not None else ()
        motion = self._mechanism_motion(crank, position, given)
        return LinkageState(
            crank, position, motion, self._apply_sensors(now, self._observe(now, motion))
        )

    def _symbolic_outputs(
        self, motion: CompiledMotion, *given: float
    ) -> Sequence[Sequence[float]]:
        """Return the ideal reading of a symbolic motion, and the joint forces."""
        acceleration = motion.acceleration
        if acceleration is None or not all_finite(acceleration.joints):
            return []
        moved = MechanismState(CrankState((), (), (), 0), *motion, (), (), (), given)
        _velocity, _acceleration, *stages = self._mechanism_stages
        for stage in stages:
            moved = stage(moved)
        reactions = (
            [] if _FORCES_ONLY.isdisjoint(self._observed_effects) else [*chain(*moved.reactions)]
        )
        return [*self._observe(0, moved)[1:], reactions]

    def _mechanism_motion(
        self, crank: CrankState, position: Position, given: tuple[float, ...]
    ) -> MechanismState:
        """Return the motion of the mechanism in a pose."""
        motion = MechanismState(crank, position, None, None, (), (), (), given)
        for stage in self._mechanism_stages:
            motion = stage(motion)
        return motion

    def _observe(self, now: int, motion: MechanismState) -> SensorReading:
        """Return the ideal reading of a motion, with the values that the scene asks for."""
        position, velocity, acceleration = motion.position, motion.velocity, motion.acceleration
        efforts: tuple[float, ...] = ()
        if 'effort' in self._observed_effects and motion.efforts:
            # Efforts of the inputs, which are published first; 0 for the other joints.
            efforts = (*motion.efforts, *(0.0,) * (len(position.joints) - len(motion.efforts)))
        return SensorReading(
            now,
            tuple(map(add, position.joints, motion.deflection))
            if motion.deflection
            else position.joints,
            velocity.joints if velocity and 'velocity' in self._observed_effects else (),
            acceleration.joints
            if acceleration and 'acceleration' in self._observed_effects
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

    def complete_state(self, state: LinkageState | CompiledState | StateTuple) -> LinkageState:
        """Return the full state of a linkage; the generated tick leaves a part out."""
        if isinstance(state, LinkageState):
            return state
        crank_numbers, numbers, _, given = state
        crank = _crank_state(crank_numbers)
        position = self._solve_loops(*crank.angles)
        reading = None if numbers is None else SensorReading(*numbers)
        return LinkageState(
            crank, position, self._mechanism_motion(crank, position, given), reading
        )

    def write_extras(self, now: int, state: LinkageState | CompiledState) -> list[bytes]:
        """Return the auxiliary messages at a time, in [ns]; b'' for none."""
        return [self._write_extra(extra, now, state) for extra in self.extras]

    def _write_extra(
        self, extra: AuxiliaryOutput, now: int, state: LinkageState | CompiledState
    ) -> bytes:
        writer = extra.writer
        if writer.due is not None and not writer.due(now):
            return b''
        reading = state.reading
        forces = (
            state if extra.effect in _FORCES_ONLY and isinstance(state, CompiledState) else None
        )
        if writer.of_reading or forces is not None:
            return b'' if reading is None else writer.write(now, forces, reading)
        _, position, motion, _ = self.complete_state(state)
        if motion is not None:
            return b'' if reading is None else writer.write(now, motion, reading)
        if position is None or writer.no_pose is None:
            return b''
        return writer.no_pose(now, position)

    @property
    def gap_begins(self) -> bool:
        """Return whether a gap in the readings began at the last tick, if that had no pose."""
        return any(sensor.gap_begins for sensor in self._sensor_stages)

    def is_stale(self, now: int) -> bool:
        """Return whether the newest sample is too old at a time, in [ns], to give a crank."""
        return now - self.drive.stamp > self.drive.max_age > 0

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


def _make_output(
    name: str, topic: str, message: str, writer: Any, linkage_name: str, *, of_reading: bool
) -> AuxiliaryOutput:
    within = f'~/{linkage_name}/{topic[2:]}' if linkage_name else topic
    return AuxiliaryOutput(
        name, within, message, WriterStage.from_writer(writer, of_reading=of_reading)
    )


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
    linkage = scene_linkage.linkage
    for effect in wanted.effects:
        if effect.alter is not None:
            random = Context.generator(seed, effect.name)
            linkage = effect.alter(wanted.parameters[effect.name], linkage, random)
    return scene_linkage.closure if linkage is scene_linkage.closure.linkage else Closure(linkage)


class Pipeline:
    """
    The pipeline of a scene. To reset it, build it again.

    Parameters
    ----------
    scene
        The scene.
    closures
        Closures of its linkages, if there are any already. They have no state; resets reuse them.
    injection
        Its faults, if they exist already; they outlive a reset.

    Raises
    ------
    FileError
        Parts of the scene do not fit together.
    TypeError
        The argument is not a scene.

    """

    def __init__(
        self,
        scene: Scene,
        closures: Sequence[Closure] | None = None,
        injection: Injection | None = None,
    ) -> None:
        if not isinstance(scene, Scene):
            raise TypeError(f'scene: {quote(scene)} is not a Scene; load_scene() reads files')
        if injection is None and scene.faults:
            from linkage_ros.stages.faults import Injection

            injection = Injection(scene.faults)
        self.injection = injection
        """The faults; None if the scene has none."""
        self.linkages = [
            LinkagePipeline(scene, scene_linkage, closures[index] if closures else None, injection)
            for index, scene_linkage in enumerate(scene.linkages)
        ]
        self.extras = [extra for linkage in self.linkages for extra in linkage.extras]
        """The topics beside the joint states."""
        topics = sorted({linkage.topic for linkage in self.linkages} - {''})
        if len(topics) > 1:
            raise scene.linkages[0].content.error(
                'drive',
                f'has the topics {" and ".join(topics)}',
                'write the same kind of drive for all',
            )
        _refuse_stamps(scene)
        self.topic = topics[0] if topics else ''
        """The topic of the drives; '' for none."""
        self.wrenches: tuple[WrenchTopic, ...] = ()
        """The topics of wrenches on links."""
        if any(linkage.wrenches for linkage in self.linkages):
            from linkage_ros.tick.wrench_topics import make_wrench_topics

            linkages = [
                (linkage.scene_linkage, linkage.drive, linkage.wrenches)
                for linkage in self.linkages
            ]
            self.wrenches = make_wrench_topics(linkages, self.topic)
        # Among the drives, only the topic drive keeps no state from earlier ticks.
        self._has_state = any(
            linkage.scene_linkage.drive[0] != 'topic'
            or not _RUNNING_IN_GAPS.isdisjoint(linkage.effect_names)
            for linkage in self.linkages
        )
        self.suppresses_ticks = (
            self._has_state
            or injection is not None
            or any(not _SUPPRESSING.isdisjoint(linkage.effect_names) for linkage in self.linkages)
        )
        """Whether ticks without a message may matter to a replay."""
        self._router = SampleRouter(
            {linkage: linkage.scene_linkage.sampled_joints for linkage in self.linkages}
        )
        self.addressed_linkages: tuple[LinkagePipeline, ...] = ()
        """Of several linkages, those whose inputs the last message named."""
        self._offer_count = 0
        self._newest_offers: dict[LinkagePipeline, int] = {}
        self._writers: dict[tuple[bool, ...], JointStateWriter] = {}
        self.tick = self._build_tick()
        """Computes the tick at a time, in [ns]."""

    def offer(self, message: bytes, now: int) -> Rejection | None:
        """
        Take a serialized crank message, or return why it is rejected.

        Parameters
        ----------
        message
            A ``sensor_msgs/msg/JointState`` in CDR.
        now
            The time, in [ns].

        """
        if len(self.linkages) == 1:
            return self.linkages[0].offer(message, now)
        # A message may concern one linkage or several: it is good if one of them accepts it.
        self._offer_count += 1
        rejections = []
        self.addressed_linkages = self._router.find_receivers(message)
        for linkage in self.addressed_linkages:
            rejections.append(linkage.offer(message, now))
            if rejections[-1] is None:
                self._newest_offers[linkage] = self._offer_count
        return None if None in rejections else next(iter(rejections), Rejection.MISSING)

    def count_fresh_and_stale(self, now: int) -> tuple[int, int]:
        """
        Tell the good messages since the last call that are still the newest for a linkage.

        Return how many of them give a crank at a time, in [ns], and how many are too old.
        """
        if len(self.linkages) == 1:
            return (0, 1) if self.linkages[0].is_stale(now) else (1, 0)
        newest = self._newest_offers.items()
        fresh = {offer for linkage, offer in newest if not linkage.is_stale(now)}
        stale = {*self._newest_offers.values()} - fresh
        self._newest_offers.clear()
        return len(fresh), len(stale)

    def _make_tick(self, now: int, states: Sequence[LinkageState | CompiledState]) -> Tick:
        """Return the result of a tick; joints without a reading are left out."""
        extras: tuple[bytes, ...] = ()
        if self.extras:
            pairs = zip(self.linkages, states, strict=True)
            extras = tuple(
                [extra for linkage, state in pairs for extra in linkage.write_extras(now, state)]
            )
        readings = [state.reading for state in states if state.reading is not None]
        if not readings:
            return Tick(b'', extras if any(extras) else (), states, self.linkages)
        present = tuple([state.reading is not None for state in states])
        writer = self._writers.get(present) or self._make_writer(present)
        stamp = max([reading.stamp for reading in readings])
        return Tick(writer.write(stamp, *_join_readings(readings)), extras, states, self.linkages)

    def _build_tick(self) -> Callable[[int], Tick]:
        """Return the tick as a function of the time, in [ns]; generated text if possible."""
        compiled = [tick for linkage in self.linkages if (tick := linkage.whole_tick) is not None]
        several = len(self.linkages) > 1
        if len(compiled) < len(self.linkages) or (several and self.extras):
            computes = [linkage.compute_state for linkage in self.linkages]
            return lambda now: self._make_tick(now, [compute(now) for compute in computes])
        if several:
            return self._combine_ticks(compiled)
        (linkage,), (compiled_tick,) = self.linkages, compiled
        return compile_scene_tick(
            compiled_tick,
            self._make_writer((True,)),
            [extra.writer for extra in self.extras],
            Tick,
            self.linkages,
            lambda now, crank: self._make_tick(now, [linkage.interpret_from_crank(now, crank)]),
        )

    def _combine_ticks(self, compiled_ticks: Sequence[CompiledTick]) -> Callable[[int], Tick]:
        """Return the tick of several linkages that all have generated ticks."""
        linkages = self.linkages
        contributions = [
            compile_contribution(compiled, linkage.interpret_from_crank)
            for compiled, linkage in zip(compiled_ticks, linkages, strict=True)
        ]
        write = self._make_writer((True,) * len(linkages)).write
        count = sum(len(compiled.joints) for compiled in compiled_ticks)

        def tick(now: int) -> Tick:
            positions: list[float] = []
            rates: list[float] = []
            efforts: list[float] = []
            states = [add(now, positions, rates, efforts) for add in contributions]
            if len(positions) < count:
                return self._make_tick(now, [_name_fields(state) for state in states])
            message = write(
                now, positions, _if_complete(rates, count), _if_complete(efforts, count)
            )
            return Tick(message, (), states, linkages)

        return tick

    def changes_state(self, tick: Tick) -> bool:
        """Return whether a tick without a message changes the state of the pipeline."""
        return any(
            not isinstance(state, LinkageState)
            or linkage.gap_begins
            or (state.position is not None and (bool(state.position.joints) or self._has_state))
            for linkage, state in zip(self.linkages, tick.states, strict=True)
        )

    def _make_writer(self, present: tuple[bool, ...]) -> JointStateWriter:
        joints = [
            joint
            for linkage, there in zip(self.linkages, present, strict=True)
            if there
            for joint in linkage.scene_linkage.joint_names
        ]
        self._writers[present] = writer = JointStateWriter(joints)
        return writer

    @property
    def closures(self) -> list[Closure]:
        """Closures of the linkages."""
        return [linkage.closure for linkage in self.linkages]

    @property
    def newest_stamp(self) -> int:
        """Stamp of the newest good sample, in [ns]; 0 before the first."""
        return max(linkage.drive.stamp for linkage in self.linkages)

    @property
    def max_age(self) -> int:
        """Age of the newest sample beyond which something is amiss, in [ns]; 0 for never."""
        return max(linkage.drive.max_age for linkage in self.linkages)


def _refuse_stamps(scene: Scene) -> None:
    """Refuse measurement stamps that cannot share one message of several linkages."""
    delays = [scene_linkage.effects.get('delay') for scene_linkage in scene.linkages]
    for scene_linkage, delay in zip(scene.linkages, delays, strict=True):
        if delay is not None and delay.stamp == 'measured' and delays.count(delay) < len(delays):
            raise scene_linkage.content.error(
                'effects.delay.stamp',
                'measured gives a linkage its own stamp, and all linkages share one message',
                'give all linkages the same delay, or write arrival',
            )


def _join_readings(
    readings: Sequence[SensorReading],
) -> tuple[list[float], list[float], list[float]]:
    """
    Return positions, rates and efforts of all readings.

    The arrays of a JointState have equal length or are empty. Where one reading has no rates (at
    a singularity, or without the effect), no rates are published. The same holds for efforts.
    """
    positions = [value for reading in readings for value in reading.joints]
    rates = [value for reading in readings for value in reading.rates]
    efforts = [value for reading in readings for value in reading.efforts]
    n = len(positions)
    return positions, _if_complete(rates, n), _if_complete(efforts, n)


def _if_complete(values: list[float], count: int) -> list[float]:
    """Return the values if there is one for each joint, else an empty list."""
    return values if len(values) == count else []


def _name_fields(state: LinkageState | StateTuple) -> LinkageState | CompiledState:
    """Return the state of a linkage as a named tuple."""
    if isinstance(state, LinkageState):
        return state
    crank, reading, *more = state
    return CompiledState(_crank_state(crank), SensorReading(*reading), *more)


def _crank_state(crank: tuple[Any, ...]) -> CrankState:
    return crank if isinstance(crank, CrankState) else CrankState(*crank)
