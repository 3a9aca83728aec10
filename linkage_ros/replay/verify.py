# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Run a bag's scene again on its samples: compare with its messages, and find its worst states.

A bag may lack the start of its run (recording began later, or its first files made way for newer
ones). Then the state of the node at that time is missing: the newest sample, whole turns, delay
lines, random generators. The ticks before the first one that is reproduced do not count, and whole
turns do not count as a difference.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import inf
from typing import NamedTuple

from linkage_ros.bag import Bag, BagMessage, missing_start_reason, read_run_metadata
from linkage_ros.description import Scene, SceneLinkage
from linkage_ros.errors import BagError
from linkage_ros.kinematics import (
    Closure,
    Position,
    RevoluteJoint,
    SingularityMargin,
    Status,
)
from linkage_ros.messages import JOINT_STATE_TYPE
from linkage_ros.replay.compare import Comparison, FirstDifference, TickPlace
from linkage_ros.replay.replay import replay_all, replay_ticks, ReplayedTick
from linkage_ros.tick import Pipeline

IDENTICAL, DIFFERENT, UNDECIDED = 'identical', 'different', 'cannot be told'

_REPORT_EVERY = 1024


class ReplayVerification(NamedTuple):
    """Result of running the scene of a bag again."""

    comparison: Comparison  # Comparison of the ticks that could be compared
    # Number of ticks at the start that cannot be judged, since the bag lacks the start of the run.
    undecided: int
    first_undecided: FirstDifference | None  # First difference of the first such tick
    missing_start: str  # Reason why the start of the run is missing; '' if it is there
    unrecoverable: tuple[str, ...]  # Drives and effects that then never reproduce the run

    @property
    def tick_count(self) -> int:
        """Return the number of ticks in the bag."""
        return self.comparison.ticks + self.undecided

    @property
    def verdict(self) -> str:
        """Return `IDENTICAL`, `DIFFERENT` or `UNDECIDED`."""
        comparison = self.comparison
        if self.undecided and not comparison.ticks:
            return UNDECIDED
        if comparison.differing:
            return UNDECIDED if self.unrecoverable else DIFFERENT
        return IDENTICAL


def verify_replay(
    bag: Bag,
    scene: Scene,
    messages: Iterable[BagMessage],
    observe: Callable[[ReplayedTick], None] = lambda _: None,
) -> ReplayVerification:
    """
    Run a bag's scene once more and compare; memory does not grow with the bag.

    ``observe`` receives every tick. Raise `LinkageError` if the scene cannot be run.
    """
    run = read_run_metadata(bag)
    types = [extra.message for extra in Pipeline(scene).extras]
    types += [JOINT_STATE_TYPE] * len(run.extras)  # for topics that the scene does not know
    topics = [(run.joint_states_topic, JOINT_STATE_TYPE), *zip(run.extras, types, strict=False)]
    silent = (b'',) * len(topics)
    beginning = missing_start_reason(bag, run)
    turning = turning_joints(scene) if beginning and not scene.wrapped else {}
    comparison, probe = Comparison(topics, turning), Comparison(topics, turning)
    undecided, in_step = 0, not beginning
    for number, replayed in enumerate(replay_all(bag, scene, messages), 1):
        time, joint_states, extras, tick = replayed
        observe(replayed)
        recorded = (joint_states, *extras)
        now = (tick.message, *tick.extras, *silent)[: len(topics)]
        at = TickPlace(number, time)
        if not in_step:
            probe.add_tick(at, recorded, now)
            in_step = probe.last != at and any(recorded)
            if not in_step:
                undecided += 1
                continue
        comparison.add_tick(at, recorded, now)
    comparison.update_deviations()
    lost = _lost_state(scene) if beginning else ()
    return ReplayVerification(
        comparison, undecided, probe.first if undecided else None, beginning, lost
    )


def beginning_text(proof: ReplayVerification) -> str:
    """Return text on the ticks that cannot be judged in a bag without the start of its run."""
    text = (
        f'{proof.missing_start}: it lacks the state of the node then, so {proof.undecided} '
        f'of {proof.tick_count} ticks, at the start, are undecided'
    )
    if proof.verdict == UNDECIDED and proof.unrecoverable:
        text += f'; {" and ".join(proof.unrecoverable)} cannot be reproduced'
    return text


def turning_joints(scene: Scene) -> dict[str, bool]:
    """Return for each joint of a scene, published or driven, whether it is a revolute joint."""
    revolute: dict[str, bool] = {}
    for scene_linkage in scene.linkages:
        driven = [not driven_joint.slider for driven_joint in scene_linkage.linkage.inputs]
        revolute |= dict(zip(scene_linkage.input_names, driven, strict=True))
        kinds = [
            isinstance(joint, RevoluteJoint) for joint in scene_linkage.linkage.joints.values()
        ]
        revolute |= dict(zip(scene_linkage.joint_names, kinds, strict=True))
    return revolute


def _lost_state(scene: Scene) -> tuple[str, ...]:
    named = []
    for scene_linkage in scene.linkages:
        drive, parameters = scene_linkage.drive
        if not parameters.is_recoverable:
            named.append(drive)
    for scene_linkage in scene.linkages:
        if scene_linkage.loads is not None and scene_linkage.loads.applied.changes_with_time:
            named.append('loads')
        effects = scene_linkage.effects.items()
        named += [name for name, effect in effects if not effect.is_recoverable]
    return tuple(dict.fromkeys(named))


class StatePlace(NamedTuple):
    """A state of a run."""

    time: int  # Time that was solved for, in [ns]
    inputs: tuple[float, ...]  # Inputs of the linkage, in [rad] or [m]


class WorstResiduals(NamedTuple):
    """The worst states of a linkage over a run."""

    # The linkage in its scene, and its closure.
    scene_linkage: SceneLinkage
    closure: Closure
    states: int  # Number of states that closed, and so were examined
    # Number of these at a toggle, and number of these beyond joint limits.
    toggles: int
    limited: int
    # Greatest `Closure.residual`, in [m], and its place; None without states.
    residual: tuple[float, StatePlace] | None
    # The singularity measures at the least conditioning, and the place.
    nearest: tuple[SingularityMargin, StatePlace] | None


class ExaminedRun(NamedTuple):
    """Result of running a scene again on its bag."""

    linkages: tuple[WorstResiduals, ...]  # The worst states of each linkage
    joint_states: int  # Number of joint states in the bag
    same: int  # Number of these that were reproduced byte for byte
    damage: str  # Damage at which reading ended, on one line
    stopped: bool  # Whether the examination was stopped early


def examine_states(
    bag: Bag, scene: Scene, progress: Callable[[int], None], stopped: Callable[[], bool]
) -> ExaminedRun:
    """
    Run a scene again on its bag and examine every state; memory does not grow with them.

    ``progress`` receives the number of examined ticks, now and then; ``stopped`` returns whether
    to stop. Raise `LinkageError` if the scene cannot be run.
    """
    # The replay builds equal closures itself: they follow from the scene alone.
    watched = [_Watch(line.scene_linkage, line.closure) for line in Pipeline(scene).linkages]
    joint_states = same = number = 0
    damage, halted = '', False
    try:
        for number, (time, recorded, _, tick) in enumerate(replay_ticks(bag, scene), 1):
            if recorded:
                joint_states += 1
                same += recorded == tick.message
            for watch, state in zip(watched, tick.states, strict=True):
                if state.has_pose and state.crank is not None:
                    # Of a compiled state the position is enough: its rates are not asked for.
                    inputs = state.crank.angles
                    position = None if state.is_compiled else state.position
                    watch.add_state(time, inputs, position or watch.closure.position(*inputs))
            if not number % _REPORT_EVERY:
                progress(number)
                if stopped():
                    halted = True
                    break
    except BagError as error:
        damage = f'{error.where}: {error.reason}'
    linkages = tuple(watch.worst_residuals() for watch in watched)
    return ExaminedRun(linkages, joint_states, same, damage, halted)


class _Watch:
    """Keeps the worst of the states of a linkage."""

    __slots__ = (
        '_least',
        '_limited',
        '_nearest',
        '_place',
        '_states',
        '_toggles',
        '_worst',
        'closure',
        'of',
    )

    def __init__(self, scene_linkage: SceneLinkage, closure: Closure) -> None:
        self.of, self.closure = scene_linkage, closure
        self._states = self._toggles = self._limited = 0
        self._worst, self._least = -1.0, inf
        self._place: StatePlace | None = None
        self._nearest: tuple[SingularityMargin, StatePlace] | None = None

    def add_state(self, time: int, inputs: Sequence[float], position: Position) -> None:
        self._states += 1
        self._toggles += position.status is Status.TOGGLE
        self._limited += position.status is Status.LIMITED
        residual = self.closure.residual(position)
        if residual > self._worst:
            self._worst, self._place = residual, StatePlace(time, tuple(inputs))
        nearness = self.closure.singularity_margin(position)
        if nearness.conditioning < self._least:
            self._least = nearness.conditioning
            self._nearest = nearness, StatePlace(time, tuple(inputs))

    def worst_residuals(self) -> WorstResiduals:
        residual = (self._worst, self._place) if self._place else None
        return WorstResiduals(
            self.of,
            self.closure,
            self._states,
            self._toggles,
            self._limited,
            residual,
            self._nearest,
        )
