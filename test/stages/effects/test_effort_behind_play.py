# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Effort behind backlash: within the play a drive bears its own inertia, and nothing of the linkage.

The references are written out here: where the crank is, by the play operator over the motor's
places; what a crank and an arm of two links take, by the closed forms of textbooks (for the arm J.
J. Craig, Introduction to Robotics, 3rd ed., 2005, 6.7).
"""

from math import cos, sin, tau

from linkage_ros.description import parse_scene
from linkage_ros.errors import FileError
import pytest

from ...support.messages import read_joint_state
from ...support.scenes import PENDULUM, pipeline_of

GRAVITY = 9.81
MS = 1_000_000
SECOND = 1000 * MS

ARM = """
links:
  ground: {O: [0, 0], X: [1, 0]}
  upper: {O: [0, 0], E: [0.4, 0]}
  fore: {E: [0, 0], hand: [0.3, 0]}
input:
  - {joint: shoulder, parent: ground, child: upper}
  - {joint: elbow, parent: upper, child: fore}
joints: {fore_joint: {parent: ground, child: fore}}
masses:
  upper: {mass: 1.5, center: [0.2, 0], inertia: 0.02}
  fore: {mass: 0.8, center: [0.15, 0], inertia: 0.006}
"""
LOADS = 'loads: {gravity: [0, -9.81], drive_inertia: 0.03}\n'
FRICTION = 'friction: {joints: {O: {viscous: 0.02, coulomb: 0.3}}}'


def published(linkage, text, times):
    """Return position and effort of each joint at times in [ns]."""
    pipeline = pipeline_of(text, linkage)
    found = []
    for time in times:
        message = pipeline.tick(SECOND + time).message
        state = read_joint_state(message)
        found.append((list(state.position), list(state.effort)))
    return found


def swing(t, mean=0.5, amplitude=0.4, frequency=1.0):
    """Return place, rate and acceleration of a motor that swings."""
    w = tau * frequency
    return (
        mean + amplitude * sin(w * t),
        amplitude * w * cos(w * t),
        -amplitude * w * w * sin(w * t),
    )


def pushes(crank, motor, play):
    """Return whether a motor lies at that end of the play towards which it moves."""
    place, rate, acceleration = motor
    way = rate or acceleration
    end = place - 0.5 * play if way > 0.0 else place + 0.5 * play
    return bool(way) and abs(crank - end) < 1e-12


def behind(motors, play):
    """Return where a crank is and whether it is pushed, for each place of its motor."""
    crank, found = motors[0][0], []
    for motor in motors:
        place = motor[0]
        if crank < place - 0.5 * play:
            crank = place - 0.5 * play
        elif crank > place + 0.5 * play:
            crank = place + 0.5 * play
        found.append((crank, pushes(crank, motor, play)))
    return found


def test_effort_within_the_play_is_the_drive_inertia():
    # On a shaft that is loaded by weight and friction, a motor to and fro, with 0.2 rad of play.
    times = [5 * i * MS for i in range(240)]
    found = published(
        PENDULUM,
        'drive: {sine: {mean: 0.5, amplitude: 0.4, frequency: 1.0}}\n'
        f'effects: {{backlash: {{play: 0.2}}, effort: {{}}, {FRICTION}}}\n{LOADS}',
        times,
    )
    motors = [swing(time * 1e-9) for time in times]
    inertia = 0.05 + 2.0 * 0.3**2 + 0.03
    alone = pushed = 0
    for ((crank, *_), (effort, *_)), motor, (expected_crank, is_pushed) in zip(
        found, motors, behind(motors, 0.2), strict=True
    ):
        assert crank == pytest.approx(expected_crank, abs=1e-12)
        _, rate, acceleration = motor
        expected = 0.03 * acceleration
        if is_pushed:
            dry = 0.3 if rate > 0.0 else -0.3
            weight = 2.0 * GRAVITY * 0.3 * cos(crank)
            expected = inertia * acceleration + weight + 0.02 * rate + dry
        assert effort == pytest.approx(expected, abs=1e-11)
        pushed += is_pushed
        alone += not is_pushed
    assert min(alone, pushed) > 50, 'both happen'


def test_effort_behind_play_follows_a_reversing_motor():
    # Rows at which a linear profile stands, moves, turns back: play 0.2, so 0.1 to either side.
    times = [0, 50, 150, 950, 1050, 1150, 1250, 1850, 2100]
    found = published(
        PENDULUM,
        'drive: {profile: {table: [[0, 0], [1, 1], [2, 0]], interpolation: linear}}\n'
        f'effects: {{backlash: {{play: 0.2}}, effort: {{}}}}\n{LOADS}',
        [time * MS for time in times],
    )

    def weight(crank):
        return 2.0 * GRAVITY * 0.3 * cos(crank)

    # The motor moves at 1 rad/s there and back: it has no acceleration, and alone takes nothing.
    timeline = [
        (0.0, 0.0),  # in the middle of the play
        (0.0, 0.0),  # still within it
        (0.05, weight(0.05)),  # it pushes
        (0.85, weight(0.85)),
        (0.85, 0.0),  # it has turned back: the crank stays, held by friction
        (0.85, 0.0),
        (0.85, weight(0.85)),  # it has crossed the play, and pushes at the other end
        (0.25, weight(0.25)),
        (0.10, 0.0),  # it stands, in touch: it pushes no more, and friction holds the crank
    ]
    for (positions, efforts), (crank, effort) in zip(found, timeline, strict=True):
        assert positions[0] == pytest.approx(crank, abs=1e-9)
        assert efforts[0] == pytest.approx(effort, abs=1e-7)
        assert efforts[1:] == [0.0]


def test_zero_play_leaves_the_effort_unchanged():
    # A motor that stands bears the weight then, as it does without backlash.
    times = [100 * i * MS for i in range(12)]
    drive = 'drive: {profile: {table: [[0, 0], [0.5, 1]], interpolation: minimum_jerk}}\n'
    with_it, without = (
        published(PENDULUM, f'{drive}effects: {{{effect}effort: {{}}}}\n{LOADS}', times)
        for effect in ('backlash: {play: 0}, ', '')
    )
    assert with_it == without
    assert with_it[-1][1][0] == pytest.approx(2.0 * GRAVITY * 0.3 * cos(1.0))


def arm(upper, fore):
    """Return the efforts of an arm in closed form; each joint has angle, rate, acceleration."""
    (q1, w1, a1), (q2, w2, a2) = upper, fore
    m1, c1, j1, length, m2, c2, j2 = 1.5, 0.2, 0.02, 0.4, 0.8, 0.15, 0.006
    coupled = m2 * length * c2
    m22 = j2 + m2 * c2**2
    m12 = m22 + coupled * cos(q2)
    m11 = j1 + m1 * c1**2 + m2 * length**2 + m22 + 2.0 * coupled * cos(q2)
    whirl = coupled * sin(q2)
    held1 = (m1 * c1 + m2 * length) * GRAVITY * cos(q1) + m2 * c2 * GRAVITY * cos(q1 + q2)
    held2 = m2 * c2 * GRAVITY * cos(q1 + q2)
    return (
        m11 * a1 + m12 * a2 - whirl * (2.0 * w1 * w2 + w2 * w2) + held1 + 0.03 * a1,
        m12 * a1 + m22 * a2 + whirl * w1 * w1 + held2 + 0.03 * a2,
    )


def test_each_input_effort_depends_on_its_own_play():
    # Shoulder and elbow swing at 1 Hz and at 0.7 Hz, with plays of 0.1 and 0.3.
    times = [7 * i * MS for i in range(400)]
    found = published(
        ARM,
        'drive: {sine: {mean: 0.5, amplitude: 0.4, frequency: 1.0, inputs: {elbow: '
        '{mean: -0.8, amplitude: 0.6, frequency: 0.7, phase: 1.0}}}}\n'
        f'effects: {{backlash: {{play: 0.1, inputs: {{elbow: 0.3}}}}, effort: {{}}}}\n{LOADS}',
        times,
    )
    shoulders = [swing(time * 1e-9) for time in times]
    elbows = []
    for time in times:
        w = tau * 0.7
        phase = w * time * 1e-9 + 1.0
        elbows.append((-0.8 + 0.6 * sin(phase), 0.6 * w * cos(phase), -0.6 * w * w * sin(phase)))
    happened = set()
    for (positions, efforts), *motors, (q1, first), (q2, second) in zip(
        found, shoulders, elbows, behind(shoulders, 0.1), behind(elbows, 0.3), strict=True
    ):
        assert positions[:2] == pytest.approx([q1, q2], abs=1e-12)
        cranks = [
            (q, *(motor[1:] if is_pushed else (0.0, 0.0)))
            for q, motor, is_pushed in zip((q1, q2), motors, (first, second), strict=True)
        ]
        expected = [
            of_arm if is_pushed else 0.03 * motor[2]
            for of_arm, motor, is_pushed in zip(arm(*cranks), motors, (first, second), strict=True)
        ]
        assert efforts[:2] == pytest.approx(expected, abs=1e-10)
        happened.add((first, second))
    assert len(happened) == 4, 'each alone, both, and neither'


def test_slide_effort_behind_play_is_a_force():
    linkage = """
links:
  ground: {G: [0, 0], X: [1, 0]}
  ram: {P: [0, 0]}
sliders: {guide: {point: P, block: ram, angle: 0, along: ground, through: G, direction: [0, 1]}}
input: {joint: ram_slide, slider: guide}
joints: {stroke: {slider: guide}}
masses: {ram: {mass: 4, center: [0, 0], inertia: 0.001}}
"""
    times = [10 * i * MS for i in range(100)]
    found = published(
        linkage,
        'drive: {sine: {mean: 0.5, amplitude: 0.4, frequency: 1.0}}\n'
        'effects: {backlash: {play: 0.2}, effort: {}}\n'
        'loads: {gravity: [0, -9.81], drive_inertia: 3.0}\n',
        times,
    )
    motors = [swing(time * 1e-9) for time in times]
    kinds = set()
    for (_, efforts), motor, (_, pushed) in zip(found, motors, behind(motors, 0.2), strict=True):
        expected = (4.0 + 3.0) * motor[2] + 4.0 * GRAVITY if pushed else 3.0 * motor[2]
        assert efforts[0] == pytest.approx(expected, abs=1e-10)
        kinds.add(pushed)
    assert len(kinds) == 2


def test_backlash_beside_a_torque_drive_is_refused():
    def scene(first, second):
        files = {
            'scene.yaml': (
                f'effects: {{backlash: {{play: 0.1}}}}\n'
                f'linkages: [{{name: a, linkage: a, {first}}}, {{name: b, linkage: b, {second}}}]'
            ).encode(),
            'a.yaml': PENDULUM.encode(),
            'b.yaml': PENDULUM.encode(),
        }
        return parse_scene('scene', 'here', files)

    turning = 'drive: {constant_rate: {rate: 1}}'
    assert len(scene(turning, 'drive: {torque: {}}, effects: {}').linkages) == 2
    with pytest.raises(FileError, match=r'effects\.backlash: is play without'):
        scene(turning, 'drive: {torque: {}}')
