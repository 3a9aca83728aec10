# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A scene as an FMU: FMPy runs it, and it gives what the pipeline gives, to the last bit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache
import json
from math import inf, nan, sin
from pathlib import Path
import sys
import tempfile
from typing import Any
import zipfile

from fmpy import simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from linkage_ros import __version__
from linkage_ros.description import load_scene, Scene
from linkage_ros.errors import LinkageError
from linkage_ros.stages.drives import CrankState
from linkage_ros.tick import Pipeline
from linkage_ros.tools.models.fmu import LinkageOutputs, scene_fmu, stepped_scene
from mpmath import mp, mpf
import pytest

from .importer import Bench
from ....support.four_bar import meeting_point
from ....support.messages import joint_state, read_joint_state
from ....support.scenes import FIVE_BAR, four_bar_text, LINKAGES, scene_of

Open = Callable[[Scene], Bench]
SECOND = 10**9
"""The FMU's first tick is at 1 s of its own clock: a stamp of 0 would be none."""
CRANK = 'crank_states.crank_joint.position'
CRANK_RATE = 'crank_states.crank_joint.velocity'
ROCKER = 'joint_states.rocker_joint.position'
TORQUE = 'crank_commands.crank_joint.effort'


@cache
def _fmu(name: str) -> bytes:
    return scene_fmu(load_scene(name))


@pytest.fixture(autouse=True)
def _no_traces(monkeypatch) -> Iterator[None]:
    """Remove what the wrapper leaves in this Python: a folder on its path, and a module."""
    monkeypatch.setattr(sys, 'path', [*sys.path])
    yield
    sys.modules.pop('linkage_fmu', None)


@pytest.fixture
def bench(tmp_path) -> Iterator[Open]:
    """Return a function that loads a scene into FMPy, as an instance of its own."""
    with ExitStack() as opened:

        def load(scene: Scene) -> Bench:
            folder = Path(tempfile.mkdtemp(dir=tmp_path))
            file = folder / 'scene.fmu'
            file.write_bytes(scene_fmu(scene))
            instance = Bench(file, folder / 'extracted', [])
            opened.callback(instance.close)
            return instance

        yield load


@pytest.mark.parametrize('name', ['four_bar', 'bare', 'torque_crank', 'two_fingers', 'worn_press'])
def test_fmu_model_description_is_valid(name, tmp_path):
    file = tmp_path / 'a.fmu'
    file.write_bytes(_fmu(name))
    assert validate_fmu(str(file)) == []


def test_fmu_variables_equal_the_joints_of_the_scene(bench):
    variables = bench(load_scene('torque_crank')).variables
    shown = {(v.name, v.causality, v.unit) for v in variables.values() if v.type == 'Float64'}
    joints = ('crank_joint', 'coupler_joint', 'rocker_joint')
    assert shown == {
        ('time', 'independent', 's'),
        (TORQUE, 'input', 'N.m'),
        *((f'joint_states.{joint}.position', 'output', 'rad') for joint in joints),
        *((f'joint_states.{joint}.velocity', 'output', 'rad/s') for joint in joints),
        *((f'joint_states.{joint}.effort', 'output', 'N.m') for joint in joints),
    }
    others = {name for name, v in variables.items() if v.type != 'Float64'}
    assert others == {'seed', 'valid', 'velocity_valid', 'effort_valid', 'status', 'rejected'}


@pytest.mark.parametrize(
    ('command', 'unit', 'text'),
    [
        ('effort', 'N.m', 'effort of the input crank_joint'),
        ('current', 'A', 'current that is commanded to the motor of crank_joint'),
        ('voltage', 'V', 'voltage that is commanded to the motor of crank_joint'),
    ],
)
def test_fmu_motor_command_has_its_own_unit(command, unit, text, bench):
    scene = load_scene('torque_crank', [VOLTAGE, f'drive.torque.motor.command={command}'])
    variables = bench(scene).variables.values()
    (given,) = [v for v in variables if v.causality == 'input']
    shown = (given.name, given.unit, given.description)
    assert shown == (f'crank_commands.crank_joint.{command}', unit, text)


@pytest.mark.parametrize(
    ('keys', 'units'),
    [
        ('', []),
        ('motor: {torque_constant: 1}', []),
        ('motor_encoder: {}', ['m', 'm/s']),
        ('motor_encoder: {}, motor: {torque_constant: 1, ratio: 100}', ['rad', 'rad/s', 'N.m']),
    ],
)
def test_fmu_motor_units_follow_motor_and_ratio(keys, units, bench):
    cylinder = (LINKAGES / 'excavator_bucket.yaml').read_text('utf-8')
    scene = scene_of(f'drive: {{torque: {{start: 0.9, {keys}}}}}', cylinder)
    motor = [v for v in bench(scene).variables.values() if v.name.startswith('motor.')]
    assert [v.unit for v in motor] == units
    assert all(v.causality == 'output' for v in motor)


def test_fmu_slide_is_in_metres_with_accelerations(bench):
    scene = load_scene('slider_crank', ['effects.acceleration={}'])
    variables = bench(scene).variables.values()
    of_piston = [v for v in variables if '.piston_slide.' in v.name]
    piston = {v.name.rpartition('.')[2]: v.unit for v in of_piston}
    assert piston == {'position': 'm', 'velocity': 'm/s', 'acceleration': 'm/s2'}


TWO = ', '.join(
    f'{{name: {name}, linkage: ../linkages/{name}.yaml}}' for name in ('four_bar', 'slider_crank')
)


VOLTAGE = (
    'drive.torque.motor={torque_constant: 0.02, resistance: 1.5, ratio: 10, command: voltage, '
    'voltage: 12}'
)


# Scenes that move by themselves, with noise, delays and forces; from samples; by efforts; with
# faults, several linkages, and a sliding input.
@pytest.mark.sample(6)
@pytest.mark.parametrize(
    ('name', 'settings'),
    [
        ('four_bar', ()),
        ('encoder_rocker', ()),
        ('excavator_delay', ()),
        ('worn_press', ()),
        ('two_fingers', ()),
        ('bare', ()),
        ('motion', ()),
        ('bare', ('effects.dropout.probability=0.3', 'effects.bias.joints={rocker_joint: 0.1}')),
        ('bare', ('rate=300',)),
        ('bare', ('faults.gone.silence={}', 'faults.gone.at=[0.01]', 'faults.gone.seconds=0.02')),
        ('two_fingers', (f'linkages=[{TWO}]',)),
        ('excavator_delay', ('drive={topic: {}}', 'effects={}')),
        ('torque_crank', ()),
        ('torque_crank', (VOLTAGE, 'drive.torque.motor_encoder={counts: 500}')),
        ('torque_crank', ('drive.torque.motor_encoder={}',)),
    ],
)
def test_fmu_outputs_equal_the_joint_states_bit_for_bit(name, settings, bench):
    scene = load_scene(name, settings)
    pipeline = Pipeline(scene)
    instance = bench(scene)
    names = [name for name, v in instance.variables.items() if v.causality == 'input']
    sampled = [
        scene_linkage
        for scene_linkage in scene.linkages
        if scene_linkage.drive[0] in ('topic', 'torque')
    ]
    driven = [joint for scene_linkage in sampled for joint in scene_linkage.input_names]
    assert list(dict.fromkeys(name.split('.')[1] for name in names)) == driven
    newest: dict[str, float] = {}
    published = 0
    for index in range(60):
        begin, now = (
            SECOND + round(ticks * SECOND / scene.rate) for ticks in (max(index - 1, 0), index)
        )
        inputs = {name: _input(name, index) for name in names}
        if index == 0:
            outputs = instance.start(inputs)
        else:
            outputs = instance.step((index - 1) / scene.rate, 1.0 / scene.rate, inputs)
        if inputs:
            assert pipeline.offer(_message(inputs, begin), begin) is None
        if pipeline.injection is not None:
            pipeline.injection.advance(now)
        tick = pipeline.tick(now)
        message = tick.message
        valid = [value for key, value in outputs.items() if key.split('.')[-1] == 'valid']
        assert any(valid) == bool(message)
        published += bool(message)
        if message:
            read = read_joint_state(message)
            arrays = {'position': read.position, 'velocity': read.velocity, 'effort': read.effort}
            for field, values in arrays.items():
                for joint, value in zip(read.name, values, strict=len(values) > 0):
                    newest[f'joint_states.{joint}.{field}'] = float(value)
        if message and any(name.startswith('motor.') for name in outputs):
            of_motor = read_joint_state(tick.extras[0])
            values = (*of_motor.position, *of_motor.velocity, *of_motor.effort)
            shown = {name: v for name, v in outputs.items() if name.startswith('motor.')}
            assert tuple(shown.values()) == tuple(map(float, values))
            assert all(name.startswith('motor.crank_joint_motor.') for name in shown)
        assert newest.items() <= outputs.items()
    assert published
    assert newest


def _input(name: str, number: int) -> float:
    """Return the value of an input at a step: to and fro, by another angle for each joint."""
    to_and_fro = 1.0 + 0.1 * sin(0.1 * number + len(name))
    quantity = name.rpartition('.')[2]
    by_quantity = {'position': to_and_fro, 'velocity': 3.0 - 0.1 * number, 'voltage': to_and_fro}
    return by_quantity.get(quantity, 0.01 * to_and_fro)


def _message(inputs: dict[str, float], now: int) -> bytes:
    """Return one message with the inputs of all linkages, as a sender in ROS writes it."""
    arrays: dict[str, list[float]] = {'position': [], 'velocity': [], 'effort': []}
    for name, value in inputs.items():
        quantity = name.rpartition('.')[2]
        arrays[quantity if quantity in arrays else 'effort'].append(value)
    joints = dict.fromkeys(name.split('.')[1] for name in inputs)
    return joint_state(joints, *arrays.values(), stamp=divmod(now, SECOND))


def test_non_finite_reading_does_not_reach_fmu_outputs():
    (line,) = Pipeline(load_scene('four_bar')).linkages
    look = line.interpret_from(SECOND, CrankState((1.0,), (2.0,), (0.0,), 0))
    outputs = LinkageOutputs(line)
    outputs.set_state(look)
    good = {field: [*values] for field, values in outputs.values.items()}
    assert outputs.valid == {'position': True, 'velocity': True}
    look.reading = look.reading._replace(rates=(nan, 1.0, inf))
    outputs.set_state(look)
    assert outputs.valid == {'position': True, 'velocity': False}
    assert outputs.values == good


def test_fmu_accelerations_equal_those_of_the_pipeline(bench):
    scene = load_scene('four_bar', ['effects.acceleration={}'])
    pipeline = Pipeline(scene)
    outputs = bench(scene).start()
    (look,) = pipeline.tick(SECOND).states
    shown = [value for name, value in outputs.items() if name.endswith('.acceleration')]
    assert tuple(shown) == look.reading.accelerations
    assert any(shown)


def test_fmu_in_fmpy_moves_as_the_closed_form(tmp_path):
    # FMPy's own loop; the rocker by circles that meet, at 30 digits.
    file = tmp_path / 'four_bar.fmu'
    file.write_bytes(_fmu('bare'))
    result = simulate_fmu(str(file), stop_time=0.05, start_values={CRANK: 0.7, CRANK_RATE: 2.0})
    assert len(result) == 51
    with mp.workdps(30):
        a, b, c, d = map(mpf, ('0.04', '0.12', '0.08', '0.1'))
        for row in result:
            # Each step sends the angle again, which its rate carries to the end of the step.
            seconds = mpf('0.001') if row['time'] else mpf(0)
            crank = a * mp.expj(mpf(0.7) + 2 * seconds)
            rocker = mp.arg(meeting_point(crank, d, b, c) - d)
            assert abs(rocker - mpf(float(row[ROCKER]))) < 1e-12


def test_fmu_reset_repeats_and_another_seed_changes_the_noise(bench):
    instance = bench(load_scene('encoder_rocker'))

    def run(seed: int | None) -> list[dict[str, Any]]:
        first = instance.start(seed=seed)
        return [first, *(instance.step(n / 1000, 0.001) for n in range(5))]

    once = run(None)
    instance.reset()
    assert run(None) == once
    instance.reset()
    other = run(8)
    assert other != once
    assert other == [_at(outputs) for outputs in _ticked(8, 6)]


def _ticked(seed: int, count: int) -> list[Any]:
    scene = load_scene('encoder_rocker', [f'seed={seed}'])
    pipeline = Pipeline(scene)
    return [pipeline.tick(SECOND + n * 10**6) for n in range(count)]


def _at(tick: Any) -> dict[str, Any]:
    read = read_joint_state(tick.message)
    fields = (('position', read.position), ('velocity', read.velocity))
    return {
        **{
            f'joint_states.{j}.{f}': v
            for f, of in fields
            for j, v in zip(read.name, of, strict=True)
        },
        'valid': True,
        'velocity_valid': True,
        'status': 1,
    }


def test_two_fmu_instances_are_independent(bench):
    alone, one, other = (bench(load_scene('torque_crank')) for _ in range(3))
    for instance in (alone, one, other):
        instance.start({TORQUE: 0.0})
    for index in range(20):
        time = index / 1000
        expected = alone.step(time, 0.001, {TORQUE: 0.05})
        assert one.step(time, 0.001, {TORQUE: 0.05}) == expected
        assert other.step(time, 0.001, {TORQUE: -0.05}) != expected


OPENING = four_bar_text(0.1, 0.05, 0.06, 0.08)
"""A crank that is longer than the others allow: it opens beyond 0.8 rad."""


def test_open_loop_keeps_last_fmu_outputs_as_invalid(bench):
    instance = bench(scene_of('effects: {velocity: {}}', OPENING))
    good = instance.start({CRANK: 0.4, CRANK_RATE: 0.0})
    assert (good['valid'], good['velocity_valid'], good['status']) == (True, True, 1)
    opened = instance.step(0.0, 0.001, {CRANK: 2.5})
    assert opened == {**good, 'valid': False, 'velocity_valid': False, 'status': 5}
    again = instance.step(0.001, 0.001, {CRANK: 0.4})
    assert again == good


def test_fmu_without_a_sample_has_no_crank(bench):
    instance = bench(scene_of('drive: {topic: {}}'))
    outputs = instance.start({CRANK: nan})
    assert (outputs['valid'], outputs['status'], outputs['rejected']) == (False, 0, 1)
    assert outputs[ROCKER] == 0.0


def test_fmu_counts_rejected_samples_and_logs_once(bench):
    instance = bench(scene_of('drive: {topic: {carry_forward: false}}'))
    good = instance.start({CRANK: 1.0})
    for index in range(3):
        outputs = instance.step(index / 1000, 0.001, {CRANK: nan})
    assert outputs == {**good, 'rejected': 3}
    assert len(instance.logged) == 1
    assert 'rejected' in instance.logged[0][1]


def test_fmu_step_of_several_periods_makes_several_ticks(bench):
    one, other = bench(load_scene('encoder_rocker')), bench(load_scene('encoder_rocker'))
    # Any start time: the scene's own clock begins there.
    one.start(at=3.0)
    other.start(at=3.0)
    for index in range(6):
        expected = one.step(3.0 + index / 1000, 0.001)
    other.step(3.0, 0.004)
    assert other.step(3.004, 0.002) == expected


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ('time', 'seconds'),
    [(0.001, 0.0015), (0.001, 0.0004), (0.001, nan), (0.001, 1e9), (0.002, 0.001), (0.0, 0.001)],
)
def test_impossible_fmu_step_is_discarded_without_effect(time, seconds, bench):
    instance, other = bench(load_scene('encoder_rocker')), bench(load_scene('encoder_rocker'))
    for each in (instance, other):
        each.start()
        each.step(0.0, 0.001)
    with pytest.raises(FMICallException, match='discard'):
        instance.step(time, seconds)
    ((status, text),) = instance.logged
    assert status == 2
    assert text.startswith('a step')
    assert instance.step(0.001, 0.001) == other.step(0.001, 0.001)


def test_fmu_takes_both_inputs_of_a_five_bar(bench):
    instance = bench(scene_of('rate: 100', FIVE_BAR))
    names = {name for name, v in instance.variables.items() if v.causality == 'input'}
    assert names == {
        f'crank_states.{joint}.{field}'
        for joint in ('left_crank', 'right_crank')
        for field in ('position', 'velocity')
    }
    instance.start({'crank_states.left_crank.position': 2.0})
    inputs = {'crank_states.right_crank.position': 1.0, 'crank_states.right_crank.velocity': 0.5}
    outputs = instance.step(0.0, 0.01, inputs)
    pipeline = Pipeline(scene_of('rate: 100', FIVE_BAR))
    message = joint_state(['left_crank', 'right_crank'], [2.0, 1.0], [0.0, 0.5], stamp=(1, 0))
    assert pipeline.offer(message, SECOND) is None
    read = read_joint_state(pipeline.tick(SECOND + 10**7).message)
    for joint, value in zip(read.name, read.position, strict=True):
        assert outputs[f'joint_states.{joint}.position'] == value


def test_repeated_fmu_has_the_same_bytes_and_no_paths(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path / 'temporary'))
    (tmp_path / 'temporary').mkdir()
    file = tmp_path / 'my press 2.yaml'
    linkage = tmp_path / 'a linkage.yaml'
    linkage.write_text('four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}  # mine\n', 'utf-8')
    file.write_text('linkage: a linkage.yaml\nseed: 4\n', 'utf-8')
    made = scene_fmu(load_scene(file))
    assert scene_fmu(load_scene(file)) == made
    assert not list((tmp_path / 'temporary').iterdir())
    fmu = tmp_path / 'an fmu.fmu'
    fmu.write_bytes(made)
    assert validate_fmu(str(fmu)) == []
    with zipfile.ZipFile(fmu) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
    assert parts['resources/linkage.yaml'] == linkage.read_bytes()
    assert parts['resources/scene.yaml'] == file.read_bytes()
    assert 'binaries/x86_64-linux/my_press_2.so' in parts
    assert not any(str(tmp_path).encode() in data for data in parts.values())


@pytest.mark.parametrize(
    ('scene', 'where', 'reason'),
    [
        ('rate: 0', 'rate', 'once|one tick'),
        ('drive: {bag: {file: a_bag}}', 'drive.bag', 'travel'),
        ('faults: {clock: {time_jump: {by: 0.5}, at: [1], seconds: 1}}', 'faults.clock', 'clock'),
        ('effects: {own.effect: {}}', 'effects.own.effect', 'module'),
        ('loads: {wrenches: {coupler: {}}}', 'loads.wrenches', 'come on topics'),
    ],
)
def test_fmu_refuses_a_scene_with_further_files(scene, where, reason):
    with pytest.raises(LinkageError, match=rf'{where}: .*({reason})'):
        scene_fmu(scene_of(scene))


def test_fmu_refuses_a_drive_with_an_unknown_message(monkeypatch):
    monkeypatch.delitem(stepped_scene._INPUT_FIELDS, 'torque')
    with pytest.raises(LinkageError, match=r'drive.torque: listens to crank_commands, .*name one'):
        scene_fmu(load_scene('torque_crank'))


def test_fmu_without_pythonfmu3_names_what_to_install(monkeypatch):
    monkeypatch.setattr('linkage_ros.errors.find_spec', lambda _name: None)
    with pytest.raises(LinkageError, match=r"pythonfmu3: is not .*linkage_ros\[fmu\]'$"):
        scene_fmu(load_scene('bare'))


@pytest.mark.parametrize('seed', [-1, 2**53 + 1])
def test_fmu_seed_out_of_bounds_fails_every_step(seed, bench):
    instance = bench(load_scene('encoder_rocker'))
    outputs = instance.start(seed=seed)
    assert not outputs['valid']
    ((status, text),) = instance.logged
    assert (status, text.startswith(f'seed: {seed} is out of bounds')) == (3, True)
    for _ in range(2):
        with pytest.raises(FMICallException, match='error'):
            instance.step(0.0, 0.001)


def test_fmu_without_linkage_ros_names_the_needed_version(tmp_path, monkeypatch):
    file = _opened('bare', tmp_path)
    monkeypatch.setitem(sys.modules, 'linkage_ros.tools.models.fmu.slave', None)
    logged: list[tuple[int, str]] = []
    with pytest.raises(Exception, match='instantiate'):
        Bench(file, tmp_path / 'extracted', logged)
    ((_, text),) = logged
    assert f'linkage_ros {__version__} is needed in this Python' in text


def test_fmu_of_another_version_is_refused_at_loading(tmp_path):
    file = tmp_path / 'old.fmu'
    with zipfile.ZipFile(file, 'w') as old, zipfile.ZipFile(_opened('bare', tmp_path)) as new:
        for name in new.namelist():
            data = new.read(name)
            if name == 'resources/fmu.json':
                data = json.dumps({**json.loads(data), 'version': '0.0.1'}).encode()
            old.writestr(name, data)
    logged: list[tuple[int, str]] = []
    with pytest.raises(Exception, match='instantiate'):
        Bench(file, tmp_path / 'extracted', logged)
    ((_, text),) = logged
    assert 'bare.fmu: is of linkage_ros 0.0.1, and this Python has' in text


def _opened(name: str, folder: Path) -> Path:
    file = folder / f'{name}.fmu'
    file.write_bytes(_fmu(name))
    return file
