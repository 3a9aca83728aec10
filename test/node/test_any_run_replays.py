# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Any run replays from its bag to the same bytes, whatever it remembers and whatever happens to it.

Scenes are drawn with every drive, effect and fault that has a memory, over motions that leave the
range of the linkage and come back: there nothing is published, and memories go on. Clocks jump,
samples are missing, and somebody asks for a reset.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from math import sin
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from hypothesis import given, strategies as st
from linkage_ros.bag import BagWriter, Topic
from linkage_ros.messages import JointStateWriter
from linkage_ros.replay import recorded_scene, replay_all
import pytest

from .conftest import LINKAGES
from .ticked import Moment, run

MS = 1_000_000
SECOND = 1_000_000_000
BEGIN = 1_700_000_000 * SECOND
ROCKER = 'left_rocker_joint'  # of the double rocker: it closes from 0.64 to 1.77 rad
EFFECTS = {
    'velocity': '{}',
    'backlash': '{play: 0.3}',
    'acceleration': '{}',
    'jitter': '{seconds: 0.005}',
    'bias': '{joints: {coupler_joint: 0.1}, deviations: {coupler_joint: 0.01}}',
    'measuring_range': '{joints: {coupler_joint: {low: -1, rate: 5}}}',
    'noise': '{joints: {coupler_joint: {white: 1.0e-3, walk: 1.0e-2, rate_white: 1.0e-3, '
    'drift: 1.0e-3, correlation_time: 0.02}}}',
    'encoder': '{joints: {right_rocker_joint: {counts: 4096, incremental: true}}}',
    'rate_limit': '{rate: 190, hold: silent, phase: 0.004, ppm: 50}',
    'dropout': '{probability: 0.4, burst: 3}',
    'delay': '{seconds: 0.012, spread: 0.005, reorder: true, duplicates: 0.1}',
    'markers': '{rate: 120, trace: 0.03}',
}
OWN = {
    'rate_limit': '{rate: 500, hold: silent, joints: {coupler_joint: {rate: 130, phase: 0.003}}}',
    'dropout': '{probability: 0.1, joints: {coupler_joint: {probability: 0.4, burst: 3}}}',
    'delay': '{seconds: 0.005, joints: {coupler_joint: {seconds: 0.009, spread: 0.004}}}',
}
"""Effects with a joint that has a sensor of its own."""
DRIVES = {
    'topic': '{max_age: 0.02}',
    'sine': '{mean: 1.2, amplitude: 0.9, frequency: 9}',
    'constant_rate': '{start: 0.3, rate: 25}',
    'chirp': '{mean: 1.2, amplitude: 0.9, start_frequency: 3, end_frequency: 15, seconds: 0.2}',
    'profile': '{table: [[0, 0.4], [0.05, 1.0], [0.1, 2.1], [0.15, 1.2]]}',
    'bag, at its pace': '{file: samples, max_age: 0.01}',
    'bag, a sample a tick': '{file: samples, pace: fast}',
}
FAULTS = {
    'hung': '{freeze: {}}',
    'worn': '{stuck: {joint: coupler_joint}}',
    'quiet': '{silence: {}}',
    'broken': '{broken_link: {link: coupler}}',
    'ahead': '{time_jump: {by: 0.03}}',
    'behind': '{time_jump: {by: -0.03}}',
}
TICKS = 150


def angle(number: int) -> float:
    """Return where the rocker is: it leaves the range, and comes back."""
    return 1.2 + 0.9 * sin(0.08 * number)


def samples(folder: Path) -> None:
    """Record the rocker alone, for the drive that takes it from a bag."""
    writer = BagWriter(folder, [Topic('/crank', 'sensor_msgs/msg/JointState', '', '')])
    write = JointStateWriter([ROCKER]).write
    for index in range(TICKS):
        stamp = BEGIN + index * MS + (50 * MS if index > 70 else 0)
        writer.write(0, stamp, stamp, write(stamp, [angle(index)], [80.0 * 0.9]))
    writer.close()


class Plan(NamedTuple):
    """What happens to a run, by the numbers of its ticks; jumps are in [ms]."""

    resets: Collection[int] = ()
    jumps: Mapping[int, int] = {}
    asked: Mapping[int, tuple[str, bool]] = {}
    every: int = 1  # a sample comes at every so many ticks
    silence: tuple[int, int] = (0, 0)  # the first tick without samples, and how many there are


def moments(plan: Plan) -> Iterator[Moment]:
    write = JointStateWriter([ROCKER]).write
    begin, end = plan.silence[0], sum(plan.silence)
    now = BEGIN
    for index in range(TICKS):
        now += MS + MS * plan.jumps.get(index, 0)
        messages: tuple[bytes, ...] = ()
        if index % plan.every == 0 and not begin <= index < end:
            messages = (write(now - MS // 7, [angle(index)], [72.0]),)
        asked = (plan.asked[index],) if index in plan.asked else ()
        yield Moment(now, messages, index in plan.resets, asked)


def scene(
    drive: str, effects: Collection[str], faults: Collection[str] = (), rest: str = ''
) -> str:
    """Return the text of a scene."""

    def entries(names: Collection[str], of: Mapping[str, str]) -> str:
        return ', '.join(f'{name}: {of[name]}' for name in sorted(names))

    text = f'linkage: {LINKAGES}/double_rocker.yaml\n{rest}'
    text += '' if 'rate:' in rest else 'rate: 1000\n'
    text += f'drive: {{{drive.partition(",")[0]}: {DRIVES[drive]}}}\n'
    text += f'effects: {{{entries(effects, EFFECTS)}}}\n'
    return text + (f'faults: {{{entries(faults, FAULTS)}}}\n' if faults else '')


ticks = st.integers(0, TICKS - 1)


@st.composite
def runs(draw: st.DrawFn) -> tuple[str, Plan]:
    """Draw a scene and what happens to it."""
    drive = draw(st.sampled_from(sorted(DRIVES)))
    faults = draw(st.sets(st.sampled_from(sorted(FAULTS)), max_size=2))
    rest = draw(st.sampled_from(['', 'angles: wrapped\n']))
    if drive == 'topic' and draw(st.booleans()):
        rest += 'rate: 0\n'
    effects = draw(st.sets(st.sampled_from(sorted(EFFECTS)), max_size=5))
    own = draw(st.sets(st.sampled_from(sorted(OWN))))
    changes = st.tuples(st.sampled_from(sorted(faults) or ['none']), st.booleans())
    text = scene(drive, effects, faults, rest)
    for effect in own:
        text = text.replace(EFFECTS[effect], OWN[effect])
    return text, Plan(
        resets=draw(st.sets(ticks, max_size=2)),
        jumps=draw(st.dictionaries(ticks, st.sampled_from([-60, -9, 9, 400]), max_size=2)),
        asked=draw(st.dictionaries(ticks, changes, max_size=6)) if faults else {},
        every=draw(st.sampled_from([1, 3, 7])),
        silence=draw(st.tuples(ticks, st.integers(0, 60))),
    )


def compare(text: str, happens: Iterable[Moment]) -> int:
    """Run a scene and replay its bag; return how many joint states came again."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        samples(folder / 'samples')
        (folder / 'scene.yaml').write_text(text)
        bag, published, extras, _ = run(folder / 'bag', folder / 'scene.yaml', happens)
        again = list(replay_all(bag, recorded_scene(bag), bag.messages()))
        assert [each.recorded for each in again if each.recorded] == published
        assert [each.tick.message for each in again] == [each.recorded for each in again]
        made = [message for each in again for message in each.tick.extras if message]
        assert made == extras
        assert [message for each in again for message in each.recorded_extras if message] == extras
        return len(published)


# Differences found once: the scene, and the events.
FOUND = {
    'play goes on where the loop is open': (scene('topic', ['backlash']), Plan()),
    'a curve begins where the loop is open': (scene('constant_rate', []), Plan()),
    'samples are used up where the loop is open': (scene('bag, a sample a tick', []), Plan()),
    'a reset': (scene('topic', ['noise']), Plan(resets=[20])),
    'a reset while the loop is open': (scene('sine', []), Plan(resets=[45])),
}
# A delay of another kind than those drawn, behind noise that walks and readings that are lost.
SAMPLED = scene('topic', ['noise', 'dropout', 'delay']).replace(
    EFFECTS['delay'], '{seconds: 0.0205, between: sampled, stamp: measured}'
)
FOUND['a delay that holds samples as they were measured'] = (SAMPLED, Plan(every=3))
# In the first gap, of 9 to 30 ms, the other joints' readings arrive before the coupler's first.
EARLIER = scene('topic', ['rate_limit', 'delay']).replace(
    EFFECTS['rate_limit'], '{rate: 500, hold: silent}'
)
FOUND['readings that arrive before there is one of each joint'] = (
    EARLIER.replace(
        EFFECTS['delay'], '{seconds: 0.005, joints: {coupler_joint: {seconds: 0.012}}}'
    ),
    Plan(),
)


@pytest.mark.parametrize('name', FOUND)
def test_runs_that_once_differed_replay_to_the_same_bytes(name):
    text, plan = FOUND[name]
    assert compare(text, moments(plan)) > 20


def test_clock_jump_between_recordings_replays_to_the_same_bytes():
    # The ticks without a crank leave nothing in the bag: its times go on, though the clock's do
    # not, and the turns before the jump have to be forgotten nevertheless.
    write = JointStateWriter(['crank_joint']).write
    four_bar = f'linkage: {LINKAGES}/four_bar.yaml\nrate: 1000\ndrive: {{topic: {{}}}}\n'
    # The crank is in its second turn; a second without samples, and the clock goes back by 0.3 s.
    before = [(BEGIN + n * MS, (5.0 + 0.02 * n,)) for n in range(200)]
    without = [(BEGIN + n * MS, ()) for n in range(200, 1000, 10)]
    after = [(BEGIN + n * MS, (5.0 + 0.02 * n,)) for n in range(700, 800)]
    happens = [
        Moment(now, (write(now, at, [20.0]),) if at else ())
        for now, at in before + without + after
    ]
    assert compare(four_bar, happens) > 250


@given(runs())
def test_random_run_replays_to_the_same_bytes(drawn):
    text, plan = drawn
    compare(text, moments(plan))


def test_torque_run_with_a_broken_link_replays_identically(tmp_path):
    # A tick makes up for a second at most: of those with a broken link a replay has to know.
    (tmp_path / 'scene.yaml').write_text(
        f'linkage: {LINKAGES}/four_bar.yaml\nrate: 100\ndrive: {{torque: {{start: 0.5}}}}\n'
        'effects: {velocity: {}}\nloads: {gravity: [0, -9.81]}\n'
        'faults: {broken: {broken_link: {link: coupler}, at: [0.2], seconds: 1.5}}\n'
    )
    happens = [Moment(BEGIN + index * 10 * MS) for index in range(220)]
    bag, published, _, _ = run(tmp_path / 'bag', tmp_path / 'scene.yaml', happens)
    again = list(replay_all(bag, recorded_scene(bag), bag.messages()))
    assert [each.tick.message for each in again if each.recorded] == published
    assert len(published) > 60
