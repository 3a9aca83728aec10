# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Hardware in the loop: a controller in a process of its own moves the crank of `torque_crank`.

The linkage is that of config/linkages/four_bar.yaml, worked out here by complex numbers: where
the controller holds it, weight, friction and command balance.
"""

from cmath import exp
from math import inf, nan
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from builtin_interfaces.msg import Time
from linkage_ros.bag import read_bag
from linkage_ros.replay import recorded_scene, replay_ticks
import pytest
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from .graph import PATIENCE, stamp_of, wait_for
from .loops import A, D, four_bar, rates
from .test_silence import publishing, STALE

SCENE = Path(__file__).parents[2] / 'config' / 'scenes' / 'torque_crank.yaml'
TARGET, KP = 2.0, 1.0
STANDS = 100
"""So many joint states of one position and no rates are a standstill: 0.1 s."""


class Controller:
    """`pd_controller`, as a process."""

    def __init__(self, graph, folder, *parameters):
        environment = os.environ | {
            'ROS_DOMAIN_ID': str(graph.domain),
            'ROS_LOG_DIR': str(folder),
        }
        command = [sys.executable, '-m', 'linkage_ros.node.pd_controller', '--ros-args']
        for parameter in (f'target:={TARGET}', f'kp:={KP}', *parameters):
            command += ['-p', parameter]
        self.process = subprocess.Popen(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )

    def wait(self):
        """Return exit code and all that it has said, once it has ended."""
        said, _ = self.process.communicate(timeout=PATIENCE)
        return self.process.returncode, said

    def end(self, number=signal.SIGINT):
        self.process.send_signal(number)
        return self.wait()


@pytest.fixture
def control(graph, folder):
    """Return a function that starts a controller; what still runs at the end is killed."""
    controllers = []

    def control(*parameters):
        controllers.append(Controller(graph, folder, *parameters))
        return controllers[-1]

    yield control
    for controller in controllers:
        if controller.process.poll() is None:
            controller.end(signal.SIGKILL)


@pytest.fixture
def states(graph):
    return graph.listen(JointState, '/joint_states')


@pytest.fixture
def falling(folder):
    """Return the scene without its brake, and with a pin that ends a swing soon."""
    text = SCENE.read_text()
    for said, instead in (
        ('on_timeout: brake', 'on_timeout: zero'),
        ('brake: 0.2', 'brake: 0'),
        ('viscous: 1.0e-4', 'viscous: 0.006'),
        ('../linkages', f'{SCENE.parents[1]}/linkages'),
    ):
        assert said in text
        text = text.replace(said, instead)
    (folder / 'falling.yaml').write_text(text)
    return folder / 'falling.yaml'


def weight(theta):
    """Return the potential energy of the linkage, in [J]."""
    coupler, rocker = four_bar(theta)
    crank, coupler = exp(1j * theta), exp(1j * (theta + coupler))
    places = (
        (0.025, 0.020 * crank),
        (0.100, A * crank + (0.060 + 0.005j) * coupler),
        (0.050, D + 0.040 * exp(1j * rocker)),
    )
    return sum(mass * 9.81 * place.imag for mass, place in places)


def slope_of_the_weight(theta):
    """Return what holds the weight, in [N·m]."""
    return (weight(theta + 1e-6) - weight(theta - 1e-6)) / 2e-6


def friction(theta):
    """Return what the friction of the pins holds, in [N·m], by the rates of link on link."""
    coupler, rocker = rates(four_bar, theta, 1.0)
    # In the order of the scene: O2, A, B, O4. B turns by rocker less coupler, both to the ground.
    return 0.002 + 0.001 * (abs(coupler) + abs(rocker - (1.0 + coupler)) + abs(rocker))


def stands(states):
    """Return the last state, once the linkage stands still."""
    last = states[-STANDS:]
    alike = {(*state.position, *state.velocity) for state in last}
    if len(last) == STANDS and len(alike) == 1 and list(last[-1].velocity) == [0.0, 0.0, 0.0]:
        return last[-1]
    return None


def is_near_target(state):
    return abs(state.position[0] - TARGET) < 0.05


def wait_until_it_stands(states, where=lambda state: True):
    return wait_for(lambda: (state := stands(states)) and where(state) and state, 'standstill')


def replays(folder):
    """Return whether the bag in a folder replays to the same bytes, and its joint states."""
    (path,) = folder.iterdir()
    bag = read_bag(path)
    again = list(replay_ticks(bag, recorded_scene(bag)))
    assert again
    return all(each.recorded == each.tick.message for each in again), len(again)


def test_controller_holds_the_crank_and_the_brake_follows(graph, folder, start, control, states):
    runs = folder / 'closed_loop'
    node = start(SCENE, '-p', f'runs_directory:={runs}')
    controller = control()
    held = wait_until_it_stands(states, is_near_target)
    # The command is what weight and friction ask for, no more and no less.
    theta = held.position[0]
    assert abs(KP * (TARGET - theta) - slope_of_the_weight(theta)) <= friction(theta) + 1e-6
    # At rest the drive exerts what is commanded; friction bears the difference from the weight.
    assert held.effort[0] == pytest.approx(KP * (TARGET - theta), abs=1e-9)
    count = len(states)
    wait_for(lambda: len(states) > count + 1000, 'a second more')
    assert {tuple(state.position) for state in states[count:]} == {tuple(held.position)}
    assert controller.end() == (0, '')
    # Another one, that swings it, is killed while it moves.
    swinging = control('target:=3.0', 'swing:=0.3', 'period:=1.0')
    wait_for(lambda: abs(states[-1].position[0] - 3.0) < 0.1, 'the other target')
    count = len(states)
    wait_for(lambda: len(states) > count + 1000, 'a swing')
    wait_for(lambda: abs(states[-1].velocity[0]) > 1.0, 'motion')
    os.kill(swinging.process.pid, signal.SIGKILL)
    before = states[-1]
    status = graph.wait_for_level('crank', STALE)
    assert status.message.startswith('No command for ')
    assert status.message.endswith(': the brake of 0.2 N·m holds crank_joint')
    braked = wait_until_it_stands(states)
    assert stamp_of(braked) > stamp_of(before)
    theta = braked.position[0]
    assert abs(slope_of_the_weight(theta)) > 2 * friction(theta)  # which alone would not hold it
    count = len(states)
    wait_for(lambda: len(states) > count + 300, 'some time more')
    assert tuple(states[-1].position) == tuple(braked.position)
    assert node.end() == 0
    assert 'Traceback' not in node.log
    same, published = replays(runs)
    assert same
    assert published >= len(states)


def test_crank_without_a_brake_falls_and_ignores_nan(
    graph, folder, falling, start, control, states
):
    runs = folder / 'falls'
    node = start(falling, '-p', f'runs_directory:={runs}')
    controller = control()
    wait_until_it_stands(states, is_near_target)
    os.kill(controller.process.pid, signal.SIGKILL)
    wait_for(lambda: not is_near_target(states[-1]), 'the fall')
    # It comes to rest where friction holds the weight.
    fallen = wait_until_it_stands(states)
    assert abs(slope_of_the_weight(fallen.position[0])) <= friction(fallen.position[0]) + 1e-6
    spoilt = iter([nan, inf, -inf, 1e11] * 10_000)
    publisher = graph.publisher(JointState, '/crank_commands')
    with publishing(publisher, lambda: JointState(name=['crank_joint'], effort=[next(spoilt)])):
        for why in ('effort not finite', 'effort beyond 1e10'):
            wait_for(lambda: graph.value('crank', f'Rejected: {why}') > '0', why)  # noqa: B023
    assert graph.next_status('crank').level == STALE
    assert tuple(states[-1].position) == tuple(fallen.position)
    assert node.end() == 0
    same, _ = replays(runs)
    assert same


def test_controller_survives_an_invalid_clock(graph, control):
    controller = control('use_sim_time:=true')
    clock = graph.publisher(Clock, '/clock')
    wait_for(clock.get_subscription_count, 'a subscription to /clock')
    for _ in range(10):
        clock.publish(Clock(clock=Time(sec=-5)))
        time.sleep(0.05)
    assert controller.end() == (0, ''), 'no complaint'


def test_controller_without_its_joint_publishes_nothing(graph, control):
    commands = graph.listen(JointState, '/crank_commands')
    states = graph.publisher(JointState, '/joint_states')
    numbers = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
    controllers = [control('rate:=100.0') for _ in numbers]
    wait_for(lambda: graph.node.count_publishers('/crank_commands') == 3, 'three controllers')
    joint = JointState(name=['another'], position=[0.0], velocity=[0.0])
    positions_alone = JointState(name=['crank_joint'], position=[0.0])
    velocities_alone = JointState(name=['crank_joint'], velocity=[0.0])
    for message in (joint, positions_alone, velocities_alone):
        with publishing(states, lambda: message):  # noqa: B023
            wait_for(lambda: states.get_subscription_count() == 3, 'three subscribers')
            time.sleep(0.3)
    assert commands == []
    told = JointState(name=['another', 'crank_joint'], position=[9.0, 1.5], velocity=[9.0, 2.0])
    with publishing(states, lambda: told):
        wait_for(lambda: len(commands) > 10, 'commands')
    for command in commands:
        assert command.name == ['crank_joint']
        # kp·(2.0 − 1.5) − kd·2.0
        assert list(command.effort) == [pytest.approx(0.5 - 0.05 * 2.0)]
        assert stamp_of(command) > 0
    for controller, number in zip(controllers, numbers, strict=True):
        assert controller.end(number) == (0, '')


def test_controller_commands_only_joints_with_a_state(graph, control):
    commands = graph.listen(JointState, '/crank_commands')
    states = graph.publisher(JointState, '/joint_states')
    given = ('joints:=[left, right]', 'right.target:=3.0', 'kd:=0.5', 'left.kd:=0.25')
    controller = control(*given, 'rate:=100.0')
    both = JointState(
        name=['right', 'x', 'left'], position=[1.0, 9.0, 1.5], velocity=[2.0, 9.0, 4]
    )
    alone = JointState(name=['left'], position=[1.5], velocity=[4.0])
    # kp·(target − q) − kd·q̇
    left = pytest.approx(1.0 * (TARGET - 1.5) - 0.25 * 4.0)
    right = pytest.approx(1.0 * (3.0 - 1.0) - 0.5 * 2.0)

    def commanded():
        return dict(zip(commands[-1].name, commands[-1].effort, strict=True)) if commands else {}

    for message, efforts in ((both, {'left': left, 'right': right}), (alone, {'left': left})):
        with publishing(states, lambda: message):  # noqa: B023
            wait_for(lambda: commanded() == efforts, 'commands of what was heard')  # noqa: B023
    assert controller.end() == (0, '')


def test_controller_ends_after_its_time_or_names_errors(control):
    bounded, wrong = control('seconds:=0.3'), control('kp:=-1.0')
    assert bounded.wait() == (0, '')
    code, said = wrong.wait()
    assert code == 2
    (line,) = said.splitlines()
    assert 'pd_controller: ' in line
    assert 'kp' in line
