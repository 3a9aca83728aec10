# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Motor and crank that meet and part without end: the work of a step is bounded, and it goes on.

What is counted is work, not time: how often the equation of motion is asked for.
"""

from dataclasses import replace
from itertools import pairwise
from math import inf

from linkage_ros.dynamics import (
    behind_play,
    Loads,
    Mechanics,
    METHODS,
    MotorPlay,
    SeveralDofMechanism,
    SingleDofMechanism,
    Terms,
    TwoMasses,
)
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import Closure
from linkage_ros.messages import EffortCommand
import pytest

from .loaded import BEGIN, closed, FOLDER, shipped
from ..support.scenes import pipeline_of

MS = 1_000_000
STEPS = 400
EVALUATIONS = {'rk4': 100, 'gauss_legendre': 600, 'semi_implicit_euler': 60}
"""Most evaluations of a step over a long run, by method; ten plain steps take about half."""

# By name: the effort [N·m], or a rate [rad/s] from which it is left to itself; the motor's inertia
# [kg·m²]; the restitution; the play [rad]; the step [s]; the method.
CASES = {
    'the scene of the report': (5.0, 0.0, 2e-4, 0.5, 0.02, 1e-3, 'rk4'),
    'backward': (-5.0, 0.0, 2e-4, 0.5, 0.02, 1e-3, 'rk4'),
    'without a bounce': (5.0, 0.0, 2e-4, 0.0, 0.02, 1e-3, 'rk4'),
    'a bounce that loses nothing': (5.0, 0.0, 2e-4, 1.0, 0.02, 1e-3, 'rk4'),
    'a motor as heavy as the crank': (5.0, 0.0, 1e-3, 0.5, 0.02, 1e-3, 'rk4'),
    'a very light motor': (5.0, 0.0, 1e-6, 0.5, 0.02, 1e-3, 'rk4'),
    'hardly any play': (5.0, 0.0, 2e-4, 0.5, 1e-6, 1e-3, 'rk4'),
    'long steps': (2.0, 0.0, 2e-4, 0.5, 0.02, 5e-3, 'rk4'),
    'another method': (5.0, 0.0, 2e-4, 0.5, 0.02, 1e-3, 'semi_implicit_euler'),
    'a thorough method': (5.0, 0.0, 2e-4, 0.5, 0.02, 1e-3, 'gauss_legendre'),
    'fast, and left to itself': (0.0, 1500.0, 2e-4, 0.5, 0.02, 1e-3, 'rk4'),
}  # fmt: skip


@pytest.mark.sample(4)
@pytest.mark.parametrize('name', CASES)
def test_chattering_step_stays_within_its_evaluation_bound(name):
    force, rate, inertia, restitution, play, step, method = CASES[name]
    equation = Mechanics(Closure(shipped('four_bar')), Loads(drive_inertia=1e-3)).motion_equation
    asked = 0

    def counted(value):
        nonlocal asked
        asked += 1
        return equation(value)

    crank = SingleDofMechanism(counted, METHODS[method].step)
    mechanism = TwoMasses.from_motor(crank, inertia, play, restitution)
    motion = mechanism.state_at(1.0, rate)
    most = EVALUATIONS[method]
    for number in range(1, STEPS + 1):
        motion = mechanism.advance(motion, step, force, 0.0, step * number)
        # A run of bounces may take what earlier steps have left over.
        assert asked <= most * (number + 100), f'{number} steps, {motion.rate:.0f} rad/s'
        assert abs(motion.motor.value - motion.crank.value) <= 0.5 * play + 1e-9
    assert asked <= most * (STEPS + 60)


@pytest.mark.sample(2)
@pytest.mark.parametrize('restitution', [0.5, 1.0])
@pytest.mark.parametrize('inertia', [2e-4, 1e-6])
def test_chattering_step_of_several_inputs_stays_within_bound(restitution, inertia):
    equation = Mechanics(closed('five_bar'), Loads(drive_inertia=1e-3)).input_equation
    asked = 0

    def counted(values, rates):
        nonlocal asked
        asked += 1
        return equation(values, rates)

    bare = SeveralDofMechanism(counted, METHODS['rk4'].step, ((-inf, inf),) * 2)
    play = MotorPlay(0.002, inertia, restitution)
    mechanism = behind_play(bare, {0: play, 1: play})
    motion = mechanism.state_at([1.2, 1.9, 1.2, 1.9], [0.0] * 4)
    for number in range(1, STEPS // 4 + 1):
        motion = mechanism.advance(motion, 1e-3, [0.0, 0.0, 0.5, -0.3], (), 1e-3 * number)
        assert asked <= 150 * (number + 100), number
        for at in (0, 1):
            assert abs(motion.value[2 + at] - motion.value[at]) <= 0.001 + 1e-9
    # Pushed on, motors and cranks move as one.
    assert motion.rate[0] == pytest.approx(4.43, abs=0.05)


@pytest.mark.parametrize('force', [0.4, -0.4, 0.0])
def test_coarse_steps_keep_momentum_and_play(force):
    # Two wheels: whatever the meetings, the momentum is the impulse of the drive.
    wheel = SingleDofMechanism(lambda _: Terms(0.23, 0.0, 0.0, 0.0, 0.0), METHODS['rk4'].step)
    mechanism = TwoMasses.from_motor(wheel, 0.1, 0.02, 0.7)
    motion = mechanism.state_at(0.0, 0.0)
    motion = motion._replace(motor=motion.motor._replace(rate=20.0))
    for index in range(1, 300):
        motion = mechanism.advance(motion._replace(trials=-100), 1e-3, force)
        momentum = 0.1 * motion.motor.rate + 0.23 * motion.crank.rate
        assert momentum == pytest.approx(2.0 + force * 1e-3 * index, abs=1e-12)
        assert abs(motion.motor.value - motion.crank.value) <= 0.01 + 1e-12
        energy = 0.1 * motion.motor.rate**2 + 0.23 * motion.crank.rate**2
        assert energy <= 0.1 * (20.0 + 10.0 * abs(force) * 1e-3 * index) ** 2 + 1e-9
    assert motion.coarse > 0


def test_coarse_steps_keep_the_crank_within_its_stops():
    wheel = SingleDofMechanism(
        lambda _: Terms(0.23, 0.0, 0.0, 0.0, 0.0), METHODS['rk4'].step, (-1.0, 1.0)
    )
    for end in (1.0, -1.0):
        for side in (1, -1, 0):
            mechanism = TwoMasses.from_motor(replace(wheel, restitution=0.5), 0.1, 0.02, 0.5)
            motion = mechanism.state_at(0.99 * end, 20.0 * end)
            at = motion.crank.value + 0.01 * side
            motion = motion._replace(side=side, motor=motion.motor._replace(value=at))
            for _ in range(20):
                motion = mechanism.advance(motion._replace(trials=-100), 1e-3, 0.0)
                assert -1.0 <= motion.crank.value <= 1.0
                assert abs(motion.motor.value - motion.crank.value) <= 0.01 + 1e-12
            assert motion.rate * end <= 0.0


SCENE = """
rate: 100
drive: {torque: {start: 1.0, timeout: 0.5, play: {PLAY}}}
loads: {drive_inertia: 0.001}
effects: {velocity: {}}
"""
LIGHT = 'width: 0.02, inertia: 2.0e-4, restitution: 0.5'


def drive_of(play=LIGHT):
    linkage = (FOLDER / 'four_bar.yaml').read_bytes()
    return pipeline_of(SCENE.replace('PLAY', play), linkage).linkages[0].drive


def pushed(drive, every, until=1500):
    """Return the motion after some [ms] under 5 N·m, looked at every so many [ms]."""
    for time in range(until + 1):
        now = BEGIN + time * MS
        if not time % 10:
            assert drive.offer(EffortCommand(0, (5.0,)), now) is None
        if not time % every:
            state = drive.state(now)
    return state, drive.chatter_count


def test_chattering_motion_does_not_depend_on_query_times():
    seldom, often = pushed(drive_of(), 500), pushed(drive_of(), 1)
    assert seldom == often
    assert seldom[1] > 0


def test_chatter_ends_the_run_with_an_error():
    drive = drive_of(f'{LIGHT}, on_chatter: end')
    with pytest.raises(LinkageError, match=r'drive\.torque\.play: .* step of 0.001 s') as caught:
        pushed(drive, 10)
    assert '\n' not in str(caught.value)


def test_late_ticks_skip_time_while_the_play_chatters():
    # A tick comes each 100 ms, where 10 ms are wanted: 20 ms of these are integrated.
    drive = drive_of(f'{LIGHT}, on_chatter: close')
    lost = []
    for index in range(40):
        now = BEGIN + 100 * index * MS
        assert drive.offer(EffortCommand(0, (5.0,)), now) is None
        drive.state(now)
        lost.append(drive.lost)
    assert drive.chatter_count > 0
    skipped = [(after - before) // MS for before, after in pairwise(lost)]
    assert skipped[0] == 0
    assert skipped[-1] in {79, 80, 81}


def test_finite_bounces_do_not_count_as_chatter():
    drive = drive_of(f'{LIGHT}, on_chatter: end')
    for index in range(100):
        if not index % 10:
            drive.offer(EffortCommand(0, (0.02 * (-1) ** (index // 10),)), BEGIN + index * 10 * MS)
        drive.state(BEGIN + index * 10 * MS)
    assert drive.chatter_count == 0
