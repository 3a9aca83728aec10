# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage``: one command; each subcommand is a module that is loaded when it is named."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
import os
import re
import sys
from threading import Event
from types import ModuleType
from typing import Any, NoReturn

from linkage_ros import __version__
from linkage_ros.cli.terminal import clean_output, give_up_output, tell_who_waits
from linkage_ros.errors import (
    decimal_comma,
    did_you_mean,
    FileError,
    LinkageError,
    list_names,
    missing_packages_reported,
    quote,
)
from linkage_ros.signals import (
    end_soon,
    has_raised,
    raise_on_signals,
    stop_on_signals,
    StoppedError,
)
from linkage_ros.workbench import find_tool, TOOLS

COMMANDS = {
    'run': 'run a scene as a ROS 2 node, with a live display',
    'demo': 'run the demo scene and its crank, on a separate ROS graph',
    'simulate': 'run a scene as fast as possible, without ROS, to a bag, CSV or Parquet',
    'echo': 'print the messages of a topic as YAML, or their rate',
    'relay': 'relay commands of other joints to the inputs, as a ROS 2 node',
    'plot': 'draw the joints of a bag over the angle of its crank',
    'info': 'describe a bag: its content, how well its loops closed, where a toggle was nearest',
    'report': 'write a run as one HTML page: its linkage moving, plots, events, counts',
    'export': 'write the joints of a bag, or one of its topics, to a CSV or Parquet file',
    'recover': 'write what a damaged or unfinished bag still holds to a new bag',
    'replay': 'run the scene of a bag once more and compare, or another scene over its samples',
    'compare': 'show how far the joints of two runs lie apart over time, and draw it',
    'scene': 'describe a scene; list all effects; print the schemas of the files',
    'accuracy': 'find where the error of a scene comes from, what a digit costs, what to write',
    'gallery': 'list the linkages and scenes that come with the package; print or copy one',
    'check': 'describe a linkage: mobility, loops, ranges, toggles, transmission angles',
    'solve': 'solve a linkage at some inputs or over its range, to a table, CSV or JSON',
    'view': 'show a linkage in the browser, to drag, drive and edit it; a scene, a node or a bag',
    'draw': 'draw a linkage, and its joints over its range',
    'animate': 'animate a linkage over its range: GIF, MP4 or SVG',
    'compile': 'write a linkage as source in C, JavaScript or Python that needs nothing else',
    'fmu': 'write a scene as an FMI 3.0 co-simulation FMU, for test benches without ROS',
    'urdf': 'write a linkage or a scene as URDF, for robot_state_publisher and RViz',
    'mjcf': 'write a linkage or a scene as MJCF, for MuJoCo, with its closed loops',
    'import': 'make a linkage file of a URDF and the pins that close it',
    'synthesize': 'design a four-bar: from pairs of angles, a function, a curve, poses, its swing',
    'completion': 'print the completion script of a shell: bash, zsh or fish',
}
"""Each subcommand and its description."""

EXIT_CODES = {
    0: 'success',
    1: 'a run failed or was stopped, or no result meets the request',
    2: 'wrong input; one line names place, reason and remedy',
    3: 'something is lost (recover, replay) or differs (replay)',
}
"""The exit codes of all commands."""

# A word that is not an option: argparse itself takes -1e-5 for one.
_NEGATIVE = re.compile(r'-\.?\d')

# What argparse says of a value that its type does not read.
_INVALID = re.compile(r"invalid (?:float|int|number|(whole) number) value: ('(.*)')")


def find_command(name: str) -> ModuleType:
    """Return the module of a subcommand: a tool's, or one in this folder."""
    return find_tool(name) if name in TOOLS else import_module(f'linkage_ros.cli.{name}')


def _in_plain_words(match: re.Match[str]) -> str:
    kind = 'whole number' if match[1] or 'int value' in match[0] else 'number'
    return f'{match[2]} is not a {kind}{decimal_comma(match[3])}'


class Parser(argparse.ArgumentParser):
    """A parser that answers a wrong word in one line, with the nearest right one."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        self._negative_number_matcher = _NEGATIVE

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; refuse unknown options first, which argparse reports only after all others."""
        options = [option for action in self._actions for option in action.option_strings]
        for word in args or ():
            if word in ('--', '--ros-args'):  # what follows is for ROS
                break
            name = word.partition('=')[0]
            if name.startswith('--') and not any(option.startswith(name) for option in options):
                remedy = did_you_mean(name, options, 'leave it out')
                self.error(f'there is no option {quote(name)}; {remedy}')
        return super().parse_args(args, namespace)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            choices = list(map(str, action.choices))
            remedy = did_you_mean(str(value), choices, f'write one of {list_names(choices)}')
            raise argparse.ArgumentError(action, f'there is no {quote(value)}; {remedy}')

    def error(self, message: str) -> NoReturn:
        """Print one line, and exit as for any wrong input."""
        message = _INVALID.sub(_in_plain_words, message)
        self.exit(2, f'{self.prog}: {message} (see {self.prog} --help)\n')


def parser_of(name: str, module: ModuleType) -> Parser:
    """Return the parser of a subcommand; its help ends with the example."""
    parser = Parser(prog=f'linkage {name}', description=module.__doc__)
    parser.set_defaults(command=name)
    module.add_arguments(parser)
    example = module.EXAMPLE
    # A group without arguments: argparse folds an epilog, and this is to be copied.
    parser.add_argument_group('example', example if isinstance(example, str) else example[name])
    return parser


def top_parser() -> Parser:
    """Return the parser of ``linkage`` itself, which reads the name of the subcommand."""
    commands = '\n'.join(f'  {name:<10} {text}' for name, text in COMMANDS.items())
    codes = '\n'.join(f'  {code}  {text}' for code, text in EXIT_CODES.items())
    parser = Parser(
        prog='linkage',
        description='Linkages for ROS 2, in the plane and in space.\n\n'
        f'commands:\n{commands}\n\nexit codes:\n{codes}',
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog='linkage COMMAND --help shows more.\n\nexample:\n  linkage check jansen_leg',
    )
    parser.add_argument('--version', action='version', version=f'linkage_ros {__version__}')
    parser.add_argument(
        'command', choices=COMMANDS, metavar='COMMAND', help='one of the commands above'
    )
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Run ``linkage`` and return one of `EXIT_CODES`."""
    if '_ARGCOMPLETE' in os.environ:  # a shell asks how to complete a line
        find_command('completion').complete()  # ends the process, if it can
        return 1
    # First of all: from here on a signal ends a command in order, and a run closes its bag.
    stop = stop_on_signals()
    clean_output()
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        try:
            with raise_on_signals():
                if stop.is_set():
                    raise StoppedError
                try:
                    return _run_command(arguments, stop)
                finally:
                    sys.stdout.flush()  # here, where an error can be reported
        except (StoppedError, Exception) as error:
            # A library may convert an error that the signal raised within it.
            stopped = isinstance(error, StoppedError) or has_raised()
            if isinstance(error, BrokenPipeError) or not stopped:
                raise
            end_soon(1)
            print(f'{_said_by(arguments)}: stopped', file=sys.stderr)
            sys.stdout.flush()  # if nobody reads the pipe, this blocks until the time limit
            return 1
    except BrokenPipeError:
        # The reader of the output has gone: there is nobody to report to.
        give_up_output()
        return 1
    except OSError as error:
        # The output, or a place for temporary files; commands report all others themselves.
        give_up_output()
        where = error.filename or 'the output'
        with suppress(OSError):
            print(f'{_said_by(arguments)}: {where}: {error.strerror or error}', file=sys.stderr)
        return 1


def _said_by(arguments: Sequence[str]) -> str:
    return ' '.join(['linkage', *(name for name in arguments[:1] if name in COMMANDS)])


def _run_command(arguments: Sequence[str], stop: Event) -> int:
    name = top_parser().parse_args(arguments[:1]).command
    typed = argparse.Namespace()
    try:
        with missing_packages_reported():
            module = find_command(name)
            parser = parser_of(name, module)
            parser.parse_args(arguments[1:], typed)
            # A local import: signals are to be handled before anything large is imported.
            from linkage_ros.cli.arguments import refuse_existing

            refuse_existing(typed)
            with tell_who_waits():
                return int(module.run(typed, stop))
    except LinkageError as error:
        # A command that reads a linkage sets the units in which it shows values.
        told = typed.angles.convert_error(error) if 'angles' in typed else error
        for line in told.in_file if isinstance(told, FileError) else (told,):
            print(f'linkage {name}: {line}', file=sys.stderr)
        return 2


if __name__ == '__main__':
    sys.exit(main())
