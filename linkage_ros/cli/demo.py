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


"""
Run a scene that comes with the package: the node in this process, what it needs beside it.

A crank from a topic, or a controller of its effort, is in a process of its own. Nothing leaves the
machine, and no other ROS graph on it is heard: discovery stays local, in a domain of its own. At
the end the bag is drawn, where the scene records one.
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

from linkage_ros.cli.plot import draw
from linkage_ros.cli.run import add_run_arguments, run_scene
from linkage_ros.cli.terminal import show, Table
from linkage_ros.errors import did_you_mean, LinkageError, listed
from linkage_ros.resources import shipped
from linkage_ros.scene.load import load_scene
from linkage_ros.scene.scene import Scene, SceneLinkage
from linkage_ros.signals import heeded

_DOMAINS = 101
"""Domain ids up to this one have ports that are safe on every operating system."""

_BESIDE = {
    'topic': ('linkage_ros.node.crank_source',),
    'torque': ('linkage_ros.node.pd_controller', 'swing:=1.0'),
}
"""Companion processes of the drives that listen to a topic, with parameters."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('name', nargs='?', default='demo', help='the scene; without it, demo')
    parser.add_argument('--list', action='store_true', help='the scenes that there are')
    add_run_arguments(parser)
    parser.set_defaults(seconds=10.0)


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Run the demo."""
    if arguments.list:
        show(Table('', ('scene', 'drive', 'recorded', ''), [_row(f) for f in _files().values()]))
        return 0
    file = _file(arguments.name)
    scene = load_scene(file)
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ['ROS_DOMAIN_ID'] = str(1 + os.getpid() % _DOMAINS)
    print(
        f'{scene.name}: {arguments.seconds:g} s; from a second terminal: '
        f'ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_DOMAIN_ID={os.environ["ROS_DOMAIN_ID"]}',
        flush=True,  # needed during the run, also by a pipe
    )
    with heeded(), _beside(scene, arguments.seconds):
        code, bag = run_scene(str(file), arguments, stop)
    if bag is not None:
        picture = Path(f'{bag}.png')
        try:
            draw(bag, picture, Event())  # Ctrl-C ended the run; it must not stop the drawing
        except LinkageError as error:
            # The run ended before it began, or matplotlib is missing: the run itself succeeded.
            print(f'picture   none: {error}')
        else:
            print(f'picture   {picture}')
    elif scene.record is None and code == 0:
        print(f'picture   none: {scene.name} records no bag to draw')
    return code


@contextmanager
def _beside(scene: Scene, seconds: float) -> Iterator[None]:
    """Run the companions of the scene's drives in processes of their own."""
    processes = [
        subprocess.Popen(
            command,
            start_new_session=True,  # Ctrl-C goes to this process only, which ends the others
        )
        for member in scene.members
        for command in _commands(member, seconds)
    ]
    try:
        yield
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait()


def _commands(member: SceneLinkage, seconds: float) -> Iterator[list[str]]:
    """Yield the command of a linkage's companion, if it needs one."""
    drive, _ = member.drive
    if drive in _BESIDE:
        module, *parameters = _BESIDE[drive]
        # A time limit, so that it ends by itself even if this process is killed.
        parameters += [f'joint:={member.inputs[0]}', f'seconds:={seconds + 10.0:.1f}']
        yield [sys.executable, '-m', module, '--ros-args', *_each('-p', parameters)]


def _each(flag: str, values: list[str]) -> Iterator[str]:
    for value in values:
        yield from (flag, value)


def _files() -> dict[str, Path]:
    """Return the scenes that come with the package, by their names."""
    folder = shipped('scenes/demo.yaml').parent
    return {file.stem: file for file in sorted(folder.glob('*.yaml'))}


def _file(name: str) -> Path:
    files = _files()
    if name in files:
        return files[name]
    remedy = did_you_mean(name, files, f'there are: {listed(files)}')
    raise LinkageError(name, 'there is no such scene', remedy)


def _row(file: Path) -> tuple[str, ...]:
    """Return the list's text on a scene: its drives, and its own description."""
    scene = load_scene(file)
    drives = ' and '.join(dict.fromkeys(member.drive[0] for member in scene.members))
    return scene.name, drives, 'yes' if scene.record else 'no', _first_sentence(file)


def _first_sentence(file: Path) -> str:
    """Return the description in the comment at the head of a file."""
    comment = []
    for line in file.read_text('utf-8').splitlines():
        if not line.startswith('#'):
            break
        if not line.startswith('# yaml-language-server:'):
            comment.append(line.lstrip('# '))
    return ' '.join(comment).partition('. ')[0].rstrip('.')
