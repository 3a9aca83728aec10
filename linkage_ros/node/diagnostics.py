# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Reports of the node: ``diagnostic_msgs/DiagnosticArray`` once a period, and warnings.

Warnings in the log are limited in rate, each kind by itself. The limit is not rclpy's throttle:
there a suppressed log line costs 150 µs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, tau
from operator import itemgetter
from time import monotonic
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from linkage_ros.errors import list_names
from linkage_ros.kinematics import Closure, describe_ranges, Position, Status
from linkage_ros.messages import head_of, NANOSECONDS, Rejection
from linkage_ros.node.run_recording import RunSnapshots
from linkage_ros.stages.drives import describe_chatter
from linkage_ros.tick import Counts, LinkagePipeline, LinkageState, TickLoop, WrenchCounts
from rclpy.impl.rcutils_logger import RcutilsLogger

if TYPE_CHECKING:
    from linkage_ros.stages.faults import Injection

OK, WARN, ERROR, STALE = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.ERROR,
    DiagnosticStatus.STALE,
)

_RATE_TOLERANCE = 0.1

# A crank that is wrapped into a turn jumps by one.
_MORE_THAN_A_TURN = 1.01 * tau

CLOCK_PATIENCE = 2.0
"""How long ``/clock`` may be silent without a warning, in [s] of the steady clock."""

_NEARNESS = {
    'transmission_angle': 'Transmission angle (rad)',
    'conditioning': 'Conditioning',
    'toggle_distance': 'Input to the nearest toggle ({unit})',
}
"""Attributes of `Closure.singularity_margin` in the diagnostics, with their keys."""

_REMEDIES = {
    Rejection.MALFORMED: 'the publisher must send sensor_msgs/JointState as plain CDR',
    Rejection.EMPTY: 'fill name and position',
    Rejection.UNEQUAL: 'give each joint that is named a number in every array that is filled',
    Rejection.TWICE: 'name the joint once',
    Rejection.NOT_FINITE: 'check the sensor',
    Rejection.TOO_LARGE: 'the units are rad and m',
    Rejection.NO_EFFORT: 'fill name and effort',
    Rejection.EFFORT_NOT_FINITE: 'activate the controller: ros2_control sends NaN before',
    Rejection.EFFORT_TOO_LARGE: 'the units are N·m and N',
    Rejection.STAMP_ZERO: 'stamp the messages, or write drive: {topic: {stamp: arrival}}',
    Rejection.STAMP_INVALID: 'stamp the messages with the time',
    Rejection.STAMP_FUTURE: 'synchronise the clocks, or raise max_lead',
    Rejection.NO_CRANK: 'linkage check --branches shows the range of the joint on its branch',
    Rejection.STAMP_OLD: 'let one source publish, in order; ~/reset forgets the last stamp',
}

_WRENCH_REMEDIES = {
    Rejection.MALFORMED: 'the publisher must send geometry_msgs/WrenchStamped as plain CDR',
    Rejection.WRENCH_NOT_FINITE: 'check the sensor',
    Rejection.WRENCH_TOO_LARGE: 'the units are N and N·m',
}

_STALE_PERIOD = 30.0
"""Least time between two warnings about stamps that are too old, in [s]: a clock stays wrong."""

_PATIENCE = 2.0
"""Time without a warning about a missing crank, in [s]."""

_UNCLOSED = {
    Status.OPEN: '{ticks} ticks open by {gap:.6g} m, nothing published; reachable: {reachable}',
    Status.INDETERMINATE: (
        '{ticks} ticks without a pose (two pins in one place, or a broken link), nothing published'
    ),
    Status.TOGGLE: '{ticks} ticks at a toggle: positions published, velocities not',
    Status.LIMITED: '{ticks} ticks beyond limits, {published}: {beyond}',
}


@dataclass(frozen=True, slots=True)
class CountsSnapshot:
    """Counts at one instant; two snapshots delimit a window."""

    time: int = 0
    ticks: int = 0
    lost: int = 0
    rejected: int = 0
    toggles: int = 0
    limited: int = 0
    unclosed: int = 0
    indeterminate: int = 0
    wrenches_rejected: int = 0
    interleaved: int = 0
    own_interleaved: int = 0
    stale: int = 0
    chatter_count: int = 0

    @classmethod
    def take(cls, counts: Counts, time: int, chattered: int = 0) -> CountsSnapshot:
        """Return the counts at a time, in [ns] of the steady clock."""
        return cls(
            time,
            counts.ticks,
            counts.lost,
            sum(counts.rejected.values()),
            counts.unclosed[Status.TOGGLE],
            counts.unclosed[Status.LIMITED],
            counts.unclosed[Status.OPEN] + counts.unclosed[Status.INDETERMINATE],
            counts.unclosed[Status.INDETERMINATE],
            sum(sum(each.rejected.values()) for each in counts.wrenches),
            counts.interleaved,
            counts.own_interleaved,
            counts.stale,
            chattered,
        )


@dataclass(frozen=True, slots=True)
class DiagnosticsSummary:
    """Data for all diagnostic statuses."""

    node: str  # Name of the node
    scene: str  # Name of the scene
    rate: float  # Wanted ticks per second, in [Hz]; 0 for one tick per sample
    clock: int  # Time of the node's clock, in [ns]
    crank_topic: str  # Resolved name of the drives' topic; '' for none
    publishers: Sequence[str]  # Other publishers on that topic
    loop: TickLoop  # The tick loop
    # Counts of the tick at the start and at the end of the window.
    window_start: CountsSnapshot
    window_end: CountsSnapshot
    recording_failure: str  # Reason why a wanted recording does not run; '' otherwise
    limits: Mapping[str, float]  # Warning threshold for each attribute of `Nearness`; 0 for never
    # Memory of the last seconds; None when a bag is recorded continuously.
    snapshots: RunSnapshots | None = None
    # Time since the last ``/clock`` message, in [s]; 0 where the node does not use it.
    clock_silence: float = 0.0
    clock_refused: int = 0  # Number of ``/clock`` messages without a valid time
    # What several publishers, or several nodes of one name, spoil; '' for nothing.
    cranks_doubled: str = ''
    node_doubled: str = ''
    # Settings of middleware and operating system that affect the ticks.
    system: Mapping[str, str] = field(default_factory=dict)

    def make_statuses(self) -> list[DiagnosticStatus]:
        """Return the statuses, one for each task."""
        statuses = [
            self._tick_status(),
            self._crank_status(),
            self._closure_status(),
            self._recording_status(),
        ]
        if self.loop.injection is not None:
            statuses.append(self._faults_status(self.loop.injection))
        if self.loop.counts.wrenches:
            statuses.append(self._wrenches_status())
        return statuses

    def _tick_status(self) -> DiagnosticStatus:
        window = max(self.window_end.time - self.window_start.time, 1) / NANOSECONDS
        ticks = self.window_end.ticks - self.window_start.ticks
        lost = self.window_end.lost - self.window_start.lost
        actual = ticks / window
        lowest = self.rate * (1.0 - _RATE_TOLERANCE)
        level, message = OK, 'Ticking'
        if self.clock_silence > CLOCK_PATIENCE:
            level, message = STALE, no_clock(self.clock_silence)
        elif actual < lowest:
            level, message = WARN, f'{actual:.1f} ticks a second, {self.rate:g} wanted'
        elif lost:
            level, message = WARN, f'{lost} ticks lost'
        elif self.window_end.chatter_count > self.window_start.chatter_count:
            level, message = WARN, 'Motor and crank meet and part too often for the step'
        elif self.node_doubled:
            level, message = WARN, self.node_doubled
        # The keys of diagnostic_updater's FrequencyStatus come first.
        values: dict[str, object] = {
            'Events in window': ticks,
            'Events since startup': self.loop.counts.ticks,
            'Duration of window (s)': f'{window:.3f}',
            'Actual frequency (Hz)': f'{actual:.3f}',
        }
        if self.rate:
            lateness = self.loop.counts.lateness
            values |= {
                'Target frequency (Hz)': f'{self.rate:g}',
                'Minimum acceptable frequency (Hz)': f'{lowest:g}',
                'Maximum acceptable frequency (Hz)': f'{self.rate * (1 + _RATE_TOLERANCE):g}',
                'Lost ticks': self.loop.counts.lost,
                'Late by more than a period': self.loop.counts.late,
                'Lateness p50 (us)': f'{lateness.percentile(50) / 1e3:.1f}',
                'Lateness p99 (us)': f'{lateness.percentile(99) / 1e3:.1f}',
                'Lateness max (us)': f'{lateness.longest / 1e3:.1f}',
            }
        values |= {
            'Joint states published': self.loop.counts.published,
            **self._lost_time(),
            'Clock jumps back': self.loop.counts.clock_jumps,
            **({'Clock messages refused': self.clock_refused} if self.clock_refused else {}),
            'Resets': self.loop.counts.resets,
        }
        values |= self.system
        return self._make_status('tick', level, message, values)

    def _lost_time(self) -> dict[str, object]:
        """Return the time that integrating drives skipped because they could not keep up."""
        lines = self.loop.pipeline.linkages
        drives = [line.drive for line in lines]
        lost = [drive.lost for drive in drives if hasattr(drive, 'lost')]
        if not lost:
            return {}
        values: dict[str, object] = {'Time not integrated (s)': f'{sum(lost) / NANOSECONDS:.3f}'}
        if any(
            limits.effort < inf
            for line in lines
            for limits in line.scene_linkage.linkage.limits.values()
        ):
            cut = sum(drive.saturated for drive in drives if hasattr(drive, 'saturated'))
            values['Commands cut to the effort limit'] = cut
        if self.window_end.chatter_count:
            values['Steps with too many meetings of motor and crank'] = (
                self.window_end.chatter_count
            )
        return values

    def _crank_status(self) -> DiagnosticStatus:
        counts = self.loop.counts
        stamp = self.loop.newest_stamp
        age = (self.clock - stamp) / NANOSECONDS if stamp else inf
        rejected = self.window_end.rejected - self.window_start.rejected
        level, message = OK, 'Samples arriving'
        max_age = self.loop.pipeline.max_age
        if not self.crank_topic:
            message = 'Driven by the scene'
        elif counts.ignored and counts.ignored == counts.received:
            level, message = STALE if max_age else WARN, 'No crank yet: messages lack its joint'
        elif self.window_end.stale > self.window_start.stale and age * NANOSECONDS > max_age:
            level, message = STALE, f'Samples arrive, but are {age:.1f} s old by their stamps'
        elif max_age and age * NANOSECONDS > max_age:
            level = STALE
            message = f'No crank for {age:.1f} s, by its stamps' if stamp else 'No crank yet'
        elif self.cranks_doubled:
            level, message = WARN, self.cranks_doubled
        elif rejected > 0:
            level, message = WARN, f'{rejected} samples rejected'
        missed = self.loop.missed_messages
        values: dict[str, object] = {
            'Topic': self.crank_topic,
            'Publishers': ', '.join(self.publishers),
            'Samples received': counts.received,
            'Samples used': counts.used,
            'Samples superseded': counts.superseded,
            'Samples stale': counts.stale,
            'Samples rejected': self.window_end.rejected,
            'Messages without the crank': counts.ignored,
            'Messages lost before': 'unknown' if missed is None else missed,
            'Age of the newest sample (s)': f'{age:.3f}',
        }
        values |= {f'Rejected: {why.value}': n for why, n in counts.rejected.items() if n}
        return self._make_status('crank', level, message, values)

    def _closure_status(self) -> DiagnosticStatus:
        counts = self.loop.counts
        level, message = OK, 'Closed'
        lines = self.loop.pipeline.linkages
        number, last = counts.last_unclosed.get(Status.OPEN, (0, None))
        reachable = describe_ranges(lines[number].closure.input_ranges)
        if self.window_end.unclosed > self.window_start.unclosed:
            level = ERROR
            message = (
                f'Open by {last.gap:.6g} m; reachable: {reachable}'
                if last is not None
                and self.window_end.indeterminate == self.window_start.indeterminate
                else 'Pose undefined: two pins coincide, or a link is broken'
            )
        elif self.window_end.limited > self.window_start.limited:
            number, beyond = counts.last_unclosed[Status.LIMITED]
            level, message = WARN, f'Beyond limits: {lines[number].closure.limit_exceeded(beyond)}'
        elif self.window_end.toggles > self.window_start.toggles:
            level, message = WARN, 'At a toggle: position valid, velocity not'
        values: dict[str, object] = {
            'Scene': self.scene,
            'Reachable': reachable,
            'Ticks at a change point': counts.unclosed[Status.CHANGE_POINT],
            'Ticks beyond limits': counts.unclosed[Status.LIMITED],
            'Ticks at a toggle': counts.unclosed[Status.TOGGLE],
            'Ticks open': counts.unclosed[Status.OPEN],
            'Ticks indeterminate': counts.unclosed[Status.INDETERMINATE],
            'Gap when last open (m)': f'{last.gap:.6g}' if last is not None else '0',
        }
        looks = (
            [*zip(counts.last_tick.linkages, counts.last_tick.states, strict=True)]
            if counts.last_tick
            else []
        )
        posed = [
            (line, look.position)
            for line, look in looks
            if look.position is not None and look.position.joints
        ]
        if posed:
            if len(lines) == 1:
                values |= _input_values(*looks[0])
            line, worst = max(
                ((line, line.closure.residual(position)) for line, position in posed),
                key=itemgetter(1),
            )
            values['Residual (m)'] = f'{worst:.3g}{_linkage_text(line)}'
            near, warning = self._worst_nearness(posed)
            values |= near
            if warning and level == OK:
                level, message = WARN, warning
        shares, warning = _limit_utilisation(looks)
        values |= shares
        if warning and level == OK:
            level, message = WARN, warning
        return self._make_status('loop closure', level, message, values)

    def _worst_nearness(
        self, posed: Sequence[tuple[LinkagePipeline, Position]]
    ) -> tuple[dict[str, str], str]:
        """Return the singularity measures of the worst linkage, and the warning text."""
        nearness = [(line, line.closure.singularity_margin(position)) for line, position in posed]
        inputs = [driven for line, _ in posed for driven in line.scene_linkage.linkage.inputs]
        unit = ' or '.join(sorted({driven.unit for driven in inputs}))
        values, warnings = {}, []
        for name, text in _NEARNESS.items():
            line, value = min(
                ((line, getattr(near, name)) for line, near in nearness), key=itemgetter(1)
            )
            key, limit = text.format(unit=unit), self.limits[name]
            values[key] = f'{value:.6g}{_linkage_text(line)}'
            if value < limit:
                warnings.append(
                    f'{key} is {value:.3g}{_linkage_text(line)}, below warn.{name} of {limit:.3g}'
                )
        return values, '; '.join(warnings)

    def _faults_status(self, injection: Injection) -> DiagnosticStatus:
        on = [name for name, switch in injection.switches.items() if switch.on]
        message = f'Injected: {", ".join(on)}' if on else 'None injected'
        values: dict[str, object] = {}
        for name, fault in injection.faults.items():
            values[f'{name} ({fault.kind})'] = 'injected' if name in on else 'off'
            values[f'Times injected: {name}'] = injection.injected[name]
        return self._make_status('faults', WARN if on else OK, message, values)

    def _wrenches_status(self) -> DiagnosticStatus:
        values: dict[str, object] = {}
        silent = []
        for topic, counts in zip(
            self.loop.pipeline.wrenches, self.loop.counts.wrenches, strict=True
        ):
            held, name = topic.wrench, topic.topic
            age = self.clock - held.stamp if held.stamp else inf
            if age > held.max_age:
                silent.append(name)
            values |= {
                f'Received: {name}': counts.received,
                f'Rejected: {name}': sum(counts.rejected.values()),
                f'Age of the newest: {name} (s)': f'{age / NANOSECONDS:.3f}',
            }
            values |= {
                f'Rejected: {name}: {why.value}': n for why, n in counts.rejected.items() if n
            }
        rejected = self.window_end.wrenches_rejected - self.window_start.wrenches_rejected
        level, message = OK, 'Wrenches arriving'
        if rejected:
            level, message = WARN, f'{rejected} wrenches rejected'
        elif silent:
            level, message = STALE, f'No messages, so no load: {", ".join(silent)}'
        return self._make_status('wrenches', level, message, values)

    def _recording_status(self) -> DiagnosticStatus:
        if self.snapshots is not None:
            return self._memory_status(self.snapshots)
        level, message = OK, 'Not recording'
        values: dict[str, object] = {}
        recorder = self.loop.recorder
        if recorder is not None:
            level, message = OK, 'Recording'
            topics = recorder.read_counts()
            for topic in topics:
                values[f'Received: {topic.name}'] = topic.received
                values[f'Recorded: {topic.name}'] = topic.recorded
                values[f'Dropped: {topic.name}'] = topic.dropped
                values[f'Waiting: {topic.name}'] = topic.waiting
                if topic.discarded:
                    values[f'Discarded: {topic.name}'] = topic.discarded
            if any(topic.dropped for topic in topics):
                level, message = WARN, 'The disk does not keep up: messages dropped'
            if recorder.failure is not None:
                level, message = ERROR, str(recorder.failure)
            if recorder.failure is not None and recorder.is_recording:
                level, message = WARN, f'Recording again, in a new file: {recorder.failure}'
        elif self.recording_failure:
            level, message = ERROR, self.recording_failure
        return self._make_status('recording', level, message, values)

    def _memory_status(self, snapshots: RunSnapshots) -> DiagnosticStatus:
        memory = snapshots.memory
        seconds, size, crowded = memory.extent
        level, message = OK, f'In memory: the last {memory.seconds:g} s'
        topics = memory.read_counts()
        values: dict[str, object] = {}
        for topic in topics:
            values[f'Received: {topic.name}'] = topic.received
            values[f'In memory: {topic.name}'] = topic.kept
            values[f'Discarded: {topic.name}'] = topic.discarded
            values[f'Dropped: {topic.name}'] = topic.dropped
        values |= {
            'In memory (s)': f'{seconds:.3f}',
            'In memory (bytes)': size,
            'Snapshot being written': 'yes' if snapshots.is_writing else 'no',
            'Snapshots written': snapshots.written,
            'Snapshots failed': snapshots.failed,
            'Last snapshot': snapshots.last_folder,
        }
        if crowded:
            level = WARN
            message = f'Room for {seconds:.1f} s of {memory.seconds:g} s: raise snapshot_bytes'
        if any(topic.dropped for topic in topics):
            level, message = WARN, 'The memory does not keep up: messages dropped'
        if snapshots.failure:
            level, message = ERROR, f'Last snapshot: {snapshots.failure}'
        if memory.failure is not None:
            level, message = ERROR, str(memory.failure)
        return self._make_status('recording', level, message, values)

    def _make_status(
        self, task: str, level: bytes, message: str, values: dict[str, object]
    ) -> DiagnosticStatus:
        return DiagnosticStatus(
            level=level,
            name=f'{self.node}: {task}',
            message=message,
            hardware_id=self.scene,
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )


def chatter_count(lines: Sequence[LinkagePipeline]) -> int:
    """Return the number of steps in which motor and crank met and parted too often."""
    return sum(line.drive.chatter_count for line in lines)


def is_interleaved(before: int, now: int) -> bool:
    """
    Return whether messages came from several publishers, by counts of numbers that went back.

    A publisher that starts again begins its numbers again, once.
    """
    return now - before > 1


def no_clock(silence: float) -> str:
    """Return the text for a ``/clock`` that has been silent for a time, in [s]."""
    return 'No /clock yet' if silence == inf else f'No /clock for {silence:.1f} s'


def _limit_utilisation(
    states: Sequence[tuple[LinkagePipeline, LinkageState]],
) -> tuple[dict[str, str], str]:
    """Return the share of its limits that each joint used at the last tick, and the excess."""
    values, warnings = {}, []
    for line, look in states:
        for name, (rate, effort) in _rates_and_efforts(line, look).items():
            limits = line.scene_linkage.linkage.limits[name]
            for what, value, most in (
                ('Velocity', rate, limits.velocity),
                ('Effort', effort, limits.effort),
            ):
                if value is None or most == inf:
                    continue
                joint = f'{line.scene_linkage.prefix}{name}'
                values[f'{what} of {joint}, of its limit'] = f'{abs(value) / most:.4g}'
                if abs(value) > most:
                    warnings.append(f'{what} of {joint} is {abs(value):.6g}, its limit {most:.6g}')
    return values, '; '.join(warnings)


def _input_values(pipeline: LinkagePipeline, state: LinkageState) -> dict[str, str]:
    """Return the inputs of a linkage, as diagnostic values."""
    angles = state.crank.angles if state.crank is not None else ()
    return {
        f'Input {driven.joint} ({driven.unit})': f'{angle:.6f}'
        for driven, angle in zip(pipeline.scene_linkage.linkage.inputs, angles, strict=False)
    }


def _rates_and_efforts(
    pipeline: LinkagePipeline, state: LinkageState
) -> dict[str, tuple[float | None, float | None]]:
    """Return rate and effort of the joints that have limits, as far as they are known."""
    linkage, reading = pipeline.scene_linkage.linkage, state.reading
    exertions: dict[str, tuple[float | None, float | None]] = {}
    if reading is not None:
        for index, name in enumerate(linkage.joints):
            # A reading has rates, and efforts, for all of its joints or for none.
            rate = reading.rates[index] if reading.rates else None
            exertions[name] = rate, reading.efforts[index] if reading.efforts else None
    driven = state.crank.rates if state.crank is not None else ()
    for given, rate in zip(linkage.inputs, driven, strict=False):
        exertions[given.joint] = rate, exertions.get(given.joint, (None, None))[1]
    return {name: of for name, of in exertions.items() if name in linkage.limits}


def _linkage_text(line: LinkagePipeline) -> str:
    """Return the name of the linkage for a message, if there are several."""
    return f' ({line.scene_linkage.name})' if line.scene_linkage.name else ''


class Warnings:
    """Warnings, with the time of the last one of each kind."""

    def __init__(self, logger: RcutilsLogger) -> None:
        self._logger = logger
        self._last: dict[str, float] = {}
        self._rejected = dict.fromkeys(Rejection, 0)
        self._wrenches_rejected: dict[str, dict[Rejection, int]] = {}
        self._unclosed = dict.fromkeys(Status, 0)
        self._lost = self._stalls = self._ticks = self._stale = 0
        self._chattered: dict[str, int] = {}
        self._last_message = (0, 0, monotonic())
        self._last_tick = (0, monotonic())

    def check_age(self, counts: Counts, crank_topic: str, max_age: int, period: float) -> None:
        """
        Warn of samples older than ``max_age`` [ns] when they arrive, as where two clocks differ.

        ``period``: least time between two such warnings, in [s], if it is above 30 s.
        """
        if (new := counts.stale - self._stale) <= 0:
            return
        age, most = counts.stale_age / NANOSECONDS, max_age / NANOSECONDS
        line = (
            f'{crank_topic}: {new} samples too old to use, the newest {age:.1f} s by its stamp, '
            f'and max_age is {most:g} s: synchronise the clocks, set use_sim_time where time is '
            'played or simulated, or write drive: {topic: {stamp: arrival}}'
        )
        if self.warn('stale', line, max(period, _STALE_PERIOD)):
            self._stale = counts.stale

    def check_silence(
        self,
        counts: Counts,
        crank_topic: str,
        inputs: Sequence[str],
        period: float,
        interval: float,
        max_age: int,
        publishers: Callable[[], Sequence[str]],
    ) -> None:
        """
        Warn if no message arrives, or none with the crank's joints, and nothing is published.

        Messages are taken by ticks: a tick that does not end is warned of instead. ``interval``:
        time from tick to tick, in [s]; 0 for one tick per message, infinity if a simulation
        decides. ``max_age``: age of the newest sample above which there is no crank, in [ns]; 0
        for never. ``publishers`` returns the names of the other publishers on the topic.
        """
        names = list_names(inputs)
        if counts.ignored and counts.ignored == counts.received:
            head = head_of(counts.last_ignored)
            held = sorted(name.decode(errors='replace') for name in head[0]) if head else ()
            self.warn(
                'ignored',
                f'messages on {crank_topic} hold {list_names(map(repr, held))}; the linkage needs '
                f'{list_names(map(repr, inputs))}: name the joint so there, or remap the topic',
                period,
            )
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
        received, published, since = self._last_message
        if (counts.received, counts.published) != (received, published):
            self._last_message = (counts.received, counts.published, monotonic())
            return
        waited = looked - since
        if (counts.received and not max_age) or waited <= max(_PATIENCE, max_age / NANOSECONDS):
            return
        number = len(publishers())
        self.warn(
            'waiting',
            f'no message on {crank_topic} in {waited:.0f} s ({number} '
            f'publisher{"" if number == 1 else "s"}), so nothing is published; send '
            f'sensor_msgs/JointState with {names} there, remap the topic, or name '
            'another drive in a scene, as drive: {sine: …}',
            period,
        )

    def check_events(
        self, counts: Counts, closures: Sequence[Closure], crank_topic: str, period: float
    ) -> None:
        """Warn of events since the last warning of their kind, at most one in a period, in [s]."""
        new = {
            r: n - self._rejected[r] for r, n in counts.rejected.items() if n > self._rejected[r]
        }
        if new:
            why = '; '.join(f'{r.value} ({n}): {_REMEDIES[r]}' for r, n in new.items())
            line = f'{crank_topic}: {sum(new.values())} samples rejected: {why}'
            if self.warn('rejected', line, period):
                self._rejected = dict(counts.rejected)
        if counts.lost > self._lost and self.warn('lost', self._lost_ticks(counts), period):
            self._lost, self._stalls, self._ticks = counts.lost, counts.stalls, counts.ticks
        for status, text in _UNCLOSED.items():
            ticks = counts.unclosed[status] - self._unclosed[status]
            if ticks and status in counts.last_unclosed:
                number, position = counts.last_unclosed[status]
                closure = closures[number]
                line = text.format(
                    ticks=ticks,
                    gap=position.gap,
                    reachable=describe_ranges(closure.input_ranges),
                    published='published anyway' if position.joints else 'nothing published',
                    beyond=closure.limit_exceeded(position),
                )
                if self.warn(status.value, line, period):
                    self._unclosed[status] = counts.unclosed[status]

    def check_chatter(self, linkages: Sequence[LinkagePipeline], period: float) -> None:
        """Warn of steps in which motor and crank met and parted too often, once a period [s]."""
        for line in linkages:
            kind, count = f'chatter {line.scene_linkage.name}', line.drive.chatter_count
            before = min(self._chattered.get(kind, 0), count)  # a reset counts anew
            if count > before:
                text = f'{describe_chatter(count - before)}{_linkage_text(line)}'
                before = count if self.warn(kind, text, period) else before
            self._chattered[kind] = before

    def check_jumps(self, linkages: Sequence[LinkagePipeline], crank_topic: str) -> None:
        """Warn once of a crank that jumps by more than a turn from one sample to the next."""
        for line in linkages:
            given, jump = line.closure.linkage.inputs[0], getattr(line.drive, 'jump', 0.0)
            if jump > _MORE_THAN_A_TURN and not given.slider:
                self.warn(
                    f'jump {given.joint}',
                    f'{crank_topic}: {given.joint} changed by {jump:.4g} rad between two '
                    'samples, more than a turn; if these are degrees, publish radians',
                    inf,
                )

    def check_wrenches(self, topics: Sequence[tuple[str, WrenchCounts]], period: float) -> None:
        """Warn of rejected wrenches since the last warning; the period of a topic is in [s]."""
        for name, counts in topics:
            rejected, before = dict(counts.rejected), self._wrenches_rejected.get(name, {})
            new = {why: n - before.get(why, 0) for why, n in rejected.items()}
            why = '; '.join(f'{r.value} ({n}): {_WRENCH_REMEDIES[r]}' for r, n in new.items() if n)
            line = f'{name}: {sum(new.values())} wrenches rejected: {why}'
            if why and self.warn(f'wrenches {name}', line, period):
                self._wrenches_rejected[name] = rejected

    def _lost_ticks(self, counts: Counts) -> str:
        """Return the line for ticks that were lost: by what, and whether the rate is too high."""
        lost, stalls = counts.lost - self._lost, counts.stalls - self._stalls
        ticks = counts.ticks - self._ticks
        often = stalls > 1 and lost > _RATE_TOLERANCE * (lost + ticks)
        assert counts.last_stall is not None, 'a lost tick is counted with its stall'
        seconds = counts.last_stall.duration / NANOSECONDS
        what = (
            f'a tick took {seconds:.3f} s'
            if counts.last_stall.in_tick
            else f'the operating system woke the node {seconds:.3f} s late'
        )
        where = 'at once' if stalls == 1 else f'in {stalls} stalls, the last'
        remedy = 'lower the rate' if often else 'the rate is kept otherwise'
        return f'{lost} ticks lost {where}: {what}; {remedy}'

    def warn(self, kind: str, line: str, period: float) -> bool:
        """Warn, unless this kind was already warned of within the period, in [s]."""
        now = monotonic()
        if now - self._last.get(kind, -inf) < period:
            return False
        self._last[kind] = now
        self._logger.warning(line)
        return True
