# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A recorded run, replayed, gives the same bytes; so do runs that an earlier version recorded."""

from hashlib import sha256
import json
import math
from math import sin, tau
from pathlib import Path

from linkage_ros.bag import BagWriter, read_bag, Recorder, RUN_FILE, Storage, Topic
from linkage_ros.errors import BagError
from linkage_ros.messages import JointStateWriter
from linkage_ros.replay import recorded_scene, replay_ticks
from linkage_ros.tick import Pipeline
import pytest

from ..support.commands import linkage

SECOND = 1_000_000_000
LINKAGE = b'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n'
RUN = b'{"scene": "s", "crank_topic": "/crank", "joint_states_topic": "/joint_states"}'
WITH_MOTION = RUN.replace(b'}', b', "extra_topics": ["/motion"]}')
SHARED = RUN.replace(b'/crank', b'/joint_states')
CRANK = JointStateWriter(['other', 'crank_joint'])


def sample(stamp: int, angle: float, rate: float) -> bytes:
    return CRANK.write(stamp, (0.0, angle), (0.0, rate))


def files(scene: str, run: bytes = RUN, linkage: bytes = LINKAGE) -> dict[str, tuple[str, bytes]]:
    return {
        'scene.yaml': ('application/yaml', f'linkage: l.yaml\n{scene}'.encode()),
        'linkage.yaml': ('application/yaml', linkage),
        RUN_FILE: ('application/json', run),
    }


class Run:
    """A tick by hand: offers and ticks as the node's tick loop makes them, recorded."""

    def __init__(
        self,
        folder: Path,
        scene: str,
        run: bytes = RUN,
        storage: Storage | None = None,
        linkage: bytes = LINKAGE,
    ) -> None:
        said = json.loads(run)
        names = [name for key, name in said.items() if key.endswith('_topic')]
        names += said.get('extra_topics', [])
        topics = [Topic(name, 'sensor_msgs/msg/JointState', '', '') for name in names]
        self.recorder = Recorder(BagWriter(folder, topics, files(scene, run, linkage), storage))
        self.folder = folder
        # The scene as the bag has it: what is tested is the order and the times, not the loading.
        self.scene = recorded_scene(read_bag(folder, allow_truncated=True))
        self.pipeline = Pipeline(self.scene)
        self.published: list[bytes] = []
        self.motions: list[bytes] = []

    def offer(self, now: int, message: bytes) -> None:
        self.recorder.offer(0, now, now - 1000, message)
        self.pipeline.offer(message, now)

    def tick(self, now: int, at: int, drop: str = '') -> None:
        tick = self.pipeline.tick(at)
        message, extras = tick.message, tick.extras
        if message and drop != 'joint state':
            self.recorder.offer(1, now, at, message)
            self.published.append(message)
        for motion in extras if drop != 'motion' else ():
            self.recorder.offer(2, now, at, motion)
            self.motions.append(motion)

    def replayed(self) -> list[tuple[bytes, bytes]]:
        self.recorder.stop()
        bag = read_bag(self.folder)
        return [(r.recorded, r.tick.message) for r in replay_ticks(bag, recorded_scene(bag))]


@pytest.mark.parametrize(
    'scene',
    [
        'effects: {velocity: {}}\n',
        'angles: wrapped\n',
        'drive: {topic: {carry_forward: false}}\n',
    ],
)
def test_ticks_on_a_clock_replay_to_the_same_bytes(tmp_path, scene):
    run = Run(tmp_path / 'bag', scene)
    for k in range(2000):
        now = SECOND + k * 1_000_000
        if k % 2 == 0 and not 900 < k < 1200:  # silence, longer than max_age, then samples again
            run.offer(now, sample(now - 137_000, tau * k * 1e-3, tau))
        if k % 17 == 0:  # what the tick refuses is in the bag too
            run.offer(now, sample(now + 10 * SECOND, 1.0, 1.0))
            run.offer(now, b'\x00\x01\x00\x00rubbish')
        run.tick(now, now)
    assert 1500 < len(run.published) < 2000
    assert run.replayed() == [(message, message) for message in run.published]


@pytest.mark.parametrize('beyond', ['publish', 'silent'])
@pytest.mark.parametrize('effects', ['{}', '{velocity: {}}'])
def test_ticks_beyond_limits_replay_to_the_same_bytes(tmp_path, beyond, effects):
    """The crank swings out of its limits and back, four times."""
    limited = LINKAGE.replace(b'}', b', input: {limits: [0.5, 1.5]}}')
    scene = f'effects: {effects}\nbeyond_limits: {beyond}\n'
    run = Run(tmp_path / 'bag', scene, linkage=limited)
    for k in range(2000):
        now = SECOND + k * 1_000_000
        run.offer(now, sample(now, 1.0 + 0.8 * sin(4.0 * tau * k / 2000), 0.0))
        run.tick(now, now)
    assert len(run.published) == 2000 if beyond == 'publish' else 500 < len(run.published) < 1500
    assert [pair for pair in run.replayed() if pair[0]] == [
        (message, message) for message in run.published
    ]


@pytest.mark.parametrize('compression', ['none', 'lz4', 'zstd'])
def test_bag_in_several_files_replays_as_one(tmp_path, compression):
    storage = Storage(split_seconds=0.3, compression=compression)
    run = Run(tmp_path / 'bag', 'effects: {velocity: {}}\n', storage=storage)
    for k in range(2000):
        now = SECOND + k * 1_000_000
        # A sample may be the last of a file, and its joint state the first of the next.
        if k % 2 == 0:
            run.offer(now - 500_000, sample(now - 637_000, tau * k * 1e-3, tau))
        run.tick(now, now)
    assert run.replayed() == [(message, message) for message in run.published]
    assert len(read_bag(run.folder).files) == 7


def test_ticks_on_samples_replay_to_the_same_bytes(tmp_path):
    run = Run(tmp_path / 'bag', 'rate: 0\neffects: {velocity: {}}\n')
    for k in range(500):
        # Solved for the sample's stamp, which is older than the moment of the tick.
        stamp = SECOND + k * 1_000_000
        run.offer(stamp + 250_000, sample(stamp, 0.01 * k, 10.0))
        run.tick(stamp + 250_000, stamp)
    assert len(run.published) == 500
    assert run.replayed() == [(message, message) for message in run.published]


def test_another_scene_replays_to_other_bytes(tmp_path):
    run = Run(tmp_path / 'bag', 'effects: {velocity: {}}\n')
    run.offer(SECOND, sample(SECOND, 1.0, 1.0))
    run.tick(SECOND, SECOND)
    run.recorder.stop()
    other = Run(tmp_path / 'other', 'angles: wrapped\n')
    (again,) = replay_ticks(read_bag(run.folder), other.scene)
    assert again.tick.message != again.recorded


def test_motions_replay_beside_joint_states_across_clock_jumps(tmp_path):
    run = Run(tmp_path / 'bag', 'effects: {acceleration: {}}\n', WITH_MOTION)
    for begin in (5 * SECOND, 2 * SECOND):
        for k in range(300):
            now = begin + k * 1_000_000
            run.offer(now, sample(now - 200_000, 0.05 * k, 50.0))
            run.tick(now, now)
        run.pipeline = Pipeline(run.scene)  # as the tick loop does where time jumps back
    assert run.replayed() == [(message, message) for message in run.published]
    again = list(replay_ticks(read_bag(run.folder), run.scene))
    assert [each.recorded_extras for each in again] == [(motion,) for motion in run.motions]
    assert [each.tick.extras for each in again] == [(motion,) for motion in run.motions]
    assert len(run.motions) == 600


DROPS = ['', 'motion', 'joint state', '', 'joint state', 'motion', 'motion', '']


# Three samples of one stamp, and one for each tick; then a sample for every tenth tick only.
@pytest.mark.parametrize(('ticks_at_first', 'per_sample'), [(3, 1), (1, 10)])
def test_dropped_messages_shift_no_replayed_ticks(tmp_path, ticks_at_first, per_sample):
    run = Run(tmp_path / 'bag', 'rate: 0\neffects: {acceleration: {}}\n', WITH_MOTION)
    drops = 4 * DROPS
    for k, drop in enumerate(drops):
        stamp = SECOND + max(k + 1 - ticks_at_first, 0) * 1_000_000
        if k % per_sample == 0:
            run.offer(stamp + 250_000, sample(stamp, 0.9 * k, 900.0))
        run.tick(stamp + 250_000, stamp, drop)
    run.recorder.stop()
    again = list(replay_ticks(read_bag(run.folder), run.scene))
    assert [bool(each.recorded) for each in again] == [drop != 'joint state' for drop in drops]
    motions = [each.recorded_extras != (b'',) for each in again]
    assert motions == [drop != 'motion' for drop in drops]
    for each in again:
        assert each.recorded in (b'', each.tick.message)
        assert each.recorded_extras in ((b'',), each.tick.extras)


def test_crank_and_joint_states_share_one_replayed_topic(tmp_path):
    # As where joint_state_broadcaster feeds the node, and the node publishes beside it.
    run = Run(tmp_path / 'bag', 'effects: {velocity: {}}\n', SHARED)
    for k in range(200):
        now = SECOND + k * 1_000_000
        run.offer(now, sample(now, 0.05 * k, 50.0))
        run.tick(now, now)
    assert len(run.published) == 200
    assert run.replayed() == [(message, message) for message in run.published]


@pytest.mark.parametrize('missing', ['scene.yaml', 'linkage.yaml', RUN_FILE])
def test_bag_without_scene_or_run_json_is_refused(tmp_path, missing):
    attached = {name: data for name, data in files('').items() if name != missing}
    BagWriter(tmp_path / 'bag', [], attached).close()
    with pytest.raises(BagError, match=missing):
        recorded_scene(read_bag(tmp_path / 'bag'))


@pytest.mark.parametrize('damaged', [b'{"scene": 3', b'{"scene": 3}', b'[]', b'"scene"', b'\xff'])
def test_damaged_run_json_is_refused(tmp_path, damaged):
    attached = {**files(''), RUN_FILE: ('application/json', damaged)}
    BagWriter(tmp_path / 'bag', [], attached).close()
    with pytest.raises(BagError, match='damaged'):
        recorded_scene(read_bag(tmp_path / 'bag'))


# Bags that an earlier version has recorded replay to the same bytes.
#
# They were recorded on 22 November 2026, before linkages were compiled: all shipped linkages with
# one input and a closed form, through their ranges and a little beyond; forces, friction and play;
# a torque drive; a cylinder behind a delay. On 25 November 51 of the 638 messages of the gallery
# were written anew, those of andrews_squeezer, double_rocker and jansen_leg: a dyad's differences
# start from the one that cancels least, and positions changed by up to 8.9e-16 rad. On 26 November
# 203 of the 225 pin forces of worn_press: they come from an elimination of our own.


FOLDER = Path(__file__).parent / 'recorded'
RECORDED_BY = 'e67be17d07eb4374'
"""Digest of the functions of the machine that recorded them; others have other last digits."""


def functions_of_this_machine() -> str:
    """Return what sine, cosine and arc tangent come to at many places."""
    places = [0.001 * i - 5.0 for i in range(10_000)]
    values = [f(x).hex() for f in (math.sin, math.cos, math.atan) for x in places]
    return sha256(''.join(values).encode()).hexdigest()[:16]


@pytest.mark.skipif(functions_of_this_machine() != RECORDED_BY, reason='another C library')
@pytest.mark.parametrize('name', sorted(path.stem for path in FOLDER.glob('*.mcap')))
def test_bag_of_an_earlier_version_replays_to_same_bytes(name):
    done = linkage(FOLDER, 'replay', f'{name}.mcap')
    assert done.returncode == 0, done.stdout + done.stderr
    (row,) = [
        line.split() for line in done.stdout.splitlines() if line.startswith('/joint_states')
    ]
    recorded, same = map(int, row[1:3])
    assert recorded == same > 30
