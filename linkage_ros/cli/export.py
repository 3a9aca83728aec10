# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Write the joints of a bag to a CSV, xlsx or Parquet file, a row for each tick.

A row has the joint states and, where they were recorded, the accelerations of ~/motion and the
forces of ~/pin_forces, in the units of the scene's file. The crank's samples have other times:
--topic writes them to a separate table, as any other topic of joint states, trajectories of one
point, or wrenches. From a foreign bag the only topic of joint states is written, in SI units.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
import sys
from threading import Event
from typing import NamedTuple

from linkage_ros.bag import Bag, layout_of, REPORT_EVERY
from linkage_ros.cli.arguments import add_bag, add_output
from linkage_ros.cli.bag_reading import open_bag, run_or_blank, unfinished_text
from linkage_ros.cli.terminal import show_progress
from linkage_ros.description import (
    block_rows,
    check_kind,
    Scene,
    table_file,
    TABLE_KINDS,
    Units,
)
from linkage_ros.errors import BagError, did_you_mean, escape_unprintable, LinkageError, list_names
from linkage_ros.messages import (
    FORCE_X,
    IN_SPACE,
    JOINT_STATE_TYPE,
    Key,
    MessageContent,
    MessageValues,
    POSITION,
    QUANTITIES,
    TYPES,
    unit_in_si,
)
from linkage_ros.replay import own_joint_states, recorded_scene, turning_joints
from linkage_ros.signals import StoppedError

# Each tick, or each message of one topic, becomes a row.
#
# The joint states, motions and pin forces of a tick follow each other in the bag and share one
# publish time: together they make one row. A joint may appear late, so a first pass collects the
# columns. A second pass writes the rows, so that only one row is in memory.

TIME, STAMP, PUBLISHED, LOGGED = 'time [s]', 'stamp [ns]', 'publish time [ns]', 'log time [ns]'
"""
The first columns: time since the first row's stamp, the stamp of the message, the time that was
solved for or at which the source sent the message, and the time of the tick that received or
published it.
"""

_MOST_COLUMNS = 10_000
_FIRST_OF_PINS = QUANTITIES.index(FORCE_X)

Row = list[float | int | None]
ProgressCallback = Callable[[int], None]

_MIB = 2**20

EXAMPLE = 'linkage export my_bag -o my_bag.csv'


class ExportSource(NamedTuple):
    """The origin of the rows."""

    bag: Bag  # The bag
    types: Mapping[str, str]  # The topics, each with its type
    closing: Collection[str]  # Topics whose messages end the row of a tick
    # For each topic that also carries other messages, the test that selects messages of the rows.
    wanted: Mapping[str, Callable[[bytes], bool]]
    # Names of dependent joints, which nobody can command; see `MessageValues`.
    dependent: Collection[str] = ()


class ExportResult(NamedTuple):
    """
    Result of the first pass: columns beyond the first four, and number of rows.

    Messages in the rows are counted by topic; messages left out by topic and reason.
    """

    keys: tuple[Key, ...]
    rows: int
    counts: Mapping[str, int]
    left_out: Mapping[tuple[str, str], int]


class _ExportTick(NamedTuple):
    """The messages of a tick, by topic, with its publish time and log time."""

    published: int
    logged: int
    messages: dict[str, MessageContent]


def survey_columns(
    source: ExportSource, order: Sequence[str], report_progress: ProgressCallback
) -> ExportResult:
    """
    Collect the columns of the rows (first pass).

    The joints in ``order`` come first; others follow in the order of the bag. ``report_progress``
    receives the number of bytes read; an exception from it ends the pass. A BagError says that the
    bag is damaged, or that new joint names keep coming.
    """
    columns: dict[Key, None] = {}
    # For each layout of a message its numbers of a joint in space, which have a column if not 0.
    known: dict[tuple[Key, ...], list[tuple[int, Key]]] = {}
    counts: Counter[str] = Counter()
    left_out: Counter[tuple[str, str]] = Counter()
    rows = 0
    for tick in _read_ticks(source, left_out, report_progress):
        rows += 1
        for topic, values in tick.messages.items():
            counts[topic] += 1
            if values.keys not in known:
                keys = enumerate(values.keys)
                known[values.keys] = [key for key in keys if key[1][1] in IN_SPACE]
                columns |= dict.fromkeys(key for key in values.keys if key[1] not in IN_SPACE)
                if max(len(columns), len(known)) > _MOST_COLUMNS:
                    raise BagError(
                        source.bag.path,
                        f'its joints take more than {_MOST_COLUMNS} columns',
                        'name one topic with --topic',
                    )
            for index, key in known[values.keys]:
                if values.numbers[index]:
                    columns[key] = None
    return ExportResult(_sort_columns(columns, order), rows, counts, left_out)


def _sort_columns(keys: Iterable[Key], order: Sequence[str]) -> tuple[Key, ...]:
    """Sort the columns by quantity, then joint; force and torque of a pin stay together."""
    keys = tuple(keys)
    names = dict.fromkeys([*order, *(name for name, _ in keys)])
    ranks = {name: rank for rank, name in enumerate(names)}

    def rank(key: Key) -> tuple[int, int, int]:
        name, quantity = key
        number = QUANTITIES.index(quantity)
        return min(number, _FIRST_OF_PINS), ranks[name], number

    return tuple(sorted(keys, key=rank))


def rows_of(
    source: ExportSource, keys: Sequence[Key], report_progress: ProgressCallback
) -> Iterator[Row]:
    """Yield the rows of a bag: the first four columns, and the numbers under these keys."""
    places = {key: 4 + index for index, key in enumerate(keys)}
    placed: dict[tuple[Key, ...], tuple[int | None, ...]] = {}
    blank: Row = [None] * len(keys)
    begin: int | None = None
    for published, logged, messages in _read_ticks(source, Counter(), report_progress):
        stamp = next(iter(messages.values())).stamp
        if begin is None:
            begin = stamp
        row: Row = [(stamp - begin) / 1_000_000_000, stamp, published, logged, *blank]
        for values in messages.values():
            columns = placed.get(values.keys)
            if columns is None:
                columns = placed[values.keys] = tuple(map(places.get, values.keys))
            # ~/motion repeats the joint state; it counts only where the joint state was dropped.
            for column, number in zip(columns, values.numbers, strict=True):
                if column is not None and row[column] is None:
                    row[column] = number
        yield row


def _read_ticks(
    source: ExportSource, left_out: Counter[tuple[str, str]], report_progress: ProgressCallback
) -> Iterator[_ExportTick]:
    """Yield the ticks of a bag; count the messages that are left out."""
    readers = {
        topic: MessageValues(kind, source.dependent) for topic, kind in source.types.items()
    }
    closing, wanted = source.closing, source.wanted
    tick: _ExportTick | None = None
    read = 0
    for number, (topic, logged, published, data) in enumerate(source.bag.messages(), 1):
        read += len(data)
        if not number % REPORT_EVERY:
            report_progress(read)
        reader = readers.get(topic)
        values = reader.read(data) if reader is not None else None
        if isinstance(values, str):
            left_out[topic, values] += 1
        elif values is not None and (topic not in wanted or wanted[topic](data)):
            if tick is not None:
                if tick.published == published and topic not in tick.messages:
                    tick.messages[topic] = values
                    continue
                yield tick
            tick = _ExportTick(published, logged, {topic: values})
            continue
        if tick is not None and topic in closing:
            yield tick
            tick = None
    if tick is not None:
        yield tick


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_bag(parser)
    add_output(parser, TABLE_KINDS)
    parser.add_argument('--topic', help='the only topic to write, a row for each message')


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Write the file; return 1 if a signal stopped it."""
    try:
        result = export_bag(arguments.bag, arguments.output, arguments.topic, stop)
    except StoppedError:
        print('linkage export: stopped; nothing was written', file=sys.stderr)
        return 1
    for (topic, reason), count in result.left_out.items():
        line = f'linkage export: {topic}: {count} messages left out: {reason}'
        print(escape_unprintable(line), file=sys.stderr)
    of = ', '.join(
        f'{count} of {escape_unprintable(topic)}' for topic, count in result.counts.items()
    )
    print(f'{arguments.output}: {result.rows} rows, {4 + len(result.keys)} columns ({of})')
    return 0


def export_bag(bag_path: Path, file: Path, topic: str | None, stop: Event) -> ExportResult:
    """
    Write a bag's joints to a file, or replace it; memory does not grow with the bag.

    A ``topic`` is written alone; None for the joint states and what was published with them.
    StoppedError if the event was set; LinkageError if the bag cannot be read or has nothing to
    write, or if the file cannot be written.
    """
    check_kind(file)
    bag = open_bag(bag_path, stop)
    if bag.truncated:
        unfinished = f'unfinished: {unfinished_text(bag)}; its content is exported'
        print(f'linkage export: {bag_path}: {unfinished}', file=sys.stderr)
    scene = _scene_or_none(bag)
    source = _choose_topics(bag, scene, topic)
    turning = turning_joints(scene) if scene is not None else {}
    units = scene.units if scene is not None else Units()

    def bounded_progress(advance: Callable[[int, int], None], of: int) -> Callable[[int], None]:
        def report_read(read: int) -> None:
            if stop.is_set():
                raise StoppedError
            advance(read // _MIB, max(of, read // _MIB))

        return report_read

    size = sum(layout_of(path).content for path in bag.files) // _MIB
    with show_progress('columns looked for [MiB]') as advance:
        survey = survey_columns(
            source, [] if scene is None else scene.joint_names, bounded_progress(advance, size)
        )
    if not survey.rows:
        raise _nothing_error(source, survey)
    columns = [shown_unit(units, unit_in_si(key, turning)) for key in survey.keys]
    heads = [
        TIME,
        STAMP,
        PUBLISHED,
        LOGGED,
        *(_column_heading(key, unit) for key, (unit, _) in zip(survey.keys, columns, strict=True)),
    ]
    converted = [(place, unit) for place, (_, unit) in enumerate(columns, 4) if unit != 1.0]
    with (
        table_file(file, heads, (STAMP, PUBLISHED, LOGGED)) as write,
        show_progress('written [MiB]') as advance,
    ):
        rows = rows_of(source, survey.keys, bounded_progress(advance, size))
        while block := list(islice(rows, block_rows(len(heads)))):
            for row in block if converted else ():
                for place, factor in converted:
                    value = row[place]
                    if value is not None:
                        row[place] = value / factor
            write(block)
    return survey


def shown_unit(units: Units, unit: str) -> tuple[str, float]:
    """
    Return the unit of a column for a unit in SI, and how many in SI are one of it.

    Of a joint that the scene does not know, 'rad or m', the unit stays.
    """
    if ' or ' in unit:
        return unit, 1.0
    return units.file_unit(unit), units.si_per_unit(unit)


def _scene_or_none(bag: Bag) -> Scene | None:
    """Return the scene in a bag; None if there is none that this version can read."""
    try:
        return recorded_scene(bag)
    except LinkageError:
        return None


def _choose_topics(bag: Bag, scene: Scene | None, topic: str | None) -> ExportSource:
    """Return the topics to write: as asked for, or as the bag names them."""
    types = {topic.name: topic.type for topic in bag.topics}
    readable = {name: kind for name, kind in types.items() if kind in TYPES}
    run = run_or_blank(bag)
    if topic is not None:
        others = f'name {list_names(readable, " or ") or "another bag"}'
        if topic not in types:
            raise BagError(
                bag.path, f'holds no topic {topic}', did_you_mean(topic, readable, others)
            )
        if topic not in readable:
            raise BagError(
                bag.path, f'{topic} is of {types[topic]}, which is not about joints', others
            )
        # A crank command may name dependent joints without a value for them.
        dependent: frozenset[str] = frozenset()
        if scene is not None and topic == run.crank_topic:
            dependent = scene.dependent_joints
        return ExportSource(bag, {topic: types[topic]}, (), {}, dependent)
    joint_states = run.joint_states_topic
    if joint_states not in readable:
        joint_states = _only_joint_states(bag, readable)
        return ExportSource(bag, {joint_states: JOINT_STATE_TYPE}, (), {})
    written = [joint_states, *(name for name in run.extras if name in readable)]
    wanted = {}
    if scene is not None and run.crank_topic == joint_states:
        wanted[joint_states] = own_joint_states(scene)
    return ExportSource(
        bag,
        {name: types[name] for name in written},
        {run.crank_topic, run.faults_topic, run.withheld_topic, run.resets_topic},
        wanted,
    )


def _only_joint_states(bag: Bag, readable: Mapping[str, str]) -> str:
    topics = [name for name, kind in readable.items() if kind == JOINT_STATE_TYPE]
    if len(topics) == 1:
        return topics[0]
    if topics:
        raise BagError(
            bag.path, f'holds joint states on {list_names(topics)}', 'name one with --topic'
        )
    raise BagError(
        bag.path,
        f'holds no topic of {JOINT_STATE_TYPE}',
        f'name {list_names(readable, " or ")} with --topic' if readable else 'name another bag',
    )


def _nothing_error(source: ExportSource, result: ExportResult) -> BagError:
    reasons = Counter(dict(result.left_out)).most_common(1)
    why = f' ({reasons[0][1]} left out: {reasons[0][0][1]})' if reasons else ''
    return BagError(
        source.bag.path,
        f'holds no message on {list_names(source.types)} to write{why}',
        'name another topic with --topic, or another bag',
    )


def _column_heading(key: Key, unit: str) -> str:
    """Return the heading of a column: joint, quantity and unit."""
    name, quantity = key
    return f'{name if quantity == POSITION else f"{name} {quantity}"} [{unit}]'
