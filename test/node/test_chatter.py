# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Motor and crank behind play that meet too often: the node keeps ticking, and says so."""

from linkage_ros.messages import EffortCommand
from linkage_ros.node import chatter_count, CountsSnapshot, DiagnosticsSummary, Warnings
from linkage_ros.tick import TickLoop
from sensor_msgs.msg import JointState

from .graph import NS, stamp_of, wait_for
from .test_lost_ticks import Said
from .test_silence import publishing, WARN
from ..support.scenes import LINKAGES, pipeline_of

SCENE = """
rate: 100
drive: {torque: {start: 1.0, timeout: 0.5, play: {width: 0.02, inertia: 2.0e-4, restitution: 0.5}}}
loads: {drive_inertia: 0.001}
effects: {velocity: {}}
"""
BEGIN = 1_700_000_000 * NS
LINKAGE = (LINKAGES / 'four_bar.yaml').read_text()


def loop_of(scene=SCENE):
    return TickLoop(lambda: pipeline_of(scene, LINKAGE), None, lambda _: None)


def run(loop, begin, end):
    """Tick a loop from one [ms] to another under 5 N·m."""
    (linkage,) = loop.pipeline.linkages
    for time_ms in range(begin, end, 10):
        assert linkage.drive.offer(EffortCommand(0, 5.0), BEGIN + time_ms * 1_000_000) is None
        loop.tick_at(BEGIN + time_ms * 1_000_000)


def summary(loop, before):
    now = CountsSnapshot.take(loop.counts, BEGIN + NS, chatter_count(loop.pipeline.linkages))
    return now, DiagnosticsSummary(
        'node', 's', 0.0, BEGIN, '', (), loop, before, now, '',
        {'transmission_angle': 0.0, 'conditioning': 0.0, 'toggle_distance': 0.0},
    ).make_statuses()[0]  # fmt: skip


def test_it_is_told_once_for_each_new_step():
    loop, lines = loop_of(), Said()
    warnings, before = Warnings(lines), CountsSnapshot()
    warnings.check_chatter(loop.pipeline.linkages, 0.0)
    before, status = summary(loop, before)
    assert (status.message, lines) == ('Ticking', [])
    run(loop, 0, 1000)
    steps = chatter_count(loop.pipeline.linkages)
    assert steps > 10
    warnings.check_chatter(loop.pipeline.linkages, 0.0)
    warnings.check_chatter(loop.pipeline.linkages, 0.0)
    (line,) = lines
    assert f'too often in {steps} steps' in line
    assert 'shorten the step' in line
    before, status = summary(loop, before)
    assert status.level == WARN
    assert 'Motor and crank meet and part too often' in status.message
    assert str(steps) in [value.value for value in status.values]
    assert summary(loop, before)[1].message == 'Ticking'
    # A reset counts anew.
    loop.reset_requested = True
    loop.tick_at(BEGIN + NS)
    warnings.check_chatter(loop.pipeline.linkages, 0.0)
    run(loop, 1010, 2000)
    warnings.check_chatter(loop.pipeline.linkages, 0.0)
    assert f'too often in {chatter_count(loop.pipeline.linkages)} steps' in lines[-1]


def test_a_run_that_ends_says_why_in_a_line():
    ends = SCENE.replace('restitution: 0.5', 'restitution: 0.5, on_chatter: end')
    loop = loop_of(ends)
    loop.start(lambda loop, _stopping: run(loop, 0, 2000))
    loop.stop()
    assert loop.failure.startswith('drive.torque.play: motor and crank meet and part too often')
    assert 'on_chatter: close' in loop.failure


def test_a_node_ticks_on_and_claims_no_silence(graph, write_scene, start):
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
