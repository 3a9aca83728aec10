# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Runs by the node's own tick loop, without ROS, and what a report reads of their bags."""

from collections.abc import Callable, Iterable, Sequence
import json
from pathlib import Path
from typing import Any, NamedTuple

from linkage_ros.bag import Bag, BagMessage, BagWriter, read_bag
from linkage_ros.messages import JointStateWriter
from linkage_ros.tools.view.report import (
    event_tracks,
    Progress,
    read_run,
    ReportedRun,
    ReportHeader,
    run_html,
    Window,
)
import numpy as np
import pytest

from ....node.ticked import Moment, run
from ....support.messages import STORE

MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000
FOUR_BAR = 'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n'
TYPES = STORE.types


def sample(stamp: float, angle: float, rate: float = 7.0, joint: str = 'crank_joint') -> bytes:
    """Return a crank's sample, stamped so many [ms] after the begin."""
    return JointStateWriter([joint]).write(BEGIN + round(stamp * MS), [angle], [rate])


class Said(NamedTuple):
    """What the node's diagnostics say of a task at a time, in [ms]; levels as in the message."""

    time: float
    task: str
    values: dict[str, object]
    level: int = 0
    message: str = ''
    node: str = 'linkage'


def diagnostics(said: Sequence[Said], little: bool = True) -> bytes:
    """Return a DiagnosticArray, by rosbags."""
    pair = TYPES['diagnostic_msgs/msg/KeyValue']
    status = TYPES['diagnostic_msgs/msg/DiagnosticStatus']
    statuses = [
        status(
            each.level, f'{each.node}: {each.task}', each.message, 'scene',
            [pair(key, str(value)) for key, value in each.values.items()],
        )
        for each in said
    ]  # fmt: skip
    kind = 'diagnostic_msgs/msg/DiagnosticArray'
    header = TYPES['std_msgs/msg/Header'](TYPES['builtin_interfaces/msg/Time'](1, 2), '')
    message = TYPES[kind](header, statuses)
    return bytes(STORE.serialize_cdr(message, kind, little_endian=little))


def turning(tick: int) -> Moment:
    """Return a tick at 1 kHz and a sample of a crank that turns at 7 rad/s, of its instant."""
    return Moment(BEGIN + tick * MS, (sample(tick, 0.007 * tick),))


def recorded(
    folder: Path,
    scene: str = '',
    moments: Iterable[Moment] | None = None,
    linkage: str = FOUR_BAR,
    said: Sequence[Said] = (),
) -> Bag:
    """Return the bag of a run: a second of `turning` where nothing else is said."""
    (folder / 'l.yaml').write_text(linkage)
    (folder / 's.yaml').write_text(scene if 'linkages:' in scene else f'linkage: l.yaml\n{scene}')
    ticks = map(turning, range(1000)) if moments is None else moments
    bag = run(folder / 'bag', folder / 's.yaml', ticks).bag
    more = [
        (BEGIN + round(each.time * MS), BagMessage('/diagnostics', 0, 0, diagnostics([each])))
        for each in said
    ]
    return with_more(bag, folder / 'more', more) if said else bag


def with_more(bag: Bag, folder: Path, more: Sequence[tuple[int, BagMessage]]) -> Bag:
    """Return a bag with more messages: each before the first that is recorded later."""
    numbers = {each.name: index for index, each in enumerate(bag.topics)}
    attached = {name: ('', data) for name, data in bag.attachments.items()}
    writer = BagWriter(folder, bag.topics, attached)
    waiting = sorted(more, key=lambda each: each[0])
    for message in bag.messages():
        while waiting and waiting[0][0] <= message.log_time:
            time, other = waiting.pop(0)
            writer.write(numbers[other.topic], time, time, other.data)
        writer.write(numbers[message.topic], *message[1:])
    for time, other in waiting:
        writer.write(numbers[other.topic], time, time, other.data)
    writer.close()
    return read_bag(writer.folder)


def from_then_on(bag: Bag, folder: Path, begin: float) -> Bag:
    """Return a bag that says that it begins in mid-run, at a time of the whole one in [ms]."""
    numbers = {each.name: index for index, each in enumerate(bag.topics)}
    attached = {name: ('', data) for name, data in bag.attachments.items()}
    attached['run.json'] = ('', attached['run.json'][1].replace(b'{', b'{"begun": "mid-run", ', 1))
    writer = BagWriter(folder, bag.topics, attached)
    for message in bag.messages():
        if message.log_time >= BEGIN + round(begin * MS):
            writer.write(numbers[message.topic], *message[1:])
    writer.close()
    return read_bag(writer.folder)


def read(bag: Bag, window: Window | None = None) -> ReportedRun:
    """Return what a report reads of a bag of a scene."""
    found, scene, missing = read_run(bag, window or Window(), Progress())
    assert scene is not None, missing
    return found


def on_lanes(found: ReportedRun) -> dict[str, list[tuple[float, float, int, str]]]:
    """Return what happened, lane by lane: begin and end in [ms], how often, and what."""
    return {
        key: [(s.begin / MS, s.end / MS, s.count, s.text) for s in lane.in_order]
        for key, lane in event_tracks(found).items()
    }


def curve(found: ReportedRun, name: str, quantity: str) -> tuple[list[float], list[float]]:
    """Return times, in [ms], and values of a curve of which every row is there."""
    for curves in found.curves:
        for place, column in enumerate(curves.columns):
            if (column.name, column.quantity) == (name, quantity):
                assert curves.intervals.rows == 1
                values = curves.intervals.first[:, place]
                told = ~np.isnan(values)
                times = curves.intervals.begins[told] / MS
                return times.tolist(), values[told].tolist()
    return [], []


def but(ticks: int, changed: Callable[[int, Moment], Moment | None]) -> list[Moment]:
    """Return so many ticks of `turning`, each as it is changed; nothing: it never was."""
    moments = (changed(tick, turning(tick)) for tick in range(ticks))
    return [moment for moment in moments if moment is not None]


def page_of_run(found: ReportedRun, header: ReportHeader | None = None) -> str:
    """Return the page of a run, without what its bag has beside it."""
    return run_html(found, header or ReportHeader('t', [], [], []))


def data_of(page: str) -> dict[str, Any]:
    """Return the data of a page; no number of it is NaN or infinite."""
    text = page.split('id="data">')[1].split('</script>', maxsplit=1)[0]
    data: dict[str, Any] = json.loads(text, parse_constant=pytest.fail)
    return data
