# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Motor and crank behind play that meet too often: the node keeps ticking, and says so."""

from linkage_ros.messages import EffortCommand
from linkage_ros.node import Warnings
from linkage_ros.tick import TickLoop
from sensor_msgs.msg import JointState

from .graph import NS, stamp_of, wait_for
from .observed import BEGIN, observe, Said, status_of
from .test_silence import publishing, WARN
from ..support.scenes import LINKAGES, pipeline_of

SCENE = """
rate: 100
drive: {torque: {start: 1.0, timeout: 0.5, play: {width: 0.02, inertia: 2.0e-4, restitution: 0.5}}}
loads: {drive_inertia: 0.001}
effects: {velocity: {}}
"""
LINKAGE = (LINKAGES / 'four_bar.yaml').read_text()


def loop_of(scene=SCENE):
    return TickLoop(lambda: pipeline_of(scene, LINKAGE), None, lambda _: None)


def run(loop, begin, end):
    """Tick a loop from one [ms] to another under 5 N·m."""
    (linkage,) = loop.pipeline.linkages
    for time_ms in range(begin, end, 10):
        assert linkage.drive.offer(EffortCommand(0, (5.0,)), BEGIN + time_ms * 1_000_000) is None
        loop.tick_at(BEGIN + time_ms * 1_000_000)


def test_node_warns_once_of_each_step_with_chatter():
    loop, lines = loop_of(), Said()
    before = loop.read_counts(BEGIN)
    warnings = Warnings(lines, before)

    def tell():
        nonlocal before
        state = observe(loop, rate=0.0)
        for _ in range(2):
            warnings.warn_of_conditions(state, 0.0)
        status, values = status_of(state, 'tick', before)
        before = state.counts
        return sum(before.chatter), status, values

    assert tell()[1].message == 'Ticking'
    run(loop, 0, 1000)
    steps, status, values = tell()
    assert steps > 10
    (line,) = lines
    assert f'too often in {steps} steps' in line
    assert 'shorten the step' in line
    assert (status.level, status.message) == (WARN, line)
    assert str(steps) in values.values()
    assert tell()[1].message == 'Ticking'
    # A reset does not count them again.
    loop.reset_requested = True
    loop.tick_at(BEGIN + NS)
    assert tell()[1].message == 'Ticking'
    run(loop, 1010, 2000)
    more, *_ = tell()
    assert [line, f'too often in {more - steps} steps' in lines[-1]] == [lines[0], True]
    assert len(lines) == 2


def test_run_ended_by_chatter_names_the_cause():
    ends = SCENE.replace('restitution: 0.5', 'restitution: 0.5, on_chatter: end')
    loop = loop_of(ends)
    loop.start(lambda loop, _stopping: run(loop, 0, 2000))
    loop.stop()
    assert loop.failure.startswith('drive.torque.play: motor and crank meet and part too often')
    assert 'on_chatter: close' in loop.failure


def test_node_keeps_ticking_under_chatter(graph, write_scene, start):
    scene = SCENE.partition('\n')[2]
    node = start(write_scene('chatter', scene, 'four_bar'))
    publisher = graph.publisher(JointState, '/crank_commands')
    joint_states = graph.listen(JointState, '/joint_states')
    command = JointState(name=['crank_joint'], effort=[5.0])
    with publishing(publisher, lambda: command):
        node.wait_for_log('met and parted too often')
        first = stamp_of(joint_states[-1])
        wait_for(lambda: stamp_of(joint_states[-1]) - first > 3 * NS, 'three more seconds')
    assert 'no message on' not in node.log
    assert node.end() == 0
