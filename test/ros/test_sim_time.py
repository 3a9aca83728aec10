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


"""With use_sim_time the node lives on /clock, whatever the machine's clock does."""

import time

import pytest
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from .graph import crank, NS, stamp_of, wait_for

BEGIN = 100 * NS


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
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(self.now, NS)
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


def test_it_ticks_as_the_clock_does(simulation):
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


def test_age_is_measured_in_simulated_time(simulation):
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


def test_a_jump_back_starts_anew(simulation, graph):
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


def test_rate_0_judges_stamps_by_the_clock(graph, write_scene, start):
    start(write_scene('sim_every_sample', 'rate: 0'), '-p', 'use_sim_time:=true')
    simulation = Simulation(graph)
    simulation.run_until_heard()
    assert stamp_of(simulation.heard[-1]) <= simulation.now
