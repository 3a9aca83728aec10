# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage info``: what a bag holds, by rosbags; how its run went, by the textbook's formulas."""

from __future__ import annotations

from contextlib import suppress
from datetime import datetime
import json
from math import acos, cos, pi, sin, sqrt
from pathlib import Path
from threading import Event
from typing import Any

from linkage_ros.bag import BagMessage, BagWriter, METADATA_FILE, RUN_FILE
from linkage_ros.cli import info
from linkage_ros.description import load_scene, Scene
from linkage_ros.kinematics import Closure
from linkage_ros.replay import simulate_run
from linkage_ros.tick import LinkagePipeline
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import (
    CompressionFormat,
    CompressionMode,
    StoragePlugin,
    Writer as RosbagsWriter,
)

from .recorded import (
    answer,
    BEGIN,
    FOUR_BAR,
    JOINT_STATE,
    MS,
    Recorded,
    rewritten,
    scene_file,
    SECOND,
    stamp_of,
    STORE,
    told,
    topic,
)

A, B, C, D = 0.04, 0.12, 0.08, 0.1  # crank, coupler, rocker and ground of FOUR_BAR
EFFECTS = 'effects: {acceleration: {}}\n'


def crank(number: int) -> dict[str, tuple[float, float]]:
    """Return a crank that turns at 7 rad/s from 1 rad on, beside a joint that is none of ours."""
    return {'other_joint': (0.5, 0.0), 'crank_joint': (1.0 + 0.007 * number, 7.0)}


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('run')
    run = Recorded(folder / 'bag', scene_file(folder, EFFECTS), crank)
    return run.run(1500, dropped={'/linkage/motion': 3})


@pytest.fixture
def tell(capsys: pytest.CaptureFixture[str]) -> Any:
    def tell(path: Path) -> dict[str, Any]:
        assert answer(info, path, '--json') == 0
        account: dict[str, Any] = json.loads(capsys.readouterr().out)
        return account

    return tell


def test_info_counts_and_times_equal_those_of_rosbags(bag: Path, tell: Any) -> None:
    account = tell(bag)
    with AnyReader([bag]) as reader:
        assert account['duration_ns'] == reader.end_time - 1 - reader.start_time
        assert account['begin_ns'] == reader.start_time
        assert account['messages'] == reader.message_count
        expected = {name: (found.msgtype, found.msgcount) for name, found in reader.topics.items()}
    found = {each['name']: (each['type'], each['messages']) for each in account['topics']}
    assert found == expected
    assert [each['dropped'] for each in account['topics']] == [0, 0, 3, 0]
    # 1500 ticks at 1 kHz, all at log times a period apart.
    rates = {each['name']: each['rate_hz'] for each in account['topics']}
    assert rates['/joint_states'] == rates['/crank_states'] == pytest.approx(1000.0, rel=1e-12)
    assert rates['/linkage/withheld'] is None
    assert account['size_bytes'] == (bag / 'bag_0.mcap').stat().st_size
    assert [file['name'] for file in account['files']] == ['bag_0.mcap']
    assert account['begin_ns'] == BEGIN + MS // 4
    # The local text is the same instant, whatever the zone; its last three digits are below 1 µs.
    text = account['begin']
    read = datetime.strptime(f'{text[:26]}{text[29:]}', '%Y-%m-%d %H:%M:%S.%f%z')
    assert read.timestamp() == pytest.approx(account['begin_ns'] / SECOND, abs=1e-6)


def test_info_prints_versions_scene_and_replay_of_a_run(bag: Path, tell: Any) -> None:
    account = tell(bag)
    assert account['versions'] == {
        'linkage_ros': '9.8.7',
        'python': '3.99.1',
        'machine': 'abacus',
        'ros_distro': 'jazzy',
        'rosbag2_metadata': 9,
        'written_by': account['versions']['written_by'],
    }
    assert account['versions']['written_by'].startswith('linkage_ros ')
    (linkage,) = account['scene']['linkages']
    assert account['scene']['name'] == 'scene of mine'
    assert linkage['inputs'] == [{'joint': 'crank_joint', 'unit': 'rad'}]
    assert linkage['joints'] == ['coupler_joint', 'rocker_joint']
    assert (linkage['drive'], linkage['effects']) == ('topic', ['acceleration'])
    assert linkage['four_bars'] == [{'kind': 'crank-rocker', 'lengths_m': [A, B, C, D]}]
    assert account['replay'] == {'joint_states': 1500, 'same_bytes': 1500}
    assert (account['truncated'], account['damage'], account['stopped']) == (False, None, False)


def transmission(crank_angle: float, a: float, b: float, c: float, d: float) -> float:
    """Return the acute angle between coupler and rocker, by the law of cosines, twice."""
    diagonal = a * a + d * d - 2 * a * d * cos(crank_angle)
    angle = acos((b * b + c * c - diagonal) / (2 * b * c))
    return min(angle, pi - angle)


def test_nearest_toggle_distance_follows_the_law_of_cosines(bag: Path, tell: Any) -> None:
    (linkage,) = tell(bag)['scene']['linkages']
    angles = [1.0 + 0.007 * index for index in range(1500)]
    least = min(range(1500), key=lambda number: transmission(angles[number], A, B, C, D))
    near = linkage['nearest_to_toggle']
    mu = transmission(angles[least], A, B, C, D)
    assert near['transmission_angle_rad'] == pytest.approx(mu, abs=1e-13)
    assert near['conditioning'] == pytest.approx(sqrt(2) * sin(mu / 2), abs=1e-13)
    assert near['time_ns'] == BEGIN + least * MS
    # The tick carries the sample forward by no time at all: it is of the same instant.
    assert near['inputs'] == [angles[least]]
    assert near['input_to_toggle'] is None  # a crank that turns fully meets none
    assert linkage['states'] == 1500
    assert linkage['toggles'] == 0


def test_distance_to_a_toggle_is_given_in_the_input(tmp_path: Path, tell: Any) -> None:
    a, b, c, d = 0.1, 0.05, 0.06, 0.12  # the crank swings: b + c < a + d
    limit = acos((a * a + d * d - (b + c) ** 2) / (2 * a * d))
    run = Recorded(
        tmp_path / 'bag',
        scene_file(tmp_path, '', f'four_bar: {{a: {a}, b: {b}, c: {c}, d: {d}}}\n'),
        lambda number: {'crank_joint': (limit - 0.2995 + 0.001 * number, 1.0)},
    )
    # The last 100 ticks are beyond the limit: no state, and nothing published.
    (linkage,) = tell(run.run(400))['scene']['linkages']
    assert linkage['states'] == 300
    near = linkage['nearest_to_toggle']
    assert near['time_ns'] == BEGIN + 299 * MS
    assert near['input_to_toggle'] == pytest.approx(0.0005, abs=1e-12)
    # The angle goes as the root of the way that is left: digits are lost on either side.
    assert near['transmission_angle_rad'] == pytest.approx(
        transmission(limit - 0.0005, a, b, c, d), rel=1e-10
    )


def test_state_at_a_toggle_is_counted_as_toggle(tmp_path: Path, tell: Any) -> None:
    # Stretched out where the crank lies along the ground: b + c = d - a, at 0 and only there.
    run = Recorded(
        tmp_path / 'bag',
        scene_file(tmp_path, '', 'four_bar: {a: 0.25, b: 0.375, c: 0.375, d: 1.0}\n'),
        lambda number: {'crank_joint': (-1.0 + 0.25 * number, 1.0)},
    )
    (linkage,) = tell(run.run(9))['scene']['linkages']
    assert (linkage['states'], linkage['toggles']) == (1, 1)
    assert linkage['nearest_to_toggle']['conditioning'] == 0.0
    assert linkage['nearest_to_toggle']['inputs'] == [0.0]


def test_worst_residual_is_the_greatest_with_its_time(
    bag: Path, tell: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    (linkage,) = tell(bag)['scene']['linkages']
    worst = linkage['worst_residual']
    assert 0.0 < worst['residual_m'] < 1e-15
    # With something else in its place that the bag tells too: the rocker's angle.
    monkeypatch.setattr(Closure, 'residual', lambda _, position: position.joints[1])
    states = [message for name, _, message in told(bag) if name == '/joint_states']
    greatest = max(states, key=lambda message: message.position[1])
    (linkage,) = tell(bag)['scene']['linkages']
    worst = linkage['worst_residual']
    assert worst['residual_m'] == greatest.position[1]
    assert worst['time_ns'] == stamp_of(greatest)
    assert worst['inputs'] == [1.0 + 0.007 * (stamp_of(greatest) - BEGIN) / MS]


TWO = """
linkages:
- {name: left, linkage: l.yaml, drive: {constant_rate: {rate: 5.0}}}
- {name: right, linkage: l.yaml, drive: {constant_rate: {rate: -3.0, start: 2.0}}}
"""


def test_info_describes_each_of_two_linkages(tmp_path: Path, tell: Any) -> None:
    account = tell(Recorded(tmp_path / 'bag', scene_file(tmp_path, TWO)).run(400))
    left, right = account['scene']['linkages']
    assert (left['name'], right['name']) == ('left', 'right')
    assert left['inputs'] == [{'joint': 'left_crank_joint', 'unit': 'rad'}]
    for linkage, start, rate in ((left, 0.0, 5.0), (right, 2.0, -3.0)):
        angles = [start + rate * index * 1e-3 for index in range(400)]
        least = min(transmission(angle, A, B, C, D) for angle in angles)
        near = linkage['nearest_to_toggle']
        assert near['transmission_angle_rad'] == pytest.approx(least, abs=1e-12)
        assert near['inputs'][0] == pytest.approx(
            start + rate * (near['time_ns'] - BEGIN) * 1e-9, abs=1e-12
        )


def test_info_of_an_mcap_file_equals_its_folder(bag: Path, tell: Any) -> None:
    whole, alone = tell(bag), tell(bag / 'bag_0.mcap')
    assert alone | {'bag': ''} == whole | {'bag': ''}


def test_info_describes_a_bag_without_messages(
    tmp_path: Path, tell: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    BagWriter(tmp_path / 'empty', [topic('/a', JOINT_STATE)]).close()
    account = tell(tmp_path / 'empty')
    assert (account['duration_ns'], account['begin'], account['messages']) == (None, None, 0)
    assert answer(info, tmp_path / 'empty') == 0
    assert 'no messages' in capsys.readouterr().out


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    """Return a bag by rosbags, compressed, without a scene."""
    writer = RosbagsWriter(tmp_path / 'foreign', version=8, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    text = STORE.types['std_msgs/msg/String']
    with writer:
        chatter = writer.add_connection('/chatter', 'std_msgs/msg/String', typestore=STORE)
        for index in range(30):
            data = STORE.serialize_cdr(text('again ' * 1000), 'std_msgs/msg/String')
            writer.write(chatter, BEGIN + index * SECOND // 10, data)
    return tmp_path / 'foreign'


def test_info_describes_a_bag_without_a_scene(
    foreign: Path, tell: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    account = tell(foreign)
    (chatter,) = account['topics']
    assert (chatter['type'], chatter['messages']) == ('std_msgs/msg/String', 30)
    assert chatter['rate_hz'] == pytest.approx(10.0)
    assert chatter['dropped'] is None
    assert account['versions']['rosbag2_metadata'] == 8
    (compression,) = account['compressions']
    assert compression['name'] == 'zstd'
    assert compression['content_bytes'] > 30 * 6000 > 20 * compression['stored_bytes']
    assert account['scene'] is None
    assert 'carries no run.json, scene.yaml' in account['scene_missing']
    assert answer(info, foreign) == 0
    assert 'carries no run.json, scene.yaml; residual and nearness' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('attached', 'reason'),
    [
        ({RUN_FILE: b'{"scene": 3'}, 'its run.json is damaged'),
        ({'scene.yaml': b'linkage: l.yaml\nrate: warp\n'}, 'rate'),
        ({'scene.yaml': b'linkage: l.yaml\neffects: {telepathy: {}}\n'}, 'telepathy'),
        ({'linkage.yaml': b'four_bar: {a: 9, b: 1, c: 1, d: 1}\n'}, 'the loops close at no value'),
        ({'scene.yaml': b'linkage: l.yaml\ndrive: {bag: {file: gone}}\n'}, 'gone'),
    ],
)
def test_info_describes_a_bag_whose_scene_fails_to_load(
    tmp_path: Path, tell: Any, attached: dict[str, bytes], reason: str
) -> None:
    run = {'scene': 's', 'joint_states_topic': '/a', 'linkage_ros': '99.0'}
    files = {
        'scene.yaml': b'linkage: l.yaml\n',
        'linkage.yaml': FOUR_BAR.encode(),
        RUN_FILE: json.dumps(run).encode(),
    } | attached
    writer = BagWriter(
        tmp_path / 'bag',
        [topic('/a', JOINT_STATE)],
        {name: ('', data) for name, data in files.items()},
    )
    writer.write(0, 5, 5, bytes(60))
    writer.close()
    account = tell(tmp_path / 'bag')
    assert account['replay'] is None
    assert reason in account['scene_missing']
    assert account['messages'] == 1


@pytest.mark.parametrize('kept', [0.3, 0.6, 0.9])
def test_info_describes_the_whole_part_of_a_truncated_bag(
    bag: Path, tmp_path: Path, tell: Any, kept: float
) -> None:
    content = (bag / 'bag_0.mcap').read_bytes()
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(content[: int(kept * len(content))])
    expected = 0
    with cut.open('rb') as stream, suppress(EndOfFile):
        for _ in NonSeekingReader(stream).iter_messages(log_time_order=False):
            expected += 1
    account = tell(cut)
    assert account['truncated']
    assert account['messages'] == expected > 100
    assert account['topics'][0]['dropped'] is None
    (linkage,) = account['scene']['linkages']
    assert linkage['states'] == account['replay']['joint_states'] > 30


def test_info_describes_a_damaged_bag_up_to_the_damage(
    bag: Path, tmp_path: Path, tell: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    content = bytearray((bag / 'bag_0.mcap').read_bytes())
    content[len(content) // 2] ^= 4
    damaged = tmp_path / 'damaged.mcap'
    damaged.write_bytes(content)
    account = tell(damaged)
    assert 'is damaged' in account['damage']
    assert 1000 < account['messages'] < 3500
    assert answer(info, damaged) == 0
    assert 'only the part before it is described' in capsys.readouterr().out


@pytest.mark.parametrize(
    'said', ['rubbish', '[1, 2]', '{"/a": "many"}', '{"/b": 2}', '{"/a": NaN}', 'null', '']
)
def test_malformed_drop_counts_are_shown_as_unknown(tmp_path: Path, tell: Any, said: str) -> None:
    writer = BagWriter(tmp_path / 'bag', [topic('/a', JOINT_STATE)])
    writer.close({'linkage_ros.dropped': said, 'linkage_ros.failure': 'the disk is full'})
    account = tell(tmp_path / 'bag')
    assert account['topics'][0]['dropped'] is None
    assert account['recording_failure'] == 'the disk is full'


@pytest.mark.parametrize('version', ['new', '9.5', '[9]', 'null', '[9], ros_distro: [9]'])
def test_malformed_metadata_version_is_shown_as_unknown(
    bag: Path, tmp_path: Path, tell: Any, version: str
) -> None:
    folder = tmp_path / 'bag'
    folder.mkdir()
    (folder / 'bag_0.mcap').write_bytes((bag / 'bag_0.mcap').read_bytes())
    (folder / METADATA_FILE).write_text(f'rosbag2_bagfile_information: {{version: {version}}}\n')
    account = tell(folder)
    assert account['messages'] == 4500
    assert account['versions']['rosbag2_metadata'] is None
    assert account['versions']['ros_distro'] is None


def test_signal_ends_info_while_reading_and_prints_the_part(
    bag: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stop = Event()
    stop.set()
    assert answer(info, bag, '--json', stop=stop) == 1
    told = capsys.readouterr()
    account = json.loads(told.out)
    assert account['stopped']
    assert account['messages'] == 4096
    assert account['scene']['linkages'][0]['states'] == 1024
    assert told.err == 'linkage info: stopped; not all of the bag was read\n'


class Later(Event):
    """A signal that comes after somebody has asked for it once."""

    def is_set(self) -> bool:
        before = super().is_set()
        self.set()
        return before


def test_signal_ends_info_while_examining_states(
    bag: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert answer(info, bag, '--json', stop=Later()) == 1
    account = json.loads(capsys.readouterr().out)
    assert account['stopped']
    assert account['messages'] == 4500
    assert account['scene']['linkages'][0]['states'] == 1024


def test_info_counts_joint_states_that_replay_differently(
    bag: Path, tmp_path: Path, tell: Any
) -> None:
    def edit(index: int, message: BagMessage) -> BagMessage:
        changed = message.topic == '/joint_states' and 300 < index < 400
        return message._replace(data=message.data[:-16] + bytes(16)) if changed else message

    assert tell(rewritten(bag, tmp_path / 'bag', edit))['replay'] == {
        'joint_states': 1500,
        'same_bytes': 1467,
    }


def test_info_escapes_terminal_sequences_in_topic_names(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    BagWriter(tmp_path / 'bag', [topic('/a\x1b[2J\n', JOINT_STATE)]).close()
    assert answer(info, tmp_path / 'bag') == 0
    out = capsys.readouterr().out
    assert '/a\\x1b[2J\\n' in out
    assert '\x1b' not in out


@pytest.mark.parametrize(('beyond', 'states', 'limited'), [('publish', 10, 4), ('silent', 6, 0)])
def test_info_counts_states_beyond_joint_limits(
    tmp_path: Path, tell: Any, beyond: str, states: int, limited: int
) -> None:
    """Where nothing is published there, there are no such states to count."""
    run = Recorded(
        tmp_path / 'bag',
        scene_file(
            tmp_path,
            f'beyond_limits: {beyond}\n',
            'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1, input: {limits: [0, 0.55]}}\n',
        ),
        lambda number: {'crank_joint': (0.1 * number, 1.0)},
    )
    (linkage,) = tell(run.run(10))['scene']['linkages']
    assert (linkage['states'], linkage['limited']) == (states, limited)


@pytest.mark.parametrize('linkage', ['ankle_motors', 'four_bar'])
def test_info_computes_no_rates_of_states(tmp_path, tell, monkeypatch, linkage):
    # Only the pose says how well a loop closed: rates, in space, would take most of the time.
    scene = tmp_path / 'scene.yaml'
    scene.write_text(
        f'linkage: {linkage}\nrate: 100\ndrive: {{sine: {{amplitude: 0.3, frequency: 1}}}}\n'
        'effects: {velocity: {}}\n'
    )
    loaded = load_scene(scene)
    simulate_run(loaded, tmp_path / 'bag', 100, lambda _: True)
    worst = read_worst(loaded)

    def refuse(*_: object) -> None:
        raise AssertionError('rates were asked for')

    monkeypatch.setattr(LinkagePipeline, 'solve_mechanism', refuse)
    (told,) = tell(tmp_path / 'bag')['scene']['linkages']
    assert told['states'] == 100
    assert told['worst_residual']['residual_m'] == worst[0]
    assert told['nearest_to_toggle']['conditioning'] == worst[1]


def read_worst(scene: Scene) -> tuple[float, float]:
    """Return the worst residual and conditioning of the sine's states, one by one."""
    closure = scene.linkages[0].closure
    residuals, conditionings = [], []
    for index in range(100):
        angle = 0.3 * sin(2.0 * pi * (index * 0.01))
        position = closure.position(*[angle] * len(closure.linkage.inputs))
        residuals.append(closure.residual(position))
        conditionings.append(closure.singularity_margin(position).conditioning)
    return max(residuals), min(conditionings)


def test_simulated_clock_is_printed_without_a_date(tmp_path, tell):
    scene = tmp_path / 'scene.yaml'
    scene.write_text('linkage: four_bar\nrate: 10\ndrive: {constant_rate: {rate: 1}}\n')
    simulate_run(load_scene(scene), tmp_path / 'bag', 21, lambda _: True)
    told = tell(tmp_path / 'bag')
    assert told['begin'] == '1.000000000 s of a simulated clock'
    assert told['end'] == '3.000000000 s of a simulated clock'
