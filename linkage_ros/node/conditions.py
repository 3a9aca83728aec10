# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Conditions of a run, each written once for its status in the diagnostics and for the log.

A condition that counts events asks what is new since earlier counts: for a status since
the last diagnostics, for the log since its last warning. Warnings are limited in rate, each kind
by itself. The limit is not rclpy's throttle: there a suppressed log line costs 150 µs.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, tau
from time import monotonic
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus
from linkage_ros.description import Scene
from linkage_ros.errors import list_names
from linkage_ros.kinematics import describe_ranges, Status
from linkage_ros.messages import head_of, NANOSECONDS, Rejection
from linkage_ros.node.run_recording import RunRecording
from linkage_ros.stages.drives import describe_chatter
from linkage_ros.tick import Counts, LinkagePipeline, TickLoop
from rclpy.impl.rcutils_logger import RcutilsLogger

OK, WARN, ERROR, STALE = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.ERROR,
    DiagnosticStatus.STALE,
)

RATE_TOLERANCE = 0.1

# A crank that is wrapped into a turn jumps by one.
_MORE_THAN_A_TURN = 1.01 * tau

_CLOCK_PATIENCE = 2.0
"""How long ``/clock`` may be silent without a warning, in [s] of the steady clock."""

_REMEDIES = {
    Rejection.MALFORMED: 'the publisher must send {type} as plain CDR',
    Rejection.EMPTY: 'fill name and position',
    Rejection.UNEQUAL: 'give each joint that is named a number in every array that is filled',
    Rejection.TWICE: 'name the joint once',
    Rejection.NOT_FINITE: 'check the sensor',
    Rejection.TOO_LARGE: 'the units are rad and m',
    Rejection.NO_EFFORT: 'fill name and effort',
    Rejection.EFFORT_NOT_FINITE: 'activate the controller: ros2_control sends NaN before',
    Rejection.EFFORT_TOO_LARGE: 'the units are N·m and N',
    Rejection.STAMP_ZERO: 'stamp the messages, or write drive: {{topic: {{stamp: arrival}}}}',
    Rejection.STAMP_INVALID: 'stamp the messages with the time',
    # Raising max_lead would carry the crank back by the lead.
    Rejection.STAMP_FUTURE: (
        'synchronise the clocks, or write drive: {{topic: {{stamp: arrival}}}}'
    ),
    Rejection.NO_CRANK: 'linkage check --branches shows the range of the joint on its branch',
    Rejection.STAMP_OLD: 'let one source publish, in order; ~/reset forgets the last stamp',
    Rejection.WRENCH_NOT_FINITE: 'check the sensor',
    Rejection.WRENCH_TOO_LARGE: 'the units are N and N·m',
}

_STALE_PERIOD = 30.0
"""Least time between two warnings about stamps that are too old, in [s]: a clock stays wrong."""

_PATIENCE = 2.0
"""Time without a warning about a missing crank, in [s]."""

_UNCLOSED = {
    Status.INDETERMINATE: (
        ERROR,
        (
            '{ticks} ticks without a pose (two pins in one place, or a broken link), nothing '
            'published'
        ),
    ),
    Status.OPEN: (
        ERROR,
        '{ticks} ticks open by {gap:.6g} m, nothing published; reachable: {reachable}',
    ),
    Status.LIMITED: (WARN, '{ticks} ticks beyond limits, {published}: {beyond}'),
    Status.TOGGLE: (WARN, '{ticks} ticks at a toggle: positions published, velocities not'),
}

Since = Mapping[str, Counts]
"""By kind of condition, the counts since which events are new."""


class Condition(NamedTuple):
    """A condition that holds, with the remedy."""

    level: bytes  # Of the status; OK if only the log shows it
    message: str
    kind: str = ''  # Kind of the warnings in the log; '' if only the status shows it
    # Least time between two warnings, in [s], where it is above the parameter's.
    period: float = 0.0


@dataclass(frozen=True, slots=True)
class RunState:
    """State of a run at one instant, for its conditions and the diagnostics."""

    node: str  # Name of the node
    scene: Scene
    loop: TickLoop
    counts: Counts  # Counts of the loop, as read at this instant
    clock: int  # Time of the node's clock, in [ns]
    recording: RunRecording
    # Warning threshold for each attribute of `SingularityMargin`; 0: never
    limits: Mapping[str, float]
    is_simulated: bool = False  # Whether a simulation's clock decides when to tick
    start: int = 0  # Time of the activation, in [ns] of the steady clock
    crank_topic: str = ''  # Resolved name of the drives' topic; '' for none
    wrench_topics: Sequence[str] = ()  # Resolved names of the topics with wrenches
    publishers: Sequence[str] = ()  # Other publishers on the drives' topic
    clock_silence: float = 0.0  # Time since the last ``/clock`` message, in [s]; 0: not used
    clock_refused: int = 0  # Number of ``/clock`` messages without a valid time
    # What several publishers, or several nodes of one name, spoil; '' for nothing.
    cranks_doubled: str = ''
    node_doubled: str = ''
    # Settings of middleware and operating system that affect the ticks.
    system: Mapping[str, str] = field(default_factory=dict)

    @property
    def rate(self) -> float:
        """Return the wanted ticks per second, in [Hz]; 0 where messages decide."""
        return 0.0 if self.is_simulated else self.scene.rate

    @property
    def inputs(self) -> list[str]:
        """Return the joints whose samples come from the crank's topic."""
        linkages = (linkage for linkage in self.loop.pipeline.linkages if linkage.topic)
        return [name for linkage in linkages for name in linkage.scene_linkage.sampled_joints]

    @property
    def takes_commands(self) -> bool:
        """Whether the drives take commands, which move the inputs, instead of samples of these."""
        return any(
            line.scene_linkage.drive[1].gives_torque for line in self.loop.pipeline.linkages
        )

    @property
    def idle_text(self) -> str:
        """Return what acts on the inputs of torque drives while no command comes."""
        acting = []
        for line in self.loop.pipeline.linkages:
            _, drive = line.scene_linkage.drive
            if not drive.gives_torque:
                continue
            unit = 'N' if line.closure.linkage.inputs[0].slider else 'N·m'
            names = list_names(line.scene_linkage.sampled_joints)
            what = (
                f'the brake of {drive.brake:g} {unit} holds' if drive.brake else 'no effort moves'
            )
            acting.append(f'{what} {names}')
        return ', '.join(acting)

    @property
    def sample_age(self) -> float:
        """Return the age of the newest sample by its stamp, in [s]; infinity without one."""
        stamp = self.loop.newest_stamp
        return (self.clock - stamp) / NANOSECONDS if stamp else inf

    def measure_rate(self, start: Counts) -> tuple[float, int]:
        """Return the time since earlier counts, in [s], and the number of ticks."""
        window = max(self.counts.time - start.time, 1) / NANOSECONDS
        return window, self.counts.ticks - start.ticks

    def find_conditions(self, since: Since) -> Iterator[Condition]:
        """Yield the conditions that hold."""
        for find in (tick_conditions, crank_conditions, closure_conditions, wrench_conditions):
            yield from find(self, since)


# Each function yields conditions of one status, the worst first: the status has its message.


def tick_conditions(run: RunState, since: Since) -> Iterator[Condition]:
    """Yield what keeps the node from ticking at its rate."""
    if run.loop.failure:
        yield Condition(ERROR, f'the tick has stopped: {run.loop.failure}', 'tick')
    if (silence := run.clock_silence) > _CLOCK_PATIENCE:
        text = 'No /clock yet' if silence == inf else f'No /clock for {silence:.1f} s'
        is_due = (run.counts.time - run.start) / NANOSECONDS > _CLOCK_PATIENCE
        remedy = 'start the simulation, or set use_sim_time: false'
        yield Condition(STALE, f'{text}: {remedy}', 'clock' if is_due else '')
    window, ticks = run.measure_rate(since[''])
    if ticks / window < run.rate * (1.0 - RATE_TOLERANCE):
        yield Condition(WARN, f'{ticks / window:.1f} ticks a second, {run.rate:g} wanted')
    if run.counts.lost > since['lost'].lost:
        text = _describe_lost_ticks(run.counts, since['lost'])
        yield Condition(WARN, text, 'lost')
    for index, (line, count) in enumerate(
        zip(run.loop.pipeline.linkages, run.counts.chatter, strict=True)
    ):
        kind = f'chatter {line.scene_linkage.name}'
        if steps := count - since[kind].chatter[index]:
            text = f'{describe_chatter(steps)}{linkage_text(line)}'
            yield Condition(WARN, text, kind)
    if run.node_doubled:
        yield Condition(WARN, run.node_doubled, 'twin')


def crank_conditions(run: RunState, since: Since) -> Iterator[Condition]:
    """Yield what is wrong with the samples of the crank."""
    counts, topic, max_age = run.counts, run.crank_topic, run.loop.pipeline.max_age
    if not topic:
        return
    age = run.sample_age
    if counts.ignored and counts.ignored == counts.received:
        head = head_of(counts.last_ignored)
        held = sorted(name.decode(errors='replace') for name in head[0]) if head else ()
        text = (
            f'messages on {topic} hold {list_names(map(repr, held))}; the linkage needs '
            f'{list_names(map(repr, run.inputs))}: name the joint so there, or remap the topic'
        )
        yield Condition(STALE if max_age else WARN, text, 'ignored')
    if counts.stale > since[''].stale and age * NANOSECONDS > max_age:
        yield Condition(STALE, f'Samples arrive, but are {age:.1f} s old by their stamps')
    if max_age and age * NANOSECONDS > max_age:
        yield Condition(STALE, _describe_silence(run, age))
    yield from _find_silent_inputs(run)
    if run.cranks_doubled:
        yield Condition(WARN, run.cranks_doubled, 'publishers')
    rejected = since['rejected'].rejected
    message = 'commands' if run.takes_commands else 'samples', 'sensor_msgs/JointState'
    yield from _find_rejections('rejected', topic, message, counts.rejected, rejected)
    if (new := counts.stale - since['stale'].stale) > 0:
        text = (
            f'{topic}: {new} samples too old to use, the newest '
            f'{counts.stale_age / NANOSECONDS:.1f} s by its stamp, and max_age is '
            f'{max_age / NANOSECONDS:g} s: synchronise the clocks, set use_sim_time where time is '
            'played or simulated, or write drive: {topic: {stamp: arrival}}'
        )
        yield Condition(OK, text, 'stale', _STALE_PERIOD)
    for line in run.loop.pipeline.linkages:
        driven, jump = line.closure.linkage.inputs[0], getattr(line.drive, 'jump', 0.0)
        if jump > _MORE_THAN_A_TURN and not driven.slider:
            text = (
                f'{topic}: {driven.joint} changed by {jump:.4g} rad between two samples, more '
                'than a turn; if these are degrees, publish radians'
            )
            yield Condition(OK, text, f'jump {driven.joint}', inf)


def _find_silent_inputs(run: RunState) -> Iterator[Condition]:
    """Yield the inputs without which a linkage has no crank, while others have samples."""
    silent = run.loop.pipeline.silent_inputs(run.clock)
    if not silent or len(silent) == len(run.inputs) or run.takes_commands:
        return
    said = [
        f'{name} for {(run.clock - stamp) / NANOSECONDS:.1f} s' if stamp else f'{name} yet'
        for name, stamp in silent.items()
    ]
    is_due = (run.counts.time - run.start) / NANOSECONDS > _PATIENCE
    text = (
        f'{run.crank_topic}: no sample of {" and ".join(said)}, so its linkage has no crank; '
        'publish each input, alone or with others'
    )
    yield Condition(STALE, text, 'silent inputs' if is_due else '')


def _describe_silence(run: RunState, age: float) -> str:
    """Return that samples or commands are missing, the newest of an age in [s]."""
    if run.takes_commands:
        text = 'No command yet' if age == inf else f'No command for {age:.1f} s'
        return f'{text}: {run.idle_text}'
    return 'No crank yet' if age == inf else f'No crank for {age:.1f} s, by its stamps'


def closure_conditions(run: RunState, since: Since) -> Iterator[Condition]:
    """Yield the poses that the linkages did not reach."""
    counts = run.counts
    for status, (level, text) in _UNCLOSED.items():
        ticks = counts.unclosed[status] - since[status.value].unclosed[status]
        if ticks and status in counts.last_unclosed:
            index, position = counts.last_unclosed[status]
            closure = run.loop.pipeline.linkages[index].closure
            message = text.format(
                ticks=ticks,
                gap=position.gap,
                reachable=describe_ranges(closure.input_ranges),
                published='published anyway' if position.joints else 'nothing published',
                beyond=closure.limit_exceeded(position),
            )
            yield Condition(level, message, status.value)


def wrench_conditions(run: RunState, since: Since) -> Iterator[Condition]:
    """Yield what is wrong with the wrenches."""
    message = 'wrenches', 'geometry_msgs/WrenchStamped'
    silent = []
    for index, (name, topic) in enumerate(
        zip(run.wrench_topics, run.loop.pipeline.wrenches, strict=True)
    ):
        kind = f'wrenches {name}'
        now, before = (counts.wrenches[index].rejected for counts in (run.counts, since[kind]))
        yield from _find_rejections(kind, name, message, now, before)
        held = topic.wrench
        if not held.stamp or run.clock - held.stamp > held.max_age:
            silent.append(topic.topic)
    if silent:
        yield Condition(STALE, f'No messages, so no load: {", ".join(silent)}')


def _find_rejections(
    kind: str,
    topic: str,
    message: tuple[str, str],
    now: Mapping[Rejection, int],
    before: Mapping[Rejection, int],
) -> Iterator[Condition]:
    """Yield the newly rejected messages, of this plural and type, each reason with its remedy."""
    new = {why: n - before[why] for why, n in now.items() if n > before[why]}
    if new:
        plural, type_name = message
        reasons = '; '.join(
            f'{why.value} ({n}): {_REMEDIES[why].format(type=type_name)}' for why, n in new.items()
        )
        text = f'{topic}: {sum(new.values())} {plural} rejected: {reasons}'
        yield Condition(WARN, text, kind)


def _describe_lost_ticks(now: Counts, before: Counts) -> str:
    """Return the line for ticks that were lost: by what, and whether the rate is too high."""
    lost, stalls, ticks = (
        now.lost - before.lost,
        now.stalls - before.stalls,
        now.ticks - before.ticks,
    )
    often = stalls > 1 and lost > RATE_TOLERANCE * (lost + ticks)
    assert now.last_stall is not None, 'a lost tick is counted with its stall'
    seconds = now.last_stall.duration / NANOSECONDS
    what = (
        f'a tick took {seconds:.3f} s'
        if now.last_stall.in_tick
        else f'the operating system woke the node {seconds:.3f} s late'
    )
    where = 'at once' if stalls == 1 else f'in {stalls} stalls, the last'
    remedy = 'lower the rate' if often else 'the rate is kept otherwise'
    return f'{lost} ticks lost {where}: {what}; {remedy}'


def linkage_text(line: LinkagePipeline) -> str:
    """Return the name of the linkage for a message, if there are several."""
    return f' ({line.scene_linkage.name})' if line.scene_linkage.name else ''


class Warnings:
    """Logs conditions; ``start`` has the counts at the beginning of the run."""

    def __init__(self, logger: RcutilsLogger, start: Counts | None = None) -> None:
        self._logger = logger
        self._last: dict[str, float] = {}  # Time of the last warning of each kind
        start = start or Counts()
        self._since: defaultdict[str, Counts] = defaultdict(lambda: start)  # Counts at that time
        self._last_message = (0, 0, monotonic())
        self._last_tick = (0, monotonic())

    def warn_of_conditions(self, run: RunState, period: float) -> None:
        """Warn of the conditions of a run, of each kind at most once in a period, in [s]."""
        for condition in run.find_conditions(self._since):
            kind, wait = condition.kind, max(period, condition.period)
            if kind and self.warn(kind, condition.message, wait):
                self._since[kind] = run.counts

    def warn_of_silence(
        self, run: RunState, publishers: Callable[[], Sequence[str]], period: float
    ) -> None:
        """
        Warn if no message arrives, and nothing is published, or nothing is commanded.

        Messages are taken by ticks: a tick that does not end is warned of instead. ``publishers``
        returns the names of the other publishers on the topic.
        """
        rate = run.scene.rate
        # Time from tick to tick, in [s]; 0 for one tick per message.
        interval = 0.0 if not rate else inf if run.is_simulated else 1.0 / rate
        counts, crank_topic, max_age = run.counts, run.crank_topic, run.loop.pipeline.max_age
        handled = counts.used + counts.superseded + counts.ignored + sum(counts.rejected.values())
        ticks, looked = self._last_tick
        if counts.ticks != ticks or (not interval and handled == counts.received):
            looked = monotonic()
        self._last_tick = counts.ticks, looked
        late = monotonic() - looked
        if late > _PATIENCE + 2.0 * interval:
            self.warn(
                'late',
                f'no tick has ended in {late:.0f} s, so nothing is published, and messages on '
                f'{crank_topic} wait or are lost; lower the rate, or make the scene cheaper',
                period,
            )
        # Without commands the linkage moves on, and its joint states are published.
        heard = (
            (run.loop.newest_stamp, 0)
            if run.takes_commands
            else (counts.received, counts.published)
        )
        *last, since = self._last_message
        if heard != (*last,):
            self._last_message = (*heard, monotonic())
            return
        waited = looked - since
        if (counts.received and not max_age) or waited <= max(_PATIENCE, max_age / NANOSECONDS):
            return
        number = len(publishers())
        among = f'({number} publisher{"" if number == 1 else "s"})'
        if run.takes_commands:
            line = (
                f'no command on {crank_topic} in {waited:.0f} s {among}, so {run.idle_text}; '
                f'send sensor_msgs/JointState with the effort of {list_names(run.inputs)} there, '
                'or remap the topic'
            )
        else:
            line = (
                f'no message on {crank_topic} in {waited:.0f} s {among}, so nothing is '
                f'published; send sensor_msgs/JointState with {list_names(run.inputs)} there, '
                'remap the topic, or name another drive in a scene, as drive: {sine: …}'
            )
        self.warn('waiting', line, period)

    def warn(self, kind: str, line: str, period: float) -> bool:
        """Warn, unless this kind was already warned of within the period, in [s]."""
        now = monotonic()
        if now - self._last.get(kind, -inf) < period:
            return False
        self._last[kind] = now
        self._logger.warning(line)
        return True
