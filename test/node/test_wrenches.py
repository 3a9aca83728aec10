# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Wrenches that come on topics: recorded at the ticks that took them, replayed, counted, refused.

The linkage is a crank alone; its inertia about the pivot is 0.23 kg·m².
"""

from dataclasses import replace
from math import nan

from geometry_msgs.msg import WrenchStamped
from linkage_ros.bag import read_bag
from linkage_ros.messages import JointStateWriter, Rejection
from linkage_ros.replay import recorded_scene, replay_all, replay_ticks
import pytest
from sensor_msgs.msg import JointState

from .graph import stamp_of, wait_for
from .test_silence import publishing, STALE
from .ticked import Moment, run
from ..support.messages import wrench_stamped
from ..support.scenes import PENDULUM

MS = 1_000_000
BEGIN = 1_700_000_000_000 * MS
INERTIA = 0.05 + 2.0 * 0.3**2
LOADS = 'loads: {wrenches: {crank: {point: end, frame: link, max_age: 0.05}}}\n'
SCENES = {
    # The first has the tick that is generated for it, the others have not.
    'moved': 'drive: {torque: {}}\neffects: {velocity: {}}\n',
    'moved, with forces': 'drive: {torque: {}}\neffects: {effort: {}, pin_forces: {}}\n',
    'held': 'drive: {constant_rate: {rate: 3}}\neffects: {effort: {}}\n',
    'measured, at its samples': 'rate: 0\ndrive: {topic: {}}\neffects: {pin_forces: {}}\n',
}


def moments(resets, jumps):
    """Yield 300 ticks; wrenches come in bursts, and a crank for the drive that wants one."""
    write, now = JointStateWriter(['drive_joint']).write, BEGIN
    for index in range(300):
        now += MS + 137 * index + MS * jumps.get(index, 0)
        wrenches = ()
        if index % 80 < 20 and index % 3:
            wrenches = ((0, wrench_stamped(1.0, 0.02 * index, nan if index % 5 == 0 else 0.3)),)
        sample = write(now - MS // 9, [0.01 * index], [10.0], [0.1])
        yield Moment(now, (sample,), index in resets, wrenches=wrenches)


@pytest.fixture
def recorded(tmp_path):
    """Return a function that runs a scene through moments, into a bag."""

    def record(name, resets=(), jumps=None):
        (tmp_path / 'pendulum.yaml').write_text(PENDULUM)
        scene = tmp_path / 'scene.yaml'
        scene.write_text(f'linkage: pendulum.yaml\n{SCENES[name]}{LOADS}')
        return run(tmp_path / 'bag', scene, moments(resets, jumps or {}))

    return record


@pytest.mark.parametrize('jumps', [{}, {150: -90, 200: 400}], ids=['steady', 'with jumps'])
@pytest.mark.parametrize('name', SCENES)
def test_run_with_wrenches_replays_to_the_same_bytes(recorded, name, jumps):
    done = recorded(name, resets={90}, jumps=jumps)
    (counts,) = done.loop.counts.wrenches
    assert counts.received == 53
    assert counts.rejected[Rejection.WRENCH_NOT_FINITE] == sum(counts.rejected.values()) == 10
    again = list(replay_all(done.bag, recorded_scene(done.bag), done.bag.messages()))
    assert [each.tick.message for each in again if each.recorded] == done.published
    assert [extra for each in again for extra in each.tick.extras if extra] == done.extras
    assert len(done.published) > 250


@pytest.mark.parametrize('name', SCENES)
def test_run_without_its_wrenches_replays_differently(recorded, name):
    done = recorded(name)
    scene = recorded_scene(done.bag)
    others = [each for each in done.bag.messages() if each.topic != '/wrench_0']
    again = list(replay_all(done.bag, scene, others))
    found = [[each.tick.message, *each.tick.extras] for each in again]
    assert found != [[each.recorded, *each.recorded_extras] for each in again]


def test_bag_with_surplus_wrench_topics_is_readable(recorded):
    done = recorded('held')
    scene = recorded_scene(done.bag)
    (scene_linkage,) = scene.linkages
    loads = replace(scene_linkage.loads, applied=type(scene_linkage.loads.applied)())
    bare = replace(scene, linkages=(replace(scene_linkage, loads=loads),))
    assert len(list(replay_ticks(done.bag, bare))) == len(done.published)


def wrench(torque):
    message = WrenchStamped()
    message.wrench.torque.z = torque
    return message


def test_wrench_topic_moves_the_crank_and_counts_nan(graph, folder, start, write_scene):
    # Valid for so long that a loaded machine does not publish too late.
    loads = LOADS.replace('0.05', '1.0')
    record = f'record: {{directory: {folder}, name: pushed}}'
    scene = write_scene('pushed', f'{SCENES["moved"]}{loads}{record}', PENDULUM)
    node = start(scene)
    assert 'wrenches from /wrenches/crank' in node.log
    states = graph.listen(JointState, '/joint_states')
    publisher = graph.publisher(WrenchStamped, '/wrenches/crank')
    status = graph.wait_for_level('wrenches', STALE)
    assert status.message == 'No messages, so no load: wrenches/crank'
    wait_for(lambda: states, 'joint states')
    with publishing(publisher, lambda: wrench(nan)):
        reason = 'Rejected: wrenches/crank: force or torque not finite'
        wait_for(lambda: graph.value('wrenches', reason) > '0', 'rejections')
        node.wait_for_log('wrenches rejected: force or torque not finite')
    assert {tuple(state.velocity) for state in states} == {(0.0, 0.0)}
    with publishing(publisher, lambda: wrench(0.5)):
        wait_for(lambda: states[-1].velocity[0] > 1.0, 'motion')
        wait_for(lambda: graph.status('wrenches').message == 'Wrenches arriving', 'no complaint')
    # While it was pushed, the rate has grown by 0.5 N·m over the inertia, in [rad/s²].
    one = next(n for n, state in enumerate(states) if state.velocity[0] > 0.2)
    other = next(n for n, state in enumerate(states) if state.velocity[0] > 0.9)
    seconds = stamp_of(states[other]) - stamp_of(states[one])
    grown = states[other].velocity[0] - states[one].velocity[0]
    assert grown == pytest.approx(0.5 / INERTIA * seconds * 1e-9, rel=0.01)
    graph.wait_for_level('wrenches', STALE)
    count = len(states)
    wait_for(lambda: len(states) > count + 100, 'some time more')
    assert len({state.velocity[0] for state in states[count:]}) == 1, 'nothing pushes it any more'
    assert node.end() == 0
    bag = read_bag(folder / 'pushed')
    again = list(replay_ticks(bag, recorded_scene(bag)))
    assert len(again) >= len(states)
    assert all(each.recorded == each.tick.message for each in again)


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', ['crank_commands', 'joint_states', 'diagnostics'])
def test_wrench_topic_remapped_to_another_topic_is_refused(start, write_scene, name):
    scene = write_scene('clash', f'{SCENES["moved"]}{LOADS}', PENDULUM)
    node = start(scene, '-r', f'wrenches/crank:={name}', ready='')
    node.wait_for_log(f'loads.wrenches.crank.topic: /{name} is another topic of the node; write')
    assert node.process.wait(20) == 2
    assert 'Traceback' not in node.log
