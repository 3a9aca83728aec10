# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A tick judges each sample when it takes it from the queue, and accounts for all of them.

The queue is the test's, and its clock goes on by a step with every look at it.
"""

from functools import partial
from itertools import count
from time import time_ns

from linkage_ros.description import load, parse_scene
from linkage_ros.kinematics import Grid
from linkage_ros.messages import JointStateWriter, NANOSECONDS, Rejection
from linkage_ros.replay import own_joint_states
from linkage_ros.resources import named_file
from linkage_ros.tick import Pipeline, TickLoop
import pytest

MS = 1_000_000
BEGIN = 1_700_000_000 * NANOSECONDS
FOUR_BAR = b'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}'
HEXAPOD = named_file('hexapod', 'linkages')
ONE = 'linkage: l.yaml\n'
TWO = 'linkages: [{name: left, linkage: l.yaml}, {name: right, linkage: l.yaml}]\n'
TWO_FILES = {'scene.yaml': TWO.encode(), 'linkage_1.yaml': FOUR_BAR, 'linkage_2.yaml': FOUR_BAR}


class Rig:
    """A tick loop behind a queue of the test's; a clock that goes on by 1 ms with every look."""

    def __init__(self, text=ONE, rate=50, drive='{max_lead: 0.0}', **options):
        text += f'rate: {rate}\ndrive: {{topic: {drive}}}\n'
        of = ['linkage.yaml'] if 'linkages' not in text else ['linkage_1.yaml', 'linkage_2.yaml']
        files = {'scene.yaml': text.encode(), **dict.fromkeys(of, FOUR_BAR)}
        scene = parse_scene('t', 't', files)
        self.queue, self.published = [], []
        self.loop = TickLoop(
            partial(Pipeline, scene), self._take, self.published.append, **options
        )
        self.tick = self.loop.tick_at if rate else self.loop.tick_samples
        self._numbers = count(1)
        self.now = BEGIN

    def _take(self):
        return self.queue.pop(0) if self.queue else None

    def clock(self):
        self.now += MS
        return self.now

    def send(self, stamp=BEGIN, angle=1.0, names=('crank_joint',), number=None, received=None):
        message = JointStateWriter(names).write(stamp, [angle] * len(names), [0.0] * len(names))
        number = next(self._numbers) if number is None else number
        info = {'source_timestamp': stamp, 'publication_sequence_number': number}
        if received is not None:
            info['received_timestamp'] = received
        self.queue.append((message, info))

    def counts(self):
        """Return received, used, superseded, ignored and rejected, which must close."""
        c = self.loop.counts
        rejected = sum(c.rejected.values())
        assert c.received == c.used + c.stale + c.superseded + c.ignored + rejected
        return c.received, c.used, c.superseded, c.ignored, rejected


@pytest.mark.parametrize('rate', [50, 0])
def test_sample_arriving_during_a_tick_is_not_future(rate):
    rig = Rig(rate=rate)
    for index in range(33):
        rig.send(BEGIN + (index + 1) * MS)  # stamped at the instant at which it is taken
    rig.tick(BEGIN, rig.clock)
    assert rig.loop.counts.rejected[Rejection.STAMP_FUTURE] == 0
    assert rig.counts() == ((33, 33, 0, 0, 0) if rate == 0 else (33, 1, 32, 0, 0))


def test_tick_keeps_its_starting_time():
    rig = Rig()
    rig.send(BEGIN + MS)
    rig.tick(BEGIN, rig.clock)
    (state,) = rig.published
    assert int.from_bytes(state[4:8], 'little') * NANOSECONDS == BEGIN
    rig.tick(BEGIN + 2 * MS, rig.clock)
    assert rig.loop.counts.clock_jumps == 0


def test_clock_jump_during_a_tick_is_counted_next_tick():
    rig = Rig()
    rig.send(BEGIN - 5 * MS)
    rig.tick(BEGIN, lambda: BEGIN - 50 * MS)
    assert rig.counts() == (1, 1, 0, 0, 0)
    rig.tick(BEGIN - 49 * MS)
    assert rig.loop.counts.clock_jumps == 1


TAKEN = {
    'one': ([('crank_joint',)], (1, 1, 0, 0, 0)),
    'a newer one': ([('crank_joint',)] * 3, (3, 1, 2, 0, 0)),
    'of another joint': ([('elbow',)], (1, 0, 0, 1, 0)),
    'among others': ([('elbow', 'crank_joint')], (1, 1, 0, 0, 0)),
    'mixed': ([('elbow',), ('crank_joint',), ('wrist',)], (3, 1, 0, 2, 0)),
    'twice in one': ([('crank_joint', 'crank_joint')], (1, 0, 0, 0, 1)),
    'nothing': ([], (0, 0, 0, 0, 0)),
}


@pytest.mark.parametrize('kind', TAKEN)
def test_sample_counts_add_up_to_received(kind):
    messages, counts = TAKEN[kind]
    rig = Rig()
    for names in messages:
        rig.send(names=names)
    rig.tick(BEGIN)
    assert rig.counts() == counts


def test_each_of_two_linkages_uses_its_newest_sample():
    left, right = ('left_crank_joint',), ('right_crank_joint',)
    rig = Rig(TWO)
    for names in (left, left, right, ('elbow',), left + right, right):
        rig.send(names=names)
    rig.tick(BEGIN)
    # The last two are used, one by each; the first three are not.
    assert rig.counts() == (6, 2, 3, 1, 0)
    rig.tick(BEGIN + MS)
    assert rig.counts() == (6, 2, 3, 1, 0)


def test_own_messages_of_one_linkage_are_ignored():
    rig = Rig(TWO, is_own=own_joint_states(parse_scene('t', 't', TWO_FILES)))
    rig.send(names=('left_crank_joint',))
    rig.tick(BEGIN)
    rig.send(BEGIN + MS, names=('right_crank_joint',))
    rig.tick(BEGIN + MS)
    counts = rig.counts()
    alone, both = rig.published
    assert (b'left' in alone, b'right' in alone) == (True, False)
    for message in (alone, both):
        rig.queue.append((message, {'source_timestamp': BEGIN}))
    rig.tick(BEGIN + 2 * MS)
    assert rig.counts() == counts == (2, 2, 0, 0, 0)


def test_looped_playback_rejects_no_sample():
    """As `ros2 bag play --loop --clock`: samples and /clock come a little before one another."""
    rig = Rig()
    rig.send(BEGIN + 900 * MS)
    rig.tick(BEGIN + 900 * MS)
    rig.send(BEGIN)  # of the second pass, before its /clock
    rig.tick(BEGIN + 910 * MS)
    rig.send(BEGIN + 915 * MS, received=time_ns())  # of the first pass, after it
    rig.send(BEGIN + 5 * MS)
    rig.tick(BEGIN + 10 * MS)
    assert rig.loop.counts.clock_jumps == 1
    assert rig.counts() == (4, 2, 2, 0, 0)
    assert rig.loop.newest_stamp == BEGIN + 5 * MS
    rig.send(BEGIN + 915 * MS, received=time_ns())  # of the future indeed
    rig.send(BEGIN)
    rig.tick(BEGIN + 20 * MS)
    assert rig.loop.counts.rejected[Rejection.STAMP_FUTURE] == 1
    assert rig.counts() == (6, 2, 2, 0, 2)


# (scene, [(joints, age of the stamp in ms)] of a tick, (used, stale, superseded)) at 200 ms.
AGES = {
    'young': (ONE, [(('crank_joint',), 5)], (1, 0, 0)),
    'at the limit': (ONE, [(('crank_joint',), 200)], (1, 0, 0)),
    'beyond it': (ONE, [(('crank_joint',), 201)], (0, 1, 0)),
    'a clock that differs': (ONE, [(('crank_joint',), 100_000)], (0, 1, 0)),
    'several, after a stall': (ONE, [(('crank_joint',), age) for age in (400, 300, 9)], (1, 0, 2)),
    'several, all too old': (ONE, [(('crank_joint',), age) for age in (402, 401)], (0, 1, 1)),
    'of two linkages one': (
        TWO, [(('left_crank_joint',), 9), (('right_crank_joint',), 300)], (1, 1, 0),
    ),
    'of two linkages both': (TWO, [(('left_crank_joint', 'right_crank_joint'), 300)], (0, 1, 0)),
}  # fmt: skip


@pytest.mark.parametrize('kind', AGES)
def test_sample_too_old_on_arrival_is_counted_stale(kind):
    text, messages, expected = AGES[kind]
    rig = Rig(text)
    for names, age in messages:
        rig.send(BEGIN - age * MS, names=names)
    rig.tick(BEGIN)
    c = rig.loop.counts
    assert (c.used, c.stale, c.superseded) == expected
    assert rig.counts()[0] == len(messages)
    assert bool(rig.published) == bool(c.used)
    assert ('stale' in rig.loop.sample_counts_text) == bool(c.stale)
    assert ('without the crank' in rig.loop.sample_counts_text) == bool(c.ignored)
    if 'differs' in kind:
        assert c.stale_age == 100_000 * MS


def test_rate_0_uses_an_old_sample_at_its_stamp():
    rig = Rig(rate=0)
    rig.send(BEGIN - 100_000 * MS)
    rig.tick(BEGIN)
    assert (rig.loop.counts.used, rig.loop.counts.stale, len(rig.published)) == (1, 0, 1)


@pytest.mark.parametrize('stamp', [0, 1, BEGIN - 100_000 * MS, BEGIN + 100_000 * MS])
def test_arrival_stamps_replace_any_message_stamp(stamp):
    rig = Rig(drive='{stamp: arrival}')
    rig.send(stamp)
    rig.tick(BEGIN)
    rig.send(stamp, 2.0)
    rig.tick(BEGIN + 10 * MS)
    assert rig.counts() == (2, 2, 0, 0, 0)
    assert rig.loop.newest_stamp == BEGIN + 10 * MS
    assert len(rig.published) == 2


def test_tick_takes_at_most_one_queue_of_messages():
    # One that sends faster than messages are read would hold up the tick for ever.
    rig = Rig(depth=10)
    rig.queue = Endless(rig.send)
    for tick in range(1, 4):
        rig.tick(BEGIN + tick * MS)
        assert (rig.loop.counts.ticks, rig.loop.counts.received) == (tick, 10 * tick)


class Endless(list):
    """A queue in which another message stands whenever one looks."""

    def __init__(self, send):
        super().__init__()
        self._send = send

    def __bool__(self):
        if not len(self):
            self._send()
        return True


NUMBERED = {
    'all': ([1, 2, 3], 0),
    'from the middle on': ([7, 8], 0),
    'two gaps': ([1, 4, 5, 7], 3),
    'a publisher that begins anew': ([8, 9, 1, 2], 0),
    'none that is numbered': ([0, 0], None),
}


@pytest.mark.parametrize('kind', NUMBERED)
def test_missing_sequence_numbers_count_lost_messages(kind):
    numbers, missed = NUMBERED[kind]
    rig = Rig()
    for number in numbers:
        rig.send(number=number)
    rig.tick(BEGIN)
    assert rig.loop.missed_messages == missed
    assert ('lost before' in rig.loop.sample_counts_text) == bool(missed)
    rig.loop.had_several_publishers = True
    assert rig.loop.missed_messages is None, 'their numbers go apart'


CRANK, LEFT, RIGHT = ('crank_joint',), ('left_crank_joint',), ('right_crank_joint',)
ELBOW, BOTH = ('elbow',), LEFT + RIGHT
# (scene, [(joints, number that the publisher gave the message)], how often they went back).
PUBLISHERS = {
    'one': (ONE, [(CRANK, 1), (CRANK, 2), (CRANK, 5)], 0),
    'one that begins anew': (ONE, [(CRANK, 8), (CRANK, 1), (CRANK, 2), (CRANK, 9)], 1),
    'two in step': (ONE, [(CRANK, 1), (CRANK, 1), (CRANK, 2), (CRANK, 2)], 2),
    'two, one of them long there': (ONE, [(CRANK, 70), (CRANK, 1), (CRANK, 71), (CRANK, 2)], 2),
    'two, and one names other joints too': (
        ONE, [(ELBOW, 1), (CRANK, 2), (CRANK, 1), (CRANK, 3), (CRANK, 2)], 2,
    ),
    'two, one of other joints': (ONE, [(CRANK, 7), (ELBOW, 1), (CRANK, 8), (ELBOW, 2)], 0),
    'two, one of which is rejected': (
        ONE, [(CRANK, 7), (CRANK * 2, 1), (CRANK, 8), (CRANK * 2, 2)], 2,
    ),
    'none that is numbered': (ONE, [(CRANK, 0), (CRANK, 0)], 0),
    'one for each of two linkages': (TWO, [(LEFT, 7), (RIGHT, 1), (LEFT, 8), (RIGHT, 2)], 0),
    'one for both': (TWO, [(BOTH, 1), (BOTH, 2)], 0),
    'two for one of two linkages': (TWO, [(LEFT, 7), (RIGHT, 1), (LEFT, 1), (LEFT, 8)], 1),
}  # fmt: skip


@pytest.mark.parametrize('kind', PUBLISHERS)
def test_sequence_numbers_reveal_two_crank_publishers(kind):
    text, messages, expected = PUBLISHERS[kind]
    rig = Rig(text)
    for names, number in messages:
        rig.send(names=names, number=number)
    rig.tick(BEGIN)
    assert rig.loop.counts.interleaved == expected
    rig.counts()


@pytest.mark.parametrize(('numbers', 'expected'), [([1, 2, 3], 0), ([9, 1, 10, 2, 11], 2)])
def test_sequence_numbers_reveal_another_joint_state_publisher(numbers, expected):
    rig = Rig(is_own=lambda message: b'rocker' in message)
    for number in numbers:
        rig.send(names=('coupler_joint', 'rocker_joint'), number=number)
        rig.send()
    rig.tick(BEGIN)
    assert rig.loop.counts.own_interleaved == expected
    assert rig.loop.counts.interleaved == 0
    assert rig.counts()[0] == len(numbers)


def test_hexapod_cells_are_computed_after_publishing(monkeypatch):
    closure, done, waiting = load('hexapod'), [], []
    look = Grid.look_ahead
    monkeypatch.setattr(Grid, 'look_ahead', lambda *given: done.append('cells') or look(*given))
    files = {'scene.yaml': b'linkage: l.yaml\n', 'linkage.yaml': HEXAPOD.read_bytes()}
    made = parse_scene('t', 't', files)
    loop = TickLoop(
        lambda: Pipeline(made), lambda: waiting.pop() if waiting else None,
        lambda _: done.append('published'),
    )  # fmt: skip
    loop.tick_at(BEGIN)
    assert done == []
    legs = JointStateWriter(closure.input_names)
    message = legs.write(BEGIN, closure.linkage.pose.inputs, [0.01] * 6)
    for index in range(1, 4):
        waiting.append((message, {'source_timestamp': 0}))
        loop.tick_at(BEGIN + index * MS)
    assert done == ['published', 'cells'] * 3
