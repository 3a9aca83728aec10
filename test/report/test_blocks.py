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

"""A bag in blocks: nothing is lost, ticks stay whole, and counts are those of ``linkage info``."""

from __future__ import annotations

from itertools import groupby, pairwise
from operator import itemgetter
from types import SimpleNamespace

from hypothesis import given
from hypothesis import strategies as st
from linkage_ros.bag.contents import contents_of
from linkage_ros.bag.reader import BagMessage, read_bag
from linkage_ros.bag.topic import Topic
from linkage_ros.report import blocks as blocks_module
from linkage_ros.report.blocks import Blocks, Progress
import pytest

from .runs import recorded

NAMES = ('/a', '/b', '/c')
TOPICS = tuple(Topic(name, 'std_msgs/msg/Empty', '', '') for name in NAMES)
MESSAGES = st.lists(
    st.builds(
        BagMessage,
        st.sampled_from((*NAMES, '/not in the index')),
        st.integers(0, 9),
        st.integers(0, 9),
        st.binary(max_size=30),
    ),
    max_size=200,
)


def bag_of(messages):
    return SimpleNamespace(topics=TOPICS, messages=lambda: iter(messages))


@pytest.fixture(scope='module', autouse=True)
def small():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(blocks_module, '_MOST_MESSAGES', 8)
        patch.setattr(blocks_module, '_MOST_BYTES', 100)
        yield


@given(MESSAGES, st.sets(st.sampled_from(NAMES)))
def test_every_wanted_message_is_in_one_block_in_its_place(messages, wanted):
    found, counts = [], []
    reader = Blocks(bag_of(messages), wanted, Progress(counts.append))
    for block in reader:
        entries = sorted((*entry, name) for name, own in block.items() for entry in own)
        assert len({number for number, *_ in entries}) == len(entries)
        found += [(name, *entry) for _, *entry, name in entries]
    assert found == [tuple(each) for each in messages if each.topic in wanted]
    assert counts == sorted(counts)
    assert reader.contents() == contents_of(bag_of(messages))


@given(MESSAGES)
def test_a_tick_is_in_one_block_unless_it_is_larger_than_any(messages):
    blocks = [
        sorted((number, log, len(data)) for own in block.values() for number, log, _, data in own)
        for block in Blocks(bag_of(messages), (*NAMES, '/not in the index'), Progress())
    ]
    for before, after in pairwise(blocks):
        if before[-1][1] == after[0][1]:
            assert len(before) >= 4 * 8 or sum(size for *_, size in before) >= 4 * 100
    for block in blocks:
        # No block is much larger than is meant: but for its last time, and its last message.
        ticks = [[*each] for _, each in groupby(block, key=itemgetter(1))]
        rest = [entry for tick in ticks[:-1] for entry in tick]
        assert len(rest) <= 8 or len(rest) - len(ticks[-2]) < 8
        assert len(block) <= 4 * 8
        assert sum(size for *_, size in block[:-1]) < 4 * 100 + 30


@pytest.mark.parametrize('harm', ['cut in a chunk', 'a damaged chunk', 'without an end', 'none'])
def test_counts_are_those_of_info_for_a_harmed_bag_too(tmp_path, harm):
    folder = recorded(tmp_path, 'effects: {velocity: {}}\n').path
    (file,) = folder.glob('*.mcap')
    content = bytearray(file.read_bytes())
    if harm == 'cut in a chunk':
        content = content[: len(content) // 2]
    elif harm == 'without an end':
        content = content[:-9]
    elif harm == 'a damaged chunk':
        content[len(content) // 3] ^= 1
    file.write_bytes(content)
    bag = read_bag(folder, allow_truncated=True)
    reader = Blocks(bag, ['/joint_states'], Progress())
    assert sum(len(own) for block in reader for own in block.values()) == next(
        each.messages for each in reader.contents().topics if each.topic.name == '/joint_states'
    )
    assert reader.contents() == contents_of(bag)
    assert bool(reader.contents().damage) == (harm == 'a damaged chunk')


def test_a_wish_to_stop_ends_the_reading_at_the_next_block():
    messages = [BagMessage('/a', number, 0, b'') for number in range(100)]
    reader = Blocks(bag_of(messages), ['/a'], Progress(stopped=lambda: True))
    assert sum(len(block['/a']) for block in reader) == 8
    assert reader.contents().stopped
