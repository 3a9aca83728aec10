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
Faults where the ticks are samples (`rate: 0`), as timelines of messages that come.

The loop is the node's own; only what waits for messages is left out. Samples come with stamps that
are 3 ms old. Times of faults are those of the node's clock, counted from when the first message
came, and not those of stamps.
"""

from __future__ import annotations

from linkage_ros.messages.joint_state import JointStateReader, JointStateWriter, Rejection
from linkage_ros.pipeline import Pipeline
from linkage_ros.ros.tick_loop import TickLoop
import pytest

from ..support.scenes import scene_of

MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000
OLD = 3
TIMES = [0, 10, 15, 21, 35, 39, 41, 50]
"""When samples come, in [ms]; the crank turns at 1 rad/s."""
IN_WINDOW = [21, 35, 39]
"""Those of them that come while a fault of `window` is on."""
CRANK = JointStateReader(['crank_joint'])
WRITE = JointStateWriter(['crank_joint']).write


def window(fault, at='[0.02]', seconds=0.02):
    return f'faults: {{mine: {{{fault}, at: {at}, seconds: {seconds}}}}}'


class Run:
    """A run at `rate: 0`: what is published, refused and told at each time a message comes."""

    def __init__(self, faults, times=TIMES, burst=1):
        scene = scene_of(f'rate: 0\npublish_input: true\n{faults}')
        waiting, self.messages, self.changes, self.published = [], [], {}, {}
        kept = []

        def build():
            pipeline = Pipeline(scene, injection=kept[0] if kept else None)
            kept[:] = [pipeline.injection]
            return pipeline

        loop = TickLoop(
            build,
            lambda: waiting.pop(0) if waiting else None,
            self.messages.append,
            publish_change=self._changed,
        )
        self.counts = loop.counts
        for self.time in times:
            for k in range(burst):
                stamp = BEGIN + (self.time - OLD) * MS + k
                sample = WRITE(stamp, [(self.time - OLD) * 1e-3], [1.0])
                waiting.append((sample, {'source_timestamp': stamp}))
            self.messages.clear()
            loop.tick_samples(BEGIN + self.time * MS)
            self.published[self.time] = list(self.messages)

    def _changed(self, change):
        self.changes.setdefault(self.time, []).append(change.on)
        return b''

    def stamps(self):
        """Return the stamp of each message, in [ms] from the first time, by when it came."""
        return {
            time: [(CRANK.read(message).stamp - BEGIN) / MS for message in messages]
            for time, messages in self.published.items()
        }


def of_samples(silent=()):
    return {time: [] if time in silent else [time - OLD] for time in TIMES}


def test_a_fault_begins_with_the_first_sample_that_is_not_before_its_time():
    run = Run(window('silence: {}'))
    assert run.stamps() == of_samples(IN_WINDOW)
    assert run.changes == {21: [True], 41: [False]}
    assert run.counts.ticks == len(TIMES), 'they are ticks, silent ones'


@pytest.mark.parametrize(('at', 'first'), [('[0.021]', 21), ('[0.0210001]', 35)])
def test_on_its_instant_it_has_begun(at, first):
    assert list(Run(window('silence: {}', at, 1.0)).changes) == [first]


@pytest.mark.parametrize(('seconds', 'first'), [(0.02, 39), (0.0200001, 41)])
def test_on_its_end_it_has_ended(seconds, first):
    # From 19 to 39 ms.
    assert list(Run(window('silence: {}', '[0.019]', seconds)).changes) == [21, first]


def test_a_fault_between_two_samples_is_told_and_touches_none():
    run = Run(window('silence: {}', '[0.022]', 0.01))
    assert run.stamps() == of_samples()
    assert run.changes == {35: [True, False]}


def test_the_times_are_those_of_the_clock_and_not_of_the_stamps():
    # By its stamp, 18 ms, the sample that comes at 21 ms would be before the fault.
    assert 21 - OLD < 20
    assert Run(window('silence: {}')).published[21] == []


def test_of_samples_that_come_together_all_see_the_same():
    run = Run(window('silence: {}'), burst=3)
    assert {time: len(found) for time, found in run.published.items()} == {
        time: 0 if time in IN_WINDOW else 3 for time in TIMES
    }
    assert run.changes == {21: [True], 41: [False]}


def test_a_frozen_reading_has_the_stamps_of_the_samples():
    run = Run(window('freeze: {}'))
    assert run.stamps() == of_samples()
    angles = {time: CRANK.read(found[0]).angles[0] for time, found in run.published.items()}
    frozen = {time: 15 if time in IN_WINDOW else time for time in TIMES}
    assert angles == pytest.approx({t: (f - OLD) * 1e-3 for t, f in frozen.items()}, abs=1e-12)


def test_samples_that_are_no_numbers_are_no_ticks():
    run = Run(window('not_a_number: {}'))
    assert run.stamps() == of_samples(IN_WINDOW)
    assert run.counts.ticks == len(TIMES) - len(IN_WINDOW)
    assert run.counts.rejected[Rejection.NOT_FINITE] == len(IN_WINDOW)


def test_a_clock_that_is_set_back_refuses_samples_that_come_from_its_future():
    run = Run(window('time_jump: {by: -5}'))
    assert run.stamps() == of_samples(IN_WINDOW)
    assert run.counts.clock_jumps == 1
    assert sum(run.counts.rejected.values()) == len(IN_WINDOW)


def test_a_clock_that_jumps_ahead_leaves_the_stamps_alone():
    run = Run(window('time_jump: {by: 0.05}'))
    assert run.stamps() == of_samples()
    assert run.counts.clock_jumps == 1, 'when it comes back'


def test_a_link_that_is_broken_leaves_samples_without_a_pose():
    run = Run(window('broken_link: {link: coupler}'))
    assert run.stamps() == of_samples(IN_WINDOW)
    assert sum(run.counts.unclosed.values()) == len(IN_WINDOW)
