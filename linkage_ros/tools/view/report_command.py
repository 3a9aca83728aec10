# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Write a run as one HTML page that needs nothing else: its linkage moving, plots, events, counts.

The page makes no request to anywhere. Of a long run it holds intervals with their least and
greatest values; --since and --until show a part of it in full. A bag that is damaged or not
finished is shown as far as it goes; a bag without a scene, by its joint states alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from functools import partial
from math import isfinite
import os
from pathlib import Path
from threading import Event
from typing import Any

from linkage_ros.bag import Bag, Layout, layout_of
from linkage_ros.cli import (
    add_bag,
    add_output,
    add_trust,
    bag_json,
    bag_tables,
    describe_gaps,
    open_bag,
    output_or,
    path_beside,
    scene_json,
    scene_of,
    show_progress,
    Table,
)
from linkage_ros.description import atomic_write, Scene, Units
from linkage_ros.errors import check_installed, LinkageError
from linkage_ros.signals import StoppedError
from linkage_ros.tools.view.report import (
    Progress,
    read_run,
    ReportedRun,
    ReportHeader,
    run_html,
    seconds_text,
    Window,
)

EXAMPLE = 'linkage report my_bag -o my_bag.html'

_MIB = 2**20


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_bag(parser)
    add_output(parser, ('.html', '.htm'), 'BAG.html')
    add_window(parser)


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Write the page."""
    file = output_or(arguments, path_beside(arguments.bag, '.html'))
    check_page(file)
    window = window_of(arguments.since, arguments.until)
    write_page(file, bag_page(arguments.bag, window, stop, trust_effects=arguments.trust_effects))
    return 0


def write_page(file: Path, page: str) -> None:
    """Write a page, and say how large it is."""
    # Undecodable bytes, of a file name for example, are written as escapes.
    data = page.encode('utf-8', 'backslashreplace')
    atomic_write(file, data)
    print(f'{file}: {len(data) / 1e6:.1f} MB')


def bag_page(bag_path: Path, window: Window, stop: Event, *, trust_effects: bool = False) -> str:
    """
    Return the page of a bag, or of a window of it; memory does not grow with the bag.

    ``trust_effects`` lets the scene's effects be imported. A LinkageError says that the bag cannot
    be read, or that plotly is not installed; a StoppedError that the event was set.
    """
    bag = open_bag(bag_path, stop)
    layouts = [layout_of(path) for path in bag.files]
    run, scene, missing = read_part(bag, layouts, window, stop, trust_effects=trust_effects)
    account = bag_json(bag, layouts, run.contents)
    account |= {'scene': None, 'scene_missing': None, 'replay': None}
    # A page is passed on to others: it shows the bag's name, not its path.
    if account['damage']:
        where, _, damage = account['damage'].partition(': ')
        account['damage'] = f'{Path(where).name}: {damage}'
    if scene is not None:
        account['scene'] = scene_json(scene)
    name = scene.name if scene is not None else bag_path.resolve().name
    page = run_html(
        run,
        ReportHeader(
            title=f'Run of {name}',
            facts=list(_run_facts(account, run, scene)),
            warnings=list(_find_warnings(bag, account, run, scene, missing)),
            tables=_page_tables(account),
            wrapped=scene is not None and scene.wrapped,
            units=scene.units if scene is not None else Units(),
        ),
    )
    _raise_if_stopped(stop)
    return page


def _raise_if_stopped(stop: Event) -> None:
    if stop.is_set():
        raise StoppedError


def _page_tables(account: dict[str, Any]) -> list[Table]:
    bag, *others = bag_tables(account)
    return [bag._replace(title='Bag'), *others]


def _run_facts(
    account: dict[str, Any], run: ReportedRun, scene: Scene | None
) -> Iterator[tuple[str, str]]:
    yield 'bag', Path(account['bag']).resolve().name
    if account['begin']:
        yield 'begun', account['begin']
        yield 'duration', f'{account["duration_ns"] / 1e9:.6f} s'
    since, until = run.window
    if since > 0 or until < run.end:
        yield 'part', f'{seconds_text(since)} s to {seconds_text(min(until, run.end))} s'
    yield 'messages', f'{account["messages"]:,}'
    if scene is not None:
        yield 'ticks', f'{scene.rate:g} a second' if scene.rate else 'one a sample'
    version = account['versions']['linkage_ros']
    if version:
        yield 'recorded by', f'linkage_ros {version}'


def _find_warnings(
    bag: Bag, account: dict[str, Any], run: ReportedRun, scene: Scene | None, missing: str
) -> Iterator[str]:
    """Yield the missing or damaged parts of a run."""
    if missing and scene is None:
        yield f'No scene of linkage_ros, so no linkage: {missing}.'
    elif missing:
        yield f'The scene was not run again, so no linkage: {missing}.'
    if not account['messages']:
        yield 'The bag holds no messages.'
    if account['damage']:
        yield f'Damaged: {account["damage"]}; the page shows what lies before.'
    if account['unfinished']:
        yield f'Unfinished: {account["unfinished"]}; the page shows what it holds.'
    if account['recording_failure']:
        yield f'The recording failed: {account["recording_failure"]}.'
    if account['beginning_missing']:
        yield f'Not from the beginning: {account["beginning_missing"]}.'
    for gap in describe_gaps(bag):
        yield f'{gap[:1].upper()}{gap[1:]}.'
    if account['messages'] and run.window.since > run.end:
        yield f'The part begins after the end of the run, at {seconds_text(run.end)} s.'


def check_page(file: Path) -> None:
    """Raise if a page could not be written, before it is made."""
    check_installed('plotly')
    # `Path.is_dir` raises for a name that is too long.
    if os.path.isdir(file):  # noqa: PTH112
        raise LinkageError(file, 'is a folder', 'name another file with -o')
    if not os.path.isdir(file.absolute().parent):  # noqa: PTH112
        raise LinkageError(file, 'lies in no folder that there is', 'name another file with -o')


def add_window(parser: argparse.ArgumentParser) -> None:
    """Declare the options for a part of a run, and the one for the effects of its scene."""
    for name, end in (('since', 'beginning'), ('until', 'end')):
        parser.add_argument(
            f'--{name}',
            type=float,
            metavar='SECONDS',
            help=f'{end} of a part, in seconds of the run',
        )
    add_trust(parser)


def window_of(since: float | None, until: float | None) -> Window:
    """
    Return the part of a run between two times, in [s].

    A LinkageError is raised if they are not times, or in the wrong order.
    """
    ends = []
    for option, value, default in (('--since', since, 0), ('--until', until, Window().until)):
        if value is not None and (not isfinite(value) or not 0.0 <= value < 1e9):
            raise LinkageError(
                option, f'{value} is not a time in a run', 'write seconds from 0 on'
            )
        ends.append(default if value is None else round(value * 1e9))
    if ends[0] >= ends[1]:
        raise LinkageError('--until', f'{until} is not after --since', 'write a later one')
    return Window(*ends)


def read_part(
    bag: Bag,
    layouts: Sequence[Layout],
    window: Window,
    stop: Event,
    *,
    trust_effects: bool = False,
) -> tuple[ReportedRun, Scene | None, str]:
    """
    Read a part of a run; see `read_run`. The layouts of its files say how much there is to read.

    A LinkageError is raised if the bag cannot be read, a StoppedError if the event was set.
    """
    size = max(1, sum(layout.content for layout in layouts) // _MIB)
    with show_progress('read [MiB]') as advance:
        run = read_run(
            bag,
            window,
            Progress(lambda read: advance(read // _MIB, max(size, read // _MIB)), stop.is_set),
            partial(scene_of, trust_effects=trust_effects),
        )
    if stop.is_set():
        raise StoppedError
    return run
