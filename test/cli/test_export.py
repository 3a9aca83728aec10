# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage export``: every number of a bag, as rosbags reads it, to the last bit."""

from __future__ import annotations

from collections.abc import Sequence
import csv
from itertools import islice
import json
import os
from pathlib import Path
import resource
from struct import pack
import subprocess
import sys
from threading import Event
from typing import Any

from hypothesis import given, strategies as st
from linkage_ros.bag import BagWriter, RUN_FILE
from linkage_ros.cli import export
from linkage_ros.description import tables
from linkage_ros.errors import LinkageError
from linkage_ros.messages import (
    JOINT_STATE_TYPE,
    JointStateWriter,
    JointTrajectoryWriter,
    MessageValues,
    TRAJECTORY,
    WRENCHES,
)
from linkage_ros.resources import shipped_path
import numpy as np
import pytest

from .recorded import (
    answer,
    BEGIN,
    MS,
    Recorded,
    scene_file,
    SECOND,
    stamp_of,
    STORE,
    told,
    topic,
)
from ..support.commands import environment

try:
    from pyarrow import parquet
except ImportError as error:
    # Not installed, or a newer one than this numpy: CSV needs neither.
    parquet, why = None, str(error)
else:
    why = ''
needs_pyarrow = pytest.mark.skipif(parquet is None, reason=why)

FOUR_BAR, SLIDER_CRANK = (
    shipped_path(f'linkages/{name}.yaml').read_text('utf-8')
    for name in ('four_bar', 'slider_crank')
)
FIRST = ['time [s]', 'stamp [ns]', 'publish time [ns]', 'log time [ns]']
EVERYTHING = """
linkage: l.yaml
publish_input: true
loads: {gravity: [0, -9.81]}
effects:
  {acceleration: {}, effort: {}, pin_forces: {}, delay: {seconds: 0.002, stamp: measured}}
"""


def crank(number: int) -> dict[str, tuple[float, float]]:
    return {'crank_joint': (0.1 + 0.013 * number, 13.0)}


def bits(value: float | None) -> bytes | int | None:
    return pack('<d', value) if isinstance(value, float) else value


def read_csv(file: Path) -> tuple[list[str], list[list[float | int | None]]]:
    with file.open(newline='', encoding='utf-8') as stream:
        heads, *rows = csv.reader(stream)
    whole = [head in FIRST[1:] for head in heads]
    return heads, [
        [
            (int(cell) if is_whole else float(cell)) if cell else None
            for cell, is_whole in zip(row, whole, strict=True)
        ]
        for row in rows
    ]


def read_parquet(file: Path) -> tuple[list[str], list[list[float | int | None]]]:
    table = parquet.read_table(file)
    assert [str(field.type) for field in table.schema] == [
        'int64' if field.name in FIRST[1:] else 'double' for field in table.schema
    ]
    columns = [column.to_pylist() for column in table.columns]
    return table.column_names, [list(row) for row in zip(*columns, strict=True)]


READERS = {'.csv': read_csv, '.parquet': read_parquet}

ENDINGS = ('.csv', pytest.param('.parquet', marks=needs_pyarrow))


@pytest.fixture(params=ENDINGS)
def exported(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    """Return a function that exports a bag, and returns headings and rows of the file."""

    def exported(bag: Path, *more: str) -> tuple[list[str], list[list[Any]]]:
        file = tmp_path / f'table{request.param}'
        assert answer(export, bag, '-o', file, *more) == 0
        return READERS[request.param](file)

    return exported


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('run')
    return Recorded(folder / 'bag', scene_file(folder, EVERYTHING, FOUR_BAR), crank).run(400)


PINS = ('O2', 'O4', 'A', 'B')


def test_exported_row_equals_the_messages_of_its_tick(bag: Path, exported: Any) -> None:
    heads, rows = exported(bag)
    joints = ('crank_joint', 'coupler_joint', 'rocker_joint')
    assert heads == [
        *FIRST,
        *(f'{joint} [rad]' for joint in joints),
        *(f'{joint} rate [rad/s]' for joint in joints),
        *(f'{joint} acceleration [rad/s²]' for joint in joints),
        *(f'{joint} effort [N·m]' for joint in joints),
        *(
            head
            for pin in PINS
            for head in (f'{pin} force x [N]', f'{pin} force y [N]', f'{pin} torque [N·m]')
        ),
    ]
    found: dict[str, list[Any]] = {}
    for name, log, message in told(bag):
        found.setdefault(name, []).append((log, message))
    # For two ticks the delay has nothing to say.
    assert len(found['/joint_states']) == len(rows) == 398
    expected = []
    for (log, state), (_, motion), (_, forces) in zip(
        *(found[name] for name in ('/joint_states', '/linkage/motion', '/linkage/pin_forces')),
        strict=True,
    ):
        (point,) = motion.points
        assert tuple(forces.joint_names) == PINS
        row = [
            (stamp_of(state) - BEGIN) / 1e9,
            stamp_of(state),
            stamp_of(forces),  # of the tick itself; what is read is older by the delay
            log,
            *state.position,
            *state.velocity,
            *point.accelerations,
            *state.effort,
        ]
        for wrench in forces.wrench:
            row += [wrench.force.x, wrench.force.y, wrench.torque.z]
        expected.append(row)
    assert [list(map(bits, row)) for row in rows] == [list(map(bits, row)) for row in expected]
    assert rows[7][2] - rows[7][1] == 2 * MS


def test_crank_samples_are_exported_as_their_own_table(bag: Path, exported: Any) -> None:
    heads, rows = exported(bag, '--topic', '/crank_states')
    assert heads == [*FIRST, 'crank_joint [rad]', 'crank_joint rate [rad/s]']
    assert rows == [
        # stamp, when it was sent, and when the tick took it
        [k / 1000, at, at + MS // 8, at + MS // 4, 0.1 + 0.013 * k, 13.0]
        for k in range(400)
        for at in [BEGIN + k * MS]
    ]


def test_export_of_the_motion_topic_has_every_acceleration(bag: Path, exported: Any) -> None:
    heads, rows = exported(bag, '--topic', '/linkage/motion')
    assert heads[4::3] == [
        'crank_joint [rad]',
        'crank_joint rate [rad/s]',
        'crank_joint acceleration [rad/s²]',
    ]
    assert len(rows) == 398


def test_slide_is_exported_in_metres(tmp_path: Path, exported: Any) -> None:
    scene = scene_file(tmp_path, 'effects: {acceleration: {}}\n', SLIDER_CRANK)
    run = Recorded(tmp_path / 'bag', scene, crank)
    heads, _ = exported(run.run(5))
    assert heads[4:] == [
        *('rod_joint [rad]', 'piston_slide [m]'),
        *('rod_joint rate [rad/s]', 'piston_slide rate [m/s]'),
        *('rod_joint acceleration [rad/s²]', 'piston_slide acceleration [m/s²]'),
    ]


TWO = """
effects: {velocity: {}}
linkages:
- {name: left, linkage: l.yaml}
- {name: right, linkage: l.yaml}
"""


@pytest.mark.parametrize('crank_topic', ['/crank_states', '/joint_states'])
def test_silent_linkage_leaves_empty_cells(
    tmp_path: Path, exported: Any, crank_topic: str
) -> None:
    def cranks(number: int) -> dict[str, tuple[float, float]]:
        # The left one is heard of in ticks 4 to 7 only, and holds for max_age.
        right = {'right_crank_joint': (0.01 * number, 10.0)}
        return right | ({'left_crank_joint': (1.0, 0.0)} if number in range(4, 8) else {})

    run = Recorded(tmp_path / 'bag', scene_file(tmp_path, TWO), cranks, crank_topic)
    heads, rows = exported(run.run(20))
    assert heads[4:8] == [
        *('left_coupler_joint [rad]', 'left_rocker_joint [rad]'),
        *('right_coupler_joint [rad]', 'right_rocker_joint [rad]'),
    ]
    # Where crank and joint states share the topic, the samples make no rows.
    assert len(rows) == 20
    assert [row[4] is None for row in rows] == [index < 4 for index in range(20)]
    assert [row[4] for row in rows if row[4] is not None] == [
        message.position[message.name.index('left_coupler_joint')]
        for _, _, message in told(tmp_path / 'bag')
        if 'left_coupler_joint' in message.name
    ]
    assert not any(row[6] is None for row in rows)


def test_shared_topic_exports_pin_forces_in_the_same_rows(tmp_path: Path, exported: Any) -> None:
    scene = scene_file(tmp_path, EVERYTHING, FOUR_BAR)
    heads, rows = exported(Recorded(tmp_path / 'bag', scene, crank, '/joint_states').run(20))
    force = heads.index('A force x [N]')
    assert [row[force] is None for row in rows] == [row[4] is None for row in rows] != []


@pytest.mark.parametrize(
    ('said', 'crank'),
    [
        ('rate: 0', crank),
        ('rate: 1000', crank),
        ('drive: {constant_rate: {rate: 9}}\npublish_input: false', None),
    ],
)
def test_dropped_messages_shift_no_exported_rows(
    tmp_path: Path, exported: Any, said: str, crank: Any
) -> None:
    gone = {(3, '/joint_states'), (4, '/linkage/motion'), (5, '/joint_states')}
    gone |= {(5, '/linkage/motion'), (8, '/linkage/motion'), (9, '/joint_states')}
    scene = scene_file(tmp_path, f'{said}\neffects: {{acceleration: {{}}}}\n')
    run = Recorded(tmp_path / 'bag', scene, crank, drop=lambda *which: which in gone)
    heads, rows = exported(run.run(12))
    assert heads[8] == 'coupler_joint acceleration [rad/s²]'
    assert [row[1] for row in rows] == [BEGIN + k * MS for k in range(12) if k != 5]
    # A motion repeats position and rate, so that of a joint state nothing is lost.
    accelerated = [(row[1] - BEGIN) // MS for row in rows if row[8] is not None]
    assert accelerated == [k for k in range(12) if k not in (4, 5, 8)]
    assert all(row[4] is not None and row[6] is not None for row in rows)


def test_ticks_of_equal_time_are_exported_as_separate_rows(tmp_path: Path, exported: Any) -> None:
    run = {
        'scene': 's', 'crank_topic': '/c', 'joint_states_topic': '/js', 'extra_topics': ['/m']
    }  # fmt: skip
    topics = [
        topic('/c', JOINT_STATE_TYPE),
        topic('/js', JOINT_STATE_TYPE),
        topic('/m', TRAJECTORY),
    ]
    writer = BagWriter(tmp_path / 'bag', topics, {RUN_FILE: ('', json.dumps(run).encode())})
    state, motion = JointStateWriter(['j']).write, JointTrajectoryWriter(['j']).write
    crank, states, motions = range(3)
    writer.write(motions, 0, 5, motion(5, (1.0,), (0.1,), (0.01,)))  # its joint state was dropped
    writer.write(crank, 0, 5, state(5, (0.0,), ()))
    writer.write(states, 0, 5, state(5, (2.0,), ()))
    writer.write(motions, 0, 5, motion(6, (3.0,), (0.3,), (0.03,)))
    writer.write(states, 0, 5, state(7, (4.0,), ()))
    writer.close()
    heads, rows = exported(tmp_path / 'bag')
    unit = 'rad or m'
    assert heads[4:] == [f'j [{unit}]', 'j rate [rad/s or m/s]', 'j acceleration [rad/s² or m/s²]']
    # Where both tell the same joint, the joint state counts, and so does its stamp.
    assert [row[1:2] + row[4:] for row in rows] == [
        [5, 1.0, 0.1, 0.01], [5, 2.0, 0.3, 0.03], [7, 4.0, None, None]
    ]  # fmt: skip


def joint_state(
    stamp: int,
    names: Sequence[str],
    position: Sequence[float] = (),
    velocity: Sequence[float] = (),
    effort: Sequence[float] = (),
    *,
    little: bool = True,
) -> bytes:
    """Return a JointState as rosbags writes it."""
    types = STORE.types
    message = types[JOINT_STATE_TYPE](
        types['std_msgs/msg/Header'](
            types['builtin_interfaces/msg/Time'](*divmod(stamp, SECOND)), 'some frame'
        ),
        list(names),
        *(np.array(values, dtype=np.float64) for values in (position, velocity, effort)),
    )
    return bytes(STORE.serialize_cdr(message, JOINT_STATE_TYPE, little_endian=little))


def foreign(folder: Path, *messages: bytes, topics: Sequence[str] = ('/js',)) -> Path:
    """Write a bag without a scene, its messages on the first topic."""
    writer = BagWriter(folder, [topic(name, JOINT_STATE_TYPE) for name in topics])
    for index, message in enumerate(messages):
        writer.write(0, BEGIN + index, BEGIN + index, message)
    writer.close()
    return folder


ODD = [-0.0, 5e-324, 1.7976931348623157e308, float('inf'), float('-inf'), 0.1 + 0.2, 1e-7, 3.0]


@pytest.mark.parametrize('little', [True, False])
def test_exported_numbers_keep_every_bit(tmp_path: Path, exported: Any, little: bool) -> None:
    messages = [joint_state(k, ['j'], [value], little=little) for k, value in enumerate(ODD)]
    heads, rows = exported(foreign(tmp_path / 'bag', *messages))
    # Nobody says whether it turns or slides.
    assert heads[4:] == ['j [rad or m]']
    assert [bits(row[4]) for row in rows] == list(map(bits, ODD))


def test_exported_nan_differs_from_a_missing_value(tmp_path: Path, exported: Any) -> None:
    bag = foreign(
        tmp_path / 'bag', joint_state(1, ['j'], [float('nan')]), joint_state(2, ['j']),
        joint_state(3, [], []), joint_state(4, ['i', 'j'], [1.0, 2.0], effort=[5.0, 6.0]),
    )  # fmt: skip
    heads, rows = exported(bag)
    assert heads[4:] == [
        *('j [rad or m]', 'i [rad or m]', 'j effort [N·m or N]', 'i effort [N·m or N]')
    ]
    assert rows[0][4] != rows[0][4]
    assert [row[5:] for row in rows[:3]] == [[None] * 3] * 3
    assert [row[4] for row in rows[1:3]] == [None, None]
    assert rows[3][4:] == [2.0, 1.0, 6.0, 5.0]
    assert [row[1] for row in rows] == [1, 2, 3, 4]


def test_any_joint_name_is_a_column_heading(tmp_path: Path, exported: Any) -> None:
    names = ['a,b', 'say "x"', 'two\nlines', 'größe', '', ' ']
    heads, rows = exported(foreign(tmp_path / 'bag', joint_state(1, names, range(6))))
    assert heads[4:] == [f'{name} [rad or m]' for name in names]
    assert rows[0][4:] == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_commands_are_exported_for_joints_without_effort(
    tmp_path: Path, exported: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    names = ['rocker_joint', 'crank_joint']
    scene = scene_file(tmp_path, 'rate: 100\n')
    run = {'scene': 's', 'joint_states_topic': '/js', 'crank_topic': '/crank_commands'}
    writer = BagWriter(
        tmp_path / 'bag',
        [topic('/js', JOINT_STATE_TYPE), topic('/crank_commands', JOINT_STATE_TYPE)],
        {
            RUN_FILE: ('', json.dumps(run).encode()),
            'scene.yaml': ('', scene.read_bytes()),
            'linkage.yaml': ('', (tmp_path / 'l.yaml').read_bytes()),
        },
    )
    for time, efforts in enumerate(([0.5, 1.5], [2.5], [3.5])):
        writer.write(1, BEGIN + time, BEGIN + time, joint_state(time, names, (), (), efforts))
    writer.close()
    heads, rows = exported(tmp_path / 'bag', '--topic', '/crank_commands')
    assert heads[4:] == ['rocker_joint effort [N·m]', 'crank_joint effort [N·m]']
    assert [row[4:] for row in rows] == [[0.5, 1.5], [None, 2.5], [None, 3.5]]
    assert capsys.readouterr().err == ''


def test_malformed_messages_are_left_out_and_counted(
    tmp_path: Path, exported: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    good = joint_state(1, ['j'], [1.0])
    bag = foreign(
        tmp_path / 'bag', good, b'', b'\0\1\0\0', good[:-30], b'\0\7' + good[2:],
        joint_state(2, ['j', 'k'], [1.0]), joint_state(3, ['j', 'j'], [1.0, 2.0]),
        joint_state(4, ['j'], [2.0]),
    )  # fmt: skip
    _, rows = exported(bag)
    assert [row[4] for row in rows] == [1.0, 2.0]
    said = capsys.readouterr()
    assert said.err.splitlines() == [
        'linkage export: /js: 4 messages left out: malformed message',
        'linkage export: /js: 1 messages left out: arrays of unequal length',
        'linkage export: /js: 1 messages left out: a joint named twice',
    ]
    assert ': 2 rows, 5 columns (2 of /js)\n' in said.out


def test_export_asks_for_one_of_two_topics(tmp_path: Path, exported: Any) -> None:
    bag = foreign(tmp_path / 'bag', joint_state(1, ['j'], [1.0]), topics=('/a', '/b'))
    with pytest.raises(LinkageError, match='holds joint states on /a, /b; name one with --topic'):
        exported(bag)
    assert len(exported(bag, '--topic', '/a')[1]) == 1


names = st.lists(st.text(max_size=9), max_size=4, unique=True).filter(
    lambda found: not any('\0' in name for name in found)
)
numbers = st.floats(width=64)


@given(data=st.data(), stamp=st.integers(-(2**31) * SECOND, 2**31 * SECOND - 1))
@pytest.mark.parametrize('kind', [JOINT_STATE_TYPE, TRAJECTORY, WRENCHES])
def test_exported_values_equal_those_serialized_by_rosbags(
    data: Any, stamp: int, kind: str
) -> None:
    types, reader = STORE.types, MessageValues(kind)
    joints = data.draw(names)

    def draw(each: int = 1) -> Any:
        count = data.draw(st.sampled_from([0, len(joints)])) * each
        drawn = data.draw(st.lists(numbers, min_size=count, max_size=count))
        return np.array(drawn, dtype=np.float64)

    seconds, rest = divmod(stamp, SECOND)
    header = types['std_msgs/msg/Header'](
        types['builtin_interfaces/msg/Time'](seconds, rest), data.draw(st.text(max_size=5))
    )
    expected: list[tuple[tuple[str, str], float]] = []
    if kind == JOINT_STATE_TYPE:
        told_of = {'position': draw(), 'rate': draw(), 'effort': draw()}
        message = types[kind](header, joints, *told_of.values())
    elif kind == TRAJECTORY:
        told_of = {'position': draw(), 'rate': draw(), 'acceleration': draw(), 'effort': draw()}
        point = types['trajectory_msgs/msg/JointTrajectoryPoint'](
            *told_of.values(),
            types['builtin_interfaces/msg/Duration'](data.draw(st.integers(0, 9)), 0),
        )
        message = types[kind](header, joints, [point])
    else:
        six = draw(6).reshape(-1, 6)
        vector, wrench = types['geometry_msgs/msg/Vector3'], types['geometry_msgs/msg/Wrench']
        wrenches = [wrench(vector(*row[:3]), vector(*row[3:])) for row in six.tolist()]
        message = types[kind](header, joints, [], [], wrenches)
        quantities = ('force x', 'force y', 'force z', 'torque x', 'torque y', 'torque')
        told_of = dict(zip(quantities, six.T, strict=True))
    for quantity, values in told_of.items():
        if len(values):
            expected += [((name, quantity), v) for name, v in zip(joints, values, strict=True)]
    encoded = bytes(STORE.serialize_cdr(message, kind, little_endian=data.draw(st.booleans())))
    for _ in range(2):  # parsed, and then known
        found = reader.read(encoded)
        assert found.stamp == stamp
        assert {
            key: bits(value) for key, value in zip(found.keys, found.numbers, strict=True)
        } == {key: bits(value) for key, value in expected}
    # Cut anywhere, or with any byte changed, it is left out or tells something; it never raises.
    cut = data.draw(st.integers(0, len(encoded)))
    reader.read(encoded[:cut])
    spoilt = bytearray(encoded)
    spoilt[data.draw(st.integers(0, len(encoded) - 1))] ^= data.draw(st.integers(1, 255))
    reader.read(bytes(spoilt))


@pytest.mark.parametrize(
    ('kind', 'changed', 'reason'),
    [
        (TRAJECTORY, 'points', 'not one point'),
        (WRENCHES, 'transforms', 'transforms or twists'),
        (WRENCHES, 'twist', 'transforms or twists'),
    ],
)
def test_trajectories_and_wrenches_beyond_one_instant_are_left_out(
    kind: str, changed: str, reason: str
) -> None:
    types = STORE.types
    header = types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](1, 0), '')
    vector = types['geometry_msgs/msg/Vector3'](0.0, 0.0, 0.0)
    empty = np.zeros(0)
    fields: dict[str, list[Any]]
    if kind == TRAJECTORY:
        point = types['trajectory_msgs/msg/JointTrajectoryPoint'](
            empty, empty, empty, empty, types['builtin_interfaces/msg/Duration'](0, 0)
        )
        fields = {'points': [point, point]}
    else:
        quaternion = types['geometry_msgs/msg/Quaternion'](0.0, 0.0, 0.0, 1.0)
        fields = {'transforms': [], 'twist': [], 'wrench': []}
        fields[changed] = [
            types['geometry_msgs/msg/Transform'](vector, quaternion)
            if changed == 'transforms'
            else types['geometry_msgs/msg/Twist'](vector, vector)
        ]
    message = types[kind](header, ['j'], **fields)
    assert MessageValues(kind).read(bytes(STORE.serialize_cdr(message, kind))) == reason


def test_truncated_bag_exports_its_whole_part(
    bag: Path, tmp_path: Path, exported: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    _, whole = exported(bag)
    content = (bag / 'bag_0.mcap').read_bytes()
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(content[: 2 * len(content) // 3])
    _, rows = exported(cut)
    assert 100 < len(rows) < 398
    # The last tick may have lost what followed its joint state.
    assert rows[:-1] == whole[: len(rows) - 1]
    assert ': unfinished: its recording was killed, ' in capsys.readouterr().err


def test_damaged_bag_exports_nothing_and_keeps_the_old_file(bag: Path, tmp_path: Path) -> None:
    content = bytearray((bag / 'bag_0.mcap').read_bytes())
    content[len(content) // 2] ^= 1
    (tmp_path / 'bad.mcap').write_bytes(content)
    (tmp_path / 'out.csv').write_text('what was there before')
    with pytest.raises(LinkageError, match='is damaged'):
        answer(export, tmp_path / 'bad.mcap', '-o', tmp_path / 'out.csv')
    assert sorted(path.name for path in tmp_path.iterdir()) == ['bad.mcap', 'out.csv']
    assert (tmp_path / 'out.csv').read_text() == 'what was there before'


@needs_pyarrow
def test_parquet_written_in_blocks_equals_one_block(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, blocks = tmp_path / 'a.parquet', tmp_path / 'b.parquet'
    assert answer(export, bag, '-o', whole) == 0
    monkeypatch.setattr(tables, '_CELLS', 1000)  # 35 rows of 28 columns
    assert answer(export, bag, '-o', blocks) == 0
    assert parquet.ParquetFile(blocks).num_row_groups == 12
    assert read_parquet(blocks) == read_parquet(whole)


@pytest.mark.parametrize('name', ['folder.csv', 'fifo.csv'])
def test_folder_or_fifo_is_not_replaced_by_a_table(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path('folder.csv').mkdir()
    os.mkfifo('fifo.csv')
    with pytest.raises(LinkageError, match=f'{name}: exists and is not a file; name another'):
        answer(export, bag, '-o', name)
    assert sorted(path.name for path in tmp_path.iterdir()) == ['fifo.csv', 'folder.csv']


def test_export_refuses_a_bag_without_joint_states(bag: Path, tmp_path: Path) -> None:
    BagWriter(tmp_path / 'a', [topic('/t', 'std_msgs/msg/String')]).close()
    with pytest.raises(LinkageError, match='holds no topic of sensor_msgs/msg/JointState'):
        answer(export, tmp_path / 'a', '-o', tmp_path / 'x.csv')
    with pytest.raises(LinkageError, match='holds no message on /js to write; '):
        answer(export, foreign(tmp_path / 'b'), '-o', tmp_path / 'x.csv')
    with pytest.raises(LinkageError, match=r'\(1 left out: malformed message\)'):
        answer(export, foreign(tmp_path / 'c', b'?'), '-o', tmp_path / 'x.csv')
    with pytest.raises(LinkageError, match='is of builtin_interfaces/msg/Time'):
        answer(export, bag, '-o', tmp_path / 'x.csv', '--topic', '/linkage/withheld')
    assert not (tmp_path / 'x.csv').exists()


def test_parquet_without_pyarrow_names_what_to_install(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, 'pyarrow', None)
    with pytest.raises(LinkageError, match=r"pip install 'linkage_ros\[export\]'"):
        answer(export, bag, '-o', tmp_path / 'x.parquet')
    assert answer(export, bag, '-o', tmp_path / 'x.csv') == 0


def test_broken_pyarrow_names_its_error_and_what_to_install(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # As pyarrow 26 does beside the numpy of Ubuntu 24.04.
    (tmp_path / 'pyarrow').mkdir()
    (tmp_path / 'pyarrow/__init__.py').write_text(
        "raise ImportError('pyarrow requires NumPy 2.0 or newer, found 1.26.4')\n"
    )
    monkeypatch.delitem(sys.modules, 'pyarrow', raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(LinkageError) as caught:
        answer(export, bag, '-o', tmp_path / 'x.parquet')
    assert str(caught.value) == (
        'pyarrow: cannot be loaded: pyarrow requires NumPy 2.0 or newer, found 1.26.4; '
        "pip install 'linkage_ros[export]', or name a file that ends in .csv"
    )
    assert answer(export, bag, '-o', tmp_path / 'x.csv') == 0


def test_stopped_export_writes_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write = JointStateWriter(['j']).write
    bag = foreign(tmp_path / 'bag', *(write(k, (0.0,), ()) for k in range(5000)))
    stop = Event()
    stop.set()
    assert answer(export, bag, '-o', tmp_path / 'x.csv', stop=stop) == 1
    assert capsys.readouterr().err == 'linkage export: stopped; nothing was written\n'
    assert [path.name for path in tmp_path.iterdir()] == ['bag']


@pytest.mark.parametrize('ending', ENDINGS)
def test_full_disk_keeps_the_old_table(bag: Path, tmp_path: Path, ending: str) -> None:
    target = tmp_path / f'x{ending}'
    target.write_text('before')
    words = ['export', str(bag), '-o', target.name, '--force']
    limited = subprocess.run(
        [sys.executable, '-m', 'linkage_ros.cli.main', *words],
        cwd=tmp_path,
        env=environment(tmp_path),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096)),
        capture_output=True,
        text=True,
        check=False,
    )
    assert limited.returncode == 2
    assert limited.stderr == (
        f'linkage export: x{ending}: cannot be written: File too large; name another file\n'
    )
    assert [path.name for path in tmp_path.iterdir()] == [target.name]
    assert target.read_text() == 'before'


def test_export_writes_through_a_symbolic_link(bag: Path, tmp_path: Path) -> None:
    (tmp_path / 'data').mkdir()
    (tmp_path / 'x.csv').symlink_to('data/real.csv')
    assert answer(export, bag, '-o', tmp_path / 'x.csv') == 0
    assert (tmp_path / 'x.csv').is_symlink()
    with (tmp_path / 'data' / 'real.csv').open() as stream:
        (first,) = islice(stream, 1)
    assert first.startswith('time [s],stamp [ns],')
