# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Read a bag once, from beginning to end, for its page; memory does not grow with the bag.

Of a bag with a scene the ticks, samples, events and open loops are shown; of a bag without one all
topics of joint states, as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from linkage_ros.bag import (
    Bag,
    Contents,
    missing_start_reason,
    read_raw_metadata,
    read_run_metadata,
    RunMetadata,
)
from linkage_ros.description import Scene
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import (
    Closure,
    CODES,
    PlanarClosure,
    SpaceClosure,
    SpaceDrawing,
    Status,
)
from linkage_ros.messages import JOINT_STATE_TYPE, WRENCHES
from linkage_ros.replay import own_joint_states, recorded_scene
from linkage_ros.tools.view.report.blocks import (
    Blocks,
    Entry,
    MessageRows,
    Progress,
    rows_of,
    RunClock,
    times_of,
)
from linkage_ros.tools.view.report.curves import (
    BoundedCurves,
    LinkWrenches,
    MOST_LINKAGES,
    NO_ROOM,
    PinForces,
    SceneCurves,
    UNITS,
)
from linkage_ros.tools.view.report.decimation import Flags, Numbers, STATE_BYTES, Times
from linkage_ros.tools.view.report.diagnostics_summary import RecordedDiagnostics
from linkage_ros.tools.view.report.joint_states import JointBlock, JointStates
from linkage_ros.tools.view.report.labels import EVENT_TRACKS, shorten_text
from linkage_ros.tools.view.report.run import (
    APART,
    CurveColumn,
    EventTrack,
    LinkageRun,
    ReportedRun,
    Silences,
    Window,
)
from linkage_ros.tools.view.report.samples import CrankHistory, SampleClassifier
import numpy as np

_MOST_TOPICS = 6
_DISORDER = 1_000_000_000
"""By how much a message may come late in a bag of another program, in [ns]."""

_MORE_TOPICS = f'topics of joint states beyond the first {_MOST_TOPICS}'
_LATER_JOINTS = 'messages with joints that turn up later'

_TOGETHER = 20_000_000
"""Events of a kind that are closer than this form one span, in [ns]."""

_ALIKE = ('open', 'toggle')
_MOST_SILENCES = 400
_NOT_MOVING = f'linkages beyond the first {MOST_LINKAGES}, which have no moving picture'

_NEVER = 2**62


class ForeignRun:
    """Reads the window of a bag without a scene, block by block."""

    def __init__(self, bag: Bag, window: Window) -> None:
        names = [topic.name for topic in bag.topics if topic.type == JOINT_STATE_TYPE]
        self._window, self._clock = window, RunClock(_DISORDER)
        self.topics = set(names[:_MOST_TOPICS])
        self._more = names[_MOST_TOPICS:]
        self._readers = {topic: JointStates() for topic in names[:_MOST_TOPICS]}
        self._kept: dict[str, BoundedCurves] = {}
        self._widths: dict[str, int] = {}
        self._event_tracks = {'jump': EventTrack(window=window)}
        # Among several topics, none is known to publish all the time.
        if len(self._readers) == 1:
            self._event_tracks['silent'] = EventTrack(APART, window=window)
            self._silences = Silences(self._event_tracks['silent'], 0)
        self._later: dict[str, int] = {}

    def add_block(self, block: Mapping[str, list[Entry]]) -> None:
        """Add the messages of a block."""
        entries = sorted(
            (*entry, topic) for topic in self.topics for entry in block.get(topic, ())
        )
        passed = self._clock.run_times(times_of([entry[1] for entry in entries]))
        for time, by in self._clock.pop_jumps():
            self._event_tracks['jump'].add(time, time, f'by {by / 1e9:.6g} s')
        for topic, reader in self._readers.items():
            own = [i for i, entry in enumerate(entries) if entry[4] == topic]
            if not own:
                continue
            read = reader.read([entries[i][3] for i in own])
            times, numbers = passed[own][read.good], read.numbers[read.good]
            if not len(times):
                continue
            if topic not in self._kept:
                # The message has no unit; the joint may be revolute or prismatic.
                columns = [
                    CurveColumn(shorten_text(name), quantity, ' or '.join(units))
                    for quantity, units in UNITS.items()
                    for name in reader.joints
                ]
                space = STATE_BYTES // len(self._readers)
                self._kept[topic] = BoundedCurves(topic, columns, space, self._window)
                self._widths[topic] = len(reader.joints)
            width = self._widths[topic]
            if numbers.shape[2] > width:
                later = ~np.isnan(numbers[:, :, width:]).all(axis=(1, 2))
                self._later[topic] = self._later.get(topic, 0) + int(later.sum())
            self._kept[topic].add(times, numbers[:, :, :width].reshape(len(times), 3 * width))
            if len(self._readers) == 1:
                self._silences.add(times)

    def finish_run(self, contents: Contents) -> ReportedRun:
        """Return the run, with the counts of all messages."""
        if len(self._readers) == 1:
            self._silences.end_run(self._clock.end)
        lanes = [
            curves for kept in self._kept.values() if (curves := kept.build_curves()) is not None
        ]
        left_out = {
            (topic, reason): count
            for topic, reader in self._readers.items()
            for reason, count in reader.left_out.items()
            if count
        }
        left_out |= {
            (topic, _LATER_JOINTS): count for topic, count in self._later.items() if count
        }
        left_out |= {
            (topic, NO_ROOM): kept.left_out for topic, kept in self._kept.items() if kept.left_out
        }
        counts = {topic.topic.name: topic.messages for topic in contents.topics}
        left_out |= {(topic, _MORE_TOPICS): counts.get(topic, 0) for topic in self._more}
        return ReportedRun(
            begin=self._clock.begin,
            end=self._clock.end,
            window=self._window,
            contents=contents,
            curves=lanes,
            event_tracks=self._event_tracks,
            left_out=left_out,
        )


def read_run(
    bag: Bag,
    window: Window,
    progress: Progress,
    scene_of: Callable[[Bag], Scene] = recorded_scene,
) -> tuple[ReportedRun, Scene | None, str]:
    """
    Return the contents of a bag for its page, its scene, and why the scene is missing.

    Of a damaged bag the part before the damage is shown. ``progress`` is called with the progress
    and returns whether to stop; ``scene_of`` returns the scene that a bag carries. The scene is
    None if the bag carries none; the reason is '' if the scene is complete, else it may also be
    that the scene cannot be built here.
    """
    scene, missing = None, ''
    reader: SceneRun | ForeignRun
    try:
        scene = scene_of(bag)
        reader = SceneRun(bag, read_run_metadata(bag), scene, window)
    except LinkageError as error:
        # A page is passed on to others: it shows the bag's name, not its path.
        missing = f'{Path(error.where).name}: {error.reason}'
        reader = ForeignRun(bag, window)
    blocks = Blocks(bag, reader.topics, progress)
    for block in blocks:
        reader.add_block(block)
    return reader.finish_run(blocks.count_contents()), scene, missing


def _find_open_loop_spans(
    linkage: LinkageRun, times: Times, angles: Numbers, track: EventTrack
) -> None:
    """Add the samples at which a linkage does not close to a lane; times in [ns]."""
    if not len(times):
        return
    status = linkage.closure.solve(*angles.T, derivatives=0).status
    is_open = status >= CODES[Status.OPEN]
    for time, inputs in zip(times[is_open].tolist(), angles[is_open].tolist(), strict=True):
        text = ''
        # The first of the joined events gives the text.
        if not track.spans or time - track.spans[-1].end > track.near:
            position = linkage.closure.position(*inputs)
            text = f'{position.status.value}, the links miss by {position.gap:.3g} m'
        track.add(time, time, f'{linkage.name} {text}'.strip())


class SceneRun:
    """Reads a window of a scene's run, block by block; a LinkageError if it cannot be built."""

    def __init__(self, bag: Bag, run: RunMetadata, scene: Scene, window: Window) -> None:
        from_beginning = not missing_start_reason(bag, run)
        self._classifier = SampleClassifier(bag, scene, from_beginning)
        pipeline = self._classifier.pipeline
        self._rate, self._window, self._clock = scene.rate, window, RunClock()
        self._event_tracks = {
            name: EventTrack(_TOGETHER, alike=name in _ALIKE, window=window)
            for name in EVENT_TRACKS
        }
        topic = read_raw_metadata(bag).get('diagnostics_topic')
        self._topics = {
            topic if isinstance(topic, str) else '/diagnostics': 'health',
            run.crank_topic: 'samples',
            run.faults_topic: 'faults',
            run.withheld_topic: 'withheld',
            run.resets_topic: 'resets',
            run.joint_states_topic: 'states',
        }
        wrenches = [topic.name for topic in bag.topics if topic.type == WRENCHES]
        forces = [name for name in wrenches if name in run.extras]
        self._forces = PinForces(', '.join(forces), window)
        for name in forces:
            self._topics.setdefault(name, 'forces')
        loads = zip(run.wrenches, pipeline.wrenches, strict=True)
        self._loads = LinkWrenches({name: load.wrench.numbers for name, load in loads}, window)
        self._loaded = {name: f'wrenches {name}' for name in run.wrenches}
        self._topics = {**self._loaded, **self._topics}
        self._topics.pop('', None)
        shared = run.crank_topic == run.joint_states_topic
        self._own = own_joint_states(scene) if shared else None
        self._linkages = [
            LinkageRun(
                scene_linkage.name,
                scene_linkage.prefix,
                linkage.closure,
                scene_linkage.input_names,
                scene_linkage.joint_names,
                tuple(driven.unit for driven in scene_linkage.linkage.inputs),
                EventTrack(APART, longest=True, most=_MOST_SILENCES, window=window),
            )
            for scene_linkage, linkage in zip(scene.linkages, pipeline.linkages, strict=True)
        ]
        inputs = [
            name for scene_linkage in scene.linkages for name in scene_linkage.sampled_joints
        ]
        self._states = JointStates(scene.joint_names, others=False)
        self._samples = JointStates(inputs, others=False)
        self._cranks = {
            index: CrankHistory(
                linkage, [inputs.index(name) for name in linkage.scene_linkage.sampled_joints]
            )
            for index, linkage in enumerate(pipeline.linkages)
            if linkage.scene_linkage.drive[1].is_measured
        }
        self._first_joints = [
            scene.joint_names.index(linkage.joints[0]) for linkage in self._linkages
        ]
        self._has_limits = any(scene_linkage.linkage.limits for scene_linkage in scene.linkages)
        self._tells_toggles = len(scene.linkages) == 1 and 'velocity' in scene.linkages[0].effects
        self._health = RecordedDiagnostics(self._event_tracks, from_beginning)
        bodies = sum(_count_bodies(linkage.closure) for linkage in self._linkages[:MOST_LINKAGES])
        topics = run.joint_states_topic, run.crank_topic
        self._curves = SceneCurves(scene, topics, bodies, window)
        period = round(1e9 / scene.rate) if scene.rate else 0
        self._silences = [Silences(linkage.silent, period) for linkage in self._linkages]
        self._stale = Silences(self._event_tracks['stale'], 0, pipeline.max_age)

    @property
    def topics(self) -> set[str]:
        """Return the topics whose messages are needed."""
        return {*self._topics}

    def add_block(self, block: Mapping[str, list[Entry]]) -> None:
        """Add the messages of a block."""
        rows = rows_of(block, self._topics, self._own, self._clock)
        for time, by in self._clock.pop_jumps():
            self._event_tracks['jump'].add(time, time, f'by {by / 1e9:.6g} s')
        states, withheld, health = rows['states'], rows['withheld'], rows['health']
        read = self._states.read(states.data)
        good = self._classifier.classify_block(rows, self._event_tracks)
        if self._classifier.listens:
            self._examine_samples(rows['samples'], good, states, read)
        for time in withheld.passed.tolist():
            self._event_tracks['withheld'].add(time, time)
        self._examine_states(states, read)
        self._forces.add(rows['forces'].passed, rows['forces'].data)
        for topic, kind in self._loaded.items():
            if kind in rows:  # unless another topic of the run has its name
                self._loads.add(topic, rows[kind].passed, rows[kind].data)
        self._curves.add_ticks(np.union1d(states.passed[read.good], withheld.passed))
        for time, message in zip(health.passed.tolist(), health.data, strict=True):
            self._health.add_message(message, time)
            self._classifier.learn_faults(self._health.last_values)

    def finish_run(self, contents: Contents) -> ReportedRun:
        """Return the run, with the counts of all messages."""
        end = self._clock.end
        self._classifier.finish_faults(end, self._event_tracks['fault'])
        for silences in self._silences:
            silences.end_run(end)
        if self._classifier.listens and self._stale.limit:
            self._stale.end_run(end)
        curves, frames = self._curves.finish_curves()
        forces = self._forces.build_curves()
        if forces is not None:
            curves.append(forces)
        curves += self._loads.build_curves()
        left_out = self._curves.left_out
        left_out |= {('pin forces', reason): n for reason, n in self._forces.left_out.items()}
        left_out |= {('wrenches', reason): n for reason, n in self._loads.left_out.items()}
        for what, reader in (('joint states', self._states), ('samples', self._samples)):
            left_out |= {(what, reason): n for reason, n in reader.left_out.items() if n}
        if self._classifier.ignored:
            left_out['samples', 'of other joints'] = self._classifier.ignored
        if len(self._linkages) > MOST_LINKAGES:
            left_out['the scene', _NOT_MOVING] = len(self._linkages) - MOST_LINKAGES
        kinds = {*self._known_kinds()}
        return ReportedRun(
            begin=self._clock.begin,
            end=end,
            window=self._window,
            contents=contents,
            curves=curves,
            frames=frames,
            linkages=self._linkages[:MOST_LINKAGES],
            event_tracks={
                key: lane for key, lane in self._event_tracks.items() if key in kinds or lane.count
            },
            lateness=self._curves.late if self._curves.late.count else None,
            age=self._curves.age if self._curves.age.count else None,
            rejected=self._classifier.rejected,
            left_out=left_out,
            last_values=self._health.last_values,
        )

    def _known_kinds(self) -> Iterator[str]:
        """Yield the kinds of events that the bag would show."""
        yield from ('silent', 'jump')
        kinds = self._topics.values()
        for kind, lane in (('faults', 'fault'), ('withheld', 'withheld'), ('resets', 'reset')):
            if kind in kinds:
                yield lane
        if self._classifier.listens:
            yield 'rejected'
            if self._cranks:
                yield 'open'
            if self._stale.limit:
                yield 'stale'
        if self._tells_toggles:
            yield 'toggle'
        if self._health.last_values:
            yield from ('lost', 'dropped', 'health', 'told_open', 'told_toggle')
            if self._has_limits:
                yield 'told_limited'

    def _examine_samples(
        self, samples: MessageRows, good: Flags, states: MessageRows, read: JointBlock
    ) -> None:
        """Add the crank's curve, and find samples at which a loop does not close."""
        decoded = self._samples.read(samples.data)
        self._curves.add_samples(samples.passed[decoded.good], decoded.numbers[decoded.good])
        if self._stale.limit:
            self._stale.add(samples.passed[good])
        for number, crank in self._cranks.items():
            own = crank.add_samples(samples.numbers, decoded.stamps, good, decoded.numbers)
            there = read.good & self._is_there(read.numbers, number)
            alone = own & ~np.isin(samples.logged, states.logged[there])
            at = samples.logged if self._rate else decoded.stamps
            angles, _ = crank.position_at(samples.numbers[alone] + 1, at[alone])
            _find_open_loop_spans(
                self._linkages[number], samples.passed[alone], angles, self._event_tracks['open']
            )

    def _examine_states(self, states: MessageRows, read: JointBlock) -> None:
        good = read.good
        numbers, passed = read.numbers[good], states.passed[good]
        if self._tells_toggles:
            for time in passed[np.isnan(numbers[:, 1]).all(axis=1)].tolist():
                self._event_tracks['toggle'].add(time, time)
        places = states.numbers[good]
        inputs, stamps = [], []
        for number, crank in self._cranks.items():
            angles, newest = crank.position_at(places, states.published[good])
            inputs.append((self._linkages[number].inputs, angles))
            stamps.append(newest)
        self._curves.add_states(passed, numbers, inputs)
        if stamps:
            # The oldest input of several linkages counts; 0 stands for none.
            stamp_rows = np.array(stamps)
            oldest = np.where(stamp_rows > 0, stamp_rows, _NEVER).min(axis=0)
            known = oldest < _NEVER
            self._curves.add_ages(passed[known], states.logged[good][known] - oldest[known])
        for number, silences in enumerate(self._silences):
            silences.add(passed[self._is_there(numbers, number)])

    def _is_there(self, numbers: Numbers, linkage: int) -> Flags:
        """Return which joint states contain a linkage."""
        present: Flags = ~np.isnan(numbers[:, 0, self._first_joints[linkage]])
        return present


def _count_bodies(closure: Closure) -> int:
    """Return how many bodies of a linkage are drawn."""
    if isinstance(closure, PlanarClosure):
        return len(closure.structure.links)
    assert isinstance(closure, SpaceClosure)
    return SpaceDrawing(closure).count
