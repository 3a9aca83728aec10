# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The last seconds in memory: asked for over the graph, read as any bag, and replayed."""

from contextlib import suppress
import json
from math import cos, sin
import os
import subprocess
import sys
from threading import Event, Thread, Timer
import time
from types import SimpleNamespace

from lifecycle_msgs.msg import Transition
from linkage_ros.bag import BagWriter, QosProfile
from linkage_ros.description import load_scene
from linkage_ros.node import RunRecording
from linkage_ros.replay import describe_topic
import pytest
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from .graph import crank, NS, wait_for
from ..support import disks
from ..support.commands import linkage

REAL_STARTS = True

OK, ERROR = b'\0', b'\2'
INCOMPLETE = 1
NODE = '/linkage_node'
TOPICS = {'/crank_states', '/joint_states', '/diagnostics'}
NOTHING = 'no snapshot was requested: nothing was written'


def scene_text(directory, seconds, more='', rate=200):
    record = f'record: {{directory: {directory}, name: bag, snapshot_seconds: {seconds}{more}}}'
    return f'rate: {rate}\neffects: {{velocity: {{}}}}\n{record}'


@pytest.fixture
def crank_swings(graph):
    """Swing the crank while the test lasts, 200 messages a second."""
    publisher, ending = graph.publisher(JointState, '/crank_states'), Event()

    def publish():
        while not ending.wait(0.005):
            stamp = time.time_ns()
            seconds = stamp % (1000 * NS) / NS
            publisher.publish(
                crank(1.0 + 0.5 * sin(3.0 * seconds), 1.5 * cos(3.0 * seconds), stamp)
            )

    thread = Thread(target=publish)
    thread.start()
    yield
    ending.set()
    thread.join()


@pytest.fixture
def counts(graph):
    """Return a function that gives the newest count of a word for the joint states."""

    def counts(word):
        return int(graph.value('recording', f'{word}: /joint_states') or 0)

    return counts


def read(folder):
    """Return topic, log time and bytes of each message, as rosbags reads the bag."""
    with AnyReader([folder]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
        return [(c.topic, log_time, bytes(data)) for c, log_time, data in reader.messages()]


def replayed(folder):
    """Return the account of ``linkage replay``, whose exit code says that nothing differs."""
    done = linkage(folder.parent, 'replay', folder.name, '--json')
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout)


def told(folder):
    """Return the account of ``linkage info``."""
    return json.loads(linkage(folder.parent, 'info', folder.name, '--json').stdout)


def test_overlapping_snapshots_count_every_message(
    graph, tmp_path, write_scene, start, crank_swings, counts
):
    runs = tmp_path / 'runs'
    node = start(write_scene('two', scene_text(runs, 3)))
    assert 'keeping the last 3 s in memory; ~/snapshot writes them' in node.log
    wait_for(lambda: counts('Received') > 100, 'joint states')
    assert not runs.exists(), 'no bag while it runs'
    success, message = graph.trigger('snapshot')
    assert success, message
    assert f'recorded to {runs}/bag: ' in message
    # At the second, all has become too old that the first begins with, and not what it ends with.
    gone = counts('Discarded') + 20
    wait_for(lambda: counts('Discarded') > gone, 'what is too old')
    success, message_2 = graph.trigger('snapshot')
    assert success, message_2
    assert f'recorded to {runs}/bag_2: ' in message_2
    first, second = read(runs / 'bag'), read(runs / 'bag_2')
    times = [log_time for _, log_time, _ in second]
    assert 2 * NS < times[-1] - times[0] <= 3 * NS
    assert first[0] not in second
    assert len(set(first) & set(second)) > 20
    for bag, messages, line in (('bag', first, message), ('bag_2', second, message_2)):
        assert {topic for topic, _, _ in messages} == TOPICS
        states = sum(topic == '/joint_states' for topic, _, _ in messages)
        assert f'/joint_states {states} recorded 0 dropped' in line
        account = replayed(runs / bag)
        assert account['verdict'] == 'identical'
        assert account['ticks'] == states
        account = told(runs / bag)
        assert not account['truncated']
        assert {topic['dropped'] for topic in account['topics']} == {0}
    assert 'begun in mid-run' in replayed(runs / 'bag_2')['beginning_missing']
    status = graph.next_status('recording')
    assert status.level == OK
    values = {pair.key: pair.value for pair in status.values}
    for topic in TOPICS:
        words = ('In memory', 'Discarded', 'Dropped')
        parts = [int(values[f'{word}: {topic}']) for word in words]
        assert int(values[f'Received: {topic}']) == sum(parts)
    assert (values['Snapshots written'], values['Snapshots failed']) == ('2', '0')
    assert values['Last snapshot'] == f'{runs}/bag_2'
    assert node.end() == 0
    assert '2 snapshots written: /joint_states' in node.log
    assert sorted(path.name for path in runs.iterdir()) == ['bag', 'bag_2']


def test_run_without_a_snapshot_reports_nothing_written(
    tmp_path, write_scene, start, crank_swings, counts
):
    node = start(write_scene('none', scene_text(tmp_path / 'runs', 30)))
    wait_for(lambda: counts('In memory') > 20, 'joint states in memory')
    assert node.end() == 0
    (line,) = [line for line in node.log.splitlines() if NOTHING in line]
    assert '/joint_states' in line
    assert not (tmp_path / 'runs').exists()


def test_run_prints_counts_of_the_snapshot_memory(tmp_path, domain, write_scene):
    drive = 'drive: {constant_rate: {rate: 2}}'
    scene = write_scene('shown', f'{scene_text(tmp_path / "runs", 1)}\n{drive}')
    command = [sys.executable, '-m', 'linkage_ros.cli.main', 'run', str(scene), '--plain']
    done = subprocess.run(
        [*command, '--seconds', '2.5'],
        env=os.environ | {'ROS_DOMAIN_ID': str(domain), 'ROS_LOG_DIR': str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    rows = [line.split(maxsplit=1) for line in done.stdout.splitlines() if line]
    (line,) = [text for name, text in rows if name == 'memory' and '/joint_states' in text]
    words = line.replace(',', '').split()
    received, kept, gone = (int(words[number]) for number in (1, 3, 6))
    assert received == kept + gone
    assert 0 < kept < received
    assert ['snapshots', NOTHING] in rows
    assert not any(name in ('bag', 'FAILED') for name, _ in rows)


@pytest.fixture
def small_disk(tmp_path):
    """Return a disk of 1 MiB, where it can be mounted."""
    with disks.small_disk(tmp_path, 1) as folder:
        yield folder


def test_snapshot_succeeds_after_the_disk_has_room_again(
    graph, small_disk, write_scene, start, crank_swings, counts
):
    with (small_disk / 'other').open('wb', buffering=0) as other, suppress(OSError):
        while True:
            other.write(bytes(4096))
    node = start(write_scene('full', scene_text(small_disk, 30)))
    wait_for(lambda: counts('In memory') > 20, 'joint states in memory')
    kept = counts('In memory')
    success, message = graph.trigger('snapshot')
    assert not success
    assert message.startswith(
        f'no snapshot: {small_disk}/bag: cannot be recorded to: No space left on device; '
    )
    assert message.endswith('; the memory continues')
    assert 'No space left' in graph.wait_for_level('recording', ERROR).message
    assert [path.name for path in small_disk.iterdir()] == ['other']
    (small_disk / 'other').unlink()
    success, message = graph.trigger('snapshot')
    assert success, message
    there = [data for topic, _, data in read(small_disk / 'bag') if topic == '/joint_states']
    assert len(there) > kept
    assert replayed(small_disk / 'bag')['verdict'] == 'identical'
    assert graph.wait_for_level('recording', OK)
    assert node.end() == INCOMPLETE, 'a snapshot was asked for and is not there'
    assert '1 snapshot written, 1 failed' in node.log
    assert 'Traceback' not in node.log


def test_disk_filled_by_a_snapshot_keeps_its_part(
    graph, small_disk, write_scene, start, crank_swings, counts
):
    node = start(write_scene('fills', scene_text(small_disk, 60, rate=2000)))
    wait_for(lambda: counts('In memory') > 6000, 'more than the disk can take')
    success, message = graph.trigger('snapshot')
    assert not success
    assert message.startswith(f'snapshot incomplete: {small_disk}/bag: ')
    assert 'No space left on device' in message
    there = [data for topic, _, data in read(small_disk / 'bag') if topic == '/joint_states']
    assert f'/joint_states {len(there)} recorded ' in message
    assert len(there) > 500
    assert 'No space left' in told(small_disk / 'bag')['recording_failure']
    assert node.end() == INCOMPLETE


def test_each_activation_has_its_own_snapshot_memory(
    graph, tmp_path, write_scene, start, crank_swings, counts
):
    node = start(write_scene('lives', scene_text(tmp_path, 30)))
    wait_for(lambda: counts('In memory') > 20, 'joint states in memory')
    assert graph.change_state(Transition.TRANSITION_DEACTIVATE)
    assert NOTHING in node.log
    success, message = graph.trigger('snapshot')
    assert (success, message) == (False, 'not active: nothing is kept in memory')
    begin = time.time_ns()
    assert graph.change_state(Transition.TRANSITION_ACTIVATE)
    wait_for(lambda: graph.trigger('snapshot')[0], 'a snapshot')
    messages = read(tmp_path / 'bag')
    assert min(log_time for _, log_time, _ in messages) > begin
    assert replayed(tmp_path / 'bag')['beginning_missing'] is None, 'all of its run is there'
    assert graph.change_state(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    assert '1 snapshot written: ' in node.log
    assert node.end() == 0


def test_reset_keeps_the_snapshot_memory(
    graph, tmp_path, write_scene, start, crank_swings, counts
):
    node = start(write_scene('reset', scene_text(tmp_path, 60)))
    wait_for(lambda: counts('In memory') > 50, 'joint states in memory')
    before = counts('In memory')
    assert graph.trigger('reset')[0]
    wait_for(lambda: counts('In memory') > 2 * before, 'more joint states in memory')
    assert graph.trigger('snapshot')[0]
    there = [data for topic, _, data in read(tmp_path / 'bag') if topic == '/joint_states']
    assert len(there) > 2 * before
    assert replayed(tmp_path / 'bag')['verdict'] == 'identical'
    assert node.end() == 0


def test_snapshot_keeps_messages_before_a_clock_jump(graph, tmp_path, write_scene, start):
    start(write_scene('sim', scene_text(tmp_path, 3, rate=50)), '-p', 'use_sim_time:=true')
    clock = graph.publisher(Clock, '/clock')
    cranks = graph.publisher(JointState, '/crank_states')
    heard = graph.listen(JointState, '/joint_states')
    wait_for(clock.get_subscription_count, 'a subscription to /clock')

    def play(begin, wanted):
        """Play from a time on, until so many joint states have come; return when that is."""
        now, wanted = begin, len(heard) + wanted

        def step():
            nonlocal now
            now += 20_000_000
            cranks.publish(crank(now / NS, 1.0, now))
            message = Clock()
            message.clock.sec, message.clock.nanosec = divmod(now, NS)
            clock.publish(message)
            time.sleep(0.005)
            return len(heard) >= wanted

        wait_for(step, 'joint states')
        return now

    # 2 s of simulated time at least; begun anew at 0, of which 1 s and some more is played.
    end = play(1000 * NS, 100)
    play(0, 60)  # what is heard here may be on its way into the memory
    success, message = graph.trigger('snapshot')
    assert success, message
    times = [log_time for topic, log_time, _ in read(tmp_path / 'bag') if topic == '/joint_states']
    before = [time for time in times if time > 1000 * NS]
    since = [time for time in times if time < 900 * NS]
    assert len(since) >= 50
    assert max(before) > end - NS // 10
    # What has passed since and what is left of before are the 3 s, to a step of the clock.
    passed = (max(since) - min(since)) + (max(before) - min(before))
    assert 2.5 * NS < passed <= 3 * NS
    assert replayed(tmp_path / 'bag')['verdict'] == 'identical'


def test_recording_services_start_and_stop_the_snapshot_memory(
    graph, tmp_path, write_scene, start, crank_swings, counts
):
    node = start(write_scene('services', scene_text(tmp_path, 30)))
    keeping = 'keeping the last 30 s in memory; ~/snapshot writes them'
    assert graph.trigger('start_recording') == (False, f'already {keeping}')
    success, message = graph.trigger('stop_recording')
    assert success
    assert f'the memory has ended, {NOTHING}: ' in message
    success, message = graph.trigger('snapshot')
    assert not success
    assert message.startswith('nothing is kept in memory; ')
    assert message.endswith(', or call ~/start_recording')
    assert graph.trigger('start_recording') == (True, keeping)
    wait_for(lambda: counts('In memory') > 20, 'joint states in memory')
    assert graph.trigger('snapshot')[0]
    assert 'begun in mid-run' in replayed(tmp_path / 'bag')['beginning_missing']
    assert node.end() == 0


def test_scene_without_snapshot_seconds_refuses_a_snapshot(
    graph, tmp_path, write_scene, start, crank_swings
):
    record = f'record: {{directory: {tmp_path}, name: bag}}'
    node = start(write_scene('usual', f'rate: 100\n{record}'))
    success, message = graph.trigger('snapshot')
    assert not success
    assert message.startswith('nothing is kept in memory; write record.snapshot_seconds')
    assert node.end() == 0
    assert [path.name for path in tmp_path.iterdir() if path.is_dir()] == ['bag']


def test_missing_lz4_is_reported_before_the_first_snapshot(
    graph, tmp_path, write_scene, start, monkeypatch
):
    """What can be known at the start is not found out when the snapshot is needed."""
    (tmp_path / 'lz4').mkdir()
    (tmp_path / 'lz4' / '__init__.py').write_text("raise ImportError('not here')")
    monkeypatch.setenv('PYTHONPATH', str(tmp_path), prepend=os.pathsep)
    node = start(write_scene('packed', scene_text(tmp_path / 'runs', 30, ', compression: lz4')))
    reason = 'cannot be packed with lz4: the Python package lz4 is missing'
    assert reason in graph.wait_for_level('recording', ERROR).message
    assert node.end() == INCOMPLETE


@pytest.fixture
def slow_disk(monkeypatch):
    """Make bags only when the test lets them be made."""
    answer = Event()

    def slow(*arguments):
        answer.wait(30)
        return BagWriter(*arguments)

    monkeypatch.setattr('linkage_ros.bag.BagWriter', slow)
    return answer


def test_stopping_run_finishes_its_snapshot_and_answers(tmp_path, write_scene, slow_disk):
    loop = SimpleNamespace(is_running=False, recorder=None, pipeline=SimpleNamespace(linkages=()))
    recording = RunRecording(SimpleNamespace(info=lambda _: None, error=lambda _: None))
    scene = load_scene(str(write_scene('ends', scene_text(tmp_path, 30))))
    states = describe_topic('/joint_states', JointState, QosProfile())
    recording.start(scene, loop, '', lambda: [('joint_states_topic', states)])
    answers, woken = [], Event()

    def ask():
        return recording.begin_snapshot(lambda *answer: answers.append(answer), woken.set)

    assert ask().startswith('nothing is in memory yet')
    loop.recorder.offer(0, 1, 1, b'\0\1\0\0')
    assert ask() == ''
    assert ask().startswith('a snapshot is being written; call again')
    recording.collect_snapshot()
    assert answers == []
    Timer(0.2, slow_disk.set).start()
    assert recording.stop(loop)[0]
    ((success, message),) = answers
    assert success
    assert message.endswith(f'recorded to {tmp_path}/bag: /joint_states 1 recorded 0 dropped')
    assert [summary.folder for summary in recording.ended_bags] == [tmp_path / 'bag']
    assert [summary.snapshots for summary in recording.memories] == ['1 snapshot written']
    assert woken.wait(10)
    recording.collect_snapshot()
    assert len(answers) == 1, 'what wakes the executor late finds nothing more to do'
