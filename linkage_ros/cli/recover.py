# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Write what a damaged or unfinished bag still holds to a new bag, and list what is lost."""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
from threading import Event

from linkage_ros.bag import recover_bag, recovered_name, Recovery
from linkage_ros.cli.arguments import add_bag, add_force, output_or
from linkage_ros.cli.terminal import print_tables, show_progress, TerminalTable
from linkage_ros.description import remove_bag
from linkage_ros.errors import escape_unprintable
from linkage_ros.signals import heed_signals

WHOLE, STOPPED, LOSS = 0, 1, 3

_MOST_SHOWN = 20
"""Maximum number of losses shown; a worn-out disk may cause thousands."""

EXAMPLE = 'linkage recover my_bag -o whole_bag'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_bag(parser)
    parser.add_argument(
        '-o', '--output', type=Path, metavar='FOLDER', help='new folder; without it BAG_recovered'
    )
    add_force(parser)


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Recover the bag; return 0 without loss, 3 with losses, 1 if stopped."""
    # A signal within a record would cut it; `recover_bag` asks the event.
    with heed_signals(), show_progress('bytes') as advance:
        folder = output_or(arguments, recovered_name(arguments.bag))
        remove_bag(folder, force=arguments.force)
        recovery = recover_bag(arguments.bag, folder, advance, stop.is_set)
    if recovery is None:
        print('stopped; nothing was written', file=sys.stderr)
        return STOPPED
    _print_recovery(recovery)
    return WHOLE if recovery.is_whole else LOSS


def _print_recovery(recovery: Recovery) -> None:
    rows = []
    for topic in recovery.topics:
        promised = '?' if topic.expected is None else f'{topic.expected:,}'
        rows.append((topic.name, f'{topic.saved:,}', promised))
    if rows:
        print_tables(TerminalTable('', ('topic', '>saved', '>of'), rows))
    if recovery.attachments:
        print(escape_unprintable(f'attachments  {", ".join(recovery.attachments)}'))
    _print_lines('note', list(recovery.remarks))
    _print_lines('repaired', list(recovery.repaired))
    lost = []
    for file, (start, end, reason) in recovery.losses:
        size = f', {end - start:,} bytes' if end > start else ''
        lost.append(f'{file} at byte {start:,}{size}: {reason}')
    if recovery.missing_count:
        lost.append(f'{recovery.missing_count:,} messages that the bag promises')
    _print_lines('LOST', lost)
    if recovery.is_whole:
        print('nothing lost')
    print(f'bag          {recovery.folder}')


def _print_lines(word: str, lines: list[str]) -> None:
    for line in lines[:_MOST_SHOWN]:
        # A name in a damaged file may contain line breaks; one loss stays one line.
        print(f'{word:<13}{escape_unprintable(line)}')
    if len(lines) > _MOST_SHOWN:
        print(f'{word:<13}and {len(lines) - _MOST_SHOWN:,} more')
