# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Faults that somebody asks for: they are told, they do what they say, and the bag replays them.

One node goes through all of them, each begun and ended by its service.
"""

import json
import time

from lifecycle_msgs.msg import Transition
from linkage_ros.bag import read_bag
from linkage_ros.replay import recorded_scene, replay_ticks
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool

from .graph import stamp_of, wait_for
from .turning import turning

OK, WARN, ERROR = b'\0', b'\1', b'\2'
ENOUGH = 100
"""Joint states that show what a fault does."""

SCENE = """
rate: 500
effects: {velocity: {}}
drive: {topic: {max_age: 2.0}}
faults:
  frozen: {freeze: {}}
  stiff: {stuck: {joint: rocker_joint}}
  snapped: {broken_link: {link: coupler}}
  pulled: {silence: {}, at: [0.2], seconds: 0.2}
  spoilt: {not_a_number: {}}
  ahead: {time_jump: {by: 1.0}}
"""
ALL = ['frozen', 'stiff', 'snapped', 'pulled', 'spoilt', 'ahead']


def frozen(states):
    assert len({(*state.position, *state.velocity) for state in states}) == 1
    assert len({stamp_of(state) for state in states}) == len(states)


def stiff(states):
    coupler, rocker = zip(*(state.position for state in states), strict=True)
    assert len(set(rocker)) == 1
    assert len(set(coupler)) > ENOUGH // 2
    assert {state.velocity[1] for state in states} == {0.0}


def still_moving(states):
    for place in (0, 1):
        assert len({state.position[place] for state in states}) > ENOUGH // 2


WITH_STATES = {'frozen': frozen, 'stiff': stiff, 'spoilt': still_moving, 'ahead': still_moving}
"""What each shows in the joint states; with the others there are none."""


class Drill:
    """A node with faults, and what the tests hear of it."""

    def __init__(self, graph, node, states):
        self.graph = graph
        self.node = node
        self.states = states

    def inject(self, name, on):
        """Let a fault begin or end; return once the diagnostics tell it."""
        request = SetBool.Request(data=on)
        answer = self.graph.call(SetBool, f'/linkage_node/inject/{name}', request)
        assert answer.success
        status = self.graph.wait_for_level('faults', WARN if on else OK)
        assert status.message == (f'Injected: {name}' if on else 'None injected')

    def newly_heard(self):
        """Return as many joint states as show something, all of which came after this call."""
        self.states.clear()
        wait_for(lambda: len(self.states) > ENOUGH, 'joint states')
        return self.states.copy()


@pytest.fixture
def drill(graph, folder, write_scene, start):
    states = graph.listen(JointState, '/joint_states')
    scene = write_scene('drill', f'{SCENE}\nrecord: {{directory: {folder}, name: drilled}}')
    with turning(graph.publisher(JointState, '/crank_states')):
        yield Drill(graph, start(scene), states)


def changes(graph):
    """Return what the topic of the faults tells to one who asks now: all that there was."""
    heard = []
    latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    subscription = graph.node.create_subscription(
        String, '/linkage_node/faults', heard.append, latched
    )
    wait_for(lambda: len(heard) >= 2 * len(ALL) + 2, 'all changes')
    graph.node.destroy_subscription(subscription)
    return [
        (said['fault'], said['injected']) for said in (json.loads(each.data) for each in heard)
    ]


def test_faults_by_service_are_recorded_and_replayed(graph, folder, drill):
    # By itself first, and once.
    wait_for(lambda: graph.value('faults', 'Times injected: pulled') == '1', 'the timeline')
    graph.wait_for_level('faults', OK)
    drill.newly_heard()
    for name, shows in WITH_STATES.items():
        drill.inject(name, True)
        heard = drill.newly_heard()
        assert (stamp_of(heard[-1]) > time.time_ns()) == (name == 'ahead')
        shows(heard)
        if name == 'spoilt':
            rejected = graph.value('crank', 'Rejected: position or rate not finite')
            assert int(rejected) > 0
        drill.inject(name, False)
        still_moving(drill.newly_heard())
    for name in ('snapped', 'pulled'):
        drill.inject(name, True)
        drill.states.clear()
        level = ERROR if name == 'snapped' else OK
        graph.wait_for_level('loop closure', level)
        assert drill.states == []
        drill.inject(name, False)
        still_moving(drill.newly_heard())
    assert graph.value('tick', 'Clock jumps back') == '1'
    asked = [(name, on) for name in (*WITH_STATES, 'snapped', 'pulled') for on in (True, False)]
    assert changes(graph) == [('pulled', True), ('pulled', False), *asked]
    assert drill.node.end() == 0
    assert 'Traceback' not in drill.node.log
    bag = read_bag(folder / 'drilled')
    again = list(replay_ticks(bag, recorded_scene(bag)))
    assert len(again) > 1000
    assert all(each.recorded == each.tick.message for each in again)


def test_inactive_node_refuses_to_inject_a_fault(graph, write_scene, start):
    node = start(write_scene('still', SCENE), '-p', 'autostart:=false', ready='')
    assert graph.change_state(Transition.TRANSITION_CONFIGURE)
    answer = graph.call(SetBool, '/linkage_node/inject/frozen', SetBool.Request(data=True))
    assert not answer.success
    assert answer.message == 'not active: nothing to inject into'
    assert node.end() == 0
