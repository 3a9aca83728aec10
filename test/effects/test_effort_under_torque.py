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
What the published effort is under the torque drive: moving freely, stuck, at a stop, braked.

Timelines of a crank with a weight, and of a ram. They are cut free by hand: the effort is what
drive, brake, stop and static friction exert together.
"""

from __future__ import annotations

from math import cos, pi

import pytest

from ..support.messages import joint_state as serialized
from ..support.messages import read_joint_state
from ..support.scenes import pipeline_of

MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000
WEIGHT = 2.0 * 9.81 * 0.3
"""Largest moment of the crank's weight, in [N·m]."""

CRANK = """
links:
  ground: {O: [0, 0], X: [1, 0]}
  crank: {O: [0, 0], end: [0.5, 0]}
input: {joint: drive_joint, parent: ground, child: crank}
joints: {crank_joint: {parent: ground, child: crank}}
masses: {crank: {mass: 2, center: [0.3, 0], inertia: 0.05}}
"""
RAM = """
links:
  ground: {W: [0, 0], X: [1, 0]}
  ram: {P: [0, 0]}
  bar: {P: [0, 0], H: [0.5, 0]}
sliders:
  guide: {point: P, block: ram, angle: 0, along: ground, through: W, direction: [0, 1]}
  rail: {point: H, along: ground, through: W, direction: [1, 0]}
input: {joint: ram_slide, slider: guide}
assembly: {rail: ahead}
joints: {bar_joint: {parent: ground, child: bar}}
masses:
  ram: {mass: 4, center: [0, 0], inertia: 0.001}
  bar: {mass: 1.0e-9, center: [0, 0], inertia: 1.0e-12}
"""
"""A ram that lifts 4 kg, and is stopped where the bar stands upright, at 0.5 m."""


def timeline(linkage, torque, commands, until, friction=''):
    """
    Return position, rate and effort of the input for each time in [ms].

    Parameters
    ----------
    linkage
        The text of its file.
    torque
        Parameters of the drive.
    commands
        Effort by the time at which it comes, in [ms]; each holds for 100 ms.
    until
        Time at which it ends, in [ms].
    friction
        Parameters of the effect; '' for none.

    """
    text = f'drive: {{torque: {torque}}}\nloads: {{gravity: [0, -9.81], drive_inertia: 0.02}}\n'
    text += f'effects: {{velocity: {{}}, effort: {{}}{friction and ", friction: " + friction}}}\n'
    pipeline = pipeline_of(text, linkage)
    (joint,) = pipeline.lines[0].member.inputs
    found = {}
    for time in range(until):
        now = BEGIN + time * MS
        if time in commands:
            assert pipeline.offer(serialized([joint], efforts=[commands[time]]), now) is None
        state = read_joint_state(pipeline.tick(now).message)
        found[time] = state.position[0], state.velocity[0], state.effort[0]
    return found


RUBBING = '{joints: {O: {viscous: 0.1, coulomb: 1.5}}}'


def test_where_it_moves_freely_it_is_what_is_commanded():
    # Whatever weight, inertia and friction do: they are what the command works against.
    commands = dict.fromkeys(range(0, 600, 90), 9.0)
    found = timeline(CRANK, '{start: -1.2}', commands, 500, RUBBING)
    assert found[499][1] > 1.0, 'it moves'
    for time in range(1, 500):
        assert found[time][2] == pytest.approx(9.0, abs=1e-10)


def test_where_no_command_holds_it_is_none():
    found = timeline(CRANK, '{start: 1.0}', {}, 300, RUBBING)
    assert found[299][1] < -1.0, 'it falls'
    for time in range(1, 300):
        assert found[time][2] == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize('command', [-0.4, 0.0, 1.2])
def test_where_friction_holds_it_it_is_the_weight_and_not_the_command(command):
    # Near the top of its circle the weight is below what friction holds, and so is what is left
    # of it with the command: drive and friction bear the weight together, in parts that nobody
    # can tell.
    angle = 0.5 * pi - 0.1
    weight = WEIGHT * cos(angle)
    assert abs(command - weight) < 1.5
    found = timeline(CRANK, f'{{start: {angle!r}}}', {0: command}, 90, RUBBING)
    for time in range(90):
        position, rate, effort = found[time]
        assert (position, rate) == (angle, 0.0)
        assert effort == pytest.approx(weight, abs=1e-12)


def test_while_the_brake_slips_it_is_the_brakes():
    # It turns forward, and the brake exerts −2 on it; friction of the pin is no part of that.
    torque = '{start: 0.2, rate: 6.0, on_timeout: brake, brake: 2.0}'
    found = timeline(CRANK, torque, {}, 60, RUBBING)
    for time in range(1, 60):
        assert found[time][1] > 0.0
        assert found[time][2] == pytest.approx(-2.0, abs=1e-10)
    back = timeline(CRANK, torque.replace('6.0', '-6.0'), {}, 60, RUBBING)
    assert back[59][1] < 0.0
    assert back[59][2] == pytest.approx(2.0, abs=1e-10)


def test_where_the_brake_holds_it_it_is_the_weight():
    torque = '{start: 0.2, on_timeout: brake, brake: 20.0}'
    found = timeline(CRANK, torque, {}, 60)
    for time in range(60):
        assert found[time][:2] == (0.2, 0.0)
        assert found[time][2] == pytest.approx(WEIGHT * cos(0.2), abs=1e-12)


def test_at_a_stop_it_is_the_weight_and_not_the_command():
    # 60 N up lift 4 kg against its 39.24 N; at the stop the ground bears what is too much.
    commands = dict.fromkeys(range(0, 1500, 90), 60.0)
    found = timeline(RAM, '{start: 0.2, stop_margin: 0.05}', commands, 1400)
    stop = max(position for position, _, _ in found.values())
    moving = [time for time in found if time and found[time][1] > 0.0]
    resting = [time for time in found if time and found[time][:2] == (stop, 0.0)]
    assert len(moving) > 100
    assert len(resting) > 100
    for time in moving:
        assert found[time][2] == pytest.approx(60.0, abs=1e-6)
    for time in resting:
        assert found[time][2] == pytest.approx(4.0 * 9.81, abs=1e-6)
