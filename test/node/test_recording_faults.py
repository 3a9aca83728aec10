# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A recording that cannot be made or goes on no longer: said, and the node goes on publishing."""

from collections import Counter
import json
import re
import resource
import time

from linkage_ros.cli.main import main
import pytest
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState

from .graph import crank, wait_for
from ..support import disks

REAL_STARTS = True

OK, WARN, ERROR = b'\0', b'\1', b'\2'
COUNTS = ('Received', 'Recorded', 'Dropped', 'Waiting')
INCOMPLETE = 1


@pytest.fixture
def small_disk(tmp_path):
    """Return a disk of 4 MiB, of which 3 are taken, where it can be mounted."""
    with disks.small_disk(tmp_path, 4) as folder:
        (folder / 'other').write_bytes(bytes(3 * 2**20))
        yield folder


@pytest.fixture
def keeps_publishing(graph):
    """Return a function that asserts that joint states go on coming."""
    publisher = graph.publisher(JointState, '/crank_states')
    heard = graph.listen(JointState, '/joint_states')

    def keeps_publishing(count=20):
        wanted = len(heard) + count

        def more():
            publisher.publish(crank(0.5, 1.0))
            return len(heard) >= wanted

        wait_for(more, 'joint states')

    return keeps_publishing


def scene_text(directory, name=', name: bag', rate=100):
    return f'rate: {rate}\neffects: {{velocity: {{}}}}\nrecord: {{directory: {directory}{name}}}'


def cannot_begin(folder, case):
    """Return a record directory, and what the node has to say of it."""
    if case == 'below a file':
        (folder / case).write_text('a file')
        return folder / case, 'Not a directory'
    return folder / ('n' * 300), 'File name too long'


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('case', 'name'),
    [
        ('below a file', ', name: bag'),
        ('below a file', ''),
        ('a name too long', ''),
    ],
    ids=['below a file', 'below a file, dated', 'too long, dated'],
)
def test_node_publishes_although_its_bag_cannot_be_made(
    graph, tmp_path, write_scene, start, keeps_publishing, case, name
):
    directory, reason = cannot_begin(tmp_path, case)
    node = start(write_scene('begin', scene_text(directory, name)))
    keeps_publishing()
    assert reason in graph.wait_for_level('recording', ERROR).message
    (line,) = [line for line in node.log.splitlines() if 'not recording' in line]
    assert reason in line
    assert str(directory) in line
    success, message = graph.trigger('start_recording')
    assert not success
    assert reason in message
    keeps_publishing()
    assert node.end() == INCOMPLETE
    assert 'Traceback' not in node.log


def test_bag_with_a_taken_name_gets_a_number(
    graph, tmp_path, write_scene, start, keeps_publishing
):
    (tmp_path / 'bag').mkdir()
    (tmp_path / 'bag' / 'mine').write_text('precious')
    (tmp_path / 'bag_2').symlink_to(tmp_path / 'nowhere')
    node = start(write_scene('taken', scene_text(tmp_path)))
    for name in ('bag_3', 'bag_4'):
        graph.wait_for_level('recording', OK)
        keeps_publishing()
        assert graph.trigger('stop_recording')[0]
        with AnyReader([tmp_path / name]) as reader:
            assert reader.message_count > 0
        assert f'recording to {tmp_path}/{name}: bag exists already' in node.log
        assert graph.trigger('start_recording')[0]
    assert node.end() == 0
    assert [path.name for path in (tmp_path / 'bag').iterdir()] == ['mine']


def limit_file_size():
    resource.setrlimit(resource.RLIMIT_FSIZE, (620_000, 620_000))


def counts_in_line(line):
    """Return by topic what the node says to have recorded and dropped."""
    found = re.findall(r'(/[\w/]+) (\d+) recorded (\d+) dropped', line)
    return {topic: (int(recorded), int(dropped)) for topic, recorded, dropped in found}


def counts_in_info(bag, capsys):
    """Return the same as `linkage info` says it, and why the recording was interrupted."""
    main(['info', str(bag), '--json'])
    account = json.loads(capsys.readouterr().out)
    counts = {t['name']: (t['messages'], t['dropped']) for t in account['topics']}
    assert all(t['received'] == t['messages'] + t['dropped'] for t in account['topics'])
    return counts, account['recording_failure']


@pytest.mark.sample(1)
@pytest.mark.parametrize('kind', ['a full disk', 'a limit on file sizes'])
def test_full_disk_counts_agree_in_log_diagnostics_and_bag(
    graph, request, tmp_path, write_scene, start, keeps_publishing, capsys, kind
):
    disk = request.getfixturevalue('small_disk') if kind == 'a full disk' else tmp_path
    scene = write_scene('early', scene_text(disk, rate=2000))
    popen = {} if kind == 'a full disk' else {'preexec_fn': limit_file_size}
    node = start(scene, **popen)
    end = time.monotonic() + 30.0
    while 'was interrupted' not in node.log:
        assert time.monotonic() < end
        keeps_publishing()
    before = graph.wait_for_level('recording', ERROR)
    reason = 'No space left on device' if kind == 'a full disk' else 'File too large'
    assert reason in before.message
    # What is published from here on is not recorded, and is counted as that.
    keeps_publishing(3000)
    after = graph.wait_for_level('recording', ERROR)
    values = {value.key: value.value for value in after.values}
    received, recorded, dropped, waiting = (
        int(values[f'{what}: /joint_states']) for what in COUNTS
    )
    assert received == recorded + dropped + waiting
    assert node.end() == INCOMPLETE
    assert 'Traceback' not in node.log
    said, line = [line for line in node.log.splitlines() if 'was interrupted' in line]
    assert reason in said
    with AnyReader([disk / 'bag']) as reader:
        kept = Counter(connection.topic for connection, _, _ in reader.messages())
    assert kept['/joint_states'] > 500
    assert kept['/joint_states'] == recorded
    told = counts_in_line(line)
    assert told['/joint_states'][0] == recorded
    assert sum(told['/joint_states']) >= received
    assert sum(told['/joint_states']) > 3000
    in_bag, reason_in_bag = counts_in_info(disk / 'bag', capsys)
    assert in_bag == told
    assert reason in reason_in_bag


def test_recording_resumes_in_a_new_file_after_full_disk(
    graph, small_disk, write_scene, start, keeps_publishing, capsys
):
    node = start(write_scene('again', scene_text(small_disk, rate=2000)))
    end = time.monotonic() + 60.0
    while 'was interrupted' not in node.log:
        assert time.monotonic() < end
        keeps_publishing()
    graph.wait_for_level('recording', ERROR)
    (small_disk / 'other').unlink()
    while 'again, in a new file' not in node.log:
        assert time.monotonic() < end
        keeps_publishing()
    assert 'No space left on device' in graph.wait_for_level('recording', WARN).message
    keeps_publishing(1000)
    assert node.end() == INCOMPLETE
    bag = small_disk / 'bag'
    assert sorted(file.name for file in bag.glob('*.mcap')) == ['bag_0.mcap', 'bag_1.mcap']
    told = counts_in_line(node.log.splitlines()[-1])
    with AnyReader([bag]) as reader:
        kept = Counter(connection.topic for connection, _, _ in reader.messages())
    assert kept == {topic: count for topic, (count, _) in told.items() if count}
    in_bag, reason = counts_in_info(bag, capsys)
    assert in_bag == told
    assert 'No space left on device' in reason
    with AnyReader([bag / 'bag_1.mcap']) as reader:
        assert reader.message_count > 1000


def test_run_with_dropped_messages_reports_their_count(graph, tmp_path, write_scene, start):
    # Messages of 13 places each, faster than the recorder's thread looks, for a queue of 100.
    record = f'record: {{directory: {tmp_path}, name: bag, queue: 100}}'
    node = start(write_scene('drops', f'rate: 100\neffects: {{velocity: {{}}}}\n{record}'))
    publisher = graph.publisher(JointState, '/crank_states')
    large = crank(0.5, 1.0)
    large.header.frame_id = 'x' * 200_000
    wait_for(lambda: graph.node.count_subscribers('/crank_states') == 1, 'the node')

    def dropped_some():
        for _ in range(10):
            publisher.publish(large)
        status = graph.status('recording')
        return status is not None and status.level == WARN

    wait_for(dropped_some, 'messages dropped')
    assert node.end() == INCOMPLETE
    assert 'Traceback' not in node.log
    line = node.log.splitlines()[-1]
    told = counts_in_line(line)
    dropped = sum(dropped for _, dropped in told.values())
    received = dropped + sum(recorded for recorded, _ in told.values())
    assert dropped
    assert f'{tmp_path}/bag: {dropped:,} of {received:,} messages were dropped: ' in line


def test_later_bag_does_not_hide_the_first_failure(
    graph, tmp_path, write_scene, start, keeps_publishing
):
    directory, _ = cannot_begin(tmp_path, 'below a file')
    node = start(write_scene('again', scene_text(directory)))
    directory.unlink()
    assert graph.trigger('start_recording')[0]
    graph.wait_for_level('recording', OK)
    keeps_publishing()
    assert node.end() == INCOMPLETE
    with AnyReader([directory / 'bag']) as reader:
        assert reader.message_count > 0
