# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Time of transmissions of ros2_control: commands to motors, and motors to joint states.

They are compiled with the stand-in of ros2_control's headers that the tests use.
"""

from __future__ import annotations

from pathlib import Path
import subprocess

from bench import ROOT
from bench.processes import MeasurementError
from bench.report import ratios, spread, Table
from linkage_ros.cli.main import main
from linkage_ros.description import load

_STAND_IN = ROOT / 'test' / 'tools' / 'models' / 'ros2_control_stand_in'
_TRANSMISSIONS: dict[str, tuple[list[str], str]] = {
    'four_bar': (['--driven-by', 'rocker_joint', '--branch', '1'], '≤ 1'),
    'gripper': (['--driven-by', 'left_finger_joint'], ''),
    'ankle_motors': (['--driven-by', 'pitch', '--driven-by', 'roll'], '≤ 5'),
    'delta': (['--driven-by', 'x', '--driven-by', 'y', '--driven-by', 'z'], ''),
}
"""For each linkage what is typed, and the wanted time, in [µs]."""


def measure_transmissions(folder: Path, rounds: int, calls: int) -> Table:
    """Return the time of both ways, with velocities and efforts, for some linkages."""
    programs = {name: _build(folder / name, name) for name in _TRANSMISSIONS}
    found: dict[str, list[float]] = {name: [] for name in programs}
    for _ in range(rounds):
        for name, (program, lines) in programs.items():
            text = f'{lines}time {calls}\n'
            done = subprocess.run(
                [program], input=text, capture_output=True, text=True, check=True
            )
            found[name].append(1e-3 * float(done.stdout))
    table = Table(
        'transmissions of ros2_control, joints to motors and back, µs; one run, in turn',
        ('', 'both ways', 'target', 'of a four-bar'),
    )
    for name, (_, wanted) in _TRANSMISSIONS.items():
        of_four_bar = spread(ratios(found[name], found['four_bar']), 2)
        table.rows.append((name, spread(found[name], 2), wanted, of_four_bar))
    return table


def _build(folder: Path, name: str) -> tuple[str, str]:
    """Return the driver of a transmission, and the lines that describe it."""
    typed, _ = _TRANSMISSIONS[name]
    package, program = folder / f'{name}_transmission', folder / 'driver'
    folder.mkdir()
    if main(['compile', name, '--ros2-control', str(package), *typed]):
        raise MeasurementError(f'{name}: no transmission is written')
    sources = (_STAND_IN / 'driver.cpp', package / 'src' / 'transmission.cpp')
    folders = (f'-I{_STAND_IN}', f'-I{package / "src"}')
    command = ['c++', '-std=c++17', '-O2', '-ffp-contract=off', *folders, *map(str, sources)]
    done = subprocess.run(
        [*command, '-o', str(program), '-pthread'], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise MeasurementError(f'{package}: {done.stderr}')
    closure = load(name)
    motors = (f'actuator {each} {each} 1 0\n' for each in closure.input_names)
    commanded, interfaces = typed[1::2], ' position velocity effort'
    joints = (
        f'joint {each} {each} 1 0{interfaces * (each in commanded)}\n'
        for each in closure.joint_names
    )
    return str(program), ''.join((*motors, *joints, 'configure\n'))
