# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""With use_sim_time the node lives on /clock, whatever the machine's clock does."""

import time

from lifecycle_msgs.msg import Transition
import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

from .graph import crank, NS, stamp_of, wait_for

BEGIN = 100 * NS
STALE = b'\3'


class Simulation:
    """A simulator: time goes on when `run` says so."""

    def __init__(self, graph):
        self.graph = graph
        self.heard = graph.listen(JointState, '/joint_states')
        self._clock = graph.publisher(Clock, '/clock')
        self._crank = graph.publisher(JointState, '/crank_states')
        self.now = BEGIN
        wait_for(self._clock.get_subscription_count, 'a subscription to /clock')

    def step(self, step, *, turning=True):
        """Advance by `step` ns; the crank turns at 1 rad/s of simulated time."""
        self.now += step
        if turning:
            self._crank.publish(crank(self.now / NS, 1.0, self.now))
        self.say(*divmod(self.now, NS))

    def say(self, sec, nanosec):
        """Send a message on /clock, whatever it says."""
        message = Clock()
        message.clock.sec, message.clock.nanosec = sec, nanosec
        self._clock.publish(message)
        time.sleep(0.005)

    def run_until_heard(self):
        """Run until the node answers: what is sent before discovery gets lost."""
        self.heard.clear()
        wait_for(lambda: self.step(10_000_000) or self.heard, 'a joint state')


@pytest.fixture
def simulation(graph, write_scene, start):
    start(write_scene('sim', 'rate: 50'), '-p', 'use_sim_time:=true')
    return Simulation(graph)


def test_node_ticks_at_times_of_the_simulated_clock(simulation):
    simulation.run_until_heard()
    begin = simulation.now
    for _ in range(100):
        simulation.step(10_000_000)
    wait_for(lambda: stamp_of(simulation.heard[-1]) > begin + 0.9 * NS, 'the last tick')
    stamps = [stamp_of(m) for m in simulation.heard if stamp_of(m) > begin]
    assert stamps == sorted(set(stamps))
    # 1 s at 50 Hz, in which a best-effort /clock may lose a few.
    assert 40 <= len(stamps) <= 51
    assert all(stamp % 10_000_000 == 0 for stamp in stamps), 'at the clock’s own times'
    time.sleep(0.3)
    count = len(simulation.heard)
    time.sleep(0.5)
    assert len(simulation.heard) == count, 'a simulation that stands still has no ticks'


def test_sample_age_is_measured_in_simulated_time(simulation):
    simulation.run_until_heard()
    time.sleep(0.5)  # an age of 0, though more than max_age has passed on this machine
    simulation.heard.clear()
    for _ in range(5):
        simulation.step(20_000_000, turning=False)
    wait_for(lambda: simulation.heard, 'ticks that carry the sample forward')
    for _ in range(20):
        simulation.step(20_000_000, turning=False)
    time.sleep(0.2)
    simulation.heard.clear()
    for _ in range(10):
        simulation.step(20_000_000, turning=False)
    time.sleep(0.2)
    assert simulation.heard == []


def test_clock_jump_back_forgets_earlier_samples(simulation, graph):
    simulation.run_until_heard()
    for _ in range(20):
        simulation.step(10_000_000)
    simulation.heard.clear()
    simulation.now = BEGIN - 50 * NS
    for _ in range(10):
        simulation.step(10_000_000, turning=False)
    time.sleep(0.2)
    # What was sent before the jump and got taken after it has stamps of the future.
    assert all(stamp_of(message) > BEGIN - NS for message in simulation.heard)
    simulation.heard.clear()
    simulation.run_until_heard()
    assert stamp_of(simulation.heard[-1]) < BEGIN - 40 * NS
    graph.diagnostics.clear()
    wait_for(lambda: graph.value('tick', 'Clock jumps back') == '1', 'the count of jumps')


def test_rate_0_judges_stamps_by_the_simulated_clock(graph, write_scene, start):
    start(write_scene('sim_every_sample', 'rate: 0'), '-p', 'use_sim_time:=true')
    simulation = Simulation(graph)
    simulation.run_until_heard()
    assert stamp_of(simulation.heard[-1]) <= simulation.now


LARGEST = 2**31 - 1
ATTACKS = {
    'negative': ((-5, 0), 'refused'),
    'the most negative': ((-(2**31), 0), 'refused'),
    'a second of nanoseconds': ((100, NS), 'refused'),
    'the most nanoseconds': ((100, 2**32 - 1), 'refused'),
    'both at their ends': ((LARGEST, 2**32 - 1), 'refused'),
    'back to zero': ((0, 0), 'a jump'),
    'a leap of 1e9 s': ((10**9, 0), 'a jump'),
    'the last second': ((LARGEST, NS - 1), 'a jump'),
}
"""What /clock says once, in the middle of a simulation, and what that is."""

SCENES = {
    'rate 50': 'rate: 50',
    'rate 0': 'rate: 0',
    'jumping': (
        'rate: 50\ndrive: {constant_rate: {rate: 1}}\nfaults: {jump: {time_jump: {by: 10}}}'
    ),
}


@pytest.mark.sample(1)
@pytest.mark.parametrize('text', SCENES)
def test_node_survives_any_clock_message(graph, folder, write_scene, start, text):
    name = text.replace(' ', '_')
    scene = f'{SCENES[text]}\nrecord: {{directory: {folder}, name: {name}}}'
    node = start(write_scene(f'clock_{name}', scene), '-p', 'use_sim_time:=true')
    simulation = Simulation(graph)
    simulation.run_until_heard()
    if 'faults' in SCENES[text]:  # no time that it makes up is beyond those of messages
        assert graph.call(SetBool, '/linkage_node/inject/jump', SetBool.Request(data=True)).success
    refused = 0
    for said, what in ATTACKS.values():
        for _ in range(10):  # /clock is best effort
            simulation.say(*said)
            time.sleep(0.01)
        simulation.run_until_heard()
        assert stamp_of(simulation.heard[-1]) < simulation.now + 20 * NS, 'it is back in time'
        refused += 10 * (what == 'refused')
    assert 'the executor' not in node.log
    assert int(wait_for(lambda: graph.value('tick', 'Clock messages refused'), 'counts')) > 0
    assert int(graph.value('tick', 'Clock messages refused')) <= refused
    assert node.end() == 0
    assert 'Traceback' not in node.log
    assert all(0 <= stamp_of(message) < (LARGEST + 1) * NS for message in simulation.heard)


def test_missing_clock_is_warned_of_and_stale(graph, write_scene, start):
    node = start(
        write_scene('no_clock', 'rate: 50\ndrive: {constant_rate: {rate: 1}}'),
        *('-p', 'use_sim_time:=true', '-p', 'warning_period:=0.5'),
    )
    message = 'No /clock yet: start the simulation, or set use_sim_time: false'
    assert graph.wait_for_level('tick', STALE).message == message
    node.wait_for_log(message)
    simulation = Simulation(graph)
    simulation.run_until_heard()
    wait_for(
        lambda: simulation.step(10_000_000) or graph.next_status('tick').message == 'Ticking',
        'a status that is well',
    )
    assert 'No /clock for' in graph.wait_for_level('tick', STALE).message, 'the clock has stopped'
    simulation.run_until_heard()


def test_use_sim_time_is_refused_while_active(graph, write_scene, start):
    node = start(write_scene('steady', 'rate: 50\ndrive: {constant_rate: {rate: 1}}'))
    heard = graph.listen(JointState, '/joint_states')

    def set_use_sim_time(value):
        value = ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=value)
        request = SetParameters.Request(
            parameters=[ParameterMessage(name='use_sim_time', value=value)]
        )
        return graph.call(SetParameters, '/linkage_node/set_parameters', request).results[0]

    def transit(number):
        assert graph.change_state(number)

    refused = set_use_sim_time(True)
    assert not refused.successful
    assert refused.reason == (
        'use_sim_time cannot change while the node is active; deactivate it first'
    )
    assert set_use_sim_time(False).successful, 'which changes nothing'
    wait_for(lambda: heard, 'joint states')
    transit(Transition.TRANSITION_DEACTIVATE)
    assert set_use_sim_time(True).successful
    transit(Transition.TRANSITION_ACTIVATE)
    simulation = Simulation(graph)
    simulation.run_until_heard()
    assert stamp_of(simulation.heard[-1]) <= simulation.now
    simulation.say(-5, 0)
    simulation.run_until_heard()
    assert node.end() == 0
