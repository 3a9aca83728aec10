# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage replay``: the same bytes again, and how two runs are compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import repeat
import json
from math import inf, nan, nextafter, sqrt, tau, ulp
from pathlib import Path
import shutil
from struct import pack, unpack
from threading import Event
from types import SimpleNamespace
from typing import Any

from hypothesis import assume, example, given, strategies as st
from linkage_ros.bag import BagMessage, BagWriter, read_bag, RUN_FILE
from linkage_ros.cli import replay
from linkage_ros.description import load_scene
from linkage_ros.errors import LinkageError
from linkage_ros.messages import JointStateWriter
from linkage_ros.node import RunRecording
from linkage_ros.replay import (
    Comparison,
    TickPlace,
    ulp_distance,
    versions_here,
)
import pytest

from .conftest import json_keys, json_keys_of
from .recorded import (
    answer,
    BEGIN,
    Edit,
    JOINT_STATE,
    MS,
    Recorded,
    rewritten,
    scene_file,
    topic,
)
from ..support.messages import read_joint_state

# ``linkage replay``: a run gives the same bytes again, or the report shows where it differs.


TICKS = 300

LINKAGE = (Path(__file__).parents[2] / 'config/linkages/four_bar.yaml').read_text()

TWO = 'linkages: [{name: a, linkage: l.yaml}, {name: b, linkage: l.yaml}]\n'

NOISE = 'noise: {joints: {rocker_joint: {white: 1.0e-3, walk: 1.0e-2}}}'

SCENES = {
    'positions': '',
    'rates': 'effects: {velocity: {}}\n',
    'wrapped': 'angles: wrapped\n',
    'motions and forces': 'effects: {acceleration: {}, effort: {}, pin_forces: {}}\n'
    'loads: {gravity: [0, -9.81]}\n',
    'markers': 'effects: {markers: {rate: 90}, pin_forces: {}}\n',
    'readings withheld': f'effects: {{{NOISE}, dropout: {{probability: 0.3}}}}\n',
    'late readings': 'effects: {velocity: {}, delay: {seconds: 0.05}}\n',
    'two that withhold': f'{TWO}drive: {{sine: {{amplitude: 1.0, frequency: 2.0}}}}\n'
    'effects: {dropout: {probability: 0.5}}\n',
    'reset': f'effects: {{{NOISE}}}\n',
    'driven by itself': 'drive: {sine: {amplitude: 1.0, frequency: 2.0}}\n',
}


def turning(number: int) -> Mapping[str, tuple[float, float]]:
    """Turn the crank at 20 rad/s; samples come every third tick."""
    return {} if number % 3 else {'crank_joint': (0.02 * number, 20.0)}


RESETS = {'reset': (20, 21, 150)}


def recorded(folder: Path, text: str, ticks: int = TICKS, **options: Any) -> Path:
    scene = scene_file(folder, text, LINKAGE)
    crank = None if 'drive: {sine' in text else turning
    return Recorded(folder / 'bag', scene, crank, **options).run(ticks)


def told(capsys: pytest.CaptureFixture[str], *typed: object) -> tuple[int, dict[str, Any]]:
    """Return exit code and account of ``linkage replay --json``."""
    capsys.readouterr()
    code = answer(replay, *typed, '--json')
    return code, json.loads(capsys.readouterr().out)


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', SCENES)
def test_recorded_run_replays_to_the_same_bytes(tmp_path, capsys, name):
    bag = recorded(tmp_path, SCENES[name], resets=RESETS.get(name, ()))
    code, account = told(capsys, bag)
    assert (code, account['verdict']) == (0, 'identical')
    in_bag = [message.topic for message in read_bag(bag).messages()]
    for each in account['topics']:
        assert each['same'] == each['recorded'] == in_bag.count(each['name'])
    assert account['topics'][0]['recorded'] > 50
    times = {m.publish_time for m in read_bag(bag).messages() if m.topic == '/linkage/withheld'}
    assert account['withheld_ticks'] == len(times)
    assert account['greatest'] == []
    assert account['first_difference'] is None
    assert answer(replay, bag) == 0
    assert 'identical' in capsys.readouterr().out


def test_replay_compares_messages_without_an_open_linkage(tmp_path, capsys):
    def cranks(number: int) -> Mapping[str, tuple[float, float]]:
        first = {'a_crank_joint': (0.01 * number, 10.0)}
        return first | ({'b_crank_joint': (0.02 * number, 20.0)} if number > 40 else {})

    scene = scene_file(tmp_path, f'{TWO}effects: {{velocity: {{}}}}\n', LINKAGE)
    bag = Recorded(tmp_path / 'bag', scene, cranks, '/joint_states').run(80)
    code, account = told(capsys, bag)
    assert (code, account['verdict']) == (0, 'identical')
    (states,) = account['topics']
    assert states['same'] == states['recorded'] == 80


def test_tick_withheld_by_two_linkages_is_counted_once(tmp_path, capsys):
    bag = recorded(tmp_path, SCENES['two that withhold'])
    code, account = told(capsys, bag)
    assert (code, account['verdict']) == (0, 'identical')
    assert account['withheld_ticks'] == sum(
        message.topic == '/linkage/withheld' for message in read_bag(bag).messages()
    )
    assert account['withheld_ticks'] > 30


def spoil(data: bytes, place: int, bits: int) -> tuple[bytes, float, float]:
    """Return a message with bits of a position flipped; and the position, before and after."""
    value = float(read_joint_state(data).position[place])
    (raw,) = unpack('<q', pack('<d', value))
    (other,) = unpack('<d', pack('<q', raw ^ bits))
    assert data.count(pack('<d', value)) == 1
    return data.replace(pack('<d', value), pack('<d', other)), value, other


def test_replay_names_one_changed_bit_of_a_position(tmp_path, capsys):
    bag = recorded(tmp_path, SCENES['rates'])
    found = {}

    def edit(_: int, message: BagMessage) -> BagMessage:
        if message.topic != '/joint_states' or message.publish_time != BEGIN + 122 * MS:
            return message
        data, found['before'], found['after'] = spoil(message.data, 1, 1)
        return message._replace(data=data)

    code, account = told(capsys, rewritten(bag, 'spoilt', edit))
    assert (code, account['verdict']) == (3, 'different')
    assert account['different_ticks'] == 1
    assert account['topics'][0]['different'] == 1
    assert account['topics'][0]['same'] == TICKS - 1
    apart = abs(found['after'] - found['before'])
    where = {'tick': 123, 'time_ns': BEGIN + 122 * MS}
    assert account['first_difference'] == where | {
        'topic': '/joint_states',
        'what': 'position',
        'joint': 'rocker_joint',
        'unit': 'rad',
        'recorded': found['after'],
        'now': found['before'],
        'difference': apart,
        'ulp': 1,
    }
    (row,) = account['greatest']
    at = where | {'joint': 'rocker_joint'}
    assert row == {
        'quantity': 'position', 'unit': 'rad', 'difference': apart, 'difference_at': at,
        'ulp': 1, 'ulp_at': at,
    }  # fmt: skip
    assert answer(replay, tmp_path / 'spoilt') == 3
    text = capsys.readouterr().out
    assert f'{found["after"]!r} recorded, {found["before"]!r} now' in text
    assert 'tick 123, at +0.122000 s' in text
    assert 'linkage_ros 9.8.7, Python 3.99.1, on abacus' in text
    assert f'replayed by linkage_ros {versions_here()["linkage_ros"]}' in text


def test_replay_json_has_the_documented_keys(tmp_path, capsys):
    bag = recorded(tmp_path, SCENES['rates'])
    assert set(told(capsys, bag)[1]) == json_keys('replay')

    def edit(_: int, message: BagMessage) -> BagMessage:
        if message.topic != '/joint_states':
            return message
        return message._replace(data=spoil(message.data, 1, 1)[0])

    _, account = told(capsys, rewritten(bag, 'spoilt', edit))
    assert set(account) == json_keys('replay')
    assert set(account['topics'][0]) == json_keys_of('replay', 'topics')
    assert set(account['first_difference']) | {'null'} == json_keys_of(
        'replay', 'first_difference'
    )
    assert set(account['last_different_tick']) | {'null'} == json_keys_of(
        'replay', 'last_different_tick'
    )
    (row,) = account['greatest']
    assert set(row) | set(row['ulp_at']) == json_keys_of('replay', 'greatest')


def test_replay_counts_differences_of_a_bag_from_another_machine(tmp_path, capsys):
    bag = recorded(tmp_path, SCENES['rates'])
    apart = []

    def edit(_: int, message: BagMessage) -> BagMessage:
        if message.topic != '/joint_states':
            return message
        tick = (message.publish_time - BEGIN) // MS
        data, before, after = spoil(message.data, 0, 3 if tick == 200 else 1)
        apart.append(abs(after - before))
        return message._replace(data=data)

    code, account = told(capsys, rewritten(bag, 'other', edit, machine='sundial'))
    assert code == 3
    assert account['versions']['bag']['machine'] == 'sundial'
    assert account['versions']['here'] == versions_here()
    (row,) = account['greatest']
    assert row['difference'] == max(apart)
    assert row['ulp'] in (1, 2, 3)
    assert account['topics'][0]['different'] == TICKS
    assert (row['ulp_at']['joint'], row['unit']) == ('coupler_joint', 'rad')


def test_dropped_messages_are_no_difference(tmp_path, capsys):
    text = 'effects: {acceleration: {}}\n'
    bag = recorded(
        tmp_path, text, drop=lambda number, name: name == '/joint_states' and not number % 5
    )
    code, account = told(capsys, bag)
    assert (code, account['verdict']) == (0, 'identical')
    states, motions = account['topics']
    assert (states['recorded'], states['not_recorded']) == (240, 60)
    assert motions['recorded'] == motions['same'] == 300


def test_tick_withheld_then_and_published_now_is_a_difference(tmp_path, capsys):
    bag = recorded(tmp_path, 'effects: {dropout: {probability: 0.3}}\n')
    files = read_bag(bag).attachments

    other = files['scene.yaml'].replace(b'0.3', b'0.0')
    assert other != files['scene.yaml']
    never = rewritten(bag, 'never', attachments={**files, 'scene.yaml': other})
    code, account = told(capsys, never)
    assert code == 3
    assert account['first_difference']['what'] == 'withheld then, published now'
    withheld = [m for m in read_bag(bag).messages() if m.topic == '/linkage/withheld']
    assert account['topics'][0]['not_recorded'] == account['different_ticks'] == len(withheld)


# Bags that begin in mid-run: text of the scene, first tick in the bag, the report's word for where
# it begins, exit code, verdict, and the number of ticks that cannot be compared.
MID_RUN = {
    'a sample is soon there': ('effects: {velocity: {}}\n', 31, 'mid-run', 0, 'identical', 2),
    'at a sample': ('effects: {velocity: {}}\n', 30, 'mid-run', 0, 'identical', 0),
    'a delay that fills': (
        'effects: {velocity: {}, delay: {seconds: 0.05}}\n', 100, 'mid-run', 0, 'identical', None
    ),
    'random numbers': (f'effects: {{{NOISE}}}\n', 31, 'mid-run', 1, 'cannot be told', TICKS - 31),
    'readings lost': (
        'effects: {dropout: {probability: 0.3}}\n', 31, 'mid-run', 1, 'cannot be told', None
    ),
    'between two markers': ('effects: {markers: {}}\n', 42, 'mid-run', 0, 'identical', 0),
    'at a marker': ('effects: {markers: {rate: 25}}\n', 120, 'mid-run', 0, 'identical', 1),
    'a trace': ('effects: {markers: {trace: 0.1}}\n', 42, 'mid-run', 1, 'cannot be told', 0),
    'the bag does not say': ('effects: {velocity: {}}\n', 31, '', 3, 'different', 0),
    'with the run': ('effects: {velocity: {}}\n', 31, 'with the run', 3, 'different', 0),
}  # fmt: skip


def from_tick(number: int) -> Edit:
    return lambda _, message: message if message.log_time >= BEGIN + number * MS else None


@pytest.mark.sample(4)
@pytest.mark.parametrize('name', MID_RUN)
def test_replay_judges_a_bag_recorded_from_mid_run(tmp_path, capsys, name):
    text, first, begun, code, verdict, untold = MID_RUN[name]
    said = {'begun': begun} if begun else {}
    bag = rewritten(recorded(tmp_path, text), 'part', from_tick(first), **said)
    found, account = told(capsys, bag)
    assert (found, account['verdict']) == (code, verdict)
    if untold is not None:
        assert account['untold_ticks'] == untold
    elif 'delay' in text:
        # 50 ms of readings at 1 kHz, and up to two ticks without a sample.
        assert 50 <= account['untold_ticks'] <= 53
    assert bool(account['beginning_missing']) == (begun == 'mid-run')
    states = account['topics'][0]
    assert account['compared_ticks'] + account['untold_ticks'] == account['ticks']
    if verdict == 'identical':
        assert states['same'] + states['same_but_for_turns'] == states['recorded'] > 100
    answer(replay, bag)
    assert ('are undecided' in capsys.readouterr().out) == (begun == 'mid-run')


def test_whole_turns_before_the_bag_are_no_difference(tmp_path, capsys):
    # At 20 rad/s the coupler's angle against the crank's runs back a turn every 314 ticks.
    bag = recorded(tmp_path, 'effects: {acceleration: {}}\n', 2000)
    part = rewritten(bag, 'part', from_tick(690), begun='mid-run')
    code, account = told(capsys, part)
    assert (code, account['verdict']) == (0, 'identical')
    states, motions = account['topics']
    assert states['same_but_for_turns'] == states['recorded'] == 1310
    assert motions['same_but_for_turns'] == motions['recorded'] == 1310
    assert answer(replay, rewritten(bag, 'whole', from_tick(690), begun='with the run')) == 3


def test_replay_finds_a_changed_bit_in_mid_run_bags(tmp_path, capsys):
    bag = recorded(tmp_path, 'effects: {velocity: {}}\n')

    def edit(number: int, message: BagMessage) -> BagMessage | None:
        if message.topic == '/joint_states' and message.publish_time == BEGIN + 200 * MS:
            return message._replace(data=spoil(message.data, 1, 1)[0])
        return from_tick(31)(number, message)

    code, account = told(capsys, rewritten(bag, 'part', edit, begun='mid-run'))
    assert (code, account['verdict'], account['untold_ticks']) == (3, 'different', 2)
    assert account['first_difference']['ulp'] == 1
    assert account['first_difference']['time_ns'] == BEGIN + 200 * MS


@pytest.mark.parametrize(('running', 'said'), [(True, 'mid-run'), (False, 'with the run')])
def test_run_json_records_whether_recording_began_in_mid_run(tmp_path, running, said):
    logger = SimpleNamespace(info=lambda _: None, error=lambda _: None)
    pipeline = SimpleNamespace(linkages=[])
    loop = SimpleNamespace(is_running=running, recorder=None, pipeline=pipeline)
    recording = RunRecording(logger)
    scene = load_scene(scene_file(tmp_path, ''))
    states = topic('/joint_states', JOINT_STATE)
    recording.start(scene, loop, str(tmp_path), lambda: [('joint_states_topic', states)])
    folder = loop.recorder.folder
    recording.stop(loop)
    assert json.loads(read_bag(folder).attachments[RUN_FILE])['begun'] == said


@pytest.fixture(scope='module')
def long_bag(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp('long'), SCENES['rates'], 6000)


def test_truncated_bag_is_replayed_up_to_its_end(tmp_path, capsys, long_bag):
    whole = (long_bag / 'bag_0.mcap').read_bytes()
    part = tmp_path / 'part.mcap'
    part.write_bytes(whole[: len(whole) * 2 // 3])
    assert answer(replay, part, '--json') == 0
    out, err = capsys.readouterr()
    account = json.loads(out)
    assert account['truncated']
    assert account['verdict'] == 'identical'
    assert 1000 < account['topics'][0]['same'] < 6000
    assert err == (
        f'linkage replay: {part}: unfinished: its recording was killed, or still runs, or goes on '
        'in another file; its content was replayed\n'
    )


@pytest.mark.sample(1)
@pytest.mark.parametrize('part', [0.09, 0.3, 0.66, 0.98])
@pytest.mark.parametrize('more', [[], ['--set', 'angles=wrapped']])
def test_replay_counts_messages_missing_against_the_metadata(
    tmp_path, capsys, long_bag, part, more
):
    bag = Path(shutil.copytree(long_bag, tmp_path / 'bag'))
    file = bag / 'bag_0.mcap'
    whole = list(read_bag(bag).messages())
    file.write_bytes(file.read_bytes()[: int(file.stat().st_size * part)])
    there = list(read_bag(bag, allow_truncated=True).messages())
    assert answer(replay, bag, *more, '--json') == 3
    out, err = capsys.readouterr()
    assert json.loads(out)['missing'] == len(whole) - len(there) > 0
    assert f'{len(whole) - len(there):,} messages that its metadata.yaml promises are not' in err


def test_damaged_bag_is_replayed_up_to_the_damage(tmp_path, capsys, long_bag):
    bag = Path(shutil.copytree(long_bag, tmp_path / 'bag'))
    file = bag / 'bag_0.mcap'
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    assert answer(replay, bag, '--json') == 1
    out, err = capsys.readouterr()
    account = json.loads(out)
    assert account['verdict'] == 'identical'
    assert 'is damaged' in account['damage']
    assert 0 < account['topics'][0]['same'] < 6000
    assert 'the part before it was replayed' in err


def test_stop_ends_the_replay_with_code_1(tmp_path, capsys):
    bag = recorded(tmp_path, '', 3000)
    stop = Event()
    stop.set()
    assert answer(replay, bag, stop=stop) == 1
    out, err = capsys.readouterr()
    assert 'identical' in out
    assert err == 'linkage replay: stopped; the rest of the bag was not replayed\n'


def test_replay_names_the_files_that_a_bag_lacks(tmp_path):
    with BagWriterOf(tmp_path / 'foreign') as write:
        write(0)
    with pytest.raises(LinkageError) as raised:
        answer(replay, tmp_path / 'foreign')
    assert str(raised.value) == (
        f'{tmp_path}/foreign: carries no run.json, scene.yaml; name a scene to run with --scene'
    )


def test_replay_refuses_a_bag_without_joint_states(tmp_path):
    bag = rewritten(
        recorded(tmp_path, ''), 'silent', lambda _, m: m if m.topic == '/crank_states' else None
    )
    with pytest.raises(LinkageError, match='holds no joint states'):
        answer(replay, bag)


class BagWriterOf:
    """A bag with a topic of joint states and nothing that says what it is."""

    def __init__(self, folder: Path) -> None:
        self._writer = BagWriter(folder, [topic('/joints', JOINT_STATE)])

    def __enter__(self) -> Callable[[int], bool]:
        return lambda number: self._writer.write(0, BEGIN + number, BEGIN, b'\0\1\0\0')

    def __exit__(self, *_: object) -> None:
        self._writer.close()


# The comparison of two runs: message by message, and to the last digit.


NAMES = ['crank', 'slide']

WRITE = JointStateWriter(NAMES).write

AT = TickPlace(7, 70)

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


def compared(recorded: bytes, now: bytes, turning: tuple[str, ...] = ()) -> Comparison:
    found = Comparison([('/s', JOINT_STATE)], dict.fromkeys(turning, True))
    found.add_tick(AT, [recorded], [now])
    found.update_deviations()
    return found


@given(NUMBERS, st.integers(0, 50), st.sampled_from([-inf, inf]))
@example(0.0, 3, inf)
@example(-5e-324, 2, inf)
@example(1.0, 3, -inf)
@example(2.0**-1022, 5, -inf)
def test_ulp_distance_counts_steps_between_two_doubles(value, steps, towards):
    other = value
    for _ in repeat(None, steps):
        other = nextafter(other, towards)
    assume(abs(other) != inf)
    assert ulp_distance(value, other) == ulp_distance(other, value) == steps


def test_ulp_distance_of_the_two_zeros_is_0():
    assert ulp_distance(-0.0, 0.0) == 0


@given(st.floats(-3.141, 3.141), st.integers(-10_000, 10_000), st.integers(-10_000, 10_000))
@example(0.1, -3, 5)
def test_comparison_ignores_whole_turns_of_a_crank(angle, then, now):
    recorded = WRITE(1, [angle + then * tau, 0.5], [1.0, 2.0])
    again = WRITE(1, [angle + now * tau, 0.5], [1.0, 2.0])
    assert compared(recorded, again, ('crank',)).differing == 0
    assert compared(recorded, again).differing == (recorded != again)


@pytest.mark.parametrize(
    ('then', 'now'),
    [
        # Beyond what rounding makes of an angle and of its turns.
        (([1.0 + tau, 0.5], []), ([1.0 - 8 * ulp(1.0 + tau), 0.5], [])),
        (([1.0 + 3.0, 0.5], []), ([1.0, 0.5], [])),
        # A slide of 2π m has not turned.
        (([1.0, tau], []), ([1.0, 0.0], [])),
        # Nor has a rate.
        (([1.0, 0.5], [tau, 0.0]), ([1.0, 0.5], [0.0, 0.0])),
    ],
)
def test_comparison_counts_partial_turns_and_slides_as_differences(then, now):
    found = compared(WRITE(1, *then), WRITE(1, *now), ('crank',))
    assert found.differing == 1


DIFFERENCES = {
    # recorded, now, what is told, of which joint
    'a position': (WRITE(1, [1.0, 2.0], []), WRITE(1, [1.0, 2.5], []), 'position', 'slide'),
    'a rate': (WRITE(1, [1, 2], [3, 4]), WRITE(1, [1, 2], [5, 4]), 'rate', 'crank'),
    'an effort': (WRITE(1, [1, 2], [], [3, 4]), WRITE(1, [1, 2], [], [3, 5]), 'effort', 'slide'),
    'not a number': (WRITE(1, [1, 2], []), WRITE(1, [1, nan], []), 'position', 'slide'),
    'the sign of a zero': (WRITE(1, [0.0, 2], []), WRITE(1, [-0.0, 2], []), 'position', 'crank'),
    'a stamp': (WRITE(1, [1, 2], []), WRITE(9, [1, 2], []), 'stamp: 1 ns then, 9 ns now', ''),
    'no rates': (
        WRITE(1, [1, 2], [3, 4]), WRITE(1, [1, 2], []),
        'positions, rates then, positions now', '',
    ),
    'other joints': (
        WRITE(1, [1, 2], []), JointStateWriter(['slide', 'crank']).write(1, [2, 1], []),
        'joints: crank, slide then, slide, crank now', '',
    ),
    'none': (WRITE(1, [1, 2], []), b'', 'published then, nothing now', ''),
    'too many': (b'', WRITE(1, [1, 2], []), 'withheld then, published now', ''),
    'padding': (
        WRITE(1, [1, 2], []), WRITE(1, [1, 2], []) + b'\0',
        'bytes outside of the numbers of joints', '',
    ),
    'nonsense': (b'\0\1\0\0', WRITE(1, [1, 2], []), 'a message that cannot be read', ''),
}  # fmt: skip


@pytest.mark.parametrize('name', DIFFERENCES)
def test_comparison_names_the_first_difference(name):
    recorded, now, what, joint = DIFFERENCES[name]
    found = compared(recorded, now)
    assert (found.ticks, found.differing) == (1, 1)
    assert found.first.at == found.last == AT
    assert found.first.what.startswith(what)
    assert found.first.joint == joint


def test_deviations_cover_all_compared_messages():
    found = Comparison([('/s', JOINT_STATE)])
    positions = [(0.0, 0.0), (0.0, 3.0), (1.0, 1.0), (2.0, -2.0)]
    for number, (then, now) in enumerate(positions, 1):
        found.add_tick(
            TickPlace(number, number), [WRITE(1, [then, 1], [])], [WRITE(1, [now, 1], [])]
        )
    found.update_deviations()
    crank = found.topics[0].deviations['crank', 'position']
    assert (crank.compared, crank.differing, crank.greatest) == (4, 2, 4.0)
    assert crank.rms == sqrt((9.0 + 16.0) / 4)
    assert crank.at == TickPlace(4, 4)
    slide = found.topics[0].deviations['slide', 'position']
    assert (slide.compared, slide.differing, slide.rms) == (4, 0, 0.0)
