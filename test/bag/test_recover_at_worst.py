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


"""`recover` where everything is against it: any damage, bad disks, full ones, no bag at all."""

from __future__ import annotations

from io import BytesIO

from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
from linkage_ros.bag.mcap_records import Message, Source
from linkage_ros.bag.recover import recover
from linkage_ros.bag.salvage import Salvage
from linkage_ros.bag.writer import BagWriter
from linkage_ros.errors import BagError, RecordingError
import pytest

from .damage import ATTACHMENTS, chunks_of, COUNT, data_of, without, write_run


@pytest.fixture
def run(tmp_path, topics, messages):
    return write_run(tmp_path / 'run', topics, messages)


@settings(
    max_examples=150,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    damages=st.lists(
        st.tuples(
            st.sampled_from(['flip', 'zeros', 'noise', 'out', 'in', 'again', 'cut']),
            st.floats(0, 1),
            st.integers(1, 3000),
        ),
        min_size=1,
        max_size=5,
    ),
    random=st.randoms(use_true_random=False),
)
def test_whatever_is_done_to_it_what_is_found_is_true(run, messages, damages, random):
    content = bytearray((run / 'run_0.mcap').read_bytes())
    for kind, place, length in damages:
        at = int(place * len(content))
        end = min(at + length, len(content))
        if kind == 'flip' and at < len(content):
            content[at] ^= 1 << length % 8
        elif kind == 'zeros':
            content[at:end] = bytes(end - at)
        elif kind == 'noise':
            content[at:end] = random.randbytes(end - at)
        elif kind == 'out':
            del content[at:end]
        elif kind == 'in':
            content[at:at] = random.randbytes(length)
        elif kind == 'again':  # the same bytes twice, as a disk that wrote a block elsewhere too
            content[at:at] = content[at:end]
        elif kind == 'cut':
            del content[at:]
    salvage = Salvage(Source(BytesIO(content)))
    found = [each for each in salvage.found() if isinstance(each, Message)]
    true = iter([('/crank', '/arm/joint_states')[m.topic], *m[1:]] for m in messages[:COUNT])
    assert all([m.channel.topic, m.log_time, m.publish_time, m.data] in true for m in found)
    assert len(found) == COUNT or salvage.losses


class Worn(BytesIO):
    """A disk with a bad block."""

    def __init__(self, content: bytes, bad: range) -> None:
        super().__init__(content)
        self.bad = bad

    def read(self, size: int = -1) -> bytes:
        start = self.tell()
        if start < self.bad.stop and start + size > self.bad.start:
            raise OSError(5, 'Input/output error')
        return super().read(size)


@pytest.mark.parametrize('cut', [0, 100])
def test_around_a_bad_block_of_the_disk_all_is_saved(run, messages, cut):
    content = (run / 'run_0.mcap').read_bytes()
    start, _ = chunks_of(content)[2]
    worn = Worn(content[: len(content) - cut], range(start + 500, start + 1012))
    salvage = Salvage(Source(worn))
    found = [each.data for each in salvage.found() if isinstance(each, Message)]
    assert found == without(messages, range(200, 300))
    assert 'Input/output error' in salvage.losses[0].reason


def test_a_bag_that_is_being_written_is_saved_as_far_as_it_got(tmp_path, topics, messages):
    writer = BagWriter(tmp_path / 'run', topics, ATTACHMENTS)
    for message in messages[:300]:
        writer.write(*message)
    writer.flush()
    recovery = recover(tmp_path / 'run')
    assert data_of(recovery.folder) == [m.data for m in messages[:300]]
    assert recovery.remarks[0].startswith('run_0.mcap is still being written')
    assert not recovery.whole
    for message in messages[300:400]:
        writer.write(*message)
    assert sum(writer.close().counts) == 400
    recovery = recover(tmp_path / 'run', tmp_path / 'later')
    assert recovery.whole
    assert recovery.remarks == ()


@pytest.mark.parametrize('kind', ['folder', 'file', 'link'])
def test_what_is_there_is_never_written_over(run, tmp_path, kind):
    target = tmp_path / 'new'
    if kind == 'folder':
        target.mkdir()
    elif kind == 'file':
        target.write_text('mine')
    else:
        target.symlink_to(tmp_path / 'nowhere')
    with pytest.raises(RecordingError, match='exists already'):
        recover(run, target)
    assert sorted(path.name for path in tmp_path.iterdir()) == ['new', 'run']
    if kind == 'file':
        assert target.read_text() == 'mine'


def test_a_full_disk_leaves_nothing_behind(run, small_disk):
    (small_disk / 'other').write_bytes(bytes(2_000_000))
    with pytest.raises(RecordingError, match='cannot be written: No space left'):
        recover(run, small_disk / 'new')
    assert list(small_disk.iterdir()) == [small_disk / 'other']


def test_stopped_it_leaves_nothing_behind(run, tmp_path):
    assert recover(run, tmp_path / 'new', stopped=lambda: True) is None
    assert list(tmp_path.iterdir()) == [run]


NO_BAG = {
    # the content of x.mcap, and what is said
    'empty': (b'', 'x.mcap is empty'),
    'text': (b'no bag at all', "x.mcap starts with b'no bag a', as no MCAP file does"),
    'zeros': (bytes(100_000), 'as no MCAP file does'),
    'a beginning': (b'\x89MCAP0\r\n', 'x.mcap at byte 8'),
    'an end': (b'\x89MCAP0\r\n' * 2, 'x.mcap at byte 8'),
    'half a magic': (b'\x89MCA', 'as no MCAP file does'),
}


@pytest.mark.parametrize(('content', 'reason'), NO_BAG.values(), ids=NO_BAG.keys())
def test_where_nothing_can_be_saved_nothing_is_made(tmp_path, content, reason):
    (tmp_path / 'x.mcap').write_bytes(content)
    with pytest.raises(BagError) as caught:
        recover(tmp_path / 'x.mcap')
    assert reason in str(caught.value)
    assert list(tmp_path.iterdir()) == [tmp_path / 'x.mcap']
