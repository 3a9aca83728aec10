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


"""
`recover` on bags that are cut, flipped, holed and forged.

Whatever the damage: what is saved is true, in order, and read by our reader, mcap's and rosbags;
the damaged bag stays as it was.
"""

from __future__ import annotations

from linkage_ros.bag.reader import read_bag
from linkage_ros.bag.recording_stats import UNFINISHED, UNFINISHED_DATA
from linkage_ros.bag.recover import recover
from mcap.reader import make_reader
import pytest
import yaml

from .damage import chunks_of, COUNT, damaged, data_of, flip, in_chunk, without, write_run


@pytest.fixture
def run(tmp_path, topics, messages):
    return write_run(tmp_path / 'run', topics, messages)


def test_a_whole_bag_is_copied_to_the_byte_of_each_message(run, topics, messages, readers):
    before = {path: path.read_bytes() for path in run.iterdir()}
    recovery = recover(run)
    assert recovery.whole
    assert (recovery.losses, recovery.repaired, recovery.remarks) == ((), (), ())
    assert recovery.folder == run.with_name('run_recovered')
    assert [(t.name, t.saved, t.promised) for t in recovery.topics] == [
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


def test_channels_and_sequence_numbers_stay(run):
    def described(file):
        with file.open('rb') as stream:
            return [
                (channel.topic, channel.metadata, schema.data, message.sequence)
                for schema, channel, message in make_reader(stream).iter_messages()
            ]

    new = recover(run).folder
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
    'an index of messages': (lambda c: flip(chunks_of(c)[2][1] + 3, 4)(c), 'marks'),
    'the index': (lambda c: flip(len(c) - 200, 3)(c), 'the index'),
    'the footer': (lambda c: flip(len(c) - 20, 3)(c), 'the index'),
    'the last byte': (lambda c: flip(len(c) - 1)(c), 'the end'),
    'the index cut off': (lambda c: c[:-100], 'the index'),
}


@pytest.mark.parametrize(('change', 'said'), NO_LOSS.values(), ids=NO_LOSS.keys())
def test_what_only_describes_is_made_anew_without_a_loss(
    run, topics, messages, readers, change, said
):
    recovery = recover(damaged(run, change))
    readers.agree(recovery.folder, topics, messages[:COUNT])
    assert recovery.attachments == ('scene.yaml', 'linkage.yaml')
    assert recovery.whole, recovery.losses
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
def test_only_what_is_damaged_is_lost(run, topics, messages, readers, change, lost):
    recovery = recover(damaged(run, change))
    kept = [m for number, m in enumerate(messages[:COUNT]) if number not in lost]
    readers.agree(recovery.folder, topics, kept)
    assert data_of(recovery.folder) == without(messages, lost)
    assert not recovery.whole
    assert recovery.losses
    assert all(0 <= loss.start <= loss.end for _, loss in recovery.losses)
    assert recovery.attachments == ('scene.yaml', 'linkage.yaml')


def test_what_was_promised_is_said(run):
    recovery = recover(damaged(run, in_chunk(2, 500)))
    assert [(t.saved, t.promised) for t in recovery.topics] == [(250, 300), (250, 300)]
    ((file, loss),) = recovery.losses
    assert file == 'run_0.mcap'
    assert loss.reason == 'its checksum does not fit'
    assert recovery.missing == 100


def test_without_an_index_the_metadata_tells_what_was_promised(run):
    recovery = recover(damaged(run, cut_at_chunk(3, 0)))
    assert [(t.saved, t.promised) for t in recovery.topics] == [(200, 300), (200, 300)]
    recovery = recover(run / 'run_0.mcap')
    assert [(t.saved, t.promised) for t in recovery.topics] == [(200, None), (200, None)]
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
def test_more_than_there_were_are_never_saved(
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
    assert [(t.saved, t.promised) for t in recover(run).topics] == 2 * [(200, told)]


def test_a_damaged_copy_of_the_topics_is_no_loss(run, messages):
    recovery = recover(damaged(run, lambda c: flip(c.index(b'channels.mcap') + 500)(c)))
    assert recovery.whole
    assert 'what marks and describes' in '\n'.join(recovery.repaired)
    assert data_of(recovery.folder) == without(messages, range(0))


def test_without_a_description_messages_are_lost_too(run):
    def change(content):
        flip(content.index(b'channels.mcap') + 500)(content)
        return cut_with(0, 500)(content)

    recovery = recover(damaged(run, change))
    assert [topic.saved for topic in recovery.topics if topic.saved] == []
    reasons = [loss.reason for _, loss in recovery.losses]
    assert sum('nowhere described' in reason for reason in reasons) == 5
    assert recovery.attachments == ('scene.yaml', 'linkage.yaml')


def test_a_damaged_attachment_is_lost_alone(run, messages):
    recovery = recover(damaged(run, lambda c: flip(c.index(b'four_bar: {}'))(c)))
    assert recovery.attachments == ('scene.yaml',)
    assert data_of(recovery.folder) == without(messages, range(0))
    assert not recovery.whole


@pytest.mark.parametrize('text', [None, '', 'a: [', '[' * 9999, 'a: 2001-99-99', '\xff'])
def test_metadata_that_are_none_are_made_anew(run, messages, text):
    file = run / 'metadata.yaml'
    file.unlink()
    if text is not None:
        file.write_text(text, encoding='latin-1')
    recovery = recover(run)
    assert recovery.whole
    assert recovery.repaired == ('metadata.yaml',)
    assert data_of(recovery.folder) == without(messages, range(0))
    assert read_bag(recovery.folder).custom['seed'] == '7', 'from the record in the file'


def test_what_was_killed_and_is_recovered_is_finished(run):
    custom = yaml.safe_load((run / 'metadata.yaml').read_text())
    custom['rosbag2_bagfile_information']['custom_data'] = {**UNFINISHED_DATA, 'seed': '7'}
    (run / 'metadata.yaml').write_text(yaml.safe_dump(custom))
    found = read_bag(recover(run).folder).custom
    assert UNFINISHED not in found
    assert found['seed'] == '7'
