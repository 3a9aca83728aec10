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


"""`LogTimeOrder`: any bag's messages sorted by time, from any start, without reading all of it."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
from linkage_ros.bag.order import LogTimeOrder, WINDOW
from linkage_ros.bag.reader import BagMessage, read_bag
from linkage_ros.errors import BagError
from mcap.writer import CompressionType, IndexType, Writer
import pytest


def write(file, messages, chunk_size=64, compression=CompressionType.NONE, **options):
    """Write (topic, log time) pairs; the bytes are the numbers of the messages."""
    with file.open('wb') as stream:
        writer = Writer(stream, chunk_size=chunk_size, compression=compression, **options)
        writer.start(profile='ros2')
        schema = writer.register_schema('std_msgs/msg/Empty', 'ros2msg', b'')
        channels = {}
        for number, (topic, log_time) in enumerate(messages):
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, 'cdr', schema)
            writer.add_message(channels[topic], log_time, b'%6d' % number, number)
        writer.finish()


def in_order(messages):
    """Return what is expected of pairs: sorted by time, those of one time as they were."""
    given = [BagMessage(t, time, n, b'%6d' % n) for n, (t, time) in enumerate(messages)]
    return sorted(given, key=lambda message: message.log_time)


PAIRS = st.lists(st.tuples(st.sampled_from(['/a', '/b']), st.integers(1, 12)), min_size=1)


@settings(max_examples=60, deadline=None)
@given(
    messages=PAIRS,
    chunk_size=st.sampled_from([1, 64, 200, 10_000]),
    compression=st.sampled_from(list(CompressionType)),
    since=st.integers(0, 13),
)
def test_messages_come_by_their_times(tmp_path_factory, messages, chunk_size, compression, since):
    file = tmp_path_factory.mktemp('bag') / 'any.mcap'
    write(file, messages, chunk_size, compression)
    order = LogTimeOrder(read_bag(file))
    expected = in_order(messages)
    assert list(order.messages()) == expected
    assert list(order.messages(since)) == [m for m in expected if m.log_time >= since]
    assert (order.begin, order.end) == (expected[0].log_time, expected[-1].log_time)


@settings(max_examples=30, deadline=None)
@given(messages=PAIRS, since=st.integers(0, 13))
def test_a_file_without_an_index_is_put_in_order_within_a_window(
    tmp_path_factory, messages, since
):
    file = tmp_path_factory.mktemp('bag') / 'plain.mcap'
    write(file, messages, use_chunking=False)
    order = LogTimeOrder(read_bag(file))
    expected = in_order(messages)
    assert list(order.messages(since)) == [m for m in expected if m.log_time >= since]
    assert (order.begin, order.end) == (expected[0].log_time, None)


def test_what_is_without_an_index_is_held_for_a_window_only(tmp_path):
    second = WINDOW
    times = [3 * second, second, 9 * second, 10 * second + 1, 9 * second + 2]
    write(tmp_path / 'plain.mcap', [('/a', time) for time in times], use_chunking=False)
    found = [m.log_time for m in LogTimeOrder(read_bag(tmp_path / 'plain.mcap')).messages()]
    # The second message stands more than a window behind its place; no other does.
    assert found == [second, 3 * second, 9 * second, 9 * second + 2, 10 * second + 1]
    times = [3 * second, 5 * second, second]
    write(tmp_path / 'late.mcap', [('/a', time) for time in times], use_chunking=False)
    found = [m.log_time for m in LogTimeOrder(read_bag(tmp_path / 'late.mcap')).messages()]
    assert found == [3 * second, second, 5 * second]


def test_files_of_a_split_bag_are_one_timeline(tmp_path):
    write(tmp_path / 'run_0.mcap', [('/a', 1), ('/a', 5), ('/b', 9)])
    write(tmp_path / 'run_1.mcap', [('/b', 4), ('/a', 6)])
    write(tmp_path / 'run_2.mcap', [('/a', 5), ('/a', 20)], use_chunking=False)
    found = [(m.topic, m.log_time) for m in LogTimeOrder(read_bag(tmp_path)).messages()]
    expected = [('/a', 1), ('/b', 4), ('/a', 5), ('/a', 5), ('/a', 6), ('/b', 9), ('/a', 20)]
    assert found == expected


def test_a_killed_recording_comes_as_far_as_it_goes(tmp_path):
    messages = [('/a', number ^ 3) for number in range(1, 400)]
    write(tmp_path / 'whole.mcap', messages)
    content = (tmp_path / 'whole.mcap').read_bytes()
    (tmp_path / 'cut.mcap').write_bytes(content[: len(content) // 2])
    bag = read_bag(tmp_path / 'cut.mcap', allow_truncated=True)
    found = list(LogTimeOrder(bag).messages())
    assert 100 < len(found) < 300
    assert found == in_order(messages[: len(found)])


def test_an_empty_bag_has_no_beginning(tmp_path):
    write(tmp_path / 'empty.mcap', [])
    order = LogTimeOrder(read_bag(tmp_path / 'empty.mcap'))
    assert (order.begin, list(order.messages())) == (None, [])


def test_damage_is_met_where_it_is_and_not_before(tmp_path):
    file = tmp_path / 'run.mcap'
    write(file, [('/a', number) for number in range(1000)], chunk_size=1000)
    content = bytearray(file.read_bytes())
    content[content.index(b'   500')] ^= 1
    file.write_bytes(content)
    order = LogTimeOrder(read_bag(file))
    found = []
    with pytest.raises(
        BagError, match=r'run\.mcap: is damaged: the chunk at byte [\d,]+ its check'
    ):
        found.extend(message.log_time for message in order.messages())
    assert found == list(range(len(found)))
    assert 400 < len(found) <= 500
    # What lies before a start is not read.
    assert [m.log_time for m in order.messages(600)] == list(range(600, 1000))


@pytest.mark.parametrize('options', [{}, {'index_types': IndexType.NONE}], ids=['index', 'none'])
def test_a_bag_whose_chunks_all_overlap_does_not_fill_memory(tmp_path, monkeypatch, options):
    write(tmp_path / 'a.mcap', [('/a', 1), ('/a', 9)] * 250, 64, CompressionType.NONE, **options)
    order = LogTimeOrder(read_bag(tmp_path / 'a.mcap'))
    assert len(list(order.messages())) == 500
    monkeypatch.setattr('linkage_ros.bag.order.MOST_HELD', 100_000)
    with pytest.raises(BagError, match='more than 100,000 bytes of its messages are not in'):
        list(order.messages())
