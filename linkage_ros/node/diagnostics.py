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


"""What the node says of its health: ``diagnostic_msgs/DiagnosticArray``, once a period."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from operator import itemgetter
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from linkage_ros.kinematics.linkage import Input
from linkage_ros.kinematics.ranges import describe
from linkage_ros.kinematics.results import Position
from linkage_ros.kinematics.status import Status
from linkage_ros.messages.layout import NANOSECONDS
from linkage_ros.node.run_snapshots import RunSnapshots
from linkage_ros.node.tick_loop import Counts, TickLoop
from linkage_ros.pipeline.pipeline import LinkagePipeline, LinkageTick

if TYPE_CHECKING:
    from linkage_ros.faults.injection import Injection

OK, WARN, ERROR, STALE = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.ERROR,
    DiagnosticStatus.STALE,
)

_RATE_TOLERANCE = 0.1

CLOCK_PATIENCE = 2.0
"""For how long ``/clock`` may be silent, in [s] of the machine."""

_NEARNESS = {
    'transmission_angle': 'Transmission angle (rad)',
    'conditioning': 'Conditioning',
    'toggle_distance': 'Input to the nearest toggle ({unit})',
}
"""What is told of `Closure.singularity_margin`, and as what."""


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Counts at one instant, of which two make a window."""

    time: int = 0
    ticks: int = 0
    lost: int = 0
    rejected: int = 0
    toggles: int = 0
    limited: int = 0
    unclosed: int = 0
    indeterminate: int = 0

    @classmethod
    def of(cls, counts: Counts, time: int) -> Snapshot:
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
        )


@dataclass(frozen=True, slots=True)
class DiagnosticsSummary:
    """
    All that the diagnostics tell.

    Attributes
    ----------
    node
        Name of the node.
    scene
        Name of the scene.
    rate
        Ticks wanted a second; 0 for one for every sample.
    clock
        Time by the node's clock, in [ns].
    crank_topic
        Resolved name of the topic that the drives listen to; '' for none.
    publishers
        Who else publishes on it.
    loop
        The tick.
    before, now
        Its counts at the beginning and the end of the window.
    recording_failure
        Why there is no recording although one was wanted; '' where there is none to tell.
    limits
        For each attribute of the nearness to trouble below what it is warned of; 0 for never.
    snapshots
        The memory of the last seconds; nothing where a bag is written as the run goes.
    clock_silence
        For how long ``/clock`` has been silent, in [s]; 0 where the node does not follow it.
    clock_refused
        How many of its messages held no time.
    crank_shared
        Whether the crank's topic is for other joints, too: then it may have several publishers.
    system
        What of middleware and operating system bears on the ticks.

    """

    node: str
    scene: str
    rate: float
    clock: int
    crank_topic: str
    publishers: Sequence[str]
    loop: TickLoop
    before: Snapshot
    now: Snapshot
    recording_failure: str
    limits: Mapping[str, float]
    snapshots: RunSnapshots | None = None
    clock_silence: float = 0.0
    clock_refused: int = 0
    crank_shared: bool = False
    system: Mapping[str, str] = field(default_factory=dict)

    def statuses(self) -> list[DiagnosticStatus]:
        """Return the statuses, one for each task."""
        statuses = [self._tick(), self._crank(), self._closure(), self._recording()]
        if self.loop.injection is not None:
            statuses.append(self._faults(self.loop.injection))
        return statuses

    def _tick(self) -> DiagnosticStatus:
        window = max(self.now.time - self.before.time, 1) / NANOSECONDS
        ticks = self.now.ticks - self.before.ticks
        lost = self.now.lost - self.before.lost
        actual = ticks / window
        lowest = self.rate * (1.0 - _RATE_TOLERANCE)
        level, message = OK, 'Ticking'
        if self.clock_silence > CLOCK_PATIENCE:
            level, message = STALE, no_clock(self.clock_silence)
        elif actual < lowest:
            level, message = WARN, f'{actual:.1f} ticks a second, {self.rate:g} wanted'
        elif lost:
            level, message = WARN, f'{lost} ticks lost'
        # The keys of diagnostic_updater's FrequencyStatus, then our own.
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
        return self._status('tick', level, message, values)

    def _lost_time(self) -> dict[str, object]:
        """Return the time that drives which integrate could not follow, and left out."""
        lines = self.loop.pipeline.lines
        drives = [line.drive for line in lines]
        lost = [drive.lost for drive in drives if hasattr(drive, 'lost')]
        if not lost:
            return {}
        values: dict[str, object] = {'Time not integrated (s)': f'{sum(lost) / NANOSECONDS:.3f}'}
        if any(
            limits.effort < inf for line in lines for limits in line.member.linkage.limits.values()
        ):
            cut = sum(drive.saturated for drive in drives if hasattr(drive, 'saturated'))
            values['Commands cut to the effort limit'] = cut
        return values

    def _crank(self) -> DiagnosticStatus:
        counts = self.loop.counts
        stamp = self.loop.newest_stamp
        age = (self.clock - stamp) / NANOSECONDS if stamp else inf
        rejected = self.now.rejected - self.before.rejected
        level, message = OK, 'Samples arriving'
        max_age = self.loop.pipeline.max_age
        if not self.crank_topic:
            message = 'Driven by the scene'
        elif counts.ignored and counts.ignored == counts.received:
            level, message = STALE if max_age else WARN, 'No crank yet, but messages without it'
        elif max_age and age * NANOSECONDS > max_age:
            level = STALE
            message = f'No crank for {age:.1f} s, by its stamps' if stamp else 'No crank yet'
        elif len(self.publishers) > 1 and not self.crank_shared:
            level, message = WARN, f'Several publishers: {", ".join(self.publishers)}'
        elif rejected:
            level, message = WARN, f'{rejected} samples rejected'
        missed = self.loop.missed
        values: dict[str, object] = {
            'Topic': self.crank_topic,
            'Publishers': ', '.join(self.publishers),
            'Samples received': counts.received,
            'Samples used': counts.used,
            'Samples superseded': counts.superseded,
            'Samples rejected': self.now.rejected,
            'Messages without the crank': counts.ignored,
            'Messages lost before': 'unknown' if missed is None else missed,
            'Age of the newest sample (s)': f'{age:.3f}',
        }
        values |= {f'Rejected: {why.value}': n for why, n in counts.rejected.items() if n}
        return self._status('crank', level, message, values)

    def _closure(self) -> DiagnosticStatus:
        counts = self.loop.counts
        level, message = OK, 'Closed'
        lines = self.loop.pipeline.lines
        number, last = counts.last_unclosed.get(Status.OPEN, (0, None))
        reachable = describe(lines[number].closure.input_ranges)
        if self.now.unclosed > self.before.unclosed:
            level = ERROR
            message = (
                f'Open by {last.gap:.6g} m; reachable: {reachable}'
                if last is not None and self.now.indeterminate == self.before.indeterminate
                else 'The pose cannot be told: two pins coincide, or a link is broken'
            )
        elif self.now.limited > self.before.limited:
            number, beyond = counts.last_unclosed[Status.LIMITED]
            level, message = WARN, f'Beyond limits: {lines[number].closure.beyond(beyond)}'
        elif self.now.toggles > self.before.toggles:
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
        looks = [*zip(counts.last.lines, counts.last.looks, strict=True)] if counts.last else []
        posed = [
            (line, look.position)
            for line, look in looks
            if look.position is not None and look.position.joints
        ]
        if posed:
            if len(lines) == 1:
                values |= _inputs(*looks[0])
            line, worst = max(
                ((line, line.closure.residual(position)) for line, position in posed),
                key=itemgetter(1),
            )
            values['Residual (m)'] = f'{worst:.3g}{_of(line)}'
            near, warning = self._nearness(posed)
            values |= near
            if warning and level == OK:
                level, message = WARN, warning
        shares, warning = _shares(looks)
        values |= shares
        if warning and level == OK:
            level, message = WARN, warning
        return self._status('loop closure', level, message, values)

    def _nearness(
        self, posed: Sequence[tuple[LinkagePipeline, Position]]
    ) -> tuple[dict[str, str], str]:
        """Return how near trouble the linkage is that is nearest, and what there is to warn."""
        nearness = [(line, line.closure.singularity_margin(position)) for line, position in posed]
        inputs = [driven for line, _ in posed for driven in line.member.linkage.inputs]
        unit = ' or '.join(sorted({_unit(driven) for driven in inputs}))
        values, warnings = {}, []
        for name, text in _NEARNESS.items():
            line, value = min(
                ((line, getattr(near, name)) for line, near in nearness), key=itemgetter(1)
            )
            key, limit = text.format(unit=unit), self.limits[name]
            values[key] = f'{value:.6g}{_of(line)}'
            if value < limit:
                warnings.append(
                    f'{key} is {value:.3g}{_of(line)}, below warn.{name} of {limit:.3g}'
                )
        return values, '; '.join(warnings)

    def _faults(self, injection: Injection) -> DiagnosticStatus:
        on = [name for name, switch in injection.switches.items() if switch.on]
        message = f'Injected: {", ".join(on)}' if on else 'None injected'
        values: dict[str, object] = {}
        for name, fault in injection.faults.items():
            values[f'{name} ({fault.kind})'] = 'injected' if name in on else 'off'
            values[f'Times injected: {name}'] = injection.injected[name]
        return self._status('faults', WARN if on else OK, message, values)

    def _recording(self) -> DiagnosticStatus:
        if self.snapshots is not None:
            return self._memory(self.snapshots)
        level, message = OK, 'Not recording'
        values: dict[str, object] = {}
        recorder = self.loop.recorder
        if recorder is not None:
            level, message = OK, 'Recording'
            topics = recorder.inspect()
            for topic in topics:
                values[f'Received: {topic.name}'] = topic.received
                values[f'Recorded: {topic.name}'] = topic.recorded
                values[f'Dropped: {topic.name}'] = topic.dropped
                values[f'Waiting: {topic.name}'] = topic.waiting
                if topic.let_go:
                    values[f'Let go: {topic.name}'] = topic.let_go
            if any(topic.dropped for topic in topics):
                level, message = WARN, 'The disk does not keep up: messages dropped'
            if recorder.failure is not None:
                level, message = ERROR, str(recorder.failure)
            if recorder.failure is not None and recorder.recording:
                level, message = WARN, f'Recording again, in a new file: {recorder.failure}'
        elif self.recording_failure:
            level, message = ERROR, self.recording_failure
        return self._status('recording', level, message, values)

    def _memory(self, snapshots: RunSnapshots) -> DiagnosticStatus:
        memory = snapshots.memory
        seconds, size, crowded = memory.extent
        level, message = OK, f'In memory: the last {memory.seconds:g} s'
        topics = memory.inspect()
        values: dict[str, object] = {}
        for topic in topics:
            values[f'Received: {topic.name}'] = topic.received
            values[f'In memory: {topic.name}'] = topic.kept
            values[f'Let go: {topic.name}'] = topic.let_go
            values[f'Dropped: {topic.name}'] = topic.dropped
        values |= {
            'In memory (s)': f'{seconds:.3f}',
            'In memory (bytes)': size,
            'Snapshot being written': 'yes' if snapshots.writing else 'no',
            'Snapshots written': snapshots.written,
            'Snapshots failed': snapshots.failed,
            'Last snapshot': snapshots.last,
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
        return self._status('recording', level, message, values)

    def _status(
        self, task: str, level: bytes, message: str, values: dict[str, object]
    ) -> DiagnosticStatus:
        return DiagnosticStatus(
            level=level,
            name=f'{self.node}: {task}',
            message=message,
            hardware_id=self.scene,
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )


def no_clock(silence: float) -> str:
    """Return that ``/clock`` has been silent for a time, in [s]."""
    return 'No /clock yet' if silence == inf else f'No /clock for {silence:.1f} s'


def _shares(looks: Sequence[tuple[LinkagePipeline, LinkageTick]]) -> tuple[dict[str, str], str]:
    """Return what of its limits each joint takes at the last tick, and what is too much."""
    values, warnings = {}, []
    for line, look in looks:
        for name, (rate, effort) in _exertions(line, look).items():
            limits = line.member.linkage.limits[name]
            for what, value, most in (
                ('Velocity', rate, limits.velocity),
                ('Effort', effort, limits.effort),
            ):
                if value is None or most == inf:
                    continue
                joint = f'{line.member.prefix}{name}'
                values[f'{what} of {joint}, of its limit'] = f'{abs(value) / most:.4g}'
                if abs(value) > most:
                    warnings.append(f'{what} of {joint} is {abs(value):.6g}, its limit {most:.6g}')
    return values, '; '.join(warnings)


def _inputs(line: LinkagePipeline, look: LinkageTick) -> dict[str, str]:
    """Return the inputs of the only linkage."""
    angles = look.crank.angles if look.crank is not None else ()
    return {
        f'Input {driven.joint} ({_unit(driven)})': f'{angle:.6f}'
        for driven, angle in zip(line.member.linkage.inputs, angles, strict=False)
    }


def _exertions(
    line: LinkagePipeline, look: LinkageTick
) -> dict[str, tuple[float | None, float | None]]:
    """Return rate and effort of the joints that have limits, as far as they are known."""
    linkage, reading = line.member.linkage, look.reading
    found: dict[str, tuple[float | None, float | None]] = {}
    if reading is not None:
        for number, name in enumerate(linkage.joints):
            # Rates and efforts are of all joints, or of none; of those that are driven no others.
            rate = reading.rates[number] if reading.rates else None
            found[name] = rate, reading.efforts[number] if reading.efforts else None
    driven = look.crank.rates if look.crank is not None else ()
    for given, rate in zip(linkage.inputs, driven, strict=False):
        found[given.joint] = rate, found.get(given.joint, (None, None))[1]
    return {name: of for name, of in found.items() if name in linkage.limits}


def _of(line: LinkagePipeline) -> str:
    """Return which linkage it is, where there are several."""
    return f' ({line.member.name})' if line.member.name else ''


def _unit(driven: Input) -> str:
    return 'm' if driven.slider else 'rad'
