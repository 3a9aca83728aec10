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
from collections.abc import Iterator
from pathlib import Path
import sys
from threading import Event
from typing import Any

from linkage_ros.bag import recover_bag, recovered_name, Recovery
from linkage_ros.cli.arguments import add_bag, add_force, output_or
from linkage_ros.cli.result import add_result, Result, show_result
from linkage_ros.cli.table import attributes_json, Column, Table, table_of_rows
from linkage_ros.cli.terminal import show_progress
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
    add_result(parser, output=False)


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
    _show_recovery(recovery, arguments)
    return WHOLE if recovery.is_whole else LOSS


_TOPIC = (
    Column('topic', 'name'),
    Column('>saved', 'saved', form=','),
    Column('>of', 'expected', form=lambda count, _: '?' if count is None else f'{count:,}'),
)


def _show_recovery(recovery: Recovery, arguments: argparse.Namespace) -> None:
    lost = []
    for file, (start, end, reason) in recovery.losses:
        size = f', {end - start:,} bytes' if end > start else ''
        lost.append(f'{file} at byte {start:,}{size}: {reason}')
    if recovery.missing_count:
        lost.append(f'{recovery.missing_count:,} messages that the bag promises')
    account = {
        'bag': str(recovery.folder),
        'whole': recovery.is_whole,
        'topics': [attributes_json(topic, _TOPIC) for topic in recovery.topics],
        'attachments': list(recovery.attachments),
        'notes': list(recovery.remarks),
        'repaired': list(recovery.repaired),
        'lost': lost,
    }
    show_result(Result(account, [*_recovery_parts(account)]), arguments)


def _recovery_parts(account: dict[str, Any]) -> Iterator[Table | str]:
    if account['topics']:
        yield table_of_rows('', 'topics', _TOPIC, account['topics'])
    lines = []
    if account['attachments']:
        lines.append(f'attachments  {", ".join(account["attachments"])}')
    for word, said in (('note', 'notes'), ('repaired', 'repaired'), ('LOST', 'lost')):
        told = account[said]
        lines += [f'{word:<13}{line}' for line in told[:_MOST_SHOWN]]
        if len(told) > _MOST_SHOWN:
            lines.append(f'{word:<13}and {len(told) - _MOST_SHOWN:,} more')
    if account['whole']:
        lines.append('nothing lost')
    # A name in a damaged file may contain line breaks; one loss stays one line.
    yield from map(escape_unprintable, [*lines, f'bag          {account["bag"]}'])
