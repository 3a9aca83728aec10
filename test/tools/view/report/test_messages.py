# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages as arrays, and the blocks in which they are read."""

from itertools import groupby, pairwise
from operator import itemgetter
from types import SimpleNamespace

from hypothesis import given, strategies as st
from linkage_ros.bag import BagMessage, contents_of, read_bag, Topic
from linkage_ros.tools.view.report import (
    Blocks,
    blocks as blocks_module,
    JointStates,
    MOST_JOINTS,
    Progress,
    read_statuses,
)
import numpy as np
import pytest

from .runs import diagnostics, recorded, Said
from ....support.messages import joint_state, read_joint_state

# Messages as arrays, as rosbags reads them one by one; damaged ones are left out.


STATE = 'sensor_msgs/msg/JointState'


def state(joints, rates=True, efforts=False, **options):
    """Return a joint state of joints with their positions; rates and efforts are multiples."""
    values = np.array([*joints.values()], float)
    return joint_state(
        joints, values, 2 * values if rates else (), 3 * values if efforts else (), **options
    )


NAMES = st.text('abcé', min_size=1, max_size=6)

MESSAGES = st.lists(
    st.builds(
        state,
        st.dictionaries(NAMES, st.floats(-1e9, 1e9), min_size=1, max_size=4),
        st.booleans(),
        st.booleans(),
        stamp=st.tuples(st.integers(0, 2**31 - 1), st.integers(0, 10**9 - 1)),
        frame=st.sampled_from(['', 'base']),
        little=st.booleans(),
    ),
    max_size=12,
)


@given(MESSAGES)
def test_joint_state_arrays_equal_those_of_rosbags(messages):
    reader = JointStates()
    block = reader.read(messages)
    assert block.good.all()
    assert not +reader.left_out
    for i, one in enumerate(messages):
        read = read_joint_state(one)
        stamp = read.header.stamp
        assert block.stamps[i] == stamp.sec * 10**9 + stamp.nanosec
        expected = np.full((3, len(reader.joints)), np.nan)
        for row, values in enumerate((read.position, read.velocity, read.effort)):
            for name, value in zip(read.name, values, strict=bool(len(values))):
                expected[row, reader.joints.index(name)] = value
        assert np.array_equal(block.numbers[i], expected, equal_nan=True)


GOOD = state({'a': 1.0, 'b': 2.0})
TWICE = joint_state(['a', 'a'], [1.0, 1.0])

BAD = {
    'malformed message': [
        b'', b'\x00\x01', GOOD[:40], b'\x07' * len(GOOD), GOOD[:4] + b'\xff' * 90
    ],
    'a joint named twice': [TWICE],
    'arrays of unequal length': [joint_state(['a', 'b'], [1.0, 1.0], [1.0])],
    'no joints or no numbers': [joint_state([]), joint_state(['a'])],
}  # fmt: skip


@pytest.mark.parametrize('reason', BAD)
def test_malformed_joint_states_are_left_out_and_counted(reason):
    reader = JointStates()
    block = reader.read([GOOD, *BAD[reason], GOOD])
    assert [*block.good] == [True, *(False for _ in BAD[reason]), True]
    assert +reader.left_out == {reason: len(BAD[reason])}
    assert [*block.numbers[-1, 0]] == [1.0, 2.0]


def test_command_with_efforts_only_is_read():
    reader = JointStates()
    block = reader.read([joint_state(['a'], efforts=[1.5])])
    assert block.good.all()
    assert np.array_equal(block.numbers[0], [[np.nan], [np.nan], [1.5]], equal_nan=True)


def test_joints_beyond_the_first_64_are_counted():
    many = {f'j{i}': float(i) for i in range(MOST_JOINTS + 3)}
    reader = JointStates()
    block = reader.read([state(many)] * 2)
    assert block.numbers.shape == (2, 3, MOST_JOINTS)
    assert [*block.numbers[1, 0]] == [float(i) for i in range(MOST_JOINTS)]
    assert +reader.left_out == {'joints beyond the first 64': 6}


def test_message_layouts_beyond_the_first_64_are_left_out():
    # Of one length, each with other names.
    data = [state({f'joint_{i:05}': 1.0}) for i in range(3000)]
    reader = JointStates()
    block = reader.read(data)
    assert block.good.sum() == 64
    assert +reader.left_out == {'ever new layouts': 2936}


TEXTS = st.text(max_size=9).map(lambda text: text.replace('\0', ''))


@given(
    st.lists(
        st.builds(
            Said, st.just(0), TEXTS, st.dictionaries(TEXTS, TEXTS, max_size=3),
            st.integers(0, 3), TEXTS,
        ),
        max_size=4,
    ),
    st.booleans(),
)  # fmt: skip
def test_diagnostics_written_by_rosbags_are_read(said, little):
    expected = [(one.level, f'{one.node}: {one.task}', one.message, one.values) for one in said]
    assert [tuple(each) for each in read_statuses(diagnostics(said, little))] == expected


def test_diagnostics_written_by_the_node_are_read():
    pytest.importorskip('rclpy')
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
    from rclpy.serialization import serialize_message

    message = DiagnosticArray()
    message.header.stamp.sec = 7
    for level, name, text, values in (
        (1, 'linkage: tick', 'spät', {'Lost ticks': '3', '': ''}),
        (0, 'linkage: crank', '', {}),
    ):
        pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
        status = DiagnosticStatus(level=bytes([level]), name=name, message=text, values=pairs)
        message.status.append(status)
    assert [tuple(each) for each in read_statuses(serialize_message(message))] == [
        (1, 'linkage: tick', 'spät', {'Lost ticks': '3', '': ''}),
        (0, 'linkage: crank', '', {}),
    ]


def test_damaged_diagnostics_give_no_status():
    assert read_statuses(diagnostics([Said(0, '', {})] * 10_001)) == []
    whole = diagnostics([Said(0, 'tick', {'a': 'b'}, 2, 'late'), Said(0, 'crank', {})])
    assert len(read_statuses(whole)) == 2
    for cut in range(len(whole)):
        assert read_statuses(whole[:cut]) == []


# A bag in blocks: nothing is lost, ticks stay whole, and counts are those of ``linkage info``.


BLOCK_NAMES = ('/a', '/b', '/c')
TOPICS = tuple(Topic(name, 'std_msgs/msg/Empty', '', '') for name in BLOCK_NAMES)

BLOCK_MESSAGES = st.lists(
    st.builds(
        BagMessage,
        st.sampled_from((*BLOCK_NAMES, '/not in the index')),
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


@given(BLOCK_MESSAGES, st.sets(st.sampled_from(BLOCK_NAMES)))
def test_blocks_hold_every_wanted_message_in_order(messages, wanted):
    found, counts = [], []
    reader = Blocks(bag_of(messages), wanted, Progress(counts.append))
    for block in reader:
        entries = sorted((*entry, name) for name, own in block.items() for entry in own)
        assert len({number for number, *_ in entries}) == len(entries)
        found += [(name, *entry) for _, *entry, name in entries]
    assert found == [tuple(each) for each in messages if each.topic in wanted]
    assert counts == sorted(counts)
    assert reader.count_contents() == contents_of(bag_of(messages))


@given(BLOCK_MESSAGES)
def test_tick_lies_within_one_block(messages):
    blocks = [
        sorted((number, log, len(data)) for own in block.values() for number, log, _, data in own)
        for block in Blocks(bag_of(messages), (*BLOCK_NAMES, '/not in the index'), Progress())
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
def test_block_counts_of_a_damaged_bag_equal_info(tmp_path, harm):
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
        each.messages
        for each in reader.count_contents().topics
        if each.topic.name == '/joint_states'
    )
    assert reader.count_contents() == contents_of(bag)
    assert bool(reader.count_contents().damage) == (harm == 'a damaged chunk')


def test_stop_ends_reading_at_the_next_block():
    messages = [BagMessage('/a', index, 0, b'') for index in range(100)]
    reader = Blocks(bag_of(messages), ['/a'], Progress(stopped=lambda: True))
    assert sum(len(block['/a']) for block in reader) == 8
    assert reader.count_contents().stopped
