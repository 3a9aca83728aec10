# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The ``diagnostic_msgs/DiagnosticArray`` of the node, once a period."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from math import inf
from operator import itemgetter
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from linkage_ros.kinematics import describe_ranges, Position, Status
from linkage_ros.messages import NANOSECONDS
from linkage_ros.node.conditions import (
    closure_conditions,
    Condition,
    crank_conditions,
    ERROR,
    linkage_text,
    OK,
    RATE_TOLERANCE,
    RunState,
    Since,
    tick_conditions,
    WARN,
    wrench_conditions,
)
from linkage_ros.node.run_recording import RunRecording, RunSnapshots
from linkage_ros.tick import Counts, LinkagePipeline, LinkageState

if TYPE_CHECKING:
    from linkage_ros.stages.faults import Injection

Values = dict[str, object]

_NEARNESS = {
    'transmission_angle': 'Transmission angle (rad)',
    'conditioning': 'Conditioning',
    'toggle_distance': 'Input to the nearest toggle ({unit})',
}
"""Attributes of `Closure.singularity_margin` in the diagnostics, with their keys."""


def make_statuses(run: RunState, start: Counts) -> list[DiagnosticStatus]:
    """Return the statuses, one for each task; ``start`` has the counts of the last ones."""
    since: Since = defaultdict(lambda: start)
    arriving = 'Commands arriving' if run.takes_commands else 'Samples arriving'
    crank = arriving if run.crank_topic else 'Driven by the scene'
    singularity, near = _describe_singularity(run)
    tasks = [
        ('tick', 'Ticking', tick_conditions(run, since), _tick_values(run, start)),
        ('crank', crank, crank_conditions(run, since), _crank_values(run)),
        (
            'loop closure',
            'Closed',
            chain(closure_conditions(run, since), near),
            _closure_values(run) | singularity,
        ),
        ('recording', *_describe_recording(run.recording)),
    ]
    if run.loop.injection is not None:
        tasks.append(('faults', *_describe_faults(run.loop.injection)))
    if run.wrench_topics:
        wrenches = wrench_conditions(run, since)
        tasks.append(('wrenches', 'Wrenches arriving', wrenches, _wrench_values(run)))
    return [_make_status(run, *task) for task in tasks]


def _make_status(
    run: RunState, task: str, well: str, conditions: Iterable[Condition], values: Values
) -> DiagnosticStatus:
    """Return the status of a task: with its first condition, or the message that all is well."""
    shown = (condition for condition in conditions if condition.level != OK)
    level, message, *_ = next(shown, Condition(OK, well))
    return DiagnosticStatus(
        level=level,
        name=f'{run.node}: {task}',
        message=message,
        hardware_id=run.scene.name,
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )


def _tick_values(run: RunState, start: Counts) -> Values:
    counts = run.counts
    window, ticks = run.measure_rate(start)
    # The keys of diagnostic_updater's FrequencyStatus come first.
    values: Values = {
        'Events in window': ticks,
        'Events since startup': counts.ticks,
        'Duration of window (s)': f'{window:.3f}',
        'Actual frequency (Hz)': f'{ticks / window:.3f}',
    }
    if run.rate:
        values |= {
            'Target frequency (Hz)': f'{run.rate:g}',
            'Minimum acceptable frequency (Hz)': f'{run.rate * (1.0 - RATE_TOLERANCE):g}',
            'Maximum acceptable frequency (Hz)': f'{run.rate * (1.0 + RATE_TOLERANCE):g}',
            'Lost ticks': counts.lost,
            'Late by more than a period': counts.late,
            'Lateness p50 (us)': f'{counts.lateness.percentile(50) / 1e3:.1f}',
            'Lateness p99 (us)': f'{counts.lateness.percentile(99) / 1e3:.1f}',
            'Lateness max (us)': f'{counts.lateness.longest / 1e3:.1f}',
        }
    values['Joint states published'] = counts.published
    values |= _lost_time(run)
    values['Clock jumps back'] = counts.clock_jumps
    if run.clock_refused:
        values['Clock messages refused'] = run.clock_refused
    values['Resets'] = counts.resets
    return {**values, **run.system}


def _lost_time(run: RunState) -> Values:
    """Return the time that integrating drives skipped because they could not keep up."""
    lines = run.loop.pipeline.linkages
    drives = [line.drive for line in lines]
    lost = [drive.lost for drive in drives if hasattr(drive, 'lost')]
    if not lost:
        return {}
    values: Values = {'Time not integrated (s)': f'{sum(lost) / NANOSECONDS:.3f}'}
    if any(
        limits.effort < inf
        for line in lines
        for limits in line.scene_linkage.linkage.limits.values()
    ):
        cut = sum(drive.saturated for drive in drives if hasattr(drive, 'saturated'))
        values['Commands cut to the effort limit'] = cut
    if any(run.counts.chatter):
        values['Steps with too many meetings of motor and crank'] = sum(run.counts.chatter)
    return values


def _crank_values(run: RunState) -> Values:
    counts, missed = run.counts, run.loop.missed_messages
    values: Values = {
        'Topic': run.crank_topic,
        'Publishers': ', '.join(run.publishers),
        'Samples received': counts.received,
        'Samples used': counts.used,
        'Samples superseded': counts.superseded,
        'Samples stale': counts.stale,
        'Samples rejected': sum(counts.rejected.values()),
        'Messages without the crank': counts.ignored,
        'Messages lost before': 'unknown' if missed is None else missed,
        'Age of the newest sample (s)': f'{run.sample_age:.3f}',
    }
    return values | {f'Rejected: {why.value}': n for why, n in counts.rejected.items() if n}


def _closure_values(run: RunState) -> Values:
    counts = run.counts
    index, last = counts.last_unclosed.get(Status.OPEN, (0, None))
    closure = run.loop.pipeline.linkages[index].closure
    return {
        'Scene': run.scene.name,
        'Reachable': describe_ranges(closure.input_ranges),
        'Ticks at a change point': counts.unclosed[Status.CHANGE_POINT],
        'Ticks beyond limits': counts.unclosed[Status.LIMITED],
        'Ticks at a toggle': counts.unclosed[Status.TOGGLE],
        'Ticks open': counts.unclosed[Status.OPEN],
        'Ticks indeterminate': counts.unclosed[Status.INDETERMINATE],
        'Gap when last open (m)': f'{last.gap:.6g}' if last is not None else '0',
    }


def _describe_singularity(run: RunState) -> tuple[Values, list[Condition]]:
    """Return how near the last poses are to a singularity and to their joints' limits."""
    tick = run.counts.last_tick
    states = [*zip(tick.linkages, tick.states, strict=True)] if tick else []
    posed = [
        (line, state.position)
        for line, state in states
        if state.position is not None and state.position.joints
    ]
    values: Values = {}
    warnings = ['', '']
    if posed:
        if len(run.loop.pipeline.linkages) == 1:
            values |= _input_values(*states[0])
        line, worst = max(
            ((line, line.closure.residual(position)) for line, position in posed),
            key=itemgetter(1),
        )
        values['Residual (m)'] = f'{worst:.3g}{linkage_text(line)}'
        near, warnings[0] = _worst_nearness(posed, run.limits)
        values |= near
    shares, warnings[1] = _limit_utilisation(states)
    return values | shares, [Condition(WARN, text) for text in warnings if text]


def _worst_nearness(
    posed: Sequence[tuple[LinkagePipeline, Position]], limits: Mapping[str, float]
) -> tuple[Values, str]:
    """Return the singularity measures of the worst linkage, and the warning text."""
    nearness = [(line, line.closure.singularity_margin(position)) for line, position in posed]
    inputs = [driven for line, _ in posed for driven in line.scene_linkage.linkage.inputs]
    unit = ' or '.join(sorted({driven.unit for driven in inputs}))
    values: Values = {}
    warnings = []
    for name, text in _NEARNESS.items():
        line, value = min(
            ((line, getattr(near, name)) for line, near in nearness), key=itemgetter(1)
        )
        key, limit = text.format(unit=unit), limits[name]
        values[key] = f'{value:.6g}{linkage_text(line)}'
        if value < limit:
            warnings.append(
                f'{key} is {value:.3g}{linkage_text(line)}, below warn.{name} of {limit:.3g}'
            )
    return values, '; '.join(warnings)


def _describe_faults(injection: Injection) -> tuple[str, list[Condition], Values]:
    on = [name for name, switch in injection.switches.items() if switch.on]
    values: Values = {}
    for name, fault in injection.faults.items():
        values[f'{name} ({fault.kind})'] = 'injected' if name in on else 'off'
        values[f'Times injected: {name}'] = injection.injected[name]
    conditions = [Condition(WARN, f'Injected: {", ".join(on)}')] if on else []
    return 'None injected', conditions, values


def _wrench_values(run: RunState) -> Values:
    values: Values = {}
    for topic, counts in zip(run.loop.pipeline.wrenches, run.counts.wrenches, strict=True):
        held, name = topic.wrench, topic.topic
        age = (run.clock - held.stamp) / NANOSECONDS if held.stamp else inf
        values |= {
            f'Received: {name}': counts.received,
            f'Rejected: {name}': sum(counts.rejected.values()),
            f'Age of the newest: {name} (s)': f'{age:.3f}',
        }
        values |= {f'Rejected: {name}: {why.value}': n for why, n in counts.rejected.items() if n}
    return values


def _describe_recording(recording: RunRecording) -> tuple[str, list[Condition], Values]:
    if recording.snapshots is not None:
        return _describe_memory(recording.snapshots)
    recorder, failure = recording.recorder, recording.failure
    if recorder is None:
        return 'Not recording', [Condition(ERROR, failure)] if failure else [], {}
    values: Values = {}
    topics = recorder.read_counts()
    for topic in topics:
        values[f'Received: {topic.name}'] = topic.received
        values[f'Recorded: {topic.name}'] = topic.recorded
        values[f'Dropped: {topic.name}'] = topic.dropped
        values[f'Waiting: {topic.name}'] = topic.waiting
        if topic.discarded:
            values[f'Discarded: {topic.name}'] = topic.discarded
    conditions = []
    if recorder.failure is not None and recorder.is_recording:
        conditions.append(Condition(WARN, f'Recording again, in a new file: {recorder.failure}'))
    elif recorder.failure is not None:
        conditions.append(Condition(ERROR, str(recorder.failure)))
    elif any(topic.dropped for topic in topics):
        conditions.append(Condition(WARN, 'The disk does not keep up: messages dropped'))
    return 'Recording', conditions, values


def _describe_memory(snapshots: RunSnapshots) -> tuple[str, list[Condition], Values]:
    memory = snapshots.memory
    seconds, size, crowded = memory.extent
    topics = memory.read_counts()
    values: Values = {}
    for topic in topics:
        values[f'Received: {topic.name}'] = topic.received
        values[f'In memory: {topic.name}'] = topic.recorded
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
    conditions = []
    if memory.failure is not None:
        conditions.append(Condition(ERROR, str(memory.failure)))
    elif snapshots.failure:
        conditions.append(Condition(ERROR, f'Last snapshot: {snapshots.failure}'))
    elif any(topic.dropped for topic in topics):
        conditions.append(Condition(WARN, 'The memory does not keep up: messages dropped'))
    elif crowded:
        text = f'Room for {seconds:.1f} s of {memory.seconds:g} s: raise snapshot_bytes'
        conditions.append(Condition(WARN, text))
    return f'In memory: the last {memory.seconds:g} s', conditions, values


def _limit_utilisation(
    states: Sequence[tuple[LinkagePipeline, LinkageState]],
) -> tuple[Values, str]:
    """Return the share of its limits that each joint used at the last tick, and the excess."""
    values: Values = {}
    warnings = []
    for line, state in states:
        linkage, reading, crank = line.scene_linkage.linkage, state.reading, state.crank
        # A reading has rates, and efforts, for all of its joints or for none.
        rates = dict(zip(linkage.joints, reading.rates if reading else (), strict=False))
        efforts = dict(zip(linkage.joints, reading.efforts if reading else (), strict=False))
        driven = zip(linkage.inputs, crank.rates if crank else (), strict=False)
        rates |= {driven_joint.joint: rate for driven_joint, rate in driven}
        for name in [joint for joint in rates | efforts if joint in linkage.limits]:
            limits = linkage.limits[name]
            for what, exerted, most in (
                ('Velocity', rates, limits.velocity),
                ('Effort', efforts, limits.effort),
            ):
                if name not in exerted or most == inf:
                    continue
                joint, value = f'{line.scene_linkage.prefix}{name}', exerted[name]
                values[f'{what} of {joint}, of its limit'] = f'{abs(value) / most:.4g}'
                if abs(value) > most:
                    warnings.append(f'{what} of {joint} is {abs(value):.6g}, its limit {most:.6g}')
    return values, '; '.join(warnings)


def _input_values(pipeline: LinkagePipeline, state: LinkageState) -> Values:
    """Return the inputs of a linkage, as diagnostic values."""
    angles = state.crank.angles if state.crank is not None else ()
    return {
        f'Input {driven.joint} ({driven.unit})': f'{angle:.6f}'
        for driven, angle in zip(pipeline.scene_linkage.linkage.inputs, angles, strict=False)
    }
