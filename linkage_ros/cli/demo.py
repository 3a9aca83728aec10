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
Run the demo scene: a crank in a process of its own, the node in this one, a picture at the end.

Nothing leaves the machine, and no other ROS graph on it is heard: discovery stays local, in a
domain of its own.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import subprocess
import sys
from threading import Event

from linkage_ros.cli.plot import draw
from linkage_ros.cli.run import add_run_arguments, run_scene
from linkage_ros.errors import LinkageError
from linkage_ros.shipped import shipped

_DOMAINS = 101
"""Domain ids up to this one are safe with the ports of every operating system."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_run_arguments(parser)
    parser.set_defaults(seconds=10.0)


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Run the demo."""
    scene = shipped('scenes/demo.yaml')
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ['ROS_DOMAIN_ID'] = str(1 + os.getpid() % _DOMAINS)
    print(
        f'{scene.name}: {arguments.seconds:g} s; from a second terminal: '
        f'ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_DOMAIN_ID={os.environ["ROS_DOMAIN_ID"]}'
    )
    # Bounded, so that it ends by itself even where this process is killed.
    crank = subprocess.Popen(
        [
            *(sys.executable, '-m', 'linkage_ros.ros.crank_source'),
            *('--ros-args', '-p', f'seconds:={arguments.seconds + 10.0:.1f}'),
        ],
        start_new_session=True,  # Ctrl-C is for this process, which ends the other
    )
    try:
        code, bag = run_scene(str(scene), arguments, stop)
    finally:
        crank.terminate()
        crank.wait()
    if bag is not None:
        picture = Path(f'{bag}.png')
        try:
            draw(bag, picture)
        except LinkageError as error:
            # A run that was ended before it began, or no matplotlib: the run itself was good.
            print(f'picture   none: {error}')
        else:
            print(f'picture   {picture}')
    return code
