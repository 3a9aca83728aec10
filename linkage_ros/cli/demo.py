# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Run a scene that comes with the package: the node in this process, its companions in others.

Companions are a crank on a topic, or a controller of the efforts of the inputs. Nothing leaves the
machine, and no other ROS graph on it is heard: discovery is local, in a separate domain. If the
scene records a bag, the command draws it at the end.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import subprocess
import sys
from threading import Event
from typing import TYPE_CHECKING

from linkage_ros.cli.gallery import first_sentence
from linkage_ros.cli.run import add_run_arguments, run_scene
from linkage_ros.cli.table import Table
from linkage_ros.cli.terminal import print_tables
from linkage_ros.description import load_scene, Scene, SceneLinkage
from linkage_ros.domains import private_domain
from linkage_ros.errors import did_you_mean, LinkageError, list_names
from linkage_ros.node import stay_on_this_machine
from linkage_ros.resources import scene_names, shipped_path
from linkage_ros.signals import heed_signals
from linkage_ros.workbench import find_tool

if TYPE_CHECKING:
    from linkage_ros.stages.faults import FaultEntry

_BESIDE = {
    'topic': ('linkage_ros.node.crank_source', 'joint:={}'),
    'torque': ('linkage_ros.node.pd_controller', 'joints:=[{}]'),
}
"""Companion programs of the drives that listen to a topic, and how they take the inputs."""

_PARAMETERS = {
    'torque_crank': ('swing:=1.0',),
    # Of two periods: the motors' sum rolls the foot, their difference nods it.
    'torque_ankle': (
        'target:=0.0',
        'swing:=0.3',
        'period:=4.0',
        'm2.period:=2.5',
        'kp:=8.0',
        'kd:=0.3',
    ),
}
"""Parameters of the companion of a scene, other than the companion's defaults."""

_SECONDS = 10.0
"""Duration of a demo without ``--seconds``, in [s]; longer if its faults end later."""

_AFTERWARDS = 3.0
"""How long a demo runs on after the last fault, in [s]."""

_PATIENCE = 20.0
"""How long the demo's duration waits for the first message for the crank, in [s]: a busy machine
takes seconds to start the second process."""

EXAMPLE = 'linkage demo fault_drill --seconds 10'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        'name', nargs='?', default='demo', metavar='SCENE', help='a shipped scene (default: demo)'
    )
    parser.add_argument('--list', action='store_true', help='list the shipped scenes')
    add_run_arguments(parser)
    parser.set_defaults(seconds=None)


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Run the demo."""
    if arguments.list:
        rows = [_scene_row(shipped_path(f'scenes/{name}.yaml')) for name in scene_names()]
        print_tables(Table('', ('scene', 'drive', 'recorded', ''), rows))
        return 0
    name, names = arguments.name, scene_names()
    if name not in names:
        remedy = did_you_mean(name, names, f'there are: {list_names(names)}')
        raise LinkageError(name, 'there is no such scene', remedy)
    file = shipped_path(f'scenes/{name}.yaml')
    scene = load_scene(file, arguments.set)
    stay_on_this_machine()
    os.environ['ROS_DOMAIN_ID'] = str(private_domain())
    if arguments.seconds is None:
        ends = [max(fault.at) + fault.seconds for fault in scene.faults.values() if fault.at]
        # Faults begin at their time after the first tick, and a look at the end is wanted.
        arguments.seconds = max([_SECONDS, *(end + _AFTERWARDS for end in ends)])
    print(
        f'{scene.name}: {arguments.seconds:g} s; from a second terminal: '
        f'ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_DOMAIN_ID={os.environ["ROS_DOMAIN_ID"]}',
        flush=True,  # needed during the run, also by a pipe
    )
    if scene.faults:
        print(
            f'faults    {list_names(map(_fault_text, scene.faults, scene.faults.values()), "; ")}'
        )
    with heed_signals(), _run_companions(scene, arguments.seconds):
        code, bag = run_scene(str(file), arguments, stop, patience=_PATIENCE)
    if bag is not None:
        picture = Path(f'{bag}.png')
        try:
            # Ctrl-C ended the run; it must not stop the drawing.
            find_tool('plot').draw_bag(bag, picture, Event())
        except LinkageError as error:
            # The run ended before it began, or matplotlib is missing: the run itself succeeded.
            print(f'picture   none: {error}')
        else:
            print(f'picture   {picture}')
    elif scene.record is None and code == 0:
        print(f'picture   none: {scene.name} records no bag to draw')
    return code


@contextmanager
def _run_companions(scene: Scene, seconds: float) -> Iterator[None]:
    """Run the companions of the scene's drives in separate processes."""
    processes = [
        subprocess.Popen(
            command,
            start_new_session=True,  # Ctrl-C goes to this process only, which ends the others
        )
        for scene_linkage in scene.linkages
        if (command := _companion_command(scene.name, scene_linkage, seconds))
    ]
    try:
        yield
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait()


def _companion_command(name: str, scene_linkage: SceneLinkage, seconds: float) -> list[str]:
    """Return the command of the companion of a scene's linkage; empty if it needs none."""
    drive, _ = scene_linkage.drive
    if drive not in _BESIDE:
        return []
    module, joints = _BESIDE[drive]
    # A time limit, so that it ends by itself even if this process is killed.
    limit = seconds + _PATIENCE + 10.0
    parameters = (
        joints.format(','.join(scene_linkage.sampled_joints)),
        f'seconds:={limit:.1f}',
        *_PARAMETERS.get(name, ()),
    )
    pairs = [part for parameter in parameters for part in ('-p', parameter)]
    return [sys.executable, '-m', module, '--ros-args', *pairs]


def _fault_text(name: str, fault: FaultEntry) -> str:
    """Return a fault as text: its name, its kind, and when it happens."""
    times = list_names(f'{time:g}' for time in fault.at)
    when = f'at {times} s for {fault.seconds:g} s' if fault.at else 'by service call'
    return f'{name} ({fault.kind}) {when}'


def _scene_row(file: Path) -> tuple[str, ...]:
    """Return the list's text on a scene: its drives, and its own description."""
    scene = load_scene(file)
    drives = ' and '.join(
        dict.fromkeys(scene_linkage.drive[0] for scene_linkage in scene.linkages)
    )
    return scene.name, drives, 'yes' if scene.record else 'no', first_sentence(file)
