# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""The torque drive of several inputs: commands by name, motors, stops, efforts, and refusals."""

from dataclasses import replace
from math import inf, nan

from linkage_ros.dynamics import (
    AppliedLoads,
    Friction,
    JointFriction,
    JointSpring,
    Loads,
    METHODS,
    SeveralDofMechanism,
)
from linkage_ros.errors import DefinitionError, LinkageError
from linkage_ros.kinematics import Limits
from linkage_ros.messages import EffortCommand, JointEffortReader, Rejection
from linkage_ros.stages.drives import Context, TorqueDrive
from linkage_ros.stages.drives.torque import MotorParameters, PlayParameters, TorqueInput
import pytest

from ...dynamics.loaded import closed
from ...dynamics.test_in_space import ANKLE, weighed
from ...support.messages import joint_state as serialized, read_joint_state
from ...support.scenes import LINKAGES, pipeline_of

BEGIN = 1_700_000_000_000_000_000
MS = 1_000_000
START = {'left_crank_joint': TorqueInput(1.2), 'right_crank_joint': TorqueInput(1.9)}
GRAVITY = Loads((0.0, -9.81), drive_inertia=0.01)


def context_of(closure, loads=GRAVITY, friction=None, effects=()):
    return Context(closure, 1000.0, True, 'seed', loads, friction, effects=frozenset(effects))


def five_bar(effects=(), **parameters):
    drive = TorqueDrive(**{'inputs': START, **parameters})
    return drive.build(context_of(closed('five_bar'), effects=effects))


def stepped(closure, loads, start, forces):
    """Return values and rates after steps of 1 ms under forces, one pair for each step."""
    mechanics = context_of(closure, loads).mechanics
    stops = ((-inf, inf),) * len(start)
    mechanism = SeveralDofMechanism(
        mechanics.input_equation, METHODS['rk4'].step, stops, laws=mechanics.laws
    )
    state = mechanism.state_at(start, [0.0] * len(start))
    for number, force in enumerate(forces):
        state = mechanism.advance(state, 1e-3, force, time=number * 1e-3)
    return tuple(state.value), tuple(state.rate)


def test_torque_commands_time_out_separately():
    crank = five_bar(timeout=0.03)
    crank.state(BEGIN)
    assert crank.offer(EffortCommand(0, (0.4, None)), BEGIN) is None
    assert crank.offer(EffortCommand(0, (None, -0.2)), BEGIN + 10 * MS) is None
    state = crank.state(BEGIN + 50 * MS)
    # The first for 30 ms; the second from 10 ms on, for as long.
    forces = [[0.4, 0.0]] * 10 + [[0.4, -0.2]] * 20 + [[0.0, -0.2]] * 10 + [[0.0, 0.0]] * 10
    expected = stepped(closed('five_bar'), GRAVITY, [1.2, 1.9], forces)
    assert (state.angles, state.rates) == expected


def test_torque_motion_does_not_depend_on_query_times():
    often, once = five_bar(), five_bar()
    for crank in (often, once):
        crank.state(BEGIN)
        crank.offer(EffortCommand(0, (0.1, -0.1)), BEGIN + 333_333)
    for time in range(1, 60_000_000, 770_000):
        often.state(BEGIN + time)
    assert often.state(BEGIN + 60 * MS) == once.state(BEGIN + 60 * MS)


def test_a_command_that_is_no_number_changes_nothing():
    crank, other = five_bar(), five_bar()
    crank.state(BEGIN)
    other.state(BEGIN)
    bad = {nan: Rejection.EFFORT_NOT_FINITE, 1e11: Rejection.EFFORT_TOO_LARGE}
    for effort, reason in bad.items():
        assert crank.offer(EffortCommand(0, (1.0, effort)), BEGIN) is reason
    assert crank.state(BEGIN + 20 * MS) == other.state(BEGIN + 20 * MS)


def test_two_motors_follow_their_voltages():
    # Of a voltage U on the resistance R the torque is k·N·(U − k·N·q̇)/R.
    motor = MotorParameters(0.05, resistance=2.0, ratio=20.0, command='voltage')
    inputs = {name: replace(given, motor=motor) for name, given in START.items()}
    crank = five_bar(('effort',), inputs=inputs)
    crank.state(BEGIN)
    crank.offer(EffortCommand(0, (3.0, -1.0)), BEGIN)
    state = crank.state(BEGIN + 40 * MS)
    for number, voltage in enumerate((3.0, -1.0)):
        torque = (voltage - 1.0 * state.rates[number]) / 2.0
        assert abs(state.rates[number]) > 0.1
        assert state.bearing[2 * number] == pytest.approx(torque, rel=1e-12)
    # The same as dampers and constant torques.
    damped = {name: JointSpring(0.0, 0.0, 0.5) for name in START}
    loads = replace(GRAVITY, applied=AppliedLoads(damped))
    expected = stepped(closed('five_bar'), loads, [1.2, 1.9], [[1.5, -0.5]] * 40)
    assert state.angles == pytest.approx(expected[0], rel=1e-9)
    assert state.rates == pytest.approx(expected[1], rel=1e-7)


def test_commands_arrive_jointly_or_per_motor():
    reader = JointEffortReader(['a', 'b', 'c'], {'d'})
    assert reader.read(serialized(['c', 'a'], efforts=[1.0, 2.0])).efforts == (2.0, None, 1.0)
    assert reader.read(serialized(['b'], efforts=[3.0])).efforts == (None, 3.0, None)
    assert reader.read(serialized(['b'], efforts=[4.0])).efforts == (None, 4.0, None)
    assert reader.read(serialized(['d', 'b'], efforts=[5.0])).efforts == (None, 5.0, None)
    assert reader.read(serialized(['x'], efforts=[1.0])) is Rejection.MISSING
    assert reader.read(serialized(['a', 'a'], efforts=[1.0, 1.0])) is Rejection.TWICE
    assert reader.read(serialized(['a'], [0.0])) is Rejection.NO_EFFORT
    assert reader.read(serialized(['a', 'b'], efforts=[1.0])) is Rejection.UNEQUAL


PUSHED = """
drive: {torque: {inputs: %s}}
loads: {gravity: %s, drive_inertia: 1.0e-3}
effects: {velocity: {}, effort: {}}
"""


@pytest.mark.parametrize(
    ('linkage', 'inputs', 'gravity'),
    [
        (ANKLE, '{m1: {start: 0.05}}', '[0, 0, -9.81]'),
        (
            (LINKAGES / 'five_bar.yaml').read_bytes() + b'masses: {left_crank: {mass: 0.2},'
            b' right_crank: {mass: 0.25}, left_forearm: {mass: 0.1}, right_forearm: {mass: 0.1}}',
            '{left_crank_joint: {start: 1.2}, right_crank_joint: {start: 1.9}}',
            '[0, -9.81]',
        ),
    ],
    ids=['ankle', 'five_bar'],
)
def test_scene_publishes_the_commanded_efforts_of_two_motors(linkage, inputs, gravity):
    pipelines = [pipeline_of(PUSHED % (inputs, gravity), linkage) for _ in range(2)]
    names = [*pipelines[0].linkages[0].scene_linkage.input_names]
    messages = [[], []]
    for time in range(120):
        now = BEGIN + time * MS
        for pipeline, said in zip(pipelines, messages, strict=True):
            if time % 50 == 10:
                command = serialized(names, efforts=[0.02, -0.01])
                assert pipeline.offer(command, now) is None
            if pipeline is pipelines[0]:
                said.append(pipeline.tick(now).message)
                state = read_joint_state(said[-1])
                if time > 10:
                    assert tuple(state.effort[:2]) == (0.02, -0.01)
            else:
                said.append(pipeline.linkages[0].interpret(now).reading)
    assert max(map(abs, state.velocity)) > 0.01, 'it moves'
    last = messages[1][-1]
    assert tuple(state.position) == last.joints
    assert tuple(state.velocity) == last.rates


def test_commands_are_counted_for_their_motor():
    # Two controllers, a message of each between two ticks: none takes the place of the other.
    pipeline = pipeline_of(PUSHED % ('{m1: {start: 0.05}}', '[0, 0, -9.81]'), ANKLE)
    pipeline.tick(BEGIN)
    for name in ('m1', 'm2', 'm2'):
        assert pipeline.offer(serialized([name], efforts=[0.1]), BEGIN + MS) is None
        ((_, number),) = pipeline.moved_inputs
        assert pipeline.linkages[0].scene_linkage.input_names[number] == name
    assert pipeline.count_fresh_and_stale(BEGIN + MS) == (2, 0)
    assert pipeline.offer(serialized(['m1', 'm2'], efforts=[0.1, nan]), BEGIN + MS) is not None
    assert pipeline.moved_inputs == ()
    later = BEGIN + 50 * MS
    assert pipeline.offer(serialized(['m2'], efforts=[0.1]), later) is None
    # Commands are valid for 0.1 s.
    assert pipeline.silent_inputs(BEGIN + 120 * MS) == {'m1': BEGIN + MS}


def test_input_at_its_stop_publishes_the_commanded_effort():
    pipeline = pipeline_of(PUSHED % ('{m1: {start: 0.55}}', '[0, 0, 0]'), ANKLE)
    for time in range(400):
        now = BEGIN + time * MS
        if time % 50 == 0:
            pipeline.offer(serialized(['m1'], efforts=[0.3]), now)
        state = read_joint_state(pipeline.tick(now).message)
    assert (state.position[0], state.velocity[0]) == (0.6, 0.0)
    assert tuple(state.effort[:2]) == (0.3, 0.0)


REFUSED = {
    'stiff motor': (
        {'motor': MotorParameters(50.0, resistance=1e-3, command='voltage')},
        'drive.torque.motor: it follows its voltage too fast',
    ),
    'start': (
        {'inputs': {'left_crank_joint': TorqueInput(3.1)}},
        'drive.torque.inputs.left_crank_joint.start: at 3.1 rad, 0 rad nothing can be moved',
    ),
}


@pytest.mark.parametrize('name', REFUSED)
def test_torque_drive_refuses_unmovable_inputs(name):
    parameters, line = REFUSED[name]
    with pytest.raises(DefinitionError) as caught:
        five_bar(**parameters)
    assert str(caught.value).startswith(line)


def test_friction_curve_too_steep_for_the_step_is_refused():
    drive, closure = TorqueDrive(inputs=START), closed('five_bar')
    steep = JointFriction(breakaway=50.0, stribeck=1e-4)
    line = r'effects\.friction\.joints\.P\.stribeck: the curve is too steep'
    with pytest.raises(DefinitionError, match=line):
        drive.build(context_of(closure, friction=Friction({'P': steep})))
    drive.build(context_of(closure, friction=Friction({'P': JointFriction(0.1, 0.2)})))


BRAKED = b"""
drive: {torque: {start: 0, timeout: 0.05, on_timeout: brake, brake: 2}}
loads: {gravity: [0, 0, -9.81]}
effects: {velocity: {}, effort: {}}
"""


def test_brakes_hold_inputs_without_a_command():
    pipeline = pipeline_of(BRAKED, ANKLE)
    pipeline.tick(BEGIN)
    state = read_joint_state(pipeline.tick(BEGIN + 100 * MS).message)
    assert [*state.position[:2], *state.velocity[:2]] == [0.0] * 4
    # The brakes bear the weight of the foot.
    assert 0.0 < max(map(abs, state.effort[:2])) < 2.0
    # An input under a command moves, and the other stays.
    pipeline.offer(serialized(['m1'], efforts=[0.8]), BEGIN + 110 * MS)
    state = read_joint_state(pipeline.tick(BEGIN + 115 * MS).message)
    assert abs(state.velocity[0]) > 0.1
    assert state.position[1] == pytest.approx(0.0, abs=1e-15)
    assert state.effort[0] == 0.8


def test_too_many_impacts_in_the_play_are_reported():
    def pushed(on_chatter):
        play = PlayParameters(1e-6, 1e-3, 1.0, on_chatter)
        crank = five_bar(play=play)
        crank.state(BEGIN)
        crank.offer(EffortCommand(0, (3.0, 3.0)), BEGIN)
        crank.state(BEGIN + 3 * MS)
        return crank.chatter_count

    assert pushed('close') > 0
    line = 'drive.torque.play: motor and crank meet and part too often'
    with pytest.raises(LinkageError, match=line):
        pushed('end')


def test_dependent_joint_limit_stops_the_torque_drive():
    closure = weighed('ankle_motors')
    hinges = dict(closure.linkage.hinges)
    hinges['pitch'] = replace(hinges['pitch'], limits=Limits(-0.5, 0.5))
    limited = type(closure)(replace(closure.linkage, hinges=hinges), closure.name)
    crank = TorqueDrive().build(context_of(limited, Loads((0.0, 0.0, -9.81))))
    crank.state(BEGIN)
    pitch = limited.joint_names.index('pitch')
    for time in range(1, 60):
        crank.offer(EffortCommand(0, (3.0, 3.0)), BEGIN + 10 * time * MS)
        state = crank.state(BEGIN + 10 * time * MS)
        value = limited.close_unlimited(*state.angles).joints[pitch]
        assert abs(value) <= 0.5 + 1e-9
    stiff = Loads(applied=AppliedLoads({'pitch': JointSpring(1e9)}))
    with pytest.raises(DefinitionError, match=r'loads\.joint_springs\.pitch: it is too stiff'):
        TorqueDrive().build(context_of(closure, stiff))
