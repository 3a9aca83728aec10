# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Faults, as timelines, at a rate and with each message."""

from math import isnan

from linkage_ros.kinematics import Status
from linkage_ros.messages import JointStateReader, JointStateWriter, Rejection
from linkage_ros.stages.faults import FaultChange, FaultEntry, Freeze, Injection
from linkage_ros.tick import Pipeline, TickLoop
import pytest

from ...support.scenes import scene_of

# Faults, as timelines: what is published before, during and after, and when they begin and end.
#
# The crank turns at 1 rad/s from 0, so that the crank's position is the time in seconds: the
# position in a tick shows which instant it belongs to.


MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000
TURNING = 'drive: {constant_rate: {rate: 1.0}}\neffects: {velocity: {}}\n'
CRANK = JointStateReader(['crank_joint'])
ROCKER = JointStateReader(['rocker_joint'])


def run(text, times, ask=None):
    """Tick at times, in [ms], and let somebody ask for faults; return a message for each."""
    pipeline = Pipeline(scene_of(text))
    injection = pipeline.injection
    messages = []
    for time in times:
        for change in (ask or {}).get(time, ()):
            injection.request_change(*change)
        injection.advance(BEGIN + time * MS)
        now = injection.tick_time(BEGIN + time * MS)
        messages.append(pipeline.tick(now).message)
    return messages


def angles(messages, reader=CRANK):
    """Return the angle in each message, in [mrad]; nothing where there is no message."""
    return [message and round(reader.read(message).angles[0] * 1e3, 6) for message in messages]


def stamps(messages):
    """Return the stamp in each message, in [ms] from the first tick; nothing for no message."""
    return [message and (CRANK.read(message).stamp - BEGIN) // MS for message in messages]


TIMES = [0, 10, 20, 30, 40, 50]
NOTHING = b''


def window(fault, at='[0.02]', seconds=0.02):
    return f'{TURNING}faults: {{mine: {{{fault}, at: {at}, seconds: {seconds}}}}}'


def test_silence_fault_publishes_no_message():
    assert angles(run(window('silence: {}'), TIMES)) == [0, 10, NOTHING, NOTHING, 40, 50]


def test_freeze_fault_repeats_the_reading_with_new_stamps():
    messages = run(window('freeze: {}'), TIMES)
    assert angles(messages) == [0, 10, 10, 10, 40, 50]
    assert stamps(messages) == TIMES
    assert [CRANK.read(message).rates for message in messages] == [(1.0,)] * 6


def test_freeze_fault_before_any_reading_publishes_nothing():
    assert angles(run(window('freeze: {}', '[0]'), TIMES)) == [NOTHING, NOTHING, 20, 30, 40, 50]


def test_stuck_joint_stands_still_while_others_move():
    sound = run(f'{TURNING}faults: {{mine: {{silence: {{}}}}}}', TIMES)
    messages = run(window('stuck: {joint: rocker_joint}'), TIMES)
    assert angles(messages) == TIMES
    true = angles(sound, ROCKER)
    assert angles(messages, ROCKER) == [true[0], true[1], true[1], true[1], true[4], true[5]]
    rates = [ROCKER.read(message).rates[0] for message in messages]
    assert [rate == 0.0 for rate in rates] == [False, False, True, True, False, False]


def test_broken_link_fault_gives_no_pose():
    pipeline = Pipeline(scene_of(window('broken_link: {link: coupler}')))
    looks = []
    for time in TIMES:
        pipeline.injection.advance(BEGIN + time * MS)
        looks += pipeline.tick(BEGIN + time * MS).states
    assert [look.position.status for look in looks] == [
        Status.CLOSED, Status.CLOSED, Status.INDETERMINATE, Status.INDETERMINATE,
        Status.CLOSED, Status.CLOSED,
    ]  # fmt: skip
    assert [look.reading is None for look in looks] == [False, False, True, True, False, False]


def test_not_a_number_fault_carries_the_last_sample_forward():
    text = 'effects: {velocity: {}}\nfaults: {mine: {not_a_number: {}, at: [0.02], seconds: 0.02}}'
    pipeline = Pipeline(scene_of(text))
    writer = JointStateWriter(['crank_joint'])
    refused, published = [], []
    for time in TIMES:
        now = BEGIN + time * MS
        pipeline.injection.advance(now)
        refused.append(pipeline.offer(writer.write(now, [2.0], [3.0]), now))
        published.append(pipeline.tick(now).message)
    why = Rejection.NOT_FINITE
    assert refused == [None, None, why, why, None, None]
    for message in published:
        assert not any(map(isnan, ROCKER.read(message).angles))
    crank = [look.crank.angles[0] for look in pipeline.tick(BEGIN + 60 * MS).states]
    assert crank == [pytest.approx(2.03)]


def test_time_jump_fault_shifts_the_stamps():
    messages = run(window('time_jump: {by: 5.0}'), TIMES)
    assert stamps(messages) == [0, 10, 5020, 5030, 40, 50]


def test_faults_start_and_end_at_the_first_tick_due():
    injection = Injection(scene_of(window('silence: {}', '[0.0151, 0.04]', 0.01)).faults)
    changes = {t: injection.advance(BEGIN + t * MS) for t in (0, 15, 16, 25, 26, 39, 40, 49, 50)}
    on, off = [FaultChange('mine', True)], [FaultChange('mine', False)]
    assert changes == {0: [], 15: [], 16: on, 25: [], 26: off, 39: [], 40: on, 49: [], 50: off}
    assert injection.injected == {'mine': 2}


def test_touching_fault_windows_count_twice():
    injection = Injection(scene_of(window('silence: {}', '[0.01, 0.02]', 0.01)).faults)
    assert injection.advance(BEGIN) == []
    assert injection.advance(BEGIN + 10 * MS) == [FaultChange('mine', True)]
    both = [FaultChange('mine', False), FaultChange('mine', True)]
    assert injection.advance(BEGIN + 20 * MS) == both
    assert injection.injected == {'mine': 2}


@pytest.mark.parametrize(
    ('at', 'seconds', 'on', 'times'),
    [
        # Windows of 5 ms from 2 and from 4 ms: the later end holds.
        ([0.002, 0.004], 0.005, range(2, 9), 1),
        # Three in a chain, not written in order.
        ([0.008, 0.002, 0.005], 0.004, range(2, 12), 1),
        # One that begins where the other ends is another one.
        ([0.002, 0.004], 0.002, range(2, 6), 2),
    ],
)
def test_overlapping_fault_windows_last_until_the_later_end(at, seconds, on, times):
    injection = Injection({'hang': FaultEntry('freeze', Freeze(), tuple(at), seconds)})
    seen = []
    for ms in range(15):
        injection.advance(BEGIN + ms * MS)
        if injection.switches['hang'].on:
            seen.append(ms)
    assert seen == list(on)
    assert injection.injected['hang'] == times


def test_requested_fault_lasts_until_switched_off():
    text = f'{TURNING}faults: {{mine: {{silence: {{}}}}}}'
    ask = {20: [('mine', True)], 30: [('mine', True)], 40: [('mine', False)]}
    assert angles(run(text, TIMES, ask)) == [0, 10, NOTHING, NOTHING, 40, 50]


def test_two_faults_act_at_once():
    quiet = 'quiet: {silence: {}, at: [0.03], seconds: 0.01}'
    late = 'late: {time_jump: {by: 1}, at: [0.01], seconds: 0.03}'
    messages = run(f'{TURNING}faults: {{{quiet}, {late}}}', TIMES)
    assert stamps(messages) == [0, 1010, 1020, NOTHING, 40, 50]


# Faults if ticks follow samples (`rate: 0`), as timelines of messages.
#
# The loop is the node's own, without the waiting for messages. The stamps of samples are 3 ms old.
# Times of faults are those of the node's clock, counted from the arrival of the first message,
# not those of stamps.


OLD = 3
MESSAGE_TIMES = [0, 10, 15, 21, 35, 39, 41, 50]
"""When samples come, in [ms]; the crank turns at 1 rad/s."""

IN_WINDOW = [21, 35, 39]
"""Those of them that come while a fault of `window` is on."""

WRITE = JointStateWriter(['crank_joint']).write


def fault_window(fault, at='[0.02]', seconds=0.02):
    return f'faults: {{mine: {{{fault}, at: {at}, seconds: {seconds}}}}}'


class Run:
    """A run at `rate: 0`: what is published, refused and told at each time a message comes."""

    def __init__(self, faults, times=MESSAGE_TIMES, burst=1):
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
    return {time: [] if time in silent else [time - OLD] for time in MESSAGE_TIMES}


def test_fault_starts_with_the_first_sample_due():
    run = Run(fault_window('silence: {}'))
    assert run.stamps() == of_samples(IN_WINDOW)
    assert run.changes == {21: [True], 41: [False]}
    assert run.counts.ticks == len(MESSAGE_TIMES), 'they are ticks, silent ones'


@pytest.mark.parametrize(('at', 'first'), [('[0.021]', 21), ('[0.0210001]', 35)])
def test_fault_is_active_at_its_start_instant(at, first):
    assert list(Run(fault_window('silence: {}', at, 1.0)).changes) == [first]


@pytest.mark.parametrize(('seconds', 'first'), [(0.02, 39), (0.0200001, 41)])
def test_fault_is_inactive_at_its_end_instant(seconds, first):
    # From 19 to 39 ms.
    assert list(Run(fault_window('silence: {}', '[0.019]', seconds)).changes) == [21, first]


def test_fault_between_two_samples_is_reported_without_effect():
    run = Run(fault_window('silence: {}', '[0.022]', 0.01))
    assert run.stamps() == of_samples()
    assert run.changes == {35: [True, False]}


def test_fault_times_follow_the_clock_not_the_stamps():
    # By its stamp, 18 ms, the sample that comes at 21 ms would be before the fault.
    assert 21 - OLD < 20
    assert Run(fault_window('silence: {}')).published[21] == []


def test_samples_of_one_burst_see_the_same_fault():
    run = Run(fault_window('silence: {}'), burst=3)
    assert {time: len(found) for time, found in run.published.items()} == {
        time: 0 if time in IN_WINDOW else 3 for time in MESSAGE_TIMES
    }
    assert run.changes == {21: [True], 41: [False]}


def test_frozen_reading_carries_the_stamps_of_samples():
    run = Run(fault_window('freeze: {}'))
    assert run.stamps() == of_samples()
    angles = {time: CRANK.read(found[0]).angles[0] for time, found in run.published.items()}
    frozen = {time: 15 if time in IN_WINDOW else time for time in MESSAGE_TIMES}
    assert angles == pytest.approx({t: (f - OLD) * 1e-3 for t, f in frozen.items()}, abs=1e-12)


def test_not_a_number_samples_make_no_ticks():
    run = Run(fault_window('not_a_number: {}'))
    assert run.stamps() == of_samples(IN_WINDOW)
    assert run.counts.ticks == len(MESSAGE_TIMES) - len(IN_WINDOW)
    assert run.counts.rejected[Rejection.NOT_FINITE] == len(IN_WINDOW)


def test_clock_set_back_rejects_samples_from_the_future():
    run = Run(fault_window('time_jump: {by: -5}'))
    assert run.stamps() == of_samples(IN_WINDOW)
    assert run.counts.clock_jumps == 1
    assert sum(run.counts.rejected.values()) == len(IN_WINDOW)


def test_clock_jump_ahead_keeps_the_sample_stamps():
    run = Run(fault_window('time_jump: {by: 0.05}'))
    assert run.stamps() == of_samples()
    assert run.counts.clock_jumps == 1, 'when it comes back'


def test_broken_link_publishes_no_sample():
    run = Run(fault_window('broken_link: {link: coupler}'))
    assert run.stamps() == of_samples(IN_WINDOW)
    assert sum(run.counts.unclosed.values()) == len(IN_WINDOW)
