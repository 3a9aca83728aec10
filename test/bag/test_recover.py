# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
`recover_bag` on bags that are cut, flipped, holed and forged.

Whatever the damage: what is saved is true, in order, and read by our reader, mcap's and rosbags;
the damaged bag stays as it was.
"""

from io import BytesIO

from hypothesis import given, HealthCheck, settings, strategies as st
from linkage_ros.bag import (
    BagWriter,
    Message,
    read_bag,
    RecordSource,
    recover_bag,
    Salvage,
    Storage,
    Topic,
    UNFINISHED,
    UNFINISHED_DATA,
)
from linkage_ros.errors import BagError, RecordingError
from mcap.reader import make_reader
import pytest
import yaml

from .damage import (
    ATTACHMENTS,
    chunks_of,
    COUNT,
    damaged,
    data_of,
    flip,
    in_chunk,
    without,
    write_run,
)


@pytest.fixture
def run(tmp_path, topics, messages):
    return write_run(tmp_path / 'run', topics, messages)


def test_recovery_copies_a_whole_bag_byte_for_byte(run, topics, messages, readers):
    before = {path: path.read_bytes() for path in run.iterdir()}
    recovery = recover_bag(run)
    assert recovery.is_whole
    assert (recovery.losses, recovery.repaired, recovery.remarks) == ((), (), ())
    assert recovery.folder == run.with_name('run_recovered')
    assert [(t.name, t.saved, t.expected) for t in recovery.topics] == [
        (topic.name, COUNT // 2, COUNT // 2) for topic in topics
    ]
    assert recovery.attachments == ('scene.yaml', 'linkage.yaml')
    readers.agree(recovery.folder, topics, messages[:COUNT])
    again, first = read_bag(recovery.folder), read_bag(run)
    assert list(again.messages()) == list(first.messages())
    assert (again.topics, again.attachments) == (first.topics, first.attachments)
    assert again.custom == first.custom | {
        'linkage_ros.recovered': f'from run: {COUNT} messages, nothing lost'
    }
    told = [
        yaml.safe_load((folder / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
        for folder in (run, recovery.folder)
    ]
    for key in ('duration', 'starting_time', 'message_count', 'topics_with_message_count'):
        assert told[0][key] == told[1][key]
    assert {path: path.read_bytes() for path in run.iterdir()} == before


def test_recovery_keeps_channels_and_sequence_numbers(run):
    def described(file):
        with file.open('rb') as stream:
            return [
                (channel.topic, channel.metadata, schema.data, message.sequence)
                for schema, channel, message in make_reader(stream).iter_messages()
            ]

    new = recover_bag(run).folder
    assert described(new / 'run_recovered_0.mcap') == described(run / 'run_0.mcap')


NO_LOSS = {
    # what is damaged: the change, and what is said to have been repaired
    'first byte': (flip(0), 'the beginning'),
    'header': (flip(20, 6), ''),
    'length of the header': (flip(9, 6), 'byte 8'),
    "a chunk's kind": (in_chunk(2, 0), 'the head of the record'),
    "a chunk's length": (in_chunk(2, 1), 'length of the record'),
    "a chunk's size when unpacked": (in_chunk(2, 25), 'the head of the record'),
    "a chunk's packing": (in_chunk(2, 37), 'the head of the record'),
    'an index of messages': (
        lambda c: flip(chunks_of(c)[2][1] + 3, 4)(c),
        'descriptions or index',
    ),
    'the index': (lambda c: flip(len(c) - 200, 3)(c), 'the index'),
    'the footer': (lambda c: flip(len(c) - 20, 3)(c), 'the index'),
    'the last byte': (lambda c: flip(len(c) - 1)(c), 'the end'),
    'the index cut off': (lambda c: c[:-100], 'the index'),
}


@pytest.mark.parametrize(('change', 'said'), NO_LOSS.values(), ids=NO_LOSS.keys())
def test_recovery_rebuilds_damaged_descriptions_without_loss(
    run, topics, messages, readers, change, said
):
    recovery = recover_bag(damaged(run, change))
    readers.agree(recovery.folder, topics, messages[:COUNT])
    assert recovery.attachments == ('scene.yaml', 'linkage.yaml')
    assert recovery.is_whole, recovery.losses
    assert said in '\n'.join(recovery.repaired)


def cut_at_chunk(number: int, beyond: int):
    return lambda content: content[: chunks_of(content)[number][1] + beyond]


def cut_with(number: int, offset: int):
    """Cut the index off, and damage a chunk's head as well: nothing says where things are."""

    def change(content):
        in_chunk(number, offset)(content)
        return content[: chunks_of(content)[5][1]]

    return change


def hole(content):
    """Take 3000 bytes out of the middle of a chunk."""
    start, _ = chunks_of(content)[2]
    begin, end = start + 5000, start + 8000
    del content[begin:end]


def zeros(content):
    """Overwrite the end of a chunk and the head of the next, as a lost block of the disk."""
    start, _ = chunks_of(content)[3]
    begin, end = start - 2048, start + 2048
    content[begin:end] = bytes(4096)
    return content[:-500]


SOME_LOSS = {
    # what is damaged: the change, and which messages are lost
    'the content of a chunk': (in_chunk(2, 500), range(200, 300)),
    'the checksum of a chunk': (in_chunk(2, 33), range(200, 300)),
    'the first chunk': (in_chunk(0, 500), range(100)),
    'the last chunk': (in_chunk(5, 500), range(500, 600)),
    'cut behind a chunk': (cut_at_chunk(3, 0), range(400, 600)),
    'cut in its indexes': (cut_at_chunk(3, 50), range(400, 600)),
    'cut before its end': (cut_at_chunk(3, -1), range(300, 600)),
    'length of a chunk, and cut': (cut_with(2, 3), range(0)),
    'kind of a chunk, and cut': (cut_with(2, 0), range(200, 300)),
    'the first chunk with the topics, and cut': (cut_with(0, 500), range(100)),
    'packing of a chunk, and cut': (cut_with(2, 37), range(200, 300)),
    'length of the data, and cut': (cut_with(2, 43), range(200, 300)),
    'a hole': (hole, range(200, 300)),
    'a lost block of the disk': (zeros, range(200, 400)),
}


@pytest.mark.parametrize(('change', 'lost'), SOME_LOSS.values(), ids=SOME_LOSS.keys())
def test_recovery_loses_damaged_messages_only(run, topics, messages, readers, change, lost):
    recovery = recover_bag(damaged(run, change))
    kept = [m for index, m in enumerate(messages[:COUNT]) if index not in lost]
    readers.agree(recovery.folder, topics, kept)
    assert data_of(recovery.folder) == without(messages, lost)
    assert not recovery.is_whole
    assert recovery.losses
    assert all(0 <= loss.start <= loss.end for _, loss in recovery.losses)
    assert recovery.attachments == ('scene.yaml', 'linkage.yaml')


def test_recovery_counts_promised_messages_of_a_damaged_chunk(run):
    recovery = recover_bag(damaged(run, in_chunk(2, 500)))
    assert [(t.saved, t.expected) for t in recovery.topics] == [(250, 300), (250, 300)]
    ((file, loss),) = recovery.losses
    assert file == 'run_0.mcap'
    assert loss.reason == 'its checksum does not match'
    assert recovery.missing_count == 100


def test_recovery_without_an_index_counts_by_the_metadata(run):
    recovery = recover_bag(damaged(run, cut_at_chunk(3, 0)))
    assert [(t.saved, t.expected) for t in recovery.topics] == [(200, 300), (200, 300)]
    recovery = recover_bag(run / 'run_0.mcap')
    assert [(t.saved, t.expected) for t in recovery.topics] == [(200, None), (200, None)]
    assert recovery.folder == run / 'run_0_recovered'


@pytest.mark.parametrize('finished', [True, False], ids=['finished', 'unfinished'])
@pytest.mark.parametrize(
    ('counted', 'told_if_finished', 'told_if_not'),
    [
        # What the metadata count of 200 that are there; what there were, if that is known.
        (190, None, None),
        (200, 200, None),
        (300, 300, 300),
    ],
    ids=['fewer than there are', 'as many', 'more'],
)
def test_recovery_promises_at_least_the_saved_messages(
    run, finished, counted, told_if_finished, told_if_not
):
    damaged(run, cut_at_chunk(3, 0))
    metadata = yaml.safe_load((run / 'metadata.yaml').read_text())
    information = metadata['rosbag2_bagfile_information']
    for topic in information['topics_with_message_count']:
        topic['message_count'] = counted
    if not finished:
        information['custom_data'] = dict(UNFINISHED_DATA)
    (run / 'metadata.yaml').write_text(yaml.safe_dump(metadata))
    told = told_if_finished if finished else told_if_not
    assert [(t.saved, t.expected) for t in recover_bag(run).topics] == 2 * [(200, told)]


def test_damaged_copy_of_the_channels_is_no_loss(run, messages):
    recovery = recover_bag(damaged(run, lambda c: flip(c.index(b'channels.mcap') + 500)(c)))
    assert recovery.is_whole
    assert 'descriptions or index' in '\n'.join(recovery.repaired)
    assert data_of(recovery.folder) == without(messages, range(0))


def test_messages_without_a_channel_description_are_lost(run):
    def change(content):
        flip(content.index(b'channels.mcap') + 500)(content)
        return cut_with(0, 500)(content)

    recovery = recover_bag(damaged(run, change))
    assert [topic.saved for topic in recovery.topics if topic.saved] == []
    reasons = [loss.reason for _, loss in recovery.losses]
    assert sum('which is not defined' in reason for reason in reasons) == 5
    assert recovery.attachments == ('scene.yaml', 'linkage.yaml')


def test_damaged_attachment_is_lost_alone(run, messages):
    recovery = recover_bag(damaged(run, lambda c: flip(c.index(b'four_bar: {}'))(c)))
    assert recovery.attachments == ('scene.yaml',)
    assert data_of(recovery.folder) == without(messages, range(0))
    assert not recovery.is_whole


@pytest.mark.parametrize('text', [None, '', 'a: [', '[' * 9999, 'a: 2001-99-99', '\xff'])
def test_recovery_rebuilds_unreadable_metadata(run, messages, text):
    file = run / 'metadata.yaml'
    file.unlink()
    if text is not None:
        file.write_text(text, encoding='latin-1')
    recovery = recover_bag(run)
    assert recovery.is_whole
    assert recovery.repaired == ('metadata.yaml',)
    assert data_of(recovery.folder) == without(messages, range(0))
    assert read_bag(recovery.folder).custom['seed'] == '7', 'from the record in the file'


def test_recovered_bag_is_marked_as_finished(run):
    custom = yaml.safe_load((run / 'metadata.yaml').read_text())
    custom['rosbag2_bagfile_information']['custom_data'] = {**UNFINISHED_DATA, 'seed': '7'}
    (run / 'metadata.yaml').write_text(yaml.safe_dump(custom))
    found = read_bag(recover_bag(run).folder).custom
    assert UNFINISHED not in found
    assert found['seed'] == '7'


# `recover_bag` where everything is against it: any damage, bad disks, full ones, no bag at all.


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
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
def test_salvage_of_random_damage_finds_true_messages_only(run, messages, damages, random):
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
    salvage = Salvage(RecordSource(BytesIO(content)))
    found = [each for each in salvage.find_records() if isinstance(each, Message)]
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
def test_salvage_skips_one_bad_disk_block(run, messages, cut):
    content = (run / 'run_0.mcap').read_bytes()
    start, _ = chunks_of(content)[2]
    worn = Worn(content[: len(content) - cut], range(start + 500, start + 1012))
    salvage = Salvage(RecordSource(worn))
    found = [each.data for each in salvage.find_records() if isinstance(each, Message)]
    assert found == without(messages, range(200, 300))
    assert 'Input/output error' in salvage.losses[0].reason


def test_bag_still_being_written_is_recovered_so_far(tmp_path, topics, messages):
    writer = BagWriter(tmp_path / 'run', topics, ATTACHMENTS)
    for message in messages[:300]:
        writer.write(*message)
    writer.flush()
    recovery = recover_bag(tmp_path / 'run')
    assert data_of(recovery.folder) == [m.data for m in messages[:300]]
    assert recovery.remarks[0].startswith('run_0.mcap is still being written')
    assert not recovery.is_whole
    for message in messages[300:400]:
        writer.write(*message)
    assert sum(writer.close().counts) == 400
    recovery = recover_bag(tmp_path / 'run', tmp_path / 'later')
    assert recovery.is_whole
    assert recovery.remarks == ()


@pytest.mark.parametrize('kind', ['folder', 'file', 'link'])
def test_recovery_never_overwrites_an_existing_path(run, tmp_path, kind):
    target = tmp_path / 'new'
    if kind == 'folder':
        target.mkdir()
    elif kind == 'file':
        target.write_text('mine')
    else:
        target.symlink_to(tmp_path / 'nowhere')
    with pytest.raises(RecordingError, match='exists already'):
        recover_bag(run, target)
    assert sorted(path.name for path in tmp_path.iterdir()) == ['new', 'run']
    if kind == 'file':
        assert target.read_text() == 'mine'


def test_recovery_on_a_full_disk_leaves_no_folder(run, small_disk):
    (small_disk / 'other').write_bytes(bytes(2_000_000))
    with pytest.raises(RecordingError, match='cannot be written: No space left'):
        recover_bag(run, small_disk / 'new')
    assert list(small_disk.iterdir()) == [small_disk / 'other']


def test_stopped_recovery_leaves_no_folder(run, tmp_path):
    assert recover_bag(run, tmp_path / 'new', stopped=lambda: True) is None
    assert list(tmp_path.iterdir()) == [run]


NO_BAG = {
    # the content of x.mcap, and what is said
    'empty': (b'', 'x.mcap is empty'),
    'text': (b'no bag at all', "x.mcap starts with b'no bag a', unlike an MCAP file"),
    'zeros': (bytes(100_000), 'unlike an MCAP file'),
    'a beginning': (b'\x89MCAP0\r\n', 'x.mcap at byte 8'),
    'an end': (b'\x89MCAP0\r\n' * 2, 'x.mcap at byte 8'),
    'half a magic': (b'\x89MCA', 'unlike an MCAP file'),
}


@pytest.mark.parametrize(('content', 'reason'), NO_BAG.values(), ids=NO_BAG.keys())
def test_unrecoverable_file_leaves_no_folder(tmp_path, content, reason):
    (tmp_path / 'x.mcap').write_bytes(content)
    with pytest.raises(BagError) as caught:
        recover_bag(tmp_path / 'x.mcap')
    assert reason in str(caught.value)
    assert list(tmp_path.iterdir()) == [tmp_path / 'x.mcap']


# A ring of files, killed between naming the files that are kept and removing the oldest.


def test_recovery_reads_removed_ring_files_before_kept_ones(tmp_path, monkeypatch):
    topics = [Topic('/a', 'std_msgs/msg/Empty', '', '')]
    storage = Storage(split_seconds=1e-8, keep_files=2)
    writer = BagWriter(tmp_path / 'run', topics, {}, storage)
    # Twelve files, the last of them `run_11`; what is not removed is as after a kill.
    monkeypatch.setattr('pathlib.Path.unlink', lambda *_, **__: None)
    for time in range(120):
        writer.write(0, time, time, b'\0\1\0\0')
    writer.flush()
    monkeypatch.undo()
    assert [m.log_time for m in read_bag(tmp_path / 'run', allow_truncated=True).messages()] == [
        *range(100, 120)
    ]
    recover_bag(tmp_path / 'run', tmp_path / 'whole')
    assert [m.log_time for m in read_bag(tmp_path / 'whole').messages()] == [*range(120)]
