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


"""A recording that cannot be made or goes on no longer: said, and the node goes on publishing."""

import os
import resource
import subprocess
import time

import pytest
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from .graph import crank, wait_for

OK, ERROR = b'\0', b'\2'
INCOMPLETE = 1


@pytest.fixture
def small_disk(tmp_path):
    """Mount a disk of 1 MiB, where that is allowed."""
    folder = tmp_path / 'disk'
    folder.mkdir()
    mount = ['mount', '-t', 'tmpfs', '-o', 'size=1m', 'tmpfs', str(folder)]
    if os.geteuid() or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip('only a root that may mount can make a small disk')
    yield folder
    subprocess.run(['umount', '--lazy', str(folder)], check=True)


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


@pytest.mark.parametrize(
    ('case', 'name'),
    [
        ('below a file', ', name: bag'),
        ('below a file', ''),
        ('a name too long', ''),
    ],
    ids=['below a file', 'below a file, dated', 'too long, dated'],
)
def test_a_bag_that_cannot_be_made(
    graph, tmp_path, write_scene, start, keeps_publishing, case, name
):
    directory, reason = cannot_begin(tmp_path, case)
    node = start(write_scene('begin', scene_text(directory, name)))
    keeps_publishing()
    assert reason in graph.wait_for_level('recording', ERROR).message
    (line,) = [line for line in node.log.splitlines() if 'not recording' in line]
    assert reason in line
    assert str(directory) in line
    answer = graph.call(Trigger, '/linkage_node/start_recording')
    assert not answer.success
    assert reason in answer.message
    keeps_publishing()
    assert node.end() == INCOMPLETE
    assert 'Traceback' not in node.log


def test_a_name_that_is_taken_gets_a_number(graph, tmp_path, write_scene, start, keeps_publishing):
    (tmp_path / 'bag').mkdir()
    (tmp_path / 'bag' / 'mine').write_text('precious')
    (tmp_path / 'bag_2').symlink_to(tmp_path / 'nowhere')
    node = start(write_scene('taken', scene_text(tmp_path)))
    for name in ('bag_3', 'bag_4'):
        graph.wait_for_level('recording', OK)
        keeps_publishing()
        assert graph.call(Trigger, '/linkage_node/stop_recording').success
        with AnyReader([tmp_path / name]) as reader:
            assert reader.message_count > 0
        assert f'recording to {tmp_path}/{name}: bag exists already' in node.log
        assert graph.call(Trigger, '/linkage_node/start_recording').success
    assert node.end() == 0
    assert [path.name for path in (tmp_path / 'bag').iterdir()] == ['mine']


def limit_file_size():
    resource.setrlimit(resource.RLIMIT_FSIZE, (620_000, 620_000))


@pytest.mark.parametrize('kind', ['a full disk', 'a limit on file sizes'])
def test_a_recording_that_ends_early(
    graph, request, tmp_path, write_scene, start, keeps_publishing, kind
):
    disk = request.getfixturevalue('small_disk') if kind == 'a full disk' else tmp_path
    scene = write_scene('early', scene_text(disk, rate=2000))
    popen = {} if kind == 'a full disk' else {'preexec_fn': limit_file_size}
    node = start(scene, **popen)
    end = time.monotonic() + 30.0
    while 'ended early' not in node.log:
        assert time.monotonic() < end
        keeps_publishing()
    message = graph.wait_for_level('recording', ERROR).message
    reason = 'No space left on device' if kind == 'a full disk' else 'File too large'
    assert reason in message
    (line,) = [line for line in node.log.splitlines() if 'ended early' in line]
    assert reason in line
    keeps_publishing()
    assert node.end() == INCOMPLETE
    assert 'Traceback' not in node.log

    with AnyReader([disk / 'bag']) as reader:
        kept = [
            reader.deserialize(data, connection.msgtype)
            for connection, _, data in reader.messages()
            if connection.topic == '/joint_states'
        ]
    assert len(kept) > 500
    assert f'/joint_states {len(kept)} recorded' in line


def test_a_later_bag_does_not_hide_the_first_failure(
    graph, tmp_path, write_scene, start, keeps_publishing
):
    directory, _ = cannot_begin(tmp_path, 'below a file')
    node = start(write_scene('again', scene_text(directory)))
    directory.unlink()
    assert graph.call(Trigger, '/linkage_node/start_recording').success
    graph.wait_for_level('recording', OK)
    keeps_publishing()
    assert node.end() == INCOMPLETE
    with AnyReader([directory / 'bag']) as reader:
        assert reader.message_count > 0
