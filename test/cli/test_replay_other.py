# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage replay --scene``: counterfactual runs, by the closed form; and into a new bag."""

from __future__ import annotations

from collections.abc import Collection, Mapping
import json
from math import sin, sqrt
from pathlib import Path
from threading import Event
from typing import Any

from linkage_ros.bag import BagMessage, BagWriter, read_bag, RUN_FILE
from linkage_ros.cli import replay
from linkage_ros.cli.main import main
from linkage_ros.description import load_scene
from linkage_ros.errors import LinkageError
from linkage_ros.messages import JointStateWriter
from linkage_ros.signals import StoppedError
from linkage_ros.tick import Pipeline
import pytest
from rosbags.highlevel import AnyReader

from .conftest import json_keys_of
from .recorded import (
    answer,
    BEGIN,
    COMMANDS,
    FOUR_BAR,
    JOINT_STATE,
    MS,
    Recorded,
    rewritten,
    scene_file,
    SECOND,
    told as messages_of,
    topic,
)
from ..support.four_bar import four_bar_angles

TICKS = 300
PLAIN = 'effects: {velocity: {}}\n'
GENERAL = (Path(__file__).parents[2] / 'config/linkages/four_bar.yaml').read_text()
SWINGING = 'four_bar: {a: 0.1, b: 0.1, c: 0.05, d: 0.12}\n'  # its crank cannot turn fully


def angle(number: int) -> float:
    return 0.3 + 0.02 * number


def crank(number: int) -> Mapping[str, tuple[float, float]]:
    """Turn the crank at 20 rad/s; samples come every other tick."""
    return {} if number % 2 else {'crank_joint': (angle(number), 20.0)}


def recorded(
    folder: Path,
    text: str = PLAIN,
    linkage: str = FOUR_BAR,
    ticks: int = TICKS,
    resets: Collection[int] = (),
) -> Path:
    own = None if 'drive: {' in text and 'topic' not in text else crank
    scene = scene_file(folder, text, linkage)
    return Recorded(folder / 'bag', scene, own, resets=resets).run(ticks)


def other(folder: Path, text: str, linkage: str = FOUR_BAR) -> Path:
    (folder / 'other_linkage.yaml').write_text(linkage)
    scene = folder / 'other.yaml'
    scene.write_text(text if 'linkages' in text else f'linkage: other_linkage.yaml\n{text}')
    return scene


def told(capsys: pytest.CaptureFixture[str], *typed: object) -> dict[str, Any]:
    capsys.readouterr()
    assert answer(replay, *typed, '--json') == 0
    return json.loads(capsys.readouterr().out)


def row(account: Mapping[str, Any], joint: str, quantity: str = 'position') -> dict[str, Any]:
    (found,) = (
        each
        for each in account['joints']
        if (each['joint'], each['quantity']) == (joint, quantity)
    )
    return found


def test_bias_in_another_scene_changes_its_joint_only(tmp_path, capsys):
    scene = other(tmp_path, 'effects: {velocity: {}, bias: {joints: {rocker_joint: 0.125}}}\n')
    account = told(capsys, recorded(tmp_path), '--scene', scene)
    assert row(account, 'rocker_joint')['rms'] == pytest.approx(0.125, rel=1e-12)
    assert row(account, 'rocker_joint')['greatest'] == pytest.approx(0.125, rel=1e-12)
    assert row(account, 'rocker_joint')['unit'] == 'rad'
    for joint, quantity in (('coupler_joint', 'position'), ('rocker_joint', 'rate')):
        found = row(account, joint, quantity)
        assert (found['rms'], found['greatest'], found['different']) == (0.0, 0.0, 0)
        assert found['compared'] == TICKS
    assert account['new_bag'] is None
    found = row(account, 'rocker_joint')
    assert set(found) | set(found['greatest_at']) == json_keys_of('replay --scene', 'joints')


def test_longer_coupler_changes_the_rocker_by_the_closed_form(tmp_path, capsys):
    longer = FOUR_BAR.replace('0.12', '0.125')
    scene = other(tmp_path, PLAIN, longer)
    account = told(capsys, recorded(tmp_path), '--scene', scene)
    apart = [
        four_bar_angles(angle(k), (0.04, 0.125, 0.08, 0.1))[1] - four_bar_angles(angle(k))[1]
        for k in range(TICKS)
    ]
    found = row(account, 'rocker_joint')
    assert found['compared'] == TICKS
    assert found['greatest'] == pytest.approx(max(map(abs, apart)), rel=1e-9)
    assert found['rms'] == pytest.approx(sqrt(sum(x * x for x in apart) / TICKS), rel=1e-9)
    number = max(range(TICKS), key=lambda k: abs(apart[k]))
    assert found['greatest_at'] == {'tick': number + 1, 'time_ns': BEGIN + number * MS}
    assert answer(replay, tmp_path / 'bag', '--scene', scene) == 0
    assert f'{found["rms"]:.3g}' in capsys.readouterr().out


NOISE = 'noise: {joints: {rocker_joint: {white: 1.0e-3, walk: 1.0e-2}}}'
LOST = 'effects: {dropout: {probability: 0.5}}\n'
FAULTS = """
effects: {velocity: {}}
faults:
  quiet: {silence: {}, at: [0.1], seconds: 0.02}
  spoilt: {not_a_number: {}, at: [0.15], seconds: 0.01}
"""
JUMP = f"""
effects: {{{NOISE}}}
drive: {{topic: {{max_lead: 10.0, max_age: 10.0}}}}
faults: {{back: {{time_jump: {{by: -0.05}}, at: [0.101], seconds: 0.05}}}}
"""

# The recorded scene and its linkage, the other scene and its linkage, number of joint states.
RUNS = {
    'the same': (PLAIN, FOUR_BAR, PLAIN, FOUR_BAR, TICKS),
    'noise': (PLAIN, FOUR_BAR, f'effects: {{{NOISE}}}\n', FOUR_BAR, TICKS),
    'motions': (PLAIN, FOUR_BAR, 'effects: {acceleration: {}}\n', FOUR_BAR, TICKS),
    'a delay': (PLAIN, FOUR_BAR, 'effects: {delay: {seconds: 0.05}}\n', FOUR_BAR, TICKS - 50),
    'readings lost': (PLAIN, FOUR_BAR, LOST, FOUR_BAR, None),
    'no longer lost': (LOST, FOUR_BAR, PLAIN, FOUR_BAR, TICKS),
    'a tenth of the rate': (PLAIN, FOUR_BAR, f'rate: 100\n{PLAIN}', FOUR_BAR, TICKS // 10),
    'twice the rate': (PLAIN, FOUR_BAR, f'rate: 2000\n{PLAIN}', FOUR_BAR, 2 * TICKS - 1),
    'for every sample': (PLAIN, FOUR_BAR, f'rate: 0\n{PLAIN}', FOUR_BAR, TICKS // 2),
    'from a tick a sample': (f'rate: 0\n{PLAIN}', FOUR_BAR, PLAIN, FOUR_BAR, None),
    'a linkage that closes': (PLAIN, SWINGING, PLAIN, FOUR_BAR, TICKS),
    'a linkage that opens': (PLAIN, FOUR_BAR, PLAIN, SWINGING, None),
    'play, and open': (
        PLAIN, FOUR_BAR, 'effects: {velocity: {}, backlash: {play: 0.3}}\n', SWINGING, None
    ),
    'faults of its own': (PLAIN, FOUR_BAR, FAULTS, FOUR_BAR, TICKS - 20),
    # At the tick that it begins with no sample comes, and time that jumps back has no crank.
    'a clock that jumps': (PLAIN, FOUR_BAR, JUMP, FOUR_BAR, TICKS - 1),
    'from what drove itself': (
        'drive: {sine: {amplitude: 1.0, frequency: 2.0}}\n', FOUR_BAR,
        'drive: {topic: {carry_forward: false}}\n', FOUR_BAR, TICKS,
    ),
}  # fmt: skip


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', RUNS)
def test_new_bag_replays_to_the_same_bytes(tmp_path, capsys, name):
    text, linkage, other_text, other_linkage, expected = RUNS[name]
    bag, scene = recorded(tmp_path, text, linkage), other(tmp_path, other_text, other_linkage)
    account = told(capsys, bag, '--scene', scene, '-o', tmp_path / 'new')
    again = told(capsys, tmp_path / 'new')
    assert again['verdict'] == 'identical'
    states = again['topics'][0]
    assert states['same'] == account['joint_states'] == account['written'][states['name']]
    if expected is None:
        assert TICKS // 20 < states['same'] <= TICKS
    else:
        assert states['same'] == expected
    counts = dict.fromkeys(account['written'], 0)
    for kind, _, _ in messages_of(tmp_path / 'new'):  # by rosbags, with the types in the bag
        counts[kind] += 1
    assert counts == account['written']


@pytest.mark.parametrize('rate', [1000, 500, 0])
def test_replay_with_another_scene_repeats_recorded_resets(tmp_path, capsys, rate):
    resets = (40, 41, 200)
    bag = recorded(tmp_path, resets=resets)
    # A reset without a sample at its tick: nothing is published until the next one comes.
    scene = other(tmp_path, f'rate: {rate}\neffects: {{{NOISE}, backlash: {{play: 0.1}}}}\n')
    account = told(capsys, bag, '--scene', scene, '-o', tmp_path / 'new')
    assert account['written']['/linkage/resets'] == len(resets)
    times = [m.log_time for m in read_bag(bag).messages() if m.topic == '/linkage/resets']
    new = read_bag(tmp_path / 'new').messages()
    assert [m.log_time for m in new if m.topic == '/linkage/resets'] == times
    again = told(capsys, tmp_path / 'new')
    assert (again['verdict'], again['ticks'] > 100) == ('identical', True)


def test_stop_ends_the_search_for_samples(tmp_path):
    bag = foreign(tmp_path, '/a', joints=('x', 'y'), count=6000)
    stop = Event()
    stop.set()
    with pytest.raises(StoppedError):
        answer(replay, bag, '--scene', other(tmp_path, ''), stop=stop)


def test_one_absurd_publish_time_adds_no_ticks(tmp_path, capsys):
    bag = recorded(tmp_path)

    def edit(_: int, message: BagMessage) -> BagMessage:
        odd = message.log_time == BEGIN + 100 * MS + MS // 4 and message.topic == '/joint_states'
        return message._replace(publish_time=1) if odd else message

    rewritten(bag, 'odd', edit)
    scene = other(tmp_path, 'effects: {bias: {joints: {rocker_joint: 0.125}}}\n')
    account = told(capsys, tmp_path / 'odd', '--scene', scene)
    assert TICKS - 2 <= account['joint_states'] <= TICKS + 2


def test_new_bag_holds_its_scene_linkage_and_run(tmp_path, capsys):
    bag = recorded(tmp_path, 'effects: {acceleration: {}}\n')
    text = 'effects: {acceleration: {}, dropout: {probability: 0.1}, pin_forces: {}}\nseed: 3\n'
    scene = other(tmp_path, text, GENERAL)
    answer(replay, bag, '--scene', scene, '-o', tmp_path / 'new')
    new = read_bag(tmp_path / 'new')
    assert new.attachments['scene.yaml'] == scene.read_bytes()
    assert new.attachments['linkage.yaml'] == GENERAL.encode()
    said = json.loads(new.attachments[RUN_FILE])
    assert said['made_from']['bag'] == '../bag'
    assert said['made_from']['run']['linkage_ros'] == '9.8.7'
    assert said['scene'] == 'other'
    assert said['begun'] == 'with the run'
    # As the bag's own run has named them, and as its node would have named the others.
    names = {each.name for each in new.topics}
    assert names == {
        '/joint_states', '/crank_states', '/linkage/withheld', '/linkage/motion',
        '/linkage/pin_forces',
    }  # fmt: skip
    samples = [m[1:] for m in read_bag(bag).messages() if m.topic == '/crank_states']
    assert [m[1:] for m in new.messages() if m.topic == '/crank_states'] == samples
    with AnyReader([tmp_path / 'new']) as reader:
        assert {each.topic for each in reader.connections} == names


def foreign(
    folder: Path,
    *topics: str,
    joints: tuple[str, ...] = ('a', 'crank_joint'),
    count: int = TICKS,
) -> Path:
    """Write a bag that nothing of ours has recorded."""
    writer = BagWriter(folder / 'foreign', [topic(name, JOINT_STATE) for name in topics])
    write = JointStateWriter(joints).write
    for index in range(count):
        stamp = BEGIN + index * 5 * MS
        for each in range(len(topics)):
            numbers = [0.1, angle(index)][: len(joints)]
            writer.write(each, stamp + MS, stamp, write(stamp, numbers, [0.0] * len(joints)))
    writer.close()
    return writer.folder


@pytest.mark.parametrize(
    ('topics', 'typed', 'used'),
    [
        (['/motor'], [], '/motor'),
        (['/joint_states'], [], '/joint_states'),
        (['/motor', '/crank_states'], [], '/crank_states'),
        (['/motor', '/gripper'], ['--crank-topic', '/gripper'], '/gripper'),
    ],
)
def test_foreign_bag_is_replayed_with_a_scene(tmp_path, capsys, topics, typed, used):
    bag = foreign(tmp_path, *topics)
    scene = other(tmp_path, f'rate: 0\n{PLAIN}')
    account = told(capsys, bag, '--scene', scene, '-o', tmp_path / 'new', *typed)
    assert account['crank_topic'] == used
    assert account['joint_states'] == TICKS
    again = told(capsys, tmp_path / 'new')
    assert (again['verdict'], again['topics'][0]['same']) == ('identical', TICKS)
    at = {
        time: message.position[1]
        for name, time, message in messages_of(tmp_path / 'new')
        if name == again['topics'][0]['name']
    }
    for number in (0, 100, 299):
        expected = four_bar_angles(angle(number))[1]
        assert at[BEGIN + (5 * number + 1) * MS] == pytest.approx(expected, abs=1e-12)


def test_foreign_bag_without_commands_is_refused_in_one_line(tmp_path, capsys):
    bag = foreign(tmp_path, '/motor', joints=('x', 'y'))
    assert main(['replay', str(bag), '--scene', 'torque_ankle']) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert 'its run took no commands, which a torque drive needs' in line


def test_foreign_bag_is_ticked_at_the_scene_rate(tmp_path, capsys):
    bag, scene = foreign(tmp_path, '/motor'), other(tmp_path, f'rate: 1000\n{PLAIN}')
    account = told(capsys, bag, '--scene', scene, '-o', tmp_path / 'new')
    # From the first sample's log time up to the last one's, both included.
    assert account['joint_states'] == (TICKS - 1) * 5 + 1
    assert told(capsys, tmp_path / 'new')['verdict'] == 'identical'


@pytest.mark.parametrize(('rate', 'each'), [(0, 100), (1000, 99 * 5 + 1)])
def test_replay_restarts_where_time_jumps_back(tmp_path, capsys, rate, each):
    writer = BagWriter(tmp_path / 'jump', [topic('/motor', JOINT_STATE)])
    write = JointStateWriter(['crank_joint']).write
    for begin in (BEGIN + 5 * SECOND, BEGIN + 2 * SECOND):
        for index in range(100):
            stamp = begin + index * 5 * MS
            writer.write(0, stamp, stamp, write(stamp, [angle(index)], [4.0]))
    writer.close()
    scene = other(tmp_path, f'rate: {rate}\neffects: {{{NOISE}}}\n')
    account = told(capsys, tmp_path / 'jump', '--scene', scene, '-o', tmp_path / 'new')
    assert account['joint_states'] == 2 * each
    again = told(capsys, tmp_path / 'new')
    assert (again['verdict'], again['ticks']) == ('identical', 2 * each)


def test_ticks_of_a_silent_run_are_its_sample_times(tmp_path, capsys):
    loaded = load_scene(scene_file(tmp_path, PLAIN, SWINGING))
    files = {name: ('', data) for name, data in loaded.files.items()}
    run = {'scene': 's', 'joint_states_topic': '/joint_states', 'crank_topic': '/crank_states'}
    files[RUN_FILE] = ('', json.dumps(run).encode())
    topics = [topic('/joint_states', JOINT_STATE), topic('/crank_states', JOINT_STATE)]
    writer = BagWriter(tmp_path / 'open', topics, files)
    write = JointStateWriter(['crank_joint']).write
    times = [BEGIN + index * MS + index * index * 37_000 % 300_000 for index in range(100)]
    for time in times:  # the pins of SWINGING are too far apart here
        writer.write(1, time, time, write(time, [3.0], [0.0]))
    writer.close()
    scene = other(tmp_path, PLAIN)
    account = told(capsys, tmp_path / 'open', '--scene', scene, '-o', tmp_path / 'new')
    assert account['joint_states'] == 100
    made = read_bag(tmp_path / 'new').messages()
    assert [m.publish_time for m in made if m.topic == '/joint_states'] == times


def test_replay_skips_a_silence_of_six_days(tmp_path, capsys):
    writer = BagWriter(tmp_path / 'gap', [topic('/motor', JOINT_STATE)])
    write = JointStateWriter(['crank_joint']).write
    for stamp in (BEGIN, BEGIN + 500_000 * SECOND):  # six days
        writer.write(0, stamp, stamp, write(stamp, [1.0], [0.0]))
    writer.close()
    scene = other(tmp_path, f'{PLAIN}drive: {{topic: {{max_age: 0.2}}}}\n')
    account = told(capsys, tmp_path / 'gap', '--scene', scene)
    assert account['joint_states'] == 201 + 1


BAD = {
    'other joints': (
        PLAIN, '', GENERAL.replace('coupler_joint', 'rod').replace('rocker_joint', 'swing'),
        'publishes rod, swing, and ',
    ),
    'other inputs': (
        PLAIN, 'linkages: [{name: left, linkage: other_linkage.yaml}]\n', FOUR_BAR,
        'holds no samples of left_crank_joint on /crank_states, which has crank_joint',
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', BAD)
def test_scene_contradicting_the_bag_is_refused_in_one_line(tmp_path, name):
    text, other_text, linkage, line = BAD[name]
    scene = other(tmp_path, other_text, linkage)
    with pytest.raises(LinkageError) as raised:
        answer(replay, recorded(tmp_path, text), '--scene', scene)
    assert line in str(raised.value)
    assert '\n' not in str(raised.value)


@pytest.mark.parametrize(
    ('topics', 'joints', 'typed', 'line'),
    [
        (['/a', '/b'], ('x', 'crank_joint'), [], 'on /a and /b; name one with --crank-topic'),
        (['/a'], ('x', 'y'), [], 'holds no samples of crank_joint on /a, which has x, y'),
        (['/a'], ('x', 'y'), ['--crank-topic', '/b'], 'holds no topic /b of sensor_msgs'),
        ([], ('x',), [], 'holds no samples of crank_joint; it has no topic of sensor_msgs'),
    ],
)
def test_foreign_bag_without_the_crank_is_refused(tmp_path, topics, joints, typed, line):
    bag = foreign(tmp_path, *topics, joints=joints)
    with pytest.raises(LinkageError) as raised:
        answer(replay, bag, '--scene', other(tmp_path, ''), *typed)
    assert line in str(raised.value)


def test_replay_leaves_an_existing_folder_untouched(tmp_path):
    bag, scene = recorded(tmp_path), other(tmp_path, PLAIN)
    (tmp_path / 'new').mkdir()
    with pytest.raises(LinkageError, match='exists already'):
        answer(replay, bag, '--scene', scene, '-o', tmp_path / 'new')
    assert list((tmp_path / 'new').iterdir()) == []


# A scene under torque takes the commands of the bag.


UNDER_TORQUE = """
rate: 500
drive: {torque: {start: 0.5, method: rk4, step: 0.002, timeout: 0.1, on_timeout: zero}}
loads: {gravity: [0, -9.81]}
effects: {velocity: {}, effort: {}%s}
"""

FRICTION = ', friction: {joints: {O2: {viscous: 0.01}}}'


def commanded(folder: Path, text: str = UNDER_TORQUE % '') -> Path:
    """Record a run under torque: efforts at every third tick, then none."""

    def efforts(number: int) -> Mapping[str, float]:
        return {'crank_joint': 0.3 * sin(0.05 * number)} if number % 3 == 0 else {'other': 1.0}

    scene = scene_file(folder, text, GENERAL)
    return Recorded(folder / 'bag', scene, efforts, COMMANDS).run(TICKS)


def test_recorded_commands_and_same_scene_give_same_bytes(tmp_path, capsys):
    bag = commanded(tmp_path)
    scene = other(tmp_path, UNDER_TORQUE % '', GENERAL)
    account = told(capsys, bag, '--scene', scene, '-o', tmp_path / 'new')
    assert account['crank_topic'] == COMMANDS
    for each in account['topics']:
        assert (each['recorded'], each['same']) == (TICKS, TICKS)
    assert list(read_bag(tmp_path / 'new').messages())
    assert answer(replay, tmp_path / 'new') == 0


def test_recorded_commands_with_other_friction_equal_its_own_pipeline(tmp_path, capsys):
    bag = commanded(tmp_path)
    scene = other(tmp_path, UNDER_TORQUE % FRICTION, GENERAL)
    account = told(capsys, bag, '--scene', scene, '-o', tmp_path / 'new')
    assert row(account, 'rocker_joint')['greatest'] > 0.01
    pipeline, made = Pipeline(load_scene(scene)), []
    for name, log_time, time, data in read_bag(bag).messages():
        if name == COMMANDS:
            pipeline.offer(data, log_time)
        elif name == '/joint_states':
            made.append(pipeline.tick(time).message)
    new = read_bag(tmp_path / 'new')
    assert [each.data for each in new.messages() if each.topic == '/joint_states'] == made
    assert answer(replay, tmp_path / 'new') == 0


def test_replay_at_half_rate_gives_the_same_motion(tmp_path, capsys):
    bag = commanded(tmp_path)
    scene = other(tmp_path, (UNDER_TORQUE % '').replace('rate: 500', 'rate: 250'), GENERAL)
    account = told(capsys, bag, '--scene', scene)
    found = row(account, 'rocker_joint')
    assert found['compared'] == TICKS // 2
    assert found['greatest'] == 0.0


WRONG_KINDS = {
    'crank angles are no commands': (False, UNDER_TORQUE % '', 'its run took no commands'),
    'a drive of its own takes nothing': (
        True, 'rate: 500\ndrive: {constant_rate: {rate: 1.0}}\n', 'its drive is constant_rate'
    ),
}  # fmt: skip


@pytest.mark.parametrize('case', WRONG_KINDS)
def test_replay_refuses_samples_of_another_kind(tmp_path, case):
    is_commanded, text, reason = WRONG_KINDS[case]
    bag = commanded(tmp_path) if is_commanded else recorded(tmp_path, linkage=GENERAL)
    scene = other(tmp_path, text, GENERAL)
    with pytest.raises(LinkageError, match=reason):
        answer(replay, bag, '--scene', scene)
