# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Read a part of a recorded run for a command: with progress, up to damage or Ctrl-C."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from math import isfinite
from threading import Event

from linkage_ros.bag import Bag, Layout
from linkage_ros.cli import add_trust, scene_of, show_progress
from linkage_ros.description import Scene
from linkage_ros.errors import LinkageError
from linkage_ros.signals import StoppedError
from linkage_ros.tools.view.report import Progress, read_run, ReportedRun, Window

_MIB = 2**20


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
        found = read_run(
            bag,
            window,
            Progress(lambda read: advance(read // _MIB, max(size, read // _MIB)), stop.is_set),
            partial(scene_of, trust_effects=trust_effects),
        )
    if stop.is_set():
        raise StoppedError
    return found
