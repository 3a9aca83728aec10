# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage as a transmission of ros2_control, compiled against a stand-in of its headers.

The real ones, with a ResourceManager and a joint_trajectory_controller, take minutes to build;
docs/how_to/ros2_control.md says what was run with them.
"""

import errno
import os
from pathlib import Path
from random import Random
import shutil
import subprocess
from typing import NamedTuple

from linkage_ros.cli.main import main
from linkage_ros.description import load
from linkage_ros.tools.models.source_code import STATUSES
import numpy as np
import pytest

pytestmark = pytest.mark.skipif(shutil.which('c++') is None, reason='needs c++')

STAND_IN = Path(__file__).parent / 'ros2_control_stand_in'
ALL = ' position velocity effort'
NUMBERS = {name: number for number, name in enumerate(STATUSES)}


class Case(NamedTuple):
    """A transmission: its linkage, commanded joints, and how far its inputs go from where."""

    linkage: str
    commanded: tuple[str, ...]
    middle: tuple[float, ...]
    reach: float
    options: tuple[str, ...] = ()


CASES = {
    'finger': Case('gripper', ('left_finger_joint',), (0.35,), 0.3),
    'rocker': Case('four_bar', ('rocker_joint',), (1.2,), 0.5, ('--branch', '1')),
    'class III': Case('class_3', ('platform_joint',), (0.4,), 0.1, ('--branch', '1')),
    'two cranks': Case('five_bar', (), (1.05, 1.05), 0.2),
    'ankle': Case('ankle_motors', (), (0.0, 0.0), 0.4),
    'delta': Case('delta', ('x', 'y', 'z'), (0.0, 0.0, 0.0), 0.2),
    'RSSR': Case('rssr', ('rocker_joint',), (-1.2,), 0.8),
    'opening': Case('gripper', ('left_pad-right_pad',), (0.35,), 0.3),
    'height': Case('rssr', ('B.z',), (1.2,), 0.3, ('--branch', '1')),
    'one crank stays': Case('five_bar', ('left_crank_joint', 'left_elbow'), (1.05, 1.05), 0.1),
    'two heights': Case('ankle_motors', ('c1.z', 'c2.z'), (0.0, 0.0), 0.1),
}


def write(folder, linkage, commanded=(), options=()):
    """Write a package; return its folder."""
    package = folder / f'{linkage}_transmission'
    typed = [word for name in commanded for word in ('--driven-by', name)]
    assert main(['compile', linkage, '--ros2-control', str(package), *typed, *options]) == 0
    return package


def build(package):
    """Compile a package with the stand-in; return the program that drives it."""
    program = package / 'driver'
    sources = [STAND_IN / 'driver.cpp', package / 'src' / 'transmission.cpp']
    subprocess.run(
        ['c++', '-std=c++17', '-Wall', '-Wextra', '-Wpedantic', '-Werror',
         '-ffp-contract=off', f'-I{STAND_IN}', f'-I{package / "src"}', *map(str, sources),
         '-o', str(program), '-pthread'],
        check=True, timeout=120,
    )  # fmt: skip
    return program


def run(program, lines):
    """Return the answers of the driver, and what it wrote as errors."""
    done = subprocess.run(
        [str(program)], input='\n'.join(lines) + '\n', capture_output=True, text=True, timeout=60,
        check=False,
    )  # fmt: skip
    return [line.split() for line in done.stdout.splitlines()], done.stderr


def say(what, values):
    return ' '.join([what, *(float(value).hex() for value in np.ravel(values))])


def numbers_of(answer):
    """Return position, velocity and effort by rows, the status, and the count of allocations."""
    *values, status, allocated = answer
    table = np.array([float.fromhex(value) for value in values]).reshape(-1, 3)
    return table, int(status), int(allocated)


@pytest.fixture(scope='module')
def programs(tmp_path_factory):
    """Return a function that builds the program of a case once."""
    built = {}

    def program_of(name):
        if name not in built:
            case = CASES[name]
            folder = tmp_path_factory.mktemp('transmissions')
            built[name] = build(write(folder, case.linkage, case.commanded, case.options))
        return built[name]

    return program_of


def described(closure, joints, commanded, reductions, offsets=None):
    """Return the lines that describe a transmission."""
    offsets = offsets or {}
    lines = [
        f'actuator {name}_motor {name} {reduction} 0'
        for name, reduction in zip(closure.input_names, reductions, strict=True)
    ]
    lines += [
        f'joint {name} {name} 1 {offsets.get(name, 0.0)}' + ALL * (name in commanded)
        for name in joints
    ]
    return [*lines, 'configure']


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', CASES)
def test_transmission_maps_motors_to_joints_and_back(programs, name):
    """Numbers are those of the closure; efforts are those of virtual work."""
    case, random = CASES[name], Random(name)
    closure = load(case.linkage).measuring(*case.commanded)
    count = len(closure.input_names)
    commanded = case.commanded or closure.joint_names
    joints = list(dict.fromkeys((*commanded, *closure.joint_names)))
    reductions = [2.0 + k for k in range(count)]
    offsets = {commanded[0]: 0.25}
    lines, given = described(closure, joints, commanded, reductions, offsets), []
    for _ in range(60):
        at = [value + random.uniform(-case.reach, case.reach) for value in case.middle]
        rates, efforts = ([random.uniform(-2.0, 2.0) for _ in range(count)] for _ in range(2))
        position = closure.position(*at)
        assert position.status.name == 'CLOSED'
        velocity = closure.velocity(position, *rates)
        given.append((np.array([at, rates, efforts]), position, velocity))
        lines.append(say('to_joints', np.array([at, rates, efforts]).T * motor_units(reductions)))
        table = np.array([[position[j], velocity[j], 0.0] for j in joints])
        table[0, 0] += 0.25
        table[:count, 2] = [random.uniform(-2.0, 2.0) for _ in commanded]
        lines.append(say('to_actuators', table))
        given.append((table, at, rates))
    answers, errors = run(programs(name), lines)
    assert errors == ''
    for (inputs, position, velocity), told in zip(given[::2], answers[::2], strict=True):
        found, status, allocated = numbers_of(told)
        assert (status, allocated) == (0, 0)
        expected = [position[j] + offsets.get(j, 0.0) for j in joints]
        assert found[:, 0] == pytest.approx(expected, rel=1e-14, abs=1e-14)
        size = 1.0 + np.abs(found[:, 1]).max()
        assert found[:, 1] == pytest.approx([velocity[j] for j in joints], abs=1e-12 * size)
        power = found[:, 1] @ found[:, 2]
        assert power == pytest.approx(inputs[1] @ inputs[2], abs=1e-11 * (1.0 + abs(power)))
        assert not found[count:, 2].any()
    for (table, at, rates), told in zip(given[1::2], answers[1::2], strict=True):
        found, status, allocated = numbers_of(told)
        assert (status, allocated) == (0, 0)
        found = found / motor_units(reductions)
        assert found[:, 0] == pytest.approx(at, abs=1e-12)
        assert found[:, 1] == pytest.approx(rates, abs=1e-10)
        power = table[:, 1] @ table[:, 2]
        assert found[:, 1] @ found[:, 2] == pytest.approx(power, abs=1e-10 * (1.0 + abs(power)))


def motor_units(reductions):
    """Return the units of position, velocity and effort before gears, by actuators."""
    return np.array([[n, n, 1.0 / n] for n in reductions])


FINGER = ['actuator motor left_knuckle_joint 1 0', 'joint finger left_finger_joint 1 0' + ALL]


@pytest.mark.parametrize(
    ('typed', 'status'),
    [
        ('-0.9', 'LIMITED'),  # beyond the limit of the motor, 42.4 degrees
        ('0.1', 'LIMITED'),
        ('inf', 'INDETERMINATE'),
    ],
)
def test_command_without_a_pose_keeps_the_last_one(programs, typed, status):
    lines = [*FINGER, 'configure', 'to_actuators -0.3 0 2', f'to_actuators {typed} 1 1',
             'sleep 1200', 'to_actuators -0.4 0 0']  # fmt: skip
    answers, errors = run(programs('finger'), lines)
    (good, before, _), (kept, told, allocated), (after, last, _) = map(numbers_of, answers)
    assert (before, told, last, allocated) == (0, NUMBERS[status], 0, 0)
    assert good[0] == pytest.approx([0.3, 0.0, -2.0], abs=1e-14)
    assert kept.tolist() == [[good[0, 0], 0.0, good[0, 2]]]  # it stands
    assert after[0, 0] == pytest.approx(0.4, abs=1e-14)
    (line,) = errors.splitlines()
    assert f': {status}; the last valid command stays' in line


def test_one_missing_joint_command_keeps_all_commands(programs):
    lines = described(load('ankle_motors'), ['pitch', 'roll'], ['pitch', 'roll'], [1.0, 1.0])
    lines += ['to_actuators 0.1 0 0 -0.1 0 0', 'to_actuators nan 1 0 0.1 1 0']
    answers, _ = run(programs('ankle'), lines)
    (good, _, _), (kept, status, _) = map(numbers_of, answers)
    assert status == NUMBERS['INDETERMINATE']
    assert kept.tolist() == [[position, 0.0, effort] for position, _, effort in good.tolist()]


DEACTIVATED = 'to_actuators nan nan nan'
"""What a transmission finds while no controller commands: NaN, as the handles begin."""


def test_deactivated_commands_are_nan_without_earlier_values(programs):
    lines = [
        *FINGER,
        'configure',
        DEACTIVATED,  # the start: nothing was commanded yet
        'sleep 1200',
        'to_actuators -0.3 0 2',
        'to_joints 0.6 0 0',  # moved by hand
        DEACTIVATED,
        'to_actuators 0.1 1 1',  # the first command after it has no pose
        DEACTIVATED,
        'to_actuators -0.6 0 0',
        'sleep 1200',
    ]
    answers, errors = run(programs('finger'), lines)
    start, given, moved, off, wrong, again, new = map(numbers_of, answers)
    for none, status, allocated in (start, off, again):
        assert np.isnan(none).all()
        assert (status, allocated) == (0, 0)
    assert given[0][0] == pytest.approx([0.3, 0.0, -2.0], abs=1e-14)
    assert moved[0][0, 0] == pytest.approx(-0.6, abs=1e-14)
    assert wrong[1] == NUMBERS['LIMITED']
    assert np.isnan(wrong[0][0, [0, 2]]).all()
    assert wrong[0][0, 1] == 0.0
    assert new[0][0, 0] == pytest.approx(0.6, abs=1e-14)
    assert errors == ''


def test_each_command_interface_may_be_nan_separately(programs):
    lines = [*FINGER, 'configure', 'to_joints 0.3 0 0', 'to_actuators nan 2 nan',
             'to_actuators -0.3 nan nan', 'to_actuators nan nan 1']  # fmt: skip
    answers, _ = run(programs('finger'), lines)
    found = [numbers_of(answer)[0][0].tolist() for answer in answers[1:]]
    assert found[0] == pytest.approx([np.nan, -2.0, np.nan], nan_ok=True)
    assert found[1] == pytest.approx([0.3, np.nan, np.nan], nan_ok=True)
    assert found[2] == pytest.approx([np.nan, np.nan, -1.0], nan_ok=True)


def test_reconfigured_transmission_forgets_earlier_values(programs):
    """The handles of a component are given anew when it is activated again."""
    lines = [*FINGER, 'configure', 'to_actuators -0.3 0 2', 'to_joints 0.3 0 0', 'configure',
             'to_joints nan 0 0', 'to_actuators 0.1 0 0']  # fmt: skip
    answers, _ = run(programs('finger'), lines)
    _, _, (state, _, _), (command, _, _) = map(numbers_of, answers)
    assert np.isnan(state).all()
    assert np.isnan(command[0, [0, 2]]).all()


def test_transmission_reports_states_but_refuses_commands_beyond_limits(programs):
    lines = [*FINGER, 'configure', 'to_joints 0.8 0 0', 'to_actuators -0.8 0 0']
    answers, _ = run(programs('finger'), lines)
    (joints, state, _), (actuators, command, _) = map(numbers_of, answers)
    assert (state, command) == (NUMBERS['LIMITED'], NUMBERS['LIMITED'])
    assert joints[0, 0] == pytest.approx(-0.8, abs=1e-14)
    assert np.isnan(actuators[0, 0])


def test_transmission_refuses_commands_of_another_assembly(programs):
    lines = described(load('ankle_motors'), ['pitch', 'roll'], ['pitch', 'roll'], [1.0, 1.0])
    answers, _ = run(programs('ankle'), [*lines, 'to_actuators 9 0 0 -0.5 0 0'])
    found, status, _ = numbers_of(answers[0])
    assert status == NUMBERS['OPEN']
    assert np.isnan(found[:, [0, 2]]).all()
    assert not found[:, 1].any()


def test_velocity_and_effort_commands_use_the_last_state(programs):
    finger = [FINGER[0], 'joint finger left_finger_joint 1 0 velocity effort']
    lines = [*finger, 'configure', 'to_joints 0.3 0 0', 'to_actuators 7 2 1']
    answers, _ = run(programs('finger'), lines)
    found, status, _ = numbers_of(answers[1])
    assert status == 0
    assert found[0] == pytest.approx([0.3, -2.0, -1.0], abs=1e-14)


def test_unclaimed_interfaces_do_not_count_as_commands(programs):
    finger = [FINGER[0], 'joint finger left_finger_joint 1 0 position']
    answers, _ = run(programs('finger'), [*finger, 'configure', 'to_actuators -0.3 2 1'])
    found, _, _ = numbers_of(answers[0])
    assert found[0] == pytest.approx([0.3, 0.0, 0.0], abs=1e-14)


# One transmission often serves commands and states, and with the same doubles: a value that is not
# written may be one of the other way.


def test_state_without_a_pose_keeps_the_last_state(programs):
    lines = described(load('ankle_motors'), ['pitch', 'roll'], ['pitch', 'roll'], [1.0, 1.0])
    lines += ['to_actuators 0.1 0 0 -0.1 0 0', 'to_joints 2.5 0 0 -2.5 0 0',
              'to_joints 0.1 0 0 0.2 0 0', 'to_actuators 0.1 0 0 -0.1 0 0',
              'to_joints 2.5 0 0 -2.5 0 0']  # fmt: skip
    answers, _ = run(programs('ankle'), lines)
    first, known, last = (numbers_of(answers[k]) for k in (1, 2, 4))
    assert np.isnan(first[0]).all()
    assert [status for _, status, _ in (first, known, last)] == [6, 0, 6]
    assert last[0].tolist() == known[0].tolist()


def test_command_without_a_pose_ignores_the_state(programs):
    lines = [
        *FINGER,
        'configure',
        'to_actuators -0.6 0 0',
        'to_joints 0.2 0 0',
        'to_actuators 1 0 0',
    ]
    answers, _ = run(programs('finger'), lines)
    commanded, _, held = (numbers_of(answer)[0] for answer in answers)
    assert held.tolist() == commanded.tolist()


WRONG = {
    'no linkage has no actuator motor; write a role of left_knuckle_joint': [
        'actuator m motor 1 0', FINGER[1]],
    'no actuator has the role left_knuckle_joint; add it': [FINGER[1]],
    'no joint has the role left_finger_joint; add it': [
        FINGER[0], 'joint r right_finger_joint 1 0'],
    'joint right: has command interfaces, but only left_finger_joint can be commanded; leave them '
    'out, or compile with --driven-by right_finger_joint': [
        *FINGER, 'joint right right_finger_joint 1 0 position'],
    'joint finger: has a reduction; give it to an actuator': [
        FINGER[0], 'joint finger left_finger_joint 2 0'],
    'actuator motor: its reduction is 0, or it has an offset; give offsets to joints': [
        'actuator motor left_knuckle_joint 0 0', FINGER[1]],
    'joint with the role left_finger_joint is given twice; leave one out': [
        *FINGER, 'joint again left_finger_joint 1 0'],
}  # fmt: skip
"""What the loader says of a wrong URDF."""


@pytest.mark.parametrize('told', WRONG)
def test_transmission_loader_reports_errors_in_one_line(programs, told):
    answers, errors = run(programs('finger'), [*WRONG[told], 'configure'])
    assert answers == []
    assert told.removeprefix('no linkage has ') in errors
    assert len(errors.splitlines()) == 1


def test_an_actuator_without_a_position_is_refused(programs):
    _, errors = run(programs('finger'), [*FINGER, 'configure effort'])
    assert errors == 'ERROR arm: an actuator has no position; the linkage needs all of them\n'


REFUSED = {
    '5 are published, of which 1 can be commanded; name 1 of right_knuckle_joint': ['gripper'],
    '2 for 1 input; name 1 different joint': [
        'gripper', '--driven-by', 'left_finger_joint', '--driven-by', 'right_finger_joint'],
    'left_fnger_joint: is not a joint, and describes no point': [
        'gripper', '--driven-by', 'left_fnger_joint'],
    'branch 1: there are 2 inputs, and no branches; leave it out': [
        'ankle_motors', '--branch', '1', '--driven-by', 'pitch', '--driven-by', 'roll'],
    '--branch: is for --driven-by; name the joint': ['ankle_motors', '--branch', '1'],
    '-o: is for one source; leave out -o or --ros2-control': ['ankle_motors', '-o', 'x.h'],
    '--arrays: is for one source': ['ankle_motors', '--arrays'],
}  # fmt: skip


@pytest.mark.parametrize('told', REFUSED)
def test_unsupported_transmission_is_refused_in_one_line(told, tmp_path, capsys):
    linkage, *options = REFUSED[told]
    assert main(['compile', linkage, '--ros2-control', str(tmp_path / 'arm'), *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert told in line
    assert not (tmp_path / 'arm').exists()


def test_joint_names_with_trigraphs_are_escaped(tmp_path):
    """Trigraphs, which C++14 still has: ??/ is a backslash, so a text would end early."""
    (tmp_path / 'arm.yaml').write_text(
        'links:\n'
        '  ground: {O2: [0, 0], O4: [0.1, 0]}\n'
        '  crank: {O2: [0, 0], A: [0.04, 0]}\n'
        '  coupler: {A: [0, 0], B: [0.12, 0]}\n'
        '  rocker: {O4: [0, 0], B: [0.08, 0]}\n'
        'input: {joint: crank_joint, parent: ground, child: crank}\n'
        'assembly: {B: left}\n'
        'joints:\n'
        """  'a??/"};int injected(){return 42;}//': {parent: crank, child: coupler}\n"""
        """  'b???/\\??': {parent: crank, child: rocker}\n"""
        '  rocker_joint: {parent: ground, child: rocker}\n'
    )
    package = tmp_path / 'arm'
    options = ('--driven-by', 'rocker_joint', '--branch', '1')
    file = str(tmp_path / 'arm.yaml')
    assert main(['compile', file, '--ros2-control', str(package), *options]) == 0
    program = tmp_path / 'names.cpp'
    program.write_text(
        '#include <cstdio>\n#include "linkage.hpp"\n'
        'int main() {for (auto name : arm_plugin::JOINT_NAMES) {std::puts(name);}}\n'
    )
    for standard in ('c++14', 'c++17'):
        subprocess.run(
            ['c++', f'-std={standard}', '-w', f'-I{package / "src"}', str(program),
             '-o', str(tmp_path / 'names')],
            check=True, timeout=120,
        )  # fmt: skip
        done = subprocess.run(
            [str(tmp_path / 'names')], capture_output=True, text=True, check=True
        )
        names = ['rocker_joint', 'a??/"};int injected(){return 42;}//', 'b???/\\??']
        assert done.stdout.splitlines() == names


UNWRITABLE = {
    'a' + 'b' * 300: 'cannot be written (File name too long); name another folder',
    'there/is_none/arm': 'there is no folder',
    'file/arm': 'cannot be written (Not a directory); name another folder',
}


@pytest.mark.parametrize('name', UNWRITABLE)
def test_uncreatable_package_folder_is_refused_in_one_line(name, tmp_path, capsys):
    (tmp_path / 'file').write_text('')
    assert main(['compile', 'ankle_motors', '--ros2-control', str(tmp_path / name)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert UNWRITABLE[name] in line
    assert [file.name for file in tmp_path.iterdir()] == ['file']


@pytest.mark.sample(2)
@pytest.mark.parametrize('count', range(6))
@pytest.mark.parametrize('force', [False, True])
def test_full_disk_leaves_no_partial_package(count, force, tmp_path, capsys, monkeypatch):
    """The disk is full after some files."""
    folder = tmp_path / 'ankle_transmission'
    if force:
        folder.mkdir()
        (folder / 'mine').write_text('mine')
    left = [count]
    write_bytes = Path.write_bytes

    def write_until_full(file, data):
        left[0] -= 1
        if left[0] < 0:
            write_bytes(file, data[: len(data) // 2])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write_bytes(file, data)

    typed = ['compile', 'ankle_motors', '--ros2-control', str(folder), *['--force'] * force]
    with monkeypatch.context() as patched:
        patched.setattr(Path, 'write_bytes', write_until_full)
        assert main(typed) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert 'cannot be written (No space left on device); name another folder' in line
    assert sorted(str(file.relative_to(tmp_path)) for file in tmp_path.rglob('*')) == (
        ['ankle_transmission', 'ankle_transmission/mine'] if force else []
    )
    assert main(typed) == 0
    assert (folder / 'src' / 'transmission.cpp').is_file()


@pytest.mark.parametrize('name', ['Arm', '9arm', 'my-arm', 'a__b', 'arm_'])
def test_invalid_ros_package_name_is_refused(name, tmp_path, capsys):
    assert main(['compile', 'ankle_motors', '--ros2-control', str(tmp_path / name)]) == 2
    assert 'is not a name of a ROS package; use lower-case letters' in capsys.readouterr().err


def test_existing_package_folder_needs_force(tmp_path, capsys):
    folder = write(tmp_path, 'ankle_motors')
    (folder / 'mine').write_text('mine')
    typed = ['compile', 'ankle_motors', '--ros2-control', str(folder)]
    assert main(typed) == 2
    assert 'exists already; name another, or add --force' in capsys.readouterr().err
    assert main([*typed, '--force']) == 0
    assert (folder / 'mine').read_text() == 'mine'
