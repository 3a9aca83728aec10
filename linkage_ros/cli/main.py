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


"""``linkage``: one command; each subcommand is a module that is loaded when it is named."""

from __future__ import annotations

import argparse
from importlib import import_module
import sys
from threading import Event

from linkage_ros import __version__
from linkage_ros.cli.terminal import clean_output
from linkage_ros.errors import LinkageError, missing_packages_reported
from linkage_ros.signals import end_soon, raising, stop_on_signals, StoppedError

COMMANDS = {
    'run': 'run a scene as a ROS 2 node, with a live display',
    'demo': 'run the demo scene with a crank of its own, on a ROS graph of its own',
    'play': 'publish a bag on the graph, at its own pace or another',
    'plot': 'draw the joints of a bag over the angle of its crank',
    'info': 'say what a bag holds, how well its loops closed, and where a toggle was nearest',
    'report': 'write a run as one HTML page: its linkage moving, plots, events, counts',
    'export': 'write the joints of a bag, or one of its topics, to a CSV or Parquet file',
    'recover': 'make a whole bag of what a damaged or unfinished one still holds',
    'replay': 'run the scene of a bag once more and compare, or another scene over its samples',
    'scene': 'say what a scene consists of; list all effects; print the schemas of the files',
    'cost': 'say what each effect of a scene costs on this machine',
    'accuracy': 'show what accuracy costs in time, on a scene: tables, and a page with pictures',
    'check': 'say what a linkage is: freedom, loops, ranges, toggles, transmission angles',
    'solve': 'solve a linkage at some inputs or over its range, to a table, CSV or JSON',
    'draw': 'draw a linkage, and its joints over its range',
    'compile': 'write a linkage as source in C, JavaScript or Python that needs nothing else',
    'urdf': 'write a linkage or a scene as URDF, for robot_state_publisher and RViz',
    'mjcf': 'write a linkage or a scene as MJCF, for MuJoCo, with its closed loops',
    'import': 'make a linkage file of a URDF and the pins that close it',
    'synthesize': 'design a four-bar: from pairs of angles, a function, a curve or poses',
}
"""Each subcommand, usually also the name of its module in this folder, and its description."""

_MODULES = {'import': 'import_urdf'}
"""Modules that cannot have their command's name, since it is a keyword of Python."""


def module_of(command: str) -> str:
    """Return the module name of a subcommand."""
    return f'linkage_ros.cli.{_MODULES.get(command, command)}'


def main(arguments: list[str] | None = None) -> int:
    """Run ``linkage``; return 0, 1 for a failed run, 2 for wrong input, 3 for a loss."""
    # First of all: from here on a signal ends a command in order, and a run closes its bag.
    stop = stop_on_signals()
    clean_output()
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        try:
            with raising():
                return _run(arguments, stop)
        except StoppedError:
            end_soon(1)
            name = ' '.join(['linkage', *(name for name in arguments[:1] if name in COMMANDS)])
            print(f'{name}: stopped', file=sys.stderr)
            sys.stdout.flush()  # if nobody reads the pipe, this blocks until the time limit
            return 1
    except BrokenPipeError:
        # The reader of the output has gone: there is nobody to report to.
        sys.stderr.close()
        return 1


def _run(arguments: list[str], stop: Event) -> int:
    commands = '\n'.join(f'  {name:<10} {text}' for name, text in COMMANDS.items())
    parser = argparse.ArgumentParser(
        prog='linkage',
        description=f'Planar linkages for ROS 2.\n\ncommands:\n{commands}',
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog='linkage COMMAND --help says more.',
    )
    parser.add_argument('--version', action='version', version=f'linkage_ros {__version__}')
    parser.add_argument('command', choices=COMMANDS, metavar='COMMAND')
    name = parser.parse_args(arguments[:1]).command

    try:
        with missing_packages_reported():
            module = import_module(module_of(name))
            subparser = argparse.ArgumentParser(prog=f'linkage {name}', description=module.__doc__)
            module.add_arguments(subparser)
            return int(module.run(subparser.parse_args(arguments[1:]), stop))
    except LinkageError as error:
        print(f'linkage {name}: {error}', file=sys.stderr)
        return 2


if __name__ == '__main__':
    sys.exit(main())
