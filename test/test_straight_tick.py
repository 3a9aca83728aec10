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

"""The usual tick, written as one function, does to the last bit what the plain steps do."""

from __future__ import annotations

from pathlib import Path

from linkage_ros.joint_state import JointStateWriter
from linkage_ros.pipeline import Look, Pipeline
import pytest

from .support.scenes import pipeline_of, scene_of

ROOT = Path(__file__).parents[1]
GALLERY = sorted((ROOT / 'config' / 'linkages').glob('*.yaml'))
BEGIN, MS = 1_700_000_000_000_000_000, 1_000_000
TICKS = 400
EFFECTS = {
    'positions': '{}',
    'rates': '{velocity: {}}',
    'accelerations': '{acceleration: {}}',
    'play': '{velocity: {}, backlash: {play: 0.01}}',
    'sensors': '{jitter: {seconds: 0.003}, dropout: {probability: 0.1}, delay: {seconds: 0.002}}',
}
DRIVES = {
    'carried': 'drive: {topic: {max_age: 0.01}}',
    'held': 'drive: {topic: {carry_forward: false}}',
    'turning': 'drive: {constant_rate: {rate: 40.0}}',
}


def pipeline(linkage, scene):
    return pipeline_of(scene, linkage)


def ticks(work):
    """Yield ticks of a crank that turns, and of one that falls silent for a while."""
    names = work.lines[0].member.inputs
    write = JointStateWriter(names).write
    for number in range(TICKS):
        now = BEGIN + number * MS
        if work.topic and number % 3 == 0 and not 200 < number < 230:
            angles = [0.04 * number + 0.3 * i for i in range(len(names))]
            assert work.offer(write(now, angles, [40.0] * len(names)), now) is None
        yield work.tick(now)


@pytest.mark.parametrize('drive', DRIVES)
@pytest.mark.parametrize('effects', EFFECTS)
@pytest.mark.parametrize('file', GALLERY, ids=lambda file: file.stem)
def test_both_publish_the_same_bytes(file, effects, drive):
    scene = f'{DRIVES[drive]}\neffects: {EFFECTS[effects]}'
    straight = pipeline(file.read_bytes(), scene)
    # A fault of the mechanism, though it never begins, wants the plain steps.
    link = next(name for name in straight.closures[0].linkage.links if name != 'ground')
    plain = pipeline(
        file.read_bytes(), f'{scene}\nfaults: {{x: {{broken_link: {{link: {link}}}}}}}'
    )
    for one, other in zip(ticks(straight), ticks(plain), strict=True):
        assert (one.message, one.extras) == (other.message, other.extras)
        for look, beside in zip(one.looks, other.looks, strict=True):
            assert (look.crank, look.reading) == (beside.crank, beside.reading)
        assert all(isinstance(seen, Look) for seen in other.seen)


@pytest.mark.parametrize('effects', EFFECTS)
def test_the_usual_tick_is_straight(effects):
    work = pipeline(
        (ROOT / 'config' / 'linkages' / 'four_bar.yaml').read_bytes(),
        f'{DRIVES["turning"]}\neffects: {EFFECTS[effects]}',
    )
    plain = [number for number, tick in enumerate(ticks(work)) if isinstance(tick.seen[0], Look)]
    # The first, and those at which an angle passes half a turn.
    assert plain[0] == 0
    assert len(plain) <= 1 + 2 * TICKS * 0.04 / 6.28


def test_a_reset_compiles_nothing(monkeypatch):
    scene = scene_of('drive: {constant_rate: {rate: 1.0}}')
    first = Pipeline(scene)
    message = first.tick(BEGIN).message
    monkeypatch.setattr('linkage_ros.kinematics.compiled.linkage.traced', None)
    monkeypatch.setattr('linkage_ros.kinematics.compiled.linkage.python_body', None)
    monkeypatch.setattr('builtins.exec', None)
    assert Pipeline(scene, first.closures).tick(BEGIN).message == message


def test_a_pose_is_worked_out_for_a_message_that_is_due_and_no_other(monkeypatch):
    file = ROOT / 'config' / 'linkages' / 'four_bar.yaml'
    work = pipeline(file.read_bytes(), f'{DRIVES["turning"]}\neffects: {{markers: {{rate: 50}}}}')
    (line,) = work.lines
    looked, worked_out = line.looked, []
    monkeypatch.setattr(line, 'looked', lambda seen: worked_out.append(seen) or looked(seen))
    drawn = sum(any(tick.extras) for tick in ticks(work))
    assert drawn == len(worked_out) == TICKS * 50 // 1000
