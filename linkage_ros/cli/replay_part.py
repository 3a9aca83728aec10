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
Run the scene of a bag once more over its samples, and compare.

Every joint state, and what else was published, is made anew and held against the recorded bytes.
Exit code 0: all are the same; 3: some differ; 1: it could not be told, was stopped, or the bag is
damaged and what lies before the damage is the same.

With --scene another scene is run, and its joints are compared with the recorded ones; -o writes it
to a new bag, which replays by itself. Then a difference is no failure.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
import json
from pathlib import Path
import sys
from threading import Event
from typing import Any

from linkage_ros.bag.reader import Bag, RUN_FILE
from linkage_ros.bag.run_events import run_account
from linkage_ros.cli.bag_reading import add_trust, BagReading, opened, scene_of
from linkage_ros.cli.replay import (
    bag_account,
    first_text,
    greatest_table,
    joints_table,
    proof_account,
    topics_table,
    versions_text,
)
from linkage_ros.cli.replay_other import replayed_with
from linkage_ros.cli.terminal import show
from linkage_ros.errors import BagError, clean, LinkageError
from linkage_ros.replay.replay import own_effects_here, ReplayedTick, versions_here
from linkage_ros.replay.verify import DIFFERENT, IDENTICAL, prove, turning_joints
from linkage_ros.scene.load import load_scene

EXIT_INCOMPLETE, EXIT_DIFFERENT = 1, 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('bag', type=Path, help="the bag's folder or its .mcap file")
    parser.add_argument('--scene', type=Path, help='another scene to run, or a linkage')
    parser.add_argument(
        '-o', '--output', type=Path, metavar='NEWBAG', help='folder of a new bag; with --scene'
    )
    parser.add_argument(
        '--crank-topic',
        help="the samples' topic, with --scene; absent, the run's own, /crank_states, or the only "
        'one that has the input joints',
    )
    parser.add_argument('--json', action='store_true', help='the same as JSON')
    add_trust(parser)


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Replay the bag; the module says what is returned."""
    for option, value in (('-o', arguments.output), ('--crank-topic', arguments.crank_topic)):
        if value is not None and arguments.scene is None:
            raise LinkageError(option, 'is for another scene', 'name it with --scene')
    bag = opened(arguments.bag, stop)
    reading = BagReading(bag, stop)
    if arguments.scene is None:
        account = replayed(bag, reading, trust_effects=arguments.trust_effects)
        code = {IDENTICAL: 0, DIFFERENT: EXIT_DIFFERENT}.get(account['verdict'], EXIT_INCOMPLETE)
    else:
        scene = load_scene(arguments.scene)
        if RUN_FILE in bag.attachments and 'seed' not in scene.members[0].content:
            # What differs is the scene, and not the noise.
            scene = replace(scene, seed=run_account(bag).seed)
        account = replayed_with(bag, reading, scene, arguments.crank_topic, arguments.output)
        code = 0
    if arguments.json:
        print(json.dumps(account, indent=1, allow_nan=False))
    elif arguments.scene is None:
        _show_proof(account)
    else:
        _show_what_if(account)
    for line in _shortcomings(account):
        print(f'linkage replay: {line}', file=sys.stderr)
    return code or (EXIT_INCOMPLETE if reading.damage or reading.stopped else 0)


def replayed(bag: Bag, reading: BagReading, *, trust_effects: bool = False) -> dict[str, Any]:
    """
    Run a bag's own scene once more; return what came of it.

    Raises
    ------
    LinkageError
        Where the bag carries no scene that can be run, or nothing to compare.

    """
    try:
        scene = scene_of(bag, trust_effects=trust_effects)
    except BagError as error:
        raise BagError(error.where, error.reason, 'name a scene to run with --scene') from None
    begin: list[int] = []

    def look(tick: ReplayedTick) -> None:
        if not begin:
            begin.append(tick.time)

    with reading.told() as messages:
        proof = prove(bag, scene, messages, look)
    if not begin and not reading.damage and not reading.stopped:
        raise BagError(bag.path, 'holds no joint states', 'record a run with a crank')
    run = run_account(bag)
    versions = {
        'bag': {**run.versions, **run.own_effects},
        'here': {**versions_here(), **own_effects_here(scene)},
    }
    account = proof_account(proof, turning_joints(scene), versions)
    return bag_account(bag, scene, reading, begin) | account


def _show_proof(account: dict[str, Any]) -> None:
    begin = account['begin_ns'] or 0
    differ, ticks = account['different_ticks'], account['compared_ticks']
    verdict = account['verdict']
    if verdict == IDENTICAL:
        text = f'identical: what {ticks} ticks have made comes to the same again'
    else:
        text = f'{verdict}: {differ} of {ticks} ticks differ' if ticks else verdict
    print(f'{account["bag"]}: {text}')
    if account['beginning_missing']:
        print(account['beginning_missing'])
    for gap in account['gaps'] if differ else ():
        print(clean(gap))
    first = account['first_difference']
    if first and differ:
        print(clean(f'first: {first_text(first, begin)}'))
        last = account['last_different_tick']['tick']
        if last < account['ticks'] and last != first['tick']:
            print(f'from tick {last + 1} on all are the same')
    elif first:
        print(clean(f'not told, first: {first_text(first, begin)}'))
    if account['withheld_ticks']:
        print(f'{account["withheld_ticks"]} ticks are without a message, then and now')
    for line in versions_text(account['versions']):
        print(line)
    print()
    show(topics_table(account))
    if account['greatest']:
        print()
        show(greatest_table(account, begin))


def _show_what_if(account: dict[str, Any]) -> None:
    print(
        f'{account["bag"]}, as {account["scene"]}: {account["joint_states"]} joint states, '
        f'from {clean(account["crank_topic"])}'
    )
    for key, when in (('joints_only_recorded', 'recorded'), ('joints_only_now', 'now')):
        if account[key] and account['topics']:
            print(f'only {when}: {", ".join(account[key])}')
    if account['topics']:
        print()
        show(topics_table(account))
    if account['joints']:
        print()
        show(joints_table(account, account['begin_ns'] or 0))
    if account['new_bag']:
        print()
        counts = ', '.join(f'{count} of {name}' for name, count in account['written'].items())
        print(f'{account["new_bag"]}: {counts}')


def _shortcomings(account: dict[str, Any]) -> Iterator[str]:
    """Yield why not all of the bag was replayed."""
    if account['truncated']:
        yield f'{account["bag"]}: unfinished: {account["unfinished"]}; what it holds was replayed'
    if account['damage']:
        yield f'{account["damage"]}; what lies before was replayed'
    if account['stopped']:
        yield 'stopped; the rest of the bag was not replayed'
