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
A run of any scene replays from its bag to the same bytes: withheld, pushed, or with faults.

The tick loop is the node's own, with its recorder; only DDS is left out.
"""

from __future__ import annotations

from math import cos, sin

from linkage_ros.messages.joint_state import JointStateWriter
from linkage_ros.replay.replay import recorded_scene, replay
from linkage_ros.scene.load import load_scene
import pytest

from .conftest import LINKAGES
from .ticked import Moment, run

MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000
TICKS = 400
SLOW_RANDOM = 'noise: {joints: {rocker_joint: {white: 1.0e-3, walk: 1.0e-2}}}'

SCENES = {
    'readings lost': f'effects: {{velocity: {{}}, {SLOW_RANDOM}, dropout: {{probability: 0.3}}}}',
    'a slow sensor': f'effects: {{{SLOW_RANDOM}, rate_limit: {{rate: 90, hold: silent}}}}',
    'a delay that fills': 'effects: {velocity: {}, jitter: {seconds: 0.004}, '
    'delay: {seconds: 0.05}}',
    'lost and delayed': f'effects: {{{SLOW_RANDOM}, dropout: {{probability: 0.5, burst: 4}}, '
    'delay: {seconds: 0.0205, between: sampled, stamp: measured}}',
    'play, forces and leaning pins': 'effects: {backlash: {play: 0.05}, effort: {}, '
    'pin_forces: {}, '
    'clearance: {pins: {A: 1.0e-5, B: 1.0e-5}}, acceleration: {}}\nloads: {gravity: [0, -9.81]}',
    'faults at their times': f"""
effects: {{velocity: {{}}, {SLOW_RANDOM}}}
faults:
  frozen: {{freeze: {{}}, at: [0.05], seconds: 0.02}}
  stuck: {{stuck: {{joint: rocker_joint}}, at: [0.1], seconds: 0.02}}
  spoilt: {{not_a_number: {{}}, at: [0.15], seconds: 0.02}}
  quiet: {{silence: {{}}, at: [0.2], seconds: 0.02}}
  broken: {{broken_link: {{link: coupler}}, at: [0.25], seconds: 0.02}}
""",
    'faults on demand': f"""
effects: {{velocity: {{}}, {SLOW_RANDOM}}}
faults: {{quiet: {{silence: {{}}}}, frozen: {{freeze: {{}}}}}}
""",
    'a clock that jumps': f"""
effects: {{velocity: {{}}, {SLOW_RANDOM}}}
drive: {{topic: {{max_lead: 10.0, max_age: 10.0}}}}
faults:
  ahead: {{time_jump: {{by: 0.5}}, at: [0.1], seconds: 0.05}}
  behind: {{time_jump: {{by: -0.05}}, at: [0.2], seconds: 0.05}}
""",
    'driven by itself': 'drive: {sine: {amplitude: 1.0, frequency: 2.0}}\n'
    f'effects: {{{SLOW_RANDOM}}}',
    'pushed': """
drive: {torque: {method: rk4, timeout: 0.02}}
effects: {velocity: {}, effort: {}, encoder: {joints: {crank_joint: {counts: 4096}}}}
loads: {gravity: [0, -9.81]}
""",
}  # fmt: skip


def moments(text):
    """Yield ticks and samples of 400 ms."""
    write = JointStateWriter(['crank_joint']).write
    for number in range(TICKS):
        # As a real clock has it: no two ticks are a period apart.
        now = BEGIN + number * MS + number * number % 137_000
        messages, asked = (), ()
        if number % 3 == 0 and not 300 < number < 340:
            angle, effort = sin(0.01 * number), 0.01 * cos(0.1 * number)
            messages = (write(now, [angle], [10.0 * cos(0.01 * number)], [effort]),)
        if text == SCENES['faults on demand']:
            asked = tuple(
                (name, number == begin)
                for name, begin, end in (('quiet', 60, 90), ('frozen', 80, 120))
                if number in (begin, end)
            )
        yield Moment(now, messages, False, asked)


def recorded(folder, text):
    """Record a run and return its bag, and the joint states that it has published."""
    (folder / 'scene.yaml').write_text(f'linkage: {LINKAGES}/four_bar.yaml\n{text}')
    bag, published, _, _ = run(folder / 'bag', folder / 'scene.yaml', moments(text))
    return bag, published


@pytest.mark.parametrize('name', SCENES)
def test_a_run_replays_to_the_same_bytes(tmp_path, name):
    bag, published = recorded(tmp_path, SCENES[name])
    assert len(set(published)) > 30
    again = list(replay(bag, recorded_scene(bag)))
    assert [each.recorded for each in again] == published
    assert [each.tick.message for each in again] == published
    for each in again:
        assert each.recorded_extras == each.tick.extras


@pytest.mark.parametrize('name', ['readings lost', 'lost and delayed', 'faults at their times'])
def test_another_seed_replays_to_other_bytes(tmp_path, name):
    # What is equal above is not so by chance.
    bag, published = recorded(tmp_path, SCENES[name])
    text = (tmp_path / 'scene.yaml').read_text()
    (tmp_path / 'scene.yaml').write_text(f'{text}\nseed: 1\n')
    other = [each.tick.message for each in replay(bag, load_scene(tmp_path / 'scene.yaml'))]
    assert other != published
