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

"""Run a scene as fast as it goes, without ROS, and write a bag or a table of its joints."""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
from tempfile import TemporaryDirectory
from threading import Event

from linkage_ros.cli.arguments import add_set, bounded, SCENE_HELP
from linkage_ros.cli.export import export
from linkage_ros.cli.terminal import progress
from linkage_ros.errors import clean
from linkage_ros.files.file_access import check_suffix
from linkage_ros.files.tables import check_kind, KINDS
from linkage_ros.node.simulated_run import check_simulated, simulate
from linkage_ros.scene.load import load_scene
from linkage_ros.signals import StoppedError

EXAMPLE = 'linkage simulate andrews_squeezer --seconds 0.03 -o squeezer.csv'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('scene', metavar='SCENE', help=SCENE_HELP)
    parser.add_argument(
        '--seconds',
        type=bounded(0.0, 1e9),
        default=10.0,
        help='duration, in the time of the scene (default 10)',
    )
    parser.add_argument(
        '-o',
        '--output',
        type=Path,
        required=True,
        metavar='OUTPUT',
        help='folder of a new bag; or a table of the joints: OUTPUT.csv or OUTPUT.parquet',
    )
    add_set(parser)


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Simulate; return 1 if a signal stopped it."""
    output: Path = arguments.output
    if output.suffix:
        check_suffix(output, KINDS)
        check_kind(output)
    scene = load_scene(arguments.scene, arguments.set)
    ticks = check_simulated(scene, arguments.seconds)
    done = 0

    def write(folder: Path) -> dict[str, int]:
        with progress('ticks') as advance:

            def goes_on(number: int) -> bool:
                nonlocal done
                done = number
                advance(number, ticks)
                return not stop.is_set()

            counts = simulate(scene, folder, ticks, goes_on)
        if stop.is_set():
            print(f'linkage simulate: stopped after {done:,} of {ticks:,} ticks', file=sys.stderr)
        return counts

    if not output.suffix:
        counts = write(output)
        parts = ', '.join(f'{count} on {clean(name)}' for name, count in counts.items() if count)
        print(f'{output}: {parts or "no messages"}')
        return int(stop.is_set())
    with TemporaryDirectory() as folder:
        bag = Path(folder) / 'run'
        write(bag)
        if stop.is_set():
            return 1
        try:
            found = export(bag, output, None, stop)
        except StoppedError:
            print('linkage simulate: stopped; nothing was written', file=sys.stderr)
            return 1
    print(f'{output}: {found.rows} rows, {4 + len(found.keys)} columns')
    return 0
